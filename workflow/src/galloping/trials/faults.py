"""Fits to recordings of the default line by imperfect sensors, or in an unsteady wind.

Every recording has one fault, of a size drawn evenly from its range, besides white noise; what is
identified must not be `ok` and wrong, and the reason should name the fault.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from galloping.identification.likelihood import instrument
from galloping.intervals import generator
from galloping.physics.galerkin import STATES, coefficients, model
from galloping.physics.gusts import wind_speed
from galloping.polynomial import PolynomialModel, design_matrix
from galloping.recording import Recording
from galloping.trials.attempts import Attempt, trial_of
from galloping.trials.recorded_lines import DURATION, MARGIN, RATE, MovingLine, default_line

GROUP = "sensor faults"
FORCE_RATE = 10.0  # Hz, of the values between which a random force is linear
SUBSTEPS = 2  # of the integration between two such values; a fortieth of the shortest period


@dataclass(frozen=True)
class InjectedFault:
    """named: what the reason must contain. sizes: range from which the size is drawn.

    record: (line, size, noise (n, 4), rng) -> times (n,) and values (n, 4).
    """

    named: str
    sizes: tuple[float, float]
    record: Callable[
        [MovingLine, float, np.ndarray, np.random.Generator], tuple[np.ndarray, np.ndarray]
    ]


def _none(line, size, noise, rng):
    return line.time, line.states + noise


def _clock(line, size, noise, rng):
    """The clock gains or loses the share `size`."""
    return line.time * (1.0 + size * rng.choice([-1.0, 1.0])), line.states + noise


def _scale(line, size, noise, rng):
    """One velocity is read `size` times too large."""
    values = line.states + noise
    values[:, rng.choice([2, 3])] *= size
    return line.time, values


def _delay(line, size, noise, rng):
    """Both horizontal channels are `size` s late."""
    values = line.states
    values[:, [1, 3]] = line.motion(np.maximum(line.time - size, 0.0))[:, [1, 3]]
    return line.time, values + noise


def _jitter(line, size, noise, rng):
    """Every sample is taken at random, with a deviation of `size` sampling steps."""
    late = line.time + size / RATE * rng.standard_normal(len(line.time))
    return line.time, line.motion(np.clip(late, 0.0, DURATION + MARGIN)) + noise


def _multiplicative(line, size, noise, rng):
    """The noise is the share `size` of the signal, and there is no other."""
    return line.time, line.states * (1.0 + size * rng.standard_normal(noise.shape))


def _forced(line, size, noise, rng):
    """White random accelerations, of `size` times the motion's."""
    knots = np.arange(0.0, DURATION + 1.0, 1.0 / FORCE_RATE)
    rms = np.sqrt(np.mean(line.model(line.states)[:, 2:] ** 2, axis=0))
    force = size * rms * rng.standard_normal((len(knots), 2))
    still = PolynomialModel(line.model.states, line.model.terms, 0.0 * line.model.coefficients)
    return line.time, _driven(line, still, knots, np.zeros(len(knots)), force) + noise


def _gusts(line, size, noise, rng):
    """The wind speed has a turbulence intensity of `size`."""
    mean = line.case["wind"]["speed"]
    knots = np.arange(0.0, DURATION + 1.0, 1.0 / FORCE_RATE)
    gusts = {**line.case["truth"]["gusts"], "intensity": size}
    speed = wind_speed(knots, mean=mean, rng=rng, **gusts)
    step = 1e-3
    at = [
        model(coefficients({**line.case, "wind": {**line.case["wind"], "speed": mean * factor}}))
        for factor in (1.0 - step, 1.0 + step)
    ]
    slope = (at[1].coefficients - at[0].coefficients) / (2.0 * step)
    change = PolynomialModel(line.model.states, line.model.terms, slope)
    no_force = np.zeros((len(knots), 2))
    return line.time, _driven(line, change, knots, speed / mean - 1.0, no_force) + noise


def _driven(
    line: MovingLine,
    change: PolynomialModel,
    knots: np.ndarray,
    share: np.ndarray,
    force: np.ndarray,
) -> np.ndarray:
    """(n, 4) motion where the model varies by `share` (n_knots,) of `change` and is forced.

    force: (n_knots, 2) accelerations. Both are linear between the times `knots`.
    """
    used = np.flatnonzero(np.any((line.model.coefficients != 0.0) | change.support, axis=0))
    terms = tuple(line.model.terms[k] for k in used)
    steady, varied = line.model.coefficients[:, used], change.coefficients[:, used]
    step = 1.0 / FORCE_RATE / SUBSTEPS
    times = step * np.arange(SUBSTEPS * (len(knots) - 1) + 1)
    halves = step / 2.0 * np.arange(2 * len(times) - 1)
    inputs = np.column_stack(
        [np.interp(halves, knots, column) for column in np.column_stack([share, force]).T]
    )

    def rate(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        dx = (steady + u[0] * varied) @ design_matrix(x[None], terms)[0]
        dx[2:] += u[1:]
        return dx

    states = np.empty((len(times), 4))
    states[0] = x = line.start
    for k in range(1, len(times)):  # Runge and Kutta, order 4
        before, between, after = inputs[2 * k - 2 : 2 * k + 1]
        a = rate(x, before)
        b = rate(x + step / 2.0 * a, between)
        c = rate(x + step / 2.0 * b, between)
        d = rate(x + step * c, after)
        states[k] = x = x + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return CubicSpline(times, states)(line.time)


FAULTS = {
    "none": InjectedFault("", (0.0, 0.0), _none),
    "clock": InjectedFault(instrument.CLOCK, (0.001, 0.005), _clock),
    "velocity scale": InjectedFault(instrument.SCALE, (1.005, 1.005), _scale),
    "late channels": InjectedFault(instrument.DELAYED, (0.02, 0.2), _delay),
    "random force": InjectedFault(instrument.FORCES, (0.005, 0.02), _forced),
    "gusts": InjectedFault(instrument.FORCES, (0.001, 0.005), _gusts),
    "jitter": InjectedFault(instrument.JITTER, (4.0, 4.0), _jitter),
    "multiplicative noise": InjectedFault(instrument.GROWING, (0.01, 0.01), _multiplicative),
}


def _attempt(seed: int, case: str, replicate: int, level: float) -> Attempt:
    line, fault = default_line(), FAULTS[case]
    rng = generator(seed, GROUP, case, replicate)
    size = rng.uniform(*fault.sizes)
    noise = level * line.states.std(axis=0) * rng.standard_normal((len(line.time), len(STATES)))
    time, values = fault.record(line, size, noise, rng)
    columns = {
        "group": GROUP, "case": case, "protocol": "state", "level": level,
        "seed": seed, "replicate": replicate, "size": size,
    }  # fmt: skip
    return Attempt(columns, line.model, Recording(time, STATES, values), cause=fault.named)


trial = trial_of(_attempt)
