"""Errors of coefficients and of the support."""

import numpy as np

from galloping.intervals import NORMAL_95
from galloping.polynomial import PolynomialModel

ORDERS = {"linear": 1, "quadratic": 2, "cubic": 3}


def relative_errors(true: PolynomialModel, coefficients: np.ndarray) -> np.ndarray:
    """|c_hat - c| / |c| of each true term, NaN elsewhere: (n_states, n_terms)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.abs(coefficients - true.coefficients) / np.abs(true.coefficients)
    return np.where(true.support, errors, np.nan)


def mean_error_by_order(
    true: PolynomialModel, coefficients: np.ndarray, equations: tuple[int, ...]
) -> dict[str, float]:
    """Mean relative error of the true terms of each order in `equations`; inf for no model."""
    errors = relative_errors(true, coefficients)[list(equations)]
    degree = np.array([sum(term) for term in true.terms])
    means = {}
    for name, order in ORDERS.items():
        chosen = errors[:, degree == order]
        chosen = chosen[true.support[list(equations)][:, degree == order]]
        if chosen.size:
            means[name] = float(np.mean(chosen)) if np.all(np.isfinite(chosen)) else np.inf
    return means


def support_scores(true: PolynomialModel, coefficients: np.ndarray) -> dict[str, float]:
    """Missing and spurious terms, and TP / (TP + FN + FP); a failed fit found nothing."""
    found = np.nan_to_num(coefficients) != 0
    hit = int(np.sum(found & true.support))
    missing = int(np.sum(true.support & ~found))
    spurious = int(np.sum(found & ~true.support))
    return {
        "missing": missing,
        "spurious": spurious,
        "true_positive_ratio": hit / (hit + missing + spurious),
    }


def relative_norm_error(true: PolynomialModel, coefficients: np.ndarray) -> float:
    """E2 = |c_hat - c| / |c| over all coefficients; inf for no model."""
    error = np.linalg.norm(coefficients - true.coefficients) / np.linalg.norm(true.coefficients)
    return float(error) if np.isfinite(error) else np.inf


def efficiency(
    true: PolynomialModel, coefficients: np.ndarray, bound: np.ndarray, equations: tuple[int, ...]
) -> float:
    """Root mean square of error / Cramer-Rao standard deviation over the true terms.

    1 is what an efficient method reaches on average; inf for no model. NaN where the bound of
    any of the terms is infinite or undefined, as it is without noise: there is no best to compare
    with then, and the other terms alone would flatter a method that missed this one.
    """
    chosen = list(equations)
    terms = true.support[chosen]
    if not np.all(np.isfinite(bound[chosen][terms])):
        return np.nan
    ratios = ((coefficients - true.coefficients) / bound)[chosen][terms]
    value = np.sqrt(np.mean(ratios**2))
    return float(value) if np.isfinite(value) else np.inf


def coverage(
    true: PolynomialModel,
    coefficients: np.ndarray,
    standard_errors: np.ndarray,
    equations: tuple[int, ...],
) -> dict[str, float]:
    """How many of the true coefficients the method's 95 % intervals hold.

    A method that states no interval at all has no counts (NaN); a term it missed is not held.
    """
    chosen = list(equations)
    errors = standard_errors[chosen]
    if np.all(np.isnan(errors)):
        return {"intervals": np.nan, "intervals_holding": np.nan}
    terms = true.support[chosen]
    off = np.abs(coefficients - true.coefficients)[chosen][terms]
    held = off <= NORMAL_95 * np.nan_to_num(errors[terms])
    return {"intervals": float(terms.sum()), "intervals_holding": float(held.sum())}
