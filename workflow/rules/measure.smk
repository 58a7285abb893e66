# trajectory -> recordings


rule measure_motion:
    input:
        model=out("models/{case}.json"),
        trajectory=out("trajectories/{case}.npz"),
    output:
        recordings=out("recordings/{case}/{protocol}/{cell}.npz"),
    log:
        log_of("measure_motion/{case}/{protocol}/{cell}"),
    benchmark:
        benchmark_of("measure_motion/{case}/{protocol}/{cell}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=lambda wildcards: {
            **noise_settings(wildcards),
            "code": script_code("measure_motion.py"),
        },
    message:
        "Measuring {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/measure_motion.py"
