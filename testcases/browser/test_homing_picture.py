"""The picture of a homing on the page of its case, as a person sees it."""

from __future__ import annotations

import pytest

from hil.testing import homing_drawings
from reports import write_report
from reports.model import CaseResult, RunResult, Verdict
from testcases.unit.hil.homing_bench import STEEP, Machine, homing_bench

pytestmark = pytest.mark.browser

MINUS = "\N{MINUS SIGN}"
HOSTILE = "</script><img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def homing_report(tmp_path_factory):
    """A report with an active homing that turns round at a limit switch, a passive one, and one that is not a
    homing.
    """
    own = {
        "Sensor[1].ActiveHoming.Mode": 1,
        "Sensor[1].ActiveHoming.HomePositionOffset": 5.0,
        "Homing.AutoReversal": True,
        "Homing.ApproachDirection": True,
    }
    with homing_bench(variables=STEEP | own, mechanics={"start_position_mm": -480.0}) as bench:
        run = Machine(bench)
        run.done()
        job = run.axis.home(0.0, mode=2)
        run.axis.move_velocity(50.0)
        run.until(job.done)
        run.run(0.3)
        trace = bench.trace()
    signals = [trace[f"axis1.{name}"] for name in ("actual_position", "actual_velocity")]
    drawings = homing_drawings(trace)
    drawings[1].job = HOSTILE
    cases = [
        CaseResult(
            "homed", "homed", Verdict.PASSED, signals=list(signals), homings=drawings, simulated_s=trace.end_s
        ),
        CaseResult("plain", "plain", Verdict.PASSED, signals=list(signals), simulated_s=trace.end_s),
    ]
    run = RunResult("Homing", 1, "profidrive", "", {}, "", cases)
    return write_report(run, tmp_path_factory.mktemp("homing")).report


def test_picture_shows_the_homing(browser, homing_report):
    """Numbered steps, bars of cam and limit switch, the used zero mark, curves with arrows, mark and home
    position.
    """
    browser.open("#/case/homed", homing_report)
    browser.until(lambda: len(browser.all(".homing-svg")) == 2, "no picture was drawn")
    rows = [row.text.split("\n")[0] for row in browser.all(".homing:first-child tbody tr")]
    names = [
        "start",
        f"approach {MINUS}",
        "negative limit reached",
        "approach +",
        "cam reached",
        "search +",
        "mark",
        "home +",
    ]
    assert [row.partition(" ")[2].startswith(name) for row, name in zip(rows, names, strict=False)] == [
        True
    ] * 8
    assert [badge.text for badge in browser.all(".homing:first-child .hnt")] == [str(n) for n in range(1, 10)]
    lanes = browser.js(
        "return [...document.querySelectorAll('.homing-svg')[0].querySelectorAll('[data-lane]')].map((l) => "
        "l.dataset.lane)"
    )
    assert lanes == ["negative limit", "cam", "zero mark"]
    first = ".homing:first-child .homing-svg "
    assert len(browser.all(first + ".hbar")) == 2
    assert len(browser.all(first + ".hz.used")) == 1
    assert len(browser.all(first + ".hp-approach .ha")) >= 2
    cam, mark = browser.one(first + "[data-lane=cam] .hbar").rect, browser.one(first + "line.hm").rect
    home = browser.one(first + "line.hh").rect
    assert cam["x"] + cam["width"] < mark["x"] < home["x"], (
        "the mark lies behind the cam, the home position behind the mark"
    )
    assert f"homing mark {MINUS}5" in browser.one(first + "text.hm").text
    assert browser.one(first).rect["width"] > 700


def test_picture_in_words(browser, homing_report):
    """The picture has a name and a description that say the same."""
    browser.open("#/case/homed", homing_report)
    browser.until(lambda: browser.all(".homing-svg"), "no picture was drawn")
    picture = browser.one(".homing-svg")
    described = browser.js(
        "return document.getElementById(arguments[0]).textContent", picture.get_attribute("aria-describedby")
    )
    assert picture.get_attribute("role") == "img"
    assert "zero mark behind the cam" in browser.js(
        "return document.getElementById(arguments[0]).textContent", picture.get_attribute("aria-labelledby")
    )
    assert f"Cam reached at {MINUS}27.9 mm" in described
    assert f"Mark at {MINUS}5.0 mm" in described


def test_steps_lead_to_the_plot(browser, homing_report):
    """A click on a step sets the cursor of the plot to its moment; the pointer on it lights it up in the
    picture.
    """
    browser.open("#/case/homed", homing_report)
    browser.plot()
    row = browser.all(".homing:first-child tbody tr")[4]
    row.find_element("css selector", "button").click()
    browser.until(lambda: "t=" in browser.driver.current_url, "the cursor did not move")
    browser.actions().move_to_element(row).perform()
    browser.until(lambda: browser.all(".homing-svg g.now[data-step='5']"), "the step did not light up")


def test_words_of_a_run_stay_words(browser, homing_report):
    """A name with markup is shown as it is; a case without a homing has no picture; dark and narrow it
    fits.
    """
    browser.open("#/case/homed", homing_report)
    browser.until(lambda: HOSTILE in browser.one(".homing:last-child summary").text, "the name is not shown")
    browser.view(420, 900, "dark")
    fits = "return document.documentElement.scrollWidth <= document.documentElement.clientWidth"
    browser.until(lambda: browser.js(fits), "the page is wider than the window")
    browser.open("#/case/plain", homing_report)
    browser.plot()
    assert browser.all(".homing") == []
