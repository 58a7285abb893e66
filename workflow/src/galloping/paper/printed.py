"""The statements of the paper that a draw of its study can be held against.

`printed.csv` holds them, a row each, as the paper prints them and nothing of ours but `tolerance`:
by how much a draw may miss a bound that stands for a word such as "exact".
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np
from pydantic import TypeAdapter

from galloping.names import NOISE, SUBSET

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
    def cell_kind(self) -> str:
        """NOISE or SUBSET: the cells that it is about."""
        return NOISE if self.points is None else SUBSET

    def values(self, scores: pd.DataFrame) -> np.ndarray:
        """What each draw has to say, (draws,), of the scores of one case, protocol and method.

        Empty where the study has no such cell. A draw without a model counts as the worst value.
        """
        values = self._of(scores, self.column, self.level)
        if not self.minus:
            return values
        level = self.level if self.minus_level is None else self.minus_level
        others = self._of(scores, self.minus, level)
        if len(others) != len(values):
            return np.empty(0)
        with np.errstate(invalid="ignore"):
            # two failures show no excess: they count as the worst value
            return np.nan_to_num(values - others, nan=-np.inf, posinf=np.inf, neginf=-np.inf)

    def rows(self, scores: pd.DataFrame) -> pd.DataFrame:
        """The scores of its cell, one row a draw."""
        return self._cell(scores, self.level)

    def _of(self, scores: pd.DataFrame, column: str, level: float) -> np.ndarray:
        return self._cell(scores, level)[column].to_numpy(float)

    def _cell(self, scores: pd.DataFrame, level: float) -> pd.DataFrame:
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
