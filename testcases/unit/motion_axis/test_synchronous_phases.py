"""Synchronous operation in each of its phases, against enabling, stops, alarms and jobs of the leading and
the following axis (SYN sections 2, 4, 5 and 10).
"""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import SynchronousAxis
from motion.s7.handles import AxisHandle
from testcases.catalogue import each
from testcases.unit.motion_axis.conftest import CYCLE, REFERENCE, Rig
from testcases.unit.motion_axis.override_cells import ACTIVE, cam_of
from testcases.unit.motion_axis.test_gear_in import (
    FIXTURE,
    SYNCHRONIZING,
    SYNCHRONOUS,
    gear,
    in_gear,
    places,
    word,
)
from testcases.unit.motion_axis.test_gear_in_pos import standing, travel
from testcases.unit.motion_axis.test_leading_objects import behind_belt

SYNC = "StatusSynchronizedMotion."
STANDSTILL, NON_POSITION_CONTROLLED = 1 << 7, 1 << 28
PHASES = {
    "waiting": "MC_GearInPos waiting",
    "cam waiting": "MC_CamIn waiting",
    "synchronising": "MC_GearIn",
    "by velocity": "MC_GearInVelocity",
    "synchronous": "MC_GearInPos active",
    "cam": "MC_CamIn active",
    "phasing": "MC_PhasingAbsolute",
    "offset": "MC_OffsetRelative",
    "leaving waits": "MC_GearOut waiting",
    "leaving": "MC_GearOut active",
    "cam leaves": "MC_CamOut active",
}
"""Job of the overriding tables that brings an axis into a phase."""


def tag(rig, name):
    return rig.axis.var(f"{SYNC}{name}")


def bring(phase, **options):
    """A leading and a following axis in a phase, and the job that makes it."""
    rig = Rig(synchronous=True, **options).enabled()
    rig.axis.home(0.0)
    rig.leader_at(0.0)
    rig.leader.home(0.0)
    rig.cycles(3)
    job = ACTIVE[PHASES[phase]](rig)
    rig.cycles(3)
    assert job.Busy
    if phase == "synchronising":
        assert word(rig.axis) == SYNCHRONIZING
    return rig, job


@pytest.mark.exhaustive
@pytest.mark.requirement("SYN-403", "SYN-482", "SYN-293")
def test_disabling_the_leading_axis_in_every_phase(subtests):
    """Whatever the stop mode, no job of the follower is aborted; it goes on when the leading axis does."""
    for label, (phase, mode) in each(list(PHASES), [0, 1, 2]):
        with subtests.test(label):
            rig, job = bring(phase)
            rig.until(rig.leader.power(False, stop_mode=mode).off)
            rig.cycles(5)
            assert rig.alarms_of("axis1") == []
            assert not job.Error
            assert not job.CommandAborted
            rig.until(rig.leader.power().status)
            rig.until(rig.leader.move_velocity(60.0).in_velocity)
            rig.run(0.3)
            assert rig.alarms_of("axis1") == []
            assert job.Busy or job.Done


@pytest.mark.exhaustive
@pytest.mark.requirement("SYN-404", "SYN-292", "SYN-207")
def test_disabling_the_follower_in_every_phase(subtests):
    """All its synchronous jobs are aborted, waiting ones too, and nothing comes back with the enable."""
    for label, (phase,) in each(list(PHASES)):
        with subtests.test(label):
            rig, job = bring(phase)
            rig.axis.power(False, stop_mode=2)
            rig.cycles(3)
            assert (job.CommandAborted, job.Error, job.Busy) == (True, False, False)
            rig.run(0.5)
            rig.until(rig.axis.power().status)
            assert (word(rig.axis), tag(rig, "FunctionState"), tag(rig, "WaitingFunctionState")) == (0, 0, 0)
            y = rig.axis.var("Position")
            rig.run(0.3)
            assert rig.axis.var("Position") == pytest.approx(y, abs=0.01)


@pytest.mark.exhaustive
@pytest.mark.requirement("SYN-295", "SYN-101", "SYN-316", "SYN-303", "SYN-465")
def test_alarms_of_the_follower_in_every_phase(subtests):
    """Reactions 1 to 4 end its jobs with 16#8001; acknowledged, it stays where it is while the leading axis
    moves on. The leading axis is not affected.
    """
    for label, (phase, alarm) in each(list(PHASES), [533, 104, 321, 421]):
        with subtests.test(label):
            rig, job = bring(phase)
            velocity = rig.leader.var("Velocity")
            rig.axis.object.alarm(alarm)
            rig.cycles(3)
            assert (job.Error, job.ErrorID, job.Busy) == (True, 0x8001, False)
            assert (word(rig.axis), tag(rig, "FunctionState"), tag(rig, "ActualMaster")) == (0, 0, 0)
            rig.run(1.0)
            rig.axis.reset()
            rig.run(0.2)
            rig.leader.move_velocity(80.0)
            rig.run(0.3)
            assert (rig.axis.var("Velocity"), velocity <= rig.leader.var("Velocity")) == (0.0, True)
            assert rig.alarms_of("leader") == []


@pytest.mark.requirement("SYN-295", "SYN-465")
@pytest.mark.parametrize(
    ("alarm", "mode", "takes_over"), [(104, 0, True), (104, 3, False), (321, 2, False), (421, 0, False)]
)
def test_a_stop_and_an_alarm(alarm, mode, takes_over):
    """Of an alarm and an MC_Stop the harder one brakes the follower; the gear has ended in every case."""
    rig = in_gear(300.0)
    rig.axis.object.alarm(alarm)
    rig.cycles()
    stop = rig.axis.stop(mode, Deceleration=100.0)
    rig.cycles(2)
    assert (rig.job.ErrorID, stop.Busy) == (0x8001, takes_over)
    assert stop.CommandAborted is not takes_over


@pytest.mark.requirement("SYN-095", "SYN-111", "SYN-302", "SYN-303")
@pytest.mark.parametrize("job", ["halt", "halt of the basic motion", "move"])
def test_a_motion_job_overrides(job):
    """The gear is aborted and all its status is gone; the follower brakes smoothly within its limits, and
    never follows again by itself. The leading axis goes on.
    """
    rig = in_gear(300.0)
    rig.rows.clear()
    if job == "move":
        rig.axis.move_velocity(20.0, Acceleration=1500.0, Deceleration=1500.0, Jerk=15000.0)
    else:
        rig.axis.halt(Mode=0 if job == "halt" else 1, Deceleration=1500.0, Jerk=15000.0)
    rig.cycles(2)
    assert (rig.job.CommandAborted, rig.job.InGear) == (True, False)
    assert (word(rig.axis), tag(rig, "FunctionState"), tag(rig, "ActualMaster")) == (0, 0, 0)
    rig.run(1.0)
    assert min(rig.column("acceleration_setpoint")) == pytest.approx(-1500.0, rel=0.2)
    assert min(rig.column("acceleration_setpoint")) >= -1500.0 - 1e-6
    assert rig.axis.var("Velocity") == (20.0 if job == "move" else 0.0)
    assert rig.leader.var("Velocity") == 300.0


@pytest.mark.requirement("SYN-001", "SYN-002", "SYN-085", "SYN-018", "SYN-005")
def test_a_synchronous_axis_without_a_synchronous_job():
    """It moves as a positioning axis does, in the same cycles with the same setpoints; no variable of
    synchronous operation shows anything; and it leads another axis.
    """

    def course(rig):
        rig.enabled()
        rig.axis.home(0.0)
        for start, inputs in (
            ("move_absolute", (30.0,)),
            ("move_relative", (-10.0,)),
            ("move_velocity", (50.0,)),
            ("jog", (20.0,)),
            ("halt", ()),
            ("move_superimposed", (3.0,)),
            ("torque_additive", (0.5,)),
            ("motion_in_velocity", (20.0,)),
            ("write_parameter", (1020, 3)),
            ("stop", (2,)),
        ):
            getattr(rig.axis, start)(*inputs)
            rig.run(0.4)
        rig.until(rig.axis.power(False).off)
        return rig.column("position_setpoint"), rig.column("status_word"), rig.column("actual_position")

    rig = Rig(synchronous=True)
    seen = set()
    names = ("FunctionState", "WaitingFunctionState", "ActualMaster", "StatusWord", "PhaseShift", "Offset")
    rig.runtime.after_cycle.append(lambda: seen.add((word(rig.axis), *(tag(rig, name) for name in names))))
    assert course(rig) == course(Rig())
    assert seen == {(0,) * 7}


@pytest.mark.requirement("SYN-014", "SYN-021", "SYN-147", "SYN-444", "SYN-036")
def test_another_leading_axis():
    """Of two leading axes the one of the active job is followed; the second job takes over in the cycle in
    which it starts, synchronises without a step, and is in gear when velocity and acceleration agree.
    """
    rig = in_gear(100.0)
    second = _second_leader(rig, -50.0)
    assert tag(rig, "ActualMaster") == rig.leader.object.db_number
    rig.rows.clear()
    job = rig.axis.gear_in(second, 2, 1, Acceleration=1000.0, Jerk=0.0)
    rig.cycles()
    assert (tag(rig, "ActualMaster"), word(rig.axis)) == (second.object.db_number, SYNCHRONIZING)
    rig.cycles()
    assert (rig.job.CommandAborted, rig.job.InGear) == (True, False)
    while not job.InGear:
        assert rig.axis.var("Velocity") > -100.0
        rig.cycles()
    assert (word(rig.axis), rig.axis.var("Velocity")) == (SYNCHRONOUS, pytest.approx(-100.0))
    velocities = rig.column("velocity_setpoint")
    assert max(abs(b - a) for a, b in pairwise(velocities)) <= 1000.0 * CYCLE + 1e-6
    rig.axis.halt()
    rig.cycles(2)
    assert tag(rig, "ActualMaster") == 0


def _second_leader(rig, velocity):
    """One more leading axis of the follower, with a constant velocity."""
    axis = SynchronousAxis(
        "second",
        SimulatedDrivePort(cycle_s=CYCLE),
        cycle_ns=rig.cycle_ns,
        variables=REFERENCE | FIXTURE,
        history=rig.history,
    )
    rig.runtime.add(axis)
    rig.axis.object.leading_objects += (axis,)
    rig.runtime.order_axes()
    handle = AxisHandle(rig.runtime, axis)
    rig.until(handle.power().status)
    rig.until(handle.move_velocity(velocity).in_velocity)
    return handle


@pytest.mark.requirement("SYN-380", "SYN-116")
def test_the_mode_of_the_follower():
    """MC_GearIn, MC_GearInPos and MC_CamIn close position control when they start, and it stays closed
    afterwards.
    """
    for name in ("MC_GearIn", "MC_GearInPos active", "MC_CamIn active"):
        rig = Rig(synchronous=True).enabled()
        rig.axis.home(0.0)
        rig.leader_at(0.0)
        rig.leader.home(0.0)
        rig.until(rig.axis.move_velocity(10.0, PositionControlled=False).in_velocity)
        assert rig.axis.var("StatusWord") & NON_POSITION_CONTROLLED
        job = ACTIVE[name](rig)
        rig.cycles(3)
        assert job.Busy
        assert not rig.axis.var("StatusWord") & NON_POSITION_CONTROLLED
        rig.until(rig.axis.halt().done)
        assert not rig.axis.var("StatusWord") & NON_POSITION_CONTROLLED


@pytest.mark.requirement("SYN-172", "SYN-422")
def test_velocity_gearing_without_position_control_has_no_positions():
    """X28 and Position 0.0; homing is refused; in position control active homing ends the gear, in both
    phases.
    """
    rig = Rig(synchronous=True).enabled()
    rig.axis.home(10.0)
    rig.leader_at(60.0)
    job = rig.axis.gear_in_velocity(rig.leader)
    rig.until(job.in_sync)
    assert rig.axis.var("StatusWord") & NON_POSITION_CONTROLLED
    assert (rig.axis.var("Position"), rig.axis.var("ActualPosition") > 10.0) == (0.0, True)
    for mode in (0, 1, 2, 3, 5, 8, 11):
        home = rig.axis.home(0.0, mode=mode)
        rig.cycles(2)
        assert (home.ErrorID, job.InSync) == (0x8071, True)
    for synchronous in (False, True):
        rig = Rig(synchronous=True).enabled()
        rig.leader_at(60.0)
        job = rig.axis.gear_in_velocity(rig.leader, PositionControlled=True, Acceleration=100.0)
        if synchronous:
            rig.until(job.in_sync)
        rig.cycles(2)
        assert rig.axis.var("Position") > 0.0
        home = rig.axis.home(mode=5)
        rig.cycles(2)
        assert (job.CommandAborted, home.Busy) == (True, True)


@pytest.mark.requirement("SYN-026")
def test_a_leading_axis_that_loses_position_control():
    """Its position setpoint becomes 0: the follower steps by what the gear makes of that, at once."""
    rig = in_gear(50.0, 2, 1, leader={"VirtualAxis.Mode": 0}, follower={"VirtualAxis.Mode": 0})
    x, y = places(rig)
    rig.leader.move_velocity(50.0, PositionControlled=False)
    rig.cycles(2)
    assert rig.leader.var("Position") == 0.0
    assert places(rig)[1] - y == pytest.approx(-2.0 * x, abs=1e-9)


@pytest.mark.requirement("SYN-019")
def test_units_are_not_converted():
    """10 mm of a linear leading axis are 10 degrees of a rotary follower."""
    rig = in_gear(0.0, follower={"Properties.MotionType": 1, "VirtualAxis.Mode": 1})
    y = rig.axis.var("Position")
    rig.until(rig.leader.move_relative(10.0).done)
    assert rig.axis.var("Position") - y == pytest.approx(10.0)
    assert (rig.axis.variables.unit("Position"), rig.leader.variables.unit("Position")) == ("deg", "mm")


@pytest.mark.requirement("SYN-022", "SYN-023", "SYN-305")
def test_the_velocity_of_modulo_leading_axes():
    """Interconnected: half a modulo range per cycle, alarm 501 where that limits; on its own: a whole one,
    and more is alarm 412.
    """
    fast = {
        "Modulo.Enable": True, "Modulo.Length": 50.0, "VirtualAxis.Mode": 1,
        "DynamicLimits.MaxVelocity": 20_000.0, "DynamicLimits.Velocity": 20_000.0,
        "DynamicLimits.MaxAcceleration": 1e6, "DynamicLimits.MaxDeceleration": 1e6,
        "DynamicLimits.MaxJerk": 1e9, "DynamicDefaults.EmergencyDeceleration": 1e6,
    }  # fmt: skip
    rig = Rig(synchronous=True, leader_variables=fast)
    rig.leader_at(0.0)
    rig.leader.move_velocity(9000.0, Acceleration=1e6, Jerk=0.0)
    rig.run(0.1)
    assert (rig.leader.var("Velocity"), rig.alarms_of("leader")) == (50.0 / (2 * CYCLE), [501])
    for velocity, alarms in ((12_000.0, []), (13_000.0, [412])):
        rig = Rig(variables=fast).enabled()
        rig.axis.move_velocity(velocity, Acceleration=1e6, Jerk=0.0)
        rig.run(0.2)
        assert rig.alarms_of("axis1") == alarms


@pytest.mark.requirement("SYN-083", "COM-027")
def test_a_control_panel_moves_the_followers_too():
    """The leading axis in jog of the panel: the follower stays in gear."""
    rig = in_gear(0.0)
    rig.leader.power(False)
    rig.run(0.2)
    x, y = places(rig)
    panel = rig.leader.control_panel()
    panel.take_control()
    panel.enable()
    rig.until(lambda: panel.enabled)
    panel.velocity = 20.0
    panel.jog()
    rig.run(0.5)
    assert places(rig)[0] - x > 1.0
    assert places(rig)[1] - y == pytest.approx(places(rig)[0] - x, abs=1e-9)
    assert rig.job.InGear


@pytest.mark.requirement("SYN-296")
def test_restarts():
    """Of the follower: jobs and shifts are gone, jobs in it get 16#800D, changed start values count; of the
    leading axis: alarm 601 at the follower, which stops.
    """
    rig = in_gear(100.0)
    rig.until(rig.axis.phasing_absolute(5.0, Velocity=50.0).done)
    rig.axis.object.variables.write_start("Modulo.Length", 400.0)
    rig.cycles(2)
    assert rig.axis.var("StatusWord.X3")
    rig.until(rig.axis.power(False).off)
    waiting = rig.axis.gear_in(rig.leader)
    rig.cycles(2)
    assert (waiting.ErrorID, rig.job.CommandAborted) == (0x800F, True)
    rig.axis.reset(restart=True)
    rig.cycles(2)
    jobs = [
        rig.axis.gear_in(rig.leader),
        rig.axis.gear_in_pos(rig.leader, 0.0, 0.0),
        rig.axis.phasing_absolute(1.0),
        rig.axis.offset_absolute(1.0, 1.0),
        rig.axis.gear_out(0.0, MasterStopDistance=1.0),
        rig.axis.leading_value_additive(1.0),
        rig.axis.synchronized_motion_simulation(),
    ]
    rig.cycles(1)
    assert [job.ErrorID for job in jobs] == [0x800D] * len(jobs)
    rig.run(0.2)
    assert (tag(rig, "PhaseShift"), tag(rig, "Offset"), tag(rig, "FunctionState")) == (0.0, 0.0, 0)
    assert not rig.axis.var("StatusWord.X3")
    rig.until(rig.axis.power().status)
    job = rig.axis.gear_in(rig.leader)
    rig.until(job.in_gear)
    rig.until(rig.leader.power(False).off)
    rig.leader.reset(restart=True)
    rig.cycles(3)
    assert (job.ErrorID, rig.alarms_of("axis1")) == (0x8001, [601])


@pytest.mark.requirement("SYN-294", "SYN-027", "SYN-310")
def test_a_disabled_leading_axis_that_is_pushed():
    """Its setpoint follows the actual value and the follower that; a value that becomes invalid is alarm
    601.
    """
    rig = Rig(synchronous=True, variables={"VirtualAxis.Mode": 1}, leader_variables={"VirtualAxis.Mode": 0})
    rig.enabled().leader_at(0.0)
    job = rig.axis.gear_in(rig.leader)
    rig.until(job.in_gear)
    rig.leader.object.alarm(421)
    rig.run(0.5)
    y = rig.axis.var("Position")
    rig.leader.object.servo.port.turn(6.283185307179586)
    rig.cycles(5)
    assert rig.axis.var("Position") - y == pytest.approx(10.0, abs=0.1)
    assert (job.InGear, rig.alarms_of("axis1")) == (True, [])
    rig.leader.object.servo.port.sensor_fault = True
    rig.cycles(5)
    assert (job.ErrorID, rig.alarms_of("axis1")[:1]) == (0x8001, [601])


@pytest.mark.exhaustive
@pytest.mark.requirement("SYN-375", "SYN-034", "SYN-047", "SYN-377")
@settings(max_examples=8)
@given(
    st.lists(st.sampled_from(sorted(PHASES)), min_size=2, max_size=4),
    st.sampled_from(("power", "halt", "alarm")),
)
def test_status_in_any_sequence_of_jobs(jobs, end):
    """In no cycle both bits; X22 with a state of a synchronous function; state 0 has no leading axis."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE).enabled()
    rig.axis.home(0.0)
    rig.leader_at(0.0)
    rig.leader.home(0.0)
    rig.cycles(3)
    seen = set()
    rig.runtime.after_cycle.append(
        lambda: seen.add((word(rig.axis), tag(rig, "FunctionState"), bool(tag(rig, "ActualMaster"))))
    )
    for phase in jobs:
        if "waits" not in phase and "leav" not in phase and phase not in {"phasing", "offset"}:
            ACTIVE[PHASES[phase]](rig)
        rig.run(0.4)
    {
        "power": lambda: rig.axis.power(False),
        "halt": rig.axis.halt,
        "alarm": lambda: rig.axis.object.alarm(104),
    }[end]()
    rig.run(0.1)
    for bits, state, leads in seen:
        assert bits != SYNCHRONIZING | SYNCHRONOUS
        assert bits != SYNCHRONOUS or state in {1, 2, 3, 6}
        assert (state != 0) is leads


FUNCTION_STATES = {
    "synchronising": 1, "synchronous": 2, "cam": 3, "leaving": 4, "cam leaves": 5, "by velocity": 6,
}  # fmt: skip
WAITING_STATES = {"waiting": 2, "cam waiting": 3, "leaving waits": 4}


@pytest.mark.requirement("SYN-034", "SYN-035", "SYN-386", "SYN-387", "SYN-048", "SYN-088")
def test_function_states():
    """Each function has its number, waiting or active; desynchronising its bit and neither of the others."""
    for phase, number in FUNCTION_STATES.items():
        rig, _ = bring(phase)
        assert (phase, tag(rig, "FunctionState"), tag(rig, "WaitingFunctionState")) == (phase, number, 0)
        assert bool(rig.axis.var("StatusWord2.X1")) is ("leav" in phase)
        assert (word(rig.axis) == 0) is ("leav" in phase)
    for phase, number in WAITING_STATES.items():
        rig, _ = bring(phase)
        assert tag(rig, "WaitingFunctionState") == number
        assert tag(rig, "FunctionState") == (2 if phase == "leaving waits" else 0)
    rig = Rig(synchronous=True).enabled()
    rig.axis.home(0.0)
    cam = ACTIVE["MC_CamOut waiting"](rig)
    rig.cycles(2)
    assert (cam.Busy, tag(rig, "WaitingFunctionState"), tag(rig, "FunctionState")) == (True, 5, 3)


@pytest.mark.requirement("SYN-485", "SYN-264")
def test_a_held_stop_refuses_synchronous_jobs():
    """While Execute of MC_Stop is TRUE: 16#800F each; afterwards they are accepted."""
    rig = standing()
    cam = cam_of(rig)
    stop = rig.axis.stop(2)
    rig.until(stop.done)

    def tried():
        jobs = [
            rig.axis.gear_in(rig.leader),
            rig.axis.gear_in_pos(rig.leader, 50.0, 0.0),
            rig.axis.gear_in_velocity(rig.leader, PositionControlled=True),
            rig.axis.cam_in(rig.leader, cam, MasterStartDistance=10.0, MasterSyncPosition=20.0),
            rig.axis.gear_out(0.0, MasterStopDistance=1.0),
            rig.axis.cam_out(0.0, MasterStopDistance=1.0),
        ]
        rig.cycles(2)
        return [job.ErrorID for job in jobs]

    assert tried() == [0x800F] * 6
    assert stop.Done
    stop.set(Execute=False)
    rig.cycles(2)
    assert tried()[:4] == [0, 0, 0, 0]


@pytest.mark.requirement("SYN-281", "SYN-213", "SYN-435")
def test_leaving_ends_what_is_shifted():
    """A phase that is being shifted ends with StartSyncOut, not before; a halt ends a way out that waits."""
    rig = in_gear(50.0)
    shift = rig.axis.phasing_relative(2.0, ProfileReference=1, PhasingDistance=500.0)
    job = rig.axis.gear_out(rig.axis.var("Position") + 60.0, MasterStopDistance=20.0)
    rig.cycles(3)
    assert (shift.Busy, job.Busy, tag(rig, "WaitingFunctionState")) == (True, True, 4)
    rig.until(job.start_sync_out)
    assert (shift.CommandAborted, rig.job.CommandAborted) == (True, True)
    rig.until(job.done)
    assert rig.axis.var("StatusWord") & STANDSTILL or rig.axis.var("Velocity") == 0.0
    rig = in_gear(50.0)
    job = rig.axis.gear_out(5000.0, MasterStopDistance=20.0)
    rig.cycles(3)
    rig.axis.halt()
    rig.cycles(2)
    assert job.CommandAborted


@pytest.mark.requirement("SYN-352", "SYN-280")
def test_appended_positioning_waits_for_the_gear():
    """It does not start as long as the gear is active, whatever time passes."""
    rig = in_gear(50.0)
    rig.axis.home(0.0)
    rig.cycles(2)
    job = rig.axis.move_absolute(5.0, BufferMode=1)
    rig.run(2.0)
    assert (job.Busy, job.Active, rig.job.InGear) == (True, False, True)


@pytest.mark.requirement("SYN-418", "CAM-143")
@pytest.mark.parametrize("profile", [1, 3])
def test_a_moving_follower_and_a_leading_axis_that_starts(profile):
    """The function of the leading value knows nothing of the velocity of the follower: it steps."""
    rig = standing(leader_at=50.0 if profile == 1 else 100.0)
    rig.axis.move_velocity(40.0)
    rig.run(0.5)
    job = rig.axis.gear_in_pos(
        rig.leader, 100.0, 60.0, SyncProfileReference=profile, MasterStartDistance=50.0
    )
    rig.run(0.1)
    rig.rows.clear()
    rig.leader.move_velocity(20.0, Acceleration=500.0, Jerk=0.0)
    rig.until(job.start_sync)
    rig.run(0.1)
    assert job.StartSync
    velocities = rig.column("velocity_setpoint")
    assert max(abs(b - a) for a, b in pairwise(velocities)) > 10.0


@pytest.mark.requirement("SYN-315")
@pytest.mark.parametrize("number", [421, 550])
def test_alarms_of_the_drive_are_acknowledged(number):
    """MC_Reset clears them; the axis follows again with a new job."""
    rig = in_gear(20.0)
    rig.axis.object.alarm(number)
    rig.run(0.5)
    rig.until(rig.axis.reset().done)
    assert rig.axis.object.engine.pending == ()
    rig.run(0.5)
    rig.until(rig.axis.gear_in(rig.leader).in_gear)


@pytest.mark.requirement("SYN-359", "SYN-360", "SYN-073")
@pytest.mark.parametrize("fault", ["telegram", "sensor"])
def test_a_leading_encoder_that_fails(fault):
    """Its telegram is lost, or its sensor fails: an alarm of the encoder, 601 at the follower, which stops
    with the maximum dynamics.
    """
    rig = behind_belt()
    job = rig.axis.gear_in(rig.encoder)
    rig.until(job.in_gear)
    rig.rows.clear()
    if fault == "sensor":
        rig.belt.sensor_fault = True
    else:
        rig.belt.silent = True
    rig.run(0.5)
    assert (job.ErrorID, rig.alarms_of("axis1")) == (0x8001, [601])
    assert rig.alarms_of("belt") == [411 if fault == "sensor" else 431]
    assert rig.axis.var("Velocity") == 0.0
    assert min(rig.column("acceleration_setpoint")) < -1100.0  # more than the default of 1000, with its jerk


@pytest.mark.requirement("SYN-362", "SYN-363")
def test_reversals_in_each_phase():
    """While it synchronises 608, in a shift over a distance 16#808C, while it leaves over a distance 608;
    while it is synchronous it follows.
    """
    rig = gear(100.0, 2, 1, Acceleration=300.0)
    travel(rig, -50.0)
    rig.run(0.5)
    assert (rig.alarms_of("axis1"), rig.job.ErrorID) == ([608], 0x8001)
    rig = in_gear(50.0)
    shift = rig.axis.offset_relative(5.0, 100.0)
    rig.run(0.2)
    travel(rig, -50.0)
    rig.run(0.2)
    assert (shift.ErrorID, rig.job.InGear, rig.alarms_of("axis1")) == (0x808C, True, [])
    assert rig.axis.var("Velocity") == pytest.approx(-50.0)
    job = rig.axis.gear_out(rig.axis.var("Position") - 30.0, MasterStopDistance=40.0)
    rig.until(job.start_sync_out)
    travel(rig, 50.0)
    rig.run(0.5)
    assert (rig.alarms_of("axis1"), job.ErrorID) == ([608], 0x8001)


@pytest.mark.requirement("SYN-076", "CFG-135")
def test_a_virtual_leading_axis():
    """It is enabled at once, homed without motion, leads several followers, and knows no limit switch."""
    rig = Rig(
        synchronous=True, variables=FIXTURE, leader_variables=FIXTURE | {"PositionLimits_HW.Active": True}
    )
    power = rig.leader.power()
    rig.cycles(3)
    assert power.Status
    rig.leader.home(123.0)
    rig.cycles(2)
    assert (rig.leader.var("Position"), rig.leader.var("Velocity")) == (123.0, 0.0)
    rig.enabled()
    rig.until(rig.axis.gear_in(rig.leader).in_gear)
    rig.leader.move_velocity(50.0)
    rig.run(0.5)
    assert (rig.axis.var("Velocity"), rig.alarms_of("leader")) == (50.0, [])


@pytest.mark.requirement("SYN-084")
def test_positions_far_away():
    """At 9e9 mm the relation of a gear is kept within 1e-3 mm, whatever the leading axis has travelled."""
    rig = standing(at=9.0e9, leader_at=9.0e9)
    rig.until(rig.axis.gear_in(rig.leader, 1, 3).in_gear)
    x, y = places(rig)
    travel(rig, 300.0)
    for _ in range(50):
        rig.run(0.05)
        now = places(rig)
        assert abs(now[1] - y - (now[0] - x) / 3.0) < 1e-3
