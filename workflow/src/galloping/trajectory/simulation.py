"""Simulation of polynomial models by power series, and detection of divergence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import compress
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from galloping.arrays import Immutable
from galloping.model.polynomial import (
    Exponents,
    PolynomialModel,
    design_matrix,
    join_inputs,
    split_functions,
    term_name,
)
from galloping.recording.samples import Factor, Input, fit_windows
from galloping.trajectory.right_hand_side import compile_system, make_tables
from galloping.trajectory.taylor import Ending, at_points, integrate, solve

if TYPE_CHECKING:
    from pandas import DataFrame

# A motion diverges at the larger of two distances from zero, unless the caller, who may know the
# size of the motion, gives the distance.
DIVERGENCE_LIMIT = 1e3  # distance, in m far beyond the clearance of any span
START_FACTOR = 100.0  # distance for other units such as mV, relative to the initial one
ESCAPE_FACTOR = 1e12  # distance if only the start is known, relative to the initial one
# A model that needs more steps is far too fast: samples that resolve a motion are as close as
# steps, and the longest motion without samples is that of a span before it has settled.
MAX_STEPS_PER_SAMPLE = 2  # largest number of steps for each sample
MAX_UNSAMPLED_STEPS = 2**16  # largest number of further steps, for a motion without samples
# Number of equal steps for each adapted one: equal steps are as short as the shortest.
EQUAL_STEP_RATIO = 4


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Immutable):
    """Simulated states of a model over time, and whether the integration ended early.

    Attributes
    ----------
    time : (n,) array
        Times, s.
    states : (n, n_states) array
        NaN after the integration ended early.
    status : str
        `ok`, or why the integration ended early.
    names : tuple of str
        Names of the states, if they are known.
    """

    time: NDArray[np.float64]
    states: NDArray[np.float64]
    status: str
    names: tuple[str, ...] = ()

    def __repr__(self) -> str:
        span = f" from {self.time[0]:.6g} to {self.time[-1]:.6g} s" if len(self.time) else ""
        samples, states = self.states.shape
        return f"Trajectory: {samples} samples of {states} states{span}, {self.status}"

    def to_frame(self) -> "DataFrame":
        """Convert the simulated states to a pandas DataFrame.

        Returns
        -------
        DataFrame
            A row for each time, which is the index `t` in s, and a column for each state.
        """
        import pandas as pd  # an extra, and slow to import

        names = self.names or [f"x{k}" for k in range(self.states.shape[1])]
        return pd.DataFrame(self.states, pd.Index(self.time, name="t"), list(names))


class Simulator:
    """Simulator of models whose terms belong to one candidate library.

    Without inputs, the motion is accurate to double precision. With inputs, the integrator is that
    of the likelihood, whose steps are as short as the sampling intervals of the inputs.

    Parameters
    ----------
    states : tuple of str
        Names of the states.
    terms : tuple of Exponents
        Exponents of the terms that models may have.
    inputs : tuple of str
        Names of the inputs of the models.
    """

    def __init__(
        self, states: tuple[str, ...], terms: tuple[Exponents, ...], inputs: tuple[str, ...] = ()
    ) -> None:
        self.states, self.terms, self.inputs = states, terms, inputs
        self._step = np.inf
        self._simulators: dict[tuple[str, ...], Simulator] = {}

    def __call__(
        self,
        model: PolynomialModel,
        x0: NDArray[np.float64],
        time: NDArray[np.float64],
        inputs: Mapping[str, Input | float] | None = None,
        limit: float | None = None,
    ) -> Trajectory:
        """Simulate a model from the state x0 (n_states,) at time[0], on the increasing grid `time`.

        inputs: each of the model's, measured or constant. limit: distance from zero at which the
        motion counts as diverged; by default that of a span in SI units. Raises ValueError for a
        model with a term that the simulator does not have, and if an input is missing, is not of
        the model or does not cover `time`.
        """
        model = model.on_library(self.terms)
        start, steps = np.asarray(x0, float), max_steps(time)
        checked = check_inputs(model, inputs or {}, time)
        if self.inputs:
            return self._simulate_driven(model, start, time, checked, limit)
        limit = _divergence_limit(start) if limit is None else limit
        states, _, end, ending = solve(model, start, time, steps, limit=limit)
        if ending is Ending.COMPLETE:
            return Trajectory(time, states, "ok", self.states)
        why = {
            Ending.TOO_MANY_STEPS: f"stopped: more than {steps} integration steps",
            Ending.NOT_FINITE: "diverged: not finite",
            Ending.BEYOND_LIMIT: f"diverged: |x| exceeded {limit:g}",
        }[ending]
        return self._ended(time, states, f"{why} at t = {end:.4g} s")

    def _simulate_driven(
        self,
        model: PolynomialModel,
        x0: NDArray[np.float64],
        time: NDArray[np.float64],
        inputs: Mapping[str, Input | float],
        limit: float | None,
    ) -> Trajectory:
        constants = {name: one for name, one in inputs.items() if not isinstance(one, Input)}
        if constants:
            model = model.at(constants)
            key = tuple(constants)
            if key not in self._simulators:
                self._simulators[key] = Simulator(self.states, model.terms, inputs=model.inputs)
            others = {name: inputs[name] for name in model.inputs}
            return self._simulators[key](model, x0, time, others, limit)
        signals = [one for name in model.inputs if isinstance(one := inputs[name], Input)]  # all
        step, most = min(self._step, first_step(signals)), EQUAL_STEP_RATIO * max_steps(time)
        try:
            states, _, self._step = solve_driven(model, signals, x0, time, step, most)
        except FloatingPointError as error:
            nowhere = np.empty((0, len(self.states)))
            return self._ended(time, nowhere, f"stopped: {error}")
        limit = _divergence_limit(x0) if limit is None else limit
        with np.errstate(over="ignore", invalid="ignore"):
            is_beyond = ~(np.sum(states**2, axis=1) < limit**2)
        if not is_beyond.any():
            return Trajectory(time, states, "ok", self.states)
        row = int(np.argmax(is_beyond))
        why = f"diverged: |x| exceeded {limit:g} at t = {time[row]:.4g} s"
        return self._ended(time, states[:row], why)

    def _ended(
        self, time: NDArray[np.float64], states: NDArray[np.float64], status: str
    ) -> Trajectory:
        """Make a Trajectory from a motion that ended early, with NaN at the missing times.

        states: (k, n_states), of the first k times.
        """
        missing = np.full((len(time) - len(states), states.shape[1]), np.nan)
        return Trajectory(time, np.concatenate([states, missing]), status, self.states)


def _divergence_limit(x0: NDArray[np.float64]) -> float:
    """Compute the distance from zero beyond which a motion from x0 (n_states,) has diverged."""
    return max(DIVERGENCE_LIMIT, START_FACTOR * float(np.linalg.norm(x0)))


def escape_distance(x0: NDArray[np.float64]) -> float:
    """Compute the distance from zero beyond which a motion from a given start has diverged.

    x0: (n_states,) initial state. The distance for a start at zero is the same as for a start at
    one.
    """
    return ESCAPE_FACTOR * (float(np.linalg.norm(x0)) or 1.0)


def max_steps(time: NDArray[np.float64]) -> int:
    """Return the largest number of integration steps allowed for a motion at given times."""
    return MAX_UNSAMPLED_STEPS + MAX_STEPS_PER_SAMPLE * len(time)


def check_inputs(
    model: PolynomialModel, inputs: Mapping[str, Input | float], time: NDArray[np.float64]
) -> dict[str, Input | float]:
    """Return a model's inputs in its order, after a check that they cover given times.

    time: (n,) s. Raises ValueError if an input is missing or of no model, is neither an Input nor a
    number, is not known at all times, as in a gap, or is zero where a term is divided by it.
    """
    for name in inputs:
        if name not in model.inputs:
            has = ", ".join(model.inputs) or "none"
            raise ValueError(f"inputs: {name}: no input of the model, which has {has}")
    for name in model.inputs:
        if name not in inputs:
            raise ValueError(f"inputs: {name}: not there; the model is driven by it")
        one = inputs[name]
        if isinstance(one, Input):
            if not (covered := one.covered(time)).all():
                raise ValueError(f"inputs: {name}: not there at {time[~covered][0]:.6g} s")
            for term in compress(model.terms, model.has_term):
                if term[model.names.index(name)] < 0 and one.has_zero(time):
                    infinite = f"{term_name(term, model.names)} is not finite there"
                    raise ValueError(f"inputs: {name}: 0; {infinite}")
        elif not isinstance(one, Real):
            raise ValueError(f"inputs: {name}: a {type(one).__name__}; must be Input or number")
    return {name: inputs[name] for name in model.inputs}


def time_grid(duration: float, sampling_rate: float) -> np.ndarray:
    """Make equally spaced sample times (s) from zero to a duration at a sampling rate."""
    return np.arange(round(duration * sampling_rate) + 1) / sampling_rate


# --- rates of motions that stick ---


STICKING_TOLERANCE = 1e-9  # argument of a sign that can stick, relative to the greatest in a motion


def rates_along(
    model: PolynomialModel, states: NDArray[np.float64], driving: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Compute the state derivatives along a motion, including sticking by dry friction.

    states: (n, n_states). A sticking state does not accelerate. driving: (n, n_inputs) of a model
    with inputs.
    """
    rates = model(states, driving)
    projections = sticking_projections(model, states, rates, driving)
    return rates if projections is None else np.einsum("nij,nj->ni", projections, rates)


def sticking_projections(
    model: PolynomialModel,
    states: NDArray[np.float64],
    rates: NDArray[np.float64],
    driving: NDArray[np.float64] | None = None,
) -> NDArray[np.float64] | None:
    """Compute matrices that cancel the acceleration of states that dry friction holds at rest.

    states, rates: (n, n_states), rates those of the model. Returns (n, n_states, n_states), factors
    on the rates and their derivatives, by which an argument of a sign remains at its zero; None for
    a model without one.
    """
    both, n, n_names = join_inputs(states, driving), len(model.states), len(model.names)
    signs = [function for function in split_functions(model.terms)[0] if function.name == "sign"]
    if not signs:
        return None
    weights = np.array([sign.weights for sign in signs])
    values = np.stack([sign.argument(states) for sign in signs], axis=1)
    is_still = np.abs(values) <= STICKING_TOLERANCE * np.abs(values).max(axis=0)
    by_signs = np.zeros((len(states), n, len(signs)))  # derivatives of the rates
    for k, sign in enumerate(signs):
        has_sign = [sign in term[n_names:] for term in model.terms]
        cofactors = tuple(
            tuple(factor for factor in term if factor != sign)
            for term in compress(model.terms, has_sign)
        )
        by_signs[:, :, k] = design_matrix(both, cofactors) @ model.coefficients[:, has_sign].T
    projections = np.tile(np.eye(n), (len(states), 1, 1))
    for row in np.flatnonzero(is_still.any(axis=1)):
        stuck = is_still[row]
        balance = weights[stuck] @ by_signs[row][:, stuck]
        if np.linalg.matrix_rank(balance) == len(balance):
            change = np.linalg.solve(balance, weights[stuck])
            at = states[row : row + 1]
            side = [np.sign(sign.argument(at)[0]) for sign in compress(signs, stuck)]
            if np.all(np.abs(side - change @ rates[row]) <= 1.0):
                projections[row] -= by_signs[row][:, stuck] @ change
    return projections


# --- models with inputs: equal steps, halved until they are accurate ---


INPUT_DEGREE = 5  # degree of the polynomial that replaces an input over a step
SAMPLES_PER_STEP = 2  # samples of a cubic spline in a step, for which that degree suffices
TRUNCATION_TOLERANCE = 1e-10  # error of a step's Taylor series, relative to the size of each state
HALVINGS = 5  # number of halved steps with one time of divergence after which a solution diverges
DIVERGENCE_FACTOR = 1e8  # size above which a solution diverges, relative to its initial size


def first_step(inputs: Sequence[Input]) -> float:
    """Choose the first integration step (s) from the sampling intervals of the inputs.

    It is that of the finest input, between samples at which it jumps.
    """
    return min(
        (1 if one.between == "zero" else SAMPLES_PER_STEP) * float(np.median(np.diff(one.time)))
        for one in inputs
    )


@lru_cache(maxsize=2)  # of many models over the same times
def _fit_inputs(
    inputs: tuple[Input, ...], factors: tuple[Factor, ...], start: float, step: float, windows: int
) -> NDArray[np.float64]:
    return fit_windows(inputs, factors, start, step, windows, INPUT_DEGREE)


def solve_driven(
    model: PolynomialModel,
    inputs: Sequence[Input],
    start: NDArray[np.float64],
    time: NDArray[np.float64],
    step: float,
    most: int,
    free: NDArray[np.int_] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Integrate a model with inputs; return states, sensitivities and the step used.

    inputs: those of the model, in its order. start: (n_states,) at time[0]. time: (n,) s,
    increasing. step: s, the longest to try. most: steps. free: (n_free, 2) pairs (equation, term).
    Returns states (n, n_states), where they diverge not finite or beyond DIVERGENCE_FACTOR times
    their initial size; and derivatives (n, n_states, n_free + n_states) by the free coefficients
    and the start, without columns if `free` is None. Raises FloatingPointError if more than `most`
    steps were needed.
    """
    n_states, sensitive = len(start), free is not None
    if not sensitive:
        model = model.without_absent_terms()
    table = make_tables(model.terms, n_states)
    columns = np.asarray(free).reshape(-1, 2) if sensitive else np.empty((0, 2), int)
    compiled = compile_system(table, model.coefficients, columns)
    diverged, longest = None, step
    ends: list[tuple[float, float]] = []
    limit = DIVERGENCE_FACTOR * _estimate_initial_size(model, inputs, start, time)
    while (windows := max(1, int(np.ceil((time[-1] - time[0]) / step - 1e-9)))) <= most:
        position = (time - time[0]) / step
        window = np.minimum(position.astype(np.int64), windows - 1)
        powers, samples, row = at_points(compiled, window, position - window, windows, n_states)
        with np.errstate(all="ignore"):
            values, derivatives, _, _, truncation = integrate(
                compiled, step, np.array([0, windows]), start[None], powers, np.arange(n_states),
                _fit_inputs(tuple(inputs), table.factors, time[0], step, windows), sensitive,
                samples,
            )  # fmt: skip
            states, slopes = values[window, :, row], derivatives[window, :, row]
            is_bounded = np.sum(states**2, axis=1) < limit**2
        if is_bounded.all() and truncation < TRUNCATION_TOLERANCE:
            return states, slopes, step
        diverged = None if is_bounded.all() else (states, slopes, longest)
        at = int(np.argmin(is_bounded))
        ends = [] if is_bounded.all() else [*ends[1 - HALVINGS :], (time[max(at - 1, 0)], time[at])]
        if len(ends) == HALVINGS and np.ptp(ends) <= 0.01 * (ends[-1][1] - time[0]):
            break
        step /= 2.0
    if diverged is not None:
        return diverged
    raise FloatingPointError(f"more than {most} integration steps")


def _estimate_initial_size(
    model: PolynomialModel,
    inputs: Sequence[Input],
    start: NDArray[np.float64],
    time: NDArray[np.float64],
) -> float:
    """Estimate the size of a motion from its start and the effect of the inputs in a radian."""
    driving = np.sqrt([[np.nanmean(one.values**2) for one in inputs]])
    rates, jacobian = model(start[None], driving)[0], model.jacobian(start[None], driving)[0]
    fastest = np.max(np.abs(np.linalg.eigvals(jacobian)))
    duration = 1.0 / fastest if fastest > 0.0 else time[-1] - time[0]
    return float(np.linalg.norm(start) + np.linalg.norm(rates) * duration) or 1.0
