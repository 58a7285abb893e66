"""Fits to recordings of published polynomial systems, periodic and chaotic.

Equations and parameters are those of the sources named; parameters and initial states of the
chaotic flows are as in the collection of Gilpin (NeurIPS 2021, `dysts`), on their attractors. A
recording lasts thirty of a system's periods, whatever its number of samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from galloping.bounds.cell import on_library
from galloping.bounds.information import Experiment, state_bound
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

    source: str
    equations: Mapping[str, Mapping[str, float]]
    start: tuple[float, ...]
    period: float
    chaotic: bool = True

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


def _sprott(case: str, start: tuple, period: float, x: dict, y: dict, z: dict) -> PublishedSystem:
    source = f"Sprott, Physical Review E 50 (1994), case {case}"
    return PublishedSystem(source, {"x": x, "y": y, "z": z}, start, period)


SYSTEMS = {
    # oscillators
    "van_der_pol": PublishedSystem(
        "van der Pol, Philosophical Magazine 2 (1926)",
        {"x": {"y": 1}, "y": {"x": -1, "y": 1, "x^2 y": -1}}, (0.5, 0), 6.66, False),
    "relaxation": PublishedSystem(
        "van der Pol, Philosophical Magazine 2 (1926), damping of 5",
        {"x": {"y": 1}, "y": {"x": -1, "y": 5, "x^2 y": -5}}, (0.5, 0), 11.6, False),
    "rayleigh": PublishedSystem(
        "Rayleigh, The Theory of Sound (1877)",
        {"x": {"y": 1}, "y": {"x": -1, "y": 1, "y^3": -1 / 3}}, (0.5, 0), 6.66, False),
    "duffing": PublishedSystem(
        "Duffing, Erzwungene Schwingungen (1918)",
        {"x": {"y": 1}, "y": {"x": -1, "y": -0.05, "x^3": -1}}, (2, 0), 4.0, False),
    "cubic_damped": PublishedSystem(
        "Brunton, Proctor and Kutz, PNAS 113 (2016), cubic oscillator",
        {"x": {"x^3": -0.1, "y^3": 2}, "y": {"x^3": -2, "y^3": -0.1}}, (2, 0), 0.9, False),
    "stuart_landau": PublishedSystem(
        "Stuart, Journal of Fluid Mechanics 9 (1960)",
        {"x": {"x": 0.2, "y": -1, "x^3": -1, "x y^2": -1},
         "y": {"x": 1, "y": 0.2, "x^2 y": -1, "y^3": -1}}, (0.01, 0), 6.28, False),
    "wake": PublishedSystem(
        "Noack et al., Journal of Fluid Mechanics 497 (2003), mean-field model",
        {"x": {"x": 0.1, "y": -1, "x z": -1}, "y": {"x": 1, "y": 0.1, "y z": -1},
         "z": {"x^2": 1, "y^2": 1, "z": -1}}, (0.01, 0, 0), 6.28, False),
    "linear": PublishedSystem(
        "Brunton, Proctor and Kutz, PNAS 113 (2016), linear oscillator",
        {"x": {"x": -0.1, "y": 2}, "y": {"x": -2, "y": -0.1}}, (2, 0), 1.2, False),
    "sel_kov": PublishedSystem(
        "Sel'kov, European Journal of Biochemistry 4 (1968), glycolysis",
        {"x": {"x": -1, "y": 0.08, "x^2 y": 1}, "y": {"1": 0.6, "y": -0.08, "x^2 y": -1}},
        (1, 1), 7.0, False),
    "brusselator": PublishedSystem(
        "Prigogine and Lefever, Journal of Chemical Physics 48 (1968)",
        {"x": {"1": 1, "x": -4, "x^2 y": 1}, "y": {"x": 3, "x^2 y": -1}}, (1, 1), 7.2, False),
    # populations
    "lotka_volterra": PublishedSystem(
        "Lotka, PNAS 6 (1920)",
        {"x": {"x": 1, "x y": -0.5}, "y": {"y": -1, "x y": 0.25}}, (6, 3), 6.6, False),
    "three_competitors": PublishedSystem(
        "May and Leonard, SIAM Journal on Applied Mathematics 29 (1975)",
        {"x": {"x": 1, "x^2": -1, "x y": -0.8, "x z": -1.3},
         "y": {"y": 1, "y^2": -1, "y z": -0.8, "x y": -1.3},
         "z": {"z": 1, "z^2": -1, "x z": -0.8, "y z": -1.3}}, (0.5, 0.3, 0.2), 20.0, False),
    "four_species": PublishedSystem(
        "Vano et al., Nonlinearity 19 (2006)",
        {"x": {"x": 1, "x^2": -1, "x y": -1.09, "x z": -1.52},
         "y": {"y": 0.72, "y^2": -0.72, "y z": -0.3168, "y w": -0.9792},
         "z": {"z": 1.53, "x z": -3.5649, "z^2": -1.53, "z w": -0.7191},
         "w": {"w": 1.27, "x w": -1.5367, "y w": -0.6477, "z w": -0.4445, "w^2": -1.27}},
        (0.3013, 0.4586, 0.1307, 0.3557), 15.0),
    # neurons
    "fitzhugh_nagumo": PublishedSystem(
        "FitzHugh, Biophysical Journal 1 (1961)",
        {"x": {"1": 0.5, "x": 1, "x^3": -1 / 3, "y": -1},
         "y": {"1": 0.056, "x": 0.08, "y": -0.064}}, (-1, 1), 39.5, False),
    "hindmarsh_rose": PublishedSystem(
        "Hindmarsh and Rose, Proceedings of the Royal Society B 221 (1984)",
        {"x": {"1": 3, "y": 1, "x^2": 3, "x^3": -1, "z": -1},
         "y": {"1": 1, "x^2": -5, "y": -1}, "z": {"1": 0.0384, "x": 0.024, "z": -0.006}},
        (-1.3, -7.5, 3.0), 12.0),
    # chaotic flows
    "lorenz": PublishedSystem(
        "Lorenz, Journal of the Atmospheric Sciences 20 (1963)",
        {"x": {"x": -10, "y": 10}, "y": {"x": 28, "y": -1, "x z": -1},
         "z": {"x y": 1, "z": -8 / 3}}, (-9.79, -15.04, 20.53), 1.5),
    "rossler": PublishedSystem(
        "Rossler, Physics Letters A 57 (1976)",
        {"x": {"y": -1, "z": -1}, "y": {"x": 1, "y": 0.2},
         "z": {"1": 0.2, "x z": 1, "z": -5.7}}, (6.51, 0.477, 0.342), 5.91),
    "chen": PublishedSystem(
        "Chen and Ueta, International Journal of Bifurcation and Chaos 9 (1999)",
        {"x": {"x": -35, "y": 35}, "y": {"x": -7, "y": 28, "x z": -1},
         "z": {"x y": 1, "z": -3}}, (3.27, 5.3, 19.4), 0.587),
    "halvorsen": PublishedSystem(
        "Sprott, Elegant Chaos (2010)",
        {"x": {"x": -1.4, "y": -4, "z": -4, "y^2": -1},
         "y": {"y": -1.4, "z": -4, "x": -4, "z^2": -1},
         "z": {"z": -1.4, "x": -4, "y": -4, "x^2": -1}}, (-8.68, -2.47, 0.07), 1.49),
    "rucklidge": PublishedSystem(
        "Rucklidge, Journal of Fluid Mechanics 237 (1992)",
        {"x": {"x": -2, "y": 6.7, "y z": -1}, "y": {"x": 1}, "z": {"y^2": 1, "z": -1}},
        (1.93, 3.19, 5.78), 6.07),
    "nose_hoover": PublishedSystem(
        "Nose, Journal of Chemical Physics 81 (1984)",
        {"x": {"y": 1}, "y": {"x": -1, "y z": 1}, "z": {"1": 1.5, "y^2": -1}},
        (-1.98, 0.25, 0.79), 5.87),
    "genesio_tesi": PublishedSystem(
        "Genesio and Tesi, Automatica 28 (1992)",
        {"x": {"y": 1}, "y": {"z": 1}, "z": {"x": -1, "y": -1.1, "z": -0.44, "x^2": 1}},
        (-0.054, -0.26, 0.335), 5.94),
    "arneodo": PublishedSystem(
        "Arneodo, Coullet and Tresser, Physics Letters A 79 (1980)",
        {"x": {"y": 1}, "y": {"z": 1}, "z": {"x": 5.5, "y": -4.5, "z": -1, "x^3": -1}},
        (-2.75, 0.19, 3.47), 3.16),
    "shimizu_morioka": PublishedSystem(
        "Shimizu and Morioka, Physics Letters A 76 (1980)",
        {"x": {"y": 1}, "y": {"x": 1, "y": -0.85, "x z": -1}, "z": {"z": -0.5, "x^2": 1}},
        (0.017, 0.035, 0.35), 12.0),
    "circulation": PublishedSystem(
        "Lorenz, Tellus 36A (1984)",
        {"x": {"x": -0.25, "1": 2.0, "y^2": -1, "z^2": -1},
         "y": {"x y": 1, "x z": -4, "y": -1, "1": 1},
         "z": {"x y": 4, "x z": 1, "z": -1}}, (1.37, 0.93, 0.64), 1.45),
    "rabinovich_fabrikant": PublishedSystem(
        "Rabinovich and Fabrikant, Soviet Physics JETP 50 (1979)",
        {"x": {"y z": 1, "y": -1, "x^2 y": 1, "x": 0.87},
         "y": {"x z": 3, "x": 1, "x^3": -1, "y": 0.87}, "z": {"z": -2.2, "x y z": -2}},
        (-1.82, 0.83, 0.21), 2.34),
    "rikitake": PublishedSystem(
        "Rikitake, Proceedings of the Cambridge Philosophical Society 54 (1958)",
        {"x": {"x": -1, "y z": 1}, "y": {"y": -1, "x": -1, "x z": 1}, "z": {"1": 1, "x y": -1}},
        (-0.78, -0.63, 2.67), 5.9),
    "moore_spiegel": PublishedSystem(
        "Moore and Spiegel, Astrophysical Journal 143 (1966)",
        {"x": {"y": 1}, "y": {"z": 1}, "z": {"z": -1, "y": 5, "x^2 y": -9, "x": -4}},
        (-0.35, 1.97, -0.38), 4.0),
    "hyperchaos": PublishedSystem(
        "Rossler, Physics Letters A 71 (1979)",
        {"x": {"y": -1, "z": -1}, "y": {"x": 1, "y": 0.25, "w": 1}, "z": {"1": 3, "x z": 1},
         "w": {"z": -0.5, "w": 0.05}}, (-20, 0, 0.15, 15), 6.0),
    "sprott_a": _sprott("A", (1.54, 1.43, -1.53), 6.37,
        {"y": 1}, {"x": -1, "y z": 1}, {"1": 1, "y^2": -1}),
    "sprott_b": _sprott("B", (1.69, 1.48, -0.54), 11.05,
        {"y z": 1}, {"x": 1, "y": -1}, {"1": 1, "x y": -1}),
    "sprott_c": _sprott("C", (-0.47, -0.27, 1.94), 8.89,
        {"y z": 1}, {"x": 1, "y": -1}, {"1": 1, "x^2": -1}),
    "sprott_d": _sprott("D", (-1.34, -0.21, 0.33), 4.83,
        {"y": -1}, {"x": 1, "z": 1}, {"x z": 1, "y^2": 3}),
    "sprott_g": _sprott("G", (-0.77, -0.75, 1.31), 8.71,
        {"x": 0.4, "z": 1}, {"x z": 1, "y": -1}, {"x": -1, "y": 1}),
    "sprott_m": _sprott("M", (1.6, -1.6, -2.62), 5.36,
        {"z": -1}, {"x^2": -1, "y": -1}, {"1": 1.7, "x": 1.7, "y": 1}),
    "sprott_s": _sprott("S", (0.126, 0.123, 1.22), 3.35,
        {"x": -1, "y": -4}, {"x": 1, "z^2": 1}, {"1": 1, "x": 1}),
}  # fmt: skip


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
