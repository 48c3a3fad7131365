"""Faults, buses, the session and the page of a campaign, in Chromium."""

from __future__ import annotations

from socket import create_server

import pytest

from hil.cockpit.campaign_watch import CampaignWatch
from hil.cockpit.watch_server import served_watch
from reports.model import CaseResult, Verdict
from testcases.browser.cockpit_page import CockpitPage
from testcases.browser.conftest import PLACES

pytestmark = pytest.mark.browser


def accessible(page, subtests, what: str) -> None:
    """Look at the page wide and dark, narrow and light."""
    for width, scheme, rules in ((1440, "dark", ()), (390, "light", PLACES)):
        with subtests.test(f"{what}, {width}, {scheme}"):
            page.accessible(width, scheme, rules)
    page.view(1440, 900, "light")


def test_a_fault_is_found_injected_seen_and_becomes_a_test(page, cockpit, subtests):
    """Search and form of the catalogue, the fault on the bus bit by bit, an object read and refused, and the
    session saved as a test; axe-core finds nothing in the three views.
    """
    page.one("#tab-faults").click()
    page.one("#view-faults input[type=search]").send_keys("trips EMCY")
    page.until(lambda: len([one for one in page.all(".fault") if one.is_displayed()]) == 1, "one is found")
    next(one for one in page.all(".fault") if one.is_displayed()).click()
    page.one(".fault-form input[required]").send_keys("2310h")
    page.press("Inject", ".fault-form")
    page.until(lambda: "drive.fault" in page.one(".armed").text, "it is listed")
    assert "code 8976" in page.one(".armed").text
    accessible(page, subtests, "faults")
    page.one("#tab-bus").click()
    page.one(".bus-view input[type=checkbox]").click()
    page.one(".bus-view input[type=search]").send_keys("emcy")
    page.until(lambda: page.all(".frames .time-of"), "the EMCY is there")
    assert "2310h" in page.one(".frames tbody").text
    page.one(".frames .time-of").click()
    page.until(lambda: "from drive1" in page.one(".detail").text, "details")
    assert len(page.all(".detail .bit")) == 64
    page.one(".bus-view [aria-label='Search objects']").send_keys("1018h:01h")
    page.press("Read", ".objects")
    page.until(lambda: page.one(".value-of").text, "a value comes")
    accessible(page, subtests, "bus")
    page.one("#tab-session").click()
    assert "fault drive.fault on drive1" in page.one(".steps").text
    page.press("Write pytest", ".session")
    page.until(lambda: "def test_session(" in page.one("pre.code").text, "the test is written", 60.0)
    page.press("Save in the working folder", ".session")
    page.until((cockpit.folder / "test_session.py").exists, "saved")
    accessible(page, subtests, "session")


def test_the_page_of_a_campaign(driver, tmp_path, subtests):
    """Progress and failures as they come, the report of a failed case, stop and resume; axe-core finds
    nothing.
    """
    watch = CampaignWatch("our stops", 4, workers=1)
    with served_watch(watch, create_server(("127.0.0.1", 0))) as address:
        page = CockpitPage(driver, tmp_path)
        page.view(1440, 900, "light")
        page.complaints()
        driver.get(address)
        page.until(lambda: page.one(".stage").text == "Running", "the page is in")
        watch.case_began("stops/a")
        page.until(lambda: "stops/a" in page.one(".running").text, "a case runs")
        watch.case_done(CaseResult("stops/a", "first", Verdict.PASSED))
        watch.case_done(CaseResult("stops/b", "second", Verdict.ERROR, message="it broke"))
        page.until(lambda: "it broke" in page.one("main").text, "the failure comes")
        assert len([one for one in page.all(".results tbody tr") if one.is_displayed()]) == 1
        accessible(page, subtests, "campaign")
        page.press("Stop", "header")
        page.until(lambda: watch.stopping, "stop arrives")
        watch.paused(finished=False)
        page.press("Resume", "header")
        page.until(lambda: page.one(".stage").text == "Running", "it goes on")
        driver.get(page.one(".results a").get_attribute("href"))
        page.until(lambda: "it broke" in page.one("body").text, "the report of the case")
        assert page.complaints() == []
        driver.get("about:blank")
