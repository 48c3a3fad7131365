"""What can be asked of the devices of a bench: objects, parameters, registers, signals."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import HilError
from hil.bench.drive_config import ProfidriveCanTable, ProfidriveModbusTable
from hil.fuzz._device_hands import table_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.bench.bench import Bench

_EXTREMES: Final = (0, 1, 2, 100, 1000, 0x4000, 0x7FFF, 0x8000, 0xFFFF, 0x0400_0000, 0x2000_0000)
"""Values that are tried for a signal, with either sign."""
_PARKS: Final = ("G1_STW", "G2_STW")
_PARK: Final = 1 << 14
"""Parks an encoder, which then shows nothing of its shaft."""


@dataclass(frozen=True)
class Entry:
    """An object, or one of its members."""

    index: int
    sub: int
    readable: bool
    writable: bool
    parameter: bool
    """Whether it can be written, is no communication parameter, and is in no RPDO."""
    start: str
    """Bytes that it has at the begin, hexadecimal; empty for a text or a domain."""


@dataclass(frozen=True)
class Node:
    """A CANopen node."""

    name: str
    led: bool
    """Whether the controller of the bench leads it: the program asks, and changes nothing."""
    number: int
    entries: tuple[Entry, ...]

    @property
    def servo(self) -> bool:
        """Whether it has the state machine of CiA 402."""
        return any(one.index == 0x6040 and one.writable for one in self.entries)


@dataclass(frozen=True)
class Server:
    """A server on a Modbus segment."""

    name: str
    numbers: tuple[int, ...] = ()
    """Its PROFIdrive parameters that the controller reaches."""
    spare: bool = True
    """Its bus has time for requests besides the cyclic ones; a line with the drive of an axis has not."""


@dataclass(frozen=True)
class Led:
    """A PROFIdrive drive without an axis."""

    name: str
    signals: tuple[tuple[str, tuple[int, ...]], ...]
    """Signals of the telegram to the drive, with values that they take."""


@dataclass(frozen=True)
class Devices:
    """What can be asked of the devices of a bench."""

    nodes: tuple[Node, ...] = ()
    servers: tuple[Server, ...] = ()
    led: tuple[Led, ...] = field(default=())

    def __bool__(self) -> bool:
        return bool(self.nodes or self.servers or self.led)

    @classmethod
    def of(cls, bench: Bench) -> Devices:
        """Look at a bench."""
        if bench.kind != "virtual":
            return cls()
        led = tuple(_led(bench))
        return cls(tuple(_nodes(bench)), tuple(_servers(bench)), led)


def _emulated(bench: Bench) -> Iterator[tuple[str, Any]]:
    """Yield the emulated devices with their names."""
    for names, find in (
        (bench.drive_names, bench.drive),
        (bench.encoder_names, bench.encoder),
        (bench.device_names, bench.device),
    ):
        for name in names:
            try:
                yield name, find(name)
            except HilError:
                continue  # a physical one


def _nodes(bench: Bench) -> Iterator[Node]:
    for name, device in _emulated(bench):
        table = table_of(bench, name)
        number = getattr(table, "node_id", None)
        slave = getattr(device, "slave", None) or getattr(getattr(device, "node", None), "slave", None)
        if not number or slave is None or table.segment not in bench.network_names:
            continue
        # A drive without an axis that the program leads by its telegram is among them as well.
        led = number in bench.network(table.segment).nodes
        entries = tuple(
            Entry(
                one.index,
                one.sub,
                one.readable,
                one.writable,
                one.writable and one.index >= 0x2000 and not one.maps_receive,
                one.encode(slave.get(one.index, one.sub)).hex() if one.size else "",
            )
            for one in slave.store.entries.values()
        )
        yield Node(name, led, number, entries)


def _servers(bench: Bench) -> Iterator[Server]:
    for segment in bench.segment_names:
        names = getattr(bench.segment(segment), "server_names", ())
        line = getattr(bench.segment(segment), "kind", "") == "modbus_rtu"
        spare = not (line and any(name in bench.ports.by_name for name in names))
        for name in names:
            numbers: tuple[int, ...] = ()
            if name in bench.drive_names and name in bench.ports.by_name:
                parameters = getattr(bench.drive(name), "parameters", None)
                numbers = () if parameters is None else tuple(parameters.store.numbers())
            yield Server(name, numbers, spare)


def _led(bench: Bench) -> Iterator[Led]:
    axes = {row.drive for row in bench.config.axis.values()}
    for name, table in bench.config.drive.items():
        if name in axes or not isinstance(table, ProfidriveCanTable | ProfidriveModbusTable):
            continue
        try:
            layout = bench.telegram(name).telegram.setpoint
        except HilError:
            continue
        signals = []
        for signal in dict.fromkeys(layout.names):
            values = tuple(
                value
                for one in _EXTREMES
                for value in (one, -one)
                if _fits(layout, signal, value) and not (signal in _PARKS and value & _PARK)
            )
            if signal != "FREE" and values:
                signals.append((signal, tuple(dict.fromkeys(values))))
        yield Led(name, tuple(signals))


def _fits(layout: Any, signal: str, value: int) -> bool:
    try:
        layout.encode({signal: value})
    except HilError:
        return False
    return True
