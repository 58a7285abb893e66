# line, identified models -> what a line engineer asks
# realisations of each variant of a line: enough to decide whether most satisfy a bound
MAX_VARIED_DRAWS = 40


rule follow_cycles:
    output:
        **add_receipts(
            cycles="<results>/sweeps/{case}/{sweep}/cycles.csv",
            bifurcations="<results>/sweeps/{case}/{sweep}/bifurcations.csv",
        ),
    log:
        "<logs>/follow_cycles/{case}/{sweep}.log",
    benchmark:
        "<benchmarks>/follow_cycles/{case}/{sweep}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CASE_RESOURCES,
    params:
        line=lambda wildcards: line_without(  # its tension bounds the motion of a galloping line
            wildcards.case, {sweep(wildcards).parameter} - {"tension"}
        ),
        parameter=of_sweep("parameter"),
        ends=of_sweep("ends"),
        code=lambda wildcards: code("follow_cycles.py"),
    message:
        "Limit cycles of {wildcards.case} along {wildcards.sweep}"
    script:
        "../scripts/follow_cycles.py"


rule simulate_sweep:
    output:
        simulated=update("<results>/sweeps/{case}/{sweep}/simulated/{block}.csv"),
        receipts=[update("<results>/sweeps/{case}/{sweep}/simulated/.{block}.csv.receipt")],
    log:
        "<logs>/simulate_sweep/{case}/{sweep}/{block}.log",
    benchmark:
        "<benchmarks>/simulate_sweep/{case}/{sweep}/{block}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CASE_RESOURCES,
    params:
        line=lambda wildcards: line_without(
            wildcards.case, {sweep(wildcards).parameter, sweep(wildcards).second}
        ),
        parameter=of_sweep("parameter"),
        values=lambda wildcards: {"values": list(sweep(wildcards).values)},
        second=of_sweep("second"),
        second_value=lambda wildcards: {"second_value": sweep(wildcards).blocks[wildcards.block]},
        code=lambda wildcards: code("simulate_sweep.py"),
    message:
        "Simulating {wildcards.case} along {wildcards.sweep}, {wildcards.block}"
    script:
        "../scripts/simulate_sweep.py"


rule assess_line:
    input:
        identified=models_of_a_line,
    output:
        **add_receipts(
            clearance="<results>/assessment/{case}/clearance.csv",
            measures="<results>/assessment/{case}/measures.csv",
            orbits="<results>/assessment/{case}/orbits.npz",
        ),
    log:
        "<logs>/assess_line/{case}.log",
    benchmark:
        "<benchmarks>/assess_line/{case}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CELL_RESOURCES,
    params:
        line=released,
        winds=setting("assessment.winds"),
        design_wind=setting("assessment.design_wind"),
        phase_distance=setting("assessment.phase_distance"),
        limit=setting("assessment.clearance"),
        chosen=setting("assessment.measures"),
        seed=setting("measurement.seed"),
        code=lambda wildcards: code("assess_line.py"),
    message:
        "Clearance of {wildcards.case}, and measures"
    script:
        "../scripts/assess_line.py"


rule predict_winds:
    input:
        identified=lambda wildcards: expand(
            "<results>/identified/{cell}/{family}.json",
            cell=recorded(wildcards).id,
            family=shown.families_of(recorded(wildcards)),
        ),
    output:
        **add_receipts(prediction="<results>/assessment/{case}/prediction_{protocol}.csv"),
    log:
        "<logs>/predict_winds/{case}/{protocol}.log",
    benchmark:
        "<benchmarks>/predict_winds/{case}/{protocol}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CELL_RESOURCES,
    params:
        line=released,
        winds=setting("assessment.winds"),
        methods=lambda wildcards: {"methods": shown.predicting_methods(recorded(wildcards))},
        seed=setting("measurement.seed"),
        code=lambda wildcards: code("predict_winds.py"),
    message:
        "Predicting {wildcards.case} by {wildcards.protocol} at other wind speeds"
    script:
        "../scripts/predict_winds.py"


rule redraw_paper:
    output:
        **add_receipts(draws="<results>/paper/{case}.csv"),
    log:
        "<logs>/redraw_paper/{case}.log",
    benchmark:
        "<benchmarks>/redraw_paper/{case}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CASE_RESOURCES,
    params:
        line=released,
        amounts=amounts(),
        number=setting("measurement.paper_replicates"),
        method=setting("identification.paper"),
        degree=setting("identification.degree"),
        seed=setting("measurement.seed"),
        code=lambda wildcards: code("redraw_paper.py"),
    message:
        "The paper's study of {wildcards.case}, drawn again and again"
    script:
        "../scripts/redraw_paper.py"


rule vary_parameter:
    input:
        drawn=f"<results>/paper/{VARIED_CASE}.csv",
    output:
        **add_receipts(claims="<results>/reproduction/{parameter}.csv"),
    log:
        "<logs>/vary_parameter/{parameter}.log",
    benchmark:
        "<benchmarks>/vary_parameter/{parameter}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CASE_RESOURCES,
    params:
        case={"case": VARIED_CASE},
        line=lambda wildcards: {f"cases.{VARIED_CASE}": STUDY.case(VARIED_CASE).released},
        values=lambda wildcards: setting(f"assessment.open_parameters.{wildcards.parameter}"),
        amounts=amounts(),
        number=lambda wildcards: {
            "measurement.paper_replicates": min(
                STUDY.settings.measurement.paper_replicates, MAX_VARIED_DRAWS
            )
        },
        method=setting("identification.paper"),
        degree=setting("identification.degree"),
        seed=setting("measurement.seed"),
        code=lambda wildcards: code("vary_parameter.py"),
    message:
        "Claims of the paper along {wildcards.parameter}"
    script:
        "../scripts/vary_parameter.py"


rule animate_line:
    input:
        trajectory=f"<results>/trajectories/{FIRST_CASE}.npz",
    output:
        **add_receipts(
            animation=report(
                "<results>/figures/galloping.gif",
                caption=CAPTION,
                category="Figures",
                labels={"figure": "galloping", "shows": ANIMATION_LABEL},
            ),
        ),
    log:
        "<logs>/animate_line.log",
    benchmark:
        "<benchmarks>/animate_line.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CASE_RESOURCES,
    params:
        case={"case": FIRST_CASE},
        line=lambda wildcards: {f"cases.{FIRST_CASE}": STUDY.case(FIRST_CASE).released},
        window=setting("simulation.steady_window"),
        caption=lambda wildcards, output: caption_of_figure("galloping"),
        code=lambda wildcards: code("animate_line.py"),
    message:
        "The first line, moving"
    script:
        "../scripts/animate_line.py"
