# line, identified models -> what a line engineer asks


rule follow_cycles:
    output:
        cycles=PATHS.cycles,
        bifurcations=PATHS.bifurcations,
    log:
        log_of("follow_cycles/{case}/{sweep}"),
    benchmark:
        benchmark_of("follow_cycles/{case}/{sweep}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("follow_cycles"),
    message:
        "Limit cycles of {wildcards.case} along {wildcards.sweep}"
    script:
        "../scripts/follow_cycles.py"


rule simulate_sweep:
    output:
        block=update(PATHS.block),
    log:
        log_of("simulate_sweep/{case}/{sweep}/{block}"),
    benchmark:
        benchmark_of("simulate_sweep/{case}/{sweep}/{block}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("simulate_sweep"),
    message:
        "Simulating {wildcards.case} along {wildcards.sweep}, {wildcards.block}"
    script:
        "../scripts/simulate_sweep.py"


rule assess_line:
    input:
        unpack(inputs("assess_line")),
    output:
        clearance=PATHS.clearance,
        measures=PATHS.measures,
        orbits=PATHS.orbits,
    log:
        log_of("assess_line/{case}"),
    benchmark:
        benchmark_of("assess_line/{case}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("assess_line"),
    message:
        "Clearance of {wildcards.case}, and measures"
    script:
        "../scripts/assess_line.py"


rule predict_winds:
    input:
        unpack(inputs("predict_winds")),
    output:
        prediction=PATHS.prediction,
    log:
        log_of("predict_winds/{case}/{protocol}"),
    benchmark:
        benchmark_of("predict_winds/{case}/{protocol}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("predict_winds"),
    message:
        "Predicting {wildcards.case} by {wildcards.protocol} at other wind speeds"
    script:
        "../scripts/predict_winds.py"


rule redraw_paper:
    output:
        draws=PATHS.paper_draws,
    log:
        log_of("redraw_paper/{case}"),
    benchmark:
        benchmark_of("redraw_paper/{case}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("redraw_paper"),
    message:
        "The paper's study of {wildcards.case}, drawn again and again"
    script:
        "../scripts/redraw_paper.py"


rule vary_parameter:
    input:
        unpack(inputs("vary_parameter")),
    output:
        table=PATHS.openness,
    log:
        log_of("vary_parameter/{parameter}"),
    benchmark:
        benchmark_of("vary_parameter/{parameter}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("vary_parameter"),
    message:
        "Claims of the paper along {wildcards.parameter}"
    script:
        "../scripts/vary_parameter.py"


rule animate_line:
    output:
        animation=PATHS.animation,
    log:
        log_of("animate_line"),
    benchmark:
        benchmark_of("animate_line")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("animate_line"),
    message:
        "The first line, moving"
    script:
        "../scripts/animate_line.py"
