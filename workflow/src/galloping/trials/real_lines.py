"""Trials of lines that no candidate library contains.

Truths are continuous lines, steady or gusty, and the two-mode model in gusts; sensors are three
along the span projected on the first modes, one at mid-span, or the modal states. A model is
assessed by its amplitude, frequencies, net damping, and forecasts.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from galloping.configuration.kinds import INPUT_METHODS
from galloping.configuration.load import load, plain
from galloping.evaluation.motion import steady_amplitude
from galloping.identification.drawn_models import draw_models
from galloping.identification.identified_model import IdentifiedModel
from galloping.line import continuous
from galloping.line.galerkin import STATES
from galloping.model.intervals import NORMAL_95
from galloping.model.polynomial import PolynomialModel, polynomial_library
from galloping.model.terms import parse_library
from galloping.recording.samples import Input, Recording
from galloping.streams import make_generator
from galloping.trajectory.simulation import Simulator, Trajectory
from galloping.trials.attempts import identify_once

CASE = "internal_resonance"
DEGREE = 3
TERMS = polynomial_library(len(STATES), DEGREE)
NOISE_LEVEL = 0.05  # noise of a sensor over the standard deviation of its noise-free reading
DURATION, RATE = 300, 100  # s, Hz
STEADY_START = 200  # s: time after which amplitudes are measured
FORECAST_DURATION = 15.0  # s: six vertical periods
QUANTITIES = (
    "amplitude_v", "amplitude_w", "damping_v", "frequency_v", "damping_w", "frequency_w",
)  # fmt: skip
N_ASSESSED = 5  # quantities with assessed intervals: all but the last, the horizontal frequency
RESULT_COLUMNS = (  # columns that are empty if a model does not give the value
    "terms",
    *(f"{name}_error_percent" for name in QUANTITIES),
    *(f"{name}_interval_percent" for name in QUANTITIES),
    "damping_v_bound_percent", "damping_w_bound_percent",
    "coverage", "forecast_r2", "other_winds_error_percent",
)  # fmt: skip


# places of the sensors, in spans
LAYOUTS = {"projected": continuous.SENSOR_POSITIONS, "mid-span": (0.5,), "states": ()}


@dataclass(frozen=True)
class SensedLine:
    """Simulated overhead line outside the model class, with its gusts and sensors.

    modes: sine modes in each direction, or 0 for the two shapes of the paper's model. aerodynamics:
    as in `continuous_line`. intensity: of the gusts. sensors: of LAYOUTS, separated into as many
    sine modes, the first of which is recorded; or the modal `states`. velocities: whether they are
    measured. wind: whether the wind is measured; the library is then the quasi-static law.
    """

    modes: int = 9
    aerodynamics: str = "small_angle"
    intensity: float = 0.0
    sensors: str = "projected"
    velocities: bool = True
    wind: bool = False


TRUTHS = {
    "9 modes": SensedLine(),
    "9 modes, relative wind": SensedLine(aerodynamics="relative"),
    "9 modes, gusts 5 %": SensedLine(intensity=0.05),
    "9 modes, mid-span": SensedLine(sensors="mid-span"),
    "9 modes, displacement only": SensedLine(velocities=False),
    "two modes, gusts 2 %": SensedLine(modes=0, intensity=0.02, sensors="states"),
    "two modes, gusts 5 %": SensedLine(modes=0, intensity=0.05, sensors="states"),
    "9 modes, gusts 5 %, wind": SensedLine(intensity=0.05, wind=True),
    "9 modes, gusts 10 %, wind": SensedLine(intensity=0.1, wind=True),
    "two modes, gusts 5 %, wind": SensedLine(modes=0, intensity=0.05, sensors="states", wind=True),
}
WIND_INPUT = "U"  # name of the wind speed as an input
# m/s: differences of the predicted winds from the recorded mean. At +2 m/s, further modes gallop by
# themselves within 300 s.
OTHER_WINDS = (-2.0, 1.0)


def make_line(case: Mapping, truth: SensedLine) -> continuous.Span:
    """Create a model of an overhead line with many modes, in the wind of a given case."""
    return continuous.continuous_line(case, truth.modes, aerodynamic=truth.aerodynamics)


def simulate_sensors(
    case: Mapping,
    line: continuous.Span,
    truth: SensedLine,
    time: np.ndarray,
    speed: np.ndarray | None = None,
) -> np.ndarray:
    """Simulate the noise-free displacements and velocities at each sensor of an overhead line.

    Returns q_v, q_w, dq_v, dq_w: (n, n_sensors, 4). speed: (n,) m/s, the wind, by default steady.
    The modal states count as one sensor.
    """
    start = continuous.displaced_state(line, [case["initial_state"][state] for state in STATES[:2]])
    states = continuous.simulate(line, start, time, speed)
    if truth.sensors == "states":
        return states[:, np.newaxis]
    return continuous.sensor_readings(line, states, LAYOUTS[truth.sensors])


def combine_sensors(line: continuous.Span, truth: SensedLine, values: np.ndarray) -> np.ndarray:
    """Combine the readings of all sensors to displacements and velocities of two modes.

    values: (n, n_sensors, 4). Returns the states, (n, 4).
    """
    if truth.sensors == "states":
        return values[:, 0]
    return continuous.first_modes(line, values, LAYOUTS[truth.sensors])[:, 0]


def linear_modes(model: PolynomialModel) -> np.ndarray:
    """Compute net damping (1/s) and frequency (rad/s) of both modes of a linearised model.

    They are -2 Re and Im of the eigenvalues, first vertical, then horizontal. They are at the
    equilibrium near the origin, by Newton's method. NaN without two oscillations.
    """
    rest = np.zeros((1, len(model.states)))
    for _ in range(10):
        rest = rest - np.linalg.lstsq(model.jacobian(rest)[0], model(rest)[0], rcond=None)[0]
    values = model.small_motions(rest[0]).oscillations().values
    if len(values) != 2:
        return np.full(4, np.nan)
    w, v = values
    return np.array([-2.0 * v.real, v.imag, -2.0 * w.real, w.imag])


def predict_quantities(
    identified: IdentifiedModel, start: np.ndarray, time: np.ndarray, simulator: Simulator,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Predict amplitudes, net damping and frequencies with a model, with 95 % intervals.

    Returns values and half widths of the intervals, by QUANTITIES, with a model of a line.
    Amplitudes are of the motion from `start` (4,) after STEADY_START s. Intervals are those of
    models drawn with the covariance of the coefficients; NaN without one. The further modes of an
    approximate model are added to its motion, and its residual to the interval of an amplitude.
    """
    further = identified.further_motion(time)

    def quantities(model: PolynomialModel) -> np.ndarray:
        states = simulator(model, start, time).states + further
        return np.concatenate(
            [steady_amplitude(states[time >= STEADY_START])[:2], linear_modes(model)]
        )

    values = quantities(identified.model)
    widths = np.full(len(QUANTITIES), np.nan)
    if len(identified.covariance) == identified.support.sum() > 0:
        sampled = np.array([quantities(each) for each in draw_models(identified, rng)])
        # half of the middle 68 %: a few draws that diverge do not count
        low, high = np.nanquantile(sampled, [0.16, 0.84], axis=0)
        widths = NORMAL_95 * (high - low) / 2.0
        residual = [identified.diagnostics.get(f"error_share_all_{q}", 0.0) for q in STATES[:2]]
        widths[:2] = np.hypot(widths[:2], residual * values[:2])
    return values, widths


def forecast_r2(
    model: PolynomialModel,
    states: np.ndarray,
    time: np.ndarray,
    simulator: Callable[..., Trajectory],
) -> float:
    """Compute the mean R2 of a model's short forecasts of a measured motion.

    Forecasts are of q_v and q_w over FORECAST_DURATION s, along the motion, (n, 4).
    """
    length = round(FORECAST_DURATION / (time[1] - time[0]))
    squares = np.zeros(2)
    for begin in range(0, len(time) - length, length):
        predicted = simulator(model, states[begin], time[begin : begin + length]).states
        squares += np.sum((predicted - states[begin : begin + length])[:, :2] ** 2, axis=0)
    total = np.sum((states - states.mean(axis=0))[:, :2] ** 2, axis=0)
    return float(np.mean(1.0 - squares / total)) if np.all(np.isfinite(squares)) else -np.inf


def trial(
    seed: int, case: str, replicates: Sequence[int], methods: Mapping[str, Mapping]
) -> Iterator[dict[str, object]]:
    """Identify overhead lines outside the model class from noisy recordings; yield their errors.

    There is a row for each replicate and method on the truth `case` of TRUTHS. The truth is a
    variant of the default line. methods: `Method.settings` by name. Replicates differ in the noise
    of the sensors and in the gusts; forecasts are assessed on a motion in gusts that no method has
    used. Seconds are those of the processor.
    """
    parameters, truth = plain(load({}))["cases"][CASE], TRUTHS[case]
    time = np.arange(DURATION * RATE + 1) / RATE
    line = make_line(parameters, truth)
    inputs = (WIND_INPUT,) if truth.wind else ()
    terms = parse_library(f"wind({WIND_INPUT})", STATES, inputs)[0] if truth.wind else TERMS
    whole = PolynomialModel(STATES, terms, np.ones((len(STATES), len(terms))), inputs)
    steady_terms = whole.at(dict.fromkeys(inputs, line.speed)).terms
    simulator = Simulator(STATES, steady_terms)
    driven = Simulator(STATES, terms, inputs=inputs) if truth.wind else simulator

    def simulate_recorded(
        *name: str | int,
    ) -> tuple[np.ndarray, dict[str, Input], np.random.Generator]:
        rng = make_generator(seed, "model_error", case, *name)
        gusts = {**parameters["truth"]["gusts"], "intensity": truth.intensity}
        speed = continuous.draw_wind(line, gusts, time, rng)
        wind_inputs = {WIND_INPUT: Input(time, speed)} if truth.wind and speed is not None else {}
        return simulate_sensors(parameters, line, truth, time, speed), wind_inputs, rng

    steady = combine_sensors(line, truth, simulate_sensors(parameters, line, truth, time))
    unseen, unseen_wind, _ = simulate_recorded("unseen")
    unseen = combine_sensors(line, truth, unseen)
    true = _true_quantities(line, steady[time >= STEADY_START])
    others = _other_winds(parameters, truth, time) if truth.wind else {}
    for replicate in replicates:
        clean, wind_inputs, rng = simulate_recorded(replicate)
        noise = NOISE_LEVEL * clean.std(axis=0) * rng.standard_normal(clean.shape)
        values = combine_sensors(line, truth, clean + noise)
        if not truth.velocities:
            values[:, 2:] = np.nan
        recordings = [Recording(time, STATES, values, inputs=wind_inputs)]
        for method, settings in methods.items():
            if truth.wind and method not in INPUT_METHODS:
                continue
            name = ("model_error", case, str(replicate))
            identified, answer = identify_once({method: settings}, recordings, terms, name)
            row = start_row(case, truth.sensors, replicate, seed, answer)
            if identified.status != "refused":
                draws = make_generator(seed, "model_error", case, replicate, method)
                in_mean_wind = identified.at(dict.fromkeys(inputs, line.speed))
                values, widths = predict_quantities(in_mean_wind, steady[0], time, simulator, draws)
                row |= _judge_values(values, widths, true)
                row["terms"] = int(identified.support.sum())
                forecasts = partial(driven, inputs=unseen_wind)
                row["forecast_r2"] = forecast_r2(identified.model, unseen, time, forecasts)
                if others:
                    row["other_winds_error_percent"] = max(
                        _amplitude_error(
                            identified.model.at({WIND_INPUT: u}), steady[0], time, amplitude
                        )
                        for u, amplitude in others.items()
                    )
            yield row


def start_row(
    case: str, sensors: str, replicate: int, seed: int, answer: Mapping[str, object]
) -> dict[str, object]:
    """Return the row of a fit before its model is judged. answer: of `attempts.identify_once`."""
    known = {"truth": case, "sensors": sensors, "replicate": replicate, "seed": seed}
    return {**known, **answer, **dict.fromkeys(RESULT_COLUMNS, np.nan)}


def _other_winds(
    parameters: Mapping, truth: SensedLine, time: np.ndarray
) -> dict[float, np.ndarray]:
    """Simulate amplitudes of q_v and q_w, (2,), in other steady winds, m/s, from the same start."""
    amplitudes = {}
    for change in OTHER_WINDS:
        speed = parameters["wind"]["speed"] + change
        case = {**parameters, "wind": {**parameters["wind"], "speed": speed}}
        line = make_line(case, truth)
        states = combine_sensors(line, truth, simulate_sensors(case, line, truth, time))
        amplitudes[speed] = steady_amplitude(states[time >= STEADY_START])[:2]
    return amplitudes


def _amplitude_error(
    model: PolynomialModel, start: np.ndarray, time: np.ndarray, amplitude: np.ndarray
) -> float:
    """Compute the largest error of the amplitudes of a motion, %."""
    states = Simulator(STATES, model.terms)(model, start, time).states
    predicted = steady_amplitude(states[time >= STEADY_START])[:2]
    return float(100.0 * np.max(np.abs(predicted / amplitude - 1.0)))


def _judge_values(values: np.ndarray, widths: np.ndarray, true: np.ndarray) -> dict[str, float]:
    """Compute errors and intervals in percent, and the coverage of the assessed intervals."""
    is_covered = (np.abs(values - true) <= widths)[:N_ASSESSED]
    row = {"coverage": np.mean(is_covered) if np.all(np.isfinite(widths)) else np.nan}
    for name, value, width, truth in zip(QUANTITIES, values, widths, true, strict=True):
        row[f"{name}_error_percent"] = 100.0 * (value / truth - 1.0)
        row[f"{name}_interval_percent"] = 100.0 * width / abs(truth)
    return row


def _true_quantities(line: continuous.Span, steady: np.ndarray) -> np.ndarray:
    """Compute QUANTITIES, (6,), of a line whose motion in its steady window is `steady` (n, 4).

    Its modes are the first symmetric ones in plane and out of plane.
    """
    values, vectors = continuous.small_motions(line)
    moving, poles = np.linalg.norm(vectors[: 2 * line.modes], axis=0), []
    for direction in (0, 1):
        rows = slice(direction * line.modes, (direction + 1) * line.modes)
        share = np.linalg.norm(vectors[rows], axis=0) / moving
        shapes = np.abs(line.arrays.shapes[direction] @ vectors[rows])
        middle = shapes[len(shapes) // 2] > 0.5 * shapes.max(axis=0)
        first = values[np.flatnonzero((share > 0.7) & middle)[0]]
        poles += [-2.0 * first.real, first.imag]
    return np.array([*steady_amplitude(steady)[:2], *poles])
