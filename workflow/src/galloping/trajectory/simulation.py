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

# m, far beyond any span's clearance: a model that gets here has lost its limit cycle. Of a system
# in other units, such as mV, so it has where it is as many times as far as it began. Of a motion
# whose size is known callers say how far is too far.
DIVERGENCE_LIMIT, TIMES_THE_START = 1e3, 100.0
# Of any system, of which nothing but the begin of a motion is known: times as far, it runs away.
AWAY = 1e12
# Samples that show a motion are no further apart than steps, and the longest motion without samples
# is that of a span before it has settled: a model that needs more steps is far too fast.
MAX_STEPS_PER_SAMPLE, MOST_STEPS_BETWEEN = 2, 2**16
# Equal steps are as short as the shortest that the motion needs: so many times as many are taken.
EQUAL_STEPS = 4


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
        self,
        states: tuple[str, ...],
        terms: tuple[Exponents, ...],
        inputs: tuple[str, ...] = (),
    ) -> None:
        self.states, self.terms, self.inputs = states, terms, inputs
        self._step = np.inf
        self._at: dict[tuple[str, ...], Simulator] = {}

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
        model with a term that the simulator does not have, and if an input is missing or does not
        cover `time`.
        """
        model = model.on_library(self.terms)
        start, steps = np.asarray(x0, float), max_steps(time)
        if self.inputs:
            checked = check_inputs(model, inputs or {}, time)
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
        held = {name: one for name, one in inputs.items() if not isinstance(one, Input)}
        if held:
            model = model.at(held)
            key = tuple(held)
            if key not in self._at:
                self._at[key] = Simulator(self.states, model.terms, inputs=model.inputs)
            others = {name: inputs[name] for name in model.inputs}
            return self._at[key](model, x0, time, others, limit)
        own = [one for name in model.inputs if isinstance(one := inputs[name], Input)]  # all
        step, most = min(self._step, first_step(own)), EQUAL_STEPS * max_steps(time)
        try:
            states, _, self._step = solve_driven(model, own, x0, time, step, most)
        except FloatingPointError as error:
            nowhere = np.empty((0, len(self.states)))
            return self._ended(time, nowhere, f"stopped: {error}")
        limit = _divergence_limit(x0) if limit is None else limit
        with np.errstate(over="ignore", invalid="ignore"):
            far = ~(np.sum(states**2, axis=1) < limit**2)
        if not far.any():
            return Trajectory(time, states, "ok", self.states)
        at = int(np.argmax(far))
        why = f"diverged: |x| exceeded {limit:g} at t = {time[at]:.4g} s"
        return self._ended(time, states[:at], why)

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
    return max(DIVERGENCE_LIMIT, TIMES_THE_START * float(np.linalg.norm(x0)))


def escape_distance(x0: NDArray[np.float64]) -> float:
    """Compute the distance from zero beyond which a motion from a given start has diverged.

    x0: (n_states,) initial state. The distance for a start at zero is the same as for a start at
    one.
    """
    return AWAY * (float(np.linalg.norm(x0)) or 1.0)


def max_steps(time: NDArray[np.float64]) -> int:
    """Return the largest number of integration steps allowed for a motion at given times."""
    return MOST_STEPS_BETWEEN + MAX_STEPS_PER_SAMPLE * len(time)


def check_inputs(
    model: PolynomialModel, inputs: Mapping[str, Input | float], time: NDArray[np.float64]
) -> dict[str, Input | float]:
    """Return a model's inputs in its order, after a check that they cover given times.

    time: (n,) s. Raises ValueError if an input is missing, is neither an Input nor a number, is not
    known at all times, as in a gap, or is zero where a term is divided by it.
    """
    for name in model.inputs:
        if name not in inputs:
            raise ValueError(f"inputs: {name}: not there; the model is driven by it")
        one = inputs[name]
        if isinstance(one, Input):
            if not (covered := one.covered(time)).all():
                raise ValueError(f"inputs: {name}: not there at {time[~covered][0]:.6g} s")
            for term in compress(model.terms, model.has_term):
                if term[model.names.index(name)] < 0 and one.has_zero(time):
                    said = f"{term_name(term, model.names)} is not finite there"
                    raise ValueError(f"inputs: {name}: 0; {said}")
        elif not isinstance(one, Real):
            raise ValueError(f"inputs: {name}: a {type(one).__name__}; must be Input or number")
    return {name: inputs[name] for name in model.inputs}


def time_grid(duration: float, sampling_rate: float) -> np.ndarray:
    """Make equally spaced sample times (s) from zero to a duration at a sampling rate."""
    return np.arange(round(duration * sampling_rate) + 1) / sampling_rate


# --- rates of motions that stick ---


STILL = 1e-9  # of the greatest argument of a sign in a motion: what is less sticks, if it can


def rates_along(
    model: PolynomialModel, states: NDArray[np.float64], driving: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Compute the state derivatives along a motion, including sticking by dry friction.

    states: (n, n_states). A sticking state does not accelerate. driving: (n, n_inputs) of a model
    with inputs.
    """
    rates = model(states, driving)
    held = sticking_projections(model, states, rates, driving)
    return rates if held is None else np.einsum("nij,nj->ni", held, rates)


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
    both, n, places = join_inputs(states, driving), len(model.states), len(model.names)
    signs = [own for own in split_functions(model.terms)[0] if own.name == "sign"]
    if not signs:
        return None
    weights = np.array([own.weights for own in signs])
    arguments = np.abs(np.stack([own.argument(states) for own in signs], axis=1))
    still = arguments <= STILL * arguments.max(axis=0)
    of_signs = np.zeros((len(states), n, len(signs)))
    for k, own in enumerate(signs):
        has = [own in term[places:] for term in model.terms]
        left = tuple(
            tuple(factor for factor in term if factor is not own and factor != own)
            for term in compress(model.terms, has)
        )
        of_signs[:, :, k] = design_matrix(both, left) @ model.coefficients[:, has].T
    held = np.tile(np.eye(n), (len(states), 1, 1))
    for row in np.flatnonzero(still.any(axis=1)):
        own = still[row]
        balance = weights[own] @ of_signs[row][:, own]
        if np.linalg.matrix_rank(balance) == len(balance):
            change = np.linalg.solve(balance, weights[own])
            sign = [np.sign(one.argument(states[row : row + 1])[0]) for one in compress(signs, own)]
            if np.all(np.abs(sign - change @ rates[row]) <= 1.0):
                held[row] -= of_signs[row][:, own] @ change
    return held


# --- models with inputs: equal steps, halved until they are accurate ---


# Degree of the polynomial that an input is over a step: a cubic spline is hardly more than that
# over two of its samples.
DEGREE, SAMPLES_PER_STEP = 5, 2
# Truncation of a step's Taylor series, relative to the size of each state.
ACCURACY = 1e-10
SETTLED = 5  # halvings of the step, through which a solution that diverges does so at one time
FAR = 1e8  # times its size at first, from which a solution diverges


def first_step(inputs: Sequence[Input]) -> float:
    """Choose the first integration step (s) from the sampling intervals of the inputs.

    It is that of the finest input, between samples at which it jumps.
    """
    return min(
        (1 if one.between == "zero" else SAMPLES_PER_STEP) * float(np.median(np.diff(one.time)))
        for one in inputs
    )


@lru_cache(maxsize=2)  # of many models over the same times
def _over_windows(
    inputs: tuple[Input, ...], factors: tuple[Factor, ...], start: float, step: float, windows: int
) -> NDArray[np.float64]:
    return fit_windows(inputs, factors, start, step, windows, DEGREE)


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
    Returns states (n, n_states), beyond FAR times their initial size or not finite where they
    diverge, and derivatives (n, n_states, n_free + n_states) by the free coefficients and the
    start, without columns if `free` is None. Raises FloatingPointError if more than `most` steps
    were needed.
    """
    n_states, wanted = len(start), free is not None
    if not wanted:  # nor are terms that are not there
        model = model.without_absent_terms()
    table = make_tables(model.terms, n_states)
    columns = np.asarray(free).reshape(-1, 2) if wanted else np.empty((0, 2), int)
    compiled = compile_system(table, model.coefficients, columns)
    diverged, longest = None, step
    ends: list[tuple[float, float]] = []
    far = FAR * _size_at_first(model, inputs, start, time)
    while (windows := max(1, int(np.ceil((time[-1] - time[0]) / step - 1e-9)))) <= most:
        place = (time - time[0]) / step
        window = np.minimum(place.astype(np.int64), windows - 1)
        powers, samples, row = at_points(compiled, window, place - window, windows, n_states)
        with np.errstate(all="ignore"):
            found, slopes, _, _, truncation = integrate(
                compiled, step, np.array([0, windows]), start[None], powers, np.arange(n_states),
                _over_windows(tuple(inputs), table.factors, time[0], step, windows), wanted,
                samples,
            )  # fmt: skip
            states, moved = found[window, :, row], slopes[window, :, row]
            near = np.sum(states**2, axis=1) < far**2
        if near.all() and truncation < ACCURACY:
            return states, moved, step
        diverged = None if near.all() else (states, moved, longest)
        at = int(np.argmin(near))
        ends = [] if near.all() else [*ends[1 - SETTLED :], (time[max(at - 1, 0)], time[at])]
        if len(ends) == SETTLED and np.ptp(ends) <= 0.01 * (ends[-1][1] - time[0]):
            break
        step /= 2.0
    if diverged is not None:
        return diverged
    raise FloatingPointError(f"more than {most} integration steps")


def _size_at_first(
    model: PolynomialModel,
    inputs: Sequence[Input],
    start: NDArray[np.float64],
    time: NDArray[np.float64],
) -> float:
    """Estimate the size of a motion from its start and the effect of the inputs in a radian."""
    driving = np.sqrt([[np.nanmean(one.values**2) for one in inputs]])
    rates, jacobian = model(start[None], driving)[0], model.jacobian(start[None], driving)[0]
    fastest = np.max(np.abs(np.linalg.eigvals(jacobian)))
    lasts = 1.0 / fastest if fastest > 0.0 else time[-1] - time[0]
    return float(np.linalg.norm(start) + np.linalg.norm(rates) * lasts) or 1.0
