"""Fit of exponentially damped sinusoids, the modes of free motion, by maximum likelihood.

A channel of free linear motion is a sum of terms Re[a exp(s t)]. The poles s are shared by all
channels and all stretches of a recording, and the amplitudes a are free. The amplitudes are
eliminated (variable projection, G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10, 1973), and
Gauss-Newton steps are taken on the poles.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import legvander

from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError, NoModel, attempt
from galloping.identification.preparation.smoothing import MIN_CHANNEL_SAMPLES, deviations_of
from galloping.identification.work import count_work

MAX_STEPS = 30  # most Gauss-Newton steps
POLE_TOLERANCE = 1e-3  # largest last step of a pole in a converged fit, in standard errors
# Relative rounding error: least noise relative to the motion, and least share of information.
ROUNDING_ERROR = 1e-10
# Number of means of samples in a shortest period, for a first fit. Means lack 0.6 % of information.
MEANS_PER_PERIOD = 24


@dataclass(frozen=True)
class Stretch:
    """Consecutive samples of free motion in several channels.

    time: (n,) s, from the first sample. values: (n, n_channels), NaN where missing. drift_degrees:
    degree of the polynomial drift of each channel in time; 0 is a constant.
    """

    time: np.ndarray
    values: np.ndarray
    drift_degrees: tuple[int, ...]

    @cached_property
    def duration(self) -> float:
        """Time between the first and the last sample, s."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def step(self) -> float:
        """Median time between samples, s."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def sizes(self) -> np.ndarray:
        """Standard deviation of each channel, (n_channels,), zero without samples."""
        return deviations_of(self.values)


@dataclass(frozen=True)
class DampedModes:
    """Exponentially damped sinusoids fitted to samples of free motion.

    poles: (n_modes,) complex, growth, 1/s, negative for a decay, and frequency, rad/s. covariance:
    (2 n_modes, 2 n_modes), of the growths and then of the frequencies. amplitudes: (n_modes,
    n_channels) complex, at the first sample of each stretch. offsets, offset_errors: (n_stretches,
    n_channels) constant offsets of the channels, and their standard errors; NaN for drifting
    channels. noise: (n_stretches, n_channels) standard deviation of a sample, NaN if a stretch
    lacks a channel. residuals: (n, n_channels) for each stretch, samples less the fit, NaN where
    missing. misfit: sum over channels and stretches of n ln(noise^2).
    """

    poles: np.ndarray
    covariance: np.ndarray
    amplitudes: list[np.ndarray]
    offsets: np.ndarray
    offset_errors: np.ndarray
    noise: np.ndarray
    residuals: list[np.ndarray]
    misfit: float

    @property
    def growth_errors(self) -> np.ndarray:
        """Standard errors of the modes' growth rates, (n_modes,), 1/s."""
        return np.sqrt(np.diag(self.covariance)[: len(self.poles)])

    @property
    def frequency_errors(self) -> np.ndarray:
        """Standard errors of the modes' frequencies, (n_modes,), rad/s."""
        return np.sqrt(np.diag(self.covariance)[len(self.poles) :])

    @property
    def first_fitted(self) -> int:
        """Index of the first stretch in which a channel has enough samples for the fit."""
        return int(np.argmax(np.isfinite(self.noise).any(axis=1)))

    def standardised_amplitudes(self, index: int) -> np.ndarray:
        """Divide the amplitudes at the beginning of a stretch by the noise of a sample.

        index: of the stretch. Returns (n_modes, n_channels) complex, zero for channels without
        samples.
        """
        amplitudes, noise = self.amplitudes[index], self.noise[index]
        is_known = np.isfinite(noise)
        return np.divide(amplitudes, noise, out=np.zeros_like(amplitudes), where=is_known)

    def amplitude_covariance(
        self, stretch: Stretch, index: int, which: Sequence[int]
    ) -> np.ndarray:
        """Compute the joint covariance of poles and amplitudes of some modes in one stretch.

        stretch: one of those that the modes are fitted to. index: its place among them. which:
        indices of the n_which modes. Returns (n, n), of growths, frequencies, real and imaginary
        parts of the amplitudes, each by mode and then by channel: n = n_which (2 + 2 n_channels).
        The covariance is zero for channels without samples.
        """
        many, channels = self.amplitudes[index].shape
        origin = np.zeros(many)
        columns = _wave_columns(stretch, self.poles, origin)
        by_poles = np.zeros((2 * many, channels, 2 * many))  # derivatives of amplitudes
        of_noise = np.zeros((2 * many, channels, 2 * many, channels))
        for c in np.flatnonzero(np.isfinite(self.noise[index])):
            degree = stretch.drift_degrees[c]
            is_known = np.isfinite(stretch.values[:, c])
            products = columns[is_known].T @ columns[is_known]
            basis, inverse = _invert_basis(products, many, degree)
            inverse = inverse[: 2 * many]
            amplitudes = self.amplitudes[index][:, c]
            slopes = _pole_slopes(amplitudes, origin, stretch.duration, columns.shape[1])
            sign = np.repeat([1.0, -1.0], many)  # sine coefficients are minus the imaginary parts
            by_poles[:, c] = -sign[:, np.newaxis] * (inverse @ products[basis] @ slopes)
            of_unit_noise = inverse[:, : 2 * many] * np.outer(sign, sign)
            of_noise[:, c, :, c] = self.noise[index, c] ** 2 * of_unit_noise
        size = 2 * many * channels
        by_poles = by_poles.reshape(size, 2 * many)
        cross_covariance = by_poles @ self.covariance
        of_amplitudes = of_noise.reshape(size, size) + cross_covariance @ by_poles.T
        whole = np.block([[self.covariance, cross_covariance.T], [cross_covariance, of_amplitudes]])
        poles = np.arange(2 * many).reshape(2, many)
        amplitudes = 2 * many + np.arange(size).reshape(2, many, channels)
        indices = np.concatenate([poles[:, which].ravel(), amplitudes[:, which].ravel()])
        return whole[np.ix_(indices, indices)]

    def evaluate(
        self, which: Sequence[int] | np.ndarray, stretch: int, time: np.ndarray
    ) -> np.ndarray:
        """Compute the motion of some modes at given times from the start of a stretch.

        Returns (n, n_channels). time: (n,) s.
        """
        places = list(which)
        waves = np.exp(np.outer(time, self.poles[places]))
        return (waves @ self.amplitudes[stretch][places]).real


def fit_poles(
    stretches: Sequence[Stretch], poles: np.ndarray, is_steady: np.ndarray | None = None
) -> DampedModes:
    """Fit damped sinusoids to samples of free motion, from initial guesses of their poles.

    If a period has many samples, means of neighbours are fitted first: of equally spaced samples,
    these are damped sinusoids with the same poles. poles: (n_modes,) complex. is_steady:
    (n_modes,) whether each growth is fixed; by default none is. Raises IdentificationError if the
    fit does not lead to finite poles that the samples distinguish.
    """
    steady = np.zeros(len(poles), bool) if is_steady is None else is_steady
    free = np.append(~steady, np.ones(len(poles), bool))
    step = max(one.step for one in stretches)
    count = int(2.0 * np.pi / (MEANS_PER_PERIOD * step * max(poles.imag)))
    means, max_steps = _average_neighbours(stretches, count) if count > 1 else [], MAX_STEPS
    if means:
        rough = attempt(_iterate, means, poles, free, MAX_STEPS)
        if not isinstance(rough, NoModel):
            poles, max_steps = rough.modes.poles, 4
    final = _iterate(stretches, poles, free, max_steps)
    scaled, scale = final.scale_information(free)
    if not np.linalg.cond(scaled) < 1.0 / ROUNDING_ERROR:
        raise IdentificationError(Code.NO_OSCILLATION)
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(free, free)] = np.linalg.inv(scaled) / np.outer(scale, scale)
    return replace(final.modes, covariance=covariance)


def _average_neighbours(stretches: Sequence[Stretch], count: int) -> list[Stretch]:
    """Average each `count` samples in a row; a mean is missing where a sample is, or across a gap.

    The list is empty if more than a tenth of a channel's samples would be lost.
    """
    averaged = []
    for one in stretches:
        n = len(one.time) // count
        if n == 0:
            return []
        time, values = one.time[: n * count], one.values[: n * count]
        time, means = time.reshape(n, count), values.reshape(n, count, -1).mean(axis=1)
        means[np.ptp(time, axis=1) > 1.5 * (count - 1) * one.step] = np.nan
        kept, given = (np.isfinite(each).sum(axis=0) for each in (means, one.values))
        if np.any(kept * count < 0.9 * given):
            return []
        averaged.append(Stretch(time.mean(axis=1), means, one.drift_degrees))
    return averaged


def _iterate(
    stretches: Sequence[Stretch], poles: np.ndarray, free: np.ndarray, max_steps: int
) -> "_NormalEquations":
    """Take Gauss-Newton steps on the poles, and return the linearisation at the last ones.

    free: (2 n_modes,) which growths and frequencies change.
    """
    current = _linearise(stretches, poles)
    fastest = np.pi / min(one.step for one in stretches)
    damping = 1e-3
    for _ in range(max_steps):
        scaled, scale = current.scale_information(free)
        scaled += damping * np.eye(len(scale))
        step = np.zeros(len(free))
        step[free] = np.linalg.solve(scaled, current.right[free] / scale) / scale
        trial_poles = current.modes.poles + step[: len(poles)] + 1j * step[len(poles) :]
        is_possible = np.all((trial_poles.imag > 0.0) & (trial_poles.imag < fastest))
        trial = _linearise(stretches, trial_poles) if is_possible else None
        misfit = current.modes.misfit
        if trial is not None and trial.modes.misfit <= misfit + 1e-9 * abs(misfit):
            current, damping = trial, damping / 10.0
            if np.max(np.abs(step[free]) * scale) < POLE_TOLERANCE:
                break
        elif damping > 1e6:
            break
        else:
            damping = 10.0 * max(damping, 1e-6)
    return current


@dataclass(frozen=True)
class _NormalEquations:
    """Normal equations of the poles, amplitudes eliminated.

    shares: part of the information on each growth and frequency that amplitudes do not explain.
    modes: the fit with these poles, whose covariance is not yet known.
    """

    information: np.ndarray
    shares: np.ndarray
    right: np.ndarray
    modes: DampedModes

    def scale_information(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Scale the information on the free growths and frequencies to a diagonal of ones.

        Returns the result and the square roots of the diagonal, (n_free,). Raises
        IdentificationError if there is no information.
        """
        if not np.all(self.shares[free] > ROUNDING_ERROR):
            raise IdentificationError(Code.NO_OSCILLATION)
        information = self.information[np.ix_(free, free)]
        scale = np.sqrt(np.diag(information))
        return information / np.outer(scale, scale), scale


def _linearise(stretches: Sequence[Stretch], poles: np.ndarray) -> _NormalEquations:
    """Linearise the fit at given poles."""
    n, channels = len(poles), stretches[0].values.shape[1]
    information, right, misfit = np.zeros((2 * n, 2 * n)), np.zeros(2 * n), 0.0
    whole = np.full(2 * n, np.finfo(float).tiny)  # diagonal information for known amplitudes
    offsets, errors, noise = np.full((3, len(stretches), channels), np.nan)
    amplitudes, residuals = [], []
    for r, stretch in enumerate(stretches):
        fitted_amplitudes = np.zeros((n, channels), complex)
        residual = np.full(stretch.values.shape, np.nan)
        origin = np.where(poles.real > 0.0, stretch.duration, 0.0)
        columns = _wave_columns(stretch, poles, origin)
        complete_products: np.ndarray | None = None
        for c, degree in enumerate(stretch.drift_degrees):
            is_known = np.isfinite(stretch.values[:, c])
            count = np.count_nonzero(is_known)
            if count < MIN_CHANNEL_SAMPLES + 2 * n + degree or stretch.sizes[c] == 0.0:
                continue
            values, is_complete = np.where(is_known, stretch.values[:, c], 0.0), is_known.all()
            of_channel = columns if is_complete else np.where(is_known[:, None], columns, 0.0)
            if complete_products is None or not is_complete:
                products = of_channel.T @ of_channel
                count_work(1e-9 * columns.size * columns.shape[1])
                complete_products = products if is_complete else None
            else:
                products = complete_products
            crossed = of_channel.T @ values
            basis, inverse = _invert_basis(products, n, degree)
            solved = inverse @ crossed[basis]
            curve = of_channel[:, basis] @ solved
            remainder = np.where(is_known, values - curve, 0.0)
            least = ROUNDING_ERROR * stretch.sizes[c] + np.finfo(float).tiny
            variance = max(remainder @ remainder / (count - len(solved)), least**2)
            a = solved[:n] - 1j * solved[n : 2 * n]
            slopes = _pole_slopes(a, origin, stretch.duration, columns.shape[1])
            overlap = products[basis] @ slopes
            of_known = slopes.T @ products @ slopes / variance
            whole += np.diag(of_known)
            information += of_known - overlap.T @ inverse @ overlap / variance
            right += slopes.T @ (of_channel.T @ remainder) / variance
            misfit += count * np.log(variance)
            fitted_amplitudes[:, c] = a * np.exp(-poles.real * origin)
            residual[is_known, c] = remainder[is_known]
            noise[r, c] = np.sqrt(variance)
            if degree == 0:
                offsets[r, c] = solved[-1]
                errors[r, c] = noise[r, c] * np.sqrt(inverse[-1, -1])
        amplitudes.append(fitted_amplitudes)
        residuals.append(residual)
    if np.isnan(noise).all() or not np.isfinite(misfit):
        raise IdentificationError(Code.NO_OSCILLATION)
    unknown = np.full((2 * n, 2 * n), np.nan)
    modes = DampedModes(poles, unknown, amplitudes, offsets, errors, noise, residuals, misfit)
    return _NormalEquations(information, np.diag(information) / whole, right, modes)


def _wave_columns(stretch: Stretch, poles: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Make the columns (n, 4 n_modes + n_drifts) of the regression on waves.

    They are the waves as cosines and sines, the same times the relative time, and polynomials of
    the drifts.
    """
    time = stretch.time[:, np.newaxis]
    size, angle = np.exp(poles.real * (time - origin)), poles.imag * time
    waves = np.hstack([size * np.cos(angle), size * np.sin(angle)])
    share = time / stretch.duration
    drifts = legvander(2.0 * share[:, 0] - 1.0, max(stretch.drift_degrees))
    return np.hstack([waves, share * waves, drifts])


def _pole_slopes(a: np.ndarray, origin: np.ndarray, duration: float, count: int) -> np.ndarray:
    """Compute combinations of columns that are derivatives by growths and frequencies.

    Returns (count, 2 n_modes). a: (n_modes,) amplitudes.
    """
    n, slopes = len(a), np.zeros((count, 2 * len(a)))
    k = np.arange(n)
    for part, cosine, sine in ((k, a.real, -a.imag), (k + n, -a.imag, -a.real)):
        slopes[k + 2 * n, part], slopes[k + 3 * n, part] = duration * cosine, duration * sine
    slopes[k, k], slopes[k + n, k] = -origin * a.real, origin * a.imag
    return slopes


def _invert_basis(products: np.ndarray, n: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Invert the normal equations of the waves of n modes, maybe nearly dependent, and a drift.

    products: inner products of all columns. Returns the indices of those of waves and drift, and
    the inverse.
    """
    basis = np.r_[0 : 2 * n, 4 * n : 4 * n + degree + 1]
    gram = products[np.ix_(basis, basis)]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    scales = np.outer(scale, scale)
    return basis, np.linalg.pinv(gram * scales, rcond=1e-14, hermitian=True) * scales
