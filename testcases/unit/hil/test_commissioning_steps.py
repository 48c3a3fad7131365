"""Steps of the commissioning sequence that take a bench of their own: absolute encoders, further axes
(§6.1).
"""

from __future__ import annotations

import pytest

from hil.bench import BenchFile, load_bench

pytestmark = pytest.mark.exhaustive

SCALE = """
[encoder.scale]
segment = "can0"
node_id = 20
profile = "profidrive"
on = "drive1"
mounting = "load"
type = "absolute_linear"
measuring_step_um = 20.0
length_mm = 2000.0
offset_mm = {offset}
"""
SECOND = """
[drive.drive2]
segment = "can0"
node_id = 6

[axis.axis2]
type = "positioning"
drive = "drive2"
"""


def taken(machine, name=None):
    panel = machine.axis(name).control_panel()
    panel.take_control()
    panel.enable()
    assert machine.run_until(lambda: panel.enabled, timeout=3.0)
    return panel


def released(machine, panel):
    panel.release()
    assert machine.run_until(lambda: not panel.active, timeout=5.0)


@pytest.mark.requirement("COM-021", "COM-022", "COM-073")
def test_further_axes():
    """A panel per axis, one after the other and both at once: each moves its own axis, and neither opens that
    of the other.
    """
    text = load_bench("reference").text
    variables = text[text.index("[axis.axis1.variables]") :].replace("axis1", "axis2")
    with BenchFile("two.toml", text + SECOND + variables).build(seed=0) as machine:
        for name, other in (("axis1", "axis2"), ("axis2", "axis1")):
            panel = taken(machine, name)
            assert machine.run_until(panel.move_relative(20.0).done, timeout=5.0)
            assert machine.axis(name).var("ActualPosition") == pytest.approx(20.0, abs=0.05)
            assert not machine.axis(other).var("StatusWord.X4")
            assert not machine.axis(other).var("StatusWord.X0")
            released(machine, panel)
            machine.axis(name).home(0.0)
            machine.run_for(0.05)
        panels = [taken(machine, name) for name in ("axis1", "axis2")]
        jobs = [panel.move_relative(way) for panel, way in zip(panels, (15.0, -15.0), strict=True)]
        assert machine.run_until(lambda: all(job.Done for job in jobs), timeout=5.0)
        assert [round(machine.axis(name).var("ActualPosition")) for name in ("axis1", "axis2")] == [15, -15]
        panels[0].disconnect()  # one connection is lost: the other axis goes on
        panels[1].jog(10.0)
        machine.run_for(3.0)
        assert (panels[0].active, panels[0].error_id) == (False, 0x8013)
        assert (panels[1].active, panels[1].error_id) == (True, 0)
        assert machine.axis("axis2").var("Velocity") > 0.0
        released(machine, panels[1])


@pytest.mark.requirement("COM-013", "HOM-154")
@pytest.mark.parametrize(("offset", "right"), [(1000.0, True), (200.0, False)])
def test_an_absolute_encoder_at_both_ends_of_the_travel(offset, right):
    """Power off and on at the start and at the end: the position is right, unless the zero of the encoder
    lies between the two.
    """
    text = load_bench("reference").text.replace('drive = "drive1"', 'drive = "drive1"\nencoders = ["scale"]')
    text = "\n".join(
        line for line in text.splitlines() if not line.startswith('"Sensor[1].')
    )  # those of the motor's encoder
    with BenchFile("scale.toml", text + SCALE.format(offset=offset)).build(seed=0) as machine:
        axis, mechanics = machine.axis(), machine.drive().mechanics
        assert machine.run_until(axis.home(0.0, mode=7).done, timeout=1.0)
        deviations = []
        for end in (300.0, -300.0):
            panel = taken(machine)
            panel.velocity = 400.0
            assert machine.run_until(panel.move_absolute(end).done, timeout=10.0)
            released(machine, panel)
            machine.controller.power_off()
            machine.encoder("scale").power_off()
            machine.run_for(0.2)
            machine.encoder("scale").power_on()
            machine.controller.power_on()
            assert machine.run_until(lambda: axis.var("StatusSensor[1].State") == 2, timeout=5.0)
            machine.run_for(0.2)
            assert machine.run_until(axis.reset().done, timeout=2.0)
            deviations.append(axis.var("ActualPosition") - 1000.0 * mechanics.position)
            if abs(deviations[-1]) > 1.0:
                break
        assert axis.var("StatusWord.X5")  # it believes itself homed: only the step of the sequence shows it
        if right:
            assert deviations == pytest.approx([0.0, 0.0], abs=0.05)
        else:
            assert deviations == pytest.approx([0.0, 2000.0], abs=0.05)
