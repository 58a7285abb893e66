"""The limit cycle that an identified model leads to, and how sure it is."""

import numpy as np
import pytest

from galloping.identification.model import IdentifiedModel
from galloping.physics.equations import STATES
from galloping.polynomial import library
from galloping.simulation import Simulator
from galloping.trials.limit_cycle import limit_cycle_ahead, table

START = np.array([0.1, 0.1, 0.0, 0.0])


def test_limit_cycle_of_the_line_with_its_interval(resonant):
    line, trajectory = resonant
    terms = library(4, 3)
    line = line.on_library(terms)
    simulator = Simulator(STATES, terms)
    support = line.support.copy()
    support[:2] = False
    errors = 1e-3 * np.abs(line.coefficients[support])
    sure = IdentifiedModel(line, "ok", covariance=np.diag(errors**2), known=(0, 1))
    unsure = IdentifiedModel(line, "ok", covariance=np.diag((2 * errors) ** 2), known=(0, 1))
    cycles = [
        limit_cycle_ahead(one, START, simulator, np.random.default_rng(1)) for one in (sure, unsure)
    ]
    for cycle in cycles:
        assert cycle.amplitude[:2] == pytest.approx([1.305, 2.132], abs=1.5e-3)
        assert np.all((cycle.low <= cycle.amplitude) & (cycle.amplitude <= cycle.high))
    widths = [(cycle.high - cycle.low)[:2] for cycle in cycles]
    assert np.all(widths[1] > 1.5 * widths[0])

    refused = IdentifiedModel.refused(STATES, terms, "no reason")
    with pytest.raises(ValueError, match="there is no model to simulate: no reason"):
        limit_cycle_ahead(refused, START, simulator, np.random.default_rng(1))
    rows = table(
        [({"level": 0.05}, [sure, refused])], line, START, trajectory.states[20000:], simulator,
        np.random.default_rng(1),
    )  # fmt: skip
    assert rows["answered"].to_list() == [1, 1]
    assert rows["recorded_m"].to_list() == pytest.approx([1.106, 1.873], abs=1e-3)
    assert rows["true_m"].to_list() == pytest.approx([1.305, 2.132], abs=1.5e-3)
    assert rows["coverage_95_percent"].to_list() == [100.0, 100.0]
