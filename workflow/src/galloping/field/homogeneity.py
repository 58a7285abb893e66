"""Whether recordings, and the parts of one, are motions of one and the same system."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from galloping.identification.model import IdentifiedModel
from galloping.recording import Recording

THIRDS = 3  # parts of a recording, which are compared
LEAST_PERIODS = 15  # of a part
# Share of the motion that one model misses, below which a difference changes no number of interest,
# and how many times as much as models of the parts it then misses. Measured: on lines in gusts of
# 5 % one model misses no more than those of the thirds do, in winds 4 % apart five times as much.
RELEVANT, WORSE = 0.03, 2.0
SHARE = "error_share_all_"  # and a channel: a diagnostic of approximate models

Identify = Callable[[Sequence[Recording]], IdentifiedModel]


@dataclass(frozen=True)
class Difference:
    """How much worse one model of several parts is than a model of each.

    channel: of which this is plainest. together, alone: share of its motion that forecasts miss, by
    one model, NaN where there is none, and at the median by those of the parts.
    """

    channel: str
    together: float
    alone: float

    def __str__(self) -> str:
        own = f"{self.alone:.1%}" if self.alone else "nothing but noise"
        if np.isnan(self.together):
            return f"none follows all; models of each by itself miss {own} of {self.channel}"
        return (
            f"its forecasts miss {self.together:.1%} of {self.channel}, and models of each by "
            f"itself miss {own}"
        )


def parts_of(recording: Recording, period: float) -> list[Recording]:
    """A recording in thirds of its time, empty where they hold too few periods, s, to tell."""
    time = recording.time
    if np.ptp(time) < THIRDS * LEAST_PERIODS * period:
        return []
    edges = np.searchsorted(time, np.linspace(time[0], time[-1], THIRDS + 1))
    return [recording[slice(a, b)] for a, b in pairwise(edges)]


def difference(
    together: IdentifiedModel, parts: Sequence[Recording], identify: Identify
) -> Difference | None:
    """What sets parts of recordings apart that were identified together, None where nothing does.

    A model that is exact misses nothing, and what is followed by one is one system.
    """
    if together.status not in ("approximate", "refused") or len(parts) < 2:
        return None
    alone = [identify([part]) for part in parts]
    if any(each.status == "refused" for each in alone):
        return None
    names = {
        key.removeprefix(SHARE)
        for each in (together, *alone)
        for key in each.diagnostics
        if key.startswith(SHARE)
    }
    found = []
    for name in sorted(names) or [together.model.states[0]]:
        missed = together.diagnostics.get(SHARE + name, np.nan)
        own = float(np.median([each.diagnostics.get(SHARE + name, 0.0) for each in alone]))
        if together.status == "refused":
            found += [Difference(name, np.nan, own)] if own < RELEVANT else []
        elif missed > max(RELEVANT, WORSE * own):
            found.append(Difference(name, missed, own))
    return max(found, key=lambda each: each.together, default=None)
