"""identified/{case}/{protocol}/{cell}/{family}.npz: the models of a family of methods."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields

import numpy as np

from galloping.identification.result import Identified
from galloping.storage import write_arrays


def write(path: str | os.PathLike, models: Mapping[str, Sequence[Identified]]) -> None:
    """Replicates of one cell, by method."""
    write_arrays(
        path,
        **{
            f"{method}/{field.name}": np.array([getattr(model, field.name) for model in replicates])
            for method, replicates in models.items()
            for field in fields(Identified)
        },
    )


def read(path: str | os.PathLike) -> dict[str, list[Identified]]:
    """The model of each replicate, by method in the order of the study."""
    with np.load(path) as file:
        columns = {key: file[key] if file[key].ndim > 1 else file[key].tolist() for key in file}
    methods = dict.fromkeys(key.partition("/")[0] for key in columns)
    names = [field.name for field in fields(Identified)]
    return {
        method: [
            Identified(*parts)
            for parts in zip(*(columns[f"{method}/{name}"] for name in names), strict=True)
        ]
        for method in methods
    }
