# models, motions, tables -> figures


rule draw_figure:
    input:
        unpack(inputs("draw_figure")),
    output:
        svg=report(
            PATHS.figure.replace("{form}", "svg"),
            caption="../report/caption.rst",
            category="Figures",
            labels=lambda wildcards: {"figure": FIGURES[wildcards.figure].label},
        ),
        png=PATHS.figure.replace("{form}", "png"),
    log:
        log_of("draw_figure/{figure}"),
    benchmark:
        benchmark_of("draw_figure/{figure}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("draw_figure"),
        caption=caption("figure"),
    message:
        "Figure {wildcards.figure}"
    script:
        "../scripts/draw_figure.py"
