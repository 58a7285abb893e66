"""Weak SINDy (Messenger and Bortz 2021; Reinbold et al. 2020) with pysindy's test functions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from galloping.identification.result import Identified
from galloping.identification.sparse.reduction import Evidence
from galloping.identification.sparse.regression import Regression
from galloping.identification.sparse.settings import best_setting, test_functions
from galloping.identification.sparse.stlsq import normalised
from galloping.polynomial import library
from galloping.recording import Recording


def weak(
    recordings: Sequence[Recording], *, degree: int, threshold: float | None, path_length: int
) -> Identified:
    """Integrates against polynomial bumps instead of differentiating, then STLSQ.

    Raises ValueError for irregular, short or missing samples.
    """
    settings = reduce(recordings, degree)
    chosen = settings[best_setting(settings)]
    return normalised(Evidence(chosen, chosen), threshold=threshold, path_length=path_length)


def reduce(recordings: Sequence[Recording], degree: int) -> list[Regression]:
    """Weak forms of recordings of one system with each of the test functions to choose from."""
    for recording in recordings:
        if not recording.is_uniform:
            raise ValueError("weak: needs a regularly sampled recording")
        if not np.all(np.isfinite(recording.values)):
            raise ValueError("weak: needs every state at every sample")
    settings = test_functions(recordings, library(len(recordings[0].states), degree))
    if not settings:
        raise ValueError("weak: the recording is too short for its test functions")
    return settings
