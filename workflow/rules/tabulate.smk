# scores, bounds -> tables, and their differences from the reference


rule make_table:
    input:
        unpack(inputs("make_table")),
    output:
        table=report(
            PATHS.table,
            caption="../report/caption.rst",
            category="Tables",
            labels={"table": "{table}"},
        ),
    log:
        log_of("make_table/{table}"),
    benchmark:
        benchmark_of("make_table/{table}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("make_table"),
        caption=caption("table"),
    message:
        "Table {wildcards.table}"
    script:
        "../scripts/make_table.py"


rule compare_reference:
    input:
        unpack(inputs("compare_reference")),
    output:
        summary=report(
            PATHS.table.format(table="reference_summary"),
            caption="../report/tables/reference_summary.rst",
            category="Tables",
            labels={"table": "reference_summary"},
        ),
        differences=report(
            PATHS.table.format(table="reference_differences"),
            caption="../report/tables/reference_differences.rst",
            category="Tables",
            labels={"table": "reference_differences"},
        ),
    log:
        log_of("compare_reference"),
    benchmark:
        benchmark_of("compare_reference")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("compare_reference"),
    message:
        "Tables beside the reference"
    script:
        "../scripts/compare_reference.py"
