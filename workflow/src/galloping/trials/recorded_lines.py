"""Fits to recordings of galloping lines: default, drawn at random, long and steady, with faults.

Every random line is a bundle of the default conductor with three spacers at the quarter points.
Drawn evenly: the span between 150 and 500 m and both damping ratios between 0.002 and 0.02 on a
logarithmic scale; the tension between 15 and 45 kN; the wind between 6 and 20 m/s; the
aerodynamic coefficients beta_1 in 0.2..1.2, beta_2 in -3..3, beta_3 in -8..-2, eta_1 in -4..4,
and, each absent in half of the lines, eta_2 in -3..3 and eta_3 in -6..6. Lines that do not gallop,
or diverge, are drawn again. Each is recorded twice: released as the default line is, and from q_v
in -2..2 m and q_w in -3..3 m at rest.

Long: the default line from its release on. Steady: 300 s of the limit cycle of the default line,
or of a random line that has one. Sensitive: 300 s of a random line where neighbouring motions part
more than MIN_GROWTH times. Faulty: one fault, of a size drawn evenly from its range, besides white
noise; what is identified must not be `ok` and wrong, and a finding should name the fault.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
from scipy.interpolate import CubicSpline

from galloping.configuration.load import load, plain
from galloping.cycles.settling import settle
from galloping.identification.findings import Code
from galloping.identification.likelihood.instrument import FORCE_CODES
from galloping.line.galerkin import STATES, coefficients, make_model
from galloping.line.gusts import wind_speed
from galloping.model.polynomial import PolynomialModel, design_matrix, polynomial_library
from galloping.recording.samples import Recording
from galloping.streams import make_generator
from galloping.trajectory.simulation import Simulator, time_grid
from galloping.trials.attempts import (
    Attempt,
    deviations_at_the_bound,
    draw_log_uniform,
    simulate_recording,
    trial_of,
)

DEFAULT, RANDOM, LONG_AND_STEADY = "default line", "random lines", "long and steady"  # groups
TERMS = polynomial_library(len(STATES), 3)
CASE = "internal_resonance"
DURATION, RATE = 300.0, 100.0  # s, Hz
END_MARGIN = 1.0  # s: motion simulated after the recording, for sensors with a time shift
# duration, s, and sampling rate, Hz
LONG_RECORDINGS = {"2000 s": (2e3, 100.0), "10000 s": (1e4, 100.0), "100000 s": (1e5, 20.0)}
START_DISTANCE = 1e-6  # m: initial distance of two motions of a line
MIN_GROWTH = 1e3  # growth of this distance in a recording of a sensitive line


@dataclass(frozen=True)
class MovingLine:
    """Simulated overhead line: its configuration, model, sampling times and motion."""

    case: dict
    model: PolynomialModel
    start: np.ndarray
    time: np.ndarray
    motion: CubicSpline

    @property
    def states(self) -> np.ndarray:
        """Displacements and velocities at the sampling times, (n_times, 4)."""
        return self.motion(self.time)


@cache
def default_line() -> MovingLine:
    """Simulate the motion of the default line of a study.

    It lasts DURATION s from the start, and END_MARGIN s more.
    """
    case = plain(load({}))["cases"][CASE]
    line = make_model(coefficients(case))
    start = np.array([case["initial_state"][state] for state in STATES])
    long = time_grid(DURATION + END_MARGIN, RATE)
    states = Simulator(line.states, line.terms)(line, start, long).states
    return MovingLine(case, line, start, time_grid(DURATION, RATE), CubicSpline(long, states))


@trial_of
def of_the_default_line(
    seed: int, case: str, replicates: Sequence[int], *, protocols: list[str], levels: list[float]
) -> Iterator[Attempt]:
    """Yield recordings of the default line, with different noise realisations.

    The line starts from its initial state; the replicates are the noise realisations.
    """
    line = default_line()
    states = line.states
    for protocol, level in product(protocols, levels):
        columns = {"group": DEFAULT, "case": case, "seed": seed}
        columns |= {"protocol": protocol, "level": level}
        attempts = [
            simulate_recording(columns | {"replicate": r}, line.model, line.time, states)
            for r in replicates
        ]
        deviations = deviations_at_the_bound(attempts[0], states)
        yield from (replace(each, deviations=deviations) for each in attempts)


def draw_line(rng: np.random.Generator) -> tuple[dict, np.ndarray]:
    """Sample a random galloping line: its configuration and two initial states.

    The configuration is a section of `cases`; the initial states are (2, n_states).
    """
    while True:
        span = float(draw_log_uniform(rng, (150.0, 500.0)))
        vertical = [rng.uniform(0.2, 1.2), rng.uniform(-3.0, 3.0), rng.uniform(-8.0, -2.0)]
        horizontal = [rng.uniform(-4.0, 4.0), *_draw_or_omit(rng, 3.0), *_draw_or_omit(rng, 6.0)]
        case = {
            "line": {"span": span, "tension": rng.uniform(15e3, 45e3)},
            "spacers": {"positions": [0.25 * span, 0.5 * span, 0.75 * span]},
            "ice": {"reading": "custom", "vertical": vertical, "horizontal": horizontal},
            "wind": {"speed": rng.uniform(6.0, 20.0)},
            "damping": {
                "vertical": float(draw_log_uniform(rng, (0.002, 0.02))),
                "horizontal": float(draw_log_uniform(rng, (0.002, 0.02))),
            },
        }
        case = plain(load({"cases": {"drawn": case}}))["cases"]["drawn"]
        first = [case["initial_state"][state] for state in STATES]
        second = [rng.uniform(-2.0, 2.0), rng.uniform(-3.0, 3.0), 0.0, 0.0]
        if coefficients(case)["gamma_1"] < 0.0:
            return case, np.array([first, second])


def draw_lines(
    rng: np.random.Generator, simulator: Simulator, time: np.ndarray
) -> Iterator[tuple[PolynomialModel, list[np.ndarray]]]:
    """Yield random galloping lines without end, each with two simulated motions.

    The motions, (n, n_states), are from both starts; none diverges.
    """
    while True:
        case, starts = draw_line(rng)
        true = make_model(coefficients(case)).on_library(TERMS)
        motions = [simulator(true, start, time) for start in starts]
        if all(motion.status == "ok" for motion in motions):
            yield true, [motion.states for motion in motions]


def _draw_or_omit(rng: np.random.Generator, size: float) -> list[float]:
    return [rng.uniform(-size, size) * float(rng.random() < 0.5)]


@trial_of
def of_random_lines(
    seed: int, case: str, replicates: Sequence[int], *, protocols: list[str], levels: list[float],
    durations: list[float],
) -> Iterator[Attempt]:  # fmt: skip
    """Yield recordings of randomly drawn lines, each simulated from two initial states.

    The replicates are the lines. durations: s, of the recordings.
    """
    simulator = Simulator(STATES, TERMS)
    for duration, number in product(durations, replicates):
        time = time_grid(duration, RATE)
        rng = make_generator(seed, "random line", number)
        true, motions = next(draw_lines(rng, simulator, time))
        for protocol, level, (release, states) in product(protocols, levels, enumerate(motions)):
            columns = {
                "group": RANDOM, "case": case, "protocol": protocol, "level": level,
                "seed": seed, "replicate": number, "release": release,
            }  # fmt: skip
            attempt = simulate_recording(columns, true, time, states)
            deviations = deviations_at_the_bound(attempt, states)
            columns |= {"duration": duration}  # on which the noise does not depend
            yield replace(attempt, columns=columns, deviations=deviations)


@trial_of
def of_long_and_steady_motions(
    seed: int, case: str, replicates: Sequence[int], *, levels: list[float]
) -> Iterator[Attempt]:
    """Yield recordings of long motions, limit cycles or motions with sensitive dependence.

    case: kind of the motion; for cases of MOTION_SELECTORS, each replicate is another line.
    """
    time = time_grid(*LONG_RECORDINGS.get(case, (DURATION, RATE)))
    simulator = Simulator(STATES, TERMS)
    for level, replicate in product(levels, replicates):
        if case in MOTION_SELECTORS:
            rng, states = make_generator(seed, LONG_AND_STEADY, case, replicate), None
            lines = draw_lines(rng, simulator, time)
            while states is None:
                true, motions = next(lines)
                states = MOTION_SELECTORS[case](simulator, true, motions[0], time)
        else:
            line = default_line()
            true, start = line.model.on_library(TERMS), line.start
            if case == "limit cycle":
                start = settle(simulator, true, start).states[-1]
            states = simulator(true, start, time).states
        columns = {
            "group": LONG_AND_STEADY, "case": case, "protocol": "state", "level": level,
            "seed": seed, "replicate": replicate,
        }  # fmt: skip
        yield simulate_recording(columns, true, time, states)


def _settled_motion(
    simulator: Simulator, true: PolynomialModel, motion: np.ndarray, time: np.ndarray
) -> np.ndarray | None:
    """Simulate the motion on the limit cycle of a line, None if it has none."""
    settled = settle(simulator, true, motion[-1])
    return simulator(true, settled.states[-1], time).states if settled.kind == "cycle" else None


def _sensitive_motion(
    simulator: Simulator, true: PolynomialModel, motion: np.ndarray, time: np.ndarray
) -> np.ndarray | None:
    """Simulate the motion of a line that forgets its start, None if it does not."""
    beside = simulator(true, motion[0] + [START_DISTANCE, 0.0, 0.0, 0.0], time).states
    return motion if np.max(np.abs(beside - motion)) > MIN_GROWTH * START_DISTANCE else None


MOTION_SELECTORS = {  # functions that return a line's motion, or None to skip the line, by case
    "limit cycle, random lines": _settled_motion,
    "sensitive lines": _sensitive_motion,
}


GROUP = "sensor faults"
FORCE_RATE = 10.0  # Hz: rate of the values of a random force, linear in between
SUBSTEPS = 2  # integration steps between two such values; one is a 40th of the shortest period


def _add_no_fault(line, size, noise, rng):
    return line.time, line.states + noise


def _stretch_clock(line, size, noise, rng):
    """Let the clock gain or lose the share `size`."""
    return line.time * (1.0 + size * rng.choice([-1.0, 1.0])), line.states + noise


def _scale_velocity(line, size, noise, rng):
    values = line.states + noise
    values[:, rng.choice([2, 3])] *= size
    return line.time, values


def _delay_channels(line, size, noise, rng):
    """Delay both horizontal channels by `size` s."""
    values = line.states
    values[:, [1, 3]] = line.motion(np.maximum(line.time - size, 0.0))[:, [1, 3]]
    return line.time, values + noise


def _add_jitter(line, size, noise, rng):
    """Take every sample at a random time, with a deviation of `size` sampling steps."""
    late = line.time + size / RATE * rng.standard_normal(len(line.time))
    return line.time, line.motion(np.clip(late, 0.0, DURATION + END_MARGIN)) + noise


def _add_multiplicative_noise(line, size, noise, rng):
    """Add noise that is the share `size` of the signal, and no other."""
    return line.time, line.states * (1.0 + size * rng.standard_normal(noise.shape))


def _add_random_force(line, size, noise, rng):
    """Add white random accelerations, of `size` times the motion's."""
    knots = np.arange(0.0, DURATION + 1.0, 1.0 / FORCE_RATE)
    rms = np.sqrt(np.mean(line.model(line.states)[:, 2:] ** 2, axis=0))
    force = size * rms * rng.standard_normal((len(knots), 2))
    still = replace(line.model, coefficients=0.0 * line.model.coefficients)
    return line.time, _simulate_driven(line, still, knots, np.zeros(len(knots)), force) + noise


def _add_gusts(line, size, noise, rng):
    """Give the wind speed a turbulence intensity of `size`."""
    mean = line.case["wind"]["speed"]
    knots = np.arange(0.0, DURATION + 1.0, 1.0 / FORCE_RATE)
    gusts = {**line.case["truth"]["gusts"], "intensity": size}
    speed = wind_speed(knots, mean=mean, rng=rng, **gusts)
    step = 1e-3
    slower, faster = (
        make_model(
            coefficients({**line.case, "wind": {**line.case["wind"], "speed": mean * share}})
        )
        for share in (1.0 - step, 1.0 + step)
    )
    slope = (faster.coefficients - slower.coefficients) / (2.0 * step)
    change = replace(line.model, coefficients=slope)
    no_force = np.zeros((len(knots), 2))
    return line.time, _simulate_driven(line, change, knots, speed / mean - 1.0, no_force) + noise


def _simulate_driven(
    line: MovingLine, change: PolynomialModel, knots: np.ndarray, share: np.ndarray,
    force: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Simulate the motion, (n, 4), of a model that varies by `share` (n_knots,) of `change`.

    force: (n_knots, 2) additional accelerations. Both are linear between the times `knots`.
    """
    columns = np.flatnonzero(np.any((line.model.coefficients != 0.0) | change.support, axis=0))
    terms = tuple(line.model.terms[k] for k in columns)
    steady, varied = line.model.coefficients[:, columns], change.coefficients[:, columns]
    step = 1.0 / FORCE_RATE / SUBSTEPS
    times = step * np.arange(SUBSTEPS * (len(knots) - 1) + 1)
    halves = step / 2.0 * np.arange(2 * len(times) - 1)
    inputs = np.column_stack([np.interp(halves, knots, column) for column in (share, *force.T)])

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


RATE_CODES = (Code.RATE_DISAGREES, Code.RATES_DISAGREE)
CLOCK_CODES = (*RATE_CODES, Code.INNOVATION_JUMPS)
DELAY_CODES = (
    Code.CHANNEL_DELAYED, Code.COORDINATE_DELAYED, Code.INPUT_DELAYED, Code.INPUT_DELAYED_BY,
    Code.INPUT_HELD,
)  # fmt: skip
# Codes of findings that name the fault, range of its size, and the function that records a line
# with it: arguments line, size, noise (n, 4), rng; returns times (n,) and values (n, 4).
FAULTS = {
    "none": ((), (0.0, 0.0), _add_no_fault),
    "clock": (CLOCK_CODES, (0.001, 0.005), _stretch_clock),
    "velocity scale": (RATE_CODES, (1.005, 1.005), _scale_velocity),
    "late channels": (DELAY_CODES, (0.02, 0.2), _delay_channels),
    "random force": (FORCE_CODES, (0.005, 0.02), _add_random_force),
    "gusts": (FORCE_CODES, (0.001, 0.005), _add_gusts),
    "jitter": ((Code.TIMES_JITTER,), (4.0, 4.0), _add_jitter),
    "multiplicative noise": ((Code.NOISE_GROWS,), (0.01, 0.01), _add_multiplicative_noise),
}


@trial_of
def of_faulty_recordings(
    seed: int, case: str, replicates: Sequence[int], *, levels: list[float]
) -> Iterator[Attempt]:
    """Yield recordings of the default line with a simulated fault, such as a wrong clock.

    case: the fault, of FAULTS; its size is drawn per replicate.
    """
    line, (codes, sizes, record) = default_line(), FAULTS[case]
    for level, replicate in product(levels, replicates):
        rng = make_generator(seed, GROUP, case, replicate)
        size = rng.uniform(*sizes)
        noise = level * line.states.std(axis=0) * rng.standard_normal(line.states.shape)
        time, values = record(line, size, noise, rng)
        columns = {
            "group": GROUP, "case": case, "protocol": "state", "level": level,
            "seed": seed, "replicate": replicate, "size": size,
        }  # fmt: skip
        yield Attempt(columns, line.model, Recording(time, STATES, values), causes=frozenset(codes))
