"""Figure 7: R2 against noise."""

import pandas as pd

from galloping.figures.noise import draw_noise_r2
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    table = pd.read_csv(snakemake.input.table)
    write_figure(output.svg, output.png, lambda: draw_noise_r2(table, settings), **settings["look"])


run(main, snakemake)
