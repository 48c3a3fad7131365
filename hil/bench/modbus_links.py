"""Modbus segments of a bench: networks and lines, virtual and real, with the clients of the controller and
one log.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Final, Protocol

from fieldbus.clock import MS
from fieldbus.modbus import (
    RtuClient,
    SerialLine,
    SerialLog,
    SocketNetwork,
    TcpClient,
    TcpLink,
    TcpLog,
)
from fieldbus.modbus.serial_port import LiveSerialLine
from fieldbus.modbus.taps import TappedConnector
from hil.bench.segment_config import ModbusTable, TcpTable

if TYPE_CHECKING:
    from fieldbus.clock import Scheduler
    from fieldbus.modbus import Change, ConnectionLimits, LinkHook, LogEntry, PtyServer, SerialFormat
    from fieldbus.modbus.tcp_client import Connector
    from motion.drives.profidrive_modbus import ProfidriveModbusPort

CONTROLLER: Final = "controller"
"""Who asks, in logs."""
_SERVER: Final = "server"
_RECONNECT_NS: Final = 50 * MS
_OUTSTANDING: Final = 16


class ModbusDevice(Protocol):
    """An emulated drive or station that answers on Modbus."""

    def listen(self, network: TcpLink | SocketNetwork, *, limits: ConnectionLimits) -> object:
        """Serve a virtual network."""

    def attach(self, line: SerialLine) -> object:
        """Answer on a virtual serial line."""

    def open_terminal(self, form: SerialFormat, /) -> PtyServer:
        """Answer on a pseudo-terminal of this machine."""

    def close(self) -> None:
        """Take the pseudo-terminal away, if there is one."""


@dataclass
class _Channel:
    """The way to a drive, or on a line to all of them."""

    log: TcpLog | SerialLog
    client: TcpClient | RtuClient
    link: TcpLink | SerialLine | LiveSerialLine | None = None
    drives: list[str] = field(default_factory=list)
    pending: list[LogEntry] = field(default_factory=list)
    """Made, not yet in the log of the segment for good."""
    counted: int = 0
    """Transmissions that are in the load already."""


class ModbusSegment:
    """A network or a serial line.

    Over TCP every drive has a connection of its own; on a virtual line all hang on the same wire, with the
    controller as master.

    Args:
        scheduler: Time of the bench.
        name: Name of the segment.
        table: Its table of the bench file.
        cycle_ns: Bus cycle, ns.

    """

    def __init__(self, scheduler: Scheduler, name: str, table: ModbusTable, *, cycle_ns: int) -> None:
        self.scheduler = scheduler
        self.name = name
        self.kind = table.kind
        self.table = table
        self.timeout_ns = table.timeout_ns(cycle_ns)
        """How long the controller waits for a response, ns."""
        self._channels: list[_Channel] = []
        self._line: SerialLine | None = None
        """The virtual line."""
        self._network: SocketNetwork | None = None
        self._merged: list[LogEntry] = []
        self._unsettled = 0
        """Entries at the end of `_merged` whose place may change."""
        self._cycle_ns = cycle_ns
        self._ports: list[ProfidriveModbusPort] = []
        self._recorded = False

    # -- making the ways ------------------------------------------------------------------------------------

    def attach(self, name: str, device: ModbusDevice) -> None:
        """Put an emulated drive on the virtual network or line."""
        if isinstance(self.table, TcpTable):
            link = TcpLink(self.scheduler, self.name, latency_ns=self.table.latency_ns)
            device.listen(link, limits=self.table.limits())
            log = TcpLog(link.log, client=CONTROLLER, names={_SERVER: name})
            client = self._tcp_client(lambda handler: link.connect(CONTROLLER, handler))
            self._channels.append(_Channel(log, client, link, drives=[name]))
            return
        if self._line is None:
            self._line = line = SerialLine(self.scheduler, self.name, self.table.serial_format())
            self._channels.append(
                _Channel(SerialLog(line.log, master=CONTROLLER), self._rtu_client(line), line)
            )
        device.attach(self._line)
        self._channels[0].drives.append(name)

    def connect(self, name: str, host: str, port: int) -> None:
        """Lead a drive at an address of a live network."""
        network = self._network
        if network is None:
            network = self._network = SocketNetwork(self.scheduler)
        tap = TappedConnector(
            self.scheduler,
            lambda handler: network.connect(host, port, handler),
            client=CONTROLLER,
            server=_SERVER,
        )
        log = TcpLog(tap.log, client=CONTROLLER, names={_SERVER: name})
        self._channels.append(_Channel(log, self._tcp_client(tap.connect), drives=[name]))

    def open(self, name: str, path: str, form: SerialFormat) -> None:
        """Lead a drive at a serial line of this machine; drives on the same device file share it.

        Raises:
            BusError: The device file cannot be opened.

        """
        for channel in self._channels:
            if isinstance(channel.link, LiveSerialLine) and channel.link.path == path:
                channel.drives.append(name)
                return
        line = LiveSerialLine(self.scheduler, path, form, other="line")
        log = SerialLog(line.log, master=CONTROLLER)
        self._channels.append(_Channel(log, self._rtu_client(line), line, drives=[name]))

    def _tcp_client(self, connect: Connector) -> TcpClient:
        return TcpClient(
            self.scheduler,
            connect,
            timeout_ns=self.timeout_ns,
            retries=0,
            outstanding=_OUTSTANDING,
            reconnect_ns=_RECONNECT_NS,
        )

    def _rtu_client(self, line: SerialLine | LiveSerialLine) -> RtuClient:
        return RtuClient(self.scheduler, line, name=CONTROLLER, timeout_ns=self.timeout_ns, retries=0)

    @property
    def server_names(self) -> tuple[str, ...]:
        """Names of the drives and stations that answer here."""
        return tuple(name for channel in self._channels for name in channel.drives)

    def client(self, name: str) -> TcpClient | RtuClient:
        """Return who carries the controller's requests to a drive."""
        return next(channel.client for channel in self._channels if name in channel.drives)

    def link(self, name: str | None = None) -> TcpLink | SerialLine | None:
        """Return the virtual link to a drive, or the first one; None on a live segment."""
        for channel in self._channels:
            if name is None or name in channel.drives:
                return channel.link if isinstance(channel.link, (TcpLink, SerialLine)) else None
        return None

    def request_ns(self) -> int:
        """Return how long a request for actual values takes to a drive, ns; 0 on a live segment."""
        if self.link() is None:
            return 0
        if isinstance(self.table, TcpTable):
            return self.table.latency_ns
        line = self.table.serial_format()
        return line.duration_ns(8) + line.t35_ns

    def add_hook(self, hook: LinkHook) -> Callable[[], None]:
        """Ask `hook` (sender, bytes, time) before everything that goes on the virtual links; returns the
        function that ends it.

        Senders are `controller` and the drives by name.
        """
        ends: list[Callable[[], None]] = []
        for channel in self._channels:
            if isinstance(channel.link, TcpLink):
                name = channel.drives[0] if channel.drives else ""
                ends.append(channel.link.add_hook(partial(_ask_by_name, hook, name)))
            elif isinstance(channel.link, SerialLine):
                ends.append(channel.link.add_hook(hook))

        def end() -> None:
            for one in ends:
                one()

        return end

    # -- evidence -------------------------------------------------------------------------------------------

    @property
    def log(self) -> list[LogEntry]:
        """Everything that was on the segment, by time; grows."""
        return self.entries()

    def entries(self) -> list[LogEntry]:
        """Return everything that was on the segment, by time; it is always the same list."""
        for channel in self._channels:
            made = channel.log.update()
            channel.pending += made
            made.clear()
        if len(self._channels) == 1:
            self._merged += self._channels[0].pending
            self._channels[0].pending.clear()
            return self._merged
        # What ends at this moment may still get company of a channel that comes before: it is put in its
        # place anew with the next call.
        del self._merged[len(self._merged) - self._unsettled :]
        now_ns = self.scheduler.now
        added = [entry for channel in self._channels for entry in channel.pending]
        added.sort(key=lambda entry: entry.time_ns)
        self._merged += added
        for channel in self._channels:
            channel.pending = [entry for entry in channel.pending if entry.time_ns >= now_ns]
        self._unsettled = sum(len(channel.pending) for channel in self._channels)
        return self._merged

    def held(self) -> int:
        """Return the number of entries in memory, about; cheaper than `entries`, which makes them."""
        return len(self._merged) + sum(channel.log.source.unread for channel in self._channels)

    def drop_log(self, count: int) -> None:
        """Remove the oldest entries of `entries`, which somebody else keeps or nobody needs."""
        if count > len(self._merged) - self._unsettled:
            for channel in self._channels:
                channel.pending.clear()
            self._unsettled = 0
        del self._merged[:count]
        for channel in self._channels:
            if isinstance(channel.link, SerialLine | LiveSerialLine):
                channel.counted -= channel.log.source.drop(channel.counted)
            else:
                channel.log.source.drop()

    def watch(self, port: ProfidriveModbusPort) -> None:
        """Record the requests of a port; of one that comes when the record has begun nothing is recorded."""
        if not self._recorded:
            self._ports.append(port)

    @property
    def columns(self) -> tuple[tuple[str, str], ...]:
        """Columns of the segment in the trace: load of a line, then of every drive response time, missing
        cycles, exceptions.
        """
        self._recorded = True
        load = () if self.kind == "modbus_tcp" else (("load", "%"),)
        return (
            *load,
            *(
                (f"{port.name}_{column}", unit)
                for port in self._ports
                for column, unit in (("response", "s"), ("missed", ""), ("exceptions", ""))
            ),
        )

    def row(self) -> tuple[float, ...]:
        """Return the present values of `columns`; the load is that since the last row."""
        values = [
            value
            for port in self._ports
            for value in (port.response_ns * 1e-9, float(port.missed), float(port.exceptions))
        ]
        return tuple(values) if self.kind == "modbus_tcp" else (self._load(), *values)

    def _load(self) -> float:
        busy = 0
        for channel in self._channels:
            if not isinstance(channel.link, SerialLine | LiveSerialLine):
                continue
            log = channel.link.log
            for frame in log[channel.counted :]:
                busy += frame.end_ns - frame.start_ns
            channel.counted = len(log)
        return busy * 100.0 / self._cycle_ns

    def close(self) -> None:
        """End connections and lines."""
        for channel in self._channels:
            if isinstance(channel.client, TcpClient):
                channel.client.close()
            if isinstance(channel.link, LiveSerialLine):
                channel.link.close()
        if self._network is not None:
            self._network.close()


def _ask_by_name(hook: LinkHook, name: str, sender: str, data: bytes, time_ns: int) -> Change | None:
    """Ask a hook, which knows the server of a connection by the name of its drive."""
    return hook(name if sender == _SERVER else sender, data, time_ns)
