"""Quasi-static aerodynamic coefficients of the iced section, as cubic polynomials of the angle."""

from __future__ import annotations

from collections.abc import Mapping

# The paper's digits are damaged; each reading restores them in one way (docs: config/README.md).
# Coefficients of alpha, alpha^2, alpha^3; the static ones drop out of the dynamic equations.
READINGS = {
    "swapped": ((0.442, 2.126, -4.432), (3.330, 0.0, 0.0)),
    "milli": ((0.442, 0.1262, -0.4324), (0.00333, 0.0, 0.0)),
}


def coefficients(ice: Mapping) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(beta_1..beta_3, eta_1..eta_3), vertical and horizontal, of an `ice` section."""
    if ice["reading"] == "custom":
        return tuple(ice["vertical"]), tuple(ice["horizontal"])
    return READINGS[ice["reading"]]
