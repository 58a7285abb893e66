"""What sparse regression sees of recordings: derivatives, measured or smoothed, on a library."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from galloping.identification.model import Unusable
from galloping.identification.sparse.differentiation import differentiate, with_missing_samples
from galloping.identification.sparse.regression import Regression, regression, stretches
from galloping.identification.sparse.tuning import Setting, best_setting, smoothings, test_functions
from galloping.polynomial import Exponents, design_matrix
from galloping.recording import Recording


@dataclass(frozen=True)
class Regressions:
    """What the methods that regress derivatives on states see of the recordings of one replicate.

    plain: derivatives as measured, or those of a spline that generalised cross-validation made as
    smooth as each channel asks for. tuned: by the smoothing that predicts held-out stretches best,
    or `plain` where there is none to choose. settings: every smoothing that was tried.
    """

    plain: Regression
    tuned: Regression
    settings: tuple[Setting, ...] = ()


def reduce(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> Regressions:
    """The regressions of recordings of one system on the candidate library `terms`.

    Where no derivatives were measured they come from smoothing, and so do the states: it is chosen
    where the samples are equally spaced, or some of equally spaced ones. Recordings without any
    sample, as of a line that diverges, give NaN, which no method can solve. Raises ValueError where
    a value is missing.
    """
    states = recordings[0].states
    if any(np.isnan(recording.values).all() for recording in recordings):
        theta, targets = np.full((1, len(terms)), np.nan), np.full((1, len(states)), np.nan)
        nothing = Regression(theta, targets, np.zeros(len(states)), states, terms)
        return Regressions(nothing, nothing)
    if all(each.derivatives is None for each in recordings):
        recordings = [with_missing_samples(_complete(each)) for each in recordings]
    parts = [_differentiated(recording) for recording in recordings]
    x, dx = (np.concatenate(arrays) for arrays in list(zip(*parts, strict=True))[:2])
    observations = sum(part[2] for part in parts)
    # block by block, so that a block's library stays in the cache
    blocks = ((design_matrix(x[rows], terms), dx[rows]) for rows in stretches(len(x)))
    plain = regression(blocks, observations, states, terms)
    settings = smoothings(recordings, terms)
    tuned = best_setting(settings).reduced if settings else plain
    return Regressions(plain, tuned, tuple(settings))


def _complete(recording: Recording) -> Recording:
    """The recording. Raises ValueError where a state is missing."""
    if not np.all(np.isfinite(recording.values)):
        raise Unusable("recording: sparse regression needs every state at every sample")
    return recording


def _differentiated(recording: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, derivatives and the effective number of observations of each derivative."""
    if recording.derivatives is None:
        return differentiate(recording.time, recording.values)
    if not np.all(np.isfinite(recording.derivatives)):
        raise Unusable("recording: sparse regression needs every derivative at every sample")
    n, states = _complete(recording).values.shape
    return recording.values, recording.derivatives, np.full(states, n)


def reduce_weakly(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> Regressions:
    """Weak forms of recordings of one system: integrals against test functions, not derivatives.

    Weak SINDy (Messenger and Bortz 2021; Reinbold et al. 2020) with pysindy's test functions.

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
