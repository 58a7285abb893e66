"""Tables of what a line engineer asks: all lines and sweeps in one table each."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd


def together(parts: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """Rows of all parts in their order; a column that a part does not have is empty there."""
    filled = [part for part in parts.values() if len(part)]
    return pd.concat(filled, ignore_index=True) if filled else pd.DataFrame(columns=["case"])
