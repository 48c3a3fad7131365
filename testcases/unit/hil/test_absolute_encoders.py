"""An absolute encoder that has been moved beyond its measuring range, after its supply or that of the
controller has been off.
"""

from __future__ import annotations

import pytest

from hil.bench import BenchFile, BenchFileError, load_bench

pytestmark = pytest.mark.exhaustive

ENCODER = """
[encoder.scale]
segment = "can0"
node_id = 20
profile = "{profile}"
type = "multi_turn"
on = "drive1"
steps_per_revolution = 2048
revolutions = 3  # of a screw of 10 mm: a measuring range of 30 mm
"""


def off_and_on(machine, part):
    """Switch the supply of the encoder or of the controller off and on, with the axis disabled."""
    axis = machine.axis()
    if part == "encoder":
        axis.power(False)
        machine.run_for(0.2)
        machine.encoder("scale").power_off()
        machine.run_for(0.1)
        machine.encoder("scale").power_on()
    else:
        machine.controller.power_off()
        machine.run_for(0.1)
        machine.controller.power_on()
    machine.run_for(0.2)
    assert machine.run_until(lambda: axis.var("StatusSensor[1].State") == 2, timeout=5.0)


@pytest.mark.requirement("CFG-292", "CFG-296", "CFG-297", "HOM-153", "HOM-154", "HOM-155")
@pytest.mark.parametrize("profile", ["cia406", "profidrive"])
@pytest.mark.parametrize("part", ["encoder", "controller"])
@pytest.mark.parametrize(
    ("kind", "way", "shown"), [(1, 100.0, 60.0), (1, -70.0, 70.0), (2, 100.0, 150.0), (2, -70.0, -20.0)]
)
def test_beyond_the_measuring_range(profile, part, kind, way, shown):
    """Of type 1 the ranges passed are lost, whichever supply has been off; of type 2 they are not."""
    text = load_bench("reference").text.replace('drive = "drive1"', 'drive = "drive1"\nencoders = ["scale"]')
    text = "\n".join(line for line in text.splitlines() if not line.startswith('"Sensor[1].'))
    text += f'\n"Sensor[1].Type" = {kind}\n'
    with BenchFile("scale.toml", text + ENCODER.format(profile=profile)).build(seed=0) as machine:
        axis = machine.axis()
        power = axis.power()
        assert machine.run_until(power.status, timeout=2.0)
        assert machine.run_until(axis.home(50.0, mode=7).done, timeout=1.0)
        assert machine.run_until(axis.move_relative(way, Velocity=400.0).done, timeout=5.0)
        before = axis.var("ActualPosition")
        assert before == pytest.approx(50.0 + way, abs=0.1)
        off_and_on(machine, part)
        assert axis.var("ActualPosition") == pytest.approx(shown, abs=0.1)
        assert (axis.var("StatusWord.X5"), axis.var("StatusSensor[1].Adjusted")) == (True, 1)


@pytest.mark.parametrize("bench", ["reference", "profidrive"])
@pytest.mark.parametrize("turns", [-3.25, 0.5, 511.75])
def test_the_encoder_says_how_it_is_mounted(bench, turns):
    """An absolute encoder on the motor shows its place of mounting where the machine is at zero; an
    incremental one has none.
    """
    file = load_bench(bench)
    counts = file.config.drive["drive1"].increments_per_revolution
    mounted = {"mounting_increments": round(turns * counts)}
    absolute = {"Sensor[1].Type": 1, "Sensor[1].Parameter.DeterminableRevolutions": 4096}
    tables = {
        "drive": {"drive1": mounted | {"encoder": "absolute"}},
        "axis": {"axis1": {"variables": absolute}},
    }
    with file.configured(tables).build(seed=1) as machine:
        machine.run_for(0.1)
        assert machine.axis().var("ActualPosition") == pytest.approx(10.0 * turns)
    with pytest.raises(BenchFileError, match=r'mounting_increments: .* needs encoder = "absolute"'):
        file.configured({"drive": {"drive1": mounted}})


@pytest.mark.requirement("CFG-098", "CFG-101")
def test_no_place_in_the_range_before_the_first_value():
    """Until an absolute encoder has brought a value, its offset makes no place: position and cycles are 0."""
    bench = load_bench("reference").configured(
        {
            "drive": {"drive1": {"encoder": "absolute"}},
            "axis": {
                "axis1": {
                    "variables": {
                        "Modulo.Enable": True,
                        "Modulo.Length": 360.0,
                        "Sensor[1].Type": 1,
                        "StatusSensor[1].AbsEncoderOffset": -123456.5,
                    }
                }
            },
        }
    )
    with bench.build(seed=0) as machine:
        axis = machine.axis()
        known = axis.var("ActualModuloCycle")
        machine.controller.power_off()
        machine.drive().power_off()
        machine.run_for(0.1)
        machine.controller.power_on()
        machine.run_for(0.1)
        assert axis.var("StatusSensor[1].State") != 2
        shown = axis.var("ActualPosition"), axis.var("ActualModuloCycle")
        trace = machine.trace()
    assert known != 0
    assert shown == (0.0, 0)
    assert trace["axis1.actual_modulo_cycle"].values[-1] == 0.0
