# line + wind -> model


rule derive_model:
    output:
        model=out("models/{case}.json"),
    log:
        log_of("derive_model/{case}"),
    benchmark:
        benchmark_of("derive_model/{case}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=lambda wildcards: {
            "case": line_settings(wildcards.case),
            "code": script_code("derive_model.py"),
        },
    message:
        "Deriving the galloping equations of {wildcards.case}"
    script:
        "../scripts/derive_model.py"
