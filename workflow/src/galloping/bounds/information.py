"""The Cramer-Rao bound: how precisely any unbiased method can know each coefficient."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from galloping.bounds.sensitivity import rate_sensitivities, sensitivities
from galloping.inputs import Input, at_times
from galloping.polynomial import PolynomialModel, design_matrix


@dataclass(frozen=True)
class Experiment:
    """What one recording measures: where it starts, when it samples, and how well.

    initial_state: (n_states,). time: (n,), s, increasing, any sampling; the state at time[0] is
    `initial_state`. sigma: (n_states,) standard deviation of the noise on each state, in the
    state's unit, infinite for a state that is not measured. rate_sigma: the same of the states'
    derivatives, None where none is measured. inputs: those of a model that has any.
    """

    initial_state: np.ndarray
    time: np.ndarray
    sigma: np.ndarray
    rate_sigma: np.ndarray | None = None
    inputs: Mapping[str, Input] = field(default_factory=dict)


@dataclass(frozen=True)
class Bound:
    """The bound of each free coefficient.

    free: (n_free, 2) pairs (equation, term). std: (n_free,) least standard deviation, in the
    coefficient's unit, infinite where the data say nothing. t: (n_free,) |coefficient| / std.
    covariance: (n_free, n_free), the inverse of the information, infinite where it is singular.
    """

    free: np.ndarray
    std: np.ndarray
    t: np.ndarray
    covariance: np.ndarray


def state_bound(model: PolynomialModel, free: np.ndarray, experiments: list[Experiment]) -> Bound:
    """Bound from noisy states: protocols `state` and `displacement`, subsets, several recordings.

    free: (n_free, 2) pairs (equation, term). The recordings share the coefficients; the initial
    state of each is unknown. The information is the sum over samples of S^T S / sigma^2.
    Raises ValueError where the model's solution diverges.
    """
    free = np.asarray(free).reshape(-1, 2)
    total = np.zeros((len(free), len(free)))
    for experiment in experiments:
        total += information(model, free, experiment)
    return bound_of(model, free, total)


def information(model: PolynomialModel, free: np.ndarray, experiment: Experiment) -> np.ndarray:
    """(n_free, n_free) Fisher information of one recording, its initial state eliminated.

    Raises ValueError where the model's solution diverges.
    """
    return fisher_information(weighted_sensitivities(model, free, experiment), len(free))


def weighted_sensitivities(
    model: PolynomialModel, free: np.ndarray, experiment: Experiment
) -> np.ndarray:
    """(n, n_channels, n_free + n_states): what samples depend on, in deviations of their noise.

    Channels are the states and then, where any is measured, their derivatives. Columns are by the
    free coefficients and then by the initial state. Raises ValueError where the model's
    solution diverges.
    """
    time, inputs = experiment.time, experiment.inputs
    states, s = sensitivities(model, free, experiment.initial_state, time, inputs)
    weighted = s / experiment.sigma[:, None]
    if experiment.rate_sigma is None:
        return weighted
    driving = at_times([inputs[name] for name in model.inputs], time)
    rates = rate_sensitivities(model, free, states, s, driving) / experiment.rate_sigma[:, None]
    return np.concatenate([weighted, rates], axis=1)


def fisher_information(weighted: np.ndarray, n_free: int) -> np.ndarray:
    """(n_free, n_free), of the samples of `weighted_sensitivities`, or of some of them."""
    rows = weighted.reshape(-1, weighted.shape[2])
    return eliminated(rows.T @ rows, n_free)


def ranked_experiments(
    model: PolynomialModel,
    free: np.ndarray,
    done: list[Experiment],
    options: list[Experiment],
) -> list[tuple[int, Bound]]:
    """Which further recording would help most.

    free: (n_free, 2) pairs (equation, term), of present and, where their absence is in doubt, of
    absent terms. done: the recordings there are. options: further ones, of which one is made.
    Returns the index of each option with the bound after it, the one with the largest weakest t
    of the present terms first; options on which the model diverges are left out.
    """
    free = np.asarray(free).reshape(-1, 2)
    before = sum((information(model, free, one) for one in done), np.zeros((len(free), len(free))))
    present = model.coefficients[free[:, 0], free[:, 1]] != 0
    ranked = []
    for k, option in enumerate(options):
        try:
            ranked.append((k, bound_of(model, free, before + information(model, free, option))))
        except ValueError:
            continue
    return sorted(ranked, key=lambda entry: -entry[1].t[present].min())


def derivative_bound(
    model: PolynomialModel, free: np.ndarray, x: np.ndarray, sigma: np.ndarray
) -> Bound:
    """Bound from exact states and noisy derivatives: sigma^2 (Theta^T Theta)^-1, per equation.

    x: (n, n_states) the sampled states, with the inputs beside them if there are any. sigma:
    (n_states,) noise of each state derivative.
    """
    free = np.asarray(free).reshape(-1, 2)
    theta = design_matrix(x, model.terms)
    gram = theta.T @ theta
    total = np.zeros((len(free), len(free)))
    for equation in np.unique(free[:, 0]):
        rows = np.flatnonzero(free[:, 0] == equation)
        columns = free[rows, 1]
        total[np.ix_(rows, rows)] = gram[np.ix_(columns, columns)] / sigma[equation] ** 2
    return bound_of(model, free, total)


def eliminated(information: np.ndarray, keep: int) -> np.ndarray:
    """Information about the first `keep` parameters when the others are unknown (Schur)."""
    rest = information[keep:, keep:]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(rest), np.finfo(float).tiny))
    inverse = np.linalg.pinv(rest * scale[:, None] * scale, rcond=1e-13, hermitian=True)
    cross = information[:keep, keep:] * scale
    return information[:keep, :keep] - cross @ inverse @ cross.T


def covariance_of(information: np.ndarray) -> np.ndarray:
    """Inverse of an information matrix, its diagonal infinite where a parameter is undetermined."""
    diagonal = np.diag(information).copy()
    seen = diagonal > 0
    covariance = np.full(information.shape, np.inf)
    if not seen.any():
        return covariance
    scale = 1.0 / np.sqrt(diagonal[seen])
    values, vectors = np.linalg.eigh(information[np.ix_(seen, seen)] * scale[:, None] * scale)
    good = values > 1e-13 * values[-1]
    inverse = (vectors[:, good] / values[good]) @ vectors[:, good].T
    undetermined = (vectors[:, ~good] ** 2).sum(axis=1) > 1e-6
    inverse = inverse * scale[:, None] * scale
    inverse[undetermined, undetermined] = np.inf
    covariance[np.ix_(seen, seen)] = inverse
    return covariance


def bound_of(model: PolynomialModel, free: np.ndarray, total: np.ndarray) -> Bound:
    """The bound from the information `total` (n_free, n_free)."""
    covariance = covariance_of(total)
    std = np.sqrt(np.diag(covariance))
    t = np.abs(model.coefficients[free[:, 0], free[:, 1]]) / std
    return Bound(free, std, t, covariance)
