"""Where a motion in random forces goes from here, and whether it is that of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galloping.identification.model import IdentifiedModel
from galloping.identification.random_forces.discrete import Steps, discretised
from galloping.identification.random_forces.tracking import tracker
from galloping.polynomial import PolynomialModel
from galloping.recording import Recording

WITHIN = 60.0  # periods at the end of a recording that tell its last state
MOST_MISFIT = 1.5  # mean square of standardised innovations: that of another line is far larger


def motions(
    found: IdentifiedModel,
    models: Sequence[PolynomialModel],
    recording: Recording,
    time: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """(n_models, n, n_states) at `time` (n,), s, one of each model, in forces drawn for it.

    found: whose forces and noise they share. Each begins at a state drawn as the end of the
    recording tells it.
    """
    recording = end_of(found, recording)
    drawn, ahead = [], Steps.between(np.append(recording.time[-1], time))
    for model in models:
        follow, data = tracker(replace(found, model=model), recording)
        end = follow.over(data)
        moved, disturbed = discretised(*follow.driven, ahead.lengths)
        roots, n = np.array([_root(each) for each in disturbed]), len(follow.rest)
        x = end.mean + _root(end.covariance) @ rng.standard_normal(len(end.mean))
        x[:n] -= follow.rest
        noise = rng.standard_normal((len(time), len(x)))
        states = np.empty((len(time), n))
        for k, step in enumerate(ahead.of[1:]):
            x = moved[step] @ x + roots[step] @ noise[k]
            states[k] = x[:n]
        drawn.append(states + follow.rest)
    return np.array(drawn)


def end_of(found: IdentifiedModel, recording: Recording) -> Recording:
    """As much of the end of a recording as tells where it ends."""
    slowest = np.min(np.abs(np.linalg.eigvals(tracker(found, recording)[0].system)))
    begin = recording.time[-1] - WITHIN * 2.0 * np.pi / slowest
    first = int(np.searchsorted(recording.time, begin))
    return recording[min(first, len(recording.time) - 2) :] if first else recording


def check_followed(found: IdentifiedModel, recording: Recording) -> None:
    """Raise ValueError, in one line, where the end of a recording is not the motion of a model."""
    follow, data = tracker(found, end_of(found, recording))
    end = follow.over(data)
    square = (end.innovations**2 / end.variances)[2 * len(end.mean) :]
    misfit = float(np.nanmean(square))
    if not misfit <= MOST_MISFIT:
        raise ValueError(
            f"the model does not follow the recording: from sample to sample it errs by "
            f"{np.sqrt(misfit):.3g} times what its forces and noise explain, where "
            f"{np.sqrt(MOST_MISFIT):.3g} is allowed: another line, another wind, or another sensor"
        )


def followed(found: IdentifiedModel, recording: Recording) -> np.ndarray:
    """(n, n_states) as the samples until each tell them."""
    follow, data = tracker(found, recording)
    return follow.over(data).means


def spectra(found: IdentifiedModel, recording: Recording, frequency: np.ndarray) -> np.ndarray:
    """(n, n_channels) one-sided spectra of the channels of a recording at frequencies (n,), Hz.

    In squares of the channels' units per Hz, noise included.
    """
    follow, _ = tracker(found, recording)
    system, white = follow.driven
    omega = 2.0 * np.pi * frequency[:, np.newaxis, np.newaxis]
    moved = follow.sensing @ np.linalg.inv(1j * omega * np.eye(len(system)) - system)
    power = np.einsum("fci,ij,fcj->fc", moved, white, moved.conj()).real
    return 2.0 * (power + follow.noise**2 * np.median(np.diff(recording.time)))


def _root(covariance: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2.0)
    return vectors * np.sqrt(np.maximum(values, 0.0))
