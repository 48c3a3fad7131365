"""A log of real connections, as virtual links keep one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldbus.modbus.tcp_link import Connection, TcpHandler, TcpSegment

if TYPE_CHECKING:
    from fieldbus.clock import Scheduler
    from fieldbus.modbus.tcp_client import Connector


class TappedConnector:
    """Makes connections and writes down what passes.

    Args:
        scheduler: Time.
        connect: Makes the connections.
        client: Name of this side in the log.
        server: Name of the other side.

    """

    def __init__(
        self, scheduler: Scheduler, connect: Connector, *, client: str = "client", server: str = "server"
    ) -> None:
        self._scheduler = scheduler
        self._connect = connect
        self._client = client
        self._server = server
        self._connections = 0
        self.log: list[TcpSegment] = []
        """As `TcpLink.log`."""

    def connect(self, handler: TcpHandler) -> Connection:
        """Begin a connection for a handler."""
        self._connections += 1
        tap = _Tap(self, handler, self._connections)
        tap.connection = self._connect(tap)
        return tap

    def note(self, connection: int, data: bytes, note: str = "", *, ours: bool) -> None:
        """Write something down."""
        sender = self._client if ours else self._server
        self.log.append(TcpSegment(self._scheduler.now, connection, sender, data, note))


class _Tap:
    """Both sides of one connection."""

    def __init__(self, tapped: TappedConnector, handler: TcpHandler, number: int) -> None:
        self._tapped = tapped
        self._handler = handler
        self._number = number
        self.connection: Connection | None = None

    def send(self, data: bytes) -> None:
        self._tapped.note(self._number, data, ours=True)
        if self.connection is not None:
            self.connection.send(data)

    def close(self) -> None:
        self._tapped.note(self._number, b"", "closed", ours=True)
        if self.connection is not None:
            self.connection.close()

    def opened(self) -> None:
        self._tapped.note(self._number, b"", "opened", ours=True)
        self._handler.opened()

    def receive(self, data: bytes) -> None:
        self._tapped.note(self._number, data, ours=False)
        self._handler.receive(data)

    def closed(self, reason: str) -> None:
        self._tapped.note(self._number, b"", "reset" if reason == "reset" else "closed", ours=False)
        self._handler.closed(reason)
