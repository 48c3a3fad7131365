"""Factor group: from the user's units to rad, rad/s, rad/s^2 and increments, and back (C402-165 to C402-167).

Velocities of 60A9h in revolutions refer to the motor shaft. The acceleration unit is the velocity unit per
second, times 6097h. The older factors come on top, so that 1/1 leaves all to the newer objects: 6093h
multiplies the increments of a position unit, 6094h and 6096h the velocity unit. 6089h to 608Eh and 60A8h name
units and convert nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any, Final

from fieldbus.errors import ConfigurationError

RANGE_OFF: Final = (-0x80000000, 0x7FFFFFFF)
"""Values of 607Bh and 607Dh for no limit."""
_TAU: Final = 2.0 * math.pi
_REVOLUTION: Final = 0xB4
_INCREMENT: Final = 0xB5
_SECOND: Final = 0x03
_MINUTE: Final = 0x47
_RPM: Final = _REVOLUTION << 16 | _MINUTE << 8
_POLARITY_POSITION: Final = 0x80
_POLARITY_VELOCITY: Final = 0x40
_POLARITY_TORQUE: Final = 0x20


def velocity_unit_rad_s(
    unit: int, user_position_rad: float = 1.0, increment_rad: float = 1.0, position_unit: int = 0
) -> float:
    """Return the size of a velocity unit of 60A9h at the motor shaft, rad/s.

    Args:
        unit: Value of 60A9h: 0 = not specified, taken as rpm; otherwise bits 31..24 decimal exponent,
            23..16 numerator (B4h revolution, B5h increment, 00h position unit, or the unit that 60A8h has:
            01h metre, 41h degree, ...), 15..8 denominator (47h minute, 03h second), 7..0 zero.
        user_position_rad: Size of the position unit at the motor shaft, rad.
        increment_rad: Size of an increment of the encoder, rad.
        position_unit: Value of 60A8h; its exponent and its unit are those of the position unit.

    Raises:
        ConfigurationError: The unit is not known.

    """
    if unit == 0:
        unit = _RPM
    exponent = _exponent(unit)
    numerator = unit >> 16 & 0xFF
    if numerator not in (_REVOLUTION, _INCREMENT, 0) and numerator == position_unit >> 16 & 0xFF:
        exponent -= _exponent(position_unit)
        numerator = 0
    denominator = unit >> 8 & 0xFF
    if (
        numerator not in (_REVOLUTION, _INCREMENT, 0)
        or denominator not in (_SECOND, _MINUTE)
        or unit & 0xFF
        or abs(exponent) > 9
    ):
        raise ConfigurationError(
            "60A9h",
            f"{unit:08X}h",
            "xxB44700h (rpm), xxB40300h (1/s), xxB50300h (inc/s), xx000300h (pu/s), "
            "or the unit of 60A8h per second",
        )
    size = {_REVOLUTION: _TAU, _INCREMENT: increment_rad, 0: user_position_rad}[numerator]
    if denominator == _MINUTE:
        size /= 60.0
    return size * 10.0**exponent if exponent >= 0 else size / 10.0**-exponent


def _exponent(unit: int) -> int:
    """Return the decimal exponent of a unit."""
    exponent = unit >> 24 & 0xFF
    return exponent - 0x100 if exponent > 0x7F else exponent


def round_half_away(numerator: int, denominator: int) -> int:
    """Return numerator / denominator as the nearest integer, ties away from zero; denominator > 0."""
    if numerator >= 0:
        return (2 * numerator + denominator) // (2 * denominator)
    return -((-2 * numerator + denominator) // (2 * denominator))


def wrap32(value: int) -> int:
    """Return `value` as a 32-bit two's complement counter shows it."""
    return (value + 0x80000000 & 0xFFFFFFFF) - 0x80000000


class Units:
    """The factors in effect.

    Args:
        counts_per_revolution: Increments of the real encoder per motor revolution.
        rated_torque_Nm: What 1000 permille are, Nm.

    """

    def __init__(self, *, counts_per_revolution: int, rated_torque_Nm: float) -> None:
        self._counts = counts_per_revolution
        self.inc_numerator = 1
        """Increments = position units * inc_numerator / inc_denominator."""
        self.inc_denominator = 1
        self.plain = True
        """The position unit is the increment and the polarity is positive."""
        self.position = 1.0
        """Size of a position unit, rad, without sign."""
        self.velocity = 1.0
        """Size of a velocity unit, rad/s."""
        self.acceleration = 1.0
        """Size of an acceleration unit, rad/s^2."""
        self.torque = rated_torque_Nm / 1000.0
        """Size of a torque unit, Nm."""
        self.position_sign = self.velocity_sign = self.torque_sign = 1
        self.turn = 0
        """Position units after which positions of a rotary axis repeat (607Bh); 0 = a linear axis."""
        self._lowest = 0
        self._position_unit = 0
        self.speed_increments = float(counts_per_revolution)
        """What 6069h shows at one motor revolution per second (6090h)."""

    def update(self, values: Mapping[int, Any]) -> None:
        """Read the factor group from the values of the device.

        Raises:
            ConfigurationError: A factor is zero or a unit is not known; the old factors stay.

        """

        def ratio(index: int) -> Fraction:
            numerator, denominator = values[index << 8 | 1], values[index << 8 | 2]
            if not numerator or not denominator:
                raise ConfigurationError(
                    f"{index:04X}h", f"{numerator}/{denominator}", "numerator and denominator > 0"
                )
            return Fraction(int(numerator), int(denominator))

        increments = ratio(0x608F) * ratio(0x6091) / ratio(0x6092) * ratio(0x6093)
        position = float(increments) * _TAU / self._counts
        position_unit = int(values.get(0x60A800, 0))
        velocity = velocity_unit_rad_s(values[0x60A900], position, _TAU / self._counts, position_unit)
        velocity *= float(ratio(0x6096) * ratio(0x6094))
        acceleration = velocity * float(ratio(0x6097))
        speed_increments = float(ratio(0x6090))
        lowest, highest = values[0x607B01], values[0x607B02]
        polarity = values[0x607E00]
        self.inc_numerator = increments.numerator
        self.inc_denominator = increments.denominator
        self.position = position
        self.velocity = velocity
        self.acceleration = acceleration
        self.speed_increments = speed_increments
        self.torque = values[0x607600] * 1e-6
        self.position_sign = -1 if polarity & _POLARITY_POSITION else 1
        self.velocity_sign = -1 if polarity & _POLARITY_VELOCITY else 1
        self.torque_sign = -1 if polarity & _POLARITY_TORQUE else 1
        self._lowest = lowest
        self._position_unit = position_unit
        self.turn = 0 if lowest >= highest or (lowest, highest) == RANGE_OFF else highest - lowest + 1
        self.plain = increments == 1 and self.position_sign == 1 and not self.turn

    def velocity_unit(self, unit: int) -> float:
        """Return the size of a velocity unit of 60A9h without the older factors, rad/s.

        Raises:
            ConfigurationError: The unit is not known.

        """
        return velocity_unit_rad_s(unit, self.position, _TAU / self._counts, self._position_unit)

    def to_user_position(self, increments: int) -> int:
        """Return a number of increments in position units, 32 bits (rounded to
        nearest, ties away from zero).
        """
        if self.plain:
            return (increments + 0x80000000 & 0xFFFFFFFF) - 0x80000000
        return self.wrap(
            round_half_away(self.position_sign * increments * self.inc_denominator, self.inc_numerator)
        )

    def wrap(self, position: int) -> int:
        """Return a position as the drive shows it: within 607Bh, or within 32 bits (C402-164)."""
        if self.turn:
            return (position - self._lowest) % self.turn + self._lowest
        return wrap32(position)

    def difference(self, position: int, origin: int) -> int:
        """Return the shortest way from `origin` to `position`, position units."""
        if self.turn:
            return (position - origin + self.turn // 2) % self.turn - self.turn // 2
        return wrap32(position - origin)

    def to_increments(self, user_position: int) -> float:
        """Return position units in increments, not rounded."""
        if self.plain:
            return float(user_position)
        return self.position_sign * user_position * self.inc_numerator / self.inc_denominator
