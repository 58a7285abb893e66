"""Every model that some setting of a method would have given, for an oracle to choose from."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from galloping.identification.sparse import frols, stlsq
from galloping.identification.sparse.cross_validation import Path
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.supports import solve, threshold_path


def alternatives(evidence: Regressions, path: Path) -> list[np.ndarray]:
    """The distinct models of each equation, (k, n_terms), over all settings of the evidence.

    path: the supports that a method's thresholds give, least squares on them the model.
    """
    found: list[list[np.ndarray]] = [[] for _ in evidence.tuned.states]
    for problem in evidence.settings or (evidence.tuned,):
        p = problem.library.shape[1]
        products = problem.products.sum(axis=0)
        lengths = np.sqrt(np.diagonal(products))
        if not np.all(lengths > 0):
            raise ValueError("a state or a derivative is zero throughout the recording")
        unit = products / np.outer(lengths, lengths)
        supports = path(unit[np.newaxis, :p, :p], unit[np.newaxis, p:, :p])[0]
        for i, each in enumerate(supports):
            distinct = np.unique(each, axis=0)
            shares = solve(unit[:p, :p], unit[[p + i], :p], distinct[np.newaxis])[0]
            found[i].append(shares * lengths[p + i] / lengths[:p])
    return [np.concatenate(models) for models in found]


PATHS: dict[str, Callable[[int], Path]] = {
    "stlsq": lambda length: partial(stlsq.supports_along, threshold_path(length)),
    "frols": lambda length: frols.supports_along,
}
"""By method, what `alternatives` needs of it; length: of a path of thresholds.

LASSO is left out: it finds no better supports than FROLS, at twenty times the cost.
"""
PATHS["weak"] = PATHS["stlsq"]
