"""Figure 1: the line and its coordinates."""

from galloping.figures.line import draw_line
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run
from galloping.storage import read_json


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    derived = read_json(snakemake.input.model)
    write_figure(
        output.svg,
        output.png,
        lambda: draw_line(settings["line"], derived, settings["case"]),
        **settings["look"],
    )


run(main, snakemake)
