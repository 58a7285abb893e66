# trajectory -> recordings, where they are asked for: the jobs that need them draw the same themselves.
# Read by all of them as a temporary file, it would run all of them again for an edit of one.


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
