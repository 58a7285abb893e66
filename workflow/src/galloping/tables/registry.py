"""The tables of the study, without importing what makes them.

A table is a function, an entry here and a caption, `workflow/report/tables/{name}.rst`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from galloping.configuration.trials import (
    EXACT_TERMS,
    INTERVALS,
    MODEL_ERROR,
    PAPER,
    SYSTEMS,
    TRUST,
)
from galloping.study import shown, sources
from galloping.study.cells import Case, Cell, Study
from galloping.study.kinds import NOISE, OPEN_PARAMETERS, OURS, OURS_FAMILY
from galloping.study.sources import Sources
from galloping.study.sweeps import Sweep


def _nothing(study: Study) -> dict:
    return {}


@dataclass(frozen=True)
class Table:
    """One table.

    function: `module:function`, imported only by the job that makes it; it takes what is read, by
    name, and `settings`, and returns a DataFrame. reads, settings: of a study, in plain values.
    belongs: whether a study has it. is_compared: with the reference. is_shown: in the report.
    """

    name: str
    function: str
    reads: Callable[[Study], Sources] = _nothing
    settings: Callable[[Study], Mapping] = _nothing
    belongs: Callable[[Study], bool] = shown.has_lines
    is_compared: bool = True
    is_shown: bool = True


def _cases(study: Study) -> dict:
    return {"cases": study.plain["cases"]}


def _scores(study: Study) -> Sources:
    return {"scores": sources.table(study, "scores")}


def _scores_of_cells(study: Study) -> Sources:
    return {"cells": {cell.id: sources.scores(study, cell) for cell in study.cells}}


def _peers(study: Study) -> Sources:
    cells = shown.oracle_cells(study)
    return _scores(study) | {"oracles": {cell.id: sources.oracle(study, cell) for cell in cells}}


def _least_noise(study: Study) -> dict[str, Cell]:
    return {case.name: shown.least_noise(study, case) for case in study.cases}


def _coefficient_reads(study: Study) -> Sources:
    _, method = shown.paper_pair(study)
    return {
        "models": {case.name: sources.model(study, case.name) for case in study.cases},
        "identified": {
            case: sources.identified(study, cell, method.family)
            for case, cell in _least_noise(study).items()
        },
    }


def _coefficients(study: Study) -> dict:
    protocol, method = shown.paper_pair(study)
    return {
        "cases": [case.name for case in study.cases],
        "continuous": [case.name for case in study.cases if case.is_continuous],
        "protocol": protocol.name,
        "method": method.name,
        "level": min(study.settings.measurement.levels),
        "degree": study.settings.identification.degree,
    }


def _claims(study: Study) -> dict:
    return {
        "cases": shown.judged_cases(study),
        "pairs": [[p.name, m.name] for p in study.protocols for m in study.methods],
        "steady_window": list(study.settings.simulation.steady_window),
    }


def _paper_draws(study: Study) -> Sources:
    cases = shown.redrawn_cases(study)
    return {"draws": {case: sources.paper_draws(study, case) for case in cases}}


def _claims_reads(study: Study) -> Sources:
    moved = {case: sources.trajectory(study, case) for case in shown.judged_cases(study)}
    return _scores(study) | _paper_draws(study) | {"trajectories": moved}


def _noisy(study: Study) -> list[Cell]:
    """Those that have a Cramer-Rao bound."""
    return [cell for cell in study.cells if cell.level > 0]


def _bounds(study: Study) -> Sources:
    return {
        "models": {case.name: sources.model(study, case.name) for case in study.cases},
        "bounds": {cell.id: sources.bounds(study, cell) for cell in _noisy(study)},
    }


def _identifiability(study: Study) -> dict:
    return {
        "degree": study.settings.identification.degree,
        "cells": {cell.id: cell.columns for cell in _noisy(study)},
    }


def _rankings(study: Study) -> Sources:
    cases = [case.name for case in study.cases if not case.is_continuous]
    return {"parts": {case: sources.ranking(study, case) for case in cases}}


def _along(study: Study) -> list:
    return [sweep for sweep in study.sweeps if not sweep.is_map]


def _limit_cycles(study: Study) -> Sources:
    """Branches of limit cycles, then the long simulations."""
    parts = {}
    for case in study.cases:
        for sweep in _along(study):
            names = {"case": case.name, "sweep": sweep.name}
            parts[f"{case.name}/{sweep.name}"] = sources.swept(study, "cycles", **names)
            parts |= _blocks(study, case, sweep)
    return {"parts": parts}


def _blocks(study: Study, case: Case, sweep: Sweep) -> dict:
    return {
        f"{case.name}/{sweep.name}/{block.name}": sources.swept(
            study, "block", case=case.name, sweep=sweep.name, block=block.name
        )
        for block in sweep.blocks
    }


def _bifurcations(study: Study) -> Sources:
    names = [{"case": c.name, "sweep": s.name} for c in study.cases for s in _along(study)]
    return {
        "parts": {"/".join(n.values()): sources.swept(study, "bifurcations", **n) for n in names}
    }


def _maps(study: Study) -> Sources:
    """Of the first case: lines that differ in what is varied have the same map."""
    case = shown.first_case(study)
    parts = [_blocks(study, case, sweep) for sweep in study.sweeps if sweep.is_map]
    return {"parts": {name: block for part in parts for name, block in part.items()}}


def _of_cases(pattern: str) -> Callable[[Study], Sources]:
    return lambda study: {
        "parts": {c.name: sources.swept(study, pattern, case=c.name) for c in study.cases}
    }


def _predictions(study: Study) -> Sources:
    case = shown.first_case(study).name
    protocols = shown.predicted_cells(study, case)
    return {
        "parts": {
            name: sources.swept(study, "prediction", case=case, protocol=name) for name in protocols
        }
    }


def _openness(study: Study) -> Sources:
    opened = study.settings.assessment.open_parameters
    names = [
        name for name in OPEN_PARAMETERS if getattr(opened, name) and shown.redrawn_cases(study)
    ]
    return {"parts": {name: sources.swept(study, "openness", parameter=name) for name in names}}


def _reduction(study: Study) -> dict:
    case = shown.first_case(study)
    gusts = {key: case.truth["gusts"][key] for key in ("length_scale", "spectrum")}
    return {"case": case.released, "seed": study.settings.measurement.seed, **gusts}


def _ahead_cells(study: Study) -> list[Cell]:
    """Whole records of the first case that ours can use."""
    return [
        cell
        for cell in study.cells
        if (cell.case, cell.kind) == (shown.first_case(study), NOISE)
        and any(method.name == OURS for method in cell.methods)
    ]


def _ahead_reads(study: Study) -> Sources:
    case = shown.first_case(study).name
    return {
        "model": sources.model(study, case),
        "trajectory": sources.trajectory(study, case),
        "identified": {
            cell.id: sources.identified(study, cell, OURS_FAMILY) for cell in _ahead_cells(study)
        },
    }


def _ahead(study: Study) -> dict:
    return {
        "method": OURS,
        "seed": study.settings.measurement.seed,
        "steady_window": list(study.settings.simulation.steady_window),
        "is_continuous": shown.first_case(study).is_continuous,
        "cells": {cell.id: cell.columns for cell in _ahead_cells(study)},
    }


def _tables(study: Study) -> dict:
    return {"tables": [*(table.name for table in of_study(study)), *COMPARISONS]}


def _fits(*tables: str) -> Callable[[Study], Sources]:
    """Of all trials that are summed up in one of the tables."""
    return lambda study: {"parts": sources.trials(study, *tables)}


COMPARISONS = ("reference_summary", "reference_differences")  # of compare_reference
TOGETHER = "galloping.tables.scores:together"
TABLES = (
    Table(
        "readings",
        "galloping.tables.parameters:readings",
        belongs=lambda study: bool(shown.departures_from_paper(study)),
        is_compared=False,
    ),
    Table(
        "table1_conductor",
        "galloping.tables.parameters:conductor",
        lambda study: sources.region(),
        _cases,
    ),
    Table(
        "table3_as_printed",
        "galloping.tables.coefficients:as_printed",
        lambda study: {"table3": sources.table(study, "table3_coefficients")},
        is_compared=False,
    ),
    Table("table2_spacers", "galloping.tables.parameters:spacers", settings=_cases),
    Table(
        "table3_coefficients",
        "galloping.tables.coefficients:table3",
        _coefficient_reads,
        _coefficients,
    ),
    Table("noise_coefficients", "galloping.tables.scores:noise_coefficients", _scores),
    Table("noise_r2", "galloping.tables.scores:noise_r2", _scores),
    Table("data_amount", "galloping.tables.scores:data_amount", _scores),
    Table(
        "claims",
        "galloping.tables.claims:claims_table",
        _claims_reads,
        _claims,
    ),
    Table(
        "paper",
        "galloping.tables.claims:paper_table",
        lambda study: _paper_draws(study) | {"claims": sources.table(study, "claims")},
        lambda study: {"departures": shown.departures_from_paper(study)},
        belongs=lambda study: bool(shown.departures_from_paper(study)),
    ),
    Table(
        "efficiency",
        "galloping.tables.bounds:efficiency",
        lambda study: _scores(study) | {"identifiability": sources.table(study, "identifiability")},
    ),
    Table("peers", "galloping.tables.scores:peers", _peers),
    Table("identifiability", "galloping.tables.bounds:identifiability", _bounds, _identifiability),
    Table("further_recordings", TOGETHER, _rankings),
    # where a branch has its points is decided by rounding
    Table("limit_cycles", TOGETHER, _limit_cycles, is_compared=False),
    Table("bifurcations", TOGETHER, _bifurcations, is_compared=False),
    Table("resonance_map", TOGETHER, _maps),
    Table("prediction", TOGETHER, _predictions),
    Table(
        "limit_cycle_ahead",
        "galloping.tables.ahead:limit_cycles_ahead",
        _ahead_reads,
        _ahead,
    ),
    Table("reduction", "galloping.evaluation.reduction:reduction_table", settings=_reduction),
    Table("clearance", TOGETHER, _of_cases("clearance")),
    Table("measures", TOGETHER, _of_cases("measures")),
    Table(
        "reproduction", TOGETHER, _openness,
        belongs=lambda study: bool(shown.redrawn_cases(study)), is_compared=False,
    ),
    Table(
        "scores",
        "galloping.tables.scores:all_scores",
        _scores_of_cells,
        is_compared=False,
        is_shown=False,
    ),
    Table(
        "columns", "galloping.report.columns:columns", settings=_tables,
        belongs=lambda study: True, is_compared=False,
    ),
    Table(
        "fits", TOGETHER, _fits(TRUST),
        belongs=shown.has_trials(TRUST), is_compared=False, is_shown=False,
    ),
    Table(
        "trust",
        "galloping.tables.trials:trust",
        lambda study: {"fits": sources.table(study, "fits")},
        belongs=shown.has_trials(TRUST),
    ),
    Table(
        "systems",
        "galloping.tables.trials:systems",
        _fits(SYSTEMS),
        belongs=shown.has_trials(SYSTEMS),
    ),
    Table(
        "model_error",
        "galloping.tables.trials:model_error",
        _fits(MODEL_ERROR),
        belongs=shown.has_trials(MODEL_ERROR),
    ),
    Table(
        "paths",
        "galloping.tables.trials:paths",
        _fits(TRUST, SYSTEMS, MODEL_ERROR),
        lambda study: {"kinds": {name: of.kind for name, of in study.settings.trials.items()}},
        belongs=shown.has_trials(TRUST, SYSTEMS, MODEL_ERROR),
    ),
    Table(
        "published_terms",
        "galloping.tables.trials:published_terms",
        _fits(EXACT_TERMS),
        belongs=shown.has_trials(EXACT_TERMS),
    ),
    Table(
        "published_intervals",
        "galloping.tables.trials:published_intervals",
        _fits(INTERVALS),
        belongs=shown.has_trials(INTERVALS),
    ),
    Table(
        "paper_region",
        "galloping.tables.inference:region_table",
        lambda study: {
            "samples": sources.table(study, "paper_samples"),
            "readings": sources.table(study, "paper_readings"),
        },
        belongs=shown.has_trials(PAPER),
    ),
    Table(
        "paper_readings",
        "galloping.tables.inference:readings",
        _fits(PAPER),
        belongs=shown.has_trials(PAPER),
    ),
    Table(
        "paper_left_out",
        "galloping.tables.inference:left_out",
        lambda study: {"samples": sources.table(study, "paper_samples")},
        belongs=shown.has_trials(PAPER),
    ),
    Table(
        "paper_exclusions",
        "galloping.tables.inference:exclusions",
        _fits(PAPER),
        belongs=shown.has_trials(PAPER),
    ),
    Table(
        "paper_samples",
        "galloping.tables.inference:region_samples",
        _fits(PAPER),
        lambda study: {"seed": study.settings.measurement.seed},
        belongs=shown.has_trials(PAPER),
        is_compared=False,
        is_shown=False,
    ),
)  # fmt: skip
BY_NAME = {table.name: table for table in TABLES}


def of_study(study: Study) -> list[Table]:
    """Those that a study has."""
    return [table for table in TABLES if table.belongs(study)]
