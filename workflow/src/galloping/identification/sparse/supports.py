"""Thresholds from the data alone: sequential thresholding along a path, judged by EBIC."""

from __future__ import annotations

import numpy as np

from galloping.identification.sparse.regression import Regression

# A term that moves its state derivative by less than this share is beyond any sensor.
NEGLIGIBLE = 1e-4
COLLINEAR = 1e-12  # of a unit column's square: what rounding leaves of one that others make up


def threshold_path(length: int) -> np.ndarray:
    """(length,) thresholds to try, in equal ratios, as shares of the largest coefficient."""
    return np.geomspace(NEGLIGIBLE, 1, length)


def ebic(rss: np.ndarray, terms: np.ndarray, observations: int, candidates: int) -> np.ndarray:
    """Extended Bayesian information criterion with gamma = 1 (Chen and Chen 2008).

    rss: residual sums of squares, terms: numbers of terms, of `candidates` in the library.
    """
    rss = np.maximum(rss, np.finfo(float).tiny)
    return observations * np.log(rss) + terms * (np.log(observations) + 2 * np.log(candidates))


def compact(problem: Regression) -> tuple[np.ndarray, np.ndarray]:
    """Library and targets as the rows of one triangle, (p + m, p) and (p + m, m).

    Raises ValueError where a column has no length to scale it by.
    """
    p = problem.library.shape[1]
    triangle = np.linalg.qr(np.hstack([problem.library, problem.targets]), mode="r")
    if not np.all(np.linalg.norm(triangle, axis=0) > 0):
        raise ValueError("a state or a derivative is zero throughout the recording")
    return triangle[:, :p], triangle[:, p:]


def solve(gram: np.ndarray, moments: np.ndarray, supports: np.ndarray) -> np.ndarray:
    """Normal equations on many supports at once.

    gram: (p, p) of columns of similar length; moments: (m, p); supports: (m, k, p) boolean.
    Returns (m, k, p) coefficients, zero off the support.
    """
    size = int(supports.sum(axis=-1).max())
    terms = np.argsort(~supports, axis=-1, kind="stable")[..., :size]  # those of the support first
    masks = np.take_along_axis(supports, terms, axis=-1).astype(float)
    systems = gram[terms[..., :, np.newaxis], terms[..., np.newaxis, :]]
    systems *= masks[..., :, np.newaxis] * masks[..., np.newaxis, :]
    diagonal = np.arange(size)
    systems[..., diagonal, diagonal] += 1 - masks
    right = moments[np.arange(len(moments))[:, np.newaxis, np.newaxis], terms] * masks
    coefficients = np.zeros(supports.shape)
    solved = np.linalg.solve(systems, right[..., np.newaxis])[..., 0]
    np.put_along_axis(coefficients, terms, solved, axis=-1)
    return coefficients


def refit(library: np.ndarray, targets: np.ndarray, supports: np.ndarray) -> np.ndarray:
    """Least squares on many supports: library (rows, p), targets (rows, m), else as `solve`."""
    return solve(library.T @ library, targets.T @ library, supports)


def thresholded_supports(
    gram: np.ndarray, moments: np.ndarray, thresholds: np.ndarray, weights: np.ndarray | float = 1
) -> np.ndarray:
    """Fixed points of sequentially thresholded least squares (Brunton et al. 2016).

    gram (p, p) and moments (m, p) as in `solve`, a ridge on the diagonal if there is one.
    thresholds: (m, k); weights: (p,), a term stays while |coefficient| * weight >= threshold.
    Returns (m, k, p) supports.
    """
    (m, k), p = thresholds.shape, len(gram)
    supports = np.ones((m, k, p), dtype=bool)
    moving = np.ones((m, k), dtype=bool)
    while np.any(moving):
        rows, columns = np.nonzero(moving)
        # neighbouring thresholds mostly have the same support: each is solved once
        keys = np.column_stack([rows, np.packbits(supports[rows, columns], axis=1)])
        _, first, where = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        distinct = supports[rows[first], columns[first]][:, np.newaxis]
        coefficients = solve(gram, moments[rows[first]], distinct)[where.ravel(), 0]
        kept = np.abs(coefficients) * weights >= thresholds[rows, columns][:, np.newaxis]
        kept &= supports[rows, columns]
        moving[rows, columns] = np.any(kept != supports[rows, columns], axis=1)
        supports[rows, columns] = kept
    return supports


def forward_supports(grams: np.ndarray, moments: np.ndarray, steps: int) -> np.ndarray:
    """Forward regression by orthogonal least squares (FROLS; Billings 2013): greedy supports.

    grams: (f, p, p), moments: (f, m, p). Returns (f, m, steps + 1, p), of 0 to `steps` terms, each
    with the term that takes most from what its predecessor leaves.
    """
    f, m, p = moments.shape
    left = np.repeat(grams[:, np.newaxis], m, axis=1)
    moments = moments.copy()
    supports = np.zeros((f, m, steps + 1, p), dtype=bool)
    rows = np.ogrid[:f, :m]
    for step in range(1, steps + 1):
        lengths = np.diagonal(left, axis1=2, axis2=3)
        # a column that others explain but for rounding has nothing to add
        gain = np.where(lengths > COLLINEAR, moments**2 / np.maximum(lengths, COLLINEAR), -1)
        gain[supports[:, :, step - 1]] = -1
        best = gain.argmax(axis=2)
        supports[:, :, step] = supports[:, :, step - 1]
        supports[(*rows, step, best)] = True
        unit = left[(*rows, slice(None), best)]
        unit = unit / np.sqrt(np.maximum(lengths[(*rows, best)], COLLINEAR))[..., np.newaxis]
        moments = (
            moments
            - unit
            * (moments[(*rows, best)] / np.sqrt(np.maximum(lengths[(*rows, best)], COLLINEAR)))[
                ..., np.newaxis
            ]
        )
        left = left - unit[..., :, np.newaxis] * unit[..., np.newaxis, :]
    return supports


def scores(
    library: np.ndarray, targets: np.ndarray, supports: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """EBIC of supports (m, k, p) of the m targets: (m, k)."""
    coefficients = refit(library, targets, supports)
    residuals = targets.T[:, np.newaxis, :] - coefficients @ library.T
    rss = np.sum(residuals**2, axis=-1)
    sizes = supports.sum(axis=-1)
    return np.stack(
        [ebic(r, k, n, library.shape[1]) for r, k, n in zip(rss, sizes, observations, strict=True)]
    )


def best_threshold(thresholds: np.ndarray, supports: np.ndarray, place: int) -> float:
    """Geometric middle of the thresholds that give the same support as the one at `place`.

    thresholds: (k,), supports: (k, p). The middle, because at either end of the range a rounding
    error or a resampled row changes the support.
    """
    same = np.all(supports == supports[place], axis=1)
    return float(np.sqrt(thresholds[same].min() * thresholds[same].max()))
