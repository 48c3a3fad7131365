"""Runs over time: what is recorded, and what a comparison says."""

from __future__ import annotations

import dataclasses
import sqlite3
import threading
from contextlib import closing, suppress

import numpy as np
import pytest

from reports import (
    CaseResult,
    Check,
    History,
    HistoryError,
    RunResult,
    Signal,
    Verdict,
    compare_runs,
    measures,
    remember,
)

WORDS = {"p": Verdict.PASSED, "f": Verdict.FAILED, "e": Verdict.ERROR, "b": Verdict.BLOCKED}


def case(name: str, word: str = "p", **values) -> CaseResult:
    values = {
        "wall_s": 0.1,
        "simulated_s": 1.0,
        "trace_digest": f"{name}{word}",
        "token": f"HIL1-{name}",
        **values,
    }
    return CaseResult(
        name, f"Title of {name}", WORDS[word], "" if word == "p" else f"because {name}", **values
    )


def run(
    started: str = "", seed: int = 1, bench: str = "bench", interrupted: bool = False, **cases
) -> RunResult:
    """A run of cases given as name = letter of the verdict, or as a whole case."""
    found = [one if isinstance(one, CaseResult) else case(name, one) for name, one in cases.items()]
    return RunResult(
        "Nightly", seed, bench, bench, {"motion-hil": "0.1"}, started, found, interrupted=interrupted
    )


@pytest.fixture
def file(tmp_path):
    return tmp_path / "deep" / "history.sqlite"


def recorded(file, *runs: RunResult):
    for one in runs:
        background = remember(one, file)
    return background.comparison


def test_runs_come_back_as_they_were_recorded(file):
    """Number, totals, times and digests of every run, newest first; cases with verdict, reason, token and
    numbers.
    """
    remember(run("monday", a="p", b="f"), file)
    background = remember(run("tuesday", a="p", b="e", c="b"), file)
    assert [(one.number, one.started) for one in background.trend] == [(1, "monday"), (2, "tuesday")]
    with History(file) as history:
        new, old = history.runs()
        assert (new.number, new.passed, new.failed, new.errors, new.blocked, new.cases) == (2, 1, 0, 1, 1, 3)
        assert (old.state, old.version, old.seed, old.wall_s) == ("failed", "0.1", "1", pytest.approx(0.2))
        assert history.find("last") == new
        assert history.find("last-1") == history.find("1") == old
        found = history.cases(1)
        assert (found["b"].verdict, found["b"].headline, found["b"].token) == (
            Verdict.FAILED,
            "because b",
            "HIL1-b",
        )
        assert found["a"].measures["simulated time"].value == 1.0
        assert [(one.run, one.verdict.value) for one in history.past("b")] == [(2, "error"), (1, "failed")]
        assert history.runs(1) == [new]


@pytest.mark.parametrize(
    ("before", "now", "what"),
    [
        ("p", "f", "new failure"),
        ("p", "e", "new failure"),
        ("b", "f", "new failure"),
        ("", "f", "new failure"),
        ("f", "p", "fixed"),
        ("e", "p", "fixed"),
        ("f", "e", "still failing"),
        ("p", "b", "newly blocked"),
        ("p", "p", ""),
        ("b", "b", ""),
        ("", "p", ""),
        ("b", "p", ""),
    ],
)
def test_what_happened_to_a_case(file, before, now, what):
    """The verdict now against the last one that the case has had."""
    first = run("1", other="p", **({"a": before} if before else {}))
    found = recorded(file, first, run("2", a=now))
    assert found.by_case() == ({"a": what} if what else {})
    assert ("a" in found.appeared) == (not before)
    assert ("a" in found.reasons) == (now in "fe")


def test_a_case_is_compared_with_its_own_last_result(file):
    """A run of a selection in between makes nothing new and forgets nothing."""
    found = recorded(file, run("1", a="f", b="p"), run("2", b="p"), run("3", a="p", b="p"))
    assert (found.fixed, found.appeared, found.common, found.base) == (["a"], [], 2, None)
    with History(file) as history:
        direct = compare_runs(history, history.find("3"), history.find("2"))
    assert (direct.fixed, direct.appeared, direct.vanished) == ([], ["a"], [])


def test_two_named_runs_are_compared_as_they_are(file):
    """What went away is named, traces that are equal are counted, a run is not compared with itself."""
    recorded(file, run("1", a="p", gone="p"), run("2", a="p", new="f"))
    with History(file) as history:
        found = compare_runs(history, history.find("last"), history.find("1"))
        assert (found.vanished, found.appeared, found.new_failures) == (["gone"], ["new"], ["new"])
        assert (found.common, found.same_traces) == (1, 1)
        assert found.as_dict()["base"] == 1
        with pytest.raises(HistoryError, match="run 2 would be compared with itself"):
            compare_runs(history, history.find("2"), history.find("2"))


@pytest.mark.parametrize(
    ("letters", "flaky"),
    [("pfp", True), ("pf", False), ("ppf", False), ("pbfbp", True), ("pbp", False), ("epfp", True)],
)
def test_flaky_is_what_turns_to_and_fro(file, letters, flaky):
    """Two turns between good and bad are one too many; blocked results say nothing."""
    found = recorded(file, *(run(str(n), a=letter) for n, letter in enumerate(letters)))
    assert found.flaky == (["a"] if flaky else [])


def test_an_edited_case_is_neither_fixed_nor_flaky(file):
    """Results of another source say nothing of this one; an unknown source is taken for the same."""
    first, second = run("1", a=case("a", "f", source="x")), run("2", a=case("a", "p", source="y"))
    found = recorded(file, first, second)
    assert (found.edited, found.fixed, found.by_case()) == (["a"], [], {"a": "edited"})
    assert found.as_dict()["edited"] == ["a"]
    found = recorded(file, run("3", a=case("a", "f", source="z")), run("4", a=case("a", "p", source="z")))
    assert (found.edited, found.fixed, found.flaky) == ([], ["a"], [])
    found = recorded(file, run("5", a=case("a", "f", source="z")))
    assert found.flaky == ["a"], "the same source now"
    assert recorded(file, run("6", a="p")).fixed == ["a"]


def test_a_history_of_the_first_format_goes_on(file):
    """Its results have no source; the next run is recorded next to them."""
    recorded(file, run("1", a="f"))
    with closing(sqlite3.connect(file)) as base:
        base.executescript("ALTER TABLE result DROP COLUMN source; PRAGMA user_version = 1;")
    found = recorded(file, run("2", a=case("a", "p", source="x")))
    assert (found.fixed, found.edited) == (["a"], [])
    with History(file) as history:
        assert [one.source for one in history.past("a")] == ["x", ""]


def test_turns_on_another_bench_or_seed_are_no_flakiness(file):
    """The same case on another bench may well end otherwise."""
    found = recorded(
        file, run("1", a="p"), run("2", a="f", bench="other"), run("3", a="f", seed=2), run("4", a="p")
    )
    assert found.flaky == []
    assert found.fixed == ["a"]


def test_slower_cases_stand_out_of_a_slower_machine(file):
    """All cases take twice as long, one of them ten times: that one is slower."""
    names = [f"c{n}" for n in range(9)]
    usual = {name: case(name, wall_s=1.0) for name in names}
    slow = {name: case(name, wall_s=2.0) for name in names} | {"c3": case("c3", wall_s=10.0)}
    found = recorded(file, run("1", **usual), run("2", **usual), run("3", **slow))
    assert [(one.identifier, one.before_s, one.now_s) for one in found.slower] == [
        ("c3", pytest.approx(2.0), 10.0)
    ]
    short = recorded(file, run("4", a=case("a", wall_s=0.01)), run("5", a=case("a", wall_s=0.2)))
    assert short.slower == [], "a quarter of a second is nothing"


def moving(
    final: float = 100.0, peak: float = 50.0, stop_s: float = 0.8, error: float = 0.2, reaction: float = 10.0
) -> CaseResult:
    time = np.arange(0, 1.0, 0.001)
    moves = time <= stop_s
    result = case("a")
    result.signals = [
        Signal("axis1.actual_position", "mm", time, np.where(moves, final * time / stop_s, final)),
        Signal("axis1.actual_velocity", "mm/s", time, np.where(moves, peak, 0.0)),
        Signal("axis1.following_error", "mm", time, np.where(moves, -error, 0.0)),
        Signal("axis1.velocity_setpoint", "mm/s", time, np.full(1000, 7.0)),
        Signal("axis1.state", "", time, np.ones(1000), {1: "MOTION"}),
    ]
    result.checks = [
        Check("reaction time", Verdict.PASSED, "", "", value=reaction, unit="ms", low=0.0, high=20.0)
    ]
    return result


def test_a_case_becomes_a_few_numbers():
    """Final position, peaks of velocity and following error, the last motion, what was measured; no
    setpoints, no states.
    """
    found = {one.name: (one.value, one.unit, one.tolerance) for one in measures(moving())}
    assert found == {
        "simulated time": (1.0, "s", 0.01),
        "axis1.actual_position: final": (100.0, "mm", 1.0),
        "axis1.actual_velocity: peak": (50.0, "mm/s", 0.5),
        "axis1.actual_velocity: last motion": (pytest.approx(0.8), "s", 0.005),
        "axis1.following_error: peak": (0.2, "mm", 0.002),
        "check: reaction time": (10.0, "ms", 0.2),
    }


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"final": 101.5}, "axis1.actual_position: final"),
        ({"peak": 50.6}, "axis1.actual_velocity: peak"),
        ({"stop_s": 0.81}, "axis1.actual_velocity: last motion"),
        ({"error": 0.21}, "axis1.following_error: peak"),
        ({"reaction": 10.3}, "check: reaction time"),
        ({"final": 100.9, "peak": 50.4, "stop_s": 0.803, "error": 0.2015, "reaction": 10.1}, ""),
    ],
)
def test_numbers_drift_beyond_their_tolerance(file, change, name):
    """A number that moved by more than its tolerance is named with both values; smaller moves are not."""
    found = recorded(file, run("1", a=moving()), run("2", a=moving(**change)))
    assert [one.name for one in found.drift] == ([name] if name else [])
    assert recorded(file, run("3", a=moving(final=300.0), seed=9)).drift == [], (
        "another seed has other numbers"
    )


def test_odd_samples_and_texts_are_recorded(file):
    """Gaps, endless values, names that repeat and surrogates break nothing; what is no number is left out."""
    odd = case("lone \ud800", wall_s=float("nan"), simulated_s=float("inf"))
    nothing = np.array([np.nan, np.nan])
    odd.signals = [
        Signal("x.position", "mm", np.array([0.0, 1.0, 2.0]), np.array([1.0, np.nan, np.nan])),
        Signal("x.velocity", "mm/s", np.array([0.0, 1.0]), nothing),
        Signal("x.torque", "Nm", np.array([]), np.array([])),
    ]
    odd.checks = [Check("same", Verdict.PASSED, "", "", value=value) for value in (1.0, 2.0, float("nan"))]
    found = {one.name: one.value for one in measures(odd)}
    assert found == {"x.position: final": 1.0, "check: same": 1.0, "check: same (2)": 2.0}
    recorded(file, run("1", odd=odd))
    with History(file) as history:
        (back,) = history.cases(1).values()
        assert (back.identifier, back.wall_s) == ("lone ?", 0.0)


def test_a_resumed_run_takes_the_place_of_its_beginning(file):
    """What went on with an interrupted run is one run, not two; a run that ended stays."""
    remember(run("1", a="p", interrupted=True), file)
    background = remember(run("1", a="p", b="p"), file)
    assert [(one.number, one.cases) for one in background.trend] == [(2, 2)]
    assert [one.cases for one in remember(run("1", a="p", b="p", c="p"), file).trend] == [2, 3]


def test_a_report_made_again_finds_its_run(file):
    """What came before a run can be asked for later; runs after it do not count."""
    first, second = run("1", a="p"), run("2", a="f")
    remember(first, file)
    remember(second, file)
    remember(run("3", a="p"), file)
    background = remember(second, file)
    assert background.comparison.new_failures == ["a"]
    assert [one.started for one in background.trend] == ["1", "2"]
    with History(file) as history:
        assert len(history.runs()) == 3
        assert history.number_of(run("9", a="p")) is None
        judged_again = run("2", a=case("a", "p", trace_digest="af"))
        assert history.number_of(judged_again) is None, "the same trace with another verdict is another run"


def test_old_runs_can_be_deleted(file):
    """The last ones stay, with their numbers; names that nobody uses go."""
    recorded(file, *(run(str(n), **{f"c{n}": "p"}) for n in range(5)))
    with History(file) as history:
        assert history.prune(2) == 3
        assert [one.number for one in history.runs()] == [5, 4]
        assert history.past("c0") == []
        with pytest.raises(ValueError, match="keep: 0 is not allowed"):
            history.prune(0)
    names = {text for (text,) in sqlite3.connect(file).execute("SELECT text FROM name")}
    assert names == {"c3", "c4", "simulated time"}


@pytest.mark.parametrize("content", [b"hello, this is no database at all" * 50, b""])
def test_what_is_no_history_is_refused_and_left_alone(tmp_path, content):
    """Another file is named in the message and not touched; an empty one becomes a history."""
    file = tmp_path / "notes.txt"
    file.write_bytes(content)
    if content:
        with pytest.raises(HistoryError, match=r"notes\.txt: not a history"):
            remember(run(a="p"), file)
        assert file.read_bytes() == content
    else:
        assert remember(run(a="p"), file).comparison.appeared == ["a"]


def test_foreign_databases_and_missing_files_are_named(tmp_path, file):
    """A database of something else is no history; reading makes no file."""
    foreign = tmp_path / "foreign.sqlite"
    base = sqlite3.connect(foreign)
    base.execute("CREATE TABLE t (x)")
    base.close()
    with pytest.raises(HistoryError, match="not a history of format 2"):
        History(foreign)
    with pytest.raises(HistoryError, match="no history here"):
        History(file)
    assert not file.exists()
    remember(run(a="p"), file)
    with (
        History(file) as history,
        pytest.raises(HistoryError, match=r"no run '7'; allowed: last, .* \(1 to 1\)"),
    ):
        history.find("7")


@pytest.mark.parametrize("page", range(1, 9))
def test_a_damaged_history_is_reported_as_one(file, page):
    """Whichever page of the file is overwritten: every answer is right, or an error that names the file."""
    for number in range(4):
        remember(run(str(number), **{f"c{k}": "p" for k in range(40)}), file)
    content = bytearray(file.read_bytes())
    assert len(content) > 9 * 4096
    content[4096 * page : 4096 * (page + 1)] = b"\xa5" * 4096
    file.write_bytes(content)
    with suppress(
        HistoryError
    ):  # and nothing else: a report is written without a history, but not without an answer
        assert remember(run("new", c1="p"), file).comparison.now.started == "new"
        with History(file) as history:
            assert history.runs()[0].started == "new"


def test_a_history_that_another_process_holds_is_reported(monkeypatch, file):
    """After a while the run goes on without: the message says that somebody holds the file, not that it is
    none.
    """
    remember(run("1", a="p"), file)
    monkeypatch.setattr("reports.history.WAIT_S", 0.05)
    holder = sqlite3.connect(file)
    holder.execute("BEGIN EXCLUSIVE")
    with pytest.raises(HistoryError, match=r"another process has held it for 0\.05 s"):
        remember(run("2", a="p"), file)
    holder.close()
    assert recorded(file, run("2", a="f")).new_failures == ["a"]


def test_two_may_record_at_the_same_time(file):
    """Runs of several processes wait for each other; none is lost."""
    threads = [
        threading.Thread(target=remember, args=(run(str(n), **{f"c{k}": "p" for k in range(30)}), file))
        for n in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with History(file) as history:
        assert sorted(one.started for one in history.runs()) == ["0", "1", "2", "3"]


def test_a_case_written_twice_counts_once(file):
    """The last one of equal name is what counts, as in the journal."""
    twice = run("1")
    twice.cases = [case("a", "f"), dataclasses.replace(case("a"), title="again")]
    recorded(file, twice)
    with History(file) as history:
        assert [one.verdict for one in history.past("a")] == [Verdict.PASSED]
