"""One tidy row of scores for each identified replicate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from galloping.evaluation.coefficients import (
    coverage,
    efficiency,
    mean_error_by_order,
    relative_norm_error,
    support_scores,
)
from galloping.evaluation.motion import r_squared, steady_amplitude, steady_frequency
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import PolynomialModel
from galloping.simulation import Simulator, Trajectory

DISPLACEMENTS = {"q_v": 0, "q_w": 1}
EQUATIONS = (2, 3)  # the kinematic rows carry no parameter of the line


@dataclass(frozen=True)
class Truth:
    """What identified models are compared with.

    model on the candidate library; time: (n,) s; states: (n, n_states); steady: window in s.
    """

    model: PolynomialModel
    time: np.ndarray
    states: np.ndarray
    steady: tuple[float, float]

    @property
    def steady_rows(self) -> slice:
        first, last = np.searchsorted(self.time, np.add(self.steady, (-1e-9, 1e-9)))
        return slice(int(first), int(last))


def reconstruct(simulator: Simulator, truth: Truth, result: IdentifiedModel) -> Trajectory:
    """The identified model's motion from the true initial state."""
    if result.status == "refused":
        return Trajectory(truth.time, np.full_like(truth.states, np.nan), result.verdict)
    return simulator(result.model, truth.states[0], truth.time)


def score(
    truth: Truth, result: IdentifiedModel, motion: Trajectory, bound: np.ndarray
) -> dict[str, float | str]:
    """All metrics of one replicate; failures score inf (errors) or -inf (R2), never nothing.

    bound: (n_states, n_terms) Cramer-Rao standard deviations, NaN without noise.
    """
    coefficients = result.model.coefficients
    rows, step = truth.steady_rows, float(truth.time[1] - truth.time[0])
    row: dict[str, float | str] = {"status": motion.status, "verdict": result.verdict}
    for order, error in mean_error_by_order(truth.model, coefficients, EQUATIONS).items():
        row[f"mean_error_{order}_percent"] = 100 * error
    row["e2"] = relative_norm_error(truth.model, coefficients)
    row |= support_scores(truth.model, coefficients)
    row["efficiency"] = efficiency(truth.model, coefficients, bound, EQUATIONS)
    row |= coverage(truth.model, coefficients, result.standard_errors, EQUATIONS)
    whole = r_squared(truth.states, motion.states)
    steady = r_squared(truth.states[rows], motion.states[rows])
    amplitude = _relative(steady_amplitude, truth.states[rows], motion.states[rows])
    frequency = _relative(
        lambda states: steady_frequency(states, step), truth.states[rows], motion.states[rows]
    )
    for name, k in DISPLACEMENTS.items():
        row[f"r2_{name}"] = whole[k]
        row[f"r2_steady_{name}"] = steady[k]
        row[f"amplitude_error_{name}_percent"] = 100 * amplitude[k]
        row[f"frequency_error_{name}_percent"] = 100 * frequency[k]
    return row


def _relative(measure, true: np.ndarray, model: np.ndarray) -> np.ndarray:
    """Relative error of a steady quantity, inf where the motion ended early."""
    if not np.all(np.isfinite(model)):
        return np.full(true.shape[1], np.inf)
    expected = measure(true)
    return np.abs(measure(model) - expected) / np.abs(expected)
