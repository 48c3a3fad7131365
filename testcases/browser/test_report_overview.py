"""Overview, coverage by ways to stop, and what a screen reader gets of every view."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from reports import RunResult, Verdict, remember, write_report
from testcases.sample_run import sample_run

pytestmark = pytest.mark.browser

FAILED = "alarm-reactions/alarm-521/encoder.freeze/motion"
VIEWS = (
    "#/cases",
    f"#/case/{FAILED}",
    f"#/case/{FAILED}?tab=bus",
    "#/overview",
    "#/coverage",
    "#/requirements",
    "#/run",
)

AUDIT = """
const visible = (node) => node.checkVisibility({ checkVisibilityCSS: true }) && node.getClientRects().length > 0;
const said = [];
const name = (node) => (node.getAttribute("aria-label") || (node.getAttribute("aria-labelledby") || "").split(" ").map((id) => document.getElementById(id)?.textContent).join(" ").trim()
  || [...(node.labels || [])].map((label) => label.textContent).join(" ").trim() || node.textContent.trim() || node.title || "").trim();
for (const node of document.querySelectorAll("a[href], button, input, select, textarea, [role=tab], [role=img], [tabindex='0']"))
  if (visible(node) && !name(node)) said.push("no name: " + node.outerHTML.slice(0, 120));
for (const table of document.querySelectorAll("table"))
  if (visible(table) && table.querySelector("thead") && !table.caption) said.push("no caption: " + table.className);
for (const th of document.querySelectorAll("thead th, tbody th")) if (visible(th) && !th.scope && !th.closest(".facts")) said.push("no scope: " + th.outerHTML.slice(0, 90));
for (const node of document.querySelectorAll("[role=tab]")) if (!document.getElementById(node.getAttribute("aria-controls"))) said.push("tab without panel");
const heads = [...document.querySelectorAll("h1, h2, h3")].filter(visible).map((node) => Number(node.tagName[1]));
if (heads[0] !== 1) said.push("the first heading is no h1");
heads.forEach((level, i) => { if (i && level > heads[i - 1] + 1) said.push("a heading level is left out"); });
const ids = [...document.querySelectorAll("[id]")].map((node) => node.id);
for (const id of new Set(ids)) if (ids.filter((one) => one === id).length > 1) said.push("id twice: " + id);
if (document.querySelectorAll("main").length !== 1 || !document.documentElement.lang || !document.title) said.push("no main, language or title");

// Contrast of every visible text against the first opaque ground behind it (WCAG 2 AA).
const parse = (colour) => { const found = colour.match(/[\\d.]+/g).map(Number); return found.length < 4 ? [...found, 1] : found; };
const light = ([r, g, b]) => [r, g, b].map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)).reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
for (let text = walker.nextNode(); text; text = walker.nextNode()) {
  const node = text.parentElement;
  if (!text.data.trim() || !visible(node) || node.closest("svg, script, .sr, option, [aria-disabled=true], .plot")) continue;
  let ground = node, drawn = false, fade = 1;
  for (let up = node; up; up = up.parentElement) fade *= Number(getComputedStyle(up).opacity);
  if (fade < 1) continue;
  while (ground && !drawn) {
    const style = getComputedStyle(ground);
    if (style.backgroundImage !== "none") break;
    drawn = parse(style.backgroundColor)[3] === 1;
    if (!drawn) ground = ground.parentElement;
  }
  if (!drawn) continue;
  const [a, b] = [light(parse(getComputedStyle(node).color)), light(parse(getComputedStyle(ground).backgroundColor))].sort((x, y) => y - x);
  if ((a + 0.05) / (b + 0.05) < 4.5) said.push(`contrast ${((a + 0.05) / (b + 0.05)).toFixed(2)}: ${node.className} ${text.data.slice(0, 40)}`);
}
return [...new Set(said)];
"""  # noqa: E501


@pytest.fixture(scope="module")
def run() -> RunResult:
    return sample_run(samples=200)


@pytest.fixture(scope="module")
def report(run, tmp_path_factory) -> Path:
    """The second run of a history: one case was good before, one was bad; two defects were seeded."""
    folder = tmp_path_factory.mktemp("overview")
    before = dataclasses.replace(
        run, started="2026-01-12T09:00:00+01:00", cases=[dataclasses.replace(case) for case in run.cases]
    )
    for case in before.cases:
        if case.identifier == FAILED:
            case.verdict = Verdict.PASSED
        elif case.identifier == "fuzz/seed-4100":
            case.verdict = Verdict.FAILED
            case.simulated_s = 2.0
    remember(before, folder / "history.sqlite")
    seeded = [
        {
            "name": "ramp-halved",
            "title": "OFF3 brakes half as hard",
            "area": "drive",
            "caught_by": [f"{FAILED}@reference"],
            "seconds": 1.5,
        },
        {"name": "sign-lost", "caught_by": [], "seconds": 2},
    ]
    (folder / "mutants.json").write_text(json.dumps(seeded))
    return write_report(run, folder, background=remember(run, folder / "history.sqlite")).report


def names(browser) -> list[str]:
    return browser.js(
        "return [...document.querySelectorAll('#cases tbody a.id')].map((link) => link.textContent)"
    )


def test_overview_leads_to_what_has_changed(browser, report):
    """What is new since the last run is counted, named with its reason, and one click away in the list."""
    browser.open("#/overview", report)
    text = browser.one("#view-overview").text
    for words in (
        "1 new failure",
        "1 fixed",
        "4 still failing",
        "1 drifted numbers",
        "simulated time",
        "1 of 2 noticed",
    ):
        assert words in text
    assert len(browser.all(".trend g")) == 2
    browser.one("a[href='#/cases?c=new+failure']").click()
    browser.until(lambda: names(browser) == [FAILED], "the list shows other cases")
    assert browser.one("#f-c").get_attribute("value") == "new failure"
    assert browser.one("#cases .change").text == "new failure"
    browser.open("#/overview", report)
    browser.one(f".defects a[href='#/case/{FAILED}']").click()
    browser.until(lambda: browser.all(".case-head .id"), "the case did not open")


def test_coverage_of_one_way_to_stop(browser, run, tmp_path):
    """The matrix of reactions is shown for all cases or for one way to stop; the address keeps it, a cell
    filters by both.
    """
    cases = [dataclasses.replace(case) for case in run.cases]
    mode = "MC_Stop Mode 3"
    chosen = [case for case in cases if any(fault.kind == "encoder.freeze" for fault in case.faults)]
    for case in chosen:
        first, *rest = case.story
        case.story = [dataclasses.replace(first, kind="do", text=mode), *rest]
    report = write_report(dataclasses.replace(run, cases=cases), tmp_path).report
    browser.open("#/coverage", report)
    whole = len([row for row in browser.all("#view-coverage .matrix tbody tr") if row.is_displayed()])
    browser.js(
        "const s = document.querySelector('#m-stop'); s.value = arguments[0]; s.dispatchEvent(new "
        "Event('change'))",
        mode,
    )
    shown = [row for row in browser.all("#view-coverage .matrix tbody tr") if row.is_displayed()]
    assert len(shown) == 1 < whole
    browser.open("#/coverage?m=MC_Stop+Mode+3", report)
    cell = next(cell for cell in browser.all("#view-coverage .cell") if cell.is_displayed())
    cell.click()
    browser.until(lambda: browser.one("#view-cases").is_displayed(), "the list did not open")
    assert names(browser)
    assert set(names(browser)) <= {case.identifier for case in chosen}
    assert browser.one("#f-m").get_attribute("value") == mode


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_view_can_be_read_without_seeing_colours_or_shapes(browser, report, scheme):
    """Controls have names, tables captions and scopes, headings an order, identifiers are unique, texts have
    contrast.
    """
    browser.view(1440, 900, scheme)
    browser.open("", report)
    for address in VIEWS:
        browser.go(address)
        if "case/" in address:
            browser.plot()
        assert browser.js(AUDIT) == [], address


def test_no_view_is_wider_than_a_telephone(browser, report):
    """At 420 pixels wide tables scroll in themselves, the page does not."""
    browser.view(420, 800, "light")
    browser.open("", report)
    for address in VIEWS:
        browser.go(address)
        fits = "return document.documentElement.scrollWidth <= document.documentElement.clientWidth"
        browser.until(lambda program=fits: browser.js(program), f"{address or 'the list'} is too wide", 5)


def test_the_audit_notices_what_it_looks_for(browser):
    """A button without a name, a text too faint, a table without a caption, an identifier used twice."""
    browser.js(
        "document.querySelector('#view-cases').insertAdjacentHTML('beforeend', '<button></button><p "
        'style="color: #aaa">faint</p>\''
        "+ '<table><thead><tr><th>x</th></tr></thead></table><i "
        'id="main"></i><h4>deep</h4><h3>deeper</h3>\')'
    )
    found = " ".join(browser.js(AUDIT))
    for words in (
        "no name: <button>",
        "faint",
        "no caption",
        "no scope",
        "id twice: main",
        "a heading level is left out",
    ):
        assert words in found
