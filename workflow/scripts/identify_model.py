"""Models identified by one method from every replicate of one cell."""

from galloping.equations import STATES
from galloping.identification import result
from galloping.identification.cell import identify
from galloping.identification.registry import BY_NAME
from galloping.identification.sparse import reduction
from galloping.polynomial import library
from galloping.recording import Recordings
from galloping.reproducibility.job import run


def main() -> None:
    settings, cell = snakemake.params.settings, snakemake.wildcards
    if BY_NAME[cell.method].evidence == "reduced":
        evidence = reduction.read(snakemake.input.evidence)
    else:
        evidence = Recordings.read(snakemake.input.evidence).replicates
    results = identify(
        cell.method,
        evidence,
        settings=settings["options"],
        seed=settings["seed"],
        name=(cell.case, cell.protocol, cell.cell),
        shape=(len(STATES), len(library(len(STATES), settings["degree"]))),
    )
    result.write(snakemake.output.models, results)


run(main, snakemake)
