"""reconstructions/{case}/{protocol}/{cell}.npz: motions of the identified models, for figures."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, fields

import numpy as np

from galloping.evaluation.motion import Reconstruction
from galloping.storage import write_arrays


def write(path: str | os.PathLike, reconstructions: Mapping[str, Reconstruction]) -> None:
    """What the models of each method do, by its name."""
    write_arrays(
        path,
        **{
            f"{method}/{name}": values
            for method, reconstruction in reconstructions.items()
            for name, values in asdict(reconstruction).items()
        },
    )


def read(path: str | os.PathLike) -> dict[str, Reconstruction]:
    """Reconstructions by method."""
    names = [field.name for field in fields(Reconstruction)]
    with np.load(path) as file:
        methods = dict.fromkeys(key.partition("/")[0] for key in file)
        return {
            method: Reconstruction(*(file[f"{method}/{name}"] for name in names))
            for method in methods
        }
