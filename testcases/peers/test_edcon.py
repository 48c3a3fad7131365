"""Festo's client festo-edcon, unmodified, leads the PROFIdrive axis with telegram 111 over Modbus TCP."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from emulators.drive.machine import NO_SWITCHES, LinearAxisConfig
from emulators.drive.positioner_config import PositionerSettings
from emulators.drive.profidrive.faults.catalogue import CATALOGUE
from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig
from fieldbus.modbus import load_map
from testcases.peers.real_drive import RealDrive, real_drive, slow_servo
from testcases.processes import Reader, hil_command

PROGRAM = Path(__file__).with_name("edcon_motion.py")
LONGEST_S = 40.0
OVER_CURRENT = 11
"""A fault number that the package has a text for; any other one ends it with a KeyError."""
POSITIONER = PositionerSettings(
    has_cam=False, mark_velocity=3_000.0, approach_velocity=3_000.0, rest_is_reached=True
)


BENCH = """
[bench]
name = "a positioning drive"
cycle_ms = 4
servo_period_us = 1000

[segment.net0]
kind = "modbus_tcp"

[drive.x]
profile = "profidrive"
telegram = 111
segment = "net0"
map = "festo"
off1_ramp_s = 0.2
off3_ramp_s = 0.1
velocity_time_constant_ms = 4.0

[drive.x.positioner]
home_here = true
rest_is_reached = true
negative_velocity = "absolute"
refused_task = "fault"
jog_velocities = [3000.0, -3000.0]
block = [{ number = 3, position = 12000, velocity = 6000 }]
"""


class Edcon:
    """The program with the package in it."""

    def __init__(self, packages: Path, host: str, port: int) -> None:
        self._program = subprocess.Popen(
            [sys.executable, PROGRAM, host, str(port)],
            env={**os.environ, "PYTHONPATH": str(packages)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.said = ""
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        assert self._answer() == "ready"

    def _listen(self) -> None:
        for line in self._program.stderr:
            self.said += line

    def _answer(self):
        timer = threading.Timer(LONGEST_S, self._program.kill)
        timer.start()
        line = self._program.stdout.readline()
        timer.cancel()
        assert line, f"no answer: {self.said[-3000:]}"
        return json.loads(line)

    def __call__(self, *order):
        """Give an order and return what the package returns."""
        self._program.stdin.write(json.dumps(order) + "\n")
        self._program.stdin.flush()
        return self._answer()

    def kill(self) -> None:
        """End the program without a farewell."""
        self._program.kill()
        self._program.wait()

    def close(self) -> int:
        """End the program; returns its exit code."""
        self._program.stdin.close()
        try:
            code = self._program.wait(LONGEST_S)
        finally:
            self._program.kill()
        self._listener.join()
        for stream in (self._program.stdout, self._program.stderr):
            stream.close()
        return code


@pytest.fixture(scope="session")
def packages() -> Path:
    """Where `install.py` has put the package; the test fails, and is never skipped, without it."""
    place = Path(os.environ.get("HIL_PEERS", "")) / "edcon"
    if not (place / "edcon").is_dir():
        pytest.fail(
            "HIL_PEERS does not name a directory with the software of others. Run these tests through "
            "`tox -e peers`, or install with `python testcases/peers/install.py DIRECTORY`.",
            pytrace=False,
        )
    return place


@pytest.fixture
def device() -> Iterator[RealDrive]:
    """A drive with telegram 111 and the registers of a Festo drive."""
    mechanics = LinearAxisConfig(negative_stop_mm=None, positive_stop_mm=None)
    drive = slow_servo(111, positioner=POSITIONER, mechanics=mechanics, switches=NO_SWITCHES)
    with real_drive("tcp", ProfidriveModbusConfig(drive=drive, map="festo", processing_ms=0.0)) as made:
        yield made


@pytest.fixture
def edcon(packages, device) -> Iterator[Edcon]:
    made = Edcon(packages, device.host, device.port)
    yield made
    made.close()


@pytest.mark.requirement("PD-018", "PD-292", "MODB-021")
def test_it_enables_homes_moves_faults_and_acknowledges(edcon, device):
    """Identification, time-out, enable, homing, absolute and relative motion, a fault in its words, and all
    again.
    """
    position = lambda: device.do(lambda: device.drive.drive.mode.positioner.position)  # noqa: E731
    assert edcon("info")["product_name"] == "CMMT-AS"
    assert device.do(lambda: device.drive.drive.settings.setpoint_monitoring_ms) == 1000.0
    assert edcon("acknowledge_faults")
    assert edcon("enable_powerstage")
    assert not edcon("referenced")
    assert edcon("referencing_task")
    assert edcon("referenced")

    assert edcon("position_task", 20_000, 6_000, True)
    assert position() == pytest.approx(20_000, abs=40)
    assert abs(edcon("current_position") - 20_000) <= 40
    assert edcon("position_task", -5_000, 6_000, False)
    assert position() == pytest.approx(15_000, abs=80)

    device.do(lambda: device.drive.raise_fault(OVER_CURRENT))
    assert edcon("fault_present")
    assert edcon("current_fault_code") == OVER_CURRENT
    assert "Over-current monitoring" in edcon("fault_string")
    assert not edcon("ready_for_motion")
    assert not device.do(lambda: device.drive.core.enabled)
    assert edcon("acknowledge_faults")
    assert not edcon("fault_present")
    assert edcon("enable_powerstage")
    assert edcon("position_task", 0, 6_000, True)
    assert position() == pytest.approx(0, abs=40)
    assert edcon("disable_powerstage")
    assert not device.do(lambda: device.drive.core.enabled)
    assert edcon.close() == 0, edcon.said


@pytest.mark.requirement("PD-199", "PD-200")
def test_it_reads_and_writes_parameters(edcon, device):
    """The mailbox gives values of every size, keeps what is written, and says no."""
    assert edcon("read", 930, 0, "H") == 2
    assert edcon("read", 1120, 0, "f") == pytest.approx(0.2)
    assert edcon("write", 1120, 0, "f", 0.75)
    assert device.do(lambda: device.drive.drive.settings.ramp_up_s) == 0.75
    assert edcon("read", 964, 0, "H") == 0x002A
    assert edcon("read", 964, 3, "H") == 2026
    assert edcon("write", 2, 0, "h", 1) is False
    assert edcon("read", 4999, 0, "H") is None


@pytest.mark.requirement("PD-280", "PD-292")
def test_a_client_that_dies_stops_the_axis(edcon, device):
    """Killed at constant travel, the client leaves an axis that stops with F01910 after its time-out of a
    second.
    """
    assert edcon("enable_powerstage")
    assert edcon("referencing_task")
    assert edcon("velocity_task", 3_000) is True
    end = time.monotonic() + LONGEST_S
    while abs(device.do(lambda: device.drive.core.speed_rpm)) < 250.0:
        assert time.monotonic() < end
    edcon.kill()
    assert device.do(lambda: device.drive.drive.faults.number) == 0
    time.sleep(2.0)
    assert device.do(lambda: device.drive.drive.faults.number) == 1910
    assert device.do(lambda: device.drive.core.standing)


@pytest.fixture
def emulated(tmp_path) -> Iterator[tuple[str, int]]:
    """`hil emulate` with a bench file: host and port of the drive."""
    bench = tmp_path / "bench.toml"
    bench.write_text(BENCH, encoding="utf-8")
    drives = Reader([*hil_command(), "emulate", str(bench)], stream="stderr")
    try:
        place = drives.wait_for(r"^x: profidrive, any unit, Modbus TCP on (\S+):(\d+)$")
        drives.wait_for("^ready")
        yield place[1], int(place[2])
        assert drives.end(signal.SIGTERM) == 0
    finally:
        drives.kill()


def test_every_task_ends_with_a_bench_file_alone(packages, emulated):
    """Homing on the spot, jog with a duration, negative velocity, record table, pause, a following error by
    its number in the package's list, and a second client after the first one died.
    """
    edcon = Edcon(packages, *emulated)
    try:
        assert edcon("acknowledge_faults")
        assert edcon("enable_powerstage")
        assert edcon("referencing_task")
        assert edcon("referenced")
        assert edcon("jog_task", True, False, False, 0.5)
        there = edcon("current_position")
        assert there > 5_000
        assert edcon("jog_task", False, True, False, 0.5)
        assert edcon("current_position") < there - 5_000
        assert edcon("position_task", 20_000, 6_000, True)
        assert edcon("position_task", -5_000, -500, False)
        assert edcon("current_position") == pytest.approx(15_000, abs=80)
        assert edcon("record_task", 3, False)
        assert edcon("current_position") == pytest.approx(12_000, abs=80)
        assert not edcon("record_task", 99, False)
        assert edcon("current_fault_code") == 60
        assert "Motion task not known" in edcon("fault_string")
        assert edcon("current_position") == pytest.approx(12_000, abs=80)
        assert edcon("acknowledge_faults")
        assert edcon("enable_powerstage")

        assert edcon("position_task", 200_000, 6_000, True, True)
        assert edcon("pause_motion_task") is None
        assert edcon("current_position") < 190_000
        assert edcon("resume_motion_task") is None
        time.sleep(0.2)  # the status word still shows the pause
        assert edcon("wait_for_target_position")
        assert edcon("current_position") == pytest.approx(200_000, abs=80)

        assert not edcon("position_task", 90_000_000, 30_000, True)  # there is a stop on the way
        assert edcon("current_fault_code") == 126
        assert "Position: following error" in edcon("fault_string")
        assert edcon("acknowledge_faults")
        assert edcon("enable_powerstage")
        assert edcon("position_task", 0, 30_000, True)
        edcon.kill()
        time.sleep(2.0)  # longer than the time-out of the process data
    finally:
        edcon.close()
    edcon = Edcon(packages, *emulated)
    try:
        assert edcon("current_fault_code") == 391
        assert edcon("acknowledge_faults")
        assert edcon("enable_powerstage")
        assert edcon("position_task", 1_000, 6_000, True)
    finally:
        edcon.close()


def test_every_number_is_in_the_list_of_the_package(packages):
    """The map shows no number that the package has no text for, and has one for every fault of the axis."""
    text = (packages / "edcon" / "edrive" / "data" / "icp_map.csv").read_text(encoding="utf-8")
    known = {int(row["icp_number"]) for row in csv.DictReader(text.splitlines(True), delimiter=";")}
    shown = load_map("festo")
    assert set(shown.faults) == set(CATALOGUE)
    assert set(shown.faults.values()) | set(shown.warnings.values()) <= known
