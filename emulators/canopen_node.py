"""The CANopen side of an emulated device: its node on a CAN segment, and faults of its services."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from emulators.repetition import Repetition
from fieldbus.can.frame import CanSegment
from fieldbus.canopen.object_table import STRING, ObjectRow
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.clock import Scheduler, seconds_to_ns
from fieldbus.errors import ConfigurationError
from fieldbus.history import History

if TYPE_CHECKING:
    import canopen

_FIRST_OWN_OBJECT = 0x2000
"""Objects below describe communication; the slave knows them."""


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
        self._emcys = Repetition(scheduler)
        self._emcy_code = 0

    # -- objects -----------------------------------------------------------------------------------------

    def require(self, indexes: Iterable[int], device: str, eds: str | os.PathLike[str] | None) -> None:
        """Check that the EDS has the objects without which it is not that of the device.

        Args:
            indexes: Objects.
            device: What it is, for the message.
            eds: The file; None: that of the product.

        Raises:
            ConfigurationError: One is missing.

        """
        for index in indexes:
            if index << 8 not in self.slave.store.entries:
                raise ConfigurationError(
                    "eds", str(eds), f"an EDS of a {device}", problem=f"has no object {index:04X}h"
                )

    def add_missing(self, rows: Iterable[ObjectRow]) -> None:
        """Give objects that the EDS lacks their built-in default, so that the device works with any EDS.

        The bus does not see those objects.
        """
        values, store = self.slave.values, self.slave.store
        for row in rows:
            if row.index < _FIRST_OWN_OBJECT:
                continue
            for sub, item in row.items.items():
                key = row.index << 8 | sub
                if item.volatile:
                    store.volatile.add(key)
                if key not in store.entries:
                    empty = "" if item.data_type == STRING else 0
                    values[key] = empty if item.default is None else item.default

    def set_defaults(self, defaults: Mapping[tuple[int, int], int], device: str) -> None:
        """Make values, by index and sub-index, the defaults of their objects, and load them.

        Raises:
            ConfigurationError: There is no such object.

        """
        values, store = self.slave.values, self.slave.store
        for (index, sub), value in defaults.items():
            key = index << 8 | sub
            entry = store.entries.get(key)
            if entry is not None:
                entry.default = entry.coerce(value)
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
