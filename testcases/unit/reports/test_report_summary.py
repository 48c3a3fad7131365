"""The summary that machines read."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import subprocess
import sys

import pytest

import reports
from reports import CaseResult, RunResult, Verdict, run_digest, summary, write_report, write_summary

pytestmark = pytest.mark.exhaustive


def test_summary_has_exactly_the_agreed_keys(run):
    """Whoever parses the summary finds these keys, and no others."""
    assert summary(run, report="r.html", junit="j.xml") == {
        "passed": 38,
        "failed": 4,
        "blocked": 2,
        "errors": 1,
        "report": "r.html",
        "junit": "j.xml",
        "seed": 20260113,
        "trace_digest": hashlib.sha256("".join(case.trace_digest for case in run.cases).encode()).hexdigest(),
    }
    assert list(summary(run)) == [
        "passed",
        "failed",
        "blocked",
        "errors",
        "report",
        "junit",
        "seed",
        "trace_digest",
    ]


def test_digest_depends_on_traces_and_their_order(run):
    """A changed trace or another order of cases is another digest; verdicts and times are not part of it."""
    turned = dataclasses.replace(run, cases=run.cases[::-1])
    slower = dataclasses.replace(
        run, cases=[dataclasses.replace(case, wall_s=9.0, verdict=Verdict.ERROR) for case in run.cases]
    )
    assert run_digest(turned) != run_digest(run)
    assert run_digest(slower) == run_digest(run)


def test_summary_file_is_strict_json_and_names_the_reason(run, tmp_path):
    """summary.json holds the short summary and one line per case with its headline."""
    path = write_summary(run, tmp_path / "deep" / "summary.json", report="a", junit="b")
    plain = json.loads(path.read_text("ascii"), parse_constant=no_json)
    assert {name: plain[name] for name in summary(run, report="a", junit="b")} == summary(
        run, report="a", junit="b"
    )
    assert plain["state"] == "failed"
    lines = {case["identifier"]: case["headline"] for case in plain["cases"]}
    assert (
        lines["alarm-reactions/alarm-521/encoder.freeze/motion"]
        == "Alarm 521 expected within 20 ms, came after 48 ms"
    )
    assert plain["requirements"]["STP"]["untested"] > 0


def no_json(word: str) -> None:
    raise AssertionError(f"{word} is no JSON")


def test_times_that_are_no_numbers_become_null(tmp_path):
    """A case without a meaningful duration does not spoil the file."""
    run = RunResult("t", 1, "b", "", {}, "", [CaseResult("c", "", Verdict.PASSED, simulated_s=float("nan"))])
    plain = json.loads(write_summary(run, tmp_path / "s.json").read_text("ascii"))
    assert (plain["simulated_s"], plain["cases"][0]["simulated_s"]) == (None, None)


def test_write_report_makes_the_four_files(run, hostile, tmp_path):
    """One call writes report, JUnit, summary and table, whatever the texts hold, and says where."""
    for folder, what in (("good", run), ("bad", hostile)):
        paths = write_report(what, tmp_path / folder)
        assert [path.name for path in paths] == ["report.html", "junit.xml", "summary.json", "cases.csv"]
        assert all(path.parent == tmp_path / folder and path.stat().st_size > 1000 for path in paths)
        assert json.loads(paths.summary.read_text("ascii"))["report"] == str(paths.report)


def test_every_public_name_exists_and_is_documented():
    """The door of the package lists only what is there, and each thing says what it is."""
    for name in reports.__all__:
        thing = getattr(reports, name)
        assert name == "Scalar" or thing.__doc__, name


def test_import_loads_neither_templates_nor_plots():
    """`import reports` stays cheap: the heavy libraries come when a page is made."""
    program = "import sys, reports; print([name for name in ('jinja2', 'plotly', 'xml.dom') if name in sys.modules])"  # noqa: E501
    found = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert found.stdout.strip() == "[]"
