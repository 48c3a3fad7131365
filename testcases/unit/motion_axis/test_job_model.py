"""The common job model: states, edges, calls, alarms, status bits (section 1 of the instruction
specification).
"""

from __future__ import annotations

import pytest

from motion.s7.axis import AxisState
from motion.s7.instructions import MC_Halt, MC_MoveRelative, MC_MoveVelocity

REMOVE_ENABLE, EMERGENCY, MAXIMUM, CURRENT, TRACK = 421, 321, 104, 533, 550
"""One alarm for every reaction."""


def shown(job):
    """Return Busy, Active, Done, CommandAborted, Error, ErrorID."""
    return (job.Busy, getattr(job, "Active", None), job.Done, job.CommandAborted, job.Error, job.ErrorID)


@pytest.mark.requirement("MC-052", "MC-053", "MC-054", "MC-055", "MC-058", "MC-061", "MC-001")
def test_states_of_a_positioning_job(rig):
    """Idle, active, waiting and done look as printed; the edge gives Busy in the same call."""
    rig.enabled()
    first, second = (
        MC_MoveRelative(rig.axis.object, Distance=20.0),
        MC_MoveRelative(rig.axis.object, Distance=5.0, BufferMode=1),
    )
    first()
    assert shown(first) == (False, False, False, False, False, 0)
    first(Execute=True)
    assert shown(first) == (True, True, False, False, False, 0)
    second(Execute=True)
    assert shown(second) == (True, False, False, False, False, 0)
    while not first.Done:
        rig.cycles(1)
        first()
        second()
    assert shown(first) == (False, False, True, False, False, 0)


@pytest.mark.requirement("MC-056", "MC-057", "MC-062", "MC-063")
def test_states_of_an_aborted_and_of_a_failed_job(rig):
    """CommandAborted after another job, Error with 16#8001 after an alarm."""
    rig.enabled()
    first, second = rig.axis.move_relative(200.0), rig.axis.move_relative(300.0, BufferMode=1)
    rig.cycles(3)
    third = rig.axis.move_relative(100.0)
    rig.cycles(2)
    assert shown(first) == (False, False, False, True, False, 0)
    assert shown(second) == (False, False, False, True, False, 0)
    rig.axis.object.alarms.raise_alarm(EMERGENCY)
    rig.cycles(2)
    assert shown(third) == (False, False, False, False, True, 0x8001)


@pytest.mark.requirement("MC-065")
def test_inputs_count_at_the_edge(rig):
    """What changes while the job runs acts with the next edge only."""
    rig.enabled()
    job = rig.axis.move_relative(50.0, Velocity=40.0)
    rig.run(0.3)
    job.set(Distance=500.0, Velocity=300.0, Acceleration=0.0)
    rig.until(job.done)
    assert rig.axis.var("Position") == pytest.approx(50.0, abs=1e-6)
    assert max(rig.column("velocity_setpoint")) == pytest.approx(40.0)
    job.set(Execute=False)
    rig.cycles(2)
    job.set(Execute=True)
    rig.cycles(2)
    assert job.ErrorID == 0x8004


@pytest.mark.requirement("MC-070")
def test_a_new_edge_wins_over_the_end_of_the_old_job(rig):
    """Called with an edge when the old job has just ended, the instance shows the new job alone."""
    rig.enabled()
    job = MC_MoveRelative(rig.axis.object, Distance=1.0)
    job(Execute=True)
    inner = job._job
    job(Execute=False)
    while inner.busy:
        rig.cycles(1)
    job(Execute=True)
    assert shown(job) == (True, True, False, False, False, 0)


@pytest.mark.requirement("MC-074")
def test_no_cycle_without_a_setpoint_source(rig):
    """At the take-over the velocity goes on without a gap, and the old job shows its abort within a cycle."""
    rig.travelling(200.0)
    second = rig.axis.move_velocity(220.0, Jerk=0.0, Acceleration=500.0)
    rig.cycles(1)
    assert second.Busy
    rig.cycles(1)
    assert rig.job.CommandAborted
    assert min(rig.column("velocity_setpoint")[-10:]) >= 200.0 - 1e-9


@pytest.mark.requirement("MC-075")
def test_a_job_goes_on_without_calls(rig):
    """Not called any more, the instance keeps its outputs and the axis its motion."""
    rig.enabled()
    job = MC_MoveRelative(rig.axis.object, Distance=20.0)
    job(Execute=True)
    frozen = shown(job)
    rig.run(3.0)
    assert shown(job) == frozen
    assert rig.axis.var("Position") == pytest.approx(20.0, abs=1e-6)
    job()
    assert job.Done


@pytest.mark.requirement("MC-076")
def test_two_call_sites_share_one_job(rig):
    """A second call site with an edge of its own starts the job again, as a re-trigger does."""
    rig.enabled()
    job = MC_MoveVelocity(rig.axis.object)
    job(Execute=True, Velocity=50.0)
    job(Execute=False)
    job(Execute=True, Velocity=80.0)
    assert job.Busy
    assert not job.CommandAborted
    rig.run(1.0)
    assert rig.column("velocity_setpoint")[-1] == pytest.approx(80.0)


@pytest.mark.requirement("MC-081")
def test_one_cycle_outputs_are_missed_by_rare_calls(rig):
    """A program that calls every call sees Done once; the record of the job does not depend on the
    program.
    """
    rig.enabled()
    job = rig.axis.move_relative(5.0)
    job.set(Execute=False)
    seen = []
    rig.runtime.after_cycle.append(lambda: seen.append(job.Done))
    job.set(Execute=True)
    rig.cycles(1)
    job.set(Execute=False)
    rig.run(2.0)
    assert sum(seen) == 1
    assert len(rig.events("job.done")) == 1


@pytest.mark.requirement("MC-008", "MC-631")
def test_no_job_while_the_object_restarts(rig):
    """16#800D between the start of the restart and its end."""
    rig.run(0.1)
    rig.axis.object.states.enter(AxisState.RESTARTING)
    jobs = [MC_MoveVelocity(rig.axis.object), MC_Halt(rig.axis.object)]
    for job in jobs:
        job(Execute=True)
        assert job.ErrorID == 0x800D


@pytest.mark.requirement("MC-012", "MC-265")
def test_job_memory(rig):
    """The ninth waiting job gets 16#8014, and those before it run in their order."""
    rig.enabled()
    jobs = [rig.axis.move_relative(1.0, BufferMode=1) for _ in range(10)]
    rig.cycles(2)
    assert [job.ErrorID for job in jobs] == [0] * 9 + [0x8014]
    order = []
    for number, job in enumerate(jobs[:9]):
        rig.until(job.done)
        order.append(number)
        assert not any(later.Done for later in jobs[number + 1 : 9])
    assert rig.axis.var("Position") == pytest.approx(9.0, abs=1e-6)


# -- alarms (1.8)
# ----------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-117", "MC-118", "MC-119", "MC-120", "MC-121")
@pytest.mark.parametrize(
    ("number", "reaction"), [(CURRENT, 1), (MAXIMUM, 2), (EMERGENCY, 3), (REMOVE_ENABLE, 4), (TRACK, 5)]
)
def test_jobs_end_with_an_error_whatever_the_reaction(rig, number, reaction):
    """Running and waiting jobs: 16#8001. MC_Power keeps Busy; Status falls unless the alarm keeps the axis
    enabled.
    """
    rig.travelling(200.0)
    waiting = rig.axis.move_relative(10.0, BufferMode=1)
    rig.cycles(2)
    rig.axis.object.alarms.raise_alarm(number, reaction=reaction)
    rig.cycles(2)
    assert rig.axis.var("ErrorDetail.Reaction") == reaction
    assert (rig.job.ErrorID, waiting.ErrorID) == (0x8001, 0x8001)
    power = rig.axis.power_instance
    assert power.Busy
    rig.run(3.0)
    assert rig.column("velocity_setpoint")[-1] == 0.0
    assert power.Busy
    assert power.Status is (number == CURRENT)


@pytest.mark.requirement("MC-122")
def test_an_alarm_without_reaction_leaves_everything(rig):
    """A warning changes neither motion nor jobs."""
    rig.travelling(200.0)
    rig.axis.object.alarms.raise_alarm(501)
    rig.run(0.3)
    assert rig.job.InVelocity
    assert rig.column("velocity_setpoint")[-1] == pytest.approx(200.0)


@pytest.mark.requirement("MC-123", "MC-132", "MC-642")
def test_no_job_while_an_alarm_is_pending(rig):
    """16#8001 until acknowledged; then the same instance starts with a new edge, without acknowledging its
    error.
    """
    rig.enabled()
    rig.axis.object.alarms.raise_alarm(EMERGENCY)
    rig.run(1.0)
    job = rig.axis.move_velocity(50.0)
    rig.cycles(1)
    assert job.ErrorID == 0x8001
    rig.until(rig.axis.reset().done)
    rig.until(rig.axis.power_instance.status)
    assert rig.column("velocity_setpoint")[-1] == 0.0
    job.set(Execute=False)
    rig.cycles(1)
    job.set(Execute=True)
    rig.until(job.in_velocity)


@pytest.mark.requirement("MC-105")
@pytest.mark.parametrize("how", ["disabled", "remove enable", "coast", "quick stop"])
def test_follow_up(rig, how):
    """While setpoints track the actual values no job is executed, and the actual position goes on being
    shown.
    """
    rig.travelling(200.0)
    if how == "remove enable":
        rig.axis.object.alarms.raise_alarm(REMOVE_ENABLE)
    else:
        rig.axis.power(False, stop_mode={"disabled": 0, "coast": 3, "quick stop": 1}[how])
    if how == "disabled":
        rig.until(rig.axis.power_instance.off)
    rig.cycles(3)
    before = rig.column("actual_position")[-1]
    rig.cycles(2)
    if how != "disabled":
        assert rig.column("actual_position")[-1] > before
    assert rig.column("position_setpoint")[-1] == pytest.approx(rig.column("actual_position")[-1])
    job = rig.axis.move_velocity(50.0)
    rig.cycles(1)
    assert job.Error


# -- status bits (1.7)
# ---------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-106", "MC-107", "MC-108", "MC-116")
@pytest.mark.parametrize(
    ("start", "bit"),
    [
        (lambda axis: axis.move_relative(200.0), 8),
        (lambda axis: axis.jog(50.0), 9),
        (lambda axis: axis.move_velocity(50.0), 10),
    ],
)
def test_command_bit_of_the_running_job(rig, start, bit):
    """The job's own bit and no other of the three; X6 when there is none."""
    rig.enabled()
    rig.run(0.1)
    assert rig.axis.var("StatusWord") >> 6 & 1
    start(rig.axis)
    rig.run(0.2)
    word = rig.axis.var("StatusWord")
    assert [number for number in (6, 8, 9, 10) if word >> number & 1] == [bit]


@pytest.mark.requirement("STP-205", "MC-103")
def test_superimposed_motion_closes_position_control(rig):
    """Superimposed motion exists in position control only."""
    rig.enabled(start_mode=0)
    rig.axis.move_superimposed(20.0)
    rig.cycles(2)
    assert not rig.axis.var("StatusWord") >> 28 & 1


@pytest.mark.requirement("MC-092", "MC-090")
def test_negative_velocity_turns_round_where_the_sign_counts(rig):
    """MC_MoveVelocity with -50: backward with Direction 0; the magnitude with Direction 1 and 2."""
    rig.enabled()
    for direction, expected in ((0, -50.0), (1, 50.0), (2, -50.0)):
        job = rig.axis.move_velocity(-50.0, Direction=direction)
        rig.until(job.in_velocity)
        assert rig.column("velocity_setpoint")[-1] == pytest.approx(expected)


@pytest.mark.requirement("MC-640")
def test_the_new_job_brings_its_dynamics(rig):
    """After an abort the dynamics are those of the overriding job."""
    rig.travelling(300.0)
    seen = len(rig.rows)
    rig.axis.move_velocity(100.0, Deceleration=250.0, Jerk=0.0)
    rig.run(0.4)
    assert min(rig.column("acceleration_setpoint")[seen:]) == pytest.approx(-250.0)


@pytest.mark.requirement("MC-641", "MC-256")
def test_done_comes_after_the_dwell_time(make_rig):
    """Done follows the target by MinDwellTime."""
    rig = make_rig(variables={"PositioningMonitoring.MinDwellTime": 0.2})
    rig.enabled()
    job = rig.axis.move_relative(10.0)
    rig.until(lambda: rig.axis.var("Position") == pytest.approx(10.0, abs=1e-9))
    arrived = rig.scheduler.now
    rig.until(job.done)
    assert (rig.scheduler.now - arrived) * 1e-9 == pytest.approx(0.2, abs=0.02)
