"""How far each method stays from the bound, against noise."""

import pandas as pd

from galloping.figures.efficiency import draw_efficiency
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    table = pd.read_csv(snakemake.input.table)
    write_figure(
        output.svg, output.png, lambda: draw_efficiency(table, settings), **settings["look"]
    )


run(main, snakemake)
