"""What the drive does when its objects are read and written: actual values, checks, refusals."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable
from typing import Final

from emulators.drive.cia402.axis import OPTION_CODES, ProfileAxis, interpolation_period_s
from emulators.drive.cia402.objects.mode_rules import ALLOWED
from emulators.drive.cia402.parameters import Parameters
from emulators.drive.cia402.units import wrap32
from emulators.drive.cia402.velocity_limits import VelocityLimits
from emulators.drive.supply import DcLink
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.errors import ConfigurationError

_ALLOWED: Final[dict[int, Container[int]]] = {
    **{index: allowed for index, allowed, _ in OPTION_CODES.values()},
    **ALLOWED,
}
"""Objects with a few allowed values; anything else is 06090030h (C402-073, C402-095)."""

REQUIRED: Final = (0x6040, 0x6041, 0x6060, 0x6061)
"""Without these an EDS is not that of a drive."""
FACTORS: Final = (0x608F, 0x6090, 0x6091, 0x6092, 0x6093, 0x6094, 0x6096, 0x6097)
"""Ratios, whose entries are not 0."""
NEVER_ZERO: Final = frozenset(
    (
        *FACTORS,
        *(0x6065, 0x6072, 0x6073, 0x6075, 0x6076, 0x607F, 0x6080, 0x6083, 0x6084, 0x6085, 0x6099, 0x609A),
        *(0x60C5, 0x60C6, 0x60E0, 0x60E1),
    )
)
"""Objects with which no drive moves if they are 0: an EDS with this default leaves them open."""
_PARAMETERS: Final = (0x6072, 0x6073, 0x607C, 0x607F, 0x6080, 0x60C5, 0x60C6, 0x60C8, 0x60C9, 0x60E0, 0x60E1)


_UNSIGNED: Final = (0, 0xFFFFFFFF)
_SIGNED: Final = (-0x80000000, 0x7FFFFFFF)
IN_VELOCITY_UNITS: Final[dict[int, tuple[int, int]]] = {
    **dict.fromkeys((0x607F00, 0x608100, 0x608200, 0x609901, 0x609902), _UNSIGNED),
    **dict.fromkeys((0x608300, 0x608400, 0x608500, 0x609A00, 0x60C500, 0x60C600), _UNSIGNED),
    **dict.fromkeys((0x60C800, 0x60C900), _SIGNED),
}
"""Keys of velocities and accelerations that 60A9h is the unit of, with the range of their type."""


def axis_readers(axis: ProfileAxis, dc_link: DcLink) -> dict[int, Callable[[], int | str]]:
    """Return what the actual and demand values show."""
    core = axis.core
    return {
        0x200002: lambda: axis.missing_count,
        0x606200: lambda: axis.demand_position,
        0x606300: lambda: wrap32(axis.internal_increments),
        0x606400: lambda: axis.actual_position,
        0x606900: lambda: round(core.velocity / math.tau * axis.units.speed_increments),
        0x606B00: lambda: axis.demand_velocity,
        0x606C00: lambda: axis.actual_velocity,
        0x607400: lambda: axis.permille(core.torque_demand),
        0x607700: lambda: axis.permille(core.torque),
        0x607800: lambda: axis.permille(core.torque),
        0x607900: lambda: round(dc_link.voltage_V * 1000.0),
        0x60E401: lambda: axis.actual_position,
        0x60E501: lambda: axis.actual_velocity,
        0x60F400: lambda: axis.following_error,
        0x60FA00: lambda: axis.demand_velocity,
        0x60FC00: lambda: wrap32(axis.demand_increments),
    }


def axis_checks(
    axis: ProfileAxis, parameters: Parameters, limits: VelocityLimits
) -> dict[int, Callable[[int], object]]:
    """Return the rules of the objects of the axis, whatever the mode."""
    values = axis.values
    core = axis.core
    checks: dict[int, Callable[[int], object]] = {}

    def changed(_value: int) -> None:
        parameters.changed = True

    def refuse_while_enabled(_value: int) -> None:
        if core.enabled:
            raise SdoAbort(AbortCode.DEVICE_STATE)

    def outside_operation(value: int, old: int) -> None:
        if value != old:
            refuse_while_enabled(value)
            parameters.changed = True

    def add(keys: Iterable[int], check: Callable[[int], object]) -> None:
        checks.update(dict.fromkeys(keys, check))

    def one_of(allowed: Container[int]) -> Callable[[int], None]:
        def check(value: int) -> None:
            if value not in allowed:
                raise SdoAbort(AbortCode.VALUE)
            parameters.changed = True

        return check

    def factor(key: int) -> Callable[[int], None]:
        def check(value: int) -> None:
            if not value:
                raise SdoAbort(AbortCode.VALUE)
            outside_operation(value, values[key])

        return check

    for index, allowed in _ALLOWED.items():
        checks[index << 8] = one_of(allowed)
    for index in FACTORS:
        for sub in (1, 2):
            checks[index << 8 | sub] = factor(index << 8 | sub)
    checks[0x607600] = factor(0x607600)
    checks[0x607E00] = lambda value: outside_operation(value, values[0x607E00])
    add([index << 8 for index in _PARAMETERS], changed)
    add((0x60FE01, 0x60FE02), changed)
    add((0x101001, 0x101002, 0x101003), refuse_while_enabled)

    def unit(value: int) -> None:
        old = values[0x60A900]
        try:
            size = axis.units.velocity_unit(value)
        except ConfigurationError:
            raise SdoAbort(AbortCode.VALUE) from None
        outside_operation(value, old)
        if value == old:
            return
        # What the drive can and does stays what it is; only the numbers that say it change.
        share = axis.units.velocity_unit(old) / size
        limits.follow(size)
        for key, (low, high) in IN_VELOCITY_UNITS.items():
            if values[key] not in (low, high):
                values[key] = min(max(round(values[key] * share), low), high)

    checks[0x60A900] = unit

    def lower_limit(value: int) -> None:
        if value > values[0x607D02]:
            raise SdoAbort(AbortCode.MAXIMUM_BELOW_MINIMUM)
        parameters.changed = True

    def upper_limit(value: int) -> None:
        if value < values[0x607D01]:
            raise SdoAbort(AbortCode.MAXIMUM_BELOW_MINIMUM)
        parameters.changed = True

    checks[0x607D01] = lower_limit
    checks[0x607D02] = upper_limit

    def homing_method(value: int) -> None:
        methods = [values[0x60E300 | sub] for sub in range(1, values[0x60E300] + 1)]
        if value and value not in methods:
            raise SdoAbort(AbortCode.VALUE)

    checks[0x609800] = homing_method

    def period(units: int, exponent: int) -> None:
        try:
            seconds = interpolation_period_s(units, exponent)
        except ConfigurationError:
            raise SdoAbort(AbortCode.VALUE) from None
        steps = seconds / core.period_s
        if steps < 0.5 or abs(steps - round(steps)) > 1e-6 * steps:
            raise SdoAbort(AbortCode.VALUE)
        parameters.changed = True

    checks[0x60C201] = lambda value: period(value, values[0x60C202])
    checks[0x60C202] = lambda value: period(values[0x60C201], value)

    def fresh(_value: int) -> None:
        axis.fresh = True

    add((0x60FF00, 0x607100), fresh)
    return checks
