"""What else moves a recorded line than its model: coefficients that fluctuate meanwhile, as gusts
vary the damping; and further modes.

Those of terms linear in a state whose equation is sought, of a line the dampings, vary about a
mean, each by itself, with a correlation that falls exponentially in time. Their variances, and
those of the jumps that are left between stretches, are estimated by expectation maximisation.
Each further mode is a line in the spectrum of what the model leaves, above the frequencies of the
motion, where errors of the model itself are small: a sinusoid that grows or decays exponentially.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from galloping.identification.likelihood.condense import WINDOWS_PER_PERIOD, Condensed
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.residual_tests import NEIGHBOURS, RESIDUAL_RATE, ROUNDING
from galloping.identification.likelihood.selection import select, solve_support
from galloping.identification.likelihood.weak_constraint import (
    STRETCH_PERIODS,
    Linear,
    Stretches,
    StretchFit,
    integrable,
    joint,
    jump_covariance,
)
from galloping.identification.model import FurtherMode
from galloping.identification.work import is_spent
from galloping.passes import passing
from galloping.polynomial import velocity_pairs

# Parts of a stretch in which coefficients are constant: a tenth of the correlation. Measured: with
# ten parts the slow mode seems to fluctuate as well.
PARTS = 24
# Correlation of a fluctuation with itself one part later: it falls over four periods. Measured:
# dampings and amplitudes in gusts are as good with the true spectrum of the wind as with 2 to 7.
MEMORY = np.exp(-STRETCH_PERIODS / (PARTS * 4.0))


def chosen(
    problem: Problem,
    information: np.ndarray,
    right: np.ndarray,
    support: np.ndarray,
    penalty: float,
) -> np.ndarray:
    """The terms that are worth their penalty, looked for from all and from those before.

    With a term comes what the library has of it with other powers of the inputs: a recording about
    one mean wind hardly tells them apart, and to leave one out would claim a law for other winds.
    """
    tried, about = [np.ones(len(right), bool), support], problem.chosen_about()
    return problem.alike(select(information, right, tried, penalty, about))


def fluctuating(fit: StretchFit, penalty: float) -> tuple[StretchFit, np.ndarray] | None:
    """The fit with means of coefficients that fluctuate, the terms chosen with them, and the
    covariance of the means (n_support, n_support).

    fit: of the whole library. None unless fluctuations explain most of what it leaves beyond the
    noise: where it lacks something else, such as modes that a sensor sees besides, they would take
    part of that for themselves. None, too, where segments are too short or too many to be divided,
    or no term is left. Raises FloatingPointError or LinAlgError where the iteration diverges.
    penalty: worth of a term in units of chi^2, were the model exact.
    """
    record, problem = fit.record, fit.record.problem
    equation, term = problem.candidates.T
    exponents = np.array(problem.terms)[term]
    of_rate = exponents[:, np.unique(equation)].sum(axis=1) == 1
    rates = np.flatnonzero((np.abs(exponents).sum(axis=1) == 1) & of_rate)
    misfit = record.white_misfit(fit.linear.residual)
    excess = _excess(record, misfit)
    windows = np.diff(record.segments.first)
    divisible = windows.min() >= PARTS and len(windows) <= 200  # a part needs 50 kB and more
    if not (len(rates) and excess > 0.0 and divisible):
        return None
    parts, jumping = _parts(record)
    size = np.sqrt(np.mean(record.states**2, axis=0)) + np.finfo(float).tiny
    period = WINDOWS_PER_PERIOD * record.condensed.step
    # of each coefficient that fluctuates: the rate of the motion, by the sizes of the states
    unit = 2.0 * np.pi / period * size[equation[rates]] / size[exponents[rates].argmax(axis=1)]
    variance, least, passes = (2e-3 * unit) ** 2, (1e-6 * unit) ** 2, 4
    fine = replace(fit, record=parts, starts=parts.starts, misfit=misfit)
    for passed in range(passes):
        if is_spent():
            return None
        passing("try coefficients that fluctuate")
        misfit = parts.white_misfit(fine.linear.residual)
        # fluctuations explain 0.56 or more of what is left where gusts are all that the library
        # lacks, 0.32 to 0.50 on a line with more modes in the same gusts, of which the terms that
        # are then chosen imitate the modes, and 0.06 or less without gusts
        if passed and not excess - _excess(record, misfit) >= 0.53 * excess:
            return None
        wider = _with_fluctuations(fine.linear, rates)
        support, jump = fine.support, fine.jump
        for settling in reversed(range(5)):
            precision = _precision(parts, jumping, jump, size, variance)
            solved = joint(parts, _stationary(parts, wider, variance), precision)
            right = solved.right + solved.information @ fine.free
            if not settling and 0 < passed < passes - 1:
                support = chosen(problem, solved.information, right, support, penalty)
            free, covariance = solve_support(solved.information, right, support)
            change = free - fine.free
            jump = jump_covariance(parts, wider, solved, change, jumping)
            step = solved.moved(change)
            own = np.diagonal(solved.variance, axis1=1, axis2=2) + step**2
            variance = np.maximum(own[:, len(size) :].mean(axis=0), least)
        free, starts = fine.free + change, fine.starts + step[:, : len(size)]
        fine = integrable(fine, StretchFit(parts, free, support, starts, misfit, jump))
    if not fine.support.any():
        return None
    return replace(fit, free=fine.free, support=fine.support), covariance


def _excess(record: Stretches, misfit: np.ndarray) -> float:
    """Logarithm of a white misfit over noise, of the channels whose samples tell theirs, summed."""
    condensed = record.condensed
    noise = np.maximum(condensed.noise_variance, record.floor**2)
    return float(np.sum(np.log(misfit[:, 0, :, 0] / noise)[condensed.tells_noise]))


def _parts(record: Stretches) -> tuple[Stretches, np.ndarray]:
    """The record in parts of its segments, and those after which it may jump: the last ones of a
    segment that another one follows.
    """
    segments = record.segments
    first = np.linspace(segments.first[:-1], segments.first[1:], PARTS, endpoint=False, axis=1)
    first = np.append(first.round().astype(np.int64), segments.first[-1])
    owner = np.repeat(segments.recording, PARTS)
    jumping = PARTS * (record.followed + 1) - 1
    return replace(record, segments=replace(segments, first=first, recording=owner)), jumping


def _with_fluctuations(linear: Linear, rates: np.ndarray) -> Linear:
    """The normal equations with the fluctuations of each segment added to its state.

    In a segment a fluctuation acts as its coefficient does.
    """
    n, extra = linear.by_coefficients.shape[2], len(rates)
    n_states = linear.ends.shape[1]
    twice = np.append(np.arange(n + n_states), rates)
    by_state = np.zeros((len(linear.ends), n_states + extra, n_states + extra))
    by_state[:, :n_states, :n_states] = linear.by_state
    by_state[:, :n_states, n_states:] = linear.by_coefficients[:, :, rates]
    by_state[:, n_states:, n_states:] = MEMORY * np.eye(extra)
    return Linear(
        linear.free,
        np.pad(linear.starts, ((0, 0), (0, extra))),
        linear.information[:, twice][:, :, twice],
        linear.right[:, twice],
        linear.residual,
        np.pad(linear.ends, ((0, 0), (0, extra))),
        np.pad(linear.by_coefficients, ((0, 0), (0, extra), (0, 0))),
        by_state,
    )


def _stationary(record: Stretches, linear: Linear, variance: np.ndarray) -> Linear:
    """The same with fluctuations of that variance where each recording begins."""
    information = linear.information.copy()
    own = slice(information.shape[1] - len(variance), None)
    information[record.begins, own, own] += np.diag(1.0 / variance)
    return replace(linear, information=information)


def _precision(
    record: Stretches, jumping: np.ndarray, jump: np.ndarray, size: np.ndarray, variance: np.ndarray
) -> np.ndarray:
    """Of state and fluctuations from each segment to the next: states jump after `jumping` only."""
    n_states, extra = len(size), len(variance)
    precision = np.zeros((len(record.size), n_states + extra, n_states + extra))
    states = record.precision(np.diag((1e-4 * size) ** 2))  # as good as continuous
    states[jumping] = record.precision(jump)[jumping]
    precision[:, :n_states, :n_states] = states
    precision[:, n_states:, n_states:] = np.diag(1.0 / ((1.0 - MEMORY**2) * variance))
    return precision


def further_modes(
    states: tuple[str, ...], condensed: Condensed, residual: np.ndarray
) -> tuple[FurtherMode, ...]:
    """The oscillations that stand out of what a model leaves, each recording and channel by itself.

    residual: (n_windows, n_observed, n_rows) projections of the samples less those of the model,
    not finite where it diverges. Channels that measure the rate of another one are left out.
    """
    found: list[FurtherMode] = []
    own = [int(i) for i in condensed.observed[~condensed.is_rate]]
    rates = {v for i, v in velocity_pairs(states).items() if i in own}
    weights = condensed.samplings[:, :, 0, 0]
    for r, (a, b) in enumerate(pairwise(condensed.first)):
        for o, i in enumerate(condensed.observed):
            left, data = residual[a:b, o, 0], condensed.targets[a:b, o, 0]
            sampled = np.flatnonzero((weights[a:b, o] > 0.0) & np.isfinite(left))
            exact = np.linalg.norm(left[sampled]) < ROUNDING * np.linalg.norm(data)
            few = len(sampled) < max((b - a) / 2, NEIGHBOURS)
            if condensed.is_rate[o] or int(i) in rates or exact or few:
                continue
            means = left[sampled] / weights[a:b, o][sampled]
            main = 1 + np.argmax(np.abs(np.fft.rfft(data)[1:]))
            lowest = 1.5 * main / (b - a) / condensed.step  # below, errors of the model are
            time = condensed.step * (sampled + 0.5)
            modes = _oscillations(time, means, condensed.step, lowest)
            found += [FurtherMode(r, states[i], *mode) for mode in modes]
    return tuple(found)


def modes_in_words(modes: tuple[FurtherMode, ...]) -> str:
    """Further modes as the end of a reason, '' where there are none."""
    lines: dict[str, set[str]] = {}
    for mode in modes:
        lines.setdefault(mode.state, set()).add(f"{mode.frequency / (2.0 * np.pi):.3g}")
    parts = [f"{state} at {', '.join(sorted(hz, key=float))} Hz" for state, hz in lines.items()]
    return f"; besides it there oscillates {', and '.join(parts)}" if parts else ""


def _oscillations(
    time: np.ndarray, values: np.ndarray, window: float, lowest: float
) -> list[tuple[float, float, float, float]]:
    """Frequency, growth, cosine and sine of four at most, the strongest first, as in `FurtherMode`.

    values: (n,) means over windows, s, about the times (n,), of which some may be missing. lowest:
    frequency, Hz.
    """
    found = []
    duration = time[-1] - time[0] + window
    for _ in range(4):
        regular = np.zeros(round(duration / window))
        regular[((time - time[0]) / window).round().astype(int)] = values
        power = np.abs(np.fft.rfft(regular)[1:]) ** 2
        frequency = np.arange(1, len(power) + 1) / duration
        band = (frequency > lowest) & (frequency < 0.4 / window)  # above, a mean tells little
        if not band.any():
            break
        # bins of noise are exponentially distributed, with a median of ln 2 of their mean
        most = np.median(power[band]) / np.log(2.0) * np.log(band.sum() / RESIDUAL_RATE)
        place = np.argmax(np.where(band, power, 0.0))
        if not power[place] > most:
            break
        *mode, fitted = _fitted(time, values, 2.0 * np.pi * frequency[place])
        rest = values - fitted
        if rest @ rest > 0.9 * (values @ values):
            break  # a mode that takes a tenth of what is left is worth a word
        omega, growth, cosine, sine = mode
        inside = np.sinc(omega * window / (2.0 * np.pi))  # of it is left in the mean over a window
        found.append((omega, growth, cosine / inside, sine / inside))
        values = rest
    return found


def _fitted(
    time: np.ndarray, values: np.ndarray, frequency: float
) -> tuple[float, float, float, float, np.ndarray]:
    """The best oscillation near `frequency`, rad/s, as in `FurtherMode`, and its values (n,)."""
    duration = time[-1] - time[0]

    def basis(place: np.ndarray) -> np.ndarray:
        # in units of its size at the middle, so that neither end is lost in rounding
        size = np.exp(place[0] * (time / duration - 0.5))
        angle = (frequency + place[1] / duration) * time
        return size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])

    def solved(place: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(basis(place), values, rcond=None)[0]

    def left(place: np.ndarray) -> np.ndarray:
        return values - basis(place) @ solved(place)

    most = np.array([20.0, 2.0 * np.pi])  # with more growth it is the end of a record alone
    tried = [
        least_squares(left, [growth, 0.0], bounds=(-most, most)) for growth in (0.0, 3.0, -3.0)
    ]
    best = min(tried, key=lambda each: each.cost).x
    cosine, sine = solved(best) * np.exp(-best[0] / 2.0)
    rate = best[0] / duration
    return frequency + best[1] / duration, rate, cosine, sine, basis(best) @ solved(best)
