# a truth that is known -> recordings -> what is claimed of the models identified, and whether it holds


rule run_trial:
    output:
        fits=PATHS.trial,
    log:
        log_of("run_trial/{trial}/{batch}"),
    benchmark:
        benchmark_of("run_trial/{trial}/{batch}")
    conda:
        "../envs/galloping.yaml"
    params:
        settings=settings("run_trial"),
    message:
        "Trial {wildcards.trial}, {wildcards.batch}"
    script:
        "../scripts/run_trial.py"
