"""Probability of the paper's printed numbers and words, given realisations of its study.

The paper shows one realisation of its noise. A *cell* is one recording of its study, such as 10,000
points at noise 0.05. Cells are independent, so the probability of all that is printed is the
product of those of the cells. The probability of a cell is the mean over draws of the product of

- a kernel about the printed errors, on a logarithmic scale, with heavy tails;
- 1 for each printed bound that the draw satisfies, `MISSED_WEIGHT` for each one that it misses;
- exp(-n / tolerance) for n false terms if the paper says in words that there are few.

A statement that compares two noise levels is a factor of its own: the mean of the same weights over
pairs of draws. The steadiness of the motion is a factor of the setting, not of its draws.
"""

from collections.abc import Collection, Mapping

import numpy as np
import pandas as pd

from galloping.paper.claims import CLAIMS, FEW, Claim
from galloping.results import NOISE

CASE = "internal_resonance"
# Mixture of two Gaussian kernels in the logarithm of a realisation over its printed number: the
# width 0.5 is a factor of 1.6; the wide one limits the influence of a number that is far off.
KERNEL_WIDTHS, KERNEL_WEIGHTS = np.array([0.5, 1.5]), np.array([0.9, 0.1])
MISSED_WEIGHT = 0.02  # weight of a realisation that violates a bound: the paper may err
ERROR_RANGE = 1e-2, 1e4  # percent: errors are clipped to this range
STEADY_DEVIATION = 0.01  # standard deviation of the relative amplitude change of a steady motion

# Claims of realisations with noise. Bounds that other claims imply are only in the table of claims.
PRINTED_CLAIMS = tuple(c for c in CLAIMS if c.case == CASE and c.level > 0 and c.is_counted)
NUMBER_CLAIMS = tuple(claim for claim in PRINTED_CLAIMS if claim.is_number)
# prefixes of the columns of scores, by group of claims that are left out together
CLAIM_GROUPS: dict[str, str | tuple[str, ...]] = {
    "coefficients": "mean_error",
    "amplitudes": "amplitude_error",
    "fits": "r2",
    "terms": ("missing", "spurious"),
}
Cell = tuple[str, float, int | None]


def group_of(claim: Claim) -> str:
    """Return the subject of a claim of the reproduced paper, such as `coefficients`."""
    return next(name for name, start in CLAIM_GROUPS.items() if claim.column.startswith(start))


def cell_of(claim: Claim) -> Cell:
    """Return which recordings a claim is about: their kind, noise level and sample number.

    The number is None for the whole record.
    """
    return claim.cell_kind, claim.level, claim.points


CELLS = tuple(dict.fromkeys(cell_of(c) for c in PRINTED_CLAIMS if c.minus_level is None))
_SIMULATED = {cell_of(c) for c in PRINTED_CLAIMS if group_of(c) in ("amplitudes", "fits")}
# noise levels of whole records for which no printed claim needs a simulated motion
UNSIMULATED_LEVELS = tuple(cell[1] for cell in CELLS if cell not in _SIMULATED)


def name_cell(cell: Cell) -> str:
    """Format the noise level or sample number of recordings as a name, such as `noise 0.05`."""
    kind, level, points = cell
    return f"noise {level:g}" if kind == NOISE else f"{points} points"


def scores_by_claim(scores: pd.DataFrame) -> dict[str, np.ndarray]:
    """Extract from a table of scores the value of each claim in every noise realisation.

    scores: one row per draw and cell, as of `quick.QuickStudy.draw_scores`.
    """
    cells = dict(list(scores.groupby(["kind", "level", "points"])))
    values = {}
    for claim in PRINTED_CLAIMS:
        parts = [
            cell
            for (kind, level, points), cell in cells.items()
            if kind == claim.cell_kind
            and level in (claim.level, claim.minus_level)
            and claim.points in (None, points)
        ]
        values[claim.name] = claim.values(pd.concat(parts) if len(parts) > 1 else parts[0])
    return values


def log_likelihoods(
    values: Mapping[str, np.ndarray],
    left_out: Collection[str] = (),
    claims: Collection[Claim] = PRINTED_CLAIMS,
) -> dict[str, float]:
    """Compute log-likelihoods of the reproduced paper's claims from simulated noise realisations.

    values: of `scores_by_claim`. left_out: names in `CLAIM_GROUPS` of ignored claims. Returns the
    logarithm of each factor, a probability or, for printed numbers, a density: by cell, and by
    claim if it compares two noise levels.
    """
    counted_claims = [claim for claim in claims if group_of(claim) not in left_out]
    factors = {
        name_cell(cell): [c for c in counted_claims if c.minus_level is None and cell_of(c) == cell]
        for cell in CELLS
    }
    factors |= {claim.name: [claim] for claim in counted_claims if claim.minus_level is not None}
    return {
        name: float(np.log(_mean_weight([(c, values[c.name]) for c in factor])))
        for name, factor in factors.items()
        if factor
    }


def _mean_weight(claims: list[tuple[Claim, np.ndarray]]) -> float:
    """Average over draws the product of the weights of claims about the same recording."""
    weights, offsets = np.ones(1), []
    for claim, values in claims:
        if claim.is_number:
            offsets.append(np.log(np.clip(values, *ERROR_RANGE) / claim.printed))
        elif claim.kind == FEW:
            weights = weights * np.exp(-values / claim.tolerance)
        else:
            weights = weights * np.where(claim.is_met(values), 1.0, MISSED_WEIGHT)
    if offsets:
        squares = np.sum(np.square(offsets), axis=0)[:, np.newaxis] / KERNEL_WIDTHS**2
        kernels = np.exp(-squares / 2) / (2 * np.pi * KERNEL_WIDTHS**2) ** (len(offsets) / 2)
        weights = weights * (kernels @ KERNEL_WEIGHTS)
    return float(np.mean(weights))


def log_steadiness(changes: np.ndarray) -> float:
    """Return the log-likelihood, at most 0, that a motion is steady, by its amplitude changes.

    changes: relative changes of the amplitudes between the halves of the steady window.
    """
    return float(-0.5 * np.sum(np.square(changes / STEADY_DEVIATION)))


def effective_number(weights: np.ndarray | pd.Series) -> float:
    """Compute the effective sample size of weights whose sum is 1 (L. Kish 1965)."""
    return float(1 / np.sum(weights**2))
