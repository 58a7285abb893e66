"""The diagrams of the two default lines against long simulations and closed forms."""

from functools import cache

import numpy as np
import pytest
from lines import CASES, RESONANT, edited, simulator

from galloping.cycles.continuation import Range
from galloping.cycles.diagram import diagram
from galloping.cycles.family import PARAMETERS, critical_wind, initial_state, line_family
from galloping.cycles.limit_cycles import find_cycles_at
from galloping.cycles.settling import SPAN_WATCH, settle

# half of the range over the last 1,000 of 4,000 s, v and w in m
CHECKS = {
    "internal_resonance": {
        6: (0.223, 0.162), 8: (0.388, 0.600), 10: (0.798, 1.373), 12: (1.305, 2.132),
        14: (1.805, 2.755), 16: (2.298, 3.277),
    },
    "non_resonant": {
        6: (0.538, 0.097), 8: (0.969, 0.235), 10: (1.372, 0.421), 12: (1.774, 0.664),
        16: (2.609, 1.386), 20: (3.573, 2.970),
    },
}  # fmt: skip


@cache
def wind_diagram(name):
    return diagram(line_family(CASES[name], "wind_speed"), Range(1, 25, ceiling=20), np.zeros(4))


def stable_cycles(name, wind):
    """Half ranges (v, w) of the stable limit cycles at a wind speed, exactly there."""
    models = line_family(CASES[name], "wind_speed")
    return [
        point.solution.half_range()[:2]
        for branch in wind_diagram(name).cycles.values()
        for point in find_cycles_at(models, branch, wind)
        if point.stability.stable
    ]


def settled(name, wind, watch=SPAN_WATCH):
    """What the line does in the end, released as it is configured."""
    model = line_family(CASES[name], "wind_speed").model(wind)
    return settle(simulator(), model, initial_state(CASES[name]), watch)


@pytest.mark.parametrize(("name", "wind"), [(n, w) for n, of in CHECKS.items() for w in of])
def test_stable_cycle_and_simulation_agree(name, wind):
    expected = CHECKS[name][wind]
    (cycle,) = [c for c in stable_cycles(name, wind) if c[0] < 4]
    if (name, wind) == ("internal_resonance", 8):  # 4,000 s are not enough to settle to the digits
        assert cycle == pytest.approx(
            settled(name, wind, SPAN_WATCH.during(16000.0)).half_range[:2], abs=1e-4
        )
    else:
        assert cycle == pytest.approx(expected, abs=5.1e-4)
    found = settled(name, wind)
    assert found.kind == "cycle"
    assert found.half_range[:2] == pytest.approx(expected, abs=5.1e-4)


def test_no_steady_cycle_of_the_resonant_line_at_20():
    assert stable_cycles("internal_resonance", 20) == []
    found = settled("internal_resonance", 20)
    assert found.kind == "irregular"
    assert found.half_range[0] == pytest.approx(4.3, rel=0.1)  # as far as rounding lets it
    assert found.highest[0] - found.lowest[0] > 0.2


@pytest.mark.parametrize("name", CHECKS)
def test_critical_wind_is_that_of_the_closed_form(name):
    (hopf,) = wind_diagram(name).equilibria.bifurcations
    assert hopf.point.solution.value == pytest.approx(critical_wind(CASES[name]), rel=1e-9)
    assert settled(name, hopf.point.solution.value - 0.3).highest[0] < 0.05


def test_bifurcations_of_the_default_lines():
    for name, expected in {
        "internal_resonance": [("period doubling", 5.54), ("period doubling", 16.56)],
        "non_resonant": [("Neimark-Sacker", 20.33), ("fold of cycles", 20.35)],
    }.items():
        assert not wind_diagram(name).failures
        branches = wind_diagram(name).cycles.values()
        assert all(branch.complete for branch in branches)
        assert max(p.stability.trivial_defect for b in branches for p in b.points) <= 1e-6
        found = [(b.name, b.point.solution.value) for of in branches for b in of.bifurcations]
        assert [(kind, round(float(at), 2)) for kind, at in found][:2] == expected
        assert len(found) == 2 or name == "non_resonant"


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_family_is_the_case_at_its_own_value(name):
    line = edited()
    own = {
        "wind_speed": 12.0, "tension": 25000.0, "span": 300.0, "spacer_mass": 4.8,
        "bundle_dimension": 0.1104, "ice_vertical_1": 0.442, "ice_vertical_2": 2.126,
        "ice_vertical_3": -4.432, "ice_horizontal_1": 3.33, "ice_horizontal_2": 0.0,
        "ice_horizontal_3": 0.0,
    }.get(name, 0.005)  # fmt: skip
    models = line_family(line, name)
    base = line_family(line, "wind_speed").model(12.0).coefficients
    assert models.model(own).coefficients == pytest.approx(base, rel=1e-12)
    assert not np.allclose(models.model(1.1 * own + 0.1).coefficients, base, rtol=1e-6)
    assert line == RESONANT
