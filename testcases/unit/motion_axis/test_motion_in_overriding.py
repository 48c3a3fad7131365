"""What ends a job with setpoints from the user program, and what such a job ends (§5.14.4, §8.20)."""

from __future__ import annotations

import pytest

CYCLE = 0.004
LOOSE = {"FollowingError.EnableMonitoring": False}


@pytest.mark.requirement("MIN-044", "MIN-043", "MC-084", "MIN-050", "OVR-008")
def test_a_halt_starts_from_the_given_state(rig):
    """Velocity 80: MC_Halt with 100 mm/s2 takes 0.8 s from the first cycle; the instance stays aborted until
    Enable falls.
    """
    rig.enabled()
    job = rig.axis.motion_in_velocity(0.0)
    rig.feed(job, [{"Velocity": 1.6 * step} for step in range(51)])
    rig.cycles()
    start = rig.times()[-1]
    rig.axis.halt(Deceleration=100.0, Jerk=0.0)
    rig.cycles(2)
    assert rig.axis.var("Velocity") == pytest.approx(80.0 - 100.0 * CYCLE)
    rig.until(lambda: rig.axis.var("Velocity") == 0.0)
    assert rig.times()[-1] - start == pytest.approx(0.8, abs=2.1 * CYCLE)
    assert (job.CommandAborted, job.Busy) == (True, False)
    job.set(Velocity=20.0)
    rig.run(0.2)
    assert rig.axis.var("Velocity") == 0.0
    assert job.CommandAborted
    job.set(Enable=False)
    rig.cycles()
    assert not job.CommandAborted
    job.set(Enable=True)
    rig.cycles(2)
    assert rig.axis.var("Velocity") == 20.0


@pytest.mark.requirement("MIN-045", "MIN-024", "MC-476", "MC-095")
def test_a_given_acceleration_that_is_not_true_runs_away(make_rig):
    """Acceleration 2000 at constant velocity: a job with 200 and jerk 1000 needs 1.8 s and gains up to 1980
    mm/s.
    """
    fast = {
        "DynamicLimits.MaxVelocity": 5000.0,
        "DynamicLimits.Velocity": 5000.0,
        "FollowingError.MaxValue": 5000.0,
    }
    rig = make_rig(variables=fast | LOOSE).enabled()
    job = rig.axis.motion_in_velocity(10.0, Acceleration=2000.0)
    rig.cycles(3)
    start = rig.times()[-1]
    rig.axis.move_velocity(4000.0, Acceleration=200.0, Deceleration=200.0, Jerk=1000.0)
    rig.until(lambda: rig.axis.var("Acceleration") <= 200.0 + 1e-9 and job.CommandAborted)
    assert rig.times()[-1] - start == pytest.approx(1.8, abs=3 * CYCLE)
    assert rig.axis.var("Velocity") == pytest.approx(10.0 + 1980.0, rel=0.01)


@pytest.mark.requirement("MIN-046")
@pytest.mark.parametrize(("given", "jerk"), [(2000.0, 0.0), (0.0, 1000.0)])
def test_remedies_against_running_away(make_rig, given, jerk):
    """Without a jerk limit, or with Acceleration 0.0 given, the job that takes over gains nothing."""
    rig = make_rig(variables=LOOSE).enabled()
    rig.axis.motion_in_velocity(100.0, Acceleration=given)
    rig.cycles(3)
    rig.axis.move_velocity(100.0, Acceleration=200.0, Deceleration=200.0, Jerk=jerk)
    rig.run(1.0)
    assert max(rig.column("velocity_setpoint")) == pytest.approx(100.0)


NEW = {
    "MC_Halt 0": lambda axis: axis.halt(Mode=0),
    "MC_Halt 1": lambda axis: axis.halt(Mode=1),
    "MC_MoveAbsolute": lambda axis: axis.move_absolute(50.0),
    "MC_MoveRelative": lambda axis: axis.move_relative(50.0),
    "MC_MoveVelocity": lambda axis: axis.move_velocity(20.0),
    "MC_MoveJog": lambda axis: axis.jog(20.0),
    "MC_MotionInVelocity": lambda axis: axis.motion_in_velocity(1.0),
    "MC_MotionInPosition": lambda axis: axis.motion_in_position(axis.var("Position")),
    "MC_Stop": lambda axis: axis.stop(0),
}


@pytest.mark.requirement("MIN-047", "OVR-014")
@pytest.mark.parametrize("active", ["motion_in_velocity", "motion_in_position"])
@pytest.mark.parametrize("new", NEW)
def test_what_aborts_a_job(rig, active, new):
    """Column H8 of the override table."""
    rig.enabled()
    rig.axis.home(0.0)
    rig.cycles(2)
    job = getattr(rig.axis, active)(0.0)
    rig.cycles(3)
    other = NEW[new](rig.axis)
    rig.cycles(2)
    assert job.CommandAborted
    assert other.Busy or other.Done


@pytest.mark.requirement("MIN-047", "MC-267", "MIN-030")
def test_what_does_not_abort_a_job(rig):
    """Superimposed jobs run on top, positioning with BufferMode 1 waits until the job ends by Enable =
    FALSE.
    """
    rig.enabled()
    rig.axis.home(0.0)
    rig.cycles(2)
    job = rig.axis.motion_in_velocity(10.0)
    rig.cycles(3)
    waiting = rig.axis.move_absolute(60.0, BufferMode=1)
    top = rig.axis.move_superimposed(5.0)
    rig.until(top.done)
    assert job.Busy
    assert waiting.Busy
    assert not waiting.Active
    job.set(Enable=False)
    rig.cycles(2)
    assert waiting.Active
    rig.until(waiting.done)
    assert rig.axis.var("Position") == pytest.approx(60.0)


@pytest.mark.requirement("MIN-048")
@pytest.mark.parametrize("new", ["MC_MotionInVelocity", "MC_MotionInPosition"])
def test_what_a_new_job_aborts(rig, new):
    """Positioning in control, positioning that waits, and superimposed motion; MC_Stop turns it away."""
    rig.enabled()
    active = rig.axis.move_relative(200.0)
    waiting = rig.axis.move_relative(10.0, BufferMode=1)
    top = rig.axis.move_superimposed(50.0)
    rig.run(0.1)
    job = NEW[new](rig.axis)
    rig.cycles(2)
    assert job.Busy
    assert active.CommandAborted
    assert waiting.CommandAborted
    assert top.CommandAborted
    rig.axis.stop(0)
    rig.cycles(2)
    refused = NEW[new](rig.axis)
    rig.cycles()
    assert (refused.Error, refused.ErrorID) == (True, 0x800F)
