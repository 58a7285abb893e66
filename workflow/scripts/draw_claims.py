"""The paper's claims beside the study's values."""

import pandas as pd

from galloping.figures.claims import draw_claims
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    table = pd.read_csv(snakemake.input.table)
    write_figure(output.svg, output.png, lambda: draw_claims(table, settings), **settings["look"])


run(main, snakemake)
