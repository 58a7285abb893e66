"""How probable the paper's printed numbers and bounds are at one setting of what it leaves out.

The paper shows one draw of its noise. Cells, such as 10,000 points at noise 0.05, are draws of
their own, so that the probability of all that is printed is the product of those of the cells: of
each the mean, over draws, of a kernel about the printed numbers in the logarithms of the errors,
for those draws that keep the bounds that are printed of the cell.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from galloping.names import NOISE
from galloping.paper.printed import CLAIMS, Claim

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
