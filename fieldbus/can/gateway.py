"""The CAN gateway of the Linux kernel (`can-gw`): rules that pass frames from one interface to another, and
change them.

Spoken to over netlink, so that nothing but the kernel module and the right `CAP_NET_ADMIN` is needed. What a
rule says holds for every frame that passes, at once and without any process; what it cannot say (delays,
repetitions, counts) needs `LiveSegment` with a bridge.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal, Self

from fieldbus.errors import BusError

Operation = Literal["AND", "OR", "XOR", "SET"]

_RTM_NEWROUTE: Final = 24
_RTM_DELROUTE: Final = 25
_RTM_GETROUTE: Final = 26
_NLMSG_ERROR: Final = 2
_NLMSG_DONE: Final = 3
_NLM_F_REQUEST: Final = 1
_NLM_F_ACK: Final = 4
_NLM_F_DUMP: Final = 0x300
_CGW_TYPE_CAN_CAN: Final = 1
_ECHO: Final = 1  # other programs on the machine see what is passed on, as they do on a wire
_CAN_FD: Final = 8
_CGW_CS_XOR: Final = 5
_CGW_HANDLED: Final = 7
_CGW_DROPPED: Final = 8
_CGW_SRC_IF: Final = 9
_CGW_DST_IF: Final = 10
_CGW_FILTER: Final = 11
_CGW_LIM_HOPS: Final = 13
_CGW_MOD_UID: Final = 14
_OPERATIONS: Final[dict[Operation, int]] = {"AND": 1, "OR": 2, "XOR": 3, "SET": 4}
_MOD_ID: Final = 1
_MOD_LENGTH: Final = 2
_MOD_DATA: Final = 4
_CAN_INV_FILTER: Final = 0x2000_0000
_CAN_EFF_FLAG: Final = 0x8000_0000

_HEADER: Final = struct.Struct("=IHHII")
_ROUTE: Final = struct.Struct("=BBH")
_ATTRIBUTE: Final = struct.Struct("=HH")
_FRAME_MOD: Final = struct.Struct("=IB3x8sB")


@dataclass(frozen=True)
class Modification:
    """One operation on the parts of a frame that are given."""

    operation: Operation
    can_id: int | None = None
    extended: bool = False
    """With `can_id`: the bit that makes it a 29-bit identifier is part of the operand."""
    length: int | None = None
    data: bytes | None = None
    """Operand for the data bytes, up to 8; those that are missing count as 0."""

    def packed(self) -> bytes:
        """Return it as the kernel takes it."""
        kind = (
            (self.can_id is not None) * _MOD_ID
            | (self.length is not None) * _MOD_LENGTH
            | (self.data is not None) * _MOD_DATA
        )
        flag = _CAN_EFF_FLAG if self.extended else 0
        data = (self.data or b"").ljust(8, b"\0")
        return _FRAME_MOD.pack((self.can_id or 0) | flag, self.length or 0, data, kind)


@dataclass(frozen=True)
class XorChecksum:
    """A checksum over data bytes that is set right after a modification;
    negative indices count from the end.
    """

    first: int
    last: int
    result: int
    start: int = 0


@dataclass(frozen=True)
class GatewayRule:
    """What is passed on from `source` to `destination`, and how it is changed on the way."""

    source: str
    destination: str
    can_id: int = 0
    mask: int = 0
    """Bits of the identifier that have to agree; 0: every frame."""
    inverted: bool = False
    """Every frame that does not agree."""
    modifications: tuple[Modification, ...] = ()
    """At most one per operation; carried out as AND, OR, XOR, SET, whatever their order."""
    checksum: XorChecksum | None = None
    hops: int = 0
    """How often a frame may have been passed on before, 1 to 255; 0: the kernel's own limit, which is 1."""
    identity: int = 0
    """Number that distinguishes equal rules, 1 to 2^32 - 1; 0: none."""
    fd: bool = False
    """The rule is for frames of CAN FD, which no other rule passes; it passes no classic ones, and changes
    nothing.
    """

    def attributes(self) -> bytes:
        """Return the rule as netlink attributes.

        Raises:
            BusError: An interface does not exist.

        """
        parts = [_attribute(_OPERATIONS[one.operation], one.packed()) for one in self.modifications]
        if self.checksum is not None:
            packed = struct.pack(
                "=bbbB", self.checksum.first, self.checksum.last, self.checksum.result, self.checksum.start
            )
            parts.append(_attribute(_CGW_CS_XOR, packed))
        if self.mask or self.inverted:
            can_id = self.can_id | (_CAN_INV_FILTER if self.inverted else 0)
            parts.append(_attribute(_CGW_FILTER, struct.pack("=II", can_id, self.mask)))
        if self.hops:
            parts.append(_attribute(_CGW_LIM_HOPS, struct.pack("=B", self.hops)))
        if self.identity:
            parts.append(_attribute(_CGW_MOD_UID, struct.pack("=I", self.identity)))
        for kind, interface in ((_CGW_SRC_IF, self.source), (_CGW_DST_IF, self.destination)):
            parts.append(_attribute(kind, struct.pack("=I", _index(interface))))
        return b"".join(parts)


@dataclass(frozen=True)
class RuleCount:
    """What the kernel says of a rule."""

    source: str
    destination: str
    identity: int
    handled: int
    """Frames passed on."""
    dropped: int
    """Frames that had been passed on too often."""


def _attribute(kind: int, content: bytes) -> bytes:
    size = _ATTRIBUTE.size + len(content)
    return _ATTRIBUTE.pack(size, kind) + content + b"\0" * (-size % 4)


def _index(interface: str) -> int:
    try:
        return socket.if_nametoindex(interface)
    except OSError as error:
        raise BusError(f"the gateway of the kernel: there is no interface {interface!r}") from error


class Gateway:
    """A connection to the kernel's gateway. The rules that were added through it go when it is closed.

    Raises:
        BusError: The system has no netlink.

    """

    def __init__(self) -> None:
        try:
            self._socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE)
            self._socket.bind((0, 0))
        except OSError as error:
            raise BusError(f"the gateway of the kernel: {error.strerror or error}") from error
        self._socket.settimeout(5.0)
        self._sequence = 0
        self._rules: list[GatewayRule] = []

    def add(self, rule: GatewayRule) -> None:
        """Add a rule.

        Raises:
            BusError: An interface does not exist, the rule is wrong, or the right
                or the kernel module is missing.

        """
        self.exchange([], [rule])

    def remove(self, rule: GatewayRule) -> None:
        """Remove a rule that was added here; harmless to repeat."""
        self.exchange([rule], [])

    def exchange(self, old: Sequence[GatewayRule], new: Sequence[GatewayRule]) -> None:
        """Take rules away and add others, in one call of the kernel, so that
        next to no frame falls in between.

        Raises:
            BusError: See `add`.

        """
        old = [rule for rule in old if rule in self._rules]
        requests = [(_RTM_DELROUTE, rule) for rule in old] + [(_RTM_NEWROUTE, rule) for rule in new]
        if not requests:
            return
        messages = b""
        for kind, rule in requests:
            self._sequence += 1
            messages += self._message(kind, _NLM_F_REQUEST | _NLM_F_ACK, rule.attributes(), fd=rule.fd)
        self._socket.send(messages)
        for (kind, rule), code in zip(requests, self._acknowledgements(len(requests)), strict=True):
            if kind == _RTM_DELROUTE:
                self._rules.remove(rule)
            elif code:
                raise BusError(f"the gateway of the kernel refuses a rule: {_reason(code)}")
            else:
                self._rules.append(rule)

    def counts(self) -> list[RuleCount]:
        """Return what the kernel counts for all rules that exist, those of other programs included."""
        self._sequence += 1
        self._socket.send(self._message(_RTM_GETROUTE, _NLM_F_REQUEST | _NLM_F_DUMP, b""))
        counts: list[RuleCount] = []
        while True:
            for kind, body in self._answers():
                if kind in (_NLMSG_DONE, _NLMSG_ERROR):
                    return counts
                found = dict(_attributes(body[_ROUTE.size :]))
                if _CGW_SRC_IF in found and _CGW_DST_IF in found:
                    counts.append(
                        RuleCount(
                            socket.if_indextoname(_number(found[_CGW_SRC_IF])),
                            socket.if_indextoname(_number(found[_CGW_DST_IF])),
                            _number(found.get(_CGW_MOD_UID, b"\0")),
                            _number(found.get(_CGW_HANDLED, b"\0")),
                            _number(found.get(_CGW_DROPPED, b"\0")),
                        )
                    )

    def _message(self, kind: int, flags: int, attributes: bytes, *, fd: bool = False) -> bytes:
        body = _ROUTE.pack(socket.AF_CAN, _CGW_TYPE_CAN_CAN, _ECHO | _CAN_FD if fd else _ECHO) + attributes
        return _HEADER.pack(_HEADER.size + len(body), kind, flags, self._sequence, 0) + body

    def _acknowledgements(self, count: int) -> list[int]:
        codes: list[int] = []
        while len(codes) < count:
            codes += [
                -int(struct.unpack_from("=i", body)[0])
                for kind, body in self._answers()
                if kind == _NLMSG_ERROR
            ]
        return codes

    def _answers(self) -> Iterator[tuple[int, bytes]]:
        data = self._socket.recv(1 << 16)
        while len(data) >= _HEADER.size:
            size, kind, *_ = _HEADER.unpack_from(data)
            yield kind, data[_HEADER.size : size]
            data = data[(size + 3) & ~3 :]

    def close(self) -> None:
        """Remove the rules that were added here; harmless to repeat."""
        if self._socket.fileno() < 0:
            return
        try:
            self.exchange(list(self._rules), [])
        except BusError:  # an interface is gone, and its rules with it
            self._rules.clear()
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    while len(data) >= _ATTRIBUTE.size:
        size, kind = _ATTRIBUTE.unpack_from(data)
        if size < _ATTRIBUTE.size:
            return
        yield kind, data[_ATTRIBUTE.size : size]
        data = data[(size + 3) & ~3 :]


def _number(content: bytes) -> int:
    return int.from_bytes(content, "little" if _LITTLE else "big")


_LITTLE: Final = struct.pack("=H", 1) == b"\x01\x00"


def _reason(code: int) -> str:
    if code == errno.EPERM:
        return "the right to configure the network (CAP_NET_ADMIN) is missing"
    if code in (errno.EOPNOTSUPP, errno.EPFNOSUPPORT):
        return "the kernel has not loaded the module can-gw"
    return os.strerror(code)
