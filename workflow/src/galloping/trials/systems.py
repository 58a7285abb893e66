"""Fits to recordings of published polynomial systems, periodic and chaotic.

`systems.csv` has them: equations and parameters are those of the sources named; parameters and
initial states of the chaotic flows are as in the collection of Gilpin (NeurIPS 2021, `dysts`), on
their attractors. A recording lasts thirty of a system's periods, whatever its number of samples.
"""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from galloping.bounds import Experiment, on_library, state_bound
from galloping.polynomial import PolynomialModel, library
from galloping.simulation import Simulator
from galloping.trials.attempts import fits, measured

DEGREE = 3
PERIODS = 30
REMEMBERED = 4  # periods of a chaotic flow from which its bound is formed


@dataclass(frozen=True)
class PublishedSystem:
    """A published system: equations by state and term, an initial state, a period.

    chaotic: whether it forgets its initial state, so that its bound is that of short pieces.
    """

    equations: Mapping[str, Mapping[str, float]]
    start: tuple[float, ...]
    period: float
    chaotic: bool

    @property
    def model(self) -> PolynomialModel:
        """On the library of all terms up to the third degree."""
        return model_of(self.equations, DEGREE)


def model_of(equations: Mapping[str, Mapping[str, float]], degree: int) -> PolynomialModel:
    """Equations by state and term, such as {"x": {"x y": 1}}, on the library up to `degree`.

    Raises ValueError for a term that is not in the library.
    """
    states = tuple(equations)
    terms = library(len(states), degree)
    names = PolynomialModel(states, terms, np.zeros((len(states), len(terms)))).term_names
    unknown = {term for row in equations.values() for term in row} - set(names)
    if unknown:
        raise ValueError(f"terms {sorted(unknown)} are not in the library")
    rows = [[row.get(name, 0.0) for name in names] for row in equations.values()]
    return PolynomialModel(states, terms, np.array(rows))


def _published() -> Iterator[tuple[str, PublishedSystem]]:
    with Path(__file__).with_name("systems.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            equations = {
                state: {str(term): coefficient for term, coefficient in terms.items()}
                for state, terms in yaml.safe_load(row["equations"]).items()
            }
            start, period = yaml.safe_load(row["start"]), float(row["period"])
            system = PublishedSystem(equations, tuple(start), period, bool(row["chaotic"]))
            yield row["name"], system


SYSTEMS = dict(_published())


def trial(
    seed: int,
    case: str,
    replicates: Sequence[int],
    methods: Mapping[str, Mapping],
    *,
    samples: Sequence[int],
    levels: Sequence[float],
) -> Iterator[dict[str, object]]:
    """A row for each fit to a recording of the system `case`: see `attempts.fits`.

    levels: of the noise, in standard deviations of each state. Of a chaotic flow the bound is that
    of pieces of REMEMBERED periods, each with an unknown beginning, which joined pieces may outdo.
    """
    system = SYSTEMS[case]
    true = system.model
    simulator = Simulator(true.states, true.terms)
    for count in samples:
        time = np.linspace(0.0, PERIODS * system.period, count)
        trajectory = simulator(true, np.array(system.start, float), time)
        if trajectory.status != "ok":
            raise ValueError(f"{case}: {trajectory.status}")
        x = trajectory.states
        for level in levels:
            deviations = _deviations(system, true, time, x, level * x.std(axis=0))
            attempts = []
            for replicate in replicates:
                columns = {
                    "system": case, "states": len(true.states), "samples": count,
                    "protocol": "state", "level": level, "seed": seed, "replicate": replicate,
                }  # fmt: skip
                attempts.append(replace(measured(columns, true, time, x), deviations=deviations))
            yield from fits(attempts, methods)


def _deviations(
    system: PublishedSystem,
    true: PolynomialModel,
    time: np.ndarray,
    x: np.ndarray,
    sigma: np.ndarray,
) -> np.ndarray:
    """(n_states, n_terms) at the Cramer-Rao bound, NaN for absent terms."""
    pieces = PERIODS // REMEMBERED if system.chaotic else 1
    parts = np.array_split(np.arange(len(time)), pieces)
    experiments = [Experiment(x[part[0]], time[part], sigma) for part in parts]
    return on_library(true, state_bound(true, np.argwhere(true.support), experiments))
