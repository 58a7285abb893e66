"""Parts of the readers: units, names, angles, hints, sampling rates."""

import numpy as np
import pytest
from field_files import run
from odd_files import ROWS, V, W, table, written

from galloping.readers.columns import (
    is_beside_motion,
    is_time,
    measured_quantity,
    quantity_by_name_alone,
)
from galloping.readers.file_table import printable, read_table
from galloping.readers.hints import likely_time_unit, likely_unit
from galloping.readers.series import unwrap_angle
from galloping.readers.units import UnitError, factor, input_si, is_unit, split_header

TIME = np.arange(2000) / 50.0


@pytest.mark.parametrize(
    ("unit", "wanted", "expected"),
    [
        ("mm", "m", 1e-3), ("0.85 mm", "m", 0.85e-3), ("inch", "m", 0.0254), ("mil", "m", 2.54e-5),
        ("0.04 s", "s", 0.04), ("d", "s", 86400.0), ("Sek", "s", 1.0), ("km/h", "m/s", 1 / 3.6),
        ("g", "m/s^2", 9.80665), ("mg", "m/s^2", 9.80665e-3), ("G", "m/s^2", 9.80665),
        ("m s⁻²", "m/s^2", 1.0), ("ms^-2", "m/s^2", 1.0), ("in/s2", "m/s^2", 0.0254),
    ],
)  # fmt: skip
def test_units_of_instruments_are_read(unit, wanted, expected):
    assert factor(unit, wanted) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "unit",
    ["px", "pixel", "pt", "counts", "V", "mV", "MM", "Mm", "Zoll", '"', "furlong", "barn/m", "",
     "m**9**9**9", "(m**9)**9", "1e999 m", "0 m", "m" * 99, "2**9 m", "m^100"],
)  # fmt: skip
def test_what_is_no_length_is_refused_at_once(unit):
    with pytest.raises(UnitError):
        factor(unit, "m")


def test_units_of_inputs_keep_their_names_without_prefixes():
    assert input_si("kN") == (1000.0, "N") and input_si("mV") == (pytest.approx(1e-3), "V")
    assert input_si("degC") == (1.0, "degC") and input_si("%") == (0.01, "1")
    assert input_si("0.5 V") == (0.5, "V") and input_si("1 N") == (1.0, "N")
    for gravity in ("3.9 mg", "0.0039 g", "0.0039 G"):  # of one count of an accelerometer
        assert input_si(gravity) == (pytest.approx(0.0039 * 9.80665), "m/s^2")
    assert input_si("µm/m") == (pytest.approx(1e-6), "1")
    assert input_si("mV/V") == (pytest.approx(1e-3), "1")
    with pytest.raises(UnitError):
        input_si("counts")


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("Position (m) Run #1", ("Position Run #1", "m")), ("Weg in mm", ("Weg", "mm")),
        ("Angle [deg] left", ("Angle left", "deg")), ("x (t)", ("x (t)", "")),
        ("Phase (A) (mm)", ("Phase (A)", "mm")), ("CH1", ("CH1", "")),
    ],
)  # fmt: skip
def test_units_stand_anywhere_in_a_name(header, expected):
    assert split_header(header) == expected


def test_a_channel_is_no_unit():
    assert not any(map(is_unit, ("CH1", "TIME", "Max", "X", "1", "Marker", "")))
    assert all(map(is_unit, ("mm", "Volt", "G", "°", "deg", "%", "m/s²")))


@pytest.mark.parametrize(
    ("header", "measured"),
    [
        ("Lat. disp. phase A (mm)", "q_w"), ("Vert. acc. [g]", "ddq_v"), ("Hor. [mm]", "q_w"),
        ("Trans. vel. (m/s)", "dq_w"), ("Horiz. displ.", "q_w"), ("Long. disp. (mm)", ""),
        ("Lat [deg]", ""), ("Lat", ""), ("vertical tilt [deg]", ""), ("Vertical [V]", ""),
    ],
)  # fmt: skip
def test_abbreviated_directions_are_read(header, measured):
    assert measured_quantity(header) == measured


def test_a_unit_that_denies_a_plain_name_is_noticed():
    assert quantity_by_name_alone("Vertical Displacement", "V") == "q_v"
    assert quantity_by_name_alone("lateral acceleration [counts]", "") == "ddq_w"
    for header in ("v [V]", "Lat [deg]", "vertical [m]", "vertical", "wind vertical [m/s]"):
        assert quantity_by_name_alone(header, "") == ""


@pytest.mark.parametrize("low", [0.0, -180.0, 37.0])
@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_an_angle_that_starts_again_is_unwrapped(low, noise):
    angle = low + 60.0 * np.sin(2.6 * TIME) + noise * np.random.default_rng(1).normal(size=2000)
    angle[700:720] = np.nan
    found, wraps = unwrap_angle((angle - low) % 360.0 + low, 360.0)
    assert wraps > 20
    turns = ((found - angle) / 360.0)[np.isfinite(angle)]
    assert np.array_equal(np.isnan(found), np.isnan(angle))
    np.testing.assert_allclose(turns, np.round(turns[0]), atol=1e-9)
    assert abs(np.nanmedian(found)) <= 180.0


@pytest.mark.parametrize(
    "angle",
    [
        np.repeat([0.0, 270.0, 0.0, 350.0], 500),  # a valve
        60.0 * np.sin(2.6 * TIME),
        720.0 * np.sin(0.1 * TIME),
        np.where(np.arange(2000) == 900, 250.0, 10.0 * np.sin(2.6 * TIME)),  # one sample is wrong
    ],
)
def test_an_angle_that_does_not_start_again_stays(angle):
    found, wraps = unwrap_angle(angle, 360.0)
    assert wraps == 0 and found is angle


def test_hints_fit_the_values():
    rows = np.arange(1000.0)
    for first, step, unit in (
        (0.0, 0.04, "s"), (1.77e9, 0.04, "s"), (1.77e12, 40.0, "ms"), (1.77e15, 4e4, "us"),
        (1.77e18, 4e7, "ns"), (46053.5, 0.04 / 86400, "d"), (739000.0, 0.04 / 86400, "d"),
        (43200.0, 0.04, "s"), (0.0, 40.0, "ms"),
    ):  # fmt: skip
        assert likely_time_unit(first + step * rows) == unit
    assert likely_unit(0, V) == "m" and likely_unit(0, 500.0 * V) == "mm"
    gravity = {"m/s^2": 9.81, "g": 1.0, "mg": 1000.0, "mm/s^2": 9807.0}
    for unit, size in gravity.items():
        assert likely_unit(2, 0.1 * size * V, [size + 0.1 * size * V]) == unit


def test_rows_are_samples_at_a_rate(tmp_path):
    path = written(tmp_path / "a.csv", table("vertical [m],horizontal [m]", V, W))
    (tmp_path / "map.yaml").write_text(
        "rate: 25\nstates: [q_v, q_w, dq_v, dq_w]\nchannels:\n"
        "  - {column: vertical, measures: q_v}\n  - {column: horizontal, measures: q_w}\n"
    )
    said = run("inspect", path, "--map", tmp_path / "map.yaml")
    assert said == run("inspect", path, "--rate", 25) and "39.96 s (25 Hz)" in said
    written_map = tmp_path / "proposed.yaml"
    run("inspect", path, "--rate", 25, "--write-map", written_map)
    assert said == run("inspect", path, "--map", written_map)
    assert "time: is missing" in run("inspect", path, "--map", _without_rate(written_map), code=1)


def test_a_rate_that_contradicts_the_times_is_refused(tmp_path):
    path = written(tmp_path / "a.csv", table("time [s],vertical [m]", TIME[:1000], V))
    said = run("inspect", path, "--rate", 25, code=1)
    assert "column 'time' has a sample every 0.02 s, and the rate is 25 Hz" in said
    assert "(50 Hz)" in run("inspect", path, "--rate", 50)
    coarse = written(tmp_path / "b.csv", table("time [s],vertical [m]", np.floor(TIME[:1000]), V))
    assert "(25 Hz)" in run("inspect", coarse, "--rate", 25)


def _without_rate(path):
    lines = path.read_text().splitlines()
    path.write_text("\n".join(line for line in lines if not line.startswith("rate")))
    return path


def test_a_count_of_samples_keeps_the_gaps_of_a_camera(tmp_path):
    kept = np.r_[:400, 430:1000]
    counts = [ROWS[k] for k in kept]
    path = written(tmp_path / "a.csv", table("frame,vertical [m]", counts, V[kept]))
    assert "39.96 s (25 Hz), 1 gap, of 1.24 s" in run("inspect", path, "--rate", 25)


def test_a_range_far_from_zero_has_enough_digits(tmp_path):
    path = written(tmp_path / "a.csv", table("t [s],vertical [m]", TIME[:1000], 1000.0 + 0.1 * V))
    assert "999.9 m to 1000.1 m" in run("inspect", path)


def test_a_name_has_one_line_that_prints():
    assert printable("a\n**ok**: b\x1b[31m\u202e c") == "a **ok**: b [31m c"


@pytest.mark.parametrize("header", ["Temps", "Tempo [s]", "Temps (s)", "t", "Zeit"])
def test_times_have_names_in_several_languages(header: str) -> None:
    assert is_time(header) and not is_beside_motion(header)
    assert not is_time("Temperatur") and is_beside_motion("Temperature [degC]")


@pytest.mark.parametrize(
    ("header", "row", "unit"),
    [
        ("Name t v w\nUnits: s mm mm", "{} 0.5 0.1 0.2", "mm"),
        ("# units: s mm mm\nt v w", "0.{:02} 0.1 0.2", "mm"),
        ("t;v", "{};\N{MINUS SIGN}9,81", ""),
    ],
)
def test_labels_of_units_and_minus_signs_are_read_in_any_layout(tmp_path, header, row, unit):
    path = tmp_path / "a.txt"
    rows = "\n".join(row.format(k + 5) for k in range(10))
    path.write_text(f"{header}\n{rows}\n", encoding="utf-8")
    table = read_table(path)
    assert table.unit("v") == unit and len(table.numbers("v")) == 10
