"""The model in random forces of recordings, from its start to its terms and to what it leaves.

Terms are chosen as ever, but that of every forced coordinate its own stiffness and damping stay.
"""

from contextlib import suppress
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.special import chdtri

from galloping.identification.answers import by
from galloping.identification.model import MOST_DAMPING, NO_MODEL, IdentifiedModel, Unusable
from galloping.identification.plausible import detection_limits
from galloping.identification.problem import Problem
from galloping.identification.random_forces.channels import Channels
from galloping.identification.random_forces.fitting import (
    Fit,
    Model,
    Question,
    fitted,
    forces_are_correlated,
    forces_are_needed,
)
from galloping.identification.random_forces.start import (
    on_grid,
    on_grids,
    shortest,
    spectra,
    strengths,
    systems,
)
from galloping.identification.random_forces.tracking import Data, sizes
from galloping.identification.random_forces.whiteness import Whiteness, function_of, whiteness
from galloping.identification.selection import added_deviation, select, solve_support
from galloping.identification.work import is_spent
from galloping.passes import passing
from galloping.polynomial import design_matrix, velocity_pairs
from galloping.recording import Recording, at_times, mean_inputs

SLOW = 0.3  # rate of slow forces to begin with, in the slowest frequency of the modes, rad/s
TRIED_PER_PERIOD = 16  # samples a shortest period, at which it is tried whether forces are random
COUPLED_RATE = 0.01  # of uncoupled coordinates that are taken for coupled ones
LEAST_NOISE = 1e-4  # deviation of a sample, in that of its channel: exact samples have rounding
STARTS = 3  # of modes beside those of the coordinates: from the first, one in nine ends elsewhere
SHARED = 0.8  # of a force, which others have, in starts
MOST_CHOICES = 4  # of nonlinear terms, each after a fit of the last
START_PERIODS = 20.0  # shortest periods, over which the first state is told
STEADY = 0.5  # mean of a factor of inputs, in its root mean square, from which it is mostly that


def fitted_to_some(
    problem: Problem,
    recordings: list[Recording],
    forced: tuple[int, ...],
    may_be_slow: bool = True,
    besides: int = 0,
) -> tuple[Question, Fit, Whiteness]:
    """The question, the fit of all terms that may stay, to no more samples than it needs, and what
    it leaves.

    recordings: without outliers. may_be_slow: whether forces may be; else a model with white ones
    that leaves plainly more than noise is none. besides: how many modes there are more than
    coordinates.
    Raises what NO_MODEL names where there is none.
    """
    recordings = _thinned(recordings)
    question, starts = _begun(problem, recordings, forced, besides)
    channels = question.channels
    white = [each for each in starts if not each.slow]
    white = white or [replace(starts[0], slow=(), rates=())]
    whole = _likeliest(question, white[:1])
    if problem.inputs:  # what they bring is no slow force
        whole = _with_further_terms(question, whole, white[0].noise)
    left = _left(question, whole, recordings)
    if besides:
        if not left.nearly:
            raise Unusable(left.in_words(channels.names))
        whole = _likeliest(question, white[1:STARTS], whole)
        left = _left(question, whole, recordings)
    reads_force = channels.averaged or not set(channels.rates) & set(forced)
    if not left.white and may_be_slow and reads_force:
        whole = _with_slow_forces(question, starts[0], whole)
    elif not (may_be_slow or left.nearly):
        raise Unusable(left.in_words(channels.names))
    whole = _with_further_terms(question, whole, white[0].noise)
    return question, whole, _left(question, whole, recordings)


def _likeliest(question: Question, starts: list[Model], known: Fit | None = None) -> Fit:
    """The likeliest of a fit that is known already and those from some starts."""
    fits, objection = [known] if known else [], None
    for start in starts:
        try:
            with np.errstate(all="ignore"):  # one that leads nowhere overflows
                begin = _with_shared_forces(question, start) if start.hosts else start
                fits.append(fitted(question, begin, question.always, correlated=True))
        except NO_MODEL as error:
            objection = error
    if not fits:
        raise objection
    return max(fits, key=lambda fit: fit.filtered.log_likelihood)


def _with_shared_forces(question: Question, start: Model) -> Model:
    """A start whose resonances share their forces with others as is likeliest, one after the other.

    From forces that share nothing a fit may end where two close modes have each other's damping.
    """
    best, most = start, question.filtered(start).log_likelihood
    for i in range(len(question.forced), len(start.root)):
        for j in range(i):
            held, size = best, np.linalg.norm(best.root[i])
            for share in (-SHARED, SHARED):
                root = held.root.copy()
                root[i, j] = share * size
                root[i] *= size / np.linalg.norm(root[i])
                tried = replace(held, root=root)
                likelihood = question.filtered(tried).log_likelihood
                if likelihood > most:
                    best, most = tried, likelihood
    return best


def fitted_to_all(
    question: Question, whole: Fit, recordings: list[Recording], period: float
) -> tuple[IdentifiedModel, Whiteness]:
    """The model of all samples from the fit of some, and what it leaves.

    Raises what NO_MODEL names where there is none.
    """
    channels, penalty = question.channels, question.penalty
    known, _ = question.regression(whole.model)
    correlated = forces_are_correlated(whole, penalty)
    support = _chosen(question, whole, penalty)
    question = replace(question, data=_data(recordings, channels))
    fit = fitted(question, question.without(whole.model, support), support, correlated)
    left = _left(question, fit, recordings)
    values = np.linalg.eigvals(question.tracker(fit.model).system)
    if not forces_are_needed(question, fit, penalty):
        raise Unusable("no random force is needed: a motion from its first state explains as much")
    if np.any(np.abs(values.real) > MOST_DAMPING * np.abs(values)):
        raise Unusable(f"no oscillations in random forces: {left.in_words(channels.names)}")
    return _identified(question, fit, recordings, period, known, penalty, left), left


def _begun(
    problem: Problem, recordings: list[Recording], forced: tuple[int, ...], besides: int
) -> tuple[Question, list[Model]]:
    """The question in units of the motion, and starts, the likeliest first.

    Of rates that are measured at the sample or as means since the last one, what is likelier.
    """
    passing("modes from correlations")
    channels = Channels.of(recordings)
    pairs = channels.pairs
    if set(problem.unknown) - set(pairs.values()) or 2 * len(pairs) < len(problem.states):
        raise Unusable("random forces are told of coordinates X and their velocities dX only")
    if besides and len(forced) < len(pairs):
        raise Unusable("modes beside those of the coordinates are moved by forces in all equations")
    step, grids = on_grids(recordings)
    period = shortest(grids, step)
    size, mean, deviation = sizes(recordings, channels, period)
    omega, powers = 2.0 * np.pi / period, problem.of_states
    about, largest = _factors(problem, recordings)
    moved = np.prod(size**powers, axis=1) * largest
    unit = np.array([omega * size[i] / moved[j] for i, j in problem.candidates])
    always = _always(problem, np.abs(about) > STEADY * largest)
    middle = np.zeros(len(problem.states))
    middle[list(channels.values)] = mean[: len(channels.values)]
    middle[list(pairs.values())] = 0.0
    least = LEAST_NOISE * deviation
    held = mean_inputs(problem.inputs, recordings)
    questions = [
        Question(problem, kind, forced, size, unit, always, middle, least,
                 _data(recordings, kind), held)
        for kind in (channels, *([replace(channels, averaged=True)] if channels.rates else []))
    ]  # fmt: skip
    frequencies, power = spectra(grids, step)
    alike = np.all(powers[:, np.newaxis] == powers, axis=2)
    expected, known = problem.of_candidates(problem.expected), problem.known + problem.expected
    found = []
    for begin in systems(channels, grids, step, period, besides):
        system = begin.system
        constant = -(system @ middle)[:, np.newaxis]
        rows = np.where(powers.sum(axis=1) > 0, system @ powers.T, constant)
        rows = (rows - (about * known) @ alike) / np.where(about == 0.0, largest, about)
        free = np.where(always, problem.of_candidates(rows), 0.0)
        free = np.where(problem.of_candidates(problem.precision) > 0.0, expected, free)
        rate = SLOW * np.min(np.abs(np.linalg.eigvals(system)))
        for question, slow in product(questions, (None, rate)):
            own = question.channels
            white, driving, noise = strengths(begin, forced, own, frequencies, power, slow)
            noise = np.maximum(np.sqrt(noise / step), 2.0 * least)
            slowly = tuple(np.sqrt(driving))
            model = Model(
                free, np.diag(np.sqrt(white)), noise, slowly, (rate,) * len(slowly), begin.swings,
                begin.onto, begin.hosts,
            )  # fmt: skip
            with suppress(np.linalg.LinAlgError):
                found.append((question.filtered(model).log_likelihood, question, model))
    found = sorted(filter(lambda each: np.isfinite(each[0]), found), key=lambda each: -each[0])
    if not found:
        raise Unusable("its correlations tell no oscillation of every coordinate")
    best = found[0][1]
    return best, [model for _, question, model in found if question is best]


def _factors(problem: Problem, recordings: list[Recording]) -> tuple[np.ndarray, np.ndarray]:
    """(n_terms,) mean and root mean square of what inputs bring to each term, 1 if nothing."""
    own = [at_times(tuple(each.inputs.values()), each.time) for each in recordings]
    of_inputs = tuple(term[len(problem.states) :] for term in problem.terms)
    factors = design_matrix(np.concatenate(own), of_inputs)
    return factors.mean(axis=0), np.sqrt(np.mean(factors**2, axis=0))


def _always(problem: Problem, steady: np.ndarray) -> np.ndarray:
    """(n_candidates,) those of the linear equations, and those with a prior.

    Of terms that differ in their inputs alone, the one of the lowest powers of those that are
    mostly there: steady, (n_terms,).
    """
    always, simplest = problem.of_candidates(problem.precision) > 0.0, {}
    for k, (i, j) in enumerate(problem.candidates):
        if problem.degrees[k] <= 1 and steady[j]:
            powers = sum(map(abs, problem.terms[j][len(problem.states) :]))
            simplest.setdefault((i, *problem.of_states[j]), []).append((powers, k))
    always[[min(alike)[1] for alike in simplest.values()]] = True
    return always


def _data(recordings: list[Recording], channels: Channels) -> tuple[Data, ...]:
    return tuple(Data.of(each, channels) for each in recordings)


def _with_slow_forces(question: Question, start: Model, white: Fit) -> Fit:
    """The fit with slow forces beside the white ones, where they pay."""
    slow = start.slow
    if not slow or question.problem.inputs:
        rate = SLOW * np.min(np.abs(np.linalg.eigvals(question.tracker(white.model).system)))
        slow = tuple(rate * np.diag(white.model.root)[: len(question.forced)])
        start = replace(white.model, slow=slow, rates=(rate,) * len(slow))
    try:
        fit = fitted(question, start, white.support, correlated=True)
    except (FloatingPointError, np.linalg.LinAlgError):
        return white
    gain = fit.filtered.log_likelihood - white.filtered.log_likelihood
    return fit if 2.0 * gain > question.penalty * 2 * len(fit.model.slow) else white


def _with_further_terms(question: Question, fit: Fit, noise: np.ndarray) -> Fit:
    """The fit with the terms that pay, nonlinear ones and those of inputs.

    They are chosen on the slopes of the innovations, again after each fit of those that were. What
    the data alone hardly tell stays too, so that intervals hold it: what inputs do to the damping
    of a coordinate, and, where the motion is so large that any nonlinear term pays, its cubic
    damping and stiffness, for the linear ones would take their place. noise: (n_channels,) of the
    start, from which each fit begins again: terms that were missing may have left none.
    """
    problem, always = question.problem, question.always
    pairs = {velocity: [velocity, i] for i, velocity in velocity_pairs(problem.states).items()}
    powers = [
        problem.of_states[j][pairs[i]] if i in pairs else (0, 0) for i, j in problem.candidates
    ]
    damping, stiffness = np.array(powers).T
    damped = (damping == 1) & (problem.degrees == 1)
    cubic = (np.maximum(damping, stiffness) == 3) & (problem.degrees == 3)
    allowed = fit.support | ~always
    prices = np.where(always, 0.0, problem.costs(question.penalty))
    every = np.ones(allowed.sum(), bool)
    for _ in range(MOST_CHOICES):
        if is_spent():
            break
        try:
            known, right = question.regression(fit.model)
            about, support = fit.model.coefficients / question.unit, allowed.copy()
            apart = problem.chosen_about(fit.model.coefficients) / question.unit
            support[allowed] = select(
                known[np.ix_(allowed, allowed)], right[allowed], [fit.support[allowed], every],
                prices[allowed], apart[allowed],
            )  # fmt: skip
            large = np.any(support & (problem.degrees > 1))
            support |= damped | (cubic & large)
            if np.array_equal(support, fit.support):
                break
            scaled, _ = solve_support(known, right + known @ about, support)
            start = replace(
                fit.model, coefficients=scaled * question.unit,
                noise=np.maximum(fit.model.noise, noise),
            )  # fmt: skip
            fit = fitted(question, start, support, correlated=True)
        except (FloatingPointError, np.linalg.LinAlgError):
            break
    return fit


def _chosen(question: Question, fit: Fit, penalty: float) -> np.ndarray:
    """(n_candidates,) the terms that stay.

    A coordinate's own stiffness and damping do, and a constant that pays. What couples two
    coordinates stays or goes together: of coupled modes each term bears on every damping, also one
    that by itself is hardly told.
    """
    problem, support = question.problem, fit.support.copy()
    judged = support & question.always & (problem.of_candidates(problem.precision) == 0.0)
    own = {velocity: i for i, velocity in velocity_pairs(problem.states).items()}
    groups: dict[tuple[int, ...], list[int]] = {}
    for k in np.flatnonzero(judged):
        equation, j = problem.candidates[k]
        moved = next((s for s, e in enumerate(problem.of_states[j]) if e), None)
        of = sorted({own[equation], own.get(moved, moved)} - {None})
        groups.setdefault((*of, k) if moved is None else tuple(of), []).append(k)
    place = np.cumsum(support) - 1
    covariance = fit.coefficient_covariance
    scaled = fit.model.coefficients / question.unit
    for of, members in groups.items():
        constant = problem.degrees[members[0]] == 0
        if len(of) == 1 and not constant:
            continue
        at = place[members]
        square = scaled[members] @ np.linalg.solve(covariance[np.ix_(at, at)], scaled[members])
        if square < (penalty if constant else chdtri(len(members), COUPLED_RATE)):
            support[members] = False
    return support


def _left(question: Question, fit: Fit, recordings: list[Recording]) -> Whiteness:
    """What the innovations say."""
    error, grids, first = fit.filtered.standardised, [], 0
    step = float(np.median(np.concatenate([np.diff(each.time) for each in recordings])))
    for each in recordings:
        own = error[first : first + len(each.time)].copy()
        own[: 2 * len(question.size)] = np.nan  # while the first state is found
        grids.append(on_grid(each.time, own, step))
        first += len(each.time)
    modes = np.abs(np.linalg.eigvals(question.tracker(fit.model).system))
    left = whiteness(grids, step, modes / (2.0 * np.pi))
    if not (names := question.problem.inputs):
        return left
    errors, before = [], []
    for part, each in zip(fit.filtered.parts, recordings, strict=False):  # priors are parts, too
        inputs = at_times([each.inputs[name] for name in names], each.time)
        begin = 2 * len(question.size)
        errors.append((part.innovations / np.sqrt(part.variances))[begin + 1 :])
        before.append(np.hstack([part.means, inputs])[begin:-1])
    k = function_of(np.concatenate(errors), np.concatenate(before))
    return left if k is None else replace(left, goes_with=question.problem.names[k])


def _identified(
    question: Question,
    fit: Fit,
    recordings: list[Recording],
    period: float,
    known: np.ndarray,
    penalty: float,
    left: Whiteness,
) -> IdentifiedModel:
    problem, channels, support = question.problem, question.channels, fit.support
    unit = question.unit[support]
    covariance = problem.of_model(fit.coefficient_covariance * np.outer(unit, unit), support)
    errors = np.full(len(support), np.nan)
    errors[support] = np.sqrt(np.diag(fit.coefficient_covariance)) * unit
    absent = added_deviation(known, support) * question.unit
    absent[np.diag(known) == 0.0] = np.nan
    sigma = np.full((len(recordings), len(problem.states)), np.nan)
    for c, i in enumerate(channels.values):
        there = [np.isfinite(one.samples[:, c]).any() for one in question.data]
        sigma[there, i] = fit.model.noise[c]
    of_rates = list(zip(channels.names, fit.model.noise, strict=True))[len(channels.values) :]
    forces = question.tracker(fit.model).forces
    resonances = question.resonances(fit.model, fit.swing_errors)
    beside = ", ".join(each.name for each in resonances if each.is_mode)
    beside = f"; {beside} beside those of the coordinates" if beside else ""
    said = "" if left.white else f"; {left.in_words(channels.names)}"
    status = "approximate" if said and left.relevant else "ok"
    found = IdentifiedModel(
        model=problem.model(fit.model.coefficients),
        status=status,
        reason=f"moved by random forces{beside}{said}",
        standard_errors=problem.on_library(errors, 0.0),
        unconditional_errors=problem.on_library(np.where(support, errors, absent), 0.0),
        detection_limits=problem.on_library(detection_limits(absent, support, penalty)),
        covariance=covariance,
        known=problem.known_equations,
        initial_states=_first_states(question, fit.model, period),
        sigma=sigma,
        forces=forces.white,
        slow_forces=forces.slow,
        resonances=resonances,
        diagnostics={
            "duration": float(sum(np.ptp(each.time) for each in recordings)),
            **{f"slow_rate_{problem.states[i]}": forces.rates[i] for i in forces.places},
            "log_likelihood": fit.filtered.log_likelihood,
            "innovations": left.statistic,
            "innovations_allowed": left.allowed,
            "innovations_told": left.told,
            "innovations_line": left.peak,
            "innovations_line_allowed": left.peak_allowed,
            **{f"noise_{name}": float(value) for name, value in of_rates},
            **({"rates_averaged": float(channels.averaged)} if channels.rates else {}),
        },
    )  # fmt: skip
    return by(["random forces"], found)


def _first_states(question: Question, model: Model, period: float) -> np.ndarray:
    """(n_recordings, n_states) at the first samples, from START_PERIODS after them."""
    tracker, found = question.tracker(model), []
    for one in question.data:
        lengths = one.steps.lengths[np.maximum(one.steps.of, 0)]
        count = int(np.searchsorted(np.cumsum(lengths), START_PERIODS * period))
        found.append(tracker.first_state(one, max(count, 2 * len(question.size))))
    return np.array(found)


def _thinned(recordings: list[Recording]) -> list[Recording]:
    """With no more samples than a trial needs; all of rates, which may be means between them."""
    if Channels.of(recordings).rates:
        return recordings
    step, grids = on_grids(recordings)
    every = max(int(shortest(grids, step) / TRIED_PER_PERIOD / step), 1)
    return [each[::every] for each in recordings]
