"""The methods at the physical limit, behind the interface of all methods.

Second-order systems name their velocities `dX`; that dX/dt is the state dX is then known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from galloping.identification.likelihood import maximum_likelihood as likelihood
from galloping.identification.likelihood import weak_gls as weak
from galloping.identification.likelihood.result import Identified as Estimate
from galloping.identification.result import Identified
from galloping.polynomial import Exponents
from galloping.recording import Recording


@dataclass(frozen=True)
class Start:
    """What the methods of a family work on: recordings of one system, and the library."""

    recordings: list[Recording]
    terms: tuple[Exponents, ...]


def start(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> Start:
    return Start(list(recordings), terms)


def weak_gls(start: Start) -> Identified:
    """`likelihood.weak_gls` on the polynomial library."""
    return _identified(weak.weak_gls(start.recordings, start.terms))


def maximum_likelihood(start: Start) -> Identified:
    """`likelihood.maximum_likelihood` on the polynomial library."""
    return _identified(likelihood.maximum_likelihood(start.recordings, start.terms))


def _identified(estimate: Estimate) -> Identified:
    if estimate.status == "refused":
        return Identified.failed(*estimate.support.shape, f"refused: {estimate.reason}")
    return Identified(
        coefficients=estimate.model.coefficients,
        thresholds=np.full(len(estimate.support), np.nan),
        standard_errors=np.where(estimate.support, estimate.deviation, np.nan),
        verdict=f"{estimate.status}: {estimate.reason}" if estimate.reason else estimate.status,
    )
