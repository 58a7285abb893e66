"""Prediction of limit cycles at other wind speeds, by the quasi-static law of the terms.

A load that is quasi-static in alpha = (velocity)/U has terms with p velocity factors proportional
to U^(2-p): linear aerodynamic damping grows with U, quadratic damping is constant, cubic damping
falls as 1/U. Terms without velocities are structural and constant. The linear damping of a
coordinate by its own velocity has both parts. They are separated by known structural damping
ratios, or by recordings at two wind speeds.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import compress
from typing import Self

import numpy as np

from galloping.cycles import limit_cycles
from galloping.cycles.continuation import NotConverged, Range, correct_guess
from galloping.cycles.family import Family, constant_family
from galloping.cycles.limit_cycles import CycleProblem, Orbit
from galloping.cycles.settling import SPAN_WATCH, settle
from galloping.identification.drawn_models import draw_models_and_rivals
from galloping.identification.identified_model import IdentifiedModel
from galloping.model.intervals import (
    MIN_INTERVAL_DRAWS,
    MODEL_DRAWS,
    draw_normal,
    interval_of_draws,
)
from galloping.model.polynomial import Exponents, PolynomialModel, linear_term, velocity_pairs
from galloping.progress_reports import passing
from galloping.trajectory.simulation import Simulator

# Simulations that end near enough to a limit cycle for its correction.
RECORDED_WATCH = SPAN_WATCH.during(2000.0, 200.0)  # of the model at the recorded wind speed
FORECAST_WATCH = SPAN_WATCH.during(1500.0, 50.0)  # of an identified model, from an initial state
CORRECTION_TOLERANCE = 1e-4  # last correction, in steps: the error is about its square
# Shares of a change of model at which limit cycles are followed: at once, or in steps.
CHANGE_SHARES = (1.0,), (0.25, 0.5, 0.75, 1.0)
MAX_CYCLE_SIZE = 5.0  # largest size of an orbit, in sizes of that at the recorded wind speed


@dataclass(frozen=True)
class Split:
    """Model separated into structural and aerodynamic parts, for any wind speed.

    fixed: (n_states, n_terms) known part: kinematic equations, known structural damping. entries:
    (n, 2) equation and term of each unknown part, powers: (n,) of the wind speed in it, values:
    (n,) its coefficient of U^power, SI units, covariance: (n, n) of the values.
    """

    states: tuple[str, ...]
    terms: tuple[Exponents, ...]
    fixed: np.ndarray
    entries: np.ndarray
    powers: np.ndarray
    values: np.ndarray
    covariance: np.ndarray

    def model(self, wind: float, values: np.ndarray | None = None) -> PolynomialModel:
        """Make the model at a wind speed in m/s, optionally with other values of its parts."""
        parts = (self.values if values is None else values) * wind**self.powers
        coefficients = self.fixed.copy()
        np.add.at(coefficients, tuple(self.entries.T), parts)
        present = np.any(self.fixed, axis=0)  # at any wind: fewer than the library cost less
        present[self.entries[:, 1]] = True
        terms = tuple(compress(self.terms, present))
        return PolynomialModel(self.states, terms, coefficients[:, present])

    def by_term(self) -> dict[tuple[int, Exponents, float], float]:
        """Return the value of each unknown part by equation, term and power of the wind speed."""
        rows, columns = self.entries.T.tolist()
        terms = (self.terms[column] for column in columns)
        return dict(zip(zip(rows, terms, self.powers, strict=True), self.values, strict=True))

    def family(self) -> Family:
        """Make the family of models with the wind speed as parameter."""
        return Family(lambda wind: self.model(float(wind)), "wind speed", "m/s")

    def sampled(self, rng: np.random.Generator) -> np.ndarray:
        """Draw random values of the unknown parts from their normal distribution.

        Shape (MODEL_DRAWS, n); (0, n) if the covariance is not known.
        """
        if not np.all(np.isfinite(self.covariance)):
            return np.zeros((0, len(self.values)))
        return draw_normal(self.values, self.covariance, MODEL_DRAWS, rng)


def split(
    identified: Sequence[IdentifiedModel],
    winds: Sequence[float],
    damping: Mapping[str, float] | None = None,
) -> Split:
    """Split models identified at known wind speeds into structural and aerodynamic parts.

    The method is least squares; wind speeds are in m/s. damping: structural damping ratio of each
    velocity state, such as {"dq_v": 0.005}, if known. Raises ValueError if it is unknown and all
    wind speeds are equal, or if a ratio names no velocity.
    """
    first, damping = identified[0].model, damping or {}
    velocities = sorted(velocity_pairs(first.states).values())
    columns = {  # of each coordinate's velocity in its own equation of motion
        i: first.terms.index(linear)
        for i in velocities
        if (linear := linear_term(i, len(first.states))) in first.terms
    }
    unknown = sorted(set(damping) - {first.states[i] for i in columns})
    if unknown:
        raise ValueError(f"damping: {unknown[0]} is not the velocity of a coordinate of the model")
    free = [pair for pair in columns.items() if first.states[pair[0]] not in damping]
    if free and len(set(winds)) == 1:
        raise ValueError(
            f"damping: at one wind speed ({winds[0]:g} m/s) the structural damping of "
            f"{first.states[free[0][0]]} cannot be separated from the wind's; give its ratio, or "
            "recordings at two wind speeds"
        )
    support = np.any([one.support for one in identified], axis=0)
    fixed = np.where(support, 0.0, first.coefficients)
    for state, ratio in damping.items():
        i = first.states.index(state)
        fixed[i, columns[i]] = -2 * ratio * np.sqrt(_squared_frequency(identified, i))
    entries, powers = [], []
    for i, j in np.argwhere(support).tolist():
        # only equations of motion contain loads; d(q)/dt = dq does not depend on the wind
        order = sum(first.terms[j][k] for k in velocities) if i in velocities else 0
        entries.append((i, j))
        powers.append(2 - order if order else 0)
        if (i, j) in free:
            entries.append((i, j))
            powers.append(0)
    return _least_squares(identified, winds, fixed, np.array(entries), np.array(powers, float))


def _squared_frequency(identified: Sequence[IdentifiedModel], equation: int) -> float:
    """Compute the squared natural frequency of an equation of motion, rad^2/s^2."""
    model = identified[0].model
    position = model.states.index(model.states[equation][1:])
    linear = model.terms.index(linear_term(position, len(model.states)))
    value = -np.mean([one.model.coefficients[equation, linear] for one in identified])
    if not value > 0:
        raise ValueError(
            f"damping: the equation of {model.states[equation]} has no positive stiffness, so a "
            "damping ratio says nothing about it"
        )
    return float(value)


def _least_squares(identified, winds, fixed, entries, powers) -> Split:
    """Solve for the unknown parts, weighted by the covariance of each model.

    If a model has no covariance, all have the same weight and the result has none.
    """
    have_covariance = all(one.covariance.size for one in identified)
    model = identified[0].model
    information = np.zeros((len(entries), len(entries)))
    right = np.zeros(len(entries))
    for one, wind in zip(identified, winds, strict=True):
        pairs = np.argwhere(one.support)
        design = np.all(pairs[:, np.newaxis] == entries, axis=2) * wind**powers
        weighted = np.linalg.solve(one.covariance, design).T if have_covariance else design.T * 1.0
        information += weighted @ design
        right += weighted @ (one.model.coefficients - fixed)[tuple(pairs.T)]
    scale = 1 / np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information * scale * scale[:, np.newaxis])
    covariance = covariance * scale * scale[:, np.newaxis]
    values = covariance @ right
    if not have_covariance:
        covariance = np.full_like(covariance, np.nan)
    return Split(model.states, model.terms, fixed, entries, powers, values, covariance)


@dataclass(frozen=True)
class Prediction:
    """Predicted amplitude of the stable limit cycle at each wind speed, with a 95 % band.

    winds: (n,) m/s. amplitude, low, high: (n, n_states) half range; NaN if there is none.
    unresolved: (n,) share of the samples without a cycle near the predicted one; the band is that
    of the others. reason: what was not predicted and why, or ''.
    """

    winds: np.ndarray
    amplitude: np.ndarray
    low: np.ndarray
    high: np.ndarray
    unresolved: np.ndarray
    reason: str = ""

    @classmethod
    def nothing(cls, winds: Sequence[float], n_states: int, reason: str = "") -> Self:
        """Make a prediction without a limit cycle at any of the wind speeds."""
        amplitude, low, high = np.full((3, len(winds), n_states), np.nan)
        return cls(np.asarray(winds, float), amplitude, low, high, np.ones(len(winds)), reason)


def predict(
    parts: Split,
    recorded: float,
    winds: Sequence[float],
    start: np.ndarray,
    draws: Sequence[Split],
    simulator: Simulator,
) -> Prediction:
    """Predict the limit cycles at given wind speeds by continuation from the recorded wind speed.

    winds: m/s. start: (n_states,) initial state of the simulation until the motion has settled.
    draws: of `draw_splits`, for the band.
    """
    prediction, missing = Prediction.nothing(winds, len(parts.states)), []
    motion = settle(simulator, parts.model(recorded), start, RECORDED_WATCH)
    if motion.kind != "cycle":
        reason = f"at {recorded:g} m/s the identified model reaches no limit cycle: {motion.kind}"
        return replace(prediction, reason=reason)
    family = parts.family()
    span = Range(
        min(*winds, recorded) - 0.5, max(*winds, recorded) + 0.5, longest=1.0,
        ceiling=MAX_CYCLE_SIZE * np.sqrt(np.sum(np.var(motion.states, axis=0))),
    )  # fmt: skip
    try:
        branches = limit_cycles.from_motion(family, recorded, motion.time, motion.states, span)
    except ValueError as failure:
        return replace(prediction, reason=str(failure))
    for k, wind in enumerate(prediction.winds):
        stable = [
            point.solution
            for branch in branches
            for point in limit_cycles.find_cycles_at(family, branch, wind)
            if point.stability.stable
        ]
        if not stable:
            missing.append(f"{wind:g}")
            continue
        prediction.amplitude[k] = stable[0].half_range()
        models = [each.model(stable[0].value) for each in draws]
        orbits = find_nearby_cycles(models, stable[0])
        prediction.low[k], prediction.high[k] = cycle_intervals(orbits, len(parts.states))[:, :-1]
        prediction.unresolved[k] = 1 - len(orbits) / max(1, len(models))
    reason = f"no stable limit cycle at {', '.join(missing)} m/s" if missing else ""
    return replace(prediction, reason=reason)


def draw_splits(
    identified: IdentifiedModel,
    wind: float,
    damping: Mapping[str, float] | None,
    rng: np.random.Generator,
) -> list[Split]:
    """Draw random models that agree with the recording, split into structure and wind parts.

    They include rivals with other terms. wind: of the recording, m/s. damping: as of `split`. Empty
    if the model has no covariance; a model whose damping cannot be separated is left out.
    """
    splits: list[Split] = []
    if not len(identified.covariance):
        return splits
    for model in draw_models_and_rivals(identified, rng):
        drawn = replace(identified, model=model, covariance=np.zeros((0, 0)))
        with suppress(ValueError, np.linalg.LinAlgError):
            splits.append(split([drawn], [wind], damping))
    return splits


def cycle_intervals(
    orbits: Sequence[Orbit], n_states: int, fewest: float = MIN_INTERVAL_DRAWS
) -> np.ndarray:
    """Compute 95 % intervals of amplitudes and period from a random sample of limit cycles.

    The period is in s. Returns (2, n_states + 1), the period last. fewest: as of
    `interval_of_draws`.
    """
    values = [[*orbit.half_range(), orbit.period] for orbit in orbits]
    return interval_of_draws(np.reshape(values, (-1, n_states + 1)), fewest)


def find_nearby_cycles(
    models: Iterable[PolynomialModel], orbit: Orbit, best: PolynomialModel | None = None
) -> list[Orbit]:
    """Find the limit cycle near a given orbit for each model that has such a limit cycle.

    best: the model of the orbit, in the terms of the others. If given, a cycle that is not found at
    once is followed from the orbit in steps, with coefficients between those of the two models.
    """
    cycles: list[Orbit] = []
    for model in models:
        passing("draw limit cycles")
        paths = [[model]]  # of models, from that of the orbit to this one
        if best is not None:
            change = model.coefficients - best.coefficients
            paths = [[replace(best, coefficients=best.coefficients + share * change)
                      for share in shares] for shares in CHANGE_SHARES]  # fmt: skip
        for path in paths:
            if (cycle := _follow_models(path, orbit)) is not None:
                cycles.append(cycle)
                break
    return cycles


def _follow_models(models: Sequence[PolynomialModel], orbit: Orbit) -> Orbit | None:
    """Follow the limit cycle from each model to the next; None if it is lost."""
    last = orbit
    with suppress(NotConverged):
        for model in models:
            problem = CycleProblem.about(constant_family(model, orbit.sizes), last, resolution=1.0)
            border = problem.along_parameter()
            last = correct_guess(problem, last.vector, border, CORRECTION_TOLERANCE).solution
        if last.spread > limit_cycles.MIN_ORBIT_SIZE * orbit.spread:
            return last
    return None


def limit_cycle_ahead(
    identified: IdentifiedModel, start: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute amplitudes, with 95 % intervals, of the limit cycle reached from an initial state.

    start: (n_states,) the initial state. Returns (n_states,) half range, and low and high ends of
    its 95 % interval. The interval is that of models that the recording does not rule out,
    including rivals with other terms; NaN if the model has no covariance, or if most of these
    models have no limit cycle nearby. Raises ValueError if there is no model, or if it reaches no
    limit cycle.
    """
    if identified.status == "refused":
        raise ValueError(f"there is no model to simulate: {identified.reason}")
    best = identified.model.without_absent_terms()
    motion = settle(Simulator(best.states, best.terms), best, start, FORECAST_WATCH)
    if not np.all(np.isfinite(motion.states)):
        raise ValueError(f"the model reaches no limit cycle: {motion.kind}")
    point = limit_cycles.cycle_from_motion(
        constant_family(best), 0.0, motion.time, motion.states, resolution=1.0
    )
    models = []
    if len(identified.covariance) == identified.support.sum() > 0:
        models = [model.without_absent_terms() for model in draw_models_and_rivals(identified, rng)]
    ends = cycle_intervals(find_nearby_cycles(models, point.solution), len(best.states))[:, :-1]
    return point.solution.half_range(), *ends
