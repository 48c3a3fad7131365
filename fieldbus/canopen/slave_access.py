"""The side of a slave that its device uses: values, callbacks, PDO events, errors."""

from __future__ import annotations

from typing import Any

from fieldbus.canopen.emcy import EmcyProducer
from fieldbus.canopen.pdo_engine import PdoEngine
from fieldbus.canopen.store import ObjectStore, ReadHook, WriteHook
from fieldbus.errors import ConfigurationError


class DeviceAccess:
    """What `CanopenSlave` offers the device that owns it; the parts belong to the slave."""

    __slots__ = ()

    name: str
    values: dict[int, Any]
    pdos: PdoEngine
    errors: EmcyProducer
    _store: ObjectStore

    def get(self, index: int, sub: int = 0) -> Any:
        """Return the present value; KeyError when the dictionary has no such entry."""
        return self.values[index << 8 | sub]

    def set(self, index: int, sub: int, value: Any) -> None:
        """Set a value without access checks; event-driven TPDOs that map it are sent if their payload
        changes.
        """
        key = index << 8 | sub
        values = self.values
        if values.get(key) != value:
            values[key] = value
            self.pdos.touch(key)

    def notify_change(self, index: int, sub: int = 0) -> None:
        """Have event-driven TPDOs with this object looked at, after a direct write to `values`."""
        self.pdos.touch(index << 8 | sub)

    def trigger_tpdos(self) -> None:
        """Have all event-driven TPDOs looked at when the present instant ends; changed payloads are sent."""
        self.pdos.touch_all()

    def trigger_tpdo(self, number: int) -> None:
        """Send event-driven TPDO `number` (1 = 1800h) as on a device event, whatever its payload is."""
        for pdo in self.pdos.transmit:
            if pdo.number == number and pdo.valid and self.pdos.operational:
                pdo.trigger()

    def send_multiplexed(self, number: int, node: int, index: int, sub: int, content: bytes) -> bool:
        """Send up to four bytes to an object of another node with TPDO `number`, which is in DAM (C301-051).

        Args:
            number: 1 = 1800h; its mapping record has FFh objects.
            node: Node-ID of the consumer; 0 = all.
            index: Index of the consumer's object.
            sub: Its sub-index.
            content: Its value, little-endian, at most four bytes.

        Returns:
            Whether it was sent: the PDO is valid, in destination address mode, and the node Operational.

        Raises:
            ConfigurationError: An argument is out of range.

        """
        if not 0 <= node <= 127:
            raise ConfigurationError("node", node, "0..127")
        if not 0 <= index <= 0xFFFF or not 0 <= sub <= 0xFF or len(content) > 4:
            raise ConfigurationError(
                "destination", (index, sub, content), "an object, and at most four bytes"
            )
        return self.pdos.send_multiplexed(number, node, index, sub, content)

    def on_write(self, index: int, sub: int, callback: WriteHook) -> None:
        """Call `callback(value)` before a value written by SDO or PDO is stored.

        A PDO write takes place when it becomes effective. `SdoAbort` from the callback refuses the value: an
        SDO is aborted with its code, a PDO leaves the object as it was. Several callbacks run in order.

        Raises:
            ConfigurationError: The dictionary has no such entry.

        """
        self._chain(self._store.write_hooks, index, sub, callback)
        self.pdos.recompile()

    def on_read(self, index: int, sub: int, callback: ReadHook) -> None:
        """Call `callback() -> value` for SDO reads and when a PDO samples the object.

        `SdoAbort` from the callback aborts an SDO; a PDO sends the last value. One callback per entry.

        Raises:
            ConfigurationError: The dictionary has no such entry.

        """
        self._known(index, sub)
        self._store.read_hooks[index << 8 | sub] = callback
        self.pdos.recompile()

    def emcy(
        self, code: int, register: int | None = None, data: bytes = b"", *, repeat: bool = False
    ) -> bool:
        """Raise an error: 1001h and 1003h take it up, an EMCY is queued (C301-108 to C301-112).

        Args:
            code: EMCY error code, 1..FFFFh.
            register: Bits of 1001h that belong to the error; bit 0 is always added. None = by the code.
            data: Up to five manufacturer-specific bytes.
            repeat: Send again although the error is already present.

        Returns:
            Whether it was new or repeated; a present error is not sent twice.

        """
        return self.errors.raise_error(code, register, data, repeat=repeat)

    def emcy_clear(self, code: int | None = None) -> bool:
        """End the error `code`, or all: EMCY 0000h with what remains of 1001h (C301-109).

        Returns:
            Whether there was anything to end.

        """
        return self.errors.clear(code)

    def _known(self, index: int, sub: int) -> None:
        if index << 8 | sub not in self._store.entries:
            raise ConfigurationError(
                f"{self.name}: callback", f"{index:04X}h:{sub}", "an entry of the dictionary"
            )

    def _chain(self, hooks: dict[int, WriteHook], index: int, sub: int, callback: WriteHook) -> None:
        self._known(index, sub)
        key = index << 8 | sub
        first = hooks.get(key)
        if first is None:
            hooks[key] = callback
            return

        def both(value: Any) -> None:
            first(value)
            callback(value)

        hooks[key] = both
