"""Measuring inputs at the probes of emulated drives, CiA 402 and PROFIdrive, and homing on the encoder."""

from __future__ import annotations

import pytest

from hil.bench import BenchFile, BenchFileError, load_bench

pytestmark = pytest.mark.exhaustive

SWITCHES = """
[drive.drive1.switches]
probe1_from_mm = 20.0
probe1_to_mm = 50.0
probe2_from_mm = 30.0
"""
TABLES = """
[measuring_input.mark]
of = "axis1"

[measuring_input.central]
of = "axis1"
kind = "central"
probe = 2
"""


def text_of(name):
    text = load_bench(name).text
    if "[drive.drive1.switches]\n" in text:
        head, rest = text.split("[drive.drive1.switches]\n", 1)
        text = head + SWITCHES + rest
    else:
        text = text.replace("[axis.axis1]\n", f"{SWITCHES}\n[axis.axis1]\n")
    return text + TABLES


@pytest.mark.parametrize("name", ["reference", "profidrive"])
def test_a_workpiece_is_measured(name):
    """Its ends, at 20 and 50 mm, whatever the cycle is; then that of the second probe, again and again; then
    the axis is homed, which ends the measuring job, and the search for the zero mark finds its mark.
    """
    with BenchFile("own.toml", text_of(name)).build(seed=4) as bench:
        axis, mark, central = bench.axis(), bench.measuring_input("mark"), bench.measuring_input("central")
        assert bench.run_until(axis.power().status, 3.0)
        offset = axis.var("ActualPosition") - bench.drive().mechanics.position * 1000.0
        job = mark.measure(3)
        axis.move_velocity(103.7)
        assert bench.run_until(job.ended, 3.0)
        assert job.Done
        found = job.MeasuredValue1 - offset, job.MeasuredValue2 - offset
        assert found == (pytest.approx(20.0, abs=0.01), pytest.approx(50.0, abs=0.01))
        refused = mark.measure_cyclic()
        bench.run_for(0.02)
        assert (refused.ErrorID, mark.var("ErrorDetail.Number")) == (0x8001, 755)
        cyclic = central.measure_cyclic(2)
        for velocity in (-100.0, 100.0, -100.0):
            axis.move_velocity(velocity)
            bench.run_for(0.9)
        assert cyclic.MeasuredValue1Counter >= 1
        assert cyclic.MeasuredValue2Counter >= 1
        values = cyclic.MeasuredValue1 - offset, cyclic.MeasuredValue2 - offset
        assert values == (pytest.approx(30.0, abs=0.01), pytest.approx(30.0, abs=0.01))
        home = axis.home(0.0, mode=2)
        bench.run_for(0.02)
        assert (cyclic.ErrorID, home.Busy) == (0x80A3, True)
        late = central.measure()
        bench.run_for(0.02)
        assert late.ErrorID == 0x80A3
        axis.move_velocity(100.0)
        assert bench.run_until(home.done, 5.0), "the zero mark is found behind a measuring job"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('of = "axis1"\n\n', 'of = "axis2"\n\n', "measuring_input.mark.of: 'axis2' is not an axis.*axis1"),
        ("probe = 2", "probe = 3", "measuring_input.central.probe"),
        ('kind = "central"', 'kind = "timer"', "measuring_input.central.kind"),
    ],
)
def test_mistakes_of_the_bench_file(old, new, message):
    """Each says where it is, and what is allowed."""
    text = text_of("reference")
    assert old in text
    with pytest.raises(BenchFileError, match=message):
        BenchFile("own.toml", text.replace(old, new, 1)).build(seed=1)
