"""What the intervals of tables and figures hold: of replicates 90 %, of an estimate 95 %."""

from collections.abc import Sequence

import numpy as np

QUANTILES_90 = (0.05, 0.95)
QUANTILES_95 = (0.025, 0.975)
NORMAL_95 = 1.959963984540054  # half width in standard deviations


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Median and the 5th and 95th percentile; a failure (inf) counts as the worst value."""
    values = np.asarray(values, dtype=float)
    low = np.quantile(values, QUANTILES_90[0], method="lower")
    high = np.quantile(values, QUANTILES_90[1], method="higher")
    return float(np.median(values)), float(low), float(high)
