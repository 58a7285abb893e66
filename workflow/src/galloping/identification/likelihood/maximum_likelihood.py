"""Maximum likelihood: coefficients, initial states and terms at the limit the data set.

The method is on a page, docs/identification.md, in the order of this module: the starts, of which
each is fitted in free segments and joined over the recording; what the residuals show; the verdict.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from galloping.arrays import one_thread
from galloping.identification.likelihood.derivative_fit import derivative_fit
from galloping.identification.likelihood.free_run import (
    forgets_start,
    free_runs,
    whole_approximation,
)
from galloping.identification.likelihood.inputs import check_question, checked_recordings, driven
from galloping.identification.likelihood.instrument import FORCES, faults
from galloping.identification.likelihood.model_error import approximation
from galloping.identification.likelihood.prior import Prior, costs
from galloping.identification.likelihood.problem import Coefficient, Problem, posed
from galloping.identification.likelihood.rate_channels import scaled, scales_told, with_rates
from galloping.identification.likelihood.residual_tests import MOST_COLOUR, Residue, residue
from galloping.identification.likelihood.shooting import Segments, residuals
from galloping.identification.likelihood.starts import (
    TIME_SCALES,
    positions_of_rest,
    rests_at_zero,
    starts_of_terms,
    with_constants,
    without_constants,
)
from galloping.identification.likelihood.trajectory_fit import (
    DIVERGES,
    FreeFit,
    JoinedFit,
    free_fit,
    join,
    prepare,
    unseen_mixtures,
    window_states,
)
from galloping.identification.likelihood.verdict import (
    Regression,
    agree,
    best_of,
    by,
    judged,
    refused,
    with_inputs,
)
from galloping.identification.likelihood.weak_constraint import STRETCH_PERIODS
from galloping.identification.likelihood.weak_gls import Start, begin, largest_terms
from galloping.identification.model import NO_MODEL, IdentifiedModel, Unusable
from galloping.identification.random_forces.random_forces import moved_at_random, random_forces
from galloping.identification.random_forces.unmodelled import unmodelled
from galloping.identification.work import ENDED, is_spent, limited
from galloping.polynomial import Exponents, PolynomialModel
from galloping.recording import Recording

PRIOR = Prior()


@one_thread
def maximum_likelihood(
    recordings: Recording | Sequence[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    prior: Prior | None = PRIOR,
    start: Start | None = None,
    forced: Sequence[str] | None = None,
    coefficients: Sequence[Coefficient] = (),
    allowed: ArrayLike | None = None,
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
    name. start: of `weak_gls.begin`, where it is made already.
    coefficients: what is known of single ones, which are then always there. allowed: (n_states,
    n_terms) boolean, in which equations each term is sought; in all by default.
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
    check_question(states, terms, known, known_states, prior, inputs, coefficients, allowed)
    if forced is not None:
        asked = terms, known, known_states, forced, coefficients, allowed
        return random_forces(recordings, *asked)
    problem = posed(states, terms, known, known_states, prior, inputs, coefficients, allowed)
    given = recordings
    try:
        recordings = driven(recordings, problem.inputs)
    except Unusable as error:
        return by(["no model"], refused(problem, str(error)))
    if all(recording.derivatives is not None for recording in recordings):
        return with_inputs(derivative_fit(problem, recordings), given, recordings)
    with limited(recordings) as work:
        found = work.told(_at_some_time_scale(problem, recordings, start))
    return with_inputs(found, given, recordings)


def _at_some_time_scale(
    problem: Problem, recordings: list[Recording], start: Start | None
) -> IdentifiedModel:
    """The model from the starts of the first time scale of which any leads to one."""
    objections = []
    for share in TIME_SCALES:
        if is_spent():
            break
        try:
            found = _at_time_scale(problem, recordings, share, start if share == 1.0 else None)
        except NO_MODEL as error:
            objections.append(str(error))
            continue
        return found if share == 1.0 else by([f"time scale {share:g}"], found)
    more = unmodelled(recordings)
    return by(["no model"], refused(problem, "; ".join(filter(None, [more, *objections[:1]]))))


def _at_time_scale(
    problem: Problem, recordings: list[Recording], share: float, begun: Start | None
) -> IdentifiedModel:
    """The model from the starts of one time scale. Raises NO_MODEL where none leads to one."""
    begun = begun or begin(problem, recordings, share)
    if share == 1.0 and (forced := moved_at_random(problem, begun)) is not None:
        return forced
    rescaled = scaled(recordings, begun.period)
    if any(one is not other for one, other in zip(recordings, rescaled, strict=True)):
        begun = begin(problem, rescaled, share)
    begun = with_rates(begun, rescaled)
    if rests_at_zero(problem, begun):
        moving, found, objections = without_constants(problem), [], []
        positions = positions_of_rest(moving, begun)
        for k, position in enumerate(positions, 1):
            try:
                one = _identified(moving, recordings, position)
                found.append(by([f"rest {k} of {len(positions)}"], one))
            except NO_MODEL as error:
                objections.append(error)
            if agree(found) or is_spent():
                break
        if not found:
            raise objections[0]
        identified = with_constants(problem, best_of(found))
    else:
        identified = _identified(problem, recordings, begun)
    told = scales_told(recordings, rescaled)
    return replace(identified, diagnostics={**identified.diagnostics, **told})


def _identified(problem: Problem, recordings: list[Recording], begun: Start) -> IdentifiedModel:
    """The model that follows the data to the noise, or one that is near where none does.

    Raises FloatingPointError where there is neither.
    """
    try:
        found = _followed(problem, recordings, begun)
    except FloatingPointError as error:
        found = str(error)
    return _near(problem, begun, found) if isinstance(found, str) else found


def _near(problem: Problem, begun: Start, objection: str) -> IdentifiedModel:
    """The model that is near where no model of the library is right, for the reason `objection`."""
    condensed, segments, fit = prepare(problem, begun, begun.fit, STRETCH_PERIODS)
    states, _ = window_states(condensed, begun.recordings, begun.smoothed)
    near = approximation(
        problem, condensed, segments, states, fit.free, fit.sigma, fit.floor, begun.penalty,
        objection,
    )  # fmt: skip
    path = ["approximation"]
    if problem.inputs and near.status == "approximate":
        run = free_runs(problem, condensed, near, fit.floor, begun.penalty, objection)
        if run is not None:
            path, near = [*path, near.diagnostics["path"]], run
    return by(path, near)


def _followed(problem: Problem, recordings: list[Recording], begun: Start) -> IdentifiedModel | str:
    """The model that follows the data to the noise, or why no model of the library is right.

    Raises FloatingPointError where a model that was found diverges over the recording.
    """
    largest, penalty = largest_terms(problem, begun.smoothed), begun.penalty
    joined = _joined(problem, begun, largest)
    if joined is None:
        return ENDED if is_spent() else DIVERGES
    if joined.objection == ENDED:  # not joined, for no cause that the data show
        return ENDED
    if joined.objection:
        return "; ".join([*_causes_of_none(problem, joined.free, penalty), joined.objection])
    remaining, shown = _remaining(problem, begun, joined)
    if shown.coloured and shown.band < MOST_COLOUR:
        joined = _with_coloured_noise(problem, begun, joined, shown)
        if joined.objection:
            return joined.objection
        remaining, shown = _remaining(problem, begun, joined)
    condensed, step, fit = joined.free.condensed, joined.step, joined.step.fit
    sigma, noise = _noise(problem, joined, remaining)
    doubt = "many models follow the data alike"
    if joined.settled:  # else what it leaves in the residuals is that it is not the best fit
        causes = faults(problem, condensed, step.segments, fit, penalty)
        objection = shown.objection(condensed.names(problem.states))
        objection = "; ".join(filter(None, [*[fault.cause for fault in causes[:1]], objection]))
        if objection:
            if causes and not causes[0].or_model:
                return by(joined.path, refused(problem, objection))
            if problem.inputs and forgets_start(problem, condensed, step.segments, fit):
                near = whole_approximation(
                    problem, condensed, step.segments, fit, step.information, remaining, penalty,
                    objection,
                )  # fmt: skip
                return by(joined.path, near)
            return objection
        doubt = ""
    kept = sum(recording.samples for recording in begun.recordings)
    found = judged(
        problem,
        Regression(step.information, step.right, fit.support, penalty, largest, fit.free),
        doubt,
        initial_states=fit.starts[np.unique(step.segments.recording, return_index=True)[1]],
        sigma=sigma,
        chi2=shown.chi2,
        diagnostics={
            "chi2_allowed": shown.chi2_allowed,
            "residual_band": shown.band,
            "residual_band_allowed": shown.band_allowed,
            "residual_line": shown.line,
            "residual_line_allowed": shown.line_allowed,
            "removed_share": 1.0 - kept / sum(recording.samples for recording in recordings),
            **noise,
        },
    )
    return by(joined.path, found)


def _joined(problem: Problem, begun: Start, largest: np.ndarray) -> JoinedFit | None:
    """The fit of the first start that settles, else of the first that follows the data, else of
    the first that can be integrated; None where none can.
    """
    prices = costs(problem.prior, problem.complexity, begun.penalty)
    best = None
    for start in starts_of_terms(problem, begun, prices):
        free = free_fit(problem, begun, start.fit)
        if free is None:
            continue
        unseen = unseen_mixtures(free.step.information, largest) > 0
        joined = join(problem, free, prices, start.dear, unseen)
        path = (start.name, *free.path(begun.period), *joined.path)
        joined = replace(joined, path=path)
        if start.dear > 1.0 and joined.settled and unseen:
            # a limit cycle looks like one of fewer terms
            told = unseen_mixtures(joined.step.information, largest) < joined.step.fit.support.sum()
            joined = replace(joined, settled=told)
        if joined.settled:
            return joined
        if best is None or (best.objection and not joined.objection):
            best = joined
    return best


def _with_coloured_noise(
    problem: Problem, begun: Start, joined: JoinedFit, shown: Residue
) -> JoinedFit:
    """Joined again, the noise as strong as it is at the frequencies of the motion."""
    power = np.where(np.isfinite(shown.band_power), shown.band_power, joined.step.fit.sigma**2)
    noise = np.sqrt(power)
    fit = replace(joined.step.fit, sigma=noise, floor=noise, reference=noise, chi2=np.inf)
    free = replace(joined.free, step=replace(joined.step, before=fit, fit=fit))
    again = join(problem, free, costs(problem.prior, problem.complexity, begun.penalty), 1.0, False)
    path = (*joined.path, "coloured noise", *again.path)
    return replace(again, free=joined.free, path=path)


def _causes_of_none(problem: Problem, free: FreeFit, penalty: float) -> list[str]:
    """What may be why no model follows the whole recording; nothing where no work is left."""
    if is_spent():
        return []
    shown = faults(problem, free.condensed, free.step.segments, free.step.fit, penalty)
    if free.is_close:
        named = [fault.cause for fault in shown[:1]]
        # a small fault does not keep the pieces from joining
        return (
            named if FORCES in named else [*named, f"followed in pieces, not as a whole: {FORCES}"]
        )
    # where nothing follows the data, a fault must explain most of what is left
    least = float(np.sum(free.condensed.rows)) / 2
    return [fault.cause for fault in shown[:1] if fault.z**2 >= least]


def _remaining(problem: Problem, begun: Start, joined: JoinedFit) -> tuple[np.ndarray, Residue]:
    """Residuals of single shooting over every chain, and what they show.

    Raises FloatingPointError where the model diverges over a chain.
    """
    condensed, fit, segments = joined.free.condensed, joined.step.fit, joined.step.segments
    begins = np.unique(segments.chains, return_index=True)[1]
    windows = np.append(segments.first[begins], segments.first[-1])
    whole = Segments(windows, segments.recording[begins], np.arange(len(begins)))
    firsts = fit.starts[begins]
    remaining, _ = residuals(problem, condensed, whole, fit.free, firsts)
    parameters = int(fit.support.sum()) + firsts.size
    return remaining, residue(condensed, remaining, parameters, begun.period)


def _noise(
    problem: Problem, joined: JoinedFit, remaining: np.ndarray
) -> tuple[np.ndarray, dict[str, float]]:
    """(n_recordings, n_states) noise of a sample of each state, and of each rate by its name."""
    condensed, fit, step = joined.free.condensed, joined.step.fit, joined.step
    parameters = int(fit.support.sum()) + (step.segments.chains[-1] + 1) * len(problem.states)
    share = parameters / max(np.count_nonzero(condensed.counts), 1)
    squares = condensed.squares(remaining) + condensed.remainder
    variance = squares / np.maximum(condensed.counts - share, 1.0)
    variance = np.where(condensed.is_known, condensed.noise_variance, variance)
    return condensed.told(problem.states, np.sqrt(variance))
