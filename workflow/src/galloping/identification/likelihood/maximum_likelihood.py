"""Maximum likelihood: coefficients, initial states and terms at the limit the data set.

The weak form gives the start; multiple shooting with matched segments, Gauss-Newton on the
coefficients of the whole library, and selection on the quadratic model do the rest. Intervals
come from the information at the solution, so they are those of the Cramer-Rao bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from galloping.identification.likelihood.ambiguity import preferred
from galloping.identification.likelihood.condense import Condensed, condense
from galloping.identification.likelihood.derivative_fit import derivative_fit
from galloping.identification.likelihood.inputs import check_question, checked_recordings
from galloping.identification.likelihood.instrument import FORCES, Fault, faults, of_the_model
from galloping.identification.likelihood.model_error import PERIODS, approximation
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.problem import problem as make_problem
from galloping.identification.likelihood.rates import (
    channel_noise,
    channel_values,
    channels,
    known_noise,
    scaled,
    scales_told,
    with_rates,
)
from galloping.identification.likelihood.result import judged, refused
from galloping.identification.likelihood.selection import select, solve_support, whiten
from galloping.identification.likelihood.shooting import (
    Segments,
    chained,
    cut,
    eliminate,
    linearise,
    residuals,
)
from galloping.identification.likelihood.smoothing import Smooth
from galloping.identification.likelihood.verdict import MOST_COLOUR, Residue, residue
from galloping.identification.likelihood.weak_gls import Start, WeakFit, begin
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import Exponents, PolynomialModel, design_matrix
from galloping.recording import Recording

WINDOWS_PER_PERIOD = 12  # of the shortest period; the projections of a window lose nothing
PERIODS_PER_SEGMENT = 6  # short enough for a rough start to converge from
PATIENCE = 5  # passes with free segments, after which they are matched, however bad the fit
MOST_PASSES = 20
CHOOSING_PASSES = 14  # of them; then the terms stay
FIRST_CHAIN, CHAIN_GROWTH = 4, 4  # segments that are matched in the first pass, then so many times
SHORTER = 4  # lengths of segments that are tried, each half the one before
MOST_HALVINGS = 6  # of the integrator's step, and of a Gauss-Newton step
CLOSE = 1.5  # chi^2 per row below which a fit is good enough to choose terms by
CONVERGED = 0.01  # squared length of a step, in standard deviations
DIVERGES = "no model found that follows the data: the iteration diverges"
MATCHED = 1e-3  # gap between segments, relative to each state
TRUNCATION = 1e-7  # of the Taylor series, relative to each state
SMALLEST_NOISE = 1e-5  # of a channel, relative to its size: rounding is not weighed as noise


@dataclass(frozen=True)
class Fit:
    """Where the iteration stands.

    free: (n_candidates,) coefficients; support: the same, boolean. starts: (n_segments,
    n_states). sigma: (n_recordings, n_observed) noise of the projections, not below `floor`.
    reference: the same as first estimated. cost: chi^2, by that, of the fit before this one.
    """

    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    sigma: np.ndarray
    floor: np.ndarray
    reference: np.ndarray
    cost: float


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step from one `Fit`, `before`, to the next.

    information: of the regression on all candidates; right: half the fall of chi^2 with each, at
    the new fit. covariance: of the supported ones. misfit, cost: chi^2 before the step, by the
    noise of its fit and by a fixed one. decrement: squared length of the step, in units of its
    covariance. gap: largest mismatch of segments before the step. segments: in the chains that
    were matched. settled: False of the last step of an iteration that did not come to an end.
    """

    before: Fit
    fit: Fit
    information: np.ndarray
    right: np.ndarray
    covariance: np.ndarray
    misfit: float
    decrement: float
    gap: float
    segments: Segments
    settled: bool


def maximum_likelihood(
    recordings: Recording | Sequence[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    begin: Callable[[Problem, list[Recording]], Start] = begin,
) -> IdentifiedModel:
    """Identify one polynomial model from one or several recordings of a system.

    recordings: sharing their states; any sampling, NaN where samples or channels are missing;
    the noise of each channel of each recording is white and Gaussian, and unknown but where they
    say it: then it is the least that is assumed, and what the misfit is held against. Where they
    carry derivatives, the states are exact and the equations are fitted directly.
    terms: the library. known: model whose equations of `known_states` hold; the equation of a
    state X is known to be dX/dt = dX where a state has that name. begin: makes the start.
    The status is `ok`, `not identifiable` (other terms could be there as well), `approximate` (no
    model of the library follows the data to the noise; see `model_error`), or `refused`.
    Raises ValueError where the recordings differ in their states, and for other input.
    """
    recordings = checked_recordings(recordings)
    states = recordings[0].states
    check_question(states, terms, known, known_states)
    problem = make_problem(states, terms, known, known_states)
    try:
        if all(recording.derivatives is not None for recording in recordings):
            return derivative_fit(problem, recordings)
        begun = begin(problem, recordings)
        rescaled = scaled(recordings, begun)
        if any(one is not other for one, other in zip(recordings, rescaled, strict=True)):
            begun = begin(problem, rescaled)
        identified = _from_states(problem, recordings, with_rates(begun, rescaled))
        told = scales_told(recordings, rescaled)
        return replace(identified, diagnostics={**identified.diagnostics, **told})
    except (ValueError, FloatingPointError, np.linalg.LinAlgError) as error:
        return refused(problem, str(error))


def _from_states(problem: Problem, recordings: list[Recording], begun: Start) -> IdentifiedModel:
    try:
        return _exact(problem, recordings, begun)
    except FloatingPointError as objection:
        condensed, segments, fit = _prepare(
            problem, begun.recordings, begun.smoothed, begun.period, begun.fit, PERIODS
        )
        states, _ = _window_states(condensed, begun.recordings, begun.smoothed)
        return approximation(
            problem, condensed, segments, states, fit.free, fit.sigma, fit.floor, begun.penalty,
            str(objection),
        )  # fmt: skip


def _exact(problem: Problem, recordings: list[Recording], begun: Start) -> IdentifiedModel:
    """The model that follows the data to the noise; refused where an instrument is at fault.

    Raises FloatingPointError where no model of the library does.
    """
    samples = sum(int(np.isfinite(recording.values).sum()) for recording in recordings)
    recordings, smoothed, period = begun.recordings, begun.smoothed, begun.period
    kept = sum(int(np.isfinite(recording.values).sum()) for recording in recordings)
    penalty, start = begun.penalty, begun.fit
    largest = _largest(problem, smoothed)
    condensed, segments, step = _followed(problem, recordings, smoothed, period, start, largest)
    fit = step.fit
    unseen = bool(np.linalg.eigvalsh(step.information * largest * largest[:, None])[0] < 1.0)
    try:
        fit, step = _iterate(problem, condensed, segments, step, penalty, unseen)
    except FloatingPointError as error:
        rows = float(np.sum(condensed.rows))
        followed = step.fit.cost < CLOSE * rows
        # where nothing follows the data, a fault must explain most of what is left
        causes = _causes(
            problem, condensed, segments, step.fit, penalty, 0.0 if followed else rows / 2
        )
        named = [fault.cause for fault in causes[:1]]
        if followed and FORCES not in named:  # a small fault does not keep the pieces from joining
            named.append(f"followed in pieces, not as a whole: {FORCES}")
        raise FloatingPointError("; ".join([*named, str(error)])) from error
    remaining, shown = _remaining(problem, condensed, fit, step.segments, period)
    if shown.coloured and shown.band < MOST_COLOUR:
        power = np.where(np.isfinite(shown.band_power), shown.band_power, fit.sigma**2)
        noise = np.sqrt(power)
        step = replace(
            step, fit=replace(fit, sigma=noise, floor=noise, reference=noise, cost=np.inf)
        )
        fit, step = _iterate(problem, condensed, segments, step, penalty, unseen)
        remaining, shown = _remaining(problem, condensed, fit, step.segments, period)
    squares = np.add.reduceat((remaining**2).sum(axis=2), condensed.first[:-1], axis=0)
    sigma = np.full((len(recordings), len(problem.states)), np.nan)
    parameters = int(fit.support.sum()) + (step.segments.chains[-1] + 1) * len(problem.states)
    share = parameters / max(np.count_nonzero(condensed.counts), 1)
    total = (squares + condensed.remainder) / np.maximum(condensed.counts - share, 1.0)
    total = np.where(condensed.is_known, condensed.noise_variance, total)
    total = np.where(condensed.counts > 0, np.sqrt(total), np.nan)
    sigma[:, condensed.observed[~condensed.is_rate]] = total[:, ~condensed.is_rate]
    names = condensed.names(problem.states)
    objection, doubt = shown.objection(names), ""
    if step.settled:
        causes = _causes(problem, condensed, step.segments, fit, penalty)
        objection = "; ".join(filter(None, [*[fault.cause for fault in causes[:1]], objection]))
        if objection and of_the_model(causes):
            raise FloatingPointError(objection)
    else:  # what it leaves in the residuals is that it is not the best fit
        objection, doubt = "", "many models follow the data alike"
    return judged(
        problem, step.information, step.right, fit.support, penalty,
        about=step.fit.free,
        objection=objection,
        doubt=doubt,
        initial_states=fit.starts[_first_segments(segments)],
        sigma=sigma,
        chi2=shown.chi2,
        diagnostics={
            "chi2_allowed": shown.chi2_allowed,
            "residual_band": shown.band,
            "residual_band_allowed": shown.band_allowed,
            "residual_line": shown.line,
            "residual_line_allowed": shown.line_allowed,
            "removed_share": 1.0 - kept / samples,
            **{f"noise_{names[o]}": total[-1, o] for o in np.flatnonzero(condensed.is_rate)},
        },
    )  # fmt: skip


def _causes(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    fit: Fit,
    penalty: float,
    least: float = 0.0,
) -> list[Fault]:
    """The faults of the recording that explain `least` of chi^2, the clearest first."""
    shown = faults(
        problem, condensed, segments, fit.sigma, fit.free, fit.support, fit.starts, penalty
    )
    return [fault for fault in shown if fault.z**2 >= least]


def _remaining(
    problem: Problem, condensed: Condensed, fit: Fit, segments: Segments, period: float
) -> tuple[np.ndarray, Residue]:
    """Residuals of single shooting over every chain, and what they show.

    Raises FloatingPointError where the model diverges over a chain.
    """
    begins = np.unique(segments.chains, return_index=True)[1]
    windows = np.append(segments.first[begins], segments.first[-1])
    whole = Segments(windows, segments.recording[begins], np.arange(len(begins)))
    firsts = fit.starts[begins]
    remaining, _ = residuals(problem, condensed, whole, fit.free, firsts)
    return remaining, residue(condensed, remaining, int(fit.support.sum()) + firsts.size, period)


def _first_segments(segments: Segments) -> np.ndarray:
    """(n_recordings,) the first segment of each recording."""
    return np.unique(segments.recording, return_index=True)[1]


def _largest(problem: Problem, smoothed: list[Smooth]) -> np.ndarray:
    """(n_candidates,) coefficients at which each term alone would make up its equation."""
    rates = [np.gradient(one.states, one.time, axis=0)[one.valid] for one in smoothed]
    rate = np.sqrt(np.mean(np.concatenate(rates) ** 2, axis=0))
    theta = design_matrix(
        np.concatenate([one.states[one.valid] for one in smoothed]), problem.terms
    )
    size = np.sqrt(np.mean(theta**2, axis=0)) + np.finfo(float).tiny
    return rate[problem.candidates[:, 0]] / size[problem.candidates[:, 1]]


def _followed(
    problem: Problem,
    recordings: list[Recording],
    smoothed: list[Smooth],
    period: float,
    start: WeakFit,
    largest: np.ndarray,
) -> tuple[Condensed, Segments, Step]:
    """Condensed samples, and segments in which a fit with free first states follows the data.

    From a rough start, that of a sensitive system above all, long segments lead astray: they are
    halved while that halves the misfit. A start that diverges even so is replaced by that of all
    terms, each held to its `largest` size. Raises FloatingPointError where that diverges too.
    """
    best = None
    for halving in range(2 * SHORTER):
        periods = PERIODS_PER_SEGMENT / 2 ** (halving % SHORTER)
        if halving == SHORTER:
            if best is not None:
                return best
            scaled = start.information * largest * largest[:, None] + np.eye(len(largest))
            free = largest * np.linalg.solve(scaled, largest * start.right)
            start = replace(start, free=free, support=np.ones(len(free), bool))
        try:
            condensed, segments, fit = _prepare(
                problem, recordings, smoothed, period, start, periods
            )
            previous = fit
            for _ in range(PATIENCE):
                step = _guarded(problem, condensed, segments, previous, fit, 1, None)
                previous, fit = step.before, step.fit
                if fit.cost < CLOSE * float(np.sum(condensed.rows)):
                    return condensed, segments, step
        except FloatingPointError:
            continue
        if best is not None and fit.cost > best[2].fit.cost / 2.0:
            return best
        best = condensed, segments, step
    if best is None:
        raise FloatingPointError(DIVERGES)
    return best


def _prepare(
    problem: Problem,
    recordings: list[Recording],
    smoothed: list[Smooth],
    period: float,
    start: WeakFit,
    periods: float,
) -> tuple[Condensed, Segments, Fit]:
    """Condensed samples, segments of so many periods and first states to integrate them from.

    Windows are halved until the Taylor series is accurate over one, segments until the start
    does not diverge within one. Raises FloatingPointError where neither is enough.
    """
    observed, is_rate = channels(recordings)
    noise = np.array(
        [
            channel_noise(recording, one, observed, is_rate)
            for recording, one in zip(recordings, smoothed, strict=True)
        ]
    )
    size = np.array([np.std(one.states[:, observed], axis=0) for one in smoothed])
    floor = SMALLEST_NOISE * np.where(size > 0.0, size, 1.0)
    known = [known_noise(recording, observed, is_rate) for recording in recordings]
    known = np.array(known) if np.any(np.isfinite(known)) else None
    floor = floor if known is None else np.fmax(floor, known)
    noise = np.where(np.isfinite(noise), np.maximum(noise, floor), 1.0)
    windows = WINDOWS_PER_PERIOD
    length = max(round(windows * periods), 2)
    for _ in range(MOST_HALVINGS):
        condensed = condense(
            [recording.time for recording in recordings],
            [channel_values(recording, observed, is_rate) for recording in recordings],
            observed,
            period / windows,
            is_rate,
            known,
        )
        states, valid = _window_states(condensed, recordings, smoothed)
        segments = cut(condensed, length, valid, chained=False)
        starts = states[segments.first[:-1]]
        fit = Fit(start.free, start.support, starts, noise, floor, noise, np.inf)
        try:
            truncation = residuals(problem, condensed, segments, fit.free, fit.starts)[1]
        except FloatingPointError:
            length = max(length // 2, 2)
            continue
        if truncation < TRUNCATION:
            return condensed, segments, fit
        windows, length = 2 * windows, 2 * length
    raise FloatingPointError("the start diverges, or its time scale is too short")


def _window_states(
    condensed: Condensed, recordings: list[Recording], smoothed: list[Smooth]
) -> tuple[np.ndarray, np.ndarray]:
    """Smoothed states where the windows start, (n_windows, n_states), and whether data are near."""
    states, valid = [], []
    for r, (recording, one) in enumerate(zip(recordings, smoothed, strict=True)):
        windows = condensed.first[r + 1] - condensed.first[r]
        time = recording.time[0] + condensed.step * np.arange(windows)
        states.append(np.column_stack([np.interp(time, one.time, x) for x in one.states.T]))
        valid.append(np.interp(time, one.time, one.valid) == 1.0)
    return np.concatenate(states), np.concatenate(valid)


def _iterate(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    step: Step,
    penalty: float,
    unseen: bool,
) -> tuple[Fit, Step]:
    """Gauss-Newton with segments matched in chains; terms chosen at every pass but the last ones.

    Chains grow from pass to pass until the terms stay the same: about a rough fit, that of too
    many terms above all, the solution over a long chain is far from linear in the coefficients,
    and the terms that seem best then lead astray. Where those of the start, `step`, are the best
    already, the chains are whole from the first.
    unseen: whether a mixture of terms, together as large as the motion, fits nothing; then an
    iteration whose terms do not settle never will, and ends with the free segments that it began
    with.
    Raises FloatingPointError where it diverges, or does not settle, on other recordings.
    """
    previous, start = step.before, step.fit
    fit = start
    every = np.ones(len(fit.support), bool)
    best = select(step.information, step.right, [every, fit.support], penalty, fit.free)
    longest = np.inf if np.array_equal(best, fit.support) else FIRST_CHAIN
    preferring = False
    for passed in range(MOST_PASSES):
        choosing = passed < CHOOSING_PASSES and not preferring
        if unseen and not (choosing or preferring):
            break
        try:
            step = _guarded(
                problem, condensed, segments, previous, fit, longest, penalty if choosing else None
            )
        except FloatingPointError:
            if unseen:
                break
            raise
        settled = np.array_equal(step.fit.support, step.before.support)
        previous, fit = step.before, step.fit
        whole = longest is None or longest >= len(segments.chains)
        if settled and whole and step.decrement < CONVERGED and step.gap < MATCHED:
            whitened = whiten(step.information, step.right, fit.free)
            support = fit.support if preferring else preferred(whitened, fit.support, penalty)
            if np.array_equal(support, fit.support):
                return fit, step
            preferring = True
            fit = replace(fit, support=support)
        if settled and whole:
            segments, longest = step.segments, None  # chains that come and go would never settle
        else:
            longest = np.inf if settled else CHAIN_GROWTH * (longest or np.inf)
    if unseen:
        step = _gauss_newton(problem, condensed, segments, start, 1, None)
        if step.fit.cost < CLOSE * float(np.sum(condensed.rows)):
            return start, replace(step, settled=False)
    misfit = fit.cost / float(np.sum(condensed.rows))
    what = "follows the data" if misfit > CLOSE else "is preferred by the data"
    raise FloatingPointError(f"no model found that {what}: chi2/n {misfit:.3g}")


def _guarded(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    previous: Fit,
    fit: Fit,
    longest: float | None,
    penalty: float | None,
) -> Step:
    """A step from `fit`, or, where that diverges or raises the misfit, from nearer to `previous`.

    The other arguments as in `_gauss_newton`. Raises FloatingPointError where halving the way
    does not help.
    """
    close = CLOSE * float(np.sum(condensed.rows))
    for _ in range(MOST_HALVINGS):
        try:
            step = _gauss_newton(problem, condensed, segments, fit, longest, penalty)
        except FloatingPointError:
            fit = _between(previous, fit)
            continue
        if step.fit.cost < max(1.5 * fit.cost, close):
            return step
        fit = _between(previous, fit)
    raise FloatingPointError(DIVERGES)


def _between(a: Fit, b: Fit) -> Fit:
    free, starts = (a.free + b.free) / 2.0, (a.starts + b.starts) / 2.0
    return replace(a, free=free, support=a.support | b.support, starts=starts)


def _gauss_newton(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    fit: Fit,
    longest: float | None,
    penalty: float | None,
) -> Step:
    """Linearise, choose the terms (unless `penalty` is None), move, re-estimate the noise.

    The noise is that of the projections, which hold the information: where the noise is not
    white it differs from the noise between samples. longest: as in `chained`, None to keep the
    chains that there are.
    """
    linear = linearise(problem, condensed, fit.sigma, segments, fit.free, fit.starts)
    if longest is not None:
        segments = chained(linear, segments, longest)
    quadratic = eliminate(linear, segments, fit.starts)
    support = fit.support
    if penalty is not None:
        starts = [np.ones(len(support), bool), fit.support]
        support = select(quadratic.information, quadratic.right, starts, penalty, fit.free)
    # solved for the change: on a long chain, rounding of the coefficients outweighs their noise
    free = np.where(support, fit.free, 0.0)
    rest = quadratic.right + quadratic.information @ (fit.free - free)
    step, covariance = solve_support(quadratic.information, rest, support)
    free = free + step
    change = free - fit.free
    starts = fit.starts + quadratic.states[:, :, :-1] @ change + quadratic.states[:, :, -1]
    squares = linear.squares * fit.sigma**2
    chains = segments.chains[-1] + 1
    share = (support.sum() + chains * len(problem.states)) / max(np.count_nonzero(squares), 1)
    sigma = np.sqrt(squares / np.maximum(condensed.rows - share, 0.2 * condensed.rows + 1.0))
    return Step(
        fit,
        Fit(
            free,
            support,
            starts,
            np.maximum(sigma, fit.floor),
            fit.floor,
            fit.reference,
            cost=float(np.sum(squares / fit.reference**2)),
        ),
        quadratic.information,
        quadratic.right - quadratic.information @ change,
        covariance,
        float(np.sum(linear.squares)),
        float(change @ quadratic.information @ change),
        quadratic.gap,
        segments,
        settled=True,
    )
