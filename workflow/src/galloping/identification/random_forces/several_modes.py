"""Modes of recordings with more modes than coordinates, and selections of them.

A selection contains the slowest modes; faster ones are filtered out of the recordings. If the next
mode is too close for a filter, it stays in the model, as a force that oscillates.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter

import numpy as np
from scipy.special import chdtri

from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import attempt
from galloping.identification.oscillations import MIN_MODE_PERIODS
from galloping.identification.preparation.channels import Channels
from galloping.identification.preparation.screening import prepare_recordings
from galloping.identification.random_forces.low_pass import (
    PASS_BAND_EDGE,
    ROLL_OFF,
    low_pass_recordings,
)
from galloping.identification.random_forces.start import (
    above_noise,
    amplitude_fluctuates,
    estimate_spectra,
    place_on_grids,
)
from galloping.model.modes import Modes
from galloping.recording.samples import Recording

# Limits of a cut-off: highest frequency that the filter leaves unchanged, relative to the last mode
# that is kept, and cut-off relative to the next mode.
CUTOFF_LIMITS = (1.04, 0.93)
# Least ratio of a mode's peak in a spectrum to the median nearby. Noise in means of four bins has
# such a peak once in ten million.
MIN_PEAK_RATIO = 6.0
MEDIAN_WIDTH = 1.25  # largest ratio of frequencies in this median to that of the peak
PEAK_WIDTH = 1.1  # largest ratio of the frequencies of peaks that count as one mode
MAX_MEDIANS = 2000  # most frequencies of a spectrum at which medians are computed
# Limits of the next mode's frequency that a filter separates, relative to the last mode kept.
SEPARABLE_RATIOS = (1.6, np.inf)
CLOSE_RATIOS = (1.0, 1.6)  # limits of the next mode's frequency if a filter affects the dampings
# Cut-off if no faster mode is to be removed, relative to the fastest mode's frequency.
OPEN_CUTOFF_RATIO = 3.0
# Largest share of samples that are left by a filter, if it is used although it keeps all modes.
MAX_KEPT_SHARE = 0.5
MAX_FURTHER_MODES = 3  # most modes of a model beside those of its coordinates
# Largest damping ratio of a mode that cannot be two that overlap.
MAX_SINGLE_DAMPING = 0.02
# Highest line of the innovations of a single mode, relative to what chance allows. One of three
# sound models has a higher line.
MAX_SINGLE_LINE = 0.75
# Rate of false pairs of modes from noise, over all frequencies.
FALSE_SPLIT_RATE = 1e-7
# Least ratio of a frequency to a coordinate's main one. Cubic terms cause motion at a ratio of
# three.
MIN_FREQUENCY_RATIO = 3.5
MIN_POWER_SHARE = 0.2  # least share of a velocity's power that the faster peaks have
LEAKAGE_FACTOR = 2.0  # factor on the estimated leakage by gaps, which may be larger by chance


@dataclass(frozen=True)
class ModeSelection:
    """Recordings, low-pass filtered to a selection of modes, and the frequencies of these modes.

    recordings, period: as of `prepare_recordings`, s. n_further: number of modes beyond the
    coordinates. modes: Hz, selected ones, empty if none are. faster: Hz, modes that are left
    out. below: Hz, above which motion is left out; None if all of it is in the recordings.
    """

    recordings: list[Recording]
    period: float
    n_further: int = 0
    modes: tuple[float, ...] = ()
    faster: tuple[float, ...] = ()
    below: float | None = None

    def has_modes_of(self, identified: IdentifiedModel) -> bool:
        """Decide whether every mode of a model is near the frequency of a selected mode."""
        beside = (each.frequency for each in identified.resonances if each.is_mode)
        omega = np.array([*_linear_modes(identified).omega, *beside])
        ratios = omega[:, np.newaxis] / (2.0 * np.pi * np.array(self.modes))
        return bool(np.all(np.abs(np.log(ratios)).min(axis=1) < 1.5 * np.log(PEAK_WIDTH)))

    def with_omissions(self, identified: IdentifiedModel) -> IdentifiedModel:
        """Add to a model a finding that names the frequencies removed by the filter.

        The cut-off frequency is added to its diagnostics as `below`.
        """
        if self.below is None:
            return identified
        if self.faster:
            modes = ", ".join(f"{each:.2g}" for each in self.faster)
            left_out = Finding.of(Code.FASTER_MODES_LEFT_OUT, modes=modes, below_hz=self.below)
        else:
            left_out = Finding.of(Code.FASTER_LEFT_OUT, below_hz=self.below)
        diagnostics = {**identified.diagnostics, "below": self.below}
        return replace(identified, diagnostics=diagnostics).with_findings(left_out)


@dataclass(frozen=True)
class SeveralModes:
    """Recordings with possibly more modes than coordinates, and selections of these modes.

    The recordings are those of `prepare_recordings`. Nothing is selected if there are inputs, or if
    random forces need not have moved the recordings.
    """

    recordings: list[Recording]
    period: float

    @property
    def whole(self) -> ModeSelection:
        """Selection of all modes: the recordings without a filter."""
        return ModeSelection(self.recordings, self.period)

    @cached_property
    def modes(self) -> list[float]:
        """Frequencies of the modes, Hz, the lowest first; empty if there are inputs."""
        return [] if self.recordings[0].inputs else find_peaks(*place_on_grids(self.recordings))

    @cached_property
    def channels(self) -> Channels:
        """Measured states and rates of the recordings."""
        return Channels.from_recordings(self.recordings)

    def slowest(self, apart: tuple[float, float] = SEPARABLE_RATIOS) -> Iterator[ModeSelection]:
        """Yield recordings filtered to the slowest modes, as many as there are coordinates.

        Nothing is yielded if there are no more modes than coordinates. apart: limits of the next
        mode, as multiples of the last of these modes.
        """
        count = len(self.channels.pairs)
        return self._selections([count] if len(self.modes) > count else [], apart)

    def more(self) -> Iterator[ModeSelection]:
        """Yield recordings filtered to more modes than there are coordinates, all modes first.

        The order is: all modes, one more than visible, then the slowest. Accelerations also show
        forces at frequencies far above all modes, where forces are not white. These frequencies are
        therefore removed, even if there are no more modes than coordinates. They are also removed
        if a mode has many samples in a period.
        """
        n, n_modes = len(self.channels.pairs), len(self.modes)
        more = range(n + 1, min(n + MAX_FURTHER_MODES, n_modes + 1) + 1)
        same = [n] if self.channels.rates and n >= n_modes else []
        counts = [*same, *sorted(more, key=lambda k: (k < n_modes, k))]
        return self._selections(counts, (1.0, np.inf))

    def _selections(
        self, counts: Iterable[int], apart: tuple[float, float]
    ) -> Iterator[ModeSelection]:
        """Select as many of the slowest modes as each of `counts`; apart: as of `_filter_edges`."""
        step = max(each.step for each in self.recordings)
        fastest = (1.0 + ROLL_OFF) / (2.2 * step)  # highest cut-off of a filter, Hz
        for k in counts:
            for cutoff in _filter_edges(self.modes, k, fastest, apart):
                selection = attempt(self._select, k, cutoff)
                if isinstance(selection, ModeSelection):
                    yield selection

    def _select(self, k: int, cutoff: float) -> ModeSelection | None:
        """Select the slowest k modes, without what is faster than `cutoff`, Hz."""
        recordings, modes = self.recordings, self.modes
        n_further, frequencies = k - len(self.channels.pairs), tuple(modes[:k])
        slow = low_pass_recordings(recordings, cutoff)
        period = prepare_recordings(slow)[2]
        if not amplitude_fluctuates(slow, period):  # such as a limit cycle without harmonics
            return None
        samples, kept_samples = (sum(len(one.time) for one in each) for each in (recordings, slow))
        if k >= len(modes) and not (self.channels.rates or kept_samples < MAX_KEPT_SHARE * samples):
            return ModeSelection(recordings, self.period, n_further, frequencies)
        return ModeSelection(slow, period, n_further, frequencies, tuple(modes[k:]), cutoff)


def may_have_split_mode(identified: IdentifiedModel) -> bool:
    """Decide whether a mode is so heavily damped that it may be two close modes fitted as one.

    The innovations then are less white than those of most sound models. With inputs no further mode
    is sought.
    """
    if identified.model.inputs:
        return False
    names = ("innovations", "innovations_allowed", "innovations_line", "innovations_line_allowed")
    statistic, allowed, line, line_allowed = (float(identified.diagnostics[name]) for name in names)
    dampings = (each.damping for each in identified.resonances if each.is_mode)
    return max(*_linear_modes(identified).damping, *dampings) > MAX_SINGLE_DAMPING and (
        statistic > 0.5 * (1.0 + allowed) or line > MAX_SINGLE_LINE * line_allowed
    )


def splits_mode(split: IdentifiedModel, identified: IdentifiedModel) -> bool:
    """Decide whether splitting a mode into two close modes makes a model clearly more likely.

    One broad mode in the middle of two overlapping ones leaves innovations that are nearly white.
    """
    if split.status != "ok" or not all(each.is_mode for each in split.resonances):
        return False
    before, after = (float(one.diagnostics["log_likelihood"]) for one in (identified, split))
    freedom = 3 + len(identified.forces.nonzero()[0]) + len(identified.resonances)
    return bool(2.0 * (after - before) > chdtri(freedom, FALSE_SPLIT_RATE))


def _filter_edges(
    modes: list[float], k: int, fastest: float, apart: tuple[float, float]
) -> Iterator[float]:
    """Yield cut-off frequencies, Hz, up to `fastest`, that keep the first k of some modes, Hz.

    apart: limits of the next mode, which is removed, as multiples of the last one.
    """
    if 0 < k < len(modes):
        least, most = CUTOFF_LIMITS[0] / PASS_BAND_EDGE * modes[k - 1], CUTOFF_LIMITS[1] * modes[k]
        if least <= most and apart[0] < modes[k] / modes[k - 1] <= apart[1]:
            # far from both limits or, for broad modes, far from the faster mode
            for share in (0.5, 0.1):
                yield float(f"{least ** (1.0 - share) * most**share:.3g}")
    elif modes:
        yield float(f"{min(OPEN_CUTOFF_RATIO * modes[-1], fastest):.3g}")


def _linear_modes(identified: IdentifiedModel) -> Modes:
    """Compute the modes of the linear part of a model."""
    return identified.model.small_motions(np.zeros(len(identified.model.states)))


def find_peaks(step: float, grids: list[np.ndarray]) -> list[float]:
    """Find the peaks of the mean spectrum of any channel, Hz, the slowest first.

    step, grids: as of `place_on_grids`.
    """
    lengths = np.array(list(map(len, grids)))
    padded = [
        np.pad(grid, ((0, lengths.max() - len(grid)), (0, 0)), constant_values=np.nan)
        for grid in grids
    ]  # of equal length, so that spectra have the same frequencies
    omega, powers = estimate_spectra(padded, step)
    powers = powers.reshape(-1, len(grids), powers.shape[1])
    power = np.average(powers, axis=1, weights=lengths)
    if not len(power):
        return []
    frequency = omega[:: len(grids)] / (2.0 * np.pi)
    centres = frequency
    if len(frequency) > MAX_MEDIANS:  # medians at all frequencies would take a minute
        places = np.geomspace(1, len(frequency), MAX_MEDIANS).astype(int)
        centres = frequency[np.unique(places) - 1]
    neighbours = neighbour_slices(frequency, centres, MEDIAN_WIDTH)
    medians = np.array([np.median(power[rows], axis=0) for rows in neighbours])
    level = np.array([np.interp(frequency, centres, column) for column in medians.T]).T
    height = np.max(power / np.maximum(level, np.finfo(float).tiny), axis=1)
    neighbours = neighbour_slices(frequency, frequency, PEAK_WIDTH)
    highest = np.array([height[rows].max() for rows in neighbours])
    is_resolved = frequency * step * lengths.max() > MIN_MODE_PERIODS
    return frequency[is_resolved & (height == highest) & (height > MIN_PEAK_RATIO)].tolist()


def neighbour_slices(frequency: np.ndarray, centres: np.ndarray, factor: float) -> list[slice]:
    """Find the frequencies (n,), increasing, within `factor` of each of `centres`."""
    first = np.searchsorted(frequency, centres / factor)
    last = np.searchsorted(frequency, centres * factor, side="right")
    return list(map(slice, first, last))


def find_unmodelled_modes(recordings: list[Recording]) -> list[Finding]:
    """Find fast modes for which recordings have no coordinate, and return a finding for each."""
    channels, findings = Channels.from_recordings(recordings), []
    if not channels.names:  # a line that diverged has no motion
        return []
    step, grids = place_on_grids(recordings)
    omega, power = estimate_spectra(grids, step)
    power = above_noise(power)
    # rad/s; slower motion is a drift
    slowest = 2.0 * np.pi * MIN_MODE_PERIODS / (step * max(map(len, grids)))
    for i in channels.pairs:
        if not (derivatives := channels.derivatives(i)):
            continue
        channel, order = derivatives[0]
        exponent = 2.0 - 2.0 * order
        velocity = power[:, channel] * omega**exponent
        if not np.any(velocity):
            continue
        main = omega[np.argmax(np.where(omega < slowest, 0.0, velocity / omega))]
        leaks = LEAKAGE_FACTOR * _leakage_of_gaps(grids, step, channel, main) * omega**exponent
        faster = np.where(
            omega > MIN_FREQUENCY_RATIO * main, np.maximum(velocity - leaks, 0.0), 0.0
        )
        peaks = 2.0 * np.pi * np.array(find_peaks(step, [grid[:, [channel]] for grid in grids]))
        neighbours = neighbour_slices(omega, peaks, PEAK_WIDTH)
        powers = [faster[rows].sum() for rows in neighbours]
        named_peaks = sorted(zip(powers, peaks, strict=True))[-3:]
        if sum(peak_power for peak_power, _ in named_peaks) < MIN_POWER_SHARE * velocity.sum():
            continue
        findings += [
            Finding.of(
                Code.MORE_MODES, channels.states[i], frequency_hz=peak / (2.0 * np.pi),
                own_hz=main / (2.0 * np.pi),
            )
            for peak_power, peak in sorted(named_peaks, key=itemgetter(1)) if peak_power > 0.0
        ]  # fmt: skip
    return findings


def _leakage_of_gaps(grids: list[np.ndarray], step: float, channel: int, main: float) -> np.ndarray:
    """Estimate the leakage of an oscillation by the gaps of a channel.

    Returns the spectrum (n,), as of `estimate_spectra`, of an oscillation at `main`, rad/s, as
    large as the channel.
    """
    masks = [np.isfinite(grid[:, [channel]]) for grid in grids]
    size = np.sqrt(2.0) * np.nanstd(np.concatenate(grids)[:, channel])
    spectra = []
    for phase in (0.0, np.pi / 2.0):
        waves = [size * np.cos(main * step * np.arange(len(rows)) + phase) for rows in masks]
        pairs = zip(masks, waves, strict=True)
        masked = [np.where(rows, wave[:, np.newaxis], np.nan) for rows, wave in pairs]
        spectra.append(estimate_spectra(masked, step)[1][:, 0])
    return np.mean(spectra, axis=0)
