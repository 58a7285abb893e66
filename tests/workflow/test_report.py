"""The report in a real browser: figures and tables load, and nothing comes from outside."""

import json
import re
import shutil
from base64 import b64decode
from urllib.parse import urlsplit

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]

FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-background-networking "
    "--disable-component-update --disable-sync --no-first-run --window-size=1600,1000"
)
DESCRIBED = re.compile(r"description\n(.+?)\nsize\n", re.IGNORECASE | re.DOTALL)
OPEN_CAPTION = """
document.querySelectorAll("table tbody tr")[arguments[0]].querySelectorAll("a")[1].click()
"""
LARGEST_IMAGE = """
return Math.max(0, ...Array.from(document.images)
  .filter(image => image.complete && image.src.includes("filename=" + arguments[0]))
  .map(image => image.naturalWidth))
"""


@pytest.fixture(scope="module")
def report(study):
    """The report of the smoke study, alone in a folder, so that it can use no file beside it."""
    assert study.first.returncode == 0, "the smoke study failed: see test_smoke.py"
    page = study.folder.with_name("report") / "report.html"
    page.parent.mkdir()
    run = study.snakemake("--report", str(page))
    assert run.returncode == 0, run.stdout
    return page


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """Headless Chromium with an empty profile."""
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not (chromium and driver):
        pytest.fail(
            "Chromium is missing: install it with `apt-get install chromium chromium-driver`",
            pytrace=False,
        )
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for flag in FLAGS.split():
        options.add_argument(flag)
    options.add_argument(f"--user-data-dir={tmp_path_factory.mktemp('profile')}")
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    chrome = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield chrome
    chrome.quit()


@pytest.fixture
def page(browser, report):
    """The report, newly opened, with empty logs."""
    browser.get("about:blank")
    for log in ("performance", "browser"):
        browser.get_log(log)
    browser.get(report.as_uri())
    wait(browser).until(lambda b: b.find_elements(By.LINK_TEXT, "Figures"))
    return browser


def wait(browser):
    return WebDriverWait(browser, 30, poll_frequency=0.05)


def rows(browser):
    """The results of the category that is open, each with its icons to show it and its caption."""
    wait(browser).until(lambda b: b.find_elements(By.CSS_SELECTOR, "table tbody tr a"))
    return browser.find_elements(By.CSS_SELECTOR, "table tbody tr")


def show(row):
    row.find_elements(By.TAG_NAME, "a")[0].click()


def fetched(browser):
    """Everything that the page asked for since the log was last read."""
    messages = (json.loads(entry["message"])["message"] for entry in browser.get_log("performance"))
    return [
        message["params"]["request"]["url"]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    ]


def test_every_figure_loads_and_nothing_comes_from_outside(page, report, study):
    figures = sorted(path.name for path in (study.results / "figures").glob("*.svg"))
    assert len(figures) >= 11
    page.find_element(By.LINK_TEXT, "Figures").click()
    assert len(rows(page)) == len(figures)
    shown: set[str] = set()

    def more(browser):
        return {f for f in figures if browser.execute_script(LARGEST_IMAGE, f) > 0} - shown

    for row in rows(page):
        show(row)
        shown |= wait(page).until(more)
    assert shown == set(figures)

    requests = fetched(page)
    assert report.as_uri() in requests
    # the log does hold the figures, so it would hold anything else
    assert all(any(f"filename={name}" in url for url in requests) for name in figures)
    assert {urlsplit(url).scheme for url in requests} <= {"file", "data", "blob"}
    assert {url for url in requests if url.startswith("file:")} == {report.as_uri()}
    assert not [e for e in page.get_log("browser") if e["level"] == "SEVERE"]


def test_tables_can_be_saved_from_the_report(page, study):
    page.find_element(By.LINK_TEXT, "Tables").click()
    links = {row.text.strip(): row.find_element(By.TAG_NAME, "a") for row in rows(page)}
    assert links.keys() >= {"table1_conductor", "table2_spacers", "table3_coefficients", "claims"}
    for name, link in links.items():
        assert link.get_attribute("download") == f"{name}.csv"
        head, _, content = link.get_attribute("href").partition(";base64,")
        assert head.startswith("data:text/csv;")
        assert b64decode(content) == (study.results / "tables" / f"{name}.csv").read_bytes()


@pytest.mark.parametrize("category", ["Figures", "Tables"])
def test_every_result_has_a_caption(page, category):
    page.find_element(By.LINK_TEXT, category).click()
    names = [row.text.strip() for row in rows(page)]
    captions = {}
    for i, name in enumerate(names):
        wait(page).until(lambda b: len(rows(b)) == len(names))
        captions[name] = wait(page).until(lambda b, i=i: opened_caption(b, i)).group(1)
        page.find_element(By.LINK_TEXT, category).click()
    assert all(len(caption) > 40 for caption in captions.values()), captions
    assert len(set(captions.values())) == len(captions)


def opened_caption(browser, i):
    """The caption of the i-th result, asked for until the page, redrawn at will, has heard it."""
    if described := DESCRIBED.search(text(browser)):
        return described
    if i < len(browser.find_elements(By.CSS_SELECTOR, "table tbody tr")):
        browser.execute_script(OPEN_CAPTION, i)
    return None


def text(browser):
    return browser.find_element(By.TAG_NAME, "body").text
