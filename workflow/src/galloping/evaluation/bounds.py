"""Cramér-Rao bound: the smallest errors of coefficients that an unbiased method can have."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from galloping.model.polynomial import PolynomialModel, design_matrix, join_inputs
from galloping.recording.measurement import Motion, Noise
from galloping.recording.samples import Input, inputs_at_times
from galloping.trajectory.simulation import (
    EQUAL_STEP_RATIO,
    check_inputs,
    first_step,
    max_steps,
    solve_driven,
    sticking_projections,
)
from galloping.trajectory.taylor import Ending, solve


def sensitivities(
    model: PolynomialModel,
    free: np.ndarray,
    initial_state: np.ndarray,
    time: np.ndarray,
    inputs: Mapping[str, Input] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate a model together with the sensitivities to its coefficients and initial state.

    The accuracy is double precision if the model has no inputs. free: (n_free, 2) pairs (equation,
    term) of the coefficients to differentiate by; absent ones too. initial_state: (n_states,) at
    time[0]. time: (n,), s, increasing. inputs: the model's. Returns the states (n, n_states) and
    the sensitivities (n, n_states, n_free + n_states), by the free coefficients and then by the
    initial state. Raises ValueError if the solution leaves the range of numbers.
    """
    start = np.asarray(initial_state, float)
    diverges = "the solution of the model diverges, or its time scale is too short"
    if model.inputs:
        checked = check_inputs(model, inputs or {}, time)
        measured = [one for one in checked.values() if isinstance(one, Input)]  # all are
        step, most = first_step(measured), EQUAL_STEP_RATIO * max_steps(time)
        try:
            states, slopes, _ = solve_driven(model, measured, start, time, step, most, free)
        except FloatingPointError:
            raise ValueError(diverges) from None
    else:
        states, slopes, _, ending = solve(model, start, time, max_steps(time), free)
        if ending is not Ending.COMPLETE:
            raise ValueError(diverges)
    if not (np.all(np.isfinite(states)) and np.all(np.isfinite(slopes))):
        raise ValueError(diverges)
    return states, slopes


# --- the bound ---


@dataclass(frozen=True)
class Experiment:
    """Initial state, sampling times and noise of one recording, for its Cramér-Rao bound.

    initial_state: (n_states,). time: (n,), s, increasing, any sampling; the state at time[0] is
    `initial_state`. sigma: (n_states,) standard deviation of the noise on each state, in the
    state's unit, infinite for a state that is not measured. rate_sigma: the same of the states'
    rates, None if none is measured. inputs: those of a model that has any.
    """

    initial_state: np.ndarray
    time: np.ndarray
    sigma: np.ndarray
    rate_sigma: np.ndarray | None = None
    inputs: Mapping[str, Input] = field(default_factory=dict)


@dataclass(frozen=True)
class Bound:
    """Cramér-Rao bound on estimated coefficients: standard deviations and covariance.

    free: (n_free, 2) pairs (equation, term). std: (n_free,) least standard deviation, in the
    coefficient's unit, infinite if undetermined. t: (n_free,) |coefficient| / std. covariance:
    (n_free, n_free), the inverse of the information, infinite where it is singular.
    """

    free: np.ndarray
    std: np.ndarray
    t: np.ndarray
    covariance: np.ndarray


def state_bound(model: PolynomialModel, free: np.ndarray, experiments: list[Experiment]) -> Bound:
    """Compute the Cramér-Rao bound on coefficients from recordings of noisy states.

    This covers the protocols `state` and `displacement`, and subsets. free: (n_free, 2) pairs
    (equation, term). The recordings share the coefficients; the initial state of each is unknown.
    The information is the sum over samples of S^T S / sigma^2. Raises ValueError if the model's
    solution diverges.
    """
    total = sum((information(model, free, one) for one in experiments), np.zeros(()))
    return bound_of(model, free, total)


def information(model: PolynomialModel, free: np.ndarray, experiment: Experiment) -> np.ndarray:
    """Compute the Fisher information of one recording about a model's coefficients.

    Returns (n_free, n_free); the initial state is unknown. Raises ValueError if the model's
    solution diverges, and as `fisher_information`.
    """
    return fisher_information(weighted_sensitivities(model, free, experiment), len(free))


def weighted_sensitivities(
    model: PolynomialModel, free: np.ndarray, experiment: Experiment
) -> np.ndarray:
    """Compute the sensitivities of all samples, divided by the standard deviation of the noise.

    Returns (n, n_channels, n_free + n_states). Channels are the states and then, if any is
    measured, their derivatives. Columns, and errors raised: as of `sensitivities`.
    """
    time, inputs = experiment.time, experiment.inputs
    states, slopes = sensitivities(model, free, experiment.initial_state, time, inputs)
    weighted = slopes / experiment.sigma[:, None]
    if experiment.rate_sigma is None:
        return weighted
    driving = inputs_at_times([inputs[name] for name in model.inputs], time)
    rates = model.jacobian(states, driving) @ slopes
    theta = design_matrix(join_inputs(states, driving), model.terms)
    rates[:, free[:, 0], np.arange(len(free))] += theta[:, free[:, 1]]
    projections = sticking_projections(model, states, theta @ model.coefficients.T, driving)
    rates = rates if projections is None else projections @ rates
    return np.concatenate([weighted, rates / experiment.rate_sigma[:, None]], axis=1)


def fisher_information(weighted: np.ndarray, n_free: int) -> np.ndarray:
    """Compute the Fisher information of coefficients, with the initial state eliminated.

    Returns (n_free, n_free). weighted: samples of `weighted_sensitivities`, or some of them. Raises
    ValueError if the information leaves the range of numbers, as for a long chaotic motion.
    """
    rows = weighted.reshape(-1, weighted.shape[2])
    by_coefficients, by_state = rows[:, :n_free], rows[:, n_free:]
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.linalg.norm(rows, axis=0)
    if not np.all(np.isfinite(size)):
        raise ValueError("the sensitivity of the motion to its start leaves the range of numbers")
    # By projection, not by a difference of information matrices: the effect of the initial state
    # may be a million times that of the coefficients, and the difference would be rounding.
    scaled = by_state / np.maximum(size[n_free:], np.finfo(float).tiny)
    directions, spread, _ = np.linalg.svd(scaled, full_matrices=False)
    directions = directions[:, spread > 1e-13 * spread.max(initial=0.0)]
    remainder = by_coefficients - directions @ (directions.T @ by_coefficients)
    return remainder.T @ remainder


def derivative_bound(
    model: PolynomialModel, free: np.ndarray, x: np.ndarray, sigma: np.ndarray
) -> Bound:
    """Compute the Cramér-Rao bound on coefficients from exact states and noisy derivatives.

    Its covariance is sigma^2 (Theta^T Theta)^-1. x: (n, n_states) the sampled states, with the
    inputs beside them if there are any. sigma: (n_states,) noise of each state derivative.
    """
    theta = design_matrix(x, model.terms)
    gram = theta.T @ theta
    total = np.zeros((len(free), len(free)))
    for equation in np.unique(free[:, 0]):
        rows = np.flatnonzero(free[:, 0] == equation)
        columns = free[rows, 1]
        total[np.ix_(rows, rows)] = gram[np.ix_(columns, columns)] / sigma[equation] ** 2
    return bound_of(model, free, total)


def covariance_of(information: np.ndarray) -> np.ndarray:
    """Invert an information matrix, with infinite variances of undetermined parameters."""
    diagonal = np.diag(information).copy()
    is_informed = diagonal > 0
    covariance = np.full(information.shape, np.inf)
    if not is_informed.any():
        return covariance
    block, scale = np.ix_(is_informed, is_informed), 1.0 / np.sqrt(diagonal[is_informed])
    values, vectors = np.linalg.eigh(information[block] * scale[:, None] * scale)
    good = values > 1e-13 * values[-1]
    inverse = (vectors[:, good] / values[good]) @ vectors[:, good].T
    undetermined = (vectors[:, ~good] ** 2).sum(axis=1) > 1e-6
    inverse = inverse * scale[:, None] * scale
    inverse[undetermined, undetermined] = np.inf
    covariance[block] = inverse
    return covariance


def bound_of(model: PolynomialModel, free: np.ndarray, total: np.ndarray) -> Bound:
    """Compute the Cramér-Rao bound on the coefficients of a model from their Fisher information.

    total: (n_free, n_free), the information.
    """
    covariance = covariance_of(total)
    std = np.sqrt(np.diag(covariance))
    t = np.abs(model.coefficients[free[:, 0], free[:, 1]]) / std
    return Bound(free, std, t, covariance)


# --- recordings of a line ---


def free_terms(model: PolynomialModel, equations: Sequence[int]) -> np.ndarray:
    """List the (equation, term) index pairs of a model's present terms in given equations.

    Returns (n_free, 2). equations: those with unknown coefficients.
    """
    pairs = np.argwhere(model.support)
    return pairs[np.isin(pairs[:, 0], equations)]


def bounds_of(
    model: PolynomialModel,
    equations: Sequence[int],
    motions: Sequence[Motion],
    noises: Sequence[Noise],
    samplings: Sequence[Sequence[np.ndarray | slice]],
) -> list[Bound]:
    """Compute Cramér-Rao bounds on a model's present terms, for each set of sampling times.

    motions, noises: one for each recording. samplings: indices of the samples of each recording.
    Raises ValueError for rates of exact states if their noise differs, for a state whose noise is
    zero among others, and as `weighted_sensitivities`.
    """
    free = free_terms(model, equations)
    rates = [n.rates if np.any(np.isfinite(n.rates)) else None for n in noises]
    if not any(np.any(noise.states) for noise in noises):
        if any(np.any(noise.rates != noises[0].rates) for noise in noises):
            raise ValueError("bound: rates of exact states need the same noise")
        # the rows of all recordings in one regression, since system and noise are the same
        x = ([m.states[k] for m, k in zip(motions, rows, strict=True)] for rows in samplings)
        sigma = noises[0].rates
        return [derivative_bound(model, free, np.concatenate(each), sigma) for each in x]
    for motion, noise in zip(motions, noises, strict=True):
        check_noise(motion.names, noise)
    # each motion is integrated once: a free state at its start is a free state at the first sample
    experiments = [
        Experiment(motion.states[0], motion.time, noise.states, rate)
        for motion, noise, rate in zip(motions, noises, rates, strict=True)
    ]
    whole = [weighted_sensitivities(model, free, each) for each in experiments]
    totals = (
        sum(
            (fisher_information(s[k], len(free)) for s, k in zip(whole, rows, strict=True)),
            np.zeros(()),
        )
        for rows in samplings
    )
    return [bound_of(model, free, total) for total in totals]


def check_noise(states: Sequence[str], noise: Noise) -> None:
    """Raise ValueError, which names the channel, if a measured channel has no noise.

    Noise in proportion to a motion is zero of a state that does not move.
    """
    names = (*states, *(f"the rate of {state}" for state in states))
    still = [n for n, sigma in zip(names, (*noise.states, *noise.rates), strict=True) if sigma == 0]
    if still:
        raise ValueError(
            f"noise of {', '.join(still)}: 0, as relative noise is of a state at rest; must be > 0"
        )


def on_library(model: PolynomialModel, found: Bound) -> np.ndarray:
    """Arrange standard deviations of a Cramér-Rao bound in a matrix, equations by terms.

    Returns (n_states, n_terms), NaN for terms without a bound.
    """
    std = np.full(model.coefficients.shape, np.nan)
    std[tuple(found.free.T)] = found.std
    return std
