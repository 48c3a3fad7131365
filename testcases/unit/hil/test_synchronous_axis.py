"""The synchronous axis as a type: everything that a positioning axis does, on a bench."""

from __future__ import annotations

import pytest

from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from motion.s7.axis import SynchronousAxis

pytestmark = pytest.mark.exhaustive


def synchronous(name="reference", extra="", **changes):
    text = read(name)[1].replace('type = "positioning"', 'type = "synchronous"')
    for old, new in changes.items():
        text = text.replace(old, new)
    assert 'type = "synchronous"' in text
    return Bench(parse(text + extra, "bench.toml"), seed=1)


@pytest.mark.requirement("CFG-015", "CFG-175")
def test_it_moves_and_stops_like_a_positioning_axis():
    """Enabled, homed, positioned, stopped by its software limit; the variables are those of the positioning
    axis and more.
    """
    with synchronous() as machine:
        axis = machine.axis()
        assert isinstance(axis.object, SynchronousAxis)
        power = axis.power()
        assert machine.run_until(power.status, 2.0)
        assert machine.run_until(axis.home(10.0, mode=0).done, 1.0)
        move = axis.move_absolute(60.0)
        assert machine.run_until(move.done, 3.0)
        assert axis.var("ActualPosition") == pytest.approx(60.0, abs=0.1)
        assert axis.var("StatusSynchronizedMotion.StatusWord") == 0
        axis.write("PositionLimits_SW.MaxPosition", 100.0)
        axis.write("PositionLimits_SW.Active", True)
        axis.move_velocity(50.0)
        assert machine.run_until(lambda: axis.var("ErrorDetail.Number") == 533, 3.0)
        machine.run_for(0.5)
        assert axis.var("Position") == pytest.approx(100.0, abs=1e-3)
        power = axis.power(False, stop_mode=1)
        assert machine.run_until(power.off, 3.0)


@pytest.mark.requirement("CFG-015", "CFG-196", "CFG-197", "STP-559")
@pytest.mark.parametrize("name", ["reference", "profidrive"])
def test_alarms(name):
    """A fault of the drive disables it as any axis, on either profile, and goes with the acknowledgement."""
    with synchronous(name) as machine:
        axis = machine.axis()
        power = axis.power()
        assert machine.run_until(power.status, 2.0)
        axis.move_velocity(50.0)
        machine.run_for(0.5)
        machine.drive().raise_fault(0x2310 if name == "reference" else 7902)
        machine.run_for(1.0)
        assert (axis.var("ErrorDetail.Number"), axis.var("ErrorDetail.Reaction")) == (421, 4)
        assert machine.run_until(axis.reset().done, 2.0)
        assert machine.run_until(power.status, 2.0)


@pytest.mark.requirement("CFG-015", "CFG-022")
def test_virtual():
    """Virtual like a positioning axis."""
    with synchronous(
        **{"[axis.axis1.variables]": '[axis.axis1.variables]\n"VirtualAxis.Mode" = 1'}
    ) as machine:
        axis = machine.axis()
        power = axis.power()
        machine.run_for(0.02)
        assert power.status()
        assert machine.run_until(axis.home(0.0, mode=0).done, 1.0)
        assert machine.run_until(axis.move_absolute(5.0).done, 2.0)
        assert machine.drive().mechanics.position == 0.0
