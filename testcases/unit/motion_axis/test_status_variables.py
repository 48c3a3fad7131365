"""What the status words and status structures of an axis show, while it does what they speak of."""

from __future__ import annotations

import pytest

from motion.s7.instructions import MC_Power
from testcases.unit.motion_axis.conftest import TorquePort


def on(rig, bit, word="StatusWord"):
    return rig.axis.var(f"{word}.X{bit}")


class TestStatusWord:
    """Each bit in a situation in which it is TRUE, and in one in which it is not."""

    @pytest.mark.requirement("VAR-028", "VAR-102")
    def test_enable(self, rig):
        """X0 and `MC_Power.Status` follow the drive's operation."""
        power = rig.axis.power()
        while not power.Status:
            assert not on(rig, 0)
            rig.cycles(1)
        assert (on(rig, 0), rig.axis.var("StatusDrive.InOperation")) == (True, True)

    @pytest.mark.requirement("VAR-030", "VAR-031")
    def test_restart(self, rig):
        """X3 shows changed start values, X2 the restart that takes them."""
        rig.cycles(2)
        assert (on(rig, 2), on(rig, 3)) == (False, False)
        rig.axis.variables.write_start("Mechanics.LeadScrew", 5.0)
        assert on(rig, 3)
        reset = rig.axis.reset(restart=True)
        rig.cycles(2)
        assert on(rig, 2)
        rig.until(reset.done)
        assert (on(rig, 2), on(rig, 3)) == (False, False)

    @pytest.mark.requirement("VAR-034", "VAR-036", "VAR-113")
    def test_positioning(self, rig):
        """X8 while a positioning runs, X6 when it has ended in the window; target and distance are valid
        meanwhile.
        """
        rig.enabled()
        assert on(rig, 6)
        job = rig.axis.move_relative(50.0)
        rig.cycles(10)
        assert (on(rig, 6), on(rig, 8)) == (False, True)
        assert rig.axis.var("StatusPositioning.TargetPosition") == pytest.approx(50.0)
        left = rig.axis.var("StatusPositioning.Distance")
        assert left == pytest.approx(50.0 - rig.axis.var("Position"))
        rig.until(job.done)
        assert (on(rig, 6), on(rig, 8)) == (True, False)

    @pytest.mark.requirement("VAR-037", "VAR-038")
    def test_jog_and_velocity(self, rig):
        """X9 while a jog runs, X10 while a velocity job does."""
        rig.enabled()
        jog = rig.axis.jog(20.0)
        rig.cycles(20)
        assert (on(rig, 9), on(rig, 10)) == (True, False)
        jog.set(JogForward=False)
        rig.run(1.0)
        assert not on(rig, 9)
        rig.axis.move_velocity(20.0)
        rig.cycles(20)
        assert (on(rig, 9), on(rig, 10)) == (False, True)

    @pytest.mark.requirement("VAR-033")
    def test_homing_done(self, rig):
        """X5 from the homing on."""
        rig.cycles(2)
        assert not on(rig, 5)
        rig.until(rig.axis.home(3.0).done)
        assert on(rig, 5)

    @pytest.mark.requirement("VAR-035", "VAR-177")
    def test_standstill(self, rig):
        """X7 when the velocity has been below its threshold for the dwell time."""
        rig.enabled()
        rig.run(0.1)
        assert on(rig, 7)
        rig.axis.move_velocity(50.0)
        rig.run(0.5)
        assert not on(rig, 7)

    @pytest.mark.requirement("VAR-040", "VAR-041", "VAR-042", "VAR-055")
    def test_phases(self, rig):
        """From standstill to a velocity and back X12, X13, X12, X14, X12, never two of them."""
        rig.enabled()
        seen = []

        def look():
            bits = [bit for bit in (12, 13, 14) if on(rig, bit)]
            assert len(bits) == 1
            if not seen or seen[-1] != bits[0]:
                seen.append(bits[0])

        rig.runtime.after_cycle.append(look)
        job = rig.axis.move_velocity(100.0)
        rig.until(job.in_velocity)
        rig.run(0.1)
        rig.until(rig.axis.halt().done)
        assert seen == [12, 13, 12, 14, 12]

    @pytest.mark.requirement("VAR-043", "VAR-044")
    @pytest.mark.parametrize(("velocity", "bit"), [(-100.0, 15), (100.0, 16)])
    def test_software_limits(self, make_rig, velocity, bit):
        """X15 and X16 at the negative and positive software limit switch."""
        rig = make_rig(
            variables={
                "PositionLimits_SW.Active": True,
                "PositionLimits_SW.MinPosition": -50.0,
                "PositionLimits_SW.MaxPosition": 50.0,
            }
        ).enabled()
        rig.axis.home(0.0)
        rig.cycles(2)
        assert (on(rig, 15), on(rig, 16)) == (False, False)
        rig.axis.move_velocity(velocity)
        rig.run(3.0)
        assert (on(rig, 15), on(rig, 16)) == (bit == 15, bit == 16)

    @pytest.mark.requirement("VAR-045", "VAR-046", "VAR-058")
    @pytest.mark.parametrize(("switch", "bit"), [(1, 17), (2, 18)])
    def test_hardware_limits(self, make_rig, switch, bit):
        """X17 and X18 follow the switches that cannot be passed."""
        rig = make_rig(variables={"PositionLimits_HW.Active": True}).enabled()
        rig.port.switches = switch
        rig.cycles(2)
        assert (on(rig, 17), on(rig, 18)) == (bit == 17, bit == 18)
        rig.port.switches = 0
        rig.cycles(2)
        assert (on(rig, 17), on(rig, 18)) == (False, False)

    @pytest.mark.requirement("VAR-051")
    def test_non_position_controlled(self, rig):
        """X28 while a velocity job runs without position control."""
        rig.enabled()
        assert not on(rig, 28)
        rig.axis.move_velocity(20.0, PositionControlled=False)
        rig.cycles(5)
        assert on(rig, 28)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("VAR-061")
    def test_stop_command(self, rig):
        """`StatusWord2.X0` while `MC_Stop` holds the axis."""
        rig.travelling(100.0)
        assert not on(rig, 0, "StatusWord2")
        stop = rig.axis.stop()
        rig.run(1.0)
        assert on(rig, 0, "StatusWord2")
        stop.set(Execute=False)
        rig.cycles(3)
        assert not on(rig, 0, "StatusWord2")

    @pytest.mark.requirement("VAR-231")
    def test_one_word_of_one_state(self, rig):
        """A copy of the word agrees with its bits."""
        rig.travelling(100.0)
        word = rig.axis.var("StatusWord")
        assert [bool(word >> bit & 1) for bit in range(32)] == [on(rig, bit) for bit in range(32)]


class TestReactions:
    """`ErrorDetail.Reaction` and what it does."""

    @pytest.mark.requirement("VAR-091", "VAR-092", "VAR-093", "VAR-094", "VAR-096")
    @pytest.mark.parametrize(
        ("number", "reaction", "deceleration"),
        [(110, 0, None), (533, 1, 1000.0), (104, 2, 2000.0), (321, 3, 4000.0), (550, 5, None)],
    )
    def test_effect(self, rig, number, reaction, deceleration):
        """0 nothing; 1 the deceleration of the job, 2 the largest, 3 the emergency ramp; 5 puts zero out and
        follows the drive.
        """
        rig.travelling(300.0)
        rig.axis.alarms.raise_alarm(number, reaction=reaction if number == 533 else None)
        shown = 0 if number == 110 else reaction
        assert rig.axis.var("ErrorDetail.Reaction") == shown
        if reaction == 0:
            rig.run(0.5)
            assert rig.axis.var("ActualVelocity") == pytest.approx(300.0, abs=0.1)
            return
        if reaction == 5:
            rig.cycles(2)
            assert rig.axis.var("VelocitySetpoint") == 0.0
            assert rig.axis.var("Velocity") == rig.axis.var("ActualVelocity") > 100.0
            assert rig.axis.var("Position") == pytest.approx(rig.axis.var("ActualPosition"))
            return
        slopes = []
        for _ in range(200):
            before = rig.axis.var("Velocity")
            rig.cycles(1)
            slopes.append((before - rig.axis.var("Velocity")) / 0.004)
        assert max(slopes) == pytest.approx(deceleration, rel=0.01)
        assert rig.axis.var("Velocity") == 0.0

    @pytest.mark.requirement("VAR-098")
    @pytest.mark.parametrize(("number", "reaction"), [(533, 1), (104, 2), (321, 3), (421, 4)])
    def test_power_stays_busy(self, rig, number, reaction):
        """Jobs end with an error, `MC_Power.StopMode` does not matter, and `MC_Power.Busy` stays TRUE."""
        rig.travelling(300.0)
        power = rig.axis.power(stop_mode=3)
        rig.axis.alarms.raise_alarm(number, reaction=reaction if number == 533 else None)
        rig.cycles(2)
        assert rig.job.ErrorID == 0x8001
        for _ in range(100):
            rig.cycles(1)
            assert power.Busy is True

    @pytest.mark.requirement("VAR-101")
    @pytest.mark.parametrize(("number", "enabled"), [(533, True), (104, False), (321, False)])
    def test_enabled_at_standstill(self, rig, number, enabled):
        """Reactions 1 to 3 disable the object at standstill; 533 keeps it enabled."""
        rig.travelling(100.0)
        rig.axis.alarms.raise_alarm(number, reaction=2 if number == 533 else None)
        rig.run(2.0)
        assert on(rig, 0) is enabled


class TestDrive:
    """`StatusDrive`, `StatusSensor`."""

    @pytest.mark.requirement("VAR-103", "CFG-244")
    def test_communication_ok(self, rig):
        """Cyclic data without a drive fault: a fault takes it away, and so does a lost link."""
        rig.run(0.1)
        assert rig.axis.var("StatusDrive.CommunicationOK") is True
        rig.port.fault = True
        rig.cycles(2)
        assert rig.axis.var("StatusDrive.CommunicationOK") is False
        rig.port.fault = False
        rig.until(rig.axis.reset().done)
        rig.cycles(3)
        assert rig.axis.var("StatusDrive.CommunicationOK") is True
        rig.port.link = False
        rig.cycles(2)
        assert rig.axis.var("StatusDrive.CommunicationOK") is False

    @pytest.mark.requirement("VAR-105")
    def test_error(self, rig):
        """A drive error on a disabled axis is shown; on an enabled one alarm 421 with reaction 4 comes with
        it.
        """
        rig.run(0.1)
        rig.port.fault = True
        rig.cycles(3)
        assert (rig.axis.var("StatusDrive.Error"), rig.axis.var("ErrorDetail.Number")) == (True, 0)
        rig.port.fault = False
        rig.until(rig.axis.reset().done)
        rig.enabled()
        rig.port.fault = True
        rig.cycles(3)
        assert rig.axis.var("StatusDrive.Error") is True
        assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (421, 4)
        assert rig.axis.var("ErrorWord.X4") is True

    @pytest.mark.requirement("VAR-107")
    def test_state_of_the_sensor(self, rig):
        """0 without a valid value, 2 with one; `MC_Power` waits for it and `MC_Home` needs it."""
        rig.cycles(2)
        rig.port.link = False
        power = rig.axis.power()
        rig.run(0.1)
        assert (rig.axis.var("StatusSensor[1].State"), power.Status) == (0, False)
        home = rig.axis.home(1.0)
        rig.cycles(2)
        assert home.ErrorID == 0x8016
        rig.port.link = True
        rig.run(0.2)
        assert (rig.axis.var("StatusSensor[1].State"), power.Status) == (2, True)

    @pytest.mark.requirement("VAR-123", "VAR-124")
    def test_speeds(self, make_rig):
        """`ActualSpeed` is the motor speed in rpm; `Velocity` the setpoint after the override,
        `VelocitySetpoint` what goes out.
        """
        rig = make_rig(variables={"Override.Velocity": 50.0}).enabled()
        rig.axis.move_velocity(100.0)
        rig.run(1.5)
        assert rig.axis.var("Velocity") == pytest.approx(50.0)
        assert rig.axis.var("VelocitySetpoint") == pytest.approx(50.0, abs=0.1)
        assert rig.axis.var("ActualSpeed") == pytest.approx(300.0, abs=1.0)


class TestDynamics:
    """Limits and defaults of jobs."""

    @pytest.mark.requirement("VAR-164", "VAR-165")
    @pytest.mark.parametrize(
        ("default", "value", "limit", "result", "warned"),
        [
            (200.0, -1.0, 400.0, 200.0, False),
            (200.0, -1.0, 50.0, 50.0, True),
            (200.0, 300.0, 400.0, 300.0, False),
            (200.0, 480.0, 400.0, 400.0, True),
        ],
    )
    def test_effective_velocity(self, make_rig, default, value, limit, result, warned):
        """Negative inputs take the default, values above the limit the limit, with warning 501."""
        rig = make_rig(
            variables={"DynamicDefaults.Velocity": default, "DynamicLimits.Velocity": limit}
        ).enabled()
        rig.axis.move_relative(2000.0, Velocity=value)
        rig.run(1.5)
        assert rig.axis.var("Velocity") == pytest.approx(result)
        assert rig.axis.alarms.engine.is_pending(501) is warned

    @pytest.mark.requirement("VAR-003", "VAR-004")
    def test_defaults_of_a_running_job(self, rig):
        """A default that changes while a job runs acts at the next rising edge, not before."""
        rig.enabled()
        first = rig.axis.move_relative(150.0)
        rig.run(0.5)
        rig.axis.write("DynamicDefaults.Velocity", 40.0)
        assert rig.axis.var("DynamicDefaults.Velocity") == 40.0
        rig.run(0.3)
        assert rig.axis.var("Velocity") == pytest.approx(100.0)
        rig.until(first.done)
        rig.axis.move_relative(100.0)
        rig.run(1.0)
        assert rig.axis.var("Velocity") == pytest.approx(40.0)

    @pytest.mark.requirement("VAR-169")
    def test_override(self, rig):
        """The override acts on the running job, with its acceleration; `InVelocity` drops until it is
        reached.
        """
        rig.travelling(100.0)
        rig.axis.write("Override.Velocity", 200.0)
        rig.cycles(3)
        assert rig.job.InVelocity is False
        rig.until(rig.job.in_velocity)
        assert rig.axis.var("Velocity") == pytest.approx(200.0)

    @pytest.mark.requirement("VAR-136")
    @pytest.mark.parametrize(("reaction", "bit"), [(1, 0), (3, 1), (5, 2), (7, 2)])
    def test_remove_enable_reaction(self, make_rig, reaction, bit):
        """The bit of OFF1, OFF2 or OFF3 is withdrawn from control word 1 when the enable is removed."""
        rig = make_rig(variables={"Actor.RemoveEnableReaction": reaction}).enabled()
        rig.axis.alarms.raise_alarm(421)
        rig.cycles(1)
        assert not rig.axis.stw1_sent >> bit & 1


@pytest.mark.requirement("CFG-010", "CFG-011", "VAR-073")
def test_not_homed(make_rig):
    """Without homing an absolute positioning is alarm 321 with reaction 3; jobs without a reference are
    executed.
    """
    rig = make_rig().enabled()
    for job in (rig.axis.move_relative(1.0), rig.axis.move_velocity(10.0), rig.axis.jog(10.0)):
        rig.run(0.2)
        assert job.ErrorID == 0
    job = rig.axis.move_absolute(10.0)
    rig.cycles(2)
    assert job.ErrorID == 0x8001
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (321, 3)
    assert rig.axis.var("ErrorWord.X3") is True


@pytest.mark.requirement("CFG-338", "VAR-125")
def test_source_of_the_velocity_does_not_matter_for_control(make_rig):
    """With the velocity of the telegram instead of the difference, setpoints and control differences are the
    same.
    """
    runs = []
    for mode in (0, 1):
        rig = make_rig(variables={"Sensor[1].ActualVelocityMode": mode}).enabled()
        differences = []
        rig.runtime.after_cycle.append(
            lambda rig=rig, into=differences: into.append(rig.axis.var("StatusServo.ControlDifference"))
        )
        rig.until(rig.axis.move_relative(40.0).done)
        runs.append((rig.column("velocity_setpoint"), rig.column("actual_position"), differences))
    assert runs[0] == runs[1]


@pytest.mark.requirement("CFG-165")
def test_free_bits_of_a_simulated_axis(make_rig):
    """`MC_SetAxisSTW` is refused while the axis is simulated."""
    rig = make_rig(variables={"Simulation.Mode": 1}).enabled()
    job = rig.axis.set_axis_stw(STW1=0x0100, STW1BitMask=0x0100)
    rig.cycles(3)
    assert job.Error is True


@pytest.mark.requirement("VAR-090")
def test_enabled_again_without_an_edge(rig):
    """After cause and alarm have gone the axis is enabled again, `MC_Power.Enable` held TRUE."""
    rig.enabled()
    rig.port.fault = True
    rig.run(0.5)
    assert not on(rig, 0)
    rig.port.fault = False
    rig.until(rig.axis.reset().done)
    rig.run(0.5)
    assert on(rig, 0)
    assert isinstance(rig.axis.power_instance, MC_Power)


@pytest.mark.requirement("VAR-171", "LIM-088")
@pytest.mark.parametrize(("low", "homed"), [(50.0, True), (60.0, True), (60.0, False)])
def test_software_limits_that_contradict(make_rig, low, homed):
    """A negative limit that is not below the positive one is alarm 104, reaction 2; put right, an
    acknowledgement suffices.
    """
    rig = make_rig(
        variables={
            "PositionLimits_SW.Active": True,
            "PositionLimits_SW.MinPosition": -50.0,
            "PositionLimits_SW.MaxPosition": 50.0,
        }
    ).enabled()
    if homed:
        rig.until(rig.axis.home(0.0).done)
    rig.axis.write("PositionLimits_SW.MinPosition", low)
    rig.cycles(3)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (104, 2)
    assert rig.axis.var("ErrorWord.X1") is True
    rig.run(0.5)
    rig.axis.write("PositionLimits_SW.MinPosition", -50.0)
    rig.until(rig.axis.reset().done)
    rig.run(0.5)
    assert (rig.axis.var("ErrorWord"), on(rig, 0)) == (0, True)


class TestInstructionsOfV9:
    """What technology version 9.0 has added, and what instructions make of their dynamic inputs."""

    @pytest.mark.requirement("CFG-001", "CFG-002")
    @pytest.mark.parametrize(("mode", "rest"), [(0, 0.0), (1, 30.0)])
    def test_halt(self, rig, mode, rest):
        """`MC_Halt` with Mode 0 stops basic and superimposed motion, with Mode 1 the basic motion alone."""
        rig.enabled()
        rig.axis.move_velocity(100.0)
        rig.run(1.0)
        rig.axis.move_superimposed(200.0, VelocityDiff=30.0)
        rig.run(1.0)
        assert rig.axis.var("Velocity") == pytest.approx(130.0)
        rig.axis.halt(Mode=mode)
        rig.run(1.0)
        assert rig.axis.var("Velocity") == pytest.approx(rest)

    @pytest.mark.requirement("CFG-004")
    @pytest.mark.parametrize("start", ["move_absolute", "move_relative"])
    def test_buffer_mode(self, rig, start):
        """Both positioning instructions have `BufferMode` and `Active`: an appended job waits, then it is
        active.
        """
        rig.enabled()
        rig.until(rig.axis.home(0.0).done)
        first = rig.axis.move_relative(10.0)
        second = getattr(rig.axis, start)(30.0, BufferMode=1)
        rig.cycles(5)
        assert (first.Active, second.Active, second.Busy) == (True, False, True)
        rig.until(second.done)
        assert first.done()

    @pytest.mark.requirement("VAR-166")
    def test_velocities_without_default(self, rig):
        """`MC_MoveVelocity` takes a negative velocity as direction, `MC_MoveJog` its magnitude; 0.0 stops the
        axis.
        """
        rig.enabled()
        rig.axis.move_velocity(-40.0)
        rig.run(1.0)
        assert rig.axis.var("Velocity") == pytest.approx(-40.0)
        rig.axis.move_velocity(0.0)
        rig.run(1.0)
        assert rig.axis.var("Velocity") == 0.0
        rig.axis.jog(-25.0)
        rig.run(1.0)
        assert rig.axis.var("Velocity") == pytest.approx(25.0)
        refused = rig.axis.move_velocity(10.0, Acceleration=0.0)
        rig.cycles(2)
        assert refused.ErrorID == 0x8004

    @pytest.mark.requirement("VAR-168")
    def test_without_jerk_limit(self, rig):
        """A jerk of 0 lets the acceleration begin at once, and so does the emergency ramp with any jerk."""
        rig.enabled()
        rig.axis.move_velocity(300.0, Jerk=0.0, Acceleration=500.0)
        rig.cycles(3)
        assert rig.axis.var("Acceleration") == pytest.approx(500.0)
        rig.run(1.0)
        rig.axis.stop(0)
        rig.cycles(3)
        assert rig.axis.var("Acceleration") == pytest.approx(-4000.0)

    @pytest.mark.requirement("VAR-175")
    def test_permitted_following_error(self, make_rig):
        """Up to `MinVelocity` the least value, then in proportion to the largest at the maximum velocity."""
        rig = make_rig(variables={"FollowingError.MinVelocity": 100.0})
        permitted = rig.axis.object.position.monitoring.permitted_following_error
        assert [permitted(v) for v in (0.0, 100.0, -300.0, 500.0, 800.0)] == [2.0, 2.0, 6.0, 10.0, 10.0]


@pytest.mark.requirement("CFG-600", "CFG-539")
@pytest.mark.parametrize("flag", ["Actor.InverseDirection", "Sensor[1].InverseDirection"])
def test_one_wrong_direction(make_rig, flag):
    """With one direction wrong the axis runs away as soon as it is displaced, until 521 ends it."""
    rig = make_rig(variables={flag: True}).enabled()
    rig.axis.move_relative(20.0)
    rig.until(lambda: rig.axis.var("ErrorDetail.Number") == 521)
    assert rig.axis.var("ErrorDetail.Reaction") == 4


COMMANDS = {
    "homing": ("StatusWord", 11, lambda axis: axis.home(5.0, mode=8), lambda axis, _: axis.home(mode=9)),
    "superimposed": (
        "StatusWord",
        23,
        lambda axis: axis.move_superimposed(50.0),
        lambda axis, _: axis.halt_superimposed(),
    ),
    "torque limit": (
        "StatusWord",
        26,
        lambda axis: axis.torque_limiting(1.0),
        lambda _, job: job.set(Enable=False),
    ),
    "motion in": (
        "StatusWord",
        31,
        lambda axis: axis.motion_in_velocity(20.0),
        lambda _, job: job.set(Enable=False),
    ),
    "motion in, superimposed": (
        "StatusWord2",
        6,
        lambda axis: axis.motion_in_superimposed(0.0, VelocityDiff=0.0),
        lambda _, job: job.set(Enable=False),
    ),
}


@pytest.mark.requirement("VAR-226")
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.requirement(identifier), id=name) for name, identifier in
     zip(COMMANDS, ("VAR-039", "VAR-047", "VAR-049", "VAR-054", "VAR-063"), strict=True)],
)  # fmt: skip
def test_bit_of_a_command(make_rig, name):
    """The bit is there while the instruction runs and neither before nor after; bits without a name stay 0
    all the time.
    """
    word, bit, start, end = COMMANDS[name]
    rig = make_rig(port=TorquePort()).enabled()
    axis = rig.axis
    named = {
        path: sum(1 << one for one in axis.variables.describe(path).bits)
        for path in ("StatusWord", "StatusWord2")
    }

    def shown():
        assert all(axis.var(path) & ~bits == 0 for path, bits in named.items())
        return axis.var(word) >> bit & 1

    seen = [shown()]
    job = start(axis)
    rig.run(0.1)
    seen.append(shown())
    end(axis, job)
    rig.run(1.0)
    assert [*seen, shown()] == [0, 1, 0]
