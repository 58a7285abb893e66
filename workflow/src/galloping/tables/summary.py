"""Scores of all cells, and medians with intervals over replicates."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

INTERVAL = (0.05, 0.95)


def read_scores(paths: Iterable[str | os.PathLike]) -> pd.DataFrame:
    """All replicates of all cells, in one order however they are given."""
    table = pd.concat([pd.read_csv(path) for path in paths], ignore_index=True)
    keys = ["case", "protocol", "method", "cell", "replicate"]
    return table.sort_values(keys, kind="stable", ignore_index=True)


def is_subset(scores: pd.DataFrame) -> pd.Series:
    """Rows of random subsets; the others are whole records."""
    return scores["cell"].str.startswith("points_")


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Median and the 5th and 95th percentile; a failure (inf) counts as the worst value."""
    values = np.asarray(values, dtype=float)
    low = np.quantile(values, INTERVAL[0], method="lower")
    high = np.quantile(values, INTERVAL[1], method="higher")
    return float(np.median(values)), float(low), float(high)


def failures(scores: pd.DataFrame) -> int:
    """Replicates without a model, or whose model's motion ended early."""
    return int((scores["status"] != "ok").sum())


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
    return pd.DataFrame(rows)
