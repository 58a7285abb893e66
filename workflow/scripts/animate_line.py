"""The first line at the design wind, moving on its limit cycle."""

from contextlib import suppress

import numpy as np

from galloping.cycles.family import LIBRARY, initial_state, line_family
from galloping.cycles.limit_cycles import circle, settle, settled
from galloping.figures.engineering import write_animation
from galloping.figures.style import spoken
from galloping.physics.galerkin import STATES
from galloping.reproducibility.job import run
from galloping.simulation import Simulator


def animate_line(animation, case, line, wind):
    family = line_family(line, "wind_speed")
    motion = settle(Simulator(STATES, LIBRARY), family.model(wind), np.array(initial_state(line)))
    title = f"{spoken(case)}, wind {wind:g} m/s"
    orbit = None
    if motion.kind == "cycle":
        with suppress(ValueError):  # none near enough
            point = settled(family, wind, motion.time, motion.states, resolution=1.0)
            orbit = point.solution
    if orbit is None:
        orbit = circle(np.zeros(len(STATES)), np.zeros(len(STATES), complex), 1.0, wind)
        title += f": no limit cycle ({motion.kind})"
    write_animation(animation, line, orbit, title)


if __name__ == "__main__":
    run(animate_line, snakemake)
