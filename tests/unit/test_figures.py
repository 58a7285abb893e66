"""Figures: the same bytes for the same data, one look per method, and nothing that stops them."""

from dataclasses import replace
from itertools import combinations, cycle

import numpy as np
import pandas as pd
import pytest
from lines import RESONANT, edited
from pictures import drawn

from galloping.figures import errors
from galloping.figures.against_paper import draw_claims
from galloping.figures.each_term import draw_coefficients, draw_identifiability
from galloping.figures.motions import draw_histories, draw_recovery
from galloping.figures.schematics import draw_aerodynamic_load, draw_flow, draw_line
from galloping.figures.style import METHODS, method_style, write_figure
from galloping.figures.verdicts import draw_reduction, draw_trust
from galloping.identification.model import IdentifiedModel
from galloping.measurement import BY_NAME as PROTOCOLS
from galloping.measurement import Motion
from galloping.paper.claims import CLAIMS
from galloping.physics.galerkin import derive
from galloping.polynomial import library
from galloping.results import Reconstruction

LINE = derive(RESONANT)
NAMES = {"cases": ["line"], "protocols": ["state"], "methods": ["weak", "new_method"]}
CELL = {"case": "line", "protocol": "state", "method": "weak"}


NOISE = {**NAMES, "kind": "noise", "x": "level", "labels": dict.fromkeys(PROTOCOLS, "noise"),
         "quantities": ["coefficients"]}  # fmt: skip
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
    first = written(tmp_path, lambda: errors.draw_methods(scores(), NOISE))
    assert written(tmp_path, lambda: errors.draw_methods(scores(), NOISE)) == first
    assert b"<dc:date>" not in first[0]
    assert b"Software" not in first[1]


def test_a_method_looks_the_same_everywhere_and_unlike_the_others():
    names = [*METHODS, "new_method"]
    looks = [method_style(name) for name in names]
    assert looks == [method_style(name) for name in names]
    for one, other in combinations(looks, 2):
        assert one.color != other.color and one.marker != other.marker


def test_every_draw_is_shown_with_the_median_and_what_the_paper_prints():
    case = "internal_resonance"
    table = scores((0.01, 0.05), case=case, worst=90.0).assign(mean_error_linear_percent=[
        7.0, 1.0, 2.0, 3.0, 8.0, 2.0, 4.0, 6.0
    ])  # fmt: skip
    more = table[4:5].rename(columns={"replicate": "draw"})
    more = pd.concat([more.assign(draw=k, mean_error_linear_percent=k + 1.0) for k in range(9)])
    (of_paper,) = errors.printed("mean_error_linear_percent", case)
    for further, every in (((), table["mean_error_linear_percent"]), ((more,), range(1, 10))):
        figure = errors.draw_draws(table, {**NOISE, **CELL, "case": case}, *further)
        drawn_lines = {line.get_label(): list(line.get_ydata()) for line in figure.axes[0].lines}
        (shown_draws,) = (y for label, y in drawn_lines.items() if label.startswith("each of"))
        assert set(every) <= set(shown_draws)
        assert drawn_lines["typical draw: the median"] == [2.5, 5.0]
        assert drawn_lines["paper: printed"] == [of_paper.printed]


def test_the_share_of_draws_above_a_bound_is_written_beside_it():
    case = "internal_resonance"
    table = scores((0, 0.05), case=case).assign(r2_q_v=[1.0, 0.995, 0.98, 0.97, 0.999])
    figure = errors.draw_draws(table, {**NOISE, **CELL, "case": case, "quantities": ["r2"]})
    assert [text.get_text() for text in figure.axes[0].texts] == ["50 % above"]
    assert figure.axes[0].get_xticklabels()[0].get_text() == "0"


def test_false_terms_of_every_draw_are_the_first_panel_of_the_coefficients():
    table = scores((0, 0.05)).assign(spurious=[0, 3, 5, 7, 40])
    settings = COEFFICIENTS | {"levels": {"a": 0.05}}
    figure = draw_coefficients(LINE, {"a": {"weak": line_models()}}, settings, table)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts == ["0", "6"]
    drawn_points = np.concatenate([line.get_ydata() for line in figure.axes[0].lines])
    assert {3, 5, 7, 40} <= set(drawn_points)


def test_efficiency_with_failures_and_joint_recordings():
    settings = {"cases": ["line", "other"], "protocols": ["state", "displacement"],
                "methods": ["weak", "maximum_likelihood", "absent", "bound"],
                "labels": NOISE["labels"]}  # fmt: skip
    whole = pd.DataFrame(
        {"case": "line", "recordings": recordings, "protocol": "state", "level": level,
         "points": 30001, "method": method, "efficiency": value, "no_model": lost, "replicates": 20}
        for recordings, level, value, lost in (
            (1, 0.01, 1.0, 0), (1, 0.05, 1.2, 1), (2, 0.05, np.nan, 0)
        )
        for method in ("weak", "maximum_likelihood", "bound")
    )  # fmt: skip
    figure = errors.draw_efficiency(whole, settings)
    written = [text.get_text() for text in figure.axes[0].texts]
    assert written == ["1 of 20"] * 2  # of the methods that lost a draw, not of the bound
    ticks = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert ticks == ["0.01", "0.05", "0.05\n2 rec."]
    for these in ("recordings == 1", "method == 'bound'", "method == 'none'", "recordings == 2"):
        drawn(lambda these=these: errors.draw_efficiency(whole.query(these), settings))


def identifiable(t, recordings=(1, 2)):
    return pd.DataFrame(
        {"case": "line", "recordings": count, "protocol": "state", "level": level,
         "points": 30001, "equation": equation, "term": term, "t": t * count}
        for count in recordings
        for level in (0.01, 0.1)
        for equation, term in (("vertical", "q_v q_w^2"), ("horizontal", "dq_w"))
    )  # fmt: skip


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
    line = LINE.model.on_library(library(4, 3))
    off = line.coefficients.copy()
    off[2, 0], off[3, 4] = 9.0, 0.0
    return [IdentifiedModel(each, "unjudged") for each in (line, replace(line, coefficients=off))]


def claims():
    """Of every claim of the paper one row, with failures and cells that were not run."""
    verdicts = {"better": 0.1, "seldom met": 1.0, "not run": np.nan, "not met": np.inf}
    return pd.DataFrame(
        {"claim": claim.name, "case": "line", "quantity": claim.quantity,
         "paper_value": claim.printed, "study_value": value, "low": value, "high": value,
         "met_by": 0.5 if replicates else np.nan, "replicates": replicates, "protocol": "state",
         "method": "weak", "verdict": verdict}
        for claim, (verdict, value) in zip(CLAIMS, cycle(verdicts.items()))
        for replicates in [0 if verdict == "not run" else 2]
    )  # fmt: skip


def shown(bad):
    """A motion identified by two methods, which may have ended early."""
    motion = Reconstruction(T, STATES + bad, STATES + bad - 1, STATES + bad + 1)
    return dict.fromkeys(("weak", "maximum_likelihood"), motion)


PAIR = edited(bundle__subconductors=2)
NO_PEERS = pd.DataFrame(
    columns=["case", "protocol", "level", "method", "setting", "mean_error_percent"]
)
HISTORIES = {**CELL, "window": (50, 100)}
COEFFICIENTS = {**CELL, "kind": "noise", "unit": "m", "degree": 3}
FLOW = {"degree": 3, "protocols": ["state"], "methods": ["weak"], "levels": [0], "points": [1000],
        "replicates": 1}  # fmt: skip
FOUR = ["paper", "weak", "maximum_likelihood", "bound"]
DRAWN = [  # of any number, size and kind, with what each is drawn of
    *((draw, scores(levels, points, error), {**extent, **CELL, "quantities": [quantity]})
      for quantity, levels, points, error in (
          ("coefficients", (0,), (), 5.0), ("coefficients", (0.05,), (), 0.0),
          ("coefficients", (0, 0.01), (), np.inf), ("r2", (0, 0.01), (1000,), np.inf),
          ("amplitude", (0, 0.01, 0.05), (1000, 5000), 5.0))
      for extent in (NOISE, AMOUNT) for draw in (errors.draw_methods, errors.draw_draws)),
    *((draw_identifiability, table,
       {"cases": ["line", "other"], "protocols": ["state", "derivative"], "level": 0.05})
      for table in (identifiable(0.0), identifiable(1e5, [1]), identifiable(1)[:0])),
    *((errors.draw_overview, scores(levels, error=error, methods=methods).fillna(0.0),
       {"case": "line", "protocol": "state", "label": "noise"}, NO_PEERS)
      for methods, error, levels in (
          (FOUR, 5.0, (0, 0.01, 0.05)), (FOUR, np.inf, (0, 0.01)), (["weak", "paper"], 5.0, (0,)),
          (["bound"], np.inf, (0, 0.01)), (["new_method"], 5.0, (0, 0.01)))),
    *((draw_histories, [SWING], {"a": shown(bad)}, HISTORIES | {"cells": {"a": "noise level 0.1"}})
      for bad in (0.0, np.nan)),
    *((draw_recovery, {"line": [SWING]}, {"line": shown(bad)}, {**NAMES, **CELL, "level": 0})
      for bad in (0.0, np.nan)),
    (draw_coefficients, LINE, {"a": {"weak": line_models()}}, COEFFICIENTS | {"levels": {"a": 0}},
     scores((0, 0.01)).assign(spurious=3)),
    (draw_claims, claims(), {"combinations": [["state", "weak"]]}),
    # nothing to show
    (draw_histories, [SWING], {}, HISTORIES | {"cells": {}}),
    (draw_coefficients, LINE, {}, COEFFICIENTS | {"levels": {}}, scores()),
    (draw_claims, claims()[:0], {"combinations": []}),
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
    fits = pd.DataFrame(rows, columns=["status", "exact", "ok_and_wrong", "cause_named"])
    figure = draw_trust(fits.assign(group="lines"))
    written = [text.get_text() for text in figure.axes[0].texts]
    assert written == ["1 of 2", "1 of 2", "0 of 1", "1 of 1"]


def test_no_point_of_the_reduction_is_cut_off():
    stretches = dict.fromkeys(("r2_0_100_s", "r2_100_200_s", "r2_200_300_s"), 0.5)
    table = pd.DataFrame(
        {"line": line, "direction": direction, "amplitude_m": amplitude, "limit_cycle_m": 1.0,
         "amplitude_error_percent": error, "limit_cycle_error_percent": error, **stretches}
        for direction in ("vertical", "horizontal")
        for line, amplitude, error in (("two modes", 1.0, 0.0), ("9 modes", 3.0, np.nan))
    )  # fmt: skip
    axes = draw_reduction(table).axes[0]
    assert axes.get_ylim()[0] == 0 and axes.get_ylim()[1] > 3.2
    assert "another motion" in axes.get_legend_handles_labels()[1]
