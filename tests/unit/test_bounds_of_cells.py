"""The bound of a cell, models drawn at it, and the tables made of both."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from identification_cases import model
from lines import moved, simulate

import galloping
from galloping.evaluation.bounds import (
    Experiment,
    bounds_of,
    free_terms,
    sensitivities,
    state_bound,
)
from galloping.evaluation.bounds_of_cells import at_the_bound, deviations, ranked_releases
from galloping.line.galerkin import Derived
from galloping.model.intervals import MIN_IDENTIFIABLE_RATIO
from galloping.model.polynomial import polynomial_library
from galloping.recording.measurement import Noise, noises_of
from galloping.tables.scores import efficiency, identifiability
from galloping.trajectory.simulation import Simulator
from galloping.trials.published import PUBLISHED_SETTINGS

EQUATIONS = (2, 3)


def given_line(name):
    """(model, motion) of a default case."""
    line, trajectory = simulate(name)
    line = line.on_library(polynomial_library(4, 3))
    return line, moved(line, trajectory)


@cache
def cell(name, protocol, level=0.05):
    """(model, bound) of the whole record of a default case."""
    line, motion = given_line(name)
    noises = noises_of([motion], protocol, level, relative=True)
    return line, *bounds_of(line, EQUATIONS, [motion], noises, [[slice(None)]])


@pytest.mark.parametrize(
    ("name", "protocol", "t", "weakest"),
    [
        ("internal_resonance", "state", 36.8, "dq_v^2"),
        ("internal_resonance", "displacement", 18.5, "dq_v^2"),
        ("internal_resonance", "derivative", 3 * 7.7, "dq_v^3"),
        ("non_resonant", "state", 2.1, "q_v q_w^2"),
    ],
)
def test_weakest_terms_of_the_default_records(name, protocol, t, weakest):
    line, found = cell(name, protocol)
    assert found.t.min() == pytest.approx(t, rel=0.03)
    assert line.term_names[found.free[np.argmin(found.t)][1]] == weakest
    if (name, protocol) == ("internal_resonance", "state"):
        relative = np.sqrt(2 / np.pi) / found.t * 100
        degree = np.array([sum(line.terms[j]) for _, j in found.free])
        means = [relative[degree == d].mean() for d in (1, 2, 3)]
        assert means == pytest.approx([0.10, 0.64, 0.76], abs=0.005)


def test_what_the_data_do_not_show_has_an_infinite_bound():
    line, _ = simulate("internal_resonance")
    still = Experiment(np.zeros(4), np.arange(100) / 100, np.ones(4))
    assert np.isinf(state_bound(line, free_terms(line, EQUATIONS)[:1], [still]).std).all()


@pytest.mark.parametrize("protocol", ["derivative", "state", "displacement", "acceleration"])
def test_bounds_grow_with_the_noise(protocol):
    _, small = cell("internal_resonance", protocol, level=0.05)
    _, large = cell("internal_resonance", protocol, level=0.15)
    assert large.std == pytest.approx(3 * small.std, rel=1e-6)


def test_a_recording_that_begins_later_has_the_bound_of_one_from_there():
    line, motion = given_line("internal_resonance")
    sigma, rows = 0.05 * motion.states.std(axis=0), np.arange(700, 30001, 7)
    noise, samplings = Noise(sigma, np.full(4, np.inf)), [[slice(None)], [rows]]
    whole, later = bounds_of(line, EQUATIONS, [motion], [noise], samplings)
    own = Experiment(motion.states[700], motion.time[rows], sigma)
    assert later.std == pytest.approx(state_bound(line, later.free, [own]).std, rel=1e-8)
    assert np.all(later.std > whole.std)


def test_models_at_the_bound_scatter_by_it():
    line, found = cell("internal_resonance", "state")
    models = [at_the_bound(line, found, np.random.default_rng(k)) for k in range(400)]
    pairs = tuple(free_terms(line, EQUATIONS).T)
    errors = np.array(
        [model.model.coefficients[pairs] - line.coefficients[pairs] for model in models]
    )
    assert np.std(errors, axis=0) == pytest.approx(found.std, rel=0.2)
    assert np.abs(errors.mean(axis=0) / found.std).max() < 5 / np.sqrt(400)
    correlation = np.corrcoef(errors.T)
    expected = found.covariance / np.outer(found.std, found.std)
    assert np.abs(correlation - expected).max() < 0.25
    assert np.array_equal(models[0].model.coefficients != 0, line.support)


def test_no_model_at_a_bound_that_is_infinite():
    line, found = cell("internal_resonance", "state")
    covariance = found.covariance.copy()
    covariance[3, 3] = np.inf
    blind = replace(found, covariance=covariance)
    model = at_the_bound(line, blind, np.random.default_rng(0))
    assert (model.status, model.codes) == ("refused", "term_undetermined")


def test_the_bound_from_accelerations_is_that_of_their_dependence_on_everything_unknown():
    line, motion = given_line("internal_resonance")
    rows, sigma = slice(0, 6000, 10), np.array([np.inf, np.inf, 0.1, 0.2])
    noise = Noise(np.full(4, np.inf), sigma)
    (found,) = bounds_of(line, EQUATIONS, [motion], [noise], [[rows]])
    simulator, places = Simulator(line.states, line.terms), tuple(found.free.T)

    def accelerations(unknown):
        coefficients = line.coefficients.copy()
        coefficients[places] = unknown[:-4]
        model = replace(line, coefficients=coefficients)
        states = simulator(model, unknown[-4:], motion.time[rows]).states
        return (model(states) / sigma)[:, 2:].ravel()

    centre = np.append(line.coefficients[places], motion.states[0])
    steps = np.diag(1e-4 * np.abs(centre) + 1e-6)
    slopes = np.transpose(
        [(accelerations(centre + h) - accelerations(centre - h)) / (2 * h.sum()) for h in steps]
    )
    expected = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))[:-4]
    assert found.std == pytest.approx(expected, rel=1e-3)


def test_derivatives_of_exact_states_have_one_noise():
    line, motion = given_line("internal_resonance")
    noises = [Noise(np.zeros(4), np.full(4, level)) for level in (1.0, 2.0)]
    with pytest.raises(ValueError, match="need the same noise"):
        bounds_of(line, EQUATIONS, [motion, motion], noises, [[slice(None), slice(None)]])


def test_a_release_of_three_metres_makes_the_non_resonant_line_identifiable():
    line, first = given_line("non_resonant")
    best, *others = ranked_releases(line, first, 0.05, [0.1, 3.0])
    assert (best["initial_displacement"], best["identifiable"]) == ("q_w(0) = 3 m", True)
    assert best["min_coefficient_over_bound"] == pytest.approx(82, rel=0.02)
    same = next(row for row in others if row["initial_displacement"] == "q_v(0) = 0.1 m")
    assert same["min_coefficient_over_bound"] == pytest.approx(2.07 * np.sqrt(2), rel=0.02)


def test_a_record_of_hours_has_a_bound():
    swing = galloping.parse_model("q = dq; dq = -100 q")
    time = np.arange(200_001) / 10
    states, moved = sensitivities(swing, np.array([[1, 1]]), np.array([1.0, 0.0]), time)
    assert states[:, 0] == pytest.approx(np.cos(10 * time), abs=1e-6)
    assert moved[-1, 0, 0] == pytest.approx(time[-1] * np.sin(10 * time[-1]) / 20, abs=0.01)


def test_a_direction_at_rest_is_named():
    line, motion = given_line("internal_resonance")
    still = replace(motion, **{
        name: getattr(motion, name) * [1, 0, 1, 0] for name in ("states", "rates")
    })  # fmt: skip
    for protocol, said in (
        ("state", "noise of q_w, dq_w: 0"), ("acceleration", "noise of the rate of dq_w: 0"),
    ):  # fmt: skip
        noises = noises_of([still], protocol, 0.05, relative=True)
        with pytest.raises(ValueError, match=f"{said}, as relative noise is of a state"):
            bounds_of(line, EQUATIONS, [still], noises, [[slice(None)]])
    assert ranked_releases(line, still, 0.05, [3.0]) == []


def test_releases_of_a_line_that_runs_away_have_no_rank():
    line, motion = given_line("internal_resonance")
    coefficients = line.coefficients.copy()
    coefficients[2, line.term_names.index("q_v")] = 50.0
    coefficients[2, line.term_names.index("q_v^3")] = 1e3
    away = replace(line, coefficients=coefficients)
    assert ranked_releases(away, motion, 0.05, [3.0]) == []


def test_identifiability_tells_which_terms_can_be_known():
    line, found = cell("non_resonant", "state")
    columns = {"case": "a", "recordings": 1, "protocol": "state", "level": 0.05, "points": 30001}
    settings = {"degree": 3, "cells": {"a/state/noise": columns}}
    bounds = {"a/state/noise": deviations(line, [found], len(line.terms))}
    rows = identifiability({"a": Derived(line, {}, {})}, bounds, settings).to_dict("records")
    assert len(rows) == 14
    verdicts = {row["term"]: row["verdict"] for row in rows if row["equation"] == "vertical"}
    assert verdicts["q_v q_w^2"] == "not identifiable"
    assert verdicts["q_v"] == "identifiable"
    assert all(
        (row["coefficient_over_bound"] > MIN_IDENTIFIABLE_RATIO)
        == (row["verdict"] == "identifiable")
        for row in rows
    )


def test_efficiency_table_counts_everything():
    cell = {"case": "a", "recordings": 1, "protocol": "state", "points": 9}
    base = cell | {
        "method": "m", "missing": 0, "spurious": 0, "r2_q_v": 0.9, "r2_q_w": 0.8, "motion": "ok",
        "amplitude_error_q_v_percent": 1.0, "amplitude_error_q_w_percent": 2.0,
        "status": "ok", "intervals": 4.0, "intervals_covering": 4.0,
    }  # fmt: skip
    failed = {
        "missing": 4, "motion": "m: no luck", "status": "refused",
        "r2_q_v": -np.inf, "r2_q_w": -np.inf, "intervals": np.nan, "intervals_covering": np.nan,
    }  # fmt: skip
    scores = pd.DataFrame(
        {**base, "level": level, "efficiency": efficiency, **more}
        for level, efficiency, more in (
            (0.0, np.nan, {}), (0.05, 3.0, {}),
            (0.05, 4.0, {"spurious": 1, "intervals_covering": 3.0}),
            (0.1, 1.0, {}), (0.1, np.inf, failed),
        )
    )  # fmt: skip
    known = pd.DataFrame(
        {**cell, "level": level, "coefficient_over_bound": t}
        for level, t in ((0.05, 5.0), (0.1, 2.5), (0.1, 7.0))
    )
    rows = efficiency(scores, known)
    first, second = rows.to_dict("records")
    assert (first["replicates"], first["exact_support"], first["failures"]) == (2, 1, 0)
    assert first["efficiency"] == pytest.approx(np.sqrt(12.5))
    assert (first["amplitude_error_percent"], first["coverage_95_percent"]) == (2.0, 87.5)
    assert (second["efficiency"], second["failures"], second["exact_support"]) == (1.0, 1, 1)
    assert (first["n_without_model"], second["n_without_model"]) == (0, 1)
    assert (first["min_coefficient_over_bound"], second["min_coefficient_over_bound"]) == (5.0, 2.5)
    without_noise = efficiency(scores[scores["level"] == 0], known)
    assert without_noise.empty and list(without_noise) == list(rows)


def test_a_term_that_is_absent_has_a_sensitivity() -> None:
    true = model(("x",), 2, {"x": -1.0})
    time = np.linspace(0.0, 2.0, 9)
    _, s = sensitivities(true, np.array([[0, 2]]), np.array([1.0]), time)
    assert s[:, 0, 0] == pytest.approx(np.exp(-time) * (1.0 - np.exp(-time)), abs=1e-9)


def test_a_longer_chaotic_motion_tells_more_of_every_term() -> None:
    chaotic, step = PUBLISHED_SETTINGS["lorenz"]
    true = chaotic.model
    free, sigma = np.argwhere(true.support), np.ones(3)
    ends = [
        state_bound(true, free, [Experiment(np.array(chaotic.start), step * np.arange(n), sigma)])
        for n in (400, 600, 800, 1000)  # of the last all but 1e-12 is what its start does
    ]
    assert np.all(np.diff([bound.std for bound in ends], axis=0) < 0.0)
    assert ends[-1].std.max() == pytest.approx(0.2088377, rel=1e-6)  # in long double


def test_a_number_is_an_input_that_stays() -> None:
    pushed = galloping.parse_model("q = dq; dq = -q - 0.1 dq + F", inputs=["F"])
    time = np.linspace(0.0, 20.0, 200)
    held, constant = (
        galloping.cramer_rao_bound(
            pushed, [1, 0], time, [0.1, 0.1], [1.0, 1.0], inputs={"F": force}
        )
        for force in (2.0, galloping.Input(time, np.full(200, 2.0)))
    )
    assert held == pytest.approx(constant, rel=1e-6, nan_ok=True)
