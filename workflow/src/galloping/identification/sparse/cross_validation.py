"""Settings from the data alone: fits to some stretches of a recording judged by the others.

The judge is the weak form of the raw samples. What a model predicts of a held-out stretch,
int phi Theta(x) c, is compared with -int phi' y, which no smoothing has touched: its noise has zero
mean and is the same for all settings. Of all models within one standard error of the best the
sparsest is taken (the one-standard-error rule; Breiman et al. 1984).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from galloping.identification.model import Unusable
from galloping.identification.sparse.regression import Regression

FOLDS = 5  # every fifth stretch of a recording is left out at a time
ROUNDING = 1e-13  # share of a sum of squares below which a difference of such sums is nothing
Path = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From Gram matrices (f, p, p) of unit columns and moments (f, m, p) to models (f, m, k, p)."""


@dataclass(frozen=True)
class Judged:
    """Models along a path, fitted to all stretches, with the errors of their like elsewhere.

    supports: (m, k, p) of the m state derivatives. errors: (FOLDS, m, k) squared errors on held-out
    stretches.
    """

    supports: np.ndarray
    errors: np.ndarray

    @property
    def best(self) -> np.ndarray:
        """(m,) the lowest error of each state derivative."""
        return self.errors.sum(axis=0).min(axis=1)

    def chosen(self) -> np.ndarray:
        """(m,) the place on the path of each model chosen by the one-standard-error rule."""
        total, sizes = self.errors.sum(axis=0), self.supports.sum(axis=2)
        rows = np.arange(len(total))
        best = total.argmin(axis=1)
        excess = self.errors - self.errors[:, rows, best][..., np.newaxis]
        error = np.sqrt(len(excess)) * excess.std(axis=0, ddof=1)
        near = excess.sum(axis=0) <= error
        sizes = np.where(near, sizes, sizes.max() + 1)
        return np.array([np.lexsort(keys)[0] for keys in zip(total, sizes, strict=True)])


def judge(problem: Regression, path: Path) -> Judged:
    """Fits along a path to all stretches of a problem, and to all but each fold of them."""
    blocks = problem.products
    p = blocks.shape[1] - len(problem.states)
    fold = np.arange(len(blocks)) % FOLDS
    whole = blocks.sum(axis=0)
    lengths = np.sqrt(np.diagonal(whole))
    if not np.all(lengths > 0):
        raise Unusable("a state or a derivative is zero throughout the recording")
    trained = [whole - blocks[fold == f].sum(axis=0) for f in range(FOLDS)]
    unit = np.stack([*trained, whole]) / np.outer(lengths, lengths)
    *models, model = path(unit[:, :p, :p], unit[:, p:, :p])
    errors = []
    for f, c in enumerate(models):
        held_out = problem.held_out[fold == f].sum(axis=0) / np.outer(lengths, lengths)
        squares = np.einsum("mkp,mkp->mk", c @ held_out[:p, :p], c)
        cross = np.einsum("mkp,mp->mk", c, held_out[p:, :p])
        total = np.diagonal(held_out)[p:, np.newaxis]
        errors.append(np.maximum(total - 2 * cross + squares, ROUNDING * total))
    return Judged(model != 0, np.stack(errors) * lengths[p:, np.newaxis] ** 2)
