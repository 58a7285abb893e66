"""Scores of all cells, and medians with intervals over replicates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from galloping.intervals import QUANTILES_90


def all_scores(cells: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """All replicates of all cells, in one order however they are given."""
    table = pd.concat(cells.values(), ignore_index=True)
    keys = ["case", "protocol", "method", "cell", "replicate"]
    return table.sort_values(keys, kind="stable", ignore_index=True)


def of_kind(scores: pd.DataFrame, kind: str) -> pd.DataFrame:
    """Scores of the cells of a kind: a whole record, a subset, or several recordings together."""
    return scores[scores["kind"] == kind]


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Median and the 5th and 95th percentile; a failure (inf) counts as the worst value."""
    values = np.asarray(values, dtype=float)
    low = np.quantile(values, QUANTILES_90[0], method="lower")
    high = np.quantile(values, QUANTILES_90[1], method="higher")
    return float(np.median(values)), float(low), float(high)


def failures(scores: pd.DataFrame) -> int:
    """Replicates without a model, or whose model's motion ended early."""
    return int((scores["motion"] != "ok").sum())


def summarise(
    scores: pd.DataFrame, keys: list[str], columns: dict[str, str], axis: str, value: str
) -> pd.DataFrame:
    """One row for each group and column: median, interval, replicates and failures.

    columns: from the name in `axis` to the score's column; value: stem of the result's columns.
    """
    rows = []
    for names, group in scores.groupby(keys, sort=True):
        for label, column in columns.items():
            median, low, high = interval(group[column])
            rows.append(
                {
                    **dict(zip(keys, names, strict=True)),
                    axis: label,
                    f"{value}": median,
                    f"{value}_low": low,
                    f"{value}_high": high,
                    "replicates": len(group),
                    "failures": failures(group),
                }
            )
    values = (value, f"{value}_low", f"{value}_high")
    return pd.DataFrame(rows, columns=[*keys, axis, *values, "replicates", "failures"])
