"""The default study's report in a real browser (run `make` first): figures load, tables open as
tables, nothing comes from outside.
"""

import pandas as pd
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

pytestmark = pytest.mark.xdist_group("report")


@pytest.fixture
def results(root):
    return root / "results"


@pytest.fixture
def page(browser, results, tmp_path):
    """The report alone in a folder, so that it can use no file beside it."""
    copy = tmp_path / "report.html"
    copy.write_bytes((results / "report.html").read_bytes())
    browser.get(copy.as_uri())
    return browser


def elements(page, css):
    return page.find_elements(By.CSS_SELECTOR, css)


def test_it_begins_with_what_was_found(page):
    sentences = [element.text for element in elements(page, "#found li")]
    assert any("maximum likelihood" in sentence for sentence in sentences)
    assert elements(page, "#found img")[0].is_displayed()
    assert "tension" in elements(page, "#settings dl")[0].text


def test_every_figure_loads_with_its_caption_and_nothing_comes_from_outside(page, results):
    drawn = (results / "figures").iterdir()
    names = {path.stem for path in drawn if path.suffix in (".svg", ".gif")}
    figures = {figure.get_attribute("id"): figure for figure in elements(page, "figure[id]")}
    assert figures.keys() == names
    for figure in figures.values():
        page.execute_script("arguments[0].scrollIntoView()", figure)
        image = figure.find_element(By.TAG_NAME, "img")
        WebDriverWait(page, 30, poll_frequency=0.05).until(
            lambda _, image=image: int(image.get_attribute("naturalWidth")) > 0
        )
    captions = [figure.find_element(By.TAG_NAME, "figcaption").text for figure in figures.values()]
    assert min(map(len, captions)) > 40 and len(set(captions)) == len(captions)
    fetched = page.execute_script(
        "return performance.getEntriesByType('resource').map(e => e.name)"
    )
    assert {url.partition(":")[0] for url in fetched} <= {"data"}


def test_tables_open_as_tables_that_can_be_searched_and_sorted(page, results):
    table = pd.read_csv(results / "tables" / "claims.csv")
    elements(page, "nav a[href='#table-claims']")[0].click()
    part = elements(page, "#table-claims ~ details")[0]
    rows = part.find_elements(By.CSS_SELECTOR, "tbody tr")
    assert part.get_attribute("open") and len(rows) == len(table) and rows[0].is_displayed()
    head = part.find_elements(By.CSS_SELECTOR, "th")[list(table).index("study_value")]
    head.click()
    shown = [row.text for row in part.find_elements(By.CSS_SELECTOR, "tbody tr")]
    assert shown != [row.text for row in rows] or table["study_value"].is_monotonic_increasing
    part.find_element(By.TAG_NAME, "input").send_keys("not reproduced")
    visible = [r for r in part.find_elements(By.CSS_SELECTOR, "tbody tr") if r.is_displayed()]
    assert len(visible) == (table["verdict"] == "not reproduced").sum()
    download = part.find_element(By.TAG_NAME, "a")
    assert download.get_attribute("download") == "claims.csv"
