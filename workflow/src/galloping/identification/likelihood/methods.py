"""The methods at the physical limit, behind the interface of all methods.

Second-order systems name their velocities `dX`; that dX/dt is the state dX is then known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from galloping.identification.likelihood import maximum_likelihood as likelihood
from galloping.identification.likelihood import weak_gls as weak
from galloping.identification.likelihood.result import Identified as Estimate
from galloping.identification.result import Identified
from galloping.polynomial import library
from galloping.recording import Recording


def weak_gls(recordings: Sequence[Recording], *, degree: int) -> Identified:
    """`likelihood.weak_gls` on the polynomial library up to `degree`."""
    return _identified(weak.weak_gls, recordings, degree)


def maximum_likelihood(recordings: Sequence[Recording], *, degree: int) -> Identified:
    """`likelihood.maximum_likelihood` on the polynomial library up to `degree`."""
    return _identified(likelihood.maximum_likelihood, recordings, degree)


def _identified(
    method: Callable[..., Estimate], recordings: Sequence[Recording], degree: int
) -> Identified:
    terms = library(len(recordings[0].states), degree)
    estimate = method(list(recordings), terms)
    if estimate.status == "refused":
        return Identified.failed(*estimate.support.shape, f"refused: {estimate.reason}")
    return Identified(
        coefficients=estimate.model.coefficients,
        thresholds=np.full(len(estimate.support), np.nan),
        standard_errors=np.where(estimate.support, estimate.deviation, np.nan),
        verdict=f"{estimate.status}: {estimate.reason}" if estimate.reason else estimate.status,
    )
