"""The values of a device: access with rights and limits, hooks, and non-volatile memory.

One dictionary keyed `index << 8 | sub-index` holds the present values. The device reads and writes it
directly; the SDO server and the RPDOs go through the checks here.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final, Protocol

from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import Entry, ObjectValue, Value, entries_of
from fieldbus.canopen.nmt import predefined_identifiers
from fieldbus.errors import HilError

if TYPE_CHECKING:
    import canopen

WriteHook = Callable[[ObjectValue], object]
"""Gets the new value before it is stored; raises `SdoAbort` to refuse it."""
ReadHook = Callable[[], ObjectValue]
"""Returns the present value."""

SAVE: Final = 0x65766173
"""Signature "save" of 1010h (C301-140)."""
LOAD: Final = 0x64616F6C
"""Signature "load" of 1011h (C301-141)."""

_ALL: Final = 1
_COMMUNICATION: Final = 2
_APPLICATION: Final = 3
_ASIDE: Final = 1 << 24
"""Added to the key of an entry that the device has not: above all of index and sub-index."""
NOT_STORED: Final = frozenset((0x1001, 0x1002, 0x1003, 0x1010, 0x1011))
"""Objects that are no configuration."""


class ForeignObjects(Protocol):
    """Objects that the dictionary does not list: they may come and go, as the parameters of a drive do. SDO
    alone reaches them.
    """

    def entry(self, index: int, sub: int) -> Entry | None:
        """Return an entry; None when there is no such object.

        Raises:
            SdoAbort: The object has no such sub-index.

        """

    def read(self, entry: Entry) -> Value:
        """Return the present value.

        Raises:
            SdoAbort: It cannot be read.

        """

    def write(self, entry: Entry, value: Value) -> None:
        """Take a value.

        Raises:
            SdoAbort: It is refused.

        """


class ObjectStore:
    """Values, access rules and memory of one device.

    Args:
        dictionary: Object dictionary of the device.
        node_id: Node-ID for defaults relative to it.

    """

    def __init__(self, dictionary: canopen.ObjectDictionary, node_id: int) -> None:
        self.dictionary = dictionary
        """What the device was made of; its defaults are those of the entries."""
        self.entries: dict[int, Entry] = entries_of(dictionary, node_id)
        self._indices = {entry.index for entry in self.entries.values()}
        self.values: dict[int, ObjectValue] = {}
        """Present values; the object is the same for the life of the device."""
        self.read_hooks: dict[int, ReadHook] = {}
        self.write_hooks: dict[int, WriteHook] = {}
        self.guards: dict[int, WriteHook] = {}
        """Checks of the communication services, before the device's own hooks."""
        self.applied: dict[int, Callable[[], object]] = {}
        """Called after a value has been stored by SDO: the service takes the new configuration over."""
        self.commands: dict[int, WriteHook] = {}
        """Entries whose writing is a command: the value is not stored."""
        self.changed: Callable[[int], object] = _nobody
        """Called with the key of every value stored by SDO or `assign`."""
        self.stored: dict[int, Value] = {}
        """Non-volatile memory: what 1010h has saved; survives power-off, and with `persist` the process."""
        self.volatile: set[int] = set()
        """Keys that 1010h does not save although they are writable, such as setpoints."""
        self.restoring: dict[int, bool] = {}
        """Areas that get their defaults with the next reset -> whether reset communication is enough."""
        self.foreign: ForeignObjects | None = None
        """Objects besides those of the dictionary."""
        self.extra: dict[str, Any] = {}
        """What the device keeps in non-volatile memory besides its objects: by name, as JSON can hold it."""
        self.on_save: Callable[[int], object] = _nobody
        """Called with the group of 1010h before the memory is written; fills `extra`."""
        self.on_restore: Callable[[int], object] = _nobody
        """Called with the area of 1011h when its defaults come back; clears `extra`."""
        self.persist: Callable[[], object] = _nothing
        """Writes the memory to where it lasts; raises `HilError` when it cannot."""
        for sub in range(1, 0x80):
            if 0x101000 | sub in self.entries:
                self.commands[0x101000 | sub] = self._saver(sub)
            if 0x101100 | sub in self.entries:
                self.commands[0x101100 | sub] = self._loader(sub)
        self.load(application=True)

    def predefine(self, node_id: int) -> None:
        """Give COB-IDs without a default of their own, or with 0, that of the
        predefined set; 0 is no identifier.
        """
        base = predefined_identifiers(0)
        identifiers = predefined_identifiers(node_id)
        for key in identifiers.keys() & self.entries.keys():
            entry, cob_id = self.entries[key], identifiers[key]
            if not entry.default:
                entry.default = cob_id
                entry.base = base[key] if base[key] != cob_id else None
        self.load(application=True)

    def renumber(self, old: int, new: int) -> None:
        """Move what is relative to the node-ID from one to another: defaults, and
        values that still are the default.
        """
        for entry in self.entries.values():
            if entry.base is not None and entry.default == entry.base + old:
                if self.values[entry.key] == entry.default:
                    self.values[entry.key] = entry.base + new
                entry.default = entry.base + new

    def set_aside(self, key: int) -> None:
        """Let an entry be plain storage on the bus: what the device itself has under this index is another
        thing, whose value, hooks and checks the bus does not see.

        Args:
            key: `index << 8 | sub-index` of an entry.

        """
        entry = self.entries[key]
        entry.key = key | _ASIDE
        self.values[entry.key] = entry.default
        self.values.pop(key, None)

    # -- access by the bus
    # ------------------------------------------------------------------------------------

    def entry(self, index: int, sub: int) -> Entry:
        """Return an entry.

        Raises:
            SdoAbort: 06020000h no such object, 06090011h no such sub-index.

        """
        entry = self.entries.get(index << 8 | sub)
        if entry is None and self.foreign is not None and index not in self._indices:
            entry = self.foreign.entry(index, sub)
        if entry is None:
            raise SdoAbort(AbortCode.NO_SUB_INDEX if index in self._indices else AbortCode.NO_OBJECT)
        return entry

    def read(self, index: int, sub: int) -> bytes:
        """Return the bytes of an entry for an upload.

        Raises:
            SdoAbort: The entry does not exist, is write-only, or a hook refuses.

        """
        entry = self.entry(index, sub)
        if not entry.readable:
            raise SdoAbort(AbortCode.WRITE_ONLY if entry.writable else AbortCode.ACCESS)
        hook = self.read_hooks.get(entry.key)
        if hook is not None:
            return entry.encode(hook())
        if self.foreign is not None and entry.index not in self._indices:
            return entry.encode(self.foreign.read(entry))
        return entry.encode(self.values[entry.key])

    def check_write(self, index: int, sub: int, size: int | None) -> int:
        """Check a download before its data have come, and return the most bytes that it may bring.

        Args:
            index: Object index.
            sub: Sub-index.
            size: Announced size in bytes; None when not announced.

        Raises:
            SdoAbort: The entry does not exist, is read-only, or the size does not fit.

        """
        entry = self.entry(index, sub)
        if not entry.writable:
            raise SdoAbort(AbortCode.READ_ONLY if entry.readable else AbortCode.ACCESS)
        limit = entry.maximum_length
        if size is not None:
            if size > limit:
                raise SdoAbort(AbortCode.TOO_LONG if limit < 1 << 16 else AbortCode.MEMORY)
            if entry.size and size < limit:
                raise SdoAbort(AbortCode.TOO_SHORT)
        return limit

    def write(
        self, index: int, sub: int, data: bytes, *, expedited: bool = False, sized: bool = True
    ) -> None:
        """Store the bytes of a download.

        Args:
            index: Object index.
            sub: Sub-index.
            data: The bytes.
            expedited: The data came with the request; a wrong length is then 06070010h (C301-074).
            sized: The request said how many bytes count; otherwise those of the entry's type do.

        Raises:
            SdoAbort: The entry does not exist, is read-only, or length, value, a
                service or the device refuses.

        """
        entry = self.entry(index, sub)
        if not entry.writable:
            raise SdoAbort(AbortCode.READ_ONLY if entry.readable else AbortCode.ACCESS)
        if not sized and 0 < entry.size <= len(data):
            data = data[: entry.size]
        self.assign(entry, entry.decode(data, exact=AbortCode.LENGTH if expedited else 0))

    def assign(self, entry: Entry, value: Value) -> None:
        """Write a value with all checks but the access right (C301-076).

        Raises:
            SdoAbort: A limit, a service or the device refuses.

        """
        key = entry.key
        if self.foreign is not None and entry.index not in self._indices:
            self.foreign.write(entry, value)
            return
        if entry.low is not None or entry.high is not None:
            entry.check_limits(value)
        guard = self.guards.get(key)
        if guard is not None:
            guard(value)
        hook = self.write_hooks.get(key)
        if hook is not None:
            hook(value)
        command = self.commands.get(key)
        if command is not None:
            command(value)
            return
        if entry.storable and self.values[key] != value and entry.index not in (0x1020, *NOT_STORED):
            # The configuration is no longer the one whose date the controller has noted (C301-148).
            for stamp in (0x102001, 0x102002):
                if self.values.get(stamp) and key not in self.volatile:
                    self.values[stamp] = 0
        self.values[key] = value
        applied = self.applied.get(key)
        if applied is not None:
            applied()
        self.changed(key)

    # -- memory
    # -----------------------------------------------------------------------------------------------

    def load(self, *, application: bool) -> None:
        """Take stored or default values, as after reset communication or, with `application`, reset node."""
        due = [area for area, soon in self.restoring.items() if application or soon]
        for area in due:
            self.stored = {key: value for key, value in self.stored.items() if not _in_group(key, area)}
            del self.restoring[area]
            self.on_restore(area)
        if due:
            # A file that cannot be written keeps the order to restore: it is carried out again at the next
            # start.
            with suppress(HilError):
                self.persist()
        stored, values = self.stored, self.values
        if application and not stored:
            for entry in self.entries.values():
                values[entry.key] = entry.default
        else:
            for key, entry in self.entries.items():
                if application or entry.index < 0x2000:
                    values[entry.key] = stored.get(key, entry.default)
        for key in self.commands:
            if key >> 8 in (0x1010, 0x1011) and not values[key]:
                values[key] = 1  # saves and restores on command, not by itself

    def _saver(self, group: int) -> WriteHook:
        def save(signature: ObjectValue) -> None:
            if signature != SAVE:
                raise SdoAbort(AbortCode.CANNOT_STORE)
            self.on_save(group)
            stored, restoring = self.stored, self.restoring
            self.stored = dict(stored)
            self.restoring = {area: soon for area, soon in restoring.items() if area not in _areas(group)}
            for key, entry in self.entries.items():
                if (
                    not entry.storable
                    or not _in_group(key, group)
                    or key in self.volatile
                    or entry.index in NOT_STORED
                    or key in self.commands
                ):
                    continue
                if entry.base is not None and self.values[entry.key] == entry.default:
                    self.stored.pop(key, None)  # follows the node-ID, also when LSS changes it
                else:
                    self.stored[key] = self.values[entry.key]
            self._keep(stored, restoring)

        return save

    def _keep(self, stored: dict[int, Value], restoring: dict[int, bool]) -> None:
        """Write the memory; go back to what it was and refuse the command when that fails."""
        try:
            self.persist()
        except HilError:
            self.stored, self.restoring = stored, restoring
            raise SdoAbort(AbortCode.HARDWARE) from None

    def _loader(self, group: int) -> WriteHook:
        def load(signature: ObjectValue) -> None:
            if signature != LOAD:
                raise SdoAbort(AbortCode.CANNOT_STORE)
            stored, restoring = self.stored, self.restoring
            self.restoring = {**restoring, **dict.fromkeys(_areas(group), group == _COMMUNICATION)}
            self._keep(stored, restoring)

        return load


def _areas(group: int) -> tuple[int, ...]:
    return (_COMMUNICATION, _APPLICATION) if group == _ALL else (group,)


def _in_group(key: int, group: int) -> bool:
    """Say whether sub-index `group` of 1010h and 1011h covers the entry; 4 and
    up are the manufacturer's area.
    """
    index = key >> 8
    if group == _COMMUNICATION:
        return index < 0x2000
    if group == _APPLICATION:
        return index >= 0x2000
    return True if group == _ALL else 0x2000 <= index < 0x6000


def _nobody(_key: int) -> None:
    pass


def _nothing() -> None:
    pass
