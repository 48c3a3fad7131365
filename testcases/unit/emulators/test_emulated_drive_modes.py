"""Modes of operation: profile position, profile velocity, homing, cyclic synchronous modes."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from emulators.drive.cia402 import DriveConfig, EncoderConfig, HomingConfig
from fieldbus.can import HookResult
from fieldbus.canopen import NmtCommand, SdoAbort
from fieldbus.cia402 import DriveState as S

REV = 131072
"""Position units per motor revolution (10 mm) of the reference axis."""


def frictionless() -> DriveConfig:
    """Return the reference axis without friction, for slopes and delays to the step."""
    config = DriveConfig.reference()
    return replace(
        config, mechanics=replace(config.mechanics, coulomb_friction_n=0.0, viscous_friction_n_per_m_s=0.0)
    )


def position_bench(make_bench, config: DriveConfig | None = None, **values: int):
    """Return a bench in profile position: 1200 rpm, 6000 rpm/s both ways."""
    bench = make_bench(config)
    bench.configure({0x6081: 1_200_000, 0x6083: 6_000_000, 0x6084: 6_000_000})
    bench.configure({int(key[1:], 16): value for key, value in values.items()})
    bench.enable(1)
    return bench


def turns(bench) -> float:
    return bench.drive.mechanics.position / 0.010


def setpoint(bench, revolutions: float, word: int = 0x1F, wait: float = 0.002) -> None:
    """Write a target and give the edge of bit 4."""
    bench.write(0x607A, round(revolutions * REV))
    bench.control(word & ~0x10 | 0x00, 0.002)
    bench.control(word, wait)


# -- changing modes ------------------------------------------------------------------------------------


@pytest.mark.requirement(
    *(f"C402-{number:03}" for number in (*range(78, 87), 89)),
)
@pytest.mark.parametrize("mode", [1, 2, 3, 4, 6, 7, 8, 9, 10])
def test_supported_modes_are_displayed_in_the_next_control_cycle(bench, mode):
    """6061h follows 6060h within one control cycle, and 6502h claims the mode."""
    bench.write(0x6060, mode)
    bench.run(0.001)
    assert bench.read(0x6061) == mode
    assert bench.read(0x6502) >> (mode - 1) & 1


@pytest.mark.requirement("C402-087", "C402-088", "C402-090")
@pytest.mark.parametrize("mode", [5, 11, 12, 100, 127, -1, -128])
def test_unsupported_modes_are_refused(bench, mode):
    """A mode that is not in 6502h: 06090030h by SDO."""
    bench.set_mode(3)
    with pytest.raises(SdoAbort) as refusal:
        bench.write(0x6060, mode)
    assert refusal.value.code == 0x06090030
    bench.run(0.005)
    assert bench.read(0x6061) == 3
    assert mode < 1 or not bench.read(0x6502) >> (mode - 1) & 1


@pytest.mark.requirement("C402-090")
def test_unsupported_mode_by_pdo(bench):
    """A mode that is not supported, by PDO: 6061h unchanged and the warning bit until a good one comes."""
    bench.start_cyclic(9)
    assert bench.read(0x6061) == 9
    bench.mode = 11
    bench.run(0.02)
    assert bench.read(0x6061) == 9
    assert bench.status & 0x80
    bench.mode = 9
    bench.run(0.02)
    assert not bench.status & 0x80


@pytest.mark.requirement("C402-089", "C402-088")
def test_mode_change_in_operation_starts_from_the_actual_values(bench):
    """Changing between modes in motion makes no jerk beyond the limits; 6060h = 0 changes nothing."""
    bench.spin(600)
    bench.set_mode(0)
    bench.run(0.05)
    assert bench.read(0x6061) == 3
    assert bench.drive.core.speed_rpm == pytest.approx(600, rel=1e-3)
    bench.configure({0x6081: 600_000})
    bench.set_mode(1)
    bench.run(0.3)
    assert bench.drive.mechanics.velocity == pytest.approx(0.0, abs=1e-6)
    assert bench.state is S.OPERATION_ENABLED


# -- profile position ----------------------------------------------------------------------------------


@pytest.mark.requirement("C402-091", "C402-033")
def test_single_setpoint(make_bench):
    """Handshake of bit 4 and bit 12, bit 10, and a trapezoid that ends exactly at the target."""
    bench = position_bench(make_bench)
    assert bench.status & 0x1400 == 0x0400
    bench.write(0x607A, 10 * REV)
    bench.control(0x1F)
    assert bench.status & 0x1400 == 0x1000
    bench.control(0x0F)
    assert bench.status & 0x1400 == 0x0000
    bench.run(0.348)
    assert bench.drive.core.speed_rpm == pytest.approx(1200, rel=1e-3)
    bench.until(lambda: bench.status & 0x400, 1.0)
    assert bench.scheduler.now / 1e9 == pytest.approx(0.010 + 0.2 + 0.5, abs=0.006)
    assert turns(bench) == pytest.approx(10.0, abs=1e-4)
    bench.run(0.1)
    assert bench.read(0x6064) == pytest.approx(10 * REV, abs=1)


@pytest.mark.requirement("C402-091")
def test_a_level_of_bit_4_is_no_setpoint(make_bench):
    """Only the edge counts: a new target with bit 4 held is not taken."""
    bench = position_bench(make_bench)
    setpoint(bench, 1.0, wait=1.0)
    bench.write(0x607A, 5 * REV)
    bench.control(0x1F, 0.5)
    assert turns(bench) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.requirement("C402-092", "C402-034")
def test_change_immediately(make_bench):
    """Bit 5 = 1: the new setpoint interrupts the running one, also into the other direction."""
    bench = position_bench(make_bench)
    setpoint(bench, 20.0, wait=0.4)
    assert turns(bench) > 3.0
    setpoint(bench, 1.0, word=0x3F, wait=0.01)
    assert bench.status & 0x1000
    bench.control(0x2F, 2.0)
    assert turns(bench) == pytest.approx(1.0, abs=1e-4)
    assert bench.status & 0x1400 == 0x0400


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-092")
def test_set_of_setpoints(make_bench):
    """Bit 5 = 0: the second waits, the third finds the buffer full (bit 12 stays 1), the axis stops in
    between.
    """
    bench = position_bench(make_bench)
    samples = bench.observe()
    setpoint(bench, 5.0)
    setpoint(bench, 8.0)
    bench.control(0x0F)
    assert bench.status & 0x1000
    setpoint(bench, 50.0)
    bench.control(0x0F)
    assert bench.status & 0x1400 == 0x1000
    bench.until(lambda: not bench.status & 0x1000, 2.0)
    assert turns(bench) == pytest.approx(5.0, abs=0.01)
    assert not bench.status & 0x400
    bench.until(lambda: bench.status & 0x400, 2.0)
    assert turns(bench) == pytest.approx(8.0, abs=1e-4)
    near_first = [velocity for _, position, velocity in samples if abs(position - 0.05) < 1e-6]
    assert min(abs(velocity) for velocity in near_first) < 1e-3


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-092", "C402-037")
def test_change_on_setpoint(make_bench):
    """Bit 9 = 1: the first target is passed with its own speed, then the second setpoint counts."""
    bench = position_bench(make_bench)
    samples = bench.observe()
    setpoint(bench, 5.0)
    bench.write(0x6081, 600_000)
    setpoint(bench, 12.0, word=0x21F)
    bench.control(0x20F, 3.0)
    assert turns(bench) == pytest.approx(12.0, abs=1e-4)
    passing = next(velocity for _, position, velocity in samples if position >= 0.05)
    assert passing == pytest.approx(0.2, rel=0.01)
    later = [velocity for _, position, velocity in samples if 0.066 < position < 0.11]
    assert max(later) == pytest.approx(0.1, rel=0.01)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-092")
def test_change_on_setpoint_with_a_jerk_limit(make_bench):
    """Bit 9 = 1 with 6086h = 3: the first target is passed without a stop too."""
    bench = position_bench(make_bench, _6086=3)
    bench.write(0x60A4, 60_000_000, 1)
    setpoint(bench, 5.0)
    setpoint(bench, 12.0, word=0x21F)
    samples = bench.observe()
    bench.control(0x20F, 3.0)
    assert turns(bench) == pytest.approx(12.0, abs=1e-4)
    assert min(velocity for _, position, velocity in samples if 0.03 < position < 0.09) > 0.15


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-093", "C402-035")
@pytest.mark.parametrize(("origin", "expected"), [(0, 5.0), (2, 4.0)])
def test_relative_setpoints(make_bench, origin, expected):
    """Bit 6 = 1: relative to the last target (60F2h = 0) or to the actual position (2)."""
    bench = position_bench(make_bench, _60F2=origin)
    setpoint(bench, 3.0, wait=1.0)
    setpoint(bench, 30.0, wait=0.1)
    bench.control(0x0F)
    # Interrupt in motion: target 30, actual somewhere else.
    actual = bench.read(0x6064) / REV
    setpoint(bench, -25.0 if origin == 0 else 4.0 - actual, word=0x7F, wait=3.0)
    assert turns(bench) == pytest.approx(expected, abs=0.35 if origin else 1e-4)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-095")
def test_profile_limits(make_bench):
    """6081h above 607Fh and accelerations above 60C5h / 60C6h are limited."""
    bench = position_bench(
        make_bench, frictionless(), _6081=9_000_000, _607F=1_500_000, _60C5=3_000_000, _60C6=2_000_000
    )
    samples = bench.observe()
    setpoint(bench, 40.0, wait=4.0)
    velocities = [velocity for _, _, velocity in samples]
    assert max(velocities) == pytest.approx(0.25, rel=1e-3)
    slopes = [(b - a) / 0.00025 for a, b in pairwise(velocities)]
    assert max(slopes) == pytest.approx(0.5, rel=0.02)
    assert min(slopes) == pytest.approx(-1.0 / 3.0, rel=0.02)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-095")
def test_jerk_limited_profile(make_bench):
    """6086h = 3 with 60A4h: the acceleration rises within a/j; other profile types are refused."""
    bench = position_bench(make_bench, frictionless(), _6086=3)
    bench.write(0x60A4, 60_000_000, 1)
    samples = bench.observe()
    setpoint(bench, 10.0, wait=2.0)
    assert turns(bench) == pytest.approx(10.0, abs=1e-4)
    velocities = [velocity for _, _, velocity in samples]
    accelerations = [(b - a) / 0.002 for a, b in zip(velocities[::8], velocities[8::8], strict=False)]
    jerks = [(b - a) / 0.002 for a, b in pairwise(accelerations)]
    assert max(jerks) < 10.0 * 1.1
    for kind in (4, -1):
        with pytest.raises(SdoAbort):
            bench.write(0x6086, kind)


@pytest.mark.requirement("C402-155", "C402-156")
def test_position_window(make_bench):
    """6067h, 6068h: bit 10 after the time in the window, 0 again when the axis is pushed out."""
    bench = position_bench(make_bench, _6067=50, _6068=100)
    setpoint(bench, 2.0, wait=0.002)
    bench.until(lambda: abs(bench.read(0x6064) - 2 * REV) <= 50, 2.0)
    start = bench.scheduler.now
    bench.until(lambda: bench.status & 0x400, 1.0)
    assert (bench.scheduler.now - start) / 1e9 == pytest.approx(0.1, abs=0.003)
    bench.drive.set_load_force(3000.0)
    bench.until(lambda: not bench.status & 0x400, 0.1)


@pytest.mark.requirement("C402-076")
def test_halt_and_resume_of_a_positioning(make_bench):
    """Bit 8 interrupts the motion, its release goes on to the same target."""
    bench = position_bench(make_bench)
    setpoint(bench, 10.0, wait=0.3)
    bench.control(0x11F, 0.5)
    assert bench.drive.mechanics.velocity == pytest.approx(0.0, abs=1e-5)
    assert turns(bench) < 6.1
    assert bench.status & 0x400
    bench.control(0x1F, 0.01)
    assert not bench.status & 0x400
    bench.run(1.0)
    assert turns(bench) == pytest.approx(10.0, abs=1e-4)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-162", "C402-163", "C402-140")
def test_software_limits_clamp_positions_once_homed(make_bench):
    """607Dh: before homing nothing; afterwards the target is clamped and bit 11 shows it; min > max is
    refused.
    """
    bench = position_bench(make_bench)
    bench.write(0x607D, -2 * REV, 1)
    bench.write(0x607D, 3 * REV, 2)
    setpoint(bench, 4.0, wait=1.5)
    assert turns(bench) == pytest.approx(4.0, abs=1e-4)
    bench.write(0x6098, 37)
    bench.control(0x0F)
    bench.set_mode(6)
    bench.control(0x1F)
    bench.control(0x0F)
    bench.set_mode(1)
    setpoint(bench, 10.0, wait=1.5)
    assert turns(bench) == pytest.approx(4.0 + 3.0, abs=1e-4)
    assert bench.status & 0x800
    setpoint(bench, 1.0, wait=1.5)
    assert not bench.status & 0x800
    for sub, value in ((1, 3 * REV + 1), (2, -2 * REV - 1)):
        with pytest.raises(SdoAbort) as refusal:
            bench.write(0x607D, value, sub)
        assert refusal.value.code == 0x06090036


@pytest.mark.requirement("C402-166")
def test_user_units(make_bench):
    """6092h = 10000: with a 10 mm screw the unit is 1 um, velocities in rpm; gear 2 halves the way of the
    motor.
    """
    bench = make_bench(DriveConfig())
    bench.write(0x6091, 2, 1)
    bench.run(0.002)
    bench.enable(1)
    bench.write(0x607A, 5000)
    bench.control(0x1F, 1.0)
    assert turns(bench) == pytest.approx(1.0, abs=1e-4)
    assert bench.read(0x6064) == pytest.approx(5000, abs=1)
    assert bench.read(0x6063) == pytest.approx(REV, abs=20)


@pytest.mark.requirement("C402-165")
def test_polarity_inverts_demand_and_actual_values(make_bench):
    """607Eh = E0h: positive targets turn the motor backwards, actual values follow; no change while
    enabled.
    """
    bench = make_bench()
    bench.write(0x607E, 0xE0)
    bench.configure({0x6083: 60_000_000})
    bench.enable(3)
    bench.write(0x60FF, 600_000)
    bench.run(0.3)
    assert bench.drive.core.speed_rpm == pytest.approx(-600, rel=1e-3)
    assert bench.read(0x606C) == pytest.approx(600_000, rel=1e-3)
    assert bench.read(0x6064) > 0 > bench.drive.mechanics.position
    assert bench.read(0x6077) > 0
    with pytest.raises(SdoAbort) as refusal:
        bench.write(0x607E, 0)
    assert refusal.value.code == 0x08000022


# -- profile velocity ----------------------------------------------------------------------------------


@pytest.mark.requirement("C402-097", "C402-157", "C402-158", "C402-044", "C402-046")
def test_profile_velocity(bench):
    """Ramps of 6083h and 6084h, bit 10 in the velocity window, bit 12 below the threshold; reversal through
    zero.
    """
    bench.configure({0x6083: 3_000_000, 0x6084: 6_000_000, 0x606D: 2000, 0x606E: 10, 0x606F: 5000, 0x6070: 0})
    bench.enable(3)
    assert bench.status & 0x1000
    samples = bench.observe()
    bench.write(0x60FF, 1_200_000)
    bench.run(0.3)
    assert not bench.status & 0x1400
    assert bench.drive.core.speed_rpm == pytest.approx(900, abs=10)
    bench.run(0.2)
    assert bench.status & 0x1400 == 0x0400
    samples.clear()
    bench.write(0x60FF, -1_200_000)
    bench.run(1.0)
    assert bench.drive.core.speed_rpm == pytest.approx(-1200, rel=1e-3)
    first = samples[0][0]
    crossing = next(time for time, _, velocity in samples if velocity < 0) - first
    end = next(time for time, _, velocity in samples if velocity < -0.1999) - first
    assert crossing == pytest.approx(0.2, abs=0.005)
    assert end - crossing == pytest.approx(0.4, abs=0.01)
    assert bench.read(0x606B) == pytest.approx(-1_200_000, abs=2)


@pytest.mark.requirement("C402-159")
def test_slippage(bench):
    """60F8h: bit 13 while demand and actual velocity differ by more."""
    bench.configure({0x60F8: 50_000, 0x6072: 3000})
    bench.enable(3)
    bench.write(0x60FF, 600_000)
    bench.run(0.5)
    assert not bench.status & 0x2000
    bench.drive.jam(True)
    bench.run(0.05)
    assert bench.status & 0x2000


@pytest.mark.requirement("C402-224", "C402-223", "C402-257")
def test_speed_limits_in_profile_velocity(bench):
    """607Fh, 6080h and 60C9h limit the velocity; bit 11 shows it."""
    bench.configure({0x6083: 60_000_000, 0x60FF: 2_900_000})
    for index, value, rpm in ((0x607F, 2_000_000, 2000), (0x6080, 1500, 1500), (0x60C9, 800_000, 800)):
        bench.write(index, value)
        if bench.state is not S.OPERATION_ENABLED:
            bench.enable(3)
        bench.run(0.6)
        assert bench.drive.core.speed_rpm == pytest.approx(rpm, rel=1e-3)
        assert bench.status & 0x800


# -- homing --------------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-127", "C402-129", "C402-134", "C402-135", "C402-138")
@pytest.mark.parametrize("method", [35, 37])
@pytest.mark.parametrize(("option", "expected"), [("profile", -7000), ("vendor", 7000)])
def test_homing_on_the_present_position(make_bench, method, option, expected):
    """Methods 35 and 37: no motion; 6064h becomes -607Ch (or +607Ch); bits 13, 12, 10 = 001 before, 011
    after.
    """
    bench = make_bench(replace(DriveConfig.reference(), homing=HomingConfig(offset=option)))
    bench.configure({0x6098: method, 0x607C: 7000})
    bench.drive.mechanics.place(0.0123)
    bench.enable(6)
    assert bench.status & 0x3400 == 0x0400
    bench.control(0x1F)
    assert bench.status & 0x3400 == 0x1400
    assert bench.read(0x6064) == expected
    bench.run(0.1)
    assert bench.drive.mechanics.position == pytest.approx(0.0123, abs=1e-7)
    assert [event.data["success"] for event in bench.history.select(kind="drive.homing")] == [True]


@pytest.mark.requirement("C402-130", "C402-135")
def test_homing_without_a_method(bench):
    """Method 0: the start leads to homing error."""
    bench.enable(6)
    bench.control(0x1F)
    assert bench.status & 0x3400 == 0x2400


def test_homing_in_motionless_control_does_not_move_the_axis(make_bench):
    """Homing shifts the coordinates under a position-controlled axis without a jerk."""
    bench = position_bench(make_bench)
    setpoint(bench, 3.3, wait=1.0)
    bench.write(0x6098, 37)
    bench.control(0x0F)
    bench.set_mode(6)
    samples = bench.observe()
    bench.control(0x1F, 0.2)
    assert bench.read(0x6064) == pytest.approx(0, abs=1)
    assert max(abs(position - samples[0][1]) for _, position, _ in samples) < 1e-7


# -- cyclic modes --------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-101", "C402-102", "C301-035")
def test_cyclic_velocity(make_bench):
    """csv: the target of one SYNC is reached linearly at the next; bit 12 = 1 while following."""
    bench = make_bench(frictionless())
    bench.start_cyclic(9)
    bench.enable_cyclic()
    assert bench.status & 0x1000
    samples = bench.observe()
    for step in range(1, 101):
        bench.target = step * 12_000
        bench.run(0.004)
    velocities = [velocity for _, _, velocity in samples]
    slopes = [(b - a) / 0.00025 for a, b in pairwise(velocities)]
    assert max(slopes[100:-50]) == pytest.approx(0.5, rel=0.02)
    assert min(slopes[100:-50]) == pytest.approx(0.5, rel=0.02)
    bench.run(0.02)
    assert bench.drive.core.speed_rpm == pytest.approx(1200, rel=1e-4)
    assert bench.read(0x606C) == pytest.approx(1_200_000, abs=20)


def test_cyclic_velocity_delay(make_bench):
    """csv: sent half a cycle after a SYNC, effective at the next one, reached one period after that."""
    bench = make_bench(frictionless())
    bench.start_cyclic(9)
    bench.enable_cyclic()
    bench.until(lambda: bench.scheduler.now % 4_000_000 == 0, 1.0)
    start = bench.scheduler.now
    samples = bench.observe()
    bench.target = 60_000
    bench.run(0.02)
    moving = next(time for time, _, velocity in samples if velocity > 1e-6) - start / 1e9
    there = next(time for time, _, velocity in samples if velocity > 0.00999) - start / 1e9
    assert moving == pytest.approx(0.004 + 0.0005, abs=1e-9)
    assert there == pytest.approx(0.008 + 0.0005, abs=0.00026)


@pytest.mark.requirement("C402-101")
def test_velocity_and_torque_offsets(bench):
    """60B1h adds to the velocity of csv; 60B2h adds torque."""
    bench.start_cyclic(9)
    bench.enable_cyclic()
    bench.target = 300_000
    bench.write(0x60B1, 60_000)
    bench.run(0.2)
    assert bench.drive.core.speed_rpm == pytest.approx(360, rel=1e-3)
    before = bench.drive.core.torque
    bench.write(0x60B2, 200)
    bench.until(lambda: bench.drive.core.torque > before + 0.3, 0.01)


@pytest.mark.requirement("C402-100")
@pytest.mark.parametrize("feedforward", [False, True])
def test_cyclic_position(make_bench, feedforward):
    """csp: linear interpolation over 60C2h, hardly any following error at constant velocity, exact end."""
    bench = make_bench()
    bench.start_cyclic(8)
    bench.enable_cyclic()
    assert bench.status & 0x1000
    velocity = REV // 250 * 4  # increments per 4 ms: 40 mm/s
    errors = []
    for _ in range(250):
        bench.target += velocity
        if feedforward:
            bench.write(0x60B1, round(velocity / REV / 0.004 * 60_000))
        bench.run(0.004)
        errors.append(bench.read(0x60F4))
    assert max(abs(error) for error in errors[100:]) <= 3
    bench.write(0x60B1, 0)
    bench.run(0.3)
    assert bench.read(0x6064) == pytest.approx(bench.target, abs=1)
    assert bench.read(0x6062) == bench.target


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-103")
def test_cyclic_position_speed_limit(bench):
    """csp: a jump of the target is travelled at 6080h with bit 11 = 1 and a growing following error."""
    bench.configure({0x6080: 600, 0x60C5: 0, 0x60C6: 0})
    bench.start_cyclic(8)
    bench.enable_cyclic()
    bench.target = 20 * REV
    bench.run(0.3)
    assert bench.drive.core.speed_rpm == pytest.approx(600, rel=0.01)
    assert bench.status & 0x1800 == 0x0800
    assert bench.read(0x60F4) > 15 * REV
    bench.run(3.0)
    assert bench.read(0x6064) == pytest.approx(20 * REV, abs=1)
    assert bench.status & 0x1800 == 0x1000


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-100", "C402-256")
def test_cyclic_position_acceleration_limits(bench):
    """csp: after a jump 60C5h and 60C6h limit speeding up and slowing down, and the target is met without
    swinging.
    """
    bench.configure({0x60C5: 6_000_000, 0x60C6: 3_000_000})
    bench.start_cyclic(8)
    bench.enable_cyclic()
    samples = bench.observe()
    bench.target = 5 * REV
    bench.run(2.0)
    velocities = [velocity for _, _, velocity in samples][::80]
    slopes = [(b - a) / 0.020 for a, b in pairwise(velocities)]
    assert max(slopes) == pytest.approx(1.0, rel=0.1)
    assert min(slopes) == pytest.approx(-0.5, rel=0.25)  # the last periods before the target are coarse
    assert max(position for _, position, _ in samples) == pytest.approx(0.05, abs=2e-4)
    assert turns(bench) == pytest.approx(5.0, abs=1e-4)


def test_a_late_sync_makes_no_dip(make_bench):
    """csp: a SYNC that comes 0.4 ms late finds the axis still moving with its velocity."""
    bench = make_bench(frictionless())
    bench.start_cyclic(8)
    bench.enable_cyclic()
    for _ in range(100):
        bench.target += 2000
        bench.run(0.004)
    late = iter(range(1000))
    bench.medium.add_hook(
        lambda frame, _sender, _time: (
            HookResult.delay(400_000) if frame.can_id == 0x80 and next(late) % 5 == 4 else None
        )
    )
    samples = bench.observe()
    for _ in range(50):
        bench.target += 2000
        bench.run(0.004)
    velocities = [velocity for _, _, velocity in samples]
    assert min(velocities) > 0.995 * velocities[0]
    assert max(velocities) < 1.005 * velocities[0]
    assert bench.state is S.OPERATION_ENABLED


@pytest.mark.requirement("C402-103", "C402-153")
def test_cyclic_position_jump_beyond_the_window_is_a_following_error(bench):
    """csp: with 6065h set the jump ends in fault 8611h."""
    bench.configure({0x6065: REV, 0x6066: 20})
    bench.start_cyclic(8)
    bench.enable_cyclic()
    bench.target = 20 * REV
    bench.run(0.5)
    assert bench.state is S.FAULT
    assert (0x8611, 0x21) in bench.emcys


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-163")
def test_cyclic_position_software_limit(make_bench):
    """csp: the demand is clamped to 607Dh, bit 11 = 1 and bit 12 = 0 while clamped."""
    bench = make_bench(replace(DriveConfig.reference(), encoder=EncoderConfig(kind="absolute")))
    bench.write(0x607D, -REV, 1)
    bench.write(0x607D, REV, 2)
    bench.start_cyclic(8)
    bench.enable_cyclic()
    for _ in range(500):
        bench.target += REV // 200
        bench.run(0.004)
    assert turns(bench) == pytest.approx(1.0, abs=1e-3)
    assert bench.status & 0x1800 == 0x0800
    bench.target = 0
    for _ in range(20):
        bench.run(0.05)
    assert bench.status & 0x1800 == 0x1000


@pytest.mark.requirement("C402-101")
def test_cyclic_torque(bench):
    """cst: 6071h + 60B2h in permille of 6076h; the torque limit cuts it."""
    bench.start_cyclic(10)
    bench.enable_cyclic()
    bench.drive.jam(True)
    bench.target = 500
    bench.run(0.02)
    assert bench.drive.core.torque == pytest.approx(1.0)
    assert bench.read(0x6077) == 500
    bench.write(0x60B2, -100)
    bench.run(0.02)
    assert bench.read(0x6077) == 400
    bench.write(0x60E0, 250)
    bench.run(0.02)
    assert bench.read(0x6077) == 250
    assert bench.status & 0x800


def test_cyclic_torque_speed_limit(bench):
    """cst: the speed stays at 6080h."""
    bench.write(0x6080, 400)
    bench.start_cyclic(10)
    bench.enable_cyclic()
    bench.target = 300
    bench.run(0.5)
    assert bench.drive.core.speed_rpm == pytest.approx(400, rel=0.02)
    assert bench.status & 0x800


@pytest.mark.requirement("C402-210", "C402-261", "C402-212", "C402-160")
def test_torque_limits(bench):
    """6072h and 60E1h limit the torque of the velocity control, bit 11 shows it, 6074h and 6077h tell it."""
    bench.write(0x6072, 400)
    bench.write(0x60E1, 150)
    bench.enable(3)
    bench.write(0x6083, 60_000_000)
    bench.write(0x60FF, 2_000_000)
    bench.run(0.02)
    assert (bench.read(0x6074), bench.read(0x6077)) == (400, 400)
    assert bench.status & 0x800
    bench.write(0x60FF, -2_000_000)
    bench.write(0x6084, 60_000_000)
    bench.run(0.02)
    assert bench.read(0x6077) == -150


@pytest.mark.requirement("C402-104", "C301-049")
def test_one_missing_setpoint_is_bridged_and_the_second_is_a_fault(bench):
    """csp: after one missing RPDO the axis goes on with its velocity, the second leads to 6007h: fault
    8250h.
    """
    bench.start_cyclic(8)
    bench.enable_cyclic()
    for _ in range(50):
        bench.target += 2000
        bench.run(0.004)
    speed = bench.drive.mechanics.velocity
    bench.sending = False
    bench.target += 4000
    bench.run(0.004)
    bench.sending = True
    bench.run(0.006)
    assert bench.drive.mechanics.velocity == pytest.approx(speed, rel=0.02)
    assert bench.read(0x2000, 2) == 1
    assert bench.state is S.OPERATION_ENABLED
    bench.sending = False
    bench.run(0.03)
    assert bench.state in (S.FAULT_REACTION_ACTIVE, S.FAULT)
    assert bench.emcys == [(0x8250, 0x11)]


def test_missing_setpoints_can_be_ignored(make_bench):
    """missing_setpoints = 0: the drive keeps its velocity."""
    bench = make_bench(replace(DriveConfig.reference(), missing_setpoints=0))
    bench.start_cyclic(9)
    bench.enable_cyclic()
    bench.target = 60_000
    bench.run(0.1)
    bench.sending = False
    bench.run(0.2)
    assert bench.state is S.OPERATION_ENABLED
    assert bench.drive.core.speed_rpm == pytest.approx(60, rel=1e-3)
    assert bench.read(0x2000, 2) > 40


@pytest.mark.requirement("C301-037")
@pytest.mark.parametrize(
    ("reaction", "state"),
    [("fault", S.FAULT), ("warning", S.OPERATION_ENABLED), ("none", S.OPERATION_ENABLED)],
)
def test_lost_sync(make_bench, reaction, state):
    """With 1006h set a missing SYNC is fault 8700h, an EMCY only, or nothing; 2000h:1 counts."""
    bench = make_bench(replace(DriveConfig.reference(), sync_loss=reaction))
    bench.write(0x1006, 4000)
    bench.start_cyclic(9)
    bench.enable_cyclic()
    bench.master.stop_sync()
    bench.run(0.05)
    assert bench.state is state
    assert bench.read(0x2000, 1) == 1
    codes = [code for code, _ in bench.emcys]
    assert codes == {"fault": [0x8700], "warning": [0x8700, 0], "none": []}[reaction]


@pytest.mark.requirement("CANP-070", "CANP-071")
@pytest.mark.parametrize(
    ("jitter", "shift_us", "reaction", "codes"),
    [
        (0.10, 300, "fault", []),
        (0.10, 500, "fault", [0x8700]),
        (0.10, -500, "fault", [0x8700]),
        (0.25, 500, "fault", []),
        (0.10, 500, "warning", [0x8700, 0]),
        (0.0, 1500, "fault", []),
    ],
)
def test_sync_jitter(make_bench, jitter, shift_us, reaction, codes):
    """A drive that follows SYNC with a clock of its own trips when one SYNC comes too early or too late."""
    bench = make_bench(
        replace(DriveConfig.reference(), sync_jitter_percent=jitter * 100.0, sync_loss=reaction)
    )
    bench.start_cyclic(9)
    bench.enable_cyclic()
    bench.run(0.1)
    assert bench.emcys == []
    bench.master.stop_sync()
    period_us = 4000
    bench.scheduler.run_for((period_us + shift_us - bench.scheduler.now // 1000 % period_us) * 1000)
    bench.master.start_sync(period_us * 1000, bench.scheduler.now % (period_us * 1000))
    bench.run(0.05)
    assert [code for code, _ in bench.emcys][:2] == codes
    assert (bench.state is S.OPERATION_ENABLED) is (reaction == "warning" or not codes)


def test_cyclic_velocity_without_sync(bench):
    """Mode csv by SDO without SYNC: the target counts all the same."""
    bench.enable(9)
    bench.write(0x60FF, 120_000)
    bench.run(0.1)
    assert bench.drive.core.speed_rpm == pytest.approx(120, rel=1e-3)


@pytest.mark.requirement("C402-102")
def test_bit_12_is_zero_while_the_drive_ignores_the_command(bench):
    """csv: bit 12 = 0 in a shutdown ramp, during halt and when not enabled."""
    bench.start_cyclic(9)
    assert not bench.status & 0x1000
    bench.enable_cyclic()
    bench.target = 1_000_000
    bench.run(0.3)
    bench.word = 0x10F
    bench.run(0.02)
    assert bench.status & 0x1027 == 0x0027
    bench.word = 0x0F
    bench.run(0.02)
    assert bench.status & 0x1000
    bench.word = 0x06
    bench.run(0.02)
    assert bench.status & 0x1027 == 0x0027


@pytest.mark.requirement("C402-171")
def test_interpolation_period(bench):
    """60C2h: multiples of the servo cycle are accepted, others are 06090030h."""
    bench.write(0x60C2, 10, 1)
    bench.write(0x60C2, 250, 1)
    bench.write(
        0x60C2, 0xFC, 2
    )  # 25 ms; 1 would be 100 us, exponent -6 would be 250 us * 1.0 = one servo step
    bench.write(0x60C2, 0xFA, 2)
    bench.write(0x60C2, 0xFC, 2)
    for value, sub in ((1, 1), (0, 1), (0xF9, 2), (0x7F, 2)):
        with pytest.raises(SdoAbort) as refusal:
            bench.write(0x60C2, value, sub)
        assert refusal.value.code == 0x06090030


@pytest.mark.requirement("C402-153", "C402-154")
def test_following_error_monitoring(make_bench):
    """6065h, 6066h: bit 13 and fault 8611h after the time; status only if so configured; FFFFFFFFh = off."""
    for reaction, window, state in (
        ("fault", 2000, S.FAULT),
        ("status", 2000, S.OPERATION_ENABLED),
        ("fault", 0xFFFFFFFF, S.OPERATION_ENABLED),
    ):
        bench = make_bench(replace(DriveConfig.reference(), following_error=reaction))
        bench.configure({0x6065: window, 0x6066: 50, 0x6081: 600_000})
        bench.enable(1)
        bench.drive.jam(True)
        setpoint(bench, 5.0, wait=0.04)
        assert bench.state is S.OPERATION_ENABLED
        assert not bench.status & 0x2000
        bench.run(0.2)
        assert bench.state is state
        if reaction == "status":
            assert bench.status & 0x2000
        assert (bench.emcys == [(0x8611, 0x21)]) == (state is S.FAULT)


@pytest.mark.requirement("C402-174")
def test_actual_values_of_one_sync_belong_together(bench):
    """Position and velocity in the TPDOs of one SYNC are of the same servo instant."""
    frames: dict[int, list[bytes]] = {0x181: [], 0x281: []}
    for cob_id, log in frames.items():
        bench.master.subscribe(cob_id, lambda data, _time, log=log: log.append(data))
    bench.start_cyclic(9)
    bench.enable_cyclic()
    bench.target = 600_000
    bench.run(0.5)
    positions = [int.from_bytes(data[2:6], "little", signed=True) for data in frames[0x181][-20:]]
    velocities = [int.from_bytes(data[:4], "little", signed=True) for data in frames[0x281][-20:]]
    steps = {b - a for a, b in pairwise(positions)}
    assert all(abs(step - 600 / 60 * 0.004 * REV) <= 1 for step in steps)
    assert all(velocity == pytest.approx(600_000, abs=50) for velocity in velocities)


def test_leaving_operational_in_cyclic_mode(bench):
    """NMT stop in motion acts as 6007h says (default: fault), and the axis stops on the quick-stop ramp."""
    bench.start_cyclic(9)
    bench.enable_cyclic()
    bench.target = 600_000
    bench.run(0.3)
    bench.master.nmt(NmtCommand.STOP, 1)
    bench.run(0.3)
    assert bench.state is S.FAULT
    assert bench.drive.mechanics.velocity == 0.0
