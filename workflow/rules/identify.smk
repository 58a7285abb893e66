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
    params:
        settings={
            "degree": STUDY["identification"]["degree"],
            "code": script_code("reduce_recordings.py"),
        },
    message:
        "Reducing the recordings of {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/reduce_recordings.py"


def method_settings(wildcards):
    """What one method reads of the settings: editing another's keys reruns nothing here."""
    identification = STUDY["identification"]
    method = BY_NAME[wildcards.method]
    available = {
        **identification,
        "threshold": identification["thresholds"].get(method.name),
    }
    return {
        "degree": identification["degree"],
        "options": {key: available[key] for key in method.options if key in available},
        "seed": STUDY["measurement"]["seed"],
        "code": script_code("identify_model.py", method.module),
    }


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
    params:
        settings=method_settings,
    message:
        "Identifying {wildcards.case} by {wildcards.method} from {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/identify_model.py"
