"""Unwrapping of angles that an encoder or a compass restarts after a full turn."""

import numpy as np
from numpy.typing import NDArray

LIKE = 4.0  # times the largest of the other steps, that a step over the end of a turn may be


def unwrap_angle(values: NDArray[np.float64], turn: float) -> tuple[NDArray[np.float64], int]:
    """Remove the jumps of a full turn from samples of an angle, and count these jumps.

    Jumps are removed if all samples are within one turn and reach both of its ends, and if the
    steps over the end, minus a turn, are like the others. The angle of a valve that opens by more
    than half a turn does not wrap. values: (n,) NaN where missing. turn: a full turn in the unit of
    the values. Returns the angle without jumps, (n,), shifted by whole turns so that its median is
    within half a turn of zero, or the values if they do not wrap; and the number of jumps that were
    removed.
    """
    known = np.isfinite(values)
    angle = values[known]
    steps = np.abs(np.diff(angle))
    jumps = steps > turn / 2.0
    if not jumps.any() or jumps.all() or np.ptp(angle) > turn * (1.0 + 1e-9):
        return values, 0
    largest = steps[~jumps].max()
    over = np.abs(turn - steps[jumps]).max()
    if turn - np.ptp(angle) > 2.0 * largest or over > LIKE * largest:
        return values, 0
    unwrapped = np.unwrap(angle, period=turn)
    found = values.copy()
    found[known] = unwrapped - turn * np.round(np.median(unwrapped) / turn)
    return found, int(jumps.sum())
