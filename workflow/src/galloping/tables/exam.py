"""Identification of fixed recordings, by stratum and compared with another commit.

Results of the same recording are compared in pairs. If a change of code is as likely to raise a
measure of a recording as to lower it, the sum of the differences has the standard error
sqrt(sum(difference^2)) (R. A. Fisher's randomisation test; for yes and no Q. McNemar's, 1947).
"""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from galloping.tables.trial_summaries import status_counts, summarise_groups

RECORDING_COLUMNS = (  # columns that identify a recording in its stratum
    "case", "truth", "system", "protocol", "samples", "duration", "level", "replicate", "release",
)  # fmt: skip
# columns with 1 or 0, empty if not assessed
ASSESSED_COLUMNS = ("exact_support", "ok_and_wrong", "fault_diagnosed")
COLUMNS = (
    "stratum", "recording", "method", "status", *ASSESSED_COLUMNS, "coverage", "coefficients",
    "findings", "path", "work", "seconds",
)  # fmt: skip
KEYS = ["stratum", "recording", "method"]
TEXT_COLUMNS = ("findings", "path")  # empty text instead of a missing value
ALL_STRATA = "all"  # stratum that contains all others
# measures of a stratum: 1 if larger values are better, -1 if worse
MEASURES = {
    "exact_support": 1, "ok": 1, "ok_and_wrong": -1, "refused": -1, "coverage": 1,
    "fault_diagnosed": 1, "work": -1,
}  # fmt: skip
MIN_SIGNIFICANCE = 2.0  # size of a significant change, standard errors
# change of a coefficient in standard errors, and relative change of a standard error
MAX_IGNORED_CHANGE = 0.01
REFERENCE_PRECISION = 1e-8  # relative precision of the numbers of a reference
DEFAULT_ERROR = 0.01  # relative standard error of a coefficient that states none


def collect_answers(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Collect identification results in one table, with a row for each recording and method.

    Columns: COLUMNS. parts: rows of trials, by trial and batch; a trial is a stratum. coverage: the
    share of the assessed 95 % intervals that contain the truth.
    """
    answers = []
    for name, part in parts.items():
        columns = [column for column in RECORDING_COLUMNS if column in part]
        rows = part.assign(
            stratum=name.split("/")[0],
            recording=part[columns].apply(_name_recording, axis=1),
            coverage=_share_of_intervals(part),
        )
        answers.append(restore_types(rows.reindex(columns=COLUMNS)))
    return pd.concat(answers, ignore_index=True)


def restore_types(answers: pd.DataFrame) -> pd.DataFrame:
    """Restore the column types of identification results that were read from a file."""
    numbers = answers[[*ASSESSED_COLUMNS, "coverage"]].astype(float)
    texts = answers[[*TEXT_COLUMNS]].astype(object).fillna("")
    return answers.assign(**numbers, **texts)


def _name_recording(row: pd.Series) -> str:
    parts = (value if isinstance(value, str) else f"{key} {value:g}" for key, value in row.items())
    return ", ".join(parts)


def _share_of_intervals(rows: pd.DataFrame) -> pd.Series | float:
    """Return the coverage of intervals; of coefficients, if terms are stated to exist."""
    if "coverage" in rows:
        return rows["coverage"]
    if "covered" in rows:
        return rows["covered"].astype(float)
    if "covered_unconditional" not in rows:
        return np.nan
    share = rows["covered_unconditional"] / rows["terms"]
    return share.where(rows["status"].isin(["ok", "not identifiable"]))


def sum_up_strata(answers: pd.DataFrame) -> pd.DataFrame:
    """Summarise identification results for each group of recordings (stratum) and method.

    Further rows are for all strata together. coverage: mean over the recordings. Counts are empty
    without assessed recordings.
    """
    rows = pd.concat([answers, answers.assign(stratum=ALL_STRATA)])
    return summarise_groups(rows, ["stratum", "method"], _sum_up, sort=False)


def _sum_up(rows: pd.DataFrame) -> dict[str, float]:
    return {
        "fits": len(rows),
        **status_counts(rows),
        "coverage": rows["coverage"].mean(),
        "fault_diagnosed": rows["fault_diagnosed"].sum(min_count=1),
        "work": rows["work"].sum(),
        "seconds": rows["seconds"].sum(),
    }


def compare_measures(before: pd.DataFrame, now: pd.DataFrame) -> pd.DataFrame:
    """Compare quality measures of two sets of identification results, paired by recording.

    Compared are the recordings that both tables have. Returns a row for each stratum, method and
    measure, and for all strata together: pairs, in which both answers are assessed; difference, the
    sum of now - before over the pairs; standard_error of it; is_significant: whether the difference
    is more than MIN_SIGNIFICANCE standard errors.
    """
    earlier = _measure_answers(before).add_suffix(" before")
    both = earlier.join(_measure_answers(now), how="inner").reset_index()
    rows = pd.concat([both, both.assign(stratum=ALL_STRATA)])
    return pd.DataFrame(
        {"stratum": stratum, "method": method, "measure": measure, **_sum_differences(own, measure)}
        for (stratum, method), own in rows.groupby(["stratum", "method"], sort=False)
        for measure in MEASURES
    )


def _measure_answers(answers: pd.DataFrame) -> pd.DataFrame:
    status = {name: (answers["status"] == name).astype(float) for name in ("ok", "refused")}
    return answers.assign(**status).set_index(KEYS)[list(MEASURES)]


def _sum_differences(rows: pd.DataFrame, measure: str) -> dict[str, float]:
    change = (rows[measure] - rows[f"{measure} before"]).dropna()
    error = float(np.sqrt(np.sum(change**2)))
    return {
        "pairs": len(change),
        "difference": float(change.sum()),
        "standard_error": error,
        "is_significant": bool(abs(change.sum()) > MIN_SIGNIFICANCE * error),
    }


def is_worse(difference: Mapping[str, Any]) -> bool:
    """Decide whether a quality measure of identification became significantly worse.

    difference: a row of `compare_measures`. Work never is worse.
    """
    better = MEASURES[difference["measure"]]
    worse = difference["difference"] * better < 0.0
    return bool(difference["is_significant"] and worse and difference["measure"] != "work")


def find_changes(before: pd.DataFrame, now: pd.DataFrame) -> pd.DataFrame:
    """List the recordings whose identification result changed, with the changes in words.

    Columns: KEYS and `change`. An answer is its status, assessment, findings, terms, and their
    coefficients and standard errors. A recording that one table lacks is a change.
    """
    pairs = before.merge(now, on=KEYS, how="outer", suffixes=("", "_now"), indicator=True)
    missing = {"left_only": "left out", "right_only": "new"}
    changes = []
    for row in pairs.to_dict("records"):
        change = missing.get(row["_merge"]) or "; ".join(_describe_changes(row))
        if change:
            changes.append({key: row[key] for key in KEYS} | {"change": change})
    return pd.DataFrame(changes, columns=[*KEYS, "change"])


def _describe_changes(row: Mapping[str, Any]) -> Iterator[str]:
    """Yield descriptions of changes between an answer and the same column with `_now`."""
    if row["status"] != row["status_now"]:
        yield f"{row['status']} -> {row['status_now']}"
    for name in (*ASSESSED_COLUMNS, "coverage"):
        first, second = row[name], row[f"{name}_now"]
        if not np.isclose(first, second, rtol=REFERENCE_PRECISION, equal_nan=True):
            yield f"{name.replace('_', ' ')} {first:.3g} -> {second:.3g}"
    first, second = (set(row[name].split()) for name in ("findings", "findings_now"))
    for sign, codes in (("-", first - second), ("+", second - first)):
        if codes:
            yield ", ".join(f"{sign}{code}" for code in sorted(codes))
    first, second = (_read_model(row[name]) for name in ("coefficients", "coefficients_now"))
    for sign, terms in (("-", first.keys() - second.keys()), ("+", second.keys() - first.keys())):
        if terms:
            yield ", ".join(f"{sign}{term} in d({state})" for state, term in sorted(terms))
    shifts, widths = [0.0], [0.0]
    for place in first.keys() & second.keys():
        (value, error), (value_now, error_now) = first[place], second[place]
        shifts.append(abs(value_now - value) / (error or DEFAULT_ERROR * abs(value)))
        if error != error_now:
            widths.append(abs(error_now / error - 1.0) if error and error_now else np.inf)
    if max(shifts) > MAX_IGNORED_CHANGE:
        yield f"coefficients by up to {max(shifts):.2g} standard errors"
    if max(widths) > MAX_IGNORED_CHANGE:
        yield f"standard errors by up to {max(widths):.2g} of them"


def _read_model(text: str) -> dict[tuple[str, str], tuple[float, float | None]]:
    """Parse value and standard error by equation and term, as of `attempts.describe_answer`."""
    equations = json.loads(text)
    return {
        (state, term): tuple(of) for state, row in equations.items() for term, of in row.items()
    }
