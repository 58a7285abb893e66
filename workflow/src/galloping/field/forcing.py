"""Whether forces that no model here has, such as gusts on a stable line, keep a motion up.

A motion without such forces follows from its start: where the line is stable it dies out. A motion
of a stable line that does not is forced (ambient vibration, buffeting).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from galloping.field.forecast import Sensed, simulator_of
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import velocity_pairs
from galloping.recording import Recording

LASTING = 1 / 3  # of a recording's motion that its last third has at least, where it does not decay
LARGER = 3.0  # times the model's own motion then
LITTLE_TOLD = 0.8  # R2 of forecasts over some periods, below which a model may only imitate forces


def little_told(identified: IdentifiedModel) -> bool:
    """Whether an inexact model, if there is one, hardly tells the motion from what came before."""
    return identified.diagnostics.get("forecast_r2", 0.0) < LITTLE_TOLD


def unmoved(identified: IdentifiedModel) -> list[str]:
    """Coordinates of whose acceleration the model knows nothing."""
    states = identified.model.states
    return [
        states[i]
        for i, velocity in velocity_pairs(states).items()
        if velocity not in identified.known and not np.any(identified.model.coefficients[velocity])
    ]


def kept_up(identified: IdentifiedModel, recordings: Sequence[Recording]) -> bool:
    """Whether the recorded motion of every channel lasts while that of the model dies out.

    recordings: those that it was identified from, with a start of each in its `initial_states`.
    """
    kept = []
    for recording, start in zip(recordings, identified.initial_states, strict=True):
        sensed, time = Sensed.by(recording), recording.time
        driven = simulator_of(identified.model, recording)
        states = driven(identified.model, start, time).states
        motion = sensed.of(identified.model, states, driven.at(time))
        last = time > time[-1] - (time[-1] - time[0]) / 3
        for samples, own in zip(sensed.samples(recording).T, motion.T, strict=True):
            known = np.isfinite(samples)
            if (known & last).any():
                recorded = np.std(samples[known & last])
                lasts = recorded > LASTING * np.std(samples[known])
                kept.append(lasts and recorded > LARGER * np.std(own[last]))
    return bool(kept) and all(kept)
