"""Which claims of the paper are met at which values of what it leaves open."""

import numpy as np
import pytest
from drawing import drawn

from galloping.configuration.load import load, plain
from galloping.figures.reproduction import draw_reproduction
from galloping.identification.registry import METHODS
from galloping.tables.reproduction import ReproductionPlan, reproduction_rows

SETTINGS = plain(load({}))
STLSQ = next(method for method in METHODS if method.name == "stlsq")
PLAN = ReproductionPlan(
    case="internal_resonance", protocol="derivative", method="stlsq",
    options=STLSQ.settings(SETTINGS["identification"], 1), levels=(0, 0.05), points=(1000,),
    subset_level=0.05, replicates=2, seed=5,
)  # fmt: skip


def test_rows_and_figure():
    case = SETTINGS["cases"]["internal_resonance"]
    values = {"wind_speed": (12.0, 14.0), "initial_displacement": (0.1, 0.5)}
    rows = reproduction_rows(PLAN, case, values)
    assert rows.groupby(["parameter", "value"]).size().nunique() == 1
    assert set(rows.loc[rows["default"], "value"]) == {12.0, 0.1}
    exact = rows[rows["claim"] == "exact structure without noise"]
    assert exact["met"].all() and np.all(exact["study_value"] == 1)
    assert set(rows.loc[rows["claim"] == "all terms found at 0.01", "verdict"]) == {"not run"}
    labels = {"wind_speed": "wind, m/s", "initial_displacement": "release, m"}
    drawn(lambda: draw_reproduction(rows, {"labels": labels}))


def test_what_the_paper_does_not_leave_open():
    with pytest.raises(ValueError, match="tension: the paper does not leave it open"):
        reproduction_rows(PLAN, SETTINGS["cases"]["internal_resonance"], {"tension": (1.0,)})
