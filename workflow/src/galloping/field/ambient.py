"""What the motion of a line in random forces tells an engineer, in words and numbers."""

import numpy as np

from galloping.field.dynamics import Dynamics, Value
from galloping.field.units import meaning
from galloping.identification.model import IdentifiedModel
from galloping.identification.random_forces.tracking import Forces
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
        f"{meaning(state).partition(' ')[0] or state} motion {margin(damping)}"
        for state, damping in of.damping.items()
    )
    told = told[0].upper() + told[1:]
    return f"**Random forces keep the motion up.** Does the line gallop as well? {told}."


def row(found: IdentifiedModel, of: Dynamics | None) -> tuple[str, str, str]:
    """Of the table of what was found: how strong the forces are."""
    return "random forces, for each kg of modal mass", strengths(found, of), ""


def margin(damping: Value) -> str:
    """Whether a mode gallops, as far as its net damping tells."""
    if damping.low > 0.0:
        return f"does not, at least {100 * damping.low:.2g} % of critical damping is left"
    if damping.high < 0.0:
        return "does, small motions grow"
    return "may, the recording is too short to tell whether small motions grow"


def strengths(found: IdentifiedModel, of: Dynamics | None) -> str:
    """The forces' one-sided spectra, at the frequency of the coordinate that each moves."""
    states, forces = found.model.states, Forces.of(found)
    said = []
    for i, velocity in velocity_pairs(states).items():
        frequency = of.frequencies[states[i]].value if of else np.nan
        density = forces.density(2.0 * np.pi * frequency)[velocity, velocity]
        if density > 0.0:
            said.append(f"{states[i]} {np.sqrt(2.0 * density):.3g} m/s² per √Hz")
    lasting = ", ".join(f"{1.0 / forces.rates[i]:.2g} s" for i in forces.places)
    return ", ".join(said) + (f", slow ones that last {lasting} included" if lasting else "")
