"""The cyclic path and its parts, timed. Nothing here judges speed; `tox -e bench` prints the table."""

from __future__ import annotations

import pytest

from fieldbus.can import CanFrame, CanMedium
from fieldbus.clock import VirtualScheduler
from hil._commands._axis_measurement import AXES, STATES, RunningAxes
from hil._commands._measurements import MovingBench, with_axes
from hil.bench import load_bench
from motion.setpoint import SetpointGenerator, plan_position


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("bench", "axes", "cycle_ms"),
    [("fast", 1, 1), ("reference", 1, 4), ("reference", 4, 4), ("reference", 4, 2)],
)
def test_simulated_second(benchmark, bench, axes, cycle_ms):
    """One simulated second of a bench with all axes moving and everything recorded."""
    moving = MovingBench(with_axes(load_bench(bench).config, axes, cycle_ms=cycle_ms))
    with moving.bench:
        before = moving.bench.now_s
        benchmark.pedantic(moving.advance, args=(1.0,), rounds=5, warmup_rounds=1)
        assert moving.bench.now_s >= before + 1.0


@pytest.mark.parametrize(("state", "count"), [(state, 1) for state in STATES] + [("positioning", AXES)])
def test_axis_cycles(benchmark, state, count):
    """A thousand cycles of the controller alone, without bus and drive."""
    running = RunningAxes(state, count)
    benchmark(running.run, 1000)
    assert (state == "standstill") is not any(axis.actual_velocity for axis in running.axes)


def test_event(benchmark):
    """A thousand periodic events of the virtual scheduler."""
    scheduler = VirtualScheduler()
    fired = []
    scheduler.every(1000, lambda: fired.append(1))
    benchmark(scheduler.run_for, 1_000_000)
    assert fired


def test_frame(benchmark):
    """A hundred frames with new data over the medium to one receiver."""
    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler, keep_log=False)
    received = []
    port = medium.attach("sender", lambda _frame, _time: None)
    medium.attach("receiver", lambda frame, _time: received.append(frame.can_id))

    def send() -> None:
        for number in range(100):
            port.send(CanFrame(0x100 + number, number.to_bytes(8, "little")))
        scheduler.run_for(20_000_000)

    benchmark(send)
    assert len(received) % 100 == 0
    assert received


def test_plan_and_advance(benchmark):
    """A point-to-point plan, and a thousand cycles of the setpoint."""
    generator = SetpointGenerator()

    def run() -> None:
        generator.set_state(0.0, 0.0)
        generator.start_position(100.0, 300.0, 1000.0, 1000.0, 10000.0)
        for _ in range(1000):
            generator.advance(0.001)

    benchmark(run)
    assert generator.s == 100.0
    assert plan_position(
        0.0, 0.0, 0.0, 100.0, max_velocity=300.0, acceleration=1000.0, deceleration=1000.0, jerk=10000.0
    ).distance == pytest.approx(100.0)
