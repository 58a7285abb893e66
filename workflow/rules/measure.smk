# trajectory -> recordings, where they are asked for: identification draws the same by itself


rule measure_motion:
    input:
        unpack(inputs("measure_motion")),
    output:
        recordings=PATHS.recordings,
    log:
        log_of(f"measure_motion/{CELL}"),
    benchmark:
        benchmark_of(f"measure_motion/{CELL}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("measure_motion"),
    message:
        "Measuring {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/measure_motion.py"
