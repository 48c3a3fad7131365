"""Profile position: what becomes of setpoints that wait when the axis is held up, or the mode is left and
entered again.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from emulators.drive.cia402 import DriveConfig, RotaryAxisConfig
from fieldbus.clock import MS
from testcases.unit.emulators.conftest import DriveBench

REV = 131072
SPEED = 1_200_000
"""6081h, 10^-3 rpm."""


def pp_bench(*, endless: bool = True, **objects: int) -> DriveBench:
    """Return a bench in pp, 1200 rpm and 6000 rpm/s, on an endless axis without friction or on the reference
    axis.
    """
    config = DriveConfig.reference()
    if endless:
        config = replace(config, mechanics=RotaryAxisConfig(coulomb_friction=0.0, viscous_friction=0.0))
    bench = DriveBench(config)
    bench.configure({0x6081: SPEED, 0x6083: 6_000_000, 0x6084: 6_000_000})
    bench.configure({int(key[1:], 16): value for key, value in objects.items()})
    bench.enable(1)
    return bench


def give(bench: DriveBench, target: int, bits: int = 0) -> None:
    """Hand a setpoint over as the handshake wants it; bit 12 tells whether it was taken."""
    bench.write(0x607A, target)
    bench.control(0x1F | bits, 0.004)
    assert bench.status & 0x1000
    bench.control(0x0F | bits, 0.004)


@pytest.mark.requirement("C402-092", "C402-161")
@pytest.mark.parametrize("bits", [0, 0x20, 0x200], ids=["waits", "immediately", "change on setpoint"])
def test_a_limit_switch_gives_waiting_set_points_up(bits):
    """Behind a target that a limit switch bars nothing waits for ever: bit 12 goes, and the next setpoint
    leads away.
    """
    bench = pp_bench(endless=False)
    give(bench, 30 * REV)
    give(bench, 40 * REV, bits & ~0x20)
    bench.run(0.2)
    bench.drive.force_input("positive_limit", True)
    bench.run(1.0)
    assert bench.status & 0x1C00 == 0x0800, "stands at the switch, target not reached, ready for a setpoint"
    give(bench, REV, bits)
    bench.run(3.0)
    assert bench.read(0x6064) == pytest.approx(REV, abs=2)
    assert bench.status & 0x1400 == 0x0400


@pytest.mark.requirement("C402-076", "C402-092")
def test_change_on_set_point_survives_a_halt():
    """Bit 9: the first target is passed with 6081h also if the axis was halted on the way."""
    bench = pp_bench()
    give(bench, 10 * REV)
    give(bench, 20 * REV, 0x200)
    bench.control(0x30F, 0.5)
    assert bench.status & 0x400
    speeds: list[int] = []

    def watch() -> None:
        if abs(bench.read(0x6064) - 10 * REV) < REV:
            speeds.append(bench.read(0x606C))

    bench.scheduler.every(MS, watch)
    bench.control(0x20F, 2.5)
    assert bench.read(0x6064) == pytest.approx(20 * REV, abs=2)
    assert len(speeds) > 50
    assert min(speeds) == pytest.approx(SPEED, rel=1e-3)


@pytest.mark.requirement("C402-089", "C402-091")
@pytest.mark.parametrize("halt_before", [False, True], ids=["halted in pv", "halted in pp"])
def test_a_set_point_is_forgotten_when_the_mode_is_left(halt_before):
    """A target of pp does not come back to life when another mode was in force meanwhile, whoever is
    halted.
    """
    bench = pp_bench()
    give(bench, 100 * REV)
    bench.run(0.3)
    if halt_before:
        bench.control(0x10F, 0.5)
    bench.write(0x6060, 3)
    bench.control(0x10F, 0.5)
    bench.write(0x6060, 1)
    bench.run(0.1)
    before = bench.read(0x6064)
    bench.control(0x0F, 1.0)
    assert bench.read(0x6064) == pytest.approx(before, abs=2)
    assert bench.status & 0x1400 == 0x0400


@pytest.mark.requirement("C402-089", "C402-093", "C402-155")
def test_pp_entered_in_motion_begins_where_it_comes_to_rest():
    """Bit 10 comes at rest, not before, also with a position window; a relative setpoint counts from
    there.
    """
    bench = pp_bench(_6067=20, _6068=5)
    bench.write(0x60FF, SPEED)
    bench.write(0x6060, 3)
    bench.run(0.5)
    bench.write(0x6060, 1)
    bench.run(0.05)
    assert bench.read(0x606C) > 100_000
    assert not bench.status & 0x400
    bench.run(1.0)
    assert bench.status & 0x400
    rest = bench.read(0x6064)
    give(bench, REV, 0x40)
    bench.run(1.0)
    assert bench.read(0x6064) == pytest.approx(rest + REV, abs=4)
    assert bench.status & 0x400


@pytest.mark.requirement("C402-095", "C402-103")
@pytest.mark.parametrize("mode", [1, 8], ids=["pp", "csp"])
def test_catching_up_keeps_the_motor_below_its_speed_limit(mode):
    """A following error, however large, does not drive the motor beyond 6080h (by more than 5 %); bit 11
    tells it.
    """
    bench = DriveBench(replace(DriveConfig.reference(sync_period_ms=1), following_error="status"))
    bench.configure({0x6081: SPEED, 0x6083: 6_000_000, 0x6084: 6_000_000, 0x6072: 27})
    bench.enable(1)
    give(bench, 20 * REV)
    bench.run(2.0)
    error = bench.read(0x60F4)
    assert error > 5 * REV
    if mode == 8:
        bench.write(0x6060, 8)
        bench.run(0.002)
    seen: list[tuple[int, int]] = []
    bench.scheduler.every(MS, lambda: seen.append((bench.read(0x606C), bench.status)))
    bench.write(0x6072, 3000)
    bench.run(1.0)
    assert 2_900_000 < max(speed for speed, _ in seen) < 3_200_000
    assert all(status & 0x800 for speed, status in seen if speed > 3_100_000)
    assert bench.read(0x6064) == pytest.approx(20 * REV, abs=2)
    assert not bench.status & 0x800
