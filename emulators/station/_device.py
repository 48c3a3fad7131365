"""A device that is nothing but its dictionary: communication as CiA 301 says,
plain storage behind the rest.
"""

from __future__ import annotations

import os
from typing import Any

from fieldbus.can.segment import CanSegment
from fieldbus.canopen.eds import shared_dictionary
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History


class CanopenDevice:
    """An I/O station, a gateway, an operator panel: any device whose EDS is there,
    without a behaviour of its own.

    What is written stays written; what a test `set`s is what the bus reads, and event-driven TPDOs that map
    it are sent. Limits, access rights, PDO set and defaults are those of the EDS. It is off until `power_on`.

    Args:
        scheduler: Time of the bench.
        segment: CAN segment.
        eds: EDS or DCF file.
        node_id: 1..127, or 255: it has none and waits for LSS.
        name: Name of the node on the segment and in the history.
        history: Log; None for none.
        storage: File of the stored parameters; None = they last as long as the object.

    Raises:
        ConfigurationError: The file is no EDS, or another argument cannot be used.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        segment: CanSegment,
        eds: str | os.PathLike[str],
        node_id: int,
        *,
        name: str,
        history: History | None = None,
        storage: str | os.PathLike[str] | None = None,
    ) -> None:
        self.name = name
        self.slave = CanopenSlave(
            scheduler,
            segment,
            shared_dictionary(eds),
            node_id,
            name=name,
            history=history,
            storage=storage,
        )

    def power_on(self) -> None:
        """Switch the supply on: stored or default values, boot-up."""
        self.slave.power_on()

    def power_off(self) -> None:
        """Switch the supply off: silence at once."""
        self.slave.power_off()

    def get(self, index: int, sub: int = 0) -> Any:
        """Return the present value of an entry.

        Raises:
            ConfigurationError: The EDS has no such entry.

        """
        self._known(index, sub)
        return self.slave.get(index, sub)

    def set(self, index: int, sub: int, value: Any) -> None:
        """Set a value as the device's own process would, an input for example; access rights and limits do
        not matter.

        Raises:
            ConfigurationError: The EDS has no such entry.

        """
        self._known(index, sub)
        self.slave.set(index, sub, value)

    def stop_heartbeat(self, stopped: bool) -> None:
        """Keep the heartbeat back, or send it again."""
        self.slave.error_control.silent = stopped

    def _known(self, index: int, sub: int) -> None:
        if index << 8 | sub not in self.slave.store.entries:
            raise ConfigurationError(f"{self.name}: entry", f"{index:04X}h:{sub}", "an entry of its EDS")
