"""Replicated recordings of one cell."""

import numpy as np

from galloping.physics.equations import model
from galloping.measurement import measure
from galloping.reproducibility.job import run
from galloping.storage import read_json


def main() -> None:
    settings, cell = snakemake.params.settings, snakemake.wildcards
    with np.load(snakemake.input.trajectory) as file:
        time, states = file["time"], file["states"][: settings["releases"]]
    recordings = measure(
        model(read_json(snakemake.input.model)["coefficients"]),
        time,
        states,
        protocol=cell.protocol,
        level=settings["level"],
        points=settings["points"],
        relative=settings["relative"],
        seed=settings["seed"],
        name=(cell.case, cell.protocol, cell.cell),
        replicates=settings["replicates"],
    )
    recordings.write(snakemake.output.recordings)


run(main, snakemake)
