"""Figure 3: the flow chart."""

from galloping.figures.flow import draw_flow
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    write_figure(output.svg, output.png, lambda: draw_flow(settings), **settings["look"])


run(main, snakemake)
