"""Sufficient statistics of a recording on short windows, where states are almost quadratic."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numba import njit

from galloping.identification.preparation.channels import Channels
from galloping.identification.work import count_work
from galloping.trajectory.right_hand_side import System
from galloping.trajectory.taylor import ORDER, Samples, integrate

# Number of windows in a shortest period. They are so short that projections contain all information
# of the samples.
WINDOWS_PER_PERIOD = 12
PROJECTIONS = 3  # number of projections to which the samples of a window are reduced
# Error of Taylor series of `taylor.ORDER` over a window, relative to each state. It is below the
# noise of any sensor.
TRUNCATION_ERROR = 1e-7


@dataclass(frozen=True)
class Condensed:
    """Samples of recordings, projected onto three orthonormal polynomials in each short window.

    n_rows = PROJECTIONS, those of a channel in a window. step: length of a window, s. first:
    (n_recordings + 1,) first window of each recording. channels: the n_observed measured ones.
    functionals: (n_windows, n_observed, n_rows, ORDER + 1), from Taylor coefficients in the time
    scaled by the window to the expected projections; zero rows if a window has few samples.
    targets: (n_windows, n_observed, n_rows) the projections of the samples, in the state's unit.
    counts: (n_recordings, n_observed) samples; rows: the same, non-zero rows. remainder:
    (n_recordings, n_observed) sum of squares of the samples outside the projections. known_noise:
    (n_recordings, n_observed) deviation of a sample if known, else NaN. inputs: (n_windows,
    n_powers, n_factors) factors of the inputs over each window (see `Problem.input_polynomials`),
    without inputs (n_windows, 1, 0). samples: those behind the projections, kept if the terms of a
    library have kinks, else None.
    """

    step: float
    first: np.ndarray
    channels: Channels
    functionals: np.ndarray
    targets: np.ndarray
    counts: np.ndarray
    rows: np.ndarray
    remainder: np.ndarray
    known_noise: np.ndarray
    inputs: np.ndarray
    samples: Samples | None = None

    def integrate_segments(
        self, compiled: System, first: np.ndarray, starts: np.ndarray, sensitive: bool
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
        """Integrate the equations over each segment, and project the solution like the samples.

        As `taylor.integrate`. first: (n_segments + 1,) windows at which the segments begin, and the
        end of the last one.
        """
        within, samples = slice(first[0], first[-1]), self.samples
        if samples is not None:
            samples = samples._replace(offsets=samples.offsets[first[0] : first[-1] + 1])
        solution = integrate(
            compiled, self.step, first - first[0], starts, self.functionals[within],
            self.channels.observed, self.inputs[within], sensitive, samples,
        )  # fmt: skip
        windows, columns = first[-1] - first[0], solution[1].shape[3]
        n_entries = len(set(map(tuple, compiled.jacobian[:, :2].tolist())))
        products = n_entries * ORDER**2 / 2 + self.functionals[0, ..., 0].size * ORDER
        count_work(2.3e-10 * windows * (columns * products + 3 * ORDER**2 * len(compiled.parent)))
        return solution

    def as_rates(self) -> Self:
        """Return a copy that projects time derivatives of the channels instead of values."""
        samples = self.samples and self.samples._replace(order=self.samples.order + 1)
        shifted = rate_functionals(self.functionals, self.step)
        return replace(self, functionals=shifted, samples=samples)

    def sum_squares(self, residual: np.ndarray) -> np.ndarray:
        """Sum squared residuals, shaped as `targets`, to (n_recordings, n_observed)."""
        return np.add.reduceat((residual**2).sum(axis=2), self.first[:-1], axis=0)

    def noise_by_state(self, noise: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
        """Sort the noise of the recordings' channels as `Channels.noise_by_state`."""
        return self.channels.noise_by_state(np.where(self.counts > 0, noise, np.nan))

    @cached_property
    def is_present(self) -> np.ndarray:
        """Whether each projection exists, shaped as `targets`: windows may have too few samples."""
        return np.asarray(self.functionals.any(axis=3))

    @property
    def is_known(self) -> np.ndarray:
        """Whether the noise of each channel is known in advance, (n_recordings, n_observed)."""
        return np.isfinite(self.known_noise) & (self.counts > 0)

    @property
    def noise_variance(self) -> np.ndarray:
        """Noise variance of a sample, known or from `remainder`, (n_recordings, n_observed)."""
        spare = self.counts - self.rows  # without spare samples the remainder is rounding
        inside = np.where(spare > 0, self.remainder, 0.0) / np.maximum(spare, 1)
        return np.where(self.is_known, self.known_noise**2, inside)

    @property
    def has_noise_estimate(self) -> np.ndarray:
        """Whether the noise of each channel is known or can be estimated, for each recording.

        Shape (n_recordings, n_observed). It can be estimated if more than three tenths of all
        samples are spare: two of five samples in a window are enough, one of four is not. From 0.15
        to 0.5 no answer of `make exam` changes.
        """
        spare = self.counts - self.rows
        return self.is_known | (spare > 0.3 * np.maximum(self.counts, 1))

    @property
    def samplings(self) -> np.ndarray:
        """Projections of a channel that is 1 and of a channel that rises from 0 to 1 in a window.

        Shape (n_windows, n_observed, n_rows, 2): these are the functionals on a channel and on its
        rate, for the time scaled by the window.
        """
        constant_and_ramp = self.functionals[..., :2].copy()
        is_rate = self.channels.is_rate
        rates = self.functionals[:, is_rate, :, 1:3] * (self.step / np.array([1, 2]))
        constant_and_ramp[:, is_rate] = rates
        return constant_and_ramp

    @cached_property
    def motion(self) -> np.ndarray:
        """Projections of the samples less their mean in each recording, shaped as `targets`."""
        ones = self.samplings[..., 0]
        sums = [
            np.add.reduceat(np.sum(ones * each, axis=2), self.first[:-1])
            for each in (self.targets, ones)
        ]
        means = sums[0] / np.maximum(sums[1], np.finfo(float).tiny)
        means = np.repeat(means, np.diff(self.first), axis=0)
        return self.targets - means[..., np.newaxis] * ones


def rate_functionals(functionals: np.ndarray, step: float) -> np.ndarray:
    """Convert weights on a signal's Taylor coefficients to weights that act on its derivative."""
    shifted = np.zeros_like(functionals)
    powers = np.arange(1, functionals.shape[-1]) / step
    np.multiply(functionals[..., :-1], powers, out=shifted[..., 1:])
    return shifted


@njit(cache=True)
def _project_recording(
    tau, values, offsets, longest, functionals, targets, counts, rows, remainder, sample_basis
):
    """Fill the statistics of one recording, in place, as in `Condensed`.

    tau: (n,) times in their windows, 0 to 1. values: (n, n_observed). offsets: (n_windows + 1,)
    first sample of each window. longest: samples of the fullest window; to find it here would
    compile for five seconds longer. sample_basis: (n, n_observed, n_rows), to be filled with the
    basis, or None. The basis is orthonormal on a window's samples: Legendre-like, by
    Gram-Schmidt, twice for its rounding.
    """
    n_windows, n_observed, n_rows, n_powers = functionals.shape
    basis = np.empty((n_rows, longest))
    point = np.empty(longest)
    sample = np.empty(longest)
    for w in range(n_windows):
        for o in range(n_observed):
            n = 0
            for i in range(offsets[w], offsets[w + 1]):
                if np.isfinite(values[i, o]):
                    point[n] = tau[i]
                    sample[n] = values[i, o]
                    n += 1
            counts[o] += n
            if sample_basis is not None:
                places = offsets[w] + np.flatnonzero(
                    np.isfinite(values[offsets[w] : offsets[w + 1], o])
                )
            used = 0
            for degree in range(min(n_rows, n)):
                size = 0.0
                for i in range(n):
                    basis[used, i] = (2.0 * point[i] - 1.0) ** degree
                    size += basis[used, i] ** 2
                for _ in range(2):
                    for b in range(used):
                        dot = 0.0
                        for i in range(n):
                            dot += basis[b, i] * basis[used, i]
                        for i in range(n):
                            basis[used, i] -= dot * basis[b, i]
                rest = 0.0
                for i in range(n):
                    rest += basis[used, i] ** 2
                if rest < 1e-9 * size or size == 0.0:
                    continue
                for i in range(n):
                    basis[used, i] /= np.sqrt(rest)
                used += 1
            for b in range(used):
                dot = 0.0
                for i in range(n):
                    dot += basis[b, i] * sample[i]
                    power = basis[b, i]
                    for k in range(n_powers):
                        functionals[w, o, b, k] += power
                        power *= point[i]
                targets[w, o, b] = dot
                for i in range(n):  # not the difference of squares, which an offset would round off
                    sample[i] -= dot * basis[b, i]
                if sample_basis is not None:
                    for i in range(n):
                        sample_basis[places[i], o, b] = basis[b, i]
            for i in range(n):
                remainder[o] += sample[i] ** 2
            rows[o] += used


def condense_recordings(
    times: list[np.ndarray],
    values: list[np.ndarray],
    channels: Channels,
    step: float,
    known_noise: np.ndarray,
    keep_samples: bool = False,
) -> Condensed:
    """Project the samples of recordings onto three polynomials in each of many short windows.

    times: per recording (n,), s, increasing. values: per recording (n, n_observed), NaN where a
    sample is missing. keep_samples: whether terms have kinks. The others as in `Condensed`.
    """
    windows = [max(1, int(np.ceil((time[-1] - time[0]) / step - 1e-6))) for time in times]
    first = np.concatenate([[0], np.cumsum(windows)])
    n_observed, is_rate = len(channels.names), channels.is_rate
    count_work(4e-7 * n_observed * (first[-1] + sum(map(len, times))))
    functionals = np.zeros((first[-1], n_observed, PROJECTIONS, ORDER + 1))
    targets = np.zeros((first[-1], n_observed, PROJECTIONS))
    counts, rows = np.zeros((2, len(times), n_observed), np.int64)
    remainder = np.zeros((len(times), n_observed))
    parts, begins = [], []
    for r, (time, value) in enumerate(zip(times, values, strict=True)):
        window_time = (time - time[0]) / step
        window = np.minimum((window_time + 1e-9).astype(np.int64), windows[r] - 1)
        offsets = np.searchsorted(window, np.arange(windows[r] + 1))
        within = slice(first[r], first[r + 1])
        basis = np.zeros((*value.shape, PROJECTIONS)) if keep_samples else None
        _project_recording(
            window_time - window, np.ascontiguousarray(value, dtype=float), offsets,
            int(np.diff(offsets).max()), functionals[within], targets[within], counts[r], rows[r],
            remainder[r], basis,
        )  # fmt: skip
        parts.append((window_time - window, basis))
        begins.append(offsets[:-1] + sum(map(len, times[:r])))
    functionals[:, is_rate] = rate_functionals(functionals[:, is_rate], step)
    samples = None
    if keep_samples:
        tau, basis = map(np.concatenate, zip(*parts, strict=True))
        offsets = np.append(np.concatenate(begins), len(tau))
        samples = Samples(offsets, tau, basis, is_rate.astype(np.int64))
    return Condensed(
        step, first, channels, functionals, targets, counts, rows, np.maximum(remainder, 0.0),
        known_noise, np.zeros((len(targets), 1, 0)), samples,
    )  # fmt: skip
