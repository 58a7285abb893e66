"""Weak SINDy (Messenger and Bortz 2021; Reinbold et al. 2020) with pysindy's WeakPDELibrary."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pysindy as ps

from galloping.identification.ensemble import seeded
from galloping.identification.reduction import regression
from galloping.identification.result import Identified
from galloping.identification.stlsq import normalised
from galloping.recording import Recording


def weak(
    recordings: tuple[Recording, ...],
    degree: int,
    threshold: float | None,
    path_length: int,
    *,
    domains: int,
    half_width: float,
    order: int,
    rng: np.random.Generator,
) -> Iterator[Identified]:
    """Integrates against polynomial bumps instead of differentiating, then STLSQ.

    recordings: replicates on one regular time grid. domains: number of bumps, at random times;
    half_width: their half width in s; order: their polynomial order. The bumps' weights depend
    on the grid alone and are computed once for all replicates.
    """
    first = recordings[0]
    if not first.is_uniform:
        raise ValueError("weak: needs a regularly sampled recording")
    with seeded(rng):
        library = ps.WeakPDELibrary(
            function_library=ps.PolynomialLibrary(degree=degree),
            spatiotemporal_grid=first.time,
            K=domains,
            H_xt=half_width,
            p=order,
        )
    library.fit([first.values])
    for recording in recordings:
        theta = np.asarray(library.transform([recording.values])[0])
        integrals = np.asarray(library.convert_u_dot_integral(recording.values))
        problem = regression(theta, integrals, np.full(integrals.shape[1], domains))
        yield normalised(problem, threshold, path_length)
