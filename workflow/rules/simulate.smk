# line + wind -> model -> trajectory -> recordings; which further recording would help most


rule derive_model:
    output:
        **add_receipts(model="<results>/models/{case}.json"),
    log:
        "<logs>/derive_model/{case}.log",
    benchmark:
        "<benchmarks>/derive_model/{case}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CASE_RESOURCES,
    params:
        line=line,
        code=lambda wildcards: code("derive_model.py"),
    message:
        "Deriving the galloping equations of {wildcards.case}"
    script:
        "../scripts/derive_model.py"


rule simulate_line:
    input:
        model="<results>/models/{case}.json",
    output:
        **add_receipts(trajectory="<results>/trajectories/{case}.npz"),
    log:
        "<logs>/simulate_line/{case}.log",
    benchmark:
        "<benchmarks>/simulate_line/{case}.tsv"
    wildcard_constraints:
        case="|".join(name for name in LINES if name not in CONTINUOUS_CASES) or "none",
    conda:
        "../envs/galloping.yaml"
    resources:
        **CASE_RESOURCES,
    params:
        releases=lambda wildcards: {
            f"cases.{wildcards.case}.initial_states": list(case(wildcards).releases)
        },
        duration=setting("simulation.duration"),
        sampling_rate=setting("simulation.sampling_rate"),
        code=lambda wildcards: code("simulate_line.py"),
    message:
        "Simulating {wildcards.case}"
    script:
        "../scripts/simulate_line.py"


# a line of many modes, whose motion is that of no model of two


rule simulate_many_modes:
    output:
        **add_receipts(trajectory="<results>/trajectories/{case}.npz"),
    log:
        "<logs>/simulate_many_modes/{case}.log",
    benchmark:
        "<benchmarks>/simulate_many_modes/{case}.tsv"
    wildcard_constraints:
        case="|".join(CONTINUOUS_CASES) or "none",
    conda:
        "../envs/galloping.yaml"
    resources:
        **CASE_RESOURCES,
    params:
        line=line,
        truth=lambda wildcards: {"truth": case(wildcards).truth},
        releases=lambda wildcards: {
            f"cases.{wildcards.case}.initial_states": list(case(wildcards).releases)
        },
        duration=setting("simulation.duration"),
        sampling_rate=setting("simulation.sampling_rate"),
        seed=lambda wildcards: {  # where the wind is steady nothing is drawn
            "measurement.seed": SEED if case(wildcards).truth["gusts"]["intensity"] > 0 else 0
        },
        code=lambda wildcards: code("simulate_many_modes.py"),
    message:
        "Simulating {wildcards.case} by many modes"
    script:
        "../scripts/simulate_many_modes.py"


rule rank_releases:
    input:
        model="<results>/models/{case}.json",
        trajectory="<results>/trajectories/{case}.npz",
    output:
        **add_receipts(ranking="<results>/bounds/{case}/further_recordings.csv"),
    log:
        "<logs>/rank_releases/{case}.log",
    benchmark:
        "<benchmarks>/rank_releases/{case}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CASE_RESOURCES,
    params:
        level=setting("measurement.subsets.level"),
        code=lambda wildcards: code("rank_releases.py"),
    message:
        "Which further recording of {wildcards.case} would help most"
    script:
        "../scripts/rank_releases.py"


# trajectory -> recordings, on request only. Jobs that need recordings simulate the same ones: if they
# read a common file, an edit of one study cell would run all of them again.


rule measure_motion:
    input:
        trajectory="<results>/trajectories/{case}.npz",
    output:
        **add_receipts(recordings="<results>/recordings/{case}/{protocol}/{cell}.npz"),
    log:
        "<logs>/measure_motion/{case}/{protocol}/{cell}.log",
    benchmark:
        "<benchmarks>/measure_motion/{case}/{protocol}/{cell}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CELL_RESOURCES,
    params:
        measurement=lambda wildcards: {"measurement": cell(wildcards).measurement},
        code=lambda wildcards: code("measure_motion.py"),
    message:
        "Measuring {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/measure_motion.py"
