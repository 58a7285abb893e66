"""Figures 8 and 9: local time histories."""

from galloping.figures.histories import draw_histories
from galloping.figures.motion import read_reconstruction, read_trajectory
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    true = read_trajectory(snakemake.input.trajectory)
    methods = [cell["method"] for cell in settings["columns"] for _ in settings["labels"]]
    motions = list(map(read_reconstruction, snakemake.input.motions, methods))
    write_figure(
        output.svg, output.png, lambda: draw_histories(true, motions, settings), **settings["look"]
    )


run(main, snakemake)
