"""The motion of a continuous line as the sensors along its span see it."""

from collections.abc import Mapping

import numpy as np

from galloping.measurement.measuring import Motion
from galloping.physics import continuous
from galloping.physics.equations import STATES
from galloping.physics.gusts import wind_speed


def motion(
    case: Mapping,
    truth: Mapping,
    start: Mapping[str, float],
    time: np.ndarray,
    rng: np.random.Generator,
) -> Motion:
    """First modes of the line of a `cases` section, by its section `truth`, released from `start`.

    start: by state, m and m/s at mid-span. time: (n,) s, equally spaced. rng: draws the gusts.
    Readings of the sensors become the coordinates of as many sine modes, of which the first are
    the states; nothing else is known of the others. A motion that is not finite is all NaN.
    """
    line = continuous.continuous_line(
        case, truth["modes"], aerodynamic=truth["aerodynamics"], drag=truth["drag"]
    )
    displaced, moving = [start[s] for s in STATES[:2]], [start[s] for s in STATES[2:]]
    begun = continuous.release(line, displaced, moving, antisymmetric=truth["antisymmetric"])
    speed = np.full(len(time), line.speed)
    if truth["gusts"]["intensity"]:
        speed = wind_speed(time, mean=line.speed, rng=rng, **truth["gusts"])
    states = continuous.simulate(line, begun, time, speed)
    if not np.all(np.isfinite(states)):
        nowhere = np.full((len(time), len(STATES)), np.nan)
        return Motion(STATES, time, nowhere, nowhere, "diverged: not finite")
    where = [share * line.line.span for share in truth["sensors"]]
    displacement, velocity, acceleration = (
        continuous.first_modes(
            continuous.readings(line, states, where, quantity, speed), where, line.line.span
        )[:, 0]
        for quantity in continuous.QUANTITIES
    )
    return Motion(
        STATES, time, np.hstack([displacement, velocity]), np.hstack([velocity, acceleration])
    )
