"""Identification of lines that no candidate library contains."""

import numpy as np
import pandas as pd
import pytest
from lines import RESONANT

from galloping import IdentifiedModel, Recording, maximum_likelihood, simulate
from galloping import polynomial_library as library
from galloping.configuration.load import load, plain
from galloping.figures.verdicts import draw_model_error
from galloping.identification.findings import Code
from galloping.identification.registry import BY_NAME
from galloping.line.continuous import draw_wind
from galloping.line.galerkin import STATES, coefficients, make_model
from galloping.tables.trial_summaries import model_error
from galloping.trials import real_lines
from galloping.trials.published import SYSTEMS
from galloping.trials.real_lines import (
    TRUTHS,
    combine_sensors,
    linear_modes,
    make_line,
    simulate_sensors,
)

TIME = np.arange(15001) / 50
TERMS = library(4, 3)
SETTINGS = plain(load({}))["identification"]
METHODS = {name: BY_NAME[name].settings(SETTINGS, 0) for name in ("maximum_likelihood", "weak")}


def recorded(name):
    truth, rng = TRUTHS[name], np.random.default_rng(11)
    line = make_line(RESONANT, truth)
    gusts = {**RESONANT["truth"]["gusts"], "intensity": truth.intensity}
    clean = simulate_sensors(RESONANT, line, truth, TIME, draw_wind(line, gusts, TIME, rng))
    noisy = clean + 0.05 * clean.std(axis=0) * rng.standard_normal(clean.shape)
    return Recording(TIME, STATES, combine_sensors(line, truth, noisy))


def test_a_line_of_nine_modes_is_answered_with_what_the_answer_is_worth():
    found = maximum_likelihood([recorded("9 modes")], TERMS)
    assert found.status == "approximate"
    assert found.has_finding(Code.RESIDUAL_LINE, Code.RESIDUAL_POWER)
    missed = {each.subject for each in found.findings if each.code == Code.FORECASTS_MISS}
    assert missed == set(STATES)
    assert found.support.sum() <= 20
    damping_v, frequency_v, damping_w, _ = linear_modes(found.model)
    assert -damping_v == pytest.approx(2 * 0.016964, rel=0.02)
    assert frequency_v == pytest.approx(2.64228, rel=5e-4)
    assert damping_w == pytest.approx(2 * 0.006724, rel=0.06)
    assert 0.99 < found.diagnostics["forecast_r2"] < 1.0
    assert 0.001 < found.diagnostics["error_share_all_q_w"] < 0.05


@pytest.mark.slow
def test_the_higher_modes_that_a_sensor_reads_are_named_beside_the_model(tmp_path):
    """At mid-span the third and fifth horizontal modes, at three and five times the first one."""
    found = maximum_likelihood([recorded("9 modes, mid-span")], TERMS)
    assert found.status == "approximate"
    assert found.has_finding(Code.FURTHER_MODE) and not found.has_finding(Code.NOISE_GROWS)
    horizontal = [mode for mode in found.further_modes if mode.state == "q_w"]
    assert {round(mode.frequency) for mode in horizontal} == {4, 7}
    assert all(mode.growth > 0 for mode in horizontal)
    truth = TRUTHS["9 modes, mid-span"]
    line = make_line(RESONANT, truth)
    clean = combine_sensors(line, truth, simulate_sensors(RESONANT, line, truth, TIME))
    own = found.simulate(clean[0], TIME).states
    late = TIME >= 200
    true, alone, together = (
        np.ptp(motion[late, 1]) for motion in (clean, own, own + found.further_motion(TIME))
    )
    assert alone < 0.99 * true
    assert together == pytest.approx(true, rel=0.04)
    found.save(tmp_path / "model.json")
    assert IdentifiedModel.load(tmp_path / "model.json").further_modes == found.further_modes


def test_gusts_are_told_from_what_a_model_lacks():
    """Where gusts alone keep the model from being right, its terms are found and its damping."""
    found = maximum_likelihood([recorded("two modes, gusts 5 %")], TERMS)
    truth = make_model(coefficients(RESONANT)).on_library(TERMS)
    assert found.status == "approximate"
    assert found.has_finding(Code.COEFFICIENTS_FLUCTUATE)
    assert np.array_equal(found.support[2:], truth.support[2:])  # the others are known
    error = (found.model.coefficients - truth.coefficients)[found.support]
    assert np.all(np.abs(error) < 5 * found.standard_errors[found.support])
    assert -linear_modes(found.model)[0] == pytest.approx(2 * 0.016964, rel=0.1)
    lacking = maximum_likelihood([recorded("9 modes, gusts 5 %")], TERMS)
    assert lacking.status == "approximate"
    assert not lacking.has_finding(Code.COEFFICIENTS_FLUCTUATE)


@pytest.mark.slow
def test_what_predicts_nothing_is_refused():
    """A narrow-band random motion looks like an oscillation, and forgets its phase at once."""
    rng = np.random.default_rng(1)
    spectrum = np.fft.rfftfreq(2 * len(TIME), TIME[1])
    band = np.exp(-(((spectrum - 0.4) / 0.15) ** 2))
    noise = rng.standard_normal((2, 2, len(spectrum)))
    motions = np.fft.irfft(band * (noise[0] + 1j * noise[1]))[:, : len(TIME)]
    velocities = np.gradient(motions, TIME[1], axis=1)
    values = np.vstack([motions, velocities]).T
    values += 0.05 * values.std(axis=0) * rng.standard_normal(values.shape)
    found = maximum_likelihood([Recording(TIME, STATES, values)], TERMS)
    assert found.status == "refused"
    assert found.findings


@pytest.mark.slow
def test_a_model_that_diverges_within_a_few_periods_is_no_approximation():
    """With jumps every half period it forecasts well, but comes to rest."""
    system = SYSTEMS["sel_kov"]
    time = np.linspace(0, 300 * system.period, 30001)
    motion = simulate(system.model, system.start, time).states
    noise = np.random.default_rng(1).standard_normal(motion.shape)
    values = motion + 0.05 * motion.std(axis=0) * noise
    recording = Recording(time, system.model.states, values)
    assert maximum_likelihood(recording, library(2, 2)).status == "refused"


def test_trial_has_a_row_for_each_replicate_and_method():
    fits = pd.DataFrame(real_lines.trial(3, "two modes, gusts 2 %", [0], METHODS))
    table = model_error({"small": fits}).set_index("method")
    ours = table.loc["maximum_likelihood"]
    assert ours[["replicates", "n_models"]].to_list() == [1, 1]
    assert ours["damping_v_error_percent"] < 5.0 and ours["forecast_r2"] > 0.9
    assert ours["amplitude_v_worst_percent"] == ours["amplitude_v_error_percent"] < 5.0
    assert 0.0 <= ours["coverage_95_percent"] <= 100.0
    assert np.isnan(table.loc["weak", "coverage_95_percent"])  # it states no intervals
    settings = {"truths": ["two modes, gusts 2 %"]}
    figure = draw_model_error(table.reset_index(), settings)
    assert len(figure.axes) == 6 and figure.get_label().startswith("Maximum likelihood errs by")
    others = table.drop(index="maximum_likelihood")
    title = draw_model_error(others.reset_index(), settings).get_label()
    assert "aximum" not in title and "% in the vertical frequency" in title
    refused = others.assign(frequency_v_error_percent=np.nan)
    title = draw_model_error(refused.reset_index(), settings).get_label()
    assert "gives no vertical frequency" in title


@pytest.mark.slow
def test_with_the_wind_measured_gusts_cost_little():
    """Two modes in gusts of 5 % without the wind miss amplitudes by some percent."""
    (row,) = real_lines.trial(5, "two modes, gusts 5 %, wind", [0], METHODS)  # weak takes no inputs
    assert row["status"] == "ok" and abs(row["amplitude_v_error_percent"]) < 0.5
    assert row["other_winds_error_percent"] < 3.0 and row["forecast_r2"] > 0.999
