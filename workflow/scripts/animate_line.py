"""The first line at the design wind, moving on its limit cycle."""

import numpy as np

from galloping.cycles.family import LIBRARY, initial_state, line_family
from galloping.cycles.limit_cycles import circle, cycle_of
from galloping.cycles.settling import settle
from galloping.figures.engineering import write_animation
from galloping.figures.style import spoken
from galloping.physics.galerkin import STATES
from galloping.reproducibility.job import run
from galloping.simulation import Simulator


def animate_line(animation, case, line, wind):
    family = line_family(line, "wind_speed")
    motion = settle(Simulator(STATES, LIBRARY), family.model(wind), np.array(initial_state(line)))
    title = f"{spoken(case)}, wind {wind:g} m/s"
    if point := cycle_of(family, wind, motion):
        orbit = point.solution
    else:
        orbit = circle(np.zeros(len(STATES)), np.zeros(len(STATES), complex), 1.0, wind)
        title += f": no limit cycle ({motion.kind})"
    write_animation(animation, line, orbit, title)


if __name__ == "__main__":
    run(animate_line, snakemake)
