"""A vendor's drive on a live bus: shown, refused, written once, then led without writing."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

from fieldbus.errors import HilError
from hil.bench import BenchFile
from testcases.campaigns._drives_of_eds import COUNTS, NODE, drive_eds
from testcases.processes import PATIENCE_S, Reader, hil_command

pytestmark = pytest.mark.realtime

GROUP = "239.74.163.21"
DRIVE = f"""
[drive.x]
segment = "can0"
node_id = {NODE}
eds = "vendor.eds"
increments_per_revolution = {COUNTS}
sync_loss = "warning"
missing_setpoints = 0
velocity_time_constant_ms = 8.0
"""
AXIS = f"""
[axis.a]
drive = "x"
[axis.a.variables]
"Sensor[1].Parameter.StepsPerRevolution" = {COUNTS}
"Sensor[1].Parameter.FineResolutionXist1" = 0
"FollowingError.EnableMonitoring" = false
"""


@pytest.fixture
def desk(tmp_path: Path):
    """The bench file of a desk whose physical drive is emulated by another process, as its EDS says."""
    port = 44000 + os.getpid() % 1000
    (tmp_path / "vendor.eds").write_text(
        drive_eds(count=2, changed={0x6502: "0x2F", 0x6084: 300}, without=(0x1017,))
    )
    place = f'interface = "udp_multicast"\nchannel = "{GROUP}"\noptions = {{ port = {port} }}\n'
    head = '[bench]\nname = "desk"\nkind = "live"\ncycle_ms = 20\nservo_period_us = 2000\n'
    head += f"[segment.can0]\n{place}"
    (tmp_path / "drive.toml").write_text(head + DRIVE)
    desk = head + DRIVE.replace("eds =", 'device = "physical"\neds =') + AXIS
    for line in ("sync_loss", "missing_setpoints", "velocity_time", "servo_period"):
        desk = re.sub(rf"^{line}.*\n", "", desk, flags=re.MULTILINE)
    (tmp_path / "desk.toml").write_text(desk)
    drives = Reader([*hil_command(), "emulate", str(tmp_path / "drive.toml")], stream="stderr")
    try:
        drives.wait_for("^ready")
        yield tmp_path / "desk.toml"
        assert drives.end(signal.SIGTERM) == 0
    finally:
        drives.kill()


def commission(desk: Path, *options: str) -> str:
    done = subprocess.run(
        [*hil_command(), "commission", str(desk), *options],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_a_vendor_drive_is_commissioned_once(desk):
    """Without the key nothing is written and the bench does not start; after `--write` it does and moves."""
    file = BenchFile(str(desk), desk.read_text())
    with pytest.raises(HilError, match="commission"), file.build():
        pass
    assert "mode pv" in commission(desk)
    with pytest.raises(HilError), file.build():
        pass
    assert re.search(r"commissioned, [1-9]\d* objects written", commission(desk, "--write"))
    with file.build() as bench:
        assert not [event for event in bench.trace().events if event.data.get("written")]
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(lambda: bool(power.Status), PATIENCE_S)
        job = axis.move_velocity(50.0)
        assert bench.run_until(lambda: job.InVelocity, PATIENCE_S)
        before = axis.var("ActualPosition")
        assert bench.run_until(lambda: axis.var("ActualPosition") > before + 20.0, PATIENCE_S)
        axis.power(False)
        assert bench.run_until(lambda: not power.Status, PATIENCE_S)
