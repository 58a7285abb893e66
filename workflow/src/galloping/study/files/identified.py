"""identified/{case}/{protocol}/{cell}/{family}.npz: the models of a family of methods."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import numpy as np

from galloping.identification.model import BY_TERM, IdentifiedModel
from galloping.polynomial import PolynomialModel
from galloping.storage import write_arrays

STACKED = (*BY_TERM, "thresholds", "chi2", "status", "reason")


def write(path: str | os.PathLike, models: Mapping[str, Sequence[IdentifiedModel]]) -> None:
    """Replicates of one cell, by method; what belongs to single recordings is left out."""
    arrays = {}
    for method, replicates in models.items():
        model = replicates[0].model
        states = np.arange(len(model.states))
        columns = {
            "states": np.array(model.states),
            "terms": np.array(model.terms),
            "coefficients": np.stack([each.model.coefficients for each in replicates]),
            "known": np.stack([np.isin(states, each.known) for each in replicates]),
            **{name: np.array([getattr(each, name) for each in replicates]) for name in STACKED},
        }
        arrays |= {f"{method}/{name}": column for name, column in columns.items()}
    write_arrays(path, **arrays)


def read(path: str | os.PathLike) -> dict[str, list[IdentifiedModel]]:
    """The model of each replicate, by method in the order of the study."""
    columns: dict[str, dict[str, np.ndarray]] = {}
    with np.load(path) as file:
        for key in file:
            method, _, name = key.partition("/")
            columns.setdefault(method, {})[name] = file[key]
    return {method: _models(arrays) for method, arrays in columns.items()}


def _models(arrays: dict[str, np.ndarray]) -> list[IdentifiedModel]:
    states = tuple(arrays["states"].tolist())
    terms = tuple(map(tuple, arrays["terms"].tolist()))
    return [
        IdentifiedModel(
            model=PolynomialModel(states, terms, coefficients),
            status=str(arrays["status"][k]),
            reason=str(arrays["reason"][k]),
            chi2=float(arrays["chi2"][k]),
            known=tuple(np.flatnonzero(arrays["known"][k]).tolist()),
            **{name: arrays[name][k] for name in (*BY_TERM, "thresholds")},
        )
        for k, coefficients in enumerate(arrays["coefficients"])
    ]
