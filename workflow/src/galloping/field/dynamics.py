"""What a model says of a line: natural frequencies, net damping, limit cycle, with intervals."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, log10

import numpy as np

from galloping.cycles.collocation import Orbit
from galloping.cycles.family import Family
from galloping.cycles.limit_cycles import settled
from galloping.cycles.motion import settle
from galloping.cycles.prediction import near
from galloping.field.forecast import drawn, simulator_of
from galloping.identification.model import IdentifiedModel
from galloping.intervals import QUANTILES_95
from galloping.polynomial import PolynomialModel, velocity_pairs
from galloping.simulation import Simulator

DRAWS = 39  # of which the least and the greatest are then the ends of the band
DURATION, FROM_NEARBY, WINDOW = 2000.0, 800.0, 200.0  # s, of the motion that settles on the cycle


@dataclass(frozen=True)
class Value:
    """A value with its 95 % interval; NaN where there is none."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Dynamics:
    """Of a model with coordinates X and velocities dX.

    frequencies: Hz, damping: ratio to critical, of the linear terms, wind included; below zero
    the motion grows. Each by the coordinate that mostly moves. kind: of the motion in the end,
    as in `cycles.motion`. period: s, half_range: by coordinate, of the limit cycle if it is one.
    """

    frequencies: dict[str, Value]
    damping: dict[str, Value]
    kind: str
    period: Value | None
    half_range: dict[str, Value]


def dynamics(identified: IdentifiedModel, rng: np.random.Generator) -> Dynamics | None:
    """None where no state is a velocity of another one, or where there is no model."""
    model = identified.model
    pairs = velocity_pairs(model.states)
    if not pairs or identified.status == "refused":
        return None
    models = drawn(identified, DRAWS if len(identified.covariance) else 1, rng)
    best = _linear(model, pairs)
    sampled = np.array([_linear(each, pairs) for each in models])
    frequencies, damping = (
        {model.states[i]: _value(best[k, n], sampled[:, k, n]) for n, i in enumerate(pairs)}
        for k in (0, 1)
    )
    simulator = simulator_of(model)
    start = identified.initial_states[-1]
    motion = settle(simulator, model, start, duration=DURATION, window=WINDOW)
    if motion.kind != "cycle":
        return Dynamics(frequencies, damping, motion.kind, None, {})
    try:
        orbit = settled(Family(lambda _: model), 0.0, motion.time, motion.states, 1.0)[1].solution
    except ValueError as error:
        return Dynamics(frequencies, damping, str(error), None, {})
    orbits = [_orbit(each, orbit, simulator) for each in models]
    ranges = np.array([each.half_range() for each in orbits if each is not None])
    periods = np.array([each.period for each in orbits if each is not None])
    if len(periods) < 0.9 * len(models):  # the band would be that of the tame ones
        ranges, periods = np.full((1, len(model.states)), np.nan), np.array([np.nan])
    half = orbit.half_range()
    return Dynamics(
        frequencies, damping, "cycle", _value(orbit.period, periods),
        {model.states[i]: _value(half[i], ranges[:, i]) for i in pairs},
    )  # fmt: skip


def expected(model: PolynomialModel, identified: IdentifiedModel) -> Dynamics | None:
    """Those of a model that is known, its motion begun where that of the identified one begins."""
    if model.states != identified.model.states:
        return None
    exact = IdentifiedModel(model, "unjudged", initial_states=identified.initial_states)
    return dynamics(exact, np.random.default_rng(0))


def _orbit(model: PolynomialModel, orbit: Orbit, simulator: Simulator) -> Orbit | None:
    """The limit cycle of another model, near one or where a motion from there ends."""
    family = Family(lambda _: model)
    if (close := near(family, orbit)) is not None:
        return close
    start = orbit.mesh_states[0]
    motion = settle(simulator, model, start, duration=FROM_NEARBY, window=WINDOW)
    if motion.kind != "cycle":
        return None
    try:
        return settled(family, 0.0, motion.time, motion.states, 1.0)[1].solution
    except ValueError:
        return None


def _value(value: float, samples: np.ndarray) -> Value:
    low, high = np.quantile(samples, QUANTILES_95, method="weibull")
    return Value(float(value), float(low), float(high))


def _linear(model: PolynomialModel, pairs: dict[int, int]) -> np.ndarray:
    """(2, n_coordinates) frequency, Hz, and damping ratio of the mode of each coordinate."""
    n = len(model.states)
    matrix = np.zeros((n, n))
    for j, term in enumerate(model.terms):
        if sum(term) == 1:
            matrix[:, term.index(1)] = model.coefficients[:, j]
    values, vectors = np.linalg.eig(matrix)
    result = np.full((2, len(pairs)), np.nan)
    free = list(np.flatnonzero(values.imag > 0))
    for k, i in enumerate(pairs):
        if not free:
            break
        shares = [np.abs(vectors[i, m]) / np.linalg.norm(vectors[list(pairs), m]) for m in free]
        mode = free.pop(int(np.argmax(shares)))
        size = np.abs(values[mode])
        result[:, k] = size / (2 * np.pi), -values[mode].real / size
    return result


def sentences(of: Dynamics) -> list[str]:
    """The same in words."""
    said = [
        f"{state} does not oscillate by itself"
        if np.isnan(of.frequencies[state].value)
        else f"{state} oscillates at {_words(of.frequencies[state], 'Hz')}, net damping "
        f"{_words(of.damping[state], '% of critical', 100)}"
        + (": it grows" if of.damping[state].value < 0 else "")
        for state in of.frequencies
    ]
    if of.period is None:
        said.append(f"the motion does not end in a limit cycle: {of.kind}")
    else:
        halves = ", ".join(
            f"{state} ± {_words(value, 'm')}" for state, value in of.half_range.items()
        )
        said.append(f"the motion ends in a limit cycle: {halves}, period {_words(of.period, 's')}")
    return said


def _words(of: Value, unit: str, factor: float = 1.0) -> str:
    value, low, high = (factor * number for number in (of.value, of.low, of.high))
    if low == high:
        return f"{value:.5g} {unit}"
    if not np.isfinite(low):
        return f"{value:.4g} {unit} (interval unknown)"
    digits = max(0, 1 - floor(log10((high - low) / 2))) if high > low else 6
    return f"{value:.{digits}f} {unit} ({low:.{digits}f} to {high:.{digits}f})"
