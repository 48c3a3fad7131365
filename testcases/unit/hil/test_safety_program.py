"""What a user program does about safety functions of the drive, and what the axis does without it (CFG
section 24).
"""

from __future__ import annotations

import pytest

from hil.bench import BenchFile, load_bench
from hil.faults import Injector
from testcases.unit.hil.test_hil_safety import TABLES, Rig, build

pytestmark = pytest.mark.exhaustive

SECOND = """
[drive.drive2]
segment = "can0"
node_id = 6
profile = "profidrive"
telegram = 105
off3_ramp_s = 1.5
increments_per_revolution = 2048
max_speed_rpm = 3000.0

[drive.drive2.safety]
ss1_time_ms = 2000.0

[axis.axis2]
type = "positioning"
drive = "drive2"
[axis.axis2.variables]
"FollowingError.EnableMonitoring" = false
"""


@pytest.fixture
def rig():
    with build() as bench:
        yield Rig(bench)


@pytest.mark.requirement("CFG-446", "CFG-610")
@pytest.mark.parametrize("kind", ["drive.ss1", "safety.ss2"])
def test_setpoints_track_the_actual_values(rig, kind):
    """While the drive brakes by itself the setpoints are the actual values, and the running job ends."""
    rig.faults.inject(kind, "drive1")
    rig.bench.run_for(0.06)
    assert rig.axis.var("ErrorDetail.Reaction") == 5
    assert rig.job.ErrorID == 0x8001
    assert rig.speed() > 50.0
    for _ in range(5):
        rig.bench.run_for(0.012)
        assert rig.axis.var("Position") == pytest.approx(rig.axis.var("ActualPosition"), abs=1e-6)
        assert rig.axis.var("Velocity") == pytest.approx(rig.axis.var("ActualVelocity"), abs=12.0)


@pytest.mark.requirement("CFG-437", "CFG-438", "CFG-439")
def test_the_axis_does_nothing_by_itself(rig):
    """A selected SLS shows in the safety channel alone: no bit of the axis, no slower motion, until the
    program reacts.
    """
    before = [rig.axis.var(path) for path in ("ErrorWord", "WarningWord")]
    word = rig.axis.var("StatusWord")
    rig.faults.inject("safety.sls", "drive1")
    rig.bench.run_for(0.1)
    assert rig.word() & 0x0040
    assert [rig.axis.var(path) for path in ("ErrorWord", "WarningWord")] == before
    assert rig.axis.var("StatusWord") == word
    assert rig.axis.var("Velocity") == pytest.approx(200.0)


@pytest.mark.requirement("CFG-462", "CFG-463", "CFG-465")
@pytest.mark.parametrize("how", ["limit", "override"])
def test_a_stored_limit(how):
    """A program that has the limit stored takes it at bit 6 of S_ZSW1B, as dynamic limit or as override:
    nothing trips.
    """
    with build() as bench:
        rig = Rig(bench, 400.0)
        rig.faults.inject("safety.sls", "drive1")
        assert bench.run_until(lambda: rig.word() & 0x0040, 1.0)
        if how == "limit":
            rig.axis.write("DynamicLimits.Velocity", 200.0)
        else:
            rig.axis.write("Override.Velocity", 50.0)
        bench.run_for(1.5)
        assert rig.speed() == pytest.approx(200.0, abs=1.0)
        assert [number for number in rig.alarms() if number >= 504] == []


@pytest.mark.requirement("CFG-469", "CFG-470", "CFG-495")
@pytest.mark.parametrize("reacts", [True, False])
def test_a_stored_range(reacts):
    """SLP from -100 to 100 mm: the drive tells no range; a program that limits its targets goes on, another
    one is stopped.
    """
    with build() as bench:
        rig = Rig(bench, 50.0)
        rig.faults.inject("safety.slp", "drive1", range=1)
        bench.run_for(0.3)
        assert bench.run_until(rig.axis.home(rig.drive.mechanics.position * 1000.0).done, 1.0)
        job = rig.axis.move_absolute(90.0 if reacts else 150.0)
        bench.run_for(4.0)
        assert job.Done is reacts
        assert (rig.alarms() == []) is reacts
        assert rig.drive.mechanics.position * 1000.0 < 125.0


@pytest.mark.requirement("CFG-450", "CFG-444", "CFG-610")
def test_emergency_stop_of_two_drives():
    """SS1 in both: each brakes on its own ramp from its own speed to rest, then STO keeps it there."""
    text = load_bench("profidrive").text.replace("[axis.axis1]\n", f"{TABLES}\n[axis.axis1]\n")
    with BenchFile("own.toml", text + SECOND).build(seed=7) as bench:
        axes = [bench.axis(name) for name in ("axis1", "axis2")]
        drives = [bench.drive(name) for name in ("drive1", "drive2")]
        powers = [axis.power() for axis in axes]
        assert bench.run_until(lambda: all(power.Status for power in powers), 2.0)
        for axis, speed in zip(axes, (200.0, 100.0), strict=True):
            axis.move_velocity(speed)
        bench.run_for(0.8)
        faults = Injector(bench)
        for name in ("drive1", "drive2"):
            faults.inject("drive.ss1", name)
        start = bench.now_s
        rest = {}
        for _ in range(200):
            bench.run_for(0.01)
            for name, drive in zip(("drive1", "drive2"), drives, strict=True):
                if name not in rest and abs(drive.mechanics.velocity) < 1e-4:
                    rest[name] = bench.now_s - start
        # From p1082 = 3000 rpm the ramps take 0.5 s and 1.5 s; 200 mm/s are 1200 rpm, 100 mm/s 600 rpm.
        assert rest["drive1"] == pytest.approx(0.5 * 1200 / 3000, abs=0.06)
        assert rest["drive2"] == pytest.approx(1.5 * 600 / 3000, abs=0.06)
        for axis in axes:
            axis.move_velocity(50.0)
        bench.run_for(0.5)
        assert all(abs(drive.mechanics.velocity) < 1e-4 for drive in drives)
        assert all(axis.var("ErrorDetail.Number") in {421, 550} for axis in axes)
