"""Detection of single events in free motion: a knock, or one step of a force.

Between events motion is free: its poles are constant, and only amplitudes and the equilibrium
change. The effect of a change at each time follows from the normal equations before and after it,
which are sums over the samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from galloping.identification.free_motion.damped_modes import DampedModes, Stretch, fit_poles
from galloping.identification.free_motion.mode_search import MIN_PART_SAMPLES, fit_modes
from galloping.identification.no_model import NO_MODEL_ERRORS, NoModel, attempt
from galloping.model.intervals import FALSE_ALARM_RATE

MIN_EXPLAINED_SHARE = 0.25  # least share of the misfit above `floor` that each event explains
MIN_PERIODS = 3.0  # least time between two events, in periods of the slowest mode


@dataclass(frozen=True)
class MotionBetweenEvents:
    """Free motion, divided at abrupt events, and the modes fitted to the parts.

    stretches: those between events. origins: for each, the index of the stretch that it comes from.
    modes: fitted to the stretches.
    """

    stretches: list[Stretch]
    origins: list[int]
    modes: DampedModes


def find_events(
    stretches: Sequence[Stretch], modes: DampedModes, floor: float
) -> MotionBetweenEvents | None:
    """Search for abrupt events, such as a knock, that separate parts of free motion.

    modes: fitted to the stretches; their residuals exceed the noise. floor: misfit with further
    damped sinusoids instead of events, with which events are compared. Returns None unless a few
    events leave nothing but noise.
    """
    parts, origins = list(stretches), list(range(len(stretches)))
    for _ in range(10):  # events in all stretches
        event = _strongest_event(parts, modes)
        if event is None:
            return None
        k, sample = event
        parts[k : k + 1] = [_select_rows(parts[k], 0, sample), _select_rows(parts[k], sample, None)]
        origins.insert(k, origins[k])
        before = modes.misfit
        try:
            modes = fit_poles(parts, modes.poles)
            if before - modes.misfit < MIN_EXPLAINED_SHARE * (before - floor):
                return None
            whole, is_noise = fit_modes(parts)
        except NO_MODEL_ERRORS:
            return None
        if whole is not None and is_noise:
            return _remove_spurious_events(stretches, MotionBetweenEvents(parts, origins, whole))
    return None


def _remove_spurious_events(
    stretches: Sequence[Stretch], motion: MotionBetweenEvents
) -> MotionBetweenEvents:
    """Remove events that explain no more than noise does besides the others.

    Such an event was detected first, in place of two others. stretches: undivided.
    """
    for k in range(len(motion.stretches) - 1, 0, -1):
        if motion.origins[k] != motion.origins[k - 1]:
            continue
        parts, origins = list(motion.stretches), list(motion.origins)
        first = origins.index(origins[k])
        begin, end = (sum(len(part.time) for part in parts[first:last]) for last in (k - 1, k + 1))
        parts[k - 1 : k + 1] = [_select_rows(stretches[origins[k]], begin, end)]
        del origins[k]
        fit = attempt(fit_poles, parts, motion.modes.poles)
        if isinstance(fit, NoModel):
            continue
        count = sum(np.count_nonzero(np.isfinite(part.values)) for part in parts)
        freedom = (2 * len(fit.poles) + 2) * parts[0].values.shape[1]
        if fit.misfit - motion.modes.misfit < chdtri(freedom, FALSE_ALARM_RATE / count):
            motion = MotionBetweenEvents(parts, origins, fit)
    return motion


def _select_rows(stretch: Stretch, begin: int, end: int | None) -> Stretch:
    """Return the samples from `begin` to `end` of a stretch, with times from the first of them."""
    time = stretch.time[begin:end]
    return replace(stretch, time=time - time[0], values=stretch.values[begin:end])


def _strongest_event(stretches: Sequence[Stretch], modes: DampedModes) -> tuple[int, int] | None:
    """Find the event that explains most; return None if none explains more than noise would.

    Returns the index of its stretch, and the first sample after it.
    """
    best, most = None, 0.0
    for index, stretch in enumerate(stretches):
        samples = _possible_samples(stretch, modes.poles)
        if not len(samples):
            continue
        gains, freedom = _event_gains(stretch, modes, index, samples)
        peak = int(np.argmax(gains))
        limit = chdtri(freedom, FALSE_ALARM_RATE / len(stretch.time))
        if gains[peak] > max(limit, most):
            first, last = samples[max(peak - 1, 0)], samples[min(peak + 1, len(samples) - 1)]
            neighbours = np.arange(first, last + 1)
            finer, _ = _event_gains(stretch, modes, index, neighbours)
            best, most = (index, int(neighbours[np.argmax(finer)])), float(gains[peak])
    return best


def _possible_samples(stretch: Stretch, poles: np.ndarray) -> np.ndarray:
    """Find samples before which a stretch may change, each side long enough for a fit."""
    least = MIN_PERIODS * 2.0 * np.pi / poles.imag.min()
    first, last = np.searchsorted(stretch.time, (stretch.time[0] + least, stretch.time[-1] - least))
    first, last = max(first, MIN_PART_SAMPLES), min(last, len(stretch.time) - MIN_PART_SAMPLES)
    if last <= first:
        return np.empty(0, int)
    # of a long stretch some of them: the best and its neighbours are then compared
    return np.unique(np.linspace(first, last, min(2000, last - first)).astype(int))


def _event_gains(
    stretch: Stretch, modes: DampedModes, index: int, samples: np.ndarray
) -> tuple[np.ndarray, int]:
    """Compute the fall of chi^2 by a change before each sample, and its degrees of freedom."""
    waves = np.exp(np.outer(stretch.time, modes.poles))
    basis = np.hstack([waves.real, -waves.imag, np.ones((len(waves), 1))])
    gains, freedom = np.zeros(len(samples)), 0
    for c in np.flatnonzero(np.isfinite(modes.noise[index])):
        is_known = np.isfinite(stretch.values[:, c])[:, np.newaxis]
        columns = np.where(is_known, basis, 0.0)
        residual = np.where(is_known, modes.residuals[index][:, [c]], 0.0)
        gram = np.cumsum(np.einsum("ni,nj->nij", columns, columns), axis=0)
        right = np.cumsum(columns * residual, axis=0)
        sums_before = gram[samples - 1], right[samples - 1]
        sums_after = gram[-1] - sums_before[0], right[-1] - sums_before[1]
        explained = _explained_squares(*sums_before) + _explained_squares(*sums_after)
        gains += explained / modes.noise[index, c] ** 2
        freedom += basis.shape[1]
    return gains, freedom


def _explained_squares(gram: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Compute the squares, (n,), explained by regressions with these normal equations."""
    scale = np.sqrt(np.maximum(np.einsum("nii->ni", gram), np.finfo(float).tiny))
    scaled = gram / (scale[:, :, np.newaxis] * scale[:, np.newaxis, :])
    scaled = scaled + 1e-12 * np.eye(gram.shape[1])  # so that they can be solved
    right = right / scale
    return np.einsum("ni,ni->n", right, np.linalg.solve(scaled, right[:, :, np.newaxis])[:, :, 0])
