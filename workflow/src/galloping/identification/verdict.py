"""Whether a fit may be trusted: misfit, residual spectrum, exchangeable terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from galloping.identification.condense import Condensed
from galloping.identification.problem import Problem
from galloping.polynomial import term_name

AMBIGUOUS = 6.0
PLAUSIBLE_TERM = 12.0
PLAUSIBLE_PAIR = 18.5
TOLERATED_SHARE = 1.0 / 60.0
SIGNIFICANCE = 1e-6
NEIGHBOURS = 15


@dataclass(frozen=True)
class Residue:
    """What the residuals of a fit show.

    chi2: mean square of the projected residuals, per degree of freedom, against the noise inside
    the windows; NaN where the windows hold too few samples to measure it. allowed: the largest
    chi2 that white noise would give at the chosen significance.
    line: ratio of the highest peak of the residuals' periodogram to its surroundings, with its
    frequency, Hz, recording and observed channel; expected: the largest ratio noise would give.
    correlation: of successive windows' mean residuals, the largest over channels.
    """

    chi2: float
    allowed: float
    line: float
    expected: float
    frequency: float
    recording: int
    channel: int
    correlation: float


def residue(condensed: Condensed, residual: np.ndarray, parameters: int) -> Residue:
    """Tests of the residuals (n_windows, n_observed, n_rows) of a fit with `parameters`."""
    squares = np.add.reduceat((residual**2).sum(axis=2), condensed.first[:-1], axis=0)
    spare = condensed.counts - condensed.rows
    measured = spare > 0.3 * np.maximum(condensed.counts, 1)
    inside = condensed.remainder / np.maximum(spare, 1)
    share = parameters / max(int(np.count_nonzero(condensed.counts)), 1)
    freedom = np.maximum(condensed.rows - share, 1.0)
    chi2, allowed = np.nan, np.nan
    if np.any(measured):
        floor = np.finfo(float).tiny
        chi2 = float(
            np.sum((squares / np.maximum(inside, floor))[measured]) / np.sum(freedom[measured])
        )
        spread = np.sqrt(2.0 / np.sum(freedom[measured]) + 2.0 / np.sum(spare[measured]))
        allowed = 1.0 + 5.0 * spread
    best = (0.0, np.inf, 0.0, 0, 0)
    correlation = 0.0
    for r, (a, b) in enumerate(zip(condensed.first[:-1], condensed.first[1:], strict=True)):
        for o in range(residual.shape[1]):
            series = residual[a:b, o, 0]
            power = float(series @ series)
            if b - a < 4 * NEIGHBOURS or power == 0.0:
                continue
            correlation = max(correlation, abs(float(series[1:] @ series[:-1])) / power)
            peak, place = _line(series)
            if peak > best[0]:
                frequency = place / ((b - a) * condensed.step)
                best = (peak, _expected_peak(condensed.first[-1]), frequency, r, o)
    return Residue(chi2, allowed, *best, correlation)


def _line(series: np.ndarray) -> tuple[float, int]:
    """Highest ratio of a periodogram bin to the mean of its neighbours, and the bin."""
    power = np.abs(np.fft.rfft(series)[1:]) ** 2
    around = np.ones(2 * NEIGHBOURS + 1)
    around[NEIGHBOURS - 2 : NEIGHBOURS + 3] = 0.0
    weight = np.convolve(np.ones(len(power)), around, mode="same")
    ratio = power / (np.convolve(power, around, mode="same") / weight)
    return float(ratio.max()), 1 + int(np.argmax(ratio))


def _expected_peak(windows: int) -> float:
    """Ratio exceeded with probability SIGNIFICANCE by the highest of that many bins of noise.

    A bin over the mean of m = 2 NEIGHBOURS - 4 others is F-distributed with (2, 2 m) degrees.
    """
    m = 2 * NEIGHBOURS - 4
    return m * ((SIGNIFICANCE / (2.0 * windows)) ** (-1.0 / m) - 1.0)


def exchange_reason(
    problem: Problem, exchanges: list[tuple[tuple[int, int], tuple[int, int], float]]
) -> str:
    """One line on exchanges of a found for an excluded (equation, term), '' where there is none."""
    parts = []
    for (equation, found), (other_equation, other), rise in exchanges:
        names = [term_name(problem.terms[j], problem.states) for j in (found, other)]
        rates = [f"d{problem.states[i]}/dt" for i in (equation, other_equation)]
        parts.append(f"{names[0]} in {rates[0]} for {names[1]} in {rates[1]} (chi2 {rise:+.1f})")
    return "the data cannot tell " + ", ".join(parts) if parts else ""


def addition_reason(
    problem: Problem, additions: list[tuple[tuple[tuple[int, int], ...], float]]
) -> str:
    """One line on excluded (equation, term) pairs that improve the fit, '' where there is none."""
    parts = []
    for pairs, fall in additions:
        names = [
            f"{term_name(problem.terms[j], problem.states)} in d{problem.states[i]}/dt"
            for i, j in pairs
        ]
        parts.append(f"{' with '.join(names)} (chi2 {-fall:+.1f})")
    return "below the limit of selection but plausible: " + ", ".join(parts) if parts else ""


def hidden_reason(
    problem: Problem, support: np.ndarray, limit: np.ndarray, theta: np.ndarray, rate: np.ndarray
) -> str:
    """One line on the absent term that could be the largest without being seen, '' if small.

    support: (n_states, n_terms). limit: (n_states, n_terms) the smallest coefficient that would
    have been found, for absent terms. theta, rate: root mean squares of the terms (n_terms,) and
    of the state derivatives (n_states,). Small is a share of TOLERATED_SHARE of the derivative.
    """
    share = np.where(support, 0.0, np.nan_to_num(limit, nan=0.0, posinf=np.inf)) * theta
    share = share / np.maximum(rate, np.finfo(float).tiny)[:, None]
    equation, term = np.unravel_index(np.argmax(share), share.shape)
    if share[equation, term] <= TOLERATED_SHARE:
        return ""
    name = term_name(problem.terms[term], problem.states)
    return (
        f"{name} in d{problem.states[equation]}/dt could make up {share[equation, term]:.1%} "
        "of it unseen"
    )
