"""Initial models of a fit in random forces: modes from correlations, then forces and noise.

The correlations of stationary motion decay as free motion does. Stochastic subspace identification
finds its modes (P. Van Overschee and B. De Moor, 1996; B. Peeters and G. De Roeck, MSSP 13, 1999);
with their shapes in the displacements these give stiffness and damping of the named equations.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.polynomial import Legendre
from scipy.fft import next_fast_len
from scipy.optimize import nnls

from galloping.arrays import round_down
from galloping.identification.findings import Code
from galloping.identification.no_model import NO_MODEL_ERRORS, IdentificationError, NoModel, attempt
from galloping.identification.oscillations import MAX_DAMPING_RATIO
from galloping.identification.preparation.channels import Channels
from galloping.identification.preparation.smoothing import without_means
from galloping.identification.preparation.weak_form import MAX_WEAK_MISFIT, Start
from galloping.recording.samples import Recording

# Lengths of the correlations from which modes are found, in shortest periods. Short ones show broad
# modes, long ones close modes. All are tried, and the likeliest start is used.
CORRELATION_PERIODS = (3.0, 8.0, 15.0)
LAGS_PER_PERIOD = 8  # number of lags in a shortest period; more add no information
MIN_START_DAMPING = 1e-3  # least damping ratio of a start: a motion that lasts is stable
# Number of bins of a spectrum in each mean. A mean of noise has a relative deviation of a half.
MEAN_BINS = 4
# Share of a spectrum's frequencies above which it is mostly noise.
NOISE_BAND_START = 0.75
# Least ratio of a signal to the median of this noise. Noise exceeds it in one of 3,700 means of
# four bins.
MIN_SIGNAL_RATIO = 4.0
# Share of a velocity's power at periods longer than the shortest of the motion.
VELOCITY_SHARE = 0.95
# Least initial strength of a force or a noise, relative to that with which it alone would explain
# the spectra: several forces may explain the same part of these.
MIN_START_STRENGTH = 0.1
# Least ratio of a start's period to that of the oscillations if it follows something slower, such
# as turbulence. A smaller value causes searches in vain, a larger one overlooks such oscillations.
# The value was not calibrated.
MIN_PERIOD_RATIO = 4.0
# Largest noise, relative to the motion, that does not hide the misfit of the weak form by random
# forces. Measured: with 0.3, six motions in random forces have misfits of 2.5 to 4.6; with 0.1, 16
# to 46.
MAX_NOISE_SHARE = 0.2


def place_on_grid(time: np.ndarray, samples: np.ndarray, step: float) -> np.ndarray:
    """Place samples on the nearest points of a uniform time grid, NaN where there is no sample.

    samples: (n, n_channels). step: s.
    """
    positions = np.round((time - time[0]) / step).astype(np.int64)
    grid = np.full((positions[-1] + 1, samples.shape[1]), np.nan)
    grid[positions] = samples
    return grid


def typical_step(recordings: Sequence[Recording]) -> float:
    """Compute the median time step between the samples of all recordings, s."""
    return float(np.median(np.concatenate([np.diff(each.time) for each in recordings])))


def place_on_grids(recordings: Sequence[Recording]) -> tuple[float, list[np.ndarray]]:
    """Place the samples of all recordings, less their means, on time grids with a common step.

    Returns the step, s, and the samples of each recording.
    """
    channels, step = Channels.from_recordings(recordings), typical_step(recordings)
    return step, [
        place_on_grid(each.time, without_means(channels.samples(each)), step) for each in recordings
    ]


def sample_correlations(grids: list[np.ndarray], lags: int) -> tuple[np.ndarray, np.ndarray]:
    """Estimate the correlation matrices of the channels at each time lag.

    Returns means of y(t + lag) y(t)' over the available samples, and the numbers of these, both
    (lags + 1, n_channels, n_channels).
    """
    channels = grids[0].shape[1]
    total, count = np.zeros((2, lags + 1, channels, channels))
    for grid in grids:
        total += _sum_lagged_products(np.nan_to_num(grid), lags)
        count += np.round(_sum_lagged_products(np.isfinite(grid).astype(float), lags))
    return total / np.maximum(count, 1.0), count


def _sum_lagged_products(samples: np.ndarray, lags: int) -> np.ndarray:
    """Sum y(t + lag) y(t)' over samples, (lags + 1, n_channels, n_channels)."""
    size = next_fast_len(len(samples) + lags, real=True)
    spectrum = np.fft.rfft(samples, size, axis=0)
    products = spectrum[:, :, None] * spectrum[:, None].conj()
    return np.fft.irfft(products, size, axis=0)[: lags + 1]


def modes_from_correlations(
    correlation: np.ndarray, step: float, count: int, additional: int
) -> tuple[np.ndarray, np.ndarray]:
    """Identify modes from correlation matrices by stochastic subspace identification.

    Returns eigenvalues (count,), 1/s, and shapes (n_channels, count) of `count` oscillations.
    correlation: (n_lags, n_channels, n_channels), of lags that are multiples of `step`, s.
    additional: number of further states of the correlations; the strongest oscillations are
    returned. Raises IdentificationError if there are fewer.
    """
    channels, rows = correlation.shape[1], (len(correlation) + 1) // 2
    order = 2 * count + additional
    if (rows - 1) * channels < order:
        raise IdentificationError(Code.MODES_UNDETERMINED)
    place = np.arange(rows)
    hankel = correlation[place[:, None] + place].transpose(0, 2, 1, 3)
    left, size, right = np.linalg.svd(hankel.reshape(rows * channels, rows * channels))
    observability = left[:, :order] * np.sqrt(size[:order])
    transition = np.linalg.lstsq(observability[:-channels], observability[channels:], rcond=None)[0]
    values, vectors = np.linalg.eig(transition)
    begins = np.linalg.inv(vectors) @ (np.sqrt(size[:order, None]) * right[:order, :channels])
    shapes = observability[:channels] @ vectors
    weight = np.linalg.norm(shapes, axis=0) * np.linalg.norm(begins, axis=1)
    rates = np.log(values.astype(complex)) / step
    oscillates = (rates.imag > 0) & (-rates.real < MAX_DAMPING_RATIO * np.abs(rates))
    modes = np.flatnonzero(oscillates)
    if len(modes) < count:
        raise IdentificationError(Code.NO_OSCILLATION)
    modes = modes[np.argsort(-weight[modes])][:count]
    modes = modes[np.argsort(rates.imag[modes])]
    return rates[modes], shapes[:, modes]


@dataclass(frozen=True)
class ExtraModes:
    """Modes for which the model has no coordinate, which act on it as oscillating forces.

    oscillators: (n_resonances, 2), frequency, rad/s, and damping ratio. onto: (n_resonances,
    n_forced) what each adds to the equations with a force; hosts: (n_resonances,) those in which
    this is one.
    """

    oscillators: np.ndarray
    onto: np.ndarray
    hosts: tuple[int, ...]

    @property
    def is_shared(self) -> np.ndarray:
        """Whether entries of `onto`, in its shape, are free rather than one by definition."""
        shared = np.ones(self.onto.shape, bool)
        shared[np.arange(len(self.hosts)), list(self.hosts)] = False
        return shared


def find_linear_systems(
    channels: Channels, grids: list[np.ndarray], step: float, period: float, n_further: int
) -> Iterator[tuple[np.ndarray, ExtraModes]]:
    """Yield linear systems as initial guesses, from the correlations of recorded motion.

    Each is a matrix, (n_states, n_states), and `n_further` modes without a coordinate. grids:
    samples on uniform steps, s, without their means. period: s, the shortest of the motion. Each
    system is from correlations of another length, of the samples or of their differences, which
    have the same modes and weaker slow components.
    """
    count = len(channels.pairs) + n_further
    size = np.nanstd(np.concatenate(grids), axis=0)
    size = np.where(size > 0.0, size, 1.0)
    grids = [grid / size for grid in grids]
    stride = max(round_down(period / LAGS_PER_PERIOD / step), 1)
    differences = [grid[stride:] - grid[:-stride] for grid in grids if len(grid) > 2 * stride]
    longest = max(len(grid) for grid in grids) // 3
    lags = min(int(CORRELATION_PERIODS[-1] * LAGS_PER_PERIOD), longest // stride) * stride
    for samples, first in ((grids, 1), (differences, 2)):
        correlation = sample_correlations(samples, lags)[0][::stride]
        # additional states are for slow motion or for other modes
        for span, additional in product(CORRELATION_PERIODS, (0, 4)):
            part = correlation[first : first + int(span * LAGS_PER_PERIOD)]
            try:
                rates, shapes = modes_from_correlations(part, stride * step, count, additional)
                start = _start_with_modes(channels, rates, size[:, np.newaxis] * shapes)
            except NO_MODEL_ERRORS:
                continue
            yield start


def _start_with_modes(
    channels: Channels, rates: np.ndarray, shapes: np.ndarray
) -> tuple[np.ndarray, ExtraModes]:
    """Make the system with these modes.

    The coordinates' own are those whose shapes differ most; the others are forces on these. Raises
    IdentificationError if the shapes of two of them are nearly the same, or no channel measures a
    coordinate.
    """
    coordinates, velocities = list(channels.pairs), list(channels.pairs.values())
    damping = np.maximum(-rates.real, MIN_START_DAMPING * np.abs(rates))
    rates = 1j * rates.imag - damping
    displacements = np.array([channels.displacement(i, rates, shapes) for i in coordinates])
    coordinate_modes = max(
        map(list, combinations(range(len(rates)), len(coordinates))),
        key=lambda modes: abs(np.linalg.det(displacements[:, modes])),
    )
    system = channels.system_with_modes(rates[coordinate_modes], shapes[:, coordinate_modes])
    others, shapes = (np.delete(each, coordinate_modes, axis=-1) for each in (rates, displacements))
    states = np.zeros((len(system), len(others)), complex)
    states[coordinates], states[velocities] = shapes, shapes * others
    residual = states[velocities] * others - system[velocities] @ states
    forces = residual[np.argsort(velocities)].T
    hosts = np.argmax(np.abs(forces), axis=1)
    onto = (forces / forces[np.arange(len(hosts)), hosts][:, np.newaxis]).real
    further = np.array([np.abs(others), -others.real / np.abs(others)]).T
    return system, ExtraModes(further, onto, tuple(hosts.tolist()))


def estimate_spectra(grids: list[np.ndarray], step: float) -> tuple[np.ndarray, np.ndarray]:
    """Estimate the power spectra of all channels of each record, averaged over adjacent bins.

    Returns frequencies (n,), rad/s, those of all records in ascending order, and two-sided spectra
    (n, n_channels). MEAN_BINS bins are averaged.
    """
    frequencies, powers = [], []
    for grid in grids:
        is_known = np.isfinite(grid)
        share = np.maximum(is_known.mean(axis=0), 1e-3)
        power = np.abs(np.fft.rfft(np.where(is_known, grid, 0.0), axis=0)[1:]) ** 2
        groups = len(power) // MEAN_BINS
        for c in np.flatnonzero(is_known.sum(axis=0) > 1):
            stride = np.median(np.diff(np.flatnonzero(is_known[:, c])))
            power[int(len(grid) / (2.0 * stride)) :, c] = 0.0  # mirror images of what is slower
        means = power[: groups * MEAN_BINS].reshape(groups, MEAN_BINS, power.shape[1]).mean(axis=1)
        powers.append(means * step / len(grid) / share)
        middle = np.arange(groups) * MEAN_BINS + (MEAN_BINS + 1) / 2  # bin 0 is the mean
        frequencies.append(2.0 * np.pi * middle / (len(grid) * step))
    omega = np.concatenate(frequencies)
    order = np.argsort(omega, kind="stable")
    return omega[order], np.concatenate(powers)[order]


def above_noise(power: np.ndarray) -> np.ndarray:
    """Set to zero those of ascending spectra, (n, n_channels), that white noise explains."""
    fast = power[int(NOISE_BAND_START * len(power)) :]
    noise = np.array([np.median(own[own > 0.0]) if own.any() else 0.0 for own in fast.T])
    return np.where(power > MIN_SIGNAL_RATIO * noise, power, 0.0)


def shortest_velocity_period(recordings: Sequence[Recording]) -> float:
    """Estimate the shortest period of a motion, s, from the spectra of its velocities.

    White noise is left out. Raises IdentificationError if the recordings show no motion.
    """
    channels, (step, grids) = Channels.from_recordings(recordings), place_on_grids(recordings)
    omega, power = estimate_spectra(grids, step)
    if not len(omega):
        raise IdentificationError(Code.MODES_UNDETERMINED)
    orders = dict(own for i in channels.pairs for own in channels.derivatives(i))
    exponent = [2 - 2 * orders.get(c, 0) for c in range(power.shape[1])]
    above = above_noise(power) * omega[:, np.newaxis] ** exponent
    share = np.cumsum(above, axis=0) / np.maximum(above.sum(axis=0), np.finfo(float).tiny)
    fastest = [omega[np.searchsorted(each, VELOCITY_SHARE)] for each in share.T if each[-1] > 0.5]
    if not fastest:
        raise IdentificationError(Code.NO_MOTION)
    return float(2.0 * np.pi / max(fastest))


def estimate_strengths(
    system: np.ndarray,
    extra_modes: ExtraModes,
    forced: tuple[int, ...],
    channels: Channels,
    omega: np.ndarray,
    power: np.ndarray,
    slow: float | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimate the strengths of random forces and noise that best explain measured spectra.

    Returns covariances per second of white forces, in the equations (n_forced,) and then on the
    resonances, and of the drive of slow ones, (n_forced,), and spectra (n_channels,) of noise.

    system, extra_modes: as of `find_linear_systems`. omega: (n,) rad/s, power: (n, n_channels),
    zero where a channel is not recorded. slow: rate of slow forces, 1/s; None: there are none.
    """
    n, many = power.shape
    is_recorded = power > 0.0
    response = channels.response(system, omega)[:, :, list(forced)]
    power_gains = np.abs(response) ** 2
    columns = list(power_gains.transpose(2, 0, 1))
    for (natural, damping), onto in zip(extra_modes.oscillators, extra_modes.onto, strict=True):
        stiffness = natural**2 - omega**2 + 2j * damping * natural * omega
        columns.append(np.abs(response @ onto / stiffness[:, np.newaxis]) ** 2)
    n_white = len(columns)
    if slow is not None:
        columns += list((power_gains / (slow**2 + omega[:, None, None] ** 2)).transpose(2, 0, 1))
    columns += [np.broadcast_to(unit, (n, many)) for unit in np.eye(many)]
    design = (np.array(columns)[:, is_recorded] / power[is_recorded]).T
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    strengths, _ = nnls(design / scale, np.ones(len(design)))
    alone = np.linalg.norm(np.ones(len(design))) / scale
    strengths = np.maximum(strengths / scale, MIN_START_STRENGTH * alone)
    return strengths[:n_white], strengths[n_white:-many], strengths[-many:]


PART_PERIODS = 3  # length of the parts whose size is computed, in periods
# Largest ratio between the means, in thirds of a recording, of an amplitude that fluctuates.
MAX_MEAN_RATIO = 5.0
# Least deviation of a fluctuating amplitude from its trend, relative to its mean. For a narrow band
# of Gaussian noise this deviation is 0.15 to 0.5.
MIN_FLUCTUATION = 0.12
TREND_DEGREE = 3  # degree of the polynomial trend


def amplitude_fluctuates(recordings: Sequence[Recording], period: float) -> bool:
    """Decide whether the amplitude of the motion fluctuates irregularly in every channel.

    Random forces cause this; a motion that grows, decays or repeats does not fluctuate. period: s.
    Parts of less than half the longest recording are ignored: a few periods follow any trend.
    """
    fluctuates, channels = [], Channels.from_recordings(recordings)
    lengths = [np.ptp(recording.time) for recording in recordings]
    for recording, length in zip(recordings, lengths, strict=True):
        if 2.0 * length < max(lengths):
            continue
        count = max(round_down(length / (PART_PERIODS * period)), 3)
        for samples in channels.samples(recording).T:
            parts = np.array_split(samples[np.isfinite(samples)], count)
            if min(map(len, parts)) > 1:
                sizes = np.array([part.std() for part in parts])
                thirds = [third.mean() for third in np.array_split(sizes, 3)]
                lasts = max(thirds) < MAX_MEAN_RATIO * min(thirds)
                place = np.linspace(-1.0, 1.0, len(sizes))
                trend = Legendre.fit(place, sizes, min(TREND_DEGREE, len(sizes) - 1))(place)
                varies = np.std(sizes - trend) > MIN_FLUCTUATION * sizes.mean()
                fluctuates.append(lasts and varies)
    return bool(fluctuates) and all(fluctuates)


def is_ambient_candidate(start: Start) -> bool:
    """Decide whether random forces may have caused the recorded motion.

    The weak form of a motion that follows from its initial state has small residuals. They are no
    evidence of such a motion if noise hides larger ones, or if the start follows slower components
    instead of the oscillations.
    """
    if start.fit.misfit >= MAX_WEAK_MISFIT:
        return True
    if not amplitude_fluctuates(start.recordings, start.period):
        return False
    noises = ((one.noise, one.states[one.valid].std(axis=0)) for one in start.smoothed)
    if any(np.any(noise > MAX_NOISE_SHARE * size) for noise, size in noises):
        return True
    fastest = attempt(shortest_velocity_period, start.recordings)
    return not isinstance(fastest, NoModel) and bool(fastest < start.period / MIN_PERIOD_RATIO)
