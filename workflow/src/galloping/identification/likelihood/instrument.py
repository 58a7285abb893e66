"""Score tests of a fit for faults of the sensors and for unknown forces.

Each fault is a parameter that is zero in the fit; its score (Lagrange multiplier) measures by how
much the data contradict this, without another fit (C. R. Rao, 1948; T. S. Breusch and A. R. Pagan,
1979). Noise shows in the variance of the residuals, forces in the mismatch of the segments.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from galloping.identification.findings import Code, Finding
from galloping.identification.likelihood.condense import PROJECTIONS
from galloping.identification.likelihood.elimination import Eliminated, eliminate_chains
from galloping.identification.likelihood.shooting import (
    Linearised,
    Segments,
    ShootingData,
    ShootingFit,
    segment_residuals,
)
from galloping.identification.selection import (
    MIN_INDEPENDENT_SHARE,
    make_tableau,
    misfit_of_support,
    select_support,
    solve_support,
    whiten,
)
from galloping.model.polynomial import Exponents, exponent_matrix, velocity_pairs

# Codes of unknown forces without inputs, and with inputs.
FORCE_CODES = (Code.FORCES, Code.FORCES_BESIDE_INPUTS)


@dataclass(frozen=True)
class Fault:
    """A possible sensor fault or unknown force, and the result of the statistical test for it.

    cause: finding that names the fault. or_model: whether a wrong model may look like this fault,
    as a missing slow term like a drift. z: evidence for the fault, in standard deviations. mixture:
    (n_parameters,) weights of the parameters of faults, tested as one parameter; none for a fault
    that is no parameter. is_noise: whether the fault only adds white noise, which explains no
    coloured misfit.
    """

    cause: Finding
    or_model: bool
    z: float = 0.0
    mixture: np.ndarray = field(default_factory=lambda: np.ones(0))
    is_noise: bool = False

    def can_explain(self, excess: float) -> bool:
        """Decide whether the fault explains most of an excess of chi^2 over that of the noise."""
        # any misfit of a model shows as unknown forces
        explained = 0.0 if self.is_noise else self.z**2
        return self.cause.code in FORCE_CODES or explained >= excess / 2.0


def find_faults(fit: ShootingFit, penalty: float) -> list[Fault]:
    """Test a fit for sensor faults and unknown forces; return those found, the clearest first.

    The false-alarm rate is one sound recording in two hundred. fit: converged, in its chains.
    penalty: 2 ln N of N samples. Raises FloatingPointError if the model diverges.
    """
    problem, condensed, segments = fit.record.problem, fit.record.condensed, fit.record.segments
    residual, _ = segment_residuals(fit.record, fit.free, fit.starts)
    of_rates = replace(fit.record, condensed=condensed.as_rates())
    rates = of_rates.predict_projections(fit.free, fit.starts)
    wider, delayed = _add_input_rates(fit)
    entries, columns, tests = _fault_parameters(fit.record, rates, delayed)

    def linearise_terms(terms: np.ndarray) -> Linearised:
        return wider.linearise(np.vstack([problem.candidates[terms], entries]), columns)

    linear = linearise_terms(fit.support)
    quadratic = eliminate_chains(linear, segments)
    scores = [score_test(quadratic.information, quadratic.right, test.mixture) for test in tests]
    tested = [replace(test, z=z) for test, z in zip(tests, scores, strict=True)]
    tested += _test_gaps(linear, fit) + _test_variances(fit, residual, rates)
    limit = -ndtri(5e-3 / 2.0 / len(tested))
    # A fault with such a score is also tested against terms that may only imitate it. A few of a
    # hundred sound recordings have such a score, which costs no more than a pass of the fit.
    doubtful = [k for k, z in enumerate(scores) if z > 2.5]
    if doubtful and max(scores) < np.sqrt(penalty):
        quadratic = eliminate_chains(linearise_terms(np.ones(len(fit.support), bool)), segments)
        for k in doubtful:
            beside = _score_beside_term(quadratic, fit, tests[k])
            instead = _score_instead_of_terms(quadratic, fit, tests[k], penalty)
            tested[k] = replace(tested[k], z=max(beside, instead))
    shown = [fault for fault in tested if fault.z > limit]
    return sorted(shown, key=lambda fault: -fault.z)


# Input that may be delayed: name, coefficients (equation, term), their values for a delay of 1 s.
DelayedInput = tuple[str, list[tuple[int, int]], list[float]]


def _add_input_rates(fit: ShootingFit) -> tuple[ShootingFit, list[DelayedInput]]:
    """Add terms with the rates of inputs to the problem of a fit, to test for delays.

    A delay of an input u subtracts c b u^(b - 1) du/dt from each term c u^b. Tested are inputs that
    share no term with another.
    """
    problem, condensed = fit.record.problem, fit.record.condensed
    coefficients, powers = problem.coefficients(fit.free), condensed.inputs
    n, extra = len(problem.states), len(problem.inputs)
    many = n + extra
    terms, delayed = [(*term[:many], *[0] * extra, *term[many:]) for term in problem.terms], []
    powers_of_inputs = exponent_matrix(problem.terms, many)[:, n:]
    slopes = np.zeros_like(powers)
    slopes[:, :-1] = powers[:, 1:] * np.arange(1, powers.shape[1])[:, None] / condensed.step
    columns = [powers]
    for k, name in enumerate(problem.inputs):
        powers_of_terms = powers_of_inputs[powers_of_inputs[:, k] != 0]
        if not len(powers_of_terms) or np.any(np.count_nonzero(powers_of_terms, axis=1) > 1):
            continue
        pairs, weights = [], []
        for i, j in np.argwhere(coefficients).tolist():
            if power := int(powers_of_inputs[j, k]):
                changed = {n + k: power - 1, n + extra + k: 1}
                slope = tuple(changed.get(place, e) for place, e in enumerate(terms[j]))
                if slope not in terms:
                    factor = problem.tables.factors.index(problem.terms[j][n : n + extra])
                    if all(slope[n : n + 2 * extra] != term[n : n + 2 * extra] for term in terms):
                        columns.append(slopes[:, :, factor : factor + 1] / power)
                    terms.append(slope)
                pairs.append((i, terms.index(slope)))
                weights.append(-coefficients[i, j] * power)
        if pairs:
            delayed.append((name, pairs, weights))
    if not delayed:
        return fit, []
    rates = [f"d({name})/dt" for name in problem.inputs]
    return add_inputs(fit, rates, terms, np.concatenate(columns, axis=2)), delayed


def add_inputs(
    fit: ShootingFit, names: Sequence[str], terms: Sequence[Exponents], factors: np.ndarray
) -> ShootingFit:
    """Add inputs, and terms in them, to the problem of a fit.

    names: of the inputs. terms: those of the problem, in these inputs too, then the added ones.
    factors: as `Condensed.inputs`.
    """
    record, problem = fit.record, fit.record.problem
    added = ((0, 0), (0, len(terms) - len(problem.terms)))
    wider = problem.change_terms(lambda values: np.pad(values, added), terms)
    wider = replace(wider, inputs=(*problem.inputs, *names))
    condensed = replace(record.condensed, inputs=factors)
    return replace(fit, record=replace(record, problem=wider, condensed=condensed))


def _fault_parameters(
    record: ShootingData, rates: np.ndarray, delayed: list[DelayedInput]
) -> tuple[np.ndarray, np.ndarray, list[Fault]]:
    """Make the parameters of faults, and the faults as mixtures of them.

    rates: (n_windows, n_observed, n_rows) projections of the solution's time derivatives. Returns
    coefficients that are zero or known, (n_entries, 2), columns as in `linearise`, and the faults.
    """
    problem, condensed = record.problem, record.condensed
    states, names = problem.states, condensed.channels.names
    channel = {i: o for o, i in enumerate(condensed.channels.values)}
    velocities = velocity_pairs(states).items()
    kinematic = [(i, v) for i, v in velocities if i in channel and v in channel]
    samplings, time = condensed.samplings, condensed.step * np.arange(len(rates))[:, None, None]
    trend = time * samplings[..., 0] + condensed.step * samplings[..., 1]
    count = len(names)
    columns = np.zeros((*rates.shape, 2 * count))
    for o in range(count):
        columns[:, o, :, o] = -rates[:, o]
        columns[:, o, :, count + o] = trend[:, o]
    entries = [(i, problem.linear(v)) for i, v in kinematic]
    first = len(entries) + sum(len(pairs) for _, pairs, _ in delayed)
    n, tests = first + 2 * count, []

    def add_test(
        places: list[int], cause: Finding, or_model: bool = False, weights: ArrayLike = 1.0
    ) -> None:
        mixture = np.zeros(n)
        mixture[places] = weights
        tests.append(Fault(cause, or_model, mixture=mixture))

    for k, (i, v) in enumerate(kinematic):
        add_test([k], Finding.of(Code.RATE_DISAGREES, states[v], coordinate=states[i]))
    if len(kinematic) > 1:
        add_test(list(range(len(kinematic))), Finding.of(Code.RATES_DISAGREE))
    for name, pairs, weights in delayed:
        places = list(range(len(entries), len(entries) + len(pairs)))
        add_test(places, Finding.of(Code.INPUT_DELAYED, name), True, weights)
        entries += pairs
    for o, name in enumerate(names):
        if len(names) > 1:
            add_test([first + o], Finding.of(Code.CHANNEL_DELAYED, name))
        add_test([first + count + o], Finding.of(Code.DRIFTS, name), True)
    for i, v in kinematic if len(kinematic) > 1 else []:
        both = [first + channel[i], first + channel[v]]
        add_test(both, Finding.of(Code.COORDINATE_DELAYED, states[i], velocity=states[v]))
    return np.array(entries, int).reshape(-1, 2), columns, tests


def score_test(information: np.ndarray, right: np.ndarray, mixture: np.ndarray) -> float:
    """Compute z, in standard deviations, of the score test for a combination of parameters.

    mixture: weights of the last parameters in the combination. The other parameters are at their
    best; 0 if they are collinear with the combination.
    """
    information, right = _combine_parameters(information, right, mixture)
    change, covariance = solve_support(information, right, np.arange(len(right)) < len(right) - 1)
    cross = information[-1, :-1]
    remaining = information[-1, -1] - cross @ covariance @ cross
    if remaining < MIN_INDEPENDENT_SHARE * information[-1, -1] or remaining <= 0.0:
        return 0.0
    return float(abs(right[-1] - information[-1] @ change) / np.sqrt(remaining))


def _combine_parameters(
    information: np.ndarray, right: np.ndarray, mixture: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Replace the last parameters of a regression by one mixture of them."""
    transformation = np.eye(len(right), len(right) - len(mixture) + 1)
    transformation[-len(mixture) :, -1] = mixture
    return transformation.T @ information @ transformation, right @ transformation


def _score_beside_term(quadratic: Eliminated, fit: ShootingFit, test: Fault) -> float:
    """Compute z of a fault beside the term that the model lacks most, which may look like it."""
    n, more = len(fit.support), fit.support.copy()
    whitened = whiten(quadratic.information[:n, :n], quadratic.right[:n], fit.free)
    tableau = make_tableau(whitened, fit.support & whitened.is_usable)
    if len(tableau.out):
        (rises,), *_ = tableau.rises(0, 1)
        more[tableau.out[np.argmin(rises)]] = True
    kept = np.append(more, np.ones(len(test.mixture), bool))
    return score_test(
        quadratic.information[np.ix_(kept, kept)], quadratic.right[kept], test.mixture
    )


def _score_instead_of_terms(
    quadratic: Eliminated, fit: ShootingFit, test: Fault, penalty: float
) -> float:
    """Compute z by which the data prefer a fault with newly selected terms to the present terms."""
    information, right = _combine_parameters(quadratic.information, quadratic.right, test.mixture)
    problem, origin = fit.record.problem, np.append(fit.free, 0.0)
    penalties = np.append(problem.least_penalties(penalty), penalty)
    present_support = np.append(fit.support, False)
    apart = np.append(problem.selection_offset(fit.free), 0.0)
    selection = select_support(
        information, right, [present_support, np.append(fit.support, True)], penalties, apart
    )
    if not selection[-1]:
        return 0.0

    misfits = [
        misfit_of_support(information, right, origin, support) + penalties[support].sum()
        for support in (present_support, selection)
    ]
    return float(np.sqrt(max(misfits[0] - misfits[1], 0.0)))


def _test_gaps(linear: Linearised, fit: ShootingFit) -> list[Fault]:
    """Test whether stretches are followed better than the whole recording by a fit's terms."""
    segments, starts = fit.record.segments, fit.starts
    is_term = np.arange(linear.right.shape[1]) < fit.support.sum()

    def misfit_fall(chain_segments: Segments) -> float:
        quadratic = eliminate_chains(linear, chain_segments)
        change, _ = solve_support(quadratic.information, quadratic.right, is_term)
        return quadratic.fall + float(change @ quadratic.right)

    whole, bounds, tested = misfit_fall(segments), segments.bounds, []
    # position of each segment in its chain
    positions = np.arange(bounds[-1]) - np.repeat(bounds[:-1], np.diff(bounds))
    for length in (1, 2, 4):  # segments in a chain, for intermittent forces and a drifting phase
        begins = positions % length == 0
        freedom = int(begins.sum() - len(bounds) + 1) * starts.shape[1]
        if freedom > 0:
            square = misfit_fall(replace(segments, chains=np.cumsum(begins) - 1)) - whole
            # a chi^2 variable's square root is almost Gaussian (R. A. Fisher)
            z = np.sqrt(2.0 * max(square, 0.0)) - np.sqrt(2.0 * freedom - 1.0)
            cause = Finding.of(FORCE_CODES[bool(fit.record.problem.inputs)])
            tested.append(Fault(cause, True, float(z)))
    return tested


def _test_variances(fit: ShootingFit, residual: np.ndarray, rates: np.ndarray) -> list[Fault]:
    """Test whether the residuals are larger where the signal is steep, or where it is large."""
    condensed, sigma = fit.record.condensed, fit.sigma
    owner = fit.record.window_recordings
    is_present = condensed.is_present
    square = (residual / sigma[owner][:, :, None]) ** 2
    weight = np.where(is_present[:, :, 0], condensed.samplings[:, :, 0, 0], 1.0)
    tested = []
    values = condensed.targets - residual
    for code, signals in ((Code.TIMES_JITTER, rates), (Code.NOISE_GROWS, values)):
        signal, scores, skews = signals[:, :, 0], [], []
        for r, o in np.ndindex(sigma.shape):
            is_inside = is_present[:, o] & (owner == r)[:, None]
            squares = square[:, o][is_inside]
            # residuals are so far below sigma only if sigma is at its floor: they are rounding
            if len(squares) < 2 or squares.mean() < 0.25:
                continue
            level = signal[:, o] / weight[:, o]
            size = np.repeat(level[:, None] ** 2, PROJECTIONS, axis=1)[is_inside]
            size = size - size.mean()
            if (spread := np.sqrt(2.0 * np.sum(size**2))) > 0.0:
                scores.append(float(size @ (squares / squares.mean())) / spread)
                skews.append(float(8.0 * np.sum(size**3)) / spread**3)
        if scores:
            n = len(scores)
            z = _as_gaussian(sum(scores) / np.sqrt(n), sum(skews) / n**1.5)
            tested.append(Fault(Finding.of(code), True, z, is_noise=True))
    return tested


def _as_gaussian(z: float, skew: float) -> float:
    """Transform z, of variance one and skew like a chi^2 variable, to a Gaussian variable.

    It is exceeded as often (E. B. Wilson and M. M. Hilferty, 1931).
    """
    if skew <= 0.0:
        return z
    freedom = 8.0 / skew**2
    ratio = max(1.0 + z * np.sqrt(2.0 / freedom), 0.0)
    return float((np.cbrt(ratio) - 1.0 + 2.0 / (9.0 * freedom)) * np.sqrt(4.5 * freedom))
