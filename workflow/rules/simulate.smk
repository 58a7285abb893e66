# model -> trajectory


rule simulate_line:
    input:
        model=out("models/{case}.json"),
    output:
        trajectory=out("trajectories/{case}.npz"),
    params:
        settings=lambda wildcards: {
            "initial_state": STUDY["cases"][wildcards.case]["initial_state"],
            "duration": STUDY["simulation"]["duration"],
            "sampling_rate": STUDY["simulation"]["sampling_rate"],
            "code": script_code("simulate_line.py"),
        },
    log:
        log_of("simulate_line/{case}"),
    benchmark:
        benchmark_of("simulate_line/{case}")
    message:
        "Simulating {wildcards.case}"
    script:
        "../scripts/simulate_line.py"
