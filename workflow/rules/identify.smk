# recordings -> identified models


rule reduce_recordings:
    input:
        recordings=out("recordings/{case}/{protocol}/{cell}.npz"),
    output:
        reduced=out("reduced/{case}/{protocol}/{cell}.npz"),
    log:
        log_of("reduce_recordings/{case}/{protocol}/{cell}"),
    benchmark:
        benchmark_of("reduce_recordings/{case}/{protocol}/{cell}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "degree": STUDY["identification"]["degree"],
            "code": script_code("reduce_recordings.py"),
        },
    message:
        "Reducing the recordings of {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/reduce_recordings.py"


rule identify_model:
    input:
        evidence=lambda wildcards: out(
            f"{BY_NAME[wildcards.method].evidence}/{{case}}/{{protocol}}/{{cell}}.npz"
        ),
    output:
        models=out("identified/{case}/{protocol}/{cell}/{method}.npz"),
    log:
        log_of("identify_model/{case}/{protocol}/{cell}/{method}"),
    benchmark:
        benchmark_of("identify_model/{case}/{protocol}/{cell}/{method}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=method_settings,
    message:
        "Identifying {wildcards.case} by {wildcards.method} from {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/identify_model.py"
