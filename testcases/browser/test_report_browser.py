"""The report as a person uses it, in a real browser, from a file, without a network."""

from __future__ import annotations

import base64
import csv
import re
import time
from urllib.parse import unquote

import numpy as np
import pytest

from reports import Verdict
from testcases.sample_run import hostile_run, sample_run

pytestmark = pytest.mark.browser

FAILED = "alarm-reactions/alarm-521/encoder.freeze/motion"


@pytest.fixture(scope="module")
def run():
    return sample_run()


def visible(browser) -> list[str]:
    return browser.js(
        "return [...document.querySelectorAll('#cases tbody tr:not([hidden]) a.id')].map((link) => "
        "link.textContent)"
    )


def test_verdict_is_seen_first(browser):
    """At first sight: red or green in word and sign, the totals, and the failed cases with their reasons on
    top.
    """
    assert browser.one("#hero-title").text == "4 failed and 1 error"
    assert browser.all("#hero-title svg use[href='#i-failed']")
    rows = [row.text for row in browser.all("#cases tbody tr")[:4]]
    assert all("failed" in row for row in rows)
    assert any("Alarm 521 expected within 20 ms, came after 48 ms" in row for row in rows)
    assert browser.all("#cases tbody tr")[3].rect["y"] < 900


def test_filter_by_verdict_text_and_fault_lives_in_the_address(browser, run):
    """Chips, search and selections narrow the list; the address brings the same list back."""
    browser.one("[data-verdict=failed]").click()
    assert set(visible(browser)) == {case.identifier for case in run.cases if case.verdict is Verdict.FAILED}
    browser.one("#f-q").send_keys("521 freeze")
    assert visible(browser) == [FAILED]
    assert browser.one("#f-count").text == "1 of 45 cases"
    address = browser.driver.current_url
    browser.open(address.partition(".html")[2])
    assert visible(browser) == [FAILED]
    assert browser.one("#f-q").get_attribute("value") == "521 freeze"
    assert browser.one("[data-verdict=failed]").get_attribute("aria-pressed") == "true"
    browser.one("#f-clear").click()
    assert len(visible(browser)) == 45
    browser.open("#/cases?f=can.drop&v=passed")
    dropped = {
        case.identifier
        for case in run.cases
        if case.verdict is Verdict.PASSED and any(fault.kind == "can.drop" for fault in case.faults)
    }
    browser.until(lambda: set(visible(browser)) == dropped, "the address did not narrow the list")
    browser.open("#/cases?q=nothing-like-this")
    assert visible(browser) == []
    assert browser.one("#no-match").is_displayed()


def test_list_sorts_by_each_column(browser, run):
    """A head sorts, a second click turns it round; the order survives in the address."""
    browser.one("[data-sort=w]").click()
    slowest = max(run.cases, key=lambda case: case.wall_s).identifier
    assert visible(browser)[-1] == slowest
    browser.one("[data-sort=w]").click()
    assert visible(browser)[0] == slowest
    assert "o=-w" in browser.driver.current_url
    browser.one("[data-sort=n]").click()
    assert visible(browser) == sorted(visible(browser))


def test_list_and_case_work_from_the_keyboard(browser):
    """Slash searches, arrows walk, Enter opens, brackets step through the list, Escape leads back to the same
    row.
    """
    browser.one("body").send_keys("/")
    active = browser.driver.switch_to.active_element
    assert active.get_attribute("id") == "f-q"
    active.send_keys("stop-modes", browser.keys.ARROW_DOWN)
    first, second = visible(browser)[:2]
    assert browser.driver.switch_to.active_element.text == first
    browser.driver.switch_to.active_element.send_keys(browser.keys.ARROW_DOWN)
    browser.driver.switch_to.active_element.send_keys(browser.keys.ENTER)
    browser.plot()
    assert browser.one(".case-head .id").text == second
    browser.one("body").send_keys("[")
    browser.until(lambda: browser.one(".case-head .id").text == first, "the previous case did not open")
    browser.plot()
    browser.one("body").send_keys(browser.keys.ESCAPE)
    browser.until(lambda: browser.one("#view-cases").is_displayed(), "no way back")
    assert browser.driver.switch_to.active_element.text == first
    assert browser.one("#f-q").get_attribute("value") == "stop-modes"


def test_failed_case_explains_itself(browser, run):
    """Headline, expected against observed, margin, timeline, alarm, fault and replay command stand on the
    page.
    """
    case = next(case for case in run.cases if case.identifier == FAILED)
    browser.one(f"a[href='#/case/{FAILED}']").click()
    browser.plot()
    assert browser.one(".case-head h1").text == "Alarm 521 expected within 20 ms, came after 48 ms"
    first = browser.all(".checks tbody tr")[0].text
    for words in (
        "failed",
        "within 20 ms",
        "came after 48 ms",
        "28 ms over the limit",
        "+48.0 ms",
        "STP-343",
    ):
        assert words in first
    story = [item.text for item in browser.all(".story li")]
    assert len(story) == len(case.story)
    assert any(
        "inject" in item and "encoder.freeze on drive1" in item and "+0.00 ms" in item for item in story
    )
    assert browser.one(".replay code").text == f"hil replay {case.token}"
    browser.one("#tab-faults").click()
    cards = [card.text for card in browser.all(".card")]
    assert "Alarm 521 on axis1" in cards[1]
    assert "0.8000 s" in cards[0]
    browser.one("#tab-evidence").click()
    assert case.trace_digest in browser.one("#panel-evidence").text
    links = [link.get_attribute("href") for link in browser.all("#panel-evidence a")]
    assert any(unquote(link).endswith("/evidence/alarm-521/encoder.freeze/motion/can0.log") for link in links)


def test_curves_are_the_recorded_samples(browser, run):
    """What the browser decodes and draws is what was recorded, to a millionth of the range."""
    case = next(case for case in run.cases if case.identifier == FAILED)
    browser.open(f"#/case/{FAILED}")
    browser.plot()
    drawn = browser.js(
        "return document.querySelector('.plot').plot.visible().map((curve) => [[...curve.x], "
        "[...curve.values]])"
    )
    names = [button.get_attribute("title").partition(":")[0] for button in browser.all(".panel-head button")]
    assert len(drawn) == len(names) >= 6
    recorded = {signal.name: signal for signal in case.signals}
    for name, (times, values) in zip(names, drawn, strict=True):
        signal = recorded[name]
        assert len(values) == len(signal.values)
        assert np.abs(np.array(times) - signal.time_s).max() < 1e-6
        assert np.abs(np.array(values) - signal.values).max() <= 1.01e-6 * np.ptp(signal.values)


def test_dragging_zooms_all_panels_and_double_click_returns(browser):
    """A drag across the plot narrows the time range for every panel and lane; the address keeps it."""
    browser.open(f"#/case/{FAILED}")
    browser.plot()
    whole = browser.range()
    lanes = browser.js("return document.querySelector('.overlay').innerHTML")
    surface = browser.surface()
    browser.actions().move_to_element_with_offset(surface, 40, 0).click_and_hold().move_by_offset(
        60, 0
    ).move_by_offset(60, 0).release().perform()
    browser.until(
        lambda: browser.range()[1] - browser.range()[0] < 0.5 * (whole[1] - whole[0]), "the drag did not zoom"
    )
    assert browser.js("return document.querySelector('.overlay').innerHTML") != lanes
    assert "z=" in browser.driver.current_url
    zoomed = browser.range()
    browser.open(browser.driver.current_url.partition(".html")[2])
    browser.plot()
    assert browser.range() == pytest.approx(zoomed, abs=1e-5)
    browser.actions().double_click(browser.surface()).perform()
    browser.until(
        lambda: browser.range() == pytest.approx(whole), "the double click did not show the whole case"
    )


def test_wheel_zooms_around_the_pointer_and_resizing_breaks_nothing(browser):
    """The moment under the pointer stays where it is; after the window went narrow and wide again zooming
    still works.
    """
    from selenium.webdriver.common.actions.wheel_input import ScrollOrigin

    browser.open(f"#/case/{FAILED}")
    browser.plot()
    for width in (800, 1440):
        browser.view(width, 900, "light")
        browser.until(
            lambda size=width: (
                abs(browser.one(".curve canvas").rect["width"] - browser.one(".plot").rect["width"]) < 2
                and browser.one(".plot").rect["width"] <= size
            ),
            "the plot did not follow the window",
        )
    surface = browser.surface()
    before = browser.range()
    origin = ScrollOrigin.from_element(surface, 100, 0)
    browser.actions().scroll_from_origin(origin, 0, -400).perform()
    browser.until(
        lambda: browser.range()[1] - browser.range()[0] < 0.8 * (before[1] - before[0]),
        "the wheel did not zoom",
    )
    left, width = surface.rect["x"], surface.rect["width"]
    share = (surface.rect["x"] + width / 2 + 100 - left) / width
    after = browser.range()
    assert after[0] + share * (after[1] - after[0]) == pytest.approx(
        before[0] + share * (before[1] - before[0]), abs=0.01
    )
    before = after
    lanes = browser.js("return document.querySelector('.overlay').innerHTML")
    browser.actions().move_to_element_with_offset(surface, -100, 0).click_and_hold().move_by_offset(
        100, 0
    ).move_by_offset(60, 0).release().perform()
    browser.until(
        lambda: browser.range()[1] - browser.range()[0] < 0.6 * (before[1] - before[0]),
        "the drag did not zoom",
    )
    assert browser.js("return document.querySelector('.overlay').innerHTML") != lanes


def test_click_on_a_check_jumps_the_plot(browser):
    """The plot zooms to the judged interval and puts the cursor on the moment; values at it are shown."""
    browser.open(f"#/case/{FAILED}")
    browser.plot()
    browser.one(".checks tr[data-check='2'] button").click()
    start, end = browser.range()
    assert 0.6 < start < 0.848
    assert 1.147 < end < 1.4
    assert "1.1470 s" in browser.one(".readout").text
    browser.one(".checks tr[data-check='0'] button").click()
    start, end = browser.range()
    assert 0.75 < start < 0.8
    assert 0.848 < end < 0.9
    assert browser.one(".cursor.locked").is_displayed()
    values = [output.text for output in browser.all(".panel-head output")]
    assert all(values)
    assert "t=0.848" in browser.driver.current_url


def test_bus_messages_and_plot_follow_each_other(browser):
    """Error frames stand out; a click on a message moves the cursor, a click in the plot marks the
    message.
    """
    browser.open("#/case/bus-faults/can.drop/tpdo1/x8?tab=bus")
    browser.plot()
    broken = browser.all(".bus tr.err")
    assert len(broken) == 8
    assert "dropped by fault can.drop" in broken[0].text
    assert "can.drop on can0:0x181 applied" in browser.one(".bus tr.event.fault").text
    broken[3].click()
    assert float(
        browser.js("return new URLSearchParams(location.hash.split('?')[1]).get('t')")
    ) == pytest.approx(0.812178)
    assert browser.all(".bus tr.now")[0].text == broken[3].text
    surface = browser.surface()
    browser.actions().move_to_element_with_offset(surface, -200, 0).click().perform()
    moment = float(browser.js("return new URLSearchParams(location.hash.split('?')[1]).get('t')"))
    assert moment < 0.8
    marked = browser.all(".bus tr.now")
    assert not marked or float(marked[0].get_attribute("data-t")) <= moment
    browser.one(".bus-tools input[type=checkbox]").click()
    assert len(browser.all(".bus tr:not(.event)")) == 8


def test_plot_obeys_the_keyboard_and_signals_can_be_chosen(browser):
    """Arrows move the cursor, plus zooms, 0 returns; a ticked signal gets its panel or lane."""
    browser.open(f"#/case/{FAILED}")
    browser.plot()
    plot = browser.one(".plot")
    before = browser.range()
    plot.send_keys("+")
    assert browser.range()[1] - browser.range()[0] < before[1] - before[0]
    plot.send_keys("0")
    assert browser.range() == pytest.approx(before)
    moment = browser.one(".cursor.locked").text
    plot.send_keys(browser.keys.ARROW_RIGHT)
    assert browser.one(".cursor.locked").text != moment
    panels = len(browser.all(".panel-head"))
    browser.one(".menu summary").click()
    choices = {label.text.split()[0]: label for label in browser.all(".menu label")}
    choices["Acceleration"].click()
    choices["drive1.statusword"].click()
    assert len(browser.all(".panel-head")) == panels + 1
    assert "0637h" in browser.js("return document.querySelector('.overlay').textContent")


def test_states_faults_alarms_and_limits_are_drawn(browser):
    """Lanes name the states, events name fault and alarm, a measured level has its limits in the plot."""
    browser.open("#/case/alarm-reactions/alarm-531/switch.positive_limit/motion")
    browser.plot()
    text = browser.js("return document.querySelector('.overlay').textContent")
    for words in (
        "MOTION",
        "ALARM_DRIVE_STOP",
        "Operation enabled",
        "switch.positive_limit → drive1",
        "531 Hardware limit switch reached",
        "-1 … 1 mm/s",
        "standstill velocity",
    ):
        assert words in text


def test_another_case_lies_under_the_curves(browser):
    """Values of the other run stand in brackets, aligned on fault or start; the address keeps both."""
    other = "alarm-reactions/alarm-521/encoder.freeze/halting"
    browser.open(f"#/case/{FAILED}")
    browser.plot()
    browser.js(
        "const pick = document.querySelector('.pick-run'); pick.value = 'case ' + arguments[0]; "
        "pick.dispatchEvent(new Event('change'))",
        other,
    )
    browser.until(
        lambda: browser.js("return document.querySelector('.plot').plot.other !== null"), "no other run"
    )
    assert "(" in browser.one(".panel-head output").text
    assert browser.js("return document.querySelector('.plot').plot.panels[0].ghosts[0].x.length") > 300
    align = next(button for button in browser.all(".tool") if button.text == "Aligned on the fault")
    align.click()
    browser.until(lambda: align.text == "Aligned on the start", "the alignment did not change")
    address = browser.driver.current_url.partition(".html")[2]
    assert "by=start" in address
    browser.open(address)
    browser.until(
        lambda: browser.js("return document.querySelector('.plot')?.plot.other"), "the address lost it"
    )
    assert browser.js("return document.querySelector('.plot').plot.other.data.id") == other


def test_visible_signals_become_a_table(browser, run, tmp_path):
    """The file has the visible curves with their units and the states, for the visible time alone."""
    browser.driver.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    browser.open(f"#/case/{FAILED}?z=0.7,0.9")
    browser.plot()
    next(button for button in browser.all(".tool") if button.text == "CSV").click()
    (table,) = browser.until(lambda: list(tmp_path.glob("*.csv")), "no table was saved")
    browser.until(lambda: table.stat().st_size > 1000, "the table is empty")
    with table.open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head[:2] == ["time [s]", "axis1.position_setpoint [mm]"]
    assert "axis1.state" in head
    times = [float(row[0]) for row in rows]
    assert times == sorted(times)
    assert 0.7 <= times[0] <= times[-1] <= 0.9
    case = next(case for case in run.cases if case.identifier == FAILED)
    signal = next(one for one in case.signals if one.name == "axis1.position_setpoint")
    first = next(row for row in rows if row[1])
    at = int(np.abs(signal.time_s - float(first[0])).argmin())
    assert float(first[1]) == pytest.approx(signal.values[at], rel=1e-5)


def test_labels_do_not_overlap_in_a_narrow_window(browser):
    """At 420 px heads are above their curves, lanes have whole names, texts keep clear of each other."""
    browser.view(420, 900, "light")
    browser.open(f"#/case/{FAILED}")
    browser.plot()
    overlapping = browser.js("""
        const all = ".overlay text, .ground text, .panel-head > *, .cursor i";
        const texts = [...document.querySelectorAll(all)]
          .filter((node) => node.checkVisibility({ visibilityProperty: true }) && node.textContent.trim());
        const boxes = texts.map((node) => [node.textContent, node.getBoundingClientRect()]);
        return boxes.flatMap(([one, a], i) => boxes.slice(i + 1)
          .filter(([, b]) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
            && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 3)
          .map(([other]) => `${one} | ${other}`));
    """)
    assert overlapping == []
    words = browser.js(
        "return [...document.querySelectorAll('.overlay text')].map((node) => node.textContent)"
    )
    assert {"axis1.state", "drive1.state"} <= set(words)


def test_picture_can_be_saved(browser, tmp_path):
    """The button gives a PNG of what is visible, made without a network."""
    browser.driver.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    browser.open(f"#/case/{FAILED}")
    browser.plot()
    next(button for button in browser.all(".tool") if button.text == "Save picture").click()
    (picture,) = browser.until(lambda: list(tmp_path.glob("*.png")), "no picture was saved")
    browser.until(lambda: picture.stat().st_size > 20_000, "the picture is empty")
    assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_coverage_leads_to_its_cases(browser):
    """A cell of the matrix opens the list with just its cases, and the filter says why."""
    browser.open("#/coverage")
    cell = next(
        cell
        for cell in browser.all(".cell")
        if cell.get_attribute("title").startswith("encoder.freeze, remove enable")
    )
    assert "1 failed, 1 passed" in cell.get_attribute("title")
    cell.click()
    browser.until(lambda: browser.one("#view-cases").is_displayed(), "the list did not open")
    assert set(visible(browser)) == {FAILED, "alarm-reactions/alarm-521/encoder.freeze/halting"}
    assert "reaction: remove enable" in browser.one("#filters .token").text


def test_requirements_filter(browser):
    """Failed requirements come first; search, family and verdict narrow the matrix; rows lead to cases."""
    browser.open("#/requirements")
    verdicts = [cell.text for cell in browser.all("#r-rows td:first-child")]
    assert verdicts[0] == "failed"
    assert verdicts == sorted(verdicts, key=["failed", "error", "blocked", "passed", "untested"].index)
    browser.one("#r-q").send_keys("stp-343")
    assert [row.text for row in browser.all("#r-rows td:nth-child(2)")] == ["STP-343"]
    browser.one("#r-rows a").click()
    browser.plot()
    assert browser.one(".case-head .id").text == FAILED
    browser.open("#/requirements?v=unknown")
    assert [row.text for row in browser.all("#r-rows td:nth-child(2)")] == ["STP-498"]


def test_cases_without_signals_and_unknown_cases_say_so(browser):
    """A blocked case gives its reason; a link to a case of another run is answered, not ignored."""
    browser.open("#/case/bus-faults/can.corrupt/tpdo1/x8")
    assert "cannot send error frames" in browser.one(".case-head h1").text
    assert "No signal was recorded" in browser.one(".plot-pane").text
    browser.open("#/case/no/such")
    assert "This run has no case no/such" in browser.one("#view-case").text


def test_hostile_texts_do_nothing(browser, hostile_report):
    """Every view of a run full of markup and scripts shows texts and executes nothing."""
    cases = hostile_run().cases
    browser.open("", hostile_report)
    for index in range(len(cases)):
        browser.go("#/cases")
        browser.until(lambda: browser.one("#view-cases").is_displayed(), "the list did not open")
        browser.all("#cases tbody a.id")[index].click()
        browser.plot()
        for tab in ("bus", "faults", "evidence"):
            browser.one(f"#tab-{tab}").click()
        assert browser.js("return window.pwned") is None
        assert (
            browser.js("return document.querySelectorAll('.case script, .case img, .case iframe').length")
            == 0
        )
    for view in ("coverage", "requirements", "run"):
        browser.go(f"#/{view}")
        assert browser.one(f"#view-{view}").is_displayed()
        assert browser.js("return window.pwned") is None


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 800])
def test_layout_fits_the_window(browser, width, scheme, tmp_path):
    """Nothing makes the page scroll sideways, in the list and in a case, wide and narrow, light and dark."""
    browser.view(width, 900, scheme)
    for address in (
        "",
        f"#/case/{FAILED}",
        f"#/case/{FAILED}?tab=bus",
        "#/coverage",
        "#/requirements",
        "#/run",
    ):
        browser.go(address)
        if "case/" in address:
            browser.plot()
        assert browser.js("return document.documentElement.scrollWidth") <= width, address
        assert browser.driver.save_screenshot(str(tmp_path / "view.png"))
    ground = browser.js("return getComputedStyle(document.body).backgroundColor")
    assert ground == ("rgb(245, 246, 248)" if scheme == "light" else "rgb(16, 19, 23)")


def test_printing_shows_everything_of_a_case_in_light_colours(browser):
    """On paper: plot, checks, story, faults and evidence one below the other on two pages, no controls."""
    browser.view(1440, 900, "dark")
    browser.open(f"#/case/{FAILED}")
    browser.plot()
    browser.js("dispatchEvent(new Event('beforeprint'))")
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert browser.js("return getComputedStyle(document.body).color") == "rgb(22, 25, 29)"
    for panel in ("checks", "faults", "evidence"):
        assert browser.one(f"#panel-{panel}").is_displayed()
    assert not browser.one(".toolbar").is_displayed()
    assert browser.one(".plot").rect["width"] <= 718
    browser.js("dispatchEvent(new Event('afterprint'))")
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert browser.one(".toolbar").is_displayed()
    options = {"preferCSSPageSize": True, "printBackground": True}
    paper = base64.b64decode(browser.driver.execute_cdp_cmd("Page.printToPDF", options)["data"])
    assert len(re.findall(rb"/Type\s*/Page\b", paper)) == 2


def test_stepping_through_cases_leaves_one_plot(browser):
    """A case that is left takes its plot along: no pile of them, and nothing else is loaded."""
    browser.open(f"#/case/{FAILED}")
    browser.plot()
    for _ in range(5):
        here = browser.one(".case-head .id").text
        browser.one("body").send_keys("]")
        browser.until(
            lambda name=here: browser.one(".case-head .id").text != name, "the next case did not open"
        )
        time.sleep(0.05)
    assert len(browser.all(".plot")) <= 1
    assert browser.js("return document.querySelectorAll('head script').length") == 0
