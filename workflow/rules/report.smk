# figures, tables -> one page
INTRODUCTIONS = ["introduction"] * bool(STUDY.cases) + list(
    dict.fromkeys("inference" if trial.kind.table == PAPER else "trials" for trial in STUDY.trials)
)


rule write_report:
    input:
        unpack(inputs("write_report")),
    output:
        report=PATHS.report,
    log:
        log_of("write_report"),
    benchmark:
        benchmark_of("write_report")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=lambda wildcards: {
            **settings("write_report")(wildcards),
            "introduction": "\n".join(captions(".", *INTRODUCTIONS).values()),
            "captions": {
                "figures": captions("figures", *FIGURES, jobs.ANIMATION),
                "tables": captions("tables", *TABLES, *tables.COMPARISONS),
            },
        },
    message:
        "Report"
    script:
        "../scripts/write_report.py"
