"""The actual speed of an encoder with a telegram of its own, 83: rotary and linear, its reference, as encoder
of an axis or apart.
"""

from __future__ import annotations

import pytest

from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from motion.s7.axis.assembly import mechanics_of
from motion.s7.variables import VariableStore

WHEEL = """
[encoder.wheel]
segment = "can0"
node_id = 20
profile = "profidrive"
type = "incremental_rotary"
steps_per_revolution = 1024
on = "drive1"
{mounting}

[encoder.wheel.profidrive]
telegram = 83
fine_xist1_bits = 8
reference_speed = 3000.0
"""
LOAD = 'mounting = "load"\nmm_per_revolution = 100.0'
SCALE = """
[encoder.scale]
segment = "can0"
node_id = 21
profile = "profidrive"
on = "drive1"
mounting = "load"
type = "absolute_linear"
measuring_step_um = 20.0

[encoder.scale.profidrive]
telegram = 83
reference_speed = 1000.0
"""


def moving(encoder, name, velocity=100.0, apart="", **variables):
    """Return a bench whose axis moves on its motor encoder, with another one in addition."""
    text = read("reference")[1]
    lines = "".join(f'"{path}" = {value}\n' for path, value in variables.items())
    if not apart:
        text = text.replace('drive = "drive1"\n', f'drive = "drive1"\nencoders = ["drive1", "{name}"]\n', 1)
        text = text.replace("[axis.axis1.variables]\n", "[axis.axis1.variables]\n" + lines)
    machine = Bench(parse(text + encoder + apart, "bench.toml"), seed=1)
    axis = machine.axis()
    power = axis.power()
    assert machine.run_until(power.status, 2.0)
    assert machine.run_until(axis.move_velocity(velocity).in_velocity, 2.0)
    machine.run_for(0.2)
    return machine


class TestEncoderOfAnAxis:
    """`Sensor[2]` with `ActualVelocityMode` = 1."""

    @pytest.mark.requirement("CFG-340", "CFG-336", "CFG-305", "CFG-432", "CFG-219", "CFG-356")
    def test_wheel(self):
        """A wheel at the load, 100 mm per revolution: 60 rpm of it are 100 mm/s, whatever the motor turns."""
        settings = {
            "Sensor[2].ActualVelocityMode": 1,
            "Sensor[2].MountingMode": 2,
            "Sensor[2].Parameter.DistancePerRevolution": 100.0,
        }
        with moving(WHEEL.format(mounting=LOAD), "wheel", **settings) as machine:
            axis = machine.axis()
            assert axis.var("Sensor[2].Parameter.ReferenceSpeed") == 3000.0
            assert axis.var("StatusSensor[2].Velocity") == pytest.approx(100.0, abs=1.0)
            assert axis.var("StatusSensor[2].Velocity") == pytest.approx(
                axis.var("StatusSensor[1].Velocity"), abs=8.0
            )

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-340", "CFG-598", "CFG-305")
    def test_a_wrong_reference(self):
        """The reference is the variable of the encoder: half of it shows half of the velocity, and the right
        position.
        """
        settings = {
            "Sensor[2].ActualVelocityMode": 1,
            "Sensor[2].MountingMode": 2,
            "Sensor[2].Parameter.DistancePerRevolution": 100.0,
            "Sensor[2].Parameter.ReferenceSpeed": 1500.0,
        }
        with moving(WHEEL.format(mounting=LOAD), "wheel", **settings) as machine:
            axis = machine.axis()
            assert axis.var("StatusSensor[2].Velocity") == pytest.approx(50.0, abs=0.5)
            before = axis.var("StatusSensor[2].Position"), axis.var("StatusSensor[1].Position")
            machine.run_for(0.5)
            moved = (
                axis.var("StatusSensor[2].Position") - before[0],
                axis.var("StatusSensor[1].Position") - before[1],
            )
            assert moved[0] == pytest.approx(moved[1], abs=0.5)

    @pytest.mark.requirement("CFG-340", "CFG-336", "CFG-305", "CFG-302")
    def test_scale(self):
        """A linear encoder has a reference velocity, here 60 m/min, and shows the velocity of the slide."""
        with moving(SCALE, "scale", -80.0, **{"Sensor[2].ActualVelocityMode": 1}) as machine:
            axis = machine.axis()
            assert axis.var("Sensor[2].Parameter.ReferenceVelocity") == pytest.approx(60.0)
            assert axis.var("StatusSensor[2].Velocity") == pytest.approx(-80.0, abs=0.5)


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-340", "CFG-336", "CFG-219", "CFG-198")
@pytest.mark.parametrize(
    ("encoder", "name"), [(WHEEL.format(mounting='mounting = "motor"'), "wheel"), (SCALE, "scale")]
)
def test_external_encoder(encoder, name):
    """An external encoder shows the same: a rotary one with lead 10 mm at the motor, a linear one at the
    load.
    """
    apart = f"""
[external_encoder.ext]
encoder = "{name}"
[external_encoder.ext.variables]
"Sensor.ActualVelocityMode" = 1
"Mechanics.LeadScrew" = 10.0
"""
    with moving(encoder, name, 90.0, apart) as machine:
        assert machine.external_encoder("ext").var("ActualVelocity") == pytest.approx(90.0, abs=0.5)


@pytest.mark.requirement("CFG-341")
@pytest.mark.parametrize("direction", [False, True])
def test_number_of_the_specification(direction):
    """1000 0000h of 3000 rpm with a pitch of 10 mm are 125 mm/s; an inverted encoder shows them negative."""
    store = VariableStore(
        "PositioningAxis",
        {
            "Mechanics.LeadScrew": 10.0,
            "Sensor[1].Parameter.ReferenceSpeed": 3000.0,
            "Sensor[1].InverseDirection": direction,
        },
    )
    scale = mechanics_of(store, apart=(True,)).sensors[0]
    shown = 0x1000_0000 / 0x4000_0000 * scale.reference * scale.unit_per_rpm
    assert shown == pytest.approx(-125.0 if direction else 125.0)


@pytest.mark.requirement("CFG-339", "CFG-340")
def test_drive_telegram_needs_no_reference():
    """In a drive telegram the reference of the drive counts, whatever stands at the sensor."""
    store = VariableStore(
        "PositioningAxis", {"Sensor[1].Parameter.ReferenceSpeed": 1.0, "LoadGear.Numerator": 2}
    )
    assert mechanics_of(store, apart=(False,)).sensors[0].unit_per_rpm == pytest.approx(10.0 / 60.0 / 2)
