"""What the motion of a line in random forces tells an engineer, in words and numbers."""

from __future__ import annotations

import numpy as np

from galloping.field.dynamics import Dynamics, Value
from galloping.field.units import meaning
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import velocity_pairs

MEANING = {
    "ok": "Random forces that nobody measured, such as those of turbulence, traffic or other "
    "spans, keep the motion up; with them the model explains it down to white noise.",
    "approximate": "Random forces that nobody measured keep the motion up; they, or the motion, "
    "are not all as the model has them, and its intervals do not tell what that changes.",
}


def outcome(of: Dynamics) -> str:
    """In a sentence, whether the line gallops."""
    told = "; ".join(
        f"{meaning(state).partition(' ')[0] or state} motion: {margin(damping)}"
        for state, damping in of.damping.items()
    )
    return f"**Random forces keep the motion up.** Whether it gallops as well: {told}."


def row(found: IdentifiedModel) -> tuple[str, str, str]:
    """Of the table of what was found: how strong the forces are."""
    return "random forces, for each kg of modal mass", strengths(found), ""


def margin(damping: Value) -> str:
    """Whether a mode gallops, as far as its net damping tells."""
    if damping.low > 0.0:
        return f"no, at least {100 * damping.low:.2g} % of critical damping is left"
    if damping.high < 0.0:
        return "yes, small motions grow"
    return "open, the recording is too short to tell whether small motions grow"


def strengths(found: IdentifiedModel) -> str:
    """The forces' one-sided spectra, which are flat."""
    velocities = {velocity: i for i, velocity in velocity_pairs(found.model.states).items()}
    return ", ".join(
        f"{found.model.states[velocities[i]]} {np.sqrt(2.0 * found.forces[i, i]):.3g} m/s² per √Hz"
        for i in np.flatnonzero(np.diag(found.forces))
    )
