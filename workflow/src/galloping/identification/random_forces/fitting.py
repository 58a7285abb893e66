"""Maximum likelihood of a system in white forces, by Fisher's scoring.

The likelihood is that of the innovations of the Kalman filter: exact for linear systems and any
sampling. Their derivatives are differences; the information is that of F. C. Schweppe
(IEEE Trans. Inf. Theory 11, 1965).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from galloping.identification.model import Resonance
from galloping.identification.problem import Problem
from galloping.identification.random_forces.channels import Channels
from galloping.identification.random_forces.tracking import Data, Filtered, Forces, Tracker
from galloping.identification.work import is_spent
from galloping.passes import passing

FIRST_STEP, STEP = 1e-5, 1e-3  # of differences: in units of a parameter, then of its error
CONVERGED = 1e-2  # rise of the log-likelihood that a step of the iteration promises
ROUNDING = 1e-9  # of a log-likelihood
MOST_STEPS, MOST_DAMPED = 40, 12
TINY = 0.1  # of the least noise, to which noise beside it may fall
UNTOLD = 1e-6  # information on a coefficient in its unit, below which the data say nothing of it
FAINTEST = -40.0  # logarithm of a root of covariance, below which it stays: zero has none
FAINT = 1e-3  # of the forces, as good as none
FIRST_DAMPING = 1e-4  # of the steps (K. Levenberg, 1944), in units of the information


@dataclass(frozen=True)
class Model:
    """coefficients: (n_candidates,). root: lower triangular, of the equations with a force and then
    of the resonances; root root' is the covariance of the white forces in a second. noise:
    (n_channels,) deviations of a sample. slow: (n_forced,) roots of the same of what drives slow
    forces, none where there are none; rates: (n_forced,) 1/s, of those. swings: (n_resonances, 2)
    frequencies, rad/s, and damping ratios. onto: (n_resonances, n_forced) what each adds to the
    equations with a force; hosts: (n_resonances,) those in which this is one.
    """

    coefficients: np.ndarray
    root: np.ndarray
    noise: np.ndarray
    slow: tuple[float, ...] = ()
    rates: tuple[float, ...] = ()
    swings: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    onto: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    hosts: tuple[int, ...] = ()

    @property
    def is_shared(self) -> np.ndarray:
        """(n_resonances, n_forced) where `onto` is not one by definition."""
        shared = np.ones(self.onto.shape, bool)
        shared[np.arange(len(self.hosts)), list(self.hosts)] = False
        return shared


@dataclass(frozen=True)
class Innovations:
    """innovations, variances: (n, n_channels) of the samples of all recordings, NaN where missing.
    parts: the filter over each recording, and what priors expect, as samples of coefficients.
    """

    parts: tuple[Filtered, ...]

    @cached_property
    def innovations(self) -> np.ndarray:
        return np.concatenate([part.innovations for part in self.parts])

    @cached_property
    def variances(self) -> np.ndarray:
        return np.concatenate([part.variances for part in self.parts])

    @cached_property
    def log_likelihood(self) -> float:
        """But for a constant; minus infinity where the filter fails, as by rounding."""
        known = np.isfinite(self.innovations) & (self.variances > 0.0)
        if known.sum() < sum(part.count for part in self.parts):
            return -np.inf
        innovations, variances = self.innovations[known], self.variances[known]
        return -0.5 * float(np.sum(np.log(variances) + innovations**2 / variances))

    @property
    def standardised(self) -> np.ndarray:
        return self.innovations / np.sqrt(self.variances)


@dataclass(frozen=True)
class Question:
    """What is asked of recordings.

    forced: indices of the equations that have a force. size: (n_states,) of the motion. unit:
    (n_candidates,) of the coefficients. always: (n_candidates,) those of the linear equations that
    every fit has, and those with a prior. middle: (n_states,) about which the motion is.
    least_noise: (n_channels,) of a sample. held: means of the inputs.
    """

    problem: Problem
    channels: Channels
    forced: tuple[int, ...]
    size: np.ndarray
    unit: np.ndarray
    always: np.ndarray
    middle: np.ndarray
    least_noise: np.ndarray
    data: tuple[Data, ...]
    held: Mapping[str, float]

    @property
    def penalty(self) -> float:
        """2 ln N of N samples."""
        return 2.0 * np.log(sum(int(np.isfinite(one.samples).sum()) for one in self.data))

    def centring(self, support: np.ndarray) -> np.ndarray:
        """(n_support, n_support) from coefficients in their units to those of which a constant is
        what is left of its equation, in the middle of the motion.

        Of a motion that is far from zero, a constant is otherwise told by the stiffness alone.
        """
        places, terms = np.flatnonzero(support), self.problem.of_states
        centring, equations = np.eye(len(places)), self.problem.candidates[places, 0]
        degrees = np.where(self.always, self.problem.degrees, -1)[places]
        for n in np.flatnonzero(degrees == 0):
            for m in np.flatnonzero((equations == equations[n]) & (degrees == 1)):
                at = self.middle @ terms[self.problem.candidates[places[m], 1]]
                centring[n, m] = at * self.unit[places[m]] / self.unit[places[n]]
        return centring

    def without(self, model: Model, support: np.ndarray) -> Model:
        """The model less what is not in the support, as it acts in the middle of the motion."""
        present = model.coefficients != 0.0
        scaled, kept = np.zeros((2, len(present)))
        scaled[present] = self.centring(present) @ (model.coefficients / self.unit)[present]
        own = np.linalg.solve(self.centring(support), scaled[support])
        kept[support] = own * self.unit[support]
        return replace(model, coefficients=kept)

    def tracker(self, model: Model) -> Tracker:
        """The filter of a model."""
        problem, n = self.problem, len(self.size)
        white, slow = np.zeros((2, n, n))
        rates, drives = np.ones(n), model.root @ model.root.T
        white[np.ix_(self.forced, self.forced)] = drives[: len(self.forced), : len(self.forced)]
        if model.slow:
            slow[self.forced, self.forced] = np.square(model.slow)
            rates[list(self.forced)] = model.rates
        forces = Forces(white, slow, rates, self.resonances(model))
        full = problem.model(model.coefficients)
        return Tracker(full, forces, self.channels, model.noise, self.size, self.held)

    def resonances(self, model: Model, errors: np.ndarray | None = None) -> tuple[Resonance, ...]:
        """errors: (n_resonances, 2), as `Resonance`."""
        n, f, drives = len(self.size), len(self.forced), model.root @ model.root.T
        errors = np.full(model.swings.shape, np.nan) if errors is None else errors
        found = []
        for k, swing in enumerate(model.swings):
            onto, drive = np.zeros(n), np.zeros(n + len(model.swings))
            onto[list(self.forced)], drive[list(self.forced)] = model.onto[k], drives[f + k, :f]
            drive[n:] = drives[f + k, f:]
            parts = (errors[k], onto, drive)
            found.append(Resonance(*map(float, swing), *(tuple(each.tolist()) for each in parts)))
        return tuple(found)

    def regression(self, model: Model) -> tuple[np.ndarray, np.ndarray]:
        """Information (n_candidates, n_candidates) on changes of the coefficients, in their units,
        and half the fall of chi^2 with each, by the slopes of the innovations of a model.

        Raises FloatingPointError where the slopes diverge.
        """
        terms, places = np.unique(self.problem.candidates[:, 1], return_inverse=True)
        candidates = np.column_stack([self.problem.candidates[:, 0], places])
        tracker, n = self.tracker(model), len(self.unit)
        known, right = np.zeros((n, n)), np.zeros(n)
        for one in self.data:
            if is_spent():
                raise FloatingPointError("the search ended at its limit of work")
            filtered, slopes = tracker.extended(one, candidates, terms)
            told = np.isfinite(filtered.innovations) & (filtered.variances > 0.0)
            root = np.sqrt(filtered.variances[told])
            own = slopes[told] * self.unit / root[:, np.newaxis]
            with np.errstate(over="ignore", invalid="ignore"):
                known += own.T @ own
            right -= own.T @ (filtered.innovations[told] / root)
        if not np.all(np.isfinite(known)):
            raise FloatingPointError("the slopes of the innovations diverge")
        prior, pull = self.problem.with_prior(np.zeros((n, n)), np.zeros(n), model.coefficients)
        return known + prior * np.outer(self.unit, self.unit), right + pull * self.unit

    def filtered(self, model: Model) -> Innovations:
        """Raises numpy.linalg.LinAlgError where the model cannot be discretised."""
        tracker = self.tracker(model)
        return Innovations((*(tracker.over(one) for one in self.data), *self._expected(model)))

    def _expected(self, model: Model) -> list[Filtered]:
        """What priors of coefficients expect beyond a model, as a sample each."""
        problem = self.problem
        mean, precision = map(problem.of_candidates, (problem.expected, problem.precision))
        told, none = np.flatnonzero(precision), np.empty(0)
        error, variance = np.full((2, len(told), len(self.channels.names)), np.nan)
        error[:, 0], variance[:, 0] = (mean - model.coefficients)[told], 1.0 / precision[told]
        return [Filtered(error, variance, none, none, none, len(told))] if len(told) else []


@dataclass(frozen=True)
class Fit:
    """The most likely model of its terms.

    support: (n_candidates,) those that were free. filtered: with it. slopes: derivatives of the
    standardised innovations, and of half the logarithms of their variances times the root of two,
    (n_parameters, 2, n_samples): of the centred coefficients of the support, of the forces and of
    the noise. centring: as of `Question`.
    """

    model: Model
    support: np.ndarray
    filtered: Innovations
    slopes: np.ndarray
    centring: np.ndarray

    @cached_property
    def swing_errors(self) -> np.ndarray:
        """(n_resonances, 2) standard errors of the frequencies, rad/s, and damping ratios."""
        swings = self.model.swings
        first = len(self.slopes) - swings.size - self.model.is_shared.sum() - len(self.model.noise)
        own = slice(first, first + swings.size)  # logarithms
        variances = np.diag(np.linalg.inv(information(self.slopes)))[own]
        return swings * np.sqrt(variances).reshape(swings.shape)

    @property
    def coefficient_covariance(self) -> np.ndarray:
        """(n_support, n_support) in units of the coefficients."""
        k, away = len(self.centring), np.linalg.inv(self.centring)
        return away @ np.linalg.inv(information(self.slopes))[:k, :k] @ away.T


def information(slopes: np.ndarray) -> np.ndarray:
    """(n_parameters, n_parameters); one on parameters of which the data say nothing, such as the
    noise of exact samples.
    """
    flat = slopes.reshape(len(slopes), -1)
    known = flat @ flat.T
    known[np.diag_indices_from(known)] += np.where(np.diag(known) > UNTOLD, 0.0, 1.0)
    return known


def score(slopes: np.ndarray, filtered: Innovations) -> np.ndarray:
    """Derivative of the log-likelihood."""
    error = filtered.standardised
    error = error[np.isfinite(error)]
    left = np.concatenate([-error, (error**2 - 1.0) / np.sqrt(2.0)])
    return slopes.reshape(len(slopes), -1) @ left


@dataclass(frozen=True)
class _Parameters:
    """Between models and vectors of parameters."""

    question: Question
    support: np.ndarray
    correlated: bool
    start: Model

    @cached_property
    def centring(self) -> np.ndarray:
        return self.question.centring(self.support)

    def vector(self, model: Model) -> np.ndarray:
        scaled = self.centring @ (model.coefficients / self.question.unit)[self.support]
        diagonal = np.diag(model.root)
        lower = np.tril_indices(len(diagonal), -1)
        mixed = (model.root / diagonal)[lower] if self.correlated else []
        slow = np.log([*model.slow, *model.rates])
        least = self.question.least_noise
        noise = np.sqrt(np.maximum(model.noise**2 - least**2, (TINY * least) ** 2))
        swings, shared = np.log(model.swings).ravel(), model.onto[model.is_shared]
        return np.concatenate(
            [scaled, np.log(diagonal), mixed, slow, swings, shared, np.log(noise)]
        )

    def model(self, vector: np.ndarray) -> Model:
        start, onto = self.start, self.start.onto.copy()
        root, shared = np.eye(len(start.root)), start.is_shared
        lower = np.tril_indices(len(root), -1 if self.correlated else -len(root))
        counts = [
            self.support.sum(), len(root), len(lower[0]), 2 * len(start.slow), start.swings.size,
            shared.sum(),
        ]  # fmt: skip
        scaled, diagonal, mixed, slow, swings, onto[shared], noise = np.split(
            vector, np.cumsum(counts)
        )
        coefficients = np.zeros(len(self.support))
        scaled = np.linalg.solve(self.centring, scaled)
        coefficients[self.support] = scaled * self.question.unit[self.support]
        root[lower] = mixed
        noise = np.hypot(np.exp(noise), self.question.least_noise)
        slow, rates = np.exp(np.maximum(slow, FAINTEST)).reshape(2, -1)
        root = root * np.exp(np.maximum(diagonal, FAINTEST))
        return Model(
            coefficients, root, noise, tuple(slow), tuple(rates),
            np.exp(swings).reshape(-1, 2), onto, start.hosts,
        )  # fmt: skip


def fitted(question: Question, model: Model, support: np.ndarray, correlated: bool = False) -> Fit:
    """The most likely model of the terms `support` (n_candidates,), from one near it.

    correlated: whether the forces of two equations may be. Terms of which the data say
    nothing are left out. Raises FloatingPointError or numpy.linalg.LinAlgError where the start
    cannot be followed.
    """
    parameters = _Parameters(question, support, correlated, model)

    def of(vector: np.ndarray) -> Innovations:
        return question.filtered(parameters.model(vector))

    vector = parameters.vector(model)
    step = np.full(len(vector), FIRST_STEP)
    here, damping = of(vector), FIRST_DAMPING
    if not np.isfinite(here.log_likelihood):
        raise FloatingPointError("the filter of its start loses all digits")
    slopes = _slopes(of, vector, here, step)
    first = slopes[: int(support.sum())]
    told = np.einsum("ijk,ijk->i", first, first) > UNTOLD
    if not told.all():  # such as the position of rest by accelerations
        kept = support.copy()
        kept[support] = told
        return fitted(question, model, kept, correlated)
    for _ in range(MOST_STEPS):
        passing("fit random forces")
        known, rise = information(slopes), score(slopes, here)
        step = STEP / np.sqrt(np.diag(known))
        for _ in range(MOST_DAMPED):
            change = np.linalg.solve(known + damping * np.diag(np.diag(known)), rise)
            try:
                with np.errstate(all="ignore"):  # a step that is too long is halved
                    tried = of(vector + change)
                    better = tried.log_likelihood >= here.log_likelihood - ROUNDING
            except np.linalg.LinAlgError:
                better = False
            if better:
                break
            damping *= 8.0
        else:
            slopes = _slopes(of, vector, here, step)
            break
        vector, here, damping = vector + change, tried, max(damping / 16.0, 1e-9)
        slopes = _slopes(of, vector, here, step)
        if 0.5 * rise @ change < CONVERGED or is_spent():
            break
    return Fit(parameters.model(vector), support, here, slopes, parameters.centring)


def _slopes(
    of: Callable[[np.ndarray], Innovations], vector: np.ndarray, here: Innovations, step: np.ndarray
) -> np.ndarray:
    known = np.isfinite(here.innovations)
    root = np.sqrt(here.variances[known])
    slopes = np.empty((len(vector), 2, len(root)))
    for j, h in enumerate(step):
        unit = np.zeros(len(vector))
        unit[j] = h
        moved = of(vector + unit)
        with np.errstate(all="ignore"):  # of a variance that is none
            slopes[j, 0] = (moved.innovations - here.innovations)[known] / h / root
            slopes[j, 1] = np.log(moved.variances[known] / here.variances[known]) / h / np.sqrt(2.0)
    if not np.isfinite(slopes).all():
        raise FloatingPointError("the likelihood has no slope where the filter loses all digits")
    return slopes


def forces_are_needed(question: Question, fit: Fit, penalty: float) -> bool:
    """Whether a model without its forces follows the samples less well than noise explains."""
    model = fit.model
    still = replace(model, root=FAINT * model.root, slow=tuple(FAINT * np.array(model.slow)))
    lost = fit.filtered.log_likelihood - question.filtered(still).log_likelihood
    return bool(2.0 * lost > penalty * (model.root.size + len(model.slow)))


def forces_are_correlated(fit: Fit, penalty: float) -> bool:
    """Whether the forces are, by the Wald statistic of what they share."""
    if fit.model.hosts:  # a mode beside those of the coordinates is moved by the same forces
        return True
    root = fit.model.root
    shares = (root / np.diag(root))[np.tril_indices(len(root), -1)]
    if not len(shares):
        return False
    first = int(fit.support.sum()) + len(root)
    own = slice(first, first + len(shares))
    covariance = np.linalg.inv(information(fit.slopes))[own, own]
    return bool(shares @ np.linalg.solve(covariance, shares) > penalty * len(shares))
