"""What the data can tell, and how close each method comes to it."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from galloping.intervals import IDENTIFIABLE
from galloping.physics.galerkin import EQUATIONS, Derived
from galloping.polynomial import extended, library
from galloping.tables.scores import exact, failures

CELL = ["case", "recordings", "protocol", "level", "points"]  # what names a cell
KEYS = [*CELL, "method"]
COLUMNS = [*CELL, "equation", "term", "true", "bound", "t", "verdict"]


def identifiability(
    models: Mapping[str, Derived], bounds: Mapping[str, np.ndarray], settings: Mapping
) -> pd.DataFrame:
    """One row a present term of each cell: bound, t = |c| / bound, whether it can be identified.

    models: by case. bounds: of each cell (n_samplings, n_states, n_terms), of which the root mean
    square is taken, NaN where undefined. settings: degree of the library; cells, each with its case
    and the columns that name it.
    """
    parts = [pd.DataFrame(columns=COLUMNS)]
    for cell, columns in settings["cells"].items():
        model = models[columns["case"]].model
        terms = library(len(model.states), settings["degree"])
        model = model.on_library(extended(terms, model))
        typical = np.sqrt(np.mean(bounds[cell] ** 2, axis=0))
        dynamic = np.isin(np.arange(len(model.states)), list(EQUATIONS))
        i, j = np.nonzero(model.support & dynamic[:, np.newaxis])
        table = pd.DataFrame({key: columns[key] for key in CELL}, index=range(len(i)))
        parts.append(
            table.assign(
                equation=[EQUATIONS[row] for row in i],
                term=[model.term_names[column] for column in j],
                true=-model.coefficients[i, j],
                bound=typical[i, j],
            )
        )
    table = pd.concat([part for part in parts if len(part)] or parts)
    t = (table["true"].abs() / table["bound"]).astype(float)
    # undefined: the library lacks the term, or the line itself diverges
    known = np.where(t > IDENTIFIABLE, "identifiable", "not identifiable")
    return table.assign(t=t, verdict=np.where(t.isna(), "undefined", known))


def efficiency(scores: pd.DataFrame, identifiability: pd.DataFrame) -> pd.DataFrame:
    """One row a cell and method: exact supports, rms error over bound, R2, coverage, failures.

    identifiability: that table, for the weakest t of each cell. Cells without noise have no bound
    and are left out.
    """
    amplitudes = scores[["amplitude_error_q_v_percent", "amplitude_error_q_w_percent"]]
    scores = scores.assign(
        exact=exact(scores).where(scores["missing"].notna()), amplitude=amplitudes.max(axis=1)
    )
    groups = scores[scores["level"] > 0].groupby(KEYS)
    table = groups.agg(
        replicates=("motion", "size"),
        exact_support=("exact", lambda found: found.sum(min_count=1)),
        efficiency=("efficiency", lambda ratio: np.sqrt(np.mean(ratio.to_numpy() ** 2))),
        r2_q_v=("r2_q_v", "median"),
        r2_q_w=("r2_q_w", "median"),
        amplitude_error_percent=("amplitude", "median"),
        failures=("motion", failures),
    )
    stated, holding = groups["intervals"].sum(), groups["intervals_holding"].sum()
    coverage = 100 * holding / stated.where(stated > 0)
    weakest = identifiability.groupby(CELL)["t"].min().rename("weakest_t")
    failed = table.pop("failures")
    table = table.assign(coverage_95_percent=coverage).join(weakest).assign(failures=failed)
    return table.reset_index()
