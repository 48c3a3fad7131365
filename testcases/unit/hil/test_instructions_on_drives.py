"""What instructions make of a CiA 402 and of a PROFIdrive drive, and what breaks on the way (sections 8.2,
8.3 and 8.5).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from emulators.drive.machine import BrakeConfig
from fieldbus.profidrive.words import MELDW
from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.faults import Injector
from motion.s7.axis import AxisState
from testcases.unit.hil.test_hil_profidrive import bench, enabled
from testcases.unit.hil.test_torque_instructions import (
    FIXED_STOP,
    STW2_WORD,
    later,
    stop_bench,
    torque_bench,
    word,
)


def cia402(**variables):
    """Return the reference bench, with other variables of the axis."""
    config = load_bench("reference").config
    axis = config.axis["axis1"]
    axis = axis.model_copy(update={"variables": {**axis.variables, **variables}})
    return Bench(config.model_copy(update={"axis": {"axis1": axis}}), seed=1)


def travelling(machine, velocity=200.0):
    """Enable the axis and bring it to a constant velocity; returns axis and job."""
    axis = enabled(machine)
    job = axis.move_velocity(velocity)
    assert machine.run_until(job.in_velocity, 2.0)
    machine.run_for(0.1)
    return axis, job


def commands(machine, since=0.0):
    """Return the different control words that the drive has taken over since a time, in their order."""
    signal = machine.trace()["drive1.controlword"]
    values = [int(value) for time, value in zip(signal.time_s, signal.values, strict=True) if time >= since]
    return [value for at, value in enumerate(values) if at == 0 or value != values[at - 1]]


def at_drive(machine, name, since):
    """Return (time, value) of a signal of the drive since a time."""
    signal = machine.trace()[f"drive1.{name}"]
    return [(t, v) for t, v in zip(signal.time_s, signal.values, strict=True) if t >= since]


# -- CiA 402
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-579")
def test_enabling_a_cia_402_drive():
    """Shutdown, switch on, enable operation; InOperation is what the status word says."""
    with cia402() as machine:
        axis = machine.axis()
        machine.run_for(0.1)
        since = machine.now_s
        assert not axis.var("StatusDrive.InOperation")
        assert machine.run_until(axis.power().status, 2.0)
        machine.run_for(0.1)
        assert commands(machine, since) == [0x06, 0x07, 0x0F]
        assert axis.var("StatusDrive.InOperation")
        assert machine.drive().slave.get(0x6041) & 0x6F == 0x27


@pytest.mark.requirement("MC-580", "MC-596")
@pytest.mark.parametrize(("stop_mode", "deceleration"), [(0, 4000.0), (2, 2000.0)])
def test_ramps_of_the_axis_on_cia_402(stop_mode, deceleration):
    """Operation stays enabled while the axis ramps down; at zero the drive gets shutdown."""
    with cia402(**{"DynamicLimits.MaxJerk": 1.0e9}) as machine:
        axis, _ = travelling(machine)
        since = machine.now_s
        power = axis.power(False, stop_mode=stop_mode)
        assert machine.run_until(power.off, 2.0)
        machine.run_for(0.1)
        assert commands(machine, since) == [0x0F, 0x06]
        withdrawn = next(t for t, v in at_drive(machine, "controlword", since) if v == 0x06)
        speed = dict(at_drive(machine, "motor_speed", since))
        assert abs(speed[withdrawn]) < 120.0  # of 1200; the drive is two cycles behind
        configured = axis.var(
            "DynamicDefaults.EmergencyDeceleration" if stop_mode == 0 else "DynamicLimits.MaxDeceleration"
        )
        assert configured == deceleration
        assert withdrawn - since == pytest.approx(200.0 / deceleration, abs=0.02)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-581", "MC-596", "MC-595")
@pytest.mark.parametrize("how", ["StopMode 1", "16#5", "16#7"])
def test_quick_stop_on_cia_402(how):
    """Quick stop command with 605Ah = 2: the drive brakes with 6085h by itself."""
    own = {} if how == "StopMode 1" else {"Actor.RemoveEnableReaction": int(how[3:])}
    with cia402(**own) as machine:
        axis, _ = travelling(machine)
        slave = machine.drive().slave
        assert slave.get(0x605A) == 2
        since = machine.now_s
        if how == "StopMode 1":
            axis.power(False, stop_mode=1)
        else:
            axis.object.alarms.raise_alarm(421)
        machine.run_for(1.0)
        assert commands(machine, since)[:2] == [0x0F, 0x02]
        began = next(t for t, v in at_drive(machine, "controlword", since) if v == 0x02)
        rows = at_drive(machine, "velocity", began)
        at_rest = next(t for t, v in rows if abs(v) < 1e-3)
        rate = slave.get(0x6085)
        assert rate > 0
        ramp = 6000.0 / 6.0  # 6000 rpm/s of the reference drive on 10 mm/rev, mm/s2
        assert at_rest - began == pytest.approx(200.0 / ramp, abs=0.02)


@pytest.mark.requirement("MC-582", "MC-596")
@pytest.mark.parametrize("how", ["StopMode 3", "16#3"])
def test_coasting_on_cia_402(how):
    """Disable voltage at once, at full speed."""
    own = {} if how == "StopMode 3" else {"Actor.RemoveEnableReaction": 3}
    with cia402(**own) as machine:
        axis, _ = travelling(machine)
        since = machine.now_s
        if how == "StopMode 3":
            axis.power(False, stop_mode=3)
        else:
            axis.object.alarms.raise_alarm(421)
        machine.run_for(0.05)
        assert commands(machine, since)[:2] == [0x0F, 0x00]
        assert abs(machine.drive().core.speed_rpm) > 600.0
        assert machine.drive().slave.get(0x6041) & 0x4F == 0x40


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-583")
def test_off1_on_cia_402():
    """16#1: shutdown with 605Bh = 1, the drive ramps down and is ready to switch on."""
    with cia402(**{"Actor.RemoveEnableReaction": 1}) as machine:
        axis, _ = travelling(machine)
        assert machine.drive().slave.get(0x605B) == 1
        since = machine.now_s
        axis.object.alarms.raise_alarm(421)
        machine.run_for(1.0)
        assert commands(machine, since)[:2] == [0x0F, 0x06]
        speeds = [v for _, v in at_drive(machine, "motor_speed", since)]
        assert any(100.0 < v < 1100.0 for v in speeds)
        assert abs(speeds[-1]) < 1.0
        assert machine.drive().slave.get(0x6041) & 0x6F == 0x21


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-584", "MC-594")
def test_acknowledging_a_cia_402_drive():
    """One rising edge of bit 7 resets the fault; the axis is enabled again, its job is not resumed."""
    with cia402() as machine:
        axis, job = travelling(machine)
        Injector(machine).inject("drive.fault", "drive1", duration_s=0.1, code=0x7500)
        machine.run_for(0.5)
        assert (axis.var("ErrorDetail.Number"), axis.var("ErrorWord.X4")) == (421, True)
        assert job.ErrorID == 0x8001
        since = machine.now_s
        assert machine.run_until(axis.reset().done, 2.0)
        assert machine.run_until(axis.power_instance.status, 2.0)
        words = commands(machine, since)
        assert sum(bool(two & 0x80 and not one & 0x80) for one, two in pairwise([0, *words])) == 1
        machine.run_for(0.2)
        assert axis.state is AxisState.STANDSTILL


# -- PROFIdrive
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-570", "MC-591", "MC-165")
@pytest.mark.parametrize("delay_ms", [0.0, 1500.0])
def test_a_drive_that_takes_its_time(delay_ms):
    """Status comes with the drive's operation, however long that takes; Busy all the time."""
    with bench(power_on_delay_ms=delay_ms) as machine:
        axis = machine.axis()
        machine.run_for(0.2)
        since = machine.now_s
        power = axis.power()
        machine.run_for(0.02)
        assert power.Busy
        assert machine.run_until(power.status, 3.0)
        assert machine.now_s - since == pytest.approx(delay_ms * 1e-3, abs=0.1)
        assert axis.var("StatusDrive.InOperation")


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-570", "MC-127", "MC-133")
def test_a_drive_that_never_gets_ready():
    """Busy without Status and without an alarm; MELDW tells whether the drive is ready."""
    with bench() as machine:
        axis = machine.axis()
        machine.run_for(0.2)
        assert axis.port.telegram_view()["MELDW"] & MELDW.READY
        Injector(machine).inject("drive.refuse_transition", "drive1", transition=4)
        power = axis.power()
        machine.run_for(2.0)
        assert (power.Status, power.Busy, power.Error) == (False, True, False)
        assert not axis.var("StatusDrive.InOperation")
        refused = axis.move_velocity(10.0)
        machine.run_for(0.02)
        assert refused.ErrorID == 0x800F


@pytest.mark.requirement("MC-573", "MC-442")
def test_control_words_are_recorded_and_the_sign_of_life_is_the_axis():
    """The user's bits of both words stand in the record of the drive; bits 12 to 15 of STW2 go on
    counting.
    """
    with torque_bench() as machine:
        axis = enabled(machine)
        since = machine.now_s
        axis.set_axis_stw(STW1=0xFB00, STW1BitMask=0xFB00, STW2=0x0FFF, STW2BitMask=0x0E55)
        machine.run_for(0.2)
        first = [int(v) for _, v in at_drive(machine, "drive_stw1", since)]
        second = [int(v) for _, v in at_drive(machine, "drive_stw2", since)]
        assert first[-1] & 0xFB00 == 0xFB00
        assert second[-1] & 0x0FFF == 0x0E55
        life = [value >> 12 for value in second[-20:]]
        assert all(two == one % 15 + 1 for one, two in pairwise(life))


@pytest.mark.requirement("MC-592", "MC-002")
@pytest.mark.parametrize("how", ["telegram.lost", "telegram.sign_of_life"])
@pytest.mark.parametrize("name", ["velocity", "relative", "halt", "stop", "waiting"])
def test_no_more_telegrams(name, how):
    """No telegram, or one whose sign of life stands still: ErrorWord.X7, reaction 4; MC_Stop shows
    CommandAborted.
    """
    with bench() as machine:
        axis, job = travelling(machine)
        if name == "relative":
            job = axis.move_relative(500.0)
        elif name == "halt":
            job = axis.halt(Deceleration=100.0)
        elif name == "stop":
            job = axis.stop(3, Deceleration=100.0)
        elif name == "waiting":
            job = axis.move_relative(10.0, BufferMode=1)
        machine.run_for(0.02)
        assert job.Busy
        Injector(machine).inject(how, "drive1", direction="actual")
        assert machine.run_until(lambda: not job.Busy, 0.5)
        assert (axis.var("ErrorDetail.Number"), axis.var("ErrorDetail.Reaction")) == (431, 4)
        assert axis.var("ErrorWord.X7")
        assert axis.alarms.engine.highest.info == (1 if how == "telegram.lost" else 2)
        if name == "stop":
            assert (job.CommandAborted, job.Error) == (True, False)
        else:
            assert job.ErrorID == 0x8001


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-576", "MC-183", "DIA-109")
def test_what_the_drive_keeps_to_itself():
    """A fault of a drive that nobody needs raises no alarm, and MC_Reset acknowledges it; a warning is in
    ZSW1 alone.
    """
    with bench() as machine:
        axis = machine.axis()
        machine.run_for(0.2)
        Injector(machine).inject("drive.fault", "drive1", duration_s=0.1, code=0x7500)
        machine.run_for(0.3)
        assert axis.port.zsw1 & 0x0008
        assert axis.var("ErrorWord") == 0
        assert machine.run_until(axis.reset().done, 2.0)
        machine.run_for(0.05)
        assert not axis.port.zsw1 & 0x0008
        Injector(machine).inject("drive.warning", "drive1", duration_s=0.2)
        machine.run_for(0.1)
        assert axis.port.zsw1 & 0x0080
        assert (axis.var("WarningWord"), axis.var("ErrorWord")) == (0, 0)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-572", "MC-446", "STP-532", "G2-036")
@pytest.mark.parametrize(("how", "worn"), [("coast", 1), ("held open", 0), ("ramp", 0)])
def test_a_brake_that_closes_at_speed_wears(how, worn):
    """OFF2 closes it at once whatever the speed is; STW1 bit 12 keeps it open; after a ramp it closes at
    rest.
    """
    brake = BrakeConfig(torque_nm=4.0, opening_time_ms=10.0, closing_time_ms=10.0)
    with bench(brake=brake) as machine:
        axis, _ = travelling(machine)
        if how == "held open":
            axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
            machine.run_for(0.05)
        axis.power(False, stop_mode=0 if how == "ramp" else 3)
        machine.run_for(0.1)
        held = machine.drive().core.brake
        if how != "ramp":
            assert held.closed is (how == "coast")
            assert (abs(machine.drive().core.speed_rpm) > 100.0) is (how == "held open")
        machine.run_for(1.0)
        assert held.worn == worn


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-589", "MC-147")
@pytest.mark.parametrize("velocity_mode", [0, 1])
def test_enabling_with_a_noisy_encoder(velocity_mode):
    """The extrapolated setpoint is off by what the noise looks like as a velocity; with VelocityModePowerOn
    it is not.
    """
    with cia402(**{"PositionControl.VelocityModePowerOn": velocity_mode}) as machine:
        axis = machine.axis()
        machine.run_for(0.2)
        Injector(machine).inject("encoder.noise", "drive1", increments=2000)
        gaps = []
        for _ in range(4):
            power = axis.power()
            assert machine.run_until(power.status, 2.0)
            gaps.append(abs(axis.var("Position") - axis.var("ActualPosition")))
            axis.power(False, stop_mode=3)
            assert machine.run_until(power.off, 2.0)
            machine.run_for(0.2)
            if axis.var("StatusWord.X1"):
                machine.run_until(axis.reset().done, 2.0)
        amplitude = 2000.0 / 131072.0 * 10.0
        assert (max(gaps) > amplitude) is (velocity_mode == 0)


# -- torque
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-104")
def test_the_limit_acts_without_position_control():
    """Too little torque for the acceleration: the drive stays at its limit, and no following error is built
    up.
    """
    with torque_bench() as machine:
        axis = machine.axis()
        assert machine.run_until(axis.power(start_mode=0).status, 2.0)
        job = axis.torque_limiting(0.12)
        later(machine)
        axis.move_velocity(400.0, Acceleration=2000.0, Jerk=0.0, PositionControlled=False)
        machine.run_for(0.3)
        assert axis.var("StatusWord.X28")
        assert job.InLimitation
        assert abs(machine.drive().core.torque) == pytest.approx(0.12, abs=0.01)
        assert axis.var("ActualVelocity") < 300.0


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-235", "MC-413", "STP-148")
@pytest.mark.parametrize("how", ["halt", "stop 3", "stop 2", "stop 0"])
def test_stopping_at_a_torque_limit(how):
    """MC_Halt and MC_Stop 2, 3 let the axis work off its following error; only Mode 0 brakes from the actual
    values.
    """
    with torque_bench(
        **{"FollowingError.EnableMonitoring": False, "DynamicLimits.MaxJerk": 1.0e9}
    ) as machine:
        axis = enabled(machine)
        axis.torque_limiting(0.2)
        later(machine)
        axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.4)
        behind = axis.var("StatusPositioning.FollowingError")
        assert behind > 5.0
        setpoint, actual = axis.var("Position"), axis.var("ActualPosition")
        if how == "halt":
            job = axis.halt(Deceleration=2000.0, Jerk=0.0)
        else:
            job = axis.stop(int(how[-1]), Deceleration=2000.0, Jerk=0.0)
        assert machine.run_until(
            lambda: abs(axis.var("Velocity")) < 1e-9 and abs(axis.var("ActualVelocity")) < 1.0, 10.0
        )
        machine.run_for(0.5)
        rest = axis.var("Position")
        if how == "stop 0":
            assert rest < setpoint  # taken back to where the axis really is
            assert rest - actual < 60.0
        else:
            assert rest > setpoint  # the ramp of the setpoint, from the setpoint
        assert job.Done or job.Busy


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-531", "MC-575", "MC-602", "STP-535")
@pytest.mark.parametrize("announced", [False, True])
def test_torque_range_at_a_fixed_stop(announced):
    """The bit of the travel to a fixed stop is the user's: without it the blocked drive trips, with it it
    presses on.
    """
    with stop_bench(blocked_ms=500.0, **{"FollowingError.EnableMonitoring": False}) as machine:
        axis = enabled(machine)
        axis.torque_range(0.5, -0.5)
        later(machine)
        assert not word(machine, STW2_WORD) & 0x0100
        if announced:
            axis.set_axis_stw(STW2=0x0100, STW2BitMask=0x0100)
        axis.move_relative(130.0, Velocity=50.0)
        machine.run_for(6.0)
        raised = [event.data["number"] for event in machine.history.select(kind="alarm.raised")]
        assert (421 in raised) is not announced
        if announced:
            assert machine.drive().core.torque == pytest.approx(0.5, abs=0.05)


@pytest.mark.requirement("MC-532", "MC-574")
@pytest.mark.parametrize("limit", [0.12, 1.5])
def test_in_limitation_without_a_telegram_10x(limit):
    """Telegram 5 with 750: X27 is whether the actual torque is above 0.9 of the limit."""
    with torque_bench(telegram=5, **{"FollowingError.EnableMonitoring": False}) as machine:
        axis = enabled(machine)
        axis.torque_range(limit, -limit)
        later(machine)
        axis.move_velocity(300.0, Acceleration=1000.0, Jerk=0.0)
        machine.run_for(0.1)
        torque = axis.port.actual_torque_nm
        assert axis.var("StatusWord.X27") is (torque > 0.9 * limit)
        assert axis.var("StatusWord.X27") is (limit < 1.0)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-603", "MC-124")
def test_limits_stay_transmitted_over_an_alarm():
    """Reduction, range and additional torque are in the telegram while the alarm stops the axis, and after
    it.
    """
    for make, number, value in (
        (lambda axis: axis.torque_limiting(0.5), 4, 0x3000),
        (lambda axis: axis.torque_additive(0.5), 10, 0x1000),
        (lambda axis: axis.torque_range(1.0, -1.0), 11, 0x2000),
    ):
        with torque_bench() as machine:
            axis = enabled(machine)
            job = make(axis)
            axis.move_velocity(50.0)
            machine.run_for(0.3)
            assert word(machine, number) == value
            axis.object.alarms.raise_alarm(421)
            for _ in range(20):
                later(machine, 2)
                assert word(machine, number) == value
            assert job.Busy


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-602", "MC-575", "MC-554")
def test_an_obstacle_that_goes_away():
    """Mode 0: the following error grows at the obstacle and is worked off without it; nothing is clamped."""
    with stop_bench(
        **{"FollowingError.EnableMonitoring": False, "Clamping.PositionTolerance": 1.0}
    ) as machine:
        assert FIXED_STOP["Clamping.FollowingErrorDeviation"] == 5.0
        axis = enabled(machine)
        limiting = axis.torque_limiting(0.5)
        job = axis.move_relative(130.0, Velocity=50.0)
        machine.run_for(4.0)
        assert axis.var("StatusPositioning.FollowingError") == pytest.approx(30.0, abs=1.0)
        assert (limiting.InLimitation, limiting.InClamping) == (True, False)
        machine.drive().mechanics.set_stops(-0.6, 0.6)
        machine.run_for(2.0)
        assert job.Done  # already at the obstacle: monitoring is suspended while a limit is active (MC-231)
        assert abs(axis.var("StatusPositioning.FollowingError")) < 0.5
        assert axis.var("ErrorWord") == 0


# -- switches
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-590")
@pytest.mark.parametrize(("filter_ms", "seen"), [(0.0, True), (60.0, False)])
@pytest.mark.parametrize("pressed", [("negative",), ("positive",), ("negative", "positive")])
def test_switches_with_a_filter(pressed, filter_ms, seen):
    """A press of 30 ms passes the input filter of the drive or not; both switches may be active."""
    drive = load_bench("profidrive").config.drive["drive1"]
    switches = replace(drive.switches, input_filter_ms=filter_ms)
    with bench(switches=switches) as machine:
        axis = machine.axis()
        machine.run_for(0.2)
        for side in pressed:
            Injector(machine).inject("switch.press", "drive1", duration_s=0.03, input=f"{side}_limit")
        machine.run_for(0.025)
        expected = {side for side in pressed if seen}
        assert {
            side for side, bit in (("negative", 17), ("positive", 18)) if axis.var(f"StatusWord.X{bit}")
        } == expected


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-588", "MC-218", "MC-219")
def test_passive_homing_searches_the_mark_with_the_encoder_interface():
    """Function 1 of G1_STW is active in G1_ZSW from the motion on; Busy until the mark is passed, once per
    revolution.
    """
    with bench(variables={"Sensor[1].PassiveHoming.Mode": 0}) as machine:
        axis = enabled(machine)
        job = axis.home(50.0, mode=8)
        machine.run_for(0.1)
        assert (job.Busy, axis.port.telegram_view()["G1_ZSW"]) == (True, 0)
        axis.move_velocity(20.0)
        while axis.var("ActualPosition") < 8.0:
            machine.run_for(0.1)
            view = axis.port.telegram_view()
            assert (job.Busy, view["G1_STW"] & 0x0F, view["G1_ZSW"] & 0x0F) == (True, 1, 1)
        assert machine.run_until(job.done, 1.0)
        assert 50.0 <= axis.var("ActualPosition") < 51.0
        machine.run_for(0.1)
        assert axis.port.telegram_view()["G1_ZSW"] & 0xFF == 0
