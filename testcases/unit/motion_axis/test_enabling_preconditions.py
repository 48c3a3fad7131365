"""What has to be there before an axis can be enabled, and what is said when it is not (§5.5, section 1.1)."""

from __future__ import annotations

import pytest

from motion.s7.axis import AxisState
from testcases.unit.motion_axis.test_adaption import BOTH
from testcases.unit.motion_axis.test_adaption import Rig as AdaptionRig

S = AxisState
COMMUNICATION, STATE = "StatusSensor[1].CommunicationOK", "StatusSensor[1].State"


def raised(rig):
    return [event.data["number"] for event in rig.history.select(kind="alarm.raised")]


def disturb(rig, what):
    """Take away the link, or the encoder value alone."""
    if what == "link":
        rig.port.link = False
    else:
        rig.port.sensor_fault = True


def restore(rig):
    rig.port.link = True
    rig.port.sensor_fault = False


# -- devices that are not there at start-up
# ------------------------------------------------------------------------------


@pytest.mark.requirement("MC-129", "MC-128", "MC-591", "STP-021", "STP-555", "CFG-620", "STP-020")
@pytest.mark.parametrize(("what", "numbers"), [("link", [106, 108]), ("encoder", [108])])
def test_enable_before_the_devices_have_joined(rig, what, numbers):
    """106 and 108 once, reaction 4, ErrorWord.X1, an entry in the diagnostic buffer; Status only after join
    and MC_Reset.
    """
    disturb(rig, what)
    power = rig.axis.power()
    rig.run(0.2)
    assert raised(rig) == numbers
    assert rig.axis.var("ErrorDetail.Reaction") == 4
    assert rig.axis.var("ErrorWord") == 1 << 1
    buffer = rig.axis.object.alarms.engine.diagnostic_buffer
    assert [entry.number for entry in buffer] == numbers
    assert all("start-up" in entry.text for entry in buffer)
    rig.until(rig.axis.reset().done)
    rig.run(0.2)
    assert raised(rig) == numbers, "acknowledged, it does not come again while the device is still away"
    assert (power.Busy, power.Status, power.Error) == (True, False, False)
    restore(rig)
    rig.until(power.status)


@pytest.mark.requirement("STP-021", "STP-019")
def test_status_stays_false_until_the_drive_joins(rig):
    """Enable TRUE from the first cycle on: no Status before the join, and none after it before the
    acknowledgement.
    """
    rig.port.link = False
    power = rig.axis.power()
    rig.run(0.4)
    rig.port.link = True
    rig.run(0.2)
    assert not any(rig.column("power_status"))
    assert {int(word) & 1 for word in rig.column("stw1")} == {0}
    rig.until(rig.axis.reset().done)
    rig.until(power.status)


@pytest.mark.requirement("STP-021")
def test_no_alarm_when_enable_comes_after_the_devices(rig):
    """Enable rises after CommunicationOK: no alarm, neither at once nor when the drive goes away later while
    disabled.
    """
    rig.port.link = False
    rig.run(0.2)
    rig.port.link = True
    rig.cycles(2)
    rig.port.link = False
    rig.cycles(2)
    power = rig.axis.power()
    rig.run(0.1)
    assert raised(rig) == []
    rig.port.link = True
    rig.until(power.status)
    assert raised(rig) == []


@pytest.mark.requirement("STP-024")
@pytest.mark.parametrize("what", ["link", "encoder"])
def test_the_start_interlock_waits_for_the_devices(rig, what):
    """Behind the interlock Enable stays FALSE until all conditions hold, so that nothing is raised; `power`
    ends it.
    """
    disturb(rig, what)
    power = rig.axis.power_when_ready()
    rig.run(0.2)
    assert (power.Enable, power.Busy) == (False, False)
    restore(rig)
    rig.until(power.status)
    assert raised(rig) == []
    rig.axis.power(False)
    rig.until(power.off)
    rig.run(0.1)
    assert not power.Enable


@pytest.mark.requirement("STP-024")
def test_the_start_interlock_withdraws_enable(rig):
    """The network is evaluated in every cycle: with CommunicationOK gone Enable falls, and rises again with
    it.
    """
    power = rig.axis.power_when_ready()
    rig.until(power.status)
    rig.port.link = False
    rig.cycles(3)
    assert not power.Enable
    rig.port.link = True
    rig.run(1.0)
    assert power.Enable


# -- encoder, transfer of parameters
# ------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-022", "STP-018")
def test_an_encoder_without_valid_values_keeps_the_axis_disabled(rig):
    """StatusSensor[1].State other than 2 with the drive ready: ON is not given until it is 2."""
    rig.cycles(2)
    rig.port.sensor_fault = True
    rig.cycles(1)
    power = rig.axis.power()
    rig.run(0.2)
    assert (rig.axis.var(STATE), rig.axis.var("StatusDrive.CommunicationOK")) == (0, True)
    assert (power.Busy, power.Status) == (True, False)
    assert {int(word) & 1 for word in rig.column("stw1")} == {0}
    rig.port.sensor_fault = False
    rig.until(power.status)
    assert rig.axis.var(STATE) == 2
    assert rig.axis.var(COMMUNICATION)


@pytest.mark.requirement("STP-023")
def test_a_selected_transfer_has_to_be_complete():
    """While AdaptionState is 1 of drive or encoder nothing is enabled; with both at 2 it is; 3 (none) does
    not block.
    """
    rig = AdaptionRig(BOTH)
    rig.port.lazy = True
    power = rig.axis.power_when_ready()
    rig.run(0.3)
    assert rig.axis.var("StatusDrive.AdaptionState") == 1
    assert not power.Enable
    plain = rig.axis.power()
    rig.run(0.2)
    assert (plain.Busy, plain.Status) == (True, False)
    free = AdaptionRig()
    power = free.axis.power_when_ready()
    free.run(0.3)
    assert power.Status
    assert [free.axis.var(f"{part}.AdaptionState") for part in ("StatusDrive", "StatusSensor[1]")] == [3, 3]


@pytest.mark.requirement("STP-023")
def test_transferred_parameters_let_the_axis_go():
    """With AdaptionState 2 of drive and encoder both variants enable."""
    rig = AdaptionRig(BOTH)
    power = rig.axis.power_when_ready()
    rig.run(0.5)
    assert power.Status
    assert [rig.axis.var(f"{part}.AdaptionState") for part in ("StatusDrive", "StatusSensor[1]")] == [2, 2]


@pytest.mark.requirement("STP-016")
def test_an_inconsistent_configuration_is_not_enabled(rig):
    """After a restart with start values that contradict each other alarm 101 is pending and Status stays
    FALSE.
    """
    rig.run(0.1)
    rig.axis.object.variables.write_start("PositionControl.InitialOperativeSensor", 3)
    rig.until(rig.axis.reset(restart=True).error)
    power = rig.axis.power()
    rig.run(0.3)
    assert rig.axis.var("ErrorDetail.Number") == 101
    assert (power.Status, power.Error, power.ErrorID) == (False, True, 0x8001)
    assert not any(rig.column("power_status"))


# -- what is in the diagnostic buffer
# -----------------------------------------------------------------------------------


@pytest.mark.requirement("STP-020")
@pytest.mark.parametrize(("what", "number"), [("link", 431), ("fault", 421)])
def test_the_reason_of_a_lost_communication_is_in_the_diagnostic_buffer(rig, what, number):
    """Whatever makes CommunicationOK FALSE on an enabled axis is recorded with its reason and time."""
    rig.enabled()
    if what == "link":
        rig.port.link = False
    else:
        rig.port.fault = True
    rig.cycles(3)
    assert not rig.axis.var("StatusDrive.CommunicationOK")
    (entry,) = rig.axis.object.alarms.engine.diagnostic_buffer
    assert (entry.number, entry.reaction) == (number, 4)
    assert entry.text
    assert entry.time_ns > 0


@pytest.mark.requirement("STP-020", "STP-045", "MC-133")
@pytest.mark.parametrize(("what", "reason"), [("link", "no cyclic communication"), ("fault", "drive fault")])
def test_what_the_enabling_waits_for_is_reported_once(rig, what, reason):
    """No alarm comes for a drive that is not ready when Enable rises: MC_Power waits, tells why, and enables
    when it is.
    """
    rig.enabled()
    rig.until(rig.axis.power(False).off)
    if what == "link":
        rig.port.link = False
    else:
        rig.port.fault = True
    rig.run(0.1)
    assert rig.events("power.waits") == []
    power = rig.axis.power()
    rig.run(0.5)
    assert (power.Busy, power.Status, power.Error) == (True, False, False)
    (reported,) = rig.events("power.waits")
    assert reason in reported.data["reason"]
    rig.port.link = True
    rig.port.fault = False
    if what == "fault":
        rig.until(rig.axis.reset().done)
    rig.until(power.status)
    assert len(rig.events("power.waits")) == 1


# -- time limit of the sequence
# -------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-043", "TA-020")
@pytest.mark.parametrize("limit", [None, 0.3])
def test_a_drive_that_cannot_be_enabled(rig, limit):
    """A drive that stays in S1: without a limit MC_Power waits; with one 421 with reaction 4, and again after
    each MC_Reset.
    """
    rig.axis.object.enabling.timeout_s = limit
    rig.run(0.1)
    rig.port.inhibited = True
    rig.cycles(2)
    power = rig.axis.power()
    began = rig.scheduler.now
    rig.run(1.0)
    events = rig.events("alarm.raised")
    assert (power.Busy, power.Status) == (True, False)
    assert [one.data["number"] for one in events] == ([] if limit is None else [421])
    if limit is None:
        return
    assert (events[0].time_ns - began) * 1e-9 == pytest.approx(limit, abs=0.02)
    assert "cannot be enabled" in events[0].data["text"]
    rig.until(rig.axis.reset().done)
    rig.run(1.0)
    assert len(rig.events("alarm.raised")) == 2
    rig.port.inhibited = False
    rig.cycles(2)
    rig.until(rig.axis.reset().done)
    rig.until(power.status)


@pytest.mark.requirement("STP-015")
@pytest.mark.parametrize("kind", ["speed", "positioning"])
def test_nothing_but_mc_power_enables(make_rig, kind):
    """Motion jobs, MC_Reset, MC_Home, torque limits and control words leave an axis disabled; bits 0 to 7 are
    not the user's.
    """
    rig = make_rig(speed=kind == "speed")
    rig.run(0.1)
    rig.axis.move_velocity(50.0)
    rig.axis.halt()
    rig.axis.stop(0)
    rig.axis.jog(50.0)
    rig.axis.reset()
    rig.axis.reset(restart=True)
    rig.axis.torque_limiting(1.0)
    rig.axis.set_axis_stw(STW1=0x000F, STW1BitMask=0x000F)
    if kind == "positioning":
        rig.axis.move_relative(10.0)
        rig.axis.home(0.0)
    with pytest.raises(Exception, match="StatusWord"):
        rig.axis.write("StatusWord", 1)
    rig.run(1.0)
    assert not any(rig.column("power_status"))
    assert {int(word) & 1 for word in rig.column("stw1")} == {0}
    rig.until(rig.axis.power().status)


# -- MC_Power among other jobs
# --------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-034")
@pytest.mark.parametrize(
    "kind", ["move", "velocity", "halt", "stop", "superimposed", "home", "reset", "torque"]
)
def test_no_job_ends_mc_power_and_enable_ends_no_job(rig, kind):
    """Whatever is started, MC_Power stays busy with Status TRUE; called on with Enable TRUE it aborts
    nothing.
    """
    rig.enabled()
    power = rig.axis.power_instance
    job = {
        "move": lambda: rig.axis.move_relative(200.0),
        "velocity": lambda: rig.axis.move_velocity(50.0),
        "halt": rig.axis.halt,
        "stop": lambda: rig.axis.stop(0),
        "superimposed": lambda: rig.axis.move_superimposed(50.0),
        "home": lambda: rig.axis.home(0.0),
        "reset": rig.axis.reset,
        "torque": lambda: rig.axis.torque_limiting(1.0, mode=1),
    }[kind]()
    rig.cycles(3)
    rig.axis.power(True, start_mode=0, stop_mode=2)
    rig.run(0.1)
    assert (power.Busy, power.Status, power.Error) == (True, True, False)
    assert not getattr(job, "CommandAborted", False)
    assert not job.Error


# -- noise at the moment of enabling
# ------------------------------------------------------------------------------------


def noisy(rig, increments):
    """Let the encoder value jump to and fro by a number of increments in every cycle, as noise does at
    rest.
    """
    plain = rig.port.read
    sign = [1]

    class Noisy(type(rig.port)):
        __slots__ = ()

        def read(self):
            plain()
            sign[0] = -sign[0]
            self.encoder_increments += sign[0] * increments

    rig.port.__class__ = Noisy


@pytest.mark.requirement("STP-054", "STP-055", "STP-564", "VAR-166")
@pytest.mark.parametrize("steps", [131072, 16384])
@pytest.mark.parametrize("velocity_mode", [0, 1])
def test_noise_steps_the_setpoint_at_enabling(make_rig, steps, velocity_mode):
    """The setpoint is x_act + v_act * delay: the coarser the encoder, the larger the step; none with
    VelocityModePowerOn 1.
    """
    increments = 131072 // steps
    rig = make_rig(
        variables={
            "PositionControl.VelocityModePowerOn": velocity_mode,
            "StandstillSignal.VelocityThreshold": 5.0,
        }
    )
    noisy(rig, increments)
    rig.run(0.1)
    rig.axis.power()
    rig.until(lambda: rig.axis.object.state is S.STANDSTILL)
    apparent = rig.axis.var("ActualVelocity")
    assert abs(apparent) == pytest.approx(2 * increments * 10.0 / 131072 / 0.004)
    step = rig.column("position_setpoint")[-1] - rig.column("actual_position")[-1]
    delay = rig.axis.object.delay_s
    assert step == pytest.approx(0.0 if velocity_mode else apparent * delay, abs=1e-12)
    rig.run(0.1)
    assert not raised(rig)


@pytest.mark.requirement("STP-055")
def test_printed_example_of_the_step(make_rig):
    """5 mm/s of apparent velocity and T_i + T_ipo + T_servo = 8.125 ms give a step of 0.0406 mm."""
    rig = make_rig(variables={"StandstillSignal.VelocityThreshold": 6.0})
    rig.axis.object.servo.delay_s = 0.000125 + 0.004 + 0.004
    # 0.02 mm in a cycle of 4 ms; 131072 increments are 10 mm.
    noisy(rig, round(0.01 * 13107.2))
    rig.run(0.1)
    rig.axis.power()
    rig.until(lambda: rig.axis.object.state is S.STANDSTILL)
    step = rig.column("position_setpoint")[-1] - rig.column("actual_position")[-1]
    assert abs(step) == pytest.approx(0.0406, abs=0.0002)
