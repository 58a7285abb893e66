# trajectory -> recordings -> identified models, by all methods of a family


rule identify_models:
    input:
        unpack(inputs("identify_models")),
    output:
        models=PATHS.identified,
    log:
        log_of(f"identify_models/{CELL}/{{family}}"),
    benchmark:
        benchmark_of(f"identify_models/{CELL}/{{family}}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("identify_models"),
    message:
        "Identifying {wildcards.case} from {wildcards.protocol}, {wildcards.cell}: {wildcards.family}"
    script:
        "../scripts/identify_models.py"


# files of instruments -> model, forecast, summary


rule identify_recordings:
    input:
        unpack(inputs("identify_recordings")),
    output:
        expand(PATHS.field, file=OUTPUTS, allow_missing=True),
    log:
        log_of("identify_recordings/{recording}"),
    benchmark:
        benchmark_of("identify_recordings/{recording}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("identify_recordings"),
    message:
        "Identifying the recordings of {wildcards.recording}"
    script:
        "../scripts/identify_recordings.py"
