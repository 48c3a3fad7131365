"""The log of a link as frames: requests and responses with time and sender, each with what it takes to read
it alone.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Generic, Literal, NamedTuple, TypeVar

from fieldbus.modbus.codes import BROADCAST
from fieldbus.modbus.decode import request_text, response_text
from fieldbus.modbus.framing import TcpSplitter, tcp_frame, unwrap_rtu
from fieldbus.modbus.serial_line import SerialFrame
from fieldbus.modbus.tcp_link import TcpSegment

T = TypeVar("T")

_HEADER: Final = 7
_REMEMBERED: Final = 64
_NOT_KNOWN: Final = b"\0"
"""Request of an unsolicited response."""
_ENDS: Final = ("closed", "reset", "refused")

Protocol = Literal["modbus_tcp", "modbus_rtu"]


@dataclass(frozen=True, slots=True)
class ModbusFrame:
    """A request or response as it was on the link, or what became of a connection.

    Args:
        protocol: The link.
        data: All bytes: header and PDU over TCP, PDU and CRC on a serial line;
            empty for news of a connection.
        asked: PDU of the request that this is the response to; empty for a request.
        note: News of the connection: `connection opened`, ...; empty for a frame.

    """

    protocol: Protocol
    data: bytes
    asked: bytes = b""
    note: str = ""

    # A frame log is read by those who know CAN frames, too.
    extended = False
    remote = False

    @property
    def can_id(self) -> int:
        """The unit."""
        at = 6 if self.protocol == "modbus_tcp" else 0
        return self.data[at] if len(self.data) > at else 0

    @property
    def dlc(self) -> int:
        """The number of bytes."""
        return len(self.data)

    @property
    def pdu(self) -> bytes:
        """Function code and data; empty for a frame that is broken."""
        if self.protocol == "modbus_tcp":
            return self.data[_HEADER:]
        content = unwrap_rtu(self.data)
        return b"" if content is None else content[1]

    def text(self) -> str:
        """Return the frame in words."""
        if not self.data:
            return self.note
        if self.protocol == "modbus_rtu" and unwrap_rtu(self.data) is None:
            return f"broken frame: {self.data.hex(' ')}"
        unit, pdu = self.can_id, self.pdu
        head = "broadcast" if unit == BROADCAST and self.protocol == "modbus_rtu" else f"unit {unit}"
        if self.protocol == "modbus_tcp":
            head = f"transaction {self.data[0] << 8 | self.data[1]} {head}"
        text = response_text(self.asked, pdu) if self.asked else request_text(pdu)
        return f"{head} {text}"


class LogEntry(NamedTuple):
    """A row of the log."""

    time_ns: int
    """End of the last byte."""
    sender: str
    frame: ModbusFrame
    error: str
    """`dropped`, `changed`, `collision`, `wrong header`, ..., or nothing."""


class ReadList(Generic[T]):
    """A growing list of somebody else that is read once, and where that is agreed removed behind the reader.

    Args:
        entries: The list.

    """

    def __init__(self, entries: list[T]) -> None:
        self._entries = entries
        self._read = 0

    def take(self) -> list[T]:
        """Return what has come since the last call."""
        new = self._entries[self._read :]
        self._read += len(new)
        return new

    @property
    def unread(self) -> int:
        """Number of entries that have not been taken."""
        return len(self._entries) - self._read

    def drop(self, most: int | None = None) -> int:
        """Remove what has been taken from the list, `most` entries at most; returns how many."""
        count = self._read if most is None else min(most, self._read)
        del self._entries[:count]
        self._read -= count
        return count


class SerialLog:
    """Makes frames of the log of a serial line.

    Args:
        source: The growing log of the line.
        master: Who asks on it.

    """

    def __init__(self, source: list[SerialFrame], *, master: str) -> None:
        self.source = ReadList(source)
        self._master = master
        self._asked: tuple[int, bytes] | None = None
        self.entries: list[LogEntry] = []
        """What has been made so far; `update` adds. Who has taken the entries may clear it."""

    def update(self) -> list[LogEntry]:
        """Return all frames up to now."""
        for _, end_ns, sender, data, note in self.source.take():
            content = unwrap_rtu(data)
            asked = b""
            if sender == self._master:
                self._asked = None if content is None or "dropped" in note else content
            elif content is not None:
                fits = self._asked is not None and self._asked[0] == content[0]
                asked = self._asked[1] if self._asked is not None and fits else _NOT_KNOWN
            self.entries.append(LogEntry(end_ns, sender, ModbusFrame("modbus_rtu", data, asked), note))
        return self.entries


class TcpLog:
    """Makes frames of the log of a TCP link.

    Args:
        source: The growing log of the link.
        names: Names of senders that have others in the log.
        client: Who asks, as the source names it.

    """

    def __init__(
        self, source: list[TcpSegment], *, client: str, names: Mapping[str, str] | None = None
    ) -> None:
        self.source = ReadList(source)
        self._client = client
        self._names = dict(names or {})
        self._streams: dict[int, tuple[TcpSplitter, TcpSplitter]] = {}
        self._asked: OrderedDict[tuple[int, int], bytes] = OrderedDict()
        self.entries: list[LogEntry] = []
        """What has been made so far; `update` adds. Who has taken the entries may clear it."""

    def update(self) -> list[LogEntry]:
        """Return all frames up to now."""
        for segment in self.source.take():
            self._take(segment)
        return self.entries

    def _add(self, segment: TcpSegment, frame: ModbusFrame, error: str) -> None:
        sender = self._names.get(segment.sender, segment.sender)
        self.entries.append(LogEntry(segment.time_ns, sender, frame, error))

    def _take(self, segment: TcpSegment) -> None:
        _, connection, sender, data, note = segment
        if not data:
            for splitter in self._streams.pop(connection, ()) if note in _ENDS else ():
                if splitter.pending:
                    self._add(segment, ModbusFrame("modbus_tcp", b"", note="half a frame"), "incomplete")
            self._add(
                segment,
                ModbusFrame("modbus_tcp", b"", note=f"connection {connection} {note}"),
                note if note in ("reset", "refused") else "",
            )
            return
        if note == "dropped":
            for frame in TcpSplitter().feed(data):
                whole = tcp_frame(*frame)
                self._add(segment, ModbusFrame("modbus_tcp", whole, self._request_of(segment, frame)), note)
            return
        streams = self._streams.get(connection)
        if streams is None:
            streams = self._streams[connection] = (TcpSplitter(), TcpSplitter())
        splitter = streams[sender != self._client]
        was_broken = splitter.broken
        for frame in splitter.feed(data):
            whole = tcp_frame(*frame)
            if sender == self._client:
                self._asked[connection, frame.transaction] = frame.pdu
                if len(self._asked) > _REMEMBERED:
                    self._asked.popitem(last=False)
            self._add(segment, ModbusFrame("modbus_tcp", whole, self._request_of(segment, frame)), note)
        if splitter.broken and not was_broken:
            self._add(
                segment,
                ModbusFrame("modbus_tcp", b"", note=f"nothing after {data.hex(' ')} can be read"),
                "wrong header",
            )

    def _request_of(self, segment: TcpSegment, frame: tuple[int, int, bytes]) -> bytes:
        if segment.sender == self._client:
            return b""
        return self._asked.get((segment.connection, frame[0]), _NOT_KNOWN)
