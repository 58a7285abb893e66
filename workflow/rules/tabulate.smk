# scores -> tables


rule tabulate_parameters:
    output:
        conductor=table("table1_conductor"),
        spacers=table("table2_spacers"),
    log:
        log_of("tabulate_parameters"),
    benchmark:
        benchmark_of("tabulate_parameters")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={"cases": STUDY["cases"], "code": script_code("tabulate_parameters.py")},
    message:
        "Tables 1 and 2: parameters"
    script:
        "../scripts/tabulate_parameters.py"


rule tabulate_coefficients:
    input:
        models=expand(out("models/{case}.json"), case=CASES),
        identified=expand(
            out("identified/{case}/{protocol}/{cell}/{method}.npz"),
            case=CASES,
            cell=min(LEVELS, key=LEVELS.get),
            **PAPER_CELL,
        ),
    output:
        table=table("table3_coefficients"),
    log:
        log_of("tabulate_coefficients"),
    benchmark:
        benchmark_of("tabulate_coefficients")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "cases": CASES,
            **PAPER_CELL,
            "level": min(LEVELS.values()),
            "degree": STUDY["identification"]["degree"],
            "code": script_code("tabulate_coefficients.py"),
        },
    message:
        "Table 3: coefficients"
    script:
        "../scripts/tabulate_coefficients.py"


rule tabulate_scores:
    input:
        scores=[out("scores/{}/{}/{}.csv".format(*cell)) for cell in cells()],
    output:
        scores=out("tables/scores.csv"),
        noise_coefficients=table("noise_coefficients"),
        noise_r2=table("noise_r2"),
        data_amount=table("data_amount"),
        claims=table("claims"),
    log:
        log_of("tabulate_scores"),
    benchmark:
        benchmark_of("tabulate_scores")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "paper_cases": PAPER_CASES,
            "protocols": PROTOCOLS,
            "methods": METHODS,
            "subset_level": STUDY["measurement"]["subsets"]["level"],
            "code": script_code("tabulate_scores.py"),
        },
    message:
        "Tables of noise, data amount and claims"
    script:
        "../scripts/tabulate_scores.py"


rule tabulate_bounds:
    input:
        scores=rules.tabulate_scores.output.scores,
        models=expand(out("models/{case}.json"), case=CASES),
        bounds=[out("bounds/{}/{}/{}.npz".format(*cell)) for cell in noisy_cells()],
        rankings=expand(out("bounds/{case}/further_recordings.csv"), case=CASES),
    output:
        efficiency=table("efficiency"),
        identifiability=table("identifiability"),
        further_recordings=table("further_recordings"),
    log:
        log_of("tabulate_bounds"),
    benchmark:
        benchmark_of("tabulate_bounds")
    conda:
        "../envs/galloping.yaml"
    params:
        settings={
            "cases": CASES,
            "degree": STUDY["identification"]["degree"],
            "samples": round(
                STUDY["simulation"]["duration"] * STUDY["simulation"]["sampling_rate"]
            )
            + 1,
            "cells": [
                {"case": case, "protocol": protocol, **cell_settings(case, cell)}
                for case, protocol, cell in noisy_cells()
            ],
            "code": script_code("tabulate_bounds.py"),
        },
    message:
        "Tables of identifiability and efficiency"
    script:
        "../scripts/tabulate_bounds.py"
