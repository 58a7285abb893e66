"""Figure 10: errors of the motion against the amount of data."""

import pandas as pd

from galloping.figures.amount import draw_data_amount
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    table = pd.read_csv(snakemake.input.table)
    write_figure(
        output.svg, output.png, lambda: draw_data_amount(table, settings), **settings["look"]
    )


run(main, snakemake)
