"""What identification gives of lines that no candidate library contains.

Truths are continuous lines, steady or gusty, and the two-mode model in gusts; sensors are three
along the span projected on the first modes, one at mid-span, or the modal states. A model is
judged by what it says of the line: amplitude, frequencies, net damping, and forecasts. Of two modes
that random forces keep up, recorded by displacements alone, the decays are judged, against the
Cramér-Rao bound as well.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from galloping.configuration.load import load, plain
from galloping.evaluation.motion import steady_amplitude
from galloping.identification.cell import identify
from galloping.identification.model import IdentifiedModel
from galloping.intervals import NORMAL_95, decay_interval, drawn
from galloping.physics import continuous, galerkin
from galloping.physics.galerkin import STATES, Line
from galloping.polynomial import PolynomialModel, library
from galloping.recording import Input, Recording
from galloping.results import generator
from galloping.simulation import Simulator
from galloping.terms import parse

CASE = "internal_resonance"
DEGREE = 3
NOISE = 0.05  # of a sensor, relative to the standard deviation of what it reads
DURATION, RATE = 300, 100  # s, Hz
STEADY = 200  # s, from where amplitudes are read
FORECAST = 15.0  # s: six vertical periods
DRAWS = 24  # of the coefficients, for the intervals
QUANTITIES = (
    "amplitude_v", "amplitude_w", "damping_v", "frequency_v", "damping_w", "frequency_w",
)  # fmt: skip
JUDGED = 5  # the first of them, whose intervals are counted: w has no bar for its frequency
COLUMNS = (
    "truth", "sensors", "method", "replicate", "seed", "status", "reason", "path", "terms",
    *(f"{name}_error_percent" for name in QUANTITIES),
    *(f"{name}_interval_percent" for name in QUANTITIES),
    "damping_v_bound_percent", "damping_w_bound_percent",
    "intervals_held", "forecast_r2", "other_winds_error_percent", "seconds",
)  # fmt: skip


LAYOUTS = {"projected": continuous.QUARTERS, "mid-span": (0.5,), "states": ()}  # places, in spans


@dataclass(frozen=True)
class SensedLine:
    """A line and its sensors.

    modes: sine modes in each direction, or 0 for the two shapes of the paper's model.
    aerodynamics: as in `continuous.span`. intensity: of the gusts. sensors: of LAYOUTS, told apart
    into as many sine modes, the first of which is recorded; or the modal `states`. velocities:
    whether they are measured. wind: whether the wind is, the model's library then being the
    quasi-static law.
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
SPEED = "U"  # the input that is the wind
# m/s, from the recorded mean: there amplitudes are asked for as well. At 2 m/s above it, 14 m/s,
# further ones of the nine modes gallop by themselves within 300 s, and the line is another one.
OTHER_WINDS = (-2.0, 1.0)
DRIVEN = ("maximum_likelihood", "weak_gls")  # methods that take inputs


def line_of(case: Mapping, truth: SensedLine) -> continuous.Span:
    """The line of a truth in the wind of a `cases` section."""
    if truth.modes:
        return continuous.continuous_line(case, truth.modes, aerodynamic=truth.aerodynamics)
    phi, psi = galerkin.modes(case, Line.from_case(case))
    return continuous.span(case, [phi], [psi], aerodynamic=truth.aerodynamics)


def motion(
    case: Mapping,
    line: continuous.Span,
    truth: SensedLine,
    time: np.ndarray,
    speed: np.ndarray | None = None,
) -> np.ndarray:
    """(n, n_sensors, 4): q_v, q_w, dq_v, dq_w as each sensor reads them, without noise.

    speed: (n,) m/s, the wind, by default steady. The modal states count as one sensor.
    """
    start = continuous.release(line, [case["initial_state"][state] for state in STATES[:2]])
    states = continuous.simulate(line, start, time, speed)
    if truth.sensors == "states":
        return states[:, np.newaxis]
    where = _places(line, truth)
    both = [
        continuous.readings(line, states, where, quantity)
        for quantity in ("displacement", "velocity")
    ]
    return np.concatenate(both, axis=2)


def combined(line: continuous.Span, truth: SensedLine, values: np.ndarray) -> np.ndarray:
    """(n, 4): the states that are made of the sensors' readings (n, n_sensors, 4)."""
    if truth.sensors == "states":
        return values[:, 0]
    return continuous.first_modes(values, _places(line, truth), line.line.span)[:, 0]


def _places(line: continuous.Span, truth: SensedLine) -> list[float]:
    return [share * line.line.span for share in LAYOUTS[truth.sensors]]


def linear_modes(model: PolynomialModel) -> np.ndarray:
    """Net damping and frequency, v and w: -2 Re and Im of the eigenvalues at rest, 1/s and rad/s.

    Rest is the equilibrium near the origin, by Newton's method. NaN where there are no two
    oscillations.
    """
    rest = np.zeros((1, len(model.states)))
    for _ in range(10):
        rest = rest - np.linalg.lstsq(model.jacobian(rest)[0], model(rest)[0], rcond=None)[0]
    values = np.linalg.eigvals(model.jacobian(rest)[0])
    values = values[values.imag > 0]
    if len(values) != 2:
        return np.full(4, np.nan)
    w, v = values[np.argsort(values.imag)]
    return np.array([-2.0 * v.real, v.imag, -2.0 * w.real, w.imag])


def answer(
    identified: IdentifiedModel, start: np.ndarray, time: np.ndarray, simulator: Simulator,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """What a model says of a line: values and half widths of 95 % intervals, by QUANTITIES.

    Amplitudes are of the motion from `start` (4,) after STEADY s. Intervals are those of models
    drawn with the covariance of the coefficients; NaN without one. An amplitude is of the motion,
    not of the model alone: the further modes that an approximate model names are added to its
    motion, what it says that it leaves to the interval.
    """
    besides = identified.further_motion(time)

    def quantities(model: PolynomialModel) -> np.ndarray:
        states = simulator(model, start, time).states + besides
        return np.concatenate([steady_amplitude(states[time >= STEADY])[:2], linear_modes(model)])

    values = quantities(identified.model)
    widths = np.full(len(QUANTITIES), np.nan)
    if len(identified.covariance) == identified.support.sum() > 0:
        sampled = np.array([quantities(each) for each in drawn(identified, DRAWS, rng)])
        # half of the middle 68 %: a few draws that diverge do not count
        low, high = np.nanquantile(sampled, [0.16, 0.84], axis=0)
        widths = NORMAL_95 * (high - low) / 2.0
        left = [identified.diagnostics.get(f"error_share_all_{q}", 0.0) for q in STATES[:2]]
        widths[:2] = np.hypot(widths[:2], left * values[:2])
    return values, widths


def forecast_r2(
    model: PolynomialModel, states: np.ndarray, time: np.ndarray, simulator: Simulator
) -> float:
    """R2 of forecasts over FORECAST s from points along a motion (n, 4), mean over q_v and q_w."""
    length = round(FORECAST / (time[1] - time[0]))
    left = np.zeros(2)
    for begin in range(0, len(time) - length, length):
        predicted = simulator(model, states[begin], time[begin : begin + length]).states
        left += np.sum((predicted - states[begin : begin + length])[:, :2] ** 2, axis=0)
    total = np.sum((states - states.mean(axis=0))[:, :2] ** 2, axis=0)
    return float(np.mean(1.0 - left / total)) if np.all(np.isfinite(left)) else -np.inf


def trial(
    seed: int, case: str, replicates: Sequence[int], methods: Mapping[str, Mapping]
) -> Iterator[dict[str, object]]:
    """A row for each replicate and method on the truth `case` of TRUTHS, a variant of the default
    line.

    methods: `Method.settings` by name. Replicates differ in the noise of the sensors and in the
    gusts; forecasts are judged on a motion in gusts that no method has seen. Seconds are those of
    the processor.
    """
    parameters, truth = plain(load({}))["cases"][CASE], TRUTHS[case]
    time = np.arange(DURATION * RATE + 1) / RATE
    line = line_of(parameters, truth)
    inputs = (SPEED,) if truth.wind else ()
    terms = (
        parse(f"wind({SPEED})", STATES, inputs)[0] if truth.wind else library(len(STATES), DEGREE)
    )
    whole = PolynomialModel(STATES, terms, np.ones((len(STATES), len(terms))), inputs)
    steady_terms = whole.at(dict.fromkeys(inputs, line.speed)).terms
    simulator = Simulator(STATES, steady_terms)
    driven = Simulator(STATES, terms, inputs=inputs) if truth.wind else simulator

    def moved(*name: str | int) -> tuple[np.ndarray, dict[str, Input], np.random.Generator]:
        rng = generator(seed, "model_error", case, *name)
        gusts = {**parameters["truth"]["gusts"], "intensity": truth.intensity}
        speed = continuous.wind(line, gusts, time, rng)
        measured = {SPEED: Input(time, speed)} if truth.wind else {}
        return motion(parameters, line, truth, time, speed), measured, rng

    steady = combined(line, truth, motion(parameters, line, truth, time))
    unseen, unseen_wind, _ = moved("unseen")
    unseen = combined(line, truth, unseen)
    true = _true_quantities(line, steady[time >= STEADY])
    others = _other_winds(parameters, truth, time) if truth.wind else {}
    for replicate in replicates:
        clean, measured, rng = moved(replicate)
        noise = NOISE * clean.std(axis=0) * rng.standard_normal(clean.shape)
        values = combined(line, truth, clean + noise)
        if not truth.velocities:
            values[:, 2:] = np.nan
        recordings = [(Recording(time, STATES, values, inputs=measured),)]
        for method, settings in methods.items():
            if truth.wind and method not in DRIVEN:
                continue
            name = ("model_error", case, str(replicate))
            identified, row = identified_by({method: settings}, recordings, terms, name)
            row |= {"truth": case, "sensors": truth.sensors, "replicate": replicate, "seed": seed}
            if identified.status != "refused":
                draws = generator(seed, "model_error", case, replicate, method)
                held = identified.at(dict.fromkeys(inputs, line.speed))
                row |= _judged(*answer(held, steady[0], time, simulator, draws), true)
                row["terms"] = int(identified.support.sum())
                forecasts = partial(driven, inputs=unseen_wind)
                row["forecast_r2"] = forecast_r2(identified.model, unseen, time, forecasts)
                if others:
                    row["other_winds_error_percent"] = max(
                        _missed(identified.model.at({SPEED: speed}), steady[0], time, amplitude)
                        for speed, amplitude in others.items()
                    )
            yield row


def identified_by(
    method: Mapping[str, Mapping], recordings: Sequence, terms: Sequence, name: Sequence[str]
) -> tuple[IdentifiedModel, dict[str, object]]:
    """What one method gives of recordings, and the row that says so."""
    began = process_time()
    ((found,),) = identify(method, recordings, terms, name).values()
    return found, dict.fromkeys(COLUMNS, np.nan) | {
        "method": next(iter(method)), "status": found.status, "reason": found.reason,
        "path": found.diagnostics.get("path", ""), "seconds": process_time() - began,
    }  # fmt: skip


def _other_winds(
    parameters: Mapping, truth: SensedLine, time: np.ndarray
) -> dict[float, np.ndarray]:
    """(2,) amplitudes of q_v and q_w in other steady winds, m/s, from the same start."""
    found = {}
    for change in OTHER_WINDS:
        speed = parameters["wind"]["speed"] + change
        case = {**parameters, "wind": {**parameters["wind"], "speed": speed}}
        line = line_of(case, truth)
        states = combined(line, truth, motion(case, line, truth, time))
        found[speed] = steady_amplitude(states[time >= STEADY])[:2]
    return found


def _missed(
    model: PolynomialModel, start: np.ndarray, time: np.ndarray, amplitude: np.ndarray
) -> float:
    """Largest error of the amplitudes of a motion, %."""
    states = Simulator(STATES, model.terms)(model, start, time).states
    said = steady_amplitude(states[time >= STEADY])[:2]
    return float(100.0 * np.max(np.abs(said / amplitude - 1.0)))


def _judged(values: np.ndarray, widths: np.ndarray, true: np.ndarray) -> dict[str, float]:
    """Errors and intervals in percent, and the share of the judged intervals that hold."""
    held = (np.abs(values - true) <= widths)[:JUDGED]
    row = {"intervals_held": np.mean(held) if np.all(np.isfinite(widths)) else np.nan}
    for name, value, width, of in zip(QUANTITIES, values, widths, true, strict=True):
        row[f"{name}_error_percent"] = 100.0 * (value / of - 1.0)
        row[f"{name}_interval_percent"] = 100.0 * width / abs(of)
    return row


def _true_quantities(line: continuous.Span, steady: np.ndarray) -> np.ndarray:
    """(6,) QUANTITIES of a line whose motion in its steady window is `steady` (n, 4)."""
    vertical, horizontal = _symmetric_modes(line)
    modes = (-2.0 * vertical.real, vertical.imag, -2.0 * horizontal.real, horizontal.imag)
    return np.array([*steady_amplitude(steady)[:2], *modes])


def _symmetric_modes(line: continuous.Span) -> tuple[complex, complex]:
    """Eigenvalues of the first symmetric modes in plane and out of plane."""
    values, vectors = continuous.eigenvalues(line)
    found = []
    for direction in (0, 1):
        own = slice(direction * line.modes, (direction + 1) * line.modes)
        moving = np.linalg.norm(vectors[: 2 * line.modes], axis=0)
        share = np.linalg.norm(vectors[own], axis=0) / moving
        shapes = np.abs(line.shapes[direction] @ vectors[own])
        middle = shapes[len(shapes) // 2] > 0.5 * shapes.max(axis=0)
        found.append(values[np.flatnonzero((share > 0.7) & middle)[0]])
    return found[0], found[1]


# --- two modes in random forces ---


FREQUENCIES, DAMPING = (0.4, 1.0), (0.003, 0.02)  # Hz; ratio to critical
DURATIONS, RATES = (300.0, 1200.0), (5.0, 25.0)  # s, Hz
MIXED = 0.3  # most that a mode moves the other coordinate, in its own
APART = 1.15  # least ratio of the two frequencies
FREE = tuple((i, np.array([j])) for i in (2, 3) for j in range(4))  # coefficients and their states


@dataclass(frozen=True)
class RandomMotion:
    """dx = system x dt + white forces, x of STATES; displacements are sampled with white noise.

    system, forces: (4, 4), forces the covariance in a second. noise: (2,) standard deviations.
    """

    system: np.ndarray
    forces: np.ndarray
    noise: np.ndarray
    recording: Recording

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "RandomMotion":
        """Two modes that move alike far on the average, within the ranges above."""
        omega = np.ones(2)
        while omega.max() < APART * omega.min():
            omega = 2.0 * np.pi * rng.uniform(*FREQUENCIES, 2)
        damping, shapes = rng.uniform(*DAMPING, 2), np.eye(2)
        shapes[[0, 1], [1, 0]] = rng.uniform(-MIXED, MIXED, 2)
        duration, rate = rng.uniform(*DURATIONS), rng.uniform(*RATES)
        inverse, system, forces = np.linalg.inv(shapes), np.eye(4, k=2), np.zeros((4, 4))
        system[2:, :2] = -shapes * omega**2 @ inverse
        system[2:, 2:] = -shapes * (2.0 * damping * omega) @ inverse
        root = shapes * np.sqrt(4.0 * damping * omega**3)  # modes that move as much as each other
        forces[2:, 2:] = root @ root.T
        stationary, step, moved = _discrete(system, forces, 1.0 / rate)
        root = np.linalg.cholesky(moved)
        states = np.empty((round(duration * rate), 4))
        states[0] = np.linalg.cholesky(stationary) @ rng.standard_normal(4)
        for k in range(1, len(states)):
            states[k] = step @ states[k - 1] + root @ rng.standard_normal(4)
        noise = NOISE * states.std(axis=0)
        values = states + noise * rng.standard_normal(states.shape)
        values[:, 2:] = np.nan
        recording = Recording(np.arange(len(states)) / rate, STATES, values)
        return cls(system, forces, noise[:2], recording)

    def least_errors(self) -> np.ndarray:
        """(2,) standard deviations of the decays, 1/s: the Cramér-Rao bound, by P. Whittle's
        likelihood (Ark. Mat. 2, 1953), for unknown coefficients, forces and noise.
        """
        step = self.recording.time[1] - self.recording.time[0]
        frequencies = np.arange(1, len(self.recording.time) // 2) / len(self.recording.time)
        turned = np.exp(2j * np.pi * frequencies)[:, np.newaxis, np.newaxis] * np.eye(4)

        def spectrum(parameters: np.ndarray) -> np.ndarray:
            system, forces = self.system.copy(), np.zeros((4, 4))
            system[2:] = parameters[:8].reshape(2, 4)
            forces[2:, 2:] = parameters[[8, 9, 9, 10]].reshape(2, 2)
            _, moves, moved = _discrete(system, forces, step)
            response = np.linalg.inv(turned - moves)[:, :2]
            return response @ moved @ response.conj().swapaxes(1, 2) + np.diag(parameters[11:])

        forces, noise = self.forces[2:, 2:], self.noise**2
        true = np.r_[self.system[2:].ravel(), forces[0], forces[1, 1], noise]
        steps = np.diag(np.r_[np.full(8, 1e-5), np.full(3, forces.max()), noise])  # last linear
        inverse = np.linalg.inv(spectrum(true))
        slopes = [
            inverse @ (spectrum(true + h) - spectrum(true - h)) / (2.0 * h.sum()) for h in steps
        ]
        information = np.einsum("afij,bfji->ab", slopes, slopes).real
        covariance = np.linalg.inv(information)[:8, :8]
        _, told = decays(self.system, FREE)
        return np.sqrt(np.einsum("mi,ij,mj->m", told, covariance, told))


def _discrete(
    system: np.ndarray, forces: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stationary covariance, transition over `step` s, and covariance of what forces add."""
    stationary, transition = solve_continuous_lyapunov(system, -forces), expm(system * step)
    return stationary, transition, stationary - transition @ stationary @ transition.T


def in_random_forces(
    seed: int, case: str, replicates: Sequence[int], methods: Mapping[str, Mapping]
) -> Iterator[dict[str, object]]:
    """A row for each replicate and method, as of `trial`, of two modes in random forces.

    Their frequencies, damping, shapes, duration and rate of sampling are drawn by number.

    The slower mode is the vertical one. intervals_held: of the decays of both modes; nothing is
    judged where no random forces are answered. Seconds are those of the processor.
    """
    for replicate in replicates:
        motion = RandomMotion.drawn(generator(seed, "ambient", case, replicate))
        (true, _), bound = decays(motion.system, ()), motion.least_errors()
        for method, settings in methods.items():
            terms, name = library(len(STATES), DEGREE), ("ambient", case, str(replicate))
            found, row = identified_by({method: settings}, [[motion.recording]], terms, name)
            row |= {"truth": case, "sensors": "displacements", "replicate": replicate, "seed": seed}
            if found.is_forced:
                places = np.argwhere(found.support)
                exponents = np.array(found.model.terms)[places[:, 1]]
                moved = [
                    (i, np.flatnonzero(e)) for (i, _), e in zip(places, exponents, strict=True)
                ]
                said, slopes = decays(found.model.jacobian(np.zeros((1, 4)))[0], moved)
                errors = np.sqrt(np.einsum("mi,ij,mj->m", slopes, found.covariance, slopes))
                lasted, held = found.diagnostics["duration"], []
                row["terms"] = len(places)
                for k, direction in enumerate("vw"):
                    low, high = decay_interval(-said[k].real, errors[k], lasted)
                    held.append(low <= -true[k].real <= high)
                    row[f"damping_{direction}_bound_percent"] = -100.0 * bound[k] / true[k].real
                    for quantity, part in (("damping", np.real), ("frequency", np.imag)):
                        off = 100.0 * (part(said[k]) / part(true[k]) - 1.0)
                        row[f"{quantity}_{direction}_error_percent"] = float(off)
                row["intervals_held"] = float(np.mean(held))
            yield row


def decays(
    system: np.ndarray, places: Sequence[tuple[int, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues of the modes, 1/s, by frequency, and slopes (n_modes, n_places) of their decays.

    places: of each coefficient its equation and the state that it is of, none of a constant.
    """
    values, right = np.linalg.eig(system)
    left, own = np.linalg.inv(right), np.flatnonzero(values.imag > 0.0)
    own = own[np.argsort(values[own].imag)]
    slopes = [[-(left[m, i] * right[j, m].sum()).real for i, j in places] for m in own]
    return values[own], np.array(slopes)
