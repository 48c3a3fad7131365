"""What a controller may ask for while the holding brake still opens."""

from __future__ import annotations

from dataclasses import replace

import pytest

from emulators.drive.cia402 import BrakeConfig, DriveConfig
from testcases.unit.emulators.conftest import DriveBench

REV = 131072


def opening(mode: int, **objects: int) -> DriveBench:
    """Return a bench that is enabled in a mode, with 0.1 s to go until the brake is open."""
    bench = DriveBench(
        replace(
            DriveConfig.reference(),
            brake=BrakeConfig(torque_nm=3.0, opening_time_ms=100.0, closing_time_ms=50.0),
        )
    )
    bench.configure({0x6081: 1_200_000, 0x6083: 6_000_000, 0x6084: 6_000_000})
    bench.configure({int(key[1:], 16): value for key, value in objects.items()})
    bench.write(0x6060, mode)
    for word in (0x06, 0x07, 0x0F):
        bench.control(word, 0.005)
    assert bench.status & 0x6F == 0x27
    return bench


@pytest.mark.requirement("C402-091", "C402-173")
def test_a_set_point_waits_for_the_brake():
    """pp: taken and acknowledged as soon as the axis can move; the controller that waits for bit 12 gets
    it.
    """
    bench = opening(1)
    bench.write(0x607A, REV)
    bench.control(0x1F, 0.05)
    assert not bench.status & 0x1000
    assert bench.read(0x6064) == 0
    bench.run(0.06)
    assert bench.status & 0x1000
    bench.control(0x0F, 1.0)
    assert bench.read(0x6064) == pytest.approx(REV, abs=2)


@pytest.mark.requirement("C402-091", "C402-173")
@pytest.mark.parametrize("enabled_again", [False, True])
def test_a_set_point_that_is_withdrawn_is_none(enabled_again):
    """pp: bit 4 that has gone before the brake is open starts nothing, nor does one from before switching
    off.
    """
    bench = opening(1)
    bench.write(0x607A, REV)
    bench.control(0x1F, 0.02)
    if enabled_again:
        for word in (0x10, 0x16, 0x17, 0x1F):
            bench.control(word, 0.005)
    else:
        bench.control(0x0F, 0.02)
    bench.run(0.5)
    assert bench.read(0x6064) == 0
    assert not bench.status & 0x1000


@pytest.mark.requirement("C402-134", "C402-173")
def test_homing_waits_for_the_brake():
    """hm: the start bit counts when the brake is open; until then the run has not started."""
    bench = opening(6, _6098=37, _607C=500)
    bench.control(0x1F, 0.05)
    assert bench.status & 0x3400 == 0x0400
    bench.run(0.06)
    assert bench.status & 0x3400 == 0x1400
    assert bench.read(0x6064) == -500


@pytest.mark.requirement("C402-097", "C402-098", "C402-173")
@pytest.mark.parametrize(("mode", "index", "target"), [(3, 0x60FF, 600_000), (4, 0x6071, 100)])
def test_nothing_is_reached_while_the_brake_opens(mode, index, target):
    """pv, tq: bit 10 is 0 as long as the axis is held although it has a target."""
    bench = opening(mode, **{f"_{index:04X}": target})
    bench.run(0.05)
    assert not bench.status & 0x400
    bench.run(0.5)
    assert bench.status & 0x400
