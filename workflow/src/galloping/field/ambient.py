"""What the motion of a line in random forces tells an engineer, in words and numbers."""

from __future__ import annotations

import numpy as np

from galloping.field.dynamics import Dynamics, Value, in_words
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import velocity_pairs

MEANING = {
    "ok": "Random forces that nobody measured, such as those of turbulence, traffic or other "
    "spans, keep the motion up; with them the model explains it down to white noise.",
    "approximate": "Random forces that nobody measured keep the motion up; they, or the motion, "
    "are not all as the model has them, and its intervals do not tell what that changes.",
}


def lines(found: IdentifiedModel, of: Dynamics) -> list[str]:
    """Frequencies, damping, margin to galloping and strength of the forces, as Markdown."""
    said = [
        "## Natural frequencies and damping",
        "",
        "Each with its 95 % interval; damping is net, that of the wind included.",
        "",
        "| mostly moves | frequency [Hz] | net damping [% of critical] | decay of the amplitude "
        "[1/s] | galloping |",
        "| --- | --- | --- | --- | --- |",
    ]
    for state, frequency in of.frequencies.items():
        damping = of.damping[state]
        rate = 2.0 * np.pi * frequency.value
        decay = Value(*(rate * end for end in (damping.value, damping.low, damping.high)))
        cells = (in_words(frequency, ""), in_words(damping, "", 100), in_words(decay, ""))
        row = " | ".join(cell.replace("  ", " ") for cell in cells)
        said.append(f"| {state} | {row} | {margin(damping)} |")
    if of.rest:
        places = ", ".join(f"{state} = {in_words(value, 'm')}" for state, value in of.rest.items())
        said += ["", f"About the position of rest {places}."]
    return [*said, "", f"The forces, for each kg of modal mass: {strengths(found)}."]


def margin(damping: Value) -> str:
    """Whether a mode gallops, as far as its net damping tells."""
    if damping.low > 0.0:
        return "no: at least this much damping is left, " + f"{100 * damping.low:.2g} %"
    if damping.high < 0.0:
        return "yes: small motions grow"
    return "open: the recording is too short to tell whether small motions grow"


def strengths(found: IdentifiedModel) -> str:
    """The forces' one-sided spectra, which are flat."""
    velocities = {velocity: i for i, velocity in velocity_pairs(found.model.states).items()}
    return ", ".join(
        f"{found.model.states[velocities[i]]} {np.sqrt(2.0 * found.forces[i, i]):.3g} m/s² per √Hz"
        for i in np.flatnonzero(np.diag(found.forces))
    )
