"""The limit cycle that an identified model leads to, and how sure it is."""

from dataclasses import replace

import numpy as np
import pytest
from lines import moved

from galloping.cycles.prediction import limit_cycle_ahead
from galloping.identification.model import IdentifiedModel
from galloping.physics.galerkin import STATES, Derived
from galloping.polynomial import library
from galloping.tables.limit_cycle_ahead import limit_cycles_ahead

START = np.array([0.1, 0.1, 0.0, 0.0])
REFUSED = IdentifiedModel.refused(STATES, library(4, 3), "no reason")


def stated(line, relative):
    """A model that is right, with errors of that size stated of every coefficient."""
    line = line.on_library(library(4, 3))
    support = line.support.copy()
    support[:2] = False
    errors = relative * np.abs(line.coefficients[support])
    return IdentifiedModel(line, "ok", covariance=np.diag(errors**2), known=(0, 1))


def test_limit_cycle_of_the_line_with_its_interval(resonant):
    line, _ = resonant
    widths = []
    for relative in (1e-3, 2e-3):
        half, low, high = limit_cycle_ahead(stated(line, relative), START, np.random.default_rng(1))
        assert half[:2] == pytest.approx([1.305, 2.132], abs=5e-4)
        assert np.all((low < half) & (half < high))
        widths.append((high - low)[:2])
    assert widths[1] == pytest.approx(2 * widths[0], rel=0.1)
    unsure = replace(stated(line, 1e-3), covariance=np.zeros((0, 0)))
    _, low, _ = limit_cycle_ahead(unsure, START, np.random.default_rng(1))
    assert np.all(np.isnan(low))
    with pytest.raises(ValueError, match="there is no model to simulate: no reason"):
        limit_cycle_ahead(REFUSED, START, np.random.default_rng(1))


def test_table_of_recorded_and_true_amplitudes(resonant):
    line, motion = resonant[0], moved(*resonant)
    settings = {
        "method": "maximum_likelihood", "seed": 1, "steady_window": [200, 300],
        "is_continuous": False,
        "cells": {"a": {"case": "internal_resonance", "protocol": "state", "level": 0.05}},
    }  # fmt: skip
    identified = {"a": {"maximum_likelihood": [stated(line, 1e-3), REFUSED]}}
    made = Derived(line, {}, {}), [motion], identified
    table = limit_cycles_ahead(*made, settings)
    assert table["state"].to_list() == ["q_v", "q_w"]
    assert table["answered"].to_list() == [1, 1]
    assert table["recorded_m"].to_list() == pytest.approx([1.106, 1.873], abs=1e-3)
    assert table["true_m"].to_list() == pytest.approx([1.305, 2.132], abs=5e-4)
    assert table["coverage_95_percent"].to_list() == [100.0, 100.0]
    of_another = limit_cycles_ahead(*made, settings | {"is_continuous": True})
    assert of_another["true_m"].isna().all() and of_another["predicted_m"].notna().all()
