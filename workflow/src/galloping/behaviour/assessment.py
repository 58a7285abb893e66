"""Results of an assessment at each value of the inputs: equilibria, limit cycles, onset."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from galloping.arrays import Immutable
from galloping.behaviour.dynamics import Value
from galloping.readers.units import plain_unit

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, eq=False)
class SmallMotion(Immutable):
    """Mode of small motion about an equilibrium: an oscillation, or a drift at zero frequency.

    state: the one that mostly moves. frequency: Hz. damping: ratio to critical, negative if the
    motion grows; of a drift its rate of decay, 1/s.
    """

    state: str
    frequency: Value
    damping: Value


@dataclass(frozen=True, eq=False)
class RestPosition(Immutable):
    """Equilibrium of a model, with the modes of small motion about it.

    place: by state. modes: of small motions about it, the slowest first. is_extrapolated: whether
    it lies outside the recorded range.
    """

    place: Mapping[str, Value]
    modes: tuple[SmallMotion, ...]
    is_extrapolated: bool = False

    @property
    def stable(self) -> bool:
        """Whether all small motions about the equilibrium die out."""
        return all(mode.damping.value > 0 for mode in self.modes)


@dataclass(frozen=True, eq=False)
class Cycle(Immutable):
    """Limit cycle of a model: amplitudes and period with intervals, and stability.

    half_range: by state. period: s. found: share of the drawn models that have it. is_extrapolated:
    whether it is larger than the recorded motion.
    """

    half_range: Mapping[str, Value]
    period: Value
    stable: bool
    found: float
    is_extrapolated: bool = False


@dataclass(frozen=True, eq=False)
class Condition(Immutable):
    """Equilibria and limit cycles of a model at one constant value of each input.

    ends: kinds of motions that do not approach a limit cycle.
    """

    at: Mapping[str, float]
    equilibria: tuple[RestPosition, ...]
    cycles: tuple[Cycle, ...]
    ends: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Onset(Immutable):
    """Input value at which small motions about an equilibrium begin or cease to grow.

    frequency: Hz. is_growing_above: whether they grow above it.
    """

    value: Value
    frequency: float
    is_growing_above: bool


@dataclass(frozen=True, eq=False)
class Assessment(Immutable):
    """Equilibria, limit cycles and onsets of galloping of a model at given input values.

    Attributes
    ----------
    conditions : tuple of Condition
        Equilibria and limit cycles at each value.
    along : str
        Name of the input that has a range, or ''.
    span : tuple of float
        Ends of that range.
    onsets : tuple of Onset
        In the order of the range.
    notes : tuple of str
        What could not be computed, and which values extrapolate.
    is_complete : bool
        Whether the equilibrium was followed along the whole range.
    """

    conditions: tuple[Condition, ...]
    along: str = ""
    span: tuple[float, float] = (np.nan, np.nan)
    onsets: tuple[Onset, ...] = ()
    notes: tuple[str, ...] = ()
    is_complete: bool = True

    def to_frame(self) -> "DataFrame":
        """Return the equilibria, limit cycles and onsets as a pandas DataFrame.

        Returns
        -------
        DataFrame
            The rows of `assessment_rows`, without units of inputs.
        """
        import pandas as pd  # an extra, and slow to import

        return pd.DataFrame(assessment_rows(self, {}))


def assessment_rows(assessment: Assessment, units: Mapping[str, str]) -> list[dict]:
    """Convert an assessment to table rows, one row for each computed number.

    A row has the inputs, then what, number, stable, quantity, value, low, high, unit, and whether
    the value is outside the recorded range.
    """
    entries: list[tuple] = []
    for condition in assessment.conditions:
        for number, rest in enumerate(condition.equilibria, start=1):
            key = condition.at, "rest", number, rest.stable, rest.is_extrapolated
            entries += [(*key, f"place of {k}", v, plain_unit(k)) for k, v in rest.place.items()]
            for k, mode in enumerate(rest.modes, start=1):
                name = f"of mode {k} ({mode.state})"
                if mode.frequency.value:
                    entries.append((*key, f"frequency {name}", mode.frequency, "Hz"))
                    entries.append((*key, f"damping {name}", mode.damping, ""))
                else:
                    entries.append((*key, f"decay {name}", mode.damping, "1/s"))
        for number, cycle in enumerate(condition.cycles, start=1):
            key = condition.at, "limit cycle", number, cycle.stable, cycle.is_extrapolated
            amplitudes = cycle.half_range.items()
            entries += [(*key, f"half range of {k}", v, plain_unit(k)) for k, v in amplitudes]
            entries.append((*key, "period", cycle.period, "s"))
    no_values, along = dict.fromkeys(assessment.conditions[0].at, np.nan), assessment.along
    for number, onset in enumerate(assessment.onsets, start=1):
        key = no_values, "onset", number, not onset.is_growing_above, False
        entries.append((*key, along, onset.value, units.get(along, "")))
    return [
        {
            **at, "what": what, "number": number, "stable": stable, "quantity": quantity,
            "value": value.value, "low": value.low, "high": value.high, "unit": unit,
            "extrapolated": extrapolated,
        }
        for at, what, number, stable, extrapolated, quantity, value, unit in entries
    ]  # fmt: skip
