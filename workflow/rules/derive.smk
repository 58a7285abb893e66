# line + wind -> model


rule derive_model:
    output:
        model="<results>/models/{case}.json",
    log:
        "<logs>/derive_model/{case}.log",
    benchmark:
        "<benchmarks>/derive_model/{case}.tsv"
    conda:
        "../envs/galloping.yaml"
    params:
        line=line,
        code=lambda wildcards: code("derive_model.py"),
    message:
        "Deriving the galloping equations of {wildcards.case}"
    script:
        "../scripts/derive_model.py"
