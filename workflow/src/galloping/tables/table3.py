"""Table 3 and figure 5: true and identified coefficients, term by term."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from galloping.identification.identified_model import IdentifiedModel
from galloping.line.galerkin import EQUATIONS, STATES, Derived, symbol_of
from galloping.model.intervals import median_and_interval
from galloping.model.polynomial import (
    Exponents,
    PolynomialModel,
    extend_library,
    polynomial_library,
    term_name,
)

VALUE_COLUMNS = ["equation", "symbol", "term", "true", "identified"]
TERM_COLUMNS = [*VALUE_COLUMNS, "low", "high", "found"]


def identified_terms(
    model: PolynomialModel, results: list[IdentifiedModel], terms: tuple[Exponents, ...]
) -> pd.DataFrame:
    """Tabulate true coefficients of an overhead line with median and range of identified ones.

    There is a row for each true term, and for each other term that a replicate found. model: of the
    line; results: replicates on the library `terms`, in which the line's terms that it lacks are
    absent. Values are those of the left-hand side, as the paper prints them. Columns TERM_COLUMNS:
    identified is the median over the replicates, found the share of those with the term.
    """
    lacking = extend_library(terms, model)[len(terms) :]
    terms = terms + lacking
    true = model.on_library(terms)
    coefficients = np.stack([np.nan_to_num(result.model.coefficients) for result in results])
    coefficients = np.pad(coefficients, ((0, 0), (0, 0), (0, len(lacking))))
    parts = []
    for row, equation in EQUATIONS.items():
        present = np.flatnonzero(true.support[row] | np.any(coefficients[:, row] != 0, axis=0))
        values = -coefficients[:, row, present]
        intervals = np.reshape([median_and_interval(each) for each in values.T], (-1, 3))
        part = pd.DataFrame(intervals, columns=["identified", "low", "high"]).assign(
            equation=equation,
            symbol=[symbol_of(row, terms[j]) for j in present],
            term=[term_name(terms[j], STATES) for j in present],
            true=0.0 - true.coefficients[row, present],
            found=np.mean(values != 0, axis=0),
        )
        parts.append(part.sort_values("symbol", key=_symbol_number, kind="stable"))
    return pd.concat(parts, ignore_index=True)[TERM_COLUMNS]


def _symbol_number(symbols: pd.Series) -> pd.Series:
    """Extract the number of a symbol, 10 of gamma_10; NaN, sorted last, without a symbol."""
    return symbols.str.extract(r"_(\d+)$")[0].astype(float)


def table3(
    models: Mapping[str, Derived],
    identified: Mapping[str, Mapping[str, list[IdentifiedModel]]],
    settings: Mapping,
) -> pd.DataFrame:
    """Tabulate true and identified coefficients of all lines with relative errors (table 3).

    The rows are ordered by case, equation and term. Columns are case, equation, symbol, term, true,
    identified, relative_error_percent, protocol, method and level. models, identified: by case.
    settings: cases, those that are continuous, whose models have no true values; protocol, method,
    level; degree of the library.
    """
    terms = polynomial_library(len(STATES), settings["degree"])
    cell = {key: settings[key] for key in ("protocol", "method", "level")}
    tables = [
        identified_terms(models[case].model, identified[case][settings["method"]], terms).assign(
            case=case, **cell
        )
        for case in settings["cases"]
    ]
    table = pd.concat(tables, ignore_index=True)
    table.loc[table["case"].isin(settings["continuous"]), "true"] = np.nan
    with np.errstate(divide="ignore"):
        error = 100 * np.abs(table["identified"] - table["true"]) / np.abs(table["true"])
    table = table.assign(relative_error_percent=error)
    return table[["case", *VALUE_COLUMNS, "relative_error_percent", *cell]]


def equations(
    model: Derived, identified: Mapping[str, Mapping[str, list[IdentifiedModel]]], settings: Mapping
) -> pd.DataFrame:
    """Tabulate the true terms of an overhead line and the terms identified from single recordings.

    Each fit has a row for each true term and for each false one that it found; values are those of
    the left-hand side. A missing term has an empty value. model: of the line. identified:
    replicates by cell and method, of which the first counts. settings: case; is_continuous, of a
    line whose model has no true values; degree of the library; fits, by cell: protocol, method and
    level.
    """
    terms, parts = polynomial_library(len(STATES), settings["degree"]), []
    for cell, fit in settings["fits"].items():
        first = identified[cell][fit["method"]][0]
        part = identified_terms(model.model, [first], terms)
        errors = {
            (equation, term_name(term, STATES)): first.standard_errors[row, j]
            for row, equation in EQUATIONS.items()
            for j, term in enumerate(terms)
        }
        keys = zip(part["equation"], part["term"], strict=True)
        part["standard_error"] = [errors.get(key, np.nan) for key in keys]
        part["identified"] = part["identified"].where(part["identified"] != 0)
        parts.append(part.assign(case=settings["case"], **fit))
    table = pd.concat(parts, ignore_index=True)
    if settings["is_continuous"]:
        table["true"] = np.nan
    return table[["case", "protocol", "method", "level", *VALUE_COLUMNS, "standard_error"]]


def as_printed(table3: pd.DataFrame) -> pd.DataFrame:
    """Arrange true and identified coefficients in the layout of the reproduced paper's table 3.

    Each number has its gamma, and kappa in parentheses. table3: table3_coefficients.csv. A row for
    the true and for the identified coefficients of each case; columns case, coefficients, then the
    numbers 1 to 10. Coefficients are those of the left-hand side; one that the equation does not
    have is left out.
    """
    rows = []
    parts = table3["symbol"].str.extract(r"^(gamma|kappa)_(\d+)$").set_axis(["letter", "k"], axis=1)
    numbered = table3.assign(**parts).dropna(subset=["k"])
    for case, of_case in numbered.groupby("case", sort=False):
        for name in ("true", "identified"):
            values = {(row["letter"], int(row["k"])): row[name] for _, row in of_case.iterrows()}
            row = {"case": case, "coefficients": name}
            for k in range(1, 11):
                gamma, kappa = (
                    _format_short(values.get((letter, k))) for letter in ("gamma", "kappa")
                )
                row[str(k)] = f"{gamma} ({kappa})" if kappa else gamma
            rows.append(row)
    return pd.DataFrame(rows)


def _format_short(value: float | None) -> str:
    return "" if value is None or np.isnan(value) else f"{value:.4g}"
