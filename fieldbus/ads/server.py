"""An ADS device on TCP: connections of this machine, each with a session of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from fieldbus.ads.frames import MalformedFrameError
from fieldbus.ads.session import AdsSession, Port

if TYPE_CHECKING:
    from fieldbus.modbus.sockets import SocketEnd, SocketNetwork

MOST_CONNECTIONS: Final = 32
"""Clients at a time; one more is turned away."""


class AdsServer:
    """Takes connections and hands what comes to sessions; everything happens on the scheduler of the network.

    Args:
        network: Sockets.
        net: AMS NetID of the device.
        ports: What it has, by AMS port.

    """

    def __init__(self, network: SocketNetwork, net: bytes, ports: Mapping[int, Port]) -> None:
        self._net = net
        self._ports = ports
        self._clients: dict[_Client, None] = {}
        self.malformed = 0
        """Connections that were ended because their bytes were no AMS/TCP."""
        network.listen(self._accept)

    @property
    def connections(self) -> int:
        """Clients that are connected."""
        return len(self._clients)

    def sample(self, now_ns: int) -> None:
        """Send the notifications that are due; once per cycle of the controller.

        Args:
            now_ns: Time of the bench, ns.

        """
        for client in list(self._clients):
            client.session.sample(now_ns)

    def _accept(self, end: SocketEnd) -> _Client | None:
        if len(self._clients) >= MOST_CONNECTIONS:
            return None
        client = _Client(self, end, AdsSession(self._net, self._ports, end.send))
        self._clients[client] = None
        return client

    def forget(self, client: _Client) -> None:
        """Take a client away."""
        self._clients.pop(client, None)


class _Client:
    """One connection, as the sockets call it."""

    def __init__(self, server: AdsServer, end: SocketEnd, session: AdsSession) -> None:
        self._server = server
        self._end = end
        self.session = session

    def opened(self) -> None:
        """Take note of the connection."""

    def receive(self, data: bytes) -> None:
        """Answer what comes; who does not speak AMS/TCP loses the connection."""
        try:
            self.session.receive(data)
        except MalformedFrameError:
            self._server.malformed += 1
            self._server.forget(self)
            self._end.close()

    def closed(self, reason: str) -> None:  # noqa: ARG002 - interface of the sockets
        """Take note of the end."""
        self._server.forget(self)
