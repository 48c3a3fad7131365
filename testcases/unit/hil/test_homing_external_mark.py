"""Homing on an external zero mark of a PROFIdrive axis (§5.11.10)."""

from __future__ import annotations

import pytest

from testcases.unit.hil.homing_bench import STEEP, Machine, homing_bench


@pytest.mark.exhaustive
@pytest.mark.requirement("HOM-168", "HOM-169", "HOM-170", "HOM-171", "HOM-069", "HOM-039")
@pytest.mark.parametrize(("inverted", "mark"), [(0, 20.0), (1, 22.0)])
@pytest.mark.parametrize("negative", [False, True])
def test_end_of_the_signal(inverted, mark, negative):
    """Active from 20 to 22 mm: the mark is 20 in either direction, inverted 22; those of the encoder do not
    count.
    """
    variables = STEEP | {"Sensor[1].ActiveHoming.Direction": int(negative)}
    switches = {"probe1_from_mm": 20.0, "probe1_to_mm": 22.0}
    start = {"start_position_mm": 40.0 if negative else 0.0}
    with homing_bench(variables=variables, switches=switches, mechanics=start) as bench:
        parameters = bench.drive().parameters
        parameters.write("p0490", inverted)
        parameters.write("p0495", 1)
        run = Machine(bench)
        run.done(100.0)
        assert run.place - run.position == pytest.approx(mark - 100.0, abs=10.0 / 2048)


@pytest.mark.requirement("HOM-170")
def test_back_to_the_encoder():
    """p0495 = 0 is the zero mark of the encoder again."""
    with homing_bench(variables=STEEP, switches={"probe1_from_mm": 20.0, "probe1_to_mm": 22.0}) as bench:
        parameters = bench.drive().parameters
        parameters.write("p0495", 1)
        parameters.write("p0495", 0)
        run = Machine(bench)
        run.done(100.0)
        assert run.place - run.position == pytest.approx(3.0 - 100.0, abs=0.01)
