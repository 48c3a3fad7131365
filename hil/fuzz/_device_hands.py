"""The hands of a program for devices: they ask over the bus, as a configuration tool does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from fieldbus.canopen.nmt import NmtCommand
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError
from fieldbus.modbus import Request

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from hil.bench.bench import Bench
    from hil.fuzz._program import Do

_TABLES: Final = ("drive", "encoder", "device", "station")
"""Tables of the bench file with devices on a bus."""


def table_of(bench: Bench, name: str) -> Any:
    """Return the table of a device in the bench file.

    Raises:
        ConfigurationError: There is none of this name.

    """
    for kind in _TABLES:
        found = getattr(bench.config, kind).get(name)
        if found is not None:
            return found
    raise ConfigurationError("step device", name, "a drive, encoder, device or station of the bench")


class DeviceHands:
    """Asks the devices of a bench; nothing waits for the answers.

    Args:
        bench: The bench.

    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def do(self, step: Do) -> None:
        """Ask something.

        Raises:
            ConfigurationError: There is no such device, or it cannot be asked this.

        """
        name = step.text("device")
        match step.job:
            case "modbus":
                self._modbus(step, name)
            case "parameter_read" | "parameter_write":
                self._parameter(step, name)
            case "signal":
                self._bench.telegram(name).send(**{step.text("name"): int(step.value("value"))})
            case _:
                self._canopen(step, *self._node(name))

    def _node(self, name: str) -> tuple[CanopenMaster, int]:
        table = table_of(self._bench, name)
        number = getattr(table, "node_id", None)
        if not number or table.segment not in self._bench.network_names:
            raise ConfigurationError("step device", name, "a node on a CAN segment")
        return self._bench.network(table.segment), number

    def _canopen(self, step: Do, master: CanopenMaster, node: int) -> None:
        def whole(name: str) -> int:
            return int(step.value(name))

        match step.job:
            case "sdo_read":
                master.sdo(node).upload(whole("index"), whole("sub"), block=bool(step.value("block")))
            case "sdo_write":
                master.sdo(node).download(whole("index"), whole("sub"), bytes.fromhex(step.text("data")))
            case "sdo_frame":
                master.send(0x600 + node, bytes.fromhex(step.text("data"))[:8])
            case "nmt":
                master.nmt(NmtCommand[step.text("command")], node)
            case "sync":
                period_ns = round(step.value("period_ms") * MS)
                if period_ns:
                    master.start_sync(period_ns)
                else:
                    master.stop_sync()
            case _:
                data = str(step.parameters.get("data", ""))
                master.send(whole("can_id"), bytes.fromhex(data)[:8])

    def _modbus(self, step: Do, name: str) -> None:
        table = table_of(self._bench, name)
        segment: Any = self._bench.segment(table.segment)
        if name not in getattr(segment, "server_names", ()):
            raise ConfigurationError("step device", name, "a server on a Modbus segment")
        values = tuple(int(text) for text in str(step.parameters.get("values", "")).split())
        request = Request(
            int(step.value("function")), int(step.value("address")), int(step.value("quantity")), values
        )
        segment.client(name).submit(request, max(table.unit, 1))

    def _parameter(self, step: Do, name: str) -> None:
        port: Any = self._bench.ports.by_name.get(name)
        method = getattr(port, "read_parameter" if step.job == "parameter_read" else "write_parameter", None)
        if method is None:
            raise ConfigurationError("step device", name, "a drive whose parameters its controller reaches")
        number, element = int(step.value("number")), int(step.value("element"))
        if step.job == "parameter_read":
            method(number, element, _ignore)
        else:
            method(number, element, int(step.value("code")), step.value("value"))


def _ignore(_value: float | None, _reason: str) -> None:
    """Take an answer that nobody waits for."""
