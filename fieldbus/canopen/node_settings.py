"""What a node is on its bus - node-ID and bit rate - and where it keeps that: LSS
and the file behind the memory.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.can.port import MediumPort
from fieldbus.can.segment import CanPort
from fieldbus.canopen.lss import LssSlave
from fieldbus.canopen.memory import ParameterFile
from fieldbus.canopen.nmt import UNCONFIGURED
from fieldbus.canopen.store import ObjectStore
from fieldbus.clock import Scheduler
from fieldbus.errors import HilError
from fieldbus.history import History

_IDENTITY: Final = (0x101801, 0x101802, 0x101803, 0x101804)


class NodeSettings:
    """Carries out what LSS asks for, and writes the non-volatile memory.

    Args:
        scheduler: Time.
        store: The dictionary; its memory is the one that lasts.
        send: Puts a frame on the bus.
        port: Connection to the segment; its bit rate is changed where it has one of its own.
        node_id: Node-ID that the node comes with, 1..127 or FFh.
        bitrate: Bit rate that it comes with, bit/s; None = that of the segment, whatever it is.
        bitrates: Bit rates that the device supports, bit/s; empty = all of the standard table.
        storage: File of the memory; None = the memory lasts as long as the object.
        on_node_id: Called when a node without node-ID has got one.
        source: Name in the history.
        history: Log; None for none.

    Raises:
        ConfigurationError: The file cannot be used.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        store: ObjectStore,
        send: Callable[[CanFrame], None],
        port: CanPort,
        *,
        node_id: int,
        bitrate: int | None,
        bitrates: Iterable[int],
        storage: str | os.PathLike[str] | None,
        on_node_id: Callable[[], None],
        source: str,
        history: History | None,
    ) -> None:
        self._store = store
        self._port = port
        self._on_node_id = on_node_id
        self._source = source
        self._history = history
        self._delivered_bitrate = bitrate
        self.bitrate = bitrate
        """Bit rate in effect, bit/s; None = that of the segment."""
        self.on_bitrate: list[Callable[[int], object]] = []
        """Called with the bit rate, bit/s, when LSS or the stored settings change it."""
        self.lss = LssSlave(scheduler, send, self, node_id=node_id, bitrates=bitrates)
        self._file = None if storage is None else ParameterFile(storage)
        if self._file is not None:
            self._file.load(store, self.lss)
            store.persist = self._save

    def start(self, *, application: bool) -> int:
        """Put settings in effect, as at reset communication or, with `application`, power-on and reset node.

        Returns:
            The node-ID from now on, 1..127 or FFh.

        """
        lss = self.lss
        if application:
            lss.restart()
            bitrate = lss.stored.bitrate or self._delivered_bitrate
            if bitrate is not None and bitrate != self.bitrate:
                self.lss_bitrate(bitrate)
        else:
            lss.stop()
        lss.active_node_id = lss.pending.node_id
        return lss.active_node_id

    def _save(self) -> None:
        assert self._file is not None
        try:
            self._file.save(self._store, self.lss)
        except HilError as error:
            if self._history is not None:
                self._history.emit(self._source, "storage.failed", reason=str(error))
            raise

    # -- what LSS asks for
    # ------------------------------------------------------------------------------------

    def lss_address(self) -> tuple[int, int, int, int]:
        """Return the identity 1018h; what the dictionary lacks is 0."""
        values = self._store.values
        vendor, product, revision, serial = (int(values.get(key, 0)) for key in _IDENTITY)
        return vendor, product, revision, serial

    def lss_node_id_set(self) -> None:
        """Start as the node that LSS has made of this one."""
        self._on_node_id()

    def lss_mute(self, muted: bool) -> None:
        """Take the controller off the bus, or put it back."""
        self._port.online = not muted

    def lss_bitrate(self, bitrate: int) -> None:
        """Change the bit rate of the controller; a model of it uses `on_bitrate`."""
        self.bitrate = bitrate
        if isinstance(self._port, MediumPort):
            self._port.set_bitrate(bitrate)
        if self._history is not None:
            self._history.emit(self._source, "lss.bitrate", bitrate=bitrate)
        for callback in self.on_bitrate:
            callback(bitrate)

    def lss_store(self) -> None:
        """Write the settings to the file, if there is one."""
        self._store.persist()

    def node_id_changed(self, node_id: int) -> None:
        """Note a node-ID that has come into force."""
        if self._history is not None:
            self._history.emit(
                self._source, "lss.node_id", node_id=None if node_id == UNCONFIGURED else node_id
            )
