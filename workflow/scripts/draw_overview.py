"""The study in one picture."""

import pandas as pd

from galloping.figures.overview import draw_overview
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    table = pd.read_csv(snakemake.input.table)
    write_figure(output.svg, output.png, lambda: draw_overview(table, settings), **settings["look"])


run(main, snakemake)
