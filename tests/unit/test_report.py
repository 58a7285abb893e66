"""The report's page: complete, self-contained, deterministic; its sentences follow the tables."""

import re

import pandas as pd
import pytest

from galloping.configuration.load import load, plain
from galloping.report.data_dictionary import meaning
from galloping.report.page import Item, as_html, render
from galloping.report.printed_numbers import PaperCell, headline
from galloping.tables import judged_claims as claims


@pytest.fixture
def page(tmp_path):
    svg, csv = tmp_path / "f.svg", tmp_path / "t.csv"
    svg.write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    csv.write_text("term,error_percent\nq_v < q_w,0.123456789\n=1+1,\n")
    figure = Item("f", "01 a figure", "It shows *this*.", svg)
    table = Item("t", "a table", "It holds ``that``.", csv)
    cells = [
        PaperCell("0.83", "2.1 (0.2 to 6)", "reproduced", "so it is"),
        PaperCell("1", "9", "worse", "<"),
    ]
    paper = {"setting": "Fitted & consistent.", "count": "1 of 2 holds.", "rows": {"errors": cells},
             "failures": ["errors: worse; <."], "by_settings": ""}  # fmt: skip
    recording = {"name": "span", "summary": "# <Summary>", "figures": [figure]}
    return {
        "title": "A study", "paper": paper, "printed": None, "made": "commit abc",
        "headline": ["One & one."], "first": figure, "study": plain(load({})),
        "introduction": "Words.", "figures": [figure], "tables": [table],
        "recordings": [recording], "versions": {"python": "3.11"}, "pages": "pages",
    }  # fmt: skip


def test_the_page_shows_everything_and_escapes_it(page):
    html = render(page)
    for shown in (
        "One &amp; one.", "<em>this</em>", "span 300 m, tension 25 kN", "commit abc",
        "<td>q_v &lt; q_w</td><td>0.1235</td>", "<td>=1+1</td><td></td>", "✓ reproduced",
        "<b>1 of 2 holds.</b>", "<li>errors: worse; &lt;.</li>", "✗ worse",
        "<pre># &lt;Summary&gt;</pre>",
    ):  # fmt: skip
        assert shown in html, shown
    assert html == render(page)


def test_the_page_refers_to_nothing_outside_but_the_documents(page, root):
    links = re.findall(r'(?:src|href)="([^"]*)"', render(page))
    outside = {link for link in links if not link.startswith(("#", "data:"))}
    documents = {f"pages/{document.stem}.html" for document in (root / "docs").glob("*.md")}
    assert outside and outside <= documents


def test_a_broken_caption_is_an_error():
    with pytest.raises(Exception, match="Unknown target"):
        as_html("see nowhere_")


def test_the_headline_is_read_from_the_tables():
    cell = {"case": "line", "protocol": "state", "level": 0.05}
    efficiency = pd.DataFrame(
        [{**cell, "points": points, "method": "maximum_likelihood", "replicates": 20,
          "exact_support": exact, "efficiency": 0.98}
         for points, exact in ((30001, 20), (5000, 19), (1000, 12))]
    )  # fmt: skip
    errors = pd.DataFrame(
        [{**cell, "method": method, "mean_error_percent": error}
         for method, error in (("maximum_likelihood", 0.5), ("stlsq", 17.0), ("weak", 30.0))]
    )  # fmt: skip
    about = {"case": "line", "protocol": "state"}
    place = {"case": "line", "parameter": "wind_speed"}
    cycles = pd.DataFrame(
        [{**place, "value": value, "stable": stable, "v_m": value / 10, "w_m": 1.0}
         for value, stable in ((6.0, True), (16.0, True), (18.0, False))]
    )  # fmt: skip
    changes = pd.DataFrame([{**place, "name": "Hopf", "value": 5.253}])
    said = headline(efficiency, errors, cycles, changes, **about)
    assert "20 of 20" in said[0] and "0.5 %, against 17 % by stlsq" in said[0]
    assert "down to 5,000 samples" in said[1]
    assert "from a wind of 5.25 m/s" in said[2] and "1.60 m (vertical)" in said[2]
    assert headline(efficiency[:0], errors, cycles[:0], changes, **about) == []
    no_sweeps = pd.DataFrame(columns=["case"])
    assert headline(efficiency, errors, no_sweeps, no_sweeps, **about) == said[:2]


def test_every_column_of_the_reference_and_of_the_claims_has_a_meaning(root):
    heads = [("claims", claims.COLUMNS), ("paper", claims.PAPER_COLUMNS)]
    for path in (root / "results" / "reference").rglob("*.csv"):
        heads.append((path.stem, pd.read_csv(path, nrows=0)))
    columns = {(table, column) for table, names in heads for column in names}
    assert [each for each in columns if not meaning(*each)] == []


def test_a_table_s_own_meaning_comes_before_the_general_one():
    assert meaning("measures", "v_m") != meaning("limit_cycles", "v_m")
    assert meaning("limit_cycles", "v_m").endswith("(m)")
    assert meaning("scores", "no_such_column") == ""
