"""Four moving axes for hours of simulated time: memory, speed and drift of a long recording.

    python -m testcases.soak [--hours H] [--memory MB] [--report FOLDER] [--json]

The bench is the reference axis four times on a bus cycle of 4 ms, everything recorded. The first axis turns
endlessly as a modulo axis, the others travel to and fro. A line is printed 24 times: simulated time,
simulated seconds per second of processor time since the line before, memory of the process: its own
(anonymous), and with the pages of mapped files, which the system takes back when it needs them. At the end
all axes stop, and the positions of the controller are compared with the true ones of the mechanics. The run
is then judged by all rules as that of any case, and the report is written and read. Ctrl-C ends the travel
early, not the rest.

Exit code 1: more than 400 MB of its own were in use at one of the lines, a position is off by an increment or
more, or the report does not show the case.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import sys
import tempfile
import threading
import time
import tomllib
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import tomli_w

from fieldbus import core_build
from hil._commands.run import finish
from hil.bench import BenchFile, load_bench
from hil.campaign import Case, CaseContext, CaseSettings, environment_facts, execute_case
from reports.model import CaseResult, RunResult

AXES = 4
LINES = 24
MODULO_MM = 1000.0
SPEED = 300.0
TRAVEL_MM = 400.0
INCREMENT_MM = 10.0 / 131072
"""Pitch of the screw by steps of the encoder in a revolution."""
ALLOWED_MB = 400.0


@dataclass
class Line:
    """What is measured now and then."""

    what: str
    simulated_s: float
    factor: float
    own_mb: float
    """Anonymous memory: what the process has allocated."""
    resident_mb: float
    """With the pages of files that are in memory at present."""


@dataclass
class Figures:
    """What came of the soak."""

    core: str
    hours: float
    """Simulated time of the travel."""
    lines: list[Line] = field(default_factory=list)
    errors_mm: dict[str, float] = field(default_factory=dict)
    turns: float = 0.0
    """How often the endless axis has passed the end of its range."""
    frames: int = 0
    samples: int = 0
    verdict: str = ""
    digest: str = ""
    report_mb: float = 0.0
    """Size of the report; 0: it does not show the case."""
    processor_s: float = 0.0
    peak_mb: float = 0.0
    """Most memory at any time, mapped pages included."""


class Meter:
    """Prints and keeps the lines."""

    def __init__(self, figures: Figures, *, quiet: bool) -> None:
        self._figures = figures
        self._quiet = quiet
        self._before = (0.0, time.process_time())

    def line(self, what: str, simulated_s: float) -> None:
        """Measure."""
        now = time.process_time()
        (last_s, last), self._before = self._before, (simulated_s, now)
        factor = (simulated_s - last_s) / (now - last) if now > last else 0.0
        own, resident = memory_mb()
        one = Line(what, simulated_s, factor, own, resident)
        self._figures.lines.append(one)
        self._figures.processor_s = now
        if not self._quiet:
            print(
                f"{what:20} {simulated_s:9.0f} s  factor {factor:6.1f}  own {own:6.1f} MB  "
                f"resident {resident:7.1f} MB  processor {now:7.0f} s",
                flush=True,
            )


def memory_mb() -> tuple[float, float]:
    """Return the anonymous memory of this process and all of it, MB; where the system does not tell them
    apart, twice the most so far.
    """
    try:
        text = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000.0
        return most, most
    found = {key: value for key, _, value in (line.partition(":") for line in text.splitlines())}
    own, whole = (int(found[key].split()[0]) / 1000.0 for key in ("RssAnon", "VmRSS"))
    return own, whole


def soak_bench(memory_mb: int | None) -> BenchFile:
    """Return the bench: the reference axis four times, the first of them endless."""
    content: dict[str, Any] = tomllib.loads(load_bench("reference").text)
    content["bench"]["name"] = "soak"
    if memory_mb is not None:
        content["bench"]["recording_memory_mb"] = memory_mb
    [drive], [axis] = content["drive"].values(), content["axis"].values()
    content["drive"] = {f"drive{n}": {**drive, "node_id": 4 + n} for n in range(1, AXES + 1)}
    content["axis"] = {f"axis{n}": {**axis, "drive": f"drive{n}"} for n in range(1, AXES + 1)}
    # Without switches and end stops, but with a range that begins anew.
    endless = {key: value for key, value in drive.items() if key != "switches"}
    content["drive"]["drive1"] = {
        **endless,
        "node_id": 5,
        "mechanics": {"negative_stop_mm": -1e9, "positive_stop_mm": 1e9},
    }
    variables = {
        key: value
        for key, value in axis["variables"].items()
        if not key.startswith(("PositionLimits_HW", "PositionLimits_SW"))
    }
    variables |= {"Modulo.Enable": True, "Modulo.StartValue": 0.0, "Modulo.Length": MODULO_MM}
    content["axis"]["axis1"] = {**axis, "drive": "drive1", "variables": variables}
    return BenchFile("soak", tomli_w.dumps(content))


def travel(ctx: CaseContext, *, hours: float, meter: Meter, figures: Figures) -> None:
    """Move for hours of bench time, stop, and compare positions."""
    bench = ctx.bench
    axes = [bench.axis(name) for name in bench.axis_names]
    powers = [axis.power() for axis in axes]
    ctx.wait_until(lambda: all(power.Status for power in powers), 3.0, "all axes are enabled")
    homes = [axis.home(0.0) for axis in axes]
    ctx.wait_until(lambda: all(home.Done for home in homes), 1.0, "all axes are homed")
    origins = [true_mm(ctx, axis.name) for axis in axes]
    turning = axes[0].move_velocity(SPEED)
    jobs = [axis.move_absolute(TRAVEL_MM, Velocity=SPEED) for axis in axes[1:]]
    ctx.do("The first axis turns, the others travel to and fro")
    meter.line("start", bench.now_s)
    begin_s, target = bench.now_s, TRAVEL_MM
    ended = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: ended.set())
    for part in range(1, LINES + 1):
        until_s = begin_s + part * hours * 3600.0 / LINES
        while bench.now_s < until_s and not ended.is_set():
            # The same instances again and again, as a program does it.
            bench.wait_until(lambda: all(job.Done for job in jobs), 10.0, "the axes arrive")
            target = -target
            for job in jobs:
                job.set(Execute=False, Position=target)
            bench.run_for(0.004)
            for job in jobs:
                job.set(Execute=True)
        if ended.is_set():
            break
        meter.line(f"{part} of {LINES}", bench.now_s)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    figures.hours = (bench.now_s - begin_s) / 3600.0
    assert turning.InVelocity
    halts = [axis.halt() for axis in axes]
    ctx.wait_until(lambda: all(halt.Done for halt in halts), 5.0, "all axes stand")
    bench.run_for(1.0)
    for axis, origin in zip(axes, origins, strict=True):
        true = true_mm(ctx, axis.name) - origin
        error = newest(ctx, f"{axis.name}.actual_position") - true
        if axis is axes[0]:
            figures.turns = true / MODULO_MM
            error = (error + MODULO_MM / 2) % MODULO_MM - MODULO_MM / 2
        figures.errors_mm[axis.name] = error
    figures.frames = bench.recorder.frame_count
    figures.samples = sum(group.rows * len(group.columns) for group in bench.recorder.groups)
    meter.line("standstill", bench.now_s)


def true_mm(ctx: CaseContext, axis: str) -> float:
    """Return the true position of the load of an axis, mm."""
    return newest(ctx, f"{ctx.bench.drive_of(axis)}.position") * 1000.0


def newest(ctx: CaseContext, signal: str) -> float:
    """Return the newest value of a signal."""
    value = ctx.bench.recorder.reader(signal)()
    assert value is not None
    return value


def soak(hours: float, folder: Path, memory: int | None, *, quiet: bool) -> Figures:
    """Run the soak, judge it, and write its report."""
    figures = Figures(core_build.kind(), hours)
    meter = Meter(figures, quiet=quiet)
    file = soak_bench(memory)
    case = Case(
        identifier="soak/four-axes",
        title=f"Four axes move for {hours:g} h",
        group="soak",
        function=travel,
        parameters={"hours": hours, "meter": meter, "figures": figures},
        simulated_limit_s=hours * 3600.0 + 60.0,
        wall_limit_s=30 * 86_400.0,
    )
    run = RunResult(
        title="Soak",
        seed=0,
        bench_name=file.name,
        bench_text=file.text,
        environment=environment_facts(),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    execution = execute_case(case, file, CaseSettings())
    result: CaseResult = execution.result
    meter.line("judged", result.simulated_s)
    run.cases.append(result)
    folder.mkdir(parents=True, exist_ok=True)
    paths = finish(run, folder)
    meter.line("report written", result.simulated_s)
    figures.verdict = f"{result.verdict.value}: {result.message}" if result.message else result.verdict.value
    figures.digest = result.trace_digest
    if case.identifier in paths.report.read_text(encoding="utf-8"):
        figures.report_mb = paths.report.stat().st_size / 1e6
    figures.peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000.0
    return figures


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hours", type=float, default=24.0, help="simulated time, h; default 24")
    parser.add_argument("--memory", type=int, help="recording_memory_mb of the bench; default: that of any")
    parser.add_argument("--report", type=Path, help="folder of the report; default: a temporary one")
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()
    if not 0.001 <= arguments.hours <= 10_000.0:
        parser.error(f"--hours {arguments.hours}: allowed are 0.001 to 10000")
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.report or Path(temporary)
        figures = soak(arguments.hours, folder, arguments.memory, quiet=arguments.json)
    own = max(line.own_mb for line in figures.lines)
    good = (
        own < ALLOWED_MB
        and len(figures.errors_mm) == AXES
        and all(abs(error) < INCREMENT_MM for error in figures.errors_mm.values())
        and figures.report_mb > 0.0
    )
    if arguments.json:
        print(json.dumps(asdict(figures) | {"increment_mm": INCREMENT_MM, "good": good}))
    else:
        print(f"{core_build.described()}; {os.cpu_count()} processors")
        print(f"{figures.hours:.3f} h; {figures.samples} values and {figures.frames} frames recorded")
        print(f"{figures.turns:.1f} turns of the endless axis")
        for name, error in figures.errors_mm.items():
            print(f"{name}: off by {error / INCREMENT_MM:+.3f} increments")
        print(f"most of its own memory {own:.1f} MB; most in all {figures.peak_mb:.1f} MB")
        print(f"report of {figures.report_mb:.1f} MB; {figures.processor_s:.0f} s of processor time")
        print(f"verdict {figures.verdict}; digest {figures.digest[:16]}; {'good' if good else 'NOT GOOD'}")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
