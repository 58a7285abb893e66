"""Structure and wind of an identified model, what it predicts, and what measures do."""

from dataclasses import replace

import numpy as np
import pytest
from identification_cases import unknown_support
from lines import RESONANT, START, edited, moved, simulate, simulator

from galloping.cycles.family import LIBRARY, critical_wind
from galloping.cycles.prediction import draw_splits, limit_cycle_ahead, predict, split
from galloping.cycles.ranking import (
    Design,
    apply_measure,
    critical_winds,
    derive_parts,
    rank_measures,
    with_measure,
)
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.line.galerkin import STATES, Derived, coefficients, make_model
from galloping.line.measures import NO_MEASURE, damper, pendulum, tension, typical_measures
from galloping.model.intervals import MODEL_DRAWS, interval_of_draws
from galloping.model.polynomial import polynomial_library
from galloping.recording.samples import Recording
from galloping.tables.limit_cycle_ahead import limit_cycles_ahead

RATIOS = {"dq_v": 0.005, "dq_w": 0.005}
CHECKS = {8: (0.3868, 0.5978), 12: (1.305, 2.132), 16: (2.298, 3.277)}


def stated(line, relative):
    """A model that is right, with errors of that size stated of every coefficient."""
    line = line.on_library(LIBRARY)
    errors = relative * np.abs(line.coefficients[unknown_support(line)])
    return IdentifiedModel(line, is_judged=True, covariance=np.diag(errors**2), known=(0, 1))


def exact(speed):
    return stated(make_model(coefficients(edited(wind__speed=speed))), 1e-4)


@pytest.mark.parametrize(
    ("values", "ends"),
    [
        ([2.0, np.inf, -0.0] * 7, [0.0, np.inf]),
        ([2.0, np.nan] * 10, [np.nan] * 2),
        ([2.0, 3.0] * 9, [np.nan] * 2),
    ],
)
def test_an_interval_holds_all_draws_and_few_draws_or_one_without_a_value_leave_none(values, ends):
    np.testing.assert_array_equal(interval_of_draws(values), ends)


@pytest.mark.parametrize("winds", [(12.0,), (9.0, 14.0)])
def test_split_gives_the_model_at_any_wind(winds):
    known = RATIOS if len(winds) == 1 else None
    parts = split([exact(speed) for speed in winds], winds, known)
    for speed in (6.0, 12.0, 20.0):
        true = exact(speed).model.coefficients
        at = parts.model(speed).on_library(LIBRARY)
        assert at.coefficients == pytest.approx(true, rel=1e-6, abs=1e-12)


def test_what_cannot_be_split_or_placed():
    with pytest.raises(ValueError, match="12 m/s"):
        split([exact(12.0)], [12.0], None)
    with pytest.raises(ValueError, match="q_x"):
        split([exact(12.0)], [12.0], {"q_x": 0.1})
    with pytest.raises(ValueError, match="position 400 m"):
        apply_measure(derive_parts(RESONANT), RESONANT, damper(400.0, 100.0))


@pytest.mark.parametrize("protocol", ["state", "displacement"])
def test_prediction_from_one_noisy_recording(protocol):
    _, motion = simulate("internal_resonance")
    noise = np.random.default_rng(20).normal(size=motion.states.shape)
    values = motion.states + 0.05 * motion.states.std(axis=0) * noise
    if protocol == "displacement":
        values[:, 2:] = np.nan
    identified = maximum_likelihood(
        [Recording(motion.time, STATES, values)], polynomial_library(4, 3)
    )
    parts = split([identified], [12.0], RATIOS)
    draws = draw_splits(identified, 12.0, RATIOS, np.random.default_rng(1))
    prediction = predict(parts, 12.0, list(CHECKS), START, draws, simulator())
    assert not prediction.reason and not prediction.unresolved.any()
    assert prediction.amplitude[:, :2] == pytest.approx(np.array(list(CHECKS.values())), rel=0.05)
    width = (prediction.high - prediction.low)[:, :2] / prediction.amplitude[:, :2]
    assert np.all((width > 1e-4) & (width < 0.05))


def test_the_band_holds_rivals_with_other_terms():
    """Half of the probability is that of a rival whose damping is a tenth stronger."""
    sure, linear = stated(exact(12.0).model, 1e-9), exact(12.0).model.terms.index((0, 0, 1, 0))
    rival = sure.model.coefficients.copy()
    rival[2, linear] *= 1.1
    found = replace(sure, rivals=rival[np.newaxis], rival_share=0.5)
    draws = draw_splits(found, 12.0, RATIOS, np.random.default_rng(3))
    values = {round(float(each.model(12.0).coefficients[2].sum()), 6) for each in draws}
    assert len(draws) == MODEL_DRAWS and len(values) == 2


def test_a_model_without_uncertainty_or_without_a_cycle():
    bare = IdentifiedModel(exact(12.0).model)  # as sparse regression gives it
    parts = split([bare], [12.0], RATIOS)
    draws = draw_splits(bare, 12.0, RATIOS, np.random.default_rng(0))
    assert draws == []
    prediction = predict(parts, 12.0, [12.0, 16.0], START, draws, simulator())
    assert prediction.amplitude[0, :2] == pytest.approx(CHECKS[12], abs=1e-3)
    assert prediction.amplitude[1, :2] == pytest.approx(CHECKS[16], abs=1e-3)
    assert np.isnan(prediction.low).all()
    calm = predict(parts, 4.0, [4.0], START, draws, simulator())
    assert calm.reason
    assert np.isnan(calm.amplitude).all()


def test_measures_change_the_line_as_the_derivation_does():
    parts = derive_parts(RESONANT)

    def at(of):
        return of.model(12.0).on_library(LIBRARY).coefficients

    def critical(of):
        return critical_winds(of, of.values[np.newaxis])[0]

    for applied in (NO_MEASURE, tension(1.2), *typical_measures(RESONANT)[3:5]):
        true = make_model(coefficients(applied.change(RESONANT))).on_library(LIBRARY)
        line = apply_measure(parts, RESONANT, applied)
        assert at(line) == pytest.approx(true.coefficients, rel=1e-9)
    assert critical(parts) == pytest.approx(critical_wind(RESONANT))
    assert critical(apply_measure(parts, RESONANT, damper(30.0, 200.0))) > 1.1 * critical(parts)
    heavier = apply_measure(parts, RESONANT, pendulum(20.0, (150.0,)))
    stiffness = 2, LIBRARY.index((1, 0, 0, 0))
    ratio = at(heavier)[stiffness] / at(parts)[stiffness]
    assert 0.95 < ratio < 1.0  # 20 kg beside a modal mass of about a ton


def test_ranking():
    design = Design(12.0, START, (0.0, 8.0), limit=3.0)
    parts = derive_parts(RESONANT)
    draws = parts.values * (1 + 0.002 * np.random.default_rng(3).normal(size=(MODEL_DRAWS, 1)))
    bare = edited(spacers__mass=0.0, spacers__positions=[])
    assert len(typical_measures(bare)) == len(typical_measures(RESONANT)) - 2
    chosen = [m for m in typical_measures(RESONANT) if "ice" in m.label or "damper" in m.label]
    order = rank_measures(parts, RESONANT, chosen, design, simulator(), draws)
    assert [row["measure"] for row in order] == [
        "ice removed", "damper of 200 N s/m at 30 m", "as it is",
    ]  # fmt: skip
    bare, _, as_is = order
    assert bare["critical_wind_m_s"] == np.inf
    assert (bare["vertical_amplitude_m"], bare["kind"]) == (0, "rest")
    assert (as_is["vertical_amplitude_m"], as_is["horizontal_amplitude_m"]) == pytest.approx(
        CHECKS[12], abs=1e-3
    )
    low, high = as_is["vertical_amplitude_m_low"], as_is["vertical_amplitude_m_high"]
    assert low < as_is["vertical_amplitude_m"] < high
    assert 3 < as_is["clearance_m"] < 8
    lost = with_measure(
        parts, RESONANT, NO_MEASURE, replace(design, wind=25.0), simulator(), draws[:0]
    )
    assert lost["kind"].startswith("diverged") and np.isnan(lost["vertical_amplitude_m"])


REFUSED = IdentifiedModel.refused(STATES, polynomial_library(4, 3), [])


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
    with pytest.raises(ValueError, match="no model"):
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
    told = table[["state", "n_limit_cycles", "coverage_95_percent"]].to_numpy().tolist()
    assert told == [["q_v", 1, 100.0], ["q_w", 1, 100.0]]
    assert table["recorded_m"].to_list() == pytest.approx([1.106, 1.873], abs=1e-3)
    assert table["true_m"].to_list() == pytest.approx([1.305, 2.132], abs=5e-4)
    of_another = limit_cycles_ahead(*made, settings | {"is_continuous": True})
    assert of_another["true_m"].isna().all() and of_another["predicted_m"].notna().all()
