"""`MC_GearOut`: a following axis leaves its gear and stops at a position (SYN section 7.6)."""

from __future__ import annotations

from itertools import pairwise

import pytest

from testcases.unit.motion_axis.conftest import CYCLE
from testcases.unit.motion_axis.override_cells import cam_of
from testcases.unit.motion_axis.test_gear_in import SYNCHRONOUS, places, word
from testcases.unit.motion_axis.test_gear_in_pos import MODULO, TAGS, standing, travel, until_place

DESYNCHRONIZING, STANDSTILL = 1 << 1, 1 << 7


def in_gear(numerator=1, denominator=1, *, velocity=100.0, **options):
    """A gear with y = x * ratio from zero on, and a leading axis with a constant velocity."""
    rig = standing(**options)
    rig.gear = rig.axis.gear_in_pos(rig.leader, 0.0, 0.0, numerator, denominator)
    rig.until(rig.gear.in_sync)
    if velocity:
        travel(rig, velocity)
    return rig


def status(rig):
    """Desynchronising bit, FunctionState, WaitingFunctionState."""
    read = rig.axis.var
    return (
        bool(read("StatusWord2") & DESYNCHRONIZING),
        read(TAGS + "FunctionState"),
        read(TAGS + "WaitingFunctionState"),
    )


@pytest.mark.requirement(
    "SYN-351", "SYN-129", "SYN-130", "SYN-205", "SYN-207", "SYN-091", "SYN-092", "SYN-093", "SYN-206"
)
def test_over_a_distance():
    """From y = 175 on along the polynomial to 200, reached when the leading axis has gone 50 mm; outputs,
    bits and variables say which phase it is.
    """
    rig = in_gear()
    job = rig.axis.gear_out(200.0, MasterStopDistance=50.0)
    until_place(rig, 174.0)
    assert (job.Busy, job.StartSyncOut, rig.gear.InSync) == (True, False, True)
    assert (word(rig.axis), status(rig)) == (SYNCHRONOUS, (False, 2, 4))
    rig.until(job.start_sync_out)
    assert places(rig)[0] == pytest.approx(175.0, abs=0.9)
    assert (rig.gear.CommandAborted, word(rig.axis), status(rig)) == (True, 0, (True, 4, 0))
    assert rig.axis.var(TAGS + "ActualMaster") == rig.leader.object.db_number
    while not job.Done:
        x, y = places(rig)
        z = min((x - 175.0) / 50.0, 1.0)
        assert y == pytest.approx(175.0 + 25.0 * (2.0 * z - 2.0 * z**3 + z**4), abs=1e-9)
        rig.cycles()
    assert places(rig)[0] == pytest.approx(225.0, abs=1.3)
    rig.cycles(5)
    assert (rig.axis.var("Position"), rig.axis.var("Velocity")) == (200.0, 0.0)
    assert (word(rig.axis), status(rig), job.StartSyncOut, job.Busy) == (0, (False, 0, 0), False, False)
    assert rig.axis.var(TAGS + "ActualMaster") == 0
    assert rig.axis.var("StatusWord") & STANDSTILL


@pytest.mark.requirement("SYN-131", "SYN-212", "SYN-434")
@pytest.mark.parametrize("stops", [False, True])
def test_with_dynamic_values(stops):
    """Braking with 1000 mm/s2 begins 5 mm before the stop position, and does not depend on the leading axis
    any more.
    """
    rig = in_gear()
    job = rig.axis.gear_out(200.0, SyncProfileReference=0, Deceleration=1000.0, Jerk=0.0)
    rig.until(job.start_sync_out)
    begun = rig.scheduler.now
    assert places(rig)[1] == pytest.approx(195.0, abs=0.9)
    assert rig.gear.CommandAborted
    if stops:
        rig.leader.stop(0)
    rig.until(job.done)
    assert (rig.scheduler.now - begun) / 1e9 == pytest.approx(0.1, abs=3.0 * CYCLE)
    assert rig.axis.var("Position") == 200.0
    velocities = rig.column("velocity_setpoint")
    assert max(a - b for a, b in pairwise(velocities)) <= 1000.0 * CYCLE + 1e-6


@pytest.mark.requirement("SYN-210")
def test_over_a_distance_the_leading_axis_is_waited_for():
    """It stops half way, and the axis with it; it goes on, and the axis comes to its position."""
    rig = in_gear()
    job = rig.axis.gear_out(200.0, MasterStopDistance=50.0)
    rig.until(job.start_sync_out)
    rig.leader.move_absolute(200.0)
    rig.run(1.0)
    assert (job.Busy, job.Done, rig.axis.var("Position")) == (True, False, pytest.approx(195.3125))
    travel(rig, 100.0)
    rig.until(job.done)
    assert rig.axis.var("Position") == 200.0


@pytest.mark.requirement("SYN-211")
def test_a_reversal_over_a_distance_is_an_alarm():
    """Alarm 608, and the job ends with 16#8001."""
    rig = in_gear()
    job = rig.axis.gear_out(200.0, MasterStopDistance=50.0)
    rig.until(job.start_sync_out)
    travel(rig, -100.0)
    rig.until(job.error)
    assert (job.ErrorID, rig.alarms_of("axis1")) == (0x8001, [608])


@pytest.mark.requirement("SYN-204", "SYN-202")
@pytest.mark.parametrize("profile", [0, 1])
def test_the_direction_is_waited_for(profile):
    """In the wrong direction the stop position is passed; the axis leaves its gear on the way back."""
    rig = in_gear()
    job = rig.axis.gear_out(100.0, SyncProfileReference=profile, MasterStopDistance=40.0, SyncOutDirection=2)
    until_place(rig, 150.0)
    assert (job.Busy, job.StartSyncOut, rig.gear.InSync) == (True, False, True)
    travel(rig, -100.0)
    rig.until(job.done)
    assert rig.axis.var("Position") == 100.0


@pytest.mark.requirement("SYN-412")
@pytest.mark.parametrize("profile", [0, 1])
def test_the_next_place_of_a_modulo_range(profile):
    """A stop position that is too near is that of the next turn, and ways over several turns are gone."""
    rig = in_gear(4, 1, follower=MODULO | {"DynamicLimits.MaxVelocity": 2000.0})
    until_place(rig, 95.0)
    job = rig.axis.gear_out(30.0, SyncProfileReference=profile, MasterStopDistance=200.0, Deceleration=200.0)
    rig.until(job.done, 10.0)
    assert rig.axis.var("Position") == pytest.approx(30.0)
    assert places(rig)[1] == pytest.approx(30.0 + 3 * 360.0)


@pytest.mark.requirement("SYN-208", "SYN-209", "SYN-332", "SYN-436", "CAM-145")
def test_what_it_ends():
    """Only gears; without one 16#8077. A gear that waits ends at once; profile 5 ends what waits, and nothing
    else.
    """
    rig = standing()
    none = rig.axis.gear_out(10.0, MasterStopDistance=1.0)
    rig.cycles(2)
    assert none.ErrorID == 0x8077
    waiting = rig.axis.gear_in_pos(rig.leader, 100.0, 0.0)
    rig.cycles(2)
    cam = rig.axis.cam_out(10.0, MasterStopDistance=1.0)
    rig.cycles(2)
    assert (cam.ErrorID, waiting.Busy) == (0x8078, True)
    job = rig.axis.gear_out(10.0, MasterStopDistance=1.0)
    rig.cycles(2)
    assert (waiting.CommandAborted, job.Done) == (True, True)
    rig = in_gear()
    first = rig.axis.gear_out(5000.0, MasterStopDistance=1.0)
    second = rig.axis.gear_out(6000.0, MasterStopDistance=1.0)
    rig.cycles(2)
    assert (first.CommandAborted, second.Busy) == (True, True)
    cancel = rig.axis.gear_out(0.0, SyncProfileReference=5)
    rig.cycles(2)
    assert (second.CommandAborted, cancel.Done, rig.gear.InSync) == (True, True, True)
    cam = cam_of(rig)
    later = rig.axis.cam_in(rig.leader, cam, MasterOffset=5000.0, MasterStartDistance=1.0)
    rig.cycles(2)
    cancel = rig.axis.cam_out(0.0, SyncProfileReference=5)
    rig.cycles(2)
    assert (later.CommandAborted, cancel.Done, rig.gear.InSync) == (True, True, True)


@pytest.mark.requirement("SYN-437", "SYN-134")
def test_a_stop_is_not_left():
    """16#800F while MC_Stop holds the axis."""
    rig = in_gear()
    rig.axis.stop(0)
    rig.cycles(2)
    job = rig.axis.gear_out(200.0, MasterStopDistance=50.0)
    rig.cycles(2)
    assert job.ErrorID == 0x800F


@pytest.mark.requirement("SYN-279", "SYN-338")
def test_active_homing_is_refused():
    """16#80A1 while the positions of the axis follow, and the gear goes on."""
    rig = in_gear()
    home = rig.axis.home(0.0, mode=3)
    rig.cycles(3)
    assert (home.ErrorID, rig.gear.InSync) == (0x80A1, True)


def test_a_gear_that_ends_otherwise_ends_the_waiting_job():
    """There is nothing to leave any more."""
    rig = standing(follower={"VirtualAxis.Mode": 0})
    travel(rig, 50.0)
    gear = rig.axis.gear_in(rig.leader)
    rig.until(gear.in_gear)
    job = rig.axis.gear_out(5000.0, MasterStopDistance=50.0)
    rig.cycles(2)
    rig.axis.home(0.0, mode=3)
    rig.cycles(3)
    assert (gear.CommandAborted, job.CommandAborted, status(rig)) == (True, True, (False, 0, 0))


@pytest.mark.requirement("SYN-198", "SYN-199", "SYN-200", "SYN-202")
@pytest.mark.parametrize(
    ("inputs", "error"),
    [
        ({"SyncProfileReference": 2}, 0x8036),
        ({"SlavePosition": float("inf")}, 0x8037),
        ({"MasterStopDistance": 0.0}, 0x8026),
        ({"SyncOutDirection": 0}, 0x8007),
        ({"SyncProfileReference": 0, "Deceleration": 0.0}, 0x8005),
        ({"Deceleration": 0.0}, 0),
        ({"SyncProfileReference": 0, "MasterStopDistance": 0.0}, 0),
    ],
)
def test_wrong_inputs(inputs, error):
    """Every input that is not permitted has its ErrorID; what the profile does not use is not looked at."""
    rig = in_gear()
    job = rig.axis.gear_out(5000.0, MasterStopDistance=50.0)
    job.set(**inputs)
    rig.cycles(3)
    assert (job.ErrorID, job.Busy, rig.gear.InSync) == (error, not error, True)
