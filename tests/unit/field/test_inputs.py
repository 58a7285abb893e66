"""Inputs of files: what is read, what is left out and named, what is refused in one line."""

import json
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pint
import pytest
from ambient import stepped
from click.testing import CliRunner
from field_files import run
from scipy.ndimage import gaussian_filter1d

import galloping
from galloping import IdentifiedModel, Input, PolynomialModel, Recording
from galloping.behaviour.objections import with_objections
from galloping.cli import main
from galloping.identification.findings import Code, Finding
from galloping.model.terms import parse_library
from galloping.readers.mapping import parse_input, validate_mapping
from galloping.readers.series import read_series
from galloping.readers.units import USUAL_UNITS, coefficient_unit
from galloping.recording.samples import evaluate_extended
from galloping.summary.advice import meanings_and_advice
from galloping.summary.analysis import read_field

pytestmark = pytest.mark.xdist_group("inputs")

TIME = np.arange(1000) / 25.0
WIND = 12.0 + np.sin(0.5 * TIME) + 0.3 * np.cos(1.7 * TIME)


def written(path, **columns):
    motion = {"t [s]": TIME, "y [1]": np.sin(2.6 * TIME)}
    pd.DataFrame(motion | columns).to_csv(path, index=False)
    return path


def content(*inputs, **more):
    """Of a mapping."""
    channels = [{"column": "y", "measures": "y"}]
    known = {"time": {"column": "t"}, "states": ["y", "dy"], "channels": channels}
    return known | {"inputs": list(inputs)} | more


def mapping(*inputs):
    return validate_mapping(content(*inputs))


def test_units_and_names_of_inputs_are_read(tmp_path):
    path = written(tmp_path / "a.csv", **{"wind [km/h]": 3.6 * WIND, "T [degC]": WIND})
    of = mapping({"name": "U", "column": "wind", "between": "linear", "error": "2 %"}, "T")
    series = read_series(path, of)
    assert dict(series.units) == {"U": "m/s", "T": "degC"} and not series.unused
    wind = series.inputs["U"]
    np.testing.assert_allclose(wind(TIME), WIND)
    assert (wind.between, wind.error) == ("linear", 0.02)
    as_they_are = read_series(path, mapping({"name": "U", "column": "wind", "unit": "1"}))
    np.testing.assert_allclose(as_they_are.inputs["U"](TIME), 3.6 * WIND)
    shaken = written(tmp_path / "b.csv", **{"base [g]": WIND})
    base = read_series(shaken, mapping({"name": "a", "column": "base"}))
    assert dict(base.units) == {"a": "m/s^2"}  # of gravity, no gram
    np.testing.assert_allclose(base.inputs["a"](TIME), 9.80665 * WIND)
    assert parse_input("U=wind[m/s] +- 2%", "zero") == {
        "name": "U", "column": "wind", "unit": "m/s", "error": "2%", "between": "zero"
    }  # fmt: skip


@pytest.mark.parametrize("between", ["zero", "linear", "cubic"])
def test_where_an_input_is_not_known_the_motion_is_left_out(tmp_path, between):
    wind = WIND.copy()
    wind[300:400] = np.nan
    path = written(tmp_path / "a.csv", **{"U [m/s]": wind})
    field = read_field([path], mapping({"column": "U", "between": between}))
    assert [len(each.time) for each in field.recordings] == [300, 600]
    assert "input U is not known for 4 s, 10 % of the samples: left out" in str(field.reports)


def test_where_an_input_is_known_nowhere_there_is_nothing_to_read(tmp_path):
    path = written(tmp_path / "a.csv", **{"U [m/s]": np.where(TIME < 3.0, WIND, np.nan)})
    (tmp_path / "map.yaml").write_text(json.dumps(content("U")), encoding="utf-8")
    printed = run("inspect", path, "--map", tmp_path / "map.yaml", code=1)
    assert "inputs: U: nowhere are all known for 3 periods" in printed and printed.count("\n") == 1


def test_how_often_a_slower_instrument_samples_is_told_beside_a_gap(tmp_path):
    slow = np.where(np.arange(len(TIME)) % 5 == 0, WIND, np.nan)
    slow[300:600] = np.nan
    path = written(tmp_path / "a.csv", **{"U [m/s]": slow})
    (report,) = read_field([path], mapping("U")).reports
    assert report["inputs"]["U"]["step_s"] == pytest.approx(0.2)


@pytest.mark.parametrize("repeated", [True, False])
def test_rows_between_the_samples_of_a_slower_instrument_are_no_gaps(tmp_path, repeated):
    slow = np.where(np.arange(len(TIME)) % 5 == 0, WIND, np.nan)
    slow = pd.Series(slow).ffill() if repeated else slow
    path = written(tmp_path / "a.csv", **{"U [m/s]": slow})
    field = read_field([path], mapping("U"))
    (recording,) = field.recordings
    inside = slice(0, 990)
    assert np.max(np.abs(recording.inputs["U"](TIME) - WIND)[inside]) < 1e-3
    held = read_field([path], mapping({"column": "U", "between": "zero"})).recordings[0]
    assert held.inputs["U"](TIME[7]) == pytest.approx(WIND[5])


def test_an_anemometer_that_lags_is_put_right(tmp_path):
    path = written(tmp_path / "a.csv", **{"U [m/s]": WIND}, note=["fine"] * len(TIME))
    (recording,) = read_field([path], mapping({"column": "U", "delay": 2.0})).recordings
    assert recording.inputs["U"](3.0) == pytest.approx(WIND[125])
    assert recording.time[-1] == pytest.approx(TIME[-1] - 2.0)
    told = run("inspect", path, "--states", "y", "--input", "U", "--delay", "U=2")
    assert "input U is not known for 1.96 s" in told and "U is an input" in told
    assert "columns that are not used: note" in told
    ((_, help_),) = meanings_and_advice([Finding.of(Code.INPUT_DELAYED_BY, "U", delay_s=1.3)])
    assert "--delay COLUMN=1.3" in help_


U, CALM = ("--input", "U"), [*WIND[:5], "calm", *WIND[6:]]
REFUSED = [  # options, the samples of U, and what the one line says
    (("--input", "V"), WIND, "no column 'V'"),
    (("--input", "U[parsec/beer]"), WIND, "'parsec/beer'"),
    (("--input", "dy=U"), WIND, "inputs: dy"),
    ((*U, *U), WIND, "inputs: U"),
    (("--input", "U +- two"), WIND, "expected NAME=COLUMN[UNIT] +- ERROR %"),
    (U, CALM, "row 7, column 'U': 'calm'"),
    (U, 12.0 + 0 * TIME, "input U is 12"),
    (U, np.nan * TIME, "column 'U' has 0 samples"),
    ((*U, "--library", "poly(y, dy; 3) + dy^3/U"), WIND - 12.0,
     "input U crosses zero, from -1.29669 to 1.27022"),
    (("--library", "y + U*dy"), WIND, "character 5: 'U'"),
    ((*U, "--library", "y + dy"), WIND, "input U"),
    (("--library", "y", "--degree", "2"), WIND, "--degree: "),
    (("--known", "dy: U*dy = 3"), WIND, "'U'"),
    ((*U, "--random-force", "y,z"), CALM, "--random-force: 'z'; must be all, or among y, dy"),
    (("--known", "dy: y^2 = 3", "--library", "y + dy"), WIND,
     "known term y^2"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "samples", "said"), REFUSED)
def test_inputs_that_cannot_be_used_get_one_line(tmp_path, options, samples, said):
    path = written(tmp_path / "a.csv", **{"U [m/s]": samples})
    command = ("identify", path, "--states", "y,dy", "--measure", "y=y", "--output")
    printed = run(*command, tmp_path / "out", *options, code=1)
    assert said in printed and printed.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_units_of_coefficients_have_those_of_inputs():
    states = ("q_v", "dq_v")
    assert coefficient_unit("dq_v", (0, 1), states) == "s^-1"
    for unit, expected in (("m/s", "m^-1"), ("", "s^-1 [U]^-1"), ("V", "s^-1 V^-1"),
                           ("1", "s^-1"), ("N", "s^-1 N^-1")):  # fmt: skip
        assert coefficient_unit("dq_v", (0, 1, 1), (*states, "U"), {"U": unit}) == expected
    assert coefficient_unit("dq_v", (0, 3, -1), (*states, "U"), {"U": "m/s"}) == "m^-1"


def test_usual_units_are_what_pint_says():
    registry = pint.UnitRegistry()
    for unit, (value, metres, seconds) in USUAL_UNITS.items():
        own = registry.Quantity(1.0, "" if unit == "1" else unit)
        assert own == value * registry.m**metres * registry.s**seconds
        assert own.to_base_units().magnitude == value


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A recording of a damped oscillator in the input u, its mapping, and its model."""
    folder = tmp_path_factory.mktemp("driven")
    terms, _ = parse_library("y + dy + u", ("y", "dy"), ("u",))
    truth = PolynomialModel(("y", "dy"), terms, [[0, 1, 0], [-6.0, -0.2, 1.5]], ("u",))
    time = np.arange(3000) / 25.0
    rng = np.random.default_rng(3)
    force = gaussian_filter1d(rng.standard_normal(len(time)), 5) * 3.0
    states = galloping.simulate(truth, [0.5, 0.0], time, {"u": Input(time, force)}).states
    noisy = states[:, 0] + 0.005 * rng.standard_normal(len(time))
    frame = pd.DataFrame({"t [s]": time, "y [1]": noisy, "u [N]": force})
    frame[:2500].to_csv(folder / "a.csv", index=False)
    frame[2400:][["t [s]", "u [N]"]].to_csv(folder / "ahead.csv", index=False)
    more = {"library": "poly(y, dy; 2) + u", "known": ["dy: y = -6 +- 0.01"]}
    (folder / "map.yaml").write_text(json.dumps(content("u", **more)), encoding="utf-8")
    files = folder / "a.csv", "--map", folder / "map.yaml", "--output", folder / "out"
    (folder / "said.json").write_text(run("identify", *files, "--json"), encoding="utf-8")
    return folder, frame, states


def test_a_driven_system_is_identified_by_one_command(driven):
    folder, *_ = driven
    found = IdentifiedModel.load(folder / "out" / "model.json")
    row = dict(zip(found.model.term_names, found.model.coefficients[1], strict=True))
    assert found.status == "ok"
    assert {name for name, value in row.items() if value} == {"y", "dy", "u"}
    assert row["u"] == pytest.approx(1.5, rel=0.01) and row["dy"] == pytest.approx(-0.2, rel=0.05)
    rows = json.loads(run("show", folder / "out" / "model.json", "--json"))
    assert [r["unit"] for r in rows if r["term"] == "u" and r["equation"] == "dy"] == ["s^-2 N^-1"]
    said = json.loads((folder / "said.json").read_text(encoding="utf-8"))
    assert (said["status"], said["inputs"], said["coefficients"]) == ("ok", {"u": "N"}, rows)
    assert all(Path(path).exists() for path in said["files"].values()) and said["files"]
    assert run("show", folder / "out" / "model.json", "--latex").count(r"\frac") == 2
    assert said["summary"]["system"]["at"]["u"]["unit"] == "N"
    summary = (folder / "out" / "summary.md").read_text(encoding="utf-8")
    assert not any(word in summary for word in ("wind", " line", "[u]"))


def test_a_forecast_needs_the_inputs_ahead(driven):
    folder, frame, states = driven
    command = ("forecast", folder / "out" / "model.json", folder / "a.csv", "--map",
               folder / "map.yaml", "--duration", 15)  # fmt: skip
    printed = run(*command, code=1)
    assert "driven by u" in printed and "--inputs FILE" in printed and printed.count("\n") == 1
    ahead = pd.read_csv(StringIO(run(*command, "--inputs", folder / "ahead.csv")))
    true = np.interp(ahead["time_s"], frame["t [s]"], states[:, 0])
    assert np.std(ahead["y"] - true) < 0.02 * np.std(true)
    held = pd.read_csv(StringIO(run(*command, "--at", "u=0")))
    assert np.std(held["y"] - true) > 10 * np.std(ahead["y"] - true)
    told = json.loads((folder / "map.yaml").read_text(encoding="utf-8")) | {"decimal": ","}
    (folder / "commas.yaml").write_text(json.dumps(told), encoding="utf-8")
    frame[:2500].to_csv(folder / "commas.csv", sep=";", decimal=",", index=False)
    rows = "".join(f"{t:.3f};2.000\n".replace(".", ",") for t in np.arange(96.0, 116.0, 0.04))
    (folder / "thousands.csv").write_text(f"t [s];u [N]\n{rows}", encoding="utf-8")
    file, mapping = folder / "commas.csv", ("--map", folder / "commas.yaml")
    ahead, held = (
        pd.read_csv(StringIO(run(*command[:2], file, *mapping, "--duration", 15, *said)))
        for said in (("--inputs", folder / "thousands.csv"), ("--at", "u=2"))
    )
    np.testing.assert_allclose(ahead["y"], held["y"], atol=1e-3)
    late = ("--inputs", folder / "a.csv")
    assert "from 99.96 to" in run(*command, *late, code=1)
    assert "--at u: " in run(*command, "--at", "u=1:2", code=1)


def test_a_model_with_inputs_is_simulated_in_them(driven, tmp_path):
    folder, frame, _ = driven
    model = folder / "out" / "model.json"
    assert "driven by u" in run("simulate", model, code=1)
    rows = run("simulate", model, "--at", "u=2", "--duration", 2000, "--rate", 1).splitlines()
    assert float(rows[-1].split(",")[1]) == pytest.approx(0.5, rel=0.02)  # 1.5 u / 6
    far = CliRunner().invoke(main, ["simulate", str(model), "--at", "u=200", "--duration", "1"])
    assert "Extrapolation: u = 200" in far.stderr
    path = folder / "a.csv"
    simulated = pd.read_csv(StringIO(run("simulate", model, "--inputs", path, "--rate", 25)))
    assert len(simulated) == 2500
    measured = frame["y [1]"][:2500].to_numpy()
    assert np.std(simulated["y"] - measured) < 0.03 * np.std(measured)
    printed = run("simulate", model, "--inputs", path, "--duration", 200, code=1)
    assert "99.96 s" in printed
    frame.iloc[[*range(1000), *range(1100, 2500)]].to_csv(tmp_path / "gap.csv", index=False)
    printed = run("simulate", model, "--inputs", tmp_path / "gap.csv", code=1)
    assert "gap.csv: inputs have a gap after 39.96 s" in printed
    both = ("--at", "u=2", "--inputs", tmp_path / "absent.csv")
    for command in (("simulate", model), ("forecast", model, path, "--map", folder / "map.yaml")):
        assert "--at and --inputs exclude each other for u" in run(*command, *both, code=1)
    content = json.loads(model.read_text(encoding="utf-8"))
    (tmp_path / "model.json").write_text(json.dumps(content | {"units": "m"}), encoding="utf-8")
    assert "units: 'm': must be" in run("simulate", tmp_path / "model.json", code=1)
    for name, said in (("u", "has no unit; write the unit"), ("v [N]", "names of the model's"),
                       ("u [degC]", "u is in degC; must be convertible to N")):  # fmt: skip
        frame.set_axis(["t [s]", "y", name], axis=1).to_csv(tmp_path / "u.csv", index=False)
        printed = run("simulate", model, "--inputs", tmp_path / "u.csv", code=1)
        assert said in printed and "--input " not in printed and "--unit" not in printed


def test_numbers_of_options_are_finite(driven):
    folder, *_ = driven
    model = folder / "out" / "model.json"
    for number in ("inf", "nan", "1e200"):
        assert "below 1e+100" in run("simulate", model, "--duration", number, code=2)
    for values, said in ((["-1e308:1e308:1"], "2 to 200 values"), (["1", "2"], "given twice")):
        at = [option for value in values for option in ("--at", f"u={value}")]
        assert said in run("assess", model, *at, code=1)


def test_what_jumps_anywhere_is_held_unless_the_mapping_says_otherwise(tmp_path):
    stairs = np.repeat(np.random.default_rng(1).uniform(-1.0, 1.0, len(TIME) // 20 + 1), 20)
    path = written(tmp_path / "a.csv", **{"U [m/s]": stairs[: len(TIME)]})
    for said, between in (("U", "zero"), ({"column": "U", "between": "cubic"}, "cubic")):
        field = read_field([path], mapping(said))
        assert field.recordings[0].inputs["U"].between == between
        assert field.reports[0]["inputs"]["U"]["between"] == between


def test_beyond_its_end_an_input_is_what_it_was_last():
    one = Input(np.arange(11.0), np.arange(10.0, 21.0))
    np.testing.assert_allclose(evaluate_extended(one, np.array([-0.3, 10.01, 40.0])), [10, 20, 20])


def test_what_an_input_drives_is_not_said_to_be_moved_by_random_forces():
    """The force is the square of the input, which the library lacks: its model comes to rest."""
    rng, time = np.random.default_rng(1), np.arange(3000) / 10.0
    u = gaussian_filter1d(rng.standard_normal(3000), 5.0)
    u /= u.std()
    forces = np.repeat(u[:, np.newaxis] ** 2 - 1.0, 20, axis=1)
    motion, _ = stepped(lambda x, v, force: -4.0 * x - 0.1 * v + force, forces, 0.1 / 20)
    read = motion + 0.02 * np.std(motion) * rng.standard_normal(3000)
    values = np.column_stack([read, np.full(3000, np.nan)])
    recording = Recording(time, ("q", "dq"), values, inputs={"u": Input(time, u, "zero")})

    def identify(own):
        return galloping.maximum_likelihood(own, ((1, 0, 0), (0, 1, 0), (0, 0, 1)))

    found = with_objections(identify([recording]), [recording], ["a"], np.pi, identify)
    assert found.status == "approximate" and not found.has_finding(Code.KEPT_UP)
