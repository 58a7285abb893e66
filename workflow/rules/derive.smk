# line + wind -> model


rule derive_model:
    output:
        model=PATHS.model,
    log:
        log_of("derive_model/{case}"),
    benchmark:
        benchmark_of("derive_model/{case}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("derive_model"),
    message:
        "Deriving the galloping equations of {wildcards.case}"
    script:
        "../scripts/derive_model.py"
