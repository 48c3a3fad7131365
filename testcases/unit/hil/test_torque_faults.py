"""Torque limits, torque range and fixed stops when something is wrong or changes (§5.7.8, section 11.6)."""

from __future__ import annotations

from dataclasses import replace

import pytest

from motion.s7.axis import AxisState
from testcases.unit.hil.test_hil_profidrive import bench, enabled
from testcases.unit.hil.test_torque_instructions import X30, clamp, later, stop_bench, torque_bench

pytestmark = pytest.mark.exhaustive

UP, LOW = 0x0B56FC05, 0x0B56FC0C
"""r2902[5] = 100 %, r2902[12] = -100 %."""
WEAK = {"FollowingError.EnableMonitoring": False}


def raised(machine):
    """Return the alarms, without warnings."""
    entries = machine.history.select(kind="alarm.raised")
    return [event.data["number"] for event in entries if event.data["alarm_class"] != "W"]


def behind(machine, limit=0.12, **inputs):
    """Travel with too little torque until the axis is far behind; returns (axis, job of the limit, job of the
    motion).
    """
    axis = enabled(machine)
    limiting = axis.torque_limiting(limit)
    later(machine)
    moving = axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0, **inputs)
    machine.run_for(0.4)
    return axis, limiting, moving


# -- monitoring and stops while the limit acts
# ------------------------------------------------------------------------------


@pytest.mark.requirement("STP-143", "STP-145")
@pytest.mark.parametrize("limit", [None, 0.12])
def test_a_limit_triggers_monitoring_that_is_left_on(limit):
    """The same motion with its torque is without alarm; limited, and monitored, it is 521."""
    with torque_bench(**{"TorqueLimiting.PositionBasedMonitorings": 1}) as machine:
        axis = enabled(machine)
        if limit is not None:
            axis.torque_limiting(limit)
        later(machine)
        axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.4)
        assert raised(machine) == ([] if limit is None else [521])


@pytest.mark.requirement("STP-147", "STP-151")
def test_without_position_control_the_following_error_means_nothing():
    """Switched to speed control the axis catches nothing up: the error is 0 and the limit still holds."""
    with torque_bench(**WEAK) as machine:
        axis, _, _ = behind(machine)
        assert axis.var("StatusPositioning.FollowingError") > 10.0
        axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0, PositionControlled=False)
        later(machine, 3)
        assert axis.var("StatusPositioning.FollowingError") == pytest.approx(0.0, abs=1.5)
        since = machine.now_s
        machine.run_for(0.5)
        torque = machine.trace()["drive1.torque"].values
        assert max(torque) <= 0.12 + 0.01
        speeds = machine.trace()["axis1.actual_velocity"]
        assert (
            max(value for time, value in zip(speeds.time_s, speeds.values, strict=True) if time > since)
            < 310.0
        )


@pytest.mark.requirement("STP-149", "STP-150", "STP-148")
@pytest.mark.parametrize(
    ("stop", "ends"), [("power", "DISABLED"), ("stop-0", "STOP_HOLD"), ("halt", "STANDSTILL")]
)
def test_stops_of_an_axis_that_is_behind(stop, ends):
    """Emergency ramps begin at the actual values; a halt lets the axis creep on to where its setpoint has
    come to.
    """
    with torque_bench(**WEAK) as machine:
        axis, _, _ = behind(machine, limit=0.2)
        setpoint, actual = axis.var("Position"), axis.var("ActualPosition")
        assert setpoint - actual > 20.0
        if stop == "power":
            axis.power(False, stop_mode=0)
        elif stop == "stop-0":
            axis.stop(0)
        else:
            axis.halt(Jerk=0.0)
        later(machine, 3)
        began = axis.var("Position")
        assert (began > setpoint) if stop == "halt" else (abs(began - actual) < 10.0)
        machine.run_for(4.0)
        assert axis.state is AxisState[ends]
        assert abs(axis.var("ActualVelocity")) < 0.1
        if stop == "halt":
            assert axis.var("ActualPosition") > setpoint + 10.0


@pytest.mark.requirement("STP-585", "STP-146")
def test_a_limit_that_is_raised_while_pressing_gives_a_short_acceleration():
    """The axis is held by a jam, the limit raised, the jam gone: it catches up within the new limit and the
    maximum speed.
    """
    with torque_bench(**WEAK) as machine:
        axis, limiting, moving = behind(machine, limit=0.3)
        drive = machine.drive()
        drive.mechanics.jam(True)
        machine.run_for(0.2)
        limiting.set(Limit=1.0)
        machine.run_for(0.1)
        drive.mechanics.jam(False)
        since = machine.now_s
        axis.halt(Jerk=0.0)
        machine.run_for(2.0)
        assert moving.CommandAborted
        trace = machine.trace()

        def largest(name):
            signal = trace[name]
            return max(abs(v) for t, v in zip(signal.time_s, signal.values, strict=True) if t > since)

        assert largest("axis1.speed_output") <= 3000.0 + 1e-6
        assert largest("drive1.torque") <= 1.0 + 0.02
        assert largest("axis1.actual_velocity") > 300.0
        assert axis.var("StatusPositioning.FollowingError") == pytest.approx(0.0, abs=0.5)


# -- reference torque
# -----------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-153", "STP-154", "MC-539")
@pytest.mark.parametrize("connected", [False, True])
def test_the_limit_is_that_of_the_instruction_when_the_drive_is_connected(connected):
    """Without telegram 750 the reduction takes its share of p1520 = 6 Nm, with p1522 and p1523 at 100 % of
    p2003 = 2 Nm.
    """
    with torque_bench(supplement=False, **WEAK) as machine:
        axis = enabled(machine)
        drive = machine.drive()
        if connected:
            drive.parameters.write("p1522", UP)
            drive.parameters.write("p1523", LOW)
        limit = drive.drive.settings.torque_limits_Nm[0]
        axis.torque_limiting(0.5)
        drive.mechanics.jam(True)
        axis.move_velocity(100.0)
        machine.run_for(0.5)
        assert drive.core.torque == pytest.approx(0.5 if connected else 0.25 * limit, rel=0.02)


@pytest.mark.requirement("STP-584")
@pytest.mark.parametrize("assumed", [1.0, 2.0, 4.0])
def test_a_wrong_reference_torque_scales_the_limit(assumed):
    """The drive has p2003 = 2 Nm; an axis that takes it for 1 or 4 Nm limits twice or half as much as it is
    commanded.
    """
    with torque_bench(**WEAK, **{"Actor.DriveParameter.ReferenceTorque": assumed}) as machine:
        axis = enabled(machine)
        axis.torque_limiting(0.5)
        machine.drive().mechanics.jam(True)
        axis.move_velocity(100.0)
        machine.run_for(0.5)
        assert machine.drive().core.torque == pytest.approx(0.5 * 2.0 / assumed, rel=0.02)


# -- blocked motor
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-185", "STP-580", "MC-531", "STP-535")
@pytest.mark.parametrize("announced", [False, True])
def test_a_blocked_motor_under_a_torque_range(announced):
    """STW2.8 is not set by MC_TorqueRange: the blocked drive trips, 421; with the bit set by MC_SetAxisSTW it
    does not.
    """
    with torque_bench(mechanics={"blocked_time_ms": 1000}, **WEAK) as machine:
        axis = enabled(machine)
        axis.torque_range(0.3, -0.3)
        if announced:
            axis.set_axis_stw(STW2=0x0100, STW2BitMask=0x0100)
        later(machine)
        machine.drive().mechanics.jam(True)
        axis.move_velocity(100.0)
        machine.run_for(2.0)
        assert bool(machine.drive().slave.get(0x5803) & 0x0100) is announced
        assert raised(machine) == ([] if announced else [421])
        if not announced:
            (alarm,) = [
                one for one in machine.history.select(kind="alarm.raised") if one.data["number"] == 421
            ]
            assert "drive fault 7900" in alarm.data["text"]  # motor blocked
            assert axis.state is AxisState.ALARM_DISABLED


# -- fixed stop
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-161")
@pytest.mark.parametrize("telegram", [3, 105])
def test_detection_with_and_without_a_torque_limit(telegram):
    """With 105 the limit acts on the way and while clamped; with 3 the following error alone detects the
    stop.
    """
    with stop_bench(**{"FollowingError.MinValue": 20.0}) as machine:
        config = machine.config
    from hil.bench.bench import Bench

    drive = config.drive["drive1"].model_copy(update={"telegram": telegram})
    if telegram == 3:
        drive = drive.model_copy(update={"profidrive": replace(drive.profidrive, torque_telegram=False)})
    with Bench(config.model_copy(update={"drive": {"drive1": drive}}), seed=1) as machine:
        axis, limiting, moving = clamp(machine)
        assert moving.CommandAborted
        assert axis.var("StatusWord") & X30
        machine.run_for(0.2)
        torque = machine.trace()["drive1.torque"].values
        if telegram == 105:
            assert max(torque) <= 0.5 + 0.02
            assert torque[-1] == pytest.approx(0.5, abs=0.02)
        else:
            assert torque[-1] > 1.0
        assert limiting.InClamping


@pytest.mark.requirement("STP-163", "STP-582", "MON-045")
@pytest.mark.parametrize(
    ("deviation", "permitted", "clamped"),
    [(5.0, 20.0, True), (20.0, 20.0, False), (25.0, 20.0, False), (5.0, 3.0, False), (5.0, 5.5, True)],
)
def test_following_error_monitoring_that_comes_first(deviation, permitted, clamped):
    """A deviation from the permitted following error on is never reached: 521 in place of clamping."""
    variables = {
        "Clamping.FollowingErrorDeviation": deviation,
        "TorqueLimiting.PositionBasedMonitorings": 1,
        "FollowingError.MinValue": permitted,
        "FollowingError.MaxValue": permitted,
        "FollowingError.WarningLevel": 100.0,
    }
    with stop_bench(**variables) as machine:
        axis = enabled(machine)
        limiting = axis.torque_limiting(0.5, mode=1)
        axis.move_velocity(200.0)
        machine.run_for(1.0)
        assert limiting.InClamping is clamped
        assert raised(machine) == ([] if clamped else [521])


@pytest.mark.requirement("STP-171", "STP-160")
def test_enable_and_mode_switch_the_detection():
    """Mode 0 presses without ever being clamped; changed to Mode 1 the stop is detected at once; a speed job
    is not detected.
    """
    with stop_bench() as machine:
        axis = enabled(machine)
        limiting = axis.torque_limiting(0.5, mode=0)
        moving = axis.move_velocity(200.0)
        machine.run_for(1.0)
        assert axis.var("StatusPositioning.FollowingError") > 20.0
        assert moving.Busy
        assert not limiting.InClamping
        limiting.set(Mode=1)
        later(machine, 3)
        assert limiting.InClamping
        assert moving.CommandAborted
    with stop_bench() as machine:
        axis = enabled(machine)
        axis.move_velocity(50.0, PositionControlled=False)
        machine.run_for(0.5)
        refused = axis.torque_limiting(0.5, mode=1)
        later(machine, 2)
        assert refused.ErrorID == 0x8071


@pytest.mark.requirement("STP-218")
def test_fixed_stop_and_superimposed_motion_need_position_control():
    """Without it detection cannot begin, and a superimposed motion closes the loop first."""
    with stop_bench() as machine:
        axis = enabled(machine)
        axis.move_velocity(20.0, PositionControlled=False)
        machine.run_for(0.3)
        assert axis.var("StatusWord.X28")
        refused = axis.torque_limiting(0.5, mode=1)
        later(machine, 2)
        assert refused.ErrorID == 0x8071
        axis.move_superimposed(10.0)
        later(machine, 2)
        assert not axis.var("StatusWord.X28")


@pytest.mark.requirement("STP-169")
@pytest.mark.parametrize(("setpoint", "alarms"), [(100.5, []), (105.0, [542])])
def test_a_setpoint_within_the_tolerance_hides_the_breakaway(setpoint, alarms):
    """Moved back to 100.5 mm, within 1 mm of the stop, the axis stays clamped; the stop gone, it moves 0.5 mm
    without alarm.
    """
    with stop_bench() as machine:
        axis, limiting, _ = clamp(machine)
        at = axis.var("ActualPosition")
        assert at == pytest.approx(100.0, abs=0.3)
        back = axis.move_relative(setpoint - axis.var("Position")) if setpoint < 105.0 else None
        machine.run_for(1.0)
        if back is not None:
            assert back.Done
        assert limiting.InClamping
        machine.drive().mechanics.set_stops(-0.6, 0.2)
        machine.run_for(0.5)
        assert raised(machine) == alarms
        if not alarms:
            assert axis.var("ActualPosition") == pytest.approx(setpoint, abs=0.1)
            assert limiting.InClamping


@pytest.mark.requirement("STP-581", "STP-168")
def test_the_stop_is_removed_while_clamped():
    """542 with reaction 4: the axis is disabled and the drive stops by itself (OFF3), with the force of the
    limit until then.
    """
    with stop_bench() as machine:
        axis, limiting, _ = clamp(machine)
        machine.drive().mechanics.set_stops(-0.6, 0.2)
        machine.run_for(1.0)
        assert raised(machine) == [542]
        assert axis.state is AxisState.ALARM_DISABLED
        assert axis.object.stw1_sent == 0x0478
        assert not limiting.InClamping
        assert axis.var("ErrorWord") == 1 << 2
        assert abs(axis.var("ActualVelocity")) < 0.1


@pytest.mark.requirement("STP-017")
def test_the_program_sees_drive_ready():
    """A drive with a fault shows DriveReady = 0 in MELDW, and is not enabled; acknowledged it is."""
    with bench(telegram=105) as machine:
        axis = machine.axis()
        machine.run_for(0.1)
        machine.drive().drive.raise_fault(7860)
        later(machine)
        view = axis.port.telegram_view()
        assert not view["MELDW"] & 0x1000
        power = axis.power()
        machine.run_for(0.5)
        assert not power.Status
        assert machine.run_until(axis.reset().done, 2.0)
        assert machine.run_until(power.status, 2.0)
        assert axis.port.telegram_view()["MELDW"] & 0x1000
