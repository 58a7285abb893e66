"""Study as its settings describe it: cases, measurement setups, study cells, sweeps and trials.

Sweeps and trials are divided into pieces, one per job. In an extended study, a piece keeps its name
and file, and additions are new pieces.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from galloping.configuration.kinds import EXAM, KINDS
from galloping.configuration.load import plain
from galloping.configuration.settings import Settings, TrialSection
from galloping.cycles.family import PARAMETERS
from galloping.identification import registry
from galloping.identification.registry import Method
from galloping.recording.measurement import PROTOCOLS_BY_NAME, Protocol
from galloping.results import JOINT, NOISE, SUBSET


def drop_swept_parameters(line: Mapping, *parameters: str | None) -> dict:
    """Remove the values of swept parameters, on which no sweep depends, from a line's settings."""
    swept = {place for name in parameters if name for place in PARAMETERS[name].places}
    return {
        section: {key: value for key, value in keys.items() if (section, key) not in swept}
        if isinstance(keys, Mapping)
        else keys
        for section, keys in line.items()
    }


@dataclass(frozen=True)
class Sweep:
    """Parameter sweep of a study: all values of one parameter, or of two parameters on a grid."""

    name: str
    parameter: str
    values: tuple[float, ...]
    second: str | None
    second_values: tuple[float, ...]

    @property
    def is_map(self) -> bool:
        """Whether the sweep varies two parameters instead of one."""
        return self.second is not None

    @property
    def ends(self) -> list[float]:
        """First and last value of the sweep's first parameter."""
        return [self.values[0], self.values[-1]]

    @property
    def blocks(self) -> dict[str, float | None]:
        """Parts of the sweep, one for each job: name to value of the second parameter, or to None.

        Each has all values of the first parameter. New values are added to the file of each.
        """
        if not self.is_map:
            return {self.parameter: None}
        return {f"{self.second}_{value:.12g}": value for value in self.second_values}


def _spaced_values(first: float, last: float, step: float) -> tuple[float, ...]:
    count = int((last - first) / step + 1e-9) + 1
    return tuple(round(first + k * step, 12) for k in range(count))


@dataclass(frozen=True)
class Batch:
    """Part of a trial (numerical experiment) that one job computes: some replicates of one case."""

    name: str
    case: str
    replicates: range


@dataclass(frozen=True)
class Trial:
    """Numerical experiment: methods identify many simulated recordings whose truth is known.

    table: that summarises its rows. options: keywords of the kind's function, in plain values.
    """

    name: str
    table: str
    seed: int
    replicates: int
    batch: int
    cases: tuple[str, ...]
    methods: tuple[Method, ...]
    options: Mapping[str, list]

    @property
    def batches(self) -> tuple[Batch, ...]:
        """Parts that separate jobs compute: some replicates of a case, named after both."""
        starts = range(0, self.replicates, self.batch)
        parts = [range(k, min(k + self.batch, self.replicates)) for k in starts]
        return tuple(
            Batch(f"{re.sub(r'[^a-z0-9]+', '_', case.lower())}_{part[0]}_to_{part[-1]}", case, part)
            for case in self.cases
            for part in parts
        )


def _make_trial(name: str, configured: TrialSection, is_exam: bool) -> Trial:
    kind = KINDS[configured.kind]
    options = {key: getattr(configured, key) or default for key, default in kind.options.items()}
    return Trial(
        name,
        EXAM if is_exam else kind.table,
        configured.seed,
        configured.replicates,
        configured.batch,
        configured.cases or kind.cases,
        tuple(registry.BY_NAME[name] for name in configured.methods or kind.methods),
        {key: list(values) for key, values in options.items()},
    )


@dataclass(frozen=True)
class Case:
    """Case of a study: an overhead line in one wind, its initial states, and the truth simulated.

    line: its settings except the initial states. releases: initial states by state, the one for the
    assessment of models first. truth: the system behind its recordings.
    """

    name: str
    line: Mapping
    releases: tuple[Mapping[str, float], ...]
    truth: Mapping

    @property
    def is_continuous(self) -> bool:
        """Whether the truth is a continuous line, for which no library has true coefficients."""
        return self.truth["model"] == "continuous"

    @property
    def released(self) -> dict:
        """Settings of the line, with the first of its initial states."""
        return {**self.line, "initial_state": dict(self.releases[0])}


@dataclass(frozen=True)
class Cell:
    """Study cell: recordings of one case with one measurement setup, noise level and sample count.

    They differ in the noise realisation. kind: NOISE (a whole record), SUBSET (random samples of
    it) or JOINT (all recordings of the case together). level: of the noise. relative: whether it is
    in units of the states' deviations. samples: of each recording. recordings: number that share a
    model. methods: those that can use them, in the order of the registry, so that jobs do not
    depend on the order in the settings.
    """

    case: Case
    protocol: Protocol
    name: str
    kind: str
    level: float
    relative: bool
    samples: int
    recordings: int
    replicates: int
    seed: int
    methods: tuple[Method, ...]

    @property
    def id(self) -> str:
        """Relative path of the study cell's files: `case/protocol/cell`."""
        return "/".join(self.wildcards.values())

    @property
    def wildcards(self) -> dict[str, str]:
        """Names of case, measurement setup and study cell, as wildcards of Snakemake."""
        return {"case": self.case.name, "protocol": self.protocol.name, "cell": self.name}

    @property
    def measurement(self) -> dict:
        """Keyword arguments for simulating the recordings of the study cell."""
        names = ("level", "relative", "samples", "recordings", "replicates", "seed")
        return {"protocol": self.protocol.name, **{name: getattr(self, name) for name in names}}

    @property
    def columns(self) -> dict:
        """Values that identify the study cell in a table: case, noise level, samples and others."""
        return {
            **self.wildcards,
            "kind": self.kind,
            "level": self.level,
            "points": self.samples,
            "recordings": self.recordings,
        }

    @property
    def families(self) -> dict[str, tuple[Method, ...]]:
        """Identification methods of the study cell, grouped by the job that runs them."""
        names = dict.fromkeys(method.family for method in self.methods)
        return {name: tuple(m for m in self.methods if m.family == name) for name in names}


@dataclass(frozen=True)
class Study:
    """All computations of a study, from its validated settings."""

    settings: Settings

    @cached_property
    def plain(self) -> dict:
        """Settings of the study as nested plain Python types, such as dict, list and float."""
        return plain(self.settings)

    @property
    def doubts(self) -> list[str]:
        """Warnings about settings that the user may have meant differently, one line each."""
        measurement = self.settings.measurement
        levels = {*measurement.levels, *measurement.joint_levels, measurement.subsets.level}
        scaled = any(protocol.is_scaled for protocol in self.protocols)
        if measurement.state_noise != "relative" or not scaled or max(levels) < 1:
            return []
        level = max(levels)
        return [
            f"measurement: noise level {level:g} is {level:.0%} of the deviation of a state; if "
            f"{level:g} % is meant, write {level / 100:g}"
        ]

    @cached_property
    def cases(self) -> tuple[Case, ...]:
        """Cases of the study (each an overhead line in one wind), in the order of the settings."""
        return tuple(
            Case(
                name,
                {
                    k: v
                    for k, v in case.items()
                    if k not in ("initial_state", "initial_states", "truth")
                },
                (case["initial_state"], *case["initial_states"].values()),
                case["truth"],
            )
            for name, case in self.plain["cases"].items()
        )

    @property
    def protocols(self) -> tuple[Protocol, ...]:
        """Measurement setups of the study, in the order of the settings."""
        return tuple(PROTOCOLS_BY_NAME[name] for name in self.settings.measurement.protocols)

    @property
    def methods(self) -> tuple[Method, ...]:
        """Identification methods of the study, in the order of the settings."""
        return tuple(registry.BY_NAME[name] for name in self.settings.identification.methods)

    def case(self, name: str) -> Case:
        """Return the case (an overhead line in one wind) that has a given name."""
        return next(case for case in self.cases if case.name == name)

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """Study cells that at least one method can use, by case and measurement setup."""
        return tuple(
            cell
            for case in self.cases
            for protocol in self.protocols
            for cell in self._cells_of_protocol(case, protocol)
            if cell.methods
        )

    def cell(self, case: str, protocol: str, cell: str) -> Cell:
        """Return a study cell (set of noisy recordings) by its case, measurement setup and name."""
        return self._by_name[case, protocol, cell]

    @cached_property
    def _by_name(self) -> dict[tuple[str, ...], Cell]:
        return {tuple(cell.wildcards.values()): cell for cell in self.cells}

    def _cells_of_protocol(self, case: Case, protocol: Protocol) -> Iterator[Cell]:
        measurement, whole = self.settings.measurement, self.settings.simulation.samples
        subsets, joint = measurement.subsets, len(case.releases)
        described = [(NOISE, level, level, whole, 1) for level in measurement.levels]
        described += [(SUBSET, points, subsets.level, points, 1) for points in subsets.points]
        if joint > 1:
            described += [(JOINT, level, level, whole, joint) for level in measurement.joint_levels]
        relative = protocol.is_scaled and measurement.state_noise == "relative"
        methods = [method for method in registry.METHODS if method in self.methods]
        for kind, number, level, samples, recordings in described:
            is_random = level > 0 or kind == SUBSET  # else all replicates are equal
            yield Cell(
                case=case,
                protocol=protocol,
                name=f"{kind}_{number:.12g}",
                kind=kind,
                level=level,
                relative=level > 0 and relative,
                samples=samples,
                recordings=recordings,
                replicates=measurement.replicates if is_random else 1,
                seed=measurement.seed if is_random else 0,
                methods=tuple(m for m in methods if m.can_use(protocol, uniform=kind != SUBSET)),
            )

    @cached_property
    def sweeps(self) -> tuple[Sweep, ...]:
        """Parameter sweeps of the study, in the order of the settings."""
        return tuple(
            Sweep(name, section.parameter, _spaced_values(*section.values), section.second,
                  _spaced_values(*section.second_values) if section.second_values else ())
            for name, section in self.settings.sweeps.items()
        )  # fmt: skip

    def sweep(self, name: str) -> Sweep:
        """Return the parameter sweep that has a given name."""
        return next(sweep for sweep in self.sweeps if sweep.name == name)

    @cached_property
    def trials(self) -> tuple[Trial, ...]:
        """Trials (identifications with known truth) of the study, in the order of the settings."""
        is_exam, trials = self.settings.exam, self.settings.trials
        return tuple(_make_trial(name, section, is_exam) for name, section in trials.items())

    def trial(self, name: str) -> Trial:
        """Return the trial (identification of many recordings with known truth) of a given name."""
        return next(trial for trial in self.trials if trial.name == name)

    def options(self, method: Method) -> dict:
        """Return the settings of the study that an identification method reads."""
        return method.settings(self.plain["identification"], self.settings.measurement.seed)
