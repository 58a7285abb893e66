"""Removal of samples that free motion cannot follow: outliers, and samples during an event."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galloping.identification.free_motion.damped_modes import DampedModes, Stretch, fit_poles
from galloping.identification.free_motion.mode_search import MANY_MODES, strongest_mode
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.preparation.screening import (
    MAX_OUTLIERS,
    MEDIAN_DEVIATION,
    OUTLIER_THRESHOLD,
)

# Largest misfit of a sample beside an event without its force, in standard deviations of noise.
MAX_SAMPLE_MISFIT = 4.5
MIN_PERIODS = 8.0  # least length of a stretch whose ends are searched for forces, in periods


def remove_unexplained_samples(
    stretches: Sequence[Stretch], modes: DampedModes
) -> list[Stretch] | None:
    """Remove isolated outliers, and samples at the ends that the force of an event affects.

    modes: fitted to the stretches. Returns the stretches without these samples, None if there are
    no such samples.
    """
    cleaned, has_changed = [], False
    for stretch, residual in zip(stretches, modes.residuals, strict=True):
        bad = np.zeros(residual.shape, bool)
        for c, column in enumerate(residual.T):
            is_known = np.isfinite(column)
            if is_known.any():
                limit = OUTLIER_THRESHOLD * MEDIAN_DEVIATION * np.median(np.abs(column[is_known]))
                far = is_known & (np.abs(column) > limit)
                is_isolated = far & ~np.append(far[1:], False) & ~np.append(False, far[:-1])
                bad[:, c] = is_isolated & (np.count_nonzero(is_isolated) <= MAX_OUTLIERS * len(far))
        bad |= _under_force(stretch, modes.poles)[:, np.newaxis]
        has_changed |= bool(bad.any())
        cleaned.append(replace(stretch, values=np.where(bad, np.nan, stretch.values)))
    return cleaned if has_changed else None


def _under_force(stretch: Stretch, poles: np.ndarray) -> np.ndarray:
    """Find samples, (n,), of the first and last period that free motion does not follow."""
    period = 2.0 * np.pi / poles.imag[0]
    is_forced = np.zeros(len(stretch.time), bool)
    is_inner = (stretch.time > period) & (stretch.time < stretch.duration - period)
    if stretch.duration < MIN_PERIODS * period or len(poles) > MANY_MODES:
        return is_forced
    time = stretch.time - period
    inner = Stretch(time[is_inner], stretch.values[is_inner], stretch.drift_degrees)
    modes = attempt(fit_poles, [inner], poles)
    if isinstance(modes, NoModel) or strongest_mode([inner], modes.residuals, poles) is not None:
        return is_forced
    residual = stretch.values - modes.evaluate(range(len(modes.poles)), 0, time)
    is_fitted = np.isfinite(modes.noise[0])
    residual, noise = residual[:, is_fitted], modes.noise[0][is_fitted]
    with np.errstate(invalid="ignore"):
        distance = np.abs(residual - np.nanmedian(residual[is_inner], axis=0))
        is_far = np.any(distance > MAX_SAMPLE_MISFIT * noise, axis=1)
    early, late = stretch.time <= period, stretch.time >= stretch.duration - period
    if (rows := np.flatnonzero(is_far & early)).size:
        is_forced[: rows[-1] + 1] = True
    if (rows := np.flatnonzero(is_far & late)).size:
        is_forced[rows[0] :] = True
    return is_forced
