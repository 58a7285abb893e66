"""What the paper leaves out: numbers within stated ranges, and readings of its words and digits."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from galloping.identification.options import IDENTIFIED, KNOWN


@dataclass(frozen=True)
class Unknown:
    """One number. low, high: between which it is as likely in each equal ratio before the paper's
    numbers are looked at. path: of the key among the settings of a case, () for the threshold.
    """

    name: str
    low: float
    high: float
    unit: str
    label: str
    path: tuple[str, ...]


UNKNOWNS = (
    Unknown("wind_speed", 1, 30, "m/s", "wind speed", ("wind", "speed")),
    Unknown("damping_vertical", 1e-4, 0.03, "1", "vertical damping", ("damping", "vertical")),
    Unknown("damping_horizontal", 1e-4, 0.03, "1", "horizontal damping", ("damping", "horizontal")),
    Unknown("release_vertical", 0.02, 3, "m", "vertical release", ("initial_state", "q_v")),
    Unknown("release_horizontal", 0.02, 3, "m", "horizontal release", ("initial_state", "q_w")),
    # one sub-conductor to more than the bundle's spacing
    Unknown("bundle_dimension", 0.0276, 0.6, "m", "bundle dimension", ("bundle", "dimension")),
    Unknown("threshold", 1e-4, 0.1, "1", "threshold", ()),
)
NAMES = tuple(unknown.name for unknown in UNKNOWNS)
LOW, HIGH = (np.log([getattr(u, end) for u in UNKNOWNS]) for end in ("low", "high"))


@dataclass(frozen=True)
class Setting:
    """What the paper does not say of its method. Fields as the keywords of `draws.paper_draws`."""

    threshold: float | None
    columns: str = "raw"
    kinematics: str = KNOWN
    protocol: str = "derivative"
    relative: bool = False


@dataclass(frozen=True)
class Variant:
    """One way to read the paper.

    name: what it changes of the first one, BASE. kind: which of the things that the paper leaves
    out that is, in a word or two. ice: beta_1 to beta_3, and eta_1 to eta_3. setting: of the
    method; its threshold is one of the unknowns. chosen: or the data choose it, by EBIC. steady:
    whether the motion has to be so from 200 to 300 s. cost: how dear a draw is: so many times fewer
    draws and settings are afforded.
    """

    name: str
    kind: str = ""
    mode_shape: str = "irvine"
    ice: tuple[tuple[float, ...], tuple[float, ...]] = ((0.442, 2.126, -4.432), (3.33, 0.0, 0.0))
    setting: Setting = Setting(threshold=1.0, kinematics=KNOWN)
    chosen: bool = False
    steady: bool = True
    cost: int = 1

    def case(self, line: Mapping, values: Mapping[str, float]) -> dict:
        """The settings of a case at values of the unknowns. line: those of the paper's line."""
        case = {
            key: dict(part) if isinstance(part, Mapping) else part for key, part in line.items()
        }
        case["line"]["mode_shape"] = self.mode_shape
        vertical, horizontal = map(list, self.ice)
        case["ice"] = {"reading": "custom", "vertical": vertical, "horizontal": horizontal}
        for unknown in UNKNOWNS:
            if unknown.path:
                section, key = unknown.path
                case[section][key] = values[unknown.name]
        return case

    def method(self, values: Mapping[str, float]) -> Setting:
        return replace(self.setting, threshold=None if self.chosen else values["threshold"])


def _method(
    name: str, kind: str, chosen: bool = False, cost: int = 1, **changes: object
) -> Variant:
    setting = Setting(**{"threshold": 1.0, "kinematics": KNOWN, **changes})
    return Variant(name, kind, setting=setting, chosen=chosen, cost=cost)


# beta_2 and beta_3 with integer and fraction exchanged, or a thousandth of what is printed; eta_1
# as printed, or a thousandth; the signs that may be lost. A limit cycle needs beta_1 > 0 > beta_3.
def _ice(b2: float, b3: float, e1: float) -> Variant:
    own = {"beta2": b2, "beta3": b3, "eta1": e1}
    changes = [
        f"{name} {'minus ' if value * first < 0 else ''}{abs(value):g}"
        for (name, value), first in zip(own.items(), PRINTED_ICE, strict=True)
        if value != first
    ]
    return Variant(", ".join(changes), "ice", ice=((0.442, b2, b3), (e1, 0.0, 0.0)))


PRINTED_ICE = 2.126, -4.432, 3.33  # beta_2, beta_3, eta_1 of the first reading
_ICE = tuple(
    _ice(sign * b2, b3, other * e1)
    for b3, b2, e1, sign, other in product(
        (-4.432, -0.4324), (2.126, 0.1262), (3.33, 0.00333), (1, -1), (1, -1)
    )
)
BASE = Variant("first reading")
VARIANTS = (
    BASE,
    Variant("any motion", "steadiness", steady=False),
    Variant("sine", "mode shape", mode_shape="sine"),
    _method("kinematics identified", "kinematics", kinematics=IDENTIFIED),
    _method("columns normalised", "columns", columns="normalised"),
    _method("threshold chosen", "threshold", chosen=True),
    _method("threshold chosen normalised", "threshold", chosen=True, columns="normalised"),
    _method("noise relative", "noise", relative=True),
    _method("noisy velocities", "protocol", cost=8, protocol="velocity"),
    *_ICE[1:],
)
BY_NAME = {variant.name: variant for variant in VARIANTS}
