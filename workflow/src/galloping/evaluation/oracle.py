"""Best possible tuning of a method, chosen with the truth.

It is computed for pysindy's STLSQ and FROLS on smoothed states, and for STLSQ on the weak form.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from galloping.evaluation.score import DYNAMIC_ROWS, Truth, reconstruct, score
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import as_findings
from galloping.identification.sparse import evidence, frols, stlsq
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.regression import Path, check_nonzero
from galloping.identification.sparse.supports import solve, threshold_path
from galloping.model.polynomial import PolynomialModel
from galloping.recording.samples import Recording
from galloping.results import TERM_DEGREES

CHOICES = ("least error", "right terms")


def oracles(true: PolynomialModel, models: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Select two candidate models, knowing the truth: of least error, and with the right terms.

    Returns coefficients, (n_states, n_terms), of both. true: on the candidate library. models: (k,
    n_terms) for each equation, one per setting. The mean error is that over the orders; the second
    model has the right terms wherever some setting finds them, with the lowest error among those.
    """
    least, right = np.empty_like(true.coefficients), np.empty_like(true.coefficients)
    for i, (candidates, weights) in enumerate(zip(models, _error_weights(true), strict=True)):
        errors = np.abs(candidates - true.coefficients[i]) @ weights
        exact = np.all((candidates != 0) == true.support[i], axis=1)
        least[i] = candidates[np.argmin(errors)]
        right[i] = candidates[np.argmin(np.where(exact | ~exact.any(), errors, np.inf))]
    return least, right


def _error_weights(true: PolynomialModel) -> np.ndarray:
    """Compute the weight of each absolute error in the mean over orders, (n_states, n_terms)."""
    degree = np.array([sum(term) for term in true.terms])
    judged = true.support.copy()
    judged[[i for i in range(len(judged)) if i not in DYNAMIC_ROWS]] = False
    weights = np.zeros(judged.shape)
    for order in TERM_DEGREES.values():
        terms = judged & (degree == order)
        weights[terms] = 1 / (max(terms.sum(), 1) * np.abs(true.coefficients[terms]))
    # the kinematic equations do not enter the mean error: their own relative errors
    others = true.support & ~judged
    weights[others] = 1 / np.abs(true.coefficients[others])
    return weights


def oracle_rows(
    truth: Truth, replicates: Iterable[Sequence[Recording]], path_length: int, weak_path_length: int
) -> list[dict]:
    """Score sparse regression methods with the best possible tuning, chosen with the truth.

    The methods are STLSQ, FROLS and the weak form; scores are those of `evaluation.score`. Each row
    has its `choice` of CHOICES. truth: its model is on the candidate library. replicates:
    recordings of each. path_length, weak_path_length: number of thresholds tried, of STLSQ and of
    the weak form.
    """
    labels, models = [], []
    thresholds, weak_thresholds = (
        partial(stlsq.models_along, threshold_path(count))
        for count in (path_length, weak_path_length)
    )
    # LASSO is left out: it finds no better supports than FROLS, at twenty times the cost
    regressed = {"stlsq": thresholds, "frols": frols.models_along}
    ways = ((evidence.reduce, regressed), (evidence.reduce_weakly, {"weak": weak_thresholds}))
    for (replicate, recordings), (make, paths) in product(enumerate(replicates), ways):
        for method, candidates in _choose_candidates(truth.model, recordings, make, paths):
            for choice, model in zip(CHOICES, candidates, strict=True):
                labels.append({"choice": choice, "method": method, "replicate": replicate})
                models.append(model)
    unknown = np.full(truth.model.coefficients.shape, np.nan)
    motions = reconstruct(truth, models)  # all at once: an integrator takes longest to be made
    return [
        name | score(truth, model, motion, unknown)
        for name, model, motion in zip(labels, models, motions, strict=True)
    ]


def _choose_candidates(
    true: PolynomialModel,
    recordings: Sequence[Recording],
    make: Callable[..., Regressions],
    paths: Mapping[str, Path],
) -> Iterator[tuple[str, list[IdentifiedModel]]]:
    """Yield the models of both CHOICES for each method that uses the same regression problems."""
    try:
        evidence = make(recordings, true.terms)
        models = {method: alternatives(evidence, path) for method, path in paths.items()}
    except (ValueError, np.linalg.LinAlgError) as error:
        nothing = IdentifiedModel.refused(true.states, true.terms, as_findings(error))
        yield from ((method, [nothing] * len(CHOICES)) for method in paths)
        return
    for method, each in models.items():
        choices = (replace(true, coefficients=c) for c in oracles(true, each))
        yield method, [IdentifiedModel(model) for model in choices]


def alternatives(evidence: Regressions, path: Path) -> list[np.ndarray]:
    """List the distinct models of each equation that a method finds over all its settings.

    Each is (k, n_terms), k models of an equation. path: the models for all thresholds of a method.
    """
    models_by_equation: list[list[np.ndarray]] = [[] for _ in evidence.tuned.states]
    for problem in [each.reduced for each in evidence.filters] or [evidence.tuned]:
        products = problem.products.sum(axis=0)
        p = len(products) - len(problem.states)
        lengths = check_nonzero(np.sqrt(np.diagonal(products)))
        unit = products / np.outer(lengths, lengths)
        (models,) = path(unit[np.newaxis, :p, :p], unit[np.newaxis, p:, :p])
        for i, each in enumerate(models):
            distinct = np.unique(each != 0, axis=0)[np.newaxis]
            shares = solve(unit[:p, :p], unit[[p + i], :p], distinct)[0]
            models_by_equation[i].append(shares * lengths[p + i] / lengths[:p])
    return [np.concatenate(models) for models in models_by_equation]
