"""Profile torque mode (tq): slope, shape, limits, stops, by true motion."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.cia402 import DriveConfig, RotaryAxisConfig
from fieldbus.canopen import SdoAbort
from fieldbus.cia402 import DriveState as S
from testcases.unit.emulators.conftest import DriveBench

RATED_NM = 2.0
DT = 0.00025


def tq_bench(*, jammed: bool = True, **objects: int) -> DriveBench:
    """Return a bench in tq, 1000 permille/s, on a rotary axis without friction; `jammed`: the shaft is
    held.
    """
    config = replace(
        DriveConfig.reference(), mechanics=RotaryAxisConfig(coulomb_friction=0.0, viscous_friction=0.0)
    )
    bench = DriveBench(config)
    bench.configure({0x6087: 1000, **{int(key[1:], 16): value for key, value in objects.items()}})
    bench.drive.jam(jammed)
    bench.enable(4)
    return bench


def torques(bench: DriveBench) -> list[float]:
    """Note the torque in permille after every servo step from now on."""
    noted: list[float] = []
    bench.scheduler.every(
        bench.drive.config.servo_period_ns,
        lambda: noted.append(bench.drive.core.torque / RATED_NM * 1000.0),
        priority=5,
    )
    return noted


@pytest.mark.requirement("C402-081", "C402-098", "C402-209", "C402-212", "C402-230")
def test_linear_slope_and_target_reached():
    """6071h = 500 at 1000 permille/s takes 0.5 s along a line; bit 10 is 0 until the demand is there."""
    bench = tq_bench()
    assert bench.status & 0x400
    noted = torques(bench)
    start = bench.scheduler.now
    bench.write(0x6071, 500)
    bench.run(0.25)
    assert not bench.status & 0x400
    assert bench.read(0x6074) == pytest.approx(250, abs=2)
    assert bench.read(0x6077) == pytest.approx(250, abs=2)
    bench.until(lambda: bench.status & 0x400, 1.0)
    assert (bench.scheduler.now - start) / 1e9 == pytest.approx(0.5, abs=0.002)
    bench.run(0.05)
    assert bench.drive.core.torque == pytest.approx(1.0)
    assert [b - a for a, b in pairwise(noted[20:1980])] == pytest.approx([0.25] * 1959, rel=1e-6)


@pytest.mark.requirement("C402-098", "C402-230")
def test_sin2_profile():
    """6088h = 1: the square of a sine, nowhere steeper than 6087h, so it takes pi/2 times as long; others are
    refused.
    """
    bench = tq_bench(_6088=1)
    noted = torques(bench)
    start = bench.scheduler.now
    bench.write(0x6071, -400)
    bench.until(lambda: not bench.status & 0x400, 0.1)
    bench.until(lambda: bench.status & 0x400, 1.0)
    time = 0.4 * math.pi / 2
    assert (bench.scheduler.now - start) / 1e9 == pytest.approx(time, abs=0.003)
    steps = [(b - a) / DT for a, b in pairwise(noted)]
    assert min(steps) == pytest.approx(-1000, rel=2e-3)
    first = next(i for i, torque in enumerate(noted) if torque != 0.0) - 1
    for share in (0.1, 0.25, 0.5, 0.8):
        expected = -400 * math.sin(math.pi / 2 * share) ** 2
        assert noted[first + round(share * time / DT)] == pytest.approx(expected, abs=1.5)
    for value in (2, -1):
        with pytest.raises(SdoAbort) as refusal:
            bench.write(0x6088, value)
        assert refusal.value.code == 0x06090030


@pytest.mark.requirement("C402-098", "C402-210", "C402-261", "C402-045")
@pytest.mark.parametrize(
    ("limit", "value", "target", "reached"),
    [(0x6072, 300, 900, 300), (0x60E0, 250, 900, 250), (0x60E1, 150, -900, -150), (0x6073, 200, -900, -200)],
)
def test_torque_limits(limit, value, target, reached):
    """6072h, 6073h, 60E0h, 60E1h hold the torque; bit 11 = 1 and bit 10 = 0, because the target is not
    reached.
    """
    bench = tq_bench(**{f"_{limit:04X}": value})
    bench.write(0x6071, target)
    bench.run(1.2)
    assert bench.read(0x6077) == reached
    assert bench.status & 0xC00 == 0x800
    bench.write(0x6071, reached // 2)
    bench.run(0.3)
    assert bench.read(0x6077) == reached // 2
    assert bench.status & 0xC00 == 0x400


@pytest.mark.requirement("C402-098", "C402-224")
def test_speed_limit():
    """6080h: a free shaft speeds up to the limit and stays there, bit 11 = 1."""
    bench = tq_bench(jammed=False, _6080=700)
    bench.write(0x6071, 200)
    bench.run(1.0)
    assert bench.drive.core.speed_rpm == pytest.approx(700, rel=0.02)
    assert bench.status & 0x800


@pytest.mark.requirement("C402-074", "C402-076", "C402-044", "C402-063", "C402-064")
@pytest.mark.parametrize("option", [1, 2])
def test_halt_takes_the_torque_to_zero_with_the_slope(option):
    """605Dh = 1, 2: the torque falls with 6087h; bit 10 = 1 at standstill; the release ramps up again."""
    bench = tq_bench(_605D=option)
    bench.write(0x6071, 400)
    bench.run(0.6)
    noted = torques(bench)
    bench.control(0x10F, 0.2)
    assert noted[-1] == pytest.approx(200, abs=4)
    assert not bench.status & 0x400
    assert max(a - b for a, b in pairwise(noted)) == pytest.approx(0.25, rel=1e-3)
    bench.run(0.3)
    assert bench.drive.core.torque == 0.0
    assert bench.status & 0x400
    assert bench.state is S.OPERATION_ENABLED
    bench.control(0x0F, 0.2)
    assert noted[-1] == pytest.approx(200, abs=4)
    bench.run(0.3)
    assert bench.read(0x6077) == 400


@pytest.mark.requirement("C402-065", "C402-066", "C402-076")
@pytest.mark.parametrize("option", [3, 4])
def test_halt_at_the_limit_brakes_a_turning_axis(option):
    """605Dh = 3, 4: the axis is braked at the torque limit to standstill."""
    bench = tq_bench(jammed=False, _605D=option, _6072=500)
    bench.write(0x6071, 100)
    bench.run(0.4)
    speed = bench.drive.core.velocity
    assert speed > 100.0
    start = bench.scheduler.now
    bench.control(0x10F, 0.002)
    assert not bench.status & 0x400
    bench.until(lambda: abs(bench.drive.core.velocity) < 20.0, 1.0)
    inertia = bench.drive.mechanics.motor_inertia
    assert (bench.scheduler.now - start) / 1e9 == pytest.approx((speed - 20.0) * inertia / 1.0, rel=0.02)
    bench.until(lambda: bench.status & 0x400, 0.1)
    assert bench.drive.core.standing


@pytest.mark.requirement("C402-074", "C402-055", "C402-058", "C402-060", "C402-062", "C402-069")
@pytest.mark.parametrize(
    ("command", "settings_", "end"),
    [
        ("quick stop", {0x605A: 2}, S.SWITCH_ON_DISABLED),
        ("quick stop", {0x605A: 6}, S.QUICK_STOP_ACTIVE),
        ("shutdown", {0x605B: 1}, S.READY_TO_SWITCH_ON),
        ("disable operation", {0x605C: 1}, S.SWITCHED_ON),
        ("fault", {0x605E: 2}, S.FAULT),
    ],
)
def test_stops_end_when_the_torque_is_zero(command, settings_, end):
    """A stop with a ramp takes the torque to zero with 6087h; then the state changes."""
    bench = tq_bench()
    bench.configure(settings_)
    bench.write(0x6071, 300)
    bench.run(0.5)
    noted = torques(bench)
    start = bench.scheduler.now
    if command == "fault":
        bench.drive.raise_fault(0x8600)
    else:
        bench.control({"quick stop": 2, "shutdown": 6, "disable operation": 7}[command], 0.0)
    bench.run(0.15)
    assert noted[-1] == pytest.approx(150, abs=4)
    bench.until(lambda: bench.state is end and not bench.drive.core.stopping, 1.0)
    assert (bench.scheduler.now - start) / 1e9 == pytest.approx(0.3, abs=0.003)
    assert bench.drive.core.torque == 0.0


@pytest.mark.requirement("C402-165")
def test_polarity_of_the_torque():
    """607Eh bit 5: target, demand, actual value and the two limits are turned together."""
    bench = DriveBench(DriveConfig.reference())
    bench.configure({0x607E: 0x20, 0x6087: 10_000, 0x60E0: 200})
    bench.drive.jam(True)
    bench.enable(4)
    bench.write(0x6071, 500)
    bench.run(0.2)
    assert bench.drive.core.torque == pytest.approx(-0.4)
    assert (bench.read(0x6074), bench.read(0x6077)) == (200, 200)


@pytest.mark.requirement("C402-098")
def test_no_slope_is_at_once():
    """6087h = 0: the torque is there with the next control cycle."""
    bench = tq_bench(_6087=0)
    bench.write(0x6071, 800)
    bench.run(0.003)
    assert bench.read(0x6077) == 800


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-098", "C402-261")
@settings(max_examples=15, deadline=None)
@given(
    targets=st.lists(st.tuples(st.integers(-2500, 2500), st.integers(1, 150)), min_size=1, max_size=6),
    slope=st.integers(3000, 50_000),
    shape=st.integers(0, 1),
    high=st.integers(100, 2000),
    low=st.integers(100, 2000),
)
def test_the_torque_never_leaves_slope_and_limits(targets, slope, shape, high, low):
    """Any sequence of targets: no step above 6087h, always within 60E0h and 60E1h, and the last target is
    met.
    """
    bench = tq_bench(_6087=slope, _6088=shape, _60E0=high, _60E1=low)
    noted = torques(bench)
    for target, milliseconds in targets:
        bench.write(0x6071, target)
        bench.run(milliseconds / 1000)
    bench.run(5000 * 1.6 / slope + 0.01)
    assert max((abs(b - a) for a, b in pairwise(noted)), default=0) <= slope * DT * 1.002 + 1e-6
    assert -low - 1e-6 <= min(noted)
    assert max(noted) <= high + 1e-6
    last = targets[-1][0]
    assert bench.read(0x6077) == max(-low, min(high, last))
    assert bool(bench.status & 0x400) == (-low <= last <= high)
