# a truth that is known -> recordings -> what is claimed of the models identified, and whether it holds


rule run_trial:
    output:
        fits="<results>/trials/{trial}/{batch}.csv",
    log:
        "<logs>/run_trial/{trial}/{batch}.log",
    benchmark:
        "<benchmarks>/run_trial/{trial}/{batch}.tsv"
    conda:
        "../envs/galloping.yaml"
    params:
        function=lambda wildcards: {"function": trial(wildcards).kind.function},
        seed=lambda wildcards: {f"trials.{wildcards.trial}.seed": trial(wildcards).seed},
        case=lambda wildcards: {f"trials.{wildcards.trial}.cases": batch(wildcards).case},
        replicates=lambda wildcards: {"replicates": list(batch(wildcards).replicates)},
        methods=lambda wildcards: {
            "identification": {m.name: STUDY.options(m) for m in trial(wildcards).methods}
        },
        options=lambda wildcards: {f"trials.{wildcards.trial}": dict(trial(wildcards).options)},
        code=lambda wildcards: code(
            "run_trial.py",
            trial(wildcards).kind.function,
            *(each for m in trial(wildcards).methods for each in m.modules),
        ),
    message:
        "Trial {wildcards.trial}, {wildcards.batch}"
    script:
        "../scripts/run_trial.py"
