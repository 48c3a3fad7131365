"""The last pass of a case is there when it fails: its curves lie under those of now."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from reports import CaseResult, HistoryError, RunResult, Signal, Verdict, remember, render_html
from reports.html.numbers import decode
from reports.html.packing import unpacked
from reports.passes import curves_of, remember_passes


def run_of(started: str, verdict: Verdict, level: float, digest: str = "") -> RunResult:
    signal = Signal("axis1.actual_position", "mm", np.arange(50) * 0.004, np.linspace(0.0, level, 50))
    case = CaseResult("stop/a", "", verdict, trace_digest=digest, signals=[signal])
    return RunResult("t", 1, "bench", "", {}, started, [case])


@pytest.mark.exhaustive
def test_a_failed_case_gets_the_curves_of_its_last_pass(tmp_path):
    """Kept is the last pass of the same bench, whatever failed in between; a case that passes needs none."""
    path = tmp_path / "history.sqlite"
    runs = [
        run_of("2026-01-01T09:00:00", Verdict.PASSED, 1.0, "a"),
        run_of("2026-01-02T09:00:00", Verdict.PASSED, 2.0, "b"),
        run_of("2026-01-03T09:00:00", Verdict.FAILED, 3.0, "c"),
        run_of("2026-01-04T09:00:00", Verdict.FAILED, 4.0, "d"),
        dataclasses.replace(run_of("2026-01-05T09:00:00", Verdict.FAILED, 5.0), bench_name="another"),
    ]
    found = []
    for run in runs:
        background = remember(run, path)
        found.append(remember_passes(run, path))
    assert [list(one) for one in found] == [[], [], ["stop/a"], ["stop/a"], []]
    label, curves = found[3]["stop/a"]
    assert label == "last pass, 2026-01-02 09:00"
    plain = unpacked(curves)
    assert decode(plain["panels"][0]["traces"][0]["y"])[-1] == pytest.approx(2.0, abs=1e-5)
    page = render_html(
        runs[3], tmp_path / "r.html", background=dataclasses.replace(background, passes=found[3])
    ).read_text("utf-8")
    data = unpacked(page.partition('id="data-case-0">')[2].partition("<")[0])
    assert data["passed"] == [label, curves]


def test_a_chosen_run_takes_the_place_of_the_last_pass(tmp_path):
    """Curves of any run can be laid under the same cases; what is no database is said."""
    run = run_of("", Verdict.PASSED, 1.0)
    earlier = curves_of(run_of("", Verdict.FAILED, 7.0), "run in other")
    page = render_html(run, tmp_path / "r.html", earlier=earlier).read_text("utf-8")
    data = unpacked(page.partition('id="data-case-0">')[2].partition("<")[0])
    assert data["passed"][0] == "run in other"
    broken = tmp_path / "broken.sqlite"
    broken.write_text("no database at all, but text that goes on for a while")
    with pytest.raises(HistoryError, match=r"broken\.sqlite: the curves of the last passes cannot be kept"):
        remember_passes(run, broken)
