"""Offsets of the cyclic modes, slippage, reserved bits, units and limits: what belongs to no mode alone."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from emulators.drive.cia402 import DriveConfig, HomingConfig, RotaryAxisConfig
from fieldbus.canopen import SdoAbort
from fieldbus.cia402 import DriveState as S
from testcases.unit.emulators.conftest import DriveBench
from testcases.unit.emulators.moving import MODES, RPM, MovingDrive

REV = 131072


def frictionless(**changes) -> DriveConfig:
    return replace(
        DriveConfig.reference(),
        mechanics=RotaryAxisConfig(coulomb_friction=0.0, viscous_friction=0.0),
        **changes,
    )


def refused(bench: DriveBench, index: int, value: int, sub: int = 0) -> int:
    with pytest.raises(SdoAbort) as refusal:
        bench.write(index, value, sub)
    return refusal.value.code


@pytest.mark.requirement("C402-100", "C402-246")
def test_position_offset_of_csp():
    """60B0h is added to 607Ah: the axis stands at the sum, and 6062h shows it."""
    bench = DriveBench(frictionless())
    bench.start_cyclic(8)
    bench.enable_cyclic()
    bench.target = 3000
    bench.write(0x60B0, -1000)
    bench.run(0.4)
    assert bench.read(0x6062) == 2000
    assert bench.read(0x6064) == pytest.approx(2000, abs=1)
    bench.write(0x60B0, 500)
    bench.run(0.4)
    assert bench.read(0x6064) == pytest.approx(3500, abs=1)


@pytest.mark.requirement("C402-100", "C402-247")
def test_velocity_offset_of_csp_is_pre_control():
    """60B1h goes to the velocity controller: too much of it makes the axis run ahead of the demand, by v /
    Kv.
    """
    errors = {}
    step = 2000
    speed = step / REV / 0.004 * 60_000
    for share in (0.5, 1.0, 1.5):
        bench = DriveBench(frictionless())
        bench.start_cyclic(8)
        bench.enable_cyclic()
        for _ in range(100):
            bench.target += step
            bench.write(0x60B1, round(speed * share))
            bench.run(0.004)
        errors[share] = bench.read(0x60F4)
    assert abs(errors[1.0]) <= 3
    expected = 0.5 * step / 0.004 / 100  # Kv = 100 1/s
    assert errors[0.5] == pytest.approx(expected, rel=0.05)
    assert errors[1.5] == pytest.approx(-expected, rel=0.05)


@pytest.mark.requirement("C402-100", "C402-101", "C402-248")
@pytest.mark.parametrize("mode", [8, 9, 10])
def test_torque_offset(mode):
    """60B2h carries a load of 10 % of rated torque: with it the axis does not sag when the load comes."""
    sag = {}
    for offset in (0, 100):
        bench = DriveBench(frictionless())
        bench.start_cyclic(mode)
        bench.enable_cyclic()
        bench.run(0.05)
        bench.write(0x60B2, offset)
        bench.drive.set_load_force(-0.2)
        bench.run(0.008)
        sag[offset] = abs(bench.drive.mechanics.position)
    assert sag[100] < 0.3 * sag[0]


@pytest.mark.requirement("C402-159", "C402-266", "C402-047")
@pytest.mark.parametrize("reaction", ["status", "fault"])
def test_slippage(reaction):
    """60F8h: bit 13 while |606Bh - 606Ch| is larger; with the option also fault 8400h; 0 = off."""
    bench = DriveBench(frictionless(slippage_reaction=reaction))
    bench.configure({0x60F8: 100_000, 0x6072: 500, 0x6083: 6_000_000})
    bench.enable(3)
    bench.write(0x60FF, 600_000)
    bench.run(0.3)
    assert not bench.status & 0x2000
    bench.drive.set_load_force(-3.0)
    bench.run(0.03)
    if reaction == "status":
        assert bench.status & 0x2000
        bench.write(0x60F8, 0)
        bench.run(0.002)
        assert not bench.status & 0x2000
    assert [code for code, _ in bench.emcys] == ([0x8400] if reaction == "fault" else [])
    assert (bench.state is S.OPERATION_ENABLED) == (reaction == "status")


@pytest.mark.requirement("C402-038", "C402-037", "C402-042", "C402-048")
@pytest.mark.parametrize("mode", MODES, ids=MODES.values())
def test_reserved_and_manufacturer_bits(mode):
    """Bits 9 to 15 of the control word change nothing (9: in pp only), bits 8, 14, 15 of the status word stay
    0.
    """
    bench = MovingDrive()
    bench.set_moving(mode)
    word = bench.following_word(mode) | (0x10 if mode == 1 else 0)
    for bit in range(9, 16):
        bench.control(word | 1 << bit, 0.01)
        assert bench.state is S.OPERATION_ENABLED
        assert not bench.status & 0xC100
        if mode != 6:
            assert bench.rpm == pytest.approx(RPM, abs=15)
    for word in (0x06, 0x00, 0x02):
        bench.control(word, 0.01)
        assert not bench.status & 0xC100


@pytest.mark.requirement("C402-203", "C402-233", "C402-167")
def test_velocity_sensor():
    """6069h: increments per second by 6090h, by default those of the encoder."""
    bench = DriveBench(frictionless())
    bench.enable(3)
    bench.configure({0x6083: 60_000_000, 0x60FF: 600_000})
    bench.run(0.2)
    assert bench.read(0x6069) == pytest.approx(10 * REV, rel=1e-4)
    assert refused(bench, 0x6090, 4096, 1) == 0x08000022
    bench.control(0)
    bench.run(0.01)
    bench.write(0x6090, 8000, 1)
    bench.write(0x6090, 2, 2)
    bench.enable(3)
    bench.run(0.2)
    assert bench.read(0x6069) == pytest.approx(40_000, rel=1e-3)


@pytest.mark.requirement("C402-167", "C402-236", "C402-237", "C402-238", "C402-239", "C402-166")
def test_factors_in_motion():
    """6093h = 1/100, 6096h = 2, 6097h = 1/2 by SDO: position, speed and ramp time of a positioning change as
    they say.
    """
    bench = DriveBench(frictionless())
    for index, numerator, denominator in ((0x6093, 100, 1), (0x6096, 2, 1), (0x6097, 1, 2)):
        bench.write(index, numerator, 1)
        bench.write(index, denominator, 2)
    bench.configure({0x6081: 300_000, 0x6083: 3_000_000, 0x6084: 3_000_000})
    bench.enable(1)
    bench.write(0x607A, 10 * REV // 100)
    bench.control(0x1F, 0.1)
    # 3000 * 2 * 1/2 rpm/s
    assert bench.drive.core.speed_rpm == pytest.approx(300, rel=0.03)
    bench.run(0.3)
    assert bench.drive.core.speed_rpm == pytest.approx(600, rel=1e-3)
    assert bench.read(0x606C) == pytest.approx(300_000, rel=1e-3)
    bench.run(1.5)
    assert bench.drive.mechanics.position == pytest.approx(10 * math.tau, rel=2e-5)
    for index in (0x6090, 0x6093, 0x6094, 0x6096, 0x6097):
        for sub in (1, 2):
            assert refused(bench, index, 3, sub) == 0x08000022
    bench.control(0)
    for index in (0x6090, 0x6093, 0x6094, 0x6096, 0x6097):
        for sub in (1, 2):
            assert refused(bench, index, 0, sub) == 0x06090030


@pytest.mark.requirement("C402-231", "C402-245")
def test_names_of_units_convert_nothing():
    """6089h to 608Eh and 60A8h can be written and read, and the same motion is shown in the same numbers."""
    bench = DriveBench(frictionless())
    for index, value in (
        (0x6089, -3),
        (0x608A, 1),
        (0x608B, -3),
        (0x608C, 0xA4),
        (0x608D, 3),
        (0x608E, 0x55),
    ):
        bench.write(index, value)
        assert bench.read(index) == value
    bench.write(0x60A8, 0xFD010000)
    bench.enable(1)
    bench.write(0x607A, REV)
    bench.control(0x1F, 1.0)
    assert bench.drive.mechanics.position == pytest.approx(math.tau, rel=1e-4)


@pytest.mark.requirement("C402-204")
def test_sensor_selection():
    """606Ah: position or velocity encoder, which are one; others are 06090030h."""
    bench = DriveBench(frictionless())
    for value in (1, 0):
        bench.write(0x606A, value)
    for value in (2, -1):
        assert refused(bench, 0x606A, value) == 0x06090030


@pytest.mark.requirement("C402-165", "C402-222")
@pytest.mark.parametrize(
    "state", [S.SWITCH_ON_DISABLED, S.READY_TO_SWITCH_ON, S.SWITCHED_ON, S.OPERATION_ENABLED]
)
@pytest.mark.parametrize("bit", [0x80, 0x40, 0x20])
def test_polarity_changes_outside_operation_only(state, bit):
    """607Eh: 08000022h while enabled, the same value and every other state are fine."""
    bench = DriveBench(frictionless())
    bench.to_state(state)
    bench.write(0x607E, 0)
    if state is S.OPERATION_ENABLED:
        assert refused(bench, 0x607E, bit) == 0x08000022
    else:
        bench.write(0x607E, bit)
        assert bench.read(0x607E) == bit


@pytest.mark.requirement("C402-165")
def test_polarity_of_the_position():
    """607Eh bit 7: targets, demand, actual position and software limits are turned together."""
    bench = DriveBench(replace(frictionless(), homing=HomingConfig(offset="profile")))
    bench.write(0x607E, 0x80)
    bench.write(0x607D, -REV, 1)
    bench.write(0x607D, 3 * REV, 2)
    bench.drive.axis.homed = True
    bench.enable(1)
    bench.write(0x607A, 2 * REV)
    bench.control(0x1F, 1.0)
    assert bench.drive.mechanics.position == pytest.approx(-2 * math.tau, rel=1e-4)
    assert bench.read(0x6062) == 2 * REV
    assert bench.read(0x6064) == pytest.approx(2 * REV, abs=1)
    bench.control(0x0F)
    bench.write(0x607A, 9 * REV)
    bench.control(0x1F, 1.0)
    assert bench.read(0x6064) == pytest.approx(3 * REV, abs=1)
    assert bench.status & 0x800
