"""Travel limits and monitoring on exact numbers (LIM and MON of the limits specification)."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motion.s7.axis import AxisState

SOFT = {
    "PositionLimits_SW.Active": True,
    "PositionLimits_SW.MinPosition": -100.0,
    "PositionLimits_SW.MaxPosition": 100.0,
}
HARD = {"PositionLimits_HW.Active": True}


def homed(make_rig, **variables):
    rig = make_rig(variables=variables)
    rig.enabled()
    rig.axis.home(0.0)
    rig.cycles(2)
    return rig


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "LIM-075", "LIM-076", "LIM-077", "LIM-079", "LIM-081", "LIM-082", "STP-590", "VAR-170"
)
def test_software_limit_with_current_dynamics(make_rig):
    """LimitReachedBehavior 1: braking starts at 87.5 and ends at 100.0 exactly; 533, job 16#8001, still
    enabled.
    """
    rig = homed(make_rig, **SOFT, **{"PositionLimits_SW.LimitReachedBehavior": 1})
    move = rig.axis.move_absolute(150.0, Velocity=50.0, Acceleration=100.0, Deceleration=100.0, Jerk=0.0)
    rig.until(lambda: rig.axis.state is AxisState.ALARM_STANDSTILL)
    v = rig.column("velocity_setpoint")
    s = rig.column("position_setpoint")
    full = [position for position, velocity in zip(s, v, strict=True) if velocity == pytest.approx(50.0)]
    assert max(full) == pytest.approx(87.5, abs=50.0 * 0.008)
    assert rig.axis.var("Position") == pytest.approx(100.0, abs=1e-9)
    rig.cycles(1)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (533, 1)
    assert (move.Error, move.ErrorID) == (True, 0x8001)
    assert rig.axis.var("StatusWord.X16")
    assert rig.axis.power_instance.Status


@pytest.mark.requirement("LIM-080", "VAR-170")
def test_software_limit_with_maximum_dynamics(make_rig):
    """LimitReachedBehavior 0 with MaxDeceleration 500: braking starts at 97.5."""
    rig = homed(make_rig, **SOFT, **{"DynamicLimits.MaxDeceleration": 500.0, "DynamicLimits.MaxJerk": 1.0e9})
    rig.axis.move_absolute(150.0, Velocity=50.0, Acceleration=100.0, Deceleration=100.0, Jerk=0.0)
    rig.until(lambda: rig.axis.state is AxisState.ALARM_STANDSTILL)
    full = [
        s
        for s, v in zip(rig.column("position_setpoint"), rig.column("velocity_setpoint"), strict=True)
        if v >= 49.999
    ]
    assert max(full) == pytest.approx(97.5, abs=50.0 * 0.008)
    assert rig.axis.var("Position") == pytest.approx(100.0, abs=1e-9)
    assert rig.axis.var("ErrorDetail.Reaction") == 2


@pytest.mark.requirement("LIM-075", "LIM-077")
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_job_without_jerk_limit_near_a_software_limit(make_rig, side):
    """Its acceleration ends at once: it is not stopped where it stands because the maximum jerk would take
    long to end it.
    """
    soft = SOFT | {"PositionLimits_SW.MinPosition": -100.0, "DynamicLimits.MaxJerk": 5000.0}
    rig = homed(
        make_rig, **soft, **{"DynamicLimits.MaxAcceleration": 1500.0, "DynamicLimits.MaxDeceleration": 2000.0}
    )
    rig.until(rig.axis.home(side * 60.0).done)
    job = rig.axis.move_relative(
        side * 300.0, Velocity=400.0, Acceleration=1500.0, Deceleration=1000.0, Jerk=0.0
    )
    rig.until(lambda: rig.axis.state is AxisState.ALARM_STANDSTILL, 2.0)
    assert job.ErrorID == 0x8001
    assert max(side * v for v in rig.column("velocity_setpoint")) > 100.0
    assert max(side * s for s in rig.column("position_setpoint")) <= 100.0 + 1e-9
    assert rig.axis.var("Position") == pytest.approx(side * 100.0, abs=1e-9)
    assert rig.axis.var("ErrorDetail.Number") == 533


@pytest.mark.requirement("LIM-073", "VAR-170")
def test_software_limit_needs_homing(make_rig):
    """Without homing the software limits do not act."""
    rig = make_rig(variables=SOFT)
    rig.enabled()
    rig.axis.move_velocity(100.0)
    rig.run(2.0)
    assert rig.axis.var("Position") > 150.0
    assert rig.axis.var("ErrorDetail.Number") == 0


@pytest.mark.requirement("LIM-083", "LIM-094")
def test_retracting_from_a_software_limit(make_rig):
    """After the acknowledgement the axis moves back in; outwards it is refused again."""
    rig = homed(make_rig, **SOFT)
    rig.axis.move_velocity(100.0)
    rig.until(lambda: rig.axis.state is AxisState.ALARM_STANDSTILL)
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.cycles(2)
    back = rig.axis.move_relative(-10.0)
    rig.until(back.done)
    assert not rig.axis.var("StatusWord.X16")
    assert rig.axis.var("Position") == pytest.approx(90.0)
    rig.axis.move_velocity(100.0)
    rig.until(lambda: rig.axis.state is AxisState.ALARM_STANDSTILL)
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.cycles(2)
    outwards = rig.axis.move_relative(5.0)
    rig.run(0.3)
    assert outwards.ErrorID == 0x8001
    assert rig.axis.var("Position") == pytest.approx(100.0, abs=1e-6)


@pytest.mark.requirement("LIM-095", "VAR-172")
def test_position_outside_is_the_limit(make_rig):
    """Homed beyond the limit, the present position is the limit: outwards refused, inwards allowed."""
    rig = homed(make_rig, **SOFT)
    rig.axis.home(130.0)
    rig.cycles(2)
    outwards = rig.axis.move_absolute(131.0)
    rig.run(0.3)
    assert outwards.Error
    assert rig.axis.var("Position") == pytest.approx(130.0, abs=1e-3)
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.cycles(2)
    inwards = rig.axis.move_absolute(120.0)
    rig.until(inwards.done)


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-075")
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    velocity=st.floats(40.0, 500.0),
    jerk=st.sampled_from([0.0, 500.0, 10000.0, 20000.0]),
    behaviour=st.sampled_from([0, 1]),
    deceleration=st.floats(50.0, 2000.0),
    wait=st.floats(0.0, 0.5),
)
def test_software_limit_is_never_passed(make_rig, velocity, jerk, behaviour, deceleration, wait):
    """Whatever the dynamics, the setpoint ends on the limit and not behind it."""
    rig = homed(make_rig, **SOFT, **{"PositionLimits_SW.LimitReachedBehavior": behaviour})
    rig.axis.move_velocity(velocity / 2, Deceleration=deceleration, Jerk=jerk)
    rig.run(wait)
    rig.axis.move_velocity(velocity, Acceleration=2000.0, Deceleration=deceleration, Jerk=jerk)
    rig.until(lambda: rig.axis.state is AxisState.ALARM_STANDSTILL, timeout=20.0)
    assert max(rig.column("position_setpoint")) <= 100.0 + 1e-6
    assert rig.axis.var("Position") == pytest.approx(100.0, abs=1e-6)
    assert rig.axis.var("ErrorDetail.Number") == 533


@pytest.mark.requirement("LIM-031", "LIM-034", "LIM-037", "LIM-039", "STP-589", "VAR-173")
def test_hardware_limit_with_emergency_ramp(make_rig):
    """Mode 0, ApproachBehavior 1: 531 with reaction 3, emergency ramp, axis stays enabled, X18 at once."""
    rig = homed(make_rig, **HARD, **{"PositionLimits_HW.ApproachBehavior": 1})
    job = rig.axis.move_velocity(300.0)
    rig.until(job.in_velocity)
    start = rig.scheduler.now / 1e9
    rig.port.switches = 2
    rig.cycles(2)
    assert rig.axis.var("StatusWord.X18")
    assert rig.axis.var("ErrorWord.X9")
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (531, 3)
    rig.run(0.3)
    duration, way = rig.stop_of_setpoint(start)
    assert duration == pytest.approx(0.075, abs=0.008)
    assert way == pytest.approx(11.25, abs=2.4)
    assert rig.axis.power_instance.Status
    assert job.ErrorID == 0x8001


@pytest.mark.requirement("LIM-032", "LIM-033", "LIM-038", "VAR-173")
@pytest.mark.parametrize("mode", [0, 1])
def test_hardware_limit_removes_the_enable(make_rig, mode):
    """Mode 1, and Mode 0 with ApproachBehavior 0: 531 with reaction 4; MC_Power stays Busy."""
    rig = homed(make_rig, **HARD, **{"PositionLimits_HW.Mode": mode})
    job = rig.axis.move_velocity(-300.0)
    rig.until(job.in_velocity)
    rig.port.switches = 1
    rig.cycles(2)
    power = rig.axis.power_instance
    assert (rig.axis.var("ErrorDetail.Reaction"), power.Status, power.Busy) == (4, False, True)
    assert rig.axis.var("StatusWord.X17")


@pytest.mark.requirement("LIM-055", "LIM-057", "LIM-058", "LIM-059")
def test_retracting_from_a_hardware_limit(make_rig):
    """After the acknowledgement outward motion raises 531 again, inward motion clears the switch."""
    rig = homed(make_rig, **HARD, **{"PositionLimits_HW.ApproachBehavior": 1})
    rig.axis.move_velocity(100.0)
    rig.run(0.5)
    rig.port.switches = 2
    rig.run(0.3)
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.cycles(2)
    outwards = rig.axis.move_velocity(50.0)
    rig.run(0.1)
    assert outwards.ErrorID == 0x8001
    assert rig.axis.var("ErrorDetail.Number") == 531
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.cycles(2)
    inwards = rig.axis.move_velocity(-50.0)
    rig.run(0.2)
    assert inwards.Busy
    rig.port.switches = 0
    rig.cycles(2)
    assert not rig.axis.var("StatusWord.X18")


@pytest.mark.requirement("LIM-044", "LIM-045", "LIM-046", "LIM-049", "VAR-057")
def test_traversable_switch_is_latched(make_rig):
    """Mode 1: passed and dropped out, X18 stays until the axis is back below the stored position."""
    rig = homed(make_rig, **HARD, **{"PositionLimits_HW.Mode": 1})
    rig.axis.move_velocity(100.0)
    rig.run(1.0)
    rig.port.switches = 2
    rig.cycles(1)
    rig.run(0.02)
    rig.port.switches = 0
    rig.run(1.0)
    assert rig.axis.var("StatusWord.X18")
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.until(rig.axis.power_instance.status)
    rig.axis.move_velocity(-50.0)
    rig.run(1.0)
    assert not rig.axis.var("StatusWord.X18")


@pytest.mark.requirement("LIM-023", "LIM-024")
def test_active_low_switch_is_fail_safe(make_rig):
    """With an active-low level, a missing signal counts as approached."""
    rig = make_rig(variables={**HARD, "PositionLimits_HW.MaxSwitchLevel": False})
    rig.cycles(5)
    assert rig.axis.var("StatusWord.X18")
    rig.port.switches = 2
    rig.cycles(2)
    assert not rig.axis.var("StatusWord.X18")


@pytest.mark.requirement("LIM-042")
def test_hardware_limit_on_a_disabled_axis(make_rig):
    """The switch alarms independently of the enable."""
    rig = make_rig(variables=HARD)
    rig.cycles(5)
    rig.port.switches = 1
    rig.cycles(2)
    assert rig.axis.var("ErrorDetail.Number") == 531
    assert rig.axis.state is AxisState.ALARM_DISABLED


@pytest.mark.requirement("MON-038", "MON-039")
def test_permitted_following_error(make_rig):
    """The permitted following error is constant, then proportional to the velocity setpoint, then
    constant.
    """
    rig = make_rig(
        variables={
            "FollowingError.MinValue": 10.0,
            "FollowingError.MaxValue": 100.0,
            "FollowingError.MinVelocity": 10.0,
        }
    )
    permitted = rig.axis.position.monitoring.permitted_following_error
    assert [permitted(v) for v in (5.0, 255.0, -255.0, 500.0, 600.0)] == pytest.approx(
        [10.0, 55.0, 55.0, 100.0, 100.0]
    )


@pytest.mark.requirement("MON-030", "MON-031", "CTL-039")
def test_following_error_excludes_transmission(rig):
    """With an ideal drive Position - ActualPosition is v * T, the following error is zero."""
    rig.travelling(100.0)
    assert rig.axis.var("Position") - rig.axis.var("ActualPosition") == pytest.approx(100.0 * 0.004, abs=1e-3)
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(0.0, abs=1e-3)


@pytest.mark.requirement("MON-040", "MON-041")
def test_following_error_alarm_after_warning(rig):
    """A growing following error gives warning 522, then 521 with reaction 4."""
    rig.travelling(100.0)
    permitted = rig.axis.position.monitoring.permitted_following_error(100.0)
    before = rig.port.encoder_increments
    rig.port.turn(-((permitted * 0.95) / 10.0 * 6.283185307179586))
    rig.cycles(1)
    assert rig.port.encoder_increments != before
    assert rig.axis.var("WarningWord.X11")
    assert rig.axis.var("ErrorDetail.Number") in (0, 522)
    rig.port.turn(-(permitted * 0.2 / 10.0 * 6.283185307179586))
    rig.cycles(1)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (521, 4)
    assert rig.axis.var("ErrorWord.X11")


@pytest.mark.requirement("MON-047", "MON-048", "VAR-059")
def test_standstill_has_a_hysteresis(rig):
    """X7 falls only when the velocity is 10 % above the threshold."""
    rig.enabled()
    rig.run(0.1)
    assert rig.axis.var("StatusWord.X7")
    slow = rig.axis.move_velocity(2.1)
    rig.until(slow.in_velocity)
    rig.run(0.1)
    assert rig.axis.var("StatusWord.X7")
    fast = rig.axis.move_velocity(2.5)
    rig.until(fast.in_velocity)
    rig.cycles(3)
    assert not rig.axis.var("StatusWord.X7")


@pytest.mark.requirement("MON-018", "MON-020")
def test_positioning_window_not_reached(make_rig):
    """The window not reached within the tolerance time: 541 with info 1, job 16#8001, never Done."""
    rig = make_rig(
        variables={
            "PositioningMonitoring.Window": 0.001,
            "PositioningMonitoring.ToleranceTime": 0.05,
            "PositionControl.Kv": 0.001,
            "FollowingError.EnableMonitoring": False,
        }
    )
    rig.enabled()
    move = rig.axis.move_relative(20.0)
    rig.until(lambda: rig.axis.var("Velocity") > 50.0)
    rig.port.turn(-0.5)
    rig.until(lambda: move.Error or move.Done)
    assert (move.Error, move.ErrorID) == (True, 0x8001)
    assert rig.axis.var("ErrorDetail.Number") == 541
    assert next(event.data["info"] for event in rig.events("alarm.raised")) == 1


@pytest.mark.requirement("MON-017", "MON-025")
@pytest.mark.parametrize("dwell", [0.0, 0.1])
def test_done_waits_for_the_dwell_time(make_rig, dwell):
    """Done comes when the actual position has stayed in the window for MinDwellTime."""
    rig = make_rig(variables={"PositioningMonitoring.MinDwellTime": dwell})
    rig.enabled()
    move = rig.axis.move_relative(10.0)
    rig.run(0.05)
    rig.until(lambda: rig.axis.motion.gen.done)
    start = rig.scheduler.now
    rig.until(move.done)
    assert (rig.scheduler.now - start) / 1e9 == pytest.approx(dwell, abs=0.008)


@pytest.mark.requirement("TA-013", "LIM-049")
@pytest.mark.parametrize("case", ["further out", "both"])
def test_the_cause_of_a_repeated_alarm(make_rig, case):
    """Acknowledged at the switch: a motion further out is 531 with cause 3, the other switch next to it with
    cause 5.
    """
    rig = make_rig(variables={"PositionLimits_HW.Active": True}).travelling(100.0)
    rig.port.switches = 2
    rig.run(1.0)
    assert rig.axis.alarms.engine.highest.info == 1
    rig.until(rig.axis.reset().done)
    rig.run(0.2)
    assert rig.axis.alarms.engine.pending == ()
    if case == "both":
        rig.port.switches = 3
    else:
        rig.axis.move_velocity(10.0)
    rig.run(0.1)
    shown = rig.axis.alarms.engine.highest
    assert (shown.number, shown.info) == (531, 5 if case == "both" else 3)
