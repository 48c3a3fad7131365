"""Function charts of synchronous operation as sequences with their printed numbers (SYN section 8), and what
limits the following axis in each phase (section 5).
"""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.override_cells import cam_of
from testcases.unit.motion_axis.test_gear_in import (
    FIXTURE,
    SYNCHRONIZING,
    SYNCHRONOUS,
    gear,
    in_gear,
    places,
    word,
)
from testcases.unit.motion_axis.test_gear_in_pos import standing, travel, until_place
from testcases.unit.motion_axis.test_leading_objects import behind_belt

SYNC = "StatusSynchronizedMotion."
DYNAMICS = {"Velocity": 50.0, "Acceleration": 1000.0, "Deceleration": 1000.0, "Jerk": 0.0}
EXCEEDED = {"velocity": 1, "acceleration": 2, "deceleration": 4}


def tag(rig, name):
    return rig.axis.var(f"{SYNC}{name}")


def ramp(rig, job, target, velocity):
    """Change the additive position evenly, with its velocity, until it is at `target`."""
    cycles = round(abs(target - job.Position) / (abs(velocity) * CYCLE))
    begin = job.Position
    for number in range(1, cycles + 1):
        job.set(Position=begin + (target - begin) * number / cycles, Velocity=velocity)
        rig.cycles()
    job.set(Velocity=0.0)


@pytest.mark.requirement("SYN-239", "SYN-240", "SYN-245", "SYN-032")
def test_additive_leading_value_chart_a():
    """While the follower synchronises the additive value rises, which makes leading value and follower
    faster, and falls again: the synchronous positions are those without it.
    """

    def course(additive):
        rig = standing()
        job = rig.axis.gear_in_pos(
            rig.leader, 300.0, 200.0, SyncProfileReference=0,
            Velocity=200.0, Acceleration=400.0, Deceleration=400.0, Jerk=0.0,
        )  # fmt: skip
        added = rig.axis.leading_value_additive(0.0)
        travel(rig, 100.0)
        rig.until(job.start_sync)
        seen = {}
        rig.runtime.after_cycle.append(
            lambda: seen.setdefault(round(places(rig)[0], 2), (rig.axis.var("Velocity"), word(rig.axis)))
        )
        start = places(rig)[0]
        if additive:
            rig.run(0.1)
            ramp(rig, added, 10.0, 50.0)
            assert tag(rig, "EffectiveLeadingValue.Velocity") == pytest.approx(150.0)
            rig.cycles()
            ramp(rig, added, 0.0, -50.0)
        rig.until(job.in_sync)
        x, y = places(rig)
        added.set(Enable=False)
        rig.cycles(2)
        assert places(rig)[1] == pytest.approx(places(rig)[0] - 100.0, abs=1e-9)
        return start, x, y, seen

    start, x, y, plain = course(False)
    other_start, other_x, other_y, added = course(True)
    assert (other_start, other_x, other_y) == (start, x, y)
    assert x == pytest.approx(300.0, abs=0.5)
    assert y == pytest.approx(200.0 + x - 300.0)
    middle = round(start + 0.2 * 100.0, 0)
    place = min(plain, key=lambda one: abs(one - middle))
    nearest = min(added, key=lambda one: abs(one - middle))
    assert added[nearest][0] > plain[place][0]


@pytest.mark.requirement("SYN-241", "SYN-228")
def test_the_effective_value_decides_on_the_synchronous_position():
    """With 20 mm added all the time the axis is synchronous 20 mm earlier by the leading axis."""
    rig = standing()
    rig.axis.leading_value_additive(20.0)
    job = rig.axis.gear_in_pos(rig.leader, 100.0, 25.0, MasterStartDistance=50.0)
    rig.cycles(2)
    travel(rig, 100.0)
    rig.until(job.start_sync)
    assert places(rig)[0] == pytest.approx(30.0, abs=0.9)
    rig.until(job.in_sync)
    assert places(rig)[0] == pytest.approx(80.0, abs=0.9)
    assert places(rig)[1] == pytest.approx(places(rig)[0] + 20.0 - 75.0, abs=1e-9)


@pytest.mark.requirement("SYN-242", "SYN-243", "SYN-478", "SYN-346")
@pytest.mark.parametrize("added", [100.0, 90.0])
def test_additive_leading_value_chart_b(added):
    """A = 100 (90): StartSync at 100 (90) of the leading axis, InSync at 200 (180); from there to 300 (270) A
    falls to 0: the effective value and the follower stand; afterwards both move on.
    """
    rig = standing()
    job = rig.axis.leading_value_additive(0.0)
    rig.cycles(2)
    ramp(rig, job, added, 500.0)
    sync = rig.axis.gear_in_pos(rig.leader, 3.0 * added, 0.0, MasterStartDistance=added)
    rig.cycles(2)
    travel(rig, 100.0)
    rig.until(sync.start_sync)
    assert places(rig)[0] == pytest.approx(added, abs=0.9)
    assert tag(rig, "EffectiveLeadingValue.Position") == pytest.approx(2.0 * added, abs=0.9)
    until_place(rig, 2.0 * added)
    rig.cycles(2)
    assert sync.InSync
    x, y = places(rig)
    effective = tag(rig, "EffectiveLeadingValue.Position")
    assert effective == pytest.approx(3.0 * added, abs=2.0)
    while job.Position > 1e-9:
        job.set(Position=max(job.Position - 100.0 * CYCLE, 0.0), Velocity=-100.0)
        rig.cycles()
        assert tag(rig, "EffectiveLeadingValue.Position") == pytest.approx(effective, abs=0.41)
        assert abs(rig.axis.var("Velocity")) <= 1e-6 or job.Position > added - 0.5
        assert places(rig)[1] == pytest.approx(y, abs=0.41)
    assert places(rig)[0] - x == pytest.approx(added, abs=1.0)
    job.set(Velocity=0.0)
    rig.run(0.1)
    y = places(rig)[1]
    job.set(Enable=False)
    rig.cycles(2)
    assert places(rig)[1] - y == pytest.approx(2 * 100.0 * CYCLE, abs=1e-9)


@pytest.mark.requirement("SYN-244")
def test_an_additive_value_that_makes_up_for_the_leading_axis():
    """From 100 to 200 while A falls from 100 to 0: the effective value is 200 throughout."""
    rig = in_gear(100.0)
    job = rig.axis.leading_value_additive(100.0)
    rig.cycles(3)
    rig.leader.home(100.0)
    rig.cycles(2)

    def given():
        """The value for the cycle in which it acts, which is the one after the next call of the program."""
        return 200.0 - rig.leader.var("Position") - 2 * 100.0 * CYCLE

    while given() > 0.0:
        job.set(Position=given(), Velocity=-100.0)
        rig.cycles()
        if job.Position < 98.0:
            assert tag(rig, "EffectiveLeadingValue.Position") == pytest.approx(200.0, abs=1e-9)
            assert tag(rig, "EffectiveLeadingValue.Velocity") == pytest.approx(0.0)
    assert job.Position < 1.0


@pytest.mark.requirement("SYN-224", "SYN-228")
def test_desynchronising_relates_to_the_effective_value():
    """An additive value that stands changes nothing of the stop position; one that rises while the follower
    leaves over a distance brings it there earlier by the leading axis.
    """
    ways = []
    for rises in (False, True):
        rig = in_gear(100.0)
        added = rig.axis.leading_value_additive(5.0)
        rig.cycles(3)
        target = rig.axis.var("Position") + 100.0
        job = rig.axis.gear_out(target, MasterStopDistance=50.0)
        rig.until(job.start_sync_out)
        x = places(rig)[0]
        if rises:
            ramp(rig, added, 15.0, 100.0)
        rig.until(job.done)
        ways.append(places(rig)[0] - x)
        assert (rig.axis.var("Position"), added.Busy) == (pytest.approx(target), True)
    assert ways[0] - ways[1] == pytest.approx(10.0, abs=1.0)


@pytest.mark.requirement("SYN-445", "SYN-377", "SYN-417")
@pytest.mark.parametrize(("profile", "begin", "end"), [(0, 95.0, 100.0), (1, 50.0, 100.0), (3, 100.0, 150.0)])
def test_the_chart_of_gear_in_pos(profile, begin, end):
    """Profile 0: the distance is calculated, from the speed of the leading axis as it is when the profile
    begins; 1 and 3: the dynamics are.
    """
    rig = standing()
    job = rig.axis.gear_in_pos(
        rig.leader, 100.0, 25.0, SyncProfileReference=profile, MasterStartDistance=50.0,
        Velocity=500.0, Acceleration=500.0, Deceleration=500.0, Jerk=0.0,
    )  # fmt: skip
    travel(rig, 20.0)
    rig.run(0.5)
    assert (job.Busy, job.StartSync, word(rig.axis), tag(rig, "WaitingFunctionState")) == (True, False, 0, 2)
    travel(rig, 100.0)
    rig.until(job.start_sync)
    assert word(rig.axis) == SYNCHRONIZING
    if profile != 0:
        assert places(rig)[0] == pytest.approx(begin, abs=0.9)
    else:
        # 25 mm to 100 mm/s with 500 mm/s2: up to 132.3 mm/s and down again, 0.329 s at 100 mm/s
        assert 100.0 - places(rig)[0] == pytest.approx(32.9, abs=0.9)
    rig.until(job.in_sync)
    assert (word(rig.axis), places(rig)[0]) == (SYNCHRONOUS, pytest.approx(end, abs=0.9))
    assert places(rig)[1] == pytest.approx(25.0 + places(rig)[0] - 100.0, abs=1e-9)


@pytest.mark.requirement("SYN-446", "SYN-447", "SYN-448", "SYN-426")
@pytest.mark.parametrize("kind", ["phasing", "offset"])
def test_the_charts_of_phasing_and_offset(kind):
    """A shift of 90 and again the same: nothing; relative and back: the variable is what it was; profile 1
    from here, then 2 from a position; while the leading axis stands profile 1 is active, and goes no further.
    """
    rig = in_gear(100.0)
    axis, name = rig.axis, "PhaseShift" if kind == "phasing" else "Offset"
    covered = "CoveredPhaseShift" if kind == "phasing" else "CoveredOffset"
    total = "AbsolutePhaseShift" if kind == "phasing" else "AbsoluteOffset"

    def shift(relative, value, **inputs):
        if kind == "phasing":
            start = axis.phasing_relative if relative else axis.phasing_absolute
            return (
                start(value, PhasingDistance=40.0, ProfileReference=1)
                if not inputs
                else start(value, PhasingDistance=40.0, **inputs)
            )
        start = axis.offset_relative if relative else axis.offset_absolute
        return start(value, 40.0, **inputs)

    job = shift(False, 90.0)
    before, values = places(rig), []
    while not job.Done:
        rig.cycles()
        values.append(getattr(job, total))
    assert values == sorted(values)
    assert (tag(rig, name), values[-1]) == (90.0, 90.0)
    again = shift(False, 90.0)
    rig.cycles(2)
    assert (again.Done, tag(rig, name)) == (True, 90.0)
    for value in (7.0, -7.0):
        job = shift(True, value)
        rig.until(job.done)
        assert getattr(job, covered) == pytest.approx(value)
    assert tag(rig, name) == pytest.approx(90.0)
    start = places(rig)[0] + 30.0
    job = shift(True, 5.0, ProfileReference=2, StartPosition=start)
    rig.until(job.start_phasing if kind == "phasing" else job.start_offset)
    assert places(rig)[0] == pytest.approx(start, abs=0.9)
    rig.until(job.done)
    assert places(rig)[0] == pytest.approx(start + 40.0, abs=0.9)
    x, y = places(rig)
    assert y - before[1] == pytest.approx(x - before[0] + 95.0, abs=1.0)
    rig.until(rig.leader.halt().done)
    job = shift(True, 5.0)
    rig.run(0.3)
    begun = job.StartPhasing if kind == "phasing" else job.StartOffset
    assert (begun, job.Busy, getattr(job, covered)) == (True, True, 0.0)


@pytest.mark.requirement("SYN-427", "SYN-433", "SYN-185", "SYN-487")
def test_directions_and_refusals_of_shifts():
    """Direction 1 and a leading value that goes back: nothing is shifted until it goes forward, and that is
    no error; while one kind waits the other is refused.
    """
    rig = in_gear(-50.0)
    for phasing in (True, False):
        travel(rig, -50.0)
        rig.run(0.1)
        way = {"ProfileReference": 1, "PhasingDistance": 20.0, "Direction": 1}
        if phasing:
            one = rig.axis.phasing_relative(4.0, **way)
        else:
            one = rig.axis.offset_relative(4.0, 20.0, Direction=1)
        rig.run(0.3)
        started = one.StartPhasing if phasing else one.StartOffset
        assert (started, one.Busy, one.Error) == (False, True, False)
        other = rig.axis.offset_relative(1.0, 5.0) if phasing else rig.axis.phasing_relative(1.0)
        rig.cycles(2)
        assert other.ErrorID == 0x808A
        travel(rig, 50.0)
        rig.until(one.done)


@pytest.mark.requirement("SYN-449", "SYN-206")
@pytest.mark.parametrize("profile", [0, 1])
def test_the_chart_of_gear_out(profile):
    """Execute - waiting with InSync - StartSyncOut without - Done at SlavePosition, standing."""
    rig = standing()
    gear_job = rig.axis.gear_in_pos(rig.leader, 100.0, 100.0, MasterStartDistance=50.0)
    travel(rig, 100.0)
    rig.until(gear_job.in_sync)
    job = rig.axis.gear_out(
        200.0, SyncProfileReference=profile, MasterStopDistance=50.0, Deceleration=1000.0, Jerk=0.0
    )
    rig.cycles(3)
    assert (gear_job.InSync, job.Busy, job.StartSyncOut, tag(rig, "FunctionState")) == (True, True, False, 2)
    rig.until(job.start_sync_out)
    rig.cycles()
    assert (gear_job.InSync, gear_job.CommandAborted, tag(rig, "FunctionState")) == (False, True, 4)
    rig.until(job.done)
    rig.run(0.3)
    assert (rig.axis.var("Position"), rig.axis.var("StatusWord.X7")) == (pytest.approx(200.0), True)
    assert (tag(rig, "FunctionState"), tag(rig, "ActualMaster")) == (0, 0)


@pytest.mark.requirement("SYN-247", "SYN-252")
def test_a_cam_that_never_moves_backwards_is_not_left():
    """MC_CamOut with SyncOutDirection 2 is Busy and waits, through all turns; the camming goes on."""
    rig = standing()
    cam = cam_of(rig, ((0.0, 0.0), (100.0, 100.0)))
    camming = rig.axis.cam_in(
        rig.leader, cam, MasterStartDistance=10.0, MasterSyncPosition=15.0, ApplicationMode=2
    )
    travel(rig, 100.0)
    rig.until(camming.in_sync)
    job = rig.axis.cam_out(150.0, MasterStopDistance=10.0, SyncOutDirection=2)
    rig.cycles(2)
    assert (job.Busy, job.StartSyncOut, tag(rig, "WaitingFunctionState")) == (True, False, 5)
    rig.run(3.0)
    assert (job.Busy, camming.InSync, rig.axis.var("Position") > 250.0) == (True, True, True)


@pytest.mark.requirement("SYN-438", "SYN-128")
@pytest.mark.parametrize(("direction", "alarms"), [(1, [608]), (3, [])])
def test_a_way_out_that_would_turn_round(direction, alarms):
    """A steep cam over a long distance swings beyond its stop position: with SyncOutDirection 1 alarm 608."""
    rig = standing()
    points = [(x, x + 0.05 * x * x) for x in range(0, 201, 2)]
    cam = cam_of(rig, points, **{"InterpolationSettings.InterpolationMode": 1})
    camming = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2)
    rig.until(camming.in_sync)
    job = rig.axis.cam_out(81.25, MasterStopDistance=100.0, SyncOutDirection=direction)
    rig.cycles(2)
    travel(rig, 40.0)
    rig.run(4.0)
    assert rig.alarms_of("axis1") == alarms
    assert (job.ErrorID, job.Done) == ((0x8001, False) if alarms else (0, True))


LIMITS = {"DynamicLimits.MaxVelocity": 100.0, "DynamicLimits.Velocity": 100.0}


@pytest.mark.requirement("SYN-103", "SYN-145", "SYN-406")
def test_limits_while_a_gear_synchronises():
    """Acceleration and jerk of the job are limited with alarms 502 and 503, the velocity without 501; InGear
    comes once the leading axis is slow enough.
    """
    limits = LIMITS | {"DynamicLimits.MaxAcceleration": 400.0, "DynamicLimits.MaxDeceleration": 400.0}
    rig = gear(150.0, follower=limits, Acceleration=900.0, Deceleration=900.0, Jerk=1e6)
    rig.run(1.0)
    assert sorted(set(rig.alarms_of("axis1"))) == [502, 503]
    assert (rig.axis.var("Velocity"), rig.job.InGear, tag(rig, "StatusWord")) == (100.0, False, 0)
    assert max(rig.column("acceleration_setpoint")) <= 400.0 + 1e-6
    travel(rig, 80.0)
    rig.until(rig.job.in_gear)


@pytest.mark.requirement("SYN-108", "SYN-405", "SYN-110", "SYN-107")
@pytest.mark.parametrize("what", ["dynamics", "phasing", "offset", "leaving"])
def test_limits_of_shifts_and_ways_out(what):
    """With dynamic values the velocity of the follower may be too high, the acceleration is limited with a
    warning; over a distance both may be: bits of StatusWord, no alarm.
    """
    limits = LIMITS | {"DynamicLimits.MaxAcceleration": 400.0, "DynamicLimits.MaxDeceleration": 400.0}
    rig = in_gear(90.0, follower=limits, Acceleration=300.0, Deceleration=300.0, Jerk=20000.0)
    rig.axis.reset()
    rig.run(0.1)
    rig.rows.clear()
    shown = []
    rig.runtime.after_cycle.append(lambda: shown.append(tag(rig, "StatusWord")))
    if what == "dynamics":
        job = rig.axis.phasing_absolute(
            20.0, Velocity=60.0, Acceleration=900.0, Deceleration=900.0, Jerk=20000.0
        )
    elif what == "phasing":
        job = rig.axis.phasing_absolute(20.0, ProfileReference=1, PhasingDistance=20.0)
    elif what == "offset":
        job = rig.axis.offset_absolute(20.0, 20.0)
    else:
        job = rig.axis.gear_out(rig.axis.var("Position") + 20.0, MasterStopDistance=6.0)
    rig.until(job.done)
    accelerations = rig.column("acceleration_setpoint")
    velocities = rig.column("velocity_setpoint")
    exceeded = 0
    for word_ in shown:
        exceeded |= word_
    if what == "dynamics":
        assert max(velocities) == pytest.approx(150.0)
        assert max(map(abs, accelerations)) <= 400.0 + 1e-6
        assert set(rig.alarms_of("axis1")) == {502}
        assert exceeded == EXCEEDED["velocity"]
    elif what == "leaving":
        assert min(accelerations) < -400.0
        assert (exceeded, rig.alarms_of("axis1")) == (EXCEEDED["deceleration"], [])
    else:
        assert exceeded == sum(EXCEEDED.values())
        assert rig.alarms_of("axis1") == []


@pytest.mark.requirement("SYN-109")
def test_limits_of_a_way_out_with_dynamic_values():
    """Deceleration and jerk of the job are limited by those of the axis."""
    limits = {"DynamicLimits.MaxDeceleration": 400.0}
    rig = in_gear(90.0, follower=limits)
    rig.rows.clear()
    job = rig.axis.gear_out(
        rig.axis.var("Position") + 60.0, SyncProfileReference=0, Deceleration=900.0, Jerk=0.0
    )
    rig.until(job.done)
    assert min(rig.column("acceleration_setpoint")) >= -400.0 - 1e-6


@pytest.mark.requirement("SYN-113", "SYN-307", "SYN-408", "SYN-366")
def test_a_leading_axis_that_is_too_fast_for_the_drive():
    """Above MaxVelocity: X0 and nothing else; above the speed of the drive: the output is limited, InGear
    stays, the following error grows until 522 and 521 take the enable.
    """
    drive = {"Actor.DriveParameter.MaxSpeed": 3000.0, "Actor.DriveParameter.ReferenceSpeed": 3000.0}
    rig = Rig(
        synchronous=True,
        variables=drive | {"DynamicLimits.MaxVelocity": 400.0, "DynamicLimits.Velocity": 400.0},
        leader_variables=FIXTURE | {"DynamicLimits.MaxVelocity": 900.0, "DynamicLimits.Velocity": 900.0},
    )
    rig.enabled().leader_at(100.0)
    job = rig.axis.gear_in(rig.leader)
    rig.until(job.in_gear)
    rig.until(rig.leader.move_velocity(450.0).in_velocity)
    rig.run(0.2)
    assert (rig.axis.var("Velocity"), tag(rig, "StatusWord")) == (pytest.approx(450.0), 1)
    assert [one for one in rig.alarms_of("axis1") if one in {521, 522}] == []
    rig.leader.move_velocity(700.0)
    rig.until(lambda: 522 in rig.alarms_of("axis1"))
    assert (job.InGear, word(rig.axis)) == (True, SYNCHRONOUS)
    assert abs(rig.axis.object.servo.speed_output_rpm) <= 3000.0 + 1e-6
    rig.until(lambda: 521 in rig.alarms_of("axis1"))
    rig.cycles(2)
    assert (job.ErrorID, rig.axis.var("ErrorDetail.Reaction")) == (0x8001, 4)


@pytest.mark.requirement("SYN-114", "SYN-308", "SYN-407")
@pytest.mark.parametrize("phase", ["gear", "velocity", "cam", "synchronising"])
def test_a_software_limit_switch_in_front_of_the_follower(phase):
    """Alarm 533 and a stop with the maximum dynamics, in front of the switch; the axis stays enabled, the job
    has 16#8001.
    """
    switch = {
        "PositionLimits_SW.Active": True, "PositionLimits_SW.MaxPosition": 100.0,
        "PositionLimits_SW.MinPosition": -1000.0,
    }  # fmt: skip
    rig = standing(follower=switch | {"DynamicLimits.MaxDeceleration": 1000.0})
    if phase == "gear":
        job = rig.axis.gear_in(rig.leader)
    elif phase == "velocity":
        job = rig.axis.gear_in_velocity(rig.leader, PositionControlled=True)
    elif phase == "cam":
        job = rig.axis.cam_in(rig.leader, cam_of(rig, ((0.0, 0.0), (500.0, 500.0))), SyncProfileReference=2)
    else:
        job = rig.axis.gear_in_pos(
            rig.leader, 300.0, 400.0, SyncProfileReference=3, MasterStartDistance=500.0
        )
        rig.leader.home(299.0)
    rig.cycles(3)
    rig.rows.clear()
    rig.leader.move_velocity(150.0, Acceleration=400.0, Jerk=4000.0)
    rig.until(lambda: job.Error)
    rig.run(0.5)
    assert (job.ErrorID, rig.alarms_of("axis1")) == (0x8001, [533])
    assert rig.axis.var("Position") <= 100.0 + 1e-6
    assert rig.axis.var("Position") == pytest.approx(100.0, abs=2.5)
    assert rig.axis.var("StatusWord.X0")
    assert min(rig.column("acceleration_setpoint")) == pytest.approx(-1000.0, rel=0.05)
    assert rig.axis.var("ErrorWord.X8")


@pytest.mark.requirement("SYN-115", "SYN-309", "SYN-028")
def test_a_software_limit_switch_that_is_passed():
    """A step of the leading value leaves no room to stop: alarm 534 with its reaction, and the job ends."""
    switch = {
        "PositionLimits_SW.Active": True, "PositionLimits_SW.MaxPosition": 100.0,
        "PositionLimits_SW.MinPosition": -1000.0,
    }  # fmt: skip
    rig = standing(follower=switch)
    job = rig.axis.gear_in(rig.leader)
    rig.until(job.in_gear)
    rig.leader.home(rig.leader.var("Position") + 130.0)
    rig.run(0.3)
    assert 534 in rig.alarms_of("axis1")
    assert (job.ErrorID, rig.axis.var("ErrorWord.X8")) == (0x8001, True)


@pytest.mark.requirement("SYN-390", "SYN-484")
@pytest.mark.parametrize("milliseconds", [1.0, 20.0])
def test_a_step_of_the_extrapolation_time(milliseconds):
    """At 100 mm/s the follower steps by v * dt in the next cycle, whatever that is."""
    rig = behind_belt()
    rig.until(rig.axis.gear_in(rig.encoder).in_gear)
    before = rig.axis.var("Position")
    rig.encoder.object.variables.write("Extrapolation.FollowingAxisDependentTime", milliseconds * 1e-3)
    rig.cycles()
    assert rig.axis.var("Position") - before == pytest.approx(0.4 + 0.1 * milliseconds)


@pytest.mark.requirement("SYN-483", "SYN-391")
@pytest.mark.parametrize(("hysteresis", "alarms"), [(0.0, [608]), (0.3, [])])
def test_noise_of_a_standing_encoder(hysteresis, alarms):
    """A gear that synchronises behind a standing encoder with noise: alarm 608; above the noise: in gear."""
    rig = behind_belt(
        0, **{"Hysteresis.Value": hysteresis, "VelocityFilter.T1": 0.1, "VelocityFilter.T2": 0.1}
    )
    rig.belt.noise = 3
    rig.run(1.0)
    rig.axis.move_velocity(30.0)
    rig.run(0.5)
    job = rig.axis.gear_in(rig.encoder, Deceleration=20.0, Jerk=0.0)
    rig.run(3.0)
    assert (rig.alarms_of("axis1"), job.InGear) == (alarms, not alarms)


@pytest.mark.requirement("SYN-051", "SYN-020")
def test_the_three_types_of_coupling():
    """Setpoint, extrapolated actual and delayed value: the follower gets what the leading object shows."""
    shown = {
        "setpoint": ("{}",),
        "actual": ("StatusExtrapolation.Extrapolated{}",),
        "delayed": ("StatusProvidedLeadingValue.DelayedLeadingValue.{}",),
    }
    for kind, (path,) in shown.items():
        across = {"CrossPlcSynchronousOperation.LocalLeadingValueDelayTime": 0.008, "VirtualAxis.Mode": 1}
        rig = Rig(synchronous=True, variables={"VirtualAxis.Mode": 1}, leader_variables=across)
        rig.axis.object.couplings = {"leader": kind}
        rig.enabled().leader_at(50.0)
        job = rig.axis.gear_in(rig.leader, Acceleration=2000.0, Jerk=0.0)
        rig.until(job.in_gear)
        rig.leader.move_velocity(150.0, Acceleration=200.0, Jerk=0.0)
        rig.run(0.2)
        for quantity in ("Position", "Velocity", "Acceleration"):
            if quantity == "Acceleration" and kind == "actual":
                continue
            value = tag(rig, f"EffectiveLeadingValue.{quantity}")
            assert value == pytest.approx(rig.leader.var(path.format(quantity)), abs=1e-9)


@pytest.mark.requirement("SYN-031", "SYN-041")
def test_derivatives_of_the_chain():
    """In a cam with a phase that moves: velocity f'(M) * (E.v + dPhase), acceleration f'' v^2 + f' a, by
    differences of the positions.
    """
    rig = standing()
    points = [(x, 0.002 * x * x + 0.1 * x) for x in range(0, 401, 10)]
    cam = cam_of(rig, points, **{"InterpolationSettings.InterpolationMode": 1})
    job = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2)
    rig.until(job.in_sync)
    rig.leader.move_velocity(200.0, Acceleration=100.0, Jerk=0.0)
    rig.run(0.5)
    rig.axis.phasing_relative(15.0, ProfileReference=1, PhasingDistance=60.0)
    seen = []
    names = ("Position", "Velocity", "Acceleration")
    rig.runtime.after_cycle.append(
        lambda: seen.append([tag(rig, f"FunctionFollowingValue.{name}") for name in names])
    )
    rig.run(1.0)
    assert tag(rig, "PhaseShift") == 15.0
    for (s0, v0, a0), (s1, v1, a1) in pairwise(seen):
        assert (s1 - s0) / CYCLE == pytest.approx((v0 + v1) / 2.0, abs=0.15)
        assert (v1 - v0) / CYCLE == pytest.approx((a0 + a1) / 2.0, abs=6.0)


@pytest.mark.exhaustive
@pytest.mark.requirement("SYN-373", "SYN-118", "SYN-423")
@settings(max_examples=15)
@given(
    numerator=st.integers(-1_000_000, 1_000_000).filter(bool),
    denominator=st.integers(1, 1_000_000),
    velocities=st.lists(st.floats(-80.0, 80.0), min_size=2, max_size=5),
)
def test_any_ratio_keeps_the_relation(numerator, denominator, velocities):
    """Any ratio up to a million, any leading motion with reversals: the relation holds in every cycle."""
    rig = in_gear(0.0, numerator, denominator)
    x, y = places(rig)
    worst = []
    ratio = numerator / denominator

    def sample():
        now = places(rig)
        worst.append(abs(now[1] - y - ratio * (now[0] - x)) / max(1.0, abs(ratio)))

    rig.runtime.after_cycle.append(sample)
    for velocity in velocities:
        travel(rig, velocity)
        rig.run(0.2)
    assert rig.job.InGear
    assert max(worst) < 1e-9


@pytest.mark.requirement("SYN-133", "SYN-318", "SYN-415")
@pytest.mark.parametrize(
    ("name", "error"),
    [("Velocity", 0x8003), ("Acceleration", 0x8004), ("Deceleration", 0x8005), ("Jerk", 0x8006)],
)
def test_dynamic_values_that_are_not_permitted(name, error):
    """0.0 is refused where the profile uses the value, and not looked at where it does not; a jerk of 0 is
    none, one that is no number 16#8006. MC_GearIn has no Velocity.
    """
    value = float("nan") if name == "Jerk" else 0.0
    rig = standing()
    jobs = [rig.axis.gear_in_pos(rig.leader, 50.0, 0.0, SyncProfileReference=0, **{name: value})]
    if name != "Velocity":
        jobs += [
            rig.axis.gear_in(rig.leader, **{name: value}),
            rig.axis.gear_in_velocity(rig.leader, **{name: value}),
        ]
    else:
        assert "Velocity" not in rig.axis.gear_in(rig.leader).inputs
        rig.axis.halt()
    cam = cam_of(rig)
    jobs.append(rig.axis.cam_in(rig.leader, cam, SyncProfileReference=0, **{name: value}))
    rig.cycles(2)
    assert [job.ErrorID for job in jobs] == [error] * len(jobs)
    for profile in (1, 3, 4):
        job = rig.axis.gear_in_pos(rig.leader, 50.0, 0.0, SyncProfileReference=profile, **{name: value})
        rig.cycles(2)
        assert (job.Error, job.Busy) == (False, True)
    rig = in_gear(0.0)
    job = rig.axis.phasing_absolute(1.0, **{name: value})
    rig.cycles(2)
    assert job.ErrorID == error
    if name in ("Deceleration", "Jerk"):
        job = rig.axis.gear_out(50.0, SyncProfileReference=0, **{name: value})
        rig.cycles(2)
        assert job.ErrorID == error


@pytest.mark.requirement("SYN-050", "SYN-310", "SYN-311", "SYN-312")
def test_the_error_bit_of_synchronous_operation():
    """ErrorWord.X14 for alarms 601, 603 and 608 with reactions 2, 4 and 2, and for no other."""
    for number, reaction in ((601, 2), (603, 4), (608, 2), (533, 2), (321, 3)):
        rig = in_gear(20.0)
        rig.axis.object.alarm(number)
        rig.cycles(2)
        assert rig.axis.var("ErrorWord.X14") is (number > 600)
        if number > 600:
            assert rig.axis.var("ErrorDetail.Reaction") == reaction
    assert not Rig().axis.var("ErrorWord.X14")
