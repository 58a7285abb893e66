"""The paper's claims beside the study's draws, each with a verdict by one rule.

The paper shows one realisation of its noise, so every replicate of the study is asked whether it
meets the claim: an error no larger, an R2 or a true positive ratio no smaller than printed. Of the
share of replicates that do, `met_by`, the verdict says: `reproduced` if it is most of them, `in
reach` if it is at least one in twenty (the paper may have shown such a draw), else `not
reproduced`. `better`: less than one draw in twenty has an error as large as the paper's. A cell the
study did not run is `not run`. Only the paper's own lines are judged: no other can reproduce it, or
fail to.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from galloping.study.kinds import NOISE, SUBSET
from galloping.tables.summary import interval, of_kind


@dataclass(frozen=True)
class Claim:
    """One statement of the paper.

    name: its row. quantity: what is compared, with unit. paper_value: as printed.
    kind: `value` or `at_least` or `at_most`. level, points: the cell; points None is the record.
    column: of the scores; minus: another column, which is taken from it, or None.
    case: the case it is about, or None for every case. source: where in the paper.
    """

    name: str
    quantity: str
    paper_value: float
    kind: str
    column: str
    level: float = 0.05
    points: int | None = None
    minus: str | None = None
    case: str | None = "internal_resonance"
    source: str = ""


def _subset_claims() -> list[Claim]:
    printed = {
        "q_v": {30000: 0.83, 10000: 5.25, 5000: 9.45, 1000: 13.21},
        "q_w": {30000: 1.03, 10000: 5.12, 5000: 10.91, 1000: 15.97},
    }
    return [
        Claim(
            f"amplitude error of {state} from {points} points",
            "relative error of the steady amplitude, percent",
            value,
            "value",
            f"amplitude_error_{state}_percent",
            points=points,
            source="section 4.4",
        )
        for state, values in printed.items()
        for points, value in values.items()
    ]


MOST, RARE = 1 / 2, 1 / 20  # shares of the draws

CLAIMS = [
    Claim("exact structure without noise", "true positive ratio of terms", 1.0, "at_least",
          "true_positive_ratio", level=0, case=None, source="section 4.1, conclusion 1"),
    Claim("exact parameters without noise", "relative error E2 of the coefficients", 1e-6,
          "at_most", "e2", level=0, case=None, source="section 4.1, conclusion 1"),
    *[
        Claim(f"all terms found at {level:g}", "missing terms", 0.0, "at_most", "missing",
              level=level, source="section 4.2")
        for level in (0.01, 0.03, 0.05)
    ],
    Claim("mean error of linear terms at 0.05", "mean relative error of coefficients, percent",
          9.56, "value", "mean_error_linear_percent", source="section 4.2, conclusion 2"),
    Claim("mean error of cubic terms at 0.05", "mean relative error of coefficients, percent",
          21.05, "value", "mean_error_cubic_percent", source="section 4.2, conclusion 2"),
    Claim("cubic error above linear at 0.05", "cubic minus linear error, percent points", 0.0,
          "at_least", "mean_error_cubic_percent", minus="mean_error_linear_percent",
          source="section 4.2"),
    *[
        Claim(f"R2 of {state} at {level:g} ({where})", "R2 over the record", bound, "at_least",
              f"r2_{state}", level=level, source=where)
        for level, bound, where in (
            (0.05, 0.99, "section 4.3"),
            (0.05, 0.97, "first abstract"),
            (0.1, 0.95, "section 4.3"),
            (0.1, 0.93, "first abstract"),
        )
        for state in ("q_v", "q_w")
    ],
    Claim("horizontal R2 above vertical at 0.05", "R2 of q_w minus R2 of q_v", 0.0, "at_least",
          "r2_q_w", minus="r2_q_v", source="section 4.3"),
    *_subset_claims(),
    *[
        Claim(f"R2 of {state} with 10000 points", "R2 over the record", 0.95, "at_least",
              f"r2_{state}", points=10000, source="section 4.4, conclusion 4")
        for state in ("q_v", "q_w")
    ],
]  # fmt: skip


COLUMNS = (
    "claim", "source", "case", "quantity", "paper_value", "study_value", "low", "high", "met_by",
    "replicates", "protocol", "method", "verdict",
)  # fmt: skip


STEADY = 1.0  # percent by which the amplitude of a steady state may grow


def claims_table(
    scores: pd.DataFrame, settings: Mapping, ahead: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Every claim about one of the cases for every protocol and method of the study.

    settings: cases, those that are the paper's, with its parameters; pairs of protocol and method;
    subset_level, the noise level of the subsets. ahead: limit_cycle_ahead.csv, for whether the
    paper's steady state is steady; that row is about the line itself, whatever was measured.
    Columns: COLUMNS, study_value the median.
    """
    rows = []
    for claim in CLAIMS:
        about = [case for case in settings["cases"] if claim.case in (None, case)]
        for case in about:
            for protocol, method in settings["pairs"]:
                values = _values(scores, claim, case, protocol, method, settings["subset_level"])
                if values is None:
                    continue
                rows.append(_row(claim, case, protocol, method, values))
    if ahead is not None:
        rows += _steadiness(ahead[ahead["case"].isin(settings["cases"])])
    return pd.DataFrame(rows, columns=COLUMNS)


def _values(scores, claim, case, protocol, method, subset_level) -> np.ndarray | None:
    """Replicates of the claim's cell; empty if the study did not run it."""
    taken = of_kind(scores, SUBSET if claim.points else NOISE)
    taken = taken[(taken["protocol"] == protocol) & (taken["method"] == method)]
    if taken.empty:
        return None  # the method does not take such recordings
    cell = taken[taken["case"] == case]
    if claim.points:
        cell = cell[(cell["points"] == claim.points) & (subset_level == claim.level)]
    else:
        cell = cell[cell["level"] == claim.level]
    values = cell[claim.column].to_numpy(float)
    if claim.minus:
        with np.errstate(invalid="ignore"):
            # two failures show no excess: they count as the worst value
            values = np.nan_to_num(values - cell[claim.minus].to_numpy(float), nan=-np.inf,
                                   posinf=np.inf, neginf=-np.inf)  # fmt: skip
    return values


def _steadiness(ahead: pd.DataFrame) -> list[dict]:
    rows = []
    for (case, state), of_state in ahead.groupby(["case", "state"], sort=False):
        growth = 100.0 * (of_state["true_m"] / of_state["recorded_m"] - 1.0).to_numpy()[:1]
        claim = Claim(
            f"steady state of {state}",
            f"growth from its amplitude to the limit cycle, percent; steady: up to {STEADY:g}",
            STEADY, "at_most", "", source="sections 4.1 to 4.4",
        )  # fmt: skip
        rows.append(_row(claim, case, "exact", "two-mode model", growth))
    return rows


def _row(claim: Claim, case: str, protocol: str, method: str, values: np.ndarray) -> dict:
    median, low, high = interval(values) if len(values) else (np.nan,) * 3
    return {
        "claim": claim.name,
        "source": claim.source,
        "case": case,
        "quantity": claim.quantity,
        "paper_value": claim.paper_value,
        "study_value": median,
        "low": low,
        "high": high,
        "met_by": np.mean(_meets(claim, values)) if len(values) else np.nan,
        "replicates": len(values),
        "protocol": protocol,
        "method": method,
        "verdict": verdict(claim, values) if len(values) else "not run",
    }


def verdict(claim: Claim, values: np.ndarray) -> str:
    """By the rule of this module, of the values of all replicates; a NaN meets nothing."""
    met = _meets(claim, values).mean()
    if claim.kind == "value" and np.mean(~(values < claim.paper_value)) < RARE:
        return "better"
    if met > MOST:
        return "reproduced"
    return "in reach" if met >= RARE else "not reproduced"


def _meets(claim: Claim, values: np.ndarray) -> np.ndarray:
    """Whether each replicate is as good as the paper says."""
    return values >= claim.paper_value if claim.kind == "at_least" else values <= claim.paper_value
