"""What the paper states that a draw of its study can be held against, and how that is judged.

`printed.csv` holds them, a row each, as the paper prints them and nothing of ours but `tolerance`:
by how much a draw may miss a bound that stands for a word such as "exact".

A number that the paper prints stands beside the 5 to 95 % of many draws: `reproduced` if it lies
inside, `better` if our errors are smaller (it lies above), `worse` if they are larger. Of a bound
the share of draws that keep it counts: `met` by most, `seldom met` by one in twenty at least, else
`not met`. `undecided`: fewer than half of the draws give a number. `not run`: the study lacks the
draws. `not judged`: the study's line or method is not the paper's.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np
from pydantic import TypeAdapter

from galloping.intervals import interval
from galloping.results import NOISE, SUBSET

if TYPE_CHECKING:
    import pandas as pd

VALUE, AT_LEAST, AT_MOST = "value", "at_least", "at_most"


@dataclass(frozen=True)
class Claim:
    """One printed number or bound.

    name: its row. case: that it is about, "" for each case of the paper. direction: vertical,
    horizontal or "" for both. quantity: what is compared, with its unit. column: of the scores.
    level: of the noise. points: size of the random subset, None for the whole record. minus: a
    column that is taken from `column`, "" for none; minus_level: the noise level of that column,
    None for the same. kind: VALUE, AT_LEAST or AT_MOST. paper_value: as printed. tolerance:
    by how much a bound may be missed, for rounding. source: where in the paper.
    """

    name: str
    quantity: str
    column: str
    level: float
    kind: str
    paper_value: float
    source: str
    case: str = ""
    direction: str = ""
    points: int | None = None
    minus: str = ""
    minus_level: float | None = None
    tolerance: float = 0.0

    @property
    def is_number(self) -> bool:
        """Whether the paper prints a number, not a bound."""
        return self.kind == VALUE

    @property
    def is_r2(self) -> bool:
        """Whether it is a bound of R2 itself, not of a difference."""
        return self.column.startswith("r2_") and not self.minus

    @property
    def cell_kind(self) -> str:
        """NOISE or SUBSET: the cells that it is about."""
        return NOISE if self.points is None else SUBSET

    def values(self, scores: pd.DataFrame) -> np.ndarray:
        """What each draw has to say, (draws,), of the scores of one case, protocol and method.

        Empty where the study has no such cell. A draw without a model counts as the worst value.
        """
        values = self.rows(scores)[self.column].to_numpy(float)
        if not self.minus:
            return values
        others = self.rows(scores, self.minus_level)[self.minus].to_numpy(float)
        if len(others) != len(values):
            return np.empty(0)
        with np.errstate(invalid="ignore"):
            # two failures show no excess: they count as the worst value
            return np.nan_to_num(values - others, nan=-np.inf, posinf=np.inf, neginf=-np.inf)

    def rows(self, scores: pd.DataFrame, level: float | None = None) -> pd.DataFrame:
        """The scores of its cell, one row a draw; level: its own by default."""
        level = self.level if level is None else level
        cell = scores[(scores["level"] == level) & (scores["kind"] == self.cell_kind)]
        return cell if self.points is None else cell[cell["points"] == self.points]

    def met(self, values: np.ndarray) -> np.ndarray:
        """Which draws keep the bound, or have an error no larger than the printed one."""
        if self.kind == AT_LEAST:
            return values >= self.paper_value - self.tolerance
        return values <= self.paper_value + (0.0 if self.is_number else self.tolerance)


def _read() -> tuple[Claim, ...]:
    named = {"claim": "name", "printed": "paper_value"}
    with files(__package__).joinpath("printed.csv").open(encoding="utf-8", newline="") as lines:
        rows = [
            {named.get(key, key): value for key, value in row.items() if value}
            for row in csv.DictReader(lines)
        ]
    return TypeAdapter(tuple[Claim, ...]).validate_python(rows)


CLAIMS = _read()


def needed(
    case: str, levels: Sequence[float], points: Sequence[int]
) -> tuple[list[float], list[int]]:
    """Of the noise levels and sizes of a study those that the claims about a case need."""
    about = [claim for claim in CLAIMS if claim.case in ("", case)]
    asked = {level for claim in about for level in (claim.level, claim.minus_level)}
    sizes = {claim.points for claim in about}
    return [level for level in levels if level in asked], [n for n in points if n in sizes]


HELD = ("reproduced", "better", "met")  # verdicts of claims that hold
MOST, SELDOM = 1 / 2, 1 / 20  # shares of the draws
WIDE = 10.0  # an interval whose ends differ by this factor holds nearly any printed error


def judged(claim: Claim, scores: pd.DataFrame) -> dict:
    """The verdict on a claim and what it rests on.

    scores: of one case, protocol and method, one row a draw and cell. Of the draws: median, low
    and high (5 and 95 %), ratio (median over the printed number), spread (high over low),
    share_of_draws (that keep the bound, or whose error is no larger than the printed one), draws,
    verdict, and the reason in a sentence.
    """
    values = claim.values(scores)
    if not len(values):
        nothing = dict.fromkeys(("median", "low", "high", "ratio", "spread", "share_of_draws"))
        return {**nothing, "draws": 0, "verdict": "not run", "reason": "the study lacks the draws"}
    median, low, high = interval(values)
    share = float(np.mean(claim.met(values)))
    number = claim.is_number
    with np.errstate(divide="ignore", invalid="ignore"):
        found = {
            "median": median,
            "low": low,
            "high": high,
            "ratio": median / claim.paper_value if number else None,
            "spread": float(np.divide(high, low)) if number else None,
            "share_of_draws": share,
            "draws": len(values),
        }
    judge = _of_number if number else _of_bound
    verdict, reason = judge(claim, scores, values, found)
    return {**found, "verdict": verdict, "reason": reason}


def verdict_of_share(share: float) -> str:
    """The verdict on a bound, or several, that this share of the draws keeps."""
    if share > MOST:
        return "met"
    return "seldom met" if share >= SELDOM else "not met"


def _of_number(
    claim: Claim, scores: pd.DataFrame, values: np.ndarray, found: dict
) -> tuple[str, str]:
    finite, printed = np.mean(np.isfinite(values)), claim.paper_value
    if finite < MOST:
        return "undecided", f"only {_percent(finite)} of the draws give a number"
    paper = f"where the paper errs by {printed:g} %"
    if printed > found["high"]:
        return "better", f"95 % of the draws err by less than {found['high']:.3g} %, {paper}"
    if printed < found["low"]:
        return "worse", f"95 % of the draws err by more than {found['low']:.3g} %, {paper}"
    text = f"{_percent(found['share_of_draws'])} of the draws err less than the paper"
    if not found["spread"] < WIDE:
        text += (
            f", but the draws spread from {found['low']:.2g} to {found['high']:.3g} %: nearly any "
            "printed error would lie inside"
        )
    return "reproduced", text


def _of_bound(
    claim: Claim, scores: pd.DataFrame, values: np.ndarray, found: dict
) -> tuple[str, str]:
    kept = found["share_of_draws"]
    verdict = "undecided" if np.mean(np.isnan(values)) > MOST else verdict_of_share(kept)
    text = f"{_percent(kept)} of the draws keep the bound"
    missed = ~claim.met(values)
    if not np.any(missed):
        return verdict, text
    others = claim.rows(scores)[missed]
    faults = {
        "lost a true term": others["missing"] > 0,
        "have false terms": others["spurious"] > 0,
        "run away": others["motion"] != "ok",
    }
    causes = [
        f"{_percent(np.mean(which))} {fault}" for fault, which in faults.items() if any(which)
    ]
    if not causes:
        text += "; the others have exactly the true terms, with coefficients that are off"
        return verdict, text
    return verdict, f"{text}; of the others {', '.join(causes)}"


def kept_together(claims: Sequence[Claim], scores: pd.DataFrame) -> tuple[float, int] | None:
    """In which share of the draws all bounds hold at once, and the number of draws.

    scores: as of `judged`; a cell without noise has one draw, which stands beside all others. None
    where the study lacks a cell.
    """
    kept = [claim.met(values) for claim in claims if len(values := claim.values(scores))]
    draws = max(map(len, kept), default=0)
    if len(kept) < len(claims) or any(len(each) not in (1, draws) for each in kept):
        return None
    return float(np.mean(np.all([np.resize(each, draws) for each in kept], axis=0))), draws


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"
