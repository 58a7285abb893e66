"""Errors against noise: of the coefficients by order, and of the motion."""

from __future__ import annotations

import pandas as pd

from galloping.tables.summary import is_subset, summarise

KEYS = ["case", "protocol", "method", "level"]


def noise_coefficients(scores: pd.DataFrame) -> pd.DataFrame:
    """case, protocol, method, level, order, mean_error_percent with its interval."""
    orders = {
        order: f"mean_error_{order}_percent"
        for order in ("linear", "quadratic", "cubic")
        if f"mean_error_{order}_percent" in scores
    }
    return summarise(scores[~is_subset(scores)], KEYS, orders, "order", "mean_error_percent")


def noise_r2(scores: pd.DataFrame) -> pd.DataFrame:
    """case, protocol, method, level, state, r2_median, r2_low, r2_high, failures."""
    states = {state: f"r2_{state}" for state in ("q_v", "q_w")}
    table = summarise(scores[~is_subset(scores)], KEYS, states, "state", "r2")
    return table.rename(columns={"r2": "r2_median"})
