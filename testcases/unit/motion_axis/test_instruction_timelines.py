"""The timelines of the instructions, with their printed numbers (section 2 of the instruction
specification).
"""

from __future__ import annotations

import pytest

from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import AxisState

CYCLE = 0.004
TWO_CYCLES = 2.5 * CYCLE


class Clock:
    """Runs a rig to times that count from a start."""

    def __init__(self, rig) -> None:
        self.rig = rig
        self.zero = rig.scheduler.now

    @property
    def now(self) -> float:
        return (self.rig.scheduler.now - self.zero) * 1e-9

    def to(self, seconds: float) -> None:
        self.rig.scheduler.run_for(self.zero + round(seconds * 1e9) - self.rig.scheduler.now)

    def until(self, predicate, timeout: float = 60.0) -> float:
        self.rig.until(predicate, timeout)
        return self.now


def velocity(rig):
    return rig.column("velocity_setpoint")[-1]


def standing(rig):
    return lambda: velocity(rig) == 0.0


def bits(rig, *numbers):
    return [rig.axis.var("StatusWord") >> number & 1 for number in numbers]


# -- MC_Power
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-164", "MC-165", "MC-166", "MC-142", "MC-019", "MC-138")
def test_enabling_and_first_job(rig):
    """Busy at once, Status when the drive is in operation and not before, then motion jobs."""
    power = rig.axis.power()
    rig.cycles(1)
    assert power.Busy
    assert not power.Status
    while not power.Status:
        assert not rig.axis.var("StatusDrive.InOperation")
        rig.cycles(1)
    assert rig.axis.var("StatusDrive.InOperation")
    assert bits(rig, 0) == [1]
    assert power.Busy
    job = rig.axis.move_velocity(100.0)
    rig.cycles(2)
    assert job.Busy
    rig.until(job.in_velocity)


@pytest.mark.requirement("MC-167", "MC-168", "MC-169", "MC-120", "MC-157", "MC-125", "MC-071", "MC-002")
def test_alarm_that_removes_the_enable(rig):
    """16#8001 at the job and at MC_Power, Status falls, Enable and Busy stay; acknowledged the axis comes
    back, the job does not.
    """
    rig.travelling(200.0)
    power = rig.axis.power_instance
    rig.axis.object.alarms.set_cause(421, True)
    rig.cycles(3)
    assert (rig.job.Busy, rig.job.InVelocity, rig.job.Error, rig.job.ErrorID) == (False, False, True, 0x8001)
    rig.until(lambda: not power.Status)
    assert power.Busy
    assert (power.Error, power.ErrorID) == (True, 0x8001)
    rig.run(1.5)
    rig.axis.object.alarms.set_cause(421, False)
    rig.until(rig.axis.reset().done)
    rig.until(power.status)
    rig.cycles(2)
    assert not power.Error
    assert velocity(rig) == 0.0
    assert not rig.job.Busy
    rig.axis.power(False)
    rig.until(power.off)
    assert (power.Status, power.Busy) == (False, False)


@pytest.mark.requirement("MC-148", "MC-150", "MC-152", "MC-163")
@pytest.mark.parametrize("stop_mode", [0, 1, 2, 3])
def test_status_and_busy_while_disabling(rig, stop_mode):
    """Every job gets CommandAborted; Busy holds until the drive is off, and then both are FALSE."""
    rig.travelling(300.0)
    waiting = rig.axis.move_relative(10.0, BufferMode=1)
    rig.cycles(2)
    power = rig.axis.power(False, stop_mode=stop_mode)
    rig.cycles(2)
    assert rig.job.CommandAborted
    assert waiting.CommandAborted
    while power.Status:
        assert power.Busy
        rig.cycles(1)
    if stop_mode in (0, 2):
        assert velocity(rig) == 0.0
    rig.until(power.off)
    assert not rig.axis.var("StatusDrive.InOperation")


@pytest.mark.requirement("MC-161", "MC-162")
def test_power_is_aborted_by_nothing_and_enabling_aborts_nothing(rig):
    """A second call with Enable TRUE leaves the running motion alone; motion jobs leave MC_Power alone."""
    rig.travelling(100.0)
    rig.axis.power(True)
    rig.cycles(3)
    assert rig.job.InVelocity
    rig.axis.stop(0)
    rig.cycles(3)
    assert rig.axis.power_instance.Busy
    assert rig.axis.power_instance.Status


@pytest.mark.requirement("MC-144", "MC-097")
@pytest.mark.parametrize("start_mode", [0, 1])
def test_enabling_at_standstill(rig, start_mode):
    """With position control the position is held; without, a speed setpoint of 0 is given."""
    rig.enabled(start_mode=start_mode)
    rig.run(0.2)
    assert rig.column("speed_output")[-1] == 0.0
    assert bits(rig, 28) == [1 - start_mode]


# -- MC_Reset
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-178", "MC-176", "MC-020")
def test_acknowledging_clears_everything_that_can_be(rig):
    """Alarms and warnings, words and ErrorDetail are 0 with Done."""
    rig.enabled()
    for number in (321, 501, 541):
        rig.axis.object.alarms.raise_alarm(number)
    rig.cycles(2)
    assert rig.axis.var("ErrorWord")
    assert rig.axis.var("WarningWord")
    rig.run(1.0)
    rig.until(rig.axis.reset().done)
    assert [
        rig.axis.var(name)
        for name in ("ErrorWord", "WarningWord", "ErrorDetail.Number", "ErrorDetail.Reaction")
    ] == [0] * 4
    assert bits(rig, 1) == [0]


@pytest.mark.requirement("MC-180")
def test_a_fatal_alarm_needs_a_restart(rig):
    """Acknowledging leaves it; Restart clears it."""
    rig.enabled()
    rig.axis.object.alarms.raise_alarm(105)
    rig.run(2.0)
    rig.axis.reset()
    rig.run(0.2)
    assert rig.axis.var("ErrorDetail.Number") == 105
    rig.axis.power(False)
    rig.run(0.5)
    rig.until(rig.axis.reset(restart=True).done)
    assert rig.axis.var("ErrorDetail.Number") == 0


@pytest.mark.requirement("MC-183")
def test_a_drive_fault_without_alarm_is_acknowledged_too(rig):
    """STW1 bit 7 gets a rising edge, and the drive drops its fault."""
    rig.run(0.1)
    rig.port.fault = True
    rig.cycles(2)
    rig.port.fault = False
    assert rig.port.fault_latched
    rig.axis.reset()
    rig.run(0.2)
    assert not rig.port.fault_latched


@pytest.mark.requirement("MC-185", "OVR-104")
@pytest.mark.parametrize("restart", [False, True])
def test_what_a_reset_aborts(rig, restart):
    """Acknowledging aborts no job; a restart, which needs a disabled axis, is refused while jobs run
    (16#800E).
    """
    rig.travelling(100.0)
    reset = rig.axis.reset(restart=restart)
    rig.run(0.1)
    assert rig.job.InVelocity
    assert reset.ErrorID == (0x800E if restart else 0)


# -- MC_Halt
# ------------------------------------------------------------------------------------------------------------

HALT = {"DynamicDefaults.Deceleration": 100.0}


@pytest.mark.requirement("MC-236", "MC-237", "MC-238", "MC-096", "MC-095", "MC-022", "MC-227")
def test_halt_reduces_the_acceleration_first(rig):
    """Acceleration 100 at velocity 50: velocity rises by 25 in 0.5 s, standstill 1.75 s after the edge,
    Done.
    """
    rig.enabled()
    clock = Clock(rig)
    first = rig.axis.move_velocity(100.0, Acceleration=100.0, Jerk=200.0)
    clock.to(0.75)
    edge = clock.now
    halt = rig.axis.halt(Deceleration=100.0, Jerk=200.0)
    rig.cycles(2)
    assert (first.CommandAborted, first.Busy, halt.Busy) == (True, False, True)
    stopped = clock.until(standing(rig))
    assert max(rig.column("velocity_setpoint")) == pytest.approx(75.0, abs=1.0)
    assert stopped - edge == pytest.approx(1.75, abs=TWO_CYCLES)
    rig.until(halt.done)
    assert not halt.Busy


@pytest.mark.requirement("MC-239", "MC-227")
def test_halt_with_abort_acceleration(rig):
    """The acceleration ends at once: never above 50, standstill 1.0 s after the edge."""
    rig.enabled()
    clock = Clock(rig)
    rig.axis.move_velocity(100.0, Acceleration=100.0, Jerk=200.0)
    clock.to(0.75)
    edge = clock.now
    reached = velocity(rig)
    halt = rig.axis.halt(Deceleration=100.0, Jerk=200.0, AbortAcceleration=True)
    stopped = clock.until(standing(rig))
    assert max(rig.column("velocity_setpoint")) <= reached + 100.0 * TWO_CYCLES
    assert stopped - edge == pytest.approx(1.0, abs=0.02)
    rig.until(halt.done)


@pytest.mark.requirement("MC-234", "MC-240", "MC-241", "MC-242", "MC-228")
def test_halt_mode_1_stops_the_basic_motion(rig):
    """150 in total, then 50: Done although the axis still moves; the superimposed motion ends by itself."""
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    basic = rig.axis.move_absolute(1000.0, Velocity=100.0)
    top = rig.axis.move_superimposed(200.0, VelocityDiff=50.0)
    rig.run(1.0)
    assert velocity(rig) == pytest.approx(150.0)
    halt = rig.axis.halt(Mode=1)
    rig.cycles(2)
    assert basic.CommandAborted
    assert top.Busy
    rig.until(halt.done)
    assert velocity(rig) == pytest.approx(50.0)
    rig.until(top.done)


@pytest.mark.requirement("MC-234", "MC-243", "MC-228")
def test_halt_mode_0_stops_the_whole_motion(rig):
    """Both are aborted, and the deceleration of 100 acts on all of the 150: 1.5 s."""
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    basic = rig.axis.move_absolute(1000.0, Velocity=100.0)
    top = rig.axis.move_superimposed(400.0, VelocityDiff=50.0)
    rig.run(1.0)
    clock = Clock(rig)
    halt = rig.axis.halt(Mode=0, Deceleration=100.0, Jerk=0.0)
    rig.cycles(2)
    assert basic.CommandAborted
    assert top.CommandAborted
    assert clock.until(standing(rig)) == pytest.approx(1.5, abs=TWO_CYCLES)
    rig.until(halt.done)


@pytest.mark.requirement("MC-232")
def test_halt_at_standstill(rig):
    """Done without motion."""
    rig.enabled()
    rig.run(0.2)
    halt = rig.axis.halt()
    rig.until(halt.done, 0.1)
    assert set(rig.column("velocity_setpoint")) == {0.0}


@pytest.mark.requirement("MC-233", "MC-101", "MC-412")
@pytest.mark.parametrize("controlled", [False, True])
@pytest.mark.parametrize("kind", ["halt", "stop"])
def test_halt_and_stop_leave_position_control_as_it_is(rig, kind, controlled):
    """X28 is the same before, during and after."""
    rig.enabled()
    job = rig.axis.move_velocity(100.0, PositionControlled=controlled)
    rig.until(job.in_velocity)
    stop = rig.axis.halt() if kind == "halt" else rig.axis.stop(3)
    rig.cycles(3)
    assert bits(rig, 28) == [1 - controlled]
    rig.until(stop.done)
    assert bits(rig, 28) == [1 - controlled]


@pytest.mark.requirement("MC-231", "MC-222")
def test_halt_runs_the_positioning_monitoring(make_rig, monkeypatch):
    """A window that the axis cannot reach gives alarm 541, as after positioning; on a disabled axis the halt
    is refused.
    """
    rig = make_rig(variables={"PositioningMonitoring.ToleranceTime": 0.1})
    refused = rig.axis.halt()
    rig.cycles(1)
    assert refused.ErrorID == 0x800F
    rig.travelling(100.0)
    rig.axis.write("PositioningMonitoring.Window", 0.001)
    plain = SimulatedDrivePort.write

    def with_offset(port, stw1, speed, torque=0.0):
        plain(port, stw1, speed + 60.0, torque)

    monkeypatch.setattr(SimulatedDrivePort, "write", with_offset)
    rig.axis.halt()
    rig.run(2.0)
    assert 541 in [event.data["number"] for event in rig.events("alarm.raised")]


# -- MC_MoveAbsolute, MC_MoveRelative
# -----------------------------------------------------------------------------------------

SLOW = {"Acceleration": 50.0, "Deceleration": 50.0, "Jerk": 0.0}


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-223", "MC-269", "MC-270", "MC-258", "MC-023")
def test_absolute_positioning_overridden(rig):
    """At 225 of 1000 with 50 a second job to 1500 with 30 takes over without a stop, and arrives 42.67 s
    later.
    """
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    clock = Clock(rig)
    first = rig.axis.move_absolute(1000.0, Velocity=50.0, **SLOW)
    clock.until(lambda: rig.axis.var("Position") >= 225.0)
    assert clock.now == pytest.approx(5.0, abs=TWO_CYCLES)
    assert first.Active
    edge = clock.now
    second = rig.axis.move_absolute(1500.0, Velocity=30.0, **SLOW)
    rig.cycles(1)
    assert second.Active
    rig.cycles(1)
    assert (first.CommandAborted, first.Active) == (True, False)
    slowed = clock.until(lambda: velocity(rig) <= 30.0 + 1e-9)
    assert slowed - edge == pytest.approx(0.4, abs=TWO_CYCLES)
    arrived = clock.until(lambda: rig.axis.var("Position") == 1500.0)
    assert arrived - edge == pytest.approx(42.67, abs=0.02)
    rig.until(second.done)
    assert not first.Done


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "STP-225", "STP-222", "MC-271", "MC-272", "MC-273", "MC-264", "MC-053", "MC-054", "MC-060"
)
def test_absolute_positioning_appended(rig):
    """The second job waits, Busy and not Active, until the first is Done at 21.0 s; it needs 17.27 s."""
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    clock = Clock(rig)
    first = rig.axis.move_absolute(1000.0, Velocity=50.0, **SLOW)
    rig.run(2.0)
    second = rig.axis.move_absolute(1500.0, Velocity=30.0, BufferMode=1, **SLOW)
    rig.cycles(2)
    assert (second.Busy, second.Active, first.Active) == (True, False, True)
    at_target = clock.until(lambda: rig.axis.var("Position") == 1000.0)
    assert at_target == pytest.approx(21.0, abs=TWO_CYCLES)
    started = clock.until(first.done)
    assert started - at_target == pytest.approx(0.01, abs=4 * CYCLE)
    rig.cycles(1)
    assert second.Active
    assert clock.until(lambda: rig.axis.var("Position") == 1500.0) - started == pytest.approx(17.27, abs=0.02)
    rig.until(second.done)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-286", "MC-287", "MC-284", "MC-024")
def test_relative_positioning_overridden(rig):
    """500 counts from the 225 at which the job takes over: 725."""
    rig.enabled()
    first = rig.axis.move_relative(1000.0, Velocity=50.0, **SLOW)
    rig.until(lambda: rig.axis.var("Position") >= 225.0, 10.0)
    here = rig.axis.var("Position")
    second = rig.axis.move_relative(500.0, Velocity=30.0, **SLOW)
    rig.until(second.done, 60.0)
    assert first.CommandAborted
    assert rig.axis.var("Position") == pytest.approx(here + 500.0, abs=50.0 * TWO_CYCLES)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-220", "MC-288", "MC-289", "MC-290", "MC-285")
def test_relative_positioning_appended(rig):
    """1000 and then 500 more: 1500."""
    rig.enabled()
    first = rig.axis.move_relative(1000.0, Velocity=50.0, **SLOW)
    rig.run(1.0)
    second = rig.axis.move_relative(500.0, Velocity=30.0, BufferMode=1, **SLOW)
    rig.cycles(2)
    assert (second.Busy, second.Active) == (True, False)
    rig.until(first.done, 60.0)
    assert rig.axis.var("Position") == pytest.approx(1000.0)
    rig.until(second.done, 60.0)
    assert rig.axis.var("Position") == pytest.approx(1500.0, abs=1e-6)


@pytest.mark.requirement("MC-262")
def test_target_that_is_reached_already(rig):
    """No motion, Done after the dwell time."""
    rig.enabled()
    rig.until(rig.axis.home(10.0).done)
    job = rig.axis.move_absolute(10.0)
    rig.until(job.done, 0.5)
    assert set(rig.column("velocity_setpoint")) == {0.0}


@pytest.mark.requirement("MC-260", "MC-100", "MC-285")
@pytest.mark.parametrize("kind", ["absolute", "relative", "superimposed"])
def test_positioning_forces_position_control(rig, kind):
    """Started without position control, it is on and stays on."""
    rig.until(rig.axis.home(0.0).done)
    rig.enabled(start_mode=0)
    assert bits(rig, 28) == [1]
    job = {
        "absolute": lambda: rig.axis.move_absolute(20.0),
        "relative": lambda: rig.axis.move_relative(20.0),
        "superimposed": lambda: rig.axis.move_superimposed(20.0),
    }[kind]()
    rig.cycles(2)
    assert bits(rig, 28) == [0]
    rig.until(job.done)
    assert bits(rig, 28) == [0]


@pytest.mark.requirement("MC-266")
def test_appended_job_without_predecessor_starts_at_once(rig):
    """BufferMode 1 on an axis at rest is active with its first call."""
    rig.enabled()
    job = rig.axis.move_relative(20.0, BufferMode=1)
    rig.cycles(1)
    assert job.Active


@pytest.mark.requirement("STP-226", "MC-267")
@pytest.mark.parametrize("active", ["velocity", "jog", "halt"])
def test_appended_job_waits_for_what_runs(rig, active):
    """It waits until the active job ends by itself, and is aborted with it by a job that overrides."""
    rig.enabled()
    rig.axis.move_velocity(100.0)
    rig.run(0.3)
    running = {
        "velocity": lambda: rig.axis.move_velocity(50.0),
        "jog": lambda: rig.axis.jog(50.0),
        "halt": lambda: rig.axis.halt(Deceleration=50.0, Jerk=0.0),
    }[active]()
    rig.cycles(2)
    waiting = rig.axis.move_relative(20.0, BufferMode=1)
    rig.run(0.2)
    assert (waiting.Busy, waiting.Active) == (True, False)
    if active == "velocity":
        rig.axis.move_velocity(10.0)
        rig.cycles(2)
        assert waiting.CommandAborted
        return
    if active == "jog":
        running.set(JogForward=False)
    rig.until(lambda: waiting.Active)
    rig.until(waiting.done)


# -- MC_MoveVelocity
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "STP-213",
    "STP-214",
    "MC-308",
    "MC-309",
    "MC-310",
    "MC-311",
    "MC-312",
    "MC-313",
    "MC-314",
    "MC-303",
    "MC-025",
)
def test_two_velocities(rig):
    """50 and 15 take turns; InVelocity belongs to the job that has reached its velocity, and only to that."""
    rig.enabled()
    clock = Clock(rig)
    one = rig.axis.move_velocity(50.0, **SLOW)
    reached = clock.until(one.in_velocity)
    assert reached == pytest.approx(1.0, abs=TWO_CYCLES)
    clock.to(2.0)
    one.set(Execute=False)
    two = rig.axis.move_velocity(15.0, **SLOW)
    rig.cycles(1)
    assert two.Busy
    assert clock.until(two.in_velocity) == pytest.approx(2.7, abs=TWO_CYCLES)
    assert (one.InVelocity, one.Busy) == (False, False)
    clock.to(4.0)
    again = rig.axis.move_velocity(50.0, **SLOW)
    rig.cycles(2)
    assert (two.CommandAborted, two.InVelocity) == (True, False)
    clock.to(4.4)
    assert velocity(rig) == pytest.approx(35.0, abs=1.0)
    assert not again.InVelocity
    last = rig.axis.move_velocity(15.0, **SLOW)
    assert clock.until(last.in_velocity) == pytest.approx(4.8, abs=2 * TWO_CYCLES)
    assert again.CommandAborted
    assert velocity(rig) == pytest.approx(15.0)
    last.set(Execute=False)
    rig.run(1.0)
    assert last.Busy
    assert last.InVelocity
    assert not last.Done


# -- MC_MoveJog
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "STP-231",
    "MC-334",
    "MC-335",
    "MC-336",
    "MC-337",
    "MC-338",
    "MC-339",
    "MC-340",
    "MC-026",
    "MC-317",
    "MC-318",
)
def test_jogging(rig):
    """The printed sequence: backward, rest, forward, faster, both inputs, none, forward again without a
    stop.
    """
    rig.enabled()
    clock = Clock(rig)
    jog = rig.axis.jog(50.0, backward=True, Acceleration=50.0, Deceleration=50.0, Jerk=0.0)
    assert clock.until(jog.in_velocity) == pytest.approx(1.0, abs=TWO_CYCLES)
    assert velocity(rig) == pytest.approx(-50.0)
    clock.to(2.0)
    jog.set(JogBackward=False)
    rig.cycles(2)
    assert not jog.InVelocity
    assert clock.until(lambda: not jog.Busy) == pytest.approx(3.0, abs=0.05)
    clock.to(4.0)
    jog.set(JogForward=True)
    assert clock.until(jog.in_velocity) == pytest.approx(5.0, abs=TWO_CYCLES)
    assert velocity(rig) == pytest.approx(50.0)
    clock.to(6.0)
    jog.set(Velocity=100.0)
    rig.cycles(2)
    assert not jog.InVelocity
    assert clock.until(jog.in_velocity) == pytest.approx(7.0, abs=TWO_CYCLES)
    clock.to(8.0)
    jog.set(JogBackward=True)
    rig.cycles(2)
    assert (jog.InVelocity, jog.Busy, jog.Error, jog.ErrorID) == (False, False, True, 0x8007)
    clock.to(8.4)
    jog.set(JogForward=False, JogBackward=False)
    rig.cycles(2)
    assert not jog.Error
    clock.to(8.8)
    assert velocity(rig) == pytest.approx(60.0, abs=1.0)
    jog.set(JogForward=True)
    assert clock.until(jog.in_velocity) == pytest.approx(9.6, abs=2 * TWO_CYCLES)
    assert min(rig.column("velocity_setpoint")[-300:]) > 50.0


@pytest.mark.requirement("MC-331")
def test_changing_the_jog_direction_goes_through_zero(rig):
    """The other input in the same call: braking, zero, and on in the other direction, without an error."""
    rig.enabled()
    jog = rig.axis.jog(50.0)
    rig.until(jog.in_velocity)
    jog.set(JogForward=False, JogBackward=True)
    rig.cycles(2)
    rig.until(jog.in_velocity)
    assert velocity(rig) == pytest.approx(-50.0)
    assert not jog.Error


@pytest.mark.requirement("STP-229", "MC-332")
def test_jogging_with_velocity_zero(rig):
    """The axis brakes to zero: InVelocity, X12 and X7."""
    rig.enabled()
    jog = rig.axis.jog(50.0)
    rig.until(jog.in_velocity)
    jog.set(Velocity=0.0)
    rig.cycles(2)
    rig.until(jog.in_velocity)
    rig.run(0.2)
    assert bits(rig, 12, 7) == [1, 1]
    assert jog.Busy


# -- MC_Stop
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "MC-424",
    "MC-425",
    "MC-426",
    "MC-427",
    "MC-428",
    "MC-429",
    "MC-404",
    "MC-406",
    "MC-407",
    "MC-030",
    "MC-115",
    "MC-010",
    "MC-409",
    "MC-410",
)
def test_stop_and_its_lock(rig):
    """Abort of what runs, Busy while braking, Done held; jobs are refused until Execute falls, and then need
    a new edge.
    """
    rig.travelling(200.0)
    stop = rig.axis.stop(3)
    rig.cycles(2)
    assert rig.job.CommandAborted
    assert (stop.Busy, stop.Done) == (True, False)
    assert rig.axis.var("StatusWord2") & 1
    rig.until(stop.done)
    assert not stop.Busy
    rig.run(0.2)
    assert stop.Done
    assert rig.axis.var("StatusWord2") & 1
    job = rig.axis.move_velocity(50.0)
    rig.cycles(2)
    assert (job.Error, job.ErrorID) == (True, 0x800F)
    assert stop.Done
    stop.set(Execute=False)
    rig.cycles(2)
    assert not stop.Done
    assert not rig.axis.var("StatusWord2") & 1
    rig.run(0.1)
    assert velocity(rig) == 0.0
    job.set(Execute=False)
    rig.cycles(2)
    job.set(Execute=True)
    rig.until(job.in_velocity)


@pytest.mark.requirement("MC-405", "MC-408")
def test_stop_without_execute(rig):
    """A falling edge while braking cancels nothing: jobs stay refused, Done shows for one call, then the axis
    is free.
    """
    rig.travelling(200.0)
    stop = rig.axis.stop(3)
    rig.cycles(2)
    stop.set(Execute=False)
    rig.cycles(2)
    assert stop.Busy
    job = rig.axis.move_velocity(50.0)
    rig.cycles(1)
    assert job.ErrorID == 0x800F
    shown = 0
    while stop.Busy or shown == 0 or stop.Done:
        rig.cycles(1)
        shown += stop.Done
        assert shown <= 1
    assert not rig.axis.var("StatusWord2") & 1
    free = rig.axis.move_velocity(50.0)
    rig.until(free.in_velocity)


@pytest.mark.requirement("MC-393")
def test_stop_needs_an_enabled_axis(rig):
    """16#800F on a disabled one."""
    stop = rig.axis.stop(0)
    rig.cycles(1)
    assert stop.ErrorID == 0x800F
    assert rig.axis.state is AxisState.DISABLED
