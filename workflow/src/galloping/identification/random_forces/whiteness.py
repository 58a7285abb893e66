"""Whiteness tests of the innovations of a fit in random forces, and frequencies of deviations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, fdtri

from galloping.identification.findings import Code, Finding, Severity
from galloping.identification.random_forces.start import sample_correlations
from galloping.model.intervals import FALSE_ALARM_RATE

MAX_LAG_PERIODS = 3.0  # longest tested lag, in slowest periods
MAX_LAGS = 100  # longest tested lag, in steps
BINS_PER_GROUP = 16  # number of bins of a spectrum in a group, which is as broad as a missing mode
NEIGHBOURS = 8  # number of groups nearby with which a group is compared
# Least number of sums of innovations in a period of the fastest mode. Sums of two or more are
# tested if a period has at least twice as many samples.
MIN_SUMS_PER_PERIOD = 32
# Number of groups of equally many values of a quantity on which innovations may depend.
VALUE_GROUPS = 16
# Largest share of the innovations' power that their past predicts in a sound model.
SOUND_PREDICTED_SHARE = 0.02
# Limits of the frequencies of spectral lines that affect the results on modes, relative to the
# slowest and to the fastest mode.
MODE_BAND = (0.5, 2.0)
# Least height of a line elsewhere that counts as another motion, relative to what chance allows.
DISTANT_LINE_RATIO = 2.0

# Highest spectral line of nearly white innovations, of which random forces are accepted as the
# cause, relative to what chance allows. Measured: limit cycles of overhead lines, also in gusts,
# leave spectral lines 60 to 200 times as high as chance allows.
MAX_LINE = 10.0
# Largest share of the power of nearly white innovations that their past predicts.
MAX_PREDICTED_SHARE = 0.05
# Largest share of the innovations' power that their past predicts if no other model is found.
FALLBACK_SHARE = 1.0 / 3.0
# Largest innovation that random forces cause, in standard deviations. Normal innovations reach 5 in
# 1e6 samples; those of gusts and traffic reach more. A clock that is set by 0.7 s in a motion of
# metres causes 15. With 7 and with 14 no answer of `make exam` changes.
MAX_INNOVATION = 10.0


@dataclass(frozen=True)
class Whiteness:
    """Results of tests whether standardised innovations are white noise.

    statistic, allowed: of the correlations of innovations, over their degrees of freedom.
    predicted: share of their power that their past predicts. frequency: Hz, of the highest peak of
    their spectrum; channel: index; peak: over its surroundings, peak_allowed: largest by chance at
    all frequencies of all channels. is_near_modes: whether modes oscillate there. largest:
    innovation, in deviations; jump_time: s, from the beginning of its recording; jump_channel:
    index. dependence: the state or input on which the innovations depend, as for a force that the
    library lacks; '' none.
    """

    statistic: float
    allowed: float
    predicted: float
    frequency: float
    channel: int
    peak: float
    peak_allowed: float
    is_near_modes: bool
    largest: float = 0.0
    jump_time: float = 0.0
    jump_channel: int = 0
    dependence: str = ""

    def to_finding(self, channels: Sequence[str]) -> Finding:
        """Return a finding that names the main deviation from white noise; channels: names."""
        if self.dependence:
            return Finding.of(Code.FORCE_MISSING, self.dependence)
        if self.has_jump:
            channel = channels[self.jump_channel]
            return Finding.of(
                Code.INNOVATION_JUMPS, channel, after_s=self.jump_time, size=self.largest
            )
        if self.shows_line:
            channel = channels[self.channel]
            return Finding.of(Code.RESIDUAL_MODE, channel, frequency_hz=self.frequency)
        severity = Severity.INEXACT if self.is_relevant else Severity.NOTE
        return Finding(Code.FORCES_NOT_WHITE, severity, data={"share": self.predicted})

    @property
    def shows_line(self) -> bool:
        """Whether the spectrum of the innovations has a higher peak than chance allows."""
        return self.peak > (1.0 if self.is_near_modes else DISTANT_LINE_RATIO) * self.peak_allowed

    @property
    def has_jump(self) -> bool:
        """Whether a single innovation is larger than random forces and noise allow."""
        return self.largest > MAX_INNOVATION

    @property
    def has_other_cause(self) -> bool:
        """Whether innovations have a line or a jump, or depend on a state or an input."""
        return self.shows_line or self.has_jump or bool(self.dependence)

    @property
    def is_white(self) -> bool:
        """Whether all tests accept the innovations as white noise."""
        return self.statistic <= self.allowed and not self.has_other_cause

    @property
    def is_reported(self) -> bool:
        """Whether a deviation from white noise is stated: not if it is 0.0 % of the power."""
        return not self.is_white and (self.has_other_cause or round(self.predicted, 3) > 0.0)

    @property
    def may_be_random(self) -> bool:
        """Whether the innovations are white enough for a motion that random forces drive."""
        is_small = self.peak < MAX_LINE * self.peak_allowed and self.predicted < MAX_PREDICTED_SHARE
        return is_small or not self.is_relevant

    @property
    def explains_most(self) -> bool:
        """Whether random forces explain most of the motion, without a clear other cause."""
        is_small = self.peak < MAX_LINE * self.peak_allowed and self.predicted < FALLBACK_SHARE
        return is_small and not self.dependence

    @property
    def is_relevant(self) -> bool:
        """Whether the deviations from white noise are large enough to affect the model."""
        return self.predicted > SOUND_PREDICTED_SHARE or self.has_other_cause


def assess_whiteness(grids: list[np.ndarray], step: float, modes: np.ndarray) -> Whiteness:
    """Test whether standardised innovations on a uniform time grid are white noise.

    grids: (n, n_channels) each, NaN where missing. step: s. modes: Hz, of the model. With many
    samples in a period, each innovation shows mostly sensor noise and hardly any force. Therefore
    sums of several innovations, which are as white, are tested as well.
    """
    tests = _assess_grids(grids, step, modes)
    many = int(1.0 / (modes.max() * step * MIN_SUMS_PER_PERIOD))
    summed = [grid for grid in grids if len(grid) >= many]
    if many >= 2 and summed:
        sums = _assess_grids([_sum_groups(grid, many) for grid in summed], many * step, modes)
        tests = max(tests, sums, key=lambda each: each.predicted)
    sizes = [np.nan_to_num(np.abs(grid)) for grid in grids]
    largest = max(sizes, key=lambda size: float(size.max()))
    row, channel = map(int, np.unravel_index(np.argmax(largest), largest.shape))
    size = float(largest.max())
    return replace(tests, largest=size, jump_time=float(row * step), jump_channel=channel)


def _sum_groups(grid: np.ndarray, many: int) -> np.ndarray:
    """Sum every `many` rows, scaled to the variance of one."""
    parts = grid[: len(grid) // many * many].reshape(-1, many, grid.shape[1])
    counts = np.isfinite(parts).sum(axis=1)
    return np.nansum(parts, axis=1) / np.sqrt(np.where(counts, counts, np.nan))


def _assess_grids(grids: list[np.ndarray], step: float, modes: np.ndarray) -> Whiteness:
    """Test all pairs of channels by the statistic of G. Ljung and G. Box (Biometrika 65, 1978)."""
    channels = grids[0].shape[1]
    lags = int(np.clip(MAX_LAG_PERIODS / modes.min() / step, 4, MAX_LAGS))
    products, counts = (lagged[1:] for lagged in sample_correlations(grids, lags))
    power = np.nanmean(np.concatenate(grids) ** 2, axis=0)
    scale = np.maximum(np.sqrt(np.outer(power, power)), np.finfo(float).tiny)
    correlation = products / scale
    freedom = int(np.count_nonzero(counts))
    statistic = float(np.sum(correlation**2 * counts)) / max(freedom, 1)
    allowed = float(chdtri(freedom, FALSE_ALARM_RATE) / freedom)
    beyond = np.maximum(correlation**2 - 1.0 / np.maximum(counts, 1.0), 0.0)  # beyond chance
    is_correlated = correlation**2 * counts > chdtri(1, FALSE_ALARM_RATE)
    predicted = float(np.sum(beyond[is_correlated])) / channels
    peak, frequency, channel = _find_peak(grids, step)
    bins = max(sum(len(grid) // 2 // BINS_PER_GROUP for grid in grids) * channels, 1)
    freedom_beside = 2 * BINS_PER_GROUP * NEIGHBOURS
    return Whiteness(
        statistic, allowed, predicted, frequency, channel, peak,
        float(fdtri(2 * BINS_PER_GROUP, freedom_beside, 1.0 - FALSE_ALARM_RATE / bins)),
        MODE_BAND[0] * modes.min() < frequency < MODE_BAND[1] * modes.max(),
    )  # fmt: skip


def find_dependence(errors: np.ndarray, before: np.ndarray) -> int | None:
    """Find the known quantity on which innovations significantly depend, as a column index.

    before: (n, m) quantities known before each innovation. Standardised innovations (n, n_channels)
    of a right model are independent of everything known before each. The test is on their means in
    VALUE_GROUPS of equally many values. None if innovations depend on no column.
    """
    tests, most, dependence = errors.shape[1] * before.shape[1], 0.0, None
    for k, column in enumerate(before.T):
        for error in errors.T:
            is_known = np.isfinite(error) & np.isfinite(column)
            if is_known.sum() < 10 * VALUE_GROUPS:
                continue
            values, error = column[is_known], error[is_known]
            edges = np.unique(np.quantile(values, np.arange(1, VALUE_GROUPS) / VALUE_GROUPS))
            group = np.searchsorted(edges, values, side="right")
            total, square = (np.bincount(group, error**power) for power in (1, 2))
            has_values = square > 0.0
            statistic = np.sum(total[has_values] ** 2 / square[has_values])
            excess = statistic / chdtri(has_values.sum(), FALSE_ALARM_RATE / tests)
            if excess > max(most, 1.0):
                most, dependence = excess, k
    return dependence


def _find_peak(grids: list[np.ndarray], step: float) -> tuple[float, float, int]:
    """Find the largest ratio of a group of bins to NEIGHBOURS groups nearby, and its place."""
    peak = (0.0, np.nan, 0)
    for grid in grids:
        power = np.abs(np.fft.rfft(np.nan_to_num(grid), axis=0)[1:]) ** 2
        groups = len(power) // BINS_PER_GROUP
        if groups < 12:
            continue
        means = power[: groups * BINS_PER_GROUP].reshape(groups, BINS_PER_GROUP, -1).mean(axis=1)
        for k in range(groups):
            first = min(max(k - NEIGHBOURS // 2 - 1, 0), groups - NEIGHBOURS - 3)
            rows = [j for j in range(first, first + NEIGHBOURS + 3) if abs(j - k) > 1][:NEIGHBOURS]
            ratio = means[k] / np.maximum(means[rows].mean(axis=0), np.finfo(float).tiny)
            c = int(np.argmax(ratio))
            if ratio[c] > peak[0]:
                middle = k * BINS_PER_GROUP + (BINS_PER_GROUP + 1) / 2
                peak = float(ratio[c]), middle / len(grid) / step, c
    return peak
