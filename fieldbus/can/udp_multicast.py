"""CAN frames in UDP multicast, packed like those of python-can's interface `udp_multicast`, on this machine
only unless `join` says otherwise, and without own frames.

python-can joins the group on the interface of the default route, binds to every address, and gives own
frames back. Here the group is joined on the loopback, what other machines send is ignored, and own frames are
known by the port that they come from, so that an equal frame of somebody else is never taken for one of them.
"""

from __future__ import annotations

import ipaddress
import select
import socket
import struct
import time
from typing import Final

import can
from can.interfaces.udp_multicast.utils import is_msgpack_installed, pack_message, unpack_message

DEFAULT_PORT: Final = 43113
"""Port that python-can takes too."""

_LARGEST: Final = 4096
_INDEX: Final = struct.Struct("@I")


class UdpMulticastBus(can.BusABC):
    """A segment in UDP multicast.

    Args:
        channel: Address of the group, IPv4 or IPv6, such as "239.74.163.2".
        port: UDP port of the group, 1..65535.
        hop_limit: How many routers a frame may pass, 0..255.
        join: Network interface on which the group is joined and frames are sent, "eth0" for example. Empty:
            the loopback (IPv6: hop limit 0), and frames of other machines are ignored.

    Raises:
        can.CanInitializationError: The group or the interface does not exist, or a socket cannot be opened.

    """

    def __init__(
        self,
        channel: str,
        *,
        port: int = DEFAULT_PORT,
        hop_limit: int = 1,
        join: str = "",
        **options: object,
    ) -> None:
        is_msgpack_installed()
        if options:
            raise can.CanInitializationError(
                f"option {next(iter(options))!r} is not known; allowed: port, hop_limit, join"
            )
        if isinstance(port, bool) or not isinstance(port, int) or not 1 <= port <= 65535:
            raise can.CanInitializationError(f"port {port!r} is not allowed; allowed: 1..65535")
        if isinstance(hop_limit, bool) or not isinstance(hop_limit, int) or not 0 <= hop_limit <= 255:
            raise can.CanInitializationError(f"hop_limit {hop_limit!r} is not allowed; allowed: 0..255")
        group = _group(channel)
        self.local = not join
        """Whether frames of other machines are ignored."""
        if self.local and group.version == 6:  # Linux has no multicast route on the loopback
            name, number, hop_limit = "this machine only", 0, 0
        else:
            name, number = _network(join)
        self._family = socket.AF_INET if group.version == 4 else socket.AF_INET6
        self._places: dict[str, bool] = {}
        self._destination = (str(group), port) if group.version == 4 else (str(group), port, 0, number)
        self._receiving = socket.socket(self._family, socket.SOCK_DGRAM)
        self._sending = socket.socket(self._family, socket.SOCK_DGRAM)
        try:
            self._prepare(group.packed, number, hop_limit)
        except OSError as error:
            self._close()
            raise can.CanInitializationError(f"{name}, port {port}: {error.strerror or error}") from error
        super().__init__(channel)
        self.channel_info = f"udp_multicast {channel}, port {port}, {name}"

    def _prepare(self, group: bytes, number: int, hop_limit: int) -> None:
        receiving, sending = self._receiving, self._sending
        receiving.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if hasattr(socket, "SO_REUSEPORT"):  # python-can sets it, and all have to
            receiving.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        receiving.bind(self._destination)  # the group, not every address: nothing but multicast comes in
        if self._family == socket.AF_INET:
            membership = group + struct.pack("@II", 0, number)
            receiving.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, struct.pack("@III", 0, 0, number))
            sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, _INDEX.pack(hop_limit))
        else:
            receiving.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, group + _INDEX.pack(number))
            sending.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_IF, _INDEX.pack(number))
            sending.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_HOPS, _INDEX.pack(hop_limit))
        sending.bind(("", 0))
        self._own_port = int(sending.getsockname()[1])

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002 - signature of python-can
        """Send a frame to everybody in the group.

        Raises:
            can.CanOperationError: The network refuses.

        """
        try:
            self._sending.sendto(pack_message(msg), self._destination)
        except OSError as error:
            raise can.CanOperationError(f"failed to send: {error.strerror or error}") from error

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            ready, _, _ = select.select([self._receiving], [], [], timeout)
            if not ready:
                return None, False
            data, sender = self._receiving.recvfrom(_LARGEST)
        except (OSError, ValueError) as error:  # a ValueError when it has been closed meanwhile
            raise can.CanOperationError(f"failed to receive: {error}") from error
        here = (self.local or sender[1] == self._own_port) and self._is_here(sender[0])
        if sender[1] == self._own_port if here else self.local:
            return None, False
        try:
            message = unpack_message(data, replace={"timestamp": time.time()}, check=True)
        except Exception as error:
            raise can.CanOperationError("what came is no message of python-can") from error
        return message, False

    def _is_here(self, address: str) -> bool:
        """Return whether an address is one of this machine: only then can a socket have it."""
        known = self._places.get(address)
        if known is None:
            with socket.socket(self._family, socket.SOCK_DGRAM) as probe:
                try:
                    probe.bind((address, 0))
                    known = True
                except OSError:
                    known = False
            if len(self._places) < 1000:
                self._places[address] = known
        return known

    def fileno(self) -> int:
        """Return the socket on which frames come."""
        return self._receiving.fileno()

    def shutdown(self) -> None:
        """Leave the group."""
        super().shutdown()
        self._close()

    def _close(self) -> None:
        self._receiving.close()
        self._sending.close()


def _group(channel: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    try:
        group = ipaddress.ip_address(channel)
    except ValueError:
        group = None
    if group is None or not group.is_multicast:
        raise can.CanInitializationError(
            f"{channel!r} is no multicast group; allowed: 224.0.0.0 to 239.255.255.255, or ff00::/8"
        )
    return group


def _network(join: str) -> tuple[str, int]:
    """Return name and number of a network interface; of the loopback for an empty name."""
    names = {name: number for number, name in socket.if_nameindex()}
    if not join:
        join = next((name for name in names if name.startswith("lo")), "lo")
    number = names.get(join)
    if number is None:
        raise can.CanInitializationError(
            f"join {join!r}: there is no such network interface; there are {', '.join(names)}"
        )
    return join, number
