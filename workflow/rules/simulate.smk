# model -> trajectory


rule simulate_line:
    input:
        model=out("models/{case}.json"),
    output:
        trajectory=out("trajectories/{case}.npz"),
    log:
        log_of("simulate_line/{case}"),
    benchmark:
        benchmark_of("simulate_line/{case}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=lambda wildcards: {
            "releases": releases(wildcards.case),
            "duration": STUDY["simulation"]["duration"],
            "sampling_rate": STUDY["simulation"]["sampling_rate"],
            "code": script_code("simulate_line.py"),
        },
    message:
        "Simulating {wildcards.case}"
    script:
        "../scripts/simulate_line.py"
