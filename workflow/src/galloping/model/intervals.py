"""Intervals, random draws from a covariance, and intervals of draws."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

QUANTILES_90 = (0.05, 0.95)  # ends of a 90 % interval
QUANTILES_95 = (0.025, 0.975)  # ends of a 95 % interval
NORMAL_95 = 1.959963984540054  # half width of a 95 % interval, in standard deviations
# Least significant difference, in standard errors. Chance exceeds it once in 16,000 cases.
MIN_SIGNIFICANCE = 4.0
FALSE_ALARM_RATE = 1e-3  # rate of false alarms of a test, by all that it tests together
ERROR_STEP = 1e-3  # step of finite differences, in standard errors
MODEL_DRAWS = 39  # number of drawn models: their extremes are then an unbiased 95 % interval
MIN_INTERVAL_DRAWS = MODEL_DRAWS / 2  # smallest number of drawn models of which an interval is made
# Smallest |coefficient|, relative to its bound, of terms that the penalty 2 ln N selects reliably.
MIN_IDENTIFIABLE_RATIO = 7.6


def median_and_interval(
    values: Sequence[float] | NDArray[np.float64],
) -> tuple[float, float, float]:
    """Compute the median and the 5th and 95th percentiles of values, infinite for failures."""
    low = np.quantile(values, QUANTILES_90[0], method="lower")
    high = np.quantile(values, QUANTILES_90[1], method="higher")
    return float(np.median(values)), float(low), float(high)


def draw_normal(
    mean: np.ndarray, covariance: np.ndarray, count: int, rng: np.random.Generator
) -> np.ndarray:
    """Draw random vectors from a normal distribution whose covariance may be singular.

    The result does not depend on the units of the values. mean: (n,). covariance: (n, n). Returns
    (count, n).
    """
    return mean + rng.standard_normal((count, len(mean))) @ covariance_root(covariance).T


def covariance_root(covariance: np.ndarray) -> np.ndarray:
    """Compute the lower-triangular square root R of a covariance matrix, which equals R R'.

    R transforms independent draws into correlated ones. It is that of the correlations, which have
    no unit, and the lower triangle with a nonnegative diagonal, which is independent of the
    decomposition method. covariance: (n, n), may be singular. Returns (n, n).
    """
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.where(deviation > 0.0, deviation, 1.0)[:, np.newaxis]
    values, vectors = np.linalg.eigh((covariance + covariance.T) / (2.0 * unit * unit.T))
    root = np.sqrt(np.maximum(values, 0.0))[:, np.newaxis] * vectors.T
    upper: np.ndarray = np.linalg.qr(root, mode="r")  # type: ignore[assignment]  # of "r" alone
    return deviation[:, np.newaxis] * upper.T * np.where(np.diag(upper) < 0.0, -1.0, 1.0)


def interval_of_draws(
    values: Sequence[float] | Sequence[np.ndarray] | np.ndarray, fewest: float = MIN_INTERVAL_DRAWS
) -> np.ndarray:
    """Return minimum and maximum of random draws of an estimate as its 95 % interval.

    values: (count, ...) of MODEL_DRAWS models, of those that have one. NaN if fewer than `fewest`
    do, or if a value is NaN. A value beyond a range is infinite.
    """
    if len(values) < fewest:
        return np.full((2, *np.shape(values)[1:]), np.nan)
    return np.stack([np.min(values, axis=0), np.max(values, axis=0)]) + 0.0  # no negative zero


# Corrections in `decay_interval`, for which the interval has its coverage. T: duration recorded.
DECAY_SHIFT = 2.0  # shift of the estimate, times T; its bias is 1 to the leading order
DECAY_VARIANCE = 2.0  # added to the variance a/T, times T^2


def decay_interval(decay: float, error: float, duration: float) -> tuple[float, float]:
    """Compute the 95 % interval of a mode's decay rate (1/s) estimated from random vibration.

    The rate is negative for growth. decay: the estimate; error: its standard error by the
    information; duration: s, recorded. The amplitude of a lightly damped mode under white forces is
    a complex Ornstein-Uhlenbeck process of decay a. Over a time T its most likely decay has, to the
    leading order, the variance a/T and the bias 1/T, and is skewed; if a T is small, an interval of
    the estimate plus or minus two of its standard errors misses more below than above. The interval
    of E. B. Wilson (J. Am. Stat. Assoc. 22, 1927) for this variance contains all a for which the
    estimate, less DECAY_SHIFT/T, is within 1.96 times the root of (a/T + DECAY_VARIANCE/T^2).
    Measured on 6,000 motions each of a T from 1 to 80: it misses 2 to 4 % on either side. Variance
    of the estimate beyond a/T, by noise or nonlinear damping, is added unchanged.
    """
    floor, middle = DECAY_VARIANCE / duration**2, decay - DECAY_SHIFT / duration
    if decay <= 0.0:
        half = NORMAL_95 * np.sqrt(error**2 + floor)
        return decay - half, decay + half
    beyond = max(error**2 - decay / duration, 0.0) + floor  # of the variance: not of the decay
    slope = NORMAL_95**2 / duration  # of the squared half width with the decay
    mean = middle + slope / 2.0
    half = np.sqrt(max(mean**2 - middle**2 + NORMAL_95**2 * beyond, 0.0))
    return float(mean - half), float(mean + half)
