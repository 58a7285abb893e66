"""Figure 5: coefficients under noise."""

from galloping.figures.coefficients import draw_coefficients
from galloping.figures.write import write_figure
from galloping.identification.model import read
from galloping.physics.equations import STATES
from galloping.polynomial import library
from galloping.reproducibility.job import run
from galloping.storage import read_json
from galloping.tables.coefficients import identified_terms


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    true = read_json(snakemake.input.model)["coefficients"]
    terms = library(len(STATES), settings["degree"])
    tables = [identified_terms(true, read(path), terms) for path in snakemake.input.identified]
    write_figure(
        output.svg, output.png, lambda: draw_coefficients(tables, settings), **settings["look"]
    )


run(main, snakemake)
