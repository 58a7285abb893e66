# what any method could know: the Cramer-Rao bound of each cell


rule bound_cell:
    input:
        model=out("models/{case}.json"),
        trajectory=out("trajectories/{case}.npz"),
        recordings=out("recordings/{case}/{protocol}/{cell}.npz"),
    output:
        bounds=out("bounds/{case}/{protocol}/{cell}.npz"),
        models=out("identified/{case}/{protocol}/{cell}/bound.npz"),
    log:
        log_of("bound_cell/{case}/{protocol}/{cell}"),
    benchmark:
        benchmark_of("bound_cell/{case}/{protocol}/{cell}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=lambda wildcards: {
            **noise_settings(wildcards),
            "degree": STUDY["identification"]["degree"],
            "code": script_code("bound_cell.py"),
        },
    message:
        "Cramer-Rao bound of {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/bound_cell.py"


rule rank_releases:
    input:
        model=out("models/{case}.json"),
        trajectory=out("trajectories/{case}.npz"),
    output:
        ranking=out("bounds/{case}/further_recordings.csv"),
    log:
        log_of("rank_releases/{case}"),
    benchmark:
        benchmark_of("rank_releases/{case}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=lambda wildcards: {
            "level": STUDY["measurement"]["subsets"]["level"],
            "heights": [1.0, 2.0, 3.0],
            "code": script_code("rank_releases.py"),
        },
    message:
        "Which further recording of {wildcards.case} would help most"
    script:
        "../scripts/rank_releases.py"
