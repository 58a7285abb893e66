"""Status of a fit in random forces, and its identified model."""

from collections.abc import Mapping

import numpy as np

from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.observations import Code, Finding
from galloping.identification.plausible import detection_limits
from galloping.identification.random_forces.fitting import ForcedFit
from galloping.identification.status import status_of


def assess_forced_fit(
    fit: ForcedFit,
    absent: np.ndarray,
    penalty: float,
    initial_states: np.ndarray,
    scales: Mapping[str, float],
) -> IdentifiedModel:
    """Turn a fit under random forces into an `IdentifiedModel`, and decide its status.

    The status is `ok`, or `approximate` if the innovations are not white and that matters. absent:
    (n_candidates,) standard errors of absent terms, if they were present. penalty: of a term.
    initial_states: (n_recordings, n_states). scales: of values that were in unknown units, by name.
    """
    posed, support = fit.posed, fit.support
    problem, channels, recordings = posed.problem, posed.channels, posed.recordings
    model, left = fit.model, fit.whiteness
    unit = posed.unit[support]
    errors = np.full(len(support), np.nan)
    errors[support] = np.sqrt(np.diag(fit.coefficient_covariance)) * unit
    covariance = problem.model_covariance(
        fit.coefficient_covariance * np.outer(unit, unit), support
    )
    sigma = np.full((len(recordings), len(problem.states)), np.nan)
    for c, i in enumerate(channels.values):
        there = [np.isfinite(one.samples[:, c]).any() for one in posed.data]
        sigma[there, i] = model.noise[c]
    of_rates = list(zip(channels.names, model.noise, strict=True))[len(channels.values) :]
    forces = posed.state_space_model(model).forces
    resonances = posed.resonances(model, fit.resonance_errors)
    beside = [each.frequency / (2.0 * np.pi) for each in resonances if each.is_mode]
    findings = (
        Finding.of(Code.RANDOM_FORCES),
        *(Finding.of(Code.MODE_BESIDE, frequency_hz=hertz) for hertz in beside),
        *([] if left.is_white else [left.to_finding(channels.names)]),
    )
    return IdentifiedModel(
        model=problem.model(model.coefficients),
        status=status_of(findings),
        findings=findings,
        standard_errors=problem.on_library(errors, 0.0),
        unconditional_errors=problem.on_library(np.where(support, errors, absent), 0.0),
        detection_limits=problem.on_library(detection_limits(absent, support, penalty)),
        covariance=covariance,
        known=problem.known_equations,
        initial_states=initial_states,
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
            "innovations_told": left.predicted,
            "innovations_line": left.peak,
            "innovations_line_allowed": left.peak_allowed,
            **{f"noise_{name}": float(value) for name, value in of_rates},
            **({"rates_averaged": float(channels.averaged)} if channels.rates else {}),
            "path": "random forces",
            **scales,
        },
    )
