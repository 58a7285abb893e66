"""Filtering of recordings by an identified model in random forces, and their continuation."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.preparation.channels import Channels
from galloping.identification.random_forces.steps import Steps
from galloping.identification.random_forces.tracking import (
    Forces,
    SampledChannels,
    StateSpaceModel,
    motion_sizes,
)
from galloping.model.intervals import covariance_root
from galloping.model.polynomial import PolynomialModel
from galloping.recording.samples import Recording, mean_inputs

# Length of the end of a recording from which the last state is estimated, in slowest periods. Of an
# earlier oscillation with a damping ratio of 0.01, a fortieth is left.
END_PERIODS = 60.0
SPECTRUM_SEGMENTS = 6  # number of segments of a motion whose spectra are averaged
# Largest mean square of standardised innovations. It is far larger for another line.
MAX_INNOVATION_SQUARE = 1.5


def state_space_model(
    identified: IdentifiedModel, recording: Recording
) -> tuple[StateSpaceModel, SampledChannels]:
    """Make the state-space model of an identified model, and extract a recording's data for it.

    The model has random forces. Raises ValueError if the model does not know the noise of a
    channel.
    """
    channels, states = Channels.from_recordings([recording]), identified.model.states
    averaged = bool(identified.diagnostics.get("rates_averaged", False))
    channels = replace(channels, averaged=averaged and bool(channels.rates))
    noise = list(np.fmax.reduce(identified.sigma, axis=0)[list(channels.values)])
    noise += [identified.diagnostics.get(f"noise_d{states[i]}", np.nan) for i in channels.rates]
    for name, value in zip(channels.names, noise, strict=True):
        if not np.isfinite(value):
            raise ValueError(
                f"the model knows no noise of {name}: its recordings had no such sensor"
            )
    names = identified.model.inputs
    unsized = StateSpaceModel(
        identified.model, Forces.from_model(identified), channels, np.array(noise),
        np.ones(len(states)), mean_inputs(names, [recording]),
    )  # fmt: skip
    size, _, _ = motion_sizes([recording], channels, 2.0 * np.pi / unsized.modes.omega.max())
    recording = replace(recording, inputs={name: recording.inputs[name] for name in names})
    return replace(unsized, size=size), SampledChannels.from_recording(recording, channels)


def simulate_motions(
    identified: IdentifiedModel,
    models: Sequence[PolynomialModel],
    recording: Recording,
    time: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Simulate models under random forces beyond the end of a recording, at given times.

    time: (n,) s. Returns (n_models, n, n_states). identified: the model whose forces and noise they
    share. Each simulation begins at a state drawn from the filter's distribution at the end of the
    recording.
    """
    recording = recording_end(identified, recording)
    inputs = [recording.inputs[name] for name in identified.model.inputs]
    motions, steps = [], Steps.from_times(np.append(recording.time[-1], time), inputs)
    for model in models:
        system_model, data = state_space_model(replace(identified, model=model), recording)
        end = system_model.filter(data)
        x = end.mean + covariance_root(end.covariance) @ rng.standard_normal(len(end.mean))
        motions.append(system_model.simulate(x, steps, rng))
    return np.array(motions)


def add_force_noise(
    identified: IdentifiedModel, recording: Recording, rates: Sequence[int], sigma: np.ndarray
) -> np.ndarray:
    """Add the effect of random forces to the noise of rates that are means between samples.

    sigma: (n,) noise of channels, of which the last are the mean rates of the states `rates`.
    """
    noise = sigma.copy()
    if rates and identified.diagnostics.get("rates_averaged"):
        noise[-len(rates) :] = np.hypot(
            sigma[-len(rates) :], np.sqrt(np.diag(identified.forces)[list(rates)] / recording.step)
        )
    return noise


def recording_end(identified: IdentifiedModel, recording: Recording) -> Recording:
    """Return the last part of a recording, just long enough to determine its final state.

    It is the whole recording if a channel has no samples in this part.
    """
    system_model, _ = state_space_model(identified, recording)
    begin = recording.time[-1] - END_PERIODS * 2.0 * np.pi / system_model.modes.omega.min()
    first = int(np.searchsorted(recording.time, begin))
    end = recording[min(first, len(recording.time) - 2) :]
    has_all = Channels.from_recordings([end]).names == system_model.channels.names
    return end if first and has_all else recording


def check_followed(identified: IdentifiedModel, recording: Recording) -> None:
    """Raise ValueError if a model predicts the end of a recording worse than its noise allows."""
    system_model, data = state_space_model(identified, recording_end(identified, recording))
    end = system_model.filter(data)
    square = (end.innovations**2 / end.variances)[2 * len(end.mean) :]
    misfit = float(np.nanmean(square))
    if not misfit <= MAX_INNOVATION_SQUARE:
        raise ValueError(
            f"the model does not follow the recording: from sample to sample it errs by "
            f"{np.sqrt(misfit):.3g} times what its forces and noise explain, where "
            f"{np.sqrt(MAX_INNOVATION_SQUARE):.3g} is allowed: another line, another wind, or "
            "another sensor"
        )


def filter_states(identified: IdentifiedModel, recording: Recording) -> np.ndarray:
    """Estimate the states at each sample from the samples up to it, by a Kalman filter.

    Returns (n, n_states).
    """
    system_model, data = state_space_model(identified, recording)
    return system_model.filter(data).means


def model_spectra(
    identified: IdentifiedModel, recording: Recording, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the power spectra of the channels that a model under random forces predicts.

    Returns frequencies (n,), Hz, and one-sided spectra (n, n_channels). The spectra are in squares
    of the channels' units per Hz, noise included. Those of a linear model are exact; others are
    means over eight motions in forces drawn for each.
    """
    from scipy.signal import welch  # slow to import

    system_model, data = state_space_model(identified, recording)
    step = recording.step
    noise = 2.0 * system_model.noise**2 * step
    if system_model.is_linear:
        frequency = np.linspace(1.0 / np.ptp(recording.time), 0.5 / step, 1500)
        system, white = system_model.augmented_system
        response = system_model.channels.response(system, 2.0 * np.pi * frequency)
        power = np.einsum("fci,ij,fcj->fc", response, white, response.conj()).real
        return frequency, 2.0 * power + noise
    channels, powers = system_model.channels, []
    inputs = [recording.inputs[name] for name in identified.model.inputs]
    time = recording.time[0] + np.arange(len(recording.time)) * step
    steps = Steps.from_times(time, inputs)
    begin = system_model.filter(data).mean
    for _ in range(8):
        states = system_model.simulate(begin, steps, rng)
        rates = np.gradient(states[:, list(channels.rates)], step, axis=0)
        samples = np.hstack([states[:, list(channels.values)], rates])
        length = len(samples) // SPECTRUM_SEGMENTS
        frequency, power = welch(samples, 1.0 / step, nperseg=length, axis=0)
        powers.append(power)
    return frequency[1:], np.mean(powers, axis=0)[1:] + noise
