"""The run as a table, as markdown, and the table of seeded defects."""

from __future__ import annotations

import csv
import dataclasses
import json
import re
from html.parser import HTMLParser

import pytest

from reports import (
    AlarmRecord,
    CaseResult,
    FaultRecord,
    RunResult,
    Step,
    Verdict,
    load_seeding,
    markdown_summary,
    remember,
    write_cases,
    write_report,
)
from reports.coverage import NO_FAULT, fault_stop_matrix, stop_modes

pytestmark = pytest.mark.exhaustive


def test_table_has_a_row_per_case(run, hostile, tmp_path):
    """Whatever the texts hold, a reader of CSV gets every case back, and no cell begins a formula."""
    for what in (run, hostile):
        with write_cases(what, tmp_path / "cases.csv").open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        assert [row["verdict"] for row in rows] == [case.verdict.value for case in what.cases]
        assert not any(value[:1] in "=+-@\t\r" for row in rows for value in row.values() if value)
    with write_cases(run, tmp_path / "cases.csv").open(encoding="utf-8", newline="") as stream:
        row = next(
            row for row in csv.DictReader(stream) if row["identifier"].endswith("encoder.freeze/motion")
        )
    assert (row["faults"], row["alarms"], row["reactions"]) == (
        "encoder.freeze on drive1",
        "521",
        "remove enable",
    )
    assert (row["headline"], row["checks_failed"]) == (
        "Alarm 521 expected within 20 ms, came after 48 ms",
        "2",
    )
    assert float(row["simulated_s"]) == 1.5


def test_formulas_are_disarmed(tmp_path):
    """A spreadsheet shows the text and computes nothing."""
    case = CaseResult("=1+1", "@SUM(A1)", Verdict.FAILED, "-2", tags=["+x"])
    text = write_cases(RunResult("t", 1, "b", "", {}, "", [case]), tmp_path / "c.csv").read_text("utf-8")
    assert text.splitlines()[1].startswith("'=1+1,'@SUM(A1),,failed,'-2,'+x")


def test_markdown_says_what_a_reviewer_needs(run, tmp_path):
    """Totals, each failed case with reason and replay command, and what is new or fixed against before."""
    remember(run, tmp_path / "h.sqlite")
    again = remember(dataclasses.replace(run, started="later"), tmp_path / "h.sqlite").comparison
    text = markdown_summary(run, again, report="hil-report/report.html")
    assert text.startswith("## ❌ Stop modes and alarm reactions: 4 failed, 1 error, 2 blocked, 38 passed\n")
    assert "| 4 | 1 | 2 | 38 |" in text
    assert "**failed**: Alarm 521 expected within 20 ms, came after 48 ms" in text
    for case in run.cases:
        bad = case.verdict in {Verdict.FAILED, Verdict.ERROR}
        assert (f"  hil replay {case.token}\n" in text) == bad
        assert (f"* `{case.identifier}` **" in text) == bad
    assert "* **5 still failing**: `" in text
    assert "new failure" not in text
    assert "No earlier result" in markdown_summary(run, remember(run, tmp_path / "new.sqlite").comparison)


def test_markdown_of_hostile_texts_stays_text(hostile):
    """No tag, link, mention or heading of a run's text becomes one; a fence cannot be closed from within."""
    for index, case in enumerate(hostile.cases):
        case.verdict, case.token = Verdict.FAILED, "```\n<script>" if index % 2 else "x"
    text = markdown_summary(hostile)
    outside = re.sub(r"(?ms)^  (`{3,})sh\n.*?^  \1$", "", text)
    outside = re.sub(r"(`+)(?!`).*?(?<!`)\1(?!`)", "", outside)
    assert not re.search(r"(?<!\\)[<>@\[\]]", outside), outside
    assert not re.search(r"^#(?!#)", outside.replace("## ❌", "").replace("### Failed", ""), re.MULTILINE)


def test_markdown_of_thousands_of_failures_is_short():
    """GitHub takes a megabyte: fifty failed cases are listed, the others counted."""
    cases = [CaseResult(f"c{n}", "", Verdict.FAILED, "broke", token="x" * 300) for n in range(3000)]
    text = markdown_summary(RunResult("t", 1, "b", "", {}, "", cases))
    assert len(text) < 50_000
    assert "* and 2950 more" in text


class Words(HTMLParser):
    """Texts and links of a part of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.links: list[str] = []
        self.feed(text)

    def handle_data(self, data):
        self.words.append(data)

    def handle_starttag(self, tag, attrs):
        if tag == "a":
            self.links.append(dict(attrs)["href"])


def overview_of(page) -> Words:
    text = page.read_text("utf-8")
    return Words(text[text.index('<section id="view-overview"') : text.index('<section id="view-coverage"')])


def test_overview_tells_changes_trend_and_seeded_defects(run, tmp_path):
    """After a second run: bars and rows of both, the case that is new, a link to the list; defects with who
    noticed.
    """
    good = RunResult(**{name: getattr(run, name) for name in vars(run)})
    good.cases = [case for case in run.cases if case.verdict is Verdict.PASSED]
    (tmp_path / "mutants.json").write_text(
        json.dumps(
            [
                {"name": "ramp-halved", "caught_by": [good.cases[0].identifier], "seconds": 1.5},
                {"name": "sign-lost", "title": "<b>", "caught_by": [], "seconds": 2},
            ]
        )
    )
    remember(good, tmp_path / "h.sqlite")
    words = overview_of(write_report(run, tmp_path, background=remember(run, tmp_path / "h.sqlite")).report)
    text = " ".join(" ".join(words.words).split())
    assert "5 new failure" in text
    assert "#/cases?c=new+failure" in words.links
    assert "Run 1: 38 passed" in text
    assert "Run 2: 4 failed, 1 error, 2 blocked, 38 passed" in text
    assert "1 of 2 noticed" in text
    assert "survived sign-lost <b>" in text
    assert text.index("sign-lost") < text.index("ramp-halved"), "what nobody noticed comes first"


def test_overview_without_history_says_so(run, tmp_path):
    """No history, no seeding: groups and slowest cases are there, and the page does not pretend a trend."""
    words = overview_of(write_report(run, tmp_path).report)
    text = " ".join(words.words)
    assert "there is no trend" in text
    assert "Seeded defects" not in text
    assert "#/cases?g=stop-modes" in words.links


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ("{", "mutants.json: "),
        ("[1]", "1 is not an object"),
        ('{"a": 1}', "has no 'mutants'"),
        ('[{"name": "x"}]', "has no 'caught_by'"),
        ('{"mutants": 5}', "not a list"),
    ],
)
def test_unreadable_seeding_is_said_in_the_report(run, tmp_path, content, error):
    """A damaged file costs the table, not the report."""
    (tmp_path / "mutants.json").write_text(content)
    assert error in load_seeding(tmp_path).error
    assert error.replace("'", "&#39;") in write_report(run, tmp_path).report.read_text("utf-8")


def test_seeding_in_full_and_none(tmp_path):
    """The object with more keys is read as well as the list; without a file there is none."""
    assert load_seeding(tmp_path) is None
    entry = {
        "name": "a",
        "title": "t",
        "area": "axis",
        "status": "explained",
        "caught_by": [],
        "explained": "nobody can",
        "seconds": 0.5,
    }
    (tmp_path / "mutants.json").write_text(json.dumps({"mutants": [entry], "caught": 0}))
    (defect,) = load_seeding(tmp_path).defects
    assert (defect.status, defect.area, defect.remark, defect.seconds) == (
        "explained",
        "axis",
        "nobody can",
        0.5,
    )


def test_ways_to_stop_are_read_from_the_story():
    """Withdrawn enable and stop with their modes, halt, and nothing; only what was done counts."""
    case = CaseResult("c", "", Verdict.PASSED)
    assert stop_modes(case) == ["no stop command"]
    texts = [
        "MC_Power Enable = TRUE, StartMode 1",
        "MC_Power Enable = FALSE, StopMode 2",
        "MC_Stop Mode 3",
        "MC_Halt",
        "MC_Stop Mode 3",
    ]
    case.story = [Step(0.0, "do", text) for text in texts] + [Step(1.0, "observe", "MC_Stop Mode 0")]
    assert stop_modes(case) == ["MC_Power StopMode 2", "MC_Stop Mode 3", "MC_Halt"]
    case.faults = [FaultRecord("can.drop", "can0", 0.0, 0.5, None)]
    case.alarms = [AlarmRecord(0.6, "axis1", 431, 4, "")]
    plain = CaseResult("d", "", Verdict.FAILED)
    matrix = fault_stop_matrix(RunResult("t", 1, "b", "", {}, "", [case, plain]))
    assert matrix.cell("can.drop", "MC_Stop Mode 3").notes == ["431"]
    assert matrix.cell(NO_FAULT, "no stop command").verdict is Verdict.FAILED
    assert matrix.cell("can.drop", "MC_Stop Mode 0").verdict is None
    assert "MC_Power StopMode 0" in matrix.columns, "what was never tried is shown"
