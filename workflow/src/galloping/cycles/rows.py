"""Tidy rows of sweeps: limit cycles, bifurcations, maps, predictions, clearance.

Their columns are described in `report/tables.csv`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from galloping.cycles.continuation import Branch, Range
from galloping.cycles.diagram import HOPF, Diagram, diagram
from galloping.cycles.family import critical_wind, initial_state, line_family, line_model, parameter
from galloping.cycles.limit_cycles import Orbit
from galloping.cycles.prediction import Prediction
from galloping.cycles.ranking import outline
from galloping.cycles.settling import SPAN_WATCH, Settled, Watch, settle
from galloping.line.galerkin import STATES, Line, make_line_and_modes
from galloping.line.measures import clearance, design_ellipses, envelope
from galloping.trajectory.simulation import Simulator

SIMULATION = "simulation"
# Simulation near a bifurcation, where amplitudes after 4,000 s err by a third of 1 %.
LONG_WATCH = SPAN_WATCH.during(16000.0)
MAX_CYCLE_SIZE = 2.0  # largest size of an orbit, in sags: the equations describe no larger one


def line_diagram(
    case: Mapping, name: str, low: float, high: float, simulator: Simulator
) -> Diagram:
    """Compute the bifurcation diagram of an overhead line along one of its parameters.

    Without a Hopf bifurcation in the range, it starts from the final motion of the case in the
    middle of the range; a range without a limit cycle is listed among the failures. Raises
    ValueError for a parameter that cannot be varied.
    """
    family = line_family(case, name)
    span = Range(low, high, ceiling=MAX_CYCLE_SIZE * Line.from_case(case).sag)
    branches = diagram(family, span, np.zeros(len(STATES)))
    if branches.cycles or branches.failures:
        return branches
    middle = (low + high) / 2
    settled = settled_line(parameter(name).at(case, middle), simulator)
    if settled.kind != "cycle":
        reason = (
            f"no limit cycle: no Hopf bifurcation in {low:g}..{high:g} {family.unit}, and at "
            f"{middle:g} the motion ends as: {settled.kind}"
        )
        return replace(branches, failures=(reason,))
    motion = middle, settled.time, settled.states
    return diagram(family, span, np.zeros(len(STATES)), motion=motion)


def settled_line(case: Mapping, simulator: Simulator, watch: Watch = SPAN_WATCH) -> Settled:
    """Simulate an overhead line from its initial state until its motion has settled."""
    return settle(simulator, line_model(case), np.array(initial_state(case)), watch)


def limit_cycle_rows(label: str, name: str, along: Diagram) -> list[dict]:
    """Return a table row for every limit cycle of a bifurcation diagram.

    label: of the case, name: of the parameter.
    """
    return [
        _place_columns(label, name, along.family.unit, point.solution.value)
        | {"branch": branch, "point": k, "stable": point.stability.stable}
        | _size_columns(point.solution)
        | {"largest_multiplier": point.stability.largest}
        | {"trivial_multiplier_error": point.stability.trivial_defect}
        for branch, cycles in along.cycles.items()
        for k, point in enumerate(cycles.points)
    ]


def _size_columns(orbit: Orbit) -> dict:
    return _amplitude_columns(*orbit.half_range()[:2]) | {"period_s": float(orbit.period)}


def _amplitude_columns(vertical: float, horizontal: float) -> dict:
    return {"vertical_amplitude_m": float(vertical), "horizontal_amplitude_m": float(horizontal)}


def _place_columns(label: str, name: str, unit: str, value: float) -> dict:
    return {"case": label, "parameter": name, "unit": unit, "value": float(value)}


def bifurcation_rows(label: str, name: str, along: Diagram, case: Mapping) -> list[dict]:
    """Return a table row for every bifurcation and every branch end of a bifurcation diagram."""
    rows = []

    def add_row(branch: str, value: float, what: str, **further: Any) -> None:
        row = _place_columns(label, name, along.family.unit, value)
        row |= {"branch": branch, "name": what}
        nothing = {"located": True, "closed_form_wind_m_s": np.nan, **_amplitude_columns(0.0, 0.0)}
        rows.append(row | nothing | {"period_s": np.nan, "note": ""} | further)

    def add_end(name: str, branch: Branch) -> None:
        verdict = "" if branch.complete else "incomplete: "
        last = branch.points[-1].solution.value
        none = _amplitude_columns(np.nan, np.nan)
        add_row(name, last, "end", **none, note=f"{verdict}{branch.reason}")

    for b in along.equilibria.bifurcations:
        further: dict[str, Any] = {"located": b.located}
        if b.name == HOPF:
            further["period_s"] = 2 * np.pi / b.point.stability.critical()[0]
            if name == "wind_speed":
                further["closed_form_wind_m_s"] = critical_wind(case)
        add_row("equilibrium", b.point.solution.value, b.name, **further)
    add_end("equilibrium", along.equilibria)
    for branch, cycles in along.cycles.items():
        for b in cycles.bifurcations:
            orbit = b.point.solution
            add_row(branch, orbit.value, b.name, located=b.located, **_size_columns(orbit))
        add_end(branch, cycles)
    for failure in along.failures:
        add_row(failure.partition(":")[0], np.nan, "end", located=False, note=failure)
    return rows


def simulation_rows(
    label: str, case: Mapping, name: str, values: Sequence[float], simulator: Simulator
) -> list[dict]:
    """Simulate an overhead line at each value of a parameter; tabulate how each motion ends.

    Each motion begins at the initial state of the case.
    """
    varied = parameter(name)
    return [
        _place_columns(label, name, varied.unit, value)
        | {"branch": SIMULATION}
        | _motion_columns(settled_line(varied.at(case, value), simulator))
        for value in values
    ]


def _motion_columns(motion: Settled) -> dict:
    ends = {
        f"{direction}_amplitude_{end}_m": float(amplitudes[k])
        for k, direction in enumerate(("vertical", "horizontal"))
        for end, amplitudes in (("min", motion.lowest), ("max", motion.highest))
    }
    return {"kind": motion.kind, **_amplitude_columns(*motion.half_range[:2]), **ends}


def map_rows(
    label: str,
    case: Mapping,
    across: tuple[str, Sequence[float]],
    up: tuple[str, Sequence[float]],
    simulator: Simulator,
) -> list[dict]:
    """Simulate an overhead line on a grid of two parameters; tabulate how each motion ends.

    Each motion begins at the initial state of the case. across, up: name and values of each.
    """
    (x_name, x_values), (y_name, y_values) = across, up
    x_parameter, y_parameter = parameter(x_name), parameter(y_name)
    rows = []
    for y, x in product(map(float, y_values), map(float, x_values)):
        varied = x_parameter.at(y_parameter.at(case, y), x)
        _, vertical, horizontal = make_line_and_modes(varied)
        rows.append({
            "case": label, "x_parameter": x_name, "x_unit": x_parameter.unit, "x": x,
            "y_parameter": y_name, "y_unit": y_parameter.unit, "y": y,
            "frequency_ratio": vertical.frequency / horizontal.frequency,
            **_motion_columns(settled_line(varied, simulator)),
        })  # fmt: skip
    return rows


def prediction_rows(
    cell: Mapping[str, object], predicted: Prediction, true: np.ndarray, status: str
) -> list[dict]:
    """Tabulate predicted and true amplitudes, with a row for each wind speed and direction.

    cell: case, protocol, method, replicate, which begin each row. true: (n_winds, 2) half ranges
    (v, w). status: of the identified model, which says whether the band is reliable.
    """
    rows, columns = [], (predicted.amplitude, predicted.low, predicted.high, true)
    for (k, wind), (axis, direction) in product(enumerate(predicted.winds), enumerate("vw")):
        value, low, high, reality = (float(column[k, axis]) for column in columns)
        rows.append({
            **cell, "wind_m_s": float(wind), "direction": direction, "predicted_m": value,
            "low_m": low, "high_m": high, "true_m": reality,
            "error_percent": 100 * abs(value / reality - 1),
            "interval_contains_truth": bool(low <= reality <= high),
            "share_without_limit_cycle": float(predicted.unresolved[k]), "status": status,
            "reason": predicted.reason,
        })  # fmt: skip
    return rows


def clearance_rows(
    label: str,
    case: Mapping,
    motions: Mapping[float, Settled],
    distance: tuple[float, float],
    limit: float,
) -> list[dict]:
    """Tabulate size and phase clearance of galloping orbits at mid-span and of design ellipses.

    motions: final motion of the line, by wind speed in m/s. distance: (horizontal, vertical) in m
    of the phases at rest; limit: clearance in m to keep.
    """
    outlines = [(what, np.nan, each.outline()) for what, each in design_ellipses(case).items()]
    outlines += [
        (motion.kind, float(wind), outline(motion))
        for wind, motion in motions.items()
        if np.all(np.isfinite(motion.states))
    ]
    rows = []
    for what, wind, places in outlines:
        room = dict(zip(("height_m", "width_m", "below_rest_m"), envelope(places), strict=True))
        least = clearance(places, places, distance)
        kept = {
            "least_clearance_m": least,
            "required_clearance_m": limit,
            "is_clearance_sufficient": least >= limit,
        }
        rows.append({"case": label, "orbit": what, "wind_m_s": wind, **room, **kept})
    return rows


def simulate_true_amplitudes(
    case: Mapping, winds: Sequence[float], simulator: Simulator
) -> np.ndarray:
    """Compute the true amplitudes of an overhead line at each wind speed by simulation.

    Final half ranges (v, w), (n_winds, 2); NaN without a limit cycle.
    """
    at = parameter("wind_speed").at
    motions = [settled_line(at(case, wind), simulator, LONG_WATCH) for wind in winds]
    return np.array(
        [m.half_range[:2] if m.kind == "cycle" else np.full(2, np.nan) for m in motions]
    )
