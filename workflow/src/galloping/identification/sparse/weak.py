"""Weak SINDy (Messenger and Bortz 2021; Reinbold et al. 2020) with pysindy's WeakPDELibrary."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pysindy as ps

from galloping.identification.model import IdentifiedModel
from galloping.identification.sparse.ensemble import seeded
from galloping.identification.sparse.reduction import regression, stretches
from galloping.identification.sparse.stlsq import normalised
from galloping.polynomial import library as polynomial_library
from galloping.recording import Recording


def weak(
    recordings: Sequence[Recording],
    *,
    degree: int,
    threshold: float | None,
    path_length: int,
    domains: int,
    half_width: float,
    order: int,
    seed: int,
) -> IdentifiedModel:
    """Integrates against polynomial bumps instead of differentiating, then STLSQ.

    `domains` bumps at random times, of `half_width` s and polynomial `order`; the same
    ones for every recording on one time grid, since their weights cost more than the fit.
    Raises ValueError for irregular or missing samples.
    """
    blocks = []
    for recording in recordings:
        if not recording.is_uniform:
            raise ValueError("weak: needs a regularly sampled recording")
        if not np.all(np.isfinite(recording.values)):
            raise ValueError("weak: needs every state at every sample")
        library = _bumps(tuple(recording.time), degree, domains, half_width, order, seed)
        library.fit([recording.values])
        theta = np.asarray(library.transform([recording.values])[0])
        integrals = np.asarray(library.convert_u_dot_integral(recording.values))
        blocks += [(theta[rows], integrals[rows]) for rows in stretches(len(theta))]
    rows = sum(len(theta) for theta, _ in blocks)
    states = recordings[0].states
    terms = polynomial_library(len(states), degree)
    problem = regression(blocks, np.full(len(states), rows), states, terms)
    return normalised(problem, threshold=threshold, path_length=path_length)


@lru_cache(maxsize=1)
def _bumps(time, degree, domains, half_width, order, seed) -> ps.WeakPDELibrary:
    """Weights of the test functions, which depend on the time grid alone."""
    with seeded(np.random.default_rng(seed)):
        return ps.WeakPDELibrary(
            function_library=ps.PolynomialLibrary(degree=degree),
            spatiotemporal_grid=np.array(time),
            K=domains,
            H_xt=half_width,
            p=order,
        )
