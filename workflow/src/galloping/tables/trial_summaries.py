"""Summaries of trials: reliability of statuses, cost, and published results for comparison.

The columns are those of `report/tables.csv`.

`exact_terms.csv`: how many of PUBLISHED_TRIALS draws of the noise of the Lorenz system gave
exactly the right terms, by length in s and noise level, as stored in AHsu98/jsindy at da8393e,
`paper-figures/lorenz-heatmap` (MIT licence, copyright 2025 Alexander W. Hsu, Ike W. Griss Salas,
Jacob M. Stevens-Haas, J. Nathan Kutz, Aleksandr Aravkin and Bamdad Hosseini), the row of ODR-BINDy
by its author L. Fung (arXiv 2507.23426). ODR-BINDy is given the size of the noise. Of van der Pol
and Roessler the authors print figures and no numbers.

`published_intervals.csv`: of the quadratic coefficient of a relaxation, PSI-SINDy, arXiv
2610.11486, 5,000 draws; the size of the noise is known. Without such a term: the least and the
largest share of the 95 % intervals that contain zero, and the same of naive tests at level 0.05
that reject zero, over all numbers of samples; the median width of the intervals. With one: the
share of its tests that reject zero.
"""

import csv
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from galloping.tables.scores import concatenate

PUBLISHED_TRIALS = 128  # published realisations of each recording
METHODS = {
    "odr_bindy": "ODR-BINDy (given the noise)",
    "jsindy": "JSINDy",
    "ensemble_weak_sindy": "ensemble weak SINDy",
}


def _read_shares() -> dict[str, dict[tuple[float, float], float]]:
    """Read published shares by method, and (duration, level)."""
    shares: dict = {method: {} for method in METHODS}
    with Path(__file__).with_name("exact_terms.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            of, level = shares[row.pop("method")], float(row.pop("level"))
            of |= {(float(length), level): int(n) / PUBLISHED_TRIALS for length, n in row.items()}
    return shares


PUBLISHED_SHARES = {"lorenz": _read_shares()}  # shares by system
PUBLISHED_INTERVALS = pd.read_csv(
    Path(__file__).with_name("published_intervals.csv"), index_col=["case", "samples"]
)
MIN_SURE_T = 9.0  # smallest t of terms at the bound of recordings that surely determine all terms


def trust(fits: pd.DataFrame) -> pd.DataFrame:
    """Summarise how reliable the status (such as `ok`) of fits to overhead lines is, by group.

    There is a row for each group, case, measurement setup and noise level. fits: of
    `galloping.trials.attempts`. Random lines of which every true term has a t above MIN_SURE_T at
    the bound have a further row.
    """
    is_sure = fits["min_coefficient_over_bound"] > MIN_SURE_T
    sure = fits[(fits["group"] == "random lines") & is_sure]
    rows = pd.concat([fits, sure.assign(case=f"every t > {MIN_SURE_T:g}")])
    return summarise_groups(rows, ["group", "case", "protocol", "level"], _summarise_trust)


def systems(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Summarise fits to published dynamical systems by system, sample count, noise and method.

    parts: fits of `galloping.trials.attempts`. error_over_bound: median over the fits with exactly
    the right terms.
    """
    keys = ["system", "states", "samples", "level", "method"]
    return summarise_groups(concatenate(parts), keys, _summarise_systems)


def model_error(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Summarise errors of models of overhead lines outside the model class, by line and method.

    There is a row for each truth, sensors and method. parts: fits of `galloping.trials.real_lines`,
    by trial and batch.
    """
    keys = ["truth", "sensors", "method"]
    return summarise_groups(concatenate(parts), keys, _summarise_model_error)


def paths(parts: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """Count how often each sequence of stages of the search led to a model, by group and method.

    The most frequent is first. parts: fits, by trial and batch. path: '' for methods with a single
    one. exact_support, ok_and_wrong: NaN if a trial does not have them. settings: `kinds`, by
    trial.
    """
    kinds = {name: settings["kinds"][name.split("/")[0]].replace("_", " ") for name in parts}
    fits = concatenate({name: part.assign(group=kinds[name]) for name, part in parts.items()})
    asked = fits.reindex(columns=["exact_support", "ok_and_wrong"]).astype(float)
    fits = fits.assign(**asked).fillna({"path": ""})
    table = summarise_groups(fits, ["group", "method", "path"], lambda own: {
        "fits": len(own), **status_counts(own), "seconds_median": own["seconds"].median(),
    })  # fmt: skip
    order = ["group", "method", "fits"]
    return table.sort_values(order, ascending=[True, True, False], kind="stable")


def published_terms(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Compare how often all terms are exactly right with published shares, by system and noise.

    There is a row for each system, length, noise level and method. parts: fits of
    `galloping.trials.published.exact_terms`.
    """
    keys = ["system", "duration", "level", "method"]
    return summarise_groups(concatenate(parts), keys, _summarise_exact_terms)


def published_intervals(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Compare the confidence intervals of a quadratic coefficient with published results.

    There is a row for each coefficient, number of samples and method. parts: fits of
    `galloping.trials.published.relaxation_intervals`.
    """
    keys = ["case", "samples", "method"]
    return summarise_groups(concatenate(parts), keys, _summarise_intervals)


def summarise_groups(
    fits: pd.DataFrame,
    keys: list[str],
    summarise: Callable[[pd.DataFrame], Mapping[str, object]],
    sort: bool = True,
) -> pd.DataFrame:
    """Tabulate a summary of each group of fits, such as those of a method, after its keys."""
    return pd.DataFrame(
        {**dict(zip(keys, names, strict=True)), **summarise(group)}
        for names, group in fits.groupby(keys, sort=sort)
    )


def status_counts(fits: pd.DataFrame) -> dict[str, float]:
    """Count fits by status, fits with exactly the true terms, and wrong fits with status `ok`."""
    status = fits["status"].value_counts()
    return {
        "exact_support": fits["exact_support"].sum(min_count=1),
        "ok": int(status.get("ok", 0)),
        "ok_and_wrong": fits["ok_and_wrong"].sum(min_count=1),
        "not_identifiable": int(status.get("not identifiable", 0)),
        "approximate": int(status.get("approximate", 0)),
        "refused": int(status.get("refused", 0)),
    }


def _summarise_trust(fits: pd.DataFrame) -> dict[str, object]:
    stating = fits[fits["status"].isin(["ok", "not identifiable"])]
    return {
        "fits": len(fits),
        **status_counts(fits),
        "coverage_given_terms": _percentage(fits["covered_given_terms"], fits["terms_found"]),
        "coverage_unconditional": _percentage(stating["covered_unconditional"], stating["terms"]),
        "width_ratio": fits["width_ratio"].median(),
        "fault_diagnosed": fits["fault_diagnosed"].sum(min_count=1),
        "seconds_median": fits["seconds"].median(),
    }


def _percentage(part: pd.Series, whole: pd.Series) -> float:
    return part.sum() / whole.sum() if whole.sum() else np.nan


def _summarise_systems(fits: pd.DataFrame) -> dict[str, object]:
    counts = status_counts(fits)
    return {
        "replicates": len(fits),
        **{name: counts[name] for name in ("exact_support", "ok", "ok_and_wrong", "refused")},
        "error_over_bound": fits["error_over_bound"].median(),
        "seconds_median": fits["seconds"].median(),
    }


def _summarise_model_error(fits: pd.DataFrame) -> dict[str, object]:
    answered = fits[fits["status"] != "refused"]
    errors = answered[[name for name in fits if name.endswith("_error_percent")]].abs()
    over_bound = [
        errors[f"damping_{direction}_error_percent"]
        / answered[f"damping_{direction}_bound_percent"]
        for direction in "vw"
    ]
    return {
        "replicates": len(fits),
        "n_models": len(answered),
        "terms": answered["terms"].median(),
        **errors.median(skipna=False).to_dict(),
        **errors.max(skipna=False).rename(lambda name: name.replace("error", "worst")).to_dict(),
        "damping_over_bound": np.sqrt((pd.concat(over_bound) ** 2).mean()),
        "coverage_95_percent": 100.0 * answered["coverage"].mean(),
        "forecast_r2": answered["forecast_r2"].median(),
        "seconds_median": fits["seconds"].median(),
    }


def _summarise_exact_terms(fits: pd.DataFrame) -> dict[str, object]:
    system, duration, level = fits.iloc[0][["system", "duration", "level"]]
    shares, cell = PUBLISHED_SHARES.get(system, {}), (duration, round(level, 6))
    ok = fits["status"] == "ok"
    return {
        "fits": len(fits),
        **_with_interval("share_exact_support", fits["exact_support"]),
        **{name: shares.get(name, {}).get(cell, np.nan) for name in METHODS},
        "ok": int(ok.sum()),
        "ok_and_inexact": int(np.sum(ok & ~fits["exact_support"])),
        "ok_and_wrong": int(fits["ok_and_wrong"].sum()),
        "min_coefficient_over_bound": fits["min_coefficient_over_bound"].median(),
        "seconds_median": fits["seconds"].median(),
    }


def _summarise_intervals(fits: pd.DataFrame) -> dict[str, object]:
    case, samples = fits.iloc[0][["case", "samples"]]
    published = PUBLISHED_INTERVALS.reindex([(case, samples)]).iloc[0]
    return {
        "fits": len(fits),
        **_with_interval("share_with_term", fits["has_term"]),
        "share_with_term_published": published["share_with_term"],
        "share_with_term_naive_low": published["naive_low"],
        "share_with_term_naive_high": published["naive_high"],
        "coverage": fits["covered"].mean(),
        "coverage_published_low": published["coverage_low"],
        "coverage_published_high": published["coverage_high"],
        "interval_width": fits["interval_width"].median(),
        "interval_width_published": published["interval_width"],
        "ok": int(np.sum(fits["status"] == "ok")),
        "exact_support": int(fits["exact_support"].sum()),
    }


def _with_interval(name: str, successes: pd.Series) -> dict[str, float]:
    """Compute a share, and its 95 % interval (E. B. Wilson 1927)."""
    found = binomtest(int(successes.sum()), len(successes)).proportion_ci(method="wilson")
    return {name: successes.mean(), f"{name}_low": found.low, f"{name}_high": found.high}
