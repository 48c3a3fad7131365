"""The compatibility level S7-1200 G2: technology version V8.0, basic instructions (section 6 of the
instruction specification).
"""

from __future__ import annotations

import itertools

import pytest

import motion.s7.instructions as instructions
from fieldbus.errors import ConfigurationError
from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from motion.s7.axis import AxisState
from motion.s7.compatibility import LEVELS
from motion.s7.instructions import (
    MC_Halt,
    MC_MoveAbsolute,
    MC_MoveJog,
    MC_MoveRelative,
    MC_MoveVelocity,
    MC_Power,
)
from testcases.unit.motion_axis.conftest import Rig, TorquePort

G2 = "S7-1200 G2"
BASIC = (
    "MC_Power",
    "MC_Halt",
    "MC_Stop",
    "MC_MoveVelocity",
    "MC_MoveRelative",
    "MC_MoveAbsolute",
    "MC_MoveJog",
    "MC_SetAxisSTW",
)


def make(**changes):
    return Rig(cpu=G2, **changes)


@pytest.fixture
def rig():
    return make()


class TestDifferences:
    """What the level has not."""

    @pytest.mark.requirement("G2-001")
    @pytest.mark.parametrize("name", BASIC)
    def test_basic_instructions(self, name):
        """Every instruction of the text does its work on an enabled axis, up to its end output."""
        rig = make(port=TorquePort()) if name == "MC_SetAxisSTW" else make()
        axis = rig.enabled().axis
        if name == "MC_MoveAbsolute":
            rig.until(axis.home(0.0).done)
        if name in ("MC_Halt", "MC_Stop"):
            rig.until(axis.move_velocity(50.0).in_velocity)
        start, output = {
            "MC_Power": (axis.power, "Status"),
            "MC_Reset": (axis.reset, "Done"),
            "MC_Home": (lambda: axis.home(5.0), "Done"),
            "MC_Halt": (axis.halt, "Done"),
            "MC_Stop": (axis.stop, "Done"),
            "MC_MoveVelocity": (lambda: axis.move_velocity(50.0), "InVelocity"),
            "MC_MoveRelative": (lambda: axis.move_relative(2.0), "Done"),
            "MC_MoveAbsolute": (lambda: axis.move_absolute(2.0), "Done"),
            "MC_MoveJog": (lambda: axis.jog(50.0), "InVelocity"),
            "MC_SetAxisSTW": (lambda: axis.set_axis_stw(STW1=0x0800, STW1BitMask=0x0800), "Done"),
        }[name]
        job = start()
        assert isinstance(job, getattr(instructions, name))
        rig.until(lambda: getattr(job, output) or job.Error)
        assert not job.Error, hex(job.ErrorID)

    @pytest.mark.requirement("CFG-062")
    @pytest.mark.parametrize("name", sorted(LEVELS[G2].without))
    def test_no_instructions_of_the_technology_processor(self, rig, name):
        """They are refused with the controller that has them."""
        with pytest.raises(
            ConfigurationError, match=f"{name}: 'S7-1200 G2' is not allowed; allowed: cpu S7-1500T"
        ):
            getattr(instructions, name)(rig.axis.object)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("G2-049", "MC-015", "MC-017", "CFG-005")
    @pytest.mark.parametrize(
        ("name", "key"),
        [("MC_Halt", "Mode"), ("MC_MoveAbsolute", "BufferMode"), ("MC_MoveRelative", "BufferMode")],
    )
    def test_no_inputs_of_v9(self, rig, name, key):
        """Refused when the instance is made, at a call, and at the edge; V9.0 has them."""
        kind = getattr(instructions, name)
        message = f"{name}.{key}: 1 is not allowed; .*technology version V8.0 of the S7-1200 G2"
        with pytest.raises(ConfigurationError, match=message):
            kind(rig.axis.object, **{key: 1})
        instance = kind(rig.axis.object)
        with pytest.raises(ConfigurationError, match=message):
            instance(**{key: 1})
        setattr(instance, key, 1)
        with pytest.raises(ConfigurationError, match=message):
            instance(Execute=True)
        assert getattr(kind(Rig().axis.object, **{key: 1}), key) == 1

    @pytest.mark.requirement("G2-049", "MC-017", "CFG-005")
    @pytest.mark.parametrize("kind", [MC_MoveAbsolute, MC_MoveRelative])
    def test_no_output_active(self, rig, kind):
        """Positioning has no output Active, and does what it does without it."""
        rig.enabled()
        rig.axis.home(0.0)
        rig.cycles(2)
        job = rig.axis.run(kind(rig.axis.object, Execute=True, Velocity=50.0))
        assert not hasattr(job, "Active")
        rig.until(job.done)
        assert not hasattr(job, "Active")
        assert hasattr(kind(Rig().axis.object), "Active")

    @pytest.mark.requirement("MC-016")
    def test_parameter_1020_is_of_v9(self, rig):
        """MC_WriteParameter 1020: 16#805A here, in force at once with V9.0."""
        for one, error, value in ((rig, 0x805A, 7), (Rig(), 0, 3)):
            one.cycles(2)
            job = one.axis.write_parameter(1020, 3)
            one.cycles(2)
            assert job.ErrorID == error
            assert one.axis.var("Actor.RemoveEnableReaction") == value

    @pytest.mark.requirement("G2-001", "CFG-062")
    def test_on_a_bench(self):
        """`cpu` of the bench file is the controller of every axis."""
        text = read("reference")[1].replace("[bench]", '[bench]\ncpu = "S7-1200 G2"')
        with Bench(parse(text, "bench.toml"), seed=1) as machine:
            axis = machine.axis()
            with pytest.raises(ConfigurationError, match=r"MC_Halt\.Mode: 1"):
                axis.halt(Mode=1)
            assert machine.run_until(axis.power().status, 2.0)
            assert machine.run_until(axis.move_relative(5.0).done, 2.0)

    @pytest.mark.requirement("CFG-177")
    def test_one_encoder(self):
        """An axis has one encoder."""
        with pytest.raises(ConfigurationError, match="cpu = S7-1200 G2 has one encoder"):
            make(variables={"Sensor[2].Existent": True})


class TestGeneral:
    """Section 6.1."""

    @pytest.mark.requirement("G2-002")
    def test_execute(self, rig):
        """The edge starts; neither its fall nor changed inputs change the running job."""
        rig.enabled()
        job = rig.axis.run(MC_MoveRelative(rig.axis.object, Distance=30.0))
        rig.cycles(3)
        assert not job.Busy
        job.set(Execute=True)
        rig.cycles(5)
        job.set(Execute=False, Distance=500.0)
        rig.until(lambda: rig.axis.state is AxisState.STANDSTILL)
        assert rig.axis.var("Position") == pytest.approx(30.0)
        job.set(Execute=True)
        rig.run(0.5)
        assert rig.axis.var("Position") > 35.0

    @pytest.mark.requirement("G2-003")
    def test_enable(self):
        """TRUE starts, values go on at every call, the falling edge ends."""
        rig = make(port=TorquePort()).enabled()
        job = rig.axis.torque_additive(0.5)
        rig.cycles(2)
        assert rig.port.additive_nm == 0.5
        job.set(Value=0.25)
        rig.cycles(2)
        assert rig.port.additive_nm == 0.25
        job.set(Enable=False)
        rig.cycles(2)
        assert (rig.port.additive_nm, job.Busy) == (0.0, False)

    @pytest.mark.requirement("G2-004")
    def test_dynamic_values(self, rig):
        """Below 0 the default of the axis, above 0 the value of the command."""
        rig.enabled()
        rig.until(rig.axis.move_relative(60.0, Velocity=-1.0).done)
        assert max(rig.column("velocity_setpoint")) == pytest.approx(100.0)
        rig.until(rig.axis.move_relative(60.0, Velocity=150.0).done)
        assert max(rig.column("velocity_setpoint")) == pytest.approx(150.0)

    @pytest.mark.requirement("G2-005", "G2-006")
    @pytest.mark.parametrize("end", ["Done", "CommandAborted", "Error"])
    def test_one_output_at_a_time(self, rig, end):
        """Busy, Done, CommandAborted and Error exclude each other; without Execute the end is shown for one
        cycle.
        """
        rig.enabled()
        shown = []
        job = MC_MoveRelative(rig.axis.object, Distance=20.0, Execute=True)
        rig.axis.run(job)
        rig.runtime.after_cycle.append(
            lambda: shown.append((job.Busy, job.Done, job.CommandAborted, job.Error))
        )
        rig.cycles(2)
        job.set(Execute=False)
        rig.cycles(20)
        if end == "CommandAborted":
            rig.axis.halt()
        elif end == "Error":
            rig.axis.alarms.raise_alarm(104)
        rig.run(1.0)
        assert all(sum(outputs) <= 1 for outputs in shown)
        place = ("Busy", "Done", "CommandAborted", "Error").index(end)
        assert [sum(outputs[number] for outputs in shown) for number in (1, 2, 3)] == [
            int(number == place) for number in (1, 2, 3)
        ]

    @pytest.mark.requirement("G2-007", "G2-008")
    def test_two_velocities(self, rig):
        """A1 to 50.0; A2 to 15.0 aborts it; A1 again; A2 again before 50.0 is reached."""
        rig.enabled()
        dynamics = {"Acceleration": 50.0, "Deceleration": 50.0, "Jerk": 0.0}
        one = rig.axis.run(MC_MoveVelocity(rig.axis.object, Velocity=50.0, **dynamics))
        two = rig.axis.run(MC_MoveVelocity(rig.axis.object, Velocity=15.0, **dynamics))
        one.set(Execute=True)
        rig.until(one.in_velocity)
        two.set(Execute=True)
        rig.cycles(2)
        assert (one.CommandAborted, one.InVelocity) == (True, False)
        rig.until(two.in_velocity)
        assert rig.axis.var("Velocity") == pytest.approx(15.0)
        one.set(Execute=False)
        rig.cycles(1)
        one.set(Execute=True)
        rig.run(0.4)
        assert (two.CommandAborted, one.InVelocity) == (True, False)
        two.set(Execute=False)
        rig.cycles(1)
        two.set(Execute=True)
        rig.cycles(2)
        assert one.CommandAborted
        rig.until(two.in_velocity)

    @pytest.mark.requirement("G2-009")
    def test_every_instance_has_data_of_its_own(self, rig):
        """Two instances of one instruction on one axis: what one is given and shows is not the other's."""
        rig.enabled()
        one = MC_MoveVelocity(rig.axis.object, Velocity=10.0)
        two = MC_MoveVelocity(rig.axis.object, Velocity=20.0)
        assert one.name != two.name
        one(Execute=True)
        two()
        assert (one.Busy, two.Busy, two.Velocity, one.Velocity) == (True, False, 20.0, 10.0)


class TestEnablingAndStopping:
    """Section 6.2."""

    @pytest.mark.requirement("G2-011", "G2-018")
    def test_start_mode(self, rig):
        """With 0 there is no position control until a positioning command; a velocity command may open it
        again.
        """
        power = rig.axis.power(start_mode=0)
        rig.until(power.status)
        assert rig.axis.var("StatusDrive.InOperation")
        assert rig.axis.var("StatusWord.X28")
        rig.until(rig.axis.move_relative(5.0).done)
        assert not rig.axis.var("StatusWord.X28")
        rig.until(rig.axis.move_velocity(20.0, PositionControlled=False).in_velocity)
        rig.cycles(1)
        assert rig.axis.var("StatusWord.X28")
        closed = make()
        closed.until(closed.axis.power(start_mode=1).status)
        assert not closed.axis.var("StatusWord.X28")

    @pytest.mark.requirement("G2-012", "G2-013", "G2-014", "G2-015")
    @pytest.mark.parametrize(
        ("mode", "deceleration"),
        [(0, 4000.0), (1, 3000.0 / 60.0 * 10.0 / 0.5), (2, 2000.0), (3, 3000.0 / 60.0 * 10.0 / 3.0)],
    )
    def test_stop_mode(self, rig, mode, deceleration):
        """Emergency and maximum deceleration by the axis; OFF3 ramp and friction by the drive (0.5 s and 3 s
        from 3000 rpm).
        """
        rig.travelling(400.0)
        since = len(rig.rows)
        rig.axis.power(False, stop_mode=mode)
        rig.run(4.0)
        speeds = rig.column("actual_speed")[since:]
        slopes = [(a - b) / 6.0 / 0.004 for a, b in itertools.pairwise(speeds) if a != b]
        assert max(slopes[:-2]) == pytest.approx(deceleration, rel=0.05)
        first = next(int(word) for word in rig.column("stw1")[since:] if int(word) != 0x047F)
        assert first == {0: 0x047E, 1: 0x047B, 2: 0x047E, 3: 0x047C}[mode]
        assert not rig.axis.power_instance.Busy

    @pytest.mark.requirement("G2-016", "G2-017")
    def test_remove_enable(self):
        """The configured reaction stops, whatever StopMode says; acknowledged with Enable TRUE the axis is
        enabled again.
        """
        rig = make(variables={"Actor.RemoveEnableReaction": 3})
        rig.travelling(300.0)
        rig.axis.power_instance.set(StopMode=2)
        rig.axis.alarms.raise_alarm(421)
        rig.cycles(2)
        assert not int(rig.column("stw1")[-1]) & 2
        rig.run(4.0)
        assert not rig.axis.power_instance.Status
        rig.until(rig.axis.reset().done)
        rig.until(rig.axis.power_instance.status)
        assert rig.axis.state is AxisState.STANDSTILL

    @pytest.mark.requirement("G2-019")
    def test_start_mode_of_a_speed_axis(self):
        """It has no effect."""
        for mode in (0, 1, 5):
            rig = make(speed=True)
            power = rig.axis.run(MC_Power(rig.axis.object, Enable=True, StartMode=mode))
            rig.until(power.status)
            rig.until(rig.axis.move_velocity(60.0).in_velocity)

    @pytest.mark.requirement("G2-020")
    def test_interlock(self, rig):
        """Enable behind the status of drive and encoder: no alarm, and enabled when both are there."""
        rig.port.link = False
        power = rig.axis.power_when_ready()
        rig.run(0.5)
        assert not power.Status
        assert not rig.events("alarm.raised")
        rig.port.link = True
        rig.until(power.status)
        assert not rig.events("alarm.raised")

    @pytest.mark.requirement("G2-021", "G2-023")
    def test_halt(self, rig):
        """Brakes with its own values; the command before shows CommandAborted, X7 and Done that it stands."""
        rig.travelling(200.0)
        since = len(rig.rows)
        halt = rig.axis.halt(Deceleration=500.0, Jerk=0.0)
        rig.cycles(2)
        assert rig.job.CommandAborted
        assert not rig.axis.var("StatusWord.X7")
        rig.until(halt.done)
        assert min(rig.column("acceleration_setpoint")[since:]) == pytest.approx(-500.0)
        rig.run(0.1)
        assert rig.axis.var("StatusWord.X7")

    @pytest.mark.requirement("G2-022")
    @pytest.mark.parametrize("abort", [False, True])
    def test_abort_acceleration(self, rig, abort):
        """While accelerating: reduced with the jerk first, so that the velocity still rises, or set to zero
        at once.
        """
        rig.enabled()
        rig.axis.move_velocity(400.0, Acceleration=1000.0, Jerk=5000.0)
        rig.run(0.25)
        before, since = rig.column("velocity_setpoint")[-1], len(rig.rows)
        assert rig.column("acceleration_setpoint")[-1] > 900.0
        rig.until(rig.axis.halt(Deceleration=1000.0, Jerk=5000.0, AbortAcceleration=abort).done)
        rise = max(rig.column("velocity_setpoint")[since:]) - before
        assert (rise > 50.0) is not abort

    @pytest.mark.requirement("G2-024", "G2-026")
    @pytest.mark.parametrize(("mode", "deceleration"), [(0, 4000.0), (2, 2000.0), (3, 700.0)])
    def test_stop(self, rig, mode, deceleration):
        """Its ramp by Mode; enabled and locked while Execute is TRUE, which X0 of StatusWord2 shows."""
        rig.travelling(400.0)
        since = len(rig.rows)
        stop = rig.axis.stop(mode, Deceleration=700.0, Jerk=0.0)
        rig.until(stop.done)
        assert min(rig.column("acceleration_setpoint")[since:]) == pytest.approx(-deceleration, rel=0.01)
        refused = rig.axis.move_relative(5.0)
        rig.cycles(2)
        assert refused.ErrorID == 0x800F
        assert rig.axis.var("StatusWord2.X0")
        assert rig.axis.power_instance.Status
        stop.set(Execute=False)
        rig.cycles(2)
        assert not rig.axis.var("StatusWord2.X0")
        rig.until(rig.axis.move_relative(5.0).done)

    @pytest.mark.requirement("G2-025")
    def test_what_aborts_a_stop(self, rig):
        """MC_Power with Enable FALSE."""
        rig.travelling(400.0)
        stop = rig.axis.stop(3, Deceleration=200.0)
        rig.run(0.05)
        rig.axis.power(False)
        rig.cycles(2)
        assert stop.CommandAborted


class TestMotion:
    """Section 6.3."""

    @pytest.mark.requirement("G2-027")
    @pytest.mark.parametrize("speed", [False, True])
    @pytest.mark.parametrize(
        ("direction", "given", "result"), [(0, -60.0, -60.0), (1, -60.0, 60.0), (2, 60.0, -60.0)]
    )
    def test_velocity(self, speed, direction, given, result):
        """Direction, Current, PositionControlled, dynamics, InVelocity; on both types of axis."""
        rig = make(speed=speed).enabled()
        given_acceleration = 50.0 if speed else 400.0  # 1/s2 of a speed axis are 60 rpm/s
        job = rig.axis.move_velocity(
            given, Direction=direction, Acceleration=given_acceleration, Jerk=0.0, PositionControlled=False
        )
        rig.until(job.in_velocity)
        assert rig.column("velocity_setpoint")[-1] == pytest.approx(result)
        shown = max(map(abs, rig.column("acceleration_setpoint")))
        assert shown == pytest.approx(3000.0 if speed else 400.0)
        rig.cycles(1)
        if not speed:
            assert rig.axis.var("StatusWord.X28")
        keep = rig.axis.move_velocity(10.0, Current=True)
        rig.until(keep.in_velocity)
        rig.run(0.1)
        assert rig.column("velocity_setpoint")[-1] == pytest.approx(result)

    @pytest.mark.requirement("G2-028", "G2-029")
    def test_positioning(self, rig):
        """Relative without homing; absolute only when homed."""
        rig.enabled()
        rig.until(rig.axis.move_relative(7.0).done)
        assert rig.axis.var("Position") == pytest.approx(7.0)
        refused = rig.axis.move_absolute(10.0)
        rig.cycles(2)
        assert refused.ErrorID == 0x8001
        rig.run(0.5)
        rig.until(rig.axis.reset().done)
        rig.until(rig.axis.power_instance.status)
        rig.until(rig.axis.home(0.0).done)
        rig.until(rig.axis.move_absolute(10.0).done)
        assert rig.axis.var("Position") == pytest.approx(10.0)
        speed = make(speed=True).enabled()
        job = speed.axis.move_relative(1.0)
        speed.cycles(2)
        assert job.ErrorID == 0x8002

    @pytest.mark.requirement("G2-030")
    def test_jog(self, rig):
        """Forward, backward, both: 16#8007 and braking with the deceleration last in force."""
        rig.enabled()
        jog = rig.axis.run(
            MC_MoveJog(rig.axis.object, Velocity=80.0, Deceleration=300.0, Jerk=0.0, PositionControlled=False)
        )
        for key, sign in (("JogForward", 1.0), ("JogBackward", -1.0)):
            jog.set(JogForward=False, JogBackward=False)
            jog.set(**{key: True})
            rig.cycles(1)
            rig.until(jog.in_velocity)
            assert jog.Busy
            assert rig.axis.var("Velocity") == pytest.approx(80.0 * sign)
        rig.cycles(1)
        assert rig.axis.var("StatusWord.X28")
        since = len(rig.rows)
        jog.set(JogForward=True)
        rig.cycles(2)
        assert (jog.Error, jog.ErrorID, jog.Busy) == (True, 0x8007, False)
        rig.run(0.5)
        assert max(rig.column("acceleration_setpoint")[since:]) == pytest.approx(300.0)
        assert rig.axis.var("Velocity") == 0.0

    @pytest.mark.requirement("G2-031")
    @pytest.mark.parametrize(("override", "result"), [(0.0, 0.0), (50.0, 50.0), (200.0, 200.0)])
    def test_override(self, rig, override, result):
        """The product acts at once, also on the running command."""
        rig.travelling(100.0)
        rig.axis.write("Override.Velocity", override)
        rig.cycles(2)
        assert rig.job.InVelocity is False
        rig.run(1.0)
        assert rig.axis.var("Velocity") == pytest.approx(result)


@pytest.mark.requirement("CFG-062")
def test_unknown_controller(make_rig):
    """The message names those that there are."""
    with pytest.raises(
        ConfigurationError, match="cpu: 'S7-300' is not allowed; allowed: S7-1500T, S7-1500, S7-1200 G2"
    ):
        make_rig(cpu="S7-300")


@pytest.mark.requirement("MC-015")
def test_halt_mode_of_v9(make_rig):
    """With V9.0 Mode 1 leaves the superimposed motion."""
    rig = make_rig()
    rig.travelling(100.0)
    top = rig.axis.move_superimposed(100.0)
    rig.run(0.2)
    rig.until(rig.axis.run(MC_Halt(rig.axis.object, Execute=True, Mode=1)).done)
    assert top.Busy
