"""The figures of the study, without importing any of them.

A figure is a function, an entry here and a caption, `workflow/report/figures/{name}.rst`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from galloping.configuration.trials import EXACT_TERMS, INTERVALS, MODEL_ERROR, PAPER, TRUST
from galloping.measurement.protocols import Protocol
from galloping.study import shown, sources
from galloping.study.cells import Cell, Study
from galloping.study.kinds import BOUND, NOISE, SUBSET
from galloping.study.shown import Pair
from galloping.study.sources import Sources


def _nothing(study: Study) -> dict:
    return {}


@dataclass(frozen=True)
class Figure:
    """One figure.

    name: of its files. label: in the report. function: `module:function`, imported only by the job
    that draws it; it takes what is read, by name, and `settings`, and returns a matplotlib Figure.
    reads, settings: of a study, in plain values. belongs: whether a study has it.
    """

    name: str
    label: str
    function: str
    reads: Callable[[Study], Sources] = _nothing
    settings: Callable[[Study], Mapping] = _nothing
    belongs: Callable[[Study], bool] = shown.has_lines


def _table(name: str) -> Callable[[Study], Sources]:
    return lambda study: {"table": sources.table(study, name)}


def _of_first_case(*kinds: Callable) -> Callable[[Study], Sources]:
    """Files of the first case, named after what they are."""
    return lambda study: {
        kind.__name__: kind(study, shown.first_case(study).name) for kind in kinds
    }


def _everything(study: Study) -> dict:
    """Cases, protocols and methods in the study's order."""
    return {
        "cases": [case.name for case in study.cases],
        "protocols": [protocol.name for protocol in study.protocols],
        "methods": [*(method.name for method in study.methods), BOUND],
    }


def _unit(study: Study, protocol: Protocol) -> str:
    """Of its noise levels."""
    return protocol.noise_unit(study.settings.measurement.state_noise == "relative")


def _noise_labels(study: Study) -> dict[str, str]:
    """Of the axes of each protocol."""
    return {p.name: f"noise level, {_unit(study, p)}" for p in study.protocols}


def _along(study: Study, kind: str, *quantities: str) -> dict:
    """Scores of whole records against noise, or of subsets against their points."""
    x, labels = "level", _noise_labels(study)
    if kind == SUBSET:
        x, labels = "points", dict.fromkeys(labels, "points")
    return {"kind": kind, "x": x, "labels": labels, "quantities": list(quantities)}


def _papers(kind: str, *quantities: str) -> Callable[[Study], Mapping]:
    """The paper's method on the first case."""
    return lambda study: {
        "case": shown.first_case(study).name,
        **_pair(shown.paper_pair(study)),
        **_along(study, kind, *quantities),
    }


def _draws(study: Study) -> Sources:
    """Scores of the paper's method, and its many draws where the study has them."""
    case = shown.first_case(study).name
    more = shown.is_papers(shown.paper_pair(study)) and case in shown.redrawn_cases(study)
    draws = {"draws": sources.paper_draws(study, case)} if more else {}
    return {"table": sources.table(study, "scores"), **draws}


def _all_methods(kind: str, values: str, *quantities: str) -> Callable[[Study], Mapping]:
    """values: the table with the numbers."""
    return lambda study: (
        _everything(study) | _along(study, kind, *quantities) | {"values": f"{values}.csv"}
    )


def _with_subset_level(study: Study) -> dict:
    return _everything(study) | {"level": study.settings.measurement.subsets.level}


def _first_line(study: Study) -> dict:
    case = shown.first_case(study)
    return {"case": case.name, "line": case.line}


def _pair(pair: Pair) -> dict:
    protocol, method = pair
    return {"protocol": protocol.name, "method": method.name}


def _flow(study: Study) -> dict:
    measurement = study.settings.measurement
    return {
        "degree": study.settings.identification.degree,
        "protocols": [protocol.name for protocol in study.protocols],
        "methods": [method.name for method in study.methods],
        "levels": [min(measurement.levels), max(measurement.levels)],
        "points": [min(measurement.subsets.points), max(measurement.subsets.points)],
        "replicates": measurement.replicates,
    }


def _recovery_reads(study: Study) -> Sources:
    cells = {case.name: shown.least_noise(study, case) for case in study.cases}
    return {
        "trajectories": {name: sources.trajectory(study, name) for name in cells},
        "reconstructions": {n: sources.reconstructions(study, c) for n, c in cells.items()},
    }


def _recovery(study: Study) -> dict:
    return {
        "cases": [case.name for case in study.cases],
        **_pair(shown.paper_pair(study)),
        "level": min(study.settings.measurement.levels),
    }


COEFFICIENT_LEVELS = (0.01, 0.03, 0.05)
HISTORY_LEVELS = (0.05, 0.1, 0.15)


def _coefficient_cells(study: Study) -> list[Cell]:
    """None where the first case has no true coefficients."""
    if shown.first_case(study).is_continuous:
        return []
    return shown.noise_cells(study, shown.paper_pair(study), COEFFICIENT_LEVELS)


def _coefficient_reads(study: Study) -> Sources:
    pair = shown.paper_pair(study)
    return {
        "model": sources.model(study, shown.first_case(study).name),
        "identified": {
            cell.name: sources.identified(study, cell, pair[1].family)
            for cell in _coefficient_cells(study)
        },
    }


def _coefficients(study: Study) -> dict:
    return {
        "case": shown.first_case(study).name,
        **_pair(shown.paper_pair(study)),
        "levels": {cell.name: cell.level for cell in _coefficient_cells(study)},
        "unit": _unit(study, shown.paper_pair(study)[0]),
        "degree": study.settings.identification.degree,
    }


def _histories(
    cells: Callable[[Study, Protocol], Mapping[str, str]], pair: Callable[[Study], Pair]
) -> tuple[Callable[[Study], Sources], Callable[[Study], Mapping]]:
    """What is read, and the settings, of time histories. cells: labels by name of the cell."""

    def named(study: Study) -> list[tuple[Cell, str]]:
        case, (protocol, _) = shown.first_case(study).name, pair(study)
        labels = cells(study, protocol)
        return [(study.cell(case, protocol.name, name), labels[name]) for name in labels]

    def reads(study: Study) -> Sources:
        return {
            "trajectory": sources.trajectory(study, shown.first_case(study).name),
            "reconstructions": {c.id: sources.reconstructions(study, c) for c, _ in named(study)},
        }

    def settings(study: Study) -> dict:
        return {
            "case": shown.first_case(study).name,
            **_pair(pair(study)),
            "cells": {cell.id: label for cell, label in named(study)},
            "window": list(study.settings.simulation.steady_window),
        }

    return reads, settings


def _noisy(study: Study, protocol: Protocol) -> dict[str, str]:
    cells = shown.noise_cells(study, shown.paper_pair(study), HISTORY_LEVELS)
    unit = _unit(study, protocol)
    return {cell.name: f"noise level {cell.level:g} ({unit})" for cell in cells}


def _subsets(study: Study, protocol: Protocol) -> dict[str, str]:
    cells = reversed(shown.amount_cells(study, shown.paper_pair(study)))  # the paper's order
    return {cell.name: f"{cell.samples} points" for cell in cells}


def _claims(study: Study) -> dict:
    pairs = shown.claim_pairs(study)
    return {"combinations": [[protocol.name, method.name] for protocol, method in pairs]}


def _overview(study: Study) -> dict:
    protocol = shown.sensor_protocol(study)
    return {
        "case": shown.first_case(study).name,
        "protocol": protocol.name,
        "label": _noise_labels(study)[protocol.name],
    }


def _limit_cycles(study: Study) -> Sources:
    return {name: sources.table(study, of) for name, of in LIMIT_CYCLES.items()}


OPEN_LABELS = {
    "wind_speed": "wind, m/s",
    "damping_vertical": "$\\zeta_v$",
    "damping_horizontal": "$\\zeta_w$",
    "bundle_dimension": "$D$, m",
    "release_vertical": "$q_v(0)$, m",
    "release_horizontal": "$q_w(0)$, m",
    "threshold": "threshold",
}
LIMIT_CYCLES = {"cycles": "limit_cycles", "bifurcations": "bifurcations"}


def _cases(study: Study) -> dict:
    return {"cases": [case.name for case in study.cases]}


def _wind(study: Study) -> dict:
    lines = {case.name: case.line for case in study.cases}
    return {"cases": lines, "parameter": "wind_speed", "label": "wind speed, m/s"}


def _resonance(study: Study) -> dict:
    return {
        "case": shown.first_case(study).name,
        "x_label": "wind speed, m/s",
        "y_label": "tension of a sub-conductor, kN",
        "y_scale": 1000,
    }


def _orbits(study: Study) -> Sources:
    return {"orbits": {case.name: sources.orbits(study, case.name) for case in study.cases}}


def _predicted(study: Study) -> dict:
    case = shown.first_case(study)
    cells = shown.predicted_cells(study, case.name)
    first = next(iter(cells.values()), None)
    methods = shown.predicting_methods(first) if first else [""]
    return {
        "case": case.name,
        "protocols": list(cells),
        "method": methods[0],
        "replicate": 0,
        "recorded": case.line["wind"]["speed"],
        **({"peer": methods[1]} if len(methods) > 1 else {}),
    }


FIGURES = (
    Figure(
        "printed",
        "the paper's printed numbers beside ours",
        "galloping.figures.against_paper:draw_printed",
        _table("paper"),
        lambda study: {"case": next(iter(shown.departures_from_paper(study)))},
        belongs=lambda study: bool(shown.departures_from_paper(study)),
    ),
    Figure(
        "figure01",
        "01 line and coordinates",
        "galloping.figures.schematics:draw_line",
        _of_first_case(sources.model),
        _first_line,
    ),
    Figure(
        "figure02",
        "02 aerodynamic load",
        "galloping.figures.schematics:draw_aerodynamic_load",
        _of_first_case(sources.trajectory),
        _first_line,
    ),
    Figure("figure03", "03 flow chart", "galloping.figures.schematics:draw_flow", settings=_flow),
    Figure(
        "figure04",
        "04 motion without noise",
        "galloping.figures.histories:draw_recovery",
        _recovery_reads,
        _recovery,
    ),
    Figure(
        "figure05",
        "05 coefficients under noise",
        "galloping.figures.each_term:draw_coefficients",
        _coefficient_reads,
        _coefficients,
    ),
    Figure(
        "figure06",
        "06 coefficient error against noise",
        "galloping.figures.errors:draw_draws",
        _draws,
        _papers(NOISE, "coefficients"),
    ),
    Figure(
        "figure06_methods",
        "06, all methods: coefficient error against noise",
        "galloping.figures.errors:draw_methods",
        _table("scores"),
        _all_methods(NOISE, "noise_coefficients", "coefficients"),
    ),
    Figure(
        "figure07",
        "07 R2 against noise",
        "galloping.figures.errors:draw_draws",
        _draws,
        _papers(NOISE, "r2"),
    ),
    Figure(
        "figure07_methods",
        "07, all methods: R2 against noise",
        "galloping.figures.errors:draw_methods",
        _table("scores"),
        _all_methods(NOISE, "noise_r2", "r2"),
    ),
    Figure(
        "figure08",
        "08 time histories under noise",
        "galloping.figures.histories:draw_histories",
        *_histories(_noisy, shown.paper_pair),
    ),
    Figure(
        "figure08_methods",
        "08, our method: time histories under noise",
        "galloping.figures.histories:draw_histories",
        *_histories(_noisy, shown.our_pair),
        belongs=shown.has_ours,
    ),
    Figure(
        "figure09",
        "09 time histories by amount of data",
        "galloping.figures.histories:draw_histories",
        *_histories(_subsets, shown.paper_pair),
    ),
    Figure(
        "figure09_methods",
        "09, our method: time histories by amount of data",
        "galloping.figures.histories:draw_histories",
        *_histories(_subsets, shown.our_pair),
        belongs=shown.has_ours,
    ),
    Figure(
        "figure10",
        "10 R2 and amplitude by amount of data",
        "galloping.figures.errors:draw_draws",
        _draws,
        _papers(SUBSET, "r2", "amplitude"),
    ),
    Figure(
        "figure10_methods",
        "10, all methods: amplitude by amount of data",
        "galloping.figures.errors:draw_methods",
        _table("scores"),
        _all_methods(SUBSET, "data_amount", "amplitude"),
    ),
    Figure(
        "claims",
        "claims of the paper",
        "galloping.figures.against_paper:draw_claims",
        _table("claims"),
        _claims,
    ),
    Figure(
        "overview",
        "overview: error against noise, and the bound",
        "galloping.figures.errors:draw_overview",
        lambda study: _table("scores")(study) | {"peers": sources.table(study, "peers")},
        _overview,
    ),
    Figure(
        "efficiency",
        "efficiency against noise",
        "galloping.figures.errors:draw_efficiency",
        _table("efficiency"),
        lambda study: _everything(study) | {"labels": _noise_labels(study)},
    ),
    Figure(
        "identifiability",
        "identifiability of each term",
        "galloping.figures.each_term:draw_identifiability",
        _table("identifiability"),
        _with_subset_level,
    ),
    Figure(
        "limit_cycles",
        "from which wind on, and how far",
        "galloping.figures.settled_motion:draw_limit_cycles",
        _limit_cycles,
        _wind,
    ),
    Figure(
        "resonance_map",
        "where the 2:1 resonance lies",
        "galloping.figures.settled_motion:draw_resonance_map",
        _table("resonance_map"),
        _resonance,
    ),
    Figure(
        "orbits",
        "orbits at mid-span",
        "galloping.figures.engineering:draw_orbits",
        _orbits,
        lambda study: {"cases": {case.name: case.released for case in study.cases}},
    ),
    Figure(
        "prediction",
        "other wind speeds, from an identified model",
        "galloping.figures.settled_motion:draw_prediction",
        _table("prediction"),
        _predicted,
    ),
    Figure(
        "limit_cycle_ahead",
        "the limit cycle ahead of its time",
        "galloping.figures.settled_motion:draw_limit_cycle_ahead",
        _table("limit_cycle_ahead"),
        lambda study: {"window": list(study.settings.simulation.steady_window)},
    ),
    Figure(
        "reduction",
        "what two modes are worth",
        "galloping.figures.verdicts:draw_reduction",
        _table("reduction"),
    ),
    Figure(
        "measures",
        "what stops it",
        "galloping.figures.engineering:draw_measures",
        _table("measures"),
        _cases,
    ),
    Figure(
        "reproduction",
        "what the missing parameters decide",
        "galloping.figures.against_paper:draw_reproduction",
        _table("reproduction"),
        lambda study: {"labels": OPEN_LABELS},
        belongs=lambda study: bool(shown.redrawn_cases(study)),
    ),
    Figure(
        "trust",
        "how often each status is right",
        "galloping.figures.verdicts:draw_trust",
        _table("fits"),
        belongs=shown.has_trials(TRUST),
    ),
    Figure(
        "model_error",
        "what a recording of a real line gives",
        "galloping.figures.verdicts:draw_model_error",
        _table("model_error"),
        belongs=shown.has_trials(MODEL_ERROR),
    ),
    Figure(
        "published_terms",
        "exact terms beside published methods",
        "galloping.figures.verdicts:draw_published_terms",
        _table("published_terms"),
        belongs=shown.has_trials(EXACT_TERMS),
    ),
    Figure(
        "published_intervals",
        "intervals after selection beside published ones",
        "galloping.figures.verdicts:draw_published_intervals",
        _table("published_intervals"),
        belongs=shown.has_trials(INTERVALS),
    ),
    Figure(
        "paper_region",
        "what the paper leaves out",
        "galloping.figures.against_paper:draw_region",
        lambda study: {
            "samples": sources.table(study, "paper_samples"),
            "readings": sources.table(study, "paper_readings"),
        },
        belongs=shown.has_trials(PAPER),
    ),
)
BY_NAME = {figure.name: figure for figure in FIGURES}


def of_study(study: Study) -> list[Figure]:
    """Those that a study has."""
    return [figure for figure in FIGURES if figure.belongs(study)]
