"""One QR per recording: all that least squares can learn from it, in 39 rows instead of 30,001.

The rows of [Theta(X) | dX/dt] enter a regression only through their inner products, and an
orthogonal transformation keeps those. Identification therefore works on the triangular factor.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from galloping.identification.model import IdentifiedModel
from galloping.polynomial import Exponents, PolynomialModel

# Contiguous stretches of a recording that are reduced separately, for the bootstrap and for
# cross-validation.
BLOCKS = 10


@dataclass(frozen=True, eq=False)  # itself alone, so that what was made of it can be kept
class Regression:
    """A reduced regression dX/dt = Theta c.

    library: (rows, n_terms), targets: (rows, n_states), rows of the stacked block factors, each
    with as many rows as columns. observations: (n_states,) effective number of independent
    observations of each target. held_out: (blocks, n_terms + n_states, n_terms + n_states), inner
    products of [library | derivatives] in the weak form on each stretch, which judge what others
    teach; None where thresholds are chosen by an information criterion instead.
    states, terms: names of the targets' states, and the candidate library.
    """

    library: np.ndarray
    targets: np.ndarray
    observations: np.ndarray
    states: tuple[str, ...]
    terms: tuple[Exponents, ...]
    held_out: np.ndarray | None = None

    def model(
        self, coefficients: np.ndarray, thresholds: np.ndarray | None = None
    ) -> IdentifiedModel:
        """What a method makes of it: (n_states, n_terms) coefficients, without a verdict."""
        model = PolynomialModel(self.states, self.terms, coefficients)
        return IdentifiedModel(model, "unjudged", thresholds=thresholds)

    @property
    def products(self) -> np.ndarray:
        """Inner products of [library | targets] on each block, shaped as `held_out`."""
        factors = np.hstack([self.library, self.targets])
        factors = factors.reshape(-1, factors.shape[1], factors.shape[1])
        return factors.transpose(0, 2, 1) @ factors


def stretches(n: int) -> list[slice]:
    """The rows of each block: at most BLOCKS contiguous stretches of n rows."""
    edges = np.linspace(0, n, min(BLOCKS, n) + 1).astype(int)
    return [slice(a, b) for a, b in pairwise(edges)]


def regression(
    blocks: Iterable[tuple[np.ndarray, np.ndarray]],
    observations: np.ndarray,
    states: tuple[str, ...],
    terms: tuple[Exponents, ...],
) -> Regression:
    """Reduce blocks of rows, each a library (n, n_terms) and targets (n, n_states)."""
    libraries, targets = [], []
    for library, target in blocks:
        p = library.shape[1]
        factor = _triangle(np.column_stack([library, target]))
        libraries.append(factor[:, :p])
        targets.append(factor[:, p:])
    library, target = np.concatenate(libraries), np.concatenate(targets)
    return Regression(library, target, np.asarray(observations), states, terms)


def _triangle(rows: np.ndarray) -> np.ndarray:
    """R of the QR factorisation, square; in cache-sized panels first, three times faster."""
    columns = rows.shape[1]
    panel = 8 * columns
    whole = len(rows) // panel
    if whole > 1:
        tops = np.linalg.qr(rows[: whole * panel].reshape(whole, panel, columns), mode="r")
        rows = np.concatenate([tops.reshape(-1, columns), rows[whole * panel :]])
    factor = np.linalg.qr(rows, mode="r")
    return np.pad(factor, ((0, columns - len(factor)), (0, 0)))
