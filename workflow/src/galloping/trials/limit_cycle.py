"""The limit cycle ahead of its time: what a short recording says of the steady state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from galloping.evaluation.motion import steady_amplitude
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import PolynomialModel
from galloping.simulation import Simulator

SETTLING, FROM_NEARBY, WINDOW = 1500, 600, 100  # s: from a release, from a cycle near by; read
RATE = 20  # Hz
DRAWS = 39  # of the coefficients: the ends of a 95 % interval are then the least and the greatest


@dataclass(frozen=True)
class LimitCycle:
    """amplitude, low, high: (n_states,) half range and its 95 % interval, NaN without a covariance.

    end: (n_states,) a state on it.
    """

    amplitude: np.ndarray
    low: np.ndarray
    high: np.ndarray
    end: np.ndarray


def settled(
    model: PolynomialModel, start: np.ndarray, simulator: Simulator, duration: float = SETTLING
) -> tuple[np.ndarray, np.ndarray]:
    """Half range of each state over the last WINDOW s of `duration` s from `start`, and the end."""
    count = round(duration * RATE)
    time = np.arange(count + 1) / RATE
    states = simulator(model, start, time).states
    return steady_amplitude(states[-WINDOW * RATE :]), states[-1]


def limit_cycle_ahead(
    identified: IdentifiedModel, start: np.ndarray, simulator: Simulator, rng: np.random.Generator
) -> LimitCycle:
    """The limit cycle that an identified model leads to from `start` (n_states,).

    The interval is that of models drawn with the covariance of the coefficients, each of them
    simulated on from the limit cycle; those that leave it for infinity do not count.
    Raises ValueError where there is no model.
    """
    if identified.status == "refused":
        raise ValueError(f"there is no model to simulate: {identified.reason}")
    model, support = identified.model, identified.support
    amplitude, end = settled(model, start, simulator)
    low = high = np.full(len(model.states), np.nan)
    if len(identified.covariance) == support.sum() > 0 and np.all(np.isfinite(end)):
        found = model.coefficients[support]
        draws = rng.multivariate_normal(found, identified.covariance, DRAWS, method="eigh")
        ranges = []
        for draw in draws:
            coefficients = model.coefficients.copy()
            coefficients[support] = draw
            drawn = PolynomialModel(model.states, model.terms, coefficients)
            ranges.append(settled(drawn, end, simulator, FROM_NEARBY)[0])
        low, high = np.nanquantile(ranges, [0.025, 0.975], axis=0, method="weibull")
    return LimitCycle(amplitude, low, high, end)


def table(
    cells: Sequence[tuple[dict, Sequence[IdentifiedModel]]],
    line: PolynomialModel,
    start: np.ndarray,
    recorded: np.ndarray,
    simulator: Simulator,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """One row for each cell and displacement: the predicted limit cycle beside the true one.

    cells: what names a cell, as columns, and the models of its replicates. line: the true model,
    start: (n_states,) its release. recorded: (n, n_states) the motion of the recording's steady
    window, to which the paper's "steady state" refers. Medians over the replicates.
    """
    true, _ = settled(line, start, simulator)
    rows = []
    for name, models in cells:
        answered = [one for one in models if one.status != "refused"]
        found = [limit_cycle_ahead(one, start, simulator, rng) for one in answered]
        for k in range(len(line.states) // 2):
            row = {
                **name,
                "state": line.states[k],
                "recorded_m": steady_amplitude(recorded)[k],
                "true_m": true[k],
                "replicates": len(models),
                "answered": len(found),
            }
            for quantity in ("amplitude", "low", "high"):
                values = [getattr(one, quantity)[k] for one in found]
                row[f"predicted_{quantity}_m"] = np.median(values) if values else np.nan
            held = [one.low[k] <= true[k] <= one.high[k] for one in found]
            row["coverage_95_percent"] = 100.0 * np.mean(held) if held else np.nan
            rows.append(row)
    return pd.DataFrame(rows)
