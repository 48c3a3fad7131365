"""How drives and encoders are connected to an axis: kinds of drives, with and without the clock of the bus,
directions.
"""

from __future__ import annotations

import pytest

from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from testcases.unit.hil.test_hil_profidrive import bench, enabled

pytestmark = pytest.mark.exhaustive

WHEEL = """
[encoder.wheel]
segment = "can0"
node_id = 20
profile = "profidrive"
type = "incremental_rotary"
steps_per_revolution = 1024
on = "drive1"
mounting = "motor"
reversed = {reversed}

[external_encoder.ext]
encoder = "wheel"
[external_encoder.ext.variables]
"Mechanics.LeadScrew" = 10.0
"Sensor.InverseDirection" = {inverse}
"""


@pytest.mark.requirement("CFG-178", "CFG-009", "CFG-013")
@pytest.mark.parametrize(("name", "kind"), [("profidrive", 1), ("analog", 0), ("stepper", 1)])
def test_kind_of_drive(name, kind):
    """Analog output or telegram: `Actor.Type` tells, and the axis controls its position through either."""
    with Bench(load_bench(name).config, seed=1) as machine:
        axis = machine.axis()
        assert axis.var("Actor.Type") == kind
        power = axis.power()
        assert machine.run_until(power.status, 3.0)
        assert machine.run_until(axis.home(100.0, mode=0).done, 1.0)
        before = machine.drive().mechanics.position * 1000.0
        assert machine.run_until(axis.move_absolute(110.0, Velocity=20.0).done, 5.0)
        machine.run_for(0.3)
        assert machine.drive().mechanics.position * 1000.0 - before == pytest.approx(10.0, abs=0.2)


@pytest.mark.requirement("CFG-182", "CFG-192", "CFG-286")
@pytest.mark.parametrize("isochronous", [True, False])
def test_with_and_without_the_clock_of_the_bus(isochronous):
    """Without sign of life, cyclically, the axis works too; its actual value is that of the encoder at the
    drive.
    """
    with bench(profidrive={"sign_of_life": isochronous}) as machine:
        axis = enabled(machine)
        start = axis.var("ActualPosition"), machine.drive().mechanics.position
        assert machine.run_until(axis.move_relative(30.0).done, 5.0)
        assert axis.port.watches_sign_of_life is isochronous
        way = (machine.drive().mechanics.position - start[1]) * 1000.0
        assert axis.var("ActualPosition") - start[0] == pytest.approx(way, abs=0.05)


@pytest.mark.requirement("CFG-531", "CFG-532")
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("inverse", [False, True])
def test_direction_of_an_external_encoder(turned, inverse):
    """While the axis moves in positive direction a G1_XIST1 that falls asks for the inversion, one that rises
    does not.
    """
    text = WHEEL.format(reversed=str(turned).lower(), inverse=str(inverse).lower())
    with Bench(parse(read("reference")[1] + text, "bench.toml"), seed=1) as machine:
        axis = machine.axis()
        power = axis.power()
        assert machine.run_until(power.status, 2.0)
        encoder = machine.external_encoder("ext")
        axis.move_velocity(20.0)
        machine.run_for(0.3)
        count = encoder.object.port.increments
        machine.run_for(0.5)
        assert (encoder.object.port.increments < count) is turned
        shown = encoder.var("ActualVelocity")
        assert shown == pytest.approx(20.0 if turned is inverse else -20.0, abs=1.0)
