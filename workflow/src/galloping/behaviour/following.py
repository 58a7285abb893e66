"""Motions of a model as the sensors of a recording see them, and their initial states."""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from galloping.cycles.settling import estimate_missing_sizes
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import checked_recordings
from galloping.identification.no_model import IdentificationError
from galloping.identification.preparation.smoothing import (
    rate_without_offset,
    shortest_period,
    unmeasured_displacements,
    with_integrals,
)
from galloping.inspection.quality import (
    MIN_DISTINCT_VALUES,
    dominant_frequencies,
    find_outliers,
)
from galloping.model.polynomial import PolynomialModel, velocity_pairs
from galloping.recording.samples import Input, Recording, inputs_at_times, mean_inputs
from galloping.trajectory.simulation import Simulator, rates_along

MAX_ITERATIONS = 4  # Gauss-Newton steps in each stage of the fit of an initial state, at most
MAX_REFINEMENTS = 2  # Gauss-Newton steps from a close guess of the initial state, at most
CHI2_TOLERANCE = 1e-4  # smallest expected decrease of chi^2 for which another step follows
STAGE_SHARES = (1 / 6, 1 / 3, 2 / 3, 1.0)  # shares of the samples that are fitted in turn
DIFFERENCE_STEP = 1e-5  # step of a state in finite differences, relative to the size of the state
DIVERGENCE_FACTOR = 1e6  # size above which a motion diverges, relative to the recorded motion
# A first guess of a velocity is the slope of a few samples.
SLOPE_PERIODS = 1 / 4  # duration of these samples, in periods of the fastest motion
MIN_SLOPE_SAMPLES = 5  # smallest number of these samples


@dataclass(frozen=True)
class Sensed:
    """Channels in which model and recording are compared: states and some of their derivatives.

    rates: indices of the states whose derivatives are compared: those that are measured without a
    displacement, as by accelerometers.
    """

    states: tuple[str, ...]
    rates: tuple[int, ...]

    @classmethod
    def by(cls, recording: Recording) -> "Sensed":
        """Determine the channels in which a recording can be compared with a model."""
        alone = {k for pair in unmeasured_displacements(recording).items() for k in pair}
        if recording.rates is None:
            return cls(recording.states, ())
        measured = np.flatnonzero(np.isfinite(recording.rates).any(axis=0))
        return cls(recording.states, tuple(k for k in measured.tolist() if k in alone))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels: of the states, then of derivatives with a `d` in front."""
        return self.states + tuple(f"d{self.states[k]}" for k in self.rates)

    def samples(self, recording: Recording) -> np.ndarray:
        """Return the samples of a recording in all channels, NaN where missing.

        Shape (n, n_sensed). Rates are without their unknown offsets.
        """
        rates = [rate_without_offset(recording, k) for k in self.rates]
        return np.column_stack([recording.values, *rates])


def check_recordings(model: PolynomialModel, recordings: object) -> list[Recording]:
    """Check that recordings have the states and inputs of a model, and return them as a list.

    Raises ValueError as `checked_recordings`, and for other states or a missing input.
    """
    recording_list = checked_recordings(recordings)
    if recording_list[0].states != model.states:
        raise ValueError(
            f"recordings: have the states {', '.join(recording_list[0].states)}; the model has "
            f"{', '.join(model.states)}"
        )
    if lacking := [name for name in model.inputs if name not in recording_list[0].inputs]:
        raise ValueError(f"recordings: lack the input {lacking[0]}, which drives the model")
    return recording_list


def without_outliers(recording: Recording) -> Recording:
    """Return a recording in which samples far from their neighbours (outliers) are NaN."""
    values, rates = (
        None
        if each is None
        else np.column_stack([_clean_channel(recording.time, y) for y in each.T])
        for each in (recording.values, recording.rates)
    )
    return replace(recording, values=np.asarray(values), rates=rates)


def _clean_channel(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Replace outliers among the values of a channel, (n,), by NaN."""
    is_finite = np.isfinite(values)
    if np.count_nonzero(is_finite) < MIN_DISTINCT_VALUES:
        return values
    time, samples = time[is_finite], values[is_finite]
    dominant = dominant_frequencies(time, samples, float(np.median(np.diff(time))))
    are_outliers = find_outliers(time, samples, dominant)
    cleaned = values.copy()
    cleaned[is_finite] = np.where(are_outliers, np.nan, samples)
    return cleaned


def ranges_of(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the least and greatest sample of each channel, (n_channels,), unbounded without any."""
    is_finite = np.isfinite(values)
    low = np.where(is_finite, values, np.inf).min(axis=0)
    high = np.where(is_finite, values, -np.inf).max(axis=0)
    return np.where(low > high, -np.inf, low), np.where(low > high, np.inf, high)


def half_range(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Compute half ranges, zero where unbounded."""
    return np.where(np.isfinite(high - low), (high - low) / 2.0, 0.0)


def simulator_of(model: PolynomialModel) -> Simulator:
    """Make a simulator for a model and for other models with the same terms."""
    return Simulator(model.states, model.terms, model.inputs)


@dataclass(frozen=True)
class Following:
    """Comparison of simulated motions of a model with the samples of a recording.

    Motions of other models with its terms can be compared too.
    """

    identified: IdentifiedModel
    recording: Recording

    @cached_property
    def sensed(self) -> Sensed:
        """Channels in which the model is compared with the recording."""
        return Sensed.by(self.recording)

    @cached_property
    def samples(self) -> np.ndarray:
        """Samples of the recording in all channels, (n, n_sensed), NaN where missing."""
        return self.sensed.samples(self.recording)

    @cached_property
    def sigma(self) -> np.ndarray:
        """Noise standard deviation of each channel, (n_sensed,), zero if it is not known."""
        rates = self.sensed.names[len(self.sensed.states) :]
        of_rates = [self.identified.diagnostics.get(f"noise_{name}", 0.0) for name in rates]
        return np.append(np.fmax.reduce(self.identified.sigma, axis=0, initial=0.0), of_rates)

    @property
    def inverse_sigma(self) -> np.ndarray:
        """Inverse of the noise standard deviation of each channel, zero if it is not known."""
        is_positive = self.sigma > 0.0
        return np.where(is_positive, 1.0 / np.where(is_positive, self.sigma, 1.0), 0.0)

    @cached_property
    def _simulator(self) -> Simulator:
        return simulator_of(self.identified.model)

    @cached_property
    def _limit(self) -> float:
        """Distance from zero beyond which a motion diverges, from the size of the recorded one."""
        model, recording = self.identified.model, self.recording
        is_finite = np.isfinite(recording.values)
        size = np.where(is_finite, np.abs(recording.values), 0.0).max(axis=0)
        steady = model.at(mean_inputs(model.inputs, [recording]))
        rates = 0.0 if recording.rates is None else half_range(*ranges_of(recording.rates))
        size = estimate_missing_sizes(size, steady, np.zeros(len(size)), rates)
        return DIVERGENCE_FACTOR * float(np.linalg.norm(size))

    @property
    def _inputs(self) -> dict[str, Input]:
        return {name: self.recording.inputs[name] for name in self.identified.model.inputs}

    def motion(self, model: PolynomialModel, start: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Simulate a model from an initial state and return its motion in all channels.

        Shape (n, n_sensed), not finite where the motion diverges.
        """
        states = self._simulator(model, start, time, self._inputs, self._limit).states
        return self.to_channels(model, states, time)

    def to_channels(
        self, model: PolynomialModel, states: np.ndarray, time: np.ndarray
    ) -> np.ndarray:
        """Convert the states of a simulated motion to the channels of the recording.

        From (n, n_states) to (n, n_sensed).
        """
        if not self.sensed.rates:
            return states
        rates = rates_along(model, states, inputs_at_times(list(self._inputs.values()), time))
        return np.hstack([states, rates[:, self.sensed.rates]])

    def fit_start(self, rows: slice) -> np.ndarray | None:
        """Fit the initial state, (n_states,), to some samples; None if the motion diverges."""
        guess = first_guess(self.recording, rows.start)
        return self.fit_start_of(self.identified.model, rows, guess, self.samples[rows])

    def fit_start_of(
        self,
        model: PolynomialModel,
        rows: slice,
        guess: np.ndarray,
        values: np.ndarray,
        slopes: np.ndarray | None = None,
    ) -> np.ndarray | None:
        """Fit the initial state of a given model to given samples; None if its motion diverges.

        rows: of the samples in the recording. guess: (n_states,) near it. values: (n, n_sensed) the
        samples, NaN where missing. slopes: sensitivities of a similar model and initial state, used
        instead of recomputed ones.
        """
        time = self.recording.time[rows]
        weight = np.isfinite(values) * self.inverse_sigma
        target, start = np.nan_to_num(values), guess
        for stage in STAGE_SHARES if slopes is None else STAGE_SHARES[-1:]:
            n = max(int(stage * len(time)), min(len(time), 2 * len(guess)))
            for _ in range(MAX_ITERATIONS if slopes is None else MAX_REFINEMENTS):
                motion = self.motion(model, start, time[:n])
                if not np.isfinite(motion).all():
                    return None
                by_start = slopes
                if by_start is None:
                    by_start = self.differentiate(model, start, motion, time[:n])
                if not np.isfinite(by_start).all():
                    return None
                residuals = ((target[:n] - motion) * weight[:n]).ravel()
                design = (by_start * weight[:n]).reshape(len(start), -1).T
                size = np.linalg.norm(design, axis=0) + np.finfo(float).tiny
                step = np.linalg.lstsq(design / size, residuals, rcond=1e-12)[0]
                start = start + step / size
                if np.sum((design @ (step / size)) ** 2) < CHI2_TOLERANCE:
                    break
        return start

    def differentiate(
        self, model: PolynomialModel, start: np.ndarray, motion: np.ndarray, time: np.ndarray
    ) -> np.ndarray:
        """Differentiate a simulated motion by its initial state: (n_states, n, n_sensed)."""
        size = np.abs(start) + np.nanstd(motion[:, : len(start)], axis=0)
        size = DIFFERENCE_STEP * np.where(size > 0.0, size, size.max() or 1.0)
        changes = [self.motion(model, start + step, time) - motion for step in np.diag(size)]
        return np.array(changes) / size[:, np.newaxis, np.newaxis]

    def misfit(self, motion: np.ndarray, values: np.ndarray) -> float:
        """Compute chi^2 per sample of a simulated motion, infinite if the motion diverges.

        motion, values: (n, n_sensed).
        """
        is_used = np.isfinite(values) & (self.sigma > 0)
        squares = ((values - motion) / np.where(self.sigma > 0, self.sigma, 1.0)) ** 2
        mean = np.mean(squares[is_used]) if is_used.any() else np.inf
        return float(mean) if np.isfinite(mean) else np.inf


def first_guess(recording: Recording, begin: int) -> np.ndarray:
    """Estimate all states at one sample by interpolation; unmeasured velocities are slopes."""
    recording = with_integrals(recording)
    time, states = recording.time, recording.states
    guess = np.zeros(len(states))
    displacement = {velocity: k for k, velocity in velocity_pairs(states).items()}
    for k in range(len(states)):
        is_finite = np.isfinite(recording.values[:, k])
        if is_finite.any():
            guess[k] = np.interp(time[begin], time[is_finite], recording.values[is_finite, k])
        elif k in displacement:
            source = recording.values[:, displacement[k]]
            is_finite = np.isfinite(source)
            if np.count_nonzero(is_finite) <= MIN_SLOPE_SAMPLES:
                continue
            distance = np.abs(time[is_finite] - time[begin])
            nearest = np.partition(distance, MIN_SLOPE_SAMPLES)[MIN_SLOPE_SAMPLES]
            with suppress(IdentificationError):  # without any motion, the velocity is zero
                is_near = distance <= max(SLOPE_PERIODS / 2 * shortest_period([recording]), nearest)
                guess[k] = np.polyfit(
                    time[is_finite][is_near] - time[begin], source[is_finite][is_near], 1
                )[0]
    return guess
