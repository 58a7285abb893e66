"""Writers and readers of every kind of file of a study.

`read` recognises a kind by the file's folder, which `workflow/rules` defines.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from os import PathLike
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from galloping.identification.identified_model import IdentifiedModel
from galloping.model.polynomial import PolynomialModel
from galloping.recording.samples import Recording
from galloping.results import Derived, Motion, Reconstruction
from galloping.storage import read_json, write_arrays, write_json, write_rows

if TYPE_CHECKING:
    import pandas as pd

CHANNELS = ("time", "values", "rates")  # arrays of a recording


def read(path: str | os.PathLike) -> object:
    """Read a result file with the reader for its folder; raise ValueError for an unknown kind."""
    for pattern, reader in READERS.items():
        if PurePath(path).match(pattern):
            return reader(path)
    raise ValueError(f"{path}: is of no kind that a study has; must be {', '.join(READERS)}")


def read_all(
    files: Mapping[str, str | PathLike | Sequence], names: Mapping[str, Sequence[str]]
) -> dict:
    """Read files into a dict by key; the files of one key into a dict with their `names`."""
    return {
        key: read(paths)
        if isinstance(paths, str | PathLike)
        else dict(zip(names[key], map(read, paths), strict=True))
        for key, paths in files.items()
    }


# --- tables: scores, sweeps, assessments, tables/{table}.csv ---


def write_table(path: str | os.PathLike, table: pd.DataFrame) -> None:
    """Write a table to a CSV file, with ten significant digits per number."""
    write_rows(path, table.to_dict("records"), list(table))


def read_table(path: str | os.PathLike) -> pd.DataFrame:
    """Read a CSV table of a study as a DataFrame."""
    import pandas as pd  # here: most jobs read no table

    return pd.read_csv(path)


def read_as_written(path: str | os.PathLike) -> pd.DataFrame:
    """Read a CSV table with all cells as text, so that an empty cell is not the word 'nan'."""
    import pandas as pd

    return pd.read_csv(path, dtype=str, keep_default_na=False)


# --- models/{case}.json: the true equations and derived quantities of a line ---


def write_model(path: str | os.PathLike, derived: Derived) -> None:
    """Write the equations and derived quantities of an overhead line to JSON, without rounding."""
    true = derived.model
    model = {"states": true.states, "terms": true.terms, "coefficients": true.coefficients.tolist()}
    content = {**derived.quantities, "coefficients": dict(derived.coefficients), "model": model}
    write_json(path, content)


def read_model(path: str | os.PathLike) -> Derived:
    """Read the equations, coefficients and derived quantities of an overhead line from a file."""
    content = read_json(path)
    model = content.pop("model")
    equations = PolynomialModel(
        tuple(model["states"]), tuple(map(tuple, model["terms"])), np.array(model["coefficients"])
    )
    return Derived(equations, content.pop("coefficients"), content)


# --- trajectories/{case}.npz: the true motion of a line after each of its releases ---


def write_trajectories(path: str | os.PathLike, motions: Sequence[Motion]) -> None:
    """Write simulated motions of one system on a common time grid to a file."""
    write_arrays(
        path,
        names=np.array(motions[0].names),
        time=motions[0].time,
        states=np.stack([motion.states for motion in motions]),
        rates=np.stack([motion.rates for motion in motions]),
        status=np.array([motion.status for motion in motions]),
    )


def read_trajectories(path: str | os.PathLike) -> tuple[Motion, ...]:
    """Read the motions of a line, one for each initial displacement, the assessed one first."""
    with np.load(path) as file:
        names, time = tuple(map(str, file["names"])), file["time"]
        motions = zip(file["states"], file["rates"], file["status"].tolist(), strict=True)
        return tuple(Motion(names, time, *motion) for motion in motions)


# --- recordings/{case}/{protocol}/{cell}.npz: the recordings of a cell ---


def write_recordings(path: str | os.PathLike, replicates: Sequence[Sequence[Recording]]) -> None:
    """Write recordings by realisation and displacement; arrays that all share are stored once."""
    arrays: dict[str, np.ndarray] = {
        "states": np.array(replicates[0][0].states),
        "shape": np.array([len(replicates), len(replicates[0])]),
        "exact": np.array(replicates[0][0].exact),
    }
    for release, copies in enumerate(zip(*replicates, strict=True)):
        for channel in CHANNELS:
            if getattr(copies[0], channel) is not None:
                arrays[f"{channel}_{release}"] = _stack_replicates(
                    [getattr(c, channel) for c in copies]
                )
    write_arrays(path, **arrays)


def read_recordings(path: str | os.PathLike) -> list[tuple[Recording, ...]]:
    """Read recordings: for each noise realisation, a tuple over the initial displacements."""
    with np.load(path) as file:
        arrays = dict(file)
    states = tuple(map(str, arrays.pop("states")))
    replicates, releases = arrays.pop("shape")
    exact = bool(arrays.pop("exact"))

    def recording(replicate: int, release: int) -> Recording:
        channels = {
            channel: arrays[key][replicate % len(arrays[key])]
            for channel in CHANNELS
            if (key := f"{channel}_{release}") in arrays
        }
        return Recording(states=states, exact=exact, **channels)

    return [tuple(recording(r, i) for i in range(releases)) for r in range(replicates)]


def _stack_replicates(arrays: list[np.ndarray]) -> np.ndarray:
    """Stack the arrays of all realisations, or one if all are equal."""
    shared = all(np.array_equal(arrays[0], a, equal_nan=True) for a in arrays[1:])
    return arrays[0][np.newaxis] if shared else np.stack(arrays)


# --- identified/{case}/{protocol}/{cell}/{family}.json: the models of a family of methods ---


def write_identified(
    path: str | os.PathLike, models: Mapping[str, Sequence[IdentifiedModel]]
) -> None:
    """Write the models of several methods, by method: one for each noise realisation."""
    content = {method: [model.to_plain() for model in fits] for method, fits in models.items()}
    write_json(path, content, indent=None)


def read_identified(path: str | os.PathLike) -> dict[str, list[IdentifiedModel]]:
    """Read identified models from a file: by method, a list over the noise realisations."""
    content = read_json(path)
    return {method: list(map(IdentifiedModel.from_plain, fits)) for method, fits in content.items()}


def read_families(paths: Iterable[str | os.PathLike]) -> dict[str, list[IdentifiedModel]]:
    """Read the models in files of several families of methods into one dict, by method."""
    return {method: fits for path in paths for method, fits in read_identified(path).items()}


# --- bounds/{case}/{protocol}/{cell}.npz: the Cramer-Rao bound of a cell ---


def write_bounds(path: str | os.PathLike, deviations: np.ndarray) -> None:
    """Write the Cramér-Rao standard deviation of each coefficient to a file.

    Coefficients are those on the candidate library. deviations: (n_samplings, n_states, n_terms),
    NaN without noise and for terms without a bound. There is one sampling if all realisations share
    their times, else one for each.
    """
    write_arrays(path, std=deviations)


def read_bounds(path: str | os.PathLike) -> np.ndarray:
    """Read Cramér-Rao standard deviations, (n_samplings, n_states, n_terms)."""
    with np.load(path) as file:
        return file["std"]


# --- reconstructions/{case}/{protocol}/{cell}.npz: motions of identified models, for figures ---


def write_reconstructions(
    path: str | os.PathLike, reconstructions: Mapping[str, Reconstruction]
) -> None:
    """Write summaries of the motions simulated with identified models, by method."""
    write_arrays(
        path,
        **{
            f"{method}/{name}": values
            for method, reconstruction in reconstructions.items()
            for name, values in asdict(reconstruction).items()
        },
    )


def read_reconstructions(path: str | os.PathLike) -> dict[str, Reconstruction]:
    """Read summaries of the motions simulated with identified models, by method."""
    with np.load(path) as file:
        methods: dict[str, dict[str, np.ndarray]] = {}
        for key in file:  # method/name
            method, _, name = key.partition("/")
            methods.setdefault(method, {})[name] = file[key]
    return {method: Reconstruction(**arrays) for method, arrays in methods.items()}


# --- assessment/{case}/orbits.npz: settled orbits at mid-span ---


def write_orbits(path: str | os.PathLike, orbits: Mapping[float, np.ndarray]) -> None:
    """Write orbits of an overhead line at mid-span to a file, by wind speed in m/s.

    An orbit has n places (w, v) in m about rest, (n, 2).
    """
    write_arrays(path, **{f"{wind:.12g}": places for wind, places in orbits.items()})


def read_orbits(path: str | os.PathLike) -> dict[float, np.ndarray]:
    """Read orbits of a line at mid-span, as `write_orbits` describes them."""
    with np.load(path) as file:
        return {float(wind): file[wind] for wind in file}


READERS = {
    "*.csv": read_table,
    "models/*.json": read_model,
    "trajectories/*.npz": read_trajectories,
    "recordings/*/*/*.npz": read_recordings,
    "identified/*/*/*/*.json": read_identified,
    "bounds/*/*/*.npz": read_bounds,
    "reconstructions/*/*/*.npz": read_reconstructions,
    "assessment/*/orbits.npz": read_orbits,
}
