"""Frequency and damping against amplitude, for a decay that no model follows.

A recording without all modes but one is divided into stretches in which the amplitude changes by
equal factors. A damped sinusoid is fitted to all samples of each, like a logarithmic decrement.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from galloping.identification.free_motion.damped_modes import DampedModes, Stretch, fit_poles
from galloping.identification.free_motion.mode_search import MIN_PART_SAMPLES, MIN_PERIODS
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.oscillations import EnvelopePart
from galloping.model.intervals import MIN_SIGNIFICANCE

MAX_PARTS = 12  # most parts of a stretch
MIN_CHANGE = 1.5  # least factor by which an amplitude changes over a stretch
# Largest change of a log amplitude against its trend, from window to window, beyond its error.
MAX_RISE = 0.05
MIN_FALL = 10.0  # least change of an amplitude over a stretch, in standard errors
MIN_SIGNAL = 2.0  # least ratio of amplitude to noise at both ends of a part


def fit_envelope(
    stretch: Stretch, modes: DampedModes, index: int, place: int, names: Sequence[str], begin: float
) -> list[EnvelopePart]:
    """Fit growth rate and frequency of a mode in intervals of equal relative amplitude change.

    modes: fitted to the stretch, among others. index: of the stretch among those of `modes`. place:
    of the mode. names: of the channels. begin: time of the first sample of the stretch on the
    recording's clock, s.
    """
    if np.isnan(modes.noise[index]).all():  # too few samples for the modes
        return []
    channel, time, values = in_strongest_channel(stretch, modes, index, [place])
    pole = modes.poles[place]
    period = 2.0 * np.pi / pole.imag
    centres, sizes, _ = running_amplitude(time, values, pole.imag, period)
    signal = np.flatnonzero(sizes > MIN_SIGNAL * modes.noise[index, channel])
    if len(signal) < 2:
        return []
    edges = _part_edges(centres[signal], np.log(sizes[signal]), MIN_PERIODS * period)
    parts = []
    for first, last in pairwise(edges):
        is_inside = (time >= first) & (time <= last)
        if np.count_nonzero(is_inside) < MIN_PART_SAMPLES:
            continue
        interval = Stretch(time[is_inside] - first, values[is_inside, np.newaxis], (0,))
        fit = attempt(fit_poles, [interval], np.array([pole]))
        if isinstance(fit, NoModel):
            continue
        middle, local = (last - first) / 2.0, fit.poles[0]
        amplitude = abs(fit.amplitudes[0][0, 0]) * np.exp(local.real * middle)
        part = EnvelopePart(
            index, names[channel], float(begin + (first + middle)), float(amplitude),
            float(local.imag), float(local.real), float(fit.frequency_errors[0]),
            float(fit.growth_errors[0]),
        )  # fmt: skip
        parts.append(part)
    return parts


def strongest_channel(modes: DampedModes, index: int, place: int) -> int:
    """Find the channel in which a mode has the highest signal-to-noise ratio."""
    return int(np.argmax(np.abs(modes.standardised_amplitudes(index)[place])))


def in_strongest_channel(
    stretch: Stretch, modes: DampedModes, index: int, places: Sequence[int]
) -> tuple[int, np.ndarray, np.ndarray]:
    """Subtract all modes but those at `places` from the channel in which the first is strongest.

    Returns the channel, the times of its samples, s, and the remainder, (n,). index: of the stretch
    among those of `modes`.
    """
    channel = strongest_channel(modes, index, places[0])
    is_known = np.isfinite(stretch.values[:, channel])
    time = stretch.time[is_known]
    others = np.setdiff1d(np.arange(len(modes.poles)), places)
    other_motion = modes.evaluate(others, index, time)[:, channel]
    return channel, time, stretch.values[is_known, channel] - other_motion


def running_amplitude(
    time: np.ndarray, values: np.ndarray, omega: float, length: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute the amplitude of an oscillation in overlapping windows of a given length.

    The windows are `length` s long and half of that apart. time, values: (n,). omega: frequency,
    rad/s. Returns the middles of the windows, s, the amplitudes there, and their standard errors,
    each (n_windows,).
    """
    starts = np.arange(time[0], time[-1] - length + 1e-9 * length, length / 2.0)
    waves = np.column_stack([np.cos(omega * time), np.sin(omega * time), np.ones(len(time))])
    windows = []
    for start in starts:
        rows = slice(*np.searchsorted(time, (start, start + length)))
        count = rows.stop - rows.start
        if count < 6:
            continue
        solved = np.linalg.lstsq(waves[rows], values[rows], rcond=None)[0]
        residual = np.linalg.norm(values[rows] - waves[rows] @ solved)
        error = residual * np.sqrt(2.0 / count / (count - 3))
        windows.append((start + length / 2.0, np.hypot(*solved[:2]), error))
    centres, sizes, errors = np.array(windows).reshape(-1, 3).T
    return centres, sizes, errors


def _part_edges(centres: np.ndarray, logarithms: np.ndarray, least: float) -> list[float]:
    """Find times, `least` s apart or more, between which amplitudes change by equal factors."""
    begin, end = centres[[0, -1]]
    sign = 1.0 if logarithms[-1] > logarithms[0] else -1.0
    rising = np.maximum.accumulate(sign * logarithms)
    count = int(np.clip((end - begin) / least, 1, MAX_PARTS))
    levels = np.linspace(rising[0], rising[-1], count + 1)[1:-1]
    edges = [begin]
    for time in np.interp(levels, rising, centres):
        if time - edges[-1] >= least and end - time >= least:
            edges.append(float(time))
    return [*edges, end]


def falls_or_rises(amplitudes: Sequence[tuple[np.ndarray, np.ndarray]]) -> bool:
    """Decide whether the amplitude of an oscillation falls, or rises, throughout its stretches.

    It must change by a factor of MIN_CHANGE or more in each, all in the same direction. amplitudes:
    values and standard errors, (n_windows,) each, for each stretch, in the order of time.
    """
    if any(len(sizes) < 3 or np.any(sizes == 0.0) for sizes, _ in amplitudes):
        return False
    falls, allowed, are_large = [], [], []
    for sizes, errors in amplitudes:
        relative = errors / sizes
        falls.append(np.log(sizes[:-1] / sizes[1:]))
        allowed.append(MAX_RISE + MIN_SIGNIFICANCE * np.hypot(relative[:-1], relative[1:]))
        are_large.append(abs(sizes[0] - sizes[-1]) > MIN_FALL * np.median(errors))
    return all(are_large) and any(
        all(
            np.sum(sign * fall) >= np.log(MIN_CHANGE) and np.all(sign * fall > -rise)
            for fall, rise in zip(falls, allowed, strict=True)
        )
        for sign in (1.0, -1.0)
    )
