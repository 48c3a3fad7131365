"""Profiles with an interpolator cycle of several servo cycles: their limits hold in every servo cycle (T_ipo
= n * T_servo).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

SERVO_NS = 1_000_000
RATIOS = pytest.mark.parametrize("ratio", [2, 4, 8])


def slopes(rig, since, column="velocity_setpoint"):
    return [(b - a) * 1e9 / SERVO_NS for a, b in pairwise(rig.column(column)[since:])]


@pytest.mark.requirement("STP-123", "STP-388", "STP-416")
@RATIOS
@pytest.mark.parametrize("velocity", [300.0, 123.4])
def test_the_emergency_ramp_is_never_steeper_than_configured(make_rig, ratio, velocity):
    """EmergencyDeceleration also where the ramp ends between two calls of the interpolator, in velocity and
    position.
    """
    rig = make_rig(cycle_ns=SERVO_NS, ratio=ratio)
    rig.enabled()
    job = rig.axis.move_velocity(velocity)
    rig.until(job.in_velocity)
    rig.run(0.1)
    since = len(rig.rows) - 1
    rig.axis.stop(0)
    rig.run(velocity / 4000.0 + 0.05)
    assert rig.column("velocity_setpoint")[-1] == 0.0
    assert min(slopes(rig, since)) == pytest.approx(-4000.0, abs=0.1)
    velocities = slopes(rig, since, "position_setpoint")
    steepest = min((b - a) * 1e9 / SERVO_NS for a, b in pairwise(velocities))
    assert steepest == pytest.approx(-4000.0, abs=0.1)


@pytest.mark.requirement("LIM-075", "STP-116")
@RATIOS
def test_a_software_limit_is_reached_and_not_passed(make_rig, ratio):
    """The ramp of alarm 533 ends at the limit, and nowhere on its way beyond it."""
    limits = {"PositionLimits_SW.Active": True, "PositionLimits_SW.MaxPosition": 60.0}
    rig = make_rig(cycle_ns=SERVO_NS, ratio=ratio, variables=limits | {"DynamicLimits.MaxJerk": 1.0e6})
    rig.enabled()
    rig.axis.home(0.0)
    rig.axis.move_velocity(123.0)
    rig.run(1.2)
    positions = rig.column("position_setpoint")
    assert positions[-1] == pytest.approx(60.0, abs=1e-9)
    assert max(positions) <= 60.0 + 1e-9
    assert min(slopes(rig, 0)) >= -2000.0 - 0.1


@pytest.mark.requirement("STP-192", "MC-351")
@RATIOS
def test_the_sum_of_two_motions_is_interpolated_too(make_rig, ratio):
    """Basic and superimposed motion end at the sum of both ways, with the accelerations of both at most."""
    rig = make_rig(cycle_ns=SERVO_NS, ratio=ratio)
    rig.enabled()
    basic = rig.axis.move_relative(20.0, Velocity=100.0, Acceleration=900.0, Deceleration=900.0, Jerk=0.0)
    rig.run(0.05)
    part = rig.axis.move_superimposed(
        7.0, VelocityDiff=90.0, Acceleration=500.0, Deceleration=500.0, Jerk=0.0
    )
    rig.until(lambda: basic.Done and part.Done)
    assert rig.column("position_setpoint")[-1] == pytest.approx(27.0, abs=1e-9)
    assert max(abs(one) for one in slopes(rig, 0)) <= 1400.0 + 0.1
