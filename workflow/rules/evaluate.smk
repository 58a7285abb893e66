# identified models -> scores


rule evaluate_model:
    input:
        model=out("models/{case}.json"),
        trajectory=out("trajectories/{case}.npz"),
        identified=out("identified/{case}/{protocol}/{cell}/{method}.npz"),
        bounds=out("bounds/{case}/{protocol}/{cell}.npz"),
    output:
        scores=out("scores/{case}/{protocol}/{cell}/{method}.csv"),
        motion=out("reconstructions/{case}/{protocol}/{cell}/{method}.npz"),
    log:
        log_of("evaluate_model/{case}/{protocol}/{cell}/{method}"),
    benchmark:
        benchmark_of("evaluate_model/{case}/{protocol}/{cell}/{method}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=lambda wildcards: {
            **cell_settings(wildcards.case, wildcards.cell),
            "degree": STUDY["identification"]["degree"],
            "steady_window": STUDY["simulation"]["steady_window"],
            "code": script_code("evaluate_model.py"),
        },
    message:
        "Evaluating {wildcards.method} on {wildcards.case}, {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/evaluate_model.py"
