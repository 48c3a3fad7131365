"""How processes end: with Ctrl-C, with Ctrl-C again and again, and when their parent is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from testcases.physical_support import bench_text, emulate, multicast_place
from testcases.processes import PATIENCE_S, Reader, hil_command

pytestmark = pytest.mark.realtime

ENDLESS = """
import os
from hil import Campaign
C = Campaign("endless")
for number in range(4):
    @C.case(f"number {number}", simulated_limit_s=10**6, wall_limit_s=10**6)
    def endless(ctx):
        print("runs in", os.getpid(), file=open("started", "a"), flush=True)
        ctx.run_for(10**5)
"""

TWO_CASES = """
from hil import Campaign
C = Campaign("two")
for number in range(2):
    @C.case(f"number {number}")
    def short(ctx):
        print("begin", file=open("order", "a"), flush=True)
        ctx.run_for(0.3)
        print("end", file=open("order", "a"), flush=True)
"""


def children_of(process: int) -> set[int]:
    """Return the processes below `process`, at any depth."""
    parents = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rpartition(")")[2].split()
        except OSError:
            continue  # has ended meanwhile
        parents[int(status.parent.name)] = int(fields[1])
    found: set[int] = set()
    while more := {child for child, parent in parents.items() if parent in {process, *found}} - found:
        found |= more
    return found


def alive(process: int) -> bool:
    """Return whether a process runs; a zombie, which nobody here may wait for, does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def wait_until(condition, what: str) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, f"waited in vain: {what}"
        time.sleep(0.02)


def start_run(directory: Path, *arguments: str, cases: int = 1) -> Reader:
    """Start `hil run` with cases that never end, and wait until `cases` of them run."""
    (directory / "endless.py").write_text(ENDLESS, encoding="utf-8")
    command = [*hil_command(), "run", "endless.py", "--report", "report", *arguments]
    run = Reader(command, stream="stderr", cwd=directory)
    started = directory / "started"
    wait_until(
        lambda: started.exists() and len(started.read_text().splitlines()) >= cases,
        f"{cases} cases are running; said so far: {run.lines}",
    )
    return run


@pytest.fixture
def live_bench(tmp_path):
    """A bench file whose drive runs in a process of its own."""
    file = tmp_path / "bench.toml"
    file.write_text(bench_text(multicast_place(), physical=False), encoding="utf-8")
    return str(file)


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_killed_run_leaves_nothing_behind(tmp_path, live_bench, jobs):
    """When `hil run` is killed, its workers and the processes of emulated drives end by themselves."""
    run = start_run(tmp_path, "--bench", live_bench, "--jobs", jobs)
    try:
        below = children_of(run.process.pid)
        assert below  # the drives', or the workers'
        run.process.kill()
        wait_until(lambda: not any(alive(process) for process in below), f"{below} have ended")
    finally:
        run.kill()


def test_a_drive_process_ends_with_its_pipe(tmp_path):
    """The end of its input ends the drive process, also when it is busy and its scheduler does not come to
    it.
    """
    busy = (
        "import sys, threading, time; from hil.bench import remote; "
        "remote._ORPHAN_S = 0.5; threading.Thread(target=remote.main).start(); time.sleep(1000)"
    )
    process = subprocess.Popen([sys.executable, "-c", busy], stdin=subprocess.PIPE)
    try:
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 1
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("pause_s", [None, 0.1])
def test_ctrl_c_twice_ends_a_run_in_order(tmp_path, pause_s):
    """A second Ctrl-C while the run ends does not spoil the end: exit code 2, a report, no traceback."""
    run = start_run(tmp_path)
    try:
        run.process.send_signal(signal.SIGINT)
        if pause_s is not None:
            time.sleep(pause_s)
            run.process.send_signal(signal.SIGINT)
        assert run.process.wait(PATIENCE_S) == 2, run.lines
        run.join()
    finally:
        run.kill()
    assert not any("Traceback" in line for line in run.lines)
    assert any("interrupted" in line for line in run.lines)
    assert (tmp_path / "report" / "report.html").exists()


def test_ctrl_c_twice_in_a_terminal_ends_workers_and_drives(tmp_path, live_bench):
    """A terminal sends Ctrl-C to the whole group of processes: only the first of them acts, and all end."""
    run = start_run(tmp_path, "--bench", live_bench, "--jobs", "2")
    try:
        below = children_of(run.process.pid)
        for _ in range(2):
            os.killpg(run.process.pid, signal.SIGINT)
            time.sleep(0.1)
        assert run.process.wait(PATIENCE_S) == 2, run.lines
        run.join()
        wait_until(lambda: not any(alive(process) for process in below), f"{below} have ended")
    finally:
        run.kill()
    assert not any("Traceback" in line for line in run.lines), run.lines
    assert (tmp_path / "report" / "report.html").exists()


def test_cases_on_a_live_bench_run_one_at_a_time(tmp_path, live_bench):
    """Two worker processes do not put two cases on the same bus."""
    (tmp_path / "two.py").write_text(TWO_CASES, encoding="utf-8")
    command = [*hil_command(), "run", "two.py", "--report", "report", "--bench", live_bench, "--jobs", "2"]
    run = Reader(command, stream="stderr", cwd=tmp_path)
    try:
        code = run.process.wait(PATIENCE_S)
        run.join()
    finally:
        run.kill()
    assert code == 0, run.lines
    assert (tmp_path / "order").read_text().split() == ["begin", "end", "begin", "end"]


def test_ctrl_c_twice_ends_an_emulation_in_order(tmp_path):
    """`hil emulate` ends with exit code 0, however often it is asked to."""
    drives = emulate(tmp_path, multicast_place())
    try:
        for _ in range(3):
            drives.process.send_signal(signal.SIGINT)
            time.sleep(0.05)
        assert drives.process.wait(PATIENCE_S) == 0
        drives.join()
    finally:
        drives.kill()
    assert not any("Traceback" in line for line in drives.lines)
