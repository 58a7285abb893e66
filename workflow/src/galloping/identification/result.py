"""What every identification method returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Identified:
    """An identified model on the candidate library.

    coefficients: (n_states, n_terms), zero where a term is absent. thresholds: (n_states,) the
    threshold chosen for each equation, in the method's unit, NaN where it has none.
    standard_errors: as coefficients, NaN where the method states none.
    status: `ok`, or one line why there is no model (the coefficients are NaN then).
    verdict: what the method itself says of its model, such as `not identifiable: ...`.
    """

    coefficients: np.ndarray
    thresholds: np.ndarray
    standard_errors: np.ndarray
    status: str = "ok"
    verdict: str = ""

    @classmethod
    def of(cls, coefficients: np.ndarray, thresholds: np.ndarray | float = np.nan) -> Identified:
        """A model without stated uncertainty."""
        n = len(coefficients)
        return cls(coefficients, np.broadcast_to(thresholds, n), np.full_like(coefficients, np.nan))

    @classmethod
    def failed(cls, n_states: int, n_terms: int, reason: str) -> Identified:
        """A failure, kept as a row with its reason."""
        nothing = np.full((n_states, n_terms), np.nan)
        return cls(nothing, np.full(n_states, np.nan), nothing, reason)
