"""The limit cycle ahead of its time: what a recording says of a steady state it does not reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from galloping.cycles.family import Family
from galloping.cycles.limit_cycles import settled
from galloping.cycles.motion import settle
from galloping.cycles.prediction import SAMPLES, near
from galloping.identification.model import IdentifiedModel
from galloping.intervals import QUANTILES_95
from galloping.polynomial import PolynomialModel
from galloping.simulation import Simulator

# s: close enough for the correction, and a stretch to begin it from
SETTLING, WINDOW = 1500.0, 50.0


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
            low, high = np.quantile(ranges, QUANTILES_95, axis=0, method="weibull")
    return LimitCycle(point.solution.half_range(), low, high)
