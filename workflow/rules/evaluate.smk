# identified models -> scores


rule evaluate_cell:
    input:
        model=out("models/{case}.json"),
        trajectory=out("trajectories/{case}.npz"),
        bounds=out("bounds/{case}/{protocol}/{cell}.npz"),
        identified=lambda wildcards: expand(
            out("identified/{case}/{protocol}/{cell}/{method}.npz"),
            method=methods_of(wildcards.protocol, wildcards.cell),
            **wildcards,
        ),
    output:
        scores=out("scores/{case}/{protocol}/{cell}.csv"),
        motions=out("reconstructions/{case}/{protocol}/{cell}.npz"),
    log:
        log_of("evaluate_cell/{case}/{protocol}/{cell}"),
    benchmark:
        benchmark_of("evaluate_cell/{case}/{protocol}/{cell}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=lambda wildcards: {
            **cell_settings(wildcards.case, wildcards.cell),
            "methods": methods_of(wildcards.protocol, wildcards.cell),
            "degree": STUDY["identification"]["degree"],
            "steady_window": STUDY["simulation"]["steady_window"],
            "code": script_code("evaluate_cell.py"),
        },
    message:
        "Evaluating {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/evaluate_cell.py"
