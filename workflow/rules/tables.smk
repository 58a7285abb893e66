# scores, bounds -> tables, and their differences from the reference
#
# A table: the function that makes it, its settings where it has such, and by the names of the
# function's arguments the files that it reads, one or several by name; each comes as
# `galloping.study.files.read` returns it.
from types import SimpleNamespace

from galloping.configuration.kinds import EXACT_TERMS, EXAM, INTERVALS, MODEL_ERROR, SYSTEMS, TRUST
from galloping.deferred import evaluation, report as pages, tables  # the jobs import them
from galloping.results import MAIN_METHOD

SCORES = "<results>/tables/scores.csv"
SAMPLES = "<results>/tables/paper_samples.csv"
READINGS = "<results>/tables/paper_readings.csv"
MODEL = f"<results>/models/{FIRST_CASE}.json"
TRAJECTORY = f"<results>/trajectories/{FIRST_CASE}.npz"
# Files in git, beside the workflow: never in a storage with the results.
ABLATION_TABLE = local("docs/identification_parts.csv")
REGION_TABLE = local("results/reference/paper/paper_region.csv")  # result of `make paper`


def made(function, settings=None, **reads):
    """How a table or a figure is made. settings: its own, by key, in plain values.

    An input is a list where several files are read by name, and `names` has their names.
    """
    several = {key: files for key, files in reads.items() if isinstance(files, dict)}
    return SimpleNamespace(
        function=function,
        settings=settings or {},
        input=reads | {key: list(files.values()) for key, files in several.items()},
        names={key: list(files) for key, files in several.items()},
    )


def every(pattern, **wildcards):
    """A file for each value of one wildcard, by that value."""
    ((name, values),) = wildcards.items()
    return {value: expand(pattern, **{name: value}, allow_missing=True)[0] for value in values}


def swept(pattern, cases=LINES, maps=False):
    """Files of sweeps of one parameter, or of two, of each case."""
    return {
        path: path
        for case in cases
        for sweep in STUDY.sweeps
        if sweep.is_map == maps
        for name in pattern
        for path in expand(f"<results>/sweeps/{case}/{sweep.name}/{name}.csv", block=sweep.blocks)
    }


def fits_of(*tables):
    """Of all trials that one of the tables sums up."""
    return {
        f"{trial.name}/{batch.name}": f"<results>/trials/{trial.name}/{batch.name}.csv"
        for trial in STUDY.trials
        if trial.table in tables
        for batch in trial.batches
    }


def joined(parts):
    """The rows of all parts."""
    return made(tables.scores.concatenate, parts=parts)


def has_trials(*tables):
    return any(trial.table in tables for trial in STUDY.trials)


TABLES = {}
if DEPARTURES:
    TABLES["readings"] = made(tables.line_parameters.readings)
if LINES:
    first_case = STUDY.cases[0]
    paper_protocol, paper_method = shown.paper_pair(STUDY)
    least_noise = {case.name: shown.least_noise(STUDY, case).id for case in STUDY.cases}
    noisy = {each.id: each.columns for each in STUDY.cells if each.level > 0}  # have a bound
    ahead = {each.id: each.columns for each in shown.ahead_cells(STUDY)}
    beside = shown.compared_fits(STUDY)
    TABLES |= {
        "table1_conductor": made(
            tables.line_parameters.conductor,
            {"cases": STUDY.plain["cases"]},
            **({"region": REGION_TABLE} if Path(REGION_TABLE).exists() else {}),
        ),
        "table3_as_printed": made(
            tables.table3.as_printed, table3="<results>/tables/table3_coefficients.csv"
        ),
        "table2_spacers": made(tables.line_parameters.spacers, {"cases": STUDY.plain["cases"]}),
        "table3_coefficients": made(
            tables.table3.table3,
            {
                "cases": LINES,
                "continuous": CONTINUOUS_CASES,
                "protocol": paper_protocol.name,
                "method": paper_method.name,
                "level": min(STUDY.settings.measurement.levels),
                "degree": DEGREE,
            },
            models=every("<results>/models/{case}.json", case=LINES),
            identified={
                case: f"<results>/identified/{cell}/{paper_method.family}.json"
                for case, cell in least_noise.items()
            },
        ),
        "equations": made(
            tables.table3.equations,
            {
                "case": FIRST_CASE,
                "is_continuous": first_case.is_continuous,
                "degree": DEGREE,
                "fits": {
                    cell.id: {
                        "protocol": cell.protocol.name,
                        "method": method.name,
                        "level": cell.level,
                    }
                    for cell, method in beside
                },
            },
            model=MODEL,
            identified={
                cell.id: f"<results>/identified/{cell.id}/{method.family}.json"
                for cell, method in beside
            },
        ),
        "noise_coefficients": made(tables.scores.noise_coefficients, scores=SCORES),
        "noise_r2": made(tables.scores.noise_r2, scores=SCORES),
        "data_amount": made(tables.scores.data_amount, scores=SCORES),
        "claims": made(
            tables.judged_claims.claims_table,
            {
                "cases": shown.judged_cases(STUDY),
                "pairs": [[p.name, m.name] for p in STUDY.protocols for m in STUDY.methods],
                "steady_window": STEADY_WINDOW,
                "winds": {case.name: case.line["wind"]["speed"] for case in STUDY.cases},
            },
            scores=SCORES,
            draws=every("<results>/paper/{case}.csv", case=REDRAWN_CASES),
            trajectories=every("<results>/trajectories/{case}.npz", case=shown.judged_cases(STUDY)),
        ),
    }
if DEPARTURES:
    TABLES["paper"] = made(
        tables.judged_claims.paper_table,
        {"departures": DEPARTURES},
        draws=every("<results>/paper/{case}.csv", case=REDRAWN_CASES),
        claims="<results>/tables/claims.csv",
    )
if LINES:
    TABLES |= {
        "efficiency": made(
            tables.scores.efficiency,
            scores=SCORES,
            identifiability="<results>/tables/identifiability.csv",
        ),
        "peers": made(
            tables.scores.peers,
            scores=SCORES,
            oracles=every(
                "<results>/oracles/{cell}.csv", cell=[each.id for each in shown.oracle_cells(STUDY)]
            ),
        ),
        "identifiability": made(
            tables.scores.identifiability,
            {"degree": DEGREE, "cells": noisy},
            models=every("<results>/models/{case}.json", case=LINES),
            bounds=every("<results>/bounds/{cell}.npz", cell=noisy),
        ),
        "further_recordings": joined(
            every(
                "<results>/bounds/{case}/further_recordings.csv",
                case=[case.name for case in STUDY.cases if not case.is_continuous],
            )
        ),
        "limit_cycles": joined(swept(["cycles", "simulated/{block}"])),
        "bifurcations": joined(swept(["bifurcations"])),
        # of the first case: lines that differ in the varied parameters only have the same map
        "resonance_map": joined(swept(["simulated/{block}"], cases=LINES[:1], maps=True)),
        "prediction": joined(
            every(
                f"<results>/assessment/{FIRST_CASE}/prediction_{{protocol}}.csv",
                protocol=shown.predicted_cells(STUDY, FIRST_CASE),
            )
        ),
        "limit_cycle_ahead": made(
            tables.limit_cycle_ahead.limit_cycles_ahead,
            {
                "method": MAIN_METHOD,
                "seed": SEED,
                "steady_window": STEADY_WINDOW,
                "is_continuous": first_case.is_continuous,
                "cells": ahead,
            },
            model=MODEL,
            trajectory=TRAJECTORY,
            identified=every(f"<results>/identified/{{cell}}/{MAIN_FAMILY}.json", cell=ahead),
        ),
        "reduction": made(
            evaluation.reduction.reduction_table,
            {
                "case": first_case.released,
                "seed": SEED,
                "length_scale": first_case.truth["gusts"]["length_scale"],
                "spectrum": first_case.truth["gusts"]["spectrum"],
            },
        ),
        "clearance": joined(every("<results>/assessment/{case}/clearance.csv", case=LINES)),
        "measures": joined(every("<results>/assessment/{case}/measures.csv", case=LINES)),
    }
if REDRAWN_CASES:
    TABLES["reproduction"] = joined(
        every(
            "<results>/reproduction/{parameter}.csv",
            parameter=[name for name, values in OPEN_PARAMETERS.items() if values],
        )
    )
if LINES:
    TABLES["scores"] = made(
        tables.scores.all_scores,
        cells=every("<results>/scores/{cell}.csv", cell=[each.id for each in STUDY.cells]),
    )
TABLES["columns"] = made(pages.data_dictionary.columns)  # its settings, all tables: below
if has_trials(TRUST):
    TABLES |= {
        "fits": joined(fits_of(TRUST)),
        "trust": made(tables.trial_summaries.trust, fits="<results>/tables/fits.csv"),
    }
    if Path(ABLATION_TABLE).exists():  # not where the study is a module of another one
        TABLES["ablations"] = joined({"parts": ABLATION_TABLE})  # measured when each was tried
for kind in (SYSTEMS, MODEL_ERROR, EXACT_TERMS, INTERVALS):  # by the name of their table
    if has_trials(kind):
        TABLES[kind] = made(getattr(tables.trial_summaries, kind), parts=fits_of(kind))
if has_trials(TRUST, SYSTEMS, MODEL_ERROR):
    TABLES["paths"] = made(
        tables.trial_summaries.paths,
        {"kinds": {name: of.kind for name, of in STUDY.settings.trials.items()}},
        parts=fits_of(TRUST, SYSTEMS, MODEL_ERROR),
    )
if has_trials(EXAM):
    TABLES |= {
        "answers": made(tables.exam.collect_answers, parts=fits_of(EXAM)),
        "exam": made(tables.exam.sum_up_strata, answers="<results>/tables/answers.csv"),
    }
if has_trials(PAPER):
    TABLES |= {
        "paper_region": made(tables.inference.region_table, samples=SAMPLES, readings=READINGS),
        "paper_readings": made(tables.inference.paper_readings, parts=fits_of(PAPER)),
        "paper_predictions": made(tables.inference.predictions, samples=SAMPLES),
        "paper_exclusions": made(tables.inference.exclusions, parts=fits_of(PAPER)),
        "paper_samples": made(tables.inference.region_samples, parts=fits_of(PAPER)),
    }

COMPARISONS = ["reference_summary", "reference_differences"]
TABLES["columns"].settings["tables"] = [*TABLES, *COMPARISONS]
LONG_TABLES = {"scores", "fits", "paper_samples"}
HIDDEN_TABLES = LONG_TABLES | {"answers"}  # tables that the report does not show
UNCOMPARED_TABLES = LONG_TABLES | {  # tables that are not compared with the reference
    "readings", "table3_as_printed", "equations", "reproduction", "columns",
    "limit_cycles", "bifurcations",  # the points of a branch depend on rounding
}  # fmt: skip
