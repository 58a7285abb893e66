"""Thresholds from the data alone: sequential thresholding along a path, judged by EBIC."""

from __future__ import annotations

import numpy as np

from galloping.identification.reduction import Regression

# A term that moves its state derivative by less than this share is beyond any sensor.
NEGLIGIBLE = 1e-4


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


def refit(library: np.ndarray, targets: np.ndarray, supports: np.ndarray) -> np.ndarray:
    """Least squares on many supports at once.

    library: (rows, p), columns of similar length; targets: (rows, m); supports: (m, k, p)
    boolean. Returns (m, k, p) coefficients, zero off the support.
    """
    masks = supports.astype(float)
    gram, moment = library.T @ library, library.T @ targets
    systems = gram * masks[..., :, np.newaxis] * masks[..., np.newaxis, :]
    diagonal = np.arange(gram.shape[0])
    systems[..., diagonal, diagonal] += 1 - masks
    right = moment.T[:, np.newaxis, :] * masks
    return np.linalg.solve(systems, right[..., np.newaxis])[..., 0]


def thresholded_supports(
    library: np.ndarray, targets: np.ndarray, thresholds: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Fixed points of sequentially thresholded least squares (Brunton et al. 2016).

    thresholds: (m, k) for the m targets; weights: (p,), a term stays while
    |coefficient| * weight >= threshold. Returns (m, k, p) supports.
    """
    (m, k), p = thresholds.shape, library.shape[1]
    supports = np.ones((m, k, p), dtype=bool)
    moving = np.ones((m, k), dtype=bool)
    while np.any(moving):
        rows, columns = np.nonzero(moving)
        keys = np.column_stack([rows, supports[rows, columns]])
        distinct, where = np.unique(keys, axis=0, return_inverse=True)
        solved = np.empty((len(distinct), p))
        for target in range(m):
            mine = distinct[:, 0] == target
            if np.any(mine):
                solved[mine] = refit(
                    library, targets[:, [target]], distinct[np.newaxis, mine, 1:].astype(bool)
                )[0]
        coefficients = solved[where.ravel()]
        kept = np.abs(coefficients) * weights >= thresholds[rows, columns][:, np.newaxis]
        kept &= supports[rows, columns]
        moving[rows, columns] = np.any(kept != supports[rows, columns], axis=1)
        supports[rows, columns] = kept
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


def best_threshold(thresholds: np.ndarray, supports: np.ndarray, score: np.ndarray) -> float:
    """Geometric middle of the thresholds whose support is the one with the lowest score.

    thresholds: (k,), supports: (k, p), score: (k,). The middle, because at either end of the
    range a rounding error or a resampled row changes the support.
    """
    same = np.all(supports == supports[np.argmin(score)], axis=1)
    return float(np.sqrt(thresholds[same].min() * thresholds[same].max()))
