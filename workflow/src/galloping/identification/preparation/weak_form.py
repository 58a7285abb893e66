"""Weak form by generalised least squares, the starting point of all methods.

Each equation, tested with bump functions phi, reads <phi', x_i> + <phi, f_i(x)> = 0, whitened by
the covariance of the measurement noise. Known equations give rows without free coefficients, which
are informative by the noise that they share with other rows.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import lapack

from galloping.arrays import round_down
from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.identification.preparation.screening import prepare_recordings
from galloping.identification.preparation.smoothing import GRID_PER_PERIOD, Smooth
from galloping.identification.problem import Problem, largest_coefficients
from galloping.identification.selection import Penalties, solve_support
from galloping.identification.work import count_work
from galloping.model.polynomial import design_matrix, linear_term, term_name
from galloping.progress_reports import passing
from galloping.recording.samples import Recording, evaluate_extended, inputs_on_grid

TEST_STRIDE = GRID_PER_PERIOD // 6  # grid steps between test functions: a third of their radius
MAX_WEAK_MISFIT = 3.0  # largest chi^2 per row of the weak form that linearised errors explain


def whitened_weak_form(
    problem: Problem, smooth: Smooth, coefficients: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Compute design matrix and right-hand side of the weak form, with errors of unit variance.

    The test functions have a radius of half the shortest period and are TEST_STRIDE steps of the
    grid apart; those that reach into a gap give zero rows. coefficients: (n_states, n_terms), about
    which the errors are linearised; without them the rows are only scaled. Returns the design
    (n_rows, n_candidates) and the right-hand side (n_rows,). Raises FloatingPointError if the
    covariance of the errors is singular.
    """
    phi, slope = _test_function(smooth)
    n_states = len(problem.states)
    usable = np.all(sliding_window_view(smooth.valid, len(phi))[::TEST_STRIDE], axis=1)
    if problem.tables.n_kinks:
        hidden = _integrate_tests(_is_sign_hidden(problem, smooth)[:, None], phi)[:, 0]
        decided = usable & (hidden < 0.5 * phi.sum())
        usable = decided if np.any(decided) else usable
    # no rows for a known equation between a curve and its own derivative
    linked = {i for i in range(n_states) if smooth.derived[i] >= 0 or np.any(smooth.derived == i)}
    keep = [i for i in range(n_states) if i in problem.unknown or i not in linked]
    moments = _integrate_tests(smooth.states, slope)
    tested = _integrate_tests(design_matrix(smooth.values, problem.terms), phi)
    # columns first, as LAPACK needs them: for a long recording a copy would be the largest array
    rows = np.zeros((len(problem.candidates) + 1, len(tested), len(keep)))
    for row, (equation, term) in zip(rows, problem.candidates, strict=False):
        row[:, keep.index(equation)] = tested[:, term]
    rows[-1] = -(moments + tested @ problem.known.T)[:, keep]
    rows[:, ~usable] = 0.0
    if coefficients is None:
        rows /= np.sqrt(np.mean(moments[:, keep] ** 2, axis=0)) + np.finfo(float).tiny
        white = rows.reshape(len(rows), -1).T.copy()
    else:
        bands = _row_covariance(problem, smooth, coefficients, usable, keep)
        factor, info = lapack.dpbtrf(bands, lower=1)
        if info:
            raise FloatingPointError("the covariance of the weak form is not positive definite")
        flat = rows.reshape(len(rows), -1).T
        white, _ = lapack.dtbtrs(factor, flat, uplo="L", overwrite_b=1)
    return white[:, :-1], white[:, -1]


def _is_sign_hidden(problem: Problem, smooth: Smooth) -> np.ndarray:
    """Find points of the grid, 0 or 1, (n_grid,), where noise hides the sign of an argument.

    The argument is that of a function with a kink. Its sign is hidden at rest, for example: there
    discontinuous terms are noise, which linearised errors do not include.
    """
    frequency = 2.0 * np.pi / (GRID_PER_PERIOD * (smooth.time[1] - smooth.time[0]))
    of_derived = frequency * smooth.sigma[smooth.derived]
    sigma = np.where(smooth.derived >= 0, of_derived, smooth.sigma)
    hidden = np.zeros(len(smooth.time))
    for weights, offset in problem.tables.arguments[: problem.tables.n_kinks]:
        noise = np.sqrt(np.sum((np.array(weights) * np.where(weights, sigma, 0.0)) ** 2))
        hidden[np.abs(smooth.states @ weights + offset) < 2.0 * noise] = 1.0
    return hidden


def _test_function(smooth: Smooth) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate the test function and its derivative at the grid points, times their spacing.

    (1 - u^2)^5 with a radius of half a period keeps 0.68 of a sine of that period, 0.18 of one of
    half.
    """
    spacing, radius = smooth.time[1] - smooth.time[0], GRID_PER_PERIOD // 2
    tau = np.arange(1 - radius, radius) / radius
    phi = (1.0 - tau**2) ** 5
    slope = -10.0 * tau * (1.0 - tau**2) ** 4
    return phi * spacing, slope / (radius * spacing) * spacing


def _integrate_tests(series: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Integrate columns against every test function: (n_grid, m) -> (n_tests, m)."""
    return sliding_window_view(series, len(phi), axis=0)[::TEST_STRIDE] @ phi


def _row_covariance(
    problem: Problem, smooth: Smooth, coefficients: np.ndarray, usable: np.ndarray, keep: list[int]
) -> np.ndarray:
    """Compute the covariance of the rows, by test and then by kept equation, as lower bands.

    usable: (n_tests,) boolean; the rows of the other tests, all zero, get a variance of one.
    Returns (n_bands, n_tests * n_kept).
    """
    n_tests, n_rows, width = len(usable), len(keep), len(_test_function(smooth)[0])
    reach = (width - 1) // TEST_STRIDE
    bands = np.zeros((n_rows * (reach + 1), n_tests, n_rows))
    batch = 4096  # test functions whose errors are linearised at once; each needs 3 kB
    for begin in range(0, n_tests, batch):
        end = min(begin + batch, n_tests)
        last = min(end + reach, n_tests)
        points = slice(begin * TEST_STRIDE, (last - 1) * TEST_STRIDE + width)
        influence = _noise_influence(problem, smooth, points, coefficients)[:, keep]
        influence[~usable[begin:last]] = 0.0
        for lag in range(min(reach, n_tests - 1) + 1):
            shift, count = lag * TEST_STRIDE, min(end, n_tests - lag) - begin
            if count <= 0:
                break
            early = influence[:count, :, :, shift:].reshape(count, n_rows, -1)
            late = influence[lag : lag + count, :, :, : width - shift]
            block = late.reshape(count, n_rows, -1) @ early.transpose(0, 2, 1)
            for a, b in np.ndindex(n_rows, n_rows):
                if (below := lag * n_rows + a - b) >= 0:
                    bands[below, begin : begin + count, b] = block[:, a, b]
    bands[0] = bands[0] * (1.0 + 1e-9) + ~usable[:, None]
    return bands.reshape(len(bands), -1)


def _noise_influence(
    problem: Problem, smooth: Smooth, points: slice, coefficients: np.ndarray
) -> np.ndarray:
    """Compute derivatives of each row by unit noise, (n_tests, n_states, n_states, n_points).

    A row belongs to a test function and an equation; the noise is that of each state at each grid
    point that the test function reaches. points: all grid points that the test functions reach.
    """
    n_states, (phi, slope) = smooth.states.shape[1], _test_function(smooth)
    signals = smooth.states[points]
    if problem.inputs:
        factors = design_matrix(smooth.inputs[points], problem.tables.factors)
        signals = np.hstack([signals, factors])
    theta = design_matrix(signals, problem.tables.monomials)
    by_states = problem.tables.jacobian(coefficients)
    jacobian = np.empty((len(theta), n_states, n_states))
    for state in range(n_states):
        jacobian[:, :, state] = theta @ by_states[:, state].T
    windows = sliding_window_view(jacobian, len(phi), axis=0)[::TEST_STRIDE]
    influence = windows * phi
    diagonal = np.arange(n_states)
    influence[:, diagonal, diagonal] += slope
    spacing = smooth.time[1] - smooth.time[0]
    for state, source in enumerate(smooth.derived):
        if source >= 0:
            padded = np.pad(influence[:, :, state], ((0, 0), (0, 0), (1, 1)))
            influence[:, :, source] -= (padded[..., 2:] - padded[..., :-2]) / (2.0 * spacing)
            influence[:, :, state] = 0.0
    sigma = np.where(smooth.derived >= 0, 0.0, smooth.sigma)
    return influence * sigma[:, None]


@dataclass(frozen=True)
class WeakFit:
    """Result of a fit of the equations in weak form: terms, coefficients and misfit.

    free, support: (n,) candidates' coefficients and which are present. information: (n, n), right:
    (n,) of the normal equations, in units of the noise. misfit: chi^2 per row, of which there are
    `rows`.
    """

    free: np.ndarray
    support: np.ndarray
    information: np.ndarray
    right: np.ndarray
    misfit: float
    rows: int


def weak_fit(problem: Problem, smoothed: list[Smooth], penalty: float) -> WeakFit:
    """Select terms and fit coefficients in weak form by iterated generalised least squares.

    The errors are linearised about the last fit. penalty: of a term in units of chi^2. Raises
    FloatingPointError if the covariance of the rows is singular, IdentificationError if gaps leave
    no row.
    """
    support = every = np.ones(len(problem.candidates), bool)
    coefficients = None
    for _ in range(1 + 3):  # after three weightings, coefficients change by less than their errors
        passing("start from the weak form")
        *system, total, n_rows = _normal_equations(problem, smoothed, coefficients)
        information, right = map(np.add, system, problem.prior_equations())
        if coefficients is not None:
            support = problem.select_terms(information, right, [every], penalty)
        if not np.any(np.diag(information)):
            raise IdentificationError(Code.GAPS_EVERYWHERE)
        free, _ = problem.solve_within_bounds(information, right, support)
        coefficients = problem.coefficients(free)
    # of the data alone, also where priors or bounds hold coefficients
    squares = total + float(free @ (system[0] @ free - 2.0 * system[1]))
    misfit = squares / max(n_rows - int(support.sum()), 1)
    return WeakFit(free, support, information, right, max(misfit, 0.0), n_rows)


def _normal_equations(
    problem: Problem, smoothed: list[Smooth], coefficients: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Compute normal equations of the weak form, (n, n) and (n,), sum of squares and row count."""
    n = len(problem.candidates)
    information, right, total, rows = np.zeros((n, n)), np.zeros(n), 0.0, 0
    for one in smoothed:
        if len(one.time) < GRID_PER_PERIOD:
            continue  # shorter than a test function
        count_work((6e-8 + 5e-11 * n) * n * len(one.time))
        a, b = whitened_weak_form(problem, one, coefficients)
        information, right = information + a.T @ a, right + a.T @ b
        total, rows = total + float(b @ b), rows + len(b)
    return information, right, total, rows


@dataclass(frozen=True)
class Start:
    """Starting point of all methods: cleaned recordings, smooth curves and a fit in weak form.

    Recordings and curves are those of `prepare_recordings`. period: the shortest of the motion, s.
    penalty: 2 ln N of N samples. samples: their number in the original recordings.
    """

    problem: Problem
    recordings: list[Recording]
    smoothed: list[Smooth]
    period: float
    penalty: float
    fit: WeakFit
    samples: int

    @cached_property
    def penalties(self) -> Penalties:
        """Penalty that each candidate term must outweigh in chi^2 to be selected.

        Terms are compared with the rates in the equations of the weak fit. The slopes of the curves
        contain noise, which increases with its frequency.
        """
        rates = design_matrix(self._values, self.problem.terms)
        rates = rates @ self.problem.coefficients(self.fit.free).T
        return self.problem.term_penalties(
            self.penalty, largest_coefficients(self.problem, self._values, rates)
        )

    @property
    def largest(self) -> np.ndarray:
        """Coefficient with which each term alone would be as large as the slope of the curves."""
        rates = [np.gradient(one.states, one.time, axis=0)[one.valid] for one in self.smoothed]
        return largest_coefficients(self.problem, self._values, np.concatenate(rates))

    @property
    def _values(self) -> np.ndarray:
        """Values of the smooth curves, (n, n_states + n_inputs)."""
        return np.concatenate([one.values[one.valid] for one in self.smoothed])


def make_start(problem: Problem, recordings: list[Recording], share: float = 1.0) -> Start:
    """Clean and smooth recordings and fit the weak form, as starting point of all methods.

    share: of their shortest period, as in `prepare_recordings`. Raises IdentificationError if there
    is no such starting point, or a term is not finite along the motion.
    """
    cleaned, smoothed, period = prepare_recordings(recordings, share)
    _check_functions(problem, smoothed)
    penalty = 2.0 * np.log(sum(recording.samples for recording in cleaned))
    fit, samples = weak_fit(problem, smoothed, penalty), sum(one.samples for one in recordings)
    return Start(problem, cleaned, smoothed, period, penalty, fit, samples)


def _check_functions(problem: Problem, smoothed: list[Smooth]) -> None:
    """Raise IdentificationError for a function of states that is not finite along the curves."""
    for curves, function in product(smoothed, problem.tables.functions):
        states = curves.states[curves.valid]
        argument = function.argument(states)
        name = term_name((*linear_term(-1, len(problem.states)), function), problem.states)
        if function.name == "inverse" and len(argument) and argument.min() <= 0 <= argument.max():
            text = function.argument_text(problem.states)
            raise IdentificationError(Code.TERM_INFINITE, name, argument=text)
        with np.errstate(over="ignore"):
            is_finite = np.isfinite(function(states)).all()
        if not is_finite:
            raise IdentificationError(Code.TERM_OVERFLOWS, name)


def rough_fit(start: Start) -> WeakFit:
    """Fit a model by its weak form; of long recordings, use only the most informative stretches.

    The errors of the weak form are small, but the same in every period of a limit cycle. Over many
    periods they outweigh the information of the transient.
    """
    stretches = [
        _most_informative_stretch(start.problem, one, start.period) for one in start.smoothed
    ]
    if all(stretch is one for stretch, one in zip(stretches, start.smoothed, strict=True)):
        return start.fit
    return weak_fit(start.problem, stretches, start.penalty)


def _most_informative_stretch(problem: Problem, smooth: Smooth, period: float) -> Smooth:
    """Find the stretch of some 1,000 periods in which the library moments are most diverse.

    The measure is the determinant of the moments (D-optimality, J. Kiefer and J. Wolfowitz, 1960).
    Returns the whole curve if it is shorter than two stretches. Of 70 candidates of the default
    line, 14 of them true, the weak form keeps 25 over the first 1,000 periods, and 63 over 40,000.
    """
    count = round_down((smooth.time[-1] - smooth.time[0]) / (1000 * period))
    if count < 2:
        return smooth
    scale = np.std(smooth.states, axis=0) + np.finfo(float).tiny
    scale = np.append(scale, np.ones(smooth.inputs.shape[1]))
    edges = np.linspace(0, len(smooth.time), count + 1).astype(int)
    stretches, diversity = [slice(a, b) for a, b in pairwise(edges)], []
    for rows in stretches:
        theta = design_matrix(smooth.values[rows][smooth.valid[rows]] / scale, problem.terms)
        diversity.append(np.linalg.slogdet(theta.T @ theta)[1])
    best = stretches[np.argmax(diversity)]
    selected = {name: getattr(smooth, name)[best] for name in ("time", "states", "valid", "inputs")}
    return replace(smooth, **selected)


def delayed_inputs(start: Start) -> dict[str, float]:
    """Find inputs recorded too early or too late relative to the motion, and their delays in s.

    Returns the delays by input name, negative if early. All candidates are fitted, so that no
    nearly correct model is needed. A delay counts if it removes most of the misfit of the weak form
    beyond the noise. Delays up to four of the shortest periods, and half the recording, are tried,
    which was not calibrated; four halvings determine a delay to a thirty-second of a period.
    """
    problem, n = start.problem, len(start.problem.candidates)
    coefficients, delays = problem.coefficients(start.fit.free), {}
    longest = max(np.ptp(one.time) for one in start.recordings)

    def misfit_of_delay(k: int, delay: float) -> tuple[float, int]:
        shifted_curves = []
        for recording, one in zip(start.recordings, start.smoothed, strict=True):
            inputs, delayed = one.inputs.copy(), recording.inputs[problem.inputs[k]]
            time = one.time + delay
            values = inputs_on_grid([delayed], time)[:, 0]
            inputs[:, k] = np.where(np.isnan(values), evaluate_extended(delayed, time), values)
            shifted_curves.append(replace(one, inputs=inputs))
        information, right, total, rows = _normal_equations(problem, shifted_curves, coefficients)
        return total - float(solve_support(information, right, np.ones(n, bool))[0] @ right), rows

    for k, name in enumerate(problem.inputs):
        (now, rows), best, step = misfit_of_delay(k, 0.0), 0.0, start.period / 2.0
        for reach in (8, 1, 1, 1, 1):
            trial_delays = best + step * np.arange(-reach, reach + 1)
            trial_delays = trial_delays[2.0 * np.abs(trial_delays) <= longest]
            misfits = [misfit_of_delay(k, delay)[0] for delay in trial_delays]
            best, step = float(trial_delays[np.argmin(misfits)]), step / 2.0
        if now - min(misfits) > max(start.penalty, (now - rows + n) / 2.0):
            delays[name] = best
    return delays
