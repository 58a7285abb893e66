"""Maximum likelihood of a system in white forces, by Fisher scoring.

The likelihood is that of the innovations of the Kalman filter: exact for linear systems and any
sampling. Their derivatives are differences; the information is that of F. C. Schweppe
(IEEE Trans. Inf. Theory 11, 1965).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from galloping.identification.findings import Finding
from galloping.identification.no_model import NotConvergedError
from galloping.identification.random_forces.forced_problem import (
    ForcedModel,
    ForcedProblem,
    Innovations,
)
from galloping.identification.random_forces.start import place_on_grid, typical_step
from galloping.identification.random_forces.whiteness import (
    Whiteness,
    assess_whiteness,
    find_dependence,
)
from galloping.identification.work import is_exhausted
from galloping.model.intervals import ERROR_STEP
from galloping.model.modes import Modes
from galloping.progress_reports import passing
from galloping.recording.samples import inputs_at_times

# Least expected rise of the log-likelihood with which the iteration continues. A step with less has
# a squared length below 0.02 in standard deviations, and increases errors by less than a hundredth.
LIKELIHOOD_TOLERANCE = 1e-2
# Least excess of a first fitted noise over the least noise, relative to the latter.
MIN_EXCESS_NOISE = 0.1
MIN_INFORMATION = 1e-6  # least information on a parameter that the data determine, in its unit
# Least logarithm of a force's strength, relative to the motion. It represents zero.
MIN_LOG_STRENGTH = -40.0
# Least damping of steps (K. Levenberg, 1944), relative to the information.
MIN_STEP_DAMPING = 1e-4


def fisher_information(slopes: np.ndarray) -> np.ndarray:
    """Compute the Fisher information of the parameters from derivatives of the innovations.

    Returns (n_parameters, n_parameters). Its diagonal is one for parameters that the data do not
    determine, such as the noise of exact samples.
    """
    flat = slopes.reshape(len(slopes), -1)
    information = flat @ flat.T
    is_determined = np.diag(information) > MIN_INFORMATION
    information[np.diag_indices_from(information)] += np.where(is_determined, 0.0, 1.0)
    return information


def likelihood_score(slopes: np.ndarray, filtered: Innovations) -> np.ndarray:
    """Compute the gradient of the log-likelihood from the innovations and their derivatives."""
    error = filtered.innovations / np.sqrt(filtered.variances)
    error = error[np.isfinite(error)]
    residuals = np.concatenate([-error, (error**2 - 1.0) / np.sqrt(2.0)])
    return slopes.reshape(len(slopes), -1) @ residuals


@dataclass(frozen=True)
class Parameters:
    """Conversion between a model under random forces and the vector of its fit parameters.

    Parameters are the centred coefficients of the support, roots of the forces, and noise.
    correlated: whether the forces of two equations may be correlated. start: a model with the slow
    forces and resonances of all.
    """

    setup: ForcedProblem
    support: np.ndarray
    correlated: bool
    start: ForcedModel

    @cached_property
    def centring(self) -> np.ndarray:
        """Matrix that refers constant terms to the middle of the motion instead of to zero."""
        return self.setup.centring(self.support)

    @cached_property
    def lower(self) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the off-diagonal entries of the forces' Cholesky factor that are fitted."""
        n = len(self.start.root)
        return np.tril_indices(n, -1 if self.correlated else -n)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Slice of the parameter vector for each kind of parameter, such as 'noise'."""
        start = self.start
        counts = {
            "coefficients": self.support.sum(), "strengths": len(start.root),
            "shared": len(self.lower[0]), "slow": 2 * len(start.slow),
            "resonances": start.extra_modes.oscillators.size,
            "onto": start.extra_modes.is_shared.sum(), "noise": len(start.noise),
        }  # fmt: skip
        ends = np.cumsum([0, *counts.values()]).tolist()
        return dict(zip(counts, map(slice, ends[:-1], ends[1:]), strict=True))

    def to_vector(self, model: ForcedModel) -> np.ndarray:
        """Convert a model to the vector of its fit parameters, (n_parameters,)."""
        scaled = self.centring @ (model.coefficients / self.setup.unit)[self.support]
        diagonal, extra = np.diag(model.root), model.extra_modes
        least = self.setup.least_noise
        noise = np.sqrt(np.maximum(model.noise**2 - least**2, (MIN_EXCESS_NOISE * least) ** 2))
        return np.concatenate([
            scaled, np.log(diagonal), (model.root / diagonal)[self.lower],
            np.log([*model.slow, *model.rates]), np.log(extra.oscillators).ravel(),
            extra.onto[extra.is_shared], np.log(noise),
        ])  # fmt: skip

    def to_model(self, vector: np.ndarray) -> ForcedModel:
        """Convert a vector of fit parameters, (n_parameters,), to a model."""
        values = {name: vector[part] for name, part in self.slices.items()}
        coefficients, root = np.zeros(len(self.support)), np.eye(len(self.start.root))
        scaled = np.linalg.solve(self.centring, values["coefficients"])
        coefficients[self.support] = scaled * self.setup.unit[self.support]
        root[self.lower] = values["shared"]
        faintest = MIN_LOG_STRENGTH + np.log(self.setup.size.max())
        root = root * np.exp(np.maximum(values["strengths"], faintest))
        noise = np.hypot(np.exp(values["noise"]), self.setup.least_noise)
        slow, rates = np.exp(np.maximum(values["slow"], faintest)).reshape(2, -1)
        extra, onto = self.start.extra_modes, self.start.extra_modes.onto.copy()
        onto[extra.is_shared] = values["onto"]
        extra = replace(extra, oscillators=np.exp(values["resonances"]).reshape(-1, 2), onto=onto)
        return ForcedModel(coefficients, root, noise, tuple(slow), tuple(rates), extra)


@dataclass(frozen=True)
class ForcedFit:
    """Maximum-likelihood fit of a model with given terms under random forces.

    filtered: innovations of the model. slopes: (n_parameters, 2, n_samples) derivatives of the
    standardised innovations, and of half the logarithms of their variances times the root of two.
    """

    parameters: Parameters
    model: ForcedModel
    filtered: Innovations
    slopes: np.ndarray

    @property
    def setup(self) -> ForcedProblem:
        """The identification problem that was fitted."""
        return self.parameters.setup

    @property
    def support(self) -> np.ndarray:
        """Whether each candidate term was in the fitted model, (n_candidates,) boolean."""
        return self.parameters.support

    @cached_property
    def modes(self) -> Modes:
        """Modes of the linear part of the fitted equations."""
        return self.setup.state_space_model(self.model).modes

    @cached_property
    def normal_equations(self) -> tuple[np.ndarray, np.ndarray]:
        """Result of `ForcedProblem.normal_equations` at the fitted model."""
        return self.setup.normal_equations(self.model)

    def covariance(self, kind: str) -> np.ndarray:
        """Compute the covariance of the parameters of one kind, such as 'coefficients'.

        kind: a key of `Parameters.slices`.
        """
        rows = self.parameters.slices[kind]
        return np.linalg.inv(fisher_information(self.slopes))[rows, rows]

    @property
    def resonance_errors(self) -> np.ndarray:
        """Standard errors of frequency, rad/s, and damping ratio of resonances, (n, 2)."""
        oscillators = self.model.extra_modes.oscillators
        variances = np.diag(self.covariance("resonances"))  # of logarithms
        return oscillators * np.sqrt(variances).reshape(oscillators.shape)

    @property
    def coefficient_covariance(self) -> np.ndarray:
        """Covariance of the fitted coefficients over `setup.unit`, (n_support, n_support)."""
        inverse = np.linalg.inv(self.parameters.centring)
        return inverse @ self.covariance("coefficients") @ inverse.T

    @cached_property
    def whiteness(self) -> Whiteness:
        """Results of the whiteness tests of the fit's innovations."""
        setup, recordings = self.setup, self.setup.recordings
        begin = 2 * len(setup.size)
        step = typical_step(recordings)
        parts = list(zip(self.filtered.parts, recordings, strict=False))  # priors are parts, too
        grids = []
        for part, each in parts:
            error = part.standardised
            error[:begin] = np.nan  # until the first state is determined
            grids.append(place_on_grid(each.time, error, step))
        whiteness = assess_whiteness(grids, step, self.modes.omega / (2.0 * np.pi))
        if not (names := setup.problem.inputs):
            return whiteness
        errors, quantities = [], []
        for part, each in parts:
            inputs = inputs_at_times([each.inputs[name] for name in names], each.time)
            errors.append(part.standardised[begin + 1 :])
            quantities.append(np.hstack([part.means, inputs])[begin:-1])
        k = find_dependence(np.concatenate(errors), np.concatenate(quantities))
        return whiteness if k is None else replace(whiteness, dependence=setup.problem.names[k])

    @property
    def deviation(self) -> Finding:
        """Finding that names the main deviation of the innovations from white noise."""
        return self.whiteness.to_finding(self.setup.channels.names)


def maximise_likelihood(
    setup: ForcedProblem, model: ForcedModel, support: np.ndarray, correlated: bool
) -> ForcedFit:
    """Fit a model with given terms under random forces by maximum likelihood.

    support: (n_candidates,) the terms. model: the initial guess. correlated: whether the forces of
    two equations may be correlated. Terms that the data do not determine are left out. Raises
    FloatingPointError if the filter of the start fails.
    """
    parameters = Parameters(setup, support, correlated, model)

    def filter_with(vector: np.ndarray) -> Innovations:
        return setup.filter_recordings(parameters.to_model(vector))

    vector = parameters.to_vector(model)
    step = np.full(len(vector), 1e-5)  # first one of finite differences, in units of parameters
    run, damping = filter_with(vector), MIN_STEP_DAMPING
    if not np.isfinite(run.log_likelihood):
        if run.objection:
            raise NotConvergedError(run.objection)
        raise FloatingPointError("the filter of its start loses all digits")
    slopes = _difference_innovations(filter_with, vector, run, step)
    first = slopes[parameters.slices["coefficients"]]
    is_determined = np.einsum("ijk,ijk->i", first, first) > MIN_INFORMATION
    if not is_determined.all():  # accelerations, for example, do not determine the equilibrium
        determined_support = support.copy()
        determined_support[support] = is_determined
        return maximise_likelihood(setup, model, determined_support, correlated)
    is_exact = True  # whether the slopes are differences at `vector`, not estimates
    for _ in range(40):
        passing("fit random forces")
        information, score = fisher_information(slopes), likelihood_score(slopes, run)
        scale = np.diag(information)
        # within one error the likelihood is nearly quadratic; the step is far above rounding
        step = ERROR_STEP / np.sqrt(scale)
        for _ in range(12 if is_exact else 1):  # trials, each shorter than the one before
            change = np.linalg.solve(information + damping * np.diag(scale), score)
            with np.errstate(all="ignore"):  # a step may be too long
                trial_run = filter_with(vector + change)
                is_better = trial_run.log_likelihood >= run.log_likelihood
            if is_better:
                break
            damping *= 8.0
        has_converged = not is_better or 0.5 * score @ change < LIKELIHOOD_TOLERANCE
        if has_converged and not is_exact:
            slopes, is_exact = _difference_innovations(filter_with, vector, run, step), True
            continue
        if is_better and not has_converged:
            slopes = _update_slopes(slopes, change, scale, run, trial_run)
            is_exact = False
        if is_better:
            vector, run, damping = vector + change, trial_run, max(damping / 16.0, MIN_STEP_DAMPING)
        if has_converged or is_exhausted():
            break
    if not is_exact:
        slopes = _difference_innovations(filter_with, vector, run, step)
    return ForcedFit(parameters, parameters.to_model(vector), run, slopes)


def _update_slopes(
    slopes: np.ndarray,
    change: np.ndarray,
    scale: np.ndarray,
    run_before: Innovations,
    run_after: Innovations,
) -> np.ndarray:
    """Update the slopes of the innovations by their differences along a step.

    It is the least change of the slopes that gives these differences (C. G. Broyden, 1965), in
    units of the parameters' standard errors. It needs a tenth of the filter runs of differences by
    every parameter. change: the step. scale: (n_parameters,) diagonal of the information.
    run_before, run_after: the innovations at both ends of the step.
    """
    is_known = np.isfinite(run_before.innovations)
    root = np.sqrt(run_after.variances[is_known])
    slopes = slopes.copy()
    slopes[:, 0] *= np.sqrt(run_before.variances[is_known]) / root
    differences = np.stack([
        (run_after.innovations - run_before.innovations)[is_known] / root,
        np.log(run_after.variances[is_known] / run_before.variances[is_known]) / np.sqrt(2.0),
    ])  # fmt: skip
    missed = differences - np.tensordot(change, slopes, 1)
    weighted = scale * change
    return slopes + (weighted / (weighted @ change))[:, np.newaxis, np.newaxis] * missed


def _difference_innovations(
    filter_with: Callable[[np.ndarray], Innovations],
    vector: np.ndarray,
    run: Innovations,
    step: np.ndarray,
) -> np.ndarray:
    is_known = np.isfinite(run.innovations)
    root = np.sqrt(run.variances[is_known])
    slopes = np.empty((len(vector), 2, len(root)))
    for j, h in enumerate(step):
        unit = np.zeros(len(vector))
        unit[j] = h
        shifted_run = filter_with(vector + unit)
        if shifted_run.objection:
            raise NotConvergedError(shifted_run.objection)
        with np.errstate(all="ignore"):  # a variance may not be positive
            slopes[j, 0] = (shifted_run.innovations - run.innovations)[is_known] / h / root
            ratio = shifted_run.variances[is_known] / run.variances[is_known]
            slopes[j, 1] = np.log(ratio) / h / np.sqrt(2.0)
    if not np.isfinite(slopes).all():
        raise FloatingPointError("the likelihood has no slope where the filter loses all digits")
    return slopes


def forces_are_needed(fit: ForcedFit, penalty: float) -> bool:
    """Decide whether random forces improve the likelihood of a fit by more than their penalty."""
    model = fit.model
    unforced = replace(model, root=0.0 * model.root, slow=())
    lost = fit.filtered.log_likelihood - fit.setup.filter_recordings(unforced).log_likelihood
    return bool(2.0 * lost > penalty * (model.root.size + len(model.slow)))


def forces_are_correlated(fit: ForcedFit, penalty: float) -> bool:
    """Decide whether the random forces on different equations are correlated, by a Wald test."""
    if fit.model.extra_modes.hosts:  # the same forces move the resonances
        return True
    root = fit.model.root
    shares = (root / np.diag(root))[fit.parameters.lower]
    if not len(shares):
        return False
    square = shares @ np.linalg.solve(fit.covariance("shared"), shares)
    return bool(square > penalty * len(shares))
