"""Trials summed up: how often a verdict is right, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

MODEL_ERROR_KEYS = ["truth", "sensors", "method"]
EVERY_TERM = 9.0  # least t at the bound of lines whose terms a recording tells without doubt


def trust(fits: pd.DataFrame, settings: Mapping) -> pd.DataFrame:
    """One row for each group, case, protocol and level of the fits to lines.

    fits: of `galloping.trials.attempts`. coverage_given_terms: of the true terms found, how many
    lie in the 95 % intervals that trust the terms; coverage_unconditional: of all true terms, of
    all fits that state them (`ok` and `not identifiable`), in those that do not; width_ratio:
    median of the widths of the second over the first. cause_named: of fits to recordings with a
    fault. Random lines of which every true term has a t above EVERY_TERM at the bound have a
    further row. settings: none are read.
    """
    sure = fits[(fits["group"] == "random lines") & (fits["weakest_t"] > EVERY_TERM)]
    rows = pd.concat([fits, sure.assign(case=f"every t > {EVERY_TERM:g}")])
    return _summed(rows, ["group", "case", "protocol", "level"], _trust)


def systems(parts: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """One row for each system, length, noise level and method.

    parts: fits of `galloping.trials.attempts`. error_over_bound: median over the fits with exactly
    the right terms. settings: none are read.
    """
    keys = ["system", "states", "samples", "level", "method"]
    return _summed(pd.concat(parts.values(), ignore_index=True), keys, _systems)


def model_error(parts: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """One row for each truth and method on lines that are not their own model.

    parts: fits of `galloping.trials.model_error`. Errors are medians over the answered replicates,
    and the worst of them; coverage_95_percent: of the intervals of the quantities that are judged.
    settings: none are read.
    """
    return _summed(pd.concat(parts.values(), ignore_index=True), MODEL_ERROR_KEYS, _model_error)


def paths(parts: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """One row for each group of trials, method and path to its models, the most used first.

    parts: fits, by trial and batch. path: '' of methods that have but one. exact, ok_and_wrong:
    NaN where a trial does not say. settings: `kinds`, by trial.
    """
    groups = {name: settings["kinds"][name.split("/")[0]].replace("_", " ") for name in parts}
    fits = pd.concat(
        [part.assign(group=groups[name]) for name, part in parts.items()], ignore_index=True
    )
    asked = fits.reindex(columns=["exact", "ok_and_wrong"]).astype(float)
    fits = fits.assign(**asked).fillna({"path": ""})
    table = _summed(fits, ["group", "method", "path"], _paths)
    order = ["group", "method", "fits"]
    return table.sort_values(order, ascending=[True, True, False], kind="stable")


def _paths(fits: pd.DataFrame) -> dict[str, object]:
    return {"fits": len(fits), **_counts(fits), "seconds_median": fits["seconds"].median()}


def _model_error(fits: pd.DataFrame) -> dict[str, object]:
    answered = fits[fits["status"] != "refused"]
    errors = answered[[name for name in fits if name.endswith("_error_percent")]].abs()
    return {
        "replicates": len(fits),
        "answered": len(answered),
        "terms": answered["terms"].median(),
        **errors.median(skipna=False).to_dict(),
        **errors.max(skipna=False).rename(lambda name: name.replace("error", "worst")).to_dict(),
        "coverage_95_percent": 100.0 * answered["intervals_held"].mean(),
        "forecast_r2": answered["forecast_r2"].median(),
        "seconds_median": fits["seconds"].median(),
    }


def _summed(fits: pd.DataFrame, keys: list[str], summary) -> pd.DataFrame:
    return pd.DataFrame(
        dict(zip(keys, names, strict=True)) | summary(group)
        for names, group in fits.groupby(keys, sort=True)
    )


def _counts(fits: pd.DataFrame) -> dict[str, float]:
    status = fits["status"].value_counts()
    return {
        "exact": fits["exact"].sum(min_count=1),
        "ok": int(status.get("ok", 0)),
        "ok_and_wrong": fits["ok_and_wrong"].sum(min_count=1),
        "not_identifiable": int(status.get("not identifiable", 0)),
        "approximate": int(status.get("approximate", 0)),
        "refused": int(status.get("refused", 0)),
    }


def _trust(fits: pd.DataFrame) -> dict[str, object]:
    stating = fits[fits["status"].isin(["ok", "not identifiable"])]
    found, terms = fits["terms_found"].sum(), stating["terms"].sum()
    return {
        "fits": len(fits),
        **_counts(fits),
        "coverage_given_terms": fits["holding_given_terms"].sum() / found if found else np.nan,
        "coverage_unconditional": stating["holding_unconditional"].sum() / terms
        if terms
        else np.nan,
        "width_ratio": fits["width_ratio"].median(),
        "cause_named": fits["cause_named"].sum(min_count=1),
        "seconds_median": fits["seconds"].median(),
    }


def _systems(fits: pd.DataFrame) -> dict[str, object]:
    counts = _counts(fits)
    chosen = ("exact", "ok", "ok_and_wrong", "refused")
    return {
        "replicates": len(fits),
        **{name: counts[name] for name in chosen},
        "error_over_bound": fits["error_over_bound"].median(),
        "seconds_median": fits["seconds"].median(),
    }
