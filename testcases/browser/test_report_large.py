"""The report of a large run, whose cases are next to the page: the list grows, cases come when they are
opened.
"""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest

from reports import CaseResult, RunResult, Verdict, render_html
from testcases.sample_run import sample_run

pytestmark = pytest.mark.browser

CASES = 700
FAILED = "alarm-reactions/alarm-521/encoder.freeze/motion"


@pytest.fixture(scope="module")
def run() -> RunResult:
    """The sample run with many small cases behind it."""
    sample = sample_run(samples=200)
    small = [
        CaseResult(f"small/{n:04d}", f"Case number {n}", Verdict.PASSED, group="small", wall_s=n / 1000)
        for n in range(CASES - len(sample.cases))
    ]
    return dataclasses.replace(sample, cases=[*sample.cases, *small])


@pytest.fixture(scope="module")
def report(run, tmp_path_factory) -> Path:
    return render_html(run, tmp_path_factory.mktemp("large") / "report.html", embedded=0)


def rows(browser) -> int:
    return browser.js("return document.querySelectorAll('#cases tbody tr').length")


def test_list_grows_while_it_is_scrolled_and_filters_look_through_all(browser, report):
    """A screenful is there at once, the rest comes with scrolling; filter and order count every case."""
    browser.open("", report)
    assert rows(browser) == 100
    assert browser.one("#cases").get_attribute("aria-rowcount") == str(CASES + 1)
    assert browser.one("#f-count").text == f"{CASES} cases"
    browser.js("scrollTo(0, document.body.scrollHeight)")
    browser.until(lambda: rows(browser) > 100, "scrolling brought no rows")
    browser.one("#f-q").send_keys("small/0654")
    browser.until(lambda: rows(browser) == 1, "the filter found something else")
    browser.one("#f-clear").click()
    browser.one("[data-sort=w]").click()
    browser.one("[data-sort=w]").click()
    browser.until(
        lambda: browser.one("#cases tbody a.id").text == "small/0654", "the slowest case is not first"
    )


def test_arrows_walk_beyond_the_rows_that_are_there(browser, report):
    """The next row is made when the keyboard comes to it, and the way back from a case leads to it."""
    browser.open("#/cases?q=small", report)
    browser.js("document.querySelectorAll('#cases tbody a.id')[99].focus()")
    browser.driver.switch_to.active_element.send_keys(browser.keys.ARROW_DOWN)
    name = "small/0100"
    assert browser.driver.switch_to.active_element.text == name
    browser.driver.switch_to.active_element.send_keys(browser.keys.ENTER)
    browser.until(lambda: browser.all(".case-head .id"), "the case did not come")
    assert browser.one(".case-head .id").text == name
    browser.one("body").send_keys(browser.keys.ESCAPE)
    browser.until(lambda: browser.driver.switch_to.active_element.text == name, "the row is not focused")


def test_case_and_plot_library_come_from_next_to_the_page(browser, report):
    """A deep link opens the case with its plot, from files alone; nothing of it was in the page."""
    assert "encoder.freeze on drive1" not in report.read_text("utf-8")
    browser.open(f"#/case/{FAILED}", report)
    browser.plot()
    assert browser.one(".case-head h1").text == "Alarm 521 expected within 20 ms, came after 48 ms"
    browser.one("body").send_keys("]")
    browser.until(lambda: browser.one(".case-head .id").text != FAILED, "the next case did not come")


def test_missing_or_foreign_data_is_said(browser, report, run, tmp_path):
    """A page without its folder, or with that of another run, says so in the place of the case."""
    alone = shutil.copy(report, tmp_path / "alone.html")
    browser.open(f"#/case/{FAILED}", alone)
    browser.until(lambda: "is missing" in browser.one("#view-case").text, "the missing file is not named")
    assert "The folder report-data" in browser.one("#view-case").text
    foreign = render_html(dataclasses.replace(run, title="other"), tmp_path / "report.html", embedded=0)
    shutil.copy(report, foreign)
    browser.open(f"#/case/{FAILED}", foreign)
    browser.until(
        lambda: "belongs to another report" in browser.one("#view-case").text, "the mix-up is not noticed"
    )
    assert all("ERR_FILE_NOT_FOUND" in line for line in browser.complaints())


def test_printing_takes_every_row_along(browser, report):
    """On paper the list is whole, without filters and buttons."""
    browser.open("", report)
    browser.js("dispatchEvent(new Event('beforeprint'))")
    assert rows(browser) == CASES
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert not browser.one("#filters").is_displayed()
    assert not browser.one("#c-more").is_displayed()
    assert browser.one("#hero-title").is_displayed()
    browser.js("dispatchEvent(new Event('afterprint'))")
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
