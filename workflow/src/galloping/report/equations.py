"""Comparison of the true and the identified equations, for the page."""

import re
from collections.abc import Mapping
from math import floor, isinf, log10

import pandas as pd
from markupsafe import Markup

FACTOR = re.compile(r"(d?)q_(\w)(?:\^(\d+))?")
FIT_COLUMNS = ["protocol", "method", "level"]


def side_by_side(table: pd.DataFrame, labels: Mapping[str, str]) -> dict[str, dict] | None:
    """Arrange true and identified coefficients side by side, in a table for each equation.

    Each has the heads of the fits, rows, and numbers of false terms. table: equations.csv. labels:
    of the methods. None without a true term.
    """
    true = table[table["true"].fillna(0) != 0]
    if true.empty:
        return None
    equations = {}
    for equation, of_equation in table.groupby("equation", sort=False):
        fits = dict(list(of_equation.groupby(FIT_COLUMNS, sort=False)))
        heads = [_format_head(method, level, labels) for _, method, level in fits]
        if len(set(heads)) < len(heads):
            heads = [f"{head}, {fit[0]}" for head, fit in zip(heads, fits, strict=True)]
        true_terms = true[true["equation"] == equation].drop_duplicates("term")
        equations[equation] = {
            "heads": heads,
            "rows": [
                [as_symbols(row["term"]), f"{row['true']:.4g}".replace("-", "\N{MINUS SIGN}")]
                + [_format_coefficient(rows[rows["term"] == row["term"]]) for rows in fits.values()]
                for row in true_terms.to_dict("records")
            ],
            "false_terms": [
                int(((rows["true"] == 0) & rows["identified"].notna()).sum())
                for rows in fits.values()
            ],
        }
    return equations


def _format_head(method: str, level: float, labels: Mapping[str, str]) -> str:
    return f"{labels.get(method, method)}, {f'noise {level:g}' if level else 'no noise'}"


def _format_coefficient(rows: pd.DataFrame) -> str:
    """Format a coefficient and its standard error, if any, to the digits of the error."""
    if rows.empty or pd.isna(rows["identified"].iloc[0]):
        return "not found"
    value, error = rows[["identified", "standard_error"]].iloc[0]
    text = f"{value:.4g}"
    if isinf(error):
        text += " ± ∞"
    elif error > 0:
        digits = max(0, -floor(log10(error)))
        text = f"{value:.{digits}f} ± {error:.{digits}f}"
    return text.replace("-", "\N{MINUS SIGN}")


def as_symbols(term: str) -> Markup:
    """Format a monomial such as `dq_v^2 q_w` in HTML, with a dot for velocities."""
    text = ""
    for dot, index, power in FACTOR.findall(term):
        letter = "q\N{COMBINING DOT ABOVE}" if dot else "q"
        text += f"<i>{letter}</i><sub>{index}</sub>" + (f"<sup>{power}</sup>" if power else "")
    return Markup(text or "1")
