"""The controller of a bench: STOP, supply and breakpoint as faults, with real drives behind real buses."""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.bench import BenchFile, load_bench
from hil.bench.bench_file import BenchFileError, parse
from hil.expect.checkers import run_checkers
from hil.faults import Injector, velocity
from motion.s7.controller import OperatingState
from reports.model import Verdict


def moving(name, speed=100.0):
    """Return a bench whose first axis travels."""
    bench = load_bench(name).build(seed=1)
    axis = bench.axis()
    assert bench.run_until(axis.power().status, 2.0)
    job = axis.move_velocity(speed)
    assert bench.run_until(job.in_velocity, 3.0)
    return bench, axis, job


def in_state(bench, state):
    return lambda: bench.controller.state is state


def enabled_again(bench, axis):
    """Acknowledge what the drive has to say, and enable."""
    bench.run_for(0.5)
    assert bench.run_until(axis.reset().done, 2.0)
    return bench.run_until(axis.power().status, 3.0)


BENCHES = ["reference", "profidrive", "profidrive_tcp", "profidrive_rtu", "analog", "stepper"]


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-629", "STP-506", "STP-588", "MC-631")
@pytest.mark.parametrize("name", BENCHES)
def test_stop_and_run(name):
    """The axis comes to rest, the job ends with CommandAborted, and after RUN the axis can be enabled
    again.
    """
    bench, axis, job = moving(name, 20.0 if name == "stepper" else 100.0)
    with bench:
        Injector(bench).inject("controller.stop", duration_s=1.5)
        bench.run_for(1.0)
        assert bench.controller.state is OperatingState.STOP
        assert axis.state.name in {"DISABLED", "ALARM_DISABLED"}
        assert abs(axis.var("ActualVelocity")) < 1.0
        assert [e.data["job"] for e in bench.history.select(kind="job.aborted")] == [job.name]
        assert bench.run_until(in_state(bench, OperatingState.RUN), 2.0)
        bench.run_for(0.1)
        assert axis.state.name in {"DISABLED", "ALARM_DISABLED"}
        assert enabled_again(bench, axis)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-630")
@pytest.mark.parametrize("name", BENCHES)
def test_power_cycle(name):
    """The drive stops by itself when its controller is gone; the controller takes it into service again."""
    bench, axis, _ = moving(name, 20.0 if name == "stepper" else 100.0)
    with bench:
        Injector(bench).inject("controller.power_off", duration_s=1.0)
        bench.run_for(0.9)
        assert bench.controller.state is OperatingState.POWER_OFF
        shaft = bench.drive().trace_row()
        bench.run_for(0.05)
        at = [column for column, _ in bench.drive().trace_columns].index("position")
        assert bench.drive().trace_row()[at] == pytest.approx(shaft[at], abs=1e-4)
        assert bench.run_until(in_state(bench, OperatingState.RUN), 8.0)
        assert bench.run_until(lambda: axis.object.port.link_ok, 3.0)
        assert enabled_again(bench, axis)


def test_silence_without_supply():
    """From the cut on the controller sends no frame."""
    bench, _, _ = moving("reference")
    with bench:
        bench.controller.power_off()
        cut = bench.scheduler.now
        bench.run_for(0.5)
        late = [entry for entry in bench.trace().frames if entry.time_ns > cut + 1_000_000]
        assert late
        assert {entry.sender for entry in late} == {"drive1"}


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-588")
def test_the_sign_of_life_ends():
    """With the process outputs the sign of life of the controller ends: the drive reports it, after its stop
    (F01912).
    """
    bench, axis, _ = moving("profidrive")
    with bench:
        bench.controller.stop()
        bench.run_for(1.5)
        assert axis.state.name == "DISABLED"
        assert axis.object.port.link_ok
        faults = list(bench.history.select(kind="drive.fault"))
        assert [e.data.get("number", e.data.get("code")) for e in faults] == [1912]
        off = [e for e in bench.history.select(kind="axis.state") if e.data["to"] == "DISABLED"][-1]
        assert faults[0].time_ns > off.time_ns


@pytest.mark.requirement("MC-629")
def test_outputs_of_stations_are_off_at_once():
    """The drive behind analog terminals loses enable and setpoint in the cycle of the stop."""
    bench, _, _ = moving("analog")
    with bench:
        station = bench.station()
        before = station.trace_row()
        bench.controller.stop()
        bench.run_for(0.03)
        assert station.trace_row() != before
        link = bench.station_link()
        assert not link._outputs


@pytest.mark.exhaustive
def test_a_breakpoint_with_a_trigger():
    """The fault is armed like any other, and the log tells all of it."""
    bench = load_bench("reference").build(seed=1)
    with bench:
        axis = bench.axis()
        Injector(bench).inject("controller.breakpoint", trigger=velocity(50.0), duration_s=1.0)
        assert bench.run_until(axis.power().status, 2.0)
        axis.move_velocity(100.0)
        assert bench.run_until(in_state(bench, OperatingState.STOP), 2.0)
        bench.run_for(0.5)
        assert [e.data["reason"] for e in bench.history.select(kind="controller.state")] == ["breakpoint"]
        assert bench.controller.diagnostics_buffer.find("overflow of MC_Servo")
        assert bench.run_until(in_state(bench, OperatingState.RUN), 3.0)


@pytest.mark.exhaustive
def test_no_program_meets_no_breakpoint():
    """In STOP, and without supply, a breakpoint does nothing, and its end starts nothing."""
    with load_bench("reference").build(seed=1) as bench:
        bench.controller.stop()
        bench.run_for(0.1)
        Injector(bench).inject("controller.breakpoint", duration_s=0.1)
        bench.run_for(0.5)
        assert bench.controller.state is OperatingState.STOP
        bench.controller.power_off()
        bench.run_for(0.1)
        Injector(bench).inject("controller.breakpoint", duration_s=0.1)
        bench.run_for(0.5)
        assert bench.controller.state is OperatingState.POWER_OFF


@pytest.mark.exhaustive
@pytest.mark.parametrize("first", ["controller.stop", "controller.power_off"])
@pytest.mark.parametrize("second", ["controller.stop", "controller.power_off"])
def test_the_last_of_overlapping_faults_gives_the_controller_free(first, second):
    """Stopped, or without supply, twice at a time: RUN comes after the end of both."""
    with load_bench("reference").build(seed=1) as bench:
        bench.run_for(0.3)
        Injector(bench).inject(first, duration_s=0.4)
        bench.run_for(0.2)
        Injector(bench).inject(second, duration_s=1.0)
        bench.run_for(0.8)
        expected = OperatingState.STOP if second == "controller.stop" else OperatingState.POWER_OFF
        assert bench.controller.state is expected
        assert bench.run_until(in_state(bench, OperatingState.RUN), 3.0)


def test_overlapping_overruns_leave_the_level_as_it_was():
    """While two faults want another computing time the later one holds; after both the level takes as long as
    before.
    """
    with load_bench("reference").build(seed=1) as bench:
        levels = bench.controller.levels
        before = levels.computing_time
        Injector(bench).inject("controller.overrun", duration_s=0.1, level="servo", time_ms=0.5)
        bench.run_for(0.05)
        Injector(bench).inject("controller.overrun", duration_s=0.1, level="servo", time_ms=1.0)
        bench.run_for(0.02)
        assert levels.computing_time[0] == 1_000_000
        bench.run_for(0.05)
        assert levels.computing_time[0] == 1_000_000
        bench.run_for(0.1)
        assert levels.computing_time == before


def test_where_it_cannot_be_injected():
    """Another target is refused, and a bench without axes."""
    led = load_bench("reference").build(seed=1)
    with led, pytest.raises(ConfigurationError, match="controller, or nothing"):
        Injector(led).inject("controller.stop", "drive1")
    text = load_bench("reference").text
    without_axis = BenchFile("own.toml", text[: text.index("[axis")]).build()
    with without_axis, pytest.raises(UnsupportedFaultError, match="outside of it"):
        Injector(without_axis).inject("controller.stop")


@pytest.mark.exhaustive
@pytest.mark.parametrize("base", ["reference", "profidrive"])
def test_an_interpolator_cycle_of_its_own(base):
    """The drive gets a new setpoint in every bus cycle, the interpolator runs in every fourth; stops are
    smooth.
    """
    text = load_bench(base).text.replace("cycle_ms = 4", "cycle_ms = 2\ninterpolator_ms = 8", 1)
    digests = set()
    for _ in range(2):
        bench = BenchFile("fine.toml", text).build(seed=1)
        with bench:
            axis = bench.axis()
            assert bench.run_until(axis.power().status, 3.0)
            bench.axis().home(0.0)
            bench.run_for(0.05)
            move = axis.move_absolute(50.0, Velocity=200.0)
            assert bench.run_until(move.done, 3.0)
            assert axis.var("ActualPosition") == pytest.approx(50.0, abs=0.05)
            job = axis.move_velocity(200.0)
            assert bench.run_until(job.in_velocity, 3.0)
            axis.stop(0)
            bench.run_for(0.5)
            trace = bench.trace()
            moving = trace["axis1.velocity_setpoint"].values
            assert len(set(moving[abs(moving) > 1.0])) > 100
            assert abs(trace["axis1.following_error"].values).max() < 1.0
            assert [check.name for check in run_checkers(trace) if check.verdict is Verdict.FAILED] == []
            digests.add(trace.digest())
    assert len(digests) == 1


@pytest.mark.requirement("MC-634", "MC-635")
@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("interpolator_ms = 6", "multiple of cycle_ms = 4"),
        ("interpolator_ms = 36", "32 at most"),
        ("servo_priority = 20\ninterpolator_priority = 20", "above interpolator_priority = 20"),
        ("servo_priority = 27", "servo_priority"),
    ],
)
def test_cycles_and_priorities_that_do_not_fit(keys, message):
    """The message names key, value and what is allowed."""
    text = load_bench("reference").text.replace("cycle_ms = 4", f"cycle_ms = 4\n{keys}", 1)
    with pytest.raises(BenchFileError, match=message):
        parse(text, "bench.toml")
