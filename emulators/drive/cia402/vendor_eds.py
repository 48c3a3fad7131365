"""What the EDS of a vendor says about his drive: its speed, torque, encoder, ramps and units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from os import PathLike, fspath
from typing import Any, Final

from emulators.drive.cia402.objects.rules import IN_VELOCITY_UNITS, NEVER_ZERO
from emulators.drive.cia402.objects.table import all_objects
from emulators.drive.cia402.units import Units
from emulators.drive.machine import EncoderConfig
from fieldbus.canopen import shared_dictionary
from fieldbus.canopen.dictionary import Entry, entries_of
from fieldbus.errors import ConfigurationError

_RPM: Final = math.tau / 60.0
_PERIOD: Final = 0x60C201
_ENCODER: Final = 0x608F
_OLDER_UNITS: Final = {0xA3: 0x00B40300, 0xA4: 0x00B44700}
"""Dimension index of 608Ch -> unit of 60A9h without its exponent: revolutions per second, per minute."""

Objects = dict[tuple[int, int], int]


class VendorEds:
    """The defaults of an EDS, as bench file and emulated drive take them.

    Args:
        path: EDS or DCF.
        increments_per_revolution: Of the encoder, where the file leaves that open.
        shown: What objects of the drive hold, by key, where that is known; it counts in place of the
            defaults of the file.

    Raises:
        ConfigurationError: The file cannot be read, or names a velocity unit that is not known.

    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        increments_per_revolution: int = EncoderConfig.counts_per_revolution,
        shown: Mapping[int, int] | None = None,
    ) -> None:
        self._path = fspath(path)
        self._entries = entries_of(shared_dictionary(path), 1)
        for key, value in (shown or {}).items():
            entry = self._entries.get(key)
            if entry is not None and entry.integer:
                entry.default, entry.given = entry.coerce(value), True
        self.increments_per_revolution = self._increments_per_revolution()
        """608Fh, where it is a whole number of at least four."""
        self._builtin: dict[int, Any] = {
            row.index << 8 | sub: item.default or 0
            for row in all_objects()
            for sub, item in row.items.items()
        }
        counts = self.increments_per_revolution or increments_per_revolution
        self._builtin[0x608F01] = counts
        self._left_open: Objects = {}
        """What the file leaves open, and what follows from the rest of it."""
        if self.given(0x6092, 1) is None:
            self._left_open |= {(0x6092, 1): counts, (0x6092, 2): 1}  # the position unit is the increment
        if self.given(0x60A9) is None:
            self._left_open[0x60A9, 0] = self._older_unit()
        self._builtin |= {index << 8 | sub: value for (index, sub), value in self._left_open.items()}
        self._units = Units(counts_per_revolution=counts, rated_torque_Nm=1.0)
        self._units.update({key: self._default(key) for key in self._builtin})
        for key, (low, high) in IN_VELOCITY_UNITS.items():  # built-in defaults are in rpm
            index, sub, value = key >> 8, key & 0xFF, self._builtin[key]
            if self.given(index, sub) is None and value not in (low, high):
                self._left_open[index, sub] = min(round(value * _RPM / self._units.velocity), high)

    def _default(self, key: int) -> Any:
        given = self.given(key >> 8, key & 0xFF)
        return self._builtin[key] if given is None else given

    def _older_unit(self) -> int:
        """Return the unit of 608Bh and 608Ch, which came before 60A9h, as 60A9h says it; else rpm."""
        exponent = (self.given(0x608B) or 0) & 0xFF
        return exponent << 24 | _OLDER_UNITS.get(self.given(0x608C) or 0, _OLDER_UNITS[0xA4])

    def given(self, index: int, sub: int = 0) -> int | None:
        """Return a default of the file; None where it has no such whole number or leaves it open.

        The value 0 leaves it open where no drive could work with it: a ratio, a rated value, a limit. So does
        608Fh if a revolution has no whole number of increments, which no encoder of a bench has.
        """
        if index == _ENCODER and self.increments_per_revolution is None:
            return None
        return self._number(index, sub)

    def _number(self, index: int, sub: int = 0) -> int | None:
        entry = self._entries.get(index << 8 | sub)
        if entry is None or not entry.given or not entry.integer:
            return None
        value = int(entry.default)
        if value == 0 and (index in NEVER_ZERO or entry.key == _PERIOD):
            return None
        return value

    def _increments_per_revolution(self) -> int | None:
        increments, revolutions = self._number(_ENCODER, 1), self._number(_ENCODER, 2) or 1
        if increments is None or increments % revolutions or not 4 <= increments // revolutions <= 1 << 24:
            return None
        return increments // revolutions

    # -- as keys of the bench file ------------------------------------------------------------------------

    @property
    def rated_torque_nm(self) -> float | None:
        """6076h, Nm."""
        rated = self.given(0x6076)
        return None if rated is None else rated / 1000.0

    @property
    def max_torque_permille(self) -> int | None:
        """Lower one of 6072h and 6073h, permille of the rated torque or current."""
        given = [value for value in (self.given(0x6072), self.given(0x6073)) if value is not None]
        return min(given, default=None)

    @property
    def rated_current_A(self) -> float | None:
        """6075h, A."""
        rated = self.given(0x6075)
        return None if rated is None else rated / 1000.0

    # -- as the controller uses it --------------------------------------------------------------------

    def entries(self, node_id: int) -> dict[int, Entry]:
        """Return the entries of the file for a node-ID."""
        return entries_of(shared_dictionary(self._path), node_id)

    @property
    def velocity_unit_rpm(self) -> float:
        """Size of a velocity unit, rpm."""
        return self._units.velocity / _RPM

    @property
    def increments_per_unit(self) -> float:
        """Increments of the encoder in a position unit."""
        return self._units.inc_numerator / self._units.inc_denominator

    def bench_keys(self) -> Iterator[tuple[str, float]]:
        """Yield the keys of `[drive.NAME]` about which the file says something, with its values."""
        if self.increments_per_revolution is not None:
            yield "increments_per_revolution", self.increments_per_revolution
        if self.rated_torque_nm is not None:
            yield "rated_torque_nm", self.rated_torque_nm
        speed_rpm = self._max_speed_rpm()
        if speed_rpm is None:
            return
        yield "max_speed_rpm", speed_rpm
        for key, index in (("off1_ramp_s", 0x6084), ("off3_ramp_s", 0x6085)):
            deceleration = self.given(index)
            if deceleration:
                ramp_s = speed_rpm * _RPM / (deceleration * self._units.acceleration)
                if 0.001 <= ramp_s <= 1000.0:
                    yield key, ramp_s

    def _max_speed_rpm(self) -> float | None:
        motor, profile = self.given(0x6080), self.given(0x607F)
        speeds = [] if motor is None else [float(motor)]
        if profile is not None:
            speeds.append(profile * self._units.velocity / _RPM)
        lowest = min(speeds, default=0.0)
        return lowest if 1.0 <= lowest <= 200_000.0 else None

    # -- what the bench file changes ----------------------------------------------------------------------

    def objects(self, wanted: Mapping[str, float], written: frozenset[str]) -> Objects:
        """Return the defaults that the bench file gives to objects of the drive.

        These are the keys that are written in it, and those about which the EDS says nothing.

        Args:
            wanted: `max_speed_rpm`, `off1_ramp_s`, `off3_ramp_s`, `rated_torque_nm` and
                `increments_per_revolution` of the drive, and `cycle_ms` of the bench.
            written: Keys that the bench file has.

        Raises:
            ConfigurationError: A written key is beyond the limits that the EDS gives its object.

        """
        objects = dict(self._left_open)
        if self.given(0x60C2, 1) is None:
            objects |= {(0x60C2, 1): round(wanted["cycle_ms"]), (0x60C2, 2): -3}
        for key, index, sub, value in self._of_keys(wanted):
            if key in written:
                self._check(key, wanted[key], index, sub, value)
            elif self.given(index, sub) is not None:
                continue
            objects[index, sub] = value
        return objects

    def _of_keys(self, wanted: Mapping[str, float]) -> Iterator[tuple[str, int, int, int]]:
        """Yield key, index, sub-index and value of what the keys say, in the units of the file."""
        units = self._units
        speed = wanted["max_speed_rpm"] * _RPM
        yield "max_speed_rpm", 0x607F, 0, round(speed / units.velocity)
        yield "max_speed_rpm", 0x6080, 0, round(wanted["max_speed_rpm"])
        for key, index in (
            ("off1_ramp_s", 0x6083),
            ("off1_ramp_s", 0x6084),
            ("off3_ramp_s", 0x6085),
            ("off1_ramp_s", 0x609A),
        ):
            yield key, index, 0, round(speed / wanted[key] / units.acceleration)
        yield "max_speed_rpm", 0x6099, 1, round(speed / 15.0 / units.velocity)
        yield "max_speed_rpm", 0x6099, 2, round(speed / 150.0 / units.velocity)
        yield "rated_torque_nm", 0x6076, 0, round(wanted["rated_torque_nm"] * 1000.0)
        yield "increments_per_revolution", 0x608F, 1, round(wanted["increments_per_revolution"])
        yield "increments_per_revolution", 0x608F, 2, 1

    def _check(self, key: str, value: float, index: int, sub: int, written: int) -> None:
        entry: Entry | None = self._entries.get(index << 8 | sub)
        if entry is None or not entry.integer:
            return
        low, high = entry.type_range
        low = low if entry.low is None else max(low, int(entry.low))
        high = high if entry.high is None else min(high, int(entry.high))
        if not low <= written <= high:
            raise ConfigurationError(
                key,
                f"{value:g}",
                f"{low} to {high} in {index:04X}h:{sub} of {self._path}, where it is {written}",
            )
