"""Modes of a recording for which its states have no coordinate."""

from operator import itemgetter

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.oscillations import MIN_MODE_PERIODS
from galloping.identification.preparation.channels import Channels
from galloping.identification.random_forces.several_modes import (
    PEAK_WIDTH,
    find_peaks,
    neighbour_slices,
)
from galloping.identification.random_forces.start import (
    above_noise,
    estimate_spectra,
    place_on_grids,
)
from galloping.recording.samples import Recording

# Least ratio of a frequency to a coordinate's main one. Cubic terms cause motion at a ratio of
# three.
MIN_FREQUENCY_RATIO = 3.5
MIN_POWER_SHARE = 0.2  # least share of a velocity's power that the faster peaks have
LEAKAGE_FACTOR = 2.0  # factor on the estimated leakage by gaps, which may be larger by chance
MAX_FREQUENCIES = 3  # most frequencies that are reported for a coordinate


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
        named_peaks = sorted(zip(powers, peaks, strict=True))[-MAX_FREQUENCIES:]
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
