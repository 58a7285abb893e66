"""Fit of a model in random forces: initial model, selection of terms, status.

Terms are selected as usual, except that each forced coordinate keeps its stiffness and damping.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import NoModel, NoModelError, attempt
from galloping.identification.oscillations import MAX_DAMPING_RATIO
from galloping.identification.plausible import detection_limits
from galloping.identification.preparation.channels import Channels
from galloping.identification.preparation.rate_channels import with_scales
from galloping.identification.problem import Problem
from galloping.identification.random_forces.fitting import (
    ForcedFit,
    forces_are_correlated,
    forces_are_needed,
    maximise_likelihood,
)
from galloping.identification.random_forces.forced_problem import (
    SLOW_DECAY_RATIO,
    ForcedModel,
    ForcedProblem,
    make_forced_problem,
)
from galloping.identification.random_forces.start import shortest_velocity_period, typical_step
from galloping.identification.selection import added_deviation, select_support, solve_support
from galloping.identification.work import is_exhausted
from galloping.recording.samples import Recording

# Number of samples in a shortest period that a trial of random forces uses. With more a trial takes
# longer, with fewer noise hides more. With 8 and with 32 no answer of `make exam` changes.
SAMPLES_PER_PERIOD = 16
FALSE_COUPLING_RATE = 0.01  # rate at which uncoupled coordinates count as coupled
FIRST_FORCE_SHARE = 0.8  # initial guess of the share of its force that a mode has with another
START_PERIODS = 20.0  # length of samples from which a first state is estimated, in shortest periods


def fit_in_forces(
    problem: Problem,
    recordings: list[Recording],
    period: float,
    forced: tuple[int, ...],
    n_further: int,
    may_be_slow: bool,
    check: Callable[[ForcedFit], None],
) -> IdentifiedModel:
    """Fit a model under random forces to recordings, select its terms, and decide its status.

    The recordings have no outliers. period: s, the shortest of the motion. forced: indices of the
    equations with a force. n_further: number of modes beyond the coordinates. may_be_slow: whether
    forces may be slow; otherwise a model with white ones and clearly correlated innovations is
    refused. check: raises NoModelError for a fit that is not accepted. It is called with the fit to
    some of the samples, then with the fit to all. Raises one of NO_MODEL_ERRORS if there is none.
    """
    rescaled, scales = with_scales(recordings, period)
    trial = _fit_some_samples(problem, rescaled, forced, may_be_slow, n_further)
    check(trial)
    fit = _fit_all_samples(trial, rescaled)
    check(fit)
    return _assess_fit(fit, trial, period, scales)


def _fit_some_samples(
    problem: Problem,
    recordings: list[Recording],
    forced: tuple[int, ...],
    may_be_slow: bool,
    n_further: int,
) -> ForcedFit:
    """Fit all terms that may be needed, to no more samples than necessary."""
    setup, starts = make_forced_problem(problem, _thin_recordings(recordings), forced, n_further)
    white = [each for each in starts if not each.slow]
    white = white or [replace(starts[0], slow=(), rates=())]
    fit = _fit_from(setup, white[0])
    if problem.inputs:  # otherwise slow forces would imitate their effects
        fit = _with_further_terms(fit, white[0].noise)
    if n_further:
        if not fit.whiteness.may_be_random:
            raise NoModelError(fit.deviation)
        # from the first start alone, one fit in nine ends elsewhere
        others = [attempt(_fit_from, setup, start) for start in white[1:3]]
        fits = [each for each in (fit, *others) if not isinstance(each, NoModel)]
        fit = max(fits, key=lambda each: each.filtered.log_likelihood)
    channels = setup.channels
    reads_force = channels.averaged or not set(channels.rates) & set(forced)
    if not fit.whiteness.is_white and may_be_slow and reads_force:
        fit = _with_slow_forces(fit, starts[0])
    elif not (may_be_slow or fit.whiteness.may_be_random):
        raise NoModelError(fit.deviation)
    return _with_further_terms(fit, white[0].noise)


def _fit_from(setup: ForcedProblem, start: ForcedModel) -> ForcedFit:
    with np.errstate(all="ignore"):  # a start without a fit may overflow
        begin = _with_shared_forces(setup, start) if start.extra_modes.hosts else start
        return maximise_likelihood(setup, begin, setup.required, correlated=True)


def _with_shared_forces(setup: ForcedProblem, start: ForcedModel) -> ForcedModel:
    """Correlate the forces of a start's resonances with others as is likeliest, one by one.

    Starting from uncorrelated forces, a fit may exchange the damping of two close modes.
    """
    best, most = start, setup.filter_recordings(start).log_likelihood
    for i in range(len(setup.forced), len(start.root)):
        for j in range(i):
            base, size = best, np.linalg.norm(best.root[i])
            for share in (-FIRST_FORCE_SHARE, FIRST_FORCE_SHARE):
                root = base.root.copy()
                root[i, j] = share * size
                root[i] *= size / np.linalg.norm(root[i])
                trial = replace(base, root=root)
                likelihood = setup.filter_recordings(trial).log_likelihood
                if likelihood > most:
                    best, most = trial, likelihood
    return best


def _fit_all_samples(trial: ForcedFit, recordings: list[Recording]) -> ForcedFit:
    """Fit the selected terms to all samples."""
    penalty = trial.setup.penalty
    correlated = forces_are_correlated(trial, penalty)
    support = _select_terms(trial, penalty)
    setup = replace(trial.setup, recordings=tuple(recordings))
    fit = maximise_likelihood(setup, setup.restrict(trial.model, support), support, correlated)
    if not forces_are_needed(fit, penalty):
        raise NoModelError(Finding.of(Code.NO_FORCE_NEEDED))
    if np.any(np.abs(fit.modes.damping) > MAX_DAMPING_RATIO):
        raise NoModelError(Finding.of(Code.NO_OSCILLATION), fit.deviation)
    return fit


def _with_slow_forces(white: ForcedFit, start: ForcedModel) -> ForcedFit:
    """Add slow forces to the white ones, if they improve the fit by more than their penalty."""
    setup, slow = white.setup, start.slow
    if not slow or setup.problem.inputs:
        rate = SLOW_DECAY_RATIO * white.modes.omega.min()
        slow = tuple(rate * np.diag(white.model.root)[: len(setup.forced)])
        start = replace(white.model, slow=slow, rates=(rate,) * len(slow))
    fit = attempt(maximise_likelihood, setup, start, white.support, correlated=True)
    if isinstance(fit, NoModel):
        return white
    gain = fit.filtered.log_likelihood - white.filtered.log_likelihood
    return fit if 2.0 * gain > setup.penalty * 2 * len(fit.model.slow) else white


def _with_further_terms(fit: ForcedFit, noise: np.ndarray) -> ForcedFit:
    """Add nonlinear terms and those of inputs that improve the fit by more than their penalty.

    They are chosen by the slopes of the innovations, after each fit anew. noise: (n_channels,) of
    the start, the least with which a fit begins: with missing terms its estimate may be zero.
    """
    allowed = fit.support | ~fit.setup.required
    for _ in range(4):
        if is_exhausted():
            break
        refit = attempt(_with_chosen_terms, fit, allowed, noise)
        if refit is fit or isinstance(refit, NoModel):
            break
        fit = refit
    return fit


def _with_chosen_terms(fit: ForcedFit, is_allowed: np.ndarray, noise: np.ndarray) -> ForcedFit:
    """Select terms from those allowed, (n_candidates,), and fit them.

    The fit itself is returned if it has the selected terms. Some terms that the data alone hardly
    determine are kept too, so that intervals include them: the effect of inputs on the damping of a
    coordinate; and its cubic damping and stiffness, if any nonlinear term is selected, or if a
    motion grows, which nonlinear terms limit. The linear terms would otherwise replace these.
    """
    setup, problem, unit = fit.setup, fit.setup.problem, fit.setup.unit
    pairs = {velocity: [velocity, i] for i, velocity in setup.channels.pairs.items()}
    powers = [
        problem.state_exponents[j][pairs[i]] if i in pairs else (0, 0)
        for i, j in problem.candidates
    ]
    damping, stiffness = np.array(powers).T
    is_damping = (damping == 1) & (problem.degrees == 1)
    is_cubic = (np.maximum(damping, stiffness) == 3) & (problem.degrees == 3)
    penalties = np.where(setup.required, 0.0, problem.least_penalties(setup.penalty))
    information, right = fit.normal_equations
    coefficients, support = fit.model.coefficients / unit, is_allowed.copy()
    offset = problem.selection_offset(fit.model.coefficients) / unit
    support[is_allowed] = select_support(
        information[np.ix_(is_allowed, is_allowed)], right[is_allowed],
        [fit.support[is_allowed], np.ones(is_allowed.sum(), bool)], penalties[is_allowed],
        offset[is_allowed],
    )  # fmt: skip
    is_nonlinear = np.any(support & (problem.degrees > 1))
    support |= is_damping | (is_cubic & (is_nonlinear or np.any(fit.modes.damping < 0.0)))
    if np.array_equal(support, fit.support):
        return fit
    free, _ = solve_support(information, right + information @ coefficients, support)
    noise = np.maximum(fit.model.noise, noise)
    start = replace(fit.model, coefficients=free * unit, noise=noise)
    return maximise_likelihood(setup, start, support, correlated=True)


def _select_terms(fit: ForcedFit, penalty: float) -> np.ndarray:
    """Select the terms to keep, (n_candidates,).

    A coordinate's own stiffness and damping are kept, and a constant that reaches its penalty.
    Terms that couple two coordinates are kept or removed together: in coupled modes each term
    affects every damping, even a term that is hardly determined by itself.
    """
    setup, problem, support = fit.setup, fit.setup.problem, fit.support.copy()
    is_tested = support & setup.required & (problem.candidate_values(problem.precision) == 0.0)
    coordinate_of = {velocity: i for i, velocity in setup.channels.pairs.items()}
    groups: dict[tuple[int, ...], list[int]] = {}
    for k in np.flatnonzero(is_tested):
        equation, j = problem.candidates[k]
        state = next((s for s, e in enumerate(problem.state_exponents[j]) if e), None)
        if state is None:  # a constant is a group of its own
            coordinates: tuple[int, ...] = (coordinate_of[equation], -1)
        else:
            coordinates = tuple(sorted({coordinate_of[equation], coordinate_of.get(state, state)}))
        groups.setdefault(coordinates, []).append(int(k))
    positions = np.cumsum(support) - 1
    covariance = fit.coefficient_covariance
    free = fit.model.coefficients / setup.unit
    for coordinates, members in groups.items():
        if len(coordinates) == 1:
            continue
        rows, is_constant = positions[members], problem.degrees[members[0]] == 0
        square = free[members] @ np.linalg.solve(covariance[np.ix_(rows, rows)], free[members])
        if square < (penalty if is_constant else chdtri(len(members), FALSE_COUPLING_RATE)):
            support[members] = False
    return support


def _first_states(fit: ForcedFit, period: float) -> np.ndarray:
    """Estimate the states at the first samples, (n_recordings, n_states), from those after."""
    system_model, states = fit.setup.state_space_model(fit.model), []
    for one in fit.setup.data:
        lengths = one.steps.lengths[np.maximum(one.steps.index, 0)]
        count = int(np.searchsorted(np.cumsum(lengths), START_PERIODS * period))
        states.append(system_model.first_state(one, max(count, 2 * len(system_model.size))))
    return np.array(states)


def _assess_fit(
    fit: ForcedFit, trial: ForcedFit, period: float, scales: Mapping[str, float]
) -> IdentifiedModel:
    """Turn a fit under random forces into an `IdentifiedModel`, and decide its status.

    The status is `ok`, or `approximate` if the innovations are not white and that matters. trial:
    the fit of all terms to some samples, which determines the standard errors that absent terms
    would have. scales: of values that were in unknown units, by name.
    """
    information, _ = trial.normal_equations
    absent = added_deviation(information, fit.support) * fit.setup.unit
    absent[np.diag(information) == 0.0] = np.nan
    setup, support = fit.setup, fit.support
    problem, channels, recordings = setup.problem, setup.channels, setup.recordings
    model, whiteness = fit.model, fit.whiteness
    unit = setup.unit[support]
    errors = np.full(len(support), np.nan)
    errors[support] = np.sqrt(np.diag(fit.coefficient_covariance)) * unit
    covariance = problem.model_covariance(
        fit.coefficient_covariance * np.outer(unit, unit), support
    )
    is_measured = [np.isfinite(one.samples).any(axis=0) for one in setup.data]
    sigma, noise_of_rates = channels.noise_by_state(np.where(is_measured, model.noise, np.nan))
    forces = setup.state_space_model(model).forces
    resonances = setup.resonances(model, fit.resonance_errors)
    beside = [each.frequency / (2.0 * np.pi) for each in resonances if each.is_mode]
    findings = (
        Finding.of(Code.RANDOM_FORCES),
        *(Finding.of(Code.MODE_BESIDE, frequency_hz=hertz) for hertz in beside),
        *([fit.deviation] if whiteness.is_reported else []),
    )
    return IdentifiedModel(
        model=problem.model(model.coefficients),
        findings=findings,
        is_judged=True,
        standard_errors=problem.on_library(errors, 0.0),
        unconditional_errors=problem.on_library(np.where(support, errors, absent), 0.0),
        detection_limits=problem.on_library(detection_limits(absent, support, trial.setup.penalty)),
        covariance=covariance,
        known=problem.known_equations,
        initial_states=_first_states(fit, period),
        sigma=sigma,
        forces=forces.white,
        slow_forces=forces.slow,
        resonances=resonances,
        diagnostics={
            "duration": float(sum(np.ptp(each.time) for each in recordings)),
            **{f"slow_rate_{problem.states[i]}": forces.rates[i] for i in forces.slow_equations},
            "log_likelihood": fit.filtered.log_likelihood,
            "innovations": whiteness.statistic,
            "innovations_allowed": whiteness.allowed,
            "innovations_told": whiteness.predicted,
            "innovations_line": whiteness.peak,
            "innovations_line_allowed": whiteness.peak_allowed,
            **noise_of_rates,
            **({"rates_averaged": float(channels.averaged)} if channels.rates else {}),
            "path": "random forces",
            **scales,
        },
    )


def _thin_recordings(recordings: list[Recording]) -> list[Recording]:
    """Reduce the samples to those that a trial needs; keep all of rates, which may be means."""
    if Channels.from_recordings(recordings).rates:
        return recordings
    step = shortest_velocity_period(recordings) / SAMPLES_PER_PERIOD
    every = max(int(step / typical_step(recordings)), 1)
    return [each[::every] for each in recordings]
