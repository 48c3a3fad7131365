"""Setpoints from the user program against a drive with inertia and a torque limit (§5.14)."""

from __future__ import annotations

import pytest

from hil.expect.checkers import check_setpoint_continuity
from reports.model import Verdict
from testcases.unit.hil.test_hil_profidrive import bench, enabled

pytestmark = pytest.mark.exhaustive


def moving(machine, velocity):
    """Ramp MC_MotionInVelocity up within 0.2 s, as a program would."""
    axis = enabled(machine)
    job = axis.motion_in_velocity(0.0)
    for step in range(1, 51):
        job.set(Velocity=velocity * step / 50, Acceleration=velocity / 0.2)
        machine.run_for(0.004)
    job.set(Velocity=velocity, Acceleration=0.0)
    machine.run_for(0.3)
    return axis, job


@pytest.mark.requirement("MIN-007", "MC-480", "MC-490", "MC-604")
@pytest.mark.parametrize("watched", [True, False])
def test_a_step_of_the_velocity(watched):
    """A step that the drive cannot follow: 521, disabled, 16#8001; without monitoring the drive goes there at
    its torque limit.
    """
    with bench(
        variables={"FollowingError.EnableMonitoring": watched, "FollowingError.MaxValue": 3.0}
    ) as machine:
        axis = enabled(machine)
        job = axis.motion_in_velocity(0.0)
        machine.run_for(0.1)
        job.set(Velocity=450.0)
        machine.run_for(0.4)
        numbers = [entry.data["number"] for entry in machine.history.select(kind="alarm.raised")]
        if watched:
            assert 521 in numbers
            assert (job.Error, job.ErrorID, job.Busy) == (True, 0x8001, False)
            assert not axis.var("StatusWord.X0")
        else:
            assert 521 not in numbers
            assert job.Busy
            assert axis.var("ActualVelocity") == pytest.approx(450.0, rel=0.01)


@pytest.mark.requirement("MIN-026", "MIN-027", "MIN-028")
@pytest.mark.parametrize("watched", [True, False])
def test_enable_falls_at_speed(watched):
    """The setpoint is zero at once, the drive brakes as hard as it can, and the following error may trip
    521.
    """
    with bench(
        variables={"FollowingError.EnableMonitoring": watched, "FollowingError.MaxValue": 3.0}
    ) as machine:
        axis, job = moving(machine, 400.0)
        assert axis.var("ActualVelocity") == pytest.approx(400.0, rel=0.01)
        job.set(Enable=False)
        machine.run_for(0.008)
        there = axis.var("Position")
        assert axis.var("Velocity") == 0.0
        machine.run_for(0.6)
        numbers = [entry.data["number"] for entry in machine.history.select(kind="alarm.raised")]
        if watched:
            assert 521 in numbers
        else:
            assert not numbers
            assert axis.var("ActualPosition") == pytest.approx(there, abs=0.05)
        assert not job.Busy


@pytest.mark.requirement("MC-568")
def test_the_continuity_of_setpoints_is_not_judged_there():
    """The always-on rule knows that these setpoints may step, and judges what surrounds them."""
    with bench(variables={"FollowingError.EnableMonitoring": False}) as machine:
        axis, job = moving(machine, 100.0)
        job.set(Velocity=-100.0)
        machine.run_for(0.2)
        job.set(Enable=False)
        machine.run_for(0.2)
        top = axis.motion_in_superimposed(0.0, VelocityDiff=40.0)
        machine.run_for(0.1)
        top.set(Enable=False)
        machine.run_for(0.2)
        machine.run_until(axis.move_relative(20.0).done, timeout=3.0)
        checks = check_setpoint_continuity(machine.trace())
        assert [check.verdict for check in checks] == [Verdict.PASSED]
        assert checks[0].value > 100.0  # the positioning was judged
