"""Fits to recordings of lines drawn at random.

Every line is a bundle of the default conductor with three spacers at the quarter points. Drawn
evenly: the span between 150 and 500 m and both damping ratios between 0.002 and 0.02 on a
logarithmic scale; the tension between 15 and 45 kN; the wind between 6 and 20 m/s; the
aerodynamic coefficients beta_1 in 0.2..1.2, beta_2 in -3..3, beta_3 in -8..-2, eta_1 in -4..4,
and, each absent in half of the lines, eta_2 in -3..3 and eta_3 in -6..6. Lines that do not gallop
are drawn again. Each is recorded twice: released as the default line is, and from q_v in -2..2 m
and q_w in -3..3 m at rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from time import perf_counter

import numpy as np

from galloping.bounds.cell import bound
from galloping.configuration.load import load, plain
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.measurement.measuring import measure, noises_of
from galloping.measurement.motion import Motion
from galloping.physics.equations import EQUATIONS, STATES, model
from galloping.physics.galerkin import coefficients
from galloping.polynomial import PolynomialModel, library
from galloping.seeds import generator
from galloping.simulation import Simulator, time_grid
from galloping.trials.scores import claims

GROUP = "random lines"


def draw(seed: int, number: int) -> tuple[dict, np.ndarray]:
    """The `cases` section of a line that gallops, and its two initial states (2, n_states)."""
    rng = generator(seed, "random line", number)
    while True:
        span = _log_uniform(rng, 150.0, 500.0)
        vertical = [rng.uniform(0.2, 1.2), rng.uniform(-3.0, 3.0), rng.uniform(-8.0, -2.0)]
        horizontal = [rng.uniform(-4.0, 4.0), *_or_absent(rng, 3.0), *_or_absent(rng, 6.0)]
        case = {
            "line": {"span": span, "tension": rng.uniform(15e3, 45e3)},
            "spacers": {"positions": [0.25 * span, 0.5 * span, 0.75 * span]},
            "ice": {"reading": "custom", "vertical": vertical, "horizontal": horizontal},
            "wind": {"speed": rng.uniform(6.0, 20.0)},
            "damping": {
                "vertical": _log_uniform(rng, 0.002, 0.02),
                "horizontal": _log_uniform(rng, 0.002, 0.02),
            },
        }
        case = plain(load({"cases": {"drawn": case}}))["cases"]["drawn"]
        first = [case["initial_state"][state] for state in STATES]
        second = [rng.uniform(-2.0, 2.0), rng.uniform(-3.0, 3.0), 0.0, 0.0]
        if coefficients(case)["gamma_1"] < 0.0:
            return case, np.array([first, second])


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _or_absent(rng: np.random.Generator, size: float) -> list[float]:
    return [rng.uniform(-size, size) * float(rng.random() < 0.5)]


def trial(
    seed: int,
    lines: Sequence[int],
    *,
    protocol: str = "state",
    level: float = 0.05,
    duration: float = 300.0,
    sampling_rate: float = 100.0,
    degree: int = 3,
) -> Iterator[dict[str, object]]:
    """One row for each recording of the lines with these numbers: see `trials.scores`.

    level: of the noise, in standard deviations of each state for the protocols that measure
    states. A line whose motion diverges is left out.
    """
    terms = library(len(STATES), degree)
    time = time_grid(duration, sampling_rate)
    simulator = Simulator(STATES, terms)
    for number in lines:
        case, starts = draw(seed, number)
        true = model(coefficients(case)).on_library(terms)
        for release, start in enumerate(starts):
            trajectory = simulator(true, start, time)
            if trajectory.status != "ok":
                continue
            motion = Motion(STATES, time, trajectory.states, true(trajectory.states))
            name = {"group": GROUP, "case": "all", "protocol": protocol, "level": level}
            yield {
                **name,
                "seed": seed,
                "line": number,
                "release": release,
                **_scored(motion, true, name, seed, (str(number), str(release))),
            }


def _scored(
    motion: Motion,
    true: PolynomialModel,
    cell: Mapping,
    seed: int,
    name: Sequence[str],
) -> dict[str, object]:
    """Measure a motion once, identify, and compare with the truth."""
    protocol, level = cell["protocol"], cell["level"]
    ((recording,),) = measure(
        [motion], protocol=protocol, level=level, relative=True, samples=len(motion.time),
        recordings=1, replicates=1, seed=seed, name=("random lines", *name),
    )  # fmt: skip
    began = perf_counter()
    result = maximum_likelihood([recording], true.terms)
    seconds = perf_counter() - began
    noises = noises_of([motion], protocol, level, True)
    try:
        known = bound(true, tuple(EQUATIONS), [recording], motion.states[:1], noises)
        weakest = float(known.t.min())
    except ValueError:  # the motion is too sensitive for its bound
        weakest = np.nan
    return {
        **claims(true, result),
        "weakest_t": weakest,
        "cause_named": np.nan,
        "seconds": seconds,
    }
