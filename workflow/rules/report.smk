# scores, bounds, motions -> tables (tables.smk), figures (figures.smk) -> one page


rule make_table:
    input:
        unpack(lambda wildcards: TABLES[wildcards.table].input),
    output:
        **add_receipts(table=table_in_report("{table}")),
    log:
        "<logs>/make_table/{table}.log",
    benchmark:
        "<benchmarks>/make_table/{table}.tsv"
    wildcard_constraints:
        table="|".join(TABLES),
    conda:
        "../envs/galloping.yaml"
    resources:
        **SHOW_RESOURCES,
    params:
        function=lambda wildcards: {"function": TABLES[wildcards.table].function},
        names=lambda wildcards: {"names": TABLES[wildcards.table].names},
        settings=lambda wildcards: {"settings": TABLES[wildcards.table].settings},
        caption=lambda wildcards, output: captions_of_tables(wildcards.table),
        code=lambda wildcards: code("make_table.py", TABLES[wildcards.table].function),
    message:
        "Table {wildcards.table}"
    script:
        "../scripts/make_table.py"


COMPARED_TABLES = [name for name in TABLES if name not in UNCOMPARED_TABLES]
SENSOR_PROTOCOL = shown.sensor_protocol(STUDY)  # protocol in the report's sentences
# settings without effect on numbers
UNCOMPARED_SETTINGS = ("results", "reference", "recordings", "figures")


rule compare_reference:
    input:
        tables=expand("<results>/tables/{table}.csv", table=COMPARED_TABLES),
        reference=reference_files(*(f"{name}.csv" for name in COMPARED_TABLES)),
        origin=reference_files("origin.json"),
    output:
        **add_receipts(
            summary=table_in_report("reference_summary"),
            differences=table_in_report("reference_differences"),
        ),
    log:
        "<logs>/compare_reference.log",
    benchmark:
        "<benchmarks>/compare_reference.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **SHOW_RESOURCES,
    params:
        study={
            "study": {k: v for k, v in STUDY.plain.items() if v and k not in UNCOMPARED_SETTINGS}
        },
        caption=lambda wildcards, output: captions_of_tables(*COMPARISONS),
        code=lambda wildcards: code("compare_reference.py"),
    message:
        "Tables beside the reference"
    script:
        "../scripts/compare_reference.py"


rule draw_figure:
    input:
        unpack(lambda wildcards: FIGURES[wildcards.figure].input),
    output:
        **add_receipts(
            svg=report(
                "<results>/figures/{figure}.svg",
                caption=CAPTION,
                category="Figures",
                labels=lambda wildcards: {
                    "figure": wildcards.figure,
                    "shows": FIGURES[wildcards.figure].label,
                },
            ),
            png="<results>/figures/{figure}.png",
        ),
    log:
        "<logs>/draw_figure/{figure}.log",
    benchmark:
        "<benchmarks>/draw_figure/{figure}.tsv"
    wildcard_constraints:
        figure="|".join(FIGURES) or "none",
    conda:
        "../envs/galloping.yaml"
    resources:
        **SHOW_RESOURCES,
    params:
        function=lambda wildcards: {"function": FIGURES[wildcards.figure].function},
        names=lambda wildcards: {"names": FIGURES[wildcards.figure].names},
        settings=lambda wildcards: {"settings": FIGURES[wildcards.figure].settings},
        look=setting("figures"),
        caption=lambda wildcards, output: caption_of_figure(wildcards.figure),
        code=lambda wildcards: code("draw_figure.py", FIGURES[wildcards.figure].function),
    message:
        "Figure {wildcards.figure}"
    script:
        "../scripts/draw_figure.py"


INTRODUCTIONS = ["introduction"] * bool(STUDY.cases) + list(
    dict.fromkeys("inference" if trial.table == PAPER else "trials" for trial in STUDY.trials)
)
SHOWN_TABLES = [*(name for name in TABLES if name not in HIDDEN_TABLES), *COMPARISONS]
ANIMATIONS = ["galloping"] if LINES else []
FIELD_PICTURES = [Path(file).stem for file in REPORT_OUTPUTS if file.endswith(".svg")]


rule write_report:
    input:
        figures=expand("<results>/figures/{figure}.svg", figure=FIGURES),
        animation=expand("<results>/figures/{name}.gif", name=ANIMATIONS),
        tables=expand("<results>/tables/{table}.csv", table=SHOWN_TABLES),
        recordings=expand(
            "<results>/recordings/{recording}/{file}",
            recording=STUDY.settings.recordings,
            file=REPORT_OUTPUTS,
        ),
        region=REGION_TABLE if Path(REGION_TABLE).exists() else [],
    output:
        **add_receipts(
            report=report(
                "<results>/report.html",
                caption="../report/page.rst",
                category="All on one page",
                labels={"page": "report"},
            ),
        ),
    log:
        "<logs>/write_report.log",
    benchmark:
        "<benchmarks>/write_report.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **SHOW_RESOURCES,
    params:
        labels={
            "labels": {name: what.label for name, what in FIGURES.items()}
            | dict.fromkeys(ANIMATIONS, ANIMATION_LABEL)
        },
        parts={
            "parts": {name: what.part for name, what in FIGURES.items()}
            | dict.fromkeys(ANIMATIONS, "engineering")
        },
        introduction=lambda wildcards: {
            "introduction": "\n".join(captions(".", *INTRODUCTIONS).values())
        },
        captions=lambda wildcards: {"captions": captions("figures", *FIGURES, *ANIMATIONS)},
        captions_of_recordings=lambda wildcards: {
            "captions_of_recordings": (
                captions("field", *FIELD_PICTURES) if STUDY.settings.recordings else {}
            )
        },
        headline={
            "headline": (
                {
                    "case": LINES[0],
                    "protocol": SENSOR_PROTOCOL.name,
                    "noise_unit": SENSOR_PROTOCOL.noise_unit(
                        STUDY.settings.measurement.state_noise == "relative"
                    ),
                }
                if LINES
                else {"case": "", "protocol": "", "noise_unit": ""}
            )
        },
        study={"study": STUDY.plain},
        code=lambda wildcards: code("write_report.py"),
    message:
        "Report"
    script:
        "../scripts/write_report.py"
