"""Home cams, workpieces, index and homing options of a bench file, and the faults at probe inputs and
index.
"""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from emulators.drive.cia402.homing_methods import supported_methods
from fieldbus.canopen import PumpedNetwork
from hil.bench import BenchFile, BenchFileError
from hil.bench.drives import object_dictionary
from hil.faults import Injector, at

TEXT = """
[bench]
name = "probes"

[segment.can0]

[drive.drive1]
segment = "can0"
node_id = 5
increments_per_revolution = 10000
{drive}

[drive.drive1.switches]
{switches}

[drive.drive1.homing]
{homing}

[axis.axis1]
drive = "drive1"

[axis.axis1.variables]
"Sensor[1].Parameter.StepsPerRevolution" = 10000
"Sensor[1].Parameter.FineResolutionXist1" = 0
"""


def file(*, drive: str = "", switches: str = "", homing: str = "") -> BenchFile:
    return BenchFile("own.toml", TEXT.format(drive=drive, switches=switches, homing=homing))


def run_at(bench, velocity: float) -> None:
    """Enable the axis and let it move, mm/s."""
    axis = bench.axis()
    power = axis.power()
    assert bench.run_until(lambda: power.Status, 3.0)
    job = axis.move_velocity(velocity)
    assert bench.run_until(lambda: job.InVelocity, 3.0)


@pytest.mark.exhaustive
def test_switches_index_and_homing_come_from_the_file():
    """Cam, one-sided switches, workpieces, index place, filter and homing options reach the emulated
    drive.
    """
    with file(
        drive="index_increments = 2500",
        switches="home_from_mm = -3.0\nhome_to_mm = 4.5\nprobe1_from_mm = 10.0\nprobe2_to_mm = "
        "-20.0\ninput_filter_ms = 1.5",
        homing='offset = "vendor"\nmove = "zero"\nhard_stop_methods = { "-1" = "negative", "-2" = '
        '"unsupported" }',
    ).build() as bench:
        drive = bench.drive()
        home, probe1, probe2 = (drive.switches[name] for name in ("home", "probe1", "probe2"))
        assert (home.low, home.high, home.hysteresis) == (-0.003, 0.0045, 0.0005)
        assert (probe1.low, probe1.high, probe1.hysteresis) == (0.010, math.inf, 0.0)
        assert (probe2.low, probe2.high) == (-math.inf, -0.020)
        assert drive.config.encoder.zero_mark_counts == 2500
        assert (drive.config.homing.offset, drive.config.homing.move) == ("vendor", "zero")
        assert drive.config.switches.filter_s("home") == 0.0015
        assert [number for number in supported_methods(drive.config.homing) if number < 0] == [-4, -3, -1]
        assert [drive.peek(0x60E3, sub) for sub in (1, 2, 3, 4)] == [-4, -3, -1, 1]
        assert drive.inputs & 0x30004 == 0x4
    with file().build() as bench:
        assert bench.drive().switches["home"].high == -0.5


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"switches": "home_from_mm = 5.0\nhome_to_mm = 5.0"},
            r"home_from_mm: 5\.0 is not allowed; allowed: less than home_to_mm = 5",
        ),
        (
            {"switches": "home_mm = 5.0\nhome_to_mm = 6.0"},
            r"home_mm: 5\.0 is not allowed; allowed: left out with",
        ),
        ({"switches": "probe1_from_mm = 2.0\nprobe1_to_mm = 1.0"}, "probe1_from_mm"),
        ({"drive": "index_increments = 10000"}, "index_increments: 10000 is not below"),
        (
            {"homing": 'hard_stop_methods = { "-5" = "positive" }'},
            "hard_stop_methods: '-5' is not allowed; allowed: '-1', '-2', '-3' or '-4'",
        ),
        ({"homing": 'hard_stop_methods = { "-1" = "up" }'}, "negative_index"),
        ({"homing": 'offset = "other"'}, "'profile' or 'vendor'"),
    ],
)
def test_mistakes_are_reported(parts, message):
    """What does not fit together is refused with key, value and what is allowed."""
    with pytest.raises(BenchFileError, match=message):
        file(**parts)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-142", "C402-152", "C402-311")
def test_a_probe_pulse_latches_the_instant_of_the_fault():
    """`probe.pulse` at 1.5001234 s of a moving axis: the drive shows that time, and the position between its
    samples.
    """
    with file().build() as bench, PumpedNetwork(bench.segment(), name="tool") as network:
        run_at(bench, 100.0)
        node = network.add_node(5, object_dictionary())
        node.sdo[0x60B8].raw = 0x31
        when = round(bench.now_s + 0.1, 3) + 0.0001234
        Injector(bench).inject("probe.pulse", "drive1", trigger=at(when), input="probe1", width_s=0.0005)
        samples = []
        mechanics = bench.drive().mechanics
        bench.scheduler.every(
            250_000, lambda: samples.append((bench.scheduler.now / 1e9, mechanics.position)), priority=9
        )
        bench.run_for(0.2)
        assert node.sdo[0x60B9].raw & 7 == 7
        assert node.sdo[0x60D1].raw == round(when * 1e9)
        assert node.sdo[0x60D2].raw == round(when * 1e9) + 500_000
        before, after = next((a, b) for a, b in pairwise(samples) if a[0] <= when < b[0])
        share = (when - before[0]) / (after[0] - before[0])
        position = before[1] + share * (after[1] - before[1])
        assert node.sdo[0x60BA].raw == pytest.approx(position / 0.010 * 10000, abs=1.0)
        assert node.sdo[0x60BB].raw - node.sdo[0x60BA].raw == pytest.approx(50, abs=1)
        (rise, fall) = [event for event in bench.history.events if event.kind == "drive.probe"]
        assert (rise.data["edge"], fall.data["edge"]) == ("positive", "negative")


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-126", "C402-136", "C402-311")
def test_an_index_that_is_missing_as_a_fault():
    """`encoder.index_missing` lasts until it is removed; a probe on the index waits as long."""
    with file().build() as bench, PumpedNetwork(bench.segment(), name="tool") as network:
        run_at(bench, 100.0)
        node = network.add_node(5, object_dictionary())
        armed = Injector(bench).inject("encoder.index_missing", "drive1")
        node.sdo[0x60B8].raw = 0x15
        bench.run_for(0.3)
        assert node.sdo[0x60B9].raw == 0x01
        armed.remove()
        bench.run_for(0.15)
        assert node.sdo[0x60B9].raw == 0x03
        assert node.sdo[0x60BA].raw % 10000 == 0


@pytest.mark.requirement("C402-311")
@pytest.mark.parametrize(
    ("kind", "parameters", "inputs"),
    [("switch.swapped", {}, 0b110), ("switch.inverted", {"input": "home"}, 0b001)],
)
def test_switches_that_are_wired_wrongly(kind, parameters, inputs):
    """Exchanged limit switches and an inverted home switch, until the fault is removed."""
    with file(switches="input_filter_ms = 0.0").build() as bench:
        drive = bench.drive()
        drive.mechanics.place(-0.552)
        assert drive.inputs == 0b101
        armed = Injector(bench).inject(kind, "drive1", **parameters)
        assert drive.inputs == inputs
        armed.remove()
        assert drive.inputs == 0b101
