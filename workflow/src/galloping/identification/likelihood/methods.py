"""The methods at the physical limit, behind the interface of all methods.

Second-order systems name their velocities `dX`; that dX/dt is the state dX is then known.
"""

from __future__ import annotations

from collections.abc import Sequence

from galloping.identification.likelihood import maximum_likelihood as likelihood
from galloping.identification.likelihood import weak_gls as weak
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import library
from galloping.recording import Recording


def weak_gls(recordings: Sequence[Recording], *, degree: int) -> IdentifiedModel:
    """`likelihood.weak_gls` on the polynomial library up to `degree`."""
    return weak.weak_gls(list(recordings), library(len(recordings[0].states), degree))


def maximum_likelihood(recordings: Sequence[Recording], *, degree: int) -> IdentifiedModel:
    """`likelihood.maximum_likelihood` on the polynomial library up to `degree`."""
    return likelihood.maximum_likelihood(
        list(recordings), library(len(recordings[0].states), degree)
    )
