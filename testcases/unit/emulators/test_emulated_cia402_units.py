"""Factor group of the drive."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.cia402.units import Units, round_half_away, velocity_unit_rad_s, wrap32
from fieldbus.errors import ConfigurationError

RPM = 2 * math.pi / 60


def units(**changes: int) -> Units:
    values = {
        0x608F01: 131072,
        0x608F02: 1,
        0x609101: 1,
        0x609102: 1,
        0x609201: 131072,
        0x609202: 1,
        0x609601: 1,
        0x609602: 1,
        0x60A900: 0x00B44700,
        0x607E00: 0,
        0x607600: 2000,
        0x609001: 131072,
        0x609002: 1,
        0x609301: 1,
        0x609302: 1,
        0x609401: 1,
        0x609402: 1,
        0x609701: 1,
        0x609702: 1,
        0x607B01: -0x80000000,
        0x607B02: 0x7FFFFFFF,
    }
    values.update({int(key[1:], 16): value for key, value in changes.items()})
    result = Units(counts_per_revolution=131072, rated_torque_Nm=2.0)
    result.update(values)
    return result


@pytest.mark.requirement("C402-245")
@pytest.mark.parametrize(
    ("unit", "size"),
    [
        (0x00B44700, RPM),
        (0, RPM),
        (0xFDB44700, RPM / 1000),
        (0x03B44700, RPM * 1000),
        (0x00B40300, 2 * math.pi),
        (0xFFB40300, 0.2 * math.pi),
        (0x00000300, 0.5),
    ],
)
def test_velocity_units(unit: int, size: float):
    """60A9h: rpm and revolutions per second with a decimal prefix in the top byte, and position units per
    second.
    """
    assert velocity_unit_rad_s(unit, 0.5) == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "position_unit", "size"),
    [
        (0xFD010300, 0xFD010000, 0.5),  # mm/s, mm
        (0xFD010300, 0xFA010000, 500.0),  # mm/s, um
        (0x00014700, 0xFD010000, 500.0 / 60.0),  # m/min, mm
        (0xFF410300, 0x00410000, 0.05),  # 0.1 degrees a second, degrees
    ],
)
def test_velocity_units_of_the_position_unit(unit: int, position_unit: int, size: float):
    """60A9h in the unit of 60A8h, whatever prefix each of them has; the position unit is 0.5 rad here."""
    assert velocity_unit_rad_s(unit, 0.5, 1.0, position_unit) == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize("unit", [0x00014700, 0x00B40000, 0x00B44701, 0x7FB44700])
def test_unknown_velocity_units_are_refused(unit: int):
    """A unit that the drive cannot compute with is refused, not taken for something else."""
    with pytest.raises(ConfigurationError, match="60A9h"):
        velocity_unit_rad_s(unit)


@pytest.mark.requirement("C402-166")
def test_position_factor():
    """Increments = pu * resolution * gear / feed: 10 mm screw with 1 um units, gear 3, 131072 inc/rev."""
    factor = units(_609101=3, _609201=10000)
    assert factor.to_increments(5000) == pytest.approx(5000 * 131072 * 3 / 10000)
    assert factor.to_user_position(round(131072 * 3 * 1.5)) == 15000
    assert factor.position == pytest.approx(3 * 2 * math.pi / 10000)


@pytest.mark.requirement("C402-165")
def test_polarity():
    """607Eh multiplies positions, velocities and torques by -1, each by its own bit."""
    factor = units(_607E00=0x80)
    assert (factor.to_user_position(1000), factor.to_increments(1000)) == (-1000, -1000.0)
    assert (factor.velocity_sign, factor.torque_sign) == (1, 1)
    assert units(_607E00=0x40).velocity_sign == -1
    assert units(_607E00=0x20).torque_sign == -1


@pytest.mark.exhaustive
@settings(deadline=None)
@given(st.integers(-(2**40), 2**40))
def test_increment_units_are_exact_32_bit_counters(increments: int):
    """With the increment as unit the position is the counter itself, wrapped to 32 bits."""
    assert units().to_user_position(increments) == wrap32(increments)


@pytest.mark.exhaustive
@settings(deadline=None)
@given(st.integers(-(10**12), 10**12), st.integers(1, 10**6))
def test_rounding(numerator: int, denominator: int):
    """Nearest integer, ties away from zero."""
    result = round_half_away(numerator, denominator)
    assert abs(result * denominator - numerator) * 2 <= denominator
    if abs(result * denominator - numerator) * 2 == denominator:
        assert abs(result * denominator) > abs(numerator)


@pytest.mark.exhaustive
@settings(deadline=None)
@given(st.integers(-(10**6), 10**6), st.integers(1, 10**6), st.integers(1, 5))
def test_positions_survive_the_way_there_and_back(position: int, feed: int, gear: int):
    """A position that is coarser than an increment comes back as it was."""
    factor = units(_609201=min(feed, 131072 * gear), _609101=gear)
    assert factor.to_user_position(round(factor.to_increments(position))) == wrap32(position)


def test_zero_factors_are_refused():
    """Numerator or denominator 0 leaves the old factors in force."""
    factor = units()
    with pytest.raises(ConfigurationError):
        factor.update(
            {
                **dict.fromkeys(
                    (0x608F01, 0x608F02, 0x609101, 0x609102, 0x609201, 0x609202, 0x609301, 0x609302), 0
                )
            }
        )
    assert factor.to_increments(7) == 7.0


@pytest.mark.requirement("C402-167", "C402-236", "C402-237", "C402-238", "C402-239")
def test_older_factors_come_on_top():
    """6093h scales positions, 6094h and 6096h velocities, 6097h accelerations; 1/1 leaves all to the newer
    objects.
    """
    plain = units()
    factor = units(_609301=5, _609302=2, _609401=3, _609402=4, _609601=2, _609602=1, _609701=7, _609702=10)
    assert factor.to_increments(1000) == pytest.approx(2500)
    assert factor.to_user_position(2500) == 1000
    assert factor.velocity == pytest.approx(plain.velocity * 0.75 * 2)
    assert factor.acceleration == pytest.approx(plain.velocity * 0.75 * 2 * 0.7)
    assert plain.acceleration == plain.velocity


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-164")
@given(increments=st.integers(-(2**40), 2**40), low=st.integers(-5000, 5000), span=st.integers(2, 10000))
def test_rotary_positions_stay_in_the_range(increments: int, low: int, span: int):
    """607Bh: every position is shown within the range, and repeats after modulo = max - min + 1."""
    factor = units(_607B01=low, _607B02=low + span - 1, _609201=3600)
    shown = factor.to_user_position(increments)
    assert low <= shown <= low + span - 1
    assert factor.wrap(shown + span) == factor.wrap(shown - span) == shown
    assert abs(factor.difference(shown, factor.wrap(shown + 1))) == 1
    assert abs(factor.difference(low, shown)) <= span / 2


@pytest.mark.requirement("C402-164")
@pytest.mark.parametrize("limits", [(5, 5), (-0x80000000, 0x7FFFFFFF)])
def test_no_range_is_a_linear_axis(limits: tuple[int, int]):
    """Minimum = maximum or the defaults: positions do not wrap but at 32 bits."""
    factor = units(_607B01=limits[0], _607B02=limits[1])
    assert factor.turn == 0
    assert factor.to_user_position(2**31) == -(2**31)
