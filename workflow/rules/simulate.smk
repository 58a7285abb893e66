# model -> trajectory, and which further release would tell most


rule simulate_line:
    input:
        unpack(inputs("simulate_line")),
    output:
        trajectory=PATHS.trajectory,
    log:
        log_of("simulate_line/{case}"),
    benchmark:
        benchmark_of("simulate_line/{case}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("simulate_line"),
    message:
        "Simulating {wildcards.case}"
    script:
        "../scripts/simulate_line.py"


rule rank_releases:
    input:
        unpack(inputs("rank_releases")),
    output:
        ranking=PATHS.ranking,
    log:
        log_of("rank_releases/{case}"),
    benchmark:
        benchmark_of("rank_releases/{case}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("rank_releases"),
    message:
        "Which further recording of {wildcards.case} would help most"
    script:
        "../scripts/rank_releases.py"
