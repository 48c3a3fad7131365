"""The journal: what is on the disk after a crash, and that it reads back as it was."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import shutil
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from reports import (
    CaseResult,
    Check,
    FaultRecord,
    Message,
    ReportError,
    RunResult,
    Signal,
    Step,
    StoreError,
    Verdict,
    fault_state_matrix,
    finish_run,
    load_run,
    measures,
    save_run,
    start_run,
    stored_cases,
    write_case,
)

pytestmark = pytest.mark.exhaustive


def bare(run: RunResult) -> RunResult:
    return dataclasses.replace(run, cases=[])


def test_run_reads_back_equal(run, tmp_path):
    """What was saved is what is loaded: texts, numbers, samples and verdicts."""
    save_run(tmp_path / "run", run)
    assert load_run(tmp_path / "run") == run


def test_signals_can_stay_on_the_disk(run, tmp_path):
    """A lazy run is equal to an eager one; texts and numbers need no archive, samples are read when they are
    asked for.
    """
    save_run(tmp_path, run)
    lazy = load_run(tmp_path, lazy=True)
    assert lazy == run
    assert run == lazy
    case = next(case for case in lazy.cases if case.signals)
    again = next(one for one in run.cases if one.identifier == case.identifier)
    assert (len(case.signals), case.signals[0]) == (len(again.signals), again.signals[0])
    assert case.signals != again.signals[:-1]
    expected = measures(again)
    shutil.rmtree(tmp_path / "signals")
    lazy = load_run(tmp_path, lazy=True)
    case = next(one for one in lazy.cases if one.identifier == again.identifier)
    assert case.signals.texts == [signal.enum for signal in again.signals]
    assert measures(case) == expected
    assert fault_state_matrix(lazy).columns == fault_state_matrix(run).columns
    with pytest.raises(StoreError, match="signals missing or damaged"):
        list(case.signals)


def test_writing_a_case_gives_what_need_not_stay_in_memory(run, tmp_path):
    """Who keeps the stored signals of a case keeps the same case."""
    case = next(dataclasses.replace(case) for case in run.cases if case.signals)
    start_run(tmp_path, bare(run))
    stored = write_case(tmp_path, case)
    assert stored == case
    assert not isinstance(stored.signals, list)
    assert not isinstance(stored.messages, list)
    bare_case = CaseResult("bare", "", Verdict.PASSED)
    assert write_case(tmp_path, bare_case) == bare_case


def test_hostile_texts_read_back_equal(hostile, tmp_path):
    """Control characters, lone surrogates, NaN and infinities survive the journal."""
    save_run(tmp_path, hostile)
    loaded = load_run(tmp_path)
    for case in [*loaded.cases, *hostile.cases]:  # NaN differs from itself
        assert math.isnan(case.checks[0].value)
        case.checks[0] = dataclasses.replace(case.checks[0], value=None)
    assert loaded == hostile


def test_equality_of_signals_sees_every_difference():
    """Two signals are equal only with equal name, unit, texts, times and samples."""
    base = Signal("a", "mm", np.arange(3.0), np.array([1.0, np.nan, 2.0]), {1: "x"})
    assert base == Signal("a", "mm", np.arange(3.0), np.array([1.0, np.nan, 2.0]), {1: "x"})
    for change in (
        {"name": "b"},
        {"unit": "m"},
        {"time_s": np.arange(1.0, 4.0)},
        {"values": np.array([1.0, np.nan, 2.1])},
        {"values": np.array([1.0, np.nan])},
        {"enum": {1: "y"}},
    ):
        assert base != dataclasses.replace(base, **change)
    assert base != "a"


def test_case_is_durable_before_the_run_ends(run, tmp_path):
    """After write_case returns, the case can be read although the run was never finished; the run counts as
    cut.
    """
    start_run(tmp_path, bare(run))
    write_case(tmp_path, run.cases[0])
    loaded = load_run(tmp_path)
    assert loaded.cases == run.cases[:1]
    assert loaded.interrupted
    finish_run(tmp_path)
    assert not load_run(tmp_path).interrupted


def test_journal_is_one_line_per_case_and_append_only(run, tmp_path):
    """A further case leaves every byte written before untouched."""
    start_run(tmp_path, bare(run))
    before = b""
    for case in run.cases[:5]:
        write_case(tmp_path, case)
        content = (tmp_path / "cases.jsonl").read_bytes()
        assert content.startswith(before)
        assert content[len(before) :].count(b"\n") == 1
        assert content.endswith(b"\n")
        before = content


@pytest.mark.parametrize("cut", [1, 2, 40, 0.5])
def test_torn_last_line_loses_that_case_only(run, tmp_path, cut):
    """Wherever the writer was killed inside a line: earlier cases load, and appending goes on behind them."""
    start_run(tmp_path, bare(run))
    for case in run.cases[:3]:
        write_case(tmp_path, case)
    path = tmp_path / "cases.jsonl"
    content = path.read_bytes()
    line = content.splitlines(keepends=True)[-1]
    lost = int(len(line) * cut) if isinstance(cut, float) else cut
    os.truncate(path, len(content) - lost)
    survivors = run.cases[: 3 if lost == 1 else 2]  # without its newline alone the line is still whole
    assert load_run(tmp_path).cases == survivors
    assert stored_cases(tmp_path) == [case.identifier for case in survivors]
    write_case(tmp_path, run.cases[3])
    assert load_run(tmp_path).cases == [*survivors, run.cases[3]]


def test_torn_line_longer_than_the_read_block_is_cut_off(run, tmp_path):
    """A torn line may be larger than any buffer."""
    start_run(tmp_path, bare(run))
    write_case(tmp_path, run.cases[0])
    with (tmp_path / "cases.jsonl").open("ab") as file:
        file.write(b'{"identifier":"' + b"x" * 200_000)
    write_case(tmp_path, run.cases[1])
    assert load_run(tmp_path).cases == run.cases[:2]


def test_killed_process_loses_at_most_the_running_case(tmp_path):
    """A process that is killed without warning leaves every case that write_case had returned from."""
    program = textwrap.dedent(
        """
        import os, sys
        from reports import CaseResult, RunResult, Verdict, start_run, write_case
        start_run(sys.argv[1], RunResult("t", 1, "b", "", {}, ""))
        for number in range(3):
            write_case(sys.argv[1], CaseResult(f"case-{number}", "", Verdict.PASSED))
        os._exit(9)
        """
    )
    assert subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=False).returncode == 9
    assert stored_cases(tmp_path) == ["case-0", "case-1", "case-2"]


def test_damage_in_the_middle_is_an_error_with_its_line(run, tmp_path):
    """A damaged line that is not the last is no crash of the writer: it is refused, not skipped."""
    save_run(tmp_path, dataclasses.replace(run, cases=run.cases[:3]))
    path = tmp_path / "cases.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + lines[1][:50] + b"\n" + lines[2])
    with pytest.raises(StoreError, match=r"cases\.jsonl, line 2: damaged"):
        load_run(tmp_path)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (b"[]\n", "line 1: not a case"),
        (b'{"identifier": "a"}\n', "line 1: not a case: 'verdict'"),
        (b'{"identifier": "a", "title": "", "verdict": "green"}\n', "line 1: not a case: 'green'"),
        (
            b'{"identifier": "a", "title": "", "verdict": "passed", "colour": 1}\n',
            "line 1: not a case: .*colour",
        ),
    ],
)
def test_line_that_is_no_case_is_named(run, tmp_path, line, message):
    """JSON that is not a case is refused with its line number."""
    start_run(tmp_path, bare(run))
    (tmp_path / "cases.jsonl").write_bytes(line)
    with pytest.raises(StoreError, match=message):
        load_run(tmp_path)


def test_older_journal_without_new_fields_loads(run, tmp_path):
    """Fields that a journal lacks take their defaults."""
    start_run(tmp_path, bare(run))
    old = {"identifier": "a", "title": "t", "verdict": "failed"}
    old["checks"] = [{"name": "n", "verdict": "failed", "expected": "e", "observed": "o"}]
    (tmp_path / "cases.jsonl").write_text(json.dumps(old) + "\n", encoding="ascii")
    assert load_run(tmp_path).cases == [
        CaseResult("a", "t", Verdict.FAILED, checks=[Check("n", Verdict.FAILED, "e", "o")])
    ]


def test_repeated_case_counts_as_written_last(run, tmp_path):
    """A resumed run that repeats a case replaces it, in its old place."""
    start_run(tmp_path, bare(run))
    first, second = run.cases[:2]
    again = dataclasses.replace(first, verdict=Verdict.ERROR, signals=second.signals)
    for case in (first, second, again):
        write_case(tmp_path, case)
    assert load_run(tmp_path).cases == [again, second]


def test_equal_cases_share_no_file_by_accident(run, tmp_path):
    """Identifiers that differ only in characters unfit for a file name keep their own signals."""
    start_run(tmp_path, bare(run))
    cases = [
        dataclasses.replace(
            run.cases[0], identifier=name, signals=[Signal("s", "", np.arange(2.0), np.full(2, value))]
        )
        for name, value in (("a/b", 1.0), ("a:b", 2.0), ("../../a b", 3.0), ("", 4.0))
    ]
    for case in cases:
        write_case(tmp_path, case)
    assert load_run(tmp_path).cases == cases
    assert {path.parent for path in tmp_path.rglob("*.npz")} == {tmp_path / "signals"}


def test_shared_time_axis_is_stored_once(tmp_path):
    """Signals with the same times cost their values only."""
    time = np.random.default_rng(1).random(5000).cumsum()
    start_run(tmp_path, RunResult("t", 1, "b", "", {}, ""))
    signals = [Signal(f"s{index}", "", time.copy(), np.zeros(5000)) for index in range(20)]
    write_case(tmp_path, CaseResult("c", "", Verdict.PASSED, signals=signals))
    (archive,) = tmp_path.rglob("*.npz")
    assert archive.stat().st_size < 2 * 8 * 5000


def test_numpy_scalars_are_numbers(tmp_path):
    """Values that a checker computed with NumPy need no conversion."""
    start_run(tmp_path, RunResult("t", 1, "b", "", {}, ""))
    case = CaseResult(
        "c",
        "",
        Verdict.PASSED,
        seed=np.int64(7),
        faults=[FaultRecord("k", "t", 0.0, np.float32(0.5), None, {"n": np.uint8(3)})],
    )
    write_case(tmp_path, case)
    loaded = load_run(tmp_path).cases[0]
    assert (loaded.seed, loaded.faults[0].applied_s, loaded.faults[0].parameters) == (7, 0.5, {"n": 3})


def test_foreign_object_is_refused_before_anything_is_appended(tmp_path):
    """A value that JSON cannot hold is an error, and the journal stays as it was."""
    start_run(tmp_path, RunResult("t", 1, "b", "", {}, ""))
    with pytest.raises(TypeError, match="object is no value of the result model"):
        write_case(tmp_path, CaseResult("c", "", Verdict.PASSED, files={"a": object()}))
    assert stored_cases(tmp_path) == []


def test_store_is_not_overwritten(run, tmp_path):
    """A second run does not go into the folder of a first one."""
    save_run(tmp_path, bare(run))
    with pytest.raises(StoreError, match="holds a run already"):
        start_run(tmp_path, bare(run))


def test_missing_run_is_named(tmp_path, run):
    """Without a run there is nothing to append to, to finish or to load."""
    for action in (load_run, finish_run, lambda folder: write_case(folder, run.cases[0])):
        with pytest.raises(StoreError, match=r"no run here; run\.json is missing"):
            action(tmp_path)


def test_damaged_header_and_archive_are_named(run, tmp_path):
    """Damage outside the journal is named with its file."""
    save_run(tmp_path / "a", dataclasses.replace(run, cases=run.cases[:1]))
    (archive,) = (tmp_path / "a").rglob("*.npz")
    archive.write_bytes(archive.read_bytes()[:100])
    with pytest.raises(StoreError, match=r"\.npz: signals missing or damaged"):
        load_run(tmp_path / "a")
    archive.unlink()
    with pytest.raises(StoreError, match=r"\.npz: signals missing or damaged"):
        load_run(tmp_path / "a")
    shutil.rmtree(tmp_path / "a" / "signals")
    (tmp_path / "a" / "run.json").write_text('{"format": 99}', encoding="ascii")
    with pytest.raises(ReportError, match=r"run\.json: not a run of format 1"):
        load_run(tmp_path / "a")
    (tmp_path / "a" / "run.json").write_text("{", encoding="ascii")
    with pytest.raises(ReportError, match=r"run\.json: damaged"):
        load_run(tmp_path / "a")


def test_archive_with_a_member_for_every_column_is_read(tmp_path):
    """A run of the first format, as earlier versions have left it, loads and goes on."""
    start_run(tmp_path, RunResult("t", 1, "b", "", {}, ""))
    header = json.loads((tmp_path / "run.json").read_bytes())
    (tmp_path / "run.json").write_text(json.dumps({**header, "format": 1}), encoding="ascii")
    (tmp_path / "signals").mkdir()
    time, values = np.arange(3.0), np.array([1.0, math.nan, -2.5])
    np.savez_compressed(tmp_path / "signals" / "old.npz", time0=time, column0=values, column1=-values)
    columns = [["a.x", "mm", "time0", "column0", []], ["a.s", "", "time0", "column1", [[1, "one"]]]]
    old = {"identifier": "old", "title": "", "verdict": "passed", "messages": []}
    old["signals"] = {"file": "signals/old.npz", "columns": columns}
    (tmp_path / "cases.jsonl").write_text(json.dumps(old) + "\n", encoding="ascii")
    new = CaseResult("new", "", Verdict.PASSED, signals=[Signal("b.y", "V", time, values)])
    write_case(tmp_path, new)
    finish_run(tmp_path)
    signals = [Signal("a.x", "mm", time, values), Signal("a.s", "", time, -values, {1: "one"})]
    for lazy in (False, True):
        assert load_run(tmp_path, lazy=lazy).cases == [
            CaseResult("old", "", Verdict.PASSED, signals=signals),
            new,
        ]


def test_texts_that_look_like_the_bus_log_of_the_journal(tmp_path):
    """The log is found by its key, whatever stands in texts, details and names around it."""
    trap = ',"messages":[[1]],"signals":{"messages":['
    case = CaseResult(
        trap,
        trap,
        Verdict.FAILED,
        trap,
        tags=[trap, ",", "messages"],
        story=[Step(0.0, "do", trap, {"messages": trap, "signals": "[", trap: None})],
        messages=[Message(0.1, "can0", 1, "00", trap, f"],{trap}", trap)],
        signals=[Signal(trap, "],", np.arange(2.0), np.zeros(2), {0: trap, 1: '],"signals":'})],
    )
    run = RunResult("t", 1, "b", "", {}, "", [case, CaseResult("none", "", Verdict.PASSED)])
    save_run(tmp_path, run)
    assert load_run(tmp_path) == run
    assert load_run(tmp_path, lazy=True) == run
