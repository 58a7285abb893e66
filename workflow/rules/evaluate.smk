# identified models, the Cramer-Rao bound, and oracles of pysindy's settings -> scores
ORACLE_REPLICATES = 5  # the first, of which the oracle of pysindy's settings is computed


rule evaluate_cell:
    input:
        model="<results>/models/{case}.json",
        trajectory="<results>/trajectories/{case}.npz",
        identified=lambda wildcards: expand(
            "<results>/identified/{case}/{protocol}/{cell}/{family}.npz",
            **wildcards,
            family=cell(wildcards).families,
        ),
    output:
        bounds="<results>/bounds/{case}/{protocol}/{cell}.npz",
        scores="<results>/scores/{case}/{protocol}/{cell}.csv",
        reconstructions="<results>/reconstructions/{case}/{protocol}/{cell}.npz",
    log:
        "<logs>/evaluate_cell/{case}/{protocol}/{cell}.log",
    benchmark:
        "<benchmarks>/evaluate_cell/{case}/{protocol}/{cell}.tsv"
    conda:
        "../envs/galloping.yaml"
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
        scores="<results>/oracles/{case}/{protocol}/{cell}.csv",
    log:
        "<logs>/find_oracle/{case}/{protocol}/{cell}.log",
    benchmark:
        "<benchmarks>/find_oracle/{case}/{protocol}/{cell}.tsv"
    conda:
        "../envs/galloping.yaml"
    params:
        columns=lambda wildcards: {"columns": cell(wildcards).columns},
        measurement=lambda wildcards: {
            "measurement": cell(wildcards).measurement
            | {"replicates": min(ORACLE_REPLICATES, cell(wildcards).replicates)}
        },
        degree=setting("identification.degree"),
        path_length=setting("identification.stlsq.path_length"),
        steady_window=setting("simulation.steady_window"),
        code=lambda wildcards: code("find_oracle.py"),
    message:
        "Best settings of pysindy for {wildcards.case} by {wildcards.protocol}, {wildcards.cell}"
    script:
        "../scripts/find_oracle.py"
