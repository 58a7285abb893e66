"""Identification problem in random forces, and initial models of the fit."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.no_model import (
    IdentificationError,
    NoModel,
    NotConvergedError,
    attempt,
)
from galloping.identification.oscillations import Resonance
from galloping.identification.preparation.channels import Channels
from galloping.identification.problem import Problem
from galloping.identification.random_forces.start import (
    ExtraModes,
    estimate_spectra,
    estimate_strengths,
    find_linear_systems,
    place_on_grids,
    shortest_velocity_period,
)
from galloping.identification.random_forces.tracking import (
    FilterResult,
    Forces,
    SampledChannels,
    StateSpaceModel,
    motion_sizes,
)
from galloping.identification.work import is_exhausted
from galloping.model.modes import Modes
from galloping.model.polynomial import design_matrix
from galloping.progress_reports import passing
from galloping.recording.samples import Recording, inputs_at_times, mean_inputs

# First decay rate of slow forces, 1/s, divided by the slowest modal frequency, rad/s.
SLOW_DECAY_RATIO = 0.3
# Least noise of a sample, relative to its channel. Exact samples have rounding.
MIN_RELATIVE_NOISE = 1e-4
MIN_STEADINESS = 0.5  # least ratio |mean| / root mean square of a term's steady input factor


@dataclass(frozen=True)
class ForcedModel:
    """Coefficients, random forces and measurement noise of a model.

    coefficients: (n_candidates,). root: (n_drives, n_drives) lower triangular, of the n_forced
    equations with a force and then of the resonances; root root' is the covariance of the white
    forces per second. noise: (n_channels,) standard deviation of a sample. slow: (n_forced,) roots
    of the variances per second of the white forces that drive slow forces. rates: (n_forced,) decay
    rates of these, 1/s. Both are empty without slow forces. extra_modes: the resonances.
    """

    coefficients: np.ndarray
    root: np.ndarray
    noise: np.ndarray
    slow: tuple[float, ...]
    rates: tuple[float, ...]
    extra_modes: ExtraModes


@dataclass(frozen=True)
class Innovations:
    """Innovations of all recordings: samples minus their predictions by the Kalman filter.

    parts: the filter over each recording, and then expectations of priors, as samples of
    coefficients; empty if the filter fails, for which `objection` gives the reason.
    """

    parts: tuple[FilterResult, ...]
    objection: Finding | None = None

    @cached_property
    def innovations(self) -> np.ndarray:
        """Innovations of all recordings and priors, in one array."""
        return np.concatenate([part.innovations for part in self.parts])

    @cached_property
    def variances(self) -> np.ndarray:
        """Variances of the innovations of all recordings and priors, in one array."""
        return np.concatenate([part.variances for part in self.parts])

    @cached_property
    def log_likelihood(self) -> float:
        """Log-likelihood except for a constant; minus infinity if the filter fails."""
        if self.objection:
            return -np.inf
        is_known = np.isfinite(self.innovations) & (self.variances > 0.0)
        if is_known.sum() < sum(part.count for part in self.parts):
            return -np.inf
        innovations, variances = self.innovations[is_known], self.variances[is_known]
        return -0.5 * float(np.sum(np.log(variances) + innovations**2 / variances))


@dataclass(frozen=True)
class ForcedProblem:
    """Problem of identifying equations from recordings of a motion under random forces.

    forced: indices of the equations that have a force. size: (n_states,) of the motion. unit:
    (n_candidates,) of the coefficients. required: (n_candidates,) terms of the linear equations,
    which every fit has, and terms with a prior. middle: (n_states,) of the motion. least_noise:
    (n_channels,) of a sample. input_means: means of the inputs.
    """

    problem: Problem
    channels: Channels
    forced: tuple[int, ...]
    size: np.ndarray
    unit: np.ndarray
    required: np.ndarray
    middle: np.ndarray
    least_noise: np.ndarray
    recordings: tuple[Recording, ...]
    input_means: Mapping[str, float]

    @cached_property
    def data(self) -> tuple[SampledChannels, ...]:
        """Samples of each recording, and the time steps between them."""
        return tuple(
            SampledChannels.from_recording(each, self.channels) for each in self.recordings
        )

    @property
    def penalty(self) -> float:
        """Penalty of a term on twice the log-likelihood: 2 ln N for N samples."""
        return 2.0 * np.log(sum(int(np.isfinite(one.samples).sum()) for one in self.data))

    def centring(self, support: np.ndarray) -> np.ndarray:
        """Compute the matrix that refers constant terms to the middle of the motion.

        Returns (n_support, n_support), for coefficients in their units. A constant becomes the
        residual of its equation in the middle of the motion: otherwise, if the motion is far from
        zero, the stiffness alone would determine a constant.
        """
        places, terms = np.flatnonzero(support), self.problem.state_exponents
        centring, equations = np.eye(len(places)), self.problem.candidates[places, 0]
        degrees = np.where(self.required, self.problem.degrees, -1)[places]
        for n in np.flatnonzero(degrees == 0):
            for m in np.flatnonzero((equations == equations[n]) & (degrees == 1)):
                value = self.middle @ terms[self.problem.candidates[places[m], 1]]
                centring[n, m] = value * self.unit[places[m]] / self.unit[places[n]]
        return centring

    def restrict(self, model: ForcedModel, support: np.ndarray) -> ForcedModel:
        """Remove terms from a model, with the states' rates unchanged in the middle of the motion.

        support: the terms that remain.
        """
        present = model.coefficients != 0.0
        scaled, coefficients = np.zeros((2, len(present)))
        scaled[present] = self.centring(present) @ (model.coefficients / self.unit)[present]
        uncentred = np.linalg.solve(self.centring(support), scaled[support])
        coefficients[support] = uncentred * self.unit[support]
        return replace(model, coefficients=coefficients)

    def state_space_model(self, model: ForcedModel) -> StateSpaceModel:
        """Convert a model to the state-space form that the Kalman filter uses."""
        problem, n = self.problem, len(self.size)
        white, slow = np.zeros((2, n, n))
        rates, drives = np.ones(n), model.root @ model.root.T
        white[np.ix_(self.forced, self.forced)] = drives[: len(self.forced), : len(self.forced)]
        if model.slow:
            slow[self.forced, self.forced] = np.square(model.slow)
            rates[list(self.forced)] = model.rates
        forces = Forces(white, slow, rates, self.resonances(model))
        full = problem.model(model.coefficients)
        return StateSpaceModel(
            full, forces, self.channels, model.noise, self.size, self.input_means
        )

    def resonances(
        self, model: ForcedModel, errors: np.ndarray | None = None
    ) -> tuple[Resonance, ...]:
        """Return the resonances of a model; errors: (n_resonances, 2), as in `Resonance`."""
        n, f, drives = len(self.size), len(self.forced), model.root @ model.root.T
        extra, resonances = model.extra_modes, []
        errors = np.full(extra.oscillators.shape, np.nan) if errors is None else errors
        for k, (frequency, damping) in enumerate(extra.oscillators.tolist()):
            onto, drive = np.zeros(n), np.zeros(n + len(extra.oscillators))
            onto[list(self.forced)], drive[list(self.forced)] = extra.onto[k], drives[f + k, :f]
            drive[n:] = drives[f + k, f:]
            deviations = float(errors[k, 0]), float(errors[k, 1])
            parts = deviations, tuple(onto.tolist()), tuple(drive.tolist())
            resonances.append(Resonance(frequency, damping, *parts))
        return tuple(resonances)

    def normal_equations(self, model: ForcedModel) -> tuple[np.ndarray, np.ndarray]:
        """Compute normal equations for changes of the coefficients from the innovations.

        The coefficients are in their units. Returns the information (n_candidates, n_candidates),
        and half the decrease of chi^2 with each, (n_candidates,), by the slopes of the innovations
        of a model. Raises FloatingPointError if the slopes diverge.
        """
        terms, places = np.unique(self.problem.candidates[:, 1], return_inverse=True)
        candidates = np.column_stack([self.problem.candidates[:, 0], places])
        system_model, n = self.state_space_model(model), len(self.unit)
        information, right = np.zeros((n, n)), np.zeros(n)
        for one in self.data:
            if is_exhausted():
                raise NotConvergedError(Finding.of(Code.LIMIT_OF_WORK))
            filtered, slopes = system_model.filter_extended(one, candidates, terms)
            is_known = np.isfinite(filtered.innovations) & (filtered.variances > 0.0)
            root = np.sqrt(filtered.variances[is_known])
            scaled = slopes[is_known] * self.unit / root[:, np.newaxis]
            with np.errstate(over="ignore", invalid="ignore"):
                information += scaled.T @ scaled
            right -= scaled.T @ (filtered.innovations[is_known] / root)
        if not np.all(np.isfinite(information)):
            raise FloatingPointError("the slopes of the innovations diverge")
        prior, prior_right = self.problem.prior_equations(model.coefficients)
        return information + prior * np.outer(self.unit, self.unit), right + prior_right * self.unit

    def filter_recordings(self, model: ForcedModel) -> Innovations:
        """Run the Kalman filter of a model over all recordings, and return the innovations."""
        system_model = self.state_space_model(model)
        parts = attempt(lambda: [system_model.filter(one) for one in self.data])
        if isinstance(parts, NoModel):
            return Innovations((), parts.findings[0])
        return Innovations((*parts, self._prior_samples(model)))

    def _prior_samples(self, model: ForcedModel) -> FilterResult:
        """Convert priors of coefficients to samples, relative to a model."""
        problem = self.problem
        mean, precision = map(problem.candidate_values, (problem.expected, problem.precision))
        priors, none = np.flatnonzero(precision), np.empty(0)
        error, variance = np.full((2, len(priors), len(self.channels.names)), np.nan)
        error[:, 0], variance[:, 0] = (mean - model.coefficients)[priors], 1.0 / precision[priors]
        return FilterResult(error, variance, none, none, none, len(priors))


def make_forced_problem(
    problem: Problem, recordings: list[Recording], forced: tuple[int, ...], n_further: int
) -> tuple[ForcedProblem, list[ForcedModel]]:
    """Set up a fit under random forces: the scaled problem, and initial guesses of the model.

    The likeliest initial guess is the first. Rates are modelled as measured at the sample or as
    means since the last one, whichever is likelier. Raises IdentificationError if there is no
    initial model.
    """
    passing("modes from correlations")
    channels = Channels.from_recordings(recordings)
    pairs = channels.pairs
    has_others = set(problem.unknown) - set(pairs.values()) or 2 * len(pairs) < len(problem.states)
    if has_others or (n_further and len(forced) < len(pairs)):
        raise IdentificationError(Code.FORCES_UNDETERMINED)
    step, grids = place_on_grids(recordings)
    period = shortest_velocity_period(recordings)
    factors = _input_factor_moments(problem, recordings)
    setup = _scaled_problem(problem, recordings, forced, period, factors)
    as_means = replace(setup, channels=replace(channels, averaged=True))
    kinds = [setup, as_means] if channels.rates else [setup]
    frequencies, power = estimate_spectra(grids, step)
    starts = []
    for system, extra_modes in find_linear_systems(channels, grids, step, period, n_further):
        free = _initial_coefficients(setup, system, factors)
        rate = SLOW_DECAY_RATIO * Modes.of(system).omega.min()
        for kind, slow in product(kinds, (None, rate)):
            white, driving, noise = estimate_strengths(
                system, extra_modes, forced, kind.channels, frequencies, power, slow
            )
            noise = np.maximum(np.sqrt(noise / step), 2.0 * kind.least_noise)
            model = ForcedModel(
                free, np.diag(np.sqrt(white)), noise, tuple(np.sqrt(driving)),
                (rate,) * len(driving), extra_modes,
            )  # fmt: skip
            likelihood = kind.filter_recordings(model).log_likelihood
            if np.isfinite(likelihood):
                starts.append((likelihood, kind, model))
    if not starts:
        raise IdentificationError(Code.NO_OSCILLATION)
    starts.sort(key=lambda start: -start[0])
    best = starts[0][1]
    return best, [model for _, kind, model in starts if kind is best]


def _scaled_problem(
    problem: Problem,
    recordings: list[Recording],
    forced: tuple[int, ...],
    period: float,
    factors: tuple[np.ndarray, np.ndarray],
) -> ForcedProblem:
    """Make the problem in units of the motion, with rates at the samples.

    period: s, the shortest of the motion. factors: as of `_input_factor_moments`.
    """
    channels, (means, rms) = Channels.from_recordings(recordings), factors
    size, mean, deviation = motion_sizes(recordings, channels, period)
    sizes = np.prod(size**problem.state_exponents, axis=1) * rms
    unit = np.array([2.0 * np.pi / period * size[i] / sizes[j] for i, j in problem.candidates])
    middle = np.zeros(len(problem.states))
    middle[list(channels.values)] = mean[: len(channels.values)]
    middle[list(channels.pairs.values())] = 0.0
    return ForcedProblem(
        problem, channels, forced, size, unit,
        _linear_candidates(problem, np.abs(means) > MIN_STEADINESS * rms), middle,
        MIN_RELATIVE_NOISE * deviation, tuple(recordings), mean_inputs(problem.inputs, recordings),
    )  # fmt: skip


def _initial_coefficients(
    setup: ForcedProblem, system: np.ndarray, factors: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Compute coefficients, (n_candidates,), of a linear system at the means of inputs.

    system: (n_states, n_states). factors: as of `_input_factor_moments`.
    """
    problem, powers, (means, rms) = setup.problem, setup.problem.state_exponents, factors
    has_same_states = np.all(powers[:, np.newaxis] == powers, axis=2)
    expected, known = problem.candidate_values(problem.expected), problem.known + problem.expected
    constant = -(system @ setup.middle)[:, np.newaxis]
    rows = np.where(powers.sum(axis=1) > 0, system @ powers.T, constant)
    rows = (rows - (means * known) @ has_same_states) / np.where(means == 0.0, rms, means)
    free = np.where(setup.required, problem.candidate_values(rows), 0.0)
    return np.where(problem.candidate_values(problem.precision) > 0.0, expected, free)


def _input_factor_moments(
    problem: Problem, recordings: list[Recording]
) -> tuple[np.ndarray, np.ndarray]:
    """Compute mean and root mean square, (n_terms,), of each term's input factor, 1 if none."""
    inputs = [inputs_at_times(tuple(each.inputs.values()), each.time) for each in recordings]
    of_inputs = tuple(term[len(problem.states) :] for term in problem.terms)
    factors = design_matrix(np.concatenate(inputs), of_inputs)
    return factors.mean(axis=0), np.sqrt(np.mean(factors**2, axis=0))


def _linear_candidates(problem: Problem, is_steady: np.ndarray) -> np.ndarray:
    """Find the terms, (n_candidates,), of the linear equations, and those with a prior.

    Of terms that differ only in their inputs, only the one with the lowest powers of steady inputs
    counts. is_steady: (n_terms,) whether the input factor of a term is steady.
    """
    required = problem.candidate_values(problem.precision) > 0.0
    simplest: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for k, (i, j) in enumerate(problem.candidates):
        if problem.degrees[k] <= 1 and is_steady[j]:
            powers = sum(map(abs, problem.terms[j][len(problem.states) :]))
            simplest.setdefault((i, *problem.state_exponents[j]), []).append((powers, k))
    required[[min(candidates)[1] for candidates in simplest.values()]] = True
    return required
