"""What the data can tell, and how close each method comes to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from galloping.physics.equations import EQUATIONS
from galloping.bounds.cell import IDENTIFIABLE
from galloping.polynomial import PolynomialModel
from galloping.tables.summary import failures

KEYS = ["case", "recordings", "protocol", "level", "points", "method"]


def identifiability(
    model: PolynomialModel, std: np.ndarray, names: Mapping[str, object]
) -> list[dict]:
    """One row a present term: bound, t = |c| / bound and whether it can be identified.

    model: on the library; std: (n_replicates, n_states, n_terms) bounds, of which the root mean
    square is taken, NaN where undefined; names: the columns that name the cell.
    """
    typical = np.sqrt(np.mean(std**2, axis=0))
    rows = []
    for equation, j in np.argwhere(model.support):
        if equation in EQUATIONS:
            true, bound = model.coefficients[equation, j], typical[equation, j]
            t = abs(true) / bound
            rows.append(
                {
                    **names,
                    "equation": EQUATIONS[equation],
                    "term": model.term_names[j],
                    "true": -true,
                    "bound": bound,
                    "t": t,
                    "verdict": _verdict(t),
                }
            )
    return rows


def _verdict(t: float) -> str:
    if np.isnan(t):  # the library lacks the term, or the line itself diverges
        return "undefined"
    return "identifiable" if t > IDENTIFIABLE else "not identifiable"


def efficiency(scores: pd.DataFrame, weakest_t: Mapping[tuple, float]) -> pd.DataFrame:
    """One row a cell and method: exact supports, rms error over bound, R2, coverage, failures.

    weakest_t: by (case, recordings, protocol, level, points). Cells without noise have no bound
    and are left out.
    """
    rows = []
    noisy = scores[scores["level"] > 0]
    for names, cell in noisy.groupby(KEYS, sort=True):
        exact = (cell["missing"] == 0) & (cell["spurious"] == 0)
        amplitude = cell[["amplitude_error_q_v_percent", "amplitude_error_q_w_percent"]]
        rows.append(
            {
                **dict(zip(KEYS, names, strict=True)),
                "replicates": len(cell),
                "exact_support": int(exact.sum()),
                "efficiency": float(np.sqrt(np.mean(cell["efficiency"].to_numpy() ** 2))),
                "r2_q_v": float(cell["r2_q_v"].median()),
                "r2_q_w": float(cell["r2_q_w"].median()),
                "amplitude_error_percent": float(amplitude.max(axis=1).median()),
                "coverage_95_percent": _coverage(cell),
                "weakest_t": weakest_t[names[:-1]],
                "failures": failures(cell),
            }
        )
    return pd.DataFrame(rows)


def _coverage(cell: pd.DataFrame) -> float:
    stated = cell["intervals"].sum()
    return float(100 * cell["intervals_holding"].sum() / stated) if stated else np.nan


def weakest(rows: Sequence[Mapping[str, object]]) -> dict[tuple, float]:
    """Smallest t of each cell of `identifiability` rows, of those that are defined."""
    smallest: dict[tuple, float] = {}
    for row in rows:
        key = tuple(row[name] for name in KEYS[:-1])
        smallest[key] = float(np.fmin(smallest.get(key, np.nan), row["t"]))
    return smallest
