"""Multiplex PDOs: single objects by address, in either direction (CiA 301; C301-051, C301-128).

A mapping record with FFh objects makes a PDO carry one object to a destination (DAM: node, index, sub-index
of the consumer); with FEh one object of a source (SAM: node, index, sub-index of the producer). What a SAM
producer sends is listed in 1FA0h to 1FCFh, what a SAM consumer does with it in 1FD0h to 1FFFh.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from struct import Struct
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.abort import SdoAbort
from fieldbus.canopen.dictionary import Entry
from fieldbus.canopen.pdo import TransmitPdo
from fieldbus.canopen.store import ObjectStore

SOURCE: Final = 0xFE
"""Number of mapped objects that stands for source address mode."""
DESTINATION: Final = 0xFF
"""Number of mapped objects that stands for destination address mode."""
MULTIPLEXED: Final = (SOURCE, DESTINATION)

EMCY_NO_DESTINATION: Final = 0x8230

_FRAME: Final = Struct("<BHB4s")
_SCANNER: Final = (0x1FA0, 0x1FCF)
_DISPATCHER: Final = (0x1FD0, 0x1FFF)
_TO_DESTINATION: Final = 0x80
_EVERYBODY: Final = 0


class Multiplexer:
    """Takes and makes the frames of multiplex PDOs.

    Args:
        store: The dictionary behind them.
        send: Puts a frame on the bus.
        emcy: Raises an error by code.
        emcy_clear: Ends an error by code.

    """

    def __init__(
        self,
        store: ObjectStore,
        send: Callable[[CanFrame], None],
        *,
        emcy: Callable[[int], object],
        emcy_clear: Callable[[int], object],
    ) -> None:
        self._store = store
        self._send = send
        self._emcy = emcy
        self._emcy_clear = emcy_clear
        self._unavailable = False
        self.node_id = 0
        """Node-ID of the node, 1..127."""

    def reset(self) -> None:
        """Forget that a destination was missing."""
        self._unavailable = False

    # -- consumer
    # ---------------------------------------------------------------------------------------------

    def receive(self, kind: int, data: bytes) -> None:
        """Take the eight bytes of a multiplex PDO whose record says `kind`, SOURCE or DESTINATION."""
        head, index, sub, content = _FRAME.unpack(data)
        node = head & 0x7F
        if kind == DESTINATION:
            if head & _TO_DESTINATION and node in (_EVERYBODY, self.node_id):
                self._deliver(index, sub, content)
        elif not head & _TO_DESTINATION and node:
            place = self._destination(node, index, sub)
            if place is not None:
                self._deliver(*place, content)

    def _deliver(self, index: int, sub: int, content: bytes) -> None:
        """Store one object; one that cannot be there is reported once until a
        frame has found its own (C301-128).
        """
        store = self._store
        entry = store.entries.get(index << 8 | sub)
        if entry is None or not entry.maps_receive or not 0 < entry.size <= len(content):
            if not self._unavailable:
                self._unavailable = True
                self._emcy(EMCY_NO_DESTINATION)
            return
        if self._unavailable:
            self._unavailable = False
            self._emcy_clear(EMCY_NO_DESTINATION)
        try:
            store.assign(entry, entry.decode(content[: entry.size]))
        except SdoAbort:
            return  # as with any PDO: the object stays as it was

    def _destination(self, node: int, index: int, sub: int) -> tuple[int, int] | None:
        """Return where the dispatcher list wants an object of another node."""
        for _, raw in self._list(_DISPATCHER):
            if raw & 0xFF != node or raw >> 16 & 0xFFFF != index:
                continue
            offset = sub - (raw >> 8 & 0xFF)
            if 0 <= offset < max(1, raw >> 56):
                return raw >> 40 & 0xFFFF, (raw >> 32 & 0xFF) + offset
        return None

    # -- producer
    # ---------------------------------------------------------------------------------------------

    def scanned(self) -> list[Entry]:
        """Return the entries that the scanner list names, as far as a PDO may carry them."""
        entries: list[Entry] = []
        for _, raw in self._list(_SCANNER):
            index, first = raw >> 8 & 0xFFFF, raw & 0xFF
            for sub in range(first, min(first + max(1, raw >> 24), 0x100)):
                entry = self._store.entries.get(index << 8 | sub)
                if entry is not None and entry.maps_transmit and 0 < entry.size <= 4:
                    entries.append(entry)
        return entries

    def send_source(self, pdo: TransmitPdo, entry: Entry, content: bytes) -> None:
        """Send an object of this node in source address mode."""
        self._transmit(pdo, self.node_id, entry.index, entry.sub, content)

    def send_destination(self, pdo: TransmitPdo, node: int, index: int, sub: int, content: bytes) -> None:
        """Send up to four bytes to an object of another node, or of all (0)."""
        self._transmit(pdo, _TO_DESTINATION | node, index, sub, content)

    def _transmit(self, pdo: TransmitPdo, head: int, index: int, sub: int, content: bytes) -> None:
        data = _FRAME.pack(head, index, sub, content)  # shorter content is filled with zeros
        self._send(CanFrame(pdo.can_id, data, extended=pdo.extended))

    def _list(self, indices: tuple[int, int]) -> list[tuple[int, int]]:
        """Return the entries of a list that are in use, with their keys."""
        first, last = indices
        values = self._store.values
        return [
            (key, int(values[key]))
            for key in self._store.entries
            if first <= key >> 8 <= last and key & 0xFF and values[key]
        ]


class ScannedObject:
    """One object of a SAM producer: sent when it changes, like an event-driven PDO of its own."""

    def __init__(self, multiplexer: Multiplexer, store: ObjectStore, pdo: TransmitPdo, entry: Entry) -> None:
        self._multiplexer = multiplexer
        self._store = store
        self._pdo = pdo
        self._entry = entry
        self.dirty = False
        self.last = self._content()

    @property
    def key(self) -> int:
        """Key of the object."""
        return self._entry.key

    def _content(self) -> bytes:
        hook = self._store.read_hooks.get(self._entry.key)
        value = self._store.values[self._entry.key]
        if hook is not None:
            with suppress(SdoAbort):
                value = hook()
        return self._entry.encode(value)

    def look(self) -> None:
        """Send if the object has changed."""
        self.dirty = False
        content = self._content()
        if content != self.last:
            self.last = content
            self._multiplexer.send_source(self._pdo, self._entry, content)
