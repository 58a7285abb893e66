"""What every identification method returns."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from galloping.storage import write_arrays


@dataclass(frozen=True)
class Identified:
    """An identified model on the candidate library.

    coefficients: (n_states, n_terms), zero where a term is absent. thresholds: (n_states,) the
    threshold chosen for each equation, in the method's unit, NaN where it has none.
    standard_errors: as coefficients, NaN where the method states none.
    status: `ok`, or one line why there is no model (the coefficients are NaN then).
    """

    coefficients: np.ndarray
    thresholds: np.ndarray
    standard_errors: np.ndarray
    status: str = "ok"

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


def write(path: str | os.PathLike, results: list[Identified]) -> None:
    """Replicates of one cell as one .npz."""
    write_arrays(
        path,
        coefficients=np.stack([r.coefficients for r in results]),
        thresholds=np.stack([r.thresholds for r in results]),
        standard_errors=np.stack([r.standard_errors for r in results]),
        status=np.array([r.status for r in results]),
    )


def read(path: str | os.PathLike) -> list[Identified]:
    with np.load(path) as file:
        columns = [file[k] for k in ("coefficients", "thresholds", "standard_errors")]
        statuses = [str(s) for s in file["status"]]
    return [Identified(*parts, status) for *parts, status in zip(*columns, statuses, strict=True)]
