# scores, bounds -> tables, and their differences from the reference


rule make_table:
    input:
        unpack(inputs("make_table")),
    output:
        table=PATHS.table,
    log:
        log_of("make_table/{table}"),
    benchmark:
        benchmark_of("make_table/{table}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("make_table"),
    message:
        "Table {wildcards.table}"
    script:
        "../scripts/make_table.py"


rule compare_reference:
    input:
        unpack(inputs("compare_reference")),
    output:
        summary=PATHS.table.format(table="reference_summary"),
        differences=PATHS.table.format(table="reference_differences"),
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
