"""Which terms the recordings can tell."""

import pandas as pd

from galloping.figures.identifiability import draw_identifiability
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    table = pd.read_csv(snakemake.input.table)
    write_figure(
        output.svg, output.png, lambda: draw_identifiability(table, settings), **settings["look"]
    )


run(main, snakemake)
