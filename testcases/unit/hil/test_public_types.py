"""What an editor and a type checker know of a test: mypy checks this file, and the assertions say what it
infers.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from typing import assert_type

import pytest

import hil
import hil.bench
from fieldbus.can import CanMedium
from fieldbus.clock import Scheduler
from fieldbus.history import Event
from hil.expect import alarm, no_alarm
from hil.testing import assert_trace
from motion.s7.axis.state import AxisState
from motion.s7.controller import Controller
from motion.s7.instructions import MC_MoveAbsolute, MC_Power
from reports.model import Check


def test_types_of_a_test(
    bench: hil.Bench, axis: hil.Axis, drive: hil.Drive, faults: hil.Injector, trace: hil.CurrentTrace
) -> None:
    """Bench, axis, job, fault and trace have their types from the fixtures on, without a cast."""
    assert_type(bench.axis(), hil.Axis)
    assert_type(bench.drive(), hil.Drive)
    assert_type(bench.node(), hil.Node)
    assert_type(bench.scheduler, Scheduler)
    assert_type(bench.controller, Controller)
    power = assert_type(axis.power(), MC_Power)
    assert bench.run_until(power.status, timeout=2.0)
    assert_type(axis.state, AxisState)
    assert_type(axis.name, str)
    move: hil.Job = axis.move_absolute(5.0)
    assert_type(axis.move_absolute(5.0), MC_MoveAbsolute)
    assert_type(axis.move_absolute(5.0).Done, bool)
    assert_type(move.ErrorID, int)
    fault = assert_type(faults.inject("drive.fault", drive.name, code=0x2310), hil.ArmedFault)
    assert_type(fault.fault, hil.Fault)
    bench.run_for(0.1)
    assert_type(trace["axis1.actual_velocity"], hil.Signal)
    assert_type(trace(), hil.Trace)
    expectation: hil.Expectation = alarm(421, since=hil.event("fault.applied"))
    trace.check(expectation)
    assert_type(trace.checks, list[Check])
    assert_type(trace.events, Sequence[Event])
    segment = bench.segment()
    assert isinstance(segment, CanMedium)
    assert_type(segment.bus_load(), float)


def test_types_of_a_bench_file(hil_bench_file: hil.BenchFile) -> None:
    """A bench file builds a bench; its model and other content have types as well."""
    changed = assert_type(hil_bench_file.configured({"bench": {"name": "other"}}), hil.BenchFile)
    assert assert_type(changed.name, str) == "other"
    with changed.build(seed=1) as bench:
        assert_type(bench, hil.Bench)
        bench.run_for(0.05)
        trace = assert_type(bench.trace(), hil.Trace)
        assert_type(assert_trace(trace, no_alarm()), list[Check])


def test_types_of_a_case(bench: hil.Bench) -> None:
    """In a case of a campaign, the context has the same types as the fixtures."""
    ctx = hil.CaseContext(bench)
    assert_type(ctx.bench, hil.Bench)
    assert_type(ctx.axis, hil.Axis)
    assert_type(ctx.drive, hil.Drive)
    assert_type(ctx.trace(), hil.Trace)
    assert_type(ctx.wait_until(ctx.axis.power().status, 2.0, "the axis is enabled"), float)


def test_every_exported_name_is_there() -> None:
    """Each name of `hil` and `hil.bench` can be loaded, and no other is offered."""
    for module in (hil, hil.bench):
        for name in module.__all__:
            assert getattr(module, name) is not None
    with pytest.raises(AttributeError, match="module 'hil' has no 'Bnech'; similar: Bench"):
        hil.Bnech  # type: ignore[attr-defined]  # noqa: B018
    with pytest.raises(AttributeError, match=r"module 'hil\.bench' has no attribute 'Bnech'"):
        hil.bench.Bnech  # type: ignore[attr-defined]  # noqa: B018


def test_importing_the_package_loads_nothing() -> None:
    """`import hil` costs nothing: its names are loaded when they are first used."""
    heavy = {"canopen", "emulators", "fieldbus", "motion", "numpy", "pydantic", "reports"}
    code = f"import sys, hil; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
