"""Instances that are called less often than the axis runs, and the log of their calls (section 8.1 of the
specification).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from fieldbus.errors import ConfigurationError
from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from motion.s7.call_log import CallLog
from motion.s7.instructions import MC_MoveJog, MC_MoveRelative, MC_TorqueAdditive
from testcases.unit.motion_axis.conftest import Rig, TorquePort

RATES = pytest.mark.parametrize("rate", [1, 3, 10])
EXCLUSIVE = {"Busy", "Done", "CommandAborted", "Error"}


def made(rate, **changes):
    """Return an enabled axis whose program is called in every `rate`-th cycle, and the log of its calls."""
    rig = Rig(**changes)
    rig.runtime.program_cycles = rate
    log = CallLog(rig.runtime)
    rig.enabled()
    return rig, log


@pytest.mark.requirement("MC-567", "MC-566", "MC-077", "MC-068", "MC-081")
@RATES
@pytest.mark.parametrize("end", ["Done", "CommandAborted", "Error"])
def test_outputs_of_one_call(rate, end):
    """Started by a pulse of one call: Busy in the call of the edge, the end in exactly one call, nothing
    afterwards.
    """
    rig, log = made(rate)
    job = rig.axis.run(MC_MoveRelative(rig.axis.object, Distance=20.0, Execute=True))
    rig.cycles(rate)
    job.set(Execute=False)
    rig.run(0.12)
    if end == "CommandAborted":
        rig.axis.halt()
    elif end == "Error":
        rig.axis.alarms.raise_alarm(104)
    rig.run(2.0)
    calls = log.of(job)
    assert calls[0].true >= {"Busy"}
    assert [end in call.true for call in calls].count(True) == 1
    assert all(len(call.true & EXCLUSIVE) <= 1 for call in calls)
    assert calls[-1].true == frozenset()
    assert calls[-1].outputs["ErrorID"] == 0
    assert [call.number for call in calls] == list(range(1, len(calls) + 1))
    assert {two.cycle - one.cycle for one, two in pairwise(calls)} == {rate}
    assert {two.time_ns - one.time_ns for one, two in pairwise(calls)} == {rate * 4_000_000}


@pytest.mark.requirement("MC-567", "MC-078")
@RATES
def test_an_end_is_held_with_execute(rate):
    """With Execute TRUE Done stays in every call until it falls."""
    rig, log = made(rate)
    job = rig.axis.move_relative(5.0)
    rig.run(2.0)
    calls = log.of(job)
    first = next(at for at, call in enumerate(calls) if "Done" in call.true)
    assert all(call.true == {"Done"} for call in calls[first:])
    job.set(Execute=False)
    rig.cycles(2 * rate)
    assert log.of(job)[-1].true == frozenset()


@pytest.mark.requirement("MC-567", "MC-082", "MC-083", "MC-085")
@RATES
def test_enable_inputs(rate):
    """The level acts from call to call: value taken over, error held until Enable falls."""
    rig, log = made(rate, port=TorquePort())
    job = rig.axis.run(MC_TorqueAdditive(rig.axis.object, Enable=True, Value=0.5))
    rig.cycles(2 * rate)
    assert rig.port.additive_nm == 0.5
    job.set(Value=0.25)
    rig.cycles(rate + 1)
    assert rig.port.additive_nm == 0.25
    job.set(Value=1.0e13)
    rig.cycles(2 * rate)
    job.set(Value=0.1)
    rig.cycles(2 * rate)
    assert log.of(job)[-1].true == {"Error"}
    job.set(Enable=False)
    rig.cycles(2 * rate)
    job.set(Enable=True)
    rig.cycles(2 * rate)
    assert rig.port.additive_nm == 0.1


@pytest.mark.requirement("MC-567", "MC-326", "MC-327")
@RATES
def test_jog(rate):
    """The axis moves from the call that sees the input TRUE to the one that sees it FALSE."""
    rig, log = made(rate)
    jog = rig.axis.run(MC_MoveJog(rig.axis.object, JogForward=True, Velocity=50.0))
    rig.run(0.4)
    assert log.of(jog)[-1].true == {"Busy", "InVelocity"}
    jog.set(JogForward=False)
    rig.run(1.0)
    assert log.of(jog)[-1].true == frozenset()
    assert rig.axis.var("Velocity") == 0.0


@pytest.mark.requirement("MC-567")
def test_the_axis_does_not_care():
    """The same job makes the same setpoints, whatever the rate of the calls is."""
    ways = []
    for rate in (1, 3, 10):
        rig, _ = made(rate)
        since = len(rig.rows)
        rig.until(rig.axis.move_relative(20.0).done)
        moving = [v for v in rig.column("velocity_setpoint")[since:] if v != 0.0]
        ways.append(moving)
    assert ways[0] == ways[1] == ways[2]


@pytest.mark.requirement("MC-566", "MC-567")
def test_on_a_bench():
    """`program_cycles` of the bench file, `record_calls` of the bench; laid-aside instances are in the log
    too.
    """
    text = read("reference")[1].replace("[bench]", "[bench]\nprogram_cycles = 5")
    with Bench(parse(text, "bench.toml"), seed=1) as machine:
        log = machine.record_calls()
        axis = machine.axis()
        assert machine.run_until(axis.power().status, 2.0)
        job = axis.move_relative(5.0)
        assert machine.run_until(job.done, 2.0)
        axis.move_relative(5.0)  # the first one is laid aside now
        machine.run_for(0.2)
        calls = log.of(job)
        assert {two.cycle - one.cycle for one, two in pairwise(calls)} == {5}
        assert calls[-1].true == {"Done"}
        assert job in log.instances
        assert axis.power_instance in log.instances


def test_a_rate_that_there_is_not(make_rig):
    """Fewer than one cycle is refused."""
    rig = make_rig()
    with pytest.raises(ConfigurationError, match="program_cycles: 0 is not allowed; allowed: 1 or more"):
        type(rig.runtime)(rig.scheduler, cycle_ns=1, program_cycles=0)
