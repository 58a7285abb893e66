"""The verdict on a set of terms, and the identified model that carries it: decided here alone."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.special import chdtri

from galloping.identification.likelihood.instrument import GUSTS
from galloping.identification.model import RANGE, IdentifiedModel
from galloping.identification.plausible import (
    MISS_RATE,
    Plausible,
    detection_limits,
    plausible_supports,
    unconditional_errors,
    with_prior,
)
from galloping.identification.problem import Problem
from galloping.identification.selection import (
    NOTHING_STANDS_OUT,
    Whitened,
    added_deviation,
    solve_support,
    tableau,
    whiten,
)
from galloping.intervals import QUANTILES_90, normal
from galloping.polynomial import PolynomialModel, term_name
from galloping.recording import Recording
from galloping.taylor import solution

# Weight that the plausible supports without one of the terms found may have together: at most one
# in fifty of all models that are `ok` holds a false term (docs/identification_parts.csv).
MOST_RIVAL_WEIGHT = 0.2
# Share of its equation that an absent term may make up unseen under an `ok`: a simple term, and any
# other (docs/identification_parts.csv). A term that may be several times as large as its equation
# is one that others balance, as they do where all that was recorded lies near a surface.
MOST_HIDDEN, MOST_BALANCED = 0.25, 5.0
MOST_SURPRISE = 4.0  # deviations; by chance once in 16,000
RIVALS = 40  # drawn, to be told with a model
REPEATS = "the motion only repeats, and other equations have the same limit cycle"
FOLLOW = ("ok", "not identifiable")  # of models that follow the data to the noise


@dataclass(frozen=True)
class Regression:
    """chi^2 about a fit, a quadratic of the candidates' coefficients, and the terms chosen on it.

    information, right: as in `selection.solve_support`. support: (n,) boolean. penalty: 2 ln N of N
    samples. largest: (n,) coefficients as in `problem.largest`. about: (n,) coefficients of the
    fit, zero outside the support, from which `right` is measured.
    """

    information: np.ndarray
    right: np.ndarray
    support: np.ndarray
    penalty: float
    largest: np.ndarray
    about: np.ndarray | float = 0.0


@dataclass(frozen=True)
class Near:
    """Coefficients of a model near the data, of which no model of the library is right.

    free: (n,), zero outside `support` (n,). errors: (n,) standard errors of the present ones, and
    of each absent one were it alone added. covariance: (n_support, n_support). price: of a term, in
    units of chi^2, at which the terms were chosen.
    """

    free: np.ndarray
    support: np.ndarray
    errors: np.ndarray
    covariance: np.ndarray
    price: float


def judged(
    problem: Problem,
    regression: Regression,
    doubt: str = "",
    recordings: Sequence[Recording] = (),
    period: float = np.inf,
    **fitted: object,
) -> IdentifiedModel:
    """The identified model of a fit that may be trusted, `ok` or `not identifiable`.

    `ok` claims: the terms found are right, every absent one is smaller than its stated limit, and
    no simple one may hide that matters. Where another one may, or where the data alone would leave
    other terms open and the prior did not, its reason says so. Intervals and limits are those of
    the data alone.

    doubt: why its terms are not settled, '' where there is nothing to say. recordings: that its
    motion followed from `initial_states`, in which it is asked whether it only repeats; none where
    they tell rates besides. period: s, the shortest of the motion. fitted: initial_states, sigma,
    chi2 and diagnostics, as in `IdentifiedModel`.
    """
    support, penalty = regression.support, regression.penalty
    free, covariance = solve_support(regression.information, regression.right, support)
    free = free + regression.about
    reason, told = NOTHING_STANDS_OUT, ""
    errors = added_deviation(regression.information, support)
    if support.any():
        about = problem.chosen_about(regression.about)
        whitened = whiten(regression.information, regression.right, about)
        plausible = plausible_supports(whitened, support)
        believed = with_prior(problem, plausible)
        limits = detection_limits(unconditional_errors(believed, errors), support, penalty)
        hidden = partial(hidden_term, problem, support, limits, regression.largest)
        most = np.where(is_simple(problem, support), MOST_HIDDEN, MOST_BALANCED)
        missing = hidden(most, "may be missing: the data would not show")
        questions = open_questions(problem, whitened, believed)
        reason = "; ".join(filter(None, [doubt, questions, missing]))
        told = hidden(MOST_HIDDEN, "would not show, were it")
        share, rival = _rival(problem, plausible)
        if problem.prior and share > MOST_RIVAL_WEIGHT:
            prior = f"the data alone cannot tell {rival}; the prior prefers the simpler terms"
            told = "; ".join(filter(None, [prior, told]))
        errors = unconditional_errors(plausible, errors)
        fitted |= _rivals(problem, regression, believed)
    model = problem.model(free)
    if recordings and only_repeats(model, fitted["initial_states"], recordings, period):
        reason = "; ".join(filter(None, [REPEATS, reason]))
    conditional = np.full(len(support), np.nan)
    conditional[support] = np.sqrt(np.diag(covariance))
    return IdentifiedModel(
        model=model,
        status="not identifiable" if reason else "ok",
        reason=reason or told,
        standard_errors=problem.on_library(conditional, fixed=0.0),
        unconditional_errors=problem.on_library(errors, fixed=0.0),
        detection_limits=problem.on_library(detection_limits(errors, support, penalty)),
        covariance=problem.of_model(covariance, support),
        known=problem.known_equations,
        **fitted,
    )


def approximate(problem: Problem, near: Near, reason: str, **fitted: object) -> IdentifiedModel:
    """The identified model where no model of the library is right, `approximate`: only how far it
    is from the data is claimed, which `reason` says. fitted: as of `judged`.
    """
    limits = detection_limits(near.errors, near.support, near.price)
    return IdentifiedModel(
        model=problem.model(near.free),
        status="approximate",
        reason=reason,
        standard_errors=problem.on_library(np.where(near.support, near.errors, np.nan), fixed=0.0),
        detection_limits=problem.on_library(limits),
        covariance=problem.of_model(near.covariance, near.support),
        known=problem.known_equations,
        **fitted,
    )


def _rivals(problem: Problem, regression: Regression, believed: Plausible) -> dict[str, object]:
    """`IdentifiedModel.rivals` and their share."""
    rng, others, drawn = np.random.default_rng(0), believed.weight[1:], []
    share = float(others.sum())
    if share < MISS_RATE:
        return {}
    for k in rng.choice(len(others), RIVALS, p=others / share):
        own = believed.supports[1 + k]
        kept = np.where(own, regression.about, 0.0)
        right = regression.right + regression.information @ (regression.about - kept)
        change, covariance = solve_support(regression.information, right, own)
        kept[own] += normal(change[own], covariance, 1, rng)[0]
        drawn.append(problem.coefficients(kept))
    return {"rivals": np.array(drawn), "rival_share": share}


def agree(found: list[IdentifiedModel]) -> bool:
    """Whether the last of models from several starts and one before have the same terms and follow
    the data.
    """
    before = [one for one in found[:-1] if one.status in FOLLOW and found[-1].status in FOLLOW]
    return any(np.array_equal(one.support, found[-1].support) for one in before)


def best_of(found: list[IdentifiedModel]) -> IdentifiedModel:
    """Of models from several starts, that of the fewest terms that follow the data, or else of the
    best forecasts; not `ok` where no other follows the data, for a better one may then be missed.
    """

    def order(identified: IdentifiedModel) -> tuple[int, float]:
        if identified.status in FOLLOW:
            return 0, float(identified.support.sum())
        if identified.status == "approximate":
            return 1, -identified.diagnostics["forecast_r2"]
        return 2, 0.0

    best = min(found, key=order)
    if best.status == "ok" and sum(one.status in FOLLOW for one in found) < 2:
        return best.doubted(
            "displacements are not measured, and one alone of several starts leads to a model"
        )
    return best


def by(path: Iterable[str], identified: IdentifiedModel) -> IdentifiedModel:
    """The model with further stages before those of its path, by which it was found."""
    own = identified.diagnostics.get("path")
    stages = [*path, *([own] if own else [])]
    return replace(identified, diagnostics={**identified.diagnostics, "path": ", ".join(stages)})


def refused(problem: Problem, reason: str) -> IdentifiedModel:
    """The answer where there is no model: status `refused`, with the reason."""
    return IdentifiedModel.refused(problem.states, problem.terms, reason, problem.inputs)


def beside_known(problem: Problem, identified: IdentifiedModel) -> IdentifiedModel:
    """The model, not `ok` where recordings alone would put a coefficient MOST_SURPRISE deviations
    from what was known of it, or further: then what was known is wrong, or the model is.

    The estimate is the mean of both, weighted by their precisions: of its distance from what was
    known, the variance is that of what was known less its own.
    """
    found, mean = identified.model.coefficients, problem.expected
    with np.errstate(invalid="ignore", divide="ignore"):
        deviation = problem.precision**-0.5
        share = np.fmax(1.0 - (identified.standard_errors / deviation) ** 2, 1e-6)
        surprise = abs(found - mean) / (deviation * np.sqrt(share))
    denied = [
        f"{term_name(problem.terms[j], problem.names)} in d({problem.states[i]})/dt is "
        f"{found[i, j]:.3g}, and {mean[i, j]:.3g} ± {deviation[i, j]:.2g}"
        for i, j in np.argwhere(surprise > MOST_SURPRISE)
    ]
    if not denied:
        return identified
    clause = f"the recording contradicts what was known: {', '.join(denied)} was said"
    return identified.doubted("; ".join(filter(None, [clause, identified.reason])))


def with_inputs(
    identified: IdentifiedModel, given: Sequence[Recording], used: Sequence[Recording]
) -> IdentifiedModel:
    """The model with what its inputs add to its errors, the share of samples without them, and the
    range in which nine tenths of their samples are (`IdentifiedModel.recorded`).

    A factor on an input, unknown by its `error`, is one on every coefficient of a term with it, to
    the power of the input. given: recordings as they came; used: the stretches with inputs.
    """
    names = identified.model.inputs
    if not names:
        return identified
    reason = identified.reason.replace(GUSTS, "")
    if identified.status == "refused":
        return replace(identified, reason=reason)
    samples, kept = (sum(one.samples for one in each) for each in (given, used))
    about = {**identified.diagnostics, "without_inputs_share": 1.0 - kept / samples}
    places = np.argwhere(identified.support)
    at = tuple(places.T)
    added, sizes = np.zeros((len(places), len(places))), []
    for k, name in enumerate(names, start=len(identified.model.states)):
        error = max(one.inputs[name].error for one in used)
        values = np.concatenate([one.inputs[name](one.time) for one in used])
        ends = np.nanquantile(values, QUANTILES_90)
        sizes.append(float(np.sqrt(np.nanmean(values**2))))
        about |= {f"{name}{end}": float(own) for end, own in zip(RANGE, ends, strict=True)}
        power = np.array([identified.model.terms[j][k] for _, j in places], float)
        moved = error * power * identified.model.coefficients[at]
        moved[identified.standard_errors[at] == 0.0] = 0.0  # of those that are fixed
        added += np.outer(moved, moved)
    wider = {"covariance": identified.covariance + added} if len(identified.covariance) else {}
    for name in ("standard_errors", "unconditional_errors"):
        errors = np.array(getattr(identified, name))
        errors[at] = np.hypot(errors[at], np.sqrt(np.diag(added)))
        wider[name] = errors
    reason = "; ".join(filter(None, [reason, laws_untold(identified, sizes, about)]))
    return replace(identified, reason=reason, diagnostics=about, **wider)


def laws_untold(
    identified: IdentifiedModel, sizes: Sequence[float], about: Mapping[str, object]
) -> str:
    """One line on the linear terms whose change with the inputs the recordings hardly tell, with
    the ranges recorded, '' where there are none.

    Of such a term the same with another power of the inputs is absent, though it may be a quarter
    as large as those found: at other inputs they part. sizes: root mean square of each input.
    about: diagnostics, with the ranges.
    """
    model, n = identified.model, len(identified.model.states)
    of_states, of_inputs = np.hsplit(np.array(model.terms), [n])
    powers = np.prod(np.array(sizes) ** of_inputs, axis=1)
    found = np.where(identified.support, model.coefficients * powers, 0.0)
    unseen = np.where(identified.support, 0.0, np.nan_to_num(identified.detection_limits * powers))
    untold = []
    for k, state in enumerate(model.states):
        alike = np.all(of_states == np.eye(n)[k], axis=1)
        size, most = abs(found[:, alike]).sum(axis=1), unseen[:, alike].max(axis=1, initial=0.0)
        untold += [
            f"{state} in d({model.states[i]})/dt"
            for i in np.flatnonzero((size > 0.0) & (most > 0.25 * size))
        ]
    if not untold:
        return ""
    ranges = [
        f"{name} from {about[name + RANGE[0]]:.3g} to {about[name + RANGE[1]]:.3g}"
        for name in model.inputs
    ]
    return f"{' and '.join(ranges)} hardly tells how {', '.join(untold)} changes with it"


def open_questions(problem: Problem, whitened: Whitened, plausible: Plausible) -> str:
    """One line on why the terms found are not settled, '' where they are.

    They are not where the plausible supports without one of them weigh more than MOST_RIVAL_WEIGHT
    together, or where an absent term, or a pair, improves the fit more than noise does, yet less
    than selection asks.
    """
    share, told = _rival(problem, plausible)
    reasons = [f"the data cannot tell {told}; supports without a term found weigh {share:.2g}"]
    reasons = reasons if share > MOST_RIVAL_WEIGHT else []
    here = tableau(whitened, plausible.supports[0])
    alone = np.arange(len(here.out))[None]
    for places, falls in ((alone, here.additions()), (here.two, here.pairs())):
        # noise alone raises a doubt once in a thousand over all terms that could be added, and over
        # all pairs; with 0.005, 55 of 1,000 models were doubted for it alone, 5 wrong
        if len(falls) and falls.max() > chdtri(len(places), 0.001 / len(falls)):
            added = problem.named(here.out[places[:, np.argmax(falls)]])
            reasons.append(
                f"{added} is plausible, below the limit of selection (chi2 {-falls.max():+.1f})"
            )
    return "; ".join(reasons)


def is_simple(problem: Problem, support: np.ndarray) -> np.ndarray:
    """(n,) terms as simple as the simplest of their equation, or of the first degree: of those a
    reader of the equation would ask why they are not there.
    """
    degrees, equations = problem.degrees, problem.candidates[:, 0]
    simplest = [min(degrees[support & (equations == i)], default=1) for i in equations]
    return degrees <= np.maximum(simplest, 1)


def hidden_term(
    problem: Problem,
    support: np.ndarray,
    limits: np.ndarray,
    largest: np.ndarray,
    most: np.ndarray | float,
    words: str,
) -> str:
    """One line on the absent term that may be there unseen though it matters, '' where there is
    none.

    limits: (n,) of `detection_limits`, the prior counted. largest: (n,) as in `problem.largest`.
    most: (n,) share of its equation from which each may not go unseen. words: between the term and
    how much of its equation it may be.
    """
    share = np.where(support, 0.0, limits / np.maximum(largest, np.finfo(float).tiny))
    k = int(np.argmax(share / most))
    if share[k] < np.broadcast_to(most, len(share))[k]:
        return ""
    percent = f"{100.0 * share[k]:.0f} % of"
    much = percent if share[k] < 1.0 else "all of" if share[k] < 2.0 else "many times"
    return f"{problem.named([k])} {words} {much} its equation"


def _rival(problem: Problem, plausible: Plausible) -> tuple[float, str]:
    """What the supports without one of the terms found weigh together, and in words in what the
    heaviest of them differs.
    """
    support = plausible.supports[0]
    lacking = np.where(plausible.supports[:, support].all(axis=1), 0.0, plausible.weight)
    rival = int(np.argmax(lacking))
    other, rise = plausible.supports[rival], plausible.chi2[rival] - plausible.chi2[0]
    gone = problem.named(np.flatnonzero(support & ~other))
    instead = problem.named(np.flatnonzero(other & ~support)) or "nothing"
    return float(lacking.sum()), f"{gone} from {instead} (chi2 {rise:+.1f})"


def only_repeats(
    model: PolynomialModel, starts: np.ndarray, recordings: Sequence[Recording], period: float
) -> bool:
    """Whether all that was recorded is the same orbit again and again, as the model has it.

    Two tones without a common period come near to themselves once, but not at its multiples.
    starts: (n_recordings, n_states), the first state of each. period: the shortest of the motion,
    s. What inputs drive is no orbit, nor is what diverges.
    """
    return not model.inputs and all(
        _repeats(model, start, float(np.ptp(one.time)), period)
        for start, one in zip(starts, recordings, strict=True)
    )


def _repeats(model: PolynomialModel, start: np.ndarray, duration: float, period: float) -> bool:
    """Whether standardised states return to themselves over two thirds of the time.

    Sought is the delay, up to a third of the time, after which they differ least, beyond the first
    after which they differ less than a little earlier: among samples by a fifth of their size, at
    its best by a hundredth. What repeats over 500 periods goes on as it does.
    """
    samples = 60  # a period, each of at most 64 steps of the integration
    time = np.arange(0.0, min(duration, 500 * period), period / samples)
    try:
        most = 64 * (len(time) // samples + 1)
        states, _, _ = solution(model, (), start, time, period, most)
    except FloatingPointError:
        return False
    if not np.all(np.isfinite(states)):
        return False
    states = (states - states.mean(axis=0)) / np.fmax(states.std(axis=0), np.finfo(float).tiny)
    apart = _apart(states)
    falling = np.flatnonzero(np.diff(apart) < 0.0)
    if not len(falling):
        return False
    nearest = falling[0] + np.argmin(apart[falling[0] :])
    if apart[nearest] > 0.2:
        return False
    step, last = time[1] - time[0], time[-1]
    best = step * float(nearest)
    curve = CubicSpline(time, states)

    def differ(delay: float) -> float:
        kept = time[time <= last - delay]
        return float(np.sqrt(np.mean((curve(kept + delay) - states[: len(kept)]) ** 2)))

    for times in (1, int(last * 2 / 3 // best)):
        width = times * step
        best = minimize_scalar(
            differ, bounds=(times * best - width, times * best + width), method="bounded"
        ).x
    return differ(best) < 0.01


def _apart(states: np.ndarray) -> np.ndarray:
    """Root mean square by which states (n, n_states) differ from themselves n samples later, of n
    up to a third of all.
    """
    count, size = len(states), 2 * len(states)
    spectrum = np.fft.rfft(states, size, axis=0)
    products = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[: count // 3].sum(axis=1)
    squares = np.concatenate([[0.0], np.cumsum(np.sum(states**2, axis=1))])
    later = np.arange(count // 3)
    sums = squares[count - later] + squares[count] - squares[later] - 2.0 * products
    return np.sqrt(np.maximum(sums, 0.0) / (count - later) / states.shape[1])
