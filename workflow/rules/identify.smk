# trajectory -> recordings -> identified models, by all methods of a family


rule identify_models:
    input:
        trajectory="<results>/trajectories/{case}.npz",
    output:
        **add_receipts(models="<results>/identified/{case}/{protocol}/{cell}/{family}.json"),
    log:
        "<logs>/identify_models/{case}/{protocol}/{cell}/{family}.log",
    benchmark:
        "<benchmarks>/identify_models/{case}/{protocol}/{cell}/{family}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CELL_RESOURCES,
    params:
        measurement=lambda wildcards: {"measurement": cell(wildcards).measurement},
        degree=setting("identification.degree"),
        methods=lambda wildcards: {
            "identification": {m.name: STUDY.options(m) for m in methods_of(wildcards)}
        },
        code=lambda wildcards: code(
            "identify_models.py", *(each for m in methods_of(wildcards) for each in m.modules)
        ),
    message:
        "Identifying {wildcards.case} from {wildcards.protocol}, {wildcards.cell}: {wildcards.family}"
    script:
        "../scripts/identify_models.py"


# files of instruments -> model, forecast, summary


rule identify_recordings:
    input:
        files=lambda wildcards: recording(wildcards)["files"],
        mapping=lambda wildcards: recording(wildcards)["mapping"],
        beside=lambda wildcards: (  # the line of a case, where the recording names one
            f"<results>/models/{recording(wildcards)['case']}.json"
            if recording(wildcards)["case"]
            else []
        ),
    output:
        **add_receipts(
            made=[
                (
                    report(
                        f"<results>/recordings/{{recording}}/{file}",
                        caption=f"../report/field/{Path(file).stem}.rst",
                        category="Recordings",
                        labels={"recording": "{recording}", "file": file},
                    )
                    if file in REPORT_OUTPUTS
                    else f"<results>/recordings/{{recording}}/{file}"
                )
                for file in OUTPUTS
            ],
        ),
    log:
        "<logs>/identify_recordings/{recording}.log",
    benchmark:
        "<benchmarks>/identify_recordings/{recording}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CELL_RESOURCES,
    params:
        question=lambda wildcards: {
            f"recordings.{wildcards.recording}": {
                key: recording(wildcards)[key] for key in ("degree", "method", "known", "seed")
            }
        },
        case=lambda wildcards: {"case": recording(wildcards)["case"]},
        code=lambda wildcards: code("identify_recordings.py"),
    message:
        "Identifying the recordings of {wildcards.recording}"
    script:
        "../scripts/identify_recordings.py"
