"""Figures: the same bytes for the same data, one look per method, and nothing that stops them."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from lines import RESONANT, edited
from pictures import drawn

from galloping.figures import errors
from galloping.figures.each_term import draw_coefficients
from galloping.figures.motions import draw_histories, draw_recovery
from galloping.figures.schematics import draw_aerodynamic_load, draw_flow, draw_line
from galloping.figures.style import METHOD_STYLES, method_style, write_figure
from galloping.figures.verdicts import ERROR_LABELS, draw_model_error, draw_trust
from galloping.identification.identified_model import IdentifiedModel
from galloping.line.galerkin import derive
from galloping.model.intervals import median_and_interval
from galloping.model.polynomial import PolynomialModel, polynomial_library
from galloping.recording.measurement import PROTOCOLS_BY_NAME, Motion
from galloping.results import Reconstruction

LINE = derive(RESONANT)
NAMES = {"cases": ["line"], "protocols": ["state"], "methods": ["weak", "new_method"]}
CELL = {"case": "line", "protocol": "state", "method": "weak"}


NOISE = {**NAMES, "kind": "noise", "x": "level", "quantities": ["coefficients"],
         "labels": dict.fromkeys(PROTOCOLS_BY_NAME, "noise")}  # fmt: skip
AMOUNT = {**NOISE, "kind": "points", "x": "points"}
COLUMNS = [column for quantity in errors.QUANTITIES.values() for column in quantity.columns]


def written(tmp_path, draw):
    """Bytes of the SVG and the PNG."""
    svg, png = tmp_path / "figure.svg", tmp_path / "figure.png"
    write_figure(svg, png, draw, dpi=60, font_size=8)
    assert sorted(tmp_path.iterdir()) == [png, svg]
    return svg.read_bytes(), png.read_bytes()


def scores(levels=(0, 0.05), points=(), error=5.0, worst=np.inf, case="line", methods=("weak",)):
    """scores.csv of four draws a cell, of which one is the worst; R2 is 1 - error / 10."""
    cells = [("noise", level, 30001) for level in levels]
    cells += [("points", 0.05, number) for number in points]
    table = pd.DataFrame(
        {"case": case, "protocol": "state", "kind": kind, "level": level, "points": number,
         "method": method, "replicate": k,
         "error": worst if k == 3 and level else error * level + 1e-13}
        for kind, level, number in cells
        for method in methods
        for k in range(4 if level else 1)
    )  # fmt: skip
    columns = {
        name: 1 - table["error"] / 10 if name.startswith("r2") else table["error"]
        for name in COLUMNS
    }
    return table.assign(**columns)


T = np.linspace(0, 100, 2001)
STATES = np.column_stack([np.sin(T), np.cos(T), np.cos(T), -np.sin(T)])
SWING = Motion(("q_v", "q_w", "dq_v", "dq_w"), T, STATES, np.gradient(STATES, T, axis=0))


def test_same_data_same_bytes_without_a_date(tmp_path):
    settings = {**NOISE, **CELL}
    first = written(tmp_path, lambda: errors.draw_draws(scores(), settings))
    assert written(tmp_path, lambda: errors.draw_draws(scores(), settings)) == first
    assert b"<dc:date>" not in first[0]
    assert b"Software" not in first[1]
    title = errors.draw_draws(scores(), settings).get_label().encode()
    assert title and all(title in file for file in first)  # the report and the reader of a PNG


def test_a_method_looks_the_same_everywhere_and_unlike_the_others():
    names = [*METHOD_STYLES, "new_method"]
    looks = [method_style(name) for name in names]
    assert looks == [method_style(name) for name in names]
    for one, other in combinations(looks, 2):
        assert one.color != other.color and one.marker != other.marker


def lines_of(axes):
    """What is drawn, by label: x and y of each line."""
    return {line.get_label(): np.array(line.get_data()) for line in axes.lines}


def test_the_median_is_shown_with_its_range_and_what_the_paper_prints():
    case = "internal_resonance"
    table = scores((0.01, 0.05), case=case, worst=90.0).assign(mean_error_linear_percent=[
        7.0, 1.0, 2.0, 3.0, 8.0, 2.0, 4.0, 6.0
    ])  # fmt: skip
    more = table[4:5]
    more = pd.concat(
        [more.assign(replicate=k, mean_error_linear_percent=k + 1.0) for k in range(9)]
    )
    (of_paper,) = errors.printed("mean_error_linear_percent", case)
    for further, values in (((), [8.0, 2.0, 4.0, 6.0]), ((more,), np.arange(1.0, 10.0))):
        figure = errors.draw_draws(table, {**NOISE, **CELL, "case": case}, *further)
        (axes,) = figure.axes
        medians = [y for line in axes.lines if len(y := line.get_ydata()) == 2]
        assert list(medians[0]) == [2.5, 5.0]  # of the linear terms, the first
        low, high = axes.collections[0].get_segments()[-1][:, 1]
        assert (low, high) == pytest.approx(median_and_interval(values)[1:])
        stars = [line.get_ydata()[0] for line in axes.lines if line.get_marker() == "*"]
        assert (of_paper.printed in stars) if further else not stars  # of the paper's study alone
        assert "2.5 % at noise 0.01, 5 % at noise 0.05" in figure.get_label()


def test_a_motion_without_a_model_is_beyond_the_axis():
    table = scores((0, 0.05), case="internal_resonance")
    table = table.assign(r2_q_v=[1.0, -np.inf, -np.inf, -np.inf, 0.999])
    figure = errors.draw_draws(table, {**NOISE, **CELL, "case": "internal_resonance",
                                       "quantities": ["r2"]})  # fmt: skip
    (axes,) = figure.axes
    triangles = [line.get_ydata()[0] for line in axes.lines if line.get_marker() == "v"]
    assert triangles == [0.0] and "no model at noise 0.05" in figure.get_label()
    assert all(label.get_text() != "0" for label in axes.get_xticklabels())  # noisy levels alone


def test_false_terms_are_counted_and_coefficients_are_over_the_true_ones():
    table = scores((0, 0.05)).assign(spurious=[0, 3, 5, 7, 40])
    settings = COEFFICIENTS | {"levels": {"a": 0.05}}
    figure = draw_coefficients(LINE, {"a": {"weak": line_models()}}, settings, table)
    above, below = figure.axes
    assert next(iter(lines_of(above).values()))[1] == [6]
    ratios = np.concatenate([line.get_ydata() for line in below.lines if line.get_marker() == "o"])
    assert np.isin([0.5, 1.0], ratios.round(9)).all()  # found in one of two fits, and in both
    assert figure.get_label().endswith("6 at noise 0.05")


@pytest.mark.parametrize(
    ("settings", "known", "possible"),
    [
        ({}, (), 4 * 35 - 16), ({"kinematics": "known"}, (), 2 * 35 - 14),
        ({}, (0, 1), 2 * 35 - 14), ({"kinematics": "known", "degree": 2}, (), 2 * 15 - 9),
    ],
)  # fmt: skip
def test_possible_terms_are_those_of_the_identified_equations_and_the_library(
    settings, known, possible
):
    settings = COEFFICIENTS | {"levels": {"a": 0.05}} | settings
    line = LINE.model.on_polynomials(settings["degree"])
    count = len(polynomial_library(4, settings["degree"]))
    library = PolynomialModel(line.states, line.terms[:count], line.coefficients[:, :count])
    models = {"a": {"weak": [IdentifiedModel(library, known=known)]}}
    figure = draw_coefficients(LINE, models, settings, scores((0, 0.05)).assign(spurious=0))
    assert f"of {possible} possible" in figure.axes[0].get_title(loc="left")


def test_the_distance_of_a_reconstruction_is_drawn_and_said():
    off = Reconstruction(T, STATES + 2e-7 * T[:, np.newaxis] / 100, STATES, STATES)
    recovered = {"line": {"weak": off}}
    figure = draw_recovery({"line": [SWING]}, recovered, {**NAMES, **CELL, "level": 0})
    *_, last = figure.axes
    (time, distance), *_ = lines_of(last).values()
    assert distance[-1] == pytest.approx(2e-7) and distance[time.searchsorted(50)] < 1.1e-7
    assert "Without noise" in figure.get_label() and "2e-07 m" in figure.get_label()
    diverged = replace(SWING, status="diverged at t = 1 s")
    of_two = {"line": [SWING], "gale": [diverged]}
    both = {**NAMES, **CELL, "level": 0, "cases": ["line", "gale"]}
    assert "2e-07 m" in draw_recovery(of_two, recovered, both).get_label()
    (axes,) = draw_recovery({"line": [diverged]}, recovered, both).axes
    assert "the line itself diverged" in axes.texts[0].get_text()


def test_the_band_of_histories_is_said_and_a_diverged_motion_is_named():
    cells = HISTORIES | {"cells": {"a": "noise 0.1"}}
    figure = draw_histories([SWING], {"a": shown(0.0)}, cells)
    assert "100 % with noise 0.1" in figure.get_label()  # 2 m wide, as the motion
    assert figure.axes[0].get_xlim() == (90.0, 100.0)
    lost = draw_histories([SWING], {"a": shown(np.nan)}, cells)
    steady = Reconstruction(T, STATES, STATES, STATES)  # of a single realisation
    assert draw_histories([SWING], {"a": {"weak": steady}}, cells).get_label() == ""
    assert lost.get_label() == "" and "diverge or fail" in lost.axes[0].get_title(loc="left")


def test_the_best_of_pysindy_has_the_lowest_median_over_the_levels():
    medians = {"weak": [1.0, 4.0, np.inf], "stlsq": [3.0, 5.0, 6.0], "maximum_likelihood": [0.1]}
    table = pd.DataFrame(
        [(method, value) for method, values in medians.items() for value in values],
        columns=["method", "median"],
    )
    assert errors.best_of_pysindy(table) == "weak"
    assert errors.best_of_pysindy(table[table["method"] == "maximum_likelihood"]) is None


def line_models():
    """The line, and a model of it with a spurious and a missing term."""
    line = LINE.model.on_library(polynomial_library(4, 3))
    off = line.coefficients.copy()
    off[2, 0], off[3, 4] = 9.0, 0.0
    return [IdentifiedModel(each) for each in (line, replace(line, coefficients=off))]


def shown(bad):
    """A motion identified by two methods, which may have ended early."""
    motion = Reconstruction(T, STATES + bad, STATES + bad - 1, STATES + bad + 1)
    return dict.fromkeys(("weak", "maximum_likelihood"), motion)


PAIR = edited(bundle__subconductors=2)
NO_PEERS = pd.DataFrame(
    columns=["case", "protocol", "level", "method", "setting", "mean_error_percent"]
)
OVERVIEW = {"case": "line", "protocol": "state", "label": "noise"}
HISTORIES = CELL
COEFFICIENTS = {**CELL, "kind": "noise", "label": "noise", "degree": 3,
                "kinematics": None}  # fmt: skip
FLOW = {"degree": 3, "methods": ["weak"], "levels": [0], "points": [1000]}
FOUR = ["paper", "weak", "maximum_likelihood", "bound"]
DRAWN = [  # of any number, size and kind, with what each is drawn of
    *((draw, scores(levels, points, error), {**extent, **CELL, "quantities": [quantity]})
      for quantity, levels, points, error in (
          ("coefficients", (0,), (), 5.0), ("coefficients", (0.05,), (), 0.0),
          ("coefficients", (0, 0.01), (), np.inf), ("r2", (0, 0.01), (1000,), np.inf),
          ("amplitude", (0, 0.01, 0.05), (1000, 5000), 5.0))
      for extent in (NOISE, AMOUNT) for draw in (errors.draw_draws,)),
    *((errors.draw_overview, scores(levels, error=error, methods=methods).fillna(0.0),
       OVERVIEW, NO_PEERS)
      for methods, error, levels in (
          (FOUR, 5.0, (0, 0.01, 0.05)), (FOUR, np.inf, (0, 0.01)), (["weak", "paper"], 5.0, (0,)),
          (["bound"], np.inf, (0, 0.01)), (["new_method"], 5.0, (0, 0.01)))),
    *((draw_histories, [SWING], {"a": shown(bad)}, HISTORIES | {"cells": {"a": "noise level 0.1"}})
      for bad in (0.0, np.nan)),
    *((draw_recovery, {"line": [SWING]}, {"line": shown(bad)}, {**NAMES, **CELL, "level": 0})
      for bad in (0.0, np.nan)),
    (draw_coefficients, LINE, {"a": {"weak": line_models()}}, COEFFICIENTS | {"levels": {"a": 0}},
     scores((0, 0.01)).assign(spurious=3)),
    # nothing to show
    (draw_histories, [SWING], {}, HISTORIES | {"cells": {}}),
    (draw_coefficients, LINE, {}, COEFFICIENTS | {"levels": {}}, scores()),
    # the configured line
    (draw_line, derive(PAIR), {"case": "pair", "line": PAIR}),
    (draw_aerodynamic_load, [SWING], {"line": PAIR}),
    (draw_flow, FLOW),
]  # fmt: skip


@pytest.mark.parametrize(("draw", "of"), [(draw, of) for draw, *of in DRAWN])
def test_nothing_stops_a_figure(draw, of):
    assert drawn(lambda: draw(*of))


def test_a_status_is_right_where_its_claim_holds_or_its_doubt_is_due():
    rows = [
        ("ok", True, False, np.nan), ("ok", False, True, np.nan),
        ("not identifiable", False, False, np.nan), ("not identifiable", True, False, np.nan),
        ("refused", False, False, 0.0), ("approximate", True, False, np.nan),
    ]  # fmt: skip
    fits = pd.DataFrame(
        rows, columns=["status", "exact_support", "ok_and_wrong", "fault_diagnosed"]
    )
    figure = draw_trust(fits.assign(group="lines"))
    written = [text.get_text() for text in figure.axes[0].texts]
    assert written == ["1 of 2", "1 of 2", "0 of 1", "1 of 1"]
    assert figure.get_label().startswith("1 of 2 models")


@pytest.mark.parametrize("methods", [["maximum_likelihood", "weak"], ["maximum_likelihood"]])
def test_an_overview_leaves_out_fits_without_true_coefficients(methods):
    table = scores((0, 0.05), methods=methods)
    table.loc[table["method"] == "maximum_likelihood", COLUMNS] = np.nan
    figure = errors.draw_overview(table, OVERVIEW, NO_PEERS)
    written = [text.get_text() for text in figure.axes[0].texts]
    reason = "no noisy recordings of this line have coefficient errors"
    assert written == (["1 of 4: no model"] if "weak" in methods else [reason])
    assert "maximum" not in figure.get_label()


def test_a_bound_above_the_limit_of_the_axis_is_cut_off():
    table = scores((0.001, 0.01, 0.1), methods=("bound",)).assign(**dict.fromkeys(COLUMNS, 1e5))
    table.loc[table["level"] == 0.001, COLUMNS] = 10.0
    (axes,) = errors.draw_overview(table, OVERVIEW, NO_PEERS).axes
    (bound,) = (line for line in axes.lines if len(line.get_xdata()) == 3)
    assert list(bound.get_ydata()) == [10.0, 1e5, 1e5] and axes.get_ylim()[1] == 1e3


def test_an_overview_says_who_errs_least():
    table = scores((0, 0.05), error=5.0, methods=("maximum_likelihood", "weak"))
    better = table["method"] == "maximum_likelihood"
    table.loc[better, COLUMNS] /= 10
    said = errors.draw_overview(table, OVERVIEW, NO_PEERS).get_label()
    assert said.index("maximum likelihood") < said.index("weak form")
    alone = scores((0, 0.05), methods=("weak_gls",))  # which the overview does not draw
    assert errors.draw_overview(alone, OVERVIEW, NO_PEERS).get_label() == ""


def test_errors_of_lines_have_a_row_for_each_truth_and_sensors_in_the_configured_order():
    rows = [("gusts 10 %", "all"), ("decay", "near"), ("decay", "far"), ("gusts 5 %", "all")]
    names = [f"{name}_{kind}_percent" for name in ERROR_LABELS for kind in ("error", "worst")]
    table = pd.DataFrame(rows, columns=["truth", "sensors"]).assign(
        method="weak", replicates=9, n_models=9, terms=2, **dict.fromkeys(names, 1.0)
    )
    figure = draw_model_error(table, {"truths": ["gusts 5 %", "gusts 10 %", "decay"]})
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == ["gusts 5 %", "gusts 10 %", "decay,\nfar", "decay,\nnear"]
    places = [text.get_position()[1] for text in figure.axes[-1].texts]
    assert len(set(places)) == len(rows)
