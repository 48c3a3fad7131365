"""What writing the objects of the modes does: couplings of vl, buffer of ip, ranges, profile types."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Final

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.function import DriveFunction
from emulators.drive.cia402.modes import VL_FULL as FULL
from emulators.drive.cia402.modes import InterpolatedPosition, vl_percentage, vl_scale, vl_units
from emulators.drive.cia402.parameters import Parameters
from emulators.drive.cia402.warnings import DriveWarning, Warnings
from fieldbus.canopen.abort import AbortCode, SdoAbort

REFUSALS: Final = (
    DriveWarning.MODE_REFUSED
    | DriveWarning.TARGET_REFUSED
    | DriveWarning.SETPOINT_REFUSED
    | DriveWarning.BUFFER_EMPTY
)
"""Warnings because of what the controller has sent."""

ALLOWED: Final[dict[int, tuple[int, ...]]] = {
    0x606A: (0, 1),  # one encoder gives position and velocity
    0x6086: (0, 1, 2, 3),
    0x6088: (0, 1),
    0x60A3: (1, 2),
    0x60C0: (0,),
}
"""Objects with a few allowed values; anything else is 06090030h (C402-095, C402-098, C402-172)."""

_RAMP_TIMES: Final = {0x6048: 0x604F, 0x6049: 0x6050, 0x604A: 0x6051}
"""Ramp as delta speed and delta time, and the same ramp as the time from zero to 604Eh."""
_REFERENCE: Final = 3000
"""Default of 604Eh, rpm."""
_RELATIVE: Final = 0x40
_U16: Final = 0xFFFF
_U32: Final = 0xFFFFFFFF

Checks = dict[int, Callable[[int], object]]


def mode_readers(
    axis: ProfileAxis, interpolation: InterpolatedPosition
) -> dict[int, Callable[[], int | str]]:
    """Return what 6043h, 6044h, 6053h to 6055h and 60C4h:4 show."""
    core = axis.core
    return {
        0x604300: lambda: vl_units(axis, core.precontrol_velocity),
        0x604400: lambda: vl_units(axis, core.velocity),
        0x605300: lambda: vl_percentage(axis, core.precontrol_velocity),
        0x605400: lambda: vl_percentage(axis, core.velocity),
        0x605500: lambda: vl_percentage(axis, core.velocity_demand),
        0x60C404: lambda: interpolation.buffer.write,
    }


def mode_checks(function: DriveFunction, warnings: Warnings, parameters: Parameters) -> Checks:
    """Return the rules of the modes' objects."""
    return {
        **_velocity_mode(function.axis),
        **_interpolation(function, warnings),
        **_positions(function, warnings, parameters),
    }


def restore_buffer(mode: InterpolatedPosition) -> None:
    """Set the buffer of ip up as 60C4h says, empty, as after reset or power-on."""
    values = mode.axis.values
    mode.buffer.configure(size=values[0x60C402], organisation=values[0x60C403], enabled=values[0x60C406] == 1)


def coupled_values(objects: Mapping[tuple[int, int], int]) -> dict[tuple[int, int], int]:
    """Return what defaults of 6046h and of the ramp times mean for 6047h and the ramps."""
    coupled: dict[tuple[int, int], int] = {}
    for (index, sub), value in objects.items():
        if index == 0x6046:
            coupled[0x6047, sub] = coupled[0x6047, sub + 2] = value
    for index, other in _RAMP_TIMES.items():
        if (other, 0) in objects:
            slope = _ramp(objects[other, 0], objects.get((0x604E, 0), _REFERENCE))
            coupled[index, 1], coupled[index, 2] = slope
    return coupled


# -- vl ------------------------------------------------------------------------------------------------


def _velocity_mode(axis: ProfileAxis) -> Checks:
    values = axis.values
    checks: Checks = {}

    def amount(sub: int) -> Callable[[int], None]:
        def set_both(value: int) -> None:
            # 6046h is 6047h for both directions at once.
            values[0x604700 | sub] = values[0x604700 | sub + 2] = value

        return set_both

    for sub in (1, 2):
        checks[0x604600 | sub] = amount(sub)

    def ramp(index: int, sub: int) -> Callable[[int], None]:
        def set_time(value: int) -> None:
            speed = value if sub == 1 else values[index << 8 | 1]
            time = value if sub == 2 else values[index << 8 | 2]
            values[_RAMP_TIMES[index] << 8] = _time_ms(speed, time, values[0x604E00])

        return set_time

    def ramp_time(index: int) -> Callable[[int], None]:
        def set_ramp(value: int) -> None:
            speed, time = _ramp(value, values[0x604E00])
            values[index << 8 | 1] = speed
            values[index << 8 | 2] = time

        return set_ramp

    for index, other in _RAMP_TIMES.items():
        checks[index << 8 | 1] = ramp(index, 1)
        checks[index << 8 | 2] = ramp(index, 2)
        checks[other << 8] = ramp_time(index)

    def reference(value: int) -> None:
        if not value:
            raise SdoAbort(AbortCode.VALUE)
        # The ramps stay as they are; what they take to the new reference changes.
        for index, other in _RAMP_TIMES.items():
            values[other << 8] = _time_ms(values[index << 8 | 1], values[index << 8 | 2], value)
        values[0x605200] = _saturated(values[0x604200] * vl_scale(axis) * FULL / value)

    checks[0x604E00] = reference

    def target(value: int) -> None:
        values[0x605200] = _saturated(value * vl_scale(axis) * FULL / (values[0x604E00] or 1))

    def nominal(value: int) -> None:
        values[0x604200] = _saturated(value * values[0x604E00] / FULL / vl_scale(axis))

    checks[0x604200] = target
    checks[0x605200] = nominal

    def not_zero(value: int) -> None:
        if not value:
            raise SdoAbort(AbortCode.VALUE)

    for index in (0x604B, 0x604C):
        for sub in (1, 2):
            checks[index << 8 | sub] = not_zero

    def poles(value: int) -> None:
        if not value or value % 2:
            raise SdoAbort(AbortCode.VALUE)

    checks[0x604D00] = poles
    return checks


def _time_ms(speed: int, time: int, reference: int) -> int:
    """Return how long a ramp takes from zero to a speed, ms; 0 = no ramp of its own."""
    return min(round(reference * time * 1000 / speed), _U32) if speed else 0


def _ramp(time_ms: int, reference: int) -> tuple[int, int]:
    """Return delta speed and delta time of the ramp that takes a time, ms, from zero to a speed."""
    if not time_ms:
        return reference, 0
    slope = Fraction(reference * 1000, time_ms)
    if slope.denominator > _U16:
        slope = slope.limit_denominator(_U16)
    if not slope.numerator:
        return 1, _U16
    return (slope.numerator, slope.denominator) if slope.numerator <= _U32 else (_U32, 1)


def _saturated(value: float) -> int:
    return min(max(round(value), -0x8000), 0x7FFF)


# -- ip ------------------------------------------------------------------------------------------------


def _interpolation(function: DriveFunction, warnings: Warnings) -> Checks:
    values = function.axis.values
    buffer = function.interpolation.buffer

    def record(value: int) -> None:
        taken = buffer.put(value)
        warnings.warn(DriveWarning.SETPOINT_REFUSED, not taken)
        if not taken:
            raise SdoAbort(AbortCode.DEVICE_STATE)

    def size(value: int) -> None:
        if not 1 <= value <= values[0x60C401]:
            raise SdoAbort(AbortCode.VALUE)
        buffer.configure(size=value, organisation=buffer.organisation, enabled=buffer.enabled)

    def organisation(value: int) -> None:
        if value not in (0, 1):
            raise SdoAbort(AbortCode.VALUE)
        buffer.configure(size=buffer.size, organisation=value, enabled=buffer.enabled)

    def place(value: int) -> None:
        if value >= buffer.size or (value != buffer.write and not buffer.organisation):
            raise SdoAbort(AbortCode.VALUE)
        buffer.go_to(value)

    def record_size(value: int) -> None:
        if value != 1:
            raise SdoAbort(AbortCode.VALUE)

    def access(value: int) -> None:
        if value not in (0, 1):
            raise SdoAbort(AbortCode.VALUE)
        buffer.configure(size=buffer.size, organisation=buffer.organisation, enabled=value == 1)
        warnings.warn(DriveWarning.SETPOINT_REFUSED, False)

    return {
        0x60C101: record,
        0x60C402: size,
        0x60C403: organisation,
        0x60C404: place,
        0x60C405: record_size,
        0x60C406: access,
    }


# -- positions -----------------------------------------------------------------------------------------


def _positions(function: DriveFunction, warnings: Warnings, parameters: Parameters) -> Checks:
    axis = function.axis
    values = axis.values

    def target(value: int) -> None:
        axis.fresh = axis.primed = True
        if axis.units.turn:
            within_range(value)

    def within_range(value: int) -> None:
        """Refuse a target outside of 607Bh; a way of pp may be longer (C402-164)."""
        outside = not values[0x607B01] <= value <= values[0x607B02]
        if outside and axis.control_word & _RELATIVE and function.mode.number == 1:
            outside = False
        warnings.warn(DriveWarning.TARGET_REFUSED, outside)
        if outside:
            raise SdoAbort(AbortCode.VALUE)

    def range_limit(sub: int) -> Callable[[int], None]:
        def check(value: int) -> None:
            if value != values[0x607B00 | sub] and axis.core.enabled:
                raise SdoAbort(AbortCode.DEVICE_STATE)
            low, high = (value, values[0x607B02]) if sub == 1 else (values[0x607B01], value)
            if low > high:
                raise SdoAbort(AbortCode.MAXIMUM_BELOW_MINIMUM)
            parameters.changed = True
            warnings.warn(DriveWarning.TARGET_REFUSED, False)

        return check

    def positioning(value: int) -> None:
        # Bits 1..0 origin of relative targets, bits 7..6 direction on a rotary axis; the rest is reserved.
        if value & ~0xC3 or value & 3 == 3:
            raise SdoAbort(AbortCode.VALUE)

    return {
        0x607A00: target,
        0x607B01: range_limit(1),
        0x607B02: range_limit(2),
        0x60F200: positioning,
    }
