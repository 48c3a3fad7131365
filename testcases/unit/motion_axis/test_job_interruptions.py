"""What happens to running and waiting jobs when something goes wrong or is switched off (sections 2.12 and
8.5).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from motion.s7.axis import AxisState
from motion.s7.instructions import MC_Home, MC_SetSensor
from testcases.catalogue import each
from testcases.unit.motion_axis.override_cells import ACTIVE, exists, synchronous
from testcases.unit.motion_axis.test_sensors import Rig as SensorRig

REACTIONS = {1: 533, 2: 104, 3: 321, 4: 421, 5: 550}
"""One alarm for every reaction."""
WEIGHT = {0: 3, 2: 2, 3: 1}
"""Weight of MC_Stop by its mode; that of a reaction is its number (MC-415 to MC-418)."""
RUNNING = [name for name in ACTIVE if exists(name) and name != "MC_LeadingValueAdditive"]
"""Jobs with the outputs of a job; the additive value only stops to be Busy (SYN-229)."""


def bring(rig, name):
    """Enable, home, and start a job of the overriding tables; returns it while it is Busy."""
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    job = ACTIVE[name](rig)
    rig.run(0.1)
    assert job.Busy
    return job


WEIGHT_ROWS = {1: "MC-418", 2: "MC-417", 3: "MC-416", 4: "MC-415", 5: "MC-121"}


@pytest.mark.parametrize(
    ("reaction", "mode"),
    [
        pytest.param(
            reaction, mode, marks=pytest.mark.requirement(WEIGHT_ROWS[reaction], "MC-595", "OVR-105")
        )
        for reaction in REACTIONS
        for mode in WEIGHT
    ],
)
class TestStopAgainstAlarm:
    """The weight decides; MC_Stop that loses shows CommandAborted and never 16#8001."""

    @pytest.mark.requirement("MC-420", "MC-422")
    def test_alarm_during_a_stop(self, rig, reaction, mode):
        """A higher weight ends the stop; an equal or lower one lets it come to its end."""
        rig.travelling(400.0)
        stop = rig.axis.stop(mode, Deceleration=500.0, Jerk=0.0)
        rig.run(0.03)
        assert stop.Busy
        rig.axis.alarms.raise_alarm(REACTIONS[reaction], reaction=reaction)
        rig.cycles(2)
        wins = reaction > WEIGHT[mode]
        assert (stop.CommandAborted, stop.Busy) == (wins, not wins)
        rig.run(2.0)
        assert not stop.Error
        assert stop.Done is not wins
        assert rig.column("velocity_setpoint")[-1] == 0.0

    @pytest.mark.requirement("MC-420", "MC-421", "MC-422")
    def test_stop_during_an_alarm(self, rig, reaction, mode):
        """A higher weight takes the ramp of the alarm over; an equal or lower one is turned away at once."""
        rig.travelling(400.0)
        rig.axis.alarms.raise_alarm(REACTIONS[reaction], reaction=reaction)
        rig.cycles(3)
        since = len(rig.rows)
        stop = rig.axis.stop(mode, Deceleration=500.0, Jerk=0.0)
        rig.cycles(2)
        wins = WEIGHT[mode] > reaction
        assert (stop.CommandAborted, stop.Busy) == (not wins, wins)
        rig.run(2.0)
        assert not stop.Error
        assert stop.Done is wins
        if wins:
            slowest = min(rig.column("acceleration_setpoint")[since:])
            assert slowest == pytest.approx({3: -4000.0, 2: -2000.0}[WEIGHT[mode]], rel=0.01)


@pytest.mark.requirement("STP-395", "STP-437")
@pytest.mark.parametrize("reaction", [1, 2, 3])
@pytest.mark.parametrize("mode", WEIGHT)
def test_stop_after_the_acknowledgement(rig, reaction, mode):
    """Of an acknowledged alarm only the ramp is left: MC_Stop is accepted as any other job, and locks the
    axis.
    """
    rig.travelling(400.0)
    rig.axis.alarms.raise_alarm(REACTIONS[reaction], reaction=reaction)
    rig.cycles(2)
    rig.until(rig.axis.reset().done)
    assert rig.axis.state is AxisState.ALARM_RAMP
    stop = rig.axis.stop(mode, Deceleration=800.0)
    rig.cycles(2)
    assert (stop.Busy, stop.CommandAborted) == (True, False)
    assert rig.axis.var("StatusWord2.X0")
    refused = rig.axis.move_velocity(10.0)
    rig.until(stop.done)
    assert refused.ErrorID == 0x800F
    assert rig.axis.state is AxisState.STOP_HOLD


@pytest.mark.requirement("MC-407", "STP-431", "STP-478")
def test_a_job_that_is_called_after_the_falling_edge(rig):
    """The lock ends with the call that sees Execute = FALSE: a job that the program calls behind it moves the
    axis.
    """
    rig.travelling(100.0)
    stop = rig.axis.stop(2)
    rig.until(stop.done)
    refused = rig.axis.move_relative(5.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x800F
    stop.set(Execute=False)
    move = rig.axis.move_relative(5.0)  # called in the same cycle, behind the stop
    rig.cycles()
    assert (stop.Done, move.Busy, move.Error) == (False, True, False)
    rig.until(move.done)


@pytest.mark.requirement("MC-419", "STP-423", "STP-439")
def test_stop_over_the_stop_that_has_taken_an_alarm_over(rig):
    """An equal MC_Stop takes over from it, a lower one does not, although the alarm is still pending."""
    rig.travelling(400.0)
    rig.axis.alarms.raise_alarm(REACTIONS[1], reaction=1)
    rig.cycles(2)
    first = rig.axis.stop(2)
    rig.cycles(2)
    lower = rig.axis.stop(3, Deceleration=800.0)
    second = rig.axis.stop(2)
    rig.cycles(2)
    assert (first.CommandAborted, lower.CommandAborted, second.Busy) == (True, True, True)
    rig.until(second.done)


def check_disabling_aborts_everything(make_rig, stop_mode, name):
    rig = make_rig(
        variables={"DynamicLimits.MaxJerk": 1.0e9},  # full deceleration at once, also with StopMode 2
        synchronous=synchronous(name),
    )
    job = bring(rig, name)
    rig.until(lambda: not rig.axis.var("StatusWord.X21"))
    rig.run(0.2)  # at constant velocity, or braking by less than every mode does
    since = len(rig.rows) - 1
    power = rig.axis.power(False, stop_mode=stop_mode)
    rig.cycles(2)
    assert (job.CommandAborted, job.Busy) == (True, False)
    shown = []
    rig.runtime.after_cycle.append(lambda: shown.append((power.Status, power.Busy)))
    rig.until(power.off)
    assert all(busy or not status for status, busy in shown)
    speeds = [abs(v) / 6.0 for v in rig.column("actual_speed")[since:]]
    slopes = [(b - a) / 0.004 for a, b in pairwise(speeds)]
    bound = {0: 4000.0, 1: 1000.0, 2: 2000.0, 3: 1000.0 / 6.0}[stop_mode]
    # What is braked with beforehand is at most 100, and an encoder quantum of velocity is added (60).
    assert min(slopes) >= -bound * 1.03 - 60.0
    if stop_mode == 3:
        return  # off at once; the axis coasts on
    assert speeds[-1] == 0.0
    if speeds[0] > 20.0:
        assert min(slopes) <= -bound * 0.97


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-596", "MC-163", "MC-062", "OVR-103", "STP-251")
def test_disabling_aborts_everything(make_rig, subtests):
    """CommandAborted at once; the ramp of the mode, measured at the drive; Status and Busy FALSE together at
    its end.
    """
    for label, values in each([0, 1, 2, 3], RUNNING):
        with subtests.test(label):
            check_disabling_aborts_everything(make_rig, *values)


@pytest.mark.requirement("MC-592", "MC-063", "MC-002")
@pytest.mark.parametrize("name", [*RUNNING])
def test_the_link_is_lost(make_rig, name):
    """Alarm 431 with reaction 4, ErrorWord.X7; every job 16#8001 but MC_Stop, which shows CommandAborted."""
    rig = make_rig(synchronous=synchronous(name))
    job = bring(rig, name)
    rig.port.link = False
    rig.cycles(4)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (431, 4)
    assert rig.axis.var("ErrorWord.X7")
    if name == "MC_Stop":
        assert (job.CommandAborted, job.Error) == (True, False)
    else:
        assert (job.Error, job.ErrorID, job.Busy) == (True, 0x8001, False)
    assert not rig.axis.power_instance.Status


@pytest.mark.requirement("MC-594", "MC-157", "MC-125")
@pytest.mark.parametrize("how", ["fault", "off"])
def test_the_drive_drops_out(rig, how):
    """ErrorWord.X4; acknowledged, the axis is enabled again by itself, and MC_MoveVelocity stays where it
    ended.
    """
    rig.travelling(300.0)
    if how == "fault":
        rig.port.fault = True
    else:
        rig.port.stage = type(rig.port.stage).S2  # ZSW1 bits 1 and 2 = 0, nobody has asked for it
    rig.cycles(3)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorWord.X4")) == (421, True)
    assert (rig.job.Error, rig.job.ErrorID) == (True, 0x8001)
    rig.port.fault = False
    rig.run(4.0)
    rig.until(rig.axis.reset().done)
    rig.until(rig.axis.power_instance.status)
    rig.run(0.3)
    assert rig.column("velocity_setpoint")[-1] == 0.0
    assert rig.axis.state is AxisState.STANDSTILL
    assert rig.job.Error
    rig.job.set(Execute=False)
    rig.cycles(1)
    rig.job.set(Execute=True)
    rig.until(rig.job.in_velocity)


@pytest.mark.requirement("MC-597", "MC-155", "MC-156")
@pytest.mark.parametrize("stop_mode", [0, 1, 2, 3])
@pytest.mark.parametrize("reaction", [1, 3, 5, 7])
def test_disabled_while_the_enable_is_removed(make_rig, reaction, stop_mode):
    """16#7: OFF3 to standstill, StopMode after it; 1, 3, 5: OFF2 at once whatever StopMode says."""
    rig = make_rig(variables={"Actor.RemoveEnableReaction": reaction})
    rig.travelling(400.0)
    rig.axis.alarms.raise_alarm(521)
    rig.cycles(5)
    assert rig.axis.var("ErrorDetail.Reaction") == 4
    power = rig.axis.power(False, stop_mode=stop_mode)
    rig.cycles(2)
    assert rig.axis.stw1_sent == (0x047B if reaction == 7 else 0x047C)
    assert rig.axis.actual_velocity > 100.0
    rig.until(power.off)
    assert abs(rig.axis.actual_velocity) < 2.0
    assert rig.axis.state is AxisState.ALARM_DISABLED


@pytest.mark.requirement("MC-593", "MC-013", "MC-130", "MC-391")
def test_an_encoder_without_a_valid_value():
    """MC_Home and MC_SetSensor 16#8016; MC_Power waits without Status; a faulty encoder in operation sets
    X5.
    """
    rig = SensorRig()
    rig.port.link = False
    rig.others[0].dead = True
    rig.cycles(3)
    home = rig.axis.run(MC_Home(rig.axis.object, Execute=True))
    sensor = rig.axis.run(MC_SetSensor(rig.axis.object, Execute=True, Sensor=2))
    power = rig.axis.power()
    rig.cycles(3)
    assert (home.ErrorID, sensor.ErrorID) == (0x8016, 0x8016)
    assert (power.Status, power.Busy) == (False, True)


@pytest.mark.requirement("MC-593", "MC-012")
def test_an_encoder_that_fails_in_operation(rig):
    """Alarm 411: ErrorWord.X5, the job 16#8001."""
    rig.travelling(100.0)
    rig.port.sensor_fault = True
    rig.cycles(3)
    assert rig.axis.var("ErrorDetail.Number") == 411
    assert rig.axis.var("ErrorWord.X5")
    assert rig.job.ErrorID == 0x8001


@pytest.mark.requirement("MC-605", "MC-261", "MC-231", "DIA-066")
@pytest.mark.parametrize("name", ["MC_MoveAbsolute", "MC_MoveRelative", "MC_Halt"])
def test_the_window_is_never_reached(make_rig, name):
    """Alarm 541 with ErrorWord.X12 and reaction 4; the job 16#8001, never Done."""
    rig = make_rig(
        variables={
            "PositioningMonitoring.Window": 0.001,
            "PositioningMonitoring.ToleranceTime": 0.05,
            "PositionControl.Kv": 0.001,
            "FollowingError.EnableMonitoring": False,
        }
    )
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    job = rig.axis.move_absolute(20.0) if name == "MC_MoveAbsolute" else rig.axis.move_relative(20.0)
    rig.until(lambda: rig.axis.var("Velocity") > 50.0)
    rig.port.turn(-0.5)
    if name == "MC_Halt":
        job = rig.axis.halt()
    rig.until(lambda: job.Error or job.Done)
    assert (job.Error, job.ErrorID, job.Done) == (True, 0x8001, False)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (541, 4)
    assert rig.axis.var("ErrorWord.X12")


@pytest.mark.requirement("MC-601", "MC-304", "MC-094", "G2-031")
@pytest.mark.parametrize(
    ("override", "given", "velocity", "warned"),
    [
        (0.0, 100.0, 0.0, False),
        (50.0, 100.0, 50.0, False),
        (200.0, 100.0, 200.0, False),
        (250.0, 100.0, 200.0, False),
        (200.0, 300.0, 500.0, True),
        (50.0, 300.0, 150.0, False),
    ],
)
def test_override_of_a_velocity(rig, override, given, velocity, warned):
    """InVelocity falls and comes back at the product; above 200 % counts as 200 %; the dynamic limit is the
    end, with 501.
    """
    rig.travelling(given)
    rig.axis.write("Override.Velocity", override)
    rig.cycles(2)
    assert rig.job.Busy
    assert not rig.job.InVelocity
    rig.until(rig.job.in_velocity)
    assert rig.axis.var("Velocity") == pytest.approx(velocity)
    assert (501 in [event.data["number"] for event in rig.events("alarm.raised")]) is warned
    rig.axis.write("Override.Velocity", 100.0)
    rig.cycles(2)
    assert not rig.job.InVelocity
    rig.until(rig.job.in_velocity)
    assert rig.axis.var("Velocity") == pytest.approx(given)


@pytest.mark.requirement("MC-599", "MC-329", "MC-338", "MC-339", "MC-340")
@pytest.mark.parametrize("first", ["JogForward", "JogBackward"])
@pytest.mark.parametrize("deceleration", [200.0, 800.0])
def test_both_jog_inputs(rig, first, deceleration):
    """16#8007 and braking with the deceleration last in force; after both are FALSE the next one moves
    again.
    """
    rig.enabled()
    jog = rig.axis.jog(100.0, backward=first == "JogBackward", Deceleration=deceleration, Jerk=0.0)
    rig.until(jog.in_velocity)
    since = len(rig.rows)
    jog.set(JogForward=True, JogBackward=True)
    rig.cycles(1)
    assert (jog.Error, jog.ErrorID, jog.Busy, jog.InVelocity) == (True, 0x8007, False, False)
    rig.run(0.1)
    assert jog.Error
    rates = {round(abs(a)) for a in rig.column("acceleration_setpoint")[since + 1 :]}
    assert rates == {round(deceleration)}
    jog.set(JogForward=False, JogBackward=False)
    rig.cycles(1)
    assert (jog.Error, jog.ErrorID) == (False, 0)
    jog.set(JogForward=True)
    rig.until(jog.in_velocity)
    assert rig.axis.var("Velocity") == pytest.approx(100.0)


@pytest.mark.requirement("MC-464", "MC-454")
@pytest.mark.parametrize("watched", [True, False])
def test_homing_on_a_limit_switch(make_rig, watched):
    """The axis gets onto its limit switch, and is homed there, with index 1000 = FALSE; watched, that is
    alarm 531.
    """
    rig = make_rig(variables={"PositionLimits_HW.Active": True}).enabled()
    if not watched:
        rig.until(rig.axis.write_parameter(1000, False).done)
    move = rig.axis.move_velocity(50.0)
    rig.until(move.in_velocity)
    rig.port.switches = 0b10
    rig.cycles(3)
    assert rig.axis.var("ErrorDetail.Number") == (531 if watched else 0)
    if watched:
        return
    rig.until(rig.axis.halt().done)
    rig.until(rig.axis.home(500.0).done)
    rig.until(rig.axis.move_absolute(480.0).done)
    rig.port.switches = 0
    rig.cycles(2)
    rig.until(rig.axis.write_parameter(1000, True).done)
    rig.run(0.1)
    assert (rig.axis.var("ErrorWord"), rig.axis.var("StatusWord.X5")) == (0, True)


@pytest.mark.requirement("MC-463", "MC-454", "LIM-063", "LIM-068", "VAR-174")
def test_retracting_with_the_limit_switches_off(make_rig):
    """Both switches active: 531. Index 1000 FALSE, acknowledged, retracted, TRUE again: the axis is as
    before.
    """
    rig = make_rig(variables={"PositionLimits_HW.Active": True})
    rig.travelling(100.0)
    rig.port.switches = 0b11
    rig.cycles(3)
    assert rig.axis.var("ErrorDetail.Number") == 531
    rig.run(2.0)
    rig.until(rig.axis.write_parameter(1000, False).done)
    reset = rig.axis.reset()
    rig.until(lambda: reset.Done or reset.Error)
    if rig.axis.var("StatusWord.X1"):
        rig.axis.power(False)
        rig.run(0.5)
        rig.until(rig.axis.reset(restart=True).done)
        rig.until(rig.axis.write_parameter(1000, False).done)
        rig.axis.power()
    rig.until(rig.axis.power_instance.status)
    rig.until(rig.axis.move_relative(-20.0).done)
    rig.port.switches = 0
    rig.cycles(2)
    rig.until(rig.axis.write_parameter(1000, True).done)
    rig.run(0.2)
    assert rig.axis.var("ErrorWord") == 0
    rig.until(rig.axis.move_relative(-20.0).done)


@pytest.mark.requirement("MC-263")
@pytest.mark.parametrize("kind", ["absolute", "relative"])
def test_a_target_behind_the_software_limit(make_rig, kind):
    """The motion goes as far as the limit, which ends the job with 16#8001."""
    rig = make_rig(
        variables={
            "PositionLimits_SW.Active": True,
            "PositionLimits_SW.MaxPosition": 100.0,
            "PositionLimits_SW.MinPosition": -100.0,
        }
    )
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    job = rig.axis.move_absolute(150.0) if kind == "absolute" else rig.axis.move_relative(150.0)
    rig.until(lambda: job.Error)
    assert job.ErrorID == 0x8001
    assert rig.axis.var("ErrorDetail.Number") == 533
    rig.run(0.5)
    assert rig.axis.var("Position") == pytest.approx(100.0, abs=1e-3)
