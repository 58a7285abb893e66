# figures, tables -> one page


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
            "introduction": captions(".", "introduction")["introduction"],
            "captions": {
                "figures": captions("figures", *FIGURES, jobs.ANIMATION),
                "tables": captions("tables", *TABLES, *jobs.COMPARISONS),
            },
        },
    message:
        "Report"
    script:
        "../scripts/write_report.py"
