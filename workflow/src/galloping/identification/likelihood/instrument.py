"""Tests of a fit for faults of the sensors and for forces that the model does not know.

Each fault is a parameter that the fit holds at zero; its score (Lagrange multiplier) says how far
the data pull it away, without another fit. Faults that add noise show in the variance of the
residuals, unknown forces in how badly the segments of the recording join up
(C. R. Rao, 1948; T. S. Breusch and A. R. Pagan, 1979).
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from galloping.identification.likelihood.condense import Condensed, of_rates
from galloping.identification.likelihood.prior import costs
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import (
    DEPENDENT,
    select,
    solve_support,
    tableau,
    whiten,
)
from galloping.identification.likelihood.shooting import (
    Eliminated,
    Linearised,
    Segments,
    eliminate,
    linearise,
    residuals,
)
from galloping.polynomial import velocity_pairs

if TYPE_CHECKING:
    from galloping.identification.likelihood.trajectory_fit import Fit

# Faults of the instrument.
# Probability that a recording without any fault is accused of one.
FALSE_FAULT_RATE = 5e-3
# Segments joined into one free stretch in the tests for unknown forces: a force that comes and
# goes shows in short stretches, a phase that wanders in long ones.
STRETCHES = (1, 2, 4)
# z from which terms are looked for that only imitate a fault; a sound recording has one a few
# times in a hundred, which costs a pass of the fit and no more.
CURIOUS = 2.5
# Mean square, in units of the noise, below which residuals are rounding: exact data are given a
# least noise, and the projections' own estimate is never this far below the true one.
EXACT = 0.25

GUSTS = ", such as gusts"  # but where the wind was measured
FORCES = f"forces besides the model act{GUSTS}, or terms are missing"
JITTER = "errors grow with the speed of the motion: sampling times jitter, or the model is wrong"
GROWING = "the noise grows with the signal"
# In the causes that name a channel first.
CLOCK, SCALE, DELAYED = "clock", "scale", "delayed against"


@dataclass(frozen=True)
class Fault:
    """cause: in words; z: how far the data deny its absence, in standard deviations.

    or_model: whether a model that is wrong would show as this fault does. Its residuals are larger
    where the motion is, like noise that grows with it, and what it lacks may be slow, like a drift.
    """

    cause: str
    z: float
    or_model: bool


def faults(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    fit: "Fit",
    penalty: float,
) -> list[Fault]:
    """The faults that the data show, the clearest first; none where the recording is sound.

    segments: of a converged fit, in their chains. penalty: 2 ln N of N samples. A sound recording
    is accused with probability FALSE_FAULT_RATE. Raises FloatingPointError where the model
    diverges.
    """
    sigma, free, support, starts = fit.sigma, fit.free, fit.support, fit.starts
    residual, _ = residuals(problem, condensed, segments, free, starts)
    rates = _rates(problem, condensed, segments, free, starts)
    wider, with_slopes, late = _delayed_inputs(problem, condensed, free)
    entries, columns, tests = _parameters(problem, condensed, rates, late)

    def linear(terms: np.ndarray) -> Linearised:
        pairs = np.vstack([problem.candidates[terms], entries])
        return linearise(wider, with_slopes, sigma, segments, free, starts, pairs, columns)

    own = linear(support)
    n = int(support.sum())
    quadratic = eliminate(own, segments, starts)
    scores = [_score(quadratic.information, quadratic.right, n, test.mixture) for test in tests]
    tested = [Fault(test.cause, z, test.or_model) for test, z in zip(tests, scores, strict=True)]
    tested += _gaps(own, segments, n, starts)
    tested += _variances(condensed, segments, sigma, residual, rates)
    limit = -ndtri(FALSE_FAULT_RATE / 2.0 / max(len(tested), 1))
    doubtful = [k for k, z in enumerate(scores) if z > CURIOUS]
    if doubtful and max(scores) < np.sqrt(penalty):
        quadratic = eliminate(linear(np.ones(len(support), bool)), segments, starts)
        for k in doubtful:
            z = _instead(problem, quadratic, support, free, tests[k], penalty)
            if tests[k].or_model:
                tested[k] = replace(tested[k], z=_beside(quadratic, support, free, tests[k]))
            tested[k] = replace(tested[k], z=max(tested[k].z, z))
    shown = [fault for fault in tested if fault.z > limit]
    return sorted(shown, key=lambda fault: -fault.z)


@dataclass(frozen=True)
class _Test:
    """mixture: (n_parameters,) of the faults' parameters, tested as one. The rest as in `Fault`."""

    mixture: np.ndarray
    cause: str
    or_model: bool


@dataclass(frozen=True)
class _Late:
    """An input that may be delayed. pairs: (n, 2) coefficients (equation, term) that are not zero
    where it is, in the ratios of `weights` (n,), which for a delay of 1 s are their values.
    """

    name: str
    pairs: np.ndarray
    weights: np.ndarray


def _delayed_inputs(
    problem: Problem, condensed: Condensed, free: np.ndarray
) -> tuple[Problem, Condensed, list[_Late]]:
    """The problem with terms of the rates of inputs, which are inputs too, and their windows.

    A delay of an input u takes c b u^(b - 1) du/dt from each term c u^b. Looked at are inputs that
    share no term with another.
    """
    coefficients, n = problem.coefficients(free), len(problem.states)
    extra = len(problem.inputs)
    terms, late = [(*term, *[0] * extra) for term in problem.terms], []
    powers = condensed.inputs
    slopes = np.zeros_like(powers)
    slopes[:, :-1] = powers[:, 1:] * np.arange(1, powers.shape[1])[:, None] / condensed.step
    columns = [powers]
    for k, name in enumerate(problem.inputs):
        own = [term for term in problem.terms if term[n + k]]
        if not own or any(np.count_nonzero(term[n:]) > 1 for term in own):
            continue
        pairs, weights = [], []
        for i, j in np.argwhere(coefficients):
            if power := problem.terms[j][n + k]:
                slope = list(terms[j])
                slope[n + k] -= 1
                slope[n + extra + k] = 1
                if tuple(slope) not in terms:
                    factor = problem.tables.factors.index(problem.terms[j][n:])
                    if all(tuple(slope[n:]) != term[n:] for term in terms):
                        columns.append(slopes[:, :, factor : factor + 1] / power)
                    terms.append(tuple(slope))
                pairs.append((i, terms.index(tuple(slope))))
                weights.append(-coefficients[i, j] * power)
        if pairs:
            late.append(_Late(name, np.array(pairs), np.array(weights)))
    if not late:
        return problem, condensed, []
    added = ((0, 0), (0, len(terms) - len(problem.terms)))
    parts = ("known", "open", "expected", "precision")
    wider = replace(
        problem,
        terms=tuple(terms),
        inputs=(*problem.inputs, *(f"d({name})/dt" for name in problem.inputs)),
        **{name: np.pad(getattr(problem, name), added) for name in parts},
    )
    return wider, replace(condensed, inputs=np.concatenate(columns, axis=2)), late


def _parameters(
    problem: Problem, condensed: Condensed, rates: np.ndarray, late: list[_Late]
) -> tuple[np.ndarray, np.ndarray, list[_Test]]:
    """Parameters of faults: coefficients that are zero or known, and columns as in `linearise`."""
    names = condensed.names(problem.states)
    channel = {int(condensed.observed[o]): int(o) for o in np.flatnonzero(~condensed.is_rate)}
    samplings = condensed.samplings
    pairs = {
        i: v for i, v in velocity_pairs(problem.states).items() if i in channel or v in channel
    }
    kinematic = [(i, v) for i, v in pairs.items() if i in channel and v in channel]
    entries = [(i, problem.linear(v)) for i, v in kinematic]
    time = condensed.step * np.arange(len(rates))[:, None, None]
    trend = time * samplings[..., 0] + condensed.step * samplings[..., 1]
    count = len(names)
    columns = np.zeros((*rates.shape, 2 * count))
    for o in range(count):
        columns[:, o, :, o] = -rates[:, o]
        columns[:, o, :, count + o] = trend[:, o]
    first = len(entries) + sum(len(one.pairs) for one in late)
    n, tests = first + 2 * count, []

    def test(places: list[int], cause: str, or_model: bool = False) -> None:
        tests.append(_Test(np.isin(np.arange(n), places).astype(float), cause, or_model))

    for k, (i, v) in enumerate(kinematic):
        a, b = problem.states[i], problem.states[v]
        test([k], f"{b} is not the rate of {a}: its {SCALE} or {CLOCK} is off")
    if len(kinematic) > 1:
        test(list(range(len(kinematic))), f"the {CLOCK}, or the {SCALE} of all velocities, is off")
    begin = len(entries)
    for one in late:
        mixture = np.zeros(n)
        mixture[begin : begin + len(one.pairs)] = one.weights
        tests.append(_Test(mixture, f"{one.name} is {DELAYED} the motion", or_model=True))
        begin += len(one.pairs)
    for o, name in enumerate(names):
        test([first + o], f"{name} is {DELAYED} the other channels")
        test([first + count + o], f"{name} drifts", or_model=True)
    for i, v in kinematic if len(kinematic) > 1 else []:
        both = [first + channel[i], first + channel[v]]
        test(both, f"{problem.states[i]} and {problem.states[v]} are {DELAYED} the others")
    pairs = [np.array(entries, int).reshape(-1, 2), *(one.pairs for one in late)]
    return np.concatenate(pairs), columns, tests


def _rates(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    free: np.ndarray,
    starts: np.ndarray,
) -> np.ndarray:
    """(n_windows, n_observed, n_rows) projections of the solution's time derivatives."""
    shifted = replace(
        condensed,
        functionals=of_rates(condensed.functionals, condensed.step),
        targets=np.zeros_like(condensed.targets),
    )
    return -residuals(problem, shifted, segments, free, starts)[0]


def _score(information: np.ndarray, right: np.ndarray, n: int, mixture: np.ndarray) -> float:
    """z of a mixture of the parameters after the first n, which are at their best."""
    information, right = _mixed(information, right, mixture)
    terms = np.arange(n + 1) < n
    change, covariance = solve_support(information, right, terms)
    cross = information[-1, :-1]
    left = information[-1, -1] - cross @ covariance @ cross
    if left < DEPENDENT * information[-1, -1] or left <= 0.0:
        return 0.0
    return float(abs(right[-1] - information[-1] @ change) / np.sqrt(left))


def _mixed(
    information: np.ndarray, right: np.ndarray, mixture: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The regression with one mixture in place of the last parameters."""
    n = len(right) - len(mixture)
    to = np.zeros((len(right), n + 1))
    to[:n, :n] = np.eye(n)
    to[n:, n] = mixture
    return to.T @ information @ to, right @ to


def _beside(quadratic: Eliminated, support: np.ndarray, free: np.ndarray, test: _Test) -> float:
    """z of a fault beside the one term, if any, that the model lacks most: weak terms are left out,
    and what they leave in the residuals may look like a fault.
    """
    n = len(support)
    whitened = whiten(quadratic.information[:n, :n], quadratic.right[:n], free)
    here = tableau(whitened, support & whitened.usable)
    more = support.copy()
    if len(here.out):
        more[here.out[np.argmax(here.additions())]] = True
    kept = np.append(more, np.ones(len(test.mixture), bool))
    information = quadratic.information[np.ix_(kept, kept)]
    return _score(information, quadratic.right[kept], int(more.sum()), test.mixture)


def _instead(
    problem: Problem,
    quadratic: Eliminated,
    support: np.ndarray,
    free: np.ndarray,
    test: _Test,
    penalty: float,
) -> float:
    """z of a fault that may replace terms which only imitate it: by how much the data prefer the
    fault with other terms, selected anew, to the terms without it; 0 where they do not.
    """
    information, right = _mixed(quadratic.information, quadratic.right, test.mixture)
    prices = np.append(costs(problem.prior, problem.complexity, penalty), penalty)
    about = np.append(free, 0.0)
    without = np.append(support, False)
    apart = np.append(problem.chosen_about(free), 0.0)
    chosen = select(information, right, [without, np.append(support, True)], prices, apart)
    if not chosen[-1]:
        return 0.0

    def worth(present: np.ndarray) -> float:
        """chi^2, from that of the fit, and the penalty of the terms and of the fault."""
        gone = np.where(present, 0.0, -about)
        rest = right - information @ gone
        change, _ = solve_support(information, rest, present)
        moved = gone @ information @ gone - 2.0 * right @ gone
        return float(moved - change @ rest) + prices[present].sum()

    return float(np.sqrt(max(worth(without) - worth(chosen), 0.0)))


def _gaps(linear: Linearised, segments: Segments, n: int, starts: np.ndarray) -> list[Fault]:
    """How much better the recording is followed in stretches than as a whole.

    n: the first coefficients of `linear`, which follow the stretches.
    """
    among = np.arange(len(linear.right)) < n

    def fall(joined: Segments) -> float:
        quadratic = eliminate(linear, joined, starts)
        change, _ = solve_support(quadratic.information, quadratic.right, among)
        return quadratic.fall + float(change @ quadratic.right)

    whole, tested = fall(segments), []
    place = np.arange(len(segments.chains))
    first = np.maximum.accumulate(np.where(np.diff(segments.chains, prepend=-1) > 0, place, 0))
    for length in STRETCHES:
        begins = (place - first) % length == 0
        freedom = (int(begins.sum()) - int(segments.chains[-1]) - 1) * starts.shape[1]
        if freedom > 0:
            square = fall(replace(segments, chains=np.cumsum(begins) - 1)) - whole
            # a chi^2 variable's square root is almost Gaussian (R. A. Fisher)
            z = np.sqrt(2.0 * max(square, 0.0)) - np.sqrt(2.0 * freedom - 1.0)
            tested.append(Fault(FORCES, float(z), or_model=True))
    return tested


def _variances(
    condensed: Condensed,
    segments: Segments,
    sigma: np.ndarray,
    residual: np.ndarray,
    rates: np.ndarray,
) -> list[Fault]:
    """Whether the residuals are larger where the signal is steep, or where it is large."""
    owner = np.repeat(segments.recording, np.diff(segments.first))
    there = np.any(condensed.functionals != 0.0, axis=3)
    square = (residual / sigma[owner][:, :, None]) ** 2
    weight = np.where(there[:, :, 0], condensed.samplings[:, :, 0, 0], 1.0)
    tested = []
    for cause, signal in (
        (JITTER, rates[:, :, 0]),
        (GROWING, (condensed.targets - residual)[:, :, 0]),
    ):
        total, channels = 0.0, 0
        for r in range(len(sigma)):
            for o in range(signal.shape[1]):
                inside = there[:, o] & (owner == r)[:, None]
                if np.count_nonzero(inside) < 2:
                    continue
                size = np.repeat((signal[:, o] / weight[:, o])[:, None] ** 2, 3, axis=1)[inside]
                size = size - size.mean()
                own = square[:, o][inside]
                if own.mean() < EXACT:
                    continue
                own = own / own.mean()
                spread = np.sqrt(2.0 * np.sum(size**2))
                if spread > 0.0:
                    total += float(size @ own) / spread
                    channels += 1
        if channels:
            tested.append(Fault(cause, total / np.sqrt(channels), or_model=True))
    return tested
