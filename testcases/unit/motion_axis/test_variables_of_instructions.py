"""Which variables an instruction takes its values from, and which it changes (section 12 of the variable
guide).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from testcases.unit.motion_axis.conftest import CYCLE

X6, X7, X8, X10, X12 = (1 << bit for bit in (6, 7, 8, 10, 12))
X13, X14, X23, X28 = (1 << bit for bit in (13, 14, 23, 28))


def seen(rig, since=0):
    """Return the bits of the status word that have been TRUE, and those that have been FALSE."""
    some, every = 0, ~0
    for word in rig.column("status_word")[since:]:
        some |= int(word)
        every &= int(word)
    return some, ~every


@pytest.mark.requirement("VAR-196", "VAR-036", "VAR-113")
@pytest.mark.parametrize("absolute", [True, False])
def test_positioning(make_rig, absolute):
    """Defaults, limits and override in, X8 while it runs, X6 behind it, X28 FALSE, and what StatusPositioning
    tells of it.
    """
    rig = make_rig(variables={"DynamicDefaults.Velocity": 300.0, "DynamicLimits.Velocity": 200.0})
    rig.enabled(start_mode=0)
    assert rig.axis.status_word & X28
    rig.axis.power(False)
    rig.until(rig.axis.power_instance.off)
    rig.enabled()
    rig.until(rig.axis.home(10.0).done)
    rig.axis.write("Override.Velocity", 50.0)
    since = len(rig.rows)
    job = rig.axis.move_absolute(210.0) if absolute else rig.axis.move_relative(200.0)
    rig.run(0.5)
    assert rig.axis.status_word & X8
    assert not rig.axis.status_word & (X6 | X28)
    assert rig.axis.var("StatusPositioning.TargetPosition") == 210.0
    assert rig.axis.var("StatusPositioning.Distance") == pytest.approx(210.0 - rig.axis.var("Position"))
    assert max(rig.column("velocity_setpoint")[since:]) == pytest.approx(150.0)
    rig.axis.write("Override.Velocity", 100.0)
    rig.until(job.done)
    assert max(rig.column("velocity_setpoint")[since:]) == pytest.approx(200.0)
    assert max(rig.column("acceleration_setpoint")[since:]) == pytest.approx(1000.0, rel=0.01)
    rig.cycles(2)
    assert rig.axis.status_word & (X6 | X8) == X6


@pytest.mark.requirement("VAR-197", "VAR-038", "VAR-037")
@pytest.mark.parametrize("jog", [True, False])
@pytest.mark.parametrize("controlled", [True, False])
def test_velocity(make_rig, jog, controlled):
    """Acceleration and deceleration by default, the velocity not; X9 or X10, X12 to X14, and X28 as the job
    says.
    """
    rig = make_rig(variables={"DynamicDefaults.Velocity": 300.0}).enabled()
    since = len(rig.rows)
    start = rig.axis.jog if jog else rig.axis.move_velocity
    job = start(120.0, PositionControlled=controlled)
    rig.until(job.in_velocity)
    assert rig.column("velocity_setpoint")[-1] == pytest.approx(120.0)
    assert rig.axis.status_word & (X8 | X10 | 1 << 9) == (1 << 9 if jog else X10)
    assert bool(rig.axis.status_word & X28) is not controlled
    rig.until(rig.axis.halt().done)
    some, _ = seen(rig, since)
    assert some & (X12 | X13 | X14) == X12 | X13 | X14
    assert bool(rig.axis.status_word & X28) is not controlled


@pytest.mark.requirement("VAR-198", "VAR-199")
@pytest.mark.parametrize("controlled", [True, False])
@pytest.mark.parametrize(
    ("mode", "deceleration", "jerk"),
    [(None, 700.0, 7000.0), (0, 4000.0, 0.0), (2, 2000.0, 20000.0), (3, 700.0, 7000.0)],
)
def test_halt_and_stop(make_rig, controlled, mode, deceleration, jerk):
    """Default, emergency or maximum dynamics; X28 unchanged, X6 and X7 at the end; StatusWord2.X0 tells of
    MC_Stop.
    """
    rig = make_rig(variables={"DynamicDefaults.Deceleration": 700.0, "DynamicDefaults.Jerk": 7000.0})
    rig.enabled()
    rig.until(rig.axis.move_velocity(400.0, PositionControlled=controlled).in_velocity)
    rig.run(0.1)
    since = len(rig.rows)
    job = rig.axis.halt() if mode is None else rig.axis.stop(mode)
    rig.cycles(2)
    assert rig.axis.var("StatusWord2.X0") is (mode is not None)
    rig.until(job.done)
    rig.run(0.1)
    slope = rig.column("acceleration_setpoint")[since:]
    assert min(slope) == pytest.approx(-deceleration, rel=0.02)
    if jerk:
        steepest = max(abs(b - a) for a, b in pairwise(slope)) / CYCLE
        assert steepest == pytest.approx(jerk, rel=0.02)
    some, missing = seen(rig, since)
    assert (missing if controlled else some) & X28
    assert not (some if controlled else missing) & X28
    assert rig.axis.status_word & (X6 | X7) == X6 | X7


@pytest.mark.requirement("VAR-116", "VAR-064", "VAR-200")
def test_superimposed_distance(rig):
    """It grows with every superimposed motion, negative ones and halts included, and is 0 when all motion has
    ended.
    """
    path = "StatusPositioning.SuperimposedDistance"
    rig.enabled()
    basic = rig.axis.move_relative(400.0, Velocity=100.0)
    rig.cycles(4)
    rig.until(rig.axis.move_superimposed(20.0, VelocityDiff=50.0).done)
    assert rig.axis.var(path) == pytest.approx(20.0)
    rig.until(rig.axis.move_superimposed(-50.0, VelocityDiff=50.0).done)
    assert rig.axis.var(path) == pytest.approx(-30.0)
    rig.axis.move_superimposed(100.0, VelocityDiff=50.0)
    rig.run(0.4)
    assert rig.axis.status_word & X23
    halt = rig.axis.halt_superimposed()
    rig.cycles(2)
    assert rig.axis.var("StatusWord2.X7") is True
    assert not rig.axis.status_word & X23
    rig.until(halt.done)
    rig.cycles(2)
    assert rig.axis.var("StatusWord2.X7") is False
    covered = rig.axis.var(path)
    assert -30.0 < covered < 70.0
    rig.until(basic.done, 10.0)
    assert rig.axis.var("Position") == pytest.approx(400.0 + covered)
    rig.cycles(2)
    assert rig.axis.var(path) == 0.0


@pytest.mark.requirement("VAR-117")
def test_setpoints_on_their_way_to_the_controller(make_rig):
    """Position, then PositionAfterDynamicFilter, BalancedPosition behind T_vtc, and what is left to the
    actual value.
    """
    rig = make_rig(
        variables={
            "SetpointFilter.DynamicFilter.Mode": 2,
            "SetpointFilter.DynamicFilter.Tt": 0.02,
            "DynamicAxisModel.VelocityTimeConstant": 0.01,
            "PositionControl.Kpc": 100.0,
        }
    )
    rig.travelling(100.0)
    rig.run(0.5)
    read = rig.axis.var
    filtered = read("StatusServo.PositionAfterDynamicFilter")
    assert read("Position") - filtered == pytest.approx(2.0)
    assert filtered - read("StatusServo.BalancedPosition") == pytest.approx(1.0)
    behind = read("StatusServo.BalancedPosition") - 100.0 * CYCLE - read("ActualPosition")
    assert read("StatusServo.ControlDifference") == pytest.approx(behind, abs=1e-3)


@pytest.mark.requirement("VAR-099", "VAR-100")
@pytest.mark.parametrize(
    ("number", "reaction", "mode", "aborted"),
    [
        (533, 1, 3, False),
        (533, 1, 2, False),
        (533, 2, 3, True),
        (321, 3, 0, False),
        (321, 3, 2, True),
        (521, 4, 0, True),
    ],
)
def test_the_more_important_stop_takes_over(rig, number, reaction, mode, aborted):
    """An alarm behind MC_Stop: of higher importance it takes over, and the job shows CommandAborted without
    an error.
    """
    rig.travelling(400.0)
    stop = rig.axis.stop(mode)
    rig.cycles(4)
    rig.axis.object.alarms.raise_alarm(number, reaction=reaction)
    rig.run(0.02)
    assert rig.axis.var("ErrorDetail.Reaction") == reaction
    assert (stop.CommandAborted, stop.Error, stop.ErrorID) == (aborted, False, 0)


@pytest.mark.requirement("VAR-104")
def test_a_drive_fault_is_acknowledged_without_communication_ok(rig):
    """CommunicationOK is FALSE with a fault of the drive; MC_Reset acknowledges it all the same."""
    rig.enabled()
    rig.port.fault = True
    rig.cycles(3)
    assert rig.axis.var("StatusDrive.CommunicationOK") is False
    rig.port.fault = False
    rig.until(rig.axis.reset().done)
    rig.cycles(3)
    assert rig.axis.var("StatusDrive.CommunicationOK") is True
    assert rig.axis.var("ErrorWord") == 0


@pytest.mark.requirement("VAR-206")
def test_control_words_of_a_simulated_axis(make_rig):
    """MC_SetAxisSTW needs X25 FALSE."""
    for simulated in (0, 1):
        rig = make_rig(variables={"Simulation.Mode": simulated}).enabled()
        rig.port.speaks_telegram = True
        job = rig.axis.set_axis_stw(STW1=1 << 8, STW1BitMask=1 << 8)
        rig.cycles(3)
        assert rig.axis.var("StatusWord.X25") is bool(simulated)
        assert job.Error is bool(simulated)


@pytest.mark.requirement("VAR-228", "VAR-006")
def test_the_data_block_is_frozen_during_a_restart(rig):
    """What the program reads while the object is initialised is what it was at the beginning, with X2 TRUE;
    then it goes on.
    """
    rig.enabled()
    rig.until(rig.axis.home(12.0).done)
    rig.axis.power(False)
    rig.until(rig.axis.power_instance.off)
    reset = rig.axis.reset(restart=True)
    rig.until(lambda: rig.axis.var("StatusWord.X2"))
    before = rig.axis.var("ActualPosition")
    assert before == pytest.approx(12.0, abs=1e-3)
    rig.port.turn(1.0)
    rig.cycles(2)
    assert rig.axis.var("StatusWord.X2") is True
    assert rig.axis.var("ActualPosition") == before
    rig.until(reset.done)
    rig.port.turn(1.0)
    rig.cycles(2)
    assert rig.axis.var("StatusWord.X2") is False
    assert rig.axis.var("ActualPosition") != before
