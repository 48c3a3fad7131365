"""`MC_GearInVelocity`: velocity gearing with setpoint coupling (SYN section 7.3)."""

from __future__ import annotations

from itertools import pairwise

import pytest

from motion.s7.axis import PositioningAxis
from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.test_gear_in import (
    FIXTURE,
    NON_POSITION_CONTROLLED,
    SYNCHRONIZING,
    SYNCHRONOUS,
    word,
)

REAL = {"VirtualAxis.Mode": 0}


def gear(velocity=100.0, numerator=1, denominator=1, *, leader=None, follower=None, **inputs):
    """A leading axis with a constant velocity, and an axis that synchronises to it since this cycle."""
    rig = Rig(
        synchronous=True, variables=FIXTURE | (follower or {}), leader_variables=FIXTURE | (leader or {})
    )
    rig.enabled().leader_at(velocity)
    rig.job = rig.axis.gear_in_velocity(rig.leader, numerator, denominator, **inputs)
    rig.cycles()
    return rig


def phase(rig):
    """Busy, StartSync, InSync, and the bits of the status word."""
    return rig.job.Busy, rig.job.StartSync, rig.job.InSync, word(rig.axis)


def in_sync(*arguments, **options):
    """The same, synchronous."""
    rig = gear(*arguments, **options)
    rig.until(rig.job.in_sync)
    return rig


@pytest.mark.requirement("SYN-165", "SYN-168", "SYN-169")
def test_the_velocity_follows_and_the_outputs_say_the_phase():
    """StartSync while the axis accelerates with the value of its job, InSync behind it; FunctionState 6."""
    rig = gear(100.0, -3, 2, Acceleration=1000.0, Jerk=0.0)
    assert (rig.job.Busy, rig.job.StartSync, rig.job.InSync, word(rig.axis)) == (
        True,
        True,
        False,
        SYNCHRONIZING,
    )
    rig.until(rig.job.in_sync)
    assert (rig.job.Busy, rig.job.StartSync, rig.job.InSync, word(rig.axis)) == (
        True,
        False,
        True,
        SYNCHRONOUS,
    )
    assert rig.axis.var("StatusSynchronizedMotion.FunctionState") == 6
    changes = [abs(b - a) for a, b in pairwise(rig.column("velocity_setpoint"))]
    assert max(changes) == pytest.approx(1000.0 * CYCLE)
    for velocity in (40.0, -70.0):
        rig.until(rig.leader.move_velocity(velocity).in_velocity)
        assert rig.axis.var("Velocity") == pytest.approx(-1.5 * velocity)
    assert rig.job.InSync
    rig.axis.halt()
    rig.cycles(2)
    assert (rig.job.CommandAborted, rig.job.StartSync, rig.job.InSync) == (True, False, False)
    assert rig.axis.var("StatusSynchronizedMotion.FunctionState") == 0


@pytest.mark.requirement("SYN-410", "SYN-421")
def test_a_reversal_while_synchronising_is_followed():
    """No alarm 608: the criterion is the velocity."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE)
    rig.enabled().leader_at(100.0)
    rig.until(rig.axis.move_velocity(-100.0).in_velocity)
    job = rig.axis.gear_in_velocity(rig.leader, Acceleration=20.0, Deceleration=20.0, Jerk=0.0)
    rig.leader.move_velocity(-50.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0)
    rig.until(job.in_sync)
    assert rig.axis.var("Velocity") == pytest.approx(-50.0)
    assert rig.alarms_of("axis1") == []


@pytest.mark.requirement("SYN-166", "SYN-170", "SYN-171", "SYN-420", "SYN-423")
def test_the_ratio_is_taken_over_continuously_or_with_the_next_start():
    """With ContinuousUpdate a change acts at once, without a limit; what changes before InSync acts with it;
    once the input has fallen the last ratio stays, also when it comes again; a new start brings it back.
    """
    rig = gear(100.0, 100, 100, ContinuousUpdate=True, Acceleration=1000.0)
    assert rig.job.ContinuousUpdateActive
    rig.job.set(RatioNumerator=90)
    rig.cycles(2)
    rig.until(rig.job.in_sync)
    rig.cycles(2)
    assert rig.axis.var("Velocity") == pytest.approx(90.0)
    rig.job.set(RatioNumerator=1_100_001, RatioDenominator=1_000_000)
    rig.cycles(2)
    assert (rig.job.InSync, rig.axis.var("Velocity")) == (True, pytest.approx(110.0001))
    rig.job.set(ContinuousUpdate=False)
    rig.cycles(2)
    for again in (False, True):
        rig.job.set(RatioNumerator=2_000_000, ContinuousUpdate=again)
        rig.cycles(3)
        assert not rig.job.ContinuousUpdateActive
        assert rig.axis.var("Velocity") == pytest.approx(110.0001)
    rig.job.set(Execute=False)
    rig.cycles()
    rig.job.set(Execute=True)
    rig.cycles()
    assert (rig.job.ContinuousUpdateActive, rig.job.StartSync, rig.job.InSync) == (True, True, False)
    rig.until(rig.job.in_sync)
    assert rig.axis.var("Velocity") == pytest.approx(200.0)


@pytest.mark.requirement("SYN-167")
@pytest.mark.parametrize("controlled", [False, True])
def test_the_mode_of_the_follower_is_that_of_the_job(controlled):
    """Without position control nothing can be superimposed (16#8071); with it the axis is controlled."""
    rig = in_sync(100.0, follower=REAL, PositionControlled=controlled)
    rig.run(0.2)
    assert bool(rig.axis.var("StatusWord") & NON_POSITION_CONTROLLED) is not controlled
    assert rig.axis.var("ActualVelocity") == pytest.approx(100.0, abs=2.0)
    on_top = rig.axis.move_superimposed(10.0)
    rig.cycles(2)
    assert (on_top.Error, on_top.ErrorID) == ((False, 0) if controlled else (True, 0x8071))
    assert rig.job.InSync


@pytest.mark.requirement("SYN-106")
def test_synchronising_knows_the_limits_of_all_but_the_velocity():
    """Beyond the maximum velocity of the axis, which StatusWord.X0 shows; the acceleration is limited with
    alarm 502.
    """
    fast = {"Actor.DriveParameter.MaxSpeed": 6000.0, "Actor.DriveParameter.ReferenceSpeed": 6000.0}
    rig = gear(400.0, 2, 1, follower=fast, Acceleration=1e6, Jerk=0.0)
    rig.until(rig.job.in_sync)
    assert rig.axis.var("Velocity") == pytest.approx(800.0)
    assert rig.axis.var("StatusSynchronizedMotion.StatusWord") == 1
    assert rig.alarms_of("axis1") == [502]
    changes = [abs(b - a) for a, b in pairwise(rig.column("velocity_setpoint"))]
    assert max(changes) == pytest.approx(5000.0 * CYCLE)


@pytest.mark.requirement("SYN-378")
def test_the_mode_of_the_leading_axis_does_not_matter():
    """No alarm 603 with a leading axis without position control."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=REAL)
    rig.enabled().leader_at(0.0)
    rig.until(rig.leader.move_velocity(50.0, PositionControlled=False).in_velocity)
    job = rig.axis.gear_in_velocity(rig.leader, 2, 1)
    rig.until(job.in_sync)
    assert rig.axis.var("Velocity") == pytest.approx(100.0)


@pytest.mark.requirement("SYN-017")
def test_a_leading_axis_that_is_not_interconnected():
    """Alarm 601, job 16#8001."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE)
    rig.enabled()
    other = PositioningAxis("other", rig.port, cycle_ns=rig.cycle_ns)
    job = rig.axis.gear_in_velocity(other)
    rig.cycles(2)
    assert (job.Error, job.ErrorID, rig.alarms_of("axis1")) == (True, 0x8001, [601])
