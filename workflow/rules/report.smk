# figures, tables -> one page
INTRODUCTIONS = ["introduction"] * bool(STUDY.cases) + list(
    dict.fromkeys("inference" if trial.kind.table == PAPER else "trials" for trial in STUDY.trials)
)
SHOWN_TABLES = [*(name for name in TABLES if name not in NOT_SHOWN), *COMPARISONS]
ANIMATED = ["galloping"] if LINES else []  # the only figure that is not drawn on paper


rule write_report:
    input:
        figures=expand("<results>/figures/{figure}.svg", figure=FIGURES),
        animation=expand("<results>/figures/{name}.gif", name=ANIMATED),
        tables=expand("<results>/tables/{table}.csv", table=SHOWN_TABLES),
        recordings=expand(
            "<results>/recordings/{recording}/{file}",
            recording=STUDY.settings.recordings,
            file=SHOWN_OF_FIELD,
        ),
    output:
        report="<results>/report.html",
    log:
        "<logs>/write_report.log",
    benchmark:
        "<benchmarks>/write_report.tsv"
    conda:
        "../envs/galloping.yaml"
    params:
        labels={
            "labels": {name: what.label for name, what in FIGURES.items()}
            | dict.fromkeys(ANIMATED, "the span, moving")
        },
        introduction=lambda wildcards: {
            "introduction": "\n".join(captions(".", *INTRODUCTIONS).values())
        },
        captions=lambda wildcards: {
            "captions": {
                "figures": captions("figures", *FIGURES, *ANIMATED),
                "tables": captions("tables", *SHOWN_TABLES),
            }
        },
        headline={
            "headline": (
                {"case": LINES[0], "protocol": shown.sensor_protocol(STUDY).name} if LINES else {}
            )
        },
        study={"study": STUDY.plain},
        code=lambda wildcards: code("write_report.py"),
    message:
        "Report"
    script:
        "../scripts/write_report.py"
