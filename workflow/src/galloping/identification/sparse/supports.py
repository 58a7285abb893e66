"""Thresholds from the data alone: sequential thresholding along a path, selected by EBIC."""

import numpy as np

MIN_TERM_SHARE = 1e-4  # least share of a term in a state derivative: no sensor resolves less
# Least remainder of a unit column's square after other columns explain it. Less is rounding.
MIN_REMAINDER = 1e-12


def threshold_path(length: int) -> np.ndarray:
    """Return `length` thresholds in geometric sequence, relative to the largest coefficient.

    They are below 1, at which rounding would decide whether the only term of an equation stays.
    """
    return np.geomspace(MIN_TERM_SHARE, 1 - MIN_TERM_SHARE, length)


def ebic(
    rss: np.ndarray, terms: np.ndarray, observations: np.ndarray | int, candidates: int
) -> np.ndarray:
    """Compute the extended Bayesian information criterion (EBIC) of least-squares fits.

    Its parameter gamma is 1 (Chen and Chen 2008). rss: residual sums of squares, terms: numbers of
    terms, of `candidates` in the library.
    """
    rss = np.maximum(rss, np.finfo(float).tiny)
    return observations * np.log(rss) + terms * (np.log(observations) + 2 * np.log(candidates))


def solve(gram: np.ndarray, moments: np.ndarray, supports: np.ndarray) -> np.ndarray:
    """Solve least-squares normal equations for many sets of terms (supports) at once.

    gram: (..., p, p) of columns of similar length; moments: (..., m, p); supports: (..., m, k, p)
    boolean. Returns (..., m, k, p) coefficients, zero off the support.
    """
    targets = np.repeat(np.arange(np.prod(supports.shape[:-2])), supports.shape[-2])
    flat = supports.reshape(-1, supports.shape[-1])
    return _solve(gram, moments, targets, flat).reshape(supports.shape)


def _solve(
    gram: np.ndarray, moments: np.ndarray, targets: np.ndarray, supports: np.ndarray
) -> np.ndarray:
    """Solve as `solve` for supports (n, p), each of one target; targets: (n,) indices."""
    # neighbouring thresholds mostly have the same support: each is solved once
    keys = np.column_stack([targets, np.packbits(supports, axis=1)])
    _, first, where = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    targets, supports = targets[first], supports[first]
    size = int(supports.sum(axis=1).max())
    terms = np.argsort(~supports, axis=1, kind="stable")[:, :size]  # those of the support first
    masks = np.take_along_axis(supports, terms, axis=1).astype(float)
    problems = (targets // moments.shape[-2])[:, np.newaxis, np.newaxis]
    grams = gram.reshape(-1, *gram.shape[-2:])
    systems = grams[problems, terms[:, :, np.newaxis], terms[:, np.newaxis]]
    systems *= masks[:, :, np.newaxis] * masks[:, np.newaxis]
    diagonal = np.arange(size)
    systems[:, diagonal, diagonal] += 1 - masks
    right = moments.reshape(-1, moments.shape[-1])[targets[:, np.newaxis], terms] * masks
    coefficients = np.zeros(supports.shape)
    solved = np.linalg.solve(systems, right[..., np.newaxis])[..., 0]
    np.put_along_axis(coefficients, terms, solved, axis=1)
    return coefficients[where.ravel()]


def refit(library: np.ndarray, targets: np.ndarray, supports: np.ndarray) -> np.ndarray:
    """Fit targets by least squares on many sets of library columns (supports) at once.

    library: (rows, p), targets: (rows, m), else as `solve`.
    """
    return solve(library.T @ library, targets.T @ library, supports)


def thresholded_supports(
    gram: np.ndarray, moments: np.ndarray, thresholds: np.ndarray, weights: np.ndarray | float = 1
) -> np.ndarray:
    """Find the terms that remain after sequentially thresholded least squares.

    They are fixed points of the iteration (Brunton et al. 2016). gram (..., p, p) and moments (...,
    m, p) as in `solve`, a ridge on the diagonal if there is one. thresholds: (m, k), or (k,) for
    all targets; weights: (p,), a term stays while |coefficient| * weight >= threshold. Returns
    (..., m, k, p) supports.
    """
    shape = (*moments.shape[:-1], thresholds.shape[-1])
    least = np.broadcast_to(thresholds, shape).reshape(-1, 1)
    targets = np.repeat(np.arange(np.prod(shape[:-1])), shape[-1])
    supports = np.ones((len(targets), moments.shape[-1]), dtype=bool)
    moving = np.arange(len(targets))
    while len(moving):
        previous_supports = supports[moving]
        coefficients = _solve(gram, moments, targets[moving], previous_supports)
        supports[moving] = previous_supports & (np.abs(coefficients) * weights >= least[moving])
        moving = moving[np.any(supports[moving] != previous_supports, axis=1)]
    return supports.reshape(*shape, -1)


def forward_models(grams: np.ndarray, moments: np.ndarray, steps: int) -> np.ndarray:
    """Fit models that grow by the most explanatory term, by orthogonal least squares (FROLS).

    The method is that of Billings 2013. grams: (f, p, p), moments: (f, m, p). Returns (f, m, steps
    + 1, p) least squares coefficients of 0 to `steps` terms, each with the term that explains most
    of the residual of its predecessor.
    """
    f, m, p = moments.shape
    models = np.zeros((f, m, steps + 1, p))
    is_taken = np.zeros((f, m, p), dtype=bool)
    lengths = np.repeat(np.diagonal(grams, axis1=1, axis2=2)[:, np.newaxis], m, axis=1)
    # what each term adds to those before: its inner products with all terms, and its combination
    terms = np.concatenate([grams, np.broadcast_to(np.eye(p), grams.shape)], axis=2)
    contributions = np.zeros((f, m, steps, 2 * p))
    rows, columns = np.ogrid[:f, :m]
    for step in range(steps):
        # a column that others explain, except for rounding, adds nothing
        gain = np.where(lengths > MIN_REMAINDER, moments**2 / np.maximum(lengths, MIN_REMAINDER), 0)
        gain[is_taken] = 0
        term_index = gain.argmax(axis=2)
        best = rows, columns, term_index
        size = np.sqrt(np.where(gain[best] > 0, lengths[best], np.inf))[..., np.newaxis]
        known = contributions[rows, columns, :, term_index][..., np.newaxis, :] @ contributions
        contributions[:, :, step] = (terms[rows, term_index] - known[..., 0, :]) / size
        unit, combination = np.split(contributions[:, :, step], 2, axis=-1)
        share = moments[best][..., np.newaxis] / size
        models[:, :, step + 1] = models[:, :, step] + share * combination
        moments, lengths = moments - share * unit, lengths - unit**2
        is_taken[best] = True
    return models


def ebic_scores(
    library: np.ndarray, targets: np.ndarray, supports: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """Compute the EBIC (Bayesian information criterion) of least-squares fits to sets of terms.

    supports: (m, k, p), k sets for each of m targets. Returns (m, k).
    """
    coefficients = refit(library, targets, supports)
    residuals = targets.T[:, np.newaxis, :] - coefficients @ library.T
    rss = np.sum(residuals**2, axis=-1)
    return ebic(rss, supports.sum(axis=-1), observations[:, np.newaxis], library.shape[1])


def best_threshold(thresholds: np.ndarray, supports: np.ndarray, place: int) -> float:
    """Return the geometric middle of the thresholds that select the same set of terms.

    The set is that of the threshold at the index `place`. thresholds: (k,), supports: (k, p). The
    middle, because at either end of the range a rounding error or a resampled row changes the
    support.
    """
    same = np.all(supports == supports[place], axis=1)
    return float(np.sqrt(thresholds[same].min() * thresholds[same].max()))
