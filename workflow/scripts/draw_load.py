"""Figure 2: the aerodynamic load."""

from galloping.physics.equations import STATES
from galloping.figures.load import draw_load
from galloping.figures.motion import read_trajectory
from galloping.figures.write import write_figure
from galloping.reproducibility.job import run


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    velocity = read_trajectory(snakemake.input.trajectory)["states"][:, STATES.index("dq_v")]
    write_figure(
        output.svg, output.png, lambda: draw_load(settings["line"], velocity), **settings["look"]
    )


run(main, snakemake)
