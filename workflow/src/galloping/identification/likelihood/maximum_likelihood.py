"""Maximum likelihood: coefficients, initial states and terms at the limit the data set.

The weak form gives the start; multiple shooting with matched segments, Gauss-Newton on the
coefficients of the whole library, and selection on the quadratic model do the rest. Intervals
come from the information at the solution, so they are those of the Cramer-Rao bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.derivative_fit import derivative_fit
from galloping.identification.likelihood.following import (
    follow,
    path_of,
    prepare,
    window_states,
)
from galloping.identification.likelihood.gauss_newton import Fit, is_close
from galloping.identification.likelihood.inputs import check_question, checked_recordings, driven
from galloping.identification.likelihood.instrument import FORCES, Fault, faults
from galloping.identification.likelihood.matching import match, unseen_mixtures
from galloping.identification.likelihood.model_error import approximation, whole_approximation
from galloping.identification.likelihood.prior import Prior
from galloping.identification.likelihood.problem import Problem, posed
from galloping.identification.likelihood.rate_channels import scaled, scales_told, with_rates
from galloping.identification.likelihood.residual_tests import MOST_COLOUR, Residue, residue
from galloping.identification.likelihood.rest import from_rest
from galloping.identification.likelihood.result import by, judged, refused
from galloping.identification.likelihood.shooting import Segments, forgets_start, residuals
from galloping.identification.likelihood.weak_constraint import STRETCH_PERIODS
from galloping.identification.likelihood.weak_gls import Start, begin, largest_terms, rough_fit
from galloping.identification.model import NO_MODEL, IdentifiedModel
from galloping.identification.random_forces.random_forces import moved_at_random, random_forces
from galloping.polynomial import Exponents, PolynomialModel
from galloping.recording import Recording
from galloping.threads import one_thread

# Time scales that are tried, each half of the one before, which gave no model: the spectrum shows
# that of most of the power, and a transient or a relaxation is quicker. Measured on systems of
# `galloping.trials.systems`: a cubic oscillator that slows down as it decays needs a half or a
# quarter of it, one that relaxes a half; of two that a quarter did not answer, neither did an
# eighth or a sixteenth.
TIME_SCALES = 3

PRIOR = Prior()


@one_thread
def maximum_likelihood(
    recordings: Recording | Sequence[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    prior: Prior | None = PRIOR,
    start: Callable[..., Start] | None = None,
    forced: Sequence[str] | None = None,
) -> IdentifiedModel:
    """Identify one polynomial model from one or several recordings of a system.

    recordings: sharing their states; any sampling, NaN where samples or channels are missing;
    the noise of each channel of each recording is white and Gaussian, and unknown but where they
    say it: then it is the least that is assumed, and what the misfit is held against. Where they
    carry derivatives, the states are exact and the equations are fitted directly.
    terms: the library, in the states or in the states and the inputs of the first recording, which
    all must have; a recording counts in the stretches in which they are there, and `initial_states`
    and `sigma` of the result are those of the stretches. known: model whose equations of
    `known_states` hold; the equation of a state X is known to be dX/dt = dX where a state has that
    name. start: makes the start, as `weak_gls.begin`, the default; with a shorter time scale where
    the first gives no model.
    prior: of the terms (see `prior`); None: the data alone choose them and speak in the verdict.
    forced: names of coordinates or states that unmeasured random forces move, none for all, as
    `random_forces`, which answers; by default it does where the motion shows such forces.
    The status is `ok`, `not identifiable` (other terms could be there as well), `approximate` (no
    model of the library follows the data to the noise; see `model_error`), or `refused`.
    Raises ValueError where the recordings differ in their states, and for other input.
    """
    recordings = checked_recordings(recordings)
    states = recordings[0].states
    inputs = tuple(recordings[0].inputs)
    check_question(states, terms, known, known_states, prior, inputs)
    if forced is not None:
        return random_forces(recordings, terms, known, known_states, forced)
    problem = posed(states, terms, known, known_states, prior, inputs)
    try:
        recordings = driven(recordings, problem.inputs)
        if all(recording.derivatives is not None for recording in recordings):
            return derivative_fit(problem, recordings)
    except NO_MODEL as error:
        return by(["derivatives"], refused(problem, str(error)))
    reasons = []
    for halvings in range(TIME_SCALES):
        try:
            found = _from_states(problem, recordings, partial(start or begin, share=0.5**halvings))
            return by([f"time scale 1/{2**halvings}"] if halvings else [], found)
        except NO_MODEL as error:
            reasons.append(str(error))
    return by(["no model"], refused(problem, reasons[0]))


def _from_states(
    problem: Problem, recordings: list[Recording], begin: Callable[..., Start]
) -> IdentifiedModel:
    begun = begin(problem, recordings)
    if not problem.inputs and (forced := moved_at_random(problem, begun)) is not None:
        return forced
    rescaled = scaled(recordings, begun)
    if any(one is not other for one, other in zip(recordings, rescaled, strict=True)):
        begun = begin(problem, rescaled)
    identified = from_rest(
        problem,
        with_rates(begun, rescaled),
        lambda problem, start: _exact_or_near(problem, recordings, start),
    )
    told = scales_told(recordings, rescaled)
    return replace(identified, diagnostics={**identified.diagnostics, **told})


def _exact_or_near(problem: Problem, recordings: list[Recording], begun: Start) -> IdentifiedModel:
    try:
        return _exact(problem, recordings, begun)
    except FloatingPointError as objection:
        condensed, segments, fit = prepare(
            problem, begun.recordings, begun.smoothed, begun.period, begun.fit, STRETCH_PERIODS
        )
        states, _ = window_states(condensed, begun.recordings, begun.smoothed)
        near = approximation(
            problem, condensed, segments, states, fit.free, fit.sigma, fit.floor, begun.penalty,
            str(objection),
        )  # fmt: skip
        return by(["approximation"], near)


def _exact(problem: Problem, recordings: list[Recording], begun: Start) -> IdentifiedModel:
    """The model that follows the data to the noise; refused where an instrument is at fault.

    Raises FloatingPointError where no model of the library does.
    """
    samples = sum(recording.samples for recording in recordings)
    recordings, smoothed, period = begun.recordings, begun.smoothed, begun.period
    kept = sum(recording.samples for recording in recordings)
    penalty, start = begun.penalty, rough_fit(problem, begun)
    largest = largest_terms(problem, smoothed)
    for name, (condensed, segments, step) in follow(
        problem, recordings, smoothed, period, start, penalty, largest
    ):
        followed = step.fit
        part = [] if start is begun.fit else ["telling stretch"]
        path = [*part, name, *path_of(period, condensed, segments, step)]
        unseen = unseen_mixtures(step.information, largest) > 0
        try:
            fit, step, ended = match(problem, condensed, segments, step, penalty, unseen, largest)
            path += ended
            break
        except FloatingPointError as error:
            unmatched = error
    else:
        causes = _causes_of_none(problem, condensed, segments, followed, penalty)
        raise FloatingPointError("; ".join([*causes, str(unmatched)])) from unmatched
    remaining, shown = _remaining(problem, condensed, fit, step.segments, period)
    if shown.coloured and shown.band < MOST_COLOUR:
        power = np.where(np.isfinite(shown.band_power), shown.band_power, fit.sigma**2)
        noise = np.sqrt(power)
        fit = replace(fit, sigma=noise, floor=noise, reference=noise, cost=np.inf)
        step = replace(step, before=fit, fit=fit)
        fit, step, ended = match(problem, condensed, segments, step, penalty, unseen, largest)
        path += ["coloured noise", *ended]
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
        if objection and (not causes or causes[0].or_model):
            if problem.inputs and forgets_start(
                problem, condensed, fit.sigma, step.segments, fit.free, fit.starts
            ):
                near = whole_approximation(
                    problem, condensed, step.segments, fit, step.information, remaining, sigma,
                    penalty, objection,
                )  # fmt: skip
                return by(path, near)
            raise FloatingPointError(objection)
    else:  # what it leaves in the residuals is that it is not the best fit
        objection, doubt = "", "many models follow the data alike"
    found = judged(
        problem, step.information, step.right, fit.support, penalty,
        about=step.fit.free,
        largest=largest,
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
    return by(path, found)


def _causes_of_none(
    problem: Problem, condensed: Condensed, segments: Segments, fit: Fit, penalty: float
) -> list[str]:
    """What may be why no model follows the whole recording; `fit` is of free segments."""
    rows = float(np.sum(condensed.rows))
    close = is_close(condensed, fit)
    # where nothing follows the data, a fault must explain most of what is left
    causes = _causes(problem, condensed, segments, fit, penalty, 0.0 if close else rows / 2)
    named = [fault.cause for fault in causes[:1]]
    if close and FORCES not in named:  # a small fault does not keep the pieces from joining
        named.append(f"followed in pieces, not as a whole: {FORCES}")
    return named


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
