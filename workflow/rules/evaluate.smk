# identified models, the Cramer-Rao bound, and oracles of pysindy's settings -> scores
from galloping.configuration.kinds import EXAMPLES
from galloping.deferred import summary, trials  # the jobs import them

ORACLE_REPLICATES = 5  # first replicates, for which pysindy's best settings are searched


rule evaluate_cell:
    input:
        model="<results>/models/{case}.json",
        trajectory="<results>/trajectories/{case}.npz",
        identified=lambda wildcards: expand(
            "<results>/identified/{case}/{protocol}/{cell}/{family}.json",
            **wildcards,
            family=cell(wildcards).families,
        ),
    output:
        **add_receipts(
            bounds="<results>/bounds/{case}/{protocol}/{cell}.npz",
            scores="<results>/scores/{case}/{protocol}/{cell}.csv",
            reconstructions="<results>/reconstructions/{case}/{protocol}/{cell}.npz",
        ),
    log:
        "<logs>/evaluate_cell/{case}/{protocol}/{cell}.log",
    benchmark:
        "<benchmarks>/evaluate_cell/{case}/{protocol}/{cell}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CELL_RESOURCES,
    params:
        columns=lambda wildcards: {"columns": cell(wildcards).columns},
        measurement=lambda wildcards: {"measurement": cell(wildcards).measurement},
        degree=setting("identification.degree"),
        steady_window=setting("simulation.steady_window"),
        is_own_model=lambda wildcards: {"is_own_model": not cell(wildcards).case.is_continuous},
        code=lambda wildcards: code("evaluate_cell.py"),
    message:
        "Evaluating {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/evaluate_cell.py"


rule find_oracle:
    input:
        model="<results>/models/{case}.json",
        trajectory="<results>/trajectories/{case}.npz",
    output:
        **add_receipts(scores="<results>/oracles/{case}/{protocol}/{cell}.csv"),
    log:
        "<logs>/find_oracle/{case}/{protocol}/{cell}.log",
    benchmark:
        "<benchmarks>/find_oracle/{case}/{protocol}/{cell}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **CELL_RESOURCES,
    params:
        columns=lambda wildcards: {"columns": cell(wildcards).columns},
        measurement=lambda wildcards: {
            "measurement": cell(wildcards).measurement
            | {"replicates": min(ORACLE_REPLICATES, cell(wildcards).replicates)}
        },
        degree=setting("identification.degree"),
        path_length=setting("identification.stlsq.path_length"),
        weak_path_length=setting("identification.weak.path_length"),
        steady_window=setting("simulation.steady_window"),
        code=lambda wildcards: code("find_oracle.py"),
    message:
        "Best settings of pysindy for {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/find_oracle.py"


# known truth -> recordings -> identified models -> whether their statuses are right


# Function of each kind of trial: it takes `seed`, `case`, `replicates` (their numbers), `methods`
# (of `Method.settings`, by name) and the keywords `options`, and yields a row for each fit.
TRIAL_FUNCTIONS = {
    "default_line": trials.recorded_lines.of_the_default_line,
    "random_lines": trials.recorded_lines.of_random_lines,
    "sensor_faults": trials.recorded_lines.of_faulty_recordings,
    "long_and_steady": trials.recorded_lines.of_long_and_steady_motions,
    "systems": trials.published.systems,
    "model_error": trials.real_lines.trial,
    "ambient": trials.ambient.trial,
    "free_decays": trials.free_decays.trial,
    "published_terms": trials.published.exact_terms,
    "published_intervals": trials.published.relaxation_intervals,
    "files": summary.sample_files.trial,
    "paper": trials.paper_inference.trial,
}


rule run_trial:
    input:
        lambda wildcards: EXAMPLES.get(batch(wildcards).case, []),
    output:
        **add_receipts(fits="<results>/trials/{trial}/{batch}.csv"),
    log:
        "<logs>/run_trial/{trial}/{batch}.log",
    benchmark:
        "<benchmarks>/run_trial/{trial}/{batch}.tsv"
    conda:
        "../envs/galloping.yaml"
    resources:
        **TRIAL_RESOURCES,
    params:
        function=lambda wildcards: {"function": trial_function(wildcards)},
        seed=lambda wildcards: {f"trials.{wildcards.trial}.seed": trial(wildcards).seed},
        case=lambda wildcards: {f"trials.{wildcards.trial}.cases": batch(wildcards).case},
        replicates=lambda wildcards: {"replicates": list(batch(wildcards).replicates)},
        methods=lambda wildcards: {
            "identification": {m.name: STUDY.options(m) for m in trial(wildcards).methods}
        },
        options=lambda wildcards: {f"trials.{wildcards.trial}": dict(trial(wildcards).options)},
        code=lambda wildcards: code(
            "run_trial.py",
            trial_function(wildcards),
            *(each for m in trial(wildcards).methods for each in m.modules),
        ),
    message:
        "Trial {wildcards.trial}, {wildcards.batch}"
    script:
        "../scripts/run_trial.py"
