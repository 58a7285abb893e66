"""Parts of an identification result: path, refusal, effects of known inputs and coefficients."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import RANGE_SUFFIXES, TERM_FIELDS, IdentifiedModel
from galloping.identification.problem import Problem
from galloping.model.intervals import MIN_SIGNIFICANCE, QUANTILES_90
from galloping.model.polynomial import exponent_matrix, has_functions, velocity_pairs
from galloping.recording.samples import Recording


def prepend_path(path: Iterable[str], identified: IdentifiedModel) -> IdentifiedModel:
    """Prepend earlier search stages to the list of stages in the diagnostics of a model."""
    stages = filter(None, (*path, str(identified.diagnostics.get("path", ""))))
    return replace(identified, diagnostics={**identified.diagnostics, "path": ", ".join(stages)})


def refused_model(problem: Problem, findings: Iterable[Finding]) -> IdentifiedModel:
    """Return an identification result without a model, with findings that explain why."""
    return IdentifiedModel.refused(problem.states, problem.terms, findings, problem.inputs)


def fitted_model(
    problem: Problem,
    free: np.ndarray,
    support: np.ndarray,
    covariance: np.ndarray,
    findings: Iterable[Finding] = (),
    **fields: Any,
) -> IdentifiedModel:
    """Return an identification result with a model, which its findings judge.

    free: (n,) coefficients of the candidates. support: (n,) boolean, which terms are present.
    covariance: (n_support, n_support). fields: further fields of the result.
    """
    errors = np.full(len(support), np.nan)
    errors[support] = np.sqrt(np.diag(covariance))
    return IdentifiedModel(
        model=problem.model(free),
        findings=tuple(findings),
        is_judged=True,
        standard_errors=problem.on_library(errors, fixed=0.0),
        covariance=problem.model_covariance(covariance, support),
        known=problem.known_equations,
        **fields,
    )


def explain_single_state(
    identified: IdentifiedModel, recordings: Iterable[Recording]
) -> IdentifiedModel:
    """Refuse a single state which rises and falls: it needs its rate as a second state.

    The motion of one equation of first order without inputs only rises or only falls.
    """
    states = identified.model.states
    if identified.status != "refused" or len(states) > 1 or identified.model.inputs:
        return identified
    still = identified.has_finding(Code.NO_MOTION, Code.MOSTLY_NOISE)
    if still or not any(_rises_and_falls(recording.values[:, 0]) for recording in recordings):
        return identified
    cause = Finding.of(Code.SECOND_STATE_MISSING, states[0])
    return replace(identified, findings=()).with_findings(cause)


def _rises_and_falls(values: np.ndarray) -> bool:
    """Decide whether values (n,) cross the middle half of their range at least twice."""
    values = values[np.isfinite(values)]
    low, high = np.quantile(values, QUANTILES_90) if len(values) else (0.0, 0.0)
    quarter = (high - low) / 4.0
    sides = (values > high - quarter).astype(int) - (values < low + quarter)
    return bool(np.count_nonzero(np.diff(sides[sides != 0])) > 1)


def expand_terms(problem: Problem, identified: IdentifiedModel) -> IdentifiedModel:
    """Extend a model to all candidate terms, with zero coefficients for those that it lacked."""
    places = [problem.terms.index(term) for term in identified.model.terms]

    def spread_values(values: np.ndarray, fill: float) -> np.ndarray:
        whole = np.full((*values.shape[:-1], len(problem.terms)), fill)
        whole[..., places] = values
        return whole

    coefficients = spread_values(identified.model.coefficients, 0.0)
    by_term: Any = {name: spread_values(getattr(identified, name), np.nan) for name in TERM_FIELDS}
    return replace(
        identified,
        model=replace(identified.model, terms=problem.terms, coefficients=coefficients),
        rivals=spread_values(identified.rivals, 0.0),
        **by_term,
    )


def check_prior_conflict(problem: Problem, identified: IdentifiedModel) -> IdentifiedModel:
    """Add a finding to a model for each coefficient that contradicts its prior or bounds.

    A coefficient does so if recordings alone would put it more than MIN_SIGNIFICANCE standard
    deviations from its prior, or out of its bounds: then the prior is wrong, or the model is.

    The estimate is the mean of both, weighted by their precisions. Its distance from the prior mean
    has the variance of the prior, less the variance of the estimate.
    """
    values, means = identified.model.coefficients, problem.expected
    with np.errstate(invalid="ignore", divide="ignore"):
        deviation = problem.precision**-0.5
        share = 1.0 - (identified.standard_errors / deviation) ** 2
        # errors of approximate models are wider than those of white noise: then the prior's alone
        share = np.where(share > 0.0, np.fmax(share, 1e-6), 1.0)
        surprise = abs(values - means) / (deviation * np.sqrt(share))
    conflicts = [
        Finding.of(
            Code.PRIOR_CONTRADICTED, problem.states[i], term=problem.coefficient_name(i, j),
            value=values[i, j], expected=means[i, j], deviation=deviation[i, j],
        )
        for i, j in np.argwhere(surprise > MIN_SIGNIFICANCE)
    ]  # fmt: skip
    for i, term, least, most in problem.bounds:  # some models are fitted without bounds
        j = problem.terms.index(term)
        if np.nan_to_num(values[i, j]) and not least <= values[i, j] <= most:
            conflicts.append(Finding.of(
                Code.BOUNDS_CONTRADICTED, problem.states[i], term=problem.coefficient_name(i, j),
                value=values[i, j], least=least, most=most,
            ))  # fmt: skip
    return replace(identified, bounds=problem.bounds).with_findings(*conflicts)


def add_input_errors(
    identified: IdentifiedModel, recordings: Sequence[Recording], stretches: Sequence[Recording]
) -> IdentifiedModel:
    """Add calibration errors of the inputs to standard errors of a model, and note input ranges.

    The diagnostics have the share of samples without inputs, and the range that contains nine
    tenths of the samples of each input (`IdentifiedModel.recorded`).

    The calibration factor of an input has the standard error `error`. It multiplies the coefficient
    of each term with this input, to the power that the input has in the term. recordings: all
    recordings; stretches: their stretches with inputs.
    """
    names = identified.model.inputs
    if not names or identified.status == "refused":
        return identified
    samples, kept_samples = (sum(one.samples for one in each) for each in (recordings, stretches))
    diagnostics = {**identified.diagnostics, "without_inputs_share": 1.0 - kept_samples / samples}
    places, shifts, sizes = np.argwhere(identified.support), [], []
    for k, name in enumerate(names, start=len(identified.model.states)):
        error = max(one.inputs[name].error for one in stretches)
        values = np.concatenate([one.inputs[name](one.time) for one in stretches])
        ends = np.nanquantile(values, QUANTILES_90)
        sizes.append(float(np.sqrt(np.nanmean(values**2))))
        ranges = zip(RANGE_SUFFIXES, map(float, ends), strict=True)
        diagnostics |= {f"{name}{end}": value for end, value in ranges}
        power = np.array([identified.model.terms[j][k] for _, j in places], float)
        shifts.append(error * power)
    findings = find_weakly_determined_input_terms(identified, sizes, diagnostics)
    wider = _with_common_errors(identified, shifts)
    return replace(wider, diagnostics=diagnostics).with_findings(*findings)


def add_scale_errors(identified: IdentifiedModel) -> IdentifiedModel:
    """Add the errors of scales that were estimated from rates to standard errors of a model.

    The error of `scale_X` is in the diagnostics. A scale multiplies each coefficient to a power:
    that of X and dX in the term, less one in the equations of X and dX.
    """
    if identified.status == "refused":
        return identified
    states, shifts = identified.model.states, []
    exponents = exponent_matrix(identified.model.terms, len(identified.model.names))
    places = np.argwhere(identified.support)
    for k, name in enumerate(states):
        if f"scale_{name}" in identified.diagnostics:
            pair = [k, *(v for x, v in velocity_pairs(states).items() if x == k)]
            power = exponents[places[:, 1]][:, pair].sum(axis=1) - np.isin(places[:, 0], pair)
            numbers = f"scale_{name}", f"error_of_scale_{name}"
            scale, error = (float(identified.diagnostics[each]) for each in numbers)
            shifts.append(error / scale * power)
    return _with_common_errors(identified, shifts) if shifts else identified


def _with_common_errors(
    identified: IdentifiedModel, shifts: Sequence[np.ndarray]
) -> IdentifiedModel:
    """Widen the errors of a model by common errors of its coefficients.

    shifts: for each cause, the relative error of each coefficient of the support, (n_support,).
    Fixed coefficients have none.
    """
    indices = tuple(np.argwhere(identified.support).T)
    coefficients = identified.model.coefficients[indices]
    coefficients[identified.standard_errors[indices] == 0.0] = 0.0
    added = np.zeros((len(coefficients), len(coefficients)))
    for shift in shifts:
        added += np.outer(shift * coefficients, shift * coefficients)
    wider: dict[str, Any] = {}
    if len(identified.covariance):
        wider["covariance"] = identified.covariance + added
    for name in ("standard_errors", "unconditional_errors"):
        wider[name] = getattr(identified, name).copy()
        wider[name][indices] = np.hypot(wider[name][indices], np.sqrt(np.diag(added)))
    return replace(identified, **wider)


def find_weakly_determined_input_terms(
    identified: IdentifiedModel, sizes: Sequence[float], diagnostics: Mapping[str, float | str]
) -> list[Finding]:
    """Return findings on linear terms whose dependence on the inputs the data hardly determine.

    Such a term is present, while the same term with another power of the inputs is absent but may
    be more than a quarter as large: at other inputs the two differ. There is a finding for each
    input, with its recorded range. sizes: root mean square of each input. diagnostics: with the
    ranges.
    """
    model, n = identified.model, len(identified.model.states)
    of_states, of_inputs = np.hsplit(exponent_matrix(model.terms, len(model.names)), [n])
    plain = ~np.array([has_functions(term) for term in model.terms])
    powers = np.prod(np.array(sizes) ** of_inputs, axis=1)
    present = np.where(identified.support, model.coefficients * powers, 0.0)
    unseen = np.where(identified.support, 0.0, np.nan_to_num(identified.detection_limits * powers))
    names = []
    for k, state in enumerate(model.states):
        alike = np.all(of_states == np.eye(n)[k], axis=1) & plain
        size, most = abs(present[:, alike]).sum(axis=1), unseen[:, alike].max(axis=1, initial=0.0)
        names += [
            f"{state} in d({model.states[i]})/dt"
            for i in np.flatnonzero((size > 0.0) & (most > 0.25 * size))
        ]
    return [
        Finding.of(
            Code.INPUT_RANGE_SHORT, name, low=diagnostics[name + RANGE_SUFFIXES[0]],
            high=diagnostics[name + RANGE_SUFFIXES[1]], terms=", ".join(names),
        )
        for name in (model.inputs if names else ())
    ]  # fmt: skip
