"""Every model that some setting of a method would have given, for an oracle to choose from."""

from collections.abc import Callable
from functools import partial

import numpy as np

from galloping.identification.model import Unusable
from galloping.identification.sparse import frols, stlsq
from galloping.identification.sparse.cross_validation import Path
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.supports import solve, threshold_path


def alternatives(evidence: Regressions, path: Path) -> list[np.ndarray]:
    """The distinct models of each equation, (k, n_terms), over all settings of the evidence.

    path: the models that a method's thresholds give.
    """
    found: list[list[np.ndarray]] = [[] for _ in evidence.tuned.states]
    for problem in [each.reduced for each in evidence.settings] or [evidence.tuned]:
        products = problem.products.sum(axis=0)
        p = len(products) - len(problem.states)
        lengths = np.sqrt(np.diagonal(products))
        if not np.all(lengths > 0):
            raise Unusable("a state or a derivative is zero throughout the recording")
        unit = products / np.outer(lengths, lengths)
        (models,) = path(unit[np.newaxis, :p, :p], unit[np.newaxis, p:, :p])
        for i, each in enumerate(models):
            distinct = np.unique(each != 0, axis=0)[np.newaxis]
            shares = solve(unit[:p, :p], unit[[p + i], :p], distinct)[0]
            found[i].append(shares * lengths[p + i] / lengths[:p])
    return [np.concatenate(models) for models in found]


PATHS: dict[str, Callable[[int], Path]] = {
    "stlsq": lambda length: partial(stlsq.models_along, threshold_path(length)),
    "frols": lambda length: frols.models_along,
}
"""By method, what `alternatives` needs of it; length: of a path of thresholds.

LASSO is left out: it finds no better supports than FROLS, at twenty times the cost.
"""
PATHS["weak"] = PATHS["stlsq"]
