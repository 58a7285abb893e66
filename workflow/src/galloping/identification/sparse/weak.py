"""Weak SINDy (Messenger and Bortz 2021; Reinbold et al. 2020) with pysindy's test functions."""

from collections.abc import Sequence

import numpy as np

from galloping.identification.model import Unusable
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.tuning import best_setting, test_functions
from galloping.polynomial import Exponents
from galloping.recording import Recording


def reduce(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> Regressions:
    """Weak forms of recordings of one system: integrals against test functions, not derivatives.

    Raises ValueError for irregular, short or missing samples.
    """
    for recording in recordings:
        if not recording.is_uniform:
            raise Unusable("needs a regularly sampled recording")
        if not np.all(np.isfinite(recording.values)):
            raise Unusable("needs every state at every sample")
    settings = test_functions(recordings, terms)
    if not settings:
        raise Unusable("the recording is too short for its test functions")
    chosen = best_setting(settings).reduced
    return Regressions(chosen, chosen, tuple(settings))
