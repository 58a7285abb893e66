"""Errors against the number of points, at one noise level."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from galloping.study.kinds import SUBSET
from galloping.tables.summary import of_kind, summarise

KEYS = ["case", "protocol", "method", "points"]


def data_amount(scores: pd.DataFrame, settings: Mapping) -> pd.DataFrame:
    """case, protocol, method, points, state, amplitude_error_percent and r2 with intervals."""
    subsets = of_kind(scores, SUBSET)
    states = ("q_v", "q_w")
    amplitude = summarise(
        subsets,
        KEYS,
        {state: f"amplitude_error_{state}_percent" for state in states},
        "state",
        "amplitude_error_percent",
    )
    r2 = summarise(subsets, KEYS, {state: f"r2_{state}" for state in states}, "state", "r2")
    return amplitude.merge(r2, on=[*KEYS, "state", "replicates", "failures"], validate="1:1")
