"""Claims of the paper that noise realisations of its study can confirm, and their assessment.

`printed.csv` has a row for every sentence of the paper that states a result. Our additions are
`tolerance`, by how much a draw may miss a bound that represents a word such as "exact", and `note`,
on the interpretation of a word or why a sentence cannot be assessed.

A printed number is `reproduced` if it is between the 5th and 95th percentile of the draws, `better`
if our errors are smaller (it is above), `worse` if they are larger. A bound is `met` if the 95 %
interval of the share of draws that satisfy it is above a half, `seldom met` if it is below,
`not met` if no draw satisfies it, else `undecided`. A number is `undecided` if fewer than half of
the draws give one, and so is any claim with a single draw of its noise. `not run`: the study lacks
the draws. `not judged`: the study's line or method is not the paper's.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydantic import TypeAdapter
from scipy.stats import binomtest

from galloping.model.intervals import median_and_interval
from galloping.results import NOISE, SUBSET

if TYPE_CHECKING:
    import pandas as pd

VALUE, AT_LEAST, AT_MOST, FEW, BEYOND = "value", "at_least", "at_most", "few", "beyond"
COUNTED = "counted"


@dataclass(frozen=True)
class Claim:
    """Claim printed in the reproduced paper: a number, a bound or a statement in words.

    It is a row of `printed.csv`. name: the claim. statement: unit of counting, its own name for a
    single claim. case: its case, "" for each case of the paper. direction: vertical, horizontal or
    "" for both. quantity: what is compared, with its unit. column: of the scores. level: of the
    noise. points: size of the random subset, None for the whole record. minus: a column that is
    subtracted from `column`, "" for none; minus_level: the noise level of that column, None for the
    same. kind: VALUE, AT_LEAST, AT_MOST, FEW (a count that the paper calls gradual or small) or
    BEYOND (without a number for assessment). printed: the number, NaN for BEYOND. words: of the
    paper instead of a number. unit: after a number in a table. tolerance: by how much a bound may
    be missed that represents a word such as "exact". source: place in the paper. role: COUNTED, or
    implied by other claims. note: on the interpretation of a word, or why it cannot be assessed.
    """

    name: str
    source: str
    kind: str
    statement: str = ""
    quantity: str = ""
    column: str = ""
    level: float = math.nan
    printed: float = math.nan
    words: str = ""
    unit: str = ""
    case: str = ""
    direction: str = ""
    points: int | None = None
    minus: str = ""
    minus_level: float | None = None
    tolerance: float = 0.0
    role: str = COUNTED
    note: str = ""

    @property
    def is_number(self) -> bool:
        """Whether the paper prints a number, not a bound."""
        return self.kind == VALUE

    @property
    def is_counted(self) -> bool:
        """Whether the claim is assessed by itself, not implied by other claims."""
        return self.role == COUNTED

    @property
    def is_yes_or_no(self) -> bool:
        """Whether the claim is only true or false in a noise realisation, without a number."""
        return self.column in ("missing", "true_positive_ratio") or bool(self.minus)

    @property
    def is_r2(self) -> bool:
        """Whether the claim is a bound on R2 itself, not on a difference of two R2."""
        return self.column.startswith("r2_") and not self.minus

    @property
    def is_exact(self) -> bool:
        """Whether the claim is about recordings without noise, of which one represents all."""
        return self.level == 0

    @property
    def cell_kind(self) -> str:
        """Kind of recordings that the claim is about, whole (NOISE) or sampled (SUBSET)."""
        return NOISE if self.points is None else SUBSET

    def values(self, scores: pd.DataFrame) -> np.ndarray:
        """Extract from scores the claimed quantity in each noise realisation.

        Returns (draws,). scores: of one case, measurement setup and method. Empty if the study has
        no such cell. A draw without a model counts as the worst value.
        """
        values = self.rows(scores)[self.column].to_numpy(float)
        if not self.minus:
            return values
        others = self.rows(scores, self.minus_level)[self.minus].to_numpy(float)
        if len(others) != len(values):
            return np.empty(0)
        with np.errstate(invalid="ignore"):
            # two failures have no difference: they count as the worst value
            return np.nan_to_num(values - others, nan=-np.inf, posinf=np.inf, neginf=-np.inf)

    def rows(self, scores: pd.DataFrame, level: float | None = None) -> pd.DataFrame:
        """Select the rows of scores that the claim is about, one per noise realisation.

        level: noise level, by default that of the claim.
        """
        level = self.level if level is None else level
        cell = scores[(scores["level"] == level) & (scores["kind"] == self.cell_kind)]
        return cell if self.points is None else cell[cell["points"] == self.points]

    def is_met(self, values: np.ndarray) -> np.ndarray:
        """Decide for each value whether it satisfies the bound or is at most the printed error."""
        if self.kind == AT_LEAST:
            return values >= self.printed - self.tolerance
        return values <= self.printed + (0.0 if self.is_number else self.tolerance)


def _read_claims() -> tuple[Claim, ...]:
    with Path(__file__).with_name("printed.csv").open(encoding="utf-8", newline="") as lines:
        rows = [
            {"name" if key == "claim" else key: value for key, value in row.items() if value}
            for row in csv.DictReader(lines)
        ]
    return TypeAdapter(tuple[Claim, ...]).validate_python(
        [{"statement": row["name"]} | row for row in rows]
    )


_ROWS = _read_claims()
CLAIMS = tuple(claim for claim in _ROWS if claim.kind != BEYOND)
CLAIMS_BY_NAME = {claim.name: claim for claim in CLAIMS}
UNJUDGED_CLAIMS = tuple(claim for claim in _ROWS if claim.kind == BEYOND)

UNDECIDED = "undecided"
HELD_VERDICTS = ("reproduced", "better", "met")  # verdicts of claims that are confirmed
MAJORITY = 1 / 2  # share of the realisations that decides a verdict
SHARE_COLUMNS = ("share_met", "share_met_low", "share_met_high")
MAX_SPREAD = 10.0  # ratio of the ends of an interval; a wider one contains nearly any number


def judge(claim: Claim, scores: pd.DataFrame) -> dict:
    """Assess a claim of the reproduced paper by its values in simulated noise realisations.

    claim: a number, a bound or a word of the paper. scores: of one case, measurement setup and
    method, one row per draw and cell. Returns of the draws: median, low (5 %) and high (95 %),
    ratio (median over the printed number), spread (high over low), share_met (that satisfy the
    bound, or whose error is no larger than the printed one) with its 95 % interval share_met_low
    and share_met_high, replicates; verdict, and reason in a sentence.
    """
    values = claim.values(scores)
    if not len(values):
        numbers = ("median", "low", "high", "ratio", "spread", *SHARE_COLUMNS)
        reason = "the study lacks these recordings"
        return dict.fromkeys(numbers) | {"replicates": 0, "verdict": "not run", "reason": reason}
    median, low, high = median_and_interval(values.tolist())
    number = claim.is_number
    with np.errstate(divide="ignore", invalid="ignore"):
        row = {
            "median": median,
            "low": low,
            "high": high,
            "ratio": median / claim.printed if number else None,
            "spread": float(np.divide(high, low)) if number else None,
            **share_with_interval(claim.is_met(values), claim.is_exact),
        }
    if row["replicates"] == 1 and not claim.is_exact:
        verdict, reason = UNDECIDED, "the study has one realisation"
    elif number:
        verdict, reason = _judge_number(claim, values, row)
    else:
        verdict, reason = _judge_bound(claim, scores, values, row)
    return {**row, "verdict": verdict, "reason": reason}


def share_with_interval(is_met: np.ndarray, is_exact: bool = False) -> dict[str, float]:
    """Compute the share of noise realisations that satisfy a bound, with its 95 % interval.

    is_met: whether each draw satisfies the bound. is_exact: whether the draws have no noise, so
    that the share has no sampling error. The interval is that of E. B. Wilson (1927).
    """
    share, draws = float(np.mean(is_met)), len(is_met)
    low, high = share, share
    if not is_exact:
        low, high = binomtest(int(np.sum(is_met)), draws).proportion_ci(method="wilson")
    return dict(zip(SHARE_COLUMNS, (share, low, high), strict=True)) | {"replicates": draws}


def verdict_of_share(share: Mapping[str, float]) -> str:
    """Derive the verdict on a bound, such as `met`, from the share of realisations that meet it.

    share: of `share_with_interval`.
    """
    if share["share_met_low"] > MAJORITY:
        return "met"
    if share["share_met_high"] < MAJORITY:
        return "seldom met" if share["share_met"] else "not met"
    return UNDECIDED


def _judge_number(claim: Claim, values: np.ndarray, row: dict) -> tuple[str, str]:
    finite, printed = np.mean(np.isfinite(values)), claim.printed
    if finite < MAJORITY:
        return UNDECIDED, f"only {format_percent(finite)} of the realisations give a number"
    paper = f"where the paper errs by {printed:g} %"
    if printed > row["high"]:
        return "better", f"95 % of the realisations err by less than {row['high']:.3g} %, {paper}"
    if printed < row["low"]:
        return "worse", f"95 % of the realisations err by more than {row['low']:.3g} %, {paper}"
    text = f"{format_percent(row['share_met'])} of the realisations err less than the paper"
    if not row["spread"] < MAX_SPREAD:
        text += (
            f", but they spread from {row['low']:.2g} to {row['high']:.3g} %: nearly any "
            "printed error would lie inside"
        )
    return "reproduced", text


def _judge_bound(
    claim: Claim, scores: pd.DataFrame, values: np.ndarray, row: dict
) -> tuple[str, str]:
    verdict = UNDECIDED if np.mean(np.isnan(values)) > MAJORITY else verdict_of_share(row)
    if claim.is_exact:
        return verdict, "without noise there is a single value"
    share, low, high = (format_percent(row[name]) for name in SHARE_COLUMNS)
    text = f"{share} of the realisations ({low} to {high})"
    is_missed = ~claim.is_met(values)
    if not np.any(is_missed):
        return verdict, text
    others = claim.rows(scores)[is_missed]
    faults = {
        "lost a true term": others["missing"] > 0,
        "have false terms": others["spurious"] > 0,
        "run away": others["motion"] != "ok",
    }
    causes = [
        f"{format_percent(np.mean(which))} {fault}" for fault, which in faults.items() if any(which)
    ]
    if causes:
        return verdict, f"{text}; of the others {', '.join(causes)}"
    text += "; the others have exactly the true terms, with coefficients that are off"
    return verdict, text


def find_joint_draws(claims: Sequence[Claim], scores: pd.DataFrame) -> np.ndarray | None:
    """Decide which noise realisations satisfy the bounds of several claims at once.

    Returns (draws,). scores: as of `judge`; a cell without noise has one draw, which is combined
    with all others. None if the study lacks a cell.
    """
    are_met = [claim.is_met(claim.values(scores)) for claim in claims]
    draws = max(map(len, are_met), default=0)
    if any(len(each) not in (1, draws) for each in are_met) or not draws:
        return None
    return np.all([np.resize(each, draws) for each in are_met], axis=0)


def format_percent(share: float) -> str:
    """Format a share as text, in whole per cent."""
    return f"{100 * share:.0f} %"
