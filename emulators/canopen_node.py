"""The CANopen side of an emulated device: its node on a CAN segment, and faults of its services."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from emulators.repetition import Repetition
from fieldbus.can.segment import CanSegment
from fieldbus.canopen.dictionary import INTEGERS, Entry
from fieldbus.canopen.eds import notes_of
from fieldbus.canopen.object_table import STRING, VAR, Item, ObjectRow
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.clock import Scheduler, seconds_to_ns
from fieldbus.errors import ConfigurationError
from fieldbus.history import History

if TYPE_CHECKING:
    import canopen

_FIRST_OWN_OBJECT: Final = 0x2000
"""Objects below describe communication; the slave knows them."""
_FIRST_PROFILE_OBJECT: Final = 0x6000


class CanopenNode:
    """A slave with the objects of a device, and faults of its services.

    Args:
        scheduler: Clock of the device.
        segment: CAN segment.
        dictionary: Object dictionary of its EDS.
        node_id: 1..127, or 255: it has none and waits for LSS.
        name: Name of the node on the segment and in the history.
        history: Event log; None for none.
        boot_time_s: From power-on or reset to the boot-up frame, s.
        storage: File in which stored parameters outlive the process; None = they do not.

    Raises:
        ConfigurationError: An argument is out of its range, or `storage` cannot be used.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        dictionary: canopen.ObjectDictionary,
        node_id: int,
        *,
        name: str,
        history: History | None = None,
        boot_time_s: float = 0.0,
        storage: str | os.PathLike[str] | None = None,
    ) -> None:
        self.slave = CanopenSlave(
            scheduler,
            segment,
            dictionary,
            node_id,
            name=name,
            history=history,
            boot_time_ns=seconds_to_ns(boot_time_s),
            storage=storage,
        )
        self.notes: tuple[str, ...] = notes_of(dictionary)
        """What the EDS says otherwise than the standards, and how it was taken."""
        self._emcys = Repetition(scheduler)
        self._emcy_code = 0

    # -- objects -----------------------------------------------------------------------------------------

    def adopt(
        self,
        rows: Sequence[ObjectRow],
        *,
        device: str,
        required: Iterable[int] = (),
        never_zero: Collection[int] = (),
        eds: str | os.PathLike[str] | None = None,
    ) -> None:
        """Bring the objects of the EDS and those of the device together.

        An object of a device profile (6000h and above) is the device's if it is of the same kind: both a
        variable or not, both a whole number or not. It keeps the length that the EDS gives it and has the
        sign of the profile, about which files differ. A manufacturer object is the device's only if it has
        the same name and data type; the numbers below 6000h mean something else in every product.
        Everything else in the EDS is plain storage on the bus. What the EDS lacks has its built-in default,
        so that the device works with any EDS, and the bus does not see it. An object whose default the EDS
        leaves open gets the built-in one.

        Args:
            rows: Objects of the device.
            device: What it is, for messages.
            required: Indexes without which the EDS is not one of such a device.
            never_zero: Indexes whose entries get the built-in default if the EDS sets them to 0.
            eds: The file; None: that of the product.

        Raises:
            ConfigurationError: A required object is missing, or not of the kind that the device needs.

        """
        store = self.slave.store
        values, entries = self.slave.values, store.entries
        notes: list[str] = []
        for row in rows:
            if row.index < _FIRST_OWN_OBJECT:
                continue
            for sub, item in row.items.items():
                key = row.index << 8 | sub
                entry = entries.get(key)
                if entry is not None and eds is not None:
                    if self._agree(entry, row, item, notes):
                        if row.index in never_zero and item.default and not entry.default:
                            entry.default = entry.coerce(item.default)
                            notes.append(f"{row.index:04X}h:{sub}: 0 leaves it open; {item.default} counts")
                        continue
                    store.set_aside(key)
                    entry = None
                if item.volatile:
                    store.volatile.add(key)
                if entry is None:
                    empty = "" if item.data_type == STRING else 0
                    values[key] = empty if item.default is None else item.default
        for index in required:
            key = index << 8
            if key not in entries:
                raise ConfigurationError(
                    "eds", str(eds), f"an EDS of a {device}", problem=f"has no object {index:04X}h"
                )
            if entries[key].key != key:
                raise ConfigurationError(
                    "eds",
                    str(eds),
                    f"an EDS of a {device}",
                    problem=f"has an object {index:04X}h that is no whole number",
                )
        self.notes += tuple(notes)

    def _agree(self, entry: Entry, row: ObjectRow, item: Item, notes: list[str]) -> bool:
        """Return whether an object of the EDS is that of the device, and adapt it if so."""
        where = f"{row.index:04X}h:{entry.sub}"
        if row.index < _FIRST_PROFILE_OBJECT:
            name = row.name if row.kind == VAR else f"{row.name}: {item.name}"
            if entry.name == name and entry.data_type == item.data_type:
                if item.volatile:
                    self.slave.store.volatile.add(entry.key)
                return True
            return False
        thing = self.slave.store.dictionary.indices[row.index]
        if hasattr(thing, "subindices") != (row.kind != VAR):
            if not entry.sub:
                kinds = ("a variable", "an array or record")
                notes.append(
                    f"{row.index:04X}h: {kinds[row.kind == VAR]}, {kinds[row.kind != VAR]} in the profile: "
                    "plain storage"
                )
            return False
        expected = INTEGERS.get(item.data_type)
        if (expected is not None) != entry.integer or (expected is None) != (entry.data_type == STRING):
            notes.append(
                f"{where}: data type {entry.data_type:04X}h, {item.data_type:04X}h in the profile: "
                "plain storage"
            )
            return False
        if expected is not None:
            bits, signed = expected
            if entry.bits != bits:
                notes.append(f"{where}: {entry.bits} bits, {bits} in the profile: taken as in the file")
            if entry.signed != signed:
                entry.signed = signed
                entry.default = entry.coerce(entry.default)
            if not entry.given and item.default:
                entry.default = entry.coerce(item.default)
        if item.volatile:
            self.slave.store.volatile.add(entry.key)
        return True

    def set_defaults(self, defaults: Mapping[tuple[int, int], int], device: str) -> None:
        """Make values, by index and sub-index, the defaults of their objects, and load them.

        Raises:
            ConfigurationError: There is no such object.

        """
        values, store = self.slave.values, self.slave.store
        for (index, sub), value in defaults.items():
            key = index << 8 | sub
            entry = store.entries.get(key)
            if entry is not None and entry.key == key:
                # What is too large even as a bit pattern is held at the end, or it might become 0.
                too_large = entry.integer and value >> entry.bits > 0
                entry.default = entry.saturated(value) if too_large else entry.coerce(value)
                entry.given = True
            elif key in values:
                values[key] = value
            else:
                raise ConfigurationError("objects", f"{index:04X}h:{sub}", f"an object of the {device}")
        store.load(application=True)

    def connect(
        self,
        readers: Mapping[int, Callable[[], Any]],
        checks: Mapping[int, Callable[[Any], object]],
    ) -> None:
        """Register what reads objects and what checks writing them, by `index << 8 | sub-index`.

        Objects that the EDS lacks are left out.
        """
        slave = self.slave
        entries = slave.store.entries
        for key, read in readers.items():
            if key in entries:
                slave.on_read(key >> 8, key & 0xFF, read)
        for key, check in checks.items():
            if key in entries:
                slave.on_write(key >> 8, key & 0xFF, check)

    # -- faults ------------------------------------------------------------------------------------------

    def stop_heartbeat(self, stopped: bool) -> None:
        """Stop sending the heartbeat, or send it again."""
        self.slave.error_control.silent = stopped

    def delay_heartbeat(self, delay_s: float) -> None:
        """Send every heartbeat this much later than its period says, s; 0 = on time again."""
        self.slave.error_control.lateness_ns = seconds_to_ns(delay_s)

    def abort_sdo(self, code: int | None, index: int = 0) -> None:
        """Abort every SDO access (to `index`, 0 = any) with `code`; None = serve it again."""
        self.slave.sdo.refusal = None if code is None else (index, code)

    def suppress_sdo_responses(self, silent: bool) -> None:
        """Leave SDO requests unanswered, or answer again."""
        self.slave.sdo.silent = silent

    def repeat_emcy(self, code: int | None, period_s: float = 0.001) -> None:
        """Send an EMCY every `period_s` without any state change; None = stop, with EMCY 0000h."""
        self._emcys.stop()
        if code is None:
            self.slave.emcy_clear(self._emcy_code)
            return
        self._emcy_code = code

        def send() -> None:
            self.slave.emcy(code, repeat=True)

        self._emcys.start(seconds_to_ns(period_s), send)
