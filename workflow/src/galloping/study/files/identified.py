"""identified/{case}/{protocol}/{cell}/{family}.npz: the models of a family of methods."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import numpy as np

from galloping.identification.model import BY_TERM, IdentifiedModel
from galloping.polynomial import PolynomialModel
from galloping.storage import write_arrays

BY_STATE = (*BY_TERM, "thresholds")  # and by term, or not
TEXTS = ("status", "reason")


def write(path: str | os.PathLike, models: Mapping[str, Sequence[IdentifiedModel]]) -> None:
    """Replicates of one cell by method; what belongs to single recordings is left out."""
    first = next(iter(models.values()))[0].model
    arrays = {"states": np.array(first.states), "terms": np.array(first.terms)}
    for method, replicates in models.items():
        columns = {name: [getattr(r, name) for r in replicates] for name in (*BY_STATE, *TEXTS)}
        columns["coefficients"] = [r.model.coefficients for r in replicates]
        columns["chi2"] = [r.chi2 for r in replicates]
        columns["covariance"] = _padded([r.covariance for r in replicates])
        columns["known"] = [np.isin(np.arange(len(first.states)), r.known) for r in replicates]
        arrays |= {f"{method}/{name}": np.array(column) for name, column in columns.items()}
    write_arrays(path, **arrays)


def read(path: str | os.PathLike) -> dict[str, list[IdentifiedModel]]:
    """The model of each replicate, by method in the order of the study."""
    with np.load(path) as file:
        arrays = dict(file)
    states = tuple(arrays.pop("states").tolist())
    terms = tuple(map(tuple, arrays.pop("terms").tolist()))

    def model(method: str, replicate: int) -> IdentifiedModel:
        part = {
            name: arrays[f"{method}/{name}"][replicate]
            for name in (*BY_STATE, *TEXTS, "coefficients", "chi2", "known", "covariance")
        }
        return IdentifiedModel(
            model=PolynomialModel(states, terms, part["coefficients"]),
            chi2=float(part["chi2"]),
            known=tuple(np.flatnonzero(part["known"]).tolist()),
            covariance=_stated(part["covariance"]),
            **{name: part[name] for name in BY_STATE},
            **{name: str(part[name]) for name in TEXTS},
        )

    methods = dict.fromkeys(name.partition("/")[0] for name in arrays)
    return {
        method: [model(method, k) for k in range(len(arrays[f"{method}/status"]))]
        for method in methods
    }


def _padded(covariances: Sequence[np.ndarray]) -> np.ndarray:
    """(n_replicates, n, n) with the largest n, NaN beyond the own size of each."""
    size = max(len(each) for each in covariances)
    padded = np.full((len(covariances), size, size), np.nan)
    for k, each in enumerate(covariances):
        padded[k, : len(each), : len(each)] = each
    return padded


def _stated(padded: np.ndarray) -> np.ndarray:
    size = int(np.isfinite(np.diag(padded)).sum())
    return padded[:size, :size]
