"""Methods as their own rules set them, beside the best that any setting could do."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from galloping.study.kinds import NOISE
from galloping.tables.summary import of_kind

CHOSEN, ORACLE = "as chosen", "oracle"
COLUMNS = (
    "case", "protocol", "level", "method", "setting", "mean_error_percent", "exact",
    "r2_q_v", "r2_q_w", "replicates",
)  # fmt: skip


def mean_error(scores: pd.DataFrame) -> pd.Series:
    """Mean over the orders of the mean error of the coefficients of each row, percent."""
    columns = [
        name
        for order in ("linear", "quadratic", "cubic")
        if (name := f"mean_error_{order}_percent") in scores
    ]
    return scores[columns].mean(axis=1)


def peers(
    scores: pd.DataFrame, oracles: Mapping[str, pd.DataFrame], settings: Mapping
) -> pd.DataFrame:
    """Medians over replicates of error and R2 of whole records, and the share of exact supports.

    scores: of all cells, of which those with an oracle are shown. oracles: by cell, rows of the
    same columns for the oracle's models of some replicates, `choice` of which is `least error` or
    `right terms`. Each number of a replicate's oracle is the best of the two and of the model as
    chosen. settings: none are read.
    """
    if not oracles:
        return pd.DataFrame(columns=COLUMNS)
    keys = ["case", "protocol", "level", "method"]
    oracle = _numbers(pd.concat(oracles.values()))
    chosen = _numbers(of_kind(scores, NOISE))
    shown = pd.MultiIndex.from_frame(oracle[keys[:3]])
    chosen = chosen[pd.MultiIndex.from_frame(chosen[keys[:3]]).isin(shown)]
    known = chosen.set_index([*keys, "replicate"]).index
    wanted = oracle.set_index([*keys, "replicate"]).index
    both = pd.concat([oracle, chosen[known.isin(wanted)]])
    best = both.groupby([*keys, "replicate"], as_index=False).agg(
        mean_error_percent=("mean_error_percent", "min"),
        exact=("exact", "max"), r2_q_v=("r2_q_v", "max"), r2_q_w=("r2_q_w", "max"),
    )  # fmt: skip
    table = pd.concat([chosen.assign(setting=CHOSEN), best.assign(setting=ORACLE)])
    table = table.groupby([*keys, "setting"], as_index=False).agg(
        mean_error_percent=("mean_error_percent", "median"),
        exact=("exact", "mean"), r2_q_v=("r2_q_v", "median"), r2_q_w=("r2_q_w", "median"),
        replicates=("replicate", "nunique"),
    )  # fmt: skip
    return table[list(COLUMNS)]


def _numbers(scores: pd.DataFrame) -> pd.DataFrame:
    exact = (scores["missing"] == 0) & (scores["spurious"] == 0)
    return pd.DataFrame(
        {
            **{key: scores[key] for key in ("case", "protocol", "level", "method", "replicate")},
            "mean_error_percent": mean_error(scores),
            "exact": exact.astype(float),
            "r2_q_v": scores["r2_q_v"],
            "r2_q_w": scores["r2_q_w"],
        }
    )
