"""What inputs are between their samples, and terms that their values cannot tell apart."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from field_files import run
from held_inputs import COUNT, DAMPING, STEP, STIFFNESS, TIME, inputs, moved_by
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

import galloping
from galloping import IdentifiedModel, Input, Recording
from galloping.identification.drawn_models import draw_models_and_rivals
from galloping.identification.findings import Code, Finding
from galloping.identification.inputs import validated_problem
from galloping.identification.preparation.interpolation import (
    choose_interpolants,
    undersampled_inputs,
)
from galloping.model.polynomial import polynomial_library
from galloping.model.terms import parse_library
from galloping.recording.samples import typical_inputs
from galloping.storage import read_json

KINDS = ("zero", "linear", "cubic")
STATES = ("q", "dq")


def recorded(samples, between, said="cubic", noise=1e-3, names=("F",)):
    """A recording whose inputs may be anything between their samples, and are taken as said."""
    one = Input(TIME, samples, said)
    others = tuple(replace(one, between=kind) for kind in KINDS if kind != said)
    seen = moved_by(samples, between, noise)
    values = np.column_stack([seen, np.full(COUNT, np.nan)])
    given = dict.fromkeys(names, replace(one, alternatives=others))
    return Recording(TIME, STATES, values, inputs=given)


@pytest.mark.parametrize("said", ["zero", "cubic"])
@pytest.mark.parametrize("noise", [1e-3, 0.03])
@pytest.mark.parametrize("name", inputs())
def test_the_motion_tells_what_an_input_is_between_its_samples(name, noise, said):
    samples, between = inputs()[name]
    recording = recorded(samples, between, said, noise)
    problem = validated_problem(
        [recording], *parse_library("poly(q, dq; 3) + F", STATES, ("F",))[:1]
    )
    found = choose_interpolants(problem, [recording])["F"]
    assert (found == "zero") == (between == "zero")


def test_what_is_said_of_an_input_is_not_asked():
    samples, _ = inputs()["a controller"]
    recording = recorded(samples, "zero")
    said = replace(recording, inputs={"F": Input(TIME, samples, "cubic")})
    problem = validated_problem([said], *parse_library("q + dq + F", STATES, ("F",))[:1])
    assert choose_interpolants(problem, [said]) == {}


@pytest.mark.parametrize("between", KINDS)
def test_means_of_inputs_are_those_of_their_integrals(between):
    rng = np.random.default_rng(1)
    one = Input(np.cumsum(rng.uniform(0.5, 1.5, 60)), rng.standard_normal(60), between)
    centres = np.linspace(one.time[2], one.time[-3], 41)
    fine = centres[:, None] + 1.7 * ((np.arange(20_000) + 0.5) / 20_000 - 0.5)
    np.testing.assert_allclose(one.mean_around(centres, 1.7), one(fine).mean(axis=1), atol=2e-4)


def aliases(values, terms, names=("F",)):
    """The terms that are left out, of inputs with these values (n, n_inputs)."""
    values = np.asarray(values, float).reshape(-1, len(names))
    rng = np.random.default_rng(1)
    drawn = values[rng.integers(0, len(values), 400)]
    time = np.arange(400.0)
    given = {name: Input(time, own, "zero") for name, own in zip(names, drawn.T, strict=True)}
    motion = rng.standard_normal((400, 2))
    recording = Recording(time, STATES, motion, inputs=given)
    problem = validated_problem([recording], *parse_library(f"dq + {terms}", STATES, names)[:1])
    model = galloping.PolynomialModel(STATES, problem.terms, 0.0 * problem.known, names)
    names = dict(zip(problem.terms, model.term_names, strict=True))
    assert not any(problem.open[one.equation, problem.terms.index(one.term)]
                   for one in problem.aliases)  # fmt: skip
    return {names[one.term]: {names[t]: c for t, c in one.simpler.items()}
            for one in problem.aliases}  # fmt: skip


def test_of_powers_of_two_values_the_simplest_are_candidates():
    powers = "q + F + F^2 + F^3"
    assert aliases([0, 2], powers) == {"F^2": {"F": 2.0}, "F^3": {"F": pytest.approx(4.0)}}
    assert aliases([-1, 1], powers) == {"F^3": {"F": pytest.approx(1.0)}}  # F^2 is a constant
    assert aliases([-1, 1], "1 + " + powers).keys() == {"F^2", "F^3"}
    assert aliases([1, 3], powers).keys() == {"F^3"}
    assert aliases([-1, 0, 1], powers).keys() == {"F^3"}
    assert aliases([0, 1, 2, 5], powers) == {}
    assert aliases([0, 2], "q + q*F + q*F^2 + F").keys() == {"q F^2"}
    assert aliases([1, 2], "q + 1/F + F^2 + F").keys() == {"F^2"}
    with pytest.raises(ValueError, match="F is 0 in a recording"):
        aliases([0, 1], "q + 1/F + F^2 + F")


def test_products_and_multiples_of_inputs_are_told_apart_by_what_was_recorded():
    both = [[0, 0], [0, 1], [1, 0], [1, 1]]
    assert aliases(both, "q + F + G + F*G", ("F", "G")) == {}
    assert aliases(both[:3], "q + F + G + F*G", ("F", "G")) == {}  # never there: no term
    assert aliases(both[:2] + both[3:], "q + F + G + F*G", ("F", "G")).keys() == {"F G"}
    proportional = [[k, 3 * k] for k in range(9)]
    assert aliases(proportional, "q + F + G", ("F", "G")) == {"G": {"F": pytest.approx(3.0)}}
    smooth = np.random.default_rng(2).standard_normal((300, 2))
    assert aliases(smooth, "poly(q, dq, F, G; 3)", ("F", "G")) == {}


def test_values_outside_the_recording_do_not_tell_terms_apart():
    values = [0.0, 2.0] * 150 + [5.0] * 100
    rng = np.random.default_rng(1)
    time, motion = np.arange(400.0), rng.standard_normal((400, 2))
    given = {"F": Input(time, values, "zero")}
    terms = parse_library("q + dq + F + F^2", STATES, ("F",))[0]
    aliased = []
    for used in (slice(0, 300), slice(0, 400)):
        recording = Recording(time[used], STATES, motion[used], inputs=given)
        aliased.append(len(validated_problem([recording], terms).aliases))
    assert aliased == [1, 0]


def written(path, samples, between, noise=1e-3):
    seen = moved_by(samples, between, noise)
    pd.DataFrame({"t [s]": TIME, "x [m]": seen, "F [N/kg]": samples}).to_csv(path, index=False)
    return path, "--states", "q,dq", "--measure", "q=x", "--input", "F=F"


@pytest.mark.parametrize(
    ("name", "library"),
    [
        ("one step", "q + dq + F"),
        ("a controller", "q + dq + F"),
        pytest.param("a controller", None, marks=pytest.mark.slow),
    ],
)
def test_the_command_holds_what_is_held(tmp_path, name, library):
    samples, between = inputs()[name]
    file = written(tmp_path / "a.csv", samples, between)
    more = ("--library", library) if library else ()
    run("identify", *file, *more, "--output", tmp_path / "out")
    path = tmp_path / "out" / "model.json"
    found = IdentifiedModel.load(path)
    row = dict(zip(found.model.term_names, found.model.coefficients[1], strict=True))
    errors = dict(zip(found.model.term_names, found.standard_errors[1], strict=True))
    assert found.status == "ok" and not found.is_forced
    assert {name for name, value in row.items() if value} == {"q", "dq", "F"}
    for term, true in (("q", -STIFFNESS), ("dq", -DAMPING), ("F", 1.0)):
        assert abs(row[term] - true) < 4.0 * errors[term]
    assert read_json(path)["between"] == {"F": "zero"}
    ahead = run("forecast", path, *file, "--duration", 1, "--at", "F=2")
    assert len(ahead.splitlines()) == 2 + round(1.0 / STEP) - 1


def test_at_values_that_were_never_recorded_intervals_hold_what_other_terms_say():
    samples, between = inputs()["a square wave"]
    recording = recorded(samples, between, "zero")
    found = galloping.maximum_likelihood(recording, polynomial_library(3, 3))
    assert found.status in ("ok", "not identifiable") and found.has_finding(Code.ALIASED_TERMS)
    assert np.array(found.model.terms)[found.support.any(axis=0), 2].max() == 1
    (at,) = typical_inputs(("F",), [recording]).values()
    assert at in (0.0, 2.0)
    models = draw_models_and_rivals(found, np.random.default_rng(0))

    def rest(model, value):
        held = model.at({"F": value})
        row = dict(zip(held.term_names, held.coefficients[1], strict=True))
        return -row["1"] / row["q"]

    recorded_at, between = ([rest(model, value) for model in models] for value in (2.0, 1.0))
    np.testing.assert_allclose(recorded_at, 2.0 / STIFFNESS, rtol=0.01)
    assert min(between) == pytest.approx(0.25 / STIFFNESS, rel=0.02)  # as by F^3
    assert max(between) == pytest.approx(1.0 / STIFFNESS, rel=0.02)


def test_an_input_that_was_said_to_be_smooth_and_is_held_is_named():
    samples, _ = inputs()["a controller"]
    recording = recorded(samples, "zero")
    said = replace(recording, inputs={"F": Input(TIME, samples, "cubic")})
    found = galloping.maximum_likelihood(said, parse_library("q + dq + F", STATES, ("F",))[0])
    assert found.status == "approximate" and Finding.of(Code.INPUT_HELD, "F") in found.findings


def test_a_wind_that_varies_between_its_samples_is_named():
    """From a sample every 5 s, intervals of amplitudes contain the truth too seldom."""
    rng, time, decay = np.random.default_rng(11), np.arange(0.0, 300.0, 0.1), np.exp(-0.1 / 8.0)
    gusts = lfilter([1.0], [1.0, -decay], rng.standard_normal(len(time)))
    wind = CubicSpline(time, 12.0 + 1.2 * (gusts - gusts.mean()) / gusts.std())
    solution = solve_ivp(
        lambda t, x: [x[1], -4 * x[0] + (0.06 * wind(t) - 0.5) * x[1] - 1.2 * x[1] ** 3 / wind(t)],
        (0.0, time[-1]), [0.2, 0.0], t_eval=time, rtol=1e-8, max_step=0.2,
    )  # fmt: skip
    values = solution.y.T + 0.03 * solution.y.std(axis=1) * rng.standard_normal((len(time), 2))
    terms, _ = galloping.library("q + dq + U*dq + dq^3/U", STATES, ["U"])
    coarse = Recording(time, STATES, values, inputs={"U": Input(time[::50], wind(time[::50]))})
    found = galloping.maximum_likelihood(coarse, terms)
    assert found.status == "approximate" and found.has_finding(Code.INPUT_UNDERSAMPLED)


def test_an_input_is_undersampled_if_it_varies_in_a_quarter_of_a_period():
    time, rng = np.arange(0.0, 100.0, 2.0), np.random.default_rng(12)
    gusty, smooth = rng.standard_normal(len(time)), np.sin(0.2 * time)

    def steps(values, between="linear", period=3.0):
        recording = Recording(TIME, STATES, np.zeros((COUNT, 2)), inputs={
            "U": Input(time, values, between)
        })  # fmt: skip
        return undersampled_inputs([recording], period)

    assert steps(gusty) == {"U": 2.0}
    assert not steps(smooth) and not steps(gusty, "zero") and not steps(gusty, period=9.0)
    assert not steps(np.ones(len(time))) and not steps(12.0 + 1e-3 * gusty)
    daily = 100.0 * np.sin(np.arange(len(time)) / 1e3)  # only the gusts are in the recording
    assert steps(np.where(time <= TIME[-1], gusty, daily)) == {"U": 2.0}
