"""Figures of the cockpit: `python -m testcases.cockpit_figures`.

* processor time of server and bench in a second of real time, without a page and with pages that watch four
  signals;
* from a click (the message of a jog) to the first sample with a setpoint at the page, median and 99th
  percentile;
* deviation of the cycles of a live bench from their grid, without and with a page that watches.
"""

from __future__ import annotations

import os
import struct
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from testcases.cockpit_rig import Page, Served
from testcases.physical_support import bench_text, multicast_place
from testcases.processes import Reader, hil_command

SIGNALS = [f"axis1.{one}" for one in ("position_setpoint", "actual_position", "actual_velocity", "state")]
SECONDS = 10.0
JOGS = 40


def serve(bench: str) -> tuple[Reader, Served]:
    """Start a cockpit in a process of its own."""
    server = Reader([*hil_command(), "cockpit", bench, "--port", "0"], stream="stderr")
    found = server.wait_for(r"http://127\.0\.0\.1:(\d+)/#token=(\S+)")
    return server, Served(int(found[1]), token=found[2])


def processor_s(process: int) -> float:
    """Return the processor time of a process and of its threads, s."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def column(page: Page, signals: int, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times and values of a signal of the frames that came so far."""
    times, values = [], []
    for frame in list(page.samples):
        rows = struct.unpack_from("<BBHIII", frame)[3]
        table = np.frombuffer(frame, "<f8", rows * (1 + signals), 16).reshape(1 + signals, rows)
        times.append(table[0])
        values.append(table[1 + number])
    return np.concatenate(times or [np.empty(0)]), np.concatenate(values or [np.empty(0)])


def cost() -> None:
    """Print the processor time that pages cost."""
    server, cockpit = serve("reference")
    try:
        with ExitStack() as stack:
            opened = 0
            for pages in (0, 1, 4):
                for _ in range(pages - opened):
                    page = stack.enter_context(cockpit.page())
                    page.do("scope.subscribe", signals=SIGNALS, number=1)
                opened = pages
                time.sleep(1.0)
                before = processor_s(server.process.pid)
                time.sleep(SECONDS)
                spent = (processor_s(server.process.pid) - before) / SECONDS
                print(f"processor time with {pages} pages: {1000 * spent:.0f} ms in a second")
    finally:
        server.end(2)


def latency() -> None:
    """Print how long a click takes to a setpoint that the page sees."""
    server, cockpit = serve("reference")
    found = []
    try:
        with cockpit.page() as page:
            page.live()
            page.do("control.take")
            page.command("axis1", "take")
            page.command("axis1", "enable")
            page.until(lambda: page.state["axis"]["axis1"]["enabled"], "enabled")
            page.do("scope.subscribe", signals=["axis1.velocity_setpoint"], number=1)
            for _ in range(JOGS):
                page.samples.clear()
                begun = time.monotonic()
                page.do("axis.jog", axis="axis1", slider=20.0)
                page.until(lambda: np.any(column(page, 1, 0)[1] > 0.0), "a setpoint")
                found.append(1000 * (time.monotonic() - begun))
                page.do("axis.jog", axis="axis1", slider=0.0)
                page.until(lambda: page.state["axis"]["axis1"]["velocity"] == 0.0, "stopped")
        median, high = np.percentile(found, [50, 99])
        print(f"click to setpoint at the page: median {median:.0f} ms, p99 {high:.0f} ms of {len(found)}")
    finally:
        server.end(2)


def jitter() -> None:
    """Print the deviation of the cycles of a live bench."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Path(folder) / "bench.toml"
        bench.write_text(bench_text(multicast_place(), physical=False), encoding="utf-8")
        server, cockpit = serve(str(bench))
        try:
            with cockpit.page():
                pass
            time.sleep(SECONDS)
            for words in ("without a page", "with a page"):
                with cockpit.page() as page:
                    watched = words == "with a page"
                    page.do("scope.subscribe", signals=SIGNALS, number=1, back_s=0.0 if watched else SECONDS)
                    time.sleep(SECONDS if watched else 1.0)
                    times = column(page, len(SIGNALS), 0)[0]
                    if not watched:
                        times = times[times < times[-1] - 1.5]
                off = np.abs(np.diff(times) - 0.02)
                median, high = 1000 * np.percentile(off, [50, 99])
                print(f"deviation of cycles {words}: median {median:.2f} ms, p99 {high:.2f} ms of {len(off)}")
        finally:
            server.end(2)


def main() -> int:
    """Print all figures."""
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    cost()
    latency()
    jitter()
    return 0


if __name__ == "__main__":
    sys.exit(main())
