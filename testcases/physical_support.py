"""Two processes and a bus between them: `hil emulate` with the drives, `hil run` with a bench whose drives
are physical.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
from pathlib import Path
from typing import Any

from hil.bench import load_bench
from reports.store import load_run
from testcases.processes import Reader, hil_command

CASE = Path(__file__).with_name("physical_case.py")
PATIENCE_S = 300.0

_PATIENT = {
    # A machine that is a second late must not make an alarm: what is judged here is what happens, not when.
    "grace_cycles = 12": "grace_cycles = 60",
    "time_s = 0.15": "time_s = 0.5",
    "heartbeat_ms = 200": "heartbeat_ms = 500",
    "consumer_heartbeat_ms = 2000": "consumer_heartbeat_ms = 20000",
    "missing_setpoints = 15": "missing_setpoints = 0",
    '"FollowingError.MinValue" = 100.0': '"FollowingError.MinValue" = 400.0',
    '"FollowingError.MaxValue" = 150.0': '"FollowingError.MaxValue" = 400.0',
}


def multicast_place() -> dict[str, Any]:
    """Return UDP multicast on the loopback, with a port of its own, so that runs side by side do not meet."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = int(probe.getsockname()[1])
    return {
        "interface": "udp_multicast",
        "channel": "239.74.163.2",
        "options": {"port": port, "hop_limit": 0},
    }


def bench_text(place: dict[str, Any] | None, *, physical: bool, axes: bool = True) -> str:
    """Return the embedded bench `live` on another bus (None: its own), with patience, and with or without
    axes.
    """
    text = load_bench("live").text
    for old, new in _PATIENT.items():
        assert text.count(f"\n{old}") == 1, old
        text = text.replace(f"\n{old}", f"\n{new}")
    if place is not None:
        own = 'interface = "socketcan"\nchannel = "vcan0"'
        assert text.count(own) == 1
        text = text.replace(own, "\n".join(f"{key} = {_toml(value)}" for key, value in place.items()))
    if physical:
        text = text.replace("node_id = 5\n", 'node_id = 5\ndevice = "physical"\ncommission = true\n')
    if not axes:
        text = text[: text.index("[axis.axis1]")]
    return text


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    return json.dumps(value)


def emulate(directory: Path, place: dict[str, Any] | None, *arguments: str) -> Reader:
    """Start `hil emulate` with the drives of the bench on `place`, and wait until they are there."""
    bench = directory / "emulated.toml"
    bench.write_text(bench_text(place, physical=False), encoding="utf-8")
    drives = Reader([*hil_command(), "emulate", str(bench), *arguments], stream="stderr")
    drives.wait_for("^ready")
    return drives


def run_round_trip(
    directory: Path, place: dict[str, Any], *, physical: bool = True, exit_code: int = 0
) -> tuple[dict[str, Any], str]:
    """Run the case on the bench whose drive is physical, or its own; returns the JSON and the message of the
    case.
    """
    bench, report = directory / "physical.toml", directory / "report"
    bench.write_text(bench_text(place, physical=physical), encoding="utf-8")
    done = subprocess.run(
        [*hil_command(), "run", str(CASE), "--bench", str(bench), "--json", "--report", str(report)],
        check=False,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        env={**os.environ, "COLUMNS": "200"},
    )
    print(done.stderr)  # pytest shows it when the test fails
    assert done.returncode == exit_code, done.stderr
    summary: dict[str, Any] = json.loads(done.stdout)
    [case] = load_run(report).cases
    return summary, case.message
