"""Scores of identified models, and of all models of a study cell with their motions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from galloping.evaluation.motion import r_squared, steady_amplitude, steady_frequency
from galloping.identification.identified_model import IdentifiedModel
from galloping.line.galerkin import EQUATIONS
from galloping.model.intervals import NORMAL_95, QUANTILES_90
from galloping.model.polynomial import PolynomialModel
from galloping.results import DISPLACEMENT_COLUMNS, TERM_DEGREES, Reconstruction
from galloping.trajectory.simulation import Simulator, Trajectory

DYNAMIC_ROWS = tuple(EQUATIONS)  # the kinematic rows carry no parameter of the line
PLOT_RATE = 20.0  # sampling rate of plots, Hz: ten times the fastest harmonic that matters


def gallops(model: PolynomialModel) -> bool:
    """Decide whether an overhead line gallops: its equilibrium in the wind is unstable.

    Some eigenvalue of the linearised equations has a positive real part (Den Hartog 1932, with
    damping). Otherwise the motion decays, and its amplitude depends on the time.
    """
    return bool(model.small_motions(np.zeros(len(model.states))).values.real.max() > 0)


@dataclass(frozen=True)
class Truth:
    """True model and true motion, with which identified models are compared.

    model: on the candidate library and the terms that it lacks (`polynomial.extend_library`). time:
    (n,) s. states: (n, n_states). steady: window in s. status: `ok`, or why the line itself has no
    motion to compare with, as in `Trajectory`. is_own_model: whether the motion is the model's;
    that of a continuous line is not, and no coefficients are true.
    """

    model: PolynomialModel
    time: np.ndarray
    states: np.ndarray
    steady: tuple[float, float]
    status: str = "ok"
    is_own_model: bool = True

    @property
    def steady_rows(self) -> slice:
        """Slice of the samples within the steady window, both ends included."""
        first, last = np.searchsorted(self.time, np.add(self.steady, (-1e-9, 1e-9)))
        return slice(int(first), int(last))

    @property
    def step(self) -> float:
        """Time between two samples, s."""
        return float(self.time[1] - self.time[0])

    @cached_property
    def amplitude(self) -> np.ndarray:
        """Amplitude of each displacement in the steady window, m; NaN without galloping."""
        return np.where(gallops(self.model), steady_amplitude(self._steady_displacements), np.nan)

    @cached_property
    def frequency(self) -> np.ndarray:
        """Dominant frequency of each displacement in the steady window, Hz."""
        return steady_frequency(self._steady_displacements, self.step)

    @property
    def _steady_displacements(self) -> np.ndarray:
        return self.states[self.steady_rows][:, list(DISPLACEMENT_COLUMNS.values())]


def _on_terms_of(truth: Truth, values: np.ndarray, absent: float) -> np.ndarray:
    """Expand values on the candidate library to all terms of the truth, (n_states, n_terms)."""
    lacking = len(truth.model.terms) - values.shape[1]
    return np.pad(values, ((0, 0), (0, lacking)), constant_values=absent)


def score(
    truth: Truth, result: IdentifiedModel, motion: Trajectory, bound: np.ndarray
) -> dict[str, Any]:
    """Compute all scores of an identified model: errors of coefficients, terms and motion.

    Failures score inf (errors) or -inf (R2). bound: (n_states, n_terms) Cramér-Rao standard
    deviations, NaN without noise. Terms that the candidate library lacks are missing from the
    model. NaN is undefined: every number if the line itself diverges, those of coefficients if
    there are no true ones, the amplitude's error if it does not gallop.
    """
    coefficients = _on_terms_of(truth, result.model.coefficients, absent=0.0)
    standard_errors = _on_terms_of(truth, result.standard_errors, absent=np.nan)
    if result.status == "refused":
        coefficients = np.full_like(coefficients, np.nan)
    errors = mean_error_by_order(truth.model, coefficients, DYNAMIC_ROWS)
    numbers = {f"mean_error_{order}_percent": 100 * error for order, error in errors.items()}
    numbers["e2"] = relative_norm_error(truth.model, coefficients)
    numbers |= support_scores(truth.model, coefficients)
    numbers["efficiency"] = efficiency(truth.model, coefficients, bound, DYNAMIC_ROWS)
    numbers |= coverage(truth.model, coefficients, standard_errors, DYNAMIC_ROWS)
    if not truth.is_own_model:
        numbers = dict.fromkeys(numbers, np.nan)
    columns = list(DISPLACEMENT_COLUMNS.values())
    true, moved = truth.states[:, columns], motion.states[:, columns]
    steady_moved = moved[truth.steady_rows]
    whole = r_squared(true, moved)
    steady = r_squared(true[truth.steady_rows], steady_moved)
    amplitude = _relative_error(steady_amplitude, truth.amplitude, steady_moved)
    frequency = _relative_error(
        lambda states: steady_frequency(states, truth.step), truth.frequency, steady_moved
    )
    for k, name in enumerate(DISPLACEMENT_COLUMNS):
        numbers[f"r2_{name}"] = whole[k]
        numbers[f"r2_steady_{name}"] = steady[k]
        numbers[f"amplitude_error_{name}_percent"] = 100 * amplitude[k]
        numbers[f"frequency_error_{name}_percent"] = 100 * frequency[k]
    if truth.status != "ok":
        numbers = dict.fromkeys(numbers, np.nan)
    described = {"motion": motion.status, "status": result.status, "findings": result.codes}
    return described | numbers


def _relative_error(measure, expected: np.ndarray, model: np.ndarray) -> np.ndarray:
    """Compute the relative error of a steady quantity, inf if the motion ended early."""
    if not np.all(np.isfinite(model)):
        return np.where(np.isnan(expected), np.nan, np.inf)
    return np.abs(measure(model) - expected) / np.abs(expected)


def evaluate(
    truth: Truth, models: Mapping[str, Sequence[IdentifiedModel]], deviations: np.ndarray
) -> tuple[list[dict], dict[str, Reconstruction]]:
    """Score the models identified from a set of recordings, and summarise their motions.

    There is a row for each model; motions are reconstructed for each method. models: noise
    realisations by method. deviations: (1 or n_replicates, n_states, n_terms), the Cramér-Rao
    bound.
    """
    rows, reconstructions = [], {}
    for method, replicates in models.items():
        motions = reconstruct(truth, replicates)
        bounds = np.broadcast_to(deviations, (len(replicates), *deviations.shape[1:]))
        scores = list(map(score, [truth] * len(motions), replicates, motions, bounds))
        rows += [{"method": method, "replicate": k, **row} for k, row in enumerate(scores)]
        quality = np.array([row["r2_q_v"] + row["r2_q_w"] for row in scores])
        states = [motion.states for motion in motions]
        reconstructions[method] = reconstruction(truth.time, states, quality)
    return rows, reconstructions


def reconstruction(
    time: np.ndarray, states: Sequence[np.ndarray], quality: np.ndarray
) -> Reconstruction:
    """Summarise motions of several models by the motion with the median R2 and a 90 % band.

    The models are those of all noise realisations. time: (n,) s. states: (n, n_states) of each.
    quality: (n_replicates,), the higher the better.
    """
    stride = max(1, round(1 / (PLOT_RATE * (time[1] - time[0]))))
    middle = np.argsort(quality, kind="stable")[len(quality) // 2]
    thinned = np.stack([each[::stride] for each in states])
    low, high = np.quantile(thinned, QUANTILES_90, axis=0)
    return Reconstruction(time[::stride], thinned[middle], low, high)


def reconstruct(truth: Truth, replicates: Sequence[IdentifiedModel]) -> list[Trajectory]:
    """Simulate each identified model from the true initial state."""
    simulator = Simulator(truth.model.states, replicates[0].model.terms)
    nowhere = np.full_like(truth.states, np.nan)
    motions = []
    for identified in replicates:
        if truth.status != "ok":
            motions.append(Trajectory(truth.time, nowhere, f"the line itself {truth.status}"))
        elif identified.status == "refused":
            motions.append(Trajectory(truth.time, nowhere, identified.verdict))
        else:
            motions.append(simulator(identified.model, truth.states[0], truth.time))
    return motions


def mean_error_by_order(
    true: PolynomialModel, coefficients: np.ndarray, equations: tuple[int, ...]
) -> dict[str, float]:
    """Average the relative errors of true linear, quadratic and cubic coefficients separately.

    The errors are |estimate - true| / |true|; inf without a model.
    """
    rows, degree, means = list(equations), np.array([sum(term) for term in true.terms]), {}
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.abs(coefficients - true.coefficients) / np.abs(true.coefficients)
    for name, order in TERM_DEGREES.items():
        order_errors = errors[rows][true.support[rows] & (degree == order)]
        if order_errors.size:
            means[name] = (
                float(np.mean(order_errors)) if np.all(np.isfinite(order_errors)) else np.inf
            )
    return means


def support_scores(true: PolynomialModel, coefficients: np.ndarray) -> dict[str, float]:
    """Count missing and spurious terms of a model, and compute the Jaccard index of its terms.

    The index is TP / (TP + FN + FP); a failed fit has no terms.
    """
    support = np.nan_to_num(coefficients) != 0
    hit = int(np.sum(support & true.support))
    missing = int(np.sum(true.support & ~support))
    spurious = int(np.sum(support & ~true.support))
    ratio = hit / (hit + missing + spurious)
    return {"missing": missing, "spurious": spurious, "true_positive_ratio": ratio}


def relative_norm_error(true: PolynomialModel, coefficients: np.ndarray) -> float:
    """Compute the relative error of the vector of all coefficients, in the Euclidean norm.

    It is E2 = |c_hat - c| / |c| of the paper; inf without a model.
    """
    error = np.linalg.norm(coefficients - true.coefficients) / np.linalg.norm(true.coefficients)
    return float(error) if np.isfinite(error) else np.inf


def efficiency(
    true: PolynomialModel, coefficients: np.ndarray, bound: np.ndarray, equations: tuple[int, ...]
) -> float:
    """Compute the rms ratio of coefficient errors to Cramér-Rao standard deviations.

    It is that of the true terms. An efficient method has 1 on average; inf without model. NaN if
    the bound of any of the terms is infinite or undefined, as it is without noise: there is no best
    to compare with then, and the other terms alone would flatter a method that missed this one.
    """
    rows = list(equations)
    terms = true.support[rows]
    if not np.all(np.isfinite(bound[rows][terms])):
        return np.nan
    ratios = ((coefficients - true.coefficients) / bound)[rows][terms]
    value = np.sqrt(np.mean(ratios**2))
    return float(value) if np.isfinite(value) else np.inf


def coverage(
    true: PolynomialModel,
    coefficients: np.ndarray,
    standard_errors: np.ndarray,
    equations: tuple[int, ...],
) -> dict[str, float]:
    """Count the 95 % intervals of true coefficients, and how many contain the true value.

    A method without any interval has no counts (NaN); a missed term is not contained.
    """
    rows = list(equations)
    errors = standard_errors[rows]
    if np.all(np.isnan(errors)):
        return {"intervals": np.nan, "intervals_covering": np.nan}
    terms = true.support[rows]
    distances = np.abs(coefficients - true.coefficients)[rows][terms]
    is_covered = distances <= NORMAL_95 * np.nan_to_num(errors[terms])
    return {"intervals": float(terms.sum()), "intervals_covering": float(is_covered.sum())}
