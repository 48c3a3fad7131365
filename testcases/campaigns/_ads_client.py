"""A plain ADS client in front of a device with four symbols, without sockets."""

from __future__ import annotations

import struct
from typing import Any

from fieldbus.ads import (
    AdsError,
    AdsSession,
    Area,
    Frame,
    FrameReader,
    Group,
    Memory,
    Port,
    Symbol,
    net_id,
    variable,
)

OWN, PEER = net_id("5.1.2.3.1.1"), net_id("10.0.0.1.1.1")
READ, WRITE, STATE, CONTROL, ADD, DELETE, READ_WRITE = 2, 3, 4, 5, 6, 7, 9


class Client:
    """A device with three symbols, and what a client asks of it."""

    def __init__(self) -> None:
        self.speed, self.flag, self.image, self.state = 12.5, True, bytearray(range(8)), 5
        memory = Memory()
        variable(memory, "MAIN.Speed", "LREAL", lambda: self.speed, self._set_speed)
        variable(memory, "MAIN.Flag", "BOOL", lambda: self.flag, comment="read only")
        offset = memory.add(Area(8, lambda: bytes(self.image), self._set_image))
        memory.name(Symbol("MAIN.Image", "IMAGE", offset, 8))
        memory.name(Symbol("MAIN.Image.Word", "UINT", offset + 2, 2))
        self.memory = memory
        self.sent: list[Frame] = []
        self._reader = FrameReader()
        port = Port(memory, lambda: self.state, self._control, "Plc30 App")
        self.session = AdsSession(OWN, {851: port}, self._take)

    def _set_speed(self, value: Any) -> int:
        if value < 0:
            return AdsError.INVALID_DATA
        self.speed = value
        return 0

    def _set_image(self, data: bytes) -> int:
        self.image[:] = data
        return 0

    def _control(self, state: int) -> int:
        self.state = state
        return 0

    def _take(self, data: bytes) -> None:
        self.sent += self._reader.feed(data)

    def ask(self, command: int, data: bytes = b"", *, net: bytes = OWN, port: int = 851) -> tuple[int, bytes]:
        """Return error of the header and data of the answer."""
        self.sent.clear()
        self.session.receive(Frame(net, port, PEER, 30000, command, 4, 0, 77, data).pack())
        (answer,) = self.sent
        assert (answer.target_net, answer.target_port, answer.source_net) == (PEER, 30000, net)
        assert (answer.command, answer.flags, answer.invoke) == (command, 5, 77)
        return answer.error, answer.data

    def read(self, group: int, offset: int, length: int) -> tuple[int, bytes]:
        error, data = self.ask(READ, struct.pack("<III", group, offset, length))
        assert error == 0
        code, size = struct.unpack_from("<II", data)
        assert size == len(data) - 8
        return code, data[8:]

    def write(self, group: int, offset: int, value: bytes) -> int:
        return int.from_bytes(
            self.ask(WRITE, struct.pack("<III", group, offset, len(value)) + value)[1], "little"
        )

    def read_write(self, group: int, offset: int, length: int, value: bytes) -> tuple[int, bytes]:
        data = self.ask(READ_WRITE, struct.pack("<IIII", group, offset, length, len(value)) + value)[1]
        return struct.unpack_from("<I", data)[0], data[8:]

    def handle(self, name: str) -> int:
        code, data = self.read_write(Group.SYMBOL_HANDLE_BY_NAME, 0, 4, name.encode() + b"\0")
        assert code == 0
        return int.from_bytes(data, "little")


def type_entries(table: bytes, number: int) -> list[Any]:
    """Return name, type, size, offset, type number, flags and members of entries of a table of data types."""
    found: list[Any] = []
    for _ in range(number):
        length, _, _, _, size, offset, kind, flags, *texts, dimensions, members = struct.unpack_from(
            "<IIIIIIIIHHHHH", table
        )
        assert (length % 8, dimensions) == (0, 0)
        place, names = 42, []
        for text in texts:
            names.append(table[place : place + text].decode())
            place += text + 1
        inner = type_entries(table[place:length], members)
        found.append((names[0], names[1], size, offset, kind, flags, inner))
        table = table[length:]
    return found
