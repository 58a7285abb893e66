"""Animation of the line's motion at the end of the simulation.

The animation of a line that diverges or stays at rest is one frame that says so.
"""

import numpy as np

from galloping.evaluation.motion import steady_frequency
from galloping.figures.engineering import write_animation, write_still
from galloping.figures.style import spoken
from galloping.reproducibility.job import run
from galloping.study.files import read

ANIMATED_PERIODS = 3  # periods of the slower direction; the motion nearly repeats


def animate_line(animation, case, trajectory, line, window):
    """Write an animation of the last periods of a line's simulated motion."""
    motion = read(trajectory)[0]
    title = f"{spoken(case)}, wind {line['wind']['speed']:g} m/s"
    steady = motion.states[motion.time >= window[0]][:, :2]
    outcome = f"itself {motion.status}" if motion.status != "ok" else "stays at rest"
    if motion.status != "ok" or not np.ptp(steady, axis=0).any():
        write_still(animation, f"{title}\nnothing to show: the line {outcome}")
        return
    slower = steady_frequency(steady, motion.time[1] - motion.time[0]).min()
    is_animated = motion.time >= motion.time[-1] - ANIMATED_PERIODS / slower
    title += f", the last {ANIMATED_PERIODS} periods"
    write_animation(animation, line, motion.time[is_animated], motion.states[is_animated], title)


if __name__ == "__main__":
    run(animate_line, snakemake)
