# identified models, the Cramer-Rao bound, and oracles of pysindy's settings -> scores


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


rule find_oracle:
    input:
        unpack(inputs("find_oracle")),
    output:
        scores=PATHS.oracle,
    log:
        log_of(f"find_oracle/{CELL}"),
    benchmark:
        benchmark_of(f"find_oracle/{CELL}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("find_oracle"),
    message:
        "Best settings of pysindy for {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/find_oracle.py"
