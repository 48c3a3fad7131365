"""A browser for the tests of the report: Debian's Chromium without a window, recording every request that it
makes.
"""

from __future__ import annotations

import importlib.util
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from reports import write_report
from testcases.sample_run import hostile_run, sample_run

COLOURS = ("color-contrast", "link-in-text-block")
PLACES = ("scrollable-region-focusable",)
"""Rules of axe-core that look at colours, and at what is where; the others see the same at every width and in
every colour scheme.
"""
FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --hide-scrollbars"
)


class Browser:
    """A Chromium with its report, and what the tests ask of it."""

    def __init__(self, driver, report: Path) -> None:
        from selenium.webdriver.common.keys import Keys

        self.driver = driver
        self.report = report
        self.keys = Keys

    def open(self, address: str = "", report: Path | None = None) -> None:
        """Load the report again at an address such as `#/case/name` and wait until the page shows it."""
        self.driver.get("about:blank")
        self.driver.get((report or self.report).as_uri() + address)
        self.shown(address)

    def go(self, address: str) -> None:
        """Follow a link inside the loaded report: the plot library stays."""
        self.js("location.hash = arguments[0]", address)
        self.shown(address)

    def shown(self, address: str) -> None:
        """Wait until the page has turned to an address: the event that tells it of a new one comes later."""
        self.until(
            lambda: self.js(
                "return document.readyState === 'complete' && document.documentElement.dataset.shown === "
                "arguments[0]",
                address,
            ),
            f"the page does not show {address or 'its first view'}",
        )

    def all(self, selector: str) -> list:
        return self.driver.find_elements("css selector", selector)

    def one(self, selector: str):
        return self.driver.find_element("css selector", selector)

    def js(self, program: str, *arguments):
        return self.driver.execute_script(program, *arguments)

    def actions(self):
        """Begin a chain of pointer actions."""
        from selenium.webdriver.common.action_chains import ActionChains

        return ActionChains(self.driver)

    def until(self, condition: Callable[[], object], what: str, seconds: float = 20.0):
        """Wait until a condition holds; what it returned is the result."""
        from selenium.common.exceptions import StaleElementReferenceException
        from selenium.webdriver.support.ui import WebDriverWait

        wait = WebDriverWait(self.driver, seconds, 0.05, ignored_exceptions=[StaleElementReferenceException])
        return wait.until(lambda _driver: condition(), what)

    def plot(self) -> None:
        """Wait until the curves of the open case are drawn."""
        self.until(lambda: self.all(".curve canvas"), "no curve was drawn")

    def range(self) -> list[float]:
        """Visible time range of the plot [s]."""
        return self.js("return [...document.querySelector('.plot').plot.range]")

    def surface(self):
        """Return the part of the plot that a pointer works on: the first panel."""
        return self.one(".curve .u-over")

    def view(self, width: int, height: int, scheme: str) -> None:
        """Set window size and colour scheme."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        features = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", features)

    def accessible(self, width: int, scheme: str, rules: Sequence[str] = ()) -> None:
        """Expect that axe-core finds nothing, and that nothing is wider than the screen, at a width and in a
        colour scheme.

        `rules`: those that depend on colours or places, where all were tried on the same page already.
        """
        self.view(width, 900, scheme)
        if not self.js("return typeof axe === 'object'"):
            folder = importlib.util.find_spec("axe_core_python").submodule_search_locations[0]
            self.js((Path(folder) / "axe.min.js").read_text("utf-8"))
            self.driver.set_script_timeout(120)
        found = self.driver.execute_async_script(
            "const done = arguments[1]; axe.run(arguments[0]).then((found) => done(found.violations.map("
            "(one) => [one.id, one.help, one.nodes.map((node) => node.html)])))",
            {"resultTypes": ["violations"], **({"runOnly": list(rules)} if rules else {})},
        )
        assert found == [], json.dumps(found, indent=1)
        assert self.js("return document.documentElement.scrollWidth") <= width

    def complaints(self) -> list[str]:
        """Everything that the console got since the last call."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def requests(self) -> set[str]:
        """Schemes of all addresses that the browser asked for since the last call."""
        found = set()
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] in {"Network.requestWillBeSent", "Network.webSocketCreated"}:
                parameters = message["params"]
                address = parameters["request"]["url"] if "request" in parameters else parameters["url"]
                found.add(address.partition(":")[0])
        return found


@pytest.fixture(scope="session")
def sample_report(tmp_path_factory) -> Path:
    return write_report(sample_run(), tmp_path_factory.mktemp("report")).report


@pytest.fixture(scope="session")
def hostile_report(tmp_path_factory) -> Path:
    return write_report(hostile_run(), tmp_path_factory.mktemp("hostile")).report


def chromium(profile: Path):
    """Start a Chromium with a profile of its own; who starts it ends it."""
    programs = {name: shutil.which(name) for name in ("chromium", "chromedriver")}
    missing = [name for name, path in programs.items() if path is None]
    if missing:
        pytest.fail(
            f"{' and '.join(missing)} not found. Install the browser of these tests with "
            "`apt-get install -y chromium chromium-driver` (Debian), or leave them out with `-m 'not "
            "browser'`.",
            pytrace=False,
        )
    try:
        from selenium import webdriver
    except ImportError:
        pytest.fail("selenium not found. Install it with `pip install 'motion-hil[dev]'`.", pytrace=False)
    options = webdriver.ChromeOptions()
    for flag in FLAGS.split():
        options.add_argument(flag)
    options.add_argument(f"--user-data-dir={profile}")
    options.binary_location = programs["chromium"]
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    # An explicit driver: selenium would look for one on the network otherwise.
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(programs["chromedriver"]))


@pytest.fixture(scope="session")
def driver(tmp_path_factory) -> Iterator[object]:
    chrome = chromium(tmp_path_factory.mktemp("profile"))
    yield chrome
    chrome.quit()


@pytest.fixture
def browser(driver, sample_report) -> Iterator[Browser]:
    """The browser at 1440 x 900 with the case list open; afterwards: no complaint in the console, no request
    anywhere.
    """
    browser = Browser(driver, sample_report)
    browser.view(1440, 900, "light")
    browser.complaints()
    browser.requests()
    browser.open()
    yield browser
    assert browser.complaints() == []
    asked = browser.requests()
    assert "file" in asked, "requests are not recorded"
    assert asked <= {"file", "data", "blob", "about"}


@pytest.fixture(scope="session")
def cockpit(tmp_path_factory) -> Iterator[object]:
    """A cockpit of the reference bench, for all tests; `folder` is its working folder."""
    from testcases.cockpit_rig import served

    folder = tmp_path_factory.mktemp("cockpit")
    with served(folder=folder) as one:
        one.folder = folder
        yield one


@pytest.fixture(scope="session")
def cockpit_page(driver, cockpit) -> Iterator[object]:
    """The page of this cockpit, opened once; it is opened again by `page` where another test left it."""
    from testcases.browser.cockpit_page import CockpitPage

    yield CockpitPage(driver, Path())
    driver.get("about:blank")


@pytest.fixture
def page(cockpit_page, cockpit) -> Iterator[object]:
    """This page in control, with a fresh bench; afterwards: no complaint in the console."""
    if not cockpit_page.driver.current_url.startswith(cockpit.origin):
        cockpit_page.enter(cockpit)
    cockpit_page.view(1440, 900, "light")
    cockpit_page.operate()
    yield cockpit_page
    assert cockpit_page.complaints() == []
