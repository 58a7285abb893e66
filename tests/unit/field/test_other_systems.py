"""What models say of systems that are no span."""

from dataclasses import replace

import numpy as np
import pytest
from statuses import finding_for

import galloping
from galloping import Coefficient, IdentifiedModel, Recording, assess, parse_model
from galloping.behaviour.dynamics import Surroundings, dynamics
from galloping.behaviour.following import first_guess
from galloping.behaviour.objections import find_difference
from galloping.readers.units import coefficient_unit
from galloping.summary.advice import may_be_wind
from galloping.summary.wording import assessment_text

TIME = np.arange(1500) * 0.04
STATES = ("q", "dq")


def exact(text: str, *starts: list[float], inputs: tuple[str, ...] = ()) -> IdentifiedModel:
    model = parse_model(text, inputs)
    return IdentifiedModel(model, is_judged=True, initial_states=np.array(starts, float))


@pytest.mark.parametrize(("friction", "said"), [
    (" - 0.5 abs(dq) dq", "does not sustain oscillations by itself.** The motion dies out, by"),
    ("", "neither grow nor die out**: no damping was found"),
])  # fmt: skip
def test_a_motion_without_linear_damping_dies_out_or_repeats(friction: str, said: str) -> None:
    found = exact(f"q = dq; dq = -39.5 q{friction}", [0.3, 0.0])
    motion = found.simulate([0.3, 0.0], TIME)
    recording = Recording(TIME, STATES, motion.states)
    known = dynamics(found, Surroundings.of([recording]), np.random.default_rng(0))
    assert said in str(galloping.Summary(found, (recording,), known))


def test_a_fixed_coefficient_ends_no_summary() -> None:
    model = parse_model("q = dq; dq = -4 q - 0.1 dq")
    motion = galloping.simulate(model, [1.0, 0.0], TIME)
    recording = galloping.measure(model, motion, level=0.02, seed=4)
    found = galloping.maximum_likelihood(
        recording,
        galloping.polynomial_library(2, 1),
        coefficients=[Coefficient("dq", (0, 1), -0.1)],
    )
    summary = galloping.summarise(found, recording)
    assert found.status == "ok" and summary.advice.term == "q in d(dq)/dt"


@pytest.mark.parametrize(("state", "term", "unit"), [
    ("q", (0, 1), "1"), ("dq", (1, 0), "s^-2"), ("dq", (0, 1), "s^-1"), ("dq", (0, 2), "1"),
])  # fmt: skip
def test_a_velocity_has_one_unit_of_time_more(state: str, term: tuple, unit: str) -> None:
    assert coefficient_unit(state, term, STATES) == unit


@pytest.mark.parametrize("unit", ["m/s", "m s-1", "m s^-1", "mps"])
def test_a_wind_is_a_wind_however_its_unit_is_written(unit: str) -> None:
    found = exact("q_v = dq_v; dq_v = -4 q_v + U", [1, 0], inputs=("U",))
    assert may_be_wind(found, {"U": unit}) and not may_be_wind(found, {"U": "N"})


@pytest.mark.parametrize("starts", [([2.0, 0.0], [0.1, 0.0]), ([0.1, 0.0], [2.0, 0.0])])
def test_the_order_of_recordings_decides_no_limit_cycle(starts: tuple) -> None:
    found = exact("q = dq; dq = -q - 0.1 dq + 0.2 dq^3 - 0.05 dq^5", *starts)
    found = replace(found, diagnostics={"q_low": -2.0, "q_high": 2.0})
    around = Surroundings(np.zeros(2), np.full(2, -2.0), np.full(2, 2.0))
    assert dynamics(found, around, np.random.default_rng(0)).kind == "cycle"
    (condition,) = assess(found).conditions
    assert [cycle.stable for cycle in condition.cycles].count(True) == 1


def test_an_overdamped_coordinate_has_no_mode_of_another() -> None:
    states = "q_v = dq_v; q_w = dq_w; dq_v = -q_v - 9 dq_v; dq_w = -39.5 q_w - 0.1 dq_w"
    around = Surroundings(np.zeros(4), -np.ones(4), np.ones(4))
    found = dynamics(exact(states, [0.1, 0.1, 0, 0]), around, np.random.default_rng(0))
    assert np.isnan(found.frequencies["q_v"].value)
    assert found.frequencies["q_w"].value == pytest.approx(1.0, rel=1e-3)


def test_modes_of_other_states_are_those_of_no_coordinate() -> None:
    text = "x = dx; y = dy; a = 20 b - 0.02 a; b = -20 a; dx = -39.5 x - 0.1 dx + 5 a"
    around = Surroundings(np.zeros(6), -np.ones(6), np.ones(6))
    model = parse_model(f"{text}; dy = -90 y - 0.1 dy + 4 a")
    found = IdentifiedModel(model, is_judged=True, initial_states=np.full((1, 6), 0.1))
    known = dynamics(found, around, np.random.default_rng(0))
    assert known.frequencies["x"].value == pytest.approx(1.0, rel=0.01)
    assert known.frequencies["y"].value == pytest.approx(1.51, rel=0.01)


def test_states_of_other_units_are_told_beside_a_pair() -> None:
    text = "x = dx; dx = 1e6 x - 1e18 x^3 - 100 dx; V = -50 V"
    found = replace(exact(text, [9e-7, 0.0, 5.0]), diagnostics={"x_low": -1e-6, "x_high": 1e-6})
    (condition,) = assess(found).conditions
    assert len(condition.equilibria) == 3 and condition.ends == ("rest",)
    assert set(condition.equilibria[0].place) == {"x", "V"}
    assert "V" in {mode.state for mode in condition.equilibria[0].modes}


def test_growth_without_oscillation_is_no_missing_onset() -> None:
    found = exact("x = U x - x^3", [0.1], inputs=("U",))
    text = assessment_text(assess(found, {"U": np.linspace(-1.0, 1.0, 4)}), {})
    first, second, *_ = text.splitlines()
    assert first == "No onset of oscillations between U = -1 and 1"
    assert second.endswith("the equilibrium becomes unstable without oscillation")


def test_an_equilibrium_is_followed_from_the_first_value_that_has_one() -> None:
    found = exact("q = dq; dq = U - 2 - q^2 + (0.1 U - 0.3) dq - dq^3", [1, 0], inputs=("U",))
    of = assess(found, {"U": [1.0, 2.5, 3.5, 5.0]})
    assert not of.is_complete and of.notes[0] == "no equilibrium was found at U = 1"
    assert [onset.value.value for onset in of.onsets] == pytest.approx([3.0])


def test_parts_with_few_samples_are_compared_with_none() -> None:
    time = np.arange(60) * 0.1
    parts = [Recording(time, STATES, np.column_stack([np.sin(time), np.cos(time)]))] * 2
    found = exact("q = dq; dq = -q", [0, 1]).with_findings(finding_for("approximate"))
    assert find_difference(found, parts, lambda own: pytest.fail("too short")) is None


def test_a_first_guess_of_a_coordinate_without_a_sensor_is_zero() -> None:
    values = np.full((300, 4), np.nan)
    values[:, 0] = np.sin(np.arange(300) * 0.1)
    recording = Recording(np.arange(300) * 0.1, ("x", "y", "dx", "dy"), values)
    assert first_guess(recording, 0)[[1, 3]].tolist() == [0.0, 0.0]


def test_a_first_guess_of_the_velocity_at_rest_is_zero() -> None:
    time = np.arange(100) / 10.0
    recording = Recording(time, ("q", "dq"), np.column_stack([np.zeros(100), np.full(100, np.nan)]))
    assert first_guess(recording, 0).tolist() == [0.0, 0.0]
