"""Figure 4: motion without noise."""

from galloping.figures.motion import read_reconstruction, read_trajectory
from galloping.figures.recovery import draw_recovery
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    true = [read_trajectory(path) for path in snakemake.input.trajectories]
    motions = [read_reconstruction(path, settings["method"]) for path in snakemake.input.motions]
    write_figure(
        output.svg, output.png, lambda: draw_recovery(true, motions, settings), **settings["look"]
    )


run(main, snakemake)
