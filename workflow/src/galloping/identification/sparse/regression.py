"""Reduction of a recording to one QR factor: all that least squares needs, in few rows.

The rows of [Theta(X) | dX/dt] enter a regression only through their inner products, which an
orthogonal transformation preserves. Identification therefore works on the triangular factor, with
39 rows instead of 30,001.

Fits to some stretches of a recording are validated on the others, in the weak form of the raw
samples: the prediction of a held-out stretch, int phi Theta(x) c, is compared with -int phi' y,
which is unsmoothed, so that its noise has zero mean and is the same for all filters.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from galloping.identification.findings import Code
from galloping.identification.identified_model import NO_ARRAY, IdentifiedModel
from galloping.identification.no_model import IdentificationError
from galloping.model.polynomial import Exponents, PolynomialModel

BLOCKS = 10  # number of blocks of a recording, for bootstrap and cross-validation
FOLDS = 5  # number of folds; every fifth block is left out, so that each has early and late ones
ROUNDING = 1e-13  # largest rounding error of a difference of two sums of squares, relative
Path = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From Gram matrices (f, p, p) of unit columns and moments (f, m, p) to models (f, m, k, p)."""


@dataclass(frozen=True, eq=False)  # compared by identity, so that results can be cached
class ReducedRegression:
    """Regression of state derivatives on library terms, reduced by QR to few equivalent rows.

    The equations are dX/dt = Theta c. library: (rows, n_terms), targets: (rows, n_states), rows of
    the stacked block factors, each with as many rows as columns. observations: (n_states,)
    effective number of independent observations of each target. held_out: (blocks, n_terms +
    n_states, n_terms + n_states), inner products of [library | derivatives] in the weak form on
    each stretch, which validate fits to the others; None if thresholds are chosen by an information
    criterion instead. states, terms: names of the targets' states, and the candidate library.
    """

    library: np.ndarray
    targets: np.ndarray
    observations: np.ndarray
    states: tuple[str, ...]
    terms: tuple[Exponents, ...]
    held_out: np.ndarray | None = None

    def model(self, coefficients: np.ndarray, thresholds: np.ndarray = NO_ARRAY) -> IdentifiedModel:
        """Make the model, with the status `unjudged`, of coefficients (n_states, n_terms)."""
        model = PolynomialModel(self.states, self.terms, coefficients)
        return IdentifiedModel(model, thresholds=thresholds)

    @property
    def products(self) -> np.ndarray:
        """Inner products of library and target columns of each block, shaped as `held_out`."""
        factors = np.hstack([self.library, self.targets])
        factors = factors.reshape(-1, factors.shape[1], factors.shape[1])
        return factors.mT @ factors

    @property
    def triangle(self) -> tuple[np.ndarray, np.ndarray]:
        """Library and targets as columns of one triangular QR factor of all rows.

        Shapes (p + m, p) and (p + m, m), of p terms and m states. Raises IdentificationError if a
        column is zero.
        """
        triangle = np.linalg.qr(np.hstack([self.library, self.targets]), mode="r")
        check_nonzero(np.linalg.norm(triangle, axis=0))
        library, targets = np.hsplit(triangle, [len(self.terms)])
        return library, targets


def check_nonzero(lengths: np.ndarray) -> np.ndarray:
    """Return the column lengths unchanged, or raise IdentificationError if a length is zero."""
    if not np.all(lengths > 0):
        raise IdentificationError(Code.STATE_ZERO)
    return lengths


class Scaled:
    """Library and target columns of a regression, scaled to unit length.

    library (rows, p) and targets (rows, m) are the columns over their `lengths` (p,) and `scale`
    (m,). Raises IdentificationError if a column is zero.
    """

    def __init__(self, library: np.ndarray, targets: np.ndarray) -> None:
        self.lengths = check_nonzero(np.linalg.norm(library, axis=0))
        self.scale = check_nonzero(np.linalg.norm(targets, axis=0))
        self.library, self.targets = library / self.lengths, targets / self.scale

    def unscale(self, shares: np.ndarray) -> np.ndarray:
        """Convert coefficients (m, p) of scaled columns to coefficients of original columns."""
        return shares * self.scale[:, np.newaxis] / self.lengths


def block_slices(n: int) -> list[slice]:
    """Divide n rows into contiguous slices of nearly equal length, at most BLOCKS of them."""
    edges = np.linspace(0, n, min(BLOCKS, n) + 1).astype(int)
    return [slice(a, b) for a, b in pairwise(edges)]


def reduce_blocks(
    blocks: Iterable[tuple[np.ndarray, np.ndarray]],
    observations: np.ndarray,
    states: tuple[str, ...],
    terms: tuple[Exponents, ...],
    held_out: np.ndarray | None = None,
) -> ReducedRegression:
    """Reduce each block of regression rows to a triangular QR factor, and stack the factors.

    A block is a library (n, n_terms) and targets (n, n_states).
    """
    factors = np.concatenate([_triangular_factor(np.column_stack(block)) for block in blocks])
    library, targets = map(np.ascontiguousarray, np.hsplit(factors, [len(terms)]))
    return ReducedRegression(library, targets, observations, states, terms, held_out)


def _triangular_factor(rows: np.ndarray) -> np.ndarray:
    """Compute R of the QR factorisation, square; cache-sized panels make it three times faster."""
    columns = rows.shape[1]
    panel = 8 * columns
    whole = len(rows) // panel
    if whole > 1:
        tops = np.linalg.qr(rows[: whole * panel].reshape(whole, panel, columns), mode="r")
        tops = tops.reshape(-1, columns)  # type: ignore[attr-defined]  # the stubs know no mode r
        rows = np.concatenate([tops, rows[whole * panel :]])
    factor = np.linalg.qr(rows, mode="r")
    return np.pad(factor, ((0, columns - len(factor)), (0, 0)))


@dataclass(frozen=True)
class HeldOutErrors:
    """Cross-validation errors of candidate models, and the terms that each model contains.

    The models along a path are fitted to all stretches; the errors are of the same fits on held-out
    stretches. supports: (m, k, p) of the m state derivatives. errors: (FOLDS, m, k) squared errors
    on held-out stretches.
    """

    supports: np.ndarray
    errors: np.ndarray

    @property
    def best(self) -> np.ndarray:
        """Lowest cross-validation error of the models of each state derivative, (m,)."""
        return self.errors.sum(axis=0).min(axis=1)

    def choose_sparsest(self) -> np.ndarray:
        """Choose a model for each state derivative by the one-standard-error rule.

        Returns its index on the path, (m,). It is the sparsest of all within one standard error of
        the best (Breiman et al. 1984).
        """
        total, sizes = self.errors.sum(axis=0), self.supports.sum(axis=2)
        rows = np.arange(len(total))
        best = total.argmin(axis=1)
        excess = self.errors - self.errors[:, rows, best][..., np.newaxis]
        error = np.sqrt(len(excess)) * excess.std(axis=0, ddof=1)
        near = excess.sum(axis=0) <= error
        sizes = np.where(near, sizes, sizes.max() + 1)
        return np.array([np.lexsort(keys)[0] for keys in zip(total, sizes, strict=True)])


def judge_path(
    products: np.ndarray, held_out: np.ndarray, n_states: int, path: Path
) -> HeldOutErrors:
    """Compute the cross-validation errors of the candidate models that a method generates.

    products, held_out: those of a `ReducedRegression`. path: of the method.
    """
    p = products.shape[1] - n_states
    fold = np.arange(len(products)) % FOLDS
    whole = products.sum(axis=0)
    scale = check_nonzero(np.sqrt(np.diagonal(whole)))
    unit = np.outer(scale, scale)
    trained = [whole - products[fold == f].sum(axis=0) for f in range(FOLDS)]
    scaled = np.stack([*trained, whole]) / unit
    *models, model = path(scaled[:, :p, :p], scaled[:, p:, :p])
    errors = []
    for f, c in enumerate(models):
        other = held_out[fold == f].sum(axis=0) / unit
        squares = np.einsum("mkp,mkp->mk", c @ other[:p, :p], c)
        cross = np.einsum("mkp,mp->mk", c, other[p:, :p])
        total = np.diagonal(other)[p:, np.newaxis]
        errors.append(np.maximum(total - 2 * cross + squares, ROUNDING * total))
    return HeldOutErrors(model != 0, np.stack(errors) * scale[p:, np.newaxis] ** 2)
