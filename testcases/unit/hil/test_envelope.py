"""Stop envelopes: copies of a running bench, what is measured in them, and what is made of it."""

import contextlib
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fieldbus.errors import ConfigurationError
from hil.cli import main
from hil.envelope import (
    Branch,
    Grid,
    Stimulus,
    load_envelope,
    move_absolute,
    stimulus_from_text,
    sweep,
    witness,
)
from hil.errors import CannotRunError

VELOCITY, DECELERATION, JERK = 200.0, 1000.0, 10_000.0


def enable(bench):
    axis = bench.axis()
    bench.wait_until(axis.power().status, 2.0, "enabled")
    bench.wait_until(axis.home(0.0, mode=0).done, 1.0, "homed")


def move(bench):
    bench.wait_until(bench.axis().move_absolute(100.0, Velocity=VELOCITY).done, 3.0, "moved")


def envelope(*stimuli, **options):
    return sweep("reference", move, stimuli, **{"before": enable, "every": 100, "watch_s": 0.6, **options})


@pytest.mark.exhaustive
def test_a_copy_is_the_run_that_was_disturbed_there():
    """Every branch has the trace of the same motion run alone and disturbed in the same cycle, and the
    number of processes changes nothing.
    """
    stimuli = ("drive.fault:code=0x2310", "operator.disable:stop_mode=0")
    one, two = envelope(*stimuli, jobs=1), envelope(*stimuli, jobs=2)
    assert one == two
    assert [branch.cycle for branch in one.of(one.stimuli[0])] == [0, 100, 200, one.cycles - 1]
    for branch in (one.of(one.stimuli[0])[1], one.of(one.stimuli[1])[1]):
        alone = witness("reference", move, branch.stimulus, branch.cycle, before=enable, watch_s=0.6)
        assert alone.trace.digest() == alone.row["digest"] == branch.digest
        assert alone.row["measures"] == branch.measures
    assert len({branch.digest for branch in one.branches}) == len(one.branches)


@pytest.mark.exhaustive
def test_copies_share_no_file():
    """A recording that goes to disk before the motion and during it is that of the run alone: copies that run
    at the same time write into no file of the others.
    """

    def on_disk(bench):
        bench.scheduler.every(20_000_000, lambda: bench.recorder.store(frames_kept=7, events_kept=2))
        enable(bench)

    def short(bench):
        bench.wait_until(bench.axis().move_absolute(10.0, Velocity=VELOCITY).done, 3.0, "moved")

    stimuli, options = ("drive.fault:code=0x2310", "operator.halt"), {"before": on_disk, "watch_s": 0.3}
    found = sweep("reference", short, stimuli, every=40, jobs=2, **options)
    for branch in (found.of(found.stimuli[0])[0], found.of(found.stimuli[1])[1]):
        alone = witness("reference", short, branch.stimulus, branch.cycle, **options)
        assert alone.trace.digest() == branch.digest
        assert alone.row["reaction"] == branch.reaction


@pytest.mark.exhaustive
def test_the_numbers_are_those_of_the_stop():
    """MC_Halt at constant velocity takes v/a + a/j and half of v times it; a fault of the drive is another
    class of reaction.
    """
    found = envelope("operator.halt", "drive.fault:code=0x2310")
    middle = found.of("operator.halt")[1]
    time = VELOCITY / DECELERATION + DECELERATION / JERK
    assert middle.value("stop_time", "axis1") == pytest.approx(time, abs=0.05)
    assert middle.value("stop_distance", "axis1") == pytest.approx(VELOCITY * time / 2.0, rel=0.1)
    assert middle.value("overshoot", "axis1") == 0.0
    assert middle.rest["axis1"] == pytest.approx(
        found.positions["axis1"][100] + middle.value("stop_distance", "axis1"), abs=0.01
    )
    assert middle.reaction == "axis1 STANDSTILL"
    tripped = found.of("drive.fault:code=8976")[1]
    assert tripped.reaction == "axis1 alarm 421 reaction 4; axis1 ALARM_DISABLED"
    assert tripped.value("reaction_time", "axis1") < 0.01
    worst = found.worst("stop_distance")
    assert (worst.branch, worst.unit, worst.axis) == (
        found.ranked("stop_distance", "axis1")[0],
        "mm",
        "axis1",
    )
    assert worst < 100.0
    assert worst <= worst.value <= float(worst)
    assert not worst > worst.value
    assert worst >= middle.value("stop_distance", "axis1")
    assert not found.failures
    assert found.stops == {"axis1": (-600.0, 600.0)}


@pytest.mark.exhaustive
def test_a_copy_ends_when_nothing_more_is_to_come():
    """With a time at rest a copy ends once its axes are disabled, at rest and without an event for so long:
    the numbers are the same, and a branch run alone ends there too. An enabled axis is watched to the end.
    """
    stimuli = ("drive.fault:code=0x2310", "operator.halt", "drive.fault:code=0x2310,duration_s=0.4")
    whole, short = envelope(*stimuli), envelope(*stimuli, rest_s=0.15)
    for one, other in zip(whole.branches, short.branches, strict=True):
        assert (one.cycle, one.reaction, one.measures, one.rest) == (
            other.cycle, other.reaction, other.measures, other.rest,
        )  # fmt: skip
        assert (one.digest == other.digest) == ("halt" in one.stimulus), one.stimulus
    ends = {}
    for stimulus in short.stimuli:
        branch = short.of(stimulus)[1]
        alone = witness("reference", move, stimulus, 100, before=enable, watch_s=0.6, rest_s=0.15)
        assert alone.trace.digest() == branch.digest
        ends[stimulus] = alone.trace.end_s - short.start_s - branch.time_s
    tripped, halted, lasting = (ends[one] for one in short.stimuli)
    assert halted == pytest.approx(0.6)
    assert 0.15 < tripped < 0.5
    assert lasting == pytest.approx(0.55, abs=0.01)


@pytest.mark.exhaustive
def test_an_axis_of_an_nc_is_swept():
    """The usual motion and operator actions find the first axis of an NC; another axis is refused by name."""
    motion = move_absolute("", 20.0, 200.0)
    found = sweep("nc-axes:reference", motion, ["operator.halt", "operator.disable"], every=60, watch_s=0.5)
    assert found.axes == ("axis1",)
    assert {branch.reaction for branch in found.of("operator.halt")} == {"no alarm"}
    assert "error 16#4356" in {*found.of("operator.disable:stop_mode=0")[1].reaction.split("axis1 ")}
    # A halt is no error: the axis shows it in its status, two cycles later.
    assert found.of("operator.halt")[1].value("reaction_time", "axis1") == pytest.approx(0.008)
    assert not found.failures
    with pytest.raises(CannotRunError, match="'axis7' is not an axis"):
        sweep("nc-axes:reference", motion, ["operator.halt@axis7"])


@pytest.mark.exhaustive
def test_a_sweep_goes_on_where_it_was_killed(tmp_path, monkeypatch):
    """Branches are kept as they end; the rest of a cut line is dropped; another envelope is not continued."""
    whole = envelope("operator.halt", folder=tmp_path)
    journal = tmp_path / "branches.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:3]) + lines[3][:40])
    done = []
    again = envelope("operator.halt", folder=tmp_path, resume=True, on_branch=lambda *one: done.append(one))
    assert again == whole == load_envelope(tmp_path)
    assert len(done) == len(whole.branches) - 2
    with pytest.raises(CannotRunError, match="another envelope"):
        envelope("operator.stop", folder=tmp_path, resume=True)
    header, *rows = (tmp_path / "envelope.csv").read_text().splitlines()
    assert header.startswith("stimulus,cycle,time_s,axis,position_unit,stop_distance")
    assert len(rows) == len(whole.branches)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(CannotRunError, match=r"pip install 'motion-hil\[parquet\]'"):
        whole.save_parquet(tmp_path / "envelope.parquet")


def processes_of_session(number):
    """Return the processes of a session that are not dead."""
    found = []
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, _, session = file.read_text().rpartition(")")[2].split()[:4]
            if session == str(number) and state != "Z":
                found.append(int(file.parent.name))
    return found


@pytest.mark.exhaustive
def test_a_sweep_that_was_killed_or_out_of_time_ends_as_one_that_was_not(tmp_path):
    """Signal 9 ends the copies and judges of a sweep with it, and a budget leaves branches out: resumed, both
    give the result of a sweep that nothing has disturbed, byte for byte.
    """
    motion, options = move_absolute("", 5.0, 200.0), {"every": 4, "watch_s": 0.2}
    whole = sweep("reference", motion, ["operator.halt"], folder=tmp_path / "whole", **options)
    killed = tmp_path / "killed"
    command = [
        *(sys.executable, "-m", "hil.cli", "envelope", "reference", "--to", "5", "--velocity", "200"),
        *("--every", "4", "--watch", "0.2", "-x", "operator.halt", "--report", str(killed)),
    ]
    with subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL) as process:
        journal = killed / "branches.jsonl"
        while not journal.exists() or journal.read_bytes().count(b"\n") < 4:
            assert process.poll() is None
            time.sleep(0.002)
        process.kill()
    deadline = time.monotonic() + 60.0
    while left := processes_of_session(process.pid):
        assert time.monotonic() < deadline, left
        time.sleep(0.01)
    kept = journal.read_bytes().count(b"\n") - 1
    assert 3 <= kept < len(whole.branches)
    done = []
    again = sweep(
        "reference", motion, ["operator.halt"], folder=killed, resume=True,
        on_branch=lambda *_: done.append(1), **options,
    )  # fmt: skip
    assert len(done) == len(whole.branches) - kept
    assert again == whole
    late = tmp_path / "late"
    short = sweep(
        "reference", motion, ["operator.halt"], folder=late, budget_s=0.3, jobs=1,
        on_branch=lambda *_: time.sleep(0.05), **options,
    )  # fmt: skip
    assert short.skipped > 0
    assert short.skipped + len(short.branches) == len(whole.branches)
    assert sweep("reference", motion, ["operator.halt"], folder=late, resume=True, **options) == whole
    files = [(folder / "envelope.json").read_bytes() for folder in (tmp_path / "whole", killed, late)]
    assert files == files[:1] * 3


def test_coarse_first_then_where_it_changes():
    """An adaptive grid asks for the middle of neighbours with other reactions, and of those that bend; on a
    straight line it asks for nothing.
    """

    def branch(cycle, reaction, value):
        return Branch(cycle, 0.0, "s", reaction, {"x": {"stop_distance": value}}, {}, (), "", "")

    grid = Grid(0)
    assert grid.first(100) == [*range(0, 100, 4), 99]
    assert Grid(30).first(100) == [0, 30, 60, 90, 99]
    line = [branch(cycle, "a", float(cycle)) for cycle in (0, 4, 8, 12)]
    assert grid.next({0: line}) == []
    assert grid.next({0: [*line, branch(16, "b", 16.0)]}) == [(14, 0)]
    assert grid.next({0: [*line[:3], branch(12, "a", 20.0)]}) == [(6, 0), (10, 0)]
    assert Grid(1).next({0: [*line, branch(16, "b", 16.0)]}) == []


@pytest.mark.exhaustive
def test_what_cannot_be_swept_is_refused():
    """Unknown kinds, values and motions are named with what is near or allowed."""
    for text, message in (
        ("drive.fualt", r"'drive.fualt' is not a fault or operator action; similar: drive.fault"),
        ("operator.disable:stop_mode=7", r"operator.disable.stop_mode: 7 .*0, 1, 2, 3"),
        ("operator.halt:speed=1", r"operator.halt.speed"),
        ("drive.fault:code", r"KIND\[@TARGET\]\[:KEY=VALUE,...\]"),
        ("drive.fault:cod=1", "cod"),
    ):
        with pytest.raises(ConfigurationError, match=message):
            stimulus_from_text(text)
    assert str(stimulus_from_text("drive.fault@d:code=0x2310")) == "drive.fault@d:code=8976"
    assert stimulus_from_text("drive.sto:duration_s=0.5") == Stimulus("drive.sto", duration_s=0.5)
    with pytest.raises(ConfigurationError, match="at least one"):
        envelope()
    with pytest.raises(ConfigurationError, match="watch_s"):
        envelope("operator.halt", watch_s=0.0)
    with pytest.raises(ConfigurationError, match="every"):
        envelope("operator.halt", every=-1)
    with pytest.raises(CannotRunError, match="does not work undisturbed: never"):
        sweep("reference", lambda bench: bench.wait_until(lambda: False, 0.01, "never"), ["operator.halt"])


@pytest.mark.exhaustive
def test_a_fault_that_the_bench_cannot_have_is_listed():
    """What a bench cannot inject is no branch; the reason is in the result."""
    found = envelope("modbus.crc", "operator.halt", every=1000, guards={"": [102.0], "axis1": [600.0]})
    assert found.stimuli == ("operator.halt",)
    assert list(found.refused) == ["modbus.crc"]
    assert "Modbus" in found.refused["modbus.crc"]
    left = {one.limit: one.left for one in found.margins("axis1")}
    highest = max(branch.rest["axis1"] for branch in found.branches)
    assert left == {
        "negative end stop": min(branch.rest["axis1"] for branch in found.branches) + 600.0,
        "positive end stop": 600.0 - highest,
        "guard at 102": 102.0 - highest,
        "guard at 600": 600.0 - highest,
    }
    assert highest == pytest.approx(100.0, abs=0.01)
    with pytest.raises(CannotRunError, match=r"can take none of the stimuli: modbus\.crc"):
        envelope("modbus.crc")
    with pytest.raises(ConfigurationError, match="'axis7' is not an axis"):
        envelope("operator.halt", guards={"axis7": [1.0]})
    assert envelope("operator.halt", budget_s=1e-9).skipped == 4


@pytest.mark.exhaustive
def test_what_a_fault_leaves_behind_breaks_no_rule(subtests):
    """Rules are silent about frames that waited for a bus with errors, the steps of a drive with a clock of
    its own, and a setpoint that begins anew when position control comes back.
    """
    for text in (
        "can.no_ack:duration_s=0.01",
        "drive.clock_jitter:jitter_us=50.0,duration_s=0.5",
        "axis.position_control_off:duration_s=0.2",
    ):
        with subtests.test(stimulus=text):
            assert witness("reference", move, text, 140, before=enable).row["broken"] == []


@pytest.mark.exhaustive
def test_a_copy_that_fails_is_a_row():
    """An error in the test code of a copy, or of a rule, is told with its branch; the sweep goes on."""

    def careless(bench):
        axis = bench.axis()
        job = axis.move_velocity(100.0)
        bench.run_for(0.2)
        if job.Error or job.CommandAborted:
            raise ZeroDivisionError("careless")

    found = sweep("reference", careless, ["operator.halt"], before=enable, every=20, watch_s=0.3)
    assert "ZeroDivisionError: careless" in {branch.error for branch in found.branches}
    assert found.failures

    def leaves(bench):
        bench.run_for(0.02)
        if bench.port().drive_fault_code:
            raise SystemExit(3)

    found = sweep("reference", leaves, ["drive.fault:code=0x2310"], before=enable, every=60, watch_s=0.1)
    assert "SystemExit: 3" in {branch.error for branch in found.branches}


@pytest.mark.exhaustive
def test_an_interrupted_sweep_keeps_what_has_ended(tmp_path):
    """Ctrl-C ends copies and judges; what they had not finished is no row, and is run by the next sweep."""

    def interrupt(done, _planned):
        if done == 3:
            raise KeyboardInterrupt

    options = {"every": 8, "watch_s": 0.2, "folder": tmp_path, "jobs": 2}
    motion = move_absolute("", 5.0, 200.0)
    before = children()
    with pytest.raises(KeyboardInterrupt):
        sweep("reference", motion, ["operator.halt"], on_branch=interrupt, **options)
    assert children() == before
    rows = [json.loads(line) for line in (tmp_path / "branches.jsonl").read_text().splitlines()[1:]]
    assert len(rows) == 3
    assert not any(row["error"] for row in rows)
    found = sweep("reference", motion, ["operator.halt"], resume=True, **options)
    assert not found.failures
    assert len(found.branches) > 3


def children():
    """Return the processes that this one has started and not yet waited for."""
    return {
        int(one) for file in Path("/proc/self/task").glob("*/children") for one in file.read_text().split()
    }


@pytest.mark.exhaustive
def test_command(tmp_path, monkeypatch, capsys):
    """`hil envelope` writes page, table and values; `--cycle` runs one branch alone; `--against` compares."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ours.py").write_text(
        "def before(bench):\n    bench.wait_until(bench.axis().power().status, 2.0, 'on')\n"
        "def motion(bench):\n    bench.axis().move_velocity(50.0)\n    bench.run_for(0.1)\n"
    )
    common = [
        "envelope",
        "reference",
        "--motion",
        "ours.py",
        "--watch",
        "0.3",
        "-x",
        "operator.disable:stop_mode=2",
    ]
    assert main([*common, "--every", "12", "--report", "one", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["branches"] == 3
    worst = answer["worst"]["axis1.stop_distance"]
    assert worst["unit"] == "mm"
    page = (tmp_path / "one" / "envelope.html").read_text()
    assert "Plotly.newPlot" in page
    assert "operator.disable:stop_mode=2" in page
    assert main([*common, "--cycle", "12", "--report", "one", "--json"]) == 0
    alone = json.loads(capsys.readouterr().out)
    (same,) = [b for b in load_envelope("one").branches if b.cycle == 12]
    assert alone["digest"] == same.digest
    other = [*common[:-1], "operator.halt", "--every", "12", "--report", "two", "--against", "one"]
    assert main([*other, "--guard", "3"]) == 0
    told = capsys.readouterr().err
    assert "only in this envelope: operator.halt" in told
    assert "only in the other envelope: operator.disable:stop_mode=2" in told
    assert "->" not in told
    assert "mm beyond its guard at 3: operator.halt at " in told
    compared = (tmp_path / "two" / "envelope.html").read_text()
    assert "Compared with reference axis, ours.py:motion" in compared
    assert "<p>only in this envelope: operator.halt</p>" in compared
    assert main(["replay", worst["token"], "--report", "again", "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["verdict"] == "passed", again["message"]
    assert f"hil replay {worst['token']}" in page
    (tmp_path / "ours.py").write_text(
        (tmp_path / "ours.py").read_text().replace("move_velocity(50.0)", "move_velocity(60.0)")
    )
    assert main(["replay", worst["token"], "--report", "again", "--json"]) == 1
    assert "The trace is not that of the sweep" in capsys.readouterr().out
    assert main([*common, "--every", "0"]) == 2
    assert "--every" in capsys.readouterr().err
