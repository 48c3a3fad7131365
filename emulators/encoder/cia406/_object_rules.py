"""What the encoder does when its objects are read and written: present values, checks, refusals."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from emulators.encoder.cia406._channel import Channel
from emulators.encoder.cia406._measurement import Measurement
from emulators.encoder.cia406._objects import CAMS
from emulators.encoder.cia406.config import EncoderDeviceConfig
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.store import ObjectStore
from fieldbus.cia406 import OperatingParameter

EVENT_TIMER: Final = 0x180005
"""1800h:5, to which 6200h is hard-wired (C406-009)."""
LONGEST_INTERVAL_MS: Final = 1000
"""6031h:2."""
_HIGHEST_PRESET: Final = 1 << 62
"""6009h: so that its difference to any position still fits 64 bits."""


def readers(
    values: dict[int, Any], device: Measurement, operating_time_tenths: Callable[[], int]
) -> dict[int, Callable[[], int | str]]:
    """Return what is read live, by key.

    Args:
        values: Values of the object dictionary.
        device: Forms the positions.
        operating_time_tenths: Returns 6508h.

    """
    first = device.channels[0]
    scaling = device.scaling

    def sampled(get: Callable[[], int]) -> Callable[[], int]:
        def read() -> int:
            device.sample()
            return get()

        return read

    def settings(key: int) -> Callable[[], int]:
        def read() -> int:
            device.take_parameters()
            return int(values[key])

        return read

    found: dict[int, Callable[[], int | str]] = {
        0x600200: settings(0x600200),
        0x600400: sampled(lambda: first.position),
        0x600800: sampled(lambda: first.unfolded),
        0x600C00: sampled(lambda: first.raw),
        0x620000: lambda: values.get(EVENT_TIMER, 0),
        0x650000: lambda: values[0x600000],
        0x650800: operating_time_tenths,
        0x650900: settings_of(device, lambda: first.offset),
        0x650A03: lambda: scaling.raw_range - 1,
    }
    for number, channel in enumerate(device.channels, 1):
        found[0x602000 | number] = sampled(partial(_position, channel))
        found[0x603000 | number] = partial(_speed, channel)
        found[0x604000 | number] = partial(_acceleration, channel)
        found[0x605000 | number] = partial(_jerk, channel)
        found[0x650C00 | number] = settings_of(device, partial(_offset, channel))
        for index in (0x6300, 0x6400):
            found[index << 8 | number] = _state(values, device, index << 8 | number)
    return found


def _position(channel: Channel) -> int:
    return channel.position


def _speed(channel: Channel) -> int:
    return channel.speed


def _acceleration(channel: Channel) -> int:
    return channel.acceleration


def _jerk(channel: Channel) -> int:
    return channel.jerk


def _offset(channel: Channel) -> int:
    return channel.offset


def _state(values: dict[int, Any], device: Measurement, key: int) -> Callable[[], int]:
    def read() -> int:
        device.sample()
        return int(values[key])

    return read


def settings_of(device: Measurement, read: Callable[[], int]) -> Callable[[], int]:
    """Return a reader that first has written parameters taken over."""

    def take_and_read() -> int:
        device.take_parameters()
        return read()

    return take_and_read


def _within(low: int, high: int) -> Callable[[int], None]:
    def check(value: int) -> None:
        if value > high:
            raise SdoAbort(AbortCode.VALUE_HIGH)
        if value < low:
            raise SdoAbort(AbortCode.VALUE_LOW)

    return check


def checks(
    store: ObjectStore, device: Measurement, config: EncoderDeviceConfig
) -> dict[int, Callable[[int], object]]:
    """Return what checks and takes written values, by key.

    Args:
        store: Object dictionary.
        device: Forms the positions.
        config: The encoder.

    """
    return {**_position_checks(store.values, device, config), **_limit_checks(store, device)}


def _position_checks(
    values: dict[int, Any], device: Measurement, config: EncoderDeviceConfig
) -> dict[int, Callable[[int], object]]:
    linear = config.kind.linear

    def changes(key: int, check: Callable[[int], None]) -> Callable[[int], None]:
        """Refuse what is not allowed; another value makes the offset invalid (C406-007)."""

        def write(value: int) -> None:
            check(value)
            if value != values[key]:
                device.invalidate()

        return write

    def operating_parameters(value: int) -> None:
        direction = OperatingParameter.MEASURING_DIRECTION if linear else OperatingParameter.CODE_SEQUENCE
        known = direction | OperatingParameter.SCALING | OperatingParameter.COMMISSIONING_DIAGNOSTICS
        if value & ~int(known):
            raise SdoAbort(AbortCode.VALUE)

    def total_range(value: int) -> None:
        device.take_parameters()
        _within(1, device.scaling.largest_total(values))(value)

    def preset(channel: int) -> Callable[[int], None]:
        def write(value: int) -> None:
            device.take_parameters()
            _within(0, device.scaling.total - 1)(value)
            device.preset(value, channel=channel)

        return write

    def wide_preset(value: int) -> None:
        _within(-_HIGHEST_PRESET, _HIGHEST_PRESET)(value)
        device.preset(value)

    found: dict[int, Callable[[int], object]] = {
        0x600000: changes(0x600000, operating_parameters),
        0x600200: changes(0x600200, total_range),
        0x600300: preset(0),
        0x600900: wide_preset,
    }
    if linear:
        found[0x600501] = changes(0x600501, _within(config.measuring_step_nm, 0xFFFFFFFF))
        for sub in (2, 3, 4):
            found[0x600500 | sub] = _within(1, 0xFFFFFFFF)
    else:
        found[0x600100] = changes(0x600100, _within(1, config.steps_per_revolution))
    for number in range(1, len(device.channels) + 1):
        found[0x601000 | number] = preset(number - 1)
    return found


def _limit_checks(store: ObjectStore, device: Measurement) -> dict[int, Callable[[int], object]]:
    values = store.values

    def event_timer(value: int) -> None:
        values[0x620000] = value

    def cyclic_timer(value: int) -> None:
        entry = store.entries.get(EVENT_TIMER)
        if entry is not None:
            store.assign(entry, value)

    def lower(key: int) -> Callable[[int], None]:
        def check(value: int) -> None:
            if value > values[key + 0x100]:
                raise SdoAbort(AbortCode.MAXIMUM_BELOW_MINIMUM)
            device.forget_sample()

        return check

    def upper(key: int) -> Callable[[int], None]:
        def check(value: int) -> None:
            if value < values[key - 0x100]:
                raise SdoAbort(AbortCode.MAXIMUM_BELOW_MINIMUM)
            device.forget_sample()

        return check

    def again(_value: int) -> None:
        device.forget_sample()

    found: dict[int, Callable[[int], object]] = {
        EVENT_TIMER: event_timer,
        0x620000: cyclic_timer,
        0x603101: _within(0, 1),
        0x603102: _within(1, LONGEST_INTERVAL_MS),
        0x603103: _within(1, 0xFFFF),
        0x603104: _within(1, 0xFFFF),
    }
    for number in range(1, len(device.channels) + 1):
        found[0x640100 | number] = lower(0x640100 | number)
        found[0x640200 | number] = upper(0x640200 | number)
        cams = (0x6301, 0x6302, *(base + cam for base in (0x6310, 0x6320, 0x6330) for cam in range(CAMS)))
        for index in cams:
            found[index << 8 | number] = again
    return found
