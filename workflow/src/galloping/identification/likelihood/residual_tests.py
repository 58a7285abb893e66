"""Tests of the residuals of a fit, which decide whether it is reliable."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.special import ndtri

from galloping.arrays import TIME_ROUNDING
from galloping.identification.findings import Code, Finding
from galloping.identification.likelihood.condense import Condensed
from galloping.identification.preparation.smoothing import sampled_rates
from galloping.recording.samples import Recording

# Rate of false objections to white noise, by the highest of all its spectral lines or by a sum of
# squares.
FALSE_OBJECTION_RATE = 1e-6
# Number of bins on each side of a spectral line, relative to whose mean its height is measured. The
# mean has a relative standard deviation of a fifth.
NEIGHBOUR_BINS = 15
# Largest chi^2 per degree of freedom of noise that does not count as correlated over a few samples:
# a model error of this size would be refused by its spectrum. The power of correlated noise at the
# motion's frequencies may be up to this many times that at higher ones, and intervals widen by the
# root of the ratio. Noise correlated over a period has a larger ratio, and looks like motion.
MAX_COLOUR_RATIO = 2.0
# Least residual or noise, relative to its channel, that is not truncation (1e-7) or rounding.
MIN_RESIDUAL = 1e-5


@dataclass(frozen=True)
class ResidualDiagnostics:
    """Test statistics of the residuals of a fit, with their limits for white noise.

    chi2: mean square of the projected residuals, per degree of freedom, against the noise inside
    the windows; NaN if the windows contain too few samples to measure it. chi2_allowed: the largest
    that white noise would give. noise_known: whether the noise of any channel is known and need not
    be measured. band: power density of the residuals below 1.5/period over that above;
    band_allowed: the largest ratio that white noise would give. A model error shows below, at the
    frequencies of the motion. band_power: (n_recordings, n_observed) power density below, as the
    variance of a projection. excess: (n_recordings, n_observed) sum of squares below, less that
    with the density above. line: ratio of the highest peak of the residuals' periodogram to its
    surroundings; line_allowed: the largest that noise would give. frequency, Hz, and channel of
    that peak, by name, and its cycles in the recording.
    """

    chi2: float
    chi2_allowed: float
    noise_known: bool
    band: float
    band_allowed: float
    band_power: np.ndarray
    excess: np.ndarray
    line: float
    line_allowed: float
    frequency: float
    channel: str
    cycles: int

    @property
    def is_coloured(self) -> bool:
        """Whether the residuals show measurement noise that is correlated over a few samples."""
        return not self.noise_known and self.chi2 > max(MAX_COLOUR_RATIO, self.chi2_allowed)

    @property
    def objections(self) -> list[Finding]:
        """Reasons not to trust the fit, such as correlated residuals; empty if it is reliable.

        Noise correlated over a few samples may have up to twice the power at the motion's
        frequencies.
        """
        misfit: Any = {"band": self.band, "chi2": self.chi2}
        if self.line > self.line_allowed and self.cycles > 2:
            line = {"frequency_hz": self.frequency, **misfit}
            return [Finding.of(Code.RESIDUAL_LINE, self.channel, **line)]
        if self.line > self.line_allowed:
            return [Finding.of(Code.RESIDUAL_DRIFTS, self.channel, **misfit)]
        if self.band > (MAX_COLOUR_RATIO if self.is_coloured else self.band_allowed):
            code = Code.NOISE_CORRELATED if self.is_coloured else Code.RESIDUAL_POWER
            return [Finding.of(code, **misfit)]
        if self.noise_known and self.chi2 > max(MAX_COLOUR_RATIO, self.chi2_allowed):
            return [Finding.of(Code.NOISE_EXCEEDS_KNOWN, chi2=self.chi2)]
        return []


def diagnose_residuals(
    condensed: Condensed,
    residual: np.ndarray,
    parameters: int,
    period: float,
    recordings: Sequence[Recording],
) -> ResidualDiagnostics:
    """Test the residuals of a fit for whiteness and for their size against the noise.

    residual: (n_windows, n_observed, n_rows). parameters: number of parameters of the fit. period:
    the shortest of the motion, s. recordings: those of the fit, whose samples show the frequency of
    a spectral line that is too high for the windows. Channels whose residuals are below
    MIN_RESIDUAL are left out of the spectra.
    """
    limit = 1.5 * condensed.step / period * (1.0 - TIME_ROUNDING)  # a bin may be at the limit
    low, high, bins = [], [], np.zeros(2)
    lines = [(0.0, 0.0, 0, 0, 0)]  # height, frequency, channel, cycles, recording
    band_power, excess = np.full(condensed.rows.shape, np.nan), np.zeros(condensed.rows.shape)
    for r, (a, b) in enumerate(pairwise(condensed.first)):
        for o in range(residual.shape[1]):
            series, motion = residual[a:b, o, 0], condensed.motion[a:b, o, 0]
            sampled = np.count_nonzero(series)
            is_exact = np.linalg.norm(series) < MIN_RESIDUAL * np.linalg.norm(motion)
            if b - a < 4 * NEIGHBOUR_BINS or sampled < NEIGHBOUR_BINS or is_exact:
                continue
            power = np.abs(np.fft.rfft(series)[1:]) ** 2 / sampled
            is_low = np.arange(1, len(power) + 1) / (b - a) < limit
            band_power[r, o] = power[is_low].mean()
            rise = power[is_low].mean() - power[~is_low].mean()
            excess[r, o] = 2.0 * is_low.sum() * max(rise, 0.0)
            low.append(power[is_low].sum() / power.mean())
            high.append(power[~is_low].sum() / power.mean())
            bins += is_low.sum(), (~is_low).sum()
            peak, place = _highest_peak(power)
            lines.append((peak, place / ((b - a) * condensed.step), o, place, r))
    band, band_allowed = np.nan, np.nan
    if low:
        band = float(sum(low) / bins[0] / (sum(high) / bins[1]))
        band_allowed = _max_mean_square(np.sqrt(np.sum(1.0 / bins)))
    # a bin over the mean of m others is F-distributed with (2, 2 m) degrees; limit of the highest
    m = 2 * NEIGHBOUR_BINS - 4
    tested = residual.shape[1] * int(condensed.first[-1]) / 2.0
    line_allowed = m * ((FALSE_OBJECTION_RATE / tested) ** (-1.0 / m) - 1.0)
    line, frequency, channel, cycles, r = max(lines, key=lambda line: line[0])
    if line > line_allowed:
        one = recordings[r]
        samples = sampled_rates(one) if condensed.channels.is_rate[channel] else one.values
        values = samples[:, condensed.channels.observed[channel]]
        frequency = _unfold(one.time, values, frequency, 1.0 / condensed.step, line_allowed)
    return ResidualDiagnostics(
        *_chi2_inside(condensed, residual, parameters), bool(condensed.is_known.any()), band,
        band_allowed, band_power, excess, line, line_allowed, frequency,
        condensed.channels.names[channel], cycles,
    )  # fmt: skip


def _chi2_inside(
    condensed: Condensed, residual: np.ndarray, parameters: int
) -> tuple[float, float]:
    """Compute chi^2 per degree of freedom against the noise inside windows, and its limit."""
    squares = condensed.sum_squares(residual)
    spare = np.where(condensed.is_known, np.inf, condensed.counts - condensed.rows)
    has_noise = condensed.has_noise_estimate
    if not np.any(has_noise):
        return np.nan, np.nan
    variance = np.maximum(condensed.noise_variance[has_noise], np.finfo(float).tiny)
    share = parameters / max(int(np.count_nonzero(condensed.counts)), 1)
    freedom = np.maximum(condensed.rows[has_noise] - share, 1.0)
    spread = np.sqrt(2.0 / np.sum(freedom) + 2.0 / np.sum(spare[has_noise]))
    return float(np.sum(squares[has_noise] / variance) / np.sum(freedom)), _max_mean_square(spread)


def _max_mean_square(spread: float) -> float:
    """Compute the limit, exceeded at FALSE_OBJECTION_RATE, of a mean square with mean one.

    spread: standard deviation of the mean square.
    """
    return float(1.0 + np.ceil(-ndtri(FALSE_OBJECTION_RATE)) * spread)


def _unfold(
    time: np.ndarray, values: np.ndarray, frequency: float, rate: float, least: float
) -> float:
    """Find the frequency of a spectral line that means at a rate, Hz, fold to a given one.

    time, s, and values: (n,) the samples, at a higher rate. Of the frequencies that fold to the
    given one, the line has the highest power relative to its neighbours. least: height of a line
    that is no noise. If no line is higher, it is the given one, below half the sampling rate.
    """
    is_known = np.isfinite(values)
    time, values = time[is_known], values[is_known] - values[is_known].mean()
    sampling_rate = 1.0 / np.median(np.diff(time))
    places = np.round((time - time[0]) * sampling_rate).astype(int)
    if places[-1] > 10 * len(values):  # mostly gaps
        return frequency
    series = np.zeros(places[-1] + 1)
    series[places] = values
    heights = _peak_heights(np.abs(np.fft.rfft(series)[1:]) ** 2)
    multiples = rate * np.arange(1 + int(sampling_rate / rate))
    candidates = np.append(multiples + frequency, multiples - frequency)
    # the samples fold frequencies too
    candidates = np.abs(candidates - sampling_rate * np.round(candidates / sampling_rate))

    def height(candidate: float) -> float:
        place = int(candidate / sampling_rate * len(series) + 0.5) - 1
        return float(np.max(heights[max(place - 1, 0) : place + 2], initial=0.0))

    highest = max(candidates, key=height)
    return float(highest if height(highest) > least else candidates[0])


def _highest_peak(power: np.ndarray) -> tuple[float, int]:
    """Find the highest ratio of a periodogram bin to the mean of its neighbours.

    Returns the ratio and the bin; a ratio of zero if a record is too short to have so many
    neighbours.
    """
    if len(power) <= 2 * NEIGHBOUR_BINS:
        return 0.0, 1
    heights = _peak_heights(power)
    return float(heights.max()), 1 + int(np.argmax(heights))


def _peak_heights(power: np.ndarray) -> np.ndarray:
    """Compute the ratio of each periodogram bin, (n,), to the mean of its neighbours.

    The two bins beside a peak, into which it leaks, are left out.
    """
    window = np.ones(2 * NEIGHBOUR_BINS + 1)
    window[NEIGHBOUR_BINS - 2 : NEIGHBOUR_BINS + 3] = 0.0
    weight = np.convolve(np.ones(len(power)), window, mode="same")
    return power / (np.convolve(power, window, mode="same") / weight)
