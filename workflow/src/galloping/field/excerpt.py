"""The stretches of a long recording that a model is identified from."""

from __future__ import annotations

import numpy as np

from galloping.identification.likelihood.smoothing import shortest_period
from galloping.recording import Recording

STRETCHES = 8  # spread over a long recording
PERIODS = 64  # of the fastest motion, in each
PARTS = 8  # of a stretch, whose sizes are compared


def excerpts(recordings: list[Recording]) -> list[Recording]:
    """The recordings, long ones in their liveliest stretches.

    What a model costs is bounded so, whatever the length: at most STRETCHES of PERIODS in all, but
    one at least of every recording. A longer recording is cut into equal parts, and from each part
    comes the stretch in which the size of the motion varies most, for what grows and decays tells
    of damping and of the cubic terms what a steady motion does not. Raises ValueError where no
    channel varies.
    """
    length = PERIODS * shortest_period(recordings)
    each = max(STRETCHES // len(recordings), 1)
    return [piece for recording in recordings for piece in _pieces(recording, each, length)]


def _pieces(recording: Recording, count: int, length: float) -> list[Recording]:
    time = recording.time
    fitting = int((time[-1] - time[0]) / length)
    if fitting <= count:
        return [recording]
    edges = np.searchsorted(time, time[0] + length / PARTS * np.arange(fitting * PARTS + 1))
    liveliness = _liveliness(recording.values, edges)
    chosen = [part[np.argmax(liveliness[part])] for part in np.array_split(range(fitting), count)]
    return [
        recording[edges[PARTS * k] : edges[PARTS * (k + 1)]] for k in chosen if liveliness[k] >= 0
    ]


def _liveliness(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(n_stretches,) how much the motion's size varies, 0 with gaps, -1 with hardly a sample.

    values: (n, n_states). edges: (PARTS n_stretches + 1,) first samples of the parts.
    """
    values = values[:, np.isfinite(values).any(axis=0)]
    known = np.isfinite(values)
    centred = np.where(known, values - np.nanmean(values, axis=0), 0.0)

    def total(of: np.ndarray) -> np.ndarray:
        sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(of, axis=0)])
        return np.diff(sums[edges], axis=0)

    counts = total(known)
    share = np.maximum(counts, 1)
    variance = total(centred**2) / share - (total(centred) / share) ** 2
    size = np.log(np.maximum(variance, np.finfo(float).tiny)).reshape(-1, PARTS, counts.shape[1])
    counts = counts.reshape(size.shape)
    varies = np.where(counts.min(axis=(1, 2)) > 1, size.std(axis=1).sum(axis=1), 0.0)
    return np.where(counts.sum(axis=(1, 2)) > 2 * PARTS, varies, -1.0)
