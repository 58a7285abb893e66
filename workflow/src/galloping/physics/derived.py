"""What follows from a line's parameters without simulating it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from galloping.polynomial import PolynomialModel


@dataclass(frozen=True)
class Derived:
    """A true model.

    model: its equations. coefficients: by the paper's symbols, SI units, on the left-hand side.
    quantities: such as the sag, by name with unit.
    """

    model: PolynomialModel
    coefficients: Mapping[str, float]
    quantities: Mapping[str, float]
