"""Which recordings the trials of a study make, and in which batches: more make new batches only."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from galloping.configuration.settings import TrialSection
from galloping.configuration.trials import KINDS, Kind
from galloping.identification.registry import BY_NAME, Method


@dataclass(frozen=True)
class Batch:
    """What one job tries: replicates of one case."""

    name: str
    case: str
    replicates: range


@dataclass(frozen=True)
class Trial:
    """One trial. options: keywords of the kind's function, in plain values."""

    name: str
    kind: Kind
    seed: int
    replicates: int
    batch: int
    cases: tuple[str, ...]
    methods: tuple[Method, ...]
    options: Mapping[str, list]

    @property
    def batches(self) -> tuple[Batch, ...]:
        """Named by their case and replicates, so that one keeps its file when others are added."""
        starts = range(0, self.replicates, self.batch)
        parts = [range(k, min(k + self.batch, self.replicates)) for k in starts]
        return tuple(
            Batch(f"{_file_name(case)}_{part[0]}_to_{part[-1]}", case, part)
            for case in self.cases
            for part in parts
        )


def trial(name: str, configured: TrialSection) -> Trial:
    """A trial as configured, keys left out at the defaults of its kind."""
    kind = KINDS[configured.kind]
    options = {key: getattr(configured, key) or default for key, default in kind.options.items()}
    return Trial(
        name,
        kind,
        configured.seed,
        configured.replicates,
        configured.batch,
        configured.cases or kind.cases,
        tuple(BY_NAME[name] for name in configured.methods or kind.methods),
        {key: list(values) for key, values in options.items()},
    )


def _file_name(case: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", case.lower())
