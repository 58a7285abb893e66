"""The report's page: complete, self-contained, deterministic; its sentences follow the tables."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from galloping.configuration.load import load, plain
from galloping.recording.measurement import DEVIATION_UNIT
from galloping.report.data_dictionary import meaning
from galloping.report.equations import as_symbols, side_by_side
from galloping.report.page import Item, as_html, render
from galloping.report.printed_numbers import PaperCell, merge_directions
from galloping.report.results_in_words import on_engineering, on_methods
from galloping.tables import judged_claims as claims


@pytest.fixture
def page(tmp_path):
    svg, csv = tmp_path / "f.svg", tmp_path / "paper.csv"
    svg.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="250pt"><title>5 &lt; 6</title></svg>'
    )
    csv.write_text("term,error_percent\nq_v < q_w,0.123456789\n=1+1,\n")
    figure = Item("figure03", "a figure", "It shows *this*.", svg)
    table = Item("paper", "a table", "It holds ``that``.", csv)
    cell = merge_directions([
        PaperCell("0.83", "2.1 (0.2 to 6)", "reproduced", "so it is", True),
        PaperCell("1", "9", "worse", "<", False),
    ])  # fmt: skip
    paper = {"setting": "Fitted & consistent.", "count": "1 of 2 holds.", "rows": {"errors": cell},
             "failures": ["errors: worse; <."], "by_settings": "Others do not."}  # fmt: skip
    recording = {"name": "span", "summary": "# <Summary>", "figures": [figure]}
    part = {"sentences": ["One & one."], "figures": [figure]}
    return {
        "title": "A study", "paper": paper, "equations": None, "made": "commit abc",
        "parts": {"paper": part, "methods": None, "engineering": None}, "study": plain(load({})),
        "introduction": "Words.", "tables": [table], "recordings": [recording],
        "versions": {"python": "3.11"},
    }  # fmt: skip


def test_the_page_shows_everything_and_escapes_it(page):
    html = render(page)
    for shown in (
        "One &amp; one.", "<em>this</em>", "span 300 m, tension 25 kN", "commit abc",
        "<td>q_v &lt; q_w</td><td>0.1235</td>", "<td>=1+1</td><td></td>", "✗ reproduced; worse",
        "<td>0.83; 1</td>", "<b>1 of 2 holds.</b>", "<li>errors: worse; &lt;.</li>",
        "<pre># &lt;Summary&gt;</pre>", "<h3>Figure 3. 5 &lt; 6</h3>", "width: 450px",
    ):  # fmt: skip
        assert shown in html, shown
    assert html == render(page)
    (figure,) = page["parts"]["paper"]["figures"]
    figure.path.write_text("<svg/>")  # without a title, the label is shown, its number once
    assert replace(figure, label="3 flow chart").title == "Figure 3. Flow chart"


@pytest.mark.parametrize(
    "lacking", [{}, {"paper": None}, {"tables": []}, {"recordings": []}, {"equations": None}]
)
def test_the_page_refers_to_nothing_outside_and_no_link_is_dead(page, lacking):
    if "equations" not in lacking:
        page["equations"] = side_by_side(EQUATIONS, {})
    html = render(page | lacking)
    links = re.findall(r'(?:src|href)="([^"]*)"', html)
    places = re.findall(r'\bid="([^"]*)"', html)
    assert len(set(places)) == len(places)
    inside = [link for link in links if link.startswith("#")]
    assert inside and {link.removeprefix("#") for link in inside} <= set(places)
    assert all(link.startswith(("#", "data:")) for link in links)


FIT = {"case": "line", "protocol": "state", "equation": "vertical"}
EQUATIONS = pd.DataFrame(
    {**FIT, "method": method, "level": 0.05, "symbol": term, "term": term, "true": true,
     "identified": found, "standard_error": error}
    for method, rows in {
        "paper": (("q_v", -2.0, -1.9, np.nan), ("dq_v^2 q_w", 0.5, np.nan, np.nan),
                  ("q_w", 0.0, 3.0, np.nan)),
        "ours": (("q_v", -2.0, -2.001, 0.0123), ("dq_v^2 q_w", 0.5, 0.5, 0.1)),
    }.items()
    for term, true, found, error in rows
)  # fmt: skip


def test_equations_stand_side_by_side_with_their_errors_and_false_terms():
    of = side_by_side(EQUATIONS, {"paper": "the paper's method"})["vertical"]
    assert of["heads"] == ["the paper's method, noise 0.05", "ours, noise 0.05"]
    assert [cells[1:] for cells in of["rows"]] == [
        ["−2", "−1.9", "−2.00 ± 0.01"], ["0.5", "not found", "0.5 ± 0.1"]
    ]  # fmt: skip
    assert of["false_terms"] == [1, 0]
    unknown = side_by_side(EQUATIONS.replace({0.0123: np.inf}), {})["vertical"]["rows"]
    assert unknown[0][3] == "−2.001 ± ∞"
    alike = EQUATIONS.assign(protocol=EQUATIONS["method"], method="ours")
    heads = side_by_side(alike, {})["vertical"]["heads"]
    assert heads == ["ours, noise 0.05, paper", "ours, noise 0.05, ours"]
    assert as_symbols("dq_v^2 q_w").count("<sup>2</sup>") == 1
    assert side_by_side(EQUATIONS.assign(true=np.nan), {}) is None  # a continuous line


def test_a_broken_caption_is_an_error():
    with pytest.raises(Exception, match="Unknown target"):
        as_html("see nowhere_")


def test_the_headline_is_read_from_the_tables():
    cell = {"case": "line", "protocol": "state", "level": 0.05}
    efficiency = pd.DataFrame(
        [{**cell, "level": level, "points": points, "method": "maximum_likelihood",
          "replicates": 20, "exact_support": exact, "efficiency": 0.98, "recordings": number}
         for number, level, points, exact in
         ((1, 0.05, 30001, 20.0), (1, 0.05, 5000, 19), (1, 0.05, 2000, 12), (1, 0.05, 1000, 20),
          (1, 0.1, 30001, 12), (1, 0.15, 30001, 20), (2, 0.3, 30001, 20))]
    )  # fmt: skip
    peers = pd.DataFrame(
        [{**cell, "setting": setting, "method": method, "mean_error_percent": error}
         for setting, method, error in
         (("as chosen", "maximum_likelihood", 0.5), ("as chosen", "stlsq", 17.0),
          ("as chosen", "weak", 30.0), ("oracle", "weak", 1.0))]
    )  # fmt: skip
    about = {"case": "line", "protocol": "state", "noise_unit": DEVIATION_UNIT}
    place = {"case": "line", "parameter": "wind_speed"}
    cycles = pd.DataFrame(
        [{**place, "value": value, "stable": stable, "vertical_amplitude_m": value / 10,
          "horizontal_amplitude_m": 1.0}
         for value, stable in ((6.0, True), (16.0, True), (18.0, False))]
    )  # fmt: skip
    changes = pd.DataFrame([{**place, "name": "Hopf", "value": 5.253}])
    tables = {"efficiency": efficiency, "peers": peers, "limit_cycles": cycles,
              "bifurcations": changes}  # fmt: skip
    said = on_methods(tables, **about)
    assert "20 of 20" in said[0] and "0.5 %, against 17 % by stlsq" in said[0]
    assert "up to 5 % noise and down to 5,000 samples" in said[1]
    named = on_methods(tables, **about, labels={"stlsq": "STLSQ"})
    assert "by STLSQ; its error is 0.98 times" in named[0]
    unbounded = tables | {"efficiency": efficiency.assign(efficiency=np.nan)}
    assert on_methods(unbounded, **about)[0].endswith("against 17 % by stlsq.")
    in_metres = on_methods(tables, **about | {"noise_unit": "m"})
    assert "with noise of 0.05 m, maximum" in in_metres[0]
    assert "up to noise of 0.05 m and" in in_metres[1]
    (of_wind,) = on_engineering(tables, **about)
    assert "from a wind of 5.25 m/s" in of_wind and "1.60 m (vertical)" in of_wind
    nothing = {name: table[:0] for name, table in tables.items()}
    assert on_methods(nothing, **about) == on_methods({}, **about) == []
    no_sweeps = pd.DataFrame(columns=["case"])
    without = {"limit_cycles": no_sweeps, "bifurcations": no_sweeps}
    assert on_engineering(without, **about) == on_engineering({}, **about) == []


def test_what_needs_no_figure_is_said():
    cell = {"case": "line", "protocol": "state"}
    about = cell | {"noise_unit": DEVIATION_UNIT}
    r2 = pd.DataFrame(
        {**cell, "method": method, "level": 0.15, "state": state, "r2_median": value}
        for method, state, value in (
            ("maximum_likelihood", "q_v", 0.99996), ("maximum_likelihood", "q_w", 0.99999),
            ("paper", "q_v", -0.2), ("paper", "q_w", 0.9),
        )
    )  # fmt: skip
    bounds = pd.DataFrame(
        {**cell, "recordings": number, "level": level, "points": 9, "coefficient_over_bound": t,
         "verdict": "identifiable" if t > 7 else "not identifiable"}
        for number, level, t in ((1, 0.05, 9), (1, 0.05, 2), (1, 0.1, 1), (2, 0.05, 9))
    )  # fmt: skip
    useless = r2.assign(level=0.3, r2_median=np.nan)  # most fits there are refused
    r2 = pd.concat([r2, useless])
    lost = {**cell, "recordings": 1, "level": 0.05, "points": 9, "verdict": "undetermined"}
    undefined = pd.DataFrame([{**lost, "coefficient_over_bound": np.nan}])
    wider = pd.concat([bounds, undefined])
    _, more = on_methods({"noise_r2": r2, "identifiability": wider}, **about)
    assert "1 of 3 terms of the line line" in more
    first, second = on_methods({"noise_r2": r2, "identifiability": bounds}, **about)
    assert "up to 15 % noise" in first
    assert "0.9999 in both" in first and "−0.2000 by the paper's method" in first
    assert "1 of 2 terms of the line line, 1 of 1" in second and "2 recordings" in second
    ahead = pd.DataFrame(
        [{**cell, "level": 0.05, "state": "q_v", "recorded_m": 0.61, "true_m": 0.54,
          "predicted_m": 0.53, "low_m": 0.5, "high_m": 0.6}]
    )  # fmt: skip
    modes = pd.DataFrame(
        {"line": line, "direction": "vertical", "amplitude_m": amplitude, "limit_cycle_m": 1.5}
        for line, amplitude in (("two modes", 2.0), ("9 modes", 2.01), ("drag", 1.5))
    )
    first, second = on_engineering({"limit_cycle_ahead": ahead, "reduction": modes}, **about)
    assert "0.530 m (0.500 to 0.600) predicted" in first
    assert "−25 % (drag), less than 1 % (9 modes)" in second
    diverging = modes.assign(amplitude_m=modes["amplitude_m"].where(modes["line"] != "two modes"))
    assert on_engineering({"reduction": diverging}, **about) == []
    assert on_engineering({"reduction": modes.assign(limit_cycle_m=1e-9)}, **about) == []
    refused = r2[r2["level"] == 0.15].assign(level=0.1, r2_median=-np.inf)
    assert on_methods({"noise_r2": pd.concat([r2, refused])}, **about) == []


def test_every_column_of_the_reference_and_of_the_claims_has_a_meaning(root):
    heads = [("claims", claims.COLUMNS), ("paper", claims.PAPER_COLUMNS)]
    heads.append(("reproduction", claims.COLUMNS))
    for path in (root / "results" / "reference").rglob("*.csv"):
        heads.append((path.stem, pd.read_csv(path, nrows=0)))
    columns = {(table, column) for table, names in heads for column in names}
    assert [each for each in columns if not meaning(*each)] == []


def test_a_table_s_own_meaning_comes_before_the_general_one():
    assert meaning("measures", "vertical_amplitude_m") != meaning(
        "limit_cycles", "vertical_amplitude_m"
    )
    assert meaning("limit_cycles", "vertical_amplitude_m").endswith("(m)")
    assert meaning("scores", "no_such_column") == ""
