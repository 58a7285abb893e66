"""All replicates of one cell through one method; a fit that fails is a row with its reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module

import numpy as np

from galloping.identification.model import IdentifiedModel
from galloping.polynomial import Exponents
from galloping.seeds import generator


def imported(path: str) -> Callable:
    """The function `module:function`, imported only now: see `registry`."""
    module, _, function = path.partition(":")
    return getattr(import_module(module), function)


def identify(
    fit: Callable[..., IdentifiedModel],
    evidence: Sequence,
    *,
    options: Mapping,
    seed: int | None,
    name: Sequence[str],
    states: tuple[str, ...],
    terms: tuple[Exponents, ...],
) -> list[IdentifiedModel]:
    """Identify a model from each replicate.

    evidence: what `fit` takes, one item a replicate. options: further keywords of `fit`. seed: of
    its random numbers, the keyword `rng`, or None if it draws none. name: of what is identified,
    the method last. states, terms: of the models.
    """
    results = []
    for replicate, item in enumerate(evidence):
        rng = {}
        if seed is not None:
            rng["rng"] = generator(seed, "identification", *name, replicate)
        try:
            results.append(fit(item, **options, **rng))
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
            reason = f"{name[-1]}: {str(error).splitlines()[0]}"
            results.append(IdentifiedModel.refused(states, terms, reason))
    return results
