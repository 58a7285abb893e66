"""All replicates of one cell through one method; a fit that fails is a row with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module

import numpy as np

from galloping.identification.registry import BY_NAME
from galloping.identification.result import Identified
from galloping.seeds import generator


def identify(
    method: str,
    evidence: Sequence,
    *,
    settings: Mapping,
    seed: int,
    name: Sequence[str],
    shape: tuple[int, int],
) -> list[Identified]:
    """Identify a model from each replicate.

    evidence: what the method asks for (see `registry`), one item a replicate. settings: the
    options of the method. seed, name: of its random numbers. shape: (n_states, n_terms).
    """
    described = BY_NAME[method]
    module, _, function = described.function.partition(":")
    fit = getattr(import_module(module), function)
    results = []
    for replicate, item in enumerate(evidence):
        available = {**settings, "rng": generator(seed, "identification", *name, method, replicate)}
        options = {key: available[key] for key in described.options}
        try:
            results.append(fit(item, **options))
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
            results.append(Identified.failed(*shape, f"{method}: {str(error).splitlines()[0]}"))
    return results
