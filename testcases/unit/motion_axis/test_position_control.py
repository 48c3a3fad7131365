"""Position control in the controller: gain, precontrol, balancing, and what is seen of them (§5.13.2 to
§5.13.4).
"""

from __future__ import annotations

import numpy as np
import pytest

from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.lagging_drive import LaggingDrivePort

LOOSE = {"FollowingError.EnableMonitoring": False}
KV, KPC, LAG = "PositionControl.Kv", "PositionControl.Kpc", "DynamicAxisModel.VelocityTimeConstant"


def axis_with(lag_s=0.0, load_rpm=0.0, **variables):
    port = LaggingDrivePort(cycle_s=CYCLE, lag_s=lag_s, load_rpm=load_rpm)
    return Rig(port=port, variables=LOOSE | variables)


@pytest.mark.requirement("CTL-001", "CTL-096")
@pytest.mark.parametrize("kv", [5.0, 20.0])
def test_a_constant_disturbance_leaves_a_deviation(kv):
    """The controller has no integral part: a load that takes 30 rpm (5 mm/s) leaves 5 / Kv."""
    rig = axis_with(lag_s=0.004, load_rpm=30.0, **{KV: kv}).enabled()
    rig.run(3.0)
    assert rig.axis.var("StatusServo.ControlDifference") == pytest.approx(5.0 / kv, rel=0.02)
    assert rig.axis.var("Position") - rig.axis.var("ActualPosition") == pytest.approx(5.0 / kv, rel=0.02)


@pytest.mark.requirement("CTL-039", "CTL-008", "CTL-046", "MON-035", "CTL-024", "VAR-190")
@pytest.mark.parametrize(("kv", "difference"), [(10.0, 10.0), (20.0, 5.0)])
def test_without_precontrol_the_axis_lags(kv, difference):
    """Kpc = 0, 100 mm/s: the control difference is v / Kv, and so is the following error; a higher gain
    lowers it.
    """
    rig = axis_with(**{KV: kv, KPC: 0.0}).travelling(100.0)
    rig.run(2.0)
    assert rig.axis.var("StatusServo.ControlDifference") == pytest.approx(difference, rel=0.01)
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(difference, rel=0.01)


@pytest.mark.requirement("CTL-039", "CTL-009", "CTL-015", "CTL-041", "CTL-044", "CTL-023", "VAR-190")
def test_precontrol_takes_the_lag_away():
    """Kpc = 100 % and the lag of the drive as T_vtc: below 1 % of v / Kv; the balanced position is v * T_vtc
    behind.
    """
    rig = axis_with(lag_s=0.02, **{KV: 10.0, KPC: 100.0, LAG: 0.02}).travelling(100.0)
    rig.run(1.0)
    assert abs(rig.axis.var("StatusServo.ControlDifference")) < 0.1
    assert rig.axis.var("Position") - rig.axis.var("StatusServo.BalancedPosition") == pytest.approx(
        2.0, rel=1e-3
    )
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(2.0, rel=0.02)


@pytest.mark.requirement("CTL-044")
@pytest.mark.parametrize(("kpc", "behind"), [(0.0, 0.0), (50.0, 1.0), (100.0, 2.0), (120.0, 2.0)])
def test_balancing_is_mixed_by_the_precontrol(kpc, behind):
    """Between 0 and 100 % the balancing counts as much as the precontrol does."""
    rig = axis_with(lag_s=0.02, **{KPC: kpc, LAG: 0.02}).travelling(100.0)
    balanced = rig.axis.var("StatusServo.BalancedPosition")
    assert rig.axis.var("Position") - balanced == pytest.approx(behind, abs=2e-3)


@pytest.mark.requirement("CTL-042", "VAR-179")
def test_without_precontrol_the_time_constant_does_nothing():
    """Kpc = 0: the same motion whatever T_vtc says."""
    rigs = [axis_with(lag_s=0.01, **{KPC: 0.0, LAG: constant}) for constant in (0.0, 0.05)]
    for rig in rigs:
        rig.enabled()
        rig.axis.move_relative(20.0)
        rig.run(1.0)
    assert rigs[0].column("actual_position") == rigs[1].column("actual_position")


@pytest.mark.requirement("CTL-043", "CTL-041", "VAR-179")
@pytest.mark.parametrize(("constant", "overshoots"), [(0.0, True), (0.03, False)])
def test_overshoot_at_the_end_of_braking(constant, overshoots):
    """A drive with a lag of 30 ms overshoots without T_vtc, and does not with it."""
    rig = axis_with(lag_s=0.03, **{KPC: 100.0, LAG: constant, KV: 10.0}).enabled()
    rig.axis.move_relative(50.0, Velocity=200.0, Acceleration=1500.0, Deceleration=1500.0)
    rig.run(2.0)
    beyond = max(rig.column("actual_position")) - 50.0
    assert (beyond > 0.05) is overshoots
    assert rig.column("actual_position")[-1] == pytest.approx(50.0, abs=0.01)


@pytest.mark.requirement("CTL-038", "CTL-049")
def test_the_output_is_the_printed_sum():
    """Speed setpoint = Kv * control difference + Kpc / 100 * velocity, as motor speed, within the maximum
    speed.
    """
    rig = axis_with(lag_s=0.02, **{KV: 20.0, KPC: 80.0, "Actor.DriveParameter.MaxSpeed": 2000.0}).enabled()
    rows = []
    rig.runtime.after_cycle.append(
        lambda: rows.append(
            (
                rig.axis.var("StatusServo.ControlDifference"),
                rig.axis.var("Velocity"),
                rig.axis.object.speed_output_rpm,
            )
        )
    )
    rig.axis.move_relative(150.0, Velocity=400.0)
    rig.run(1.0)
    difference, velocity, output = np.array(rows).T
    expected = np.clip(6.0 * (20.0 * difference + 0.8 * velocity), -2000.0, 2000.0)
    assert output == pytest.approx(expected, abs=1e-9)
    assert output.max() == 2000.0


@pytest.mark.requirement("CTL-040", "CTL-104", "VAR-179")
@pytest.mark.parametrize(("written", "acts"), [(200.0, 150.0), (-5.0, 0.0)])
def test_precontrol_is_kept_in_its_range(written, acts):
    """A value outside 0..150 % is set to the violated bound at once, without an alarm."""
    rig = axis_with().enabled()
    rig.axis.write(KPC, written)
    rig.cycles(2)
    assert rig.axis.var(KPC) == acts
    assert not rig.events("alarm.raised")


@pytest.mark.requirement("CTL-007")
@pytest.mark.parametrize(("smoothing", "greatest"), [(0.0, 95.0), (0.05, 10.0)])
def test_a_change_of_the_gain_can_be_smoothed(smoothing, greatest):
    """Kv from 10 to 20 at a control difference of 10 mm: a step of 100 mm/s, or the way there with the
    smoothing time.
    """
    rig = axis_with(
        **{KV: 10.0, KPC: 0.0, "PositionControl.SmoothingTimeByChangeDifference": smoothing}
    ).travelling(100.0)
    rig.run(2.0)
    before = len(rig.rows)
    rig.axis.write(KV, 20.0)
    rig.run(1.0)
    outputs = np.array(rig.column("speed_output")[before - 1 :]) / 6.0
    step = abs(np.diff(outputs)).max()
    assert step > greatest if not smoothing else step < greatest
    assert rig.axis.var("StatusServo.ControlDifference") == pytest.approx(5.0, rel=0.01)


@pytest.mark.requirement("CTL-002", "CTL-005", "CTL-004", "VAR-192")
def test_a_disabled_axis_follows_what_moves_it():
    """Moved by hand from 10 to 25: setpoint and actual value are 25, there is no following error and no
    alarm.
    """
    rig = Rig()
    rig.cycles(3)
    rig.axis.home(10.0)
    rig.cycles(2)
    for _ in range(100):
        rig.port.turn(0.15 / 10.0 * 2.0 * np.pi)
        rig.cycles()
    assert rig.axis.var("ActualPosition") == pytest.approx(25.0, abs=1e-3)
    assert rig.axis.var("Position") == rig.axis.var("ActualPosition")
    assert rig.axis.var("StatusPositioning.FollowingError") == 0.0
    assert not rig.events("alarm.raised")


@pytest.mark.requirement("CTL-004", "CTL-006", "CTL-003", "VAR-192")
def test_following_up_during_an_alarm_stop():
    """Reaction 4 at 100 mm/s: on the OFF3 ramp setpoint equals actual value; enabling at rest makes no
    jump.
    """
    rig = axis_with().travelling(100.0)
    rig.axis.alarms.raise_alarm(531)
    rig.cycles(2)
    while rig.axis.at_rest is False:
        assert rig.axis.var("Position") == rig.axis.var("ActualPosition")
        rig.cycles()
    rig.run(0.5)
    rig.until(rig.axis.reset().done)
    rest = rig.axis.var("ActualPosition")
    rig.run(0.5)
    assert rig.axis.var("StatusWord.X0")
    assert rig.axis.var("Position") == pytest.approx(rest, abs=1e-3)
    assert max(abs(value) for value in rig.column("speed_output")[-100:]) < 1.0


# -- switching position control
# -----------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("CTL-085", "CTL-086", "CTL-087", "CTL-090")
def test_the_mode_stays_until_another_instruction_changes_it(rig):
    """StartMode 0 leaves it off; MC_Halt and MC_Stop do not change it; velocity jobs choose; positioning
    forces it on.
    """
    off = lambda: rig.axis.var("StatusWord.X28")  # noqa: E731 - a name for a bit
    rig.enabled(start_mode=0)
    rig.axis.home(0.0)
    assert off()
    rig.until(rig.axis.move_velocity(20.0, PositionControlled=False).in_velocity)
    rig.until(rig.axis.halt().done)
    assert off()
    rig.until(rig.axis.move_velocity(20.0).in_velocity)
    assert not off()
    stop = rig.axis.stop(0)
    rig.until(stop.done)
    assert not off()
    stop.set(Execute=False)
    rig.cycles(2)
    jog = rig.axis.jog(10.0, PositionControlled=False)
    rig.run(0.2)
    assert off()
    jog.set(JogForward=False)
    rig.run(0.5)
    assert off()
    rig.until(rig.axis.move_relative(1.0).done)
    assert not off()


@pytest.mark.requirement("CTL-093", "CTL-089")
@pytest.mark.parametrize("start", ["move_absolute", "move_relative", "move_superimposed"])
def test_closing_the_loop_on_the_way_makes_no_jump(start):
    """50 mm/s without position control: the first setpoint is the actual position, moved on by the delay."""
    rig = axis_with(lag_s=0.004, **{LAG: 0.004}).enabled()
    rig.axis.home(0.0)
    rig.until(rig.axis.move_velocity(50.0, PositionControlled=False).in_velocity)
    rig.run(0.3)
    before = len(rig.rows)
    getattr(rig.axis, start)(100.0)
    rig.run(0.1)
    assert not rig.axis.var("StatusWord.X28")
    setpoints = np.array(rig.column("position_setpoint")[before - 3 :])
    assert np.diff(setpoints).max() < 1.0
    outputs = np.array(rig.column("speed_output")[before - 1 :]) / 6.0
    assert abs(np.diff(outputs)).max() < 1000.0 * CYCLE + 0.5


@pytest.mark.requirement("CTL-094", "MON-036")
def test_opening_the_loop_forgets_the_following_error():
    """5 mm behind: MC_MoveVelocity without position control never makes them up, and shows none."""
    rig = axis_with(**{KPC: 0.0, KV: 20.0}).travelling(100.0)
    rig.run(1.0)
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(5.0, rel=0.01)
    rig.until(rig.axis.move_velocity(100.0, PositionControlled=False).in_velocity)
    rig.cycles(2)
    assert rig.axis.var("StatusPositioning.FollowingError") == 0.0
    rig.run(1.0)
    assert max(rig.column("actual_velocity")[-200:]) < 100.5
    rig.until(rig.axis.halt().done)
    assert rig.axis.var("StatusPositioning.FollowingError") == 0.0


@pytest.mark.requirement("CTL-093", "CFG-168")
@pytest.mark.parametrize("ratio", [1, 2, 4])
def test_closing_the_loop_between_two_interpolator_cycles(ratio):
    """With a slower interpolator the setpoint goes on from where the loop is closed: the speed output stays
    as it was.
    """
    rig = Rig(ratio=ratio, variables=LOOSE).enabled()
    rig.until(rig.axis.move_velocity(100.0, PositionControlled=False).in_velocity)
    rig.run(0.1)
    before = len(rig.rows)
    for closed in (True, False, True):
        rig.axis.move_velocity(100.0, PositionControlled=closed)
        rig.run(0.1)
        assert rig.axis.var("StatusWord.X28") is not closed
    assert rig.column("speed_output")[before:] == pytest.approx([600.0] * (len(rig.rows) - before), abs=3.0)


@pytest.mark.requirement("CTL-104", "CTL-008", "CTL-016", "CTL-015")
@pytest.mark.parametrize("kind", ["none", "Simulation.Mode", "VirtualAxis.Mode"])
@pytest.mark.parametrize(
    ("path", "value"),
    [
        (KV, 0.0),
        (LAG, 1e12),
        ("DynamicAxisModel.AdditionalPositionTimeConstant", 1e12),
        ("PositionControl.SmoothingTimeByChangeDifference", 1e12),
        ("FollowingError.AdditionalSetpointDelayTime", 1e12),
        ("PositioningMonitoring.ToleranceTime", 1e12),
        ("StandstillSignal.MinDwellTime", 1e12),
    ],
)
def test_the_end_of_a_range_stops_no_cycle(kind, path, value):
    """Any value within its range may be written while moving: the axis goes on being controlled, and shows
    numbers.
    """
    rig = Rig(variables=LOOSE | {KPC: 0.0} | ({} if kind == "none" else {kind: 1})).travelling(50.0)
    rig.axis.write(path, value)
    rig.run(0.1)
    assert rig.axis.var(path) == value
    shown = (
        "StatusPositioning.SetpointExecutionTime",
        "StatusPositioning.FollowingError",
        "StatusServo.ControlDifference",
        "VelocitySetpoint",
    )
    assert all(np.isfinite(rig.axis.var(name)) for name in shown)
    rig.until(rig.axis.halt().ended)
    rig.axis.power(False, stop_mode=0)
    rig.run(0.5)
    assert not rig.axis.var("StatusWord.X0")
