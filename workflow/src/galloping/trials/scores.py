"""What is claimed of an identified model, and whether it holds."""

from __future__ import annotations

import numpy as np

from galloping.identification.model import IdentifiedModel
from galloping.intervals import NORMAL_95
from galloping.polynomial import PolynomialModel

FAR = 4.0  # standard errors beyond which a coefficient is wrong


def claims(true: PolynomialModel, result: IdentifiedModel) -> dict[str, object]:
    """What is stated and whether it holds, for one fit; counts are of the true terms.

    true: on the library of `result`. Nothing is counted where there is no model. `ok_and_wrong`
    is an `ok` model with a false term, without one above its stated limit, or with a coefficient
    more than four unconditional errors off; `off_given_terms` counts those of its coefficients
    that are more than four off by the errors that trust the terms.
    """
    terms = true.support.copy()
    terms[list(result.known)] = False
    row: dict[str, object] = {
        "status": result.status,
        "exact": bool(np.array_equal(result.support, terms)),
        "ok_and_wrong": False,
        "false_terms": 0,
        "above_limit": 0,
        "off": 0,
        "off_given_terms": 0,
        "terms": 0,
        "terms_found": 0,
        "holding_given_terms": 0,
        "holding_unconditional": 0,
        "width_ratio": np.nan,
        "reason": result.reason,
        "path": result.diagnostics.get("path", ""),
    }
    if result.status == "refused":
        return row
    distance = np.abs(result.model.coefficients - true.coefficients)
    present = result.support
    absent = terms & ~present
    row["false_terms"] = int(np.sum(present & ~terms))
    row["above_limit"] = int(
        np.sum(np.abs(true.coefficients[absent]) > result.detection_limits[absent])
    )
    row["off"] = int(np.sum(distance[present] > FAR * result.unconditional_errors[present]))
    row["off_given_terms"] = int(np.sum(distance[present] > FAR * result.standard_errors[present]))
    wrong = row["false_terms"] or row["above_limit"] or row["off"]
    row["ok_and_wrong"] = bool(result.status == "ok" and wrong)
    row["terms"], row["terms_found"] = int(terms.sum()), int(np.sum(terms & present))
    both = terms & present
    row["holding_given_terms"] = int(
        np.sum(distance[both] <= NORMAL_95 * result.standard_errors[both])
    )
    row["holding_unconditional"] = int(
        np.sum(distance[terms] <= NORMAL_95 * result.unconditional_errors[terms])
    )
    ratios = (result.unconditional_errors / result.standard_errors)[present]
    row["width_ratio"] = float(np.median(ratios)) if ratios.size else np.nan
    return row
