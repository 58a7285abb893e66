"""What instruments would have recorded of a motion."""

from collections.abc import Sequence

import numpy as np

from galloping.measurement.protocols import BY_NAME, DERIVATIVES, Noise
from galloping.recording import Recording
from galloping.results import Motion
from galloping.seeds import generator


def measure(
    motions: Sequence[Motion],
    *,
    protocol: str,
    level: float,
    relative: bool,
    samples: int,
    recordings: int,
    replicates: int,
    seed: int,
    name: Sequence[str],
) -> list[tuple[Recording, ...]]:
    """Independent recordings of the first motion or of several under one protocol, by replicate.

    level: of the noise; relative: in units of each channel's standard deviation. samples: how many
    of each motion; fewer than it has are a random subset, drawn without replacement. recordings: of
    how many motions. The recording of a motion in a replicate depends on `seed`, `name` and these
    two numbers only.
    """
    noises = noises_of(motions[:recordings], protocol, level, relative)
    of_derivatives = "derivatives" if BY_NAME[protocol].measures == DERIVATIVES else "rates"

    def record(replicate: int, release: int) -> Recording:
        rng = generator(seed, "measurement", *name, replicate, release)
        motion, noise = motions[release], noises[release]
        rows = slice(None)
        if samples < len(motion.time):
            rows = np.sort(rng.choice(len(motion.time), size=samples, replace=False))
        values = _channels(motion.states[rows], noise.states, rng)
        further = {}
        if np.any(np.isfinite(noise.derivatives)):
            channels = _channels(motion.derivatives[rows], noise.derivatives, rng)
            further[of_derivatives] = channels
        return Recording(motion.time[rows], motion.names, values, **further)

    return [tuple(record(r, i) for i in range(recordings)) for r in range(replicates)]


def noises_of(
    motions: Sequence[Motion], protocol: str, level: float, relative: bool
) -> list[Noise]:
    """The noise on each motion. Raises KeyError for an unknown protocol."""
    described = BY_NAME[protocol]
    return [described.noise(level, channel_scale(each, relative)) for each in motions]


def _channels(exact: np.ndarray, sigma: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Exact channels (n, n_channels) with noise, NaN where one is not measured."""
    if not np.any(sigma):
        return exact
    return exact + np.where(np.isinf(sigma), np.nan, sigma) * rng.standard_normal(exact.shape)


def channel_scale(motion: Motion, relative: bool) -> np.ndarray:
    """What a noise level is in units of, (2, n_states), of states and of derivatives.

    relative: the standard deviation of each, else one SI unit.
    """
    if not relative:
        return np.ones((2, len(motion.names)))
    return np.array([motion.states.std(axis=0), motion.derivatives.std(axis=0)])
