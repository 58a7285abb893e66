"""Numbers that others published of the settings of `galloping.trials.published`.

Lorenz: how many of DRAWS draws of the noise gave exactly the right terms, as kept in
AHsu98/jsindy at da8393e, `paper-figures/lorenz-heatmap` (MIT licence, copyright 2025 Alexander W.
Hsu, Ike W. Griss Salas, Jacob M. Stevens-Haas, J. Nathan Kutz, Aleksandr Aravkin and Bamdad
Hosseini), the row of ODR-BINDy by its author L. Fung (arXiv 2507.23426). ODR-BINDy is told the
size of the noise. Of van der Pol and Roessler the authors give pictures and no numbers.
Intervals: PSI-SINDy, arXiv 2610.11486, 5,000 draws; the size of the noise is known.
"""

from __future__ import annotations

DRAWS = 128
DURATIONS = (4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)  # s: columns
LEVELS = tuple(k / 40 for k in range(1, 17))  # of the noise: rows
_LORENZ = {
    "odr_bindy": """
        128 128 128 128 128 127 128
        128 128 128 128 128 127 128
        128 128 128 128 128 127 128
        128 128 128 128 128 127 128
        127 128 128 128 128 127 128
        121 127 128 127 128 127 128
        102 122 125 127 126 127 128
         73 111 117 120 125 127 128
         52  99 111 114 123 127 126
         40  85 100 112 120 126 121
         22  74  88 100 119 125 125
         18  56  69  92 113 121 118
         12  41  53  65  98 111 114
          5  29  34  49  88 103 108
          5  15  32  39  68  90 105
          5  19  24  32  48  82  94
    """,
    "jsindy": """
        128 128 128 128 128 128 128
        125 124 124 127 127 127 127
        108 114 116 118 120 126 123
         93  98 107 110 107 116 119
         87  86  89  96  99 104 110
         79  78  84  91  95 103 104
         64  76  81  90  83  97  97
         53  69  74  86  74  88  91
         38  62  71  78  67  82  89
         37  45  58  70  65  79  82
         24  47  53  69  59  69  80
         19  41  40  70  56  69  70
         14  33  40  56  53  65  70
         15  29  42  54  48  57  67
         11  23  38  51  40  49  65
          9  22  31  46  44  45  55
    """,
    "ensemble_weak_sindy": """
         45  30  36  32  39  57  60
         26  29  34  35  36  33  25
         11  17  17  14  13  16  12
          1   5   9   8   7   5   6
          1   2   4   4   1   4   4
          0   2   0   2   2   3   3
          0   0   0   1   2   0   4
          0   0   0   0   0   2   1
          0   1   0   3   0   1   0
          0   1   0   1   0   2   0
          0   1   0   0   0   1   1
          0   0   0   0   0   0   0
          0   0   0   0   0   1   1
          0   0   0   0   0   1   0
          0   0   0   0   0   0   1
          0   0   0   0   0   0   1
    """,
}
METHODS = {
    "odr_bindy": "ODR-BINDy (told the noise)",
    "jsindy": "JSINDy",
    "ensemble_weak_sindy": "ensemble weak SINDy",
}


def _shares(counts: str) -> dict[tuple[float, float], float]:
    """Shares of exact terms by duration and level."""
    rows = [[int(count) for count in line.split()] for line in counts.strip().splitlines()]
    return {
        (duration, level): count / DRAWS
        for level, row in zip(LEVELS, rows, strict=True)
        for duration, count in zip(DURATIONS, row, strict=True)
    }


# by system, method, and (duration, level)
EXACT = {"lorenz": {method: _shares(counts) for method, counts in _LORENZ.items()}}

# PSI-SINDy, of the quadratic coefficient. Without one: the least and the largest share of the
# intervals of 95 % that hold zero, and the same of naive tests at level 0.05 that reject it, over
# 200, 800, 1,600 and 3,200 samples; the median width of the intervals at the ends of that range.
# With one: the share of its tests that reject zero.
HOLDING, NAIVE_REJECTIONS = (0.946, 0.956), (0.074, 0.087)
WIDTHS = {200: 0.385, 3200: 0.096}
POWER = {("gamma 0.02", 800): 0.0675, ("gamma 0.16", 800): 0.6485}
