"""Sweep points as tidy rows: limit cycles, bifurcations, maps, predictions, clearance, measures.

Their columns are those of `report/tables.csv`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from galloping.cycles.continuation import Branch, Range
from galloping.cycles.diagram import HOPF, Diagram, diagram
from galloping.cycles.family import critical_wind, initial_state, line_family, parameter
from galloping.cycles.limit_cycles import Orbit, Settled, settle
from galloping.cycles.prediction import Prediction
from galloping.cycles.ranking import Design, Outcome, outline
from galloping.physics.galerkin import STATES, Line, at_rest
from galloping.physics.measures import clearance, design_ellipses, envelope
from galloping.simulation import Simulator

SIMULATION = "simulation"
PATIENT = 16000.0  # s: near a bifurcation, 4,000 s leave a third of a percent to settle
MEASURED = ("critical_wind_m_s", "v_m", "w_m", "clearance_m")  # of an outcome, with intervals
CEILING = 2.0  # sags: a larger orbit is no line's any more


def line_diagram(
    case: Mapping, name: str, low: float, high: float, simulator: Simulator
) -> Diagram:
    """The diagram of a case along a parameter.

    Where no Hopf bifurcation lies in the range, it starts from what the case settles to in the
    middle of the range; a range without a limit cycle says so among the failures. Raises
    ValueError for a parameter that cannot be varied.
    """
    family = line_family(case, name)
    span = Range(low, high, ceiling=CEILING * Line.from_case(case).sag)
    along = diagram(family, span, np.zeros(len(STATES)))
    if along.cycles or along.failures:
        return along
    middle = (low + high) / 2
    settled = settle(
        simulator, family.model(middle), initial_state(parameter(name).at(case, middle))
    )
    if settled.kind != "cycle":
        reason = (
            f"no limit cycle: no Hopf bifurcation in {low:g}..{high:g} {family.unit}, and at "
            f"{middle:g} the motion ends as: {settled.kind}"
        )
        return replace(along, failures=(reason,))
    motion = middle, settled.time, settled.states
    return diagram(family, span, np.zeros(len(STATES)), motion=motion)


def limit_cycle_rows(label: str, name: str, along: Diagram) -> list[dict]:
    """Every limit cycle of a diagram; label: of the case, name: of the parameter."""
    rows = []
    for branch, cycles in along.cycles.items():
        for k, point in enumerate(cycles.points):
            orbit, own = point.solution, point.stability
            rows.append({
                **_place(label, name, along.family.unit, orbit.value),
                "branch": branch, "point": k, "stable": own.stable, **_size(orbit),
                "largest_multiplier": own.largest, "trivial_defect": own.trivial_defect,
            })  # fmt: skip
    return rows


def _size(orbit: Orbit) -> dict:
    v, w = orbit.half_range()[:2]
    return {"v_m": float(v), "w_m": float(w), "period_s": float(orbit.period)}


def _place(label: str, name: str, unit: str, value: float) -> dict:
    return {"case": label, "parameter": name, "unit": unit, "value": float(value)}


def bifurcation_rows(label: str, name: str, along: Diagram, case: Mapping) -> list[dict]:
    """Bifurcations in the order of their branches, and how each branch ended."""
    rows = []

    def row(branch: str, value: float, what: str, **further: object) -> None:
        place = _place(label, name, along.family.unit, value) | {"branch": branch, "name": what}
        nothing = {"located": True, "closed_form": np.nan, "v_m": 0.0, "w_m": 0.0}
        rows.append(place | nothing | {"period_s": np.nan, "note": ""} | further)

    def end(of: str, branch: Branch) -> None:
        verdict = "" if branch.complete else "incomplete: "
        last = branch.points[-1].solution.value
        row(of, last, "end", v_m=np.nan, w_m=np.nan, note=f"{verdict}{branch.reason}")

    for b in along.equilibria.bifurcations:
        further = {"located": b.located}
        if b.name == HOPF:
            further["period_s"] = 2 * np.pi / b.point.stability.frequency
            if name == "wind_speed":
                further["closed_form"] = critical_wind(case)
        row("equilibrium", b.point.solution.value, b.name, **further)
    end("equilibrium", along.equilibria)
    for branch, cycles in along.cycles.items():
        for b in cycles.bifurcations:
            orbit = b.point.solution
            row(branch, orbit.value, b.name, located=b.located, **_size(orbit))
        end(branch, cycles)
    for failure in along.failures:
        row(failure.partition(":")[0], np.nan, "end", located=False, note=failure)
    return rows


def simulation_rows(
    label: str, case: Mapping, name: str, values: Sequence[float], simulator: Simulator
) -> list[dict]:
    """The long simulation of a case from its initial state at each value of a parameter."""
    family, varied, rows = line_family(case, name), parameter(name), []
    for value in values:
        motion = settle(simulator, family.model(value), initial_state(varied.at(case, value)))
        place = _place(label, name, family.unit, value)
        rows.append(place | {"branch": SIMULATION} | _motion(motion))
    return rows


def _motion(motion: Settled) -> dict:
    v, w = motion.half_range[:2]
    ends = {
        f"{axis}_{end}_m": float(of[k])
        for k, axis in enumerate("vw")
        for end, of in (("low", motion.lowest), ("high", motion.highest))
    }
    return {"kind": motion.kind, "v_m": float(v), "w_m": float(w), **ends}


def map_rows(
    label: str,
    case: Mapping,
    across: tuple[str, Sequence[float]],
    up: tuple[str, Sequence[float]],
    simulator: Simulator,
) -> list[dict]:
    """What the motion settles to over two parameters, from the case's initial state.

    across, up: name and values of each.
    """
    (x_name, x_values), (y_name, y_values) = across, up
    x_parameter, y_parameter = parameter(x_name), parameter(y_name)
    rows = []
    for y in y_values:
        outer = y_parameter.at(case, float(y))
        family = line_family(outer, x_name)
        for x in x_values:
            inner = x_parameter.at(outer, float(x))
            _, vertical, horizontal = at_rest(inner)
            motion = settle(simulator, family.model(x), initial_state(inner))
            rows.append(
                {"case": label, "x_parameter": x_name, "x_unit": x_parameter.unit, "x": float(x)}
                | {"y_parameter": y_name, "y_unit": y_parameter.unit, "y": float(y)}
                | {"frequency_ratio": vertical.frequency / horizontal.frequency}
                | _motion(motion)
            )
    return rows


def prediction_rows(
    cell: Mapping[str, object], predicted: Prediction, true: np.ndarray, verdict: str
) -> list[dict]:
    """One model's prediction beside the truth: a row for each wind speed and direction.

    cell: case, protocol, method, replicate, which begin each row. true: (n_winds, 2) half ranges
    (v, w). verdict: of the identification, which says whether the band can be trusted.
    """
    rows = []
    for k, wind in enumerate(predicted.winds):
        for axis, direction in enumerate(("v", "w")):
            values = (predicted.amplitude, predicted.low, predicted.high, true)
            value, low, high, reality = (float(of[k, axis]) for of in values)
            rows.append({
                **cell, "wind_m_s": float(wind), "direction": direction, "predicted_m": value,
                "low_m": low, "high_m": high, "true_m": reality,
                "error_percent": 100 * abs(value / reality - 1),
                "inside": bool(low <= reality <= high),
                "unresolved": float(predicted.unresolved[k]), "verdict": verdict,
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
    """Room that orbits at mid-span and design ellipses need, and the clearance of two phases.

    motions: what the line settles to, by wind speed in m/s. distance: (horizontal, vertical) in m
    of the phases at rest; limit: clearance in m to keep.
    """
    rows = []

    def row(what: str, wind: float, outline: np.ndarray) -> None:
        room = dict(zip(("height_m", "width_m", "below_m"), envelope(outline), strict=True))
        least = clearance(outline, outline, distance)
        kept = {"least_clearance_m": least, "limit_m": limit, "kept": least >= limit}
        rows.append({"case": label, "what": what, "wind_m_s": wind, **room, **kept})

    for what, ellipse in design_ellipses(case).items():
        row(what, np.nan, ellipse.outline())
    for wind, motion in motions.items():
        if np.all(np.isfinite(motion.states)):
            row(motion.kind, float(wind), outline(motion))
    return rows


def measure_rows(label: str, outcomes: Sequence[Outcome], design: Design) -> list[dict]:
    """Measures in their order."""
    rows = []
    for rank, of in enumerate(outcomes, start=1):
        numbers = of.critical_wind, of.v, of.w, of.clearance
        measured = {
            f"{name}{end}": value
            for name, values in zip(MEASURED, numbers, strict=True)
            for end, value in zip(("", "_low", "_high"), values, strict=True)
        }
        rows.append({
            "case": label, "rank": rank, "measure": of.measure.label, **measured,
            "kind": of.kind, "limit_m": design.limit,
            "kept": bool(of.clearance[0] >= design.limit), "design_wind_m_s": design.wind,
            "source": of.measure.source, "note": of.measure.limit,
        })  # fmt: skip
    return rows


def steady_truth(case: Mapping, winds: Sequence[float], simulator: Simulator) -> np.ndarray:
    """(n_winds, 2) half ranges (v, w) to which a case settles; NaN where it finds no cycle."""
    family = line_family(case, "wind_speed")
    start = initial_state(case)
    motions = [settle(simulator, family.model(w), start, duration=PATIENT) for w in winds]
    return np.array(
        [m.half_range[:2] if m.kind == "cycle" else np.full(2, np.nan) for m in motions]
    )
