"""Fits to recordings of published polynomial systems, also with settings of other authors.

Systems: `configuration/systems.csv` has them, periodic and chaotic; equations and parameters are
those of the sources named; parameters and initial states of the chaotic flows are as in the
collection of Gilpin (NeurIPS 2021, `dysts`), on their attractors. A recording has the length of
thirty of a system's periods, with any number of samples. Exact terms: the chaotic and periodic
systems of ODR-BINDy (L. Fung, arXiv 2507.23426; its code, llfung/ODR-BINDy at 90271d3): recordings
of a few periods with noise of the same size on every state, a share `level` of the standard
deviation of all states together over the longest of the recordings. Intervals: the relaxation of
PSI-SINDy (arXiv 2610.11486) towards its equilibrium, whose quadratic coefficient is zero or small,
with noise of known size.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from galloping.configuration.kinds import GAMMAS, PUBLISHED, PUBLISHED_DURATIONS
from galloping.evaluation.bounds import Experiment, on_library, state_bound
from galloping.model.intervals import NORMAL_95
from galloping.model.polynomial import PolynomialModel, polynomial_library
from galloping.model.terms import parse_model
from galloping.recording.samples import Recording
from galloping.streams import make_generator
from galloping.trajectory.simulation import Simulator
from galloping.trials.attempts import Attempt, identify_once, simulate_recording, trial_of

RECORDED_PERIODS = 30  # length of a recording, periods
PIECE_PERIODS = 4  # length of the pieces of a chaotic flow, for its bound, periods


@dataclass(frozen=True)
class PublishedSystem:
    """Dynamical system from the literature: equations, initial state and known period.

    equations: as of `parse_model`. degree: of its library. chaotic: whether it forgets its initial
    state, so that its bound is that of short pieces.
    """

    equations: str
    start: tuple[float, ...]
    period: float = np.nan
    chaotic: bool = False
    degree: int = 3

    @property
    def model(self) -> PolynomialModel:
        """Polynomial model of the system on its library of candidate terms."""
        model = parse_model(self.equations)
        return model.on_library(polynomial_library(len(model.states), self.degree))


SYSTEMS = {
    name: PublishedSystem(
        row["equations"],
        tuple(json.loads(row["start"])),
        float(row["period"]),
        bool(row["chaotic"]),
    )
    for name, row in PUBLISHED.items()
}


@trial_of
def systems(
    seed: int, case: str, replicates: Sequence[int], *, samples: list[int], levels: list[float]
) -> Iterator[Attempt]:
    """Yield noisy recordings of a published system with different numbers of samples and noise.

    case: name of the system. levels: of the noise, in standard deviations of each state. The bound
    of a chaotic flow is that of pieces of PIECE_PERIODS periods, each with an unknown beginning,
    which joined pieces may exceed.
    """
    system = SYSTEMS[case]
    true = system.model
    simulator = Simulator(true.states, true.terms)
    for count in samples:
        time = np.linspace(0.0, RECORDED_PERIODS * system.period, count)
        trajectory = simulator(true, np.array(system.start, float), time)
        if trajectory.status != "ok":
            raise ValueError(f"{case}: {trajectory.status}")
        x = trajectory.states
        pieces = RECORDED_PERIODS // PIECE_PERIODS if system.chaotic else 1
        parts = np.array_split(np.arange(count), pieces)
        for level in levels:
            sigma = level * x.std(axis=0)
            experiments = [Experiment(x[part[0]], time[part], sigma) for part in parts]
            deviations = _bound_deviations(true, experiments)
            for replicate in replicates:
                columns = {
                    "system": case, "states": len(true.states), "samples": count,
                    "protocol": "state", "level": level, "seed": seed, "replicate": replicate,
                }  # fmt: skip
                yield replace(simulate_recording(columns, true, time, x), deviations=deviations)


def _bound_deviations(true: PolynomialModel, experiments: list[Experiment]) -> np.ndarray:
    """Compute deviations at the Cramér-Rao bound, (n_states, n_terms), NaN for absent terms."""
    return on_library(true, state_bound(true, np.argwhere(true.support), experiments))


GROUP = "published settings"
PUBLISHED_SETTINGS = {  # systems with published initial states, and sampling intervals, s, by name
    "lorenz": (replace(SYSTEMS["lorenz"], start=(-8, 8, 27), degree=2), 0.01),
    "van_der_pol": (PublishedSystem("x = y; y = -x + 0.5 y - 0.5 x^2 y", (-2, 1)), 0.01),
    "rossler": (replace(SYSTEMS["rossler"], start=(-6, 5, 0), degree=2), 0.05),
}

RELAXATION = "x = -0.25 - 0.35 x + {} x^2"
RELAXATION_START, RELAXATION_END, RELAXATION_NOISE = 1.2, 8.0, 0.06


@trial_of
def exact_terms(
    seed: int, case: str, replicates: Sequence[int], *, levels: list[float], durations: list[float]
) -> Iterator[Attempt]:
    """Yield simulated recordings of a system, to count how often exactly its terms are found.

    case: name of the system. Noise and durations are those of a published comparison. levels: of
    the noise, relative to the size of the motion. durations: s, up to PUBLISHED_DURATIONS.
    """
    system, step = PUBLISHED_SETTINGS[case]
    true = system.model
    time = step * np.arange(round(PUBLISHED_DURATIONS[case] / step), dtype=np.float64)
    start = np.array(system.start, np.float64)
    motion = Simulator(true.states, true.terms)(true, start, time).states
    for duration in durations:
        rows = slice(round(duration / step))
        for level in levels:
            sigma = np.full(len(true.states), level * motion.std())
            columns = {
                "group": GROUP, "system": case, "duration": duration, "level": level, "seed": seed,
            }  # fmt: skip
            deviations = _bound_deviations(true, [Experiment(motion[0], time[rows], sigma)])
            for replicate in replicates:
                keys = columns | {"replicate": replicate}
                rng = make_generator(*_noise_seed(keys))
                noise = sigma * rng.standard_normal(motion[rows].shape)
                recording = Recording(time[rows], true.states, motion[rows] + noise)
                yield Attempt(keys, true, recording, deviations)


def relaxation_intervals(
    seed: int,
    case: str,
    replicates: Sequence[int],
    methods: Mapping[str, Mapping],
    *,
    samples: Sequence[int],
) -> Iterator[dict[str, object]]:
    """Fit simulated relaxations; yield whether the x^2 coefficient's interval covers the truth.

    case: name of the true quadratic coefficient. There is a row for each fit. Besides the columns
    of `attempts.identify_once`: exact_support, as in `attempts.against_truth`; has_term, whether
    the model has x^2; covered, whether the unconditional 95 % interval contains the true
    coefficient of x^2; interval_width, of that interval.
    """
    true = parse_model(RELAXATION.format(GAMMAS[case])).on_polynomials(3)
    quadratic = true.terms.index((2,))
    simulator = Simulator(true.states, true.terms)
    for count in samples:
        time = np.linspace(0.0, RELAXATION_END, count)
        motion = simulator(true, np.array([RELAXATION_START]), time).states
        for replicate in replicates:
            columns = {"case": case, "samples": count, "seed": seed, "replicate": replicate}
            rng = make_generator(*_noise_seed(columns))
            values = motion + RELAXATION_NOISE * rng.standard_normal(motion.shape)
            noise = np.array([[RELAXATION_NOISE], [np.nan]])
            recording = Recording(time, true.states, values, known_noise=noise)
            name = list(map(str, columns.values()))
            for method, settings in methods.items():
                result, answer = identify_once({method: settings}, [recording], true.terms, name)
                error = result.unconditional_errors[0, quadratic]
                distance = abs(result.model.coefficients[0, quadratic] - GAMMAS[case])
                yield {
                    **columns,
                    **answer,
                    "exact_support": bool(np.array_equal(result.support, true.support)),
                    "has_term": bool(result.support[0, quadratic]),
                    "covered": bool(distance <= NORMAL_95 * error),
                    "interval_width": float(2.0 * NORMAL_95 * error),
                }


def _noise_seed(columns: Mapping[str, Any]) -> tuple[int, str]:
    """Return the seed and the other names from which the noise of a recording is drawn."""
    names = [f"{key} {value}" for key, value in columns.items() if key != "seed"]
    return columns["seed"], "/".join(names)
