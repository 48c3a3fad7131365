"""Setpoints from the user program while `MC_Interpolator` is slower than `MC_Servo` (§5.14, MIN-002)."""

from __future__ import annotations

import pytest

from hil.bench import BenchFile, load_bench

pytestmark = pytest.mark.exhaustive

INTERPOLATOR_S = 0.016


def build(name):
    text = load_bench(name).text.replace("cycle_ms = 4", "cycle_ms = 4\ninterpolator_ms = 16")
    return BenchFile("slow.toml", text).build(seed=1)


def led(machine, job, vector):
    """Let a program give `job` a vector by the number of its call, before the instance is called; returns
    what ends that.
    """
    calls = [0]

    def program():
        calls[0] += 1
        job.set(**vector(calls[0]))

    machine.runtime.call(program, first=True)
    return lambda: machine.runtime.uncall(program)


@pytest.mark.requirement("MIN-002", "MIN-019", "MIN-022", "MIN-026", "MIN-028", "MIN-034", "MIN-040")
@pytest.mark.parametrize("name", ["reference", "profidrive"])
def test_vectors_of_a_slow_interpolator(name):
    """Between two vectors the servo goes on in small steps: no following error, no alarm; a falling Enable
    acts with the next vector.
    """
    with build(name) as machine:
        axis = machine.axis()
        assert machine.run_until(axis.power().status, timeout=3.0)

        def largest_error(since):
            return abs(machine.trace()["axis1.following_error"].between(since, machine.now_s).values).max()

        job = axis.motion_in_velocity(0.0)
        end = led(machine, job, lambda call: {"Velocity": min(100.0, 8.0 * call)})
        began = machine.now_s
        machine.run_for(0.6)
        assert largest_error(began) < 0.1
        outputs = machine.trace()["axis1.speed_output"].between(began + 0.4, machine.now_s).values
        assert outputs == pytest.approx(600.0, rel=0.002)  # constant travel has no ripple of the interpolator
        end()
        fell = machine.now_s
        job.set(Enable=False)
        machine.run_for(0.5)
        setpoint = machine.trace()["axis1.velocity_setpoint"].between(
            fell + 3 * INTERPOLATOR_S, machine.now_s
        )
        assert abs(setpoint.values).max() == 0.0
        assert axis.var("ActualPosition") == pytest.approx(axis.var("Position"), abs=0.01)

        start = axis.var("Position")
        job = axis.motion_in_position(start)
        end = led(
            machine, job, lambda call: {"Position": start - 40.0 * INTERPOLATOR_S * call, "Velocity": -40.0}
        )
        began = machine.now_s
        machine.run_for(0.5)
        assert largest_error(began + 0.2) < 0.05
        end()
        job.set(Enable=False)
        machine.run_for(0.4)
        assert axis.var("StatusMotionIn.FunctionState") == 0

        start = axis.var("Position")
        top = axis.motion_in_superimposed(0.0)
        end = led(
            machine,
            top,
            lambda call: {"Distance": min(2.0, 0.16 * call), "VelocityDiff": 10.0 if call < 13 else 0.0},
        )
        machine.run_for(0.5)
        end()
        top.set(Enable=False)
        machine.run_for(0.1)
        assert axis.var("StatusPositioning.SuperimposedDistance") == pytest.approx(
            0.0
        )  # reset, since nothing moves any more
        assert axis.var("ActualPosition") == pytest.approx(start + 2.0, abs=0.05)
        assert axis.alarms.engine.number == 0
