"""The cockpit in Chromium: two pages, a browser that is killed while it jogs, the keyboard alone, and what
axe-core finds.
"""

from __future__ import annotations

import os
import signal
from itertools import pairwise
from pathlib import Path

import pytest

from testcases.browser.conftest import Browser, chromium
from testcases.cockpit_rig import TOKEN, served

pytestmark = pytest.mark.browser

VIEWS = ("bench", "axis", "scope")


@pytest.fixture(scope="module")
def cockpit():
    with served() as one:
        yield one


class CockpitPage(Browser):
    """A browser with the page of a cockpit."""

    def enter(self, cockpit) -> None:
        """Open the page with the token; the console is read from here on."""
        self.view(1440, 900, "light")
        self.driver.get("about:blank")
        self.complaints()
        self.requests()
        self.driver.get(f"{cockpit.origin}/#token={TOKEN}")
        self.until(
            lambda: self.js("return document.documentElement.dataset.bench") == "up", "the bench comes up"
        )

    def press(self, words: str, within: str = "body") -> None:
        """Click the button with these words, when it can be."""
        button = self.until(
            lambda: next(
                (one for one in self.all(f"{within} button") if one.text == words and one.is_enabled()), None
            ),
            f"no button {words}",
        )
        self.js("arguments[0].scrollIntoView({block: 'center'})", button)
        button.click()

    def show(self, view: str) -> None:
        self.one(f"#tab-{view}").click()

    def enable(self) -> None:
        """Enable the axis with the buttons that a person uses."""
        self.show("axis")
        self.press("Enable", "#view-axis")
        self.until(lambda: self.one("#view-axis .badge").text == "standstill", "enabled")

    def reading(self, name: str) -> float:
        """Return a value of the axis as it is shown."""
        shown = self.one(f'#view-axis output[aria-label="{name}"]').text
        return float(shown.replace("\u2212", "-"))


@pytest.fixture
def page(driver, cockpit):
    one = CockpitPage(driver, Path())
    one.enter(cockpit)
    one.press("Take control")
    one.until(lambda: "You have control" in one.one(".control-state").text, "control")
    one.show("bench")
    one.press("Reset bench")
    one.until(lambda: float(one.one(".clock").text.split()[0]) < 3.0, "reset")
    yield one
    complaints = one.complaints()
    driver.get("about:blank")
    assert complaints == []


def test_two_browsers(page, cockpit, tmp_path):
    """One page moves the axis, another browser watches it, and stops it by Esc, which is all it can do."""
    chrome = chromium(tmp_path / "other")
    try:
        other = CockpitPage(chrome, Path())
        other.enter(cockpit)
        other.show("axis")
        other.until(lambda: "has control" in other.one(".control-state").text, "somebody operates")
        assert not any(one.is_enabled() for one in other.all("#view-axis button.operate"))
        page.enable()
        page.press("By distance")
        other.until(lambda: other.reading("Velocity") > 20.0, "the other page sees it move")
        other.one("body").send_keys(other.keys.ESCAPE)
        page.until(lambda: page.reading("Velocity") == 0.0, "stopped")
        assert 0.0 < page.reading("Position") < 90.0
        assert other.complaints() == []
        assert other.requests() <= {"http", "ws", "about", "data", "blob"}
    finally:
        chrome.quit()


def test_killed_browser_stops_the_axis(cockpit, tmp_path):
    """A browser that is killed while it jogs: the axis stops, is disabled and given back with alarm 204."""
    chrome = chromium(tmp_path / "killed")
    service = chrome.service
    try:
        page = CockpitPage(chrome, Path())
        page.enter(cockpit)
        with cockpit.page() as watcher:
            watcher.until(lambda: watcher.state["operator"] is None, "nobody operates")
            page.press("Take control")
            page.press("Reset bench")
            page.until(lambda: float(page.one(".clock").text.split()[0]) < 3.0, "reset")
            page.enable()
            page.actions().click_and_hold(page.one('[aria-label="Jog forward"]')).perform()
            axis = lambda: watcher.state["axis"]["axis1"]  # noqa: E731
            watcher.until(lambda: axis()["velocity"] > 5.0, "jogs")
            driver_children = _children(service.process.pid)
            before = watcher.state["time_s"]
            for process in driver_children:
                os.kill(process, signal.SIGKILL)
            watcher.until(lambda: axis()["velocity"] == 0.0, "stops")
            assert watcher.state["time_s"] - before < 2.0
            watcher.until(lambda: axis()["master"] == "program", "given back")
            watcher.until(lambda: axis()["alarms"], "alarm")
            assert axis()["alarms"][0]["number"] == 204
            assert not axis()["enabled"]
    finally:
        service.stop()


def _children(parent: int) -> list[int]:
    """Return the processes that a process has started, and theirs."""
    found = []
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = place.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == parent:
            own = int(place.parent.name)
            found += [own, *_children(own)]
    return found


def test_keyboard_alone(page):
    """Tabs turn by arrow keys, a jog key moves as long as the space bar is held, Esc stops a move."""
    page.one("#tab-bench").send_keys(page.keys.ARROW_RIGHT)
    assert page.js("return document.activeElement.id") == "tab-axis"
    page.js(
        "[...document.querySelectorAll('#view-axis button')]"
        ".find((one) => one.textContent === 'Enable').focus()"
    )
    page.actions().send_keys(page.keys.ENTER).perform()
    page.until(lambda: page.one("#view-axis .badge").text == "standstill", "enabled")
    page.js("document.querySelector('[aria-label=\"Jog forward\"]').focus()")
    page.actions().key_down(page.keys.SPACE).perform()
    page.until(lambda: page.reading("Velocity") > 5.0, "jogs")
    page.actions().key_up(page.keys.SPACE).perform()
    page.until(lambda: page.reading("Velocity") == 0.0, "let go")
    place = page.reading("Position")
    assert place > 0.0
    page.press("By distance")
    page.until(lambda: page.reading("Velocity") > 20.0, "moves")
    page.actions().send_keys(page.keys.ESCAPE).perform()
    page.until(lambda: page.reading("Velocity") == 0.0, "stopped")
    assert page.reading("Position") < place + 90.0


def test_jog_ends_where_the_window_loses_the_focus(page):
    """A jog that is held ends when the window loses the focus or the page is hidden."""
    page.enable()
    for event in (
        "window.dispatchEvent(new Event('blur'))",
        "document.dispatchEvent(new Event('visibilitychange'))",
    ):
        page.actions().click_and_hold(page.one('[aria-label="Jog forward"]')).perform()
        page.until(lambda: page.reading("Velocity") > 5.0, "jogs")
        page.js(event)
        page.until(lambda: page.reading("Velocity") == 0.0, event)
        page.actions().release().perform()


def test_homing_is_drawn(page):
    """The picture of a homing grows while the axis homes, and has all its steps at the end."""
    page.enable()
    assert not page.one("#view-axis .homing").is_displayed()
    page.press("Home", "#view-axis")
    page.until(lambda: page.all("#view-axis .homing-svg"), "a picture while it homes")
    page.until(lambda: "Done: homed" in page.one("#view-axis .homing .note").text, "homed")
    steps = [one.text for one in page.all("#view-axis .homing tbody strong")]
    assert steps == ["start", "search +", "mark", "home \N{MINUS SIGN}", "home position"]


def test_scope(page):
    """The scope shows every sample, holds at a trigger with what was before it, calculates, and saves."""
    page.enable()
    page.show("scope")
    page.until(lambda: page.all("#view-scope .chart canvas"), "curves")
    page.js("for (const one of document.querySelectorAll('#view-scope details')) one.open = true")
    page.one('[aria-label="Signal of the trigger"]').send_keys("axis1.actual_velocity")
    level = page.one("#view-scope form input[type=number]")
    level.clear()
    level.send_keys("20")
    page.one('#view-scope select[aria-label="Length of the window"]').send_keys("1 s")
    page.press("Single", "#view-scope")
    page.one('[aria-label="Signal a"]').send_keys("axis1.actual_position")
    page.js(
        "const form = document.querySelector('[aria-label=\"Signal a\"]').form;"
        "form.querySelector('select').value = 'derivative';"
        "form.querySelector('select').dispatchEvent(new Event('change')); form.requestSubmit()"
    )
    page.until(lambda: "d/dt axis1.actual position" in page.one(".readings").text, "calculated channel")
    page.show("axis")
    page.press("By distance")
    page.show("scope")
    page.until(lambda: "held" in page.one("#view-scope output.note").text, "triggered")
    page.js(
        "window.saved = new Promise((done) => { URL.createObjectURL = (blob) => { blob.text().then(done); "
        "return 'blob:none'; }; })"
    )
    page.js("HTMLAnchorElement.prototype.click = () => {}")
    page.press("Save CSV", "#view-scope")
    lines = page.driver.execute_async_script("window.saved.then(arguments[0])").splitlines()
    heads = lines[0].split(",")
    rows = [dict(zip(heads, line.split(","), strict=True)) for line in lines[1:]]
    times = [float(row["time [s]"]) for row in rows]
    assert len(rows) in range(249, 253)
    assert max(b - a for a, b in pairwise(times)) < 0.0041
    crossed = next(row for row in rows if float(row["axis1.actual_velocity [mm/s]"]) >= 20.0)
    assert abs(float(crossed["time [s]"]) - times[0] - 0.2) < 0.01
    slope = float(rows[-2]["d/dt axis1.actual position [mm/s]"])
    assert slope == pytest.approx(float(rows[-2]["axis1.actual_velocity [mm/s]"]), rel=0.05)


def test_nothing_overflows_and_axe_finds_nothing(page, subtests):
    """In every view, wide and narrow, light and dark: axe-core finds nothing, and nothing is wider than the
    screen.
    """
    page.js("for (const one of document.querySelectorAll('details.card')) one.open = true")
    for view in VIEWS:
        page.show(view)
        for width, scheme in ((1440, "light"), (1440, "dark"), (390, "light")):
            with subtests.test(f"{view}, {width}, {scheme}"):
                page.accessible(width, scheme)
    page.view(1440, 900, "light")
