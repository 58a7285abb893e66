"""Comparison of the paper's printed numbers with ours: sentences and rows, from tables."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from operator import getitem

import numpy as np
import pandas as pd

from galloping.paper.claims import (
    AT_LEAST,
    AT_MOST,
    CLAIMS_BY_NAME,
    HELD_VERDICTS,
    MAX_SPREAD,
    UNDECIDED,
    Claim,
    format_percent,
)
from galloping.paper.unknowns import UNKNOWN_LABELS, UNKNOWN_NAMES, UNKNOWNS
from galloping.tables.inference import MAX_AGREEMENT_RATIO

STATES = {"vertical": "q_v", "horizontal": "q_w"}
SIGNS = {AT_LEAST: "≥ ", AT_MOST: "≤ "}


@dataclass(frozen=True)
class PaperCell:
    """Table cell that compares a statement of the reproduced paper with the study's result.

    The statement is a printed number, bound or word. verdict: as of `galloping.paper.claims`.
    holds: whether the result confirms the statement.
    """

    printed: str
    ours: str
    verdict: str
    reason: str
    holds: bool


def section(
    paper: pd.DataFrame, varied: pd.DataFrame | None, region: pd.DataFrame | None, study: Mapping
) -> dict:
    """Build the report's section that compares the paper's statements with the study's results.

    paper, varied, region: paper.csv, reproduction.csv and paper_region.csv. The last two are None
    if the study does not have them. study: its settings. Returns setting: the sentence on these;
    count: the sentence on the number of confirmed statements; rows: the table, a cell for each
    statement; failures: a sentence for each unconfirmed claim; by_settings: a sentence on settings
    that the paper does not print, or "".
    """
    return {
        "setting": describe_setting(paper, region, count_unfitted(paper, region, study)),
        "count": describe_counts(paper),
        "rows": {
            statement: merge_directions(cells) for statement, cells in build_table(paper).items()
        },
        "failures": describe_failures(paper),
        "by_settings": "" if varied is None else by_settings(varied),
    }


def count_unfitted(paper: pd.DataFrame, region: pd.DataFrame | None, study: Mapping) -> int:
    """Count the unprinted numbers of the first line that are outside the range of the fit.

    Parameters are as in `section`. The range is that of the region; without one, none is outside.
    """
    line = study["cases"].get(next(iter(paper["case"]), ""))
    if region is None or line is None:
        return 0
    ranges = region.drop_duplicates("unknown").set_index("unknown")[["low", "high"]]
    threshold = study["identification"]["paper"]["threshold"]
    values = [reduce(getitem, u.path, line) if u.path else threshold for u in UNKNOWNS]
    low, high = ranges.reindex(UNKNOWN_NAMES).to_numpy().T
    own = np.array(values, float)
    return int(np.sum(~((own >= low) & (own <= high))))


def describe_setting(paper: pd.DataFrame, region: pd.DataFrame | None, unfitted: int = 0) -> str:
    """Describe in sentences how the settings that the paper does not state were chosen.

    paper: paper.csv. region: paper_region.csv. unfitted: number of these settings outside the range
    of the fit. The text is "" if no claim about the line is judged.
    """
    first = next(iter(paper["case"]), "")
    own = paper[(paper["case"] == first) & (paper["role"] == "counted")]
    if own["verdict"].isin(("not judged", "not run")).all():
        return ""
    text = (
        f"The paper does not state {len(UNKNOWNS)} numbers that the study needs for the line with "
        "internal resonance, such as the wind speed. "
    )
    if unfitted:
        text += f"In this study, {unfitted} of them are outside the range that was fitted to the "
        text += "claims of the paper about this line."
    else:
        text += (
            "These numbers were fitted to all claims of the paper about this line. Agreement "
            "therefore shows that the claims are consistent with each other; it does not confirm "
            "the paper."
        )
    if region is not None:
        verdicts = region.drop_duplicates("unknown").set_index("unknown")["verdict"]
        count = int((verdicts.reindex(UNKNOWN_NAMES) == "left open").sum())
        which = "all" if count == len(UNKNOWNS) else f"{count} of the"
        if count:
            text += f" The claims determine these numbers poorly: for {which} {len(UNKNOWNS)}, the "
            text += f"largest plausible value is at least {MAX_AGREEMENT_RATIO} times the smallest."
    joint = paper[paper["role"] == "joint"]
    first = next(iter(joint["case"]), "")
    for row in joint[joint["case"] == first].to_dict("records"):
        count = int(re.findall(r"\d+", row["claim"])[0])
        which = "bounds and comparisons" if "except" in row["claim"] else "bounds of R2"
        text += f" {format_percent(row['share_met'])} of the noise realisations satisfy all "
        text += f"{count} {which}."
    numbers = paper[(paper["role"] == "counted") & paper["spread"].notna()]
    wide = int((~(numbers["spread"] < MAX_SPREAD)).sum())
    if wide:
        text += f" For {wide} of {len(numbers)} printed errors, nine in ten of our realisations "
        text += f"spread over more than a factor of {MAX_SPREAD:g}: "
        text += "nearly any printed error would agree."
    return text


def describe_counts(paper: pd.DataFrame) -> str:
    """Describe as text how many statements of the reproduced paper are confirmed and how many not.

    A statement is counted once, and is reproduced if all of its rows are. paper: paper.csv.
    """
    single = paper[paper["role"] == "counted"]
    judged = single[single["verdict"] != "not judged"]
    lacks = judged["verdict"].eq("not run").groupby([judged["case"], judged["statement"]]).any()
    holds, may_hold = (
        judged["verdict"].isin(verdicts).groupby([judged["case"], judged["statement"]]).all()
        for verdicts in (HELD_VERDICTS, (*HELD_VERDICTS, UNDECIDED))
    )
    statements, may_hold = holds[~lacks], may_hold[~lacks]
    text = "No statement of the paper is judged."
    if len(statements):
        text = f"{statements.sum()} of {len(statements)} statements of the paper are reproduced."
    if lacks.any():
        further = "further " if len(statements) else ""
        text += f" {lacks.sum()} {further}statements need recordings that this study does not have."
    first = next(iter(paper["case"]), "")
    for what, which in (("Not reproduced", ~may_hold), ("Undecided", may_hold & ~statements)):
        claims = [
            statement if case == first else f"{statement} ({case.replace('_', '-')} line)"
            for case, statement in statements.index[which]
        ]
        if claims:
            text += f" {what}: {', '.join(claims)}."
    beyond = int((paper["role"] == "beyond").sum())
    if beyond:
        text += f" {beyond} further sentences cannot be checked."
    for (case, reason), rows in single[single["verdict"] == "not judged"].groupby(
        ["case", "reason"], sort=False
    ):
        count = rows["statement"].nunique()
        text += f" {count} about {case} are not judged: {reason}."
    return text


def build_table(paper: pd.DataFrame) -> dict[str, list[PaperCell]]:
    """Build the table that compares the paper's statements with the study's results, by statement.

    It has counted claims, and claims that the same draw satisfies together. Both directions of a
    statement are in one row.
    """
    first = next(iter(paper["case"]), "")
    cells: dict[str, list[PaperCell]] = {}
    for row in paper[paper["role"].isin(("counted", "joint"))].to_dict("records"):
        state = STATES.get(row["direction"])
        claim = row["claim"].replace(f" of {state}", "") if state else row["claim"]
        if row["case"] != first:
            claim += f" ({row['case'].replace('_', '-')})"
        cells.setdefault(claim, []).append(_as_cell(row))
    return cells


def merge_directions(cells: list[PaperCell]) -> PaperCell:
    """Merge table cells for the vertical and the horizontal direction, with common text once."""
    texts = {
        name: "; ".join(dict.fromkeys(getattr(cell, name) for cell in cells))
        for name in ("printed", "ours", "verdict", "reason")
    }
    return PaperCell(**texts, holds=all(cell.holds for cell in cells))


def describe_failures(paper: pd.DataFrame) -> list[str]:
    """Write a sentence for each claim of the reproduced paper that was tested and does not hold."""
    others = (*HELD_VERDICTS, UNDECIDED, "not run", "not judged", "beyond judgement")
    failed = paper[~paper["verdict"].isin(others)]
    return [f"{row['claim']}: {row['verdict']}; {row['reason']}." for _, row in failed.iterrows()]


def by_settings(varied: pd.DataFrame) -> str:
    """Describe as text how many claims hold at other values of settings that the paper omits.

    varied: reproduction.csv. For each setting the value with the fewest confirmed claims is named.
    """
    if varied.empty:
        return ""
    varied = varied[varied["verdict"] != "not run"]
    runs = varied.groupby(["parameter", "value", "unit", "is_default"], sort=False)["is_reproduced"]
    runs = runs.agg(["sum", "size"]).reset_index()
    default = runs[runs["is_default"]]
    others = runs[~runs["is_default"]]
    if others.empty:
        return ""
    worst = others.loc[others.groupby("parameter", sort=False)["sum"].idxmin()]
    examples = ", ".join(
        f"{row['sum']} at {UNKNOWN_LABELS[row['parameter']]} {row['value']:g}"
        + (f" {row['unit']}" if row["unit"] != "1" else "")
        for row in worst.sort_values("sum").to_dict("records")
    )
    base = (
        f"{default['sum'].iloc[0]} are reproduced at the study's settings; " if len(default) else ""
    )
    return (
        f"The paper leaves some settings open. Of {others['size'].iloc[0]} claims about the "
        f"{varied['case'].iloc[0].replace('_', '-')} line that were run, {base}with one setting "
        f"changed, the fewest are {examples}."
    )


def _as_cell(row: dict) -> PaperCell:
    claim = CLAIMS_BY_NAME.get(row["claim"])
    printed = _describe_printed(claim) if claim else "at once"
    is_judged = row["verdict"] not in ("not judged", "not run")
    ours = _describe_ours(row, claim) if is_judged else ""
    return PaperCell(printed, ours, row["verdict"], row["reason"], row["verdict"] in HELD_VERDICTS)


def _describe_printed(claim: Claim) -> str:
    """Format the paper's number, or its words if it prints none."""
    if claim.words:
        return claim.words
    return f"{SIGNS.get(claim.kind, '')}{claim.printed:g} {claim.unit}".rstrip()


def _describe_ours(row: dict, claim: Claim | None) -> str:
    """Describe the draws: a median with its range, a value, or a share of the draws."""
    share = format_percent(row["share_met"])
    if claim is None or claim.is_yes_or_no:
        if claim and claim.is_exact:
            return "yes" if row["share_met"] == 1 else "no"
        return f"in {share} of the realisations"
    median, low, high = (_format_number(row[name]) for name in ("median", "low", "high"))
    if claim.is_r2:
        return f"{row['median']:.3f}, met in {share}"
    value = f"{median} {claim.unit}".rstrip()
    return value if low == high else f"{value} ({low} to {high})"


def _format_number(value: float) -> str:
    if not np.isfinite(value):
        return "no model" if pd.isna(value) else ("∞" if value > 0 else "−∞")
    return f"{value:.3g}" if abs(value) >= 1e-3 or value == 0 else f"{value:.0e}"
