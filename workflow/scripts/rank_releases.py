"""Further releases of one case, the one that would help identification most first."""

from galloping.bounds.releases import ranked_releases
from galloping.reproducibility.job import run
from galloping.storage import write_rows
from galloping.study.files import models, trajectories

COLUMNS = ("case", "release", "level", "weakest_t", "weakest_term", "identifiable")


def main() -> None:
    settings = snakemake.params.settings
    line = models.read(snakemake.input.model).model
    first = trajectories.read(snakemake.input.trajectory)[0]
    ranked = ranked_releases(line, first, settings["level"], settings["heights"])
    rows = [{"case": snakemake.wildcards.case, **row} for row in ranked]
    write_rows(snakemake.output.ranking, rows, COLUMNS)  # there may be none


run(main, snakemake)
