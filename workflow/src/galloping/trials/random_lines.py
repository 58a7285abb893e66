"""Fits to recordings of lines drawn at random.

Every line is a bundle of the default conductor with three spacers at the quarter points. Drawn
evenly: the span between 150 and 500 m and both damping ratios between 0.002 and 0.02 on a
logarithmic scale; the tension between 15 and 45 kN; the wind between 6 and 20 m/s; the
aerodynamic coefficients beta_1 in 0.2..1.2, beta_2 in -3..3, beta_3 in -8..-2, eta_1 in -4..4,
and, each absent in half of the lines, eta_2 in -3..3 and eta_3 in -6..6. Lines that do not gallop,
or diverge, are drawn again. Each is recorded twice: released as the default line is, and from q_v
in -2..2 m and q_w in -3..3 m at rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from galloping.configuration.load import load, plain
from galloping.physics.equations import STATES, model
from galloping.physics.galerkin import coefficients
from galloping.polynomial import PolynomialModel, library
from galloping.seeds import generator
from galloping.simulation import Simulator, time_grid
from galloping.trials.attempts import at_the_bound, fits, measured

GROUP = "random lines"
TERMS = library(len(STATES), 3)


def draw(rng: np.random.Generator) -> tuple[dict, np.ndarray]:
    """The `cases` section of a line that gallops, and its two initial states (2, n_states)."""
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


def lines(
    rng: np.random.Generator, simulator: Simulator, time: np.ndarray
) -> Iterator[tuple[PolynomialModel, list[np.ndarray]]]:
    """Lines without end, each with its motions (n, n_states) from both releases, none diverging."""
    while True:
        case, starts = draw(rng)
        true = model(coefficients(case)).on_library(TERMS)
        motions = [simulator(true, start, time) for start in starts]
        if all(motion.status == "ok" for motion in motions):
            yield true, [motion.states for motion in motions]


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _or_absent(rng: np.random.Generator, size: float) -> list[float]:
    return [rng.uniform(-size, size) * float(rng.random() < 0.5)]


def trial(
    seed: int,
    case: str,
    replicates: Sequence[int],
    methods: Mapping[str, Mapping],
    *,
    protocols: Sequence[str],
    levels: Sequence[float],
    duration: float = 300.0,
    sampling_rate: float = 100.0,
) -> Iterator[dict[str, object]]:
    """A row for each fit to a recording of the lines `replicates`: see `attempts.fits`."""
    time = time_grid(duration, sampling_rate)
    simulator = Simulator(STATES, TERMS)
    for number in replicates:
        true, motions = next(lines(generator(seed, "random line", number), simulator, time))
        for protocol in protocols:
            for level in levels:
                for release, states in enumerate(motions):
                    columns = {
                        "group": GROUP, "case": case, "protocol": protocol, "level": level,
                        "seed": seed, "replicate": number, "release": release,
                    }  # fmt: skip
                    attempt = measured(columns, true, time, states)
                    deviations = at_the_bound(attempt, states)
                    yield from fits([replace(attempt, deviations=deviations)], methods)
