"""`MC_GearInPos`: absolute gearing (SYN sections 5, 6 and 7.2)."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.test_gear_in import FIXTURE, SYNCHRONIZING, SYNCHRONOUS, places, word

TAGS = "StatusSynchronizedMotion."
MODULO = {"Modulo.Enable": True, "Modulo.Length": 360.0}


def standing(*, at=0.0, leader_at=0.0, leader=None, follower=None):
    """Leading and following axis, enabled, homed and at rest at these positions."""
    rig = Rig(
        synchronous=True, variables=FIXTURE | (follower or {}), leader_variables=FIXTURE | (leader or {})
    )
    rig.enabled().leader_at(0.0)
    rig.axis.home(at)
    rig.leader.home(leader_at)
    rig.cycles(3)
    assert (rig.leader.var("Position"), rig.axis.var("Position")) == (leader_at, at)
    rig.rows.clear()
    return rig


def travel(rig, velocity, **inputs):
    """Let the leading axis keep a velocity, from this cycle on."""
    rig.leader.move_velocity(velocity, Acceleration=5000.0, Deceleration=5000.0, Jerk=0.0, **inputs)


def phase(job):
    """Busy, StartSync, InSync."""
    return job.Busy, job.StartSync, job.InSync


def until_place(rig, x):
    """Go on until the leading setpoint has reached `x` in positive direction."""
    rig.until(lambda: rig.leader.object.servo.total.s >= x - 1e-9, 20.0)


@pytest.mark.requirement("SYN-121", "SYN-156", "SYN-163", "SYN-086", "SYN-089", "SYN-090", "SYN-099")
def test_in_advance_over_a_distance():
    """Waiting up to 50 mm before the synchronous position, then the polynomial, then y = x - 75; outputs,
    status bits and variables say which.
    """
    rig = standing()
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 25.0, MasterStartDistance=50.0)
    travel(rig, 100.0)
    read = rig.axis.var
    until_place(rig, 49.0)
    assert phase(job) == (True, False, False)
    assert (word(rig.axis), read(TAGS + "FunctionState"), read(TAGS + "WaitingFunctionState")) == (0, 0, 2)
    assert (read(TAGS + "ActualMaster"), rig.axis.var("Position")) == (0, 0.0)
    until_place(rig, 75.0)
    x, y = places(rig)
    z = (x - 50.0) / 50.0
    assert y == pytest.approx(25.0 * (2.0 * z**3 - z**4), abs=1e-9)
    assert y == pytest.approx(4.6875, abs=0.3)
    assert rig.axis.var("Velocity") == pytest.approx(25.0 * (6.0 * z**2 - 4.0 * z**3) * 2.0)
    assert phase(job) == (True, True, False)
    assert (word(rig.axis), read(TAGS + "FunctionState"), read(TAGS + "WaitingFunctionState")) == (
        SYNCHRONIZING, 2, 0,
    )  # fmt: skip
    assert read(TAGS + "ActualMaster") == rig.leader.object.db_number
    until_place(rig, 99.0)
    assert not job.InSync
    until_place(rig, 100.0)
    rig.cycles()
    assert phase(job) == (True, False, True)
    assert (word(rig.axis), read(TAGS + "FunctionState")) == (SYNCHRONOUS, 2)
    travel(rig, -70.0)
    for _ in range(100):
        rig.cycles()
        x, y = places(rig)
        assert y == pytest.approx(x - 75.0, abs=1e-9)
    assert job.InSync


@pytest.mark.requirement("SYN-122", "SYN-158")
def test_subsequently_over_a_distance():
    """Synchronising begins at MasterSyncPosition and ends a distance later, on the line through the
    synchronous positions.
    """
    rig = standing()
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 0.0, SyncProfileReference=3, MasterStartDistance=50.0)
    travel(rig, 100.0)
    until_place(rig, 99.0)
    assert not job.StartSync
    seen = []
    rig.runtime.after_cycle.append(lambda: seen.append((*places(rig), rig.axis.var("Velocity"))))
    until_place(rig, 150.0)
    rig.cycles(2)
    for x, y, _ in seen:
        z = min(max((x - 100.0) / 50.0, 0.0), 1.0)
        line = x - 100.0 if z == 1.0 else 50.0 * (6.0 * z**3 - 8.0 * z**4 + 3.0 * z**5)
        assert y == pytest.approx(line, abs=1e-9)
    assert max(v for *_, v in seen) == pytest.approx(151.2, abs=0.05)
    assert job.InSync


@pytest.mark.requirement("SYN-160")
@pytest.mark.parametrize(("profile", "start", "end"), [(1, -50.0, -100.0), (3, -100.0, -150.0)])
def test_a_negative_leading_motion_mirrors_the_positions(profile, start, end):
    """Synchronising begins and ends on the other side of the synchronous position."""
    rig = standing()
    job = rig.axis.gear_in_pos(
        rig.leader, -100.0, 25.0, SyncProfileReference=profile, MasterStartDistance=50.0
    )
    travel(rig, -100.0)
    rig.until(job.start_sync)
    assert places(rig)[0] == pytest.approx(start, abs=0.9)
    rig.until(job.in_sync)
    assert places(rig)[0] == pytest.approx(end, abs=0.9)
    x, y = places(rig)
    assert y == pytest.approx(x + 125.0, abs=1e-9)


@pytest.mark.requirement("SYN-123", "SYN-124", "SYN-125", "SYN-434")
@pytest.mark.parametrize(
    ("way", "velocity", "start", "duration"),
    [(5.0, 200.0, 90.0, 0.1), (15.0, 200.0, 81.716, 0.182843), (15.0, 120.0, 81.333, 0.186667)],
)
def test_in_advance_with_dynamic_values(way, velocity, start, duration):
    """The time-optimal profile begins where it ends together with the leading axis."""
    rig = standing()
    job = rig.axis.gear_in_pos(
        rig.leader, 100.0, way, SyncProfileReference=0,
        Velocity=velocity, Acceleration=1000.0, Deceleration=1000.0, Jerk=0.0,
    )  # fmt: skip
    travel(rig, 100.0)
    rig.until(job.start_sync)
    begun = rig.scheduler.now
    assert places(rig)[0] == pytest.approx(start, abs=0.9)
    rig.until(job.in_sync)
    assert (rig.scheduler.now - begun) / 1e9 == pytest.approx(duration, abs=2.0 * CYCLE)
    assert places(rig)[0] == pytest.approx(100.0, abs=0.9)
    velocities = rig.column("velocity_setpoint")
    assert max(velocities) <= velocity + 1e-6
    assert max(abs(b - a) for a, b in pairwise(velocities)) <= 1000.0 * CYCLE + 1e-6
    rig.run(0.3)
    x, y = places(rig)
    assert y == pytest.approx(x - 100.0 + way, abs=1e-9)


@pytest.mark.requirement("SYN-471", "SYN-157")
def test_a_leading_axis_that_is_too_near_has_to_come_again():
    """Between start and synchronous position the job waits, until the start position is passed."""
    rig = standing(leader_at=70.0)
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 25.0, MasterStartDistance=50.0)
    travel(rig, 100.0)
    rig.run(0.6)
    assert phase(job) == (True, False, False)
    rig.until(rig.leader.move_absolute(20.0).done)
    assert phase(job) == (True, False, False)
    travel(rig, 100.0)
    rig.until(job.in_sync)
    assert places(rig)[0] == pytest.approx(100.0, abs=0.9)


@pytest.mark.requirement("SYN-159", "SYN-164", "SYN-416")
@pytest.mark.parametrize("profile", [0, 1, 3])
def test_axes_that_are_in_place_are_synchronous_at_once(profile):
    """Without StartSync, as soon as both stand at their synchronous positions; the job itself moves
    nothing.
    """
    rig = standing(at=25.0, leader_at=100.0)
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 25.0, 2, 1, SyncProfileReference=profile)
    rig.cycles(3)
    assert phase(job) == (True, False, True)
    assert word(rig.axis) == SYNCHRONOUS
    rig = standing(at=10.0, leader_at=100.0)
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 25.0, 2, 1, SyncProfileReference=profile)
    rig.run(1.0)
    assert (phase(job), rig.axis.var("Position")) == ((True, False, False), 10.0)
    rig.axis.move_absolute(25.0)
    rig.until(job.in_sync)
    assert rig.axis.var("Position") == pytest.approx(25.0)


@pytest.mark.requirement("SYN-161", "SYN-419")
@pytest.mark.parametrize(("direction", "way"), [(1, 20.0), (2, -340.0), (3, 20.0)])
def test_direction_of_a_modulo_follower(direction, way):
    """From 350 to 10 degrees: the short way forwards, the long one backwards, or the shorter one."""
    rig = standing(at=350.0, follower=MODULO)
    job = rig.axis.gear_in_pos(
        rig.leader, 200.0, 10.0, 1, 100, MasterStartDistance=150.0, SyncDirection=direction
    )
    begun = places(rig)[1]
    travel(rig, 100.0)
    rig.until(job.in_sync)
    x, y = places(rig)
    assert y - begun == pytest.approx(way + 0.01 * (x - 200.0), abs=1e-9)


@pytest.mark.requirement("SYN-162")
def test_a_modulo_leading_axis_starts_in_the_turn_before():
    """With 30 degrees and 50 degrees of synchronising the start is at 340 degrees, of the turn before."""
    for profile, begun, end in ((1, 300.0, 30.0), (0, 300.0, 30.0), (0, 100.0, 390.0)):
        rig = standing(leader_at=begun, leader=MODULO)
        job = rig.axis.gear_in_pos(
            rig.leader, 30.0, 25.0, SyncProfileReference=profile, MasterStartDistance=50.0
        )
        travel(rig, 100.0)
        rig.until(job.start_sync)
        assert profile == 0 or rig.leader.var("Position") == pytest.approx(340.0, abs=0.9)
        rig.until(job.in_sync)
        x, y = places(rig)
        assert (x, y) == (pytest.approx(end, abs=0.9), pytest.approx(25.0 + x - end, abs=1e-9))


@pytest.mark.requirement("SYN-128")
def test_a_way_against_the_direction_is_an_alarm():
    """A follower that would have to swing back first, and may not: alarm 608."""
    rig = standing(at=20.0, follower=MODULO)
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 25.0, MasterStartDistance=50.0, SyncDirection=1)
    travel(rig, 100.0)
    rig.until(job.error)
    assert (job.ErrorID, rig.alarms_of("axis1")) == (0x8001, [608])


@pytest.mark.requirement("SYN-127")
@pytest.mark.parametrize("profile", [0, 1, 3])
def test_a_reversal_while_synchronising_is_an_alarm(profile):
    """Alarm 608, and the job ends with 16#8001; before StartSync a reversal does not matter."""
    rig = standing(leader_at=0.0)
    job = rig.axis.gear_in_pos(
        rig.leader, 100.0, 40.0, SyncProfileReference=profile, MasterStartDistance=50.0,
        Acceleration=200.0, Deceleration=200.0,
    )  # fmt: skip
    travel(rig, 100.0)
    rig.run(0.1)
    travel(rig, -100.0)
    rig.run(0.1)
    assert rig.alarms_of("axis1") == []
    travel(rig, 100.0)
    rig.until(job.start_sync)
    rig.run(0.05)
    travel(rig, -100.0)
    rig.until(job.error)
    assert (job.ErrorID, rig.alarms_of("axis1"), job.StartSync) == (0x8001, [608], False)


@pytest.mark.requirement("SYN-253", "SYN-254", "SYN-098", "SYN-102", "OVR-096", "OVR-100")
def test_a_waiting_job_leaves_the_active_one_alone():
    """MC_MoveVelocity keeps InVelocity until StartSync comes, and ends with CommandAborted in that cycle;
    MC_Halt ends it, and leaves the waiting job alone.
    """
    for halts in (False, True):
        rig = standing(leader_at=100.0)
        move = rig.axis.move_velocity(50.0)
        rig.until(move.in_velocity)
        rig.leader.home(100.0)
        rig.axis.home(0.0)
        job = rig.axis.gear_in_pos(rig.leader, 300.0, 200.0, MasterStartDistance=50.0)
        travel(rig, 100.0)
        rig.run(0.5)
        assert (phase(job), move.InVelocity) == ((True, False, False), True)
        if halts:
            rig.until(rig.axis.halt().done)
            assert (move.CommandAborted, phase(job)) == (True, (True, False, False))
        while not job.StartSync:
            assert halts or move.InVelocity
            rig.cycles()
        assert move.CommandAborted
        assert places(rig)[0] == pytest.approx(250.0, abs=0.9)
        rig.until(job.in_sync)
        assert places(rig)[0] == pytest.approx(300.0, abs=0.9)
        velocities = rig.column("velocity_setpoint")
        assert max(abs(b - a) for a, b in pairwise(velocities)) < 5000.0 * CYCLE


@pytest.mark.requirement("SYN-087", "SYN-283")
def test_a_gear_goes_on_while_another_one_waits():
    """The status is that of the active gear; a second waiting job ends the first one."""
    rig = standing()
    travel(rig, 50.0)
    first = rig.axis.gear_in(rig.leader, 2, 1)
    rig.until(first.in_gear)
    second = rig.axis.gear_in_pos(rig.leader, 500.0, 0.0)
    third = rig.axis.gear_in_pos(rig.leader, 400.0, 500.0, MasterStartDistance=80.0)
    rig.cycles(3)
    assert (first.InGear, second.CommandAborted, phase(third)) == (True, True, (True, False, False))
    assert (rig.axis.var(TAGS + "FunctionState"), rig.axis.var(TAGS + "WaitingFunctionState")) == (1, 2)
    assert word(rig.axis) == SYNCHRONOUS
    rig.until(third.start_sync, 20.0)
    assert first.CommandAborted
    rig.until(third.in_sync)
    assert rig.axis.var(TAGS + "FunctionState") == 2


@pytest.mark.requirement("SYN-292", "SYN-097")
def test_disabling_ends_a_waiting_job():
    """It does not come back with the enable."""
    rig = standing()
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 0.0)
    rig.cycles(2)
    rig.power.set(Enable=False)
    rig.cycles(2)
    assert (job.CommandAborted, rig.axis.var(TAGS + "WaitingFunctionState")) == (True, 0)


@pytest.mark.requirement("SYN-381", "SYN-467", "SYN-481")
def test_an_axis_that_is_not_homed():
    """Alarm 321 with reaction 3, ErrorWord.X3, and 16#8001."""
    rig = Rig(synchronous=True, variables={"VirtualAxis.Mode": 0}, leader_variables=FIXTURE)
    rig.enabled().leader_at(0.0)
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 0.0)
    rig.cycles(3)
    (alarm,) = rig.axis.object.engine.pending
    assert (job.ErrorID, alarm.number, alarm.reaction, rig.axis.var("ErrorWord.X3")) == (0x8001, 321, 3, True)


@pytest.mark.requirement("SYN-149", "SYN-150", "SYN-151", "SYN-152", "SYN-154")
@pytest.mark.parametrize(
    ("inputs", "error"),
    [
        ({"MasterSyncPosition": float("nan")}, 0x8034),
        ({"SlaveSyncPosition": 2e12}, 0x8035),
        ({"SyncProfileReference": 2}, 0x8036),
        ({"SyncProfileReference": 5}, 0x8036),
        ({"MasterStartDistance": 0.0}, 0x8026),
        ({"MasterStartDistance": -1.0, "SyncProfileReference": 3}, 0x8026),
        ({"SyncDirection": 4}, 0x8007),
        ({"RatioNumerator": 0}, 0x8017),
        ({"Velocity": 0.0, "SyncProfileReference": 0}, 0x8003),
        ({"Velocity": 0.0}, 0),
        ({"MasterStartDistance": 0.0, "SyncProfileReference": 0}, 0),
    ],
)
def test_wrong_inputs(inputs, error):
    """Every input that is not permitted has its ErrorID; what the profile does not use is not looked at."""
    rig = standing()
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 0.0)
    job.set(**inputs)
    rig.cycles(3)
    assert (job.ErrorID, job.Busy) == (error, not error)


@pytest.mark.requirement("SYN-174", "SYN-333")
def test_velocity_gearing_without_position_control_refuses_it():
    """16#8079, and the velocity gearing goes on."""
    rig = Rig(synchronous=True, variables={"VirtualAxis.Mode": 0}, leader_variables=FIXTURE)
    rig.enabled().leader_at(20.0)
    rig.axis.home(0.0)
    first = rig.axis.gear_in_velocity(rig.leader)
    rig.until(first.in_sync)
    job = rig.axis.gear_in_pos(rig.leader, 5000.0, 0.0)
    rig.cycles(3)
    assert (job.ErrorID, first.InSync) == (0x8079, True)


@pytest.mark.requirement("SYN-104", "SYN-306")
def test_dynamic_values_are_limited_with_a_warning():
    """501, 502 and 503, and the axis keeps to the limits of its configuration."""
    rig = standing(follower={"DynamicLimits.Velocity": 150.0})
    job = rig.axis.gear_in_pos(
        rig.leader, 200.0, 60.0, SyncProfileReference=0, Velocity=400.0, Acceleration=9000.0, Jerk=1e6
    )
    travel(rig, 100.0)
    rig.until(job.in_sync)
    assert sorted(rig.alarms_of("axis1")) == [501, 502, 503]
    assert max(rig.column("velocity_setpoint")) <= 150.0 + 1e-6


@pytest.mark.requirement("SYN-105", "SYN-411")
def test_a_distance_knows_no_dynamic_limits():
    """Over a distance the axis goes as fast as it takes, without an alarm; the status word says so."""
    rig = standing()
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 300.0, MasterStartDistance=50.0)
    bits = set()
    rig.runtime.after_cycle.append(lambda: bits.add(rig.axis.var(TAGS + "StatusWord")))
    travel(rig, 100.0)
    rig.until(job.in_sync)
    assert max(rig.column("velocity_setpoint")) > 900.0
    assert rig.alarms_of("axis1") == []
    assert {value & 1 for value in bits} == {0, 1}


@pytest.mark.exhaustive
@given(
    numerator=st.integers(-9, 9).filter(bool),
    denominator=st.integers(1, 9),
    profile=st.sampled_from([0, 1, 3, 4]),
    speed=st.floats(20.0, 60.0),
    slave=st.floats(-60.0, 60.0),
    start=st.floats(-40.0, 40.0),
    jerk=st.sampled_from([0.0, 20_000.0]),
)
def test_any_ratio_profile_and_place(numerator, denominator, profile, speed, slave, start, jerk):
    """Synchronous positions, once InSync, are on the line in every cycle whatever the leading axis does; with
    dynamic values the way there keeps to them.
    """
    rig = standing(follower={"DynamicLimits.MaxVelocity": 600.0, "DynamicLimits.Velocity": 600.0})
    job = rig.axis.gear_in_pos(
        rig.leader, 150.0, slave, numerator, denominator, SyncProfileReference=profile,
        MasterStartDistance=80.0, Velocity=300.0, Acceleration=1500.0, Deceleration=1500.0, Jerk=jerk,
    )  # fmt: skip
    if profile == 0 and start:
        rig.axis.move_velocity(start)
    travel(rig, speed)
    rig.until(lambda: job.InSync or job.Error, 30.0)
    assert job.InSync
    if profile == 0:
        velocities = rig.column("velocity_setpoint")
        most = max(300.0, abs(speed * numerator / denominator))
        assert max(map(abs, velocities)) <= most + 1e-3
        assert max(abs(b - a) for a, b in pairwise(velocities)) <= 1500.0 * CYCLE * 1.02
    for velocity in (speed, -speed):
        travel(rig, velocity)
        for _ in range(30):
            rig.cycles()
            x, y = places(rig)
            assert y == pytest.approx(slave + numerator * (x - 150.0) / denominator, abs=1e-9)
