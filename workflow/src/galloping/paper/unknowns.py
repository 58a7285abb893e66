"""Unknowns of the paper: numbers within stated ranges, and readings of its words and digits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from galloping.line.galerkin import READINGS as ICE_READINGS
from galloping.results import IDENTIFIED, KNOWN


@dataclass(frozen=True)
class Unknown:
    """Quantity whose value the reproduced paper does not print, with its possible range.

    low, high: its range, in which its logarithm has a uniform prior. path: of the key among the
    settings of a case, () for the threshold of the method.
    """

    name: str
    low: float
    high: float
    unit: str
    label: str
    path: tuple[str, ...]

    def set_in(self, case: Mapping, value: float) -> dict:
        """Return the settings of a case with this quantity set to a value."""
        if not self.path:
            return dict(case)
        section, key = self.path
        return {**case, section: {**case[section], key: value}}


UNKNOWNS = (
    Unknown("wind_speed", 1, 30, "m/s", "wind speed", ("wind", "speed")),
    Unknown("damping_vertical", 1e-4, 0.03, "1", "vertical damping", ("damping", "vertical")),
    Unknown("damping_horizontal", 1e-4, 0.03, "1", "horizontal damping", ("damping", "horizontal")),
    Unknown("initial_vertical", 0.02, 3, "m", "initial vertical displacement",
            ("initial_state", "q_v")),
    Unknown("initial_horizontal", 0.02, 3, "m", "initial horizontal displacement",
            ("initial_state", "q_w")),
    # one sub-conductor to more than the bundle's spacing
    Unknown("bundle_dimension", 0.0276, 0.6, "m", "bundle dimension", ("bundle", "dimension")),
    Unknown("threshold", 1e-4, 0.1, "1", "threshold", ()),
)  # fmt: skip
UNKNOWN_NAMES = tuple(unknown.name for unknown in UNKNOWNS)
UNKNOWN_LABELS = {unknown.name: unknown.label for unknown in UNKNOWNS}
# logarithms of the ends of the prior ranges
LOG_LOW, LOG_HIGH = (np.log([getattr(u, end) for u in UNKNOWNS]) for end in ("low", "high"))


@dataclass(frozen=True)
class MethodReading:
    """One interpretation of the reproduced paper's ambiguous identification method.

    threshold: one number for all terms, or None to choose each equation's by EBIC. columns: `raw`
    or `normalised`, to which thresholds apply. kinematics: KNOWN, or IDENTIFIED as any equation.
    protocol: of `draws.NOISES_BY_READING`. relative: whether noise levels are in standard
    deviations of each noisy channel.
    """

    threshold: float | None = 1.0
    columns: str = "raw"
    kinematics: str = KNOWN
    protocol: str = "derivative"
    relative: bool = False


ONE_LINE, BOTH_LINES = "one line", "both lines"


@dataclass(frozen=True)
class Reading:
    """One interpretation of the ambiguous or damaged text of the reproduced paper.

    name: difference from the first reading. kind: of the ambiguity, in a word or two. ice: beta_1
    to beta_3, and eta_1 to eta_3. method: without its threshold, which is one of the unknowns.
    chosen: whether the data choose the threshold instead, by EBIC. steady: lines whose motion is
    interpreted as steady from 200 s on, ONE_LINE, BOTH_LINES or "" for none. attack_limit: largest
    |dq_v| / U over the record at which the motion counts as much slower than the wind, rad.
    """

    name: str
    kind: str = ""
    mode_shape: str = "irvine"
    ice: tuple[tuple[float, ...], tuple[float, ...]] = ICE_READINGS["swapped"]
    method: MethodReading = MethodReading()
    chosen: bool = False
    steady: str = ONE_LINE
    attack_limit: float = 0.2

    @property
    def has_threshold_in_units(self) -> bool:
        """Whether the threshold applies to coefficients in SI units, as the paper says."""
        return self.method.columns == "raw" and not self.chosen

    def case_at(self, values: Mapping[str, float], line: Mapping) -> dict:
        """Make the settings of a case at given values of the unknown quantities.

        line: settings of one of the paper's lines.
        """
        vertical, horizontal = map(list, self.ice)
        ice = {"reading": "custom", "vertical": vertical, "horizontal": horizontal}
        case = {**line, "line": {**line["line"], "mode_shape": self.mode_shape}, "ice": ice}
        for unknown in UNKNOWNS:
            case = unknown.set_in(case, values[unknown.name])
        return case

    def method_at(self, values: Mapping[str, float]) -> MethodReading:
        """Return the paper's method with its threshold taken from values of the unknowns."""
        return replace(self.method, threshold=None if self.chosen else values["threshold"])


FIRST_READING = Reading("first reading")


# beta_2 and beta_3 with integer and fraction exchanged, or a thousandth of what is printed; eta_1
# as printed, or a thousandth; the signs that may be lost. A limit cycle needs beta_1 > 0 > beta_3.
def _read_ice(b2: float, b3: float, e1: float) -> Reading:
    (b1, *betas), (eta, *rest) = FIRST_READING.ice
    changed = {"beta2": b2, "beta3": b3, "eta1": e1}
    changes = [
        f"{name} {'minus ' if value * first < 0 else ''}{abs(value):g}"
        for (name, value), first in zip(changed.items(), (*betas, eta), strict=True)
        if value != first
    ]
    return Reading(", ".join(changes), "ice", ice=((b1, b2, b3), (e1, *rest)))


# values of each coefficient by the two readings of the digits
_BETAS, _ETAS = (
    tuple(zip(*each, strict=True)) for each in zip(*ICE_READINGS.values(), strict=True)
)
_ICE = tuple(
    _read_ice(sign * b2, b3, other * e1)
    for b3, b2, e1, sign, other in product(_BETAS[2], _BETAS[1], _ETAS[0], (1, -1), (1, -1))
)
READINGS = (
    FIRST_READING,
    Reading("attack angle at most 0.35", "attack angle", attack_limit=0.35),
    Reading("any attack angle", "attack angle", attack_limit=np.inf),
    Reading("any motion", "steadiness", steady=""),
    Reading("both lines steady", "steadiness", steady=BOTH_LINES),
    Reading("sine", "mode shape", mode_shape="sine"),
    Reading("kinematics identified", "kinematics", method=MethodReading(kinematics=IDENTIFIED)),
    Reading("columns normalised", "columns", method=MethodReading(columns="normalised")),
    Reading("threshold chosen", "threshold", chosen=True),
    Reading("threshold chosen normalised", "threshold", chosen=True,
            method=MethodReading(columns="normalised")),
    Reading("noise relative", "noise", method=MethodReading(relative=True)),
    Reading("noisy velocities, central differences", "protocol",
            method=MethodReading(protocol="velocity")),
    Reading("noisy velocities, smoothed differences", "protocol",
            method=MethodReading(protocol="smoothed velocity")),
    Reading("noisy velocities, smoothed states and differences", "protocol",
            method=MethodReading(protocol="smoothed states")),
    *_ICE[1:],
)  # fmt: skip
READINGS_BY_NAME = {reading.name: reading for reading in READINGS}
