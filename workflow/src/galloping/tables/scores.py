"""Tables of scores against noise and amount of data, beside best possible tunings and bounds."""

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd

from galloping.line.galerkin import EQUATIONS, Derived
from galloping.model.intervals import MIN_IDENTIFIABLE_RATIO, median_and_interval
from galloping.results import DISPLACEMENT_COLUMNS, NOISE, SUBSET, TERM_DEGREES

CELL_COLUMNS = ["case", "protocol", "level"]
R2_COLUMNS = {state: f"r2_{state}" for state in DISPLACEMENT_COLUMNS}
CHOSEN_SETTING, ORACLE_SETTING = "as chosen", "oracle"
PEER_COLUMNS = (
    "case", "protocol", "level", "method", "setting", "mean_error_percent", "share_exact_support",
    "r2_q_v", "r2_q_w", "replicates",
)  # fmt: skip


def concatenate(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Concatenate several tables in order; columns that a table lacks are empty."""
    filled = [part for part in parts.values() if len(part)]
    return pd.concat(filled, ignore_index=True) if filled else pd.DataFrame(columns=["case"])


def all_scores(cells: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Concatenate the score tables of a study, sorted by case, method and noise realisation.

    The order of the rows does not depend on that of the argument.
    """
    keys = ["case", "protocol", "method", "cell", "replicate"]
    return concatenate(cells).sort_values(keys, kind="stable", ignore_index=True)


def of_kind(scores: pd.DataFrame, kind: str) -> pd.DataFrame:
    """Select scores of fits by their data: whole records, subsampled records or several records."""
    return scores[scores["kind"] == kind]


def failures(motions: pd.Series) -> int:
    """Count the fits without a model, and those whose model's simulated motion ended early.

    motions: status of the motion of each fit.
    """
    return int((motions != "ok").sum())


def exact(scores: pd.DataFrame) -> pd.Series:
    """Decide for each fit in a table of scores whether its model has exactly the true terms."""
    return (scores["missing"] == 0) & (scores["spurious"] == 0)


def mean_error(scores: pd.DataFrame) -> pd.Series:
    """Average the coefficient errors of linear, quadratic and cubic terms of each fit, in %."""
    columns = [f"mean_error_{order}_percent" for order in TERM_DEGREES]
    return scores[scores.columns.intersection(columns)].mean(axis=1)


def spread(column: str, stem: str = "") -> dict[str, tuple[str, Callable]]:
    """Return arguments for `DataFrameGroupBy.agg` that compute a column's median and 90 % range.

    They are named `stem`, `{stem}_low` and `{stem}_high`; without a stem median, low and high.
    """
    names = (stem, f"{stem}_low", f"{stem}_high") if stem else ("median", "low", "high")
    return {
        name: (column, lambda values, k=k: median_and_interval(values)[k])
        for k, name in enumerate(names)
    }


def medians(
    scores: pd.DataFrame, keys: list[str], columns: Mapping[str, str], axis: str, value: str
) -> pd.DataFrame:
    """Tabulate the median, 90 % range, number of fits and number of failures of scores, by group.

    columns: from the name in `axis` to the score's column. value: stem of the result's columns.
    """
    numbers = scores[[*keys, "motion", *columns.values()]]
    numbers = numbers.rename(columns={column: name for name, column in columns.items()})
    long = numbers.melt([*keys, "motion"], var_name=axis, value_name=value)
    long[axis] = pd.Categorical(long[axis], list(columns))  # in this order
    groups = long.groupby([*keys, axis], observed=True)
    table = groups.agg(
        **spread(value, value), replicates=(value, "size"), failures=("motion", failures)
    )
    return table.reset_index().astype({axis: str})


def noise_coefficients(scores: pd.DataFrame) -> pd.DataFrame:
    """Tabulate median coefficient errors with 90 % ranges, by setup, method, noise and order."""
    columns = {order: f"mean_error_{order}_percent" for order in TERM_DEGREES}
    columns = {order: name for order, name in columns.items() if name in scores}
    keys = ["case", "protocol", "method", "level"]
    return medians(of_kind(scores, NOISE), keys, columns, "order", "mean_error_percent")


def noise_r2(scores: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the median R2 of motions with 90 % ranges, by setup, method, noise and state."""
    keys = ["case", "protocol", "method", "level"]
    table = medians(of_kind(scores, NOISE), keys, R2_COLUMNS, "state", "r2")
    return table.rename(columns={"r2": "r2_median"})


def data_amount(scores: pd.DataFrame) -> pd.DataFrame:
    """Tabulate amplitude errors and R2 with 90 % ranges, by setup, method, samples and state."""
    subsets, keys = of_kind(scores, SUBSET), ["case", "protocol", "method", "points"]
    columns = {state: f"amplitude_error_{state}_percent" for state in DISPLACEMENT_COLUMNS}
    amplitude = medians(subsets, keys, columns, "state", "amplitude_error_percent")
    r2 = medians(subsets, keys, R2_COLUMNS, "state", "r2")
    return amplitude.merge(r2, on=[*keys, "state", "replicates", "failures"], validate="1:1")


def peers(scores: pd.DataFrame, oracles: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Tabulate the scores of methods with their own tuning beside the best possible tuning.

    Errors and R2 are medians over whole records. scores: of all cells, of which those with a best
    possible tuning are shown. oracles: by cell, rows of the same columns for models with this
    tuning of some replicates, `choice` of which is `least error` or `right terms`. Each number of a
    replicate's tuning is the best of the two and of the method's own model. Columns: PEER_COLUMNS.
    """
    if not oracles:
        return pd.DataFrame(columns=PEER_COLUMNS)
    one = [*CELL_COLUMNS, "method", "replicate"]
    oracle, chosen_scores = (
        rows.assign(
            mean_error_percent=mean_error(rows), share_exact_support=exact(rows).astype(float)
        )
        for rows in (pd.concat(oracles.values()), of_kind(scores, NOISE))
    )
    chosen_scores = chosen_scores.merge(oracle[CELL_COLUMNS].drop_duplicates())
    both = pd.concat([oracle, chosen_scores.merge(oracle[one].drop_duplicates())])
    best = {"mean_error_percent": "min"}
    best |= dict.fromkeys(("share_exact_support", "r2_q_v", "r2_q_w"), "max")
    best = both.groupby(one, as_index=False).agg(best)
    table = pd.concat(
        [chosen_scores.assign(setting=CHOSEN_SETTING), best.assign(setting=ORACLE_SETTING)]
    )
    table = table.groupby([*CELL_COLUMNS, "method", "setting"], as_index=False).agg(
        mean_error_percent=("mean_error_percent", "median"),
        share_exact_support=("share_exact_support", "mean"),
        r2_q_v=("r2_q_v", "median"), r2_q_w=("r2_q_w", "median"),
        replicates=("replicate", "nunique"),
    )  # fmt: skip
    return table[list(PEER_COLUMNS)]


# --- beside the bound ---


BOUND_COLUMNS = ["case", "recordings", "protocol", "level", "points"]  # identify a cell
KEYS = [*BOUND_COLUMNS, "method"]
RATIO = "coefficient_over_bound"
IDENTIFIABILITY_COLUMNS = [*BOUND_COLUMNS, "equation", "term", "true", "bound", RATIO, "verdict"]


def identifiability(
    models: Mapping[str, Derived], bounds: Mapping[str, np.ndarray], settings: Mapping
) -> pd.DataFrame:
    """Tabulate for each true term whether it is identifiable, by its Cramér-Rao bound.

    Columns: the bound, t = |coefficient| / bound, and the verdict; there are rows for each study
    cell. models: by case. bounds: of each cell (n_samplings, n_states, n_terms), of which the root
    mean square is taken, NaN where undefined. settings: degree of the library; cells, each with its
    case and the columns that name it.
    """
    parts = [pd.DataFrame(columns=IDENTIFIABILITY_COLUMNS)]
    for cell, columns in settings["cells"].items():
        model = models[columns["case"]].model.on_polynomials(settings["degree"])
        typical = np.sqrt(np.mean(bounds[cell] ** 2, axis=0))
        dynamic = np.isin(np.arange(len(model.states)), list(EQUATIONS))
        i, j = np.nonzero(model.support & dynamic[:, np.newaxis])
        table = pd.DataFrame({key: columns[key] for key in BOUND_COLUMNS}, index=range(len(i)))
        parts.append(
            table.assign(
                equation=[EQUATIONS[row] for row in i.tolist()],
                term=[model.term_names[column] for column in j.tolist()],
                true=-model.coefficients[i, j],
                bound=typical[i, j],
            )
        )
    table = pd.concat([part for part in parts if len(part)] or parts)
    t = (table["true"].abs() / table["bound"]).astype(float)
    # undefined: the library lacks the term, or the line itself diverges
    known = np.where(t > MIN_IDENTIFIABLE_RATIO, "identifiable", "not identifiable")
    return table.assign(**{RATIO: t}, verdict=np.where(t.isna(), "undefined", known))


def _rms_of_finite(ratios: pd.Series) -> float:
    finite = ratios[np.isfinite(ratios)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else np.nan


def efficiency(scores: pd.DataFrame, identifiability: pd.DataFrame) -> pd.DataFrame:
    """Tabulate error over Cramér-Rao bound, coverage and exact supports of each method.

    The groups are those of cell and method; further columns are R2 and failures. The rms is that of
    the fits with a model; n_without_model: number of failures. identifiability: that table, for the
    weakest t of each cell. Cells without noise have no bound and are left out.
    """
    amplitudes = scores[["amplitude_error_q_v_percent", "amplitude_error_q_w_percent"]]
    scores = scores.assign(
        exact=exact(scores).where(scores["missing"].notna()), amplitude=amplitudes.max(axis=1)
    )
    groups = scores[scores["level"] > 0].groupby(KEYS)
    table = groups.agg(
        replicates=("motion", "size"),
        exact_support=("exact", lambda found: found.sum(min_count=1)),
        efficiency=("efficiency", _rms_of_finite),
        n_without_model=("status", lambda status: int((status == "refused").sum())),
        r2_q_v=("r2_q_v", "median"),
        r2_q_w=("r2_q_w", "median"),
        amplitude_error_percent=("amplitude", "median"),
    )
    stated, holding = groups["intervals"].sum(), groups["intervals_covering"].sum()
    table = table.assign(coverage_95_percent=100 * holding / stated.where(stated > 0))
    weakest = identifiability.groupby(BOUND_COLUMNS)[RATIO].min().rename(f"min_{RATIO}")
    return table.join(weakest).assign(failures=groups["motion"].agg(failures)).reset_index()
