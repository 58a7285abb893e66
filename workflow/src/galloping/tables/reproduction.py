"""What the parameters that the paper leaves open decide: its claims, met or not, for each value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from galloping.cycles.line_family import PARAMETERS, Parameter, initial_state
from galloping.evaluation.cell import evaluate
from galloping.evaluation.score import Truth
from galloping.identification.cell import identify
from galloping.measurement.measuring import measure
from galloping.measurement.motion import Motion
from galloping.physics.equations import model
from galloping.physics.galerkin import coefficients
from galloping.polynomial import extended, library
from galloping.simulation import Simulator, time_grid
from galloping.study.kinds import NOISE, SUBSET
from galloping.tables.claims import claims_table


def _released(case: Mapping, value: float) -> dict:
    return {**case, "initial_state": {**case["initial_state"], "q_v": value, "q_w": value}}


# what the paper leaves open
OPEN = {
    "wind_speed": PARAMETERS["wind_speed"],
    "damping_ratio": PARAMETERS["damping_ratio"],
    "bundle_dimension": PARAMETERS["bundle_dimension"],
    "initial_displacement": Parameter("initial displacement, both directions", "m", _released),
}
MET = ("reproduced", "better")


@dataclass(frozen=True)
class ReproductionPlan:
    """What is measured and identified of each variant of a case.

    case: its name, by which claims are about it. protocol, method: name; options: `Method.settings`
    of it. levels: of noise on whole records; points: sizes of the subsets at subset_level.
    relative: whether levels are in units of what is measured. degree: of the candidate library.
    duration: s, sampling_rate: Hz, steady: window in s.
    """

    case: str
    protocol: str
    method: str
    options: Mapping
    levels: Sequence[float]
    points: Sequence[int]
    subset_level: float
    replicates: int
    seed: int
    relative: bool = True
    degree: int = 3
    duration: float = 300.0
    sampling_rate: float = 100.0
    steady: tuple[float, float] = (200.0, 300.0)


def reproduction_rows(
    plan: ReproductionPlan, case: Mapping, values: Mapping[str, Sequence[float]]
) -> pd.DataFrame:
    """Every claim of the paper for every value of every open parameter, one varied at a time.

    values: by name in OPEN. Columns parameter, unit, value, default (whether it is the case's
    own), met, then those of the claims table. Raises ValueError for a name that is not open.
    """
    unknown = sorted(set(values) - set(OPEN))
    if unknown:
        raise ValueError(f"{unknown[0]}: the paper does not leave it open; {', '.join(OPEN)}")
    own = _claims(plan, case)  # shared by all parameters
    tables = []
    for name, of in values.items():
        for value in of:
            varied = OPEN[name].at(case, value)
            is_own = bool(np.isclose(_distance(case, varied), 0.0))
            table = own if is_own else _claims(plan, varied)
            place = {"parameter": name, "unit": OPEN[name].unit, "value": value, "default": is_own}
            met = table["verdict"].isin(MET)
            tables.append(table.assign(**place, met=met)[[*place, "met", *table.columns]])
    return pd.concat(tables, ignore_index=True)


def _distance(case: Mapping, varied: Mapping) -> float:
    """Relative change of the model and its release."""
    before, after = (
        np.array([*coefficients(c).values(), *initial_state(c)]) for c in (case, varied)
    )
    return float(np.max(np.abs(after - before) / np.maximum(np.abs(before), 1e-12)))


def _claims(plan: ReproductionPlan, case: Mapping) -> pd.DataFrame:
    settings = {
        "cases": [plan.case],
        "pairs": [(plan.protocol, plan.method)],
        "subset_level": plan.subset_level,
    }
    return claims_table(_scores(plan, case), settings)


def _scores(plan: ReproductionPlan, case: Mapping) -> pd.DataFrame:
    """Scores of all replicates of all cells of one variant."""
    line = model(coefficients(case))
    time = time_grid(plan.duration, plan.sampling_rate)
    moved = Simulator(line.states, line.terms)(line, np.array(initial_state(case)), time)
    motion = Motion(line.states, time, moved.states, line(moved.states), moved.status)
    terms = library(len(line.states), plan.degree)
    true = line.on_library(extended(terms, line))
    truth = Truth(true, time, moved.states, plan.steady, moved.status)
    cells = [(NOISE, level, len(time)) for level in plan.levels]
    cells += [(SUBSET, plan.subset_level, points) for points in plan.points]
    unbounded = np.full((1, *true.coefficients.shape), np.nan)
    rows = []
    for kind, level, points in cells:
        name = (plan.case, plan.protocol, f"{kind}_{points if kind == SUBSET else level:.12g}")
        recordings = measure(
            [motion], protocol=plan.protocol, level=level, relative=plan.relative, samples=points,
            recordings=1, replicates=plan.replicates, seed=plan.seed, name=name,
        )  # fmt: skip
        models = identify({plan.method: plan.options}, recordings, terms, name)
        scored, _ = evaluate(truth, models, unbounded)
        cell = {"case": plan.case, "protocol": plan.protocol, "kind": kind, "level": level,
                "points": points}  # fmt: skip
        rows += [{**cell, **row} for row in scored]
    return pd.DataFrame(rows)
