"""The cockpit in Chromium: two pages, a browser that is killed while it jogs, the keyboard alone, and what
axe-core finds.
"""

from __future__ import annotations

import os
import signal
from itertools import pairwise
from pathlib import Path

import pytest

from testcases.browser.cockpit_page import CockpitPage
from testcases.browser.conftest import COLOURS, PLACES, chromium

pytestmark = pytest.mark.browser

VIEWS = ("bench", "axis", "scope")


def test_a_second_browser_watches_stops_and_is_killed(page, cockpit, tmp_path):
    """One page moves the axis; another browser watches it, and stops it by Esc, which is all it can do. When
    that one operates and is killed while it jogs, the axis stops, is disabled and given back with alarm 204.
    """
    chrome = chromium(tmp_path / "other")
    service = chrome.service
    try:
        other = CockpitPage(chrome, Path())
        other.enter(cockpit)
        other.show("axis")
        other.until(lambda: "has control" in other.one(".control-state").text, "somebody operates")
        assert not any(one.is_enabled() for one in other.all("#view-axis button.operate"))
        page.enable()
        page.far()
        other.until(lambda: other.reading("Velocity") > 20.0, "the other page sees it move")
        other.one("body").send_keys(other.keys.ESCAPE)
        page.until(lambda: page.reading("Velocity") == 0.0, "stopped")
        assert 0.0 < page.reading("Position") < 390.0
        page.press("Release control")
        other.take()
        other.until(lambda: other.one("#view-axis .badge").text == "disabled", "given back")
        other.enable()
        assert other.complaints() == []
        assert other.requests() <= {"http", "ws", "about", "data", "blob"}
        with cockpit.page() as watcher:
            other.actions().click_and_hold(other.one('[aria-label="Jog forward"]')).perform()
            axis = lambda: watcher.state["axis"]["axis1"]  # noqa: E731
            watcher.until(lambda: axis()["velocity"] > 5.0, "jogs")
            before = watcher.state["time_s"]
            for process in _children(service.process.pid):
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
    page.show("bench")
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
    page.far()
    page.until(lambda: page.reading("Velocity") > 20.0, "moves")
    page.actions().send_keys(page.keys.ESCAPE).perform()
    page.until(lambda: page.reading("Velocity") == 0.0, "stopped")
    assert page.reading("Position") < place + 390.0


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
    page.js("window.own = [URL.createObjectURL, HTMLAnchorElement.prototype.click]")
    page.js(
        "window.saved = new Promise((done) => { URL.createObjectURL = (blob) => { blob.text().then(done); "
        "return 'blob:none'; }; })"
    )
    page.js("HTMLAnchorElement.prototype.click = () => {}")
    page.press("Save CSV", "#view-scope")
    lines = page.driver.execute_async_script("window.saved.then(arguments[0])").splitlines()
    page.js("[URL.createObjectURL, HTMLAnchorElement.prototype.click] = window.own")
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
        for width, scheme, rules in ((1440, "light", ()), (1440, "dark", COLOURS), (390, "light", PLACES)):
            with subtests.test(f"{view}, {width}, {scheme}"):
                page.accessible(width, scheme, rules)
    page.view(1440, 900, "light")
