"""The limit cycle ahead of its time: what a recording says of a steady state it does not reach."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from galloping.cycles.family import Family
from galloping.cycles.limit_cycles import settled
from galloping.cycles.motion import settle
from galloping.cycles.prediction import BAND, SAMPLES, near
from galloping.evaluation.motion import steady_amplitude
from galloping.identification.model import IdentifiedModel
from galloping.measurement.motion import Motion
from galloping.physics.derived import Derived
from galloping.polynomial import PolynomialModel
from galloping.seeds import generator
from galloping.simulation import Simulator

# s: close enough for the correction, and a stretch to begin it from
SETTLING, WINDOW = 1500.0, 50.0
COLUMNS = (
    "case", "protocol", "level", "method", "state", "recorded_m", "true_m", "predicted_m",
    "low_m", "high_m", "coverage_95_percent", "answered", "replicates",
)  # fmt: skip


@dataclass(frozen=True)
class LimitCycle:
    """amplitude, low, high: (n_states,) half range and its 95 % interval, NaN without a covariance
    and where most of the models drawn with it have no limit cycle near by.
    """

    amplitude: np.ndarray
    low: np.ndarray
    high: np.ndarray


def limit_cycle_ahead(
    identified: IdentifiedModel, start: np.ndarray, rng: np.random.Generator
) -> LimitCycle:
    """The limit cycle to which an identified model leads from `start` (n_states,).

    The interval is that of models drawn with the covariance of the coefficients. Raises ValueError
    where there is no model, and where it does not lead to a limit cycle.
    """
    if identified.status == "refused":
        raise ValueError(f"there is no model to simulate: {identified.reason}")
    present = np.any(identified.model.coefficients != 0, axis=0)
    terms = tuple(t for t, kept in zip(identified.model.terms, present, strict=True) if kept)

    def model(coefficients: np.ndarray) -> PolynomialModel:
        return PolynomialModel(identified.model.states, terms, coefficients[:, present])

    coefficients, support = identified.model.coefficients, identified.support
    found = model(coefficients)
    simulator = Simulator(found.states, terms, found.support)
    motion = settle(simulator, found, start, SETTLING, WINDOW)
    if not np.all(np.isfinite(motion.states)):
        raise ValueError(f"the model does not settle: {motion.kind}")
    _, point = settled(Family(lambda _: found), 0.0, motion.time, motion.states, resolution=1.0)
    low = high = np.full(len(found.states), np.nan)
    if len(identified.covariance) == support.sum() > 0:
        drawn = np.repeat(coefficients[np.newaxis], SAMPLES, axis=0)
        drawn[:, support] = rng.multivariate_normal(
            coefficients[support], identified.covariance, SAMPLES, method="eigh"
        )
        orbits = [near(Family(lambda _, c=c: model(c)), point.solution) for c in drawn]
        ranges = [orbit.half_range() for orbit in orbits if orbit is not None]
        if len(ranges) > SAMPLES / 2:
            low, high = np.quantile(ranges, BAND, axis=0, method="weibull")
    return LimitCycle(point.solution.half_range(), low, high)


def limit_cycles_ahead(
    model: Derived,
    trajectory: Sequence[Motion],
    identified: Mapping[str, Mapping[str, Sequence[IdentifiedModel]]],
    settings: Mapping,
) -> pd.DataFrame:
    """One row for each cell and displacement: the predicted limit cycle beside the true one.

    model, trajectory: of the line. identified: by cell and method. settings: method, seed;
    cells, each with its columns; steady_window, s, to which the paper's "steady state" refers;
    is_continuous, whether the motion is not the model's, whose limit cycle then is not the true
    one. Columns as in COLUMNS: recorded_m is the amplitude of the motion in that window,
    predicted_m and its interval medians over the replicates that were answered.
    """
    first = trajectory[0]
    begin, end = settings["steady_window"]
    recorded = steady_amplitude(first.states[(first.time >= begin) & (first.time <= end)])
    true = np.full(len(first.names), np.nan)
    if first.status == "ok" and not settings["is_continuous"]:
        own = IdentifiedModel(model.model, "unjudged")
        true = limit_cycle_ahead(own, first.states[0], np.random.default_rng(0)).amplitude
    rows = []
    for name, columns in settings["cells"].items():
        models, cycles = identified[name][settings["method"]], []
        for replicate, found in enumerate(models):
            rng = generator(settings["seed"], "limit cycle ahead", name, replicate)
            try:
                cycles.append(limit_cycle_ahead(found, first.states[0], rng))
            except (ValueError, np.linalg.LinAlgError):
                continue
        for k in range(len(first.names) // 2):
            low, high, predicted = (
                np.array([getattr(cycle, which)[k] for cycle in cycles])
                for which in ("low", "high", "amplitude")
            )
            stated = np.isfinite(low)
            held = (low <= true[k]) & (true[k] <= high)
            row = {
                **{key: columns[key] for key in ("case", "protocol", "level")},
                "method": settings["method"],
                "state": first.names[k],
                "recorded_m": recorded[k],
                "true_m": true[k],
                "answered": len(cycles),
                "replicates": len(models),
                "predicted_m": np.median(predicted) if cycles else np.nan,
                "low_m": np.median(low[stated]) if stated.any() else np.nan,
                "high_m": np.median(high[stated]) if stated.any() else np.nan,
                "coverage_95_percent": 100.0 * np.mean(held[stated])
                if stated.any() and np.isfinite(true[k])
                else np.nan,
            }
            rows.append(row)
    return pd.DataFrame(rows, columns=COLUMNS)
