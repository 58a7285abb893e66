"""Effect of measures against galloping: onset wind, limit cycle at the design wind, clearance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from galloping.cycles.limit_cycles import find_cycle_from_motion
from galloping.cycles.prediction import Split, cycle_intervals, find_nearby_cycles, split
from galloping.cycles.settling import Settled, settle
from galloping.identification.identified_model import IdentifiedModel
from galloping.line.galerkin import STATES, coefficients, make_line_and_modes, make_model
from galloping.line.measures import NO_MEASURE, Measure, added_damping_and_mass, clearance
from galloping.model.intervals import interval_of_draws
from galloping.model.polynomial import linear_term
from galloping.trajectory.simulation import Simulator

# Number of points of the outline of a motion. With 256, the clearance of an irregular motion was
# 0.1 to 0.2 m too large.
OUTLINE_POINTS = 2000
DAMPING = (("dq_v", "vertical"), ("dq_w", "horizontal"))


@dataclass(frozen=True)
class Design:
    """Design conditions of an overhead line: wind, initial state, phase distance and clearance.

    wind: m/s. start: (n_states,) initial state. distance: (horizontal, vertical) in m of two phases
    at rest. limit: clearance that they must keep, m.
    """

    wind: float
    start: np.ndarray
    distance: tuple[float, float]
    limit: float


def damping_ratios(case: Mapping) -> dict[str, float]:
    """Return the structural damping ratio of each mode, as a dict by the velocity of the mode."""
    return {state: case["damping"][name] for state, name in DAMPING}


def derive_parts(case: Mapping) -> Split:
    """Derive structural and aerodynamic parts of an overhead line model from the data of the line.

    They have no uncertainty.
    """
    line = make_model(coefficients(case))
    exact = IdentifiedModel(line, known=(0, 1))
    exact = replace(exact, covariance=np.eye(exact.support.sum()))
    parts = split([exact], [case["wind"]["speed"]], damping_ratios(case))
    return replace(parts, covariance=np.zeros_like(parts.covariance))


def apply_measure(parts: Split, case: Mapping, measure: Measure) -> Split:
    """Compute the model of an overhead line after a countermeasure to galloping, such as a damper.

    The model is identified, or that of `derive_parts`. Each part changes in proportion, as it does
    in the derivation. parts: of the line that `case` describes.
    """
    changed_case = measure.change(case)
    old, new = derive_parts(case), derive_parts(changed_case)
    old_values, new_values = old.by_term(), new.by_term()
    damping, mass = added_damping_and_mass(changed_case, measure)
    masses = np.array([mode.mass for mode in make_line_and_modes(changed_case)[1:]])
    lighter = masses / (masses + mass)  # of forces by mass, with the added point masses
    factor = np.append(np.ones(2), lighter)  # of kinematic equations, and of those of motion
    ratios = np.array([
        factor[part[0]]
        * (new_values.get(part, 0.0) / old_values[part] if old_values.get(part) else 1.0)
        for part in parts.by_term()
    ])  # fmt: skip
    fixed = parts.fixed.copy()
    for k, (state, _) in enumerate(DAMPING):
        row = STATES.index(state)
        linear = linear_term(row, len(STATES))
        term = parts.terms.index(linear)
        old_rate, changed = (each.fixed[row, each.terms.index(linear)] for each in (old, new))
        # the damping ratio stays, the frequency falls with the added mass
        fixed[row, term] *= np.sqrt(lighter[k]) * (changed / old_rate if old_rate else 1.0)
        fixed[row, term] -= damping[k] / (masses + mass)[k]
    return replace(
        parts,
        fixed=fixed,
        values=ratios * parts.values,
        covariance=ratios * parts.covariance * ratios[:, np.newaxis],
    )


def critical_winds(parts: Split, values: np.ndarray) -> np.ndarray:
    """Compute the wind speed at which vertical damping is zero, for samples of coefficients.

    values: (n, n_values) the samples. Returns (n,). The result is the model's onset if its linear
    damping is uncoupled, as in the derivation.
    """
    row = STATES.index("dq_v")
    term = parts.terms.index(linear_term(row, len(STATES)))
    is_damping = (parts.entries == (row, term)).all(axis=1)
    structure, wind = (
        values[:, is_damping & (parts.powers == power)].sum(axis=1) for power in (0, 1)
    )
    structure = parts.fixed[row, term] + structure
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(wind > 0, -structure / wind, np.inf)


def with_measure(
    parts: Split,
    case: Mapping,
    measure: Measure,
    design: Design,
    simulator: Simulator,
    draws: np.ndarray,
) -> dict:
    """Compute onset, amplitudes and clearance of an overhead line with one countermeasure.

    The result is a table row. The model of the line that `case` describes is identified, or that of
    `derive_parts`. draws: (n, n_values) samples of the parts' values, for the intervals; may be
    empty. A number has the interval `_low` and `_high`, NaN if unknown: critical_wind_m_s, infinite
    if the line never gallops; vertical_amplitude_m and horizontal_amplitude_m, at the design wind;
    clearance_m. kind: of the motion there, `cycle`, `rest`, or another.
    """
    line = apply_measure(parts, case, measure)
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled = draws * np.where(parts.values != 0, line.values / parts.values, 1.0)
    (critical,) = critical_winds(line, line.values[np.newaxis])
    motion = settle(simulator, line.model(design.wind), design.start)
    kind, v, w, room = motion.kind, *(((np.nan,) * 3,) * 3)
    # near the critical wind a motion may die out too slowly to settle
    if kind == "rest" or (kind == "irregular" and critical >= design.wind):
        still = clearance(np.zeros((1, 2)), np.zeros((1, 2)), design.distance)
        kind, v, w, room = "rest", (0.0,) * 3, (0.0,) * 3, (still,) * 3
    elif np.all(np.isfinite(motion.states)):
        orbits, half, centre = [], motion.half_range, outline(motion)
        if (point := find_cycle_from_motion(line.family(), design.wind, motion)) is not None:
            orbit = point.solution
            orbits = find_nearby_cycles((line.model(orbit.value, each) for each in scaled), orbit)
            half, centre = orbit.half_range(), places(orbit.states)
        least, *others = (
            clearance(each, each, design.distance)
            for each in (centre, *(places(orbit.states) for orbit in orbits))
        )
        room = least, *interval_of_draws(others)
        v, w, *_ = zip(half, *cycle_intervals(orbits, len(STATES))[:, :-1], strict=True)
    wind = critical, *interval_of_draws(critical_winds(line, scaled))
    numbers = {
        "critical_wind_m_s": wind,
        "vertical_amplitude_m": v,
        "horizontal_amplitude_m": w,
        "clearance_m": room,
    }
    results = {
        f"{name}{end}": float(value)
        for name, values in numbers.items()
        for end, value in zip(("", "_low", "_high"), values, strict=True)
    }
    return {
        "measure": measure.label, **results, "kind": kind, "required_clearance_m": design.limit,
        "is_clearance_sufficient": bool(room[0] >= design.limit),
        "design_wind_m_s": design.wind, "source": measure.source, "note": measure.limit,
    }  # fmt: skip


def outline(motion: Settled) -> np.ndarray:
    """Return the positions at mid-span, horizontal and vertical, along a settled motion.

    They are places (w, v), (n, 2): successive samples of a limit cycle, whose periods are equal;
    otherwise samples from the whole window.
    """
    stride = 1 if motion.kind == "cycle" else max(1, len(motion.states) // OUTLINE_POINTS)
    return places(motion.states[::stride][:OUTLINE_POINTS])


def places(states: np.ndarray) -> np.ndarray:
    """Extract the horizontal and vertical displacement at mid-span from states.

    From (n, n_states) to places (w, v), (n, 2).
    """
    return states[:, [STATES.index("q_w"), STATES.index("q_v")]]


def rank_measures(
    parts: Split,
    case: Mapping,
    measures: Sequence[Measure],
    design: Design,
    simulator: Simulator,
    draws: np.ndarray,
) -> list[dict]:
    """Rank galloping countermeasures by the vertical amplitude that remains, as table rows.

    The rows are those of `with_measure`; the line as it is has one too. The smallest vertical
    motion comes first, and of two lines at rest the one with the higher critical wind; a line
    without a bounded motion comes last.
    """
    rows = [
        with_measure(parts, case, measure, design, simulator, draws)
        for measure in (NO_MEASURE, *measures)
    ]
    amplitude, wind = "vertical_amplitude_m", "critical_wind_m_s"
    rows.sort(key=lambda row: (np.nan_to_num(row[amplitude], nan=np.inf), -row[wind]))
    return [{"rank": rank, **row} for rank, row in enumerate(rows, start=1)]
