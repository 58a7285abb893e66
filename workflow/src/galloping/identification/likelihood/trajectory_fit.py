"""Fit of the trajectory that follows the recordings: free segments first, then joined ones."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.likelihood.condense import (
    TRUNCATION_ERROR,
    WINDOWS_PER_PERIOD,
    Condensed,
    condense_recordings,
)
from galloping.identification.likelihood.elimination import (
    NormalEquations,
    chain_segments,
    eliminate_chains,
)
from galloping.identification.likelihood.residual_tests import MIN_RESIDUAL
from galloping.identification.likelihood.shooting import (
    MAX_TRIALS,
    ShootingData,
    ShootingFit,
    cut_segments,
    segment_residuals,
    shorten_step,
)
from galloping.identification.no_model import NotConvergedError, as_findings
from galloping.identification.preparation.channels import Channels
from galloping.identification.preparation.rate_channels import channel_noise
from galloping.identification.preparation.smoothing import MIN_FREEDOM, Smooth, rate_without_offset
from galloping.identification.preparation.weak_form import Start, WeakFit
from galloping.identification.selection import Penalties, n_unidentifiable_directions
from galloping.identification.work import is_exhausted
from galloping.model.polynomial import design_matrix, velocity_pairs
from galloping.progress_reports import passing
from galloping.recording.samples import Recording

# Length of the first segments, in periods. Fits to them converge from a rough guess.
PERIODS_PER_SEGMENT = 6
CLOSE_MISFIT = 1.5  # largest chi^2 per projection of a fit that is close enough to choose its terms
# Passes with joined segments: those that select terms, twice as many if the model follows the data
# after these, and later ones that do not. If all select terms, fewer settle.
SELECTING_PASSES, SETTLING_PASSES = 14, 6
# Largest squared length of the last step, in standard deviations. It increases errors by 0.5 %.
DECREMENT_TOLERANCE = 0.01


@dataclass(frozen=True)
class Step(NormalEquations):
    """Gauss-Newton step of a multiple-shooting fit, with the normal equations after it.

    before, fit: the fits before and after it. Segments are in chains. decrement: squared length of
    the step, in units of its covariance. gap: largest mismatch of segments before the step, in
    units of each state's size.
    """

    before: ShootingFit
    fit: ShootingFit
    decrement: float
    gap: float

    def path(self, period: float) -> Iterator[str]:
        """Yield words on the lengths of windows and segments; period: s, the shortest."""
        record = self.fit.record
        if (finer := round(period / WINDOWS_PER_PERIOD / record.condensed.step)) > 1:
            yield f"windows 1/{finer}"
        halvings = round(np.log2(PERIODS_PER_SEGMENT / (record.stretch / period)))
        yield f"{PERIODS_PER_SEGMENT / 2**halvings:g} periods"
        if not self.fit.misfit < CLOSE_MISFIT:
            yield "not close"


@dataclass(frozen=True)
class JoinedFit:
    """Result of a multiple-shooting fit with joined segments.

    free_step: the last step in free segments. step: the last step of all. path: the stages, in
    words. settled: whether the iteration converged with the same terms. objection: why the fit does
    not follow the data, None if it does.
    """

    free_step: Step
    step: Step
    path: tuple[str, ...]
    settled: bool
    objection: Finding | None


def fit_free_segments(start: Start, guess: WeakFit) -> Step | None:
    """Fit a model to segments of the recordings, each with an independent initial state.

    Segments are halved up to three times, until the fit is close, or until they are so short that
    their initial states alone explain the samples. If no fit is close, the result is that of the
    last of the halvings that each halved the misfit. None if there is no fit.

    From a rough guess, particularly of a sensitive system, long segments diverge from the solution;
    segments that are too short hide faults of the recording.
    """
    best, improving, periods = None, True, float(PERIODS_PER_SEGMENT)
    stretch = np.inf
    for _ in range(4):
        if is_exhausted():
            break
        try:
            fit = prepare_fit(start, guess, periods)
            if fit.record.stretch >= stretch:  # segments of two windows are the shortest
                break
            stretch = fit.record.stretch
            periods = stretch / start.period
            step = _iterate_free_segments(fit, start.largest)
        except FloatingPointError:
            continue
        finally:
            periods /= 2.0
        if step is None:
            break
        if step.fit.misfit < CLOSE_MISFIT:
            return step
        improving = best is None or (improving and step.fit.chi2 <= best.fit.chi2 / 2.0)
        best = step if improving else best
    return best


def follows_in_segments(start: Start) -> bool:
    """Decide whether a model fits the data to the noise in free segments of three periods or more.

    None does if random forces move the system.
    """
    try:
        fit = prepare_fit(start, start.fit, PERIODS_PER_SEGMENT)
        is_long = fit.record.stretch / start.period >= PERIODS_PER_SEGMENT / 2
        step = _iterate_free_segments(fit, start.largest) if is_long else None
        return step is not None and step.fit.misfit < CLOSE_MISFIT
    except FloatingPointError:
        return False


def _iterate_free_segments(fit: ShootingFit, largest: np.ndarray) -> Step | None:
    """Iterate over free segments until the fit is close, or chi^2 falls slowly.

    Returns None if the segments determine no combination of terms.
    """
    previous_fit = fit
    # with three steps fewer models are `ok` (docs/identification_parts.csv); after the last step
    # segments are joined, however bad the fit
    for _ in range(5):
        step = take_step(previous_fit, fit, 1, None)
        if n_unidentifiable_directions(step.information, largest) == len(largest):
            return None
        previous_fit, fit = step.before, step.fit
        # with 0.7 or 0.8, two of 36 published systems are found that five passes miss
        is_slow = fit.chi2 > 0.8 * previous_fit.chi2
        if fit.misfit < CLOSE_MISFIT or is_slow:
            break
    return step


def prepare_fit(
    start: Start, guess: WeakFit, periods: float, min_periods: float = 0.0
) -> ShootingFit:
    """Set up a multiple-shooting fit in segments of `periods` periods, from an initial guess.

    Windows are halved until inputs are nearly polynomials within one and the Taylor series is
    accurate over one, segments until the guess does not diverge within one, but not below
    `min_periods`. Raises FloatingPointError if this does not suffice.
    """
    recordings, smoothed, period = start.recordings, start.smoothed, start.period
    problem, channels = start.problem, Channels.from_recordings(recordings)
    columns = channels.observed + len(problem.states) * channels.is_rate  # of states, then of rates
    noises = [channel_noise(*one) for one in zip(recordings, smoothed, strict=True)]
    noise, known = np.take(np.stack(noises, axis=1), columns, axis=2)
    times = [one.time for one in recordings]
    sampled = [
        np.column_stack(
            [
                rate_without_offset(one, k) if is_rate else one.values[:, k]
                for k, is_rate in zip(channels.observed, channels.is_rate, strict=True)
            ]
        )
        for one in recordings
    ]
    curves = [
        np.hstack([one.states, np.gradient(one.states, one.time, axis=0)]) for one in smoothed
    ]
    size = np.array([np.std(one[:, columns], axis=0) for one in curves])
    floor = np.fmax(MIN_RESIDUAL * np.where(size > 0.0, size, 1.0), known)
    noise = np.where(np.isfinite(noise), np.maximum(noise, floor), 1.0)
    windows = WINDOWS_PER_PERIOD
    length = max(round(windows * periods), 2)
    for _ in range(MAX_TRIALS):
        if is_exhausted():
            raise NotConvergedError(Finding.of(Code.LIMIT_OF_WORK))
        has_kinks = problem.tables.n_kinks > 0
        condensed = condense_recordings(
            times, sampled, channels, period / windows, known, has_kinks
        )
        if problem.inputs:
            windowed = condensed.first, condensed.step
            inputs, input_errors = problem.input_polynomials(recordings, *windowed)
            condensed = replace(condensed, inputs=inputs)
            error = _error_of_inputs(start, guess, channels, input_errors)
            # the inputs' deviation from their polynomials moves the solution too far in a window
            if windows < 8 * WINDOWS_PER_PERIOD and np.any(error > 0.1 * noise):
                windows, length = 2 * windows, 2 * length
                continue
        states, valid = _window_states(condensed, recordings, smoothed)
        segments = cut_segments(condensed, length, valid)
        record = ShootingData(problem, condensed, segments, states, floor)
        try:
            truncation = segment_residuals(record, guess.free, record.starts)[1]
        except FloatingPointError:
            shortest = max(round(windows * min_periods), 2)
            if length <= shortest:
                break
            length = max(length // 2, shortest)
            continue
        if truncation < TRUNCATION_ERROR:
            return ShootingFit(record, guess.free, guess.support, record.starts, noise, noise)
        windows, length = 2 * windows, 2 * length
    raise FloatingPointError("the initial guess diverges, or its time scale is too short")


def _error_of_inputs(
    start: Start, guess: WeakFit, channels: Channels, input_errors: np.ndarray
) -> np.ndarray:
    """Estimate the error of the solution from inputs that are no polynomials, (n_observed,).

    It is a root mean square within windows. The difference between inputs and polynomials, such as
    the steps of a held input, affects a rate, its integral the state, and its second integral the
    state that has this state as rate. No term counts for more than its whole equation.
    """
    problem, n = start.problem, len(start.problem.states)
    observed, is_rate = channels.observed, channels.is_rate
    values = np.concatenate([one.states[one.valid] for one in start.smoothed])
    theta = design_matrix(values, tuple(map(tuple, problem.state_exponents)))
    sizes = np.sqrt(np.mean(theta**2, axis=0))
    coefficients = np.minimum(np.abs(guess.free), start.largest)
    errors = np.zeros((3, n))
    for (equation, term), coefficient in zip(problem.candidates, coefficients, strict=True):
        factor = problem.terms[term][n : n + len(problem.inputs)]
        if any(factor):
            share = coefficient * sizes[term]
            errors[:, equation] += share * input_errors[:, problem.tables.factors.index(factor)]
    error = np.where(is_rate, errors[0, observed], errors[1, observed])
    for displacement, velocity in velocity_pairs(problem.states).items():
        own = observed == displacement
        error[own] = np.where(is_rate[own], errors[1, velocity], errors[2, velocity])
    return error


def _window_states(
    condensed: Condensed, recordings: list[Recording], smoothed: list[Smooth]
) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate smoothed states where the windows start, and find whether data are near.

    Returns (n_windows, n_states) and (n_windows,). Without data nearby, as in the gap of a channel,
    states are limited to their range.
    """
    states, has_data = [], []
    windows = np.diff(condensed.first)
    for recording, one, count in zip(recordings, smoothed, windows, strict=True):
        time = recording.time[0] + condensed.step * np.arange(count)
        values = np.column_stack([np.interp(time, one.time, x) for x in one.states.T])
        valid = np.interp(time, one.time, one.valid) == 1.0
        if valid.any():
            values = np.clip(values, values[valid].min(axis=0), values[valid].max(axis=0))
        states.append(values)
        has_data.append(valid)
    return np.concatenate(states), np.concatenate(has_data)


def join_segments(
    free_step: Step, penalties: Penalties, penalty_factor: float, has_unseen: bool
) -> JoinedFit:
    """Join fitted segments into continuous trajectories by Gauss-Newton, and select the terms.

    Terms are selected in all but the last passes: if the model of a sensitive system follows the
    data, superfluous terms still disappear slowly, a few in each pass. Chains grow fourfold until
    the terms are unchanged: about a rough fit, particularly with too many terms, the solution over
    a long chain is far from linear in the coefficients, and the apparently best terms mislead. If
    those of the start are the best already, the chains are whole from the first.

    free_step: the last step in free segments. penalties: of terms. penalty_factor: on them in the
    first two passes; half of it, but at least one, in the next two, and so on. has_unseen:
    whether mixtures of terms are undetermined: then many models follow the data alike, an iteration
    that does not converge while terms are chosen never will, and the last model represents the
    others.
    """
    step, count = free_step, len(free_step.fit.starts)
    best = step.choose_terms(step.fit, penalties.scale_by(penalty_factor))
    # segments in the first chains: with two or eight, three recordings have the same model
    chain = count if np.array_equal(best, step.fit.support) else 4
    n_selecting, n_settling = SELECTING_PASSES, 0 if has_unseen else SETTLING_PASSES
    whole, settled, iteration = False, False, 0
    try:
        while iteration < n_selecting + n_settling:
            factor = max(penalty_factor / 2 ** (iteration // 2), 1.0)
            longest = None if whole else chain  # changing chains would never settle
            of_pass = penalties.scale_by(factor) if iteration < n_selecting else None
            step = take_step(step.before, step.fit, longest, of_pass)
            unchanged = np.array_equal(step.fit.support, step.before.support)
            if factor == 1.0 and not step.fit.support.any():
                raise NotConvergedError(Finding.of(Code.NO_TERM))
            was_whole = whole or chain >= count
            # the gap is measured before the step, which leaves about its square, 1e-6 of each state
            converged = step.decrement < DECREMENT_TOLERANCE and step.gap < 1e-3 and factor == 1.0
            settled = unchanged and was_whole and converged
            if settled or is_exhausted():
                break
            whole = unchanged and was_whole
            if not whole:
                chain = count if unchanged else 4 * chain
            iteration += 1
            if iteration == SELECTING_PASSES and not has_unseen and step.fit.misfit < CLOSE_MISFIT:
                n_selecting *= 2
    except FloatingPointError as error:
        return JoinedFit(free_step, step, ("left",), False, as_findings(error)[0])
    misfit = step.fit.misfit
    follows = settled or (has_unseen and was_whole and misfit < CLOSE_MISFIT)
    code = Code.NOT_FOLLOWED if misfit > CLOSE_MISFIT else Code.NOT_PREFERRED
    objection = None if follows else Finding.of(code, chi2=misfit)
    if objection and is_exhausted():
        objection = Finding.of(Code.LIMIT_OF_WORK)
    return JoinedFit(free_step, step, ("settled" if settled else "unsettled",), settled, objection)


def take_step(
    before: ShootingFit, fit: ShootingFit, longest: float | None, penalties: Penalties | None
) -> Step:
    """Take a Gauss-Newton step from a fit or, if the fit is bad, from nearer to the one before it.

    A fit is bad if it diverges, or if it is not close and its chi^2 is 1.5 times that of the fit
    before it or more. A fit nearer to `before` is compared with that of one pass earlier. The other
    arguments are as in `_gauss_newton`. Raises FloatingPointError if all are bad, or the work is
    exhausted.
    """
    passing("follow the recording in segments")
    if is_exhausted():
        raise NotConvergedError(Finding.of(Code.LIMIT_OF_WORK))

    def step_from(tried: ShootingFit) -> Step:
        step = _gauss_newton(tried, longest, penalties)
        if not (step.fit.misfit < CLOSE_MISFIT or step.fit.chi2 < 1.5 * tried.chi2):
            raise FloatingPointError("chi^2 rises")
        return step

    return shorten_step(step_from, before, fit)


def _gauss_newton(fit: ShootingFit, longest: float | None, penalties: Penalties | None) -> Step:
    """Linearise, choose the terms (unless `penalties` is None), move, and re-estimate the noise.

    The noise is that of the projections, since coloured noise scatters differently within a window.
    longest: as in `chain_segments`, None to keep the existing chains.
    """
    record, linear = fit.record, fit.linearise()
    if longest is not None:
        record = replace(record, segments=chain_segments(linear, record.segments, longest))
    quadratic = eliminate_chains(linear, record.segments)
    support = fit.support if penalties is None else quadratic.choose_terms(fit, penalties)
    free, _ = quadratic.best_coefficients(fit, support)
    change = free - fit.free
    starts = quadratic.move_states(change, fit.starts)
    next_fit = replace(fit, record=record, free=free, support=support, starts=starts)
    next_fit = update_noise(next_fit, record.condensed.sum_squares(linear.residual))
    information, right = quadratic.information, quadratic.right
    decrement = float(change @ information @ change)
    # a state may be zero, except for rounding, wherever segments end
    size = np.maximum(abs(linear.ends).max(axis=0), MIN_RESIDUAL * abs(record.states).max(axis=0))
    gap = float(np.max(quadratic.gap / (size + np.finfo(float).tiny)))
    return Step(information, right - information @ change, fit, next_fit, decrement, gap)


def update_noise(fit: ShootingFit, squares: np.ndarray) -> ShootingFit:
    """Update noise and chi^2 of a fit by its squared residuals' sums (n_recordings, n_observed)."""
    rows, floor = fit.record.condensed.rows, fit.record.floor
    share = fit.n_parameters / max(int(np.count_nonzero(squares)), 1)
    freedom = np.maximum(rows - share, MIN_FREEDOM * rows + 1.0)
    sigma = np.maximum(np.sqrt(squares / freedom), floor)
    return replace(fit, sigma=sigma, chi2=float(np.sum(squares / fit.reference**2)))
