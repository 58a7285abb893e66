"""The default study's report in a real browser (run `make` first): figures load in their order,
tables are used with the keyboard, at 200 % too, nothing comes from outside.
"""

import re
from contextlib import suppress

import pandas as pd
import pytest

with suppress(ModuleNotFoundError):  # then there is no browser
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import WebDriverWait

pytestmark = pytest.mark.xdist_group("report")


@pytest.fixture(scope="module")
def results(root):
    return root / "results"


@pytest.fixture(scope="module")
def page(browser, results, tmp_path_factory):
    """The report alone in a folder, so that it can use no file beside it, loaded once."""
    copy = tmp_path_factory.mktemp("report") / "report.html"
    copy.write_bytes((results / "report.html").read_bytes())
    browser.get(copy.as_uri())
    return browser


def elements(page, css):
    return page.find_elements(By.CSS_SELECTOR, css)


def test_it_begins_with_the_paper_and_says_what_was_found(page):
    first, *others = (s.get_attribute("id") for s in elements(page, "main > section"))
    assert first == "paper" and others[:2] == ["methods", "engineering"]
    assert elements(page, "#paper b")[0].is_displayed() and elements(page, ".equations table")
    sentences = [element.text for element in elements(page, "#methods li")]
    assert any("maximum likelihood" in sentence for sentence in sentences)
    assert "tension" in elements(page, "#appendix dl")[0].text


def test_the_paper_takes_five_screens(page):
    size = page.get_window_size()
    page.set_window_size(1280, 900)
    try:
        page.execute_script("document.querySelectorAll('img').forEach(i => i.loading = 'eager')")
        WebDriverWait(page, 30, poll_frequency=0.05).until(
            lambda _: page.execute_script("return [...document.images].every(i => i.complete)")
        )
        end = page.execute_script(
            "return document.querySelector('#paper').getBoundingClientRect().bottom + scrollY"
        )
        assert end <= 5 * 900
    finally:
        page.set_window_size(size["width"], size["height"])


def test_every_figure_loads_with_its_caption_and_nothing_comes_from_outside(page, results):
    drawn = (results / "figures").iterdir()
    names = {path.stem for path in drawn if path.suffix in (".svg", ".gif")}
    figures = {figure.get_attribute("id"): figure for figure in elements(page, "figure[id]")}
    assert figures.keys() == names and len(names) <= 18
    for figure in figures.values():
        page.execute_script("arguments[0].scrollIntoView()", figure)
        image = figure.find_element(By.TAG_NAME, "img")
        WebDriverWait(page, 30, poll_frequency=0.05).until(
            lambda _, image=image: int(image.get_attribute("naturalWidth")) > 0
        )
    captions = [figure.find_element(By.TAG_NAME, "figcaption").text for figure in figures.values()]
    assert min(map(len, captions)) > 40 and len(set(captions)) == len(captions)
    assert max(len(caption.split()) for caption in captions) <= 50
    fetched = page.execute_script(
        "return performance.getEntriesByType('resource').map(e => e.name)"
    )
    assert {url.partition(":")[0] for url in fetched} <= {"data"}


def test_figures_stand_in_the_order_of_the_paper_with_what_they_show(page):
    figures = elements(page, "#paper figure")
    names = [figure.get_attribute("id") for figure in figures]
    assert names == ["printed", *(f"figure{k:02d}" for k in range(1, 11))]
    titles = [figure.find_element(By.TAG_NAME, "h3").text for figure in figures[1:]]
    for number, title in enumerate(titles, start=1):
        assert re.match(rf"Figure {number}\. \w.{{15,}}", title)


def test_a_table_is_searched_sorted_and_saved_with_the_keyboard_alone(page, results):
    table = pd.read_csv(results / "tables" / "claims.csv")
    elements(page, "nav a[href='#table-claims']")[0].send_keys(Keys.ENTER)
    part = elements(page, "#table-claims ~ details")[0]
    assert part.get_attribute("open") and part.find_element(By.TAG_NAME, "table").is_displayed()
    column = list(table).index("study_value")
    head = part.find_elements(By.CSS_SELECTOR, "th")[column]
    for order, ascending in (("ascending", True), ("descending", False)):
        head.find_element(By.TAG_NAME, "button").send_keys(Keys.ENTER)
        shown = page.execute_script(
            "return [...arguments[0].querySelectorAll('tbody tr')]"
            ".map(row => row.cells[arguments[1]].textContent)", part, column,
        )  # fmt: skip
        values = pd.Series([float(text) for text in shown if text])
        assert head.get_attribute("aria-sort") == order and len(shown) == len(table)
        assert values.is_monotonic_increasing if ascending else values.is_monotonic_decreasing
    part.find_element(By.TAG_NAME, "input").send_keys("seldom")
    found = int((table.map(str).agg(" ".join, axis=1).str.contains("seldom")).sum())
    visible = [r for r in part.find_elements(By.CSS_SELECTOR, "tbody tr") if r.is_displayed()]
    assert len(visible) == found > 0
    assert part.find_element(By.TAG_NAME, "output").text == f"{found} of {len(table)} rows"
    download = part.find_element(By.TAG_NAME, "a")
    assert download.get_attribute("download") == "claims.csv"
    saved = page.execute_script("return fetch(arguments[0].href).then(r => r.text())", download)
    assert saved == (results / "tables" / "claims.csv").read_text()


@pytest.mark.parametrize("width", [1400, 700])  # 700: a screen of 1,400 pixels at 200 %
def test_nothing_needs_scrolling_sideways(page, width):
    size = page.get_window_size()
    page.set_window_size(width, 900)
    try:
        wide, inner = page.execute_script("return [document.body.scrollWidth, innerWidth]")
        assert wide <= inner
        assert bool(elements(page, "nav details[open]")) == (width > 960)  # not before the content
    finally:
        page.set_window_size(size["width"], size["height"])


def test_it_is_light(results):
    assert (results / "report.html").stat().st_size <= 8_000_000
