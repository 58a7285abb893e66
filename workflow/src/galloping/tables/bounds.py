"""What the data can tell, and how close each method comes to it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from galloping.bounds.identifiable import IDENTIFIABLE
from galloping.physics.derived import Derived
from galloping.physics.equations import EQUATIONS
from galloping.polynomial import PolynomialModel, extended, library
from galloping.tables.summary import failures

CELL = ["case", "recordings", "protocol", "level", "points"]  # what names a cell
KEYS = [*CELL, "method"]
EFFICIENCY = [
    "replicates", "exact_support", "efficiency", "r2_q_v", "r2_q_w", "amplitude_error_percent",
    "coverage_95_percent", "weakest_t", "failures",
]  # fmt: skip
COLUMNS = [*CELL, "equation", "term", "true", "bound", "t", "verdict"]


def identifiability(
    models: Mapping[str, Derived], bounds: Mapping[str, np.ndarray], settings: Mapping
) -> pd.DataFrame:
    """One row a present term of each cell: bound, t = |c| / bound, whether it can be identified.

    models: by case. bounds: of each cell (n_samplings, n_states, n_terms), of which the root mean
    square is taken, NaN where undefined. settings: degree of the library; cells, each with its case
    and the columns that name it.
    """
    rows = []
    for cell, columns in settings["cells"].items():
        model = models[columns["case"]].model
        terms = library(len(model.states), settings["degree"])
        model = model.on_library(extended(terms, model))
        names = {key: columns[key] for key in CELL}
        rows += _terms(model, np.sqrt(np.mean(bounds[cell] ** 2, axis=0)), names)
    return pd.DataFrame(rows, columns=COLUMNS)


def _terms(model: PolynomialModel, typical: np.ndarray, names: Mapping[str, object]) -> list[dict]:
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


def further_recordings(rankings: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """The rankings of all cases."""
    return pd.concat(rankings.values()) if rankings else pd.DataFrame(columns=["case"])


def efficiency(
    scores: pd.DataFrame, identifiability: pd.DataFrame, settings: Mapping
) -> pd.DataFrame:
    """One row a cell and method: exact supports, rms error over bound, R2, coverage, failures.

    identifiability: that table, for the weakest t of each cell. Cells without noise have no bound
    and are left out.
    """
    weakest = identifiability.groupby(CELL)["t"].min()  # of those that are defined
    rows = []
    noisy = scores[scores["level"] > 0]
    for names, cell in noisy.groupby(KEYS, sort=True):
        exact = (cell["missing"] == 0) & (cell["spurious"] == 0)
        amplitude = cell[["amplitude_error_q_v_percent", "amplitude_error_q_w_percent"]]
        rows.append(
            {
                **dict(zip(KEYS, names, strict=True)),
                "replicates": len(cell),
                "exact_support": int(exact.sum()) if cell["missing"].notna().any() else np.nan,
                "efficiency": float(np.sqrt(np.mean(cell["efficiency"].to_numpy() ** 2))),
                "r2_q_v": float(cell["r2_q_v"].median()),
                "r2_q_w": float(cell["r2_q_w"].median()),
                "amplitude_error_percent": float(amplitude.max(axis=1).median()),
                "coverage_95_percent": _coverage(cell),
                "weakest_t": weakest[names[:-1]],
                "failures": failures(cell),
            }
        )
    return pd.DataFrame(rows, columns=[*KEYS, *EFFICIENCY])


def _coverage(cell: pd.DataFrame) -> float:
    stated = cell["intervals"].sum()
    return float(100 * cell["intervals_holding"].sum() / stated) if stated else np.nan
