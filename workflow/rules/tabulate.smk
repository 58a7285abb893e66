# scores, bounds -> tables (tables.smk), and their differences from the reference


rule make_table:
    input:
        unpack(lambda wildcards: files_of(TABLES[wildcards.table])),
    output:
        table=report("<results>/tables/{table}.csv", category="Tables", labels={"table": "{table}"}),
    log:
        "<logs>/make_table/{table}.log",
    benchmark:
        "<benchmarks>/make_table/{table}.tsv"
    wildcard_constraints:
        table="|".join(TABLES),
    conda:
        "../envs/galloping.yaml"
    params:
        function=lambda wildcards: {"function": TABLES[wildcards.table].function},
        names=lambda wildcards: names_of(TABLES[wildcards.table]),
        settings=lambda wildcards: {"settings": TABLES[wildcards.table].settings},
        code=lambda wildcards: code("make_table.py", TABLES[wildcards.table].function),
    message:
        "Table {wildcards.table}"
    script:
        "../scripts/make_table.py"


COMPARED = [name for name in TABLES if name not in NOT_COMPARED]
REFERENCE = Path(STUDY.settings.reference)
OTHERS = ("results", "reference", "recordings", "figures")  # on which no number depends


rule compare_reference:
    input:
        tables=expand("<results>/tables/{table}.csv", table=COMPARED),
        reference=[str(path) for name in COMPARED if (path := REFERENCE / f"{name}.csv").exists()],
        origin=[str(path) for path in [REFERENCE / "origin.json"] if path.exists()],
    output:
        summary="<results>/tables/reference_summary.csv",
        differences="<results>/tables/reference_differences.csv",
    log:
        "<logs>/compare_reference.log",
    benchmark:
        "<benchmarks>/compare_reference.tsv"
    conda:
        "../envs/galloping.yaml"
    params:
        study={"study": {k: v for k, v in STUDY.plain.items() if v and k not in OTHERS}},
        code=lambda wildcards: code("compare_reference.py"),
    message:
        "Tables beside the reference"
    script:
        "../scripts/compare_reference.py"
