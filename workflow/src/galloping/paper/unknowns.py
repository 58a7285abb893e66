"""What the paper leaves out, and how probable its printed numbers are at one setting of that.

Unknown are numbers within stated ranges, and readings of its words and digits.
The paper shows one draw of its noise. Cells, such as 10,000 points at noise 0.05, are draws of
their own, so that the probability of all that is printed is the product of those of the cells: of
each the mean, over draws, of a kernel about the printed numbers in the logarithms of the errors,
for those draws that keep the bounds that are printed of the cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from galloping.paper.claims import CLAIMS, Claim
from galloping.physics.galerkin import READINGS
from galloping.results import IDENTIFIED, KNOWN, NOISE

if TYPE_CHECKING:
    import pandas as pd


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

    def at(self, case: Mapping, value: float) -> dict:
        """The settings of a case at a value."""
        if not self.path:
            return dict(case)
        section, key = self.path
        return {**case, section: {**case[section], key: value}}


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
class MethodReading:
    """The paper's method, with what the paper does not say of it.

    threshold: one number for all terms, or None to choose each equation's by EBIC. columns: `raw`
    or `normalised`, what thresholds act on. kinematics: KNOWN, or IDENTIFIED as any equation.
    protocol: of `draws.PROTOCOLS`. relative: whether noise levels are in standard deviations of
    each noisy channel.
    """

    threshold: float | None = 1.0
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
    ice: tuple[tuple[float, ...], tuple[float, ...]] = READINGS["swapped"]
    setting: MethodReading = MethodReading()
    chosen: bool = False
    steady: bool = True
    cost: int = 1

    def case(self, line: Mapping, values: Mapping[str, float]) -> dict:
        """The settings of a case at values of the unknowns. line: those of the paper's line."""
        vertical, horizontal = map(list, self.ice)
        ice = {"reading": "custom", "vertical": vertical, "horizontal": horizontal}
        case = {**line, "line": {**line["line"], "mode_shape": self.mode_shape}, "ice": ice}
        for unknown in UNKNOWNS:
            case = unknown.at(case, values[unknown.name])
        return case

    def method(self, values: Mapping[str, float]) -> MethodReading:
        """The paper's method at values of the unknowns."""
        return replace(self.setting, threshold=None if self.chosen else values["threshold"])


BASE = Variant("first reading")


# beta_2 and beta_3 with integer and fraction exchanged, or a thousandth of what is printed; eta_1
# as printed, or a thousandth; the signs that may be lost. A limit cycle needs beta_1 > 0 > beta_3.
def _ice(b2: float, b3: float, e1: float) -> Variant:
    (b1, *betas), (eta, *rest) = BASE.ice
    own = {"beta2": b2, "beta3": b3, "eta1": e1}
    changes = [
        f"{name} {'minus ' if value * first < 0 else ''}{abs(value):g}"
        for (name, value), first in zip(own.items(), (*betas, eta), strict=True)
        if value != first
    ]
    return Variant(", ".join(changes), "ice", ice=((b1, b2, b3), (e1, *rest)))


# each coefficient as the readings have it
_BETAS, _ETAS = (tuple(zip(*each, strict=True)) for each in zip(*READINGS.values(), strict=True))
_ICE = tuple(
    _ice(sign * b2, b3, other * e1)
    for b3, b2, e1, sign, other in product(_BETAS[2], _BETAS[1], _ETAS[0], (1, -1), (1, -1))
)
VARIANTS = (
    BASE,
    Variant("any motion", "steadiness", steady=False),
    Variant("sine", "mode shape", mode_shape="sine"),
    Variant("kinematics identified", "kinematics", setting=MethodReading(kinematics=IDENTIFIED)),
    Variant("columns normalised", "columns", setting=MethodReading(columns="normalised")),
    Variant("threshold chosen", "threshold", chosen=True),
    Variant("threshold chosen normalised", "threshold", setting=MethodReading(columns="normalised"),
            chosen=True),
    Variant("noise relative", "noise", setting=MethodReading(relative=True)),
    Variant("noisy velocities", "protocol", setting=MethodReading(protocol="velocity"), cost=8),
    *_ICE[1:],
)  # fmt: skip
BY_NAME = {variant.name: variant for variant in VARIANTS}


CASE = "internal_resonance"
# A draw is near a printed number within a factor of 1.6; a few may be off by more, so that a
# search sees where to go.
WIDTHS, SHARES = np.array([0.5, 1.5]), np.array([0.9, 0.1])
MISSED = 0.02  # how much a draw that misses a bound counts beside one that keeps it
RANGE = 1e-2, 1e4  # percent: errors beyond count as these

# Bounds that others imply or that compare two noise levels, whose draws are not one recording's,
# are left to the claims.
PRINTED = tuple(
    claim
    for claim in CLAIMS
    if claim.case == CASE
    and claim.level > 0
    and claim.minus_level is None
    and "first abstract" not in claim.source
)
NUMBERS = tuple(claim for claim in PRINTED if claim.is_number)
BOUNDS = tuple(claim for claim in PRINTED if not claim.is_number)
Cell = tuple[str, float, int | None]


def cell_of(claim: Claim) -> Cell:
    """Kind, noise level and points (None for the whole record) of what a claim is about."""
    return claim.cell_kind, claim.level, claim.points


CELLS = tuple(dict.fromkeys(map(cell_of, PRINTED)))
MOVED = {cell_of(c) for c in PRINTED if c.column.startswith(("r2", "amplitude"))}
STILL = tuple(level for kind, level, points in CELLS if (kind, level, points) not in MOVED)


def cell_name(cell: Cell) -> str:
    kind, level, points = cell
    return f"noise {level:g}" if kind == NOISE else f"{points} points"


def log_probabilities(
    scores: pd.DataFrame, left_out: Sequence[str] = (), printed: Sequence[Claim] = PRINTED
) -> dict[str, float]:
    """Logarithm of the probability (density, where numbers are printed) of each cell.

    scores: of draws, as of `draws.paper_draws`. left_out: what columns of claims that do not count
    begin with. printed: the paper's claims.
    """
    counting = [c for c in printed if not c.column.startswith(tuple(left_out))]
    cells = {cell: [c for c in counting if cell_of(c) == cell] for cell in CELLS}
    return {
        cell_name(cell): float(np.log(_density(claims, scores)))
        for cell, claims in cells.items()
        if claims
    }


def _density(claims: Sequence[Claim], scores: pd.DataFrame) -> float:
    numbers = [claim for claim in claims if claim.is_number]
    weights = np.ones(1)
    for claim in claims:
        if not claim.is_number:
            weights = weights * np.where(claim.met(claim.values(scores)), 1.0, MISSED)
    if not numbers:
        return float(weights.mean())
    off = np.column_stack(
        [np.log(np.clip(c.values(scores), *RANGE) / c.paper_value) for c in numbers]
    )
    squares = np.sum(off**2, axis=1)[:, np.newaxis] / WIDTHS**2
    kernel = np.exp(-squares / 2) / (2 * np.pi * WIDTHS**2) ** (len(numbers) / 2)
    return float(np.mean(weights * (kernel @ SHARES)))


def one_draw(scores: pd.DataFrame, draw: int = 0) -> dict[str, float]:
    """What one draw of each cell gives in place of what is printed, by the names of the claims."""
    some = scores[scores["draw"] == draw]
    return {claim.name: float(claim.values(some)[0]) for claim in PRINTED}


def shares(scores: pd.DataFrame) -> Mapping[str, float]:
    """The share of draws below each printed number, and of those that keep each bound."""
    return {claim.name: float(np.mean(claim.met(claim.values(scores)))) for claim in PRINTED}
