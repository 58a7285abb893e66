"""Simulated recordings of a motion by several measurement setups ("protocols").

A protocol consists of the noise on each state and on each state's derivative: the recordings follow
from it, the Cramér-Rao bound (`bounds`) and the applicable methods (`identification.registry`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from galloping.model.polynomial import velocity_pairs
from galloping.recording.samples import Recording
from galloping.results import Motion
from galloping.streams import make_generator

# Contents of recordings: exact states with noisy rates; all states; displacements only; rates.
DERIVATIVES, ALL_STATES = "derivatives", "states"
DISPLACEMENTS_ALONE, RATES = "displacements", "rates"
DEVIATION_UNIT = "standard deviations of each channel"  # unit of a relative noise level


@dataclass(frozen=True)
class Noise:
    """Standard deviation of the noise on each channel: 0 if exact, infinite if not measured.

    states, rates: (n_states,), of the states in their units and of their rates. The noise is drawn
    white and Gaussian (`recordings_of`).
    """

    states: np.ndarray
    rates: np.ndarray


@dataclass(frozen=True)
class Protocol:
    """Measurement setup: which states or derivatives are measured, and with what noise.

    measures: DERIVATIVES, ALL_STATES, DISPLACEMENTS_ALONE or RATES. meaning: in the words of the
    settings. by_default: whether a study that names no protocols has it.
    """

    name: str
    measures: str
    meaning: str
    by_default: bool = True

    @property
    def is_scaled(self) -> bool:
        """Whether the standard deviation of the noise scales with the size of the motion."""
        return self.measures != DERIVATIVES

    def noise(self, level: float, scale: np.ndarray, pairs: Mapping[int, int]) -> Noise:
        """Return the standard deviations of the noise at a noise level.

        scale: (2, n_states), of each state and of each rate. pairs: index of the velocity of each
        displacement, as `velocity_pairs` returns. Noise of derivatives is absolute, and on every
        rate (Brunton et al. 2016).
        """
        states, rates = np.full(scale.shape, np.inf)
        if self.measures == DERIVATIVES:
            states[:], rates[:] = 0.0, level
        elif self.measures == ALL_STATES:
            states = level * scale[0]
        elif self.measures == DISPLACEMENTS_ALONE:
            columns = list(pairs)
            states[columns] = level * scale[0, columns]
        else:
            columns = list(pairs.values())
            rates[columns] = level * scale[1, columns]
        return Noise(states, rates)

    def noise_unit(self, relative: bool) -> str:
        """Return the unit of the noise level, DEVIATION_UNIT if that is the size of the motion.

        relative: as in `channel_scale`.
        """
        if relative and self.is_scaled:
            return DEVIATION_UNIT
        return {DISPLACEMENTS_ALONE: "m", RATES: "m/s²"}.get(self.measures, "SI units")

    def noise_label(self, relative: bool) -> str:
        """Return a label of the noise level, with its unit.

        relative: as in `channel_scale`.
        """
        noise = "noise of the derivatives" if self.measures == DERIVATIVES else "sensor noise"
        return f"{noise}, {self.noise_unit(relative)}"


PROTOCOLS = (
    Protocol("derivative", DERIVATIVES, "exact states with noisy derivatives"),
    Protocol("state", ALL_STATES, "noisy states"),
    Protocol("displacement", DISPLACEMENTS_ALONE, "noisy displacements without velocities"),
    # of the methods only `maximum_likelihood` can use it
    Protocol("acceleration", RATES, "noisy accelerations alone", by_default=False),
)
PROTOCOLS_BY_NAME = {protocol.name: protocol for protocol in PROTOCOLS}


def recordings_of(
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
    """Draw independent noisy recordings of motions, one tuple for each noise realisation.

    level: of the noise; relative: in units of each channel's standard deviation. samples: number of
    each motion; fewer than it has are a random subset, drawn without replacement. recordings:
    number of motions. The recording of a motion in a realisation depends on `seed`, `name` and
    these two numbers only.
    """
    noises = noises_of(motions[:recordings], protocol, level, relative)
    exact = PROTOCOLS_BY_NAME[protocol].measures == DERIVATIVES

    def record(replicate: int, release: int) -> Recording:
        rng = make_generator(seed, "measurement", *name, replicate, release)
        motion, noise = motions[release], noises[release]
        rows: slice | np.ndarray = slice(None)
        if samples < len(motion.time):
            rows = np.sort(rng.choice(len(motion.time), size=samples, replace=False))
        values = _add_noise(motion.states[rows], noise.states, rng)
        rates = None
        if np.any(np.isfinite(noise.rates)):
            rates = _add_noise(motion.rates[rows], noise.rates, rng)
        return Recording(motion.time[rows], motion.names, values, rates, exact=exact)

    return [tuple(record(r, i) for i in range(recordings)) for r in range(replicates)]


def noises_of(
    motions: Sequence[Motion], protocol: str, level: float, relative: bool
) -> list[Noise]:
    """Compute the standard deviations of the noise on each motion in a measurement setup.

    protocol: its name; raises KeyError if it is unknown, and ValueError if it measures
    displacements or accelerations and no state is a velocity.
    """
    setup, noises = PROTOCOLS_BY_NAME[protocol], []
    for motion in motions:
        pairs = velocity_pairs(motion.names)
        if not pairs and setup.measures in (DISPLACEMENTS_ALONE, RATES):
            raise ValueError(
                f"protocol: {protocol!r}; must be derivative or state, since none of the states "
                f"{', '.join(motion.names)} is a velocity dX of another"
            )
        noises.append(setup.noise(level, channel_scale(motion, relative), pairs))
    return noises


def _add_noise(exact: np.ndarray, sigma: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Add noise to exact channels (n, n_channels), NaN where one is not measured."""
    if not np.any(sigma):
        return exact
    return exact + np.where(np.isinf(sigma), np.nan, sigma) * rng.standard_normal(exact.shape)


def channel_scale(motion: Motion, relative: bool) -> np.ndarray:
    """Return the factors from noise level to standard deviation, for each state and derivative.

    Returns (2, n_states). relative: the factors are the standard deviations, else one SI unit.
    """
    if not relative:
        return np.ones((2, len(motion.names)))
    return np.array([motion.states.std(axis=0), motion.rates.std(axis=0)])
