# models, motions, tables -> figures


rule draw_figure:
    input:
        unpack(inputs("draw_figure")),
    output:
        svg=PATHS.figure.replace("{form}", "svg"),
        png=PATHS.figure.replace("{form}", "png"),
    log:
        log_of("draw_figure/{figure}"),
    benchmark:
        benchmark_of("draw_figure/{figure}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("draw_figure"),
    message:
        "Figure {wildcards.figure}"
    script:
        "../scripts/draw_figure.py"
