"""Errors against noise: of the coefficients by order, and of the motion."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from galloping.study.kinds import NOISE
from galloping.tables.summary import of_kind, summarise

KEYS = ["case", "protocol", "method", "level"]


def noise_coefficients(scores: pd.DataFrame, settings: Mapping) -> pd.DataFrame:
    """case, protocol, method, level, order, mean_error_percent with its interval."""
    orders = {
        order: f"mean_error_{order}_percent"
        for order in ("linear", "quadratic", "cubic")
        if f"mean_error_{order}_percent" in scores
    }
    return summarise(of_kind(scores, NOISE), KEYS, orders, "order", "mean_error_percent")


def noise_r2(scores: pd.DataFrame, settings: Mapping) -> pd.DataFrame:
    """case, protocol, method, level, state, r2_median, r2_low, r2_high, failures."""
    states = {state: f"r2_{state}" for state in ("q_v", "q_w")}
    table = summarise(of_kind(scores, NOISE), KEYS, states, "state", "r2")
    return table.rename(columns={"r2": "r2_median"})
