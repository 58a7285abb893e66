# tables and motions -> figures, numbered as in the paper


rule draw_line:
    input:
        model=out(f"models/{FIRST_CASE}.json"),
    output:
        svg=vector("figure01"),
        png=raster("figure01"),
    log:
        log_of("draw_line"),
    benchmark:
        benchmark_of("draw_line")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "case": FIRST_CASE,
            "line": line_settings(FIRST_CASE),
            "look": STUDY["figures"],
            "code": script_code("draw_line.py"),
        },
    message:
        "Figure 1: line and coordinates"
    script:
        "../scripts/draw_line.py"


rule draw_load:
    input:
        trajectory=out(f"trajectories/{FIRST_CASE}.npz"),
    output:
        svg=vector("figure02"),
        png=raster("figure02"),
    log:
        log_of("draw_load"),
    benchmark:
        benchmark_of("draw_load")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "line": line_settings(FIRST_CASE),
            "look": STUDY["figures"],
            "code": script_code("draw_load.py"),
        },
    message:
        "Figure 2: aerodynamic load"
    script:
        "../scripts/draw_load.py"


rule draw_flow:
    output:
        svg=vector("figure03"),
        png=raster("figure03"),
    log:
        log_of("draw_flow"),
    benchmark:
        benchmark_of("draw_flow")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "degree": STUDY["identification"]["degree"],
            "protocols": PROTOCOLS,
            "methods": METHODS,
            "levels": [min(LEVELS.values()), max(LEVELS.values())],
            "points": [min(SUBSETS.values()), max(SUBSETS.values())],
            "replicates": STUDY["measurement"]["replicates"],
            "look": STUDY["figures"],
            "code": script_code("draw_flow.py"),
        },
    message:
        "Figure 3: flow chart"
    script:
        "../scripts/draw_flow.py"


rule draw_recovery:
    input:
        trajectories=expand(out("trajectories/{case}.npz"), case=CASES),
        motions=expand(out(MOTION), case=CASES, cell=min(LEVELS, key=LEVELS.get), **PAPER_CELL),
    output:
        svg=vector("figure04"),
        png=raster("figure04"),
    log:
        log_of("draw_recovery"),
    benchmark:
        benchmark_of("draw_recovery")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "cases": CASES,
            **PAPER_CELL,
            "level": min(LEVELS.values()),
            "look": STUDY["figures"],
            "code": script_code("draw_recovery.py"),
        },
    message:
        "Figure 4: motion without noise"
    script:
        "../scripts/draw_recovery.py"


rule draw_coefficients:
    input:
        model=out(f"models/{FIRST_CASE}.json"),
        identified=expand(out(IDENTIFIED), case=FIRST_CASE, cell=COEFFICIENT_CELLS, **PAPER_CELL),
    output:
        svg=vector("figure05"),
        png=raster("figure05"),
    log:
        log_of("draw_coefficients"),
    benchmark:
        benchmark_of("draw_coefficients")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "case": FIRST_CASE,
            **PAPER_CELL,
            "levels": list(COEFFICIENT_CELLS.values()),
            "degree": STUDY["identification"]["degree"],
            "look": STUDY["figures"],
            "code": script_code("draw_coefficients.py"),
        },
    message:
        "Figure 5: coefficients under noise"
    script:
        "../scripts/draw_coefficients.py"


rule draw_noise_coefficients:
    input:
        table=out("tables/noise_coefficients.csv"),
    output:
        svg=vector("figure06"),
        png=raster("figure06"),
    log:
        log_of("draw_noise_coefficients"),
    benchmark:
        benchmark_of("draw_noise_coefficients")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "cases": CASES,
            "protocols": PROTOCOLS,
            "methods": SHOWN_METHODS,
            "look": STUDY["figures"],
            "code": script_code("draw_noise_coefficients.py"),
        },
    message:
        "Figure 6: coefficient errors against noise"
    script:
        "../scripts/draw_noise_coefficients.py"


rule draw_noise_r2:
    input:
        table=out("tables/noise_r2.csv"),
    output:
        svg=vector("figure07"),
        png=raster("figure07"),
    log:
        log_of("draw_noise_r2"),
    benchmark:
        benchmark_of("draw_noise_r2")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "cases": CASES,
            "protocols": PROTOCOLS,
            "methods": SHOWN_METHODS,
            "look": STUDY["figures"],
            "code": script_code("draw_noise_r2.py"),
        },
    message:
        "Figure 7: R2 against noise"
    script:
        "../scripts/draw_noise_r2.py"


rule draw_noise_histories:
    input:
        trajectory=out(f"trajectories/{FIRST_CASE}.npz"),
        motions=[
            out(MOTION).format(case=FIRST_CASE, cell=cell, **shown)
            for shown in SHOWN_CELLS
            for cell in NOISE_CELLS
        ],
    output:
        svg=vector("figure08"),
        png=raster("figure08"),
    log:
        log_of("draw_noise_histories"),
    benchmark:
        benchmark_of("draw_noise_histories")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "case": FIRST_CASE,
            "columns": SHOWN_CELLS,
            "labels": [f"noise level {level:g}" for level in NOISE_CELLS.values()],
            "window": STUDY["simulation"]["steady_window"],
            "look": STUDY["figures"],
            "code": script_code("draw_histories.py"),
        },
    message:
        "Figure 8: time histories under noise"
    script:
        "../scripts/draw_histories.py"


rule draw_amount_histories:
    input:
        trajectory=out(f"trajectories/{FIRST_CASE}.npz"),
        motions=[
            out(MOTION).format(case=FIRST_CASE, cell=cell, **shown)
            for shown in SHOWN_CELLS
            for cell in AMOUNT_CELLS
        ],
    output:
        svg=vector("figure09"),
        png=raster("figure09"),
    log:
        log_of("draw_amount_histories"),
    benchmark:
        benchmark_of("draw_amount_histories")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "case": FIRST_CASE,
            "columns": SHOWN_CELLS,
            "labels": [f"{points} points" for points in AMOUNT_CELLS.values()],
            "window": STUDY["simulation"]["steady_window"],
            "look": STUDY["figures"],
            "code": script_code("draw_histories.py"),
        },
    message:
        "Figure 9: time histories by amount of data"
    script:
        "../scripts/draw_histories.py"


rule draw_data_amount:
    input:
        table=out("tables/data_amount.csv"),
    output:
        svg=vector("figure10"),
        png=raster("figure10"),
    log:
        log_of("draw_data_amount"),
    benchmark:
        benchmark_of("draw_data_amount")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "cases": CASES,
            "protocols": PROTOCOLS,
            "methods": SHOWN_METHODS,
            "level": STUDY["measurement"]["subsets"]["level"],
            "look": STUDY["figures"],
            "code": script_code("draw_data_amount.py"),
        },
    message:
        "Figure 10: errors by amount of data"
    script:
        "../scripts/draw_data_amount.py"


rule draw_claims:
    input:
        table=out("tables/claims.csv"),
    output:
        svg=vector("claims"),
        png=raster("claims"),
    log:
        log_of("draw_claims"),
    benchmark:
        benchmark_of("draw_claims")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "combinations": [
                [protocol, method]
                for protocol in CLAIM_PROTOCOLS
                for method in CLAIM_METHODS
                if runs(method, protocol, min(LEVELS, key=LEVELS.get))
            ],
            "look": STUDY["figures"],
            "code": script_code("draw_claims.py"),
        },
    message:
        "Claims of the paper"
    script:
        "../scripts/draw_claims.py"


rule draw_overview:
    input:
        table=out("tables/scores.csv"),
    output:
        svg=vector("overview"),
        png=raster("overview"),
    log:
        log_of("draw_overview"),
    benchmark:
        benchmark_of("draw_overview")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "case": FIRST_CASE,
            "protocol": SENSOR_PROTOCOL,
            "look": STUDY["figures"],
            "code": script_code("draw_overview.py"),
        },
    message:
        "Overview: error against noise, and the bound"
    script:
        "../scripts/draw_overview.py"


rule draw_efficiency:
    input:
        table=out("tables/efficiency.csv"),
    output:
        svg=vector("efficiency"),
        png=raster("efficiency"),
    log:
        log_of("draw_efficiency"),
    benchmark:
        benchmark_of("draw_efficiency")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "cases": CASES,
            "protocols": PROTOCOLS,
            "methods": SHOWN_METHODS,
            "look": STUDY["figures"],
            "code": script_code("draw_efficiency.py"),
        },
    message:
        "Efficiency against noise"
    script:
        "../scripts/draw_efficiency.py"


rule draw_identifiability:
    input:
        table=out("tables/identifiability.csv"),
    output:
        svg=vector("identifiability"),
        png=raster("identifiability"),
    log:
        log_of("draw_identifiability"),
    benchmark:
        benchmark_of("draw_identifiability")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "cases": CASES,
            "protocols": PROTOCOLS,
            "level": STUDY["measurement"]["subsets"]["level"],
            "look": STUDY["figures"],
            "code": script_code("draw_identifiability.py"),
        },
    message:
        "Identifiability of each term"
    script:
        "../scripts/draw_identifiability.py"
