"""Outputs of the instructions, call by call (sections 1 and 2 of the instruction specification)."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motion.s7.axis import AxisState
from motion.s7.instructions import (
    MC_Halt,
    MC_MoveAbsolute,
    MC_MoveJog,
    MC_MoveRelative,
    MC_MoveVelocity,
    MC_Power,
)


def outputs(instance):
    return (instance.Busy, instance.Done, instance.CommandAborted, instance.Error)


@pytest.mark.requirement("MC-077", "MC-064", "MC-068")
def test_done_is_shown_for_one_call_without_execute(rig):
    """A job that ends while Execute is FALSE shows Done for exactly one call."""
    rig.enabled()
    move = rig.axis.move_relative(1.0)
    rig.cycles(1)
    assert outputs(move) == (True, False, False, False)
    move.set(Execute=False)
    shown = []
    rig.runtime.after_cycle.append(lambda: shown.append(outputs(move)))
    rig.run(1.0)
    assert shown.count((False, True, False, False)) == 1
    assert shown[-1] == (False, False, False, False)


@pytest.mark.requirement("MC-078", "MC-066", "MC-067")
def test_done_is_held_with_execute(rig):
    """A job that ends while Execute is TRUE holds Done until Execute falls, then everything is FALSE in that
    call.
    """
    rig.enabled()
    move = rig.axis.move_relative(1.0)
    rig.until(move.done)
    rig.cycles(50)
    assert outputs(move) == (False, True, False, False)
    move.set(Execute=False)
    rig.cycles(1)
    assert outputs(move) == (False, False, False, False)


def test_ended_instances_are_not_called(rig):
    """A program does not grow with the jobs that have ended: they are called again when Execute falls."""
    rig.enabled()
    first = rig.axis.move_relative(1.0)
    rig.until(first.done)
    for _ in range(9):
        rig.until(rig.axis.move_relative(1.0).done)
    instances = rig.runtime.instances
    assert len(rig.runtime.program) <= 3
    assert len(instances) >= 10
    first.set(Execute=False)
    first.set(Execute=True)  # between two calls: there is no edge
    rig.cycles(2)
    assert first.Done
    assert len(rig.runtime.program) <= 3
    first.set(Execute=False)
    rig.cycles(1)
    assert not first.Done
    first.set(Execute=True)
    rig.cycles(1)
    assert first.Busy
    rig.until(first.done)
    assert set(rig.runtime.instances) == set(instances)


@pytest.mark.requirement("MC-079", "OVR-001", "OVR-014", "MC-062")
def test_overridden_job_shows_command_aborted(rig):
    """The job that another one takes over from shows CommandAborted and holds it while Execute is TRUE."""
    rig.enabled()
    first = rig.axis.move_velocity(100.0)
    rig.run(0.1)
    second = rig.axis.move_velocity(50.0)
    rig.cycles(2)
    assert outputs(first) == (False, False, True, False)
    assert second.Busy
    rig.cycles(20)
    assert first.CommandAborted


@pytest.mark.requirement("MC-069")
def test_retriggered_instance_stays_busy(rig):
    """A new edge while Busy starts a new job; the instance shows no CommandAborted of the old one."""
    rig.enabled()
    move = rig.axis.move_velocity(100.0)
    rig.run(0.05)
    move.set(Execute=False)
    rig.cycles(1)
    move.set(Execute=True, Velocity=20.0)
    rig.cycles(1)
    assert outputs(move) == (True, False, False, False)
    rig.until(move.in_velocity)
    assert rig.axis.var("Velocity") == pytest.approx(20.0)


@pytest.mark.requirement("MC-080", "MC-059", "STP-031")
def test_rejection_before_enabling(rig):
    """A motion job on a disabled axis is refused in its first call with 16#800F and was never Busy."""
    rig.cycles(5)
    move = MC_MoveVelocity(rig.axis.object, Execute=True)
    move()
    assert (outputs(move), move.ErrorID) == ((False, False, False, True), 0x800F)
    move(Execute=False)
    assert (outputs(move), move.ErrorID) == ((False, False, False, False), 0)


@pytest.mark.parametrize(
    ("cls", "inputs", "error"),
    [
        pytest.param(MC_MoveAbsolute, {"Velocity": 0.0}, 0x8003, marks=pytest.mark.requirement("MC-086")),
        pytest.param(MC_MoveAbsolute, {"Acceleration": 0.0}, 0x8004, marks=pytest.mark.requirement("MC-087")),
        pytest.param(MC_MoveRelative, {"Deceleration": 0.0}, 0x8005, marks=pytest.mark.requirement("MC-088")),
        pytest.param(MC_MoveRelative, {"Jerk": float("nan")}, 0x8006),
        pytest.param(MC_MoveRelative, {"Distance": float("inf")}, 0x8008),
        pytest.param(MC_MoveAbsolute, {"Position": float("nan")}, 0x8009),
        pytest.param(MC_MoveAbsolute, {"BufferMode": 2}, 0x800A),
        pytest.param(MC_MoveVelocity, {"Direction": 3}, 0x8007, marks=pytest.mark.requirement("MC-003")),
        pytest.param(MC_Halt, {"Mode": 2}, 0x800A),
        pytest.param(MC_Halt, {"Deceleration": 0.0}, 0x8005, marks=pytest.mark.requirement("MC-225")),
    ],
)
def test_illegal_input_is_refused(rig, cls, inputs, error):
    """Each illegal input has its ErrorID, and the running job is not touched."""
    rig.enabled()
    rig.axis.home(0.0)
    running = rig.axis.move_velocity(50.0)
    rig.until(running.in_velocity)
    refused = cls(rig.axis.object, Execute=True, **inputs)
    refused()
    assert (refused.Error, refused.ErrorID) == (True, error)
    rig.cycles(5)
    assert running.InVelocity
    assert running.Busy


@pytest.mark.requirement("STP-417", "MC-396")
def test_mc_stop_mode_1_is_not_allowed(rig):
    """MC_Stop Mode 1 is refused with 16#800A and stops nothing."""
    rig.travelling(100.0)
    stop = rig.axis.stop(1)
    rig.cycles(3)
    assert (stop.Error, stop.ErrorID) == (True, 0x800A)
    assert rig.job.InVelocity


@pytest.mark.requirement("MC-246")
def test_absolute_motion_needs_homing(rig):
    """MC_MoveAbsolute on an axis that is not homed raises alarm 321 and ends with 16#8001."""
    rig.enabled()
    move = rig.axis.move_absolute(10.0)
    rig.cycles(2)
    assert (move.Error, move.ErrorID) == (True, 0x8001)
    assert rig.axis.var("ErrorDetail.Number") == 321
    assert rig.axis.var("ErrorWord.X3")


@pytest.mark.requirement("MC-261", "MC-257", "DIA-107")
def test_move_absolute_ends_on_the_target(rig):
    """MC_MoveAbsolute ends exactly on its target and shows X8 while it moves, X6 afterwards."""
    rig.enabled()
    rig.axis.home(0.0)
    move = rig.axis.move_absolute(123.456, Velocity=200.0)
    rig.run(0.2)
    assert rig.axis.var("StatusWord.X8")
    assert not rig.axis.var("StatusWord.X6")
    rig.until(move.done)
    assert rig.axis.var("Position") == pytest.approx(123.456, abs=1e-9)
    assert rig.axis.var("ActualPosition") == pytest.approx(123.456, abs=1e-3)
    assert rig.axis.var("StatusWord.X6")


@pytest.mark.requirement("MC-271", "MC-272", "MC-264", "STP-224", "MC-072")
def test_appended_job_waits_and_then_runs(rig):
    """BufferMode 1: Busy without Active until the first job is Done, then Active."""
    rig.enabled()
    rig.axis.home(0.0)
    first = rig.axis.move_absolute(50.0, Velocity=100.0)
    rig.run(0.1)
    second = rig.axis.move_absolute(80.0, Velocity=100.0, BufferMode=1)
    rig.run(0.1)
    assert (second.Busy, second.Active, first.Active) == (True, False, True)
    rig.until(first.done)
    assert rig.axis.var("Position") == pytest.approx(50.0)
    rig.until(second.done)
    assert rig.axis.var("Position") == pytest.approx(80.0)


@pytest.mark.requirement("MC-265")
def test_waiting_jobs_are_limited(rig):
    """More than eight waiting jobs are refused with 16#8014."""
    rig.enabled()
    rig.axis.move_relative(400.0)
    waiting = [rig.axis.move_relative(1.0, BufferMode=1) for _ in range(9)]
    rig.cycles(3)
    assert [job.ErrorID for job in waiting] == [0] * 8 + [0x8014]


@pytest.mark.requirement("MC-284", "MC-287")
def test_relative_distance_counts_from_the_takeover(rig):
    """An overriding MC_MoveRelative measures from the setpoint at the moment of overriding."""
    rig.enabled()
    rig.axis.move_relative(300.0, Velocity=100.0)
    rig.run(1.0)
    at = rig.axis.var("Position")
    second = rig.axis.move_relative(50.0, Velocity=100.0)
    rig.until(second.done)
    assert rig.axis.var("Position") == pytest.approx(at + 50.0, abs=100.0 * 0.008)


@pytest.mark.requirement("MC-304", "STP-215", "MC-094")
def test_override_acts_at_once(rig):
    """Override 50 %: InVelocity falls, and rises again at half the velocity."""
    rig.travelling(300.0)
    rig.axis.write("Override.Velocity", 50.0)
    rig.cycles(3)
    assert not rig.job.InVelocity
    rig.until(rig.job.in_velocity)
    assert rig.axis.var("Velocity") == pytest.approx(150.0)


@pytest.mark.requirement("MC-307", "STP-084", "STP-105")
def test_velocity_is_limited_with_a_warning(rig):
    """Velocity above the limit: the limit is used, warning 501, InVelocity at the limited velocity, no error
    bit.
    """
    rig.enabled()
    rig.axis.home(0.0)
    move = rig.axis.move_velocity(900.0)
    rig.until(move.in_velocity)
    assert rig.axis.var("Velocity") == pytest.approx(500.0)
    assert rig.axis.var("WarningWord.X6")
    assert not rig.axis.var("StatusWord.X1")


@pytest.mark.requirement("STP-607")
@pytest.mark.parametrize(
    ("path", "number"),
    [
        ("DynamicLimits.MaxAcceleration", 305),
        ("DynamicLimits.MaxDeceleration", 305),
        ("DynamicLimits.MaxJerk", 306),
    ],
)
def test_zero_limit_is_an_alarm(rig, path, number):
    """A dynamic limit of zero makes any motion impossible: alarm 305 or 306 with reaction 3, standstill."""
    rig.travelling(100.0)
    rig.axis.write(path, 0.0)
    rig.cycles(2)
    late = rig.axis.move_velocity(50.0)
    rig.run(0.5)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (number, 3)
    assert late.ErrorID == 0x8001
    assert rig.axis.var("Velocity") == 0.0


@pytest.mark.requirement("STP-111")
def test_lowered_limit_brakes_the_running_job(rig):
    """DynamicLimits.Velocity lowered while moving: the axis brakes to it with the job's dynamics."""
    rig.travelling(400.0)
    rig.axis.write("DynamicLimits.Velocity", 200.0)
    rig.run(1.0)
    assert rig.axis.var("Velocity") == pytest.approx(200.0)


@pytest.mark.requirement("MC-305", "STP-216")
def test_velocity_zero(rig):
    """MC_MoveVelocity with 0.0 brakes to zero, then InVelocity, X12 and X7 are TRUE and Busy stays."""
    rig.travelling(100.0)
    zero = rig.axis.move_velocity(0.0)
    rig.until(zero.in_velocity)
    rig.run(0.2)
    assert zero.Busy
    assert rig.axis.var("StatusWord.X12")
    assert rig.axis.var("StatusWord.X7")


@pytest.mark.requirement("MC-299", "MC-306")
def test_current_keeps_the_velocity(rig):
    """Current = TRUE keeps the velocity found at the start whatever Velocity says."""
    rig.travelling(120.0)
    keep = rig.axis.move_velocity(400.0, Current=True)
    rig.until(keep.in_velocity)
    rig.run(0.2)
    assert rig.axis.var("Velocity") == pytest.approx(120.0)


@pytest.mark.requirement("STP-232", "STP-233", "STP-234", "STP-235", "STP-236", "MC-326", "MC-327")
def test_jog(rig):
    """Jog moves while its input is TRUE, brakes when it falls, ends at standstill without Done."""
    rig.enabled()
    jog = rig.axis.jog(50.0, backward=True)
    rig.cycles(1)
    assert jog.Busy
    rig.until(jog.in_velocity)
    assert rig.axis.var("Velocity") == pytest.approx(-50.0)
    assert rig.axis.var("StatusWord.X9")
    jog.set(JogBackward=False)
    rig.cycles(2)
    assert (jog.InVelocity, jog.Busy) == (False, True)
    rig.until(lambda: not jog.Busy)
    assert rig.axis.var("Velocity") == 0.0
    assert rig.axis.state is AxisState.STANDSTILL


@pytest.mark.requirement("STP-237", "MC-329", "MC-338", "MC-339")
def test_both_jog_inputs_are_an_error(rig):
    """Both inputs TRUE: 16#8007, the axis brakes, the error goes with both inputs."""
    rig.enabled()
    jog = rig.axis.jog(50.0)
    rig.until(jog.in_velocity)
    jog.set(JogBackward=True)
    rig.cycles(1)
    assert (jog.Error, jog.ErrorID, jog.Busy, jog.InVelocity) == (True, 0x8007, False, False)
    assert rig.axis.var("Velocity") > 0.0
    jog.set(JogForward=False, JogBackward=False)
    rig.cycles(1)
    assert not jog.Error
    rig.run(0.5)
    assert rig.axis.var("Velocity") == 0.0


@pytest.mark.requirement("MC-330", "STP-238", "MC-340")
def test_jog_again_before_standstill(rig):
    """A jog input set again while braking accelerates without stopping."""
    rig.enabled()
    jog = rig.axis.jog(100.0)
    rig.until(jog.in_velocity)
    jog.set(JogForward=False)
    rig.run(0.05)
    jog.set(JogForward=True)
    rig.until(jog.in_velocity)
    slowest = min(v for t, v in zip(rig.times(), rig.column("velocity_setpoint"), strict=True) if t > 0.3)
    assert slowest > 20.0


@pytest.mark.requirement("MC-328", "MC-337")
def test_jog_takes_changed_velocity(rig):
    """A changed velocity acts at the next call; InVelocity is FALSE in between."""
    rig.enabled()
    jog = MC_MoveJog(rig.axis.object, JogForward=True, Velocity=50.0)
    rig.axis.run(jog)
    rig.until(jog.in_velocity)
    jog.set(Velocity=100.0)
    rig.cycles(2)
    assert not jog.InVelocity
    rig.until(jog.in_velocity)
    assert rig.axis.var("Velocity") == pytest.approx(100.0)


@pytest.mark.requirement("STP-606", "MC-160")
def test_second_power_instance(rig):
    """A second MC_Power on the same object gets 16#800C and has no effect."""
    rig.enabled()
    second = MC_Power(rig.axis.object, Enable=False)
    second()
    assert (second.Error, second.ErrorID) == (True, 0x800C)
    rig.cycles(5)
    assert rig.axis.power_instance.Status


@pytest.mark.requirement("MC-137")
def test_illegal_stop_mode(rig):
    """StopMode other than 0..3 gives 16#800B."""
    power = MC_Power(rig.axis.object, Enable=True, StopMode=4)
    power()
    assert (power.Error, power.ErrorID) == (True, 0x800B)


@pytest.mark.requirement("STP-038", "STP-040", "STP-042", "STP-509", "MC-142")
def test_enable_sequence(rig):
    """Busy in the call of the edge, Status with InOperation, control words 16#047E then 16#047F."""
    rig.cycles(5)
    power = rig.axis.power()
    rig.cycles(1)
    assert (power.Busy, power.Status) == (True, False)
    rig.until(power.status)
    assert rig.axis.var("StatusDrive.InOperation")
    sequence = list(dict.fromkeys(int(w) for w in rig.column("stw1")))
    assert sequence == [0x047E, 0x047F]


@pytest.mark.requirement("STP-046", "STP-510", "STP-557")
def test_on_is_not_given_to_an_inhibited_drive(rig):
    """While ZSW1.6 = 1 the ON command stays away."""
    rig.port.inhibited = True
    rig.axis.power()
    rig.run(0.5)
    assert {int(w) & 1 for w in rig.column("stw1")} == {0}
    rig.port.inhibited = False
    rig.until(rig.axis.power_instance.status)


@pytest.mark.requirement("STP-019", "STP-018", "MC-133")
def test_enable_waits_for_communication(rig):
    """Enable while the drive is away: Busy, no Status, and enabling by itself afterwards."""
    rig.cycles(2)
    rig.port.link = False
    power = rig.axis.power()
    rig.run(0.3)
    assert (power.Busy, power.Status) == (True, False)
    rig.port.link = True
    rig.until(power.status)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-047", "STP-048", "STP-028", "MC-097")
@pytest.mark.parametrize("start_mode", [0, 1])
def test_start_mode(rig, start_mode):
    """StartMode decides position control at enabling; X28 shows it."""
    rig.enabled(start_mode=start_mode)
    assert rig.axis.var("StatusWord.X28") is (start_mode == 0)


@pytest.mark.requirement("MC-098", "MC-099", "STP-217", "MC-100")
def test_position_control_follows_the_job(rig):
    """PositionControlled of MC_MoveVelocity switches; a positioning job forces it on; it stays afterwards."""
    rig.enabled()
    rig.axis.move_velocity(50.0, PositionControlled=False)
    rig.run(0.2)
    assert rig.axis.var("StatusWord.X28")
    halt = rig.axis.halt()
    rig.until(halt.done)
    assert rig.axis.var("StatusWord.X28")
    move = rig.axis.move_relative(5.0)
    rig.until(move.done)
    assert not rig.axis.var("StatusWord.X28")


@pytest.mark.requirement("STP-559", "STP-033", "TA-020", "STP-068")
def test_drive_fault(rig):
    """ZSW1.3: alarm 421 with reaction 4; after the cause is gone one MC_Reset acknowledges both and
    enables.
    """
    rig.travelling()
    rig.port.fault = True
    rig.cycles(3)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (421, 4)
    assert rig.axis.var("ErrorWord.X4")
    rig.run(3.0)
    rig.port.fault = False
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.until(rig.axis.power_instance.status)
    assert rig.axis.var("ErrorDetail.Number") == 0


@pytest.mark.requirement("TA-007", "STP-072")
def test_acknowledging_a_present_cause(rig):
    """While the drive's fault persists, the acknowledged alarm comes again."""
    rig.travelling()
    rig.port.fault = True
    rig.run(3.0)
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.cycles(2)
    assert rig.axis.var("ErrorDetail.Number") == 421


@pytest.mark.requirement("STP-561", "STP-595", "STP-460")
def test_drive_brakes_by_itself(rig):
    """A drive that brakes by itself raises 550 with reaction 5; the enables stay set."""
    rig.travelling()
    rig.port.autonomous_stop = True
    rig.cycles(3)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (550, 5)
    assert rig.axis.state is AxisState.TRACKING
    assert int(rig.column("stw1")[-1]) == 0x047F


@pytest.mark.requirement("STP-397", "TA-020")
def test_lost_link(rig):
    """The link lost while moving: alarm 431 with reaction 4; it needs the link to be acknowledged for
    good.
    """
    rig.travelling()
    rig.port.link = False
    rig.cycles(3)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorWord.X7")) == (431, True)
    rig.port.link = True
    rig.run(3.0)
    reset = rig.axis.reset()
    rig.until(reset.done)
    rig.until(rig.axis.power_instance.status)


@pytest.mark.requirement("STP-078", "VAR-007", "TA-009", "MC-170")
def test_restart_needs_a_disabled_axis(rig):
    """MC_Reset with Restart on an enabled axis: 16#800E and warning 322, the axis is not touched."""
    rig.enabled()
    reset = rig.axis.reset(restart=True)
    rig.cycles(3)
    assert (reset.Error, reset.ErrorID) == (True, 0x800E)
    assert rig.axis.var("WarningWord.X3")
    assert rig.axis.power_instance.Status


@pytest.mark.requirement("STP-076", "STP-077", "STP-080", "VAR-006", "VAR-008", "MC-181")
def test_restart_takes_start_values(rig):
    """A restart takes restart-relevant values from load memory together, and ends the homing of an
    incremental axis.
    """
    rig.cycles(5)
    rig.axis.home(5.0)
    rig.cycles(2)
    assert rig.axis.var("StatusWord.X5")
    rig.axis.variables.write_start("Mechanics.LeadScrew", 20.0)
    rig.cycles(2)
    assert rig.axis.var("StatusWord.X3")
    assert rig.axis.var("Mechanics.LeadScrew") == 10.0
    reset = rig.axis.reset(restart=True)
    rig.cycles(2)
    assert rig.axis.var("StatusWord.X2")
    early = rig.axis.move_velocity(10.0)
    rig.cycles(2)
    assert early.ErrorID == 0x800D
    rig.until(reset.done)
    rig.cycles(2)
    assert rig.axis.var("Mechanics.LeadScrew") == 20.0
    assert not rig.axis.var("StatusWord.X3")
    assert not rig.axis.var("StatusWord.X5")


@pytest.mark.requirement(
    "HOM-139",
    "HOM-140",
    "HOM-142",
    "MC-199",
    "MC-200",
    "MC-211",
    "MC-212",
    "HOM-146",
    "HOM-147",
    "HOM-012",
    "HOM-013",
    "HOM-145",
)
@pytest.mark.parametrize(
    ("mode", "position", "expected"), [(0, 100.0, 100.0), (1, 5.0, None), (11, 7.0, None), (12, 5.0, None)]
)
def test_direct_homing_moves_nothing(rig, mode, position, expected):
    """Direct homing shifts the coordinates while the axis moves, without a step of the speed."""
    rig.travelling(50.0)
    before_set, before_actual = rig.axis.var("Position"), rig.axis.var("ActualPosition")
    error = before_set - before_actual
    speeds = rig.column("speed_output")[-1]
    home = rig.axis.home(position, mode=mode)
    rig.cycles(2)
    assert home.Done
    assert rig.axis.var("StatusWord.X5")
    assert rig.axis.var("Position") - rig.axis.var("ActualPosition") == pytest.approx(error, abs=1e-3)
    assert rig.column("speed_output")[-1] == pytest.approx(speeds, rel=1e-3)
    if expected is not None:
        assert home.ReferenceMarkPosition == pytest.approx(expected)
    assert rig.job.Busy


@pytest.mark.requirement("MC-210", "MC-211")
@pytest.mark.parametrize("mode", [11, 12])
def test_the_setpoint_is_set_and_the_following_error_kept(rig, mode):
    """Mode 11 makes the setpoint the given position, mode 12 shifts it; the axis moves on and stays as far
    behind.
    """
    rig.travelling(50.0)
    error = rig.axis.var("StatusPositioning.FollowingError")
    before = rig.axis.var("Position")
    home = rig.axis.home(-250.0, mode=mode)
    rig.cycles()
    assert home.Done
    expected = -250.0 if mode == 11 else before - 250.0
    assert rig.axis.var("Position") == pytest.approx(expected, abs=50.0 * 0.004 + 1e-9)
    rig.cycles()
    assert rig.axis.var("Position") > expected
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(error, abs=1e-3)


@pytest.mark.requirement("MC-194")
@pytest.mark.parametrize("mode", [4, 14, -1])
def test_illegal_homing_mode(rig, mode):
    """A homing mode that does not exist is refused with 16#800A."""
    rig.cycles(5)
    home = rig.axis.home(0.0, mode=mode)
    rig.cycles(2)
    assert (home.Error, home.ErrorID) == (True, 0x800A)


@pytest.mark.requirement("MC-214", "MC-011")
def test_homing_mode_and_encoder_type(rig):
    """Absolute encoder adjustment on an incremental encoder is refused with 16#8010."""
    rig.cycles(5)
    home = rig.axis.home(0.0, mode=7)
    rig.cycles(2)
    assert home.ErrorID == 0x8010


@pytest.mark.requirement("MC-013", "MC-186")
def test_homing_needs_a_valid_actual_value(rig):
    """Homing without a valid actual value is refused with 16#8016."""
    rig.port.link = False
    rig.cycles(5)
    home = rig.axis.home(0.0)
    rig.cycles(2)
    assert home.ErrorID == 0x8016


@pytest.mark.requirement("MC-102", "STP-027", "MC-042")
def test_speed_axis_moves_and_stops(make_rig):
    """A speed axis takes MC_MoveVelocity, ignores StartMode, and ends MC_Halt at setpoint zero."""
    rig = make_rig(speed=True)
    rig.enabled(start_mode=0)
    move = rig.axis.move_velocity(600.0)
    rig.until(move.in_velocity)
    rig.cycles(2)
    assert rig.axis.var("ActualSpeed") == pytest.approx(600.0)
    halt = rig.axis.halt()
    rig.until(halt.done)
    assert rig.axis.var("StatusWord.X6")


@pytest.mark.requirement("MC-051", "MC-041", "MC-039")
def test_object_type_of_instructions(make_rig):
    """Positioning and homing on a speed axis are refused with 16#8002."""
    rig = make_rig(speed=True)
    rig.enabled()
    move = rig.axis.move_relative(1.0)
    home = rig.axis.home(0.0)
    rig.cycles(2)
    assert (move.ErrorID, home.ErrorID) == (0x8002, 0x8002)


ACTIONS = st.lists(
    st.one_of(
        st.tuples(st.just("move"), st.floats(-400, 400)),
        st.tuples(st.just("relative"), st.floats(-50, 50)),
        st.tuples(st.just("append"), st.floats(-50, 50)),
        st.tuples(st.just("superimposed"), st.floats(-50, 50)),
        st.tuples(st.just("halt superimposed"), st.just(0.0)),
        st.tuples(st.just("halt basic"), st.just(0.0)),
        st.tuples(st.just("halt"), st.just(0.0)),
        st.tuples(st.just("stop"), st.sampled_from([0.0, 2.0, 3.0])),
        st.tuples(st.just("release"), st.just(0.0)),
        st.tuples(st.just("off"), st.sampled_from([0.0, 1.0, 2.0, 3.0])),
        st.tuples(st.just("on"), st.just(0.0)),
        st.tuples(st.just("alarm"), st.sampled_from([104.0, 321.0, 521.0])),
        st.tuples(st.just("reset"), st.just(0.0)),
        st.tuples(st.just("wait"), st.floats(0.0, 0.4)),
    ),
    max_size=12,
)


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "MC-071", "MC-072", "MC-073", "STP-507", "STP-509", "STP-510", "STP-512", "STP-513", "DIA-103"
)
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(actions=ACTIONS)
def test_invariants_under_any_sequence(make_rig, actions):
    """Whatever is commanded in whatever order, the outputs obey the rules in every call."""
    rig = make_rig()
    instances = []
    power = rig.axis.power_instance

    def check():
        for one in instances:
            assert sum((one.Busy, getattr(one, "Done", False), one.CommandAborted, one.Error)) <= 1
            assert (one.ErrorID != 0) is one.Error
            assert not getattr(one, "Active", False) or one.Busy
        assert power.Busy or not power.Status
        assert power.Busy or not power.Enable
        word = rig.axis.status_word
        assert sum(bool(word >> bit & 1) for bit in (12, 13, 14)) <= 1
        engine = rig.axis.alarms.engine
        assert bool(word & 2) is bool(engine.error_word) or engine.error_word
        if word & 2:
            assert engine.number
        # STW1 of the cycle before met the status word of this one.
        if len(rig.rows) > 1:
            index = rig.names.index("stw1") + 1
            zsw1 = int(rig.rows[-1][rig.names.index("zsw1") + 1])
            rising = int(rig.rows[-1][index]) & 1 and not int(rig.rows[-2][index]) & 1
            assert not (rising and zsw1 & 0x40)

    rig.runtime.after_cycle.append(check)
    rig.enabled()
    stops = []
    for action, value in actions:
        if action == "move":
            instances.append(rig.axis.move_velocity(value))
        elif action == "relative":
            instances.append(rig.axis.move_relative(value))
        elif action == "append":
            instances.append(rig.axis.move_relative(value, BufferMode=1))
        elif action == "superimposed":
            instances.append(rig.axis.move_superimposed(value))
        elif action == "halt superimposed":
            instances.append(rig.axis.halt_superimposed())
        elif action == "halt basic":
            instances.append(rig.axis.halt(Mode=1))
        elif action == "halt":
            instances.append(rig.axis.halt())
        elif action == "stop":
            stops.append(rig.axis.stop(int(value)))
            instances.append(stops[-1])
        elif action == "release":
            for stop in stops:
                stop.set(Execute=False)
        elif action == "off":
            rig.axis.power(False, stop_mode=int(value))
        elif action == "on":
            rig.axis.power()
        elif action == "alarm":
            rig.axis.alarms.raise_alarm(int(value))
        elif action == "reset":
            rig.axis.reset()
        else:
            rig.run(value)
        rig.cycles(1)
    rig.run(0.5)
