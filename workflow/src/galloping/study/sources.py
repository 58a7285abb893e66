"""Files that a job reads, each with the function that reads it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from galloping.study.cells import Cell, Study

FILES = "galloping.study.files"
REGION = Path("results/reference/paper/paper_region.csv")  # what `make paper` found, kept


@dataclass(frozen=True)
class Source:
    """One file. reader: `module:function`, which takes the path."""

    path: str
    reader: str


Sources = Mapping[str, Source | Mapping[str, Source]]  # by name, or by name and key


def model(study: Study, case: str) -> Source:
    """The derived model of a line."""
    return Source(study.paths.model.format(case=case), f"{FILES}.models:read")


def trajectory(study: Study, case: str) -> Source:
    """Its motion after each release."""
    return Source(study.paths.trajectory.format(case=case), f"{FILES}.trajectories:read")


def ranking(study: Study, case: str) -> Source:
    """Its further releases, ranked."""
    return Source(study.paths.ranking.format(case=case), f"{FILES}.tables:read")


def identified(study: Study, cell: Cell, family: str) -> Source:
    """The models that a family of methods found in a cell."""
    path = study.paths.identified.format(**cell.wildcards, family=family)
    return Source(path, f"{FILES}.identified:read")


def bounds(study: Study, cell: Cell) -> Source:
    """The Cramér-Rao bounds of a cell."""
    return Source(study.paths.bounds.format(**cell.wildcards), f"{FILES}.bounds:read")


def scores(study: Study, cell: Cell) -> Source:
    """The scores of a cell."""
    return Source(study.paths.scores.format(**cell.wildcards), f"{FILES}.tables:read")


def oracle(study: Study, cell: Cell) -> Source:
    """The scores of the oracle of a cell."""
    return Source(study.paths.oracle.format(**cell.wildcards), f"{FILES}.tables:read")


def paper_draws(study: Study, case: str) -> Source:
    """The draws of the paper's study by its own method."""
    return Source(study.paths.paper_draws.format(case=case), f"{FILES}.tables:read")


def reconstructions(study: Study, cell: Cell) -> Source:
    """The motions of the models of a cell."""
    path = study.paths.reconstructions.format(**cell.wildcards)
    return Source(path, f"{FILES}.reconstructions:read")


def table(study: Study, name: str) -> Source:
    """A table of the study by name."""
    return Source(study.paths.table.format(table=name), f"{FILES}.tables:read")


def trials(study: Study, *tables: str) -> dict[str, Source]:
    """The fits of all batches of the trials that one of the tables sums up."""
    return {
        f"{trial.name}/{batch.name}": Source(
            study.paths.trial.format(trial=trial.name, batch=batch.name), f"{FILES}.tables:read"
        )
        for trial in study.trials
        if trial.kind.table in tables
        for batch in trial.batches
    }


def swept(study: Study, pattern: str, **names: str) -> Source:
    """A table of a sweep or an assessment. pattern: a field of `Paths`."""
    return Source(getattr(study.paths, pattern).format(**names), f"{FILES}.tables:read")


def orbits(study: Study, case: str) -> Source:
    """The orbits of a line over one period."""
    return Source(study.paths.orbits.format(case=case), f"{FILES}.orbits:read")


def region() -> dict[str, Source]:
    """What was inferred of the settings that the paper does not print, where a clone has it."""
    return {"region": Source(str(REGION), f"{FILES}.tables:read")} if REGION.exists() else {}


def as_written(path: str) -> Source:
    """A table of text."""
    return Source(path, f"{FILES}.tables:read_as_written")


def flat(sources: Sources) -> dict[str, Source]:
    """By `name` or `name/key`, as they are called in a rule."""
    named = {}
    for name, source in sources.items():
        if isinstance(source, Source):
            named[name] = source
        else:
            named |= {f"{name}/{key}": each for key, each in source.items()}
    return named


def readers(sources: Sources) -> dict:
    """The reader of each, as settings of a job."""
    return {
        name: source.reader
        if isinstance(source, Source)
        else {key: each.reader for key, each in source.items()}
        for name, source in sources.items()
    }
