# models, motions, tables -> figures (figures.smk)


rule draw_figure:
    input:
        unpack(lambda wildcards: files_of(FIGURES[wildcards.figure])),
    output:
        svg=report(
            "<results>/figures/{figure}.svg", category="Figures", labels={"figure": "{figure}"}
        ),
        png="<results>/figures/{figure}.png",
    log:
        "<logs>/draw_figure/{figure}.log",
    benchmark:
        "<benchmarks>/draw_figure/{figure}.tsv"
    wildcard_constraints:
        figure="|".join(FIGURES) or "none",
    conda:
        "../envs/galloping.yaml"
    params:
        function=lambda wildcards: {"function": FIGURES[wildcards.figure].function},
        names=lambda wildcards: names_of(FIGURES[wildcards.figure]),
        settings=lambda wildcards: {"settings": FIGURES[wildcards.figure].settings},
        look=setting("figures"),
        code=lambda wildcards: code("draw_figure.py", FIGURES[wildcards.figure].function),
    message:
        "Figure {wildcards.figure}"
    script:
        "../scripts/draw_figure.py"
