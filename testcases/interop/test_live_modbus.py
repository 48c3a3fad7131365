"""A PROFIdrive axis over real Modbus: loopback TCP and a pseudo-terminal, its drive in another process or
`physical`.

What is judged is what happens, not how fast: the limits in the bench file are wide, because the machine may
be slow.
"""

from __future__ import annotations

import re
import signal

import pytest

from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from hil.campaign import CaseSettings, execute_case
from hil.errors import BlockedError
from hil.faults import Injector
from reports.model import Verdict
from testcases.campaigns import stop_modes
from testcases.processes import Reader, hil_command

PATIENT = {
    "cycle_ms": "40\nservo_period_us = 2000\ngrace_cycles = 60",
    '"PositionControl.Kv"': "3.0",
    '"PositioningMonitoring.Window"': "5.0",
    '"PositioningMonitoring.ToleranceTime"': "5.0",
    '"PositioningMonitoring.MinDwellTime"': "0.0",
    '"FollowingError.MinValue"': "400.0",
    '"FollowingError.MaxValue"': "400.0",
}
TOLERANCE = "[tolerance]\ntime_s = 0.5\ndistance_mm = 60.0\nlateness_s = 1.0\n\n[segment."
DRIVE = "off3_ramp_s = 0.5\nvelocity_time_constant_ms = 8.0\nprofidrive = { setpoint_monitoring_ms = 5000 }\n"


def bench_text(kind, *, drive="", segment=""):
    """Return an embedded bench as a live one, with patience and keys of drive and segment."""
    text = (
        read(f"profidrive_{kind}")[1]
        .replace('kind = "virtual"', 'kind = "live"')
        .replace("latency_us = 100\n", "")
    )
    for key, value in PATIENT.items():
        text, count = re.subn(rf"^{re.escape(key)} = .*$", f"{key} = {value}", text, flags=re.MULTILINE)
        assert count == 1, key
    text = text.replace("[segment.", TOLERANCE, 1).replace("off3_ramp_s = 0.5\n", DRIVE + drive)
    return text.replace(f'kind = "modbus_{kind}"\n', f'kind = "modbus_{kind}"\ntimeout_ms = 500\n{segment}')


def judge(text, stop="halt/constant"):
    """Run a case of the campaign about stops on a bench; it has to pass."""

    class File:
        name = "live Modbus"
        kind = "live"
        digest = ""
        config = parse(text, "live.toml")

        def __init__(self):
            self.text = text

        def build(self, *, seed=0):
            return Bench(self.config, seed=seed)

    case = next(case for case in stop_modes.CAMPAIGN.cases if case.identifier == f"stop-modes/{stop}")
    execution = execute_case(case, File(), CaseSettings(seed=1))
    assert execution.result.verdict is Verdict.PASSED, execution.result.message
    return execution.trace


@pytest.mark.parametrize("kind", ["tcp", "rtu"])
def test_a_stop_in_real_time_with_the_drive_in_a_process_of_its_own(kind):
    """The case passes over loopback TCP and over a pseudo-terminal, and the trace has what passed, in
    words.
    """
    trace = judge(bench_text(kind))
    [bus] = trace.buses
    words = [entry[2].text() for entry in trace.raw_frames(bus)]
    assert sum("request 16 write multiple registers 0063h" in text for text in words) > 30
    assert sum("response 03 read holding registers: " in text for text in words) > 30
    assert "drive1.position" in trace


@pytest.mark.parametrize("kind", ["tcp", "rtu"])
def test_a_physical_drive_is_that_of_hil_emulate(kind, tmp_path):
    """`hil emulate` serves the drive of a Modbus bench, on a TCP port or a device file, and the same case
    leads it there.
    """
    (tmp_path / "emulated.toml").write_text(bench_text(kind))
    link = tmp_path / "ttyDrive"
    extra = ["--link", str(link)] if kind == "rtu" else []
    drives = Reader([*hil_command(), "emulate", str(tmp_path / "emulated.toml"), *extra], stream="stderr")
    try:
        drives.wait_for("^ready")
        physical = 'device = "physical"\n'
        if kind == "tcp":
            port = drives.wait_for(r"^drive1: profidrive, any unit, Modbus TCP on 127\.0\.0\.1:(\d+)$")[1]
            text = bench_text(kind, drive=physical, segment=f"port = {port}\n")
        else:
            drives.wait_for(r"^drive1: profidrive, unit 5, Modbus RTU on /dev/")
            text = bench_text(kind, drive=physical, segment=f'path = "{link}"\n')
        with Bench(parse(text, "physical.toml"), seed=1) as machine:
            axis = machine.axis()
            assert machine.run_until(axis.power().status, 20.0)
            assert machine.run_until(axis.home(0.0).done, 10.0)
            assert machine.run_until(axis.move_absolute(20.0, Velocity=60.0).done, 20.0)
            assert machine.run_until(lambda: abs(axis.var("ActualPosition") - 20.0) < 1.0, 20.0)
        drives.wait_for(r"drive1  drive\.state  S3 switched on -> S4 operation")
        assert drives.end(signal.SIGTERM) == 0
    finally:
        drives.kill()
    assert not link.is_symlink()


def station_bench(kind):
    """Return the embedded bench `analog` as a live one over TCP or on a serial line, with patience."""
    segment = {"tcp": "", "rtu": "baud = 115200\n"}[kind]
    text = (
        read("analog")[1]
        .replace('kind = "virtual"', 'kind = "live"')
        .replace("watchdog_ms = 20.0\n", "watchdog_ms = 3000.0\n")
    )
    for key, value in PATIENT.items():
        text = re.sub(rf"^{re.escape(key)} = .*$", f"{key} = {value}", text, flags=re.MULTILINE)
    return (
        text.replace("[segment.", TOLERANCE, 1)
        .replace("off3_ramp_s = 0.5\n", "off3_ramp_s = 0.5\nvelocity_time_constant_ms = 8.0\n")
        .replace('kind = "modbus_tcp"\n', f'kind = "modbus_{kind}"\ntimeout_ms = 500\n{segment}')
    )


@pytest.mark.parametrize("kind", ["tcp", "rtu"])
def test_an_analog_drive_at_a_station_of_another_process(kind):
    """Enable, setpoint, encoder and switches go through a station on loopback TCP or a pseudo-terminal;
    without its supply the axis loses its drive.
    """
    with Bench(parse(station_bench(kind), "live.toml"), seed=1) as machine:
        axis = machine.axis()
        power = axis.power()
        assert machine.run_until(power.status, 20.0)
        assert machine.run_until(axis.home(0.0).done, 10.0)
        assert machine.run_until(axis.move_absolute(20.0, Velocity=60.0).done, 20.0)
        assert machine.run_until(lambda: abs(axis.var("ActualPosition") - 20.0) < 1.0, 20.0)
        armed = Injector(machine).inject("io.power_off", "io")
        assert machine.run_until(lambda: not power.Status, 20.0)
        armed.remove()
        assert "io.count0" in machine.trace()
        assert "drive1.position" in machine.trace()


def test_a_drive_that_is_not_there_blocks_the_bench():
    """Nobody listens at the port: the bench is not ready, with drive, unit and reason."""
    text = bench_text("tcp", drive='device = "physical"\n', segment="port = 1\n")
    with pytest.raises(BlockedError, match=r"drive1 \(unit 1\) does not answer within 5 s: .*no connection"):
        Bench(parse(text, "physical.toml"), seed=1)


def test_a_line_that_is_not_there_blocks_the_bench(tmp_path):
    """No such device file: the bench is not ready, with its name."""
    text = bench_text("rtu", drive='device = "physical"\n', segment=f'path = "{tmp_path}/nosuch"\n')
    with pytest.raises(BlockedError, match=f"serial line {tmp_path}/nosuch: "):
        Bench(parse(text, "physical.toml"), seed=1)


pytestmark = pytest.mark.realtime
