"""Tables of sweep points and their figures: what is in them, and that nothing stops them."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from lines import RESONANT, START, edited, simulator
from pictures import drawn
from PIL import Image

from galloping.cycles import rows
from galloping.cycles.family import line_family
from galloping.cycles.prediction import Prediction
from galloping.cycles.ranking import Design, derive_parts, rank_measures
from galloping.cycles.settling import settle
from galloping.figures.engineering import draw_measures, draw_orbits, write_animation
from galloping.figures.motions import draw_limit_cycles, draw_prediction, draw_resonance_map
from galloping.figures.parts import MAX_FIGURE_HEIGHT
from galloping.line import measures
from galloping.line.measures import (
    FOOT,
    NO_MEASURE,
    cigre,
    clearance,
    davison,
    ice_removal,
    pendulum,
    toye,
)


def test_diagram():
    along = rows.line_diagram(RESONANT, "wind_speed", 4, 9, simulator())
    simulated = rows.simulation_rows("line", RESONANT, "wind_speed", [4, 8], simulator())
    assert [row["kind"] for row in simulated] == ["rest", "cycle"]
    cycles = pd.DataFrame(rows.limit_cycle_rows("line", "wind_speed", along) + simulated)
    assert set(cycles["unit"]) == {"m/s"} and cycles["trivial_multiplier_error"].max() <= 1e-6
    changes = pd.DataFrame(rows.bifurcation_rows("line", "wind_speed", along, RESONANT))
    (hopf,) = changes[changes["name"] == "Hopf"].to_dict("records")
    assert hopf["value"] == pytest.approx(hopf["closed_form_wind_m_s"], rel=1e-9)
    ends = changes[changes["name"] == "end"]
    assert list(ends["note"]) == ["reached 9"] * 3

    def figure(line):
        settings = {"parameter": "wind_speed", "label": "wind speed", "cases": {"line": line}}
        return drawn(lambda: draw_limit_cycles(cycles, changes, settings))

    assert figure(None) != figure(RESONANT)  # which is shaded
    settings = {"parameter": "wind_speed", "label": "wind speed", "cases": {"line": RESONANT}}
    said = draw_limit_cycles(cycles, changes, settings).get_label()
    assert f"{hopf['value']:.1f} m/s (line)" in said
    alone = drawn(lambda: draw_limit_cycles(cycles, changes, settings))
    tenser = cycles.assign(parameter="tension", value=1e4 * cycles["value"])
    both = pd.concat([cycles, tenser])
    assert drawn(lambda: draw_limit_cycles(both, changes, settings)) == alone
    still = cycles[cycles["kind"] == "rest"].assign(vertical_amplitude_m=1e-260)
    figure = draw_limit_cycles(still, changes[:0], settings)
    assert figure.axes[0].get_ylim()[1] > 1e-3  # not of the remains of a motion
    (axes,) = draw_limit_cycles(tenser, changes, settings).axes
    assert axes.texts[0].get_text() == "this study does not vary the wind speed alone"


def test_parameters_without_a_hopf_bifurcation_in_their_range():
    along = rows.line_diagram(RESONANT, "tension", 18e3, 34e3, simulator())
    cycles = pd.DataFrame(rows.limit_cycle_rows("line", "tension", along))
    assert set(cycles["unit"]) == {"N"} and {18e3, 34e3} <= set(cycles["value"])
    assert list(cycles["branch"].unique()) == [
        "from 26000, side 1", "from 26000, side 2",  # of two vertical swings, about resonance
        "from 26000, side 1, halved, side 1", "from 26000, side 1, halved, side 2",
    ]  # fmt: skip
    changes = pd.DataFrame(rows.bifurcation_rows("line", "tension", along, RESONANT))
    doublings = changes.loc[changes["name"] == "period doubling", "value"]
    assert sorted(doublings) == pytest.approx([21434.1, 28031.9], abs=0.1)
    assert not changes["note"].str.contains("incomplete").any()
    calm = rows.line_diagram(RESONANT, "wind_speed", 2, 4, simulator())
    *_, last = rows.bifurcation_rows("line", "wind_speed", calm, RESONANT)
    assert last["note"].startswith("no limit cycle: no Hopf bifurcation in 2..4 m/s, and at 3")
    with pytest.raises(ValueError, match="wind_speed"):
        rows.line_diagram(RESONANT, "phase_of_the_moon", 0, 1, simulator())


def test_map_and_orbits():
    winds, tensions = ("wind_speed", [8.0, 30.0]), ("tension", [22e3, 25e3, 28e3])
    table = pd.DataFrame(rows.map_rows("line", RESONANT, winds, tensions, simulator()))
    assert table["frequency_ratio"].is_monotonic_decreasing
    assert not np.isfinite(table["vertical_amplitude_m"]).all()  # 30 m/s is too much for the model
    settings = {"case": "line", "x_label": "x", "y_label": "y", "y_scale": 1000}
    alone = drawn(lambda: draw_resonance_map(table, settings))
    more = pd.concat([table, table.assign(y_parameter="span"), table])  # of other sweeps
    assert drawn(lambda: draw_resonance_map(more, settings)) == alone
    assert drawn(lambda: draw_resonance_map(more[more["y_parameter"] == "span"], settings))
    other = {"x": table["y"], "y": table["x"], "x_parameter": "tension"}
    turned = table.assign(**other, y_parameter="wind_speed")
    assert drawn(lambda: draw_resonance_map(turned, settings)) == alone
    bounded = table[np.isfinite(table["horizontal_amplitude_m"])]
    ratio = bounded.loc[bounded["horizontal_amplitude_m"].idxmax(), "frequency_ratio"]
    assert f"{ratio:.2f} times" in draw_resonance_map(table, settings).get_label()
    still = table.assign(kind="rest", horizontal_amplitude_m=1e-260 * table["x"])
    assert draw_resonance_map(still, settings).get_label() == ""


def test_orbits_that_leave_all_design_ellipses_are_named():
    angle = np.linspace(0, 6.28, 50)
    near = 0.3 * np.column_stack([np.cos(angle), np.sin(2 * angle)])
    far = near * [20, 1]
    for orbits, winds, said in (
        ({8.0: near}, [8.0], "Every orbit stays within a design ellipse"),
        ({8.0: near, 12.0: far}, [8.0], "The orbit leaves all design ellipses at 12 m/s (line)"),
        ({8.0: near}, [8.0, 12.0], ""),
        ({}, [8.0], ""),
    ):
        figure = draw_orbits({"line": orbits}, {"cases": {"line": RESONANT}, "winds": winds})
        assert figure.get_label() == said
        without = figure.axes[0].get_title(loc="left").endswith("no limit cycle at these winds")
        assert without == (not orbits)


def test_clearance_and_measures():
    motion = settle(simulator(), line_family(RESONANT, "wind_speed").model(12.0), START)
    told = rows.clearance_rows("line", RESONANT, {12.0: motion}, (0.0, 8.0), 3.0)
    assert [row["orbit"] for row in told] == ["Davison", "Toye", "CIGRE 322", "cycle"]
    assert told[-1]["height_m"] == pytest.approx(2 * 1.305, abs=2e-3)
    assert told[-1]["is_clearance_sufficient"]
    growing = motion.states * np.linspace(1.0, 2.0, len(motion.states))[:, np.newaxis]
    irregular = replace(motion, kind="irregular", states=growing)
    *_, last = rows.clearance_rows("line", RESONANT, {12.0: irregular}, (0.0, 8.0), 3.0)
    assert last["height_m"] == pytest.approx(2 * told[-1]["height_m"], rel=0.01)  # its last swings
    design, parts = Design(12.0, START, (0.0, 8.0), 3.0), derive_parts(RESONANT)
    tried, no_draws = [ice_removal(), pendulum(20.0, (100.0,))], np.zeros((0, len(parts.values)))
    found = rank_measures(parts, RESONANT, tried, design, simulator(), no_draws)
    table = pd.DataFrame(found).assign(case="line")
    assert table["measure"][0] == "ice removed" and "torsion" in " ".join(table["note"])
    figure = draw_measures(table, {"cases": ["line"]})
    assert figure.get_label() == ""  # no measure beside removal of the ice that helps
    written = [text.get_text() for text in figure.axes[0].texts]
    assert written == [f"{value:.3g}" for value in table["vertical_amplitude_m"]]
    as_it_is = table.set_index("measure").loc[NO_MEASURE.label, "vertical_amplitude_m"]
    better = table[:1].assign(measure="a damper", vertical_amplitude_m=as_it_is / 2)
    said = draw_measures(pd.concat([table, better]), {"cases": ["line"]}).get_label()
    assert f"a damper, reduces the vertical amplitude from {as_it_is:.2g}" in said
    calm = table[:1].assign(measure="a long damper", vertical_amplitude_m=0.0)
    said = draw_measures(pd.concat([table, better, calm]), {"cases": ["line"]}).get_label()
    assert f"a long damper, reduces the vertical amplitude from {as_it_is:.2g} to 0 m" in said
    still = table.assign(vertical_amplitude_m=0.0, vertical_amplitude_m_high=0.0)
    figure = draw_measures(still, {"cases": ["line"]})
    figure.draw_without_rendering()
    labels = figure.axes[0].get_xticklabels()
    assert max(len(label.get_text()) for label in labels) <= 4  # they do not overlap
    unsure = table.assign(critical_wind_m_s_high=np.inf, required_clearance_m=50.0)
    figure = draw_measures(unsure, {"cases": ["line"]})
    assert "or never" in figure.axes[1].texts[-1].get_text() and drawn(lambda: figure)
    assert figure.axes[2].get_xlim()[1] > 50.0  # the clearance to keep is on the axis
    many = [f"line {k}" for k in range(20)]
    tall = draw_measures(pd.concat([table.assign(case=name) for name in many]), {"cases": many})
    assert len(tall.axes) == 3 * len(many) and tall.get_figheight() <= MAX_FIGURE_HEIGHT


def test_prediction():
    true = rows.simulate_true_amplitudes(RESONANT, [8.0, 12.0], simulator())
    near = np.column_stack([true, true])
    wide = Prediction(np.array([8.0, 12.0]), near, 0.9 * near, 1.1 * near, np.zeros(2))
    cell = {"case": "line", "protocol": "state", "method": "maximum_likelihood", "replicate": 0}
    told = rows.prediction_rows(cell, wide, true, "not identifiable")
    assert len(told) == 4 and all(row["interval_contains_truth"] for row in told)
    nothing = np.full((2, 4), np.nan)
    lost = Prediction(wide.winds, nothing, nothing, nothing, np.ones(2), "it does not settle")
    told += rows.prediction_rows({**cell, "method": "stlsq"}, lost, true, "unjudged")
    assert not any(row["interval_contains_truth"] for row in told[4:])
    settings = {"case": "line", "protocol": "state", "method": "maximum_likelihood",
                "replicate": 0, "recorded": 12.0, "peer": "stlsq"}  # fmt: skip
    figure = draw_prediction(pd.DataFrame(told), settings)
    assert (
        "8 to 12 m/s are predicted; the largest error of all recordings is 0 %"
        in figure.get_label()
    )
    figure.draw_without_rendering()
    assert figure.legends[0].get_window_extent().width <= figure.bbox.width
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    ours = lines["maximum likelihood (not identifiable)"]  # the status, beside the name alone
    np.testing.assert_allclose(ours.get_ydata(), true[:, 0])
    (lost_at,) = (line for label, line in lines.items() if label.startswith("no stable limit"))
    assert list(lost_at.get_xdata()) == [8.0, 12.0]
    assert not any(text.get_text() for axes in figure.axes for text in axes.texts)
    table = pd.DataFrame(told)
    table.loc[table["method"] == "stlsq", "status"] = "refused"
    table.loc[0, "predicted_m"] = np.nan
    figure = draw_prediction(table, settings)
    assert "the largest error of 3 of 4 predictions of all recordings is" in figure.get_label()
    labels = [line.get_label() for line in figure.axes[1].lines]
    assert "no model" in labels and "no stable limit cycle" not in labels


def test_the_animation_moves_as_far_as_the_span_and_is_the_same_twice(tmp_path):
    time = np.arange(0, 4.8, 0.01)
    swing = np.column_stack([np.sin(2.6 * time), 0.5 * np.cos(1.3 * time)])
    states = np.hstack([swing, np.zeros_like(swing)])
    files = [tmp_path / name for name in ("one.gif", "two.gif")]
    for path in files:
        write_animation(path, RESONANT, time, states, "line")
    assert files[0].read_bytes() == files[1].read_bytes()
    with Image.open(files[0]) as image:
        assert image.n_frames == 48  # ten a second, in real time
        frames = []
        for frame in range(image.n_frames):
            image.seek(frame)
            frames.append(np.asarray(image.convert("L"), float))
    # the place of mid-span in the panel at the right moves over twice the vertical amplitude
    changed = np.ptp(frames, axis=0)[:, int(0.75 * frames[0].shape[1]) :] > 60
    rows = np.flatnonzero(changed.any(axis=1))
    assert np.ptp(rows) > 0.4 * frames[0].shape[0]
    assert files[0].stat().st_size < 1_000_000
    assert sorted(tmp_path.iterdir()) == files


@pytest.mark.parametrize("rate", [25, 15, 4])
def test_an_animation_lasts_as_long_as_the_motion(tmp_path, rate):
    time = np.arange(0, 4.0, 1.0 / rate)
    states = np.column_stack([np.sin(time), np.cos(time), *np.zeros((2, len(time)))])
    write_animation(tmp_path / "one.gif", RESONANT, time, states, "line")
    with Image.open(tmp_path / "one.gif") as image:
        lasted = 0
        for frame in range(image.n_frames):
            image.seek(frame)
            lasted += image.info["duration"]
    step = max(1, round(rate / 10))
    assert lasted == pytest.approx(1000 * step * len(range(0, len(time), step)) / rate, abs=5)


def test_a_study_without_sweeps_or_models_says_so():
    nothing = pd.DataFrame(columns=["case"])
    assert drawn(lambda: draw_limit_cycles(nothing, nothing, {}))
    for draw in (draw_resonance_map, draw_prediction):
        assert drawn(lambda draw=draw: draw(nothing, {}))


# major axis, minor axis, lowest point below rest, all in feet
WORKED = [
    (davison(7.9 * FOOT), (10.9, 4.3, 2.0)),
    (toye(1000 * FOOT, 24.99 * FOOT), (9.8, 5.9, 2.0)),
    (cigre(5.72 * FOOT, 0.0281432, bundle=False), (16.9, 6.8, 5.1)),
    (cigre(20.65 * FOOT, 0.0281432, bundle=True), (20, 8, 6)),
]


@pytest.mark.parametrize(("ellipse", "feet"), WORKED)
def test_worked_values(ellipse, feet):
    axes = np.array([ellipse.major, ellipse.minor, ellipse.below]) / FOOT
    assert axes == pytest.approx(feet, abs=0.0501)  # one decimal is given


def test_outline_and_envelope():
    ellipse = measures.Ellipse(major=4.0, minor=1.0, below=1.5)
    assert measures.envelope(ellipse.outline()) == pytest.approx((4.0, 1.0, 1.5))
    short = edited(line__span=150, spacers__positions=[75])  # its sag is too small for the last
    assert measures.design_ellipses(short).keys() == {"Davison", "Toye"}
    with pytest.raises(ValueError, match="sag: 1 m"):
        cigre(1.0, 0.0276, bundle=True)


def test_clearance_of_two_circles():
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    assert clearance(circle, circle, (3.0, 4.0)) == pytest.approx(3.0, abs=1e-3)
    assert clearance(circle, 2 * circle, (0.0, 6.0)) == pytest.approx(3.0, abs=1e-3)
    assert clearance(circle, circle, (1.5, 0.0)) == 0
