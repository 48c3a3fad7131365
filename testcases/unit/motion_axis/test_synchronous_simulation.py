"""`MC_SynchronizedMotionSimulation`: a synchronous job without its axis (SYN section 7.8)."""

from __future__ import annotations

import pytest

from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.override_cells import ACTIVE, cam_of
from testcases.unit.motion_axis.test_gear_in import FIXTURE, SYNCHRONOUS, gear, in_gear, places, word
from testcases.unit.motion_axis.test_gear_in_pos import standing, travel

SYNC = "StatusSynchronizedMotion."
IN_SIMULATION = 1 << 3


def tag(rig, name):
    return rig.axis.var(f"{SYNC}{name}")


def simulated(*arguments, **options):
    """An axis in gear behind a leading axis that stands, its synchronous operation simulated."""
    rig = in_gear(0.0, *arguments, **options)
    rig.run(0.2)
    rig.simulation = rig.axis.synchronized_motion_simulation()
    rig.cycles(2)
    assert rig.simulation.InSimulation
    return rig


def sync_relation(rig, ratio=1.0):
    """Position of the synchronous function less the ratio times that of the leading axis."""
    return tag(rig, "FunctionFollowingValue.Position") - ratio * places(rig)[0]


@pytest.mark.requirement("SYN-232", "SYN-094", "SYN-045", "SYN-231", "SYN-230", "SYN-472")
def test_the_job_goes_on_without_the_axis():
    """InSimulation and X3, not X22; InGear stays; the function follows the leading axis, the axis stands."""
    rig = in_gear(0.0, 2, 1)
    rig.run(0.2)
    base = sync_relation(rig, 2.0)
    number = tag(rig, "ActualMaster")
    assert (word(rig.axis), tag(rig, "StatusWord")) == (SYNCHRONOUS, 0)
    simulation = rig.axis.synchronized_motion_simulation()
    rig.cycles(2)
    assert (simulation.InSimulation, simulation.Busy, simulation.Error) == (True, True, False)
    assert (word(rig.axis), tag(rig, "StatusWord")) == (0, IN_SIMULATION)
    y = rig.axis.var("Position")
    rig.leader.move_relative(30.0)
    for _ in range(100):
        rig.cycles()
        assert sync_relation(rig, 2.0) == pytest.approx(base, abs=1e-9)
        assert (rig.axis.var("Position"), rig.axis.var("Velocity")) == (y, 0.0)
    assert tag(rig, "FunctionFollowingValue.Velocity") > 0.0
    assert (rig.job.InGear, rig.job.Busy) == (True, True)
    assert (tag(rig, "FunctionState"), tag(rig, "ActualMaster")) == (1, number)


@pytest.mark.requirement("SYN-233", "SYN-330", "SYN-413", "SYN-320")
def test_what_can_be_simulated():
    """Without a synchronous job 16#8075, while one synchronises or waits 16#80A9, behind a leading axis that
    moves not at all; a second instance is 16#800C.
    """

    def refused(rig):
        one = rig.axis.synchronized_motion_simulation()
        rig.cycles(2)
        assert (one.Error, one.Busy, one.InSimulation) == (True, False, False)
        return one.ErrorID

    rig = standing()
    assert refused(rig) == 0x8075
    rig.axis.gear_in_pos(rig.leader, 100.0, 0.0)
    rig.cycles(2)
    assert refused(rig) == 0x80A9
    rig = gear(100.0, Acceleration=100.0)
    assert refused(rig) == 0x80A9
    rig.until(rig.job.in_gear)
    assert refused(rig) == 0x800D
    assert rig.job.InGear
    rig = simulated()
    assert refused(rig) == 0x800C
    assert rig.simulation.InSimulation


@pytest.mark.requirement("SYN-235", "SYN-236", "SYN-404", "SYN-442", "MC-411")
@pytest.mark.parametrize("what", ["move", "halt", "stop", "power", "leader", "superimposed"])
def test_what_does_not_end_it(what):
    """Motion jobs, MC_Stop and disabling of either axis leave the synchronous job alone, which goes on."""
    rig = simulated()
    base = sync_relation(rig)
    axis = rig.axis
    if what == "move":
        rig.until(axis.move_absolute(50.0).done if axis.homed else axis.move_relative(50.0).done)
    elif what == "halt":
        rig.until(axis.halt().done)
    elif what == "stop":
        stop = axis.stop(2)
        rig.until(stop.done)
        stop.set(Execute=False)
        rig.cycles(2)
    elif what == "power":
        rig.until(axis.power(False).off)
        rig.leader.move_relative(10.0)
        rig.run(0.5)
        assert sync_relation(rig) == pytest.approx(base, abs=1e-9)
        rig.until(axis.power().status)
    elif what == "leader":
        rig.until(rig.leader.power(False).off)
        rig.until(rig.leader.power().status)
    else:
        rig.until(axis.move_superimposed(5.0).done)
    assert (rig.job.InGear, rig.job.CommandAborted, rig.simulation.InSimulation) == (True, False, True)
    rig.leader.move_relative(10.0)
    rig.run(0.5)
    assert sync_relation(rig) == pytest.approx(base, abs=1e-9)


@pytest.mark.requirement("SYN-134", "SYN-440", "SYN-185", "SYN-331", "SYN-486")
def test_no_other_synchronous_job_starts():
    """16#8076 for every instruction of synchronous operation, and the simulated job goes on."""
    rig = simulated()
    rig.axis.home(0.0)
    rig.cycles(2)
    cam = cam_of(rig)
    jobs = [
        rig.axis.gear_in(rig.leader),
        rig.axis.gear_in_pos(rig.leader, 10.0, 0.0),
        rig.axis.gear_in_velocity(rig.leader),
        rig.axis.cam_in(rig.leader, cam, MasterStartDistance=10.0),
        rig.axis.phasing_absolute(1.0),
        rig.axis.phasing_relative(1.0),
        rig.axis.offset_absolute(1.0, 10.0),
        rig.axis.offset_relative(1.0, 10.0),
        rig.axis.gear_out(0.0, MasterStopDistance=1.0),
        rig.axis.cam_out(0.0, MasterStopDistance=1.0),
    ]
    rig.cycles(2)
    assert [(one.instruction, one.ErrorID) for one in jobs] == [(one.instruction, 0x8076) for one in jobs]
    assert (rig.job.InGear, rig.simulation.InSimulation) == (True, True)


@pytest.mark.requirement("SYN-237", "SYN-443")
@pytest.mark.parametrize("apart", [0.0, 7.0])
def test_its_end_is_a_step_of_what_lies_between(apart):
    """The axis follows again in the next cycle without StartSync, from wherever it is: what another job has
    moved it is a step; the job that runs is aborted.
    """
    rig = simulated(2, 1)
    x, y = places(rig)
    rig.until(rig.axis.move_relative(apart).done)
    rig.leader.move_relative(20.0)
    rig.run(0.1)
    other = rig.axis.move_relative(-2.0 * (x - places(rig)[0]) - apart)  # to where the function is by now
    rig.until(other.done)
    if apart:
        other = rig.axis.move_velocity(1.0)
        rig.run(0.1)
    rig.until(lambda: rig.leader.var("Velocity") == 0.0)
    rig.rows.clear()
    rig.simulation.set(Enable=False)
    rig.cycles(3)
    assert (rig.simulation.InSimulation, rig.simulation.Busy) == (False, False)
    assert (rig.job.InGear, word(rig.axis), tag(rig, "StatusWord") & IN_SIMULATION) == (True, SYNCHRONOUS, 0)
    assert places(rig)[1] - y == pytest.approx(2.0 * (places(rig)[0] - x), abs=1e-9)
    assert not apart or other.CommandAborted
    rig.leader.move_relative(20.0)
    rig.run(0.5)
    assert places(rig)[1] - y == pytest.approx(2.0 * (places(rig)[0] - x), abs=1e-9)


@pytest.mark.requirement("SYN-237", "SYN-443")
@pytest.mark.parametrize("function", ["MC_GearInPos active", "MC_CamIn active", "at once"])
def test_a_function_of_positions_goes_on_without_synchronising_again(function):
    """The axis is where its function is in the cycle behind the end of the simulation, whatever way the
    leader has gone meanwhile; StartSync and the bit of synchronising never come.
    """
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE).enabled()
    rig.axis.home(0.0)
    rig.leader_at(0.0)
    rig.leader.home(0.0)
    rig.cycles(3)
    if function == "at once":
        rig.leader.move_velocity(20.0)
        job = rig.axis.cam_in(rig.leader, cam_of(rig), SyncProfileReference=2, MasterSyncPosition=3.0)
    else:
        job = ACTIVE[function](rig)
    rig.until(job.in_sync)
    rig.until(rig.leader.halt().done)
    rig.run(0.1)
    simulation = rig.axis.synchronized_motion_simulation()
    rig.cycles(2)
    rig.until(rig.leader.move_relative(12.0).done)
    function_at = tag(rig, "FunctionFollowingValue.Position") + tag(rig, "Offset")
    assert abs(function_at - rig.axis.var("Position")) > 1.0
    seen = []
    rig.runtime.after_cycle.append(lambda: seen.append((job.StartSync, word(rig.axis))))
    simulation.set(Enable=False)
    rig.cycles(3)
    assert (job.InSync, rig.axis.var("Position")) == (True, pytest.approx(function_at, abs=1e-9))
    assert {one for one, _ in seen} == {False}
    assert {bits for _, bits in seen} <= {0, SYNCHRONOUS}


@pytest.mark.requirement("SYN-234", "SYN-238", "STP-204", "MC-358")
@pytest.mark.parametrize("when", ["before", "at the start", "during"])
def test_what_is_superimposed_is_lost(when):
    """It moves the axis in the simulation; when that ends, the axis steps back by SuperimposedDistance."""
    rig = in_gear(0.0)
    rig.run(0.2)
    y = places(rig)[1]
    if when != "during":
        job = rig.axis.move_superimposed(6.0, VelocityDiff=20.0)
        rig.until(job.done) if when == "before" else rig.run(0.1)
    simulation = rig.axis.synchronized_motion_simulation()
    rig.cycles(2)
    assert simulation.InSimulation
    if when == "during":
        job = rig.axis.move_superimposed(6.0)
    rig.cycles(2)
    rig.until(lambda: not job.Busy)
    rig.cycles(2)
    total = rig.axis.object.servo.total
    assert total.s - y == pytest.approx(6.0)
    simulation.set(Enable=False)
    rig.cycles(3)
    assert places(rig)[1] - y == pytest.approx(0.0, abs=1e-9)


@pytest.mark.requirement("SYN-196")
def test_an_offset_is_kept():
    """What MC_OffsetAbsolute has shifted is there after the simulation, without a step."""
    rig = in_gear(100.0)
    rig.until(rig.axis.offset_absolute(6.0, 20.0).done)
    rig.until(rig.leader.halt().done)
    rig.run(0.3)
    x, y = places(rig)
    simulation = rig.axis.synchronized_motion_simulation()
    rig.cycles(5)
    assert simulation.InSimulation
    simulation.set(Enable=False)
    rig.cycles(3)
    assert (places(rig), tag(rig, "Offset")) == ((x, pytest.approx(y, abs=1e-9)), 6.0)


@pytest.mark.requirement("SYN-441", "SYN-443", "SYN-225")
@pytest.mark.parametrize("end", ["restart", "disabled", "alarm", "leader", "stop held"])
def test_what_ends_the_simulated_job(end):
    """A restart, an end while the axis is disabled or held by MC_Stop, an alarm, and a leading value that
    fails.
    """
    rig = simulated()
    if end in ("restart", "disabled"):
        rig.until(rig.axis.power(False).off)
        assert rig.job.InGear
    if end == "restart":
        additive = rig.axis.leading_value_additive(3.0)
        rig.cycles(2)
        assert additive.Busy
        rig.axis.reset(restart=True)
        rig.run(0.1)
        assert (additive.Busy, tag(rig, "StatusWord")) == (False, 0)
    elif end == "alarm":
        rig.axis.object.alarm(104)
    elif end == "leader":
        rig.until(rig.leader.power(False).off)
        rig.leader.reset(restart=True)
    else:
        if end == "stop held":
            rig.until(rig.axis.stop(2).done)
        rig.simulation.set(Enable=False)
    rig.cycles(4)
    failed = end in ("alarm", "leader")
    assert (rig.job.CommandAborted, rig.job.ErrorID) == (not failed, 0x8001 if failed else 0)
    assert (rig.simulation.InSimulation, rig.simulation.Busy) == (False, False)
    assert (tag(rig, "FunctionState"), tag(rig, "ActualMaster")) == (0, 0)
    assert rig.alarms_of("axis1") == ([104] if end == "alarm" else [601] if end == "leader" else [])


@pytest.mark.requirement("SYN-221", "SYN-228")
def test_the_additive_value_acts_on_a_simulated_job():
    """It is accepted while the axis is disabled and simulated, and moves the function."""
    rig = simulated(2, 1)
    rig.until(rig.axis.power(False).off)
    before = tag(rig, "FunctionFollowingValue.Position")
    job = rig.axis.leading_value_additive(4.0)
    rig.cycles(3)
    assert (job.Busy, job.Error) == (True, False)
    assert tag(rig, "FunctionFollowingValue.Position") - before == pytest.approx(8.0)


def test_an_offset_on_its_way_goes_on():
    """What shifts the following value when the simulation begins is not ended by jobs of the axis, and goes
    on with the leading value.
    """
    rig = in_gear(50.0)
    job = rig.axis.offset_relative(6.0, 40.0)
    rig.run(0.2)
    rig.until(rig.leader.halt().done)
    rig.run(0.3)
    simulation = rig.axis.synchronized_motion_simulation()
    rig.cycles(2)
    assert simulation.InSimulation
    rig.until(rig.axis.move_relative(3.0).done)
    assert (job.Busy, job.CommandAborted, tag(rig, "Offset") < 6.0) == (True, False, True)
    rig.until(rig.leader.move_relative(50.0).done)
    rig.cycles(2)
    assert (job.Done, tag(rig, "Offset")) == (True, 6.0)


def test_a_job_that_waits_goes_on_waiting():
    """A gear that waits for its leading value, and a way out of the present one, are held until the
    simulation has ended.
    """
    rig = in_gear(0.0)
    rig.axis.home(0.0)
    rig.leader.home(0.0)
    rig.run(0.2)
    waiting = rig.axis.gear_in_pos(rig.leader, 50.0, 0.0, MasterStartDistance=10.0)
    rig.cycles(2)
    simulation = rig.axis.synchronized_motion_simulation()
    rig.cycles(2)
    rig.until(rig.leader.move_absolute(30.0).done)
    rig.until(rig.leader.move_absolute(60.0).done)
    assert (waiting.Busy, waiting.StartSync, rig.job.InGear) == (True, False, True)
    rig.until(rig.leader.move_absolute(0.0).done)
    simulation.set(Enable=False)
    rig.cycles(3)
    travel(rig, 50.0)
    rig.until(waiting.in_sync)
    assert rig.job.CommandAborted


def test_velocity_gearing_goes_on_from_where_the_axis_is():
    """A coupling of velocities knows no positions, so that nothing steps at the end."""
    rig = Rig(synchronous=True)
    rig.enabled().leader_at(0.0)
    job = rig.axis.gear_in_velocity(rig.leader, PositionControlled=True)
    rig.until(job.in_sync)
    rig.run(0.2)
    simulation = rig.axis.synchronized_motion_simulation()
    rig.cycles(2)
    assert simulation.InSimulation
    rig.until(rig.axis.move_relative(30.0).done)
    y = places(rig)[1]
    rig.until(rig.leader.move_relative(10.0).done)
    simulation.set(Enable=False)
    rig.cycles(3)
    assert (places(rig)[1], job.InSync) == (pytest.approx(y), True)
    rig.leader.move_velocity(40.0)
    rig.run(CYCLE * 250)
    assert rig.axis.var("Velocity") == pytest.approx(40.0)
