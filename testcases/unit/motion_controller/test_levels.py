"""Execution levels: order, blocks of the user, two cycles, computing time and overflow (MC-634 to MC-637)."""

from __future__ import annotations

import itertools

import pytest

from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from motion.s7.controller import OperatingState
from motion.s7.controller.levels import check_priorities
from motion.s7.runtime import Runtime

STOP, RUN = OperatingState.STOP, OperatingState.RUN
T = 4 * MS


class TestOrder:
    """What is called when."""

    @pytest.mark.requirement("MC-634", "CFG-253")
    def test_one_cycle(self, rig):
        """MC_PreServo, MC_Servo, MC_PostServo, MC_PreInterpolator, then the program; a hook that is taken
        away is gone.
        """
        calls = []
        axis = rig.axis.object
        read, write = axis.read_inputs, axis.write_outputs
        axis.read_inputs = lambda: (calls.append("inputs"), read())
        axis.write_outputs = lambda output: (write(output), calls.append("outputs"))
        levels = rig.controller.levels
        ends = [
            levels.hook(level, lambda level=level: calls.append(level))
            for level in ("MC_PostServo", "MC_PreInterpolator", "MC_PreServo")
        ]
        rig.runtime.call(lambda: calls.append("program"))
        rig.cycles(1)
        assert calls == ["MC_PreServo", "inputs", "outputs", "MC_PostServo", "MC_PreInterpolator", "program"]
        for end in ends:
            end()
            end()
        assert levels.plain
        calls.clear()
        rig.cycles(1)
        assert calls == ["inputs", "outputs", "program"]
        with pytest.raises(ConfigurationError, match="MC_PreServo, MC_PostServo"):
            levels.hook("OB1", print)

    @pytest.mark.requirement("MC-634", "MC-632")
    def test_blocks_of_the_user_are_not_called_in_stop(self, rig):
        """STOP calls no program, whatever its level."""
        calls = []
        rig.controller.levels.hook("MC_PreServo", lambda: calls.append(1))
        rig.cycles(2)
        rig.stopped()
        number = len(calls)
        rig.cycles(5)
        assert len(calls) == number >= 2
        rig.running()
        assert len(calls) > number

    @pytest.mark.requirement("MIN-002", "MC-473")
    @pytest.mark.parametrize(("level", "cycles"), [("MC_PreServo", 1), ("MC_PreInterpolator", 2)])
    def test_setpoints_of_the_user(self, rig, level, cycles):
        """A vector given in MC_PreServo acts in the MC_Servo of the same cycle, in MC_PreInterpolator in that
        of the next.
        """
        rig.enabled()
        job = rig.axis.motion_in_velocity(0.0)
        rig.cycles(5)

        def give() -> None:
            job(Velocity=50.0)

        rig.controller.levels.hook(level, give)
        rig.rows.clear()
        rig.cycles(3)
        assert rig.column("velocity_setpoint").index(50.0) == cycles - 1

    @pytest.mark.requirement("MC-634")
    def test_an_interpolator_cycle_of_three(self, make_rig):
        """The servo runs in every cycle, interpolator and program in every third."""
        rig = make_rig(cycle_ns=2 * MS, ratio=3)
        calls = {"servo": 0, "interpolator": 0, "program": 0}

        def count(name):
            return lambda: calls.__setitem__(name, calls[name] + 1)

        rig.controller.levels.hook("MC_PostServo", count("servo"))
        rig.controller.levels.hook("MC_PreInterpolator", count("interpolator"))
        rig.runtime.call(count("program"))
        rig.cycles(30)
        assert calls == {"servo": 30, "interpolator": 10, "program": 10}


@pytest.mark.requirement("CFG-187", "MC-634")
@pytest.mark.parametrize(
    ("servo", "interpolator", "clock", "message"),
    [
        (3, 3, 2, "multiple of the send clock of 2000000 ns"),
        (2, 3, 2, "multiple of the servo cycle of 2000000 ns"),
        (4, 2, 2, "multiple of the servo cycle"),
        (4, 36, 4, "at most 32 ms"),
        (2, 2, 2, ""),
        (4, 4, 2, ""),
        (6, 6, 2, ""),
        (2, 4, 2, ""),
    ],
)
def test_cycles_that_fit(servo, interpolator, clock, message):
    """T_servo is a whole number of send clocks, T_ipo one of servo cycles, at most 32 ms."""
    arguments = {"cycle_ns": servo * MS, "interpolator_ns": interpolator * MS, "send_clock_ns": clock * MS}
    if message:
        with pytest.raises(ConfigurationError, match=message):
            Runtime(VirtualScheduler(), **arguments)
    else:
        assert Runtime(VirtualScheduler(), **arguments).controller.levels.ratio == interpolator // servo


@pytest.mark.requirement("MC-635")
@pytest.mark.parametrize(
    ("servo", "interpolator", "good"),
    [
        (26, 24, True),
        (17, 16, True),
        (26, 25, True),
        (24, 24, False),
        (16, 15, False),
        (27, 24, False),
        (26, 26, False),
        (20, 22, False),
    ],
)
def test_priorities(servo, interpolator, good):
    """17 to 26 and 16 to 25, the servo's higher by at least one."""
    if good:
        check_priorities(servo, interpolator)
    else:
        with pytest.raises(ConfigurationError, match="priority"):
            check_priorities(servo, interpolator)


class TestFineInterpolation:
    """T_ipo = n * T_servo."""

    @pytest.mark.requirement("CFG-169", "CFG-170", "CFG-166", "CFG-167", "CFG-168", "VAR-127")
    @pytest.mark.parametrize(
        ("variables", "lag_mm"),
        [
            ({"DynamicAxisModel.VelocityTimeConstant": 0.003}, 0.9),
            ({"PositionControl.Kv": 100.0, "PositionControl.Kpc": 0.0}, 1.4),
        ],
        ids=["precontrol", "no precontrol"],
    )
    def test_lag_of_a_simulated_axis(self, make_rig, variables, lag_mm):
        """T_ipo 4 ms, T_servo 2 ms, 100 mm/s: the lag is that of the formula, seen where the interpolator
        runs.
        """
        rig = make_rig(cycle_ns=2 * MS, ratio=2, variables={"Simulation.Mode": 1, **variables})
        lags = []
        rig.controller.levels.hook(
            "MC_PreInterpolator",
            lambda: lags.append(rig.axis.var("Position") - rig.axis.var("ActualPosition")),
        )
        rig.travelling(100.0)
        rig.run(0.3)
        assert lags[-1] == pytest.approx(lag_mm, abs=1e-6)
        assert lags[-2] == pytest.approx(lag_mm, abs=1e-6)

    @pytest.mark.parametrize("ratio", [2, 4, 8])
    def test_the_same_profile_on_a_finer_grid(self, make_rig, ratio):
        """At the ends of the intervals the setpoint is that of an interpolator alone; between them it is
        smooth.
        """
        coarse = make_rig(cycle_ns=8 * MS).enabled()
        fine = make_rig(cycle_ns=8 * MS // ratio, ratio=ratio).enabled()
        for rig in (coarse, fine):
            rig.run(0.08)
            rig.rows.clear()
            rig.until(rig.axis.move_relative(100.0, Velocity=200.0).done)
        ends = [s for s in fine.column("position_setpoint") if s > 0.0]
        wanted = [s for s in coarse.column("position_setpoint") if s > 0.0]
        assert ends[ratio - 1 :: ratio][: len(wanted) // 2] == pytest.approx(
            wanted[: len(wanted) // 2], abs=1e-9
        )
        velocity = fine.column("velocity_setpoint")
        step = max(abs(b - a) for a, b in itertools.pairwise(velocity))
        assert step <= 1.5 * 1000.0 * fine.cycle_ns / S
        assert fine.column("position_setpoint")[-1] == pytest.approx(100.0)

    @pytest.mark.parametrize("ratio", [2, 4])
    @pytest.mark.parametrize("command", ["power", "stop", "alarm"])
    def test_setpoints_from_actual_values(self, make_rig, ratio, command):
        """An emergency ramp takes the actual values without a step, wherever in the interval it begins."""
        rig = make_rig(cycle_ns=8 * MS // ratio, ratio=ratio).travelling(200.0)
        rig.run(0.1)
        rig.rows.clear()
        if command == "power":
            rig.axis.power(False, stop_mode=0)
        elif command == "stop":
            rig.axis.stop(0)
        else:
            rig.axis.object.alarms.raise_alarm(531, reaction=3)
        rig.run(0.2)
        position = rig.column("position_setpoint")
        steps = [b - a for a, b in itertools.pairwise(position)]
        assert max(abs(step) for step in steps) <= 200.0 * rig.cycle_ns / S * 1.1
        changes = [abs(b - a) for a, b in itertools.pairwise(steps)]
        assert max(changes) <= 4000.0 * (rig.cycle_ns / S) ** 2 * 2.0 + 1e-3
        assert max(abs(error) for error in rig.column("following_error")) < 0.5

    def test_homing_between_two_interpolations(self, make_rig):
        """A shift of the coordinate system moves the points on the way, too: nothing jumps."""
        rig = make_rig(cycle_ns=2 * MS, ratio=4).travelling(100.0)
        rig.rows.clear()
        rig.axis.home(500.0)
        rig.run(0.1)
        errors = rig.column("following_error")
        assert max(abs(error) for error in errors) < 0.05

    def test_without_position_control(self, make_rig):
        """The speed setpoint goes in small steps, too; a speed axis likewise."""
        for rig in (
            make_rig(cycle_ns=2 * MS, ratio=4).enabled(start_mode=0),
            make_rig(cycle_ns=2 * MS, ratio=4, speed=True).enabled(),
        ):
            job = rig.axis.move_velocity(300.0, PositionControlled=False)
            rig.until(job.in_velocity)
            output = rig.column("speed_output")
            rate = 6000.0
            assert max(b - a for a, b in itertools.pairwise(output)) <= rate * 0.002 * 1.6
