"""Four encoders on one axis, each with a place, a scale and troubles of its own (section 8.4 of the
instruction specification).
"""

from __future__ import annotations

import pytest

from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from hil.faults import Injector
from motion.s7.instructions import MC_Home

ENCODER = """
[encoder.{name}]
segment = "can0"
node_id = {node}
type = "{kind}"
measuring_step_um = {step}
on = "drive1"
mounting = "load"
"""


@pytest.fixture
def machine():
    """The reference bench with three scales at the load next to the encoder of the drive."""
    text = read("reference")[1].replace(
        'drive = "drive1"\n', 'drive = "drive1"\nencoders = ["drive1", "fine", "coarse", "third"]\n'
    )
    for node, name, kind, step in (
        (20, "fine", "absolute_linear", 1.0),
        (21, "coarse", "absolute_linear", 50.0),
        (22, "third", "absolute_linear", 5.0),
    ):
        text += ENCODER.format(name=name, node=node, kind=kind, step=step)
    with Bench(parse(text, "bench.toml"), seed=1) as one:
        axis = one.axis()
        assert one.run_until(axis.power().status, 5.0)
        assert one.run_until(axis.home(100.0).done, 1.0)
        yield one


def shown(machine):
    return [machine.axis().var(f"StatusSensor[{number}].Position") for number in (1, 2, 3, 4)]


@pytest.mark.requirement("MC-586", "MC-378")
def test_scale_and_offset_of_each(machine):
    """Each is adjusted for itself; all show the same travel, within the step of each."""
    axis = machine.axis()
    for number in (2, 3, 4):
        assert machine.run_until(axis.set_sensor(number, mode=2).done, 1.0)
    assert shown(machine) == pytest.approx([100.0] * 4, abs=0.06)
    assert machine.run_until(axis.run(_adjust(axis, 3, 70.0)).done, 1.0)
    machine.run_for(0.02)
    before = shown(machine)
    assert before[2] == pytest.approx(70.0, abs=0.06)
    assert [before[at] for at in (0, 1, 3)] == pytest.approx([100.0] * 3, abs=0.06)
    assert machine.run_until(axis.move_relative(30.0).done, 3.0)
    machine.run_for(0.05)
    travel = [after - one for after, one in zip(shown(machine), before, strict=True)]
    assert travel == pytest.approx([30.0] * 4, abs=0.11)
    assert abs(travel[1] - 30.0) < 0.02


def _adjust(axis, sensor, position):
    return MC_Home(axis.object, Execute=True, Mode=7, Position=position, Sensor=sensor)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-586", "MC-391", "MC-593")
def test_troubles_of_each(machine):
    """Drift on one, noise on another, a third without supply: each shows its own alone, and the axis goes on
    with the second.
    """
    axis = machine.axis()
    assert machine.run_until(axis.set_sensor(2).done, 1.0)
    axis.move_velocity(10.0)
    machine.run_for(0.5)
    faults = Injector(machine)
    faults.inject("encoder.drift", "drive1", increments_per_s=13107.2)
    faults.inject("encoder.power_off", "coarse")
    faults.inject("encoder.noise", "third", increments=40)
    reference = shown(machine)
    offsets = [one - reference[1] for one in reference]
    noise = []
    for _ in range(50):
        machine.run_for(0.004)
        now = shown(machine)
        noise.append(now[3] - now[1] - offsets[3])
    machine.run_for(0.8)
    now = shown(machine)
    assert 0.1 < max(noise) < 0.3
    assert -0.3 < min(noise) < -0.1
    assert now[0] - now[1] - offsets[0] == pytest.approx(1.0, abs=0.1)  # a tenth of a revolution, 10 mm each
    assert [axis.var(f"StatusSensor[{n}].State") for n in (1, 2, 3, 4)] == [2, 2, 0, 2]
    assert axis.var("ErrorWord") == 0
    assert axis.var("ActualVelocity") == pytest.approx(10.0, abs=0.5)
    refused = axis.set_sensor(3)
    machine.run_for(0.02)
    assert refused.ErrorID == 0x8016
    assert machine.run_until(axis.set_sensor(4).done, 1.0)
    assert axis.var("OperativeSensor") == 4
