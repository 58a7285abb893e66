# identified models, and the Cramer-Rao bound -> scores


rule evaluate_cell:
    input:
        unpack(inputs("evaluate_cell")),
    output:
        bounds=PATHS.bounds,
        scores=PATHS.scores,
        reconstructions=PATHS.reconstructions,
    log:
        log_of(f"evaluate_cell/{CELL}"),
    benchmark:
        benchmark_of(f"evaluate_cell/{CELL}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("evaluate_cell"),
    message:
        "Evaluating {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/evaluate_cell.py"
