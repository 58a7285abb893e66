"""Fits in the settings of published comparisons, summed up beside the published numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from galloping.trials.published_numbers import (
    EXACT,
    HOLDING,
    METHODS,
    NAIVE_REJECTIONS,
    POWER,
    WIDTHS,
)


def published_terms(parts: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """One row for each system, length, noise level and method.

    parts: fits of `galloping.trials.published.exact_terms`. exact: share of fits with exactly the
    right terms, with an interval of 95 % (E. B. Wilson 1927), and beside it the share that each of
    `published_numbers.METHODS` had, NaN where none is known. ok_and_inexact: `ok` with any other
    terms, even such as are below the stated limits. weakest_t: of the true terms, at the bound.
    settings: none are read.
    """
    fits = pd.concat(parts.values(), ignore_index=True)
    rows = []
    for names, group in fits.groupby(["system", "duration", "level", "method"], sort=True):
        system, duration, level, _ = names
        exact, ok = group["exact"], group["status"] == "ok"
        low, high = _interval(exact)
        published = EXACT.get(system, {})
        cell = (duration, round(level, 6))
        rows.append(
            dict(zip(["system", "duration", "level", "method"], names, strict=True))
            | {
                "fits": len(group),
                "exact": exact.mean(),
                "exact_low": low,
                "exact_high": high,
                **{name: published.get(name, {}).get(cell, np.nan) for name in METHODS},
                "ok": int(ok.sum()),
                "ok_and_inexact": int(np.sum(ok & ~exact)),
                "ok_and_wrong": int(group["ok_and_wrong"].sum()),
                "weakest_t": group["weakest_t"].median(),
                "seconds_median": group["seconds"].median(),
            }
        )
    return pd.DataFrame(rows)


def published_intervals(parts: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """One row for each quadratic coefficient, number of samples and method.

    parts: fits of `galloping.trials.published.intervals`. found: share of models with the term,
    with an interval as in `published_terms`; holds: of the intervals of 95 % with its true
    coefficient; width: their median. The published numbers beside them are those of
    `published_numbers`, NaN where none is known; of naive tests the range over the lengths.
    settings: none are read.
    """
    fits = pd.concat(parts.values(), ignore_index=True)
    rows = []
    for names, group in fits.groupby(["case", "samples", "method"], sort=True):
        case, samples, _ = names
        low, high = _interval(group["found"])
        none = case == "gamma 0"
        rows.append(
            dict(zip(["case", "samples", "method"], names, strict=True))
            | {
                "fits": len(group),
                "found": group["found"].mean(),
                "found_low": low,
                "found_high": high,
                "found_published": POWER.get((case, samples), np.nan),
                "found_naive_low": NAIVE_REJECTIONS[0] if none else np.nan,
                "found_naive_high": NAIVE_REJECTIONS[1] if none else np.nan,
                "holds": group["holds"].mean(),
                "holds_published_low": HOLDING[0] if none else np.nan,
                "holds_published_high": HOLDING[1] if none else np.nan,
                "width": group["width"].median(),
                "width_published": WIDTHS.get(samples, np.nan) if none else np.nan,
                "ok": int(np.sum(group["status"] == "ok")),
                "exact": int(group["exact"].sum()),
            }
        )
    return pd.DataFrame(rows)


def _interval(successes: pd.Series) -> tuple[float, float]:
    """Of 95 %, of a share."""
    found = binomtest(int(successes.sum()), len(successes)).proportion_ci(method="wilson")
    return float(found.low), float(found.high)
