"""Fits in the settings of published comparisons: as another method's authors set them up.

Exact terms: the chaotic and periodic systems of ODR-BINDy (L. Fung, arXiv 2507.23426; its code,
llfung/ODR-BINDy at 90271d3): recordings of a few periods with noise of the same size on every
state, a share `level` of the standard deviation of all states together over the longest of the
recordings. Intervals: the relaxation of PSI-SINDy (arXiv 2610.11486) towards its equilibrium, whose
quadratic coefficient is zero or small, with noise of known size.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from galloping.bounds import Experiment, on_library, state_bound
from galloping.configuration.kinds import GAMMAS, LONGEST
from galloping.identification.cell import identify
from galloping.intervals import NORMAL_95, generator
from galloping.polynomial import PolynomialModel
from galloping.recording import Recording
from galloping.simulation import Simulator
from galloping.trials.attempts import Attempt, fits
from galloping.trials.systems import model_of

GROUP = "published settings"


@dataclass(frozen=True)
class Setting:
    """A system as it was recorded: its equations, library, initial state, s between samples."""

    equations: Mapping[str, Mapping[str, float]]
    degree: int
    start: tuple[float, ...]
    step: float

    @property
    def model(self) -> PolynomialModel:
        return model_of(self.equations, self.degree)


SETTINGS = {
    "lorenz": Setting(
        {"x": {"x": -10, "y": 10}, "y": {"x": 28, "y": -1, "x z": -1},
         "z": {"x y": 1, "z": -8 / 3}}, 2, (-8, 8, 27), 0.01),
    "van_der_pol": Setting(
        {"x": {"y": 1}, "y": {"x": -1, "y": 0.5, "x^2 y": -0.5}}, 3, (-2, 1), 0.01),
    "rossler": Setting(
        {"x": {"y": -1, "z": -1}, "y": {"x": 1, "y": 0.2}, "z": {"1": 0.2, "x z": 1, "z": -5.7}},
        2, (-6, 5, 0), 0.05),
}  # fmt: skip

# dx/dt = -0.25 - 0.35 x + gamma x^2
CONSTANT, LINEAR = -0.25, -0.35
RELAXATION_START, RELAXATION_END, RELAXATION_NOISE = 1.2, 8.0, 0.06


def exact_terms(
    seed: int,
    case: str,
    replicates: Sequence[int],
    methods: Mapping[str, Mapping],
    *,
    levels: Sequence[float],
    durations: Sequence[float],
) -> Iterator[dict[str, object]]:
    """A row for each fit to a recording of the system `case`: see `attempts.fits`.

    levels: of the noise, relative to the size of the motion. durations: s, up to LONGEST.
    """
    setting = SETTINGS[case]
    true = setting.model
    time = setting.step * np.arange(round(LONGEST[case] / setting.step))
    motion = Simulator(true.states, true.terms)(true, np.array(setting.start, float), time).states
    for duration in durations:
        rows = slice(round(duration / setting.step))
        for level in levels:
            sigma = np.full(len(true.states), level * motion.std())
            columns = {
                "group": GROUP, "system": case, "duration": duration, "level": level, "seed": seed,
            }  # fmt: skip
            experiment = Experiment(motion[0], time[rows], sigma)
            bound = state_bound(true, np.argwhere(true.support), [experiment])
            attempts = []
            for replicate in replicates:
                named = columns | {"replicate": replicate}
                rng = generator(*_drawn(named))
                noise = sigma * rng.standard_normal(motion[rows].shape)
                recording = Recording(time[rows], true.states, motion[rows] + noise)
                attempts.append(Attempt(named, true, recording, on_library(true, bound)))
            yield from fits(attempts, methods)


def intervals(
    seed: int,
    case: str,
    replicates: Sequence[int],
    methods: Mapping[str, Mapping],
    *,
    samples: Sequence[int],
) -> Iterator[dict[str, object]]:
    """A row for each fit to a relaxation with the quadratic coefficient of `case`.

    status, exact: as in `scores.claims`. found: whether the model has x^2. holds: whether the
    interval of 95 % that does not trust the terms has its true coefficient; width: of it.
    """
    equation = {"1": CONSTANT, "x": LINEAR, "x^2": GAMMAS[case]}
    true = model_of({"x": equation}, 3)
    quadratic = true.terms.index((2,))
    simulator = Simulator(true.states, true.terms)
    for count in samples:
        time = np.linspace(0.0, RELAXATION_END, count)
        motion = simulator(true, np.array([RELAXATION_START]), time).states
        for replicate in replicates:
            columns = {"case": case, "samples": count, "seed": seed, "replicate": replicate}
            rng = generator(*_drawn(columns))
            values = motion + RELAXATION_NOISE * rng.standard_normal(motion.shape)
            noise = np.array([[RELAXATION_NOISE], [np.nan]])
            recording = Recording(time, true.states, values, known_noise=noise)
            name = list(map(str, columns.values()))
            for method, models in identify(methods, [[recording]], true.terms, name).items():
                (result,) = models
                error = result.unconditional_errors[0, quadratic]
                distance = abs(result.model.coefficients[0, quadratic] - GAMMAS[case])
                yield {
                    **columns,
                    "method": method,
                    "status": result.status,
                    "exact": bool(np.array_equal(result.support, true.support)),
                    "found": bool(result.support[0, quadratic]),
                    "holds": bool(distance <= NORMAL_95 * error),
                    "width": float(2.0 * NORMAL_95 * error),
                }


def _drawn(columns: Mapping[str, object]) -> tuple[int, str]:
    """What the noise of a recording is drawn from: the seed and the names of the rest."""
    names = [f"{key} {value}" for key, value in columns.items() if key != "seed"]
    return columns["seed"], "/".join(names)
