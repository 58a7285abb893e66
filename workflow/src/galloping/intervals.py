"""What intervals hold, and how they come from draws."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from galloping.polynomial import PolynomialModel

QUANTILES_90 = (0.05, 0.95)
QUANTILES_95 = (0.025, 0.975)
NORMAL_95 = 1.959963984540054  # half width in standard deviations
# |coefficient| over its bound from which a selection with penalty 2 ln N can be trusted.
IDENTIFIABLE = 7.6


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Median and the 5th and 95th percentile; a failure (inf) counts as the worst value."""
    values = np.asarray(values, dtype=float)
    low = np.quantile(values, QUANTILES_90[0], method="lower")
    high = np.quantile(values, QUANTILES_90[1], method="higher")
    return float(np.median(values)), float(low), float(high)


class Identified(Protocol):
    """What is needed of an identified model."""

    model: PolynomialModel
    covariance: np.ndarray  # (n_support, n_support), in the order of np.argwhere(support)

    @property
    def support(self) -> np.ndarray: ...


def normal(
    mean: np.ndarray, covariance: np.ndarray, count: int, rng: np.random.Generator
) -> np.ndarray:
    """(count, n) values drawn with a mean (n,) and a covariance (n, n) that may be singular."""
    return rng.multivariate_normal(mean, covariance, count, method="eigh", check_valid="ignore")


def drawn(identified: Identified, count: int, rng: np.random.Generator) -> list[PolynomialModel]:
    """Models with coefficients drawn with their covariance; all the same where there is none."""
    model, support = identified.model, identified.support
    coefficients = np.repeat(model.coefficients[np.newaxis], count, axis=0)
    if len(identified.covariance):
        mean = model.coefficients[support]
        coefficients[:, support] = normal(mean, identified.covariance, count, rng)
    return [replace(model, coefficients=each) for each in coefficients]


def of_draws(samples: np.ndarray) -> np.ndarray:
    """(2, ...) ends of the interval of an estimate, from draws (count, ...) of it.

    The 95 % are those of the draws' distribution, so that of 39 draws they are the least and the
    greatest.
    """
    return np.quantile(samples, QUANTILES_95, axis=0, method="weibull")
