"""Parameters that the profile itself needs: identification, telegram, faults
and warnings, loading and saving.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from emulators.drive.profidrive.faults.buffer import FaultBuffer, FaultMessage
from emulators.drive.profidrive.parameters.store import ParameterStore, Reader
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import Telegram
from fieldbus.profidrive.requests import LONGEST_RECORD, MOST_PARAMETERS
from fieldbus.profidrive.signal_numbers import signal_numbers

WARNING_WORDS = range(953, 961)
_RESTART_IMMEDIATELY, _RESTART_LATER = 1, 3
_HALF, _FULL = 1 << 31, 1 << 32
_LOAD_FACTORY, _LOAD_SAVED = 1, 10


@dataclass(frozen=True, kw_only=True)
class Identification:
    """What PNU 964, 965, 974, 975 and 978 tell.

    Args:
        manufacturer: Vendor-ID, 0..65535.
        device_type: PNU 964[1], 0..65535.
        object_type: PNU 975[1], 0..65535.
        version: Firmware version times 100, such as 521.
        year: Of the firmware.
        day_month: Day * 100 + month.
        object_class: PNU 975[5]: 1 axis, 5 encoder.
        object_sub_class: PNU 975[6]: application classes as bits.
        object_id: DO-ID of this object, 1..254.
        object_ids: DO-IDs of the device, 1..8 of them.
        profile_version: PNU 965, such as 42.
        multi: Whether a request may hold several parameters.
        latency_ms: PNU 974[2].

    Raises:
        ConfigurationError: A value does not fit its word.

    """

    manufacturer: int = 0x002A
    device_type: int = 5300
    object_type: int = 11
    version: int = 521
    year: int = 2026
    day_month: int = 101
    object_class: int = 1
    object_sub_class: int = 0
    object_id: int = 1
    object_ids: tuple[int, ...] = (1,)
    profile_version: int = 42
    multi: bool = True
    latency_ms: int = 50

    def __post_init__(self) -> None:
        for name in (
            "manufacturer",
            "device_type",
            "object_type",
            "version",
            "year",
            "day_month",
            "object_class",
            "object_sub_class",
            "latency_ms",
        ):
            if not 0 <= getattr(self, name) <= 0xFFFF:
                raise ConfigurationError(f"identification, {name}", getattr(self, name), "0..65535")
        if not 0 <= self.profile_version <= 0xFF:
            raise ConfigurationError("identification, profile_version", self.profile_version, "0..255")
        if not 1 <= len(self.object_ids) <= 8 or not all(1 <= one <= 254 for one in self.object_ids):
            raise ConfigurationError("identification, object_ids", self.object_ids, "1 to 8 numbers 1..254")
        if self.object_id not in self.object_ids:
            raise ConfigurationError("identification, object_id", self.object_id, f"one of {self.object_ids}")


def identify(store: ParameterStore, who: Identification) -> None:
    """Enter the identification of device and drive object (PD-247, PD-248, PD-252 to PD-254)."""
    common = (who.version, who.year, who.day_month)
    rows: Mapping[int, tuple[int, ...]] = {
        964: (who.manufacturer, who.device_type, *common, len(who.object_ids)),
        965: (3, who.profile_version),
        974: (LONGEST_RECORD, MOST_PARAMETERS if who.multi else 1, who.latency_ms),
        975: (
            who.manufacturer,
            who.object_type,
            *common,
            who.object_class,
            who.object_sub_class,
            who.object_id,
        ),
        978: who.object_ids,
    }
    for number, row in rows.items():
        _fill(store, number, row)


def show_telegram(store: ParameterStore, telegram: Telegram, *, by_bus: bool = True) -> None:
    """Show the telegram in effect: PNU 915, 916, 922, 923 (PD-031, PD-233, PD-235, PD-236).

    Args:
        store: The parameters.
        telegram: Telegram in effect.
        by_bus: The bus configuration has chosen it: PNU 922 and p2079 can only be read.

    """
    setpoint, actual = signal_numbers(telegram.setpoint), signal_numbers(telegram.actual)
    _fill(store, 915, setpoint)
    _fill(store, 916, actual)
    _fill(store, 923, sorted({*setpoint, *actual} - {0}))
    for number in (922, 2079):
        store.set(number, telegram.number)
        if by_bus:
            store.locked.add(number)


def connect_faults(
    store: ParameterStore,
    buffer: FaultBuffer,
    catalogue: Mapping[int, tuple[int, str]],
    *,
    cleared: Callable[[], None] | None = None,
) -> None:
    """Connect PNU 944 to 952 and r2131 to a fault buffer (PD-134 to PD-136).

    Args:
        store: The parameters.
        buffer: The fault buffer of the axis.
        catalogue: Fault code and text of every fault number that the drive knows.
        cleared: Called after 0 was written to PNU 952; None = the buffer alone is cleared.

    """

    def entry(field: Callable[[FaultMessage], int]) -> Reader:
        def read(sub_index: int) -> int:
            message = buffer.entry(sub_index)
            return 0 if message is None else field(message)

        return read

    def clear(_sub_index: int, _value: float) -> None:
        buffer.clear()
        if cleared is not None:
            cleared()

    numbers = sorted(catalogue)
    _resize(store, 946, [catalogue[number][0] for number in numbers])
    _resize(store, 951, numbers, [catalogue[number][1] for number in numbers])
    store.readers[944] = lambda _: buffer.counter
    store.readers[945] = entry(lambda message: message.code)
    store.readers[947] = entry(lambda message: message.number)
    store.readers[948] = entry(lambda message: message.time_ms)
    store.readers[949] = entry(lambda message: (message.value + _HALF) % _FULL - _HALF)
    store.readers[952] = lambda _: buffer.situations
    store.readers[2131] = lambda _: buffer.present[0].number if buffer.present else 0
    store.writers[952] = clear


def connect_warnings(
    store: ParameterStore, listed: Iterable[int], active: Callable[[], Iterable[int]]
) -> None:
    """Connect the warning words, r2122 and r2132 (PD-138).

    Args:
        store: The parameters.
        listed: Numbers of the warnings, up to 128; the n-th has bit n % 16 of PNU 953 + n // 16.
        active: Returns the numbers of the active warnings, oldest first.

    Raises:
        ConfigurationError: There are too many.

    """
    places = {number: place for place, number in enumerate(listed)}
    if len(places) > 16 * len(WARNING_WORDS):
        raise ConfigurationError("warnings", len(places), f"at most {16 * len(WARNING_WORDS)}")

    def word(of: int) -> Reader:
        def read(_: int) -> int:
            bits = 0
            for number in active():
                place = places.get(number, -1)
                if place // 16 == of:
                    bits |= 1 << place % 16
            return bits

        return read

    def listed_alarm(sub_index: int) -> int:
        present = list(active())
        return present[sub_index] if sub_index < len(present) else 0

    for of, number in enumerate(WARNING_WORDS):
        store.readers[number] = word(of)
    store.readers[2122] = listed_alarm
    store.readers[2132] = lambda _: listed_alarm(0)


class ParameterMemory:
    """Loading, saving and restarting: PNU 970, 971, 972, 976, 977 (PD-250, PD-251, PD-285).

    Loading and saving are done when the answer is given; the parameter reads 0 again then. 970 and 976: 1
    loads the factory settings, 10 what was saved. 972: 1 restarts at once, 2 only announces it, 3 leaves it
    to the end of communication.

    Args:
        store: The parameters.
        restart: Restarts the drive. The parameters have been loaded before.

    """

    def __init__(self, store: ParameterStore, restart: Callable[[], None] | None = None) -> None:
        self._store = store
        self._restart = restart
        self.reset = 0
        """PNU 972: 2 prepared, 3 waits for the end of communication."""
        self.on_saved: Callable[[], object] = _nothing
        """Called when a parameter has ordered to save: the memory of the device keeps it."""
        store.readers.update(dict.fromkeys((970, 971, 976, 977), lambda _: 0))
        store.readers[972] = lambda _: self.reset
        store.writers.update(dict.fromkeys((970, 976), self._load))
        store.writers.update(dict.fromkeys((971, 977), self._save))
        store.writers[972] = self._take_reset

    def restart(self) -> None:
        """Begin as after power-on: with what was saved."""
        self.reset = 0
        self._store.load()
        if self._restart is not None:
            self._restart()

    def end_of_communication(self) -> bool:
        """Carry out a reset that has waited for it; return whether there was one."""
        waiting = self.reset == _RESTART_LATER
        if waiting:
            self.restart()
        return waiting

    def _load(self, _sub_index: int, value: float) -> None:
        if value == _LOAD_FACTORY:
            self._store.factory_reset()
        elif value == _LOAD_SAVED:
            self._store.load()

    def _save(self, _sub_index: int, value: float) -> None:
        if value:
            self._store.save()
            self.on_saved()

    def _take_reset(self, _sub_index: int, value: float) -> None:
        if value == _RESTART_IMMEDIATELY:
            self.restart()
        else:
            self.reset = int(value)


def _nothing() -> None:
    pass


def _fill(store: ParameterStore, number: int, row: Iterable[int]) -> None:
    """Fill an array from its beginning; the rest is 0."""
    definition = store.definition(number)
    if definition is None:
        return  # a parameter list of the user's may be shorter
    values = tuple(row)[: definition.elements]
    for at in range(definition.elements):
        store.set(number, values[at] if at < len(values) else 0, at)


def _resize(store: ParameterStore, number: int, values: list[int], texts: list[str] | None = None) -> None:
    definition = store.definition(number)
    if definition is not None and values:
        store.define(
            replace(
                definition, size=len(values), defaults=tuple(values), texts=tuple(texts or definition.texts)
            )
        )
