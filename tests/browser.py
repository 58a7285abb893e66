"""A real browser for the tests that need one, wherever there is one with its driver."""

import os
import shutil
from importlib.util import find_spec

import pytest

FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-background-networking "
    "--disable-component-update --disable-sync --no-first-run --window-size=1600,1000"
)
CHROMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
MISSING = (
    "Browser checks were not run: they need selenium (`make tools`), and Chromium, Chrome or "
    "Firefox with its driver."
)


def installed():
    """(browser, path, driver) of the first that is there with its driver, or None."""
    chrome = next(filter(None, map(shutil.which, CHROMES)), None)
    firefox = shutil.which("firefox") or shutil.which("firefox-esr")
    for name, path, driver in (
        ("chrome", chrome, shutil.which("chromedriver")),
        ("firefox", firefox, shutil.which("geckodriver")),
    ):
        if path and driver and find_spec("selenium"):
            return name, path, driver
    return None


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """The browser, headless, with an empty profile."""
    available = installed()
    if not available:
        if os.getenv("CI"):
            pytest.fail(MISSING, pytrace=False)
        pytest.skip(MISSING)
    from selenium import webdriver

    name, path, driver = available
    if name == "chrome":
        options = webdriver.ChromeOptions()
        for flag in FLAGS.split():
            options.add_argument(flag)
        options.add_argument(f"--user-data-dir={tmp_path_factory.mktemp('profile')}")
        options.binary_location = path
        window = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    else:
        options = webdriver.FirefoxOptions()
        options.add_argument("--headless")
        options.binary_location = path
        window = webdriver.Firefox(options=options, service=webdriver.FirefoxService(driver))
    yield window
    window.quit()


def pytest_unconfigure(config):
    """The last line says what was not run."""
    if not hasattr(config, "workerinput") and not installed() and not os.getenv("CI"):
        print(MISSING)
