"""Files of instruments: every kind is read alike, every bad one is refused in one line."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.signal import StateSpace, lfilter, lsim

from galloping.inspection.quality import inspect_recording
from galloping.readers import FileError
from galloping.readers.mapping import MappingError, parse_channel, validate_mapping
from galloping.readers.recordings import make_recording
from galloping.readers.series import read_series

TIME = np.arange(500) * 0.04
V, W = np.sin(2.6 * TIME), np.cos(1.3 * TIME)
MAPPING = {
    "time": {"column": "t", "unit": "s"},
    "states": ["q_v", "q_w", "dq_v", "dq_w"],
    "channels": [
        {"column": "v", "measures": "q_v", "unit": "mm"},
        {"column": "w", "measures": "q_w", "unit": "m"},
    ],
}


FRAME = pd.DataFrame({"t": TIME, "v": 1000 * V, "w": W})


def write(path, frame):
    frame.to_csv(path, index=False)
    return path


def recorded(path, frame, **more):
    """The recording of a file of a frame, by the mapping with other keys."""
    mapping = validate_mapping({**MAPPING, **more})
    return make_recording(read_series(write(path, frame), mapping), mapping)


def questioned(path, frame, **more):
    """What is said of the quality of a file of a frame, by the mapping with other keys."""
    mapping = validate_mapping({**MAPPING, **more})
    return inspect_recording(read_series(write(path, frame), mapping), mapping)


def test_states_of_another_system_are_taken_in_si_whatever_unit_they_have(tmp_path):
    path = write(tmp_path / "a.csv", pd.DataFrame({"t [s]": TIME, "x [mm]": 1e3 * V, "dx [V]": W}))
    system = {"time": {"column": "t"}, "states": ["x", "dx"]}
    given = {"x": {"noise": "2 mm"}, "dx": {"unit": "1", "noise": 3}}
    channels = [{"column": c, "measures": c, **more} for c, more in given.items()]
    series = read_series(path, validate_mapping({**system, "channels": channels}))
    np.testing.assert_allclose(series.values, np.column_stack([V, W]))
    np.testing.assert_allclose(series.noise, [0.002, 3.0])
    assert series.notes == ("column 'x' is read in m; numbers of x are printed without this unit",)
    channels[0]["unit"] = "1"
    with pytest.raises(FileError, match="'2 mm'"):
        read_series(path, validate_mapping({**system, "channels": channels}))


def test_units_come_from_the_description_beside_a_file(tmp_path):
    channels = [{"column": c, "measures": f"q_{c}"} for c in "vw"]
    mapping = validate_mapping({**MAPPING, "time": {"column": "t"}, "channels": channels})
    described = write(tmp_path / "b.csv", FRAME)
    fields = [{"name": n, "unit": u} for n, u in (("t", "s"), ("v", "mm"), ("w", "m"))]
    package = {"resources": [{"path": "b.csv", "schema": {"fields": fields}}]}
    (tmp_path / "datapackage.json").write_text(json.dumps(package))
    np.testing.assert_allclose(read_series(described, mapping).values[:, 0], V, atol=1e-12)
    fields[0]["unit"] = ["s"]
    package["resources"][0]["schema"] = fields
    (tmp_path / "datapackage.json").write_text(json.dumps(package))
    with pytest.raises(FileError, match=r"datapackage\.json: "):
        read_series(described, mapping)


def test_what_is_safe_is_mended_and_said(tmp_path):
    frame = FRAME.copy()
    frame.loc[100:104, "v"] = np.nan
    mixed = pd.concat([frame[:200], frame[199:200], frame[250:], frame[200:250]])
    series = read_series(write(tmp_path / "a.csv", mixed), validate_mapping(MAPPING))
    np.testing.assert_allclose(series.time, TIME, atol=1e-12)
    assert np.isnan(series.values[100:105, 0]).all()
    assert series.notes[0].endswith("sorted by time")
    assert "repeated rows were dropped" in series.notes[1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"states": ["x", "x"]}, "x is named twice"),
        ({"channels": []}, "at least 1"),
        ({"channels": [{"column": "v", "measures": "z"}]}, "measures 'z', which is neither"),
        ({"channels": [{"column": "v", "measures": "q_v", "position": 3}]}, "needs the span"),
        ({"span": 2, "channels": [{"column": "v", "measures": "q_v", "position": 3}]}, "not in"),
        ({"speed": 3}, "speed: 3: there is no such key; allowed: time, rate, states"),
        ({"time": {"column": "t", "units": "s"}}, "no such key; allowed: column, unit"),
        ({"library": 3}, "library.0: 3: must be text"),
        ({"rate": True}, "rate: true: must be no truth value"),
        ({"decimal": ";"}, "decimal: ';': must be"),
        ({"random_force": ["z"]}, "random_force: 'z'; must be all, or among"),
    ],
)
def test_a_bad_mapping_is_refused_by_name(change, message):
    with pytest.raises(MappingError, match=message):
        validate_mapping({**MAPPING, **change})


def test_short_form_of_a_channel():
    assert parse_channel("ddq_v=acc mid[g_n]@150") == {
        "measures": "ddq_v", "column": "acc mid", "unit": "g_n", "position": "150",
    }  # fmt: skip


def test_three_sensors_separate_the_first_mode_from_two_others(tmp_path):
    places = (75.0, 150.0, 225.0)
    modes = [np.sin(2.6 * TIME), 0.3 * np.sin(5 * TIME), 0.2 * np.cos(4 * TIME)]
    columns = {
        f"s{k}": sum(m * np.sin((j + 1) * np.pi * place / 300) for j, m in enumerate(modes))
        for k, place in enumerate(places)
    }
    channels = [
        {"column": f"s{k}", "measures": "q_v", "unit": "m", "position": place}
        for k, place in enumerate(places)
    ]
    frame = pd.DataFrame({"t": TIME, **columns})
    read = recorded(tmp_path / "a.csv", frame, channels=channels, span=300)
    np.testing.assert_allclose(read.values[:, 0], modes[0], atol=1e-12)


def test_a_delayed_channel_is_moved_to_when_it_was_true(tmp_path):
    vertical, horizontal = MAPPING["channels"]
    channels = [vertical, {**horizontal, "delay": 0.12}]
    frame = FRAME.assign(w=np.sin(2.6 * (TIME - 0.12)))
    read = recorded(tmp_path / "a.csv", frame, channels=channels)
    both = np.isfinite(read.values[:, :2]).all(axis=1)
    assert both.sum() > 400
    np.testing.assert_allclose(read.values[both, 0], read.values[both, 1], atol=1e-9)


def test_quality_tells_noise_frequency_outliers_gaps_and_clipping(tmp_path):
    rng = np.random.default_rng(1)
    time = np.arange(0, 300, 0.04)
    values = 1000 * np.sin(2.6 * time) + 50 * rng.standard_normal(len(time))
    values[7] = 1e5
    frame = pd.DataFrame({"t": time, "v": values, "w": np.clip(np.cos(1.3 * time), -1, 0.9)})
    left_out, empty = frame.drop(index=range(2000, 2100)), frame.copy()
    empty.loc[range(2000, 2100), ["v", "w"]] = np.nan
    for each in (empty, left_out):
        report = questioned(tmp_path / "a.csv", each)
        assert report["sampling"]["gaps_total"] == 1 and report["sampling"]["gaps"][0] == {
            "row": 2001, "from_s": pytest.approx(79.96), "length_s": pytest.approx(4.04),
        }  # fmt: skip
    v = report["channels"]["v"]
    assert v["noise"] == pytest.approx(0.05, rel=0.05)
    assert v["dominant_frequencies_hz"][0] == pytest.approx(2.6 / (2 * np.pi), abs=0.004)
    said = {(p["column"], p["row"], p["code"]) for p in report["problems"]}
    assert ("v", 9, "outliers_seen") in said
    assert any(column == "w" and code == "clipped" for column, _, code in said)
    json.dumps(report, allow_nan=False)


def test_quick_swings_and_gaps_are_no_outliers_and_what_a_sensor_missed_is_told(tmp_path):
    time = np.arange(7500) / 25
    frame = pd.DataFrame({"t": time, "v": 1000 * np.sin(15 * time), "w": np.cos(1.3 * time)})
    frame.loc[1000:2500, "w"] = np.nan
    (problem,) = questioned(tmp_path / "a.csv", frame)["problems"]
    assert (problem["column"], problem["row"], problem["code"]) == ("w", 1001, "samples_missing")
    assert problem["data"]["share"] == pytest.approx(0.2, abs=0.005)


@pytest.mark.parametrize(("share", "said"), [(0.0, ["w"]), (0.3, [])])
def test_a_sensor_that_shows_nothing_of_its_own_is_told(tmp_path, share, said):
    noises = 0.02 * np.random.default_rng(3).standard_normal((2, len(TIME)))
    frame = FRAME.assign(v=1000 * (V + noises[0]), w=1.7 * V + share * W + noises[1])
    problems = questioned(tmp_path / "a.csv", frame)["problems"]
    same = [one for one in problems if one["code"] == "shown_twice"]
    assert [one["column"] for one in same] == said
    assert [round(one["data"]["times"], 1) for one in same] == [1.7] * len(said)


def test_a_motion_that_dies_out_does_not_jump(tmp_path):
    """Its quiet end tells nothing of how far its beginning is from a polynomial."""
    time = np.arange(3000) * 0.05
    decays = 0.2 * np.exp(-0.05 * time) * np.cos(2.95 * time) + 0.006 * np.cos(5.65 * time)
    decays += 0.004 * np.random.default_rng(3).standard_normal(3000)
    for step, jumps in ((0.0, False), (0.3, True)):
        seen = decays + step * (time > 40.0)
        report = questioned(
            tmp_path / "a.csv", pd.DataFrame({"t": time, "v": -900 * seen, "w": seen})
        )
        told = [each["code"] for each in report["problems"] if each["column"] == "w"]
        assert ("channel_jumps" in told) == jumps


def test_samples_that_a_camera_missed_are_no_jumps(tmp_path):
    time, rng = np.arange(3000) * 0.05, np.random.default_rng(3)
    seen = 0.05 * np.sin(2.6 * time + [[0.0], [1.0]]) + 0.01 * rng.standard_normal((2, 3000))
    seen[:, rng.random(3000) < 0.05] = np.nan
    frame = pd.DataFrame({"t": time, "v": 1000 * seen[0], "w": seen[1]})
    assert questioned(tmp_path / "a.csv", frame)["problems"] == []


def test_what_follows_gusts_is_neither_too_short_nor_in_a_wrong_unit(tmp_path):
    time, rng = np.arange(3000) / 10.0, np.random.default_rng(3)
    gust = lfilter([1.0], [1.0, -0.995], rng.standard_normal(len(time)))  # of 20 s
    own = {"v": 1e3 * np.sin(2.6 * time), "w": 0.1 * gust}
    assert "periods" not in str(questioned(tmp_path / "a.csv", pd.DataFrame({"t": time, **own})))
    slow = own | {"w": np.sin(0.15 * time)}  # seven periods
    (one,) = questioned(tmp_path / "b.csv", pd.DataFrame({"t": time, **slow}))["problems"]
    assert (one["column"], one["code"]) == ("w", "few_periods")


def test_a_random_force_in_an_accelerometer_is_no_noise(tmp_path):
    time, rng = np.arange(6000) / 20.0, np.random.default_rng(3)
    force = 20.0 * rng.standard_normal(len(time))  # mm/s^2
    mode = StateSpace([[0, 1], [-6.8, -0.03]], [[0], [1]], [[-6.8, -0.03]], [[1]])
    moved = lsim(mode, force, time, interp=False)[1]
    channels = [{"column": "v", "measures": "ddq_v", "unit": "mm/s^2"}]

    def said(values):
        frame = pd.DataFrame({"t": time, "v": values})
        problems = questioned(tmp_path / "a.csv", frame, channels=channels)["problems"]
        return [each["code"] for each in problems]

    assert said(moved) == [] and said(force) == ["mostly_noise"]


def test_sensors_that_a_logger_writes_in_turn_have_their_own_step(tmp_path) -> None:
    rows = [FRAME.assign(w=np.nan), FRAME.assign(v=np.nan, t=TIME + 0.001)]
    frame = pd.concat(rows).sort_values("t")
    report = questioned(tmp_path / "a.csv", frame)
    assert report["sampling"]["rate_hz"] == pytest.approx(25.0, rel=1e-6)
    assert report["sampling"]["gaps_total"] == 0
    assert recorded(tmp_path / "b.csv", frame).step == pytest.approx(0.04, rel=1e-6)


@pytest.mark.parametrize(("form", "start"), [
    ("%y/%m/%d %H:%M:%S.%f", None), ("%Y-%m-%dT%H:%M:%S.%f", "2026-01-02T"),
    ("%Y-%m-%dT%H:%M:%S.%f+01:00", "2026-01-01T"), ("%H:%M:%S.%f", ""),
])  # fmt: skip
def test_times_over_midnight_go_on_and_have_a_zone_only_where_it_stands(tmp_path, form, start):
    day = "2026-01-01" if start == "2026-01-01T" else "2026-01-02"
    dates = pd.Timestamp(f"{day}T23:59:50") + pd.to_timedelta(TIME, "s")
    path = write(tmp_path / "a.csv", FRAME.assign(t=dates.strftime(form)))
    mapping = validate_mapping({**MAPPING, "time": {"column": "t"}})
    if start is None:  # may be the 26th of January
        with pytest.raises(FileError, match="day or month first"):
            read_series(path, mapping)
        return
    series = read_series(path, mapping)
    np.testing.assert_allclose(series.time, TIME, atol=1e-6)
    assert series.start.startswith(start) and series.start.endswith("+00:00") == ("+" in form)
    assert bool(series.start) == bool(start)


@pytest.mark.parametrize(("cell", "said"), [
    ("abc", "row 202, column 'v': 'abc' is not a number"),
    ("1.234,5", "row 202, column 'v': '1.234,5' is not a number"),
    ("1.234", "'1.234' has a point, which separates thousands"),
])  # fmt: skip
def test_one_bad_cell_among_decimal_commas_is_named(tmp_path, cell: str, said: str) -> None:
    rows = [";".join(f"{x:.2f}".replace(".", ",") for x in row) for row in FRAME.to_numpy()]
    rows[200] = f"8,00;{cell};3,00"
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t;v;w", *rows]))
    with pytest.raises(FileError, match=said):
        read_series(path, validate_mapping({**MAPPING, "decimal": ","}))


@pytest.mark.parametrize("shift", [0, 3])
def test_repetitions_of_a_slower_camera_are_no_samples(tmp_path, shift) -> None:
    held, coarse = np.roll(np.repeat(W[::5], 5), shift), np.round(0.5 * W, 1)
    for values, kept in ((held, 100), (coarse, 500)):
        path = write(tmp_path / "a.csv", FRAME.assign(w=values))
        series = read_series(path, validate_mapping(MAPPING))
        known = np.isfinite(series.values)
        assert known[:, 0].all() and known[:, 1].sum() == pytest.approx(kept, abs=1)
        assert ("repeats each sample" in str(series.notes)) == (kept < 500)
        if kept < 500 and not shift:
            np.testing.assert_allclose(series.values[known[:, 1], 1], W[::5], atol=1e-12)


@pytest.mark.parametrize(("day", "start"), [("05/06/2026", ""), ("05/16/2026", "2026-05-16T12")])
def test_a_day_that_may_be_a_month_is_not_told(tmp_path, day, start) -> None:
    times = pd.Timestamp("2026-05-06T12:00:00") + pd.to_timedelta(TIME, "s")
    path = write(tmp_path / "a.csv", FRAME.assign(t=times.strftime(f"{day} %H:%M:%S.%f")))
    series = read_series(path, validate_mapping({**MAPPING, "time": {"column": "t"}}))
    assert series.start[:13] == start
    np.testing.assert_allclose(series.time, TIME, atol=1e-6)
