"""Trials on files of motions with known truth, as users record them.

The motions are of kinds that are often recorded and easily misinterpreted: very small units of
length or long ones of time, a release after rest, decays with a knock or to rest, dry friction, a
pendulum at large angles, the steady force of a machine, and measured forces that step, are held
between samples, or have two values only. Each replicate draws frequency and damping within
NOMINAL_SPREAD of nominal ones, and the noise. The examples of the project are used unchanged.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp
from scipy.signal import StateSpace, dlsim

from galloping.behaviour.dynamics import Value
from galloping.configuration.kinds import EXAMPLES
from galloping.identification.findings import Code
from galloping.model.intervals import NORMAL_95
from galloping.model.terms import known_model
from galloping.readers.mapping import read_mapping, validate_mapping
from galloping.streams import make_generator
from galloping.summary.analysis import Field, FieldQuestion, identify_field, read_field
from galloping.summary.summarise import Summary
from galloping.trials.attempts import (
    MAX_COEFFICIENT_DISTANCE,
    against_truth,
    counted_cost,
    describe_answer,
)

NOMINAL_SPREAD = 0.1  # half range of a frequency or damping, relative to its nominal value
NUMBER_FORMAT = "%.9g"  # format of numbers in the files
DISPLACEMENT: dict[str, object] = {
    "states": ("q", "dq"),
    "channels": [{"column": "x", "measures": "q"}],
}
ACCELERATION = {"states": ("q", "dq"), "channels": [{"column": "acc", "measures": "ddq"}]}
FORCE_INPUT: dict[str, object] = {"inputs": [{"column": "F", "name": "F"}]}


@dataclass(frozen=True)
class Oscillation:
    """Damped linear oscillator, given by its natural frequency (rad/s) and damping ratio."""

    frequency: float
    damping: float

    @classmethod
    def drawn(cls, rng: np.random.Generator, frequency: float, damping: float) -> "Oscillation":
        """Draw a random oscillator within 10 % of a given frequency (Hz) and damping ratio."""
        factors = rng.uniform(1.0 - NOMINAL_SPREAD, 1.0 + NOMINAL_SPREAD, 2)
        return cls(2.0 * np.pi * frequency * factors[0], damping * factors[1])

    @property
    def rates(self) -> np.ndarray:
        """System matrix A, (2, 2), in d(q, dq)/dt = A (q, dq)."""
        return np.array([[0.0, 1.0], [-(self.frequency**2), -2 * self.damping * self.frequency]])

    def equation(self, more: str = "") -> str:
        """Format the equation of the velocity dq as text, with optional further terms.

        The text is in the grammar of `terms.known_model`.
        """
        stiffness, damping = self.rates[1]
        return f"dq = {stiffness:.17g} q {damping:+.17g} dq{more}"

    def free(self, time: np.ndarray, start: float, derivative: int = 0) -> np.ndarray:
        """Compute the free motion that starts at rest from a displacement at time zero.

        Returns (n,), or its derivative of the given order; zero before time zero.
        """
        exponent = self.frequency * complex(-self.damping, np.sqrt(1.0 - self.damping**2))
        amplitude = start * complex(1.0, exponent.real / exponent.imag)  # at rest when released
        motion = amplitude * exponent**derivative * np.exp(exponent * np.maximum(time, 0.0))
        return np.where(time >= 0.0, motion.real, 0.0)

    def driven(self, force: np.ndarray, step: float, start: float = 0.0) -> np.ndarray:
        """Simulate the displacement under an acceleration that is constant over each step.

        force: (n,) accelerations. step: s. start: displacement at first, at rest.
        """
        system = StateSpace(self.rates, [[0.0], [1.0]], [[1.0, 0.0]], 0.0).to_discrete(step)
        _, _, states = dlsim(system, force, x0=(start, 0.0))
        return states[:, 0]


@dataclass(frozen=True)
class SampleFile:
    """Columns of a synthetic recording file, with the true model of its system.

    columns: (n,) samples by header, times first. mapping: of the columns, as for
    `readers.mapping.validate_mapping`, without the time. mode: the small motions. equation: that of
    dq, as `terms.known_model` reads it; '' if no model of the library is true. library: the
    candidate terms; '' for all of degree three. cause: the correct finding, if there is one.
    """

    columns: Mapping[str, np.ndarray]
    mapping: Mapping[str, object]
    mode: Oscillation
    equation: str = ""
    library: str = ""
    cause: Code | None = None


def _sample_times(duration: float, rate: float) -> np.ndarray:
    return np.arange(round(duration * rate)) / rate


def _add_noise(rng: np.random.Generator, values: np.ndarray, deviation: float) -> np.ndarray:
    return values + deviation * rng.standard_normal(len(values))


def _integrate(
    acceleration: Callable[[float, float], float], start: float, time: np.ndarray
) -> np.ndarray:
    """Integrate q'' = acceleration(q, q') from `start`: displacement, (n,)."""
    return solve_ivp(
        lambda _, x: (x[1], acceleration(*x)), time[[0, -1]], (start, 0.0), "DOP853", time,
        rtol=1e-9, atol=1e-9 * abs(start),
    ).y[0]  # fmt: skip


def simulate_limit_cycle(
    rng: np.random.Generator, length: str = "m", clock: str = "s"
) -> SampleFile:
    """Simulate a recording of a random van der Pol oscillator in given units of length and time."""
    mode = Oscillation.drawn(rng, 0.16, -0.1)
    (stiffness, growth), time = mode.rates[1], _sample_times(80.0, 20.0)
    x = _integrate(lambda q, dq: stiffness * q + growth * (1.0 - q**2) * dq, 0.1, time)
    metre, second = {"m": 1.0, "um": 1e-6}[length], {"s": 1.0, "min": 60.0}[clock]
    real = Oscillation(mode.frequency / second, mode.damping)
    limit = real.rates[1, 1] / metre**2
    columns = {f"t [{clock}]": time, f"x [{length}]": _add_noise(rng, x, 0.02)}
    return SampleFile(columns, DISPLACEMENT, real, real.equation(f" {-limit:+.17g} q^2 dq"))


def simulate_release_after_rest(rng: np.random.Generator) -> SampleFile:
    """Simulate a recording of a free decay that begins after five seconds of rest."""
    mode, time = Oscillation.drawn(rng, 1.0, 0.015), _sample_times(35.0, 50.0)
    columns = {"t [s]": time, "x [m]": _add_noise(rng, mode.free(time - 5.0, 0.05), 3e-4)}
    return SampleFile(columns, DISPLACEMENT, mode, mode.equation(), cause=Code.RELEASED)


def simulate_decay_to_rest(rng: np.random.Generator) -> SampleFile:
    """Simulate a recording of a free decay that ends below the noise."""
    mode, time = Oscillation.drawn(rng, 1.0, 0.02), _sample_times(60.0, 50.0)
    columns = {"t [s]": time, "x [m]": _add_noise(rng, mode.free(time, 0.05), 3e-4)}
    return SampleFile(columns, DISPLACEMENT, mode, mode.equation())


def simulate_knock(rng: np.random.Generator) -> SampleFile:
    """Simulate an accelerometer's recording of a free decay with a small knock at half time.

    The knock adds a tenth of the initial displacement.
    """
    mode, time = Oscillation.drawn(rng, 6.8, 0.0014), _sample_times(20.0, 100.0)
    acceleration = mode.free(time, 1.6e-3, 2) + mode.free(time - 10.0, 1.6e-4, 2)
    columns = {"t [s]": time, "acc [m/s^2]": _add_noise(rng, acceleration, 0.01)}
    return SampleFile(columns, ACCELERATION, mode, cause=Code.KNOCKED)


def simulate_dry_friction(rng: np.random.Generator, library: str = "") -> SampleFile:
    """Simulate an encoder's recording of an oscillation that dry friction damps.

    The amplitude falls by twice `slip` in every half period. The resolution is 0.09 degrees.
    library: that has the term of friction.
    """
    mode, slip = Oscillation.drawn(rng, 1.0, 0.0), 1.5
    time, start = _sample_times(20.0, 50.0), 40.0
    half = np.floor(time * mode.frequency / np.pi)
    size = start - (2.0 * half + 1.0) * slip
    angle = size * np.cos(time * mode.frequency) + slip * (-1.0) ** half
    stuck = size <= 0.0
    angle[stuck] = angle[~stuck][-1]
    columns = {"t [s]": time, "x [deg]": 0.09 * np.round(angle / 0.09)}
    stiffness = mode.frequency**2
    friction = f"dq = {-stiffness:.17g} q {-stiffness * np.radians(slip):+.17g} sign(dq)"
    return SampleFile(columns, DISPLACEMENT, mode, friction if library else "", library)


def simulate_large_angles(rng: np.random.Generator, library: str = "") -> SampleFile:
    """Simulate a recording of a pendulum that starts at 60 degrees.

    library: that has the sine.
    """
    mode, time = Oscillation.drawn(rng, 1.6, 0.002), _sample_times(20.0, 100.0)
    stiffness, damping = mode.rates[1]
    angle = _integrate(lambda q, dq: stiffness * np.sin(q) + damping * dq, np.pi / 3.0, time)
    columns = {"t [s]": time, "x [deg]": _add_noise(rng, np.degrees(angle), 0.5)}
    sine = f"dq = {stiffness:.17g} sin(q) {damping:+.17g} dq"
    return SampleFile(columns, DISPLACEMENT, mode, sine if library else "", library)


def simulate_wrapped_angle(rng: np.random.Generator) -> SampleFile:
    """Simulate a recording of a pendulum whose angle wraps at 0 and 360 degrees."""
    mode, time = Oscillation.drawn(rng, 0.5, 0.005), _sample_times(30.0, 50.0)
    angle = _add_noise(rng, mode.free(time, 30.0), 0.3) % 360.0
    return SampleFile({"t [s]": time, "x [deg]": angle}, DISPLACEMENT, mode, mode.equation())


def simulate_two_modes(rng: np.random.Generator) -> SampleFile:
    """Simulate a recording of decaying heave and pitch of a rigid section, with play in pitch."""
    heave, pitch = Oscillation.drawn(rng, 2.2, 0.028), Oscillation.drawn(rng, 2.8, 0.037)
    time, play = _sample_times(16.0, 100.0), 0.01
    h = heave.free(time, 0.02) - 0.1 * pitch.free(time, 0.02)
    a = pitch.free(time, 0.4) + 0.2 * heave.free(time, 0.4)
    a = np.sign(a) * np.maximum(np.abs(a) - play, 0.0)
    columns = {
        "t [s]": time, "h [m]": _add_noise(rng, h, 1e-4), "a [rad]": _add_noise(rng, a, 2e-3)
    }  # fmt: skip
    channels = [{"column": name, "measures": name} for name in "ha"]
    return SampleFile(columns, {"states": ("h", "a", "dh", "da"), "channels": channels}, heave)


def simulate_unmeasured_machine(rng: np.random.Generator) -> SampleFile:
    """Simulate a recording of an oscillator under a harmonic force that is not recorded.

    The force has 0.9 of the natural frequency.
    """
    mode, time, fine = Oscillation.drawn(rng, 1.0, 0.02), _sample_times(100.0, 20.0), 20
    step = time[1] / fine
    instants = (np.arange(fine * len(time)) + 0.5) * step
    force = 0.9 * np.sin(0.9 * mode.frequency * instants)
    x = mode.driven(force, step, 0.1)[::fine]
    columns = {"t [s]": time, "x [m]": _add_noise(rng, x, 1e-3)}
    return SampleFile(columns, DISPLACEMENT, mode, cause=Code.FORCED_STEADILY)


def _record_force(
    rng: np.random.Generator, force: np.ndarray, library: str = "q + dq + F"
) -> SampleFile:
    """Draw a motion under a recorded force that is held between samples."""
    mode, step = Oscillation.drawn(rng, 0.5, 0.03), 0.02
    x = _add_noise(rng, mode.driven(force, step), 5e-4)
    columns = {"t [s]": step * np.arange(len(force)), "x [m]": x, "F [N/kg]": force}
    return SampleFile(columns, DISPLACEMENT | FORCE_INPUT, mode, mode.equation(" + F"), library)


FILES: Mapping[str, Callable[[np.random.Generator], SampleFile]] = {
    "limit cycle in micrometres": partial(simulate_limit_cycle, length="um"),
    "limit cycle in minutes": partial(simulate_limit_cycle, clock="min"),
    "release after rest": simulate_release_after_rest,
    "decay to rest": simulate_decay_to_rest,
    "decay with a knock": simulate_knock,
    "dry friction": simulate_dry_friction,
    "dry friction, its term asked for": partial(simulate_dry_friction, library="q + dq + sign(dq)"),
    "large angles": simulate_large_angles,
    "large angles, sine asked for": partial(simulate_large_angles, library="q + sin(q) + dq"),
    "angle that wraps": simulate_wrapped_angle,
    "two modes to rest": simulate_two_modes,
    "unmeasured machine": simulate_unmeasured_machine,
    "step of a force": lambda rng: _record_force(rng, np.where(np.arange(1500) >= 200, 2.0, 0.0)),
    "held force": lambda rng: _record_force(rng, 6.0 * rng.standard_normal(1500)),
    "force of two values": lambda rng: _record_force(  # the library has its powers
        rng, 2.0 * (np.arange(2000) // 150 % 2), library=""
    ),
}


def trial(
    seed: int, case: str, replicates: Sequence[int], methods: Mapping[str, Mapping]
) -> Iterator[dict[str, object]]:
    """Identify models from synthetic or example files; yield a table row per file and method.

    case: a kind of FILES, or a name of EXAMPLES. methods: by their names in the command. Besides
    the columns of `attempts.describe_answer` and `attempts.counted_cost`, files of FILES have those
    of `judge`. All replicates of an example are the same.
    """
    for replicate in replicates:
        if case in EXAMPLES:
            file, mapping = EXAMPLES[case]
            sample, field = None, read_field([file], read_mapping(mapping))
        else:
            sample = FILES[case](make_generator(seed, "file", case, replicate))
            field = write_and_read(sample)
        library = (sample.library,) if sample and sample.library else ()
        for method in methods:
            with counted_cost(field.recordings) as cost:
                _, summary = identify_field(field, FieldQuestion(method=method, library=library))
            row: dict[str, object] = {"case": case, "seed": seed, "replicate": replicate}
            row |= {"method": method, **describe_answer(summary.found), **cost}
            yield row | (judge(sample, summary) if sample else {})


def write_and_read(sample: SampleFile) -> Field:
    """Write a synthetic recording to a CSV file, and read it back with the command's reader."""
    first, _, unit = next(iter(sample.columns)).partition(" ")
    time = {"time": {"column": first, "unit": unit.strip("[]")}}
    with TemporaryDirectory() as folder:
        path = Path(folder, "sample.csv")
        pd.DataFrame(sample.columns).to_csv(path, index=False, float_format=NUMBER_FORMAT)
        return read_field([path], validate_mapping({**time, **sample.mapping}))


def judge(sample: SampleFile, summary: Summary) -> dict[str, object]:
    """Compare the model identified from a synthetic file with the truth; return table columns.

    Returns coverage: the share of the 95 % intervals of frequency and damping that contain the
    truth, NaN if neither is stated. fault_diagnosed: whether the correct finding is among the
    findings, NaN if there is none. If an equation is true, the columns of `attempts.against_truth`;
    else ok_and_wrong: whether the status is `ok` with a frequency or a damping more than
    MAX_COEFFICIENT_DISTANCE standard errors off.
    """
    identified, dynamics = summary.found, summary.dynamics
    distances = []
    if dynamics:
        first, mode = identified.model.states[0], sample.mode
        pairs = [(dynamics.frequencies.get(first), mode.frequency / (2.0 * np.pi))]
        if mode.damping:  # otherwise the damping is not that of small motions
            pairs.append((dynamics.damping.get(first), mode.damping))
        distances = [_distance(value, truth) for value, truth in pairs if value is not None]
    row: dict[str, object] = {
        "coverage": float(np.mean(np.array(distances) <= 1.0)) if distances else np.nan,
        "fault_diagnosed": float(identified.has_finding(sample.cause)) if sample.cause else np.nan,
    }
    if not sample.equation:
        is_far = any(distance > MAX_COEFFICIENT_DISTANCE / NORMAL_95 for distance in distances)
        return row | {"ok_and_wrong": bool(identified.status == "ok" and is_far)}
    model = identified.model
    equations = (f"{model.states[0]} = {model.states[1]}", sample.equation)
    true, _, _ = known_model(equations, model.states, model.terms, model.inputs)
    return row | against_truth(true, identified)


def _distance(value: Value, truth: float) -> float:
    """Compute the distance to the truth in units of that side of the 95 % interval."""
    half = value.high - value.value if truth > value.value else value.value - value.low
    return abs(truth - value.value) / half if half > 0.0 else np.inf
