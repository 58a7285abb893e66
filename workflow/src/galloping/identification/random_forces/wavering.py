"""Whether the size of a motion goes up and down, as random forces make it."""

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import Legendre

from galloping.identification.random_forces.channels import Channels
from galloping.recording import Recording

WINDOW = 3  # periods, in which a motion has a size
# Of the mean size in thirds of a recording, and of the deviation of sizes from a smooth trend, in
# share of their mean: that of a narrow band of Gaussian noise is 0.15 to 0.5.
STEADY, WAVERING, TREND = 5.0, 0.12, 3


def wavers(recordings: Sequence[Recording], period: float) -> bool:
    """Whether the size of the motion in every channel goes up and down about the same size.

    As random forces make it; a motion that grows, decays or repeats does not. period: s.
    """
    found, channels = [], Channels.of(list(recordings))
    for recording in recordings:
        count = max(int(np.ptp(recording.time) / (WINDOW * period)), 3)
        for samples in channels.samples(recording).T:
            parts = np.array_split(samples[np.isfinite(samples)], count)
            if min(map(len, parts)) > 1:
                sizes = np.array([part.std() for part in parts])
                thirds = [third.mean() for third in np.array_split(sizes, 3)]
                steady = max(thirds) < STEADY * min(thirds)
                place = np.linspace(-1.0, 1.0, len(sizes))
                trend = Legendre.fit(place, sizes, min(TREND, len(sizes) - 1))(place)
                found.append(steady and np.std(sizes - trend) > WAVERING * sizes.mean())
    return bool(found) and all(found)
