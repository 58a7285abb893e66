"""Numbers that others published of the settings of `galloping.trials.published`.

`exact_terms.csv`: how many of DRAWS draws of the noise of the Lorenz system gave exactly the right
terms, by length in s and noise level, as kept in AHsu98/jsindy at da8393e,
`paper-figures/lorenz-heatmap` (MIT licence, copyright 2025 Alexander W. Hsu, Ike W. Griss Salas,
Jacob M. Stevens-Haas, J. Nathan Kutz, Aleksandr Aravkin and Bamdad Hosseini), the row of ODR-BINDy
by its author L. Fung (arXiv 2507.23426). ODR-BINDy is told the size of the noise. Of van der Pol
and Roessler the authors give pictures and no numbers. Intervals: PSI-SINDy, arXiv 2610.11486,
5,000 draws; the size of the noise is known.
"""

import csv
from pathlib import Path

DRAWS = 128
METHODS = {
    "odr_bindy": "ODR-BINDy (told the noise)",
    "jsindy": "JSINDy",
    "ensemble_weak_sindy": "ensemble weak SINDy",
}


def _shares() -> dict[str, dict[tuple[float, float], float]]:
    """By method, and (duration, level)."""
    shares: dict = {method: {} for method in METHODS}
    with Path(__file__).with_name("exact_terms.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            of, level = shares[row.pop("method")], float(row.pop("level"))
            of |= {(float(length), level): int(n) / DRAWS for length, n in row.items()}
    return shares


EXACT = {"lorenz": _shares()}  # by system

# PSI-SINDy, of the quadratic coefficient. Without one: the least and the largest share of the
# intervals of 95 % that hold zero, and the same of naive tests at level 0.05 that reject it, over
# 200, 800, 1,600 and 3,200 samples; the median width of the intervals at the ends of that range.
# With one: the share of its tests that reject zero.
HOLDING, NAIVE_REJECTIONS = (0.946, 0.956), (0.074, 0.087)
WIDTHS = {200: 0.385, 3200: 0.096}
POWER = {("gamma 0.02", 800): 0.0675, ("gamma 0.16", 800): 0.6485}
