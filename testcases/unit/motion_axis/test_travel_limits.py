"""Hardware and software limit switches: wiring errors, retraction, changes while moving (§5.10)."""

from __future__ import annotations

from math import tau

import pytest

from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import AxisState, ExternalEncoder, SpeedAxis
from testcases.unit.motion_axis.conftest import CYCLE

NEGATIVE, POSITIVE, BOTH = 1, 2, 3
SOFT = {
    "PositionLimits_SW.Active": True,
    "PositionLimits_SW.MinPosition": -100.0,
    "PositionLimits_SW.MaxPosition": 100.0,
}
X8, X9, X15, X16, X17, X18 = 1 << 8, 1 << 9, 1 << 15, 1 << 16, 1 << 17, 1 << 18


def hard(make_rig, mode, **variables):
    rig = make_rig(
        variables={
            "PositionLimits_HW.Active": True,
            "PositionLimits_HW.Mode": mode,
            "PositionLimits_HW.ApproachBehavior": 1,
        }
        | variables
    ).enabled()
    rig.axis.home(0.0)
    rig.cycles(2)
    return rig


def soft(make_rig, **variables):
    rig = make_rig(variables=SOFT | variables).enabled()
    rig.axis.home(0.0)
    rig.cycles(2)
    return rig


def alarms(rig, number=531):
    return [entry.data["info"] for entry in rig.events("alarm.raised") if entry.data["number"] == number]


def acknowledge(rig):
    rig.run(0.7)
    reset = rig.axis.reset()
    rig.until(lambda: reset.Done or reset.Error)
    rig.run(0.2)


def switches(rig, value):
    rig.port.switches = value
    rig.cycles(2)


# -- hardware: which switch, which level, when
# ---------------------------------------------------------------------------


@pytest.mark.requirement("LIM-002")
def test_only_axes_with_a_position_have_limits():
    """Speed axis and external encoder have no such variables."""
    port = SimulatedDrivePort(cycle_s=CYCLE)
    for one in (
        SpeedAxis("axis1", port, cycle_ns=4_000_000),
        ExternalEncoder("encoder1", port, cycle_ns=4_000_000),
    ):
        assert not [path for path in one.variables.paths() if path.startswith("PositionLimits")]


@pytest.mark.requirement("LIM-003", "LIM-013", "LIM-005")
@pytest.mark.parametrize("active", [False, True])
def test_monitoring_has_to_be_switched_on(make_rig, active):
    """Active FALSE: neither switch does anything; TRUE: both do."""
    for switch, bit in ((NEGATIVE, X17), (POSITIVE, X18)):
        rig = hard(make_rig, 0, **{"PositionLimits_HW.Active": active})
        switches(rig, switch)
        assert bool(alarms(rig)) is active
        assert bool(rig.axis.status_word & bit) is active


@pytest.mark.requirement("LIM-014", "LIM-015", "LIM-023", "LIM-019", "LIM-020", "LIM-022", "LIM-056")
@pytest.mark.parametrize("low", ["MinSwitchLevel", "MaxSwitchLevel"])
def test_levels(make_rig, low):
    """Active low: the switch counts as approached while the input is FALSE; the other one keeps its level."""
    own = NEGATIVE if low == "MinSwitchLevel" else POSITIVE
    rig = make_rig(variables={"PositionLimits_HW.Active": True, f"PositionLimits_HW.{low}": False})
    rig.port.switches = own
    rig.cycles(5)
    assert not alarms(rig)
    switches(rig, 0)
    assert alarms(rig) == [1 if own == POSITIVE else 2]
    assert rig.axis.status_word & (X18 if own == POSITIVE else X17)
    assert rig.axis.alarms.engine.error_word & X9
    assert not rig.axis.status_word & (X17 if own == POSITIVE else X18)


@pytest.mark.requirement("LIM-036", "LIM-035", "LIM-018")
def test_emergency_ramp_with_numbers(make_rig):
    """100 mm/s with 1000 mm/s2: 0.1 s and 5.0 mm; enabled all the time, no job before the acknowledgement."""
    rig = hard(
        make_rig,
        0,
        **{"DynamicDefaults.EmergencyDeceleration": 1000.0, "DynamicLimits.MaxDeceleration": 900.0},
    )
    rig.until(rig.axis.move_velocity(100.0).in_velocity)
    rig.run(0.1)
    start = rig.times()[-1]
    rig.port.switches = POSITIVE
    rig.run(0.4)
    duration, way = rig.stop_of_setpoint(start)
    assert duration == pytest.approx(0.1, abs=2 * CYCLE)
    assert way == pytest.approx(5.0, abs=100.0 * 2 * CYCLE)
    assert rig.axis.power_instance.Status
    refused = rig.axis.move_velocity(-10.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x8001
    acknowledge(rig)
    assert rig.axis.power_instance.Status


@pytest.mark.requirement("LIM-040")
def test_neither_homing_nor_position_control_is_needed(make_rig):
    """Not homed, without position control: the switch stops the axis all the same."""
    rig = make_rig(variables={"PositionLimits_HW.Active": True}).enabled()
    rig.until(rig.axis.move_velocity(50.0, PositionControlled=False).in_velocity)
    switches(rig, POSITIVE)
    assert alarms(rig) == [1]


@pytest.mark.requirement(
    "LIM-006", "LIM-017", "LIM-045", "LIM-046", "LIM-044", "LIM-047", "LIM-048", "LIM-050"
)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_traversable_switch_is_passed(make_rig, side):
    """Detected at 50, the input drops out behind it: still reached, until the axis is back inside over the
    switch.
    """
    switch, bit = (POSITIVE, X18) if side > 0 else (NEGATIVE, X17)
    rig = hard(make_rig, 1)
    rig.until(rig.axis.move_velocity(side * 50.0).in_velocity)
    rig.until(lambda: side * rig.axis.var("ActualPosition") > 50.0)
    rig.port.switches = switch
    rig.cycles(3)
    rig.port.switches = 0
    rig.run(0.3)
    assert rig.axis.status_word & bit
    assert not rig.axis.power_instance.Status
    acknowledge(rig)
    assert rig.axis.power_instance.Status
    back = rig.axis.move_velocity(-side * 20.0)
    rig.until(lambda: side * rig.axis.var("ActualPosition") < 51.0)
    rig.port.switches = switch
    rig.cycles(3)
    rig.until(lambda: side * rig.axis.var("ActualPosition") < 48.0)
    assert rig.axis.status_word & bit
    rig.port.switches = 0
    rig.cycles(3)
    assert not rig.axis.status_word & bit
    assert back.Busy
    assert len(alarms(rig)) == 1


@pytest.mark.requirement("LIM-054", "LIM-060", "LIM-030")
@pytest.mark.parametrize("mode", [0, 1])
def test_a_switch_that_drops_out_too_early(make_rig, mode):
    """Not traversable: outwards again without an alarm, until the input comes again; traversable: the alarm
    comes at once.
    """
    rig = hard(make_rig, mode)
    rig.until(rig.axis.move_velocity(50.0).in_velocity)
    switches(rig, POSITIVE)
    rig.run(0.3)
    rig.port.switches = 0
    acknowledge(rig)
    rig.axis.move_velocity(20.0)
    rig.run(0.3)
    assert alarms(rig) == ([1] if mode == 0 else [1, 3])


@pytest.mark.requirement("LIM-051")
def test_the_place_of_a_switch_goes_with_the_coordinates(make_rig):
    """Homed while a traversable switch is held: released where the switch is in the new coordinates."""
    rig = hard(make_rig, 1)
    rig.until(rig.axis.move_velocity(50.0).in_velocity)
    switches(rig, POSITIVE)
    trip = rig.axis.var("ActualPosition")
    rig.port.switches = 0
    acknowledge(rig)
    rig.axis.home(1000.0)
    rig.cycles(2)
    end = 1000.0 - (rig.axis.var("ActualPosition") - 1000.0)
    assert end > 0.0
    rig.axis.move_velocity(-20.0)
    rig.until(lambda: not rig.axis.status_word & X18)
    assert rig.axis.var("ActualPosition") < 1000.0
    assert trip > 0.0


@pytest.mark.requirement("LIM-052", "LIM-065", "LIM-068", "LIM-013")
def test_switching_off_forgets_everything(make_rig):
    """Parameter 1000: bits and place are gone; Done confirms; motion is free in both directions."""
    rig = hard(make_rig, 1)
    rig.until(rig.axis.move_velocity(50.0).in_velocity)
    switches(rig, POSITIVE)
    off = rig.axis.write_parameter(1000, False)
    rig.until(off.done)
    rig.cycles(2)
    assert not rig.axis.status_word & (X17 | X18)
    acknowledge(rig)
    rig.until(rig.axis.move_relative(3.0).done)
    rig.until(rig.axis.move_relative(-3.0).done)
    rig.until(rig.axis.write_parameter(1000, True).done)
    rig.cycles(2)
    assert rig.axis.status_word & X18
    assert len(alarms(rig)) == 2


# -- hardware: wrong wiring
# -----------------------------------------------------------------------------------------------


@pytest.mark.requirement("LIM-061", "LIM-063", "LIM-064", "TA-016", "VAR-174")
@pytest.mark.parametrize("mode", [0, 1])
def test_both_switches_active(make_rig, mode):
    """531 for both; retraction is refused in both directions; a traversable pair needs a restart; switched
    off the axis gets free.
    """
    rig = hard(make_rig, mode)
    rig.until(rig.axis.move_velocity(50.0).in_velocity)
    switches(rig, BOTH)
    assert rig.axis.status_word & X17
    assert rig.axis.status_word & X18
    assert rig.axis.var("ErrorDetail.Number") == 531
    acknowledge(rig)
    if mode == 1:
        assert rig.axis.var("ErrorDetail.Number") == 531  # only a restart clears it
        rig.axis.power(False)
        rig.until(rig.axis.power_instance.off)
        rig.port.switches = 0
        restart = rig.axis.reset(restart=True)
        rig.until(restart.done)
        rig.cycles(3)
        assert rig.axis.var("ErrorDetail.Number") == 0
        return
    for velocity in (20.0, -20.0):
        before = len(alarms(rig))
        job = rig.axis.move_velocity(velocity)
        rig.run(0.3)
        assert job.Error
        assert alarms(rig)[before:] == [5]
        acknowledge(rig)
    rig.until(rig.axis.write_parameter(1000, False).done)
    rig.until(rig.axis.move_relative(-5.0).done)


@pytest.mark.requirement("LIM-062", "LIM-063", "LIM-064", "TA-016", "VAR-174")
@pytest.mark.parametrize("mode", [0, 1])
def test_the_wrong_switch(make_rig, mode):
    """The negative switch in positive direction: reversed, whichever way it goes on; for traversable ones a
    restart is needed.
    """
    rig = hard(make_rig, mode)
    rig.until(rig.axis.move_velocity(50.0).in_velocity)
    switches(rig, NEGATIVE)
    assert alarms(rig) == [4]
    acknowledge(rig)
    if mode == 1:
        assert rig.axis.var("ErrorDetail.Number") == 531
        return
    for velocity in (20.0, -20.0):
        job = rig.axis.move_velocity(velocity)
        rig.run(0.3)
        assert job.Error
        acknowledge(rig)
    assert alarms(rig) == [4, 4, 4]
    rig.until(rig.axis.write_parameter(1000, False).done)
    rig.until(rig.axis.move_relative(-5.0).done)
    switches(rig, 0)
    rig.until(rig.axis.write_parameter(1000, True).done)
    rig.cycles(2)
    assert not rig.axis.alarms.engine.number


@pytest.mark.requirement("LIM-053")
def test_an_encoder_that_fails_behind_a_traversable_switch(make_rig):
    """Nobody knows when the axis is back: 531 with cause 6, which only a restart clears."""
    rig = hard(make_rig, 1)
    rig.until(rig.axis.move_velocity(50.0).in_velocity)
    switches(rig, POSITIVE)
    acknowledge(rig)
    rig.port.sensor_fault = True
    rig.cycles(3)
    assert alarms(rig)[-1] == 6
    rig.port.sensor_fault = False
    rig.run(0.2)
    acknowledge(rig)
    assert rig.axis.var("ErrorDetail.Number") == 531


# -- software
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("LIM-004", "LIM-008")
def test_without_activation_nothing_is_limited(make_rig):
    """Active FALSE: past both limits, no alarm, no bit."""
    rig = soft(make_rig, **{"PositionLimits_SW.Active": False})
    rig.until(rig.axis.move_absolute(150.0, Velocity=400.0).done)
    assert not rig.axis.status_word & (X15 | X16)
    assert not rig.events("alarm.raised")


@pytest.mark.requirement("LIM-009", "LIM-010", "LIM-021", "LIM-011")
@pytest.mark.parametrize(("target", "bit"), [(150.0, X16), (-150.0, X15)])
def test_both_limits(make_rig, target, bit):
    """Positive and negative: 533 in ErrorWord.X8, the bit of that side, the end exactly there."""
    rig = soft(make_rig)
    rig.axis.move_absolute(target, Velocity=200.0)
    rig.until(lambda: rig.axis.state is AxisState.ALARM_STANDSTILL)
    rig.cycles(2)
    assert len(alarms(rig, 533)) == 1
    assert rig.axis.alarms.engine.error_word & X8
    assert rig.axis.status_word & bit
    assert abs(rig.axis.var("Position")) == pytest.approx(100.0, abs=1e-9)


@pytest.mark.requirement("LIM-074")
def test_the_setpoint_counts(make_rig):
    """The actual value overshoots, the setpoint stops on the limit: 533 and no 534."""
    rig = soft(make_rig, **{"FollowingError.EnableMonitoring": False})
    rig.axis.move_velocity(200.0)
    rig.until(lambda: rig.axis.state is AxisState.ALARM_RAMP)
    rig.port.turn(3.0 / 10.0 * tau)
    rig.until(lambda: rig.axis.state is AxisState.ALARM_STANDSTILL)
    assert max(rig.column("actual_position")) > 100.0
    assert rig.events("alarm.raised")[0].data["number"] == 533
    assert not alarms(rig, 534)


@pytest.mark.requirement("LIM-087", "LIM-084", "LIM-085", "LIM-012")
@pytest.mark.parametrize(("behaviour", "reaction", "enabled"), [(0, 4, False), (1, 3, True)])
def test_a_limit_that_is_moved_behind_the_axis(make_rig, behaviour, reaction, enabled):
    """Changed to a value already passed: 534 in the next cycle, with the reaction that is configured."""
    rig = soft(make_rig, **{"PositionLimits_SW.LimitExceededBehavior": behaviour})
    rig.until(rig.axis.move_velocity(100.0).in_velocity)
    rig.until(lambda: rig.axis.var("Position") > 50.0)
    rig.axis.write("PositionLimits_SW.MaxPosition", 30.0)
    rig.cycles(2)
    assert len(alarms(rig, 534)) == 1
    assert rig.axis.var("ErrorDetail.Reaction") == reaction
    rig.run(0.5)
    assert rig.axis.power_instance.Status is enabled


@pytest.mark.requirement("LIM-087")
def test_a_limit_that_is_moved_away_in_time(make_rig):
    """A limit further out acts from the next cycle on: the axis goes on."""
    rig = soft(make_rig)
    rig.until(rig.axis.move_velocity(100.0).in_velocity)
    rig.axis.write("PositionLimits_SW.MaxPosition", 400.0)
    rig.until(lambda: rig.axis.var("Position") > 150.0)
    assert not rig.events("alarm.raised")


@pytest.mark.requirement("LIM-086", "STP-126")
def test_a_soft_emergency_ramp_passes_the_limit(make_rig):
    """EmergencyDeceleration below the maximum: a warning in the configuration, and the axis stops behind the
    limit.
    """
    rig = soft(
        make_rig,
        **{"DynamicDefaults.EmergencyDeceleration": 500.0, "PositionLimits_SW.LimitExceededBehavior": 1},
    )
    rig.until(rig.axis.move_velocity(200.0).in_velocity)
    rig.until(lambda: rig.axis.var("Position") > 60.0)
    rig.axis.write("PositionLimits_SW.MaxPosition", rig.axis.var("Position") - 1.0)
    rig.until(lambda: rig.axis.state is AxisState.ALARM_STANDSTILL)
    assert (
        rig.axis.var("Position") - rig.axis.var("PositionLimits_SW.MaxPosition")
        > 200.0**2 / (2 * 500.0) * 0.9
    )


@pytest.mark.requirement("LIM-089")
def test_without_position_control_there_is_no_prediction(make_rig):
    """The position follows the actual value: 534 when it has passed the limit, which is therefore
    exceeded.
    """
    rig = soft(make_rig)
    rig.axis.move_velocity(100.0, PositionControlled=False)
    rig.until(lambda: rig.axis.var("ErrorDetail.Number") != 0)
    assert len(alarms(rig, 534)) == 1
    assert not alarms(rig, 533)
    assert rig.axis.var("ActualPosition") > 100.0


@pytest.mark.requirement("LIM-090")
def test_a_disabled_axis_raises_nothing(make_rig):
    """Pushed over the limit: X16 follows the position, no alarm; enabled there, that place is the limit."""
    rig = soft(make_rig)
    rig.axis.power(False)
    rig.until(rig.axis.power_instance.off)
    for _ in range(60):
        rig.port.turn(2.0 / 10.0 * tau)
        rig.cycles()
    rig.cycles(2)
    assert rig.axis.status_word & X16
    assert not rig.events("alarm.raised")
    rig.enabled()
    rig.until(rig.axis.move_relative(-5.0).done)
    assert not rig.events("alarm.raised")


@pytest.mark.requirement("LIM-096", "LIM-097")
def test_the_limit_follows_inwards(make_rig):
    """Homed to 130 behind 100: at 120 the limit is 120; back outwards 533; inside the configured one holds
    again.
    """
    rig = soft(make_rig)
    rig.axis.home(130.0)
    rig.cycles(2)
    rig.until(rig.axis.move_absolute(120.0).done)
    outwards = rig.axis.move_absolute(125.0)
    rig.run(0.5)
    assert outwards.Error
    assert alarms(rig, 533) or alarms(rig, 534)
    assert rig.axis.var("Position") < 121.0
    acknowledge(rig)
    if not rig.axis.power_instance.Status:
        rig.until(rig.axis.power_instance.status)
    rig.until(rig.axis.move_absolute(90.0).done)
    rig.until(rig.axis.move_absolute(99.0).done)


@pytest.mark.requirement("LIM-091", "LIM-093", "LIM-092")
@pytest.mark.parametrize(
    ("low", "high", "target", "stops"),
    [(-10.0, 200.0, 250.0, 200.0), (400.0, 500.0, 250.0, None), (90.0, 400.0, 50.0, None)],
)
def test_modulo_axes(make_rig, low, high, target, stops):
    """The modulo position counts; one limit outside of the range: the end of the range; both: no
    monitoring.
    """
    rig = make_rig(
        variables={
            "Modulo.Enable": True,
            "Modulo.Length": 360.0,
            "Modulo.StartValue": 0.0,
            "PositionLimits_SW.Active": True,
            "PositionLimits_SW.MinPosition": low,
            "PositionLimits_SW.MaxPosition": high,
        }
    ).enabled()
    rig.axis.home(100.0)
    rig.cycles(2)
    if (low, high) == (90.0, 400.0):
        job = rig.axis.move_absolute(target, Velocity=300.0, Direction=2)
        rig.run(1.5)
        assert job.Error
        assert rig.axis.var("Position") == pytest.approx(90.0, abs=1e-6)
        return
    job = rig.axis.move_absolute(target, Velocity=300.0, Direction=1)
    rig.run(2.0)
    if stops is None:
        assert job.Done
    else:
        assert job.Error
        assert rig.axis.var("Position") == pytest.approx(stops, abs=1e-6)
