# trajectory -> recordings, where they are asked for: identification draws the same by itself


rule measure_motion:
    input:
        trajectory="<results>/trajectories/{case}.npz",
    output:
        recordings="<results>/recordings/{case}/{protocol}/{cell}.npz",
    log:
        "<logs>/measure_motion/{case}/{protocol}/{cell}.log",
    benchmark:
        "<benchmarks>/measure_motion/{case}/{protocol}/{cell}.tsv"
    conda:
        "../envs/galloping.yaml"
    params:
        measurement=lambda wildcards: {"measurement": cell(wildcards).measurement},
        code=lambda wildcards: code("measure_motion.py"),
    message:
        "Measuring {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/measure_motion.py"
