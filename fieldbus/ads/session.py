"""An ADS device: requests of a connection in, answers and notifications out. It knows no sockets and no
clock: the caller passes the time.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from struct import Struct
from typing import Final

from fieldbus.ads.codes import AdsError, AdsState, Command, Group, TransMode
from fieldbus.ads.frames import REQUEST, Frame, FrameReader
from fieldbus.ads.symbols import Memory, Symbol

_ADDRESS: Final = Struct("<III")
_TWO: Final = Struct("<II")
_ONE: Final = Struct("<I")
_INFO: Final = Struct("<IBBH16s")
_STATE: Final = Struct("<IHH")
_DEVICE_STATE: Final = Struct("<HH")
_CONTROL: Final = Struct("<HHI")
_NOTIFICATION: Final = Struct("<IIIIII16s")
_READ_WRITE: Final = Struct("<IIII")
_STAMP: Final = Struct("<IIQI")
_EPOCH: Final = 125_911_584_000_000_000
"""2000-01-01 as a file time, 100 ns."""
_WATCHED: Final = (Group.PLC_DATA, Group.DEVICE_DATA, Group.SYMBOL_VERSION)
"""Groups whose values a notification may be about, besides those of handles."""
MOST_HANDLES: Final = 1024
MOST_NOTIFICATIONS: Final = 512
MOST_IN_SUM: Final = 500
"""Requests in one sum command."""
MOST_READ: Final = 1 << 20
"""Bytes that the answers of a sum may have."""


@dataclass(frozen=True)
class Port:
    """What is behind an AMS port.

    Args:
        memory: Its memory with symbols.
        state: Returns its state.
        control: Changes it; returns an error code, 0 for none.
        name: What it calls itself, up to 16 characters.

    """

    memory: Memory
    state: Callable[[], int]
    control: Callable[[int], int]
    name: str


@dataclass
class _Notification:
    frame: Frame
    read: Callable[[], bytes | AdsError]
    mode: int
    cycle_ns: int
    due_ns: int = 0
    last: bytes = b""


class AdsSession:
    """One connection to an ADS device.

    Args:
        net: AMS NetID of the device.
        ports: What it has, by AMS port.
        send: Takes bytes for the peer.

    """

    def __init__(self, net: bytes, ports: Mapping[int, Port], send: Callable[[bytes], object]) -> None:
        self._net = net
        self._ports = ports
        self._send = send
        self._reader = FrameReader()
        self._handles: dict[tuple[int, int], Symbol] = {}
        self._notifications: dict[int, _Notification] = {}
        self._count = 0

    def receive(self, data: bytes) -> None:
        """Take bytes of the peer and answer the requests in them.

        Raises:
            MalformedFrameError: It does not speak AMS/TCP; the connection has no use any more.

        """
        for frame in self._reader.feed(data):
            if frame.flags & 0x1 or not frame.flags & REQUEST:
                continue  # an answer, to what nobody asked here
            self._send(self._answer(frame).pack())

    def _answer(self, frame: Frame) -> Frame:
        if frame.target_net != self._net:
            return frame.answer(b"", AdsError.MACHINE_NOT_FOUND)
        port = self._ports.get(frame.target_port)
        if port is None:
            return frame.answer(b"", AdsError.PORT_NOT_FOUND)
        try:
            return frame.answer(self._result(frame, port))
        except struct.error:
            # Its data are shorter than the command needs.
            return frame.answer(_ONE.pack(AdsError.INVALID_SIZE))

    def _result(self, frame: Frame, port: Port) -> bytes:
        data = frame.data
        match frame.command:
            case Command.READ_DEVICE_INFO:
                return _INFO.pack(0, 3, 1, 0, port.name.encode("ascii", "replace")[:16])
            case Command.READ:
                group, offset, length = _ADDRESS.unpack(data)
                return _with_length(self._read(frame, port, group, offset, length))
            case Command.WRITE:
                group, offset, length = _ADDRESS.unpack_from(data)
                values = data[_ADDRESS.size :]
                if length != len(values):
                    return _ONE.pack(AdsError.INVALID_SIZE)
                return _ONE.pack(self._write(frame, port, group, offset, values))
            case Command.READ_STATE:
                return _STATE.pack(0, port.state(), 0)
            case Command.WRITE_CONTROL:
                state, _, length = _CONTROL.unpack_from(data)
                if length != len(data) - _CONTROL.size:
                    return _ONE.pack(AdsError.INVALID_SIZE)
                return _ONE.pack(port.control(state))
            case Command.ADD_NOTIFICATION:
                return self._add_notification(frame, port)
            case Command.DELETE_NOTIFICATION:
                (handle,) = _ONE.unpack(data)
                return _ONE.pack(self._delete_notification(handle))
            case Command.READ_WRITE:
                group, offset, length, size = _READ_WRITE.unpack_from(data)
                values = data[_READ_WRITE.size :]
                if size != len(values):
                    return _with_length(AdsError.INVALID_SIZE)
                return _with_length(self._read_write(frame, port, (group, offset, length), values))
        return _ONE.pack(AdsError.SERVICE_NOT_SUPPORTED)

    # -- reading and writing --------------------------------------------------------------------------------

    def _read(self, frame: Frame, port: Port, group: int, offset: int, length: int) -> bytes | AdsError:
        memory = port.memory
        match group:
            case Group.PLC_DATA:
                return memory.read(offset, length)
            case Group.SYMBOL_VALUE_BY_HANDLE:
                symbol = self._handles.get((frame.target_port, offset))
                if symbol is None:
                    return AdsError.SYMBOL_NOT_FOUND
                if length > symbol.size:
                    return AdsError.INVALID_SIZE
                return memory.read(symbol.offset, length)
            case Group.SYMBOL_VERSION:
                return b"\1"[:length]
            case Group.SYMBOL_UPLOAD:
                return b"".join(symbol.entry() for symbol in memory.symbols)[:length]
            case Group.SYMBOL_UPLOAD_INFO:
                return _upload_info(memory)[:length]
            case Group.SYMBOL_UPLOAD_INFO_2:
                return (_upload_info(memory) + _types_info(memory) + bytes(8))[:length]
            case Group.DEVICE_DATA:
                state = _DEVICE_STATE.pack(port.state(), 0)
                if offset >= len(state):
                    return AdsError.INVALID_OFFSET
                found = state[offset : offset + length]
                return found if len(found) == length else AdsError.INVALID_SIZE
            case Group.DATA_TYPE_UPLOAD:
                return b"".join(memory.types)[:length]
        return AdsError.INVALID_GROUP

    def _write(self, frame: Frame, port: Port, group: int, offset: int, data: bytes) -> int:
        match group:
            case Group.PLC_DATA:
                return port.memory.write(offset, data)
            case Group.SYMBOL_VALUE_BY_HANDLE:
                symbol = self._handles.get((frame.target_port, offset))
                if symbol is None:
                    return AdsError.SYMBOL_NOT_FOUND
                if len(data) != symbol.size:
                    return AdsError.INVALID_SIZE
                return port.memory.write(symbol.offset, data)
            case Group.SYMBOL_RELEASE_HANDLE:
                (handle,) = _ONE.unpack(data)
                known = self._handles.pop((frame.target_port, handle), None) is not None
                return 0 if known else AdsError.SYMBOL_NOT_FOUND
        return AdsError.INVALID_GROUP

    def _read_write(
        self, frame: Frame, port: Port, address: tuple[int, int, int], data: bytes
    ) -> bytes | AdsError:
        group, offset, length = address  # clients ask for more than there is, up to FFFFFFFFh
        match group:
            case Group.SYMBOL_HANDLE_BY_NAME:
                return self._handle(frame, port, data)
            case Group.SYMBOL_VALUE_BY_NAME:
                symbol = port.memory.find(_name(data))
                if symbol is None:
                    return AdsError.SYMBOL_NOT_FOUND
                return port.memory.read(symbol.offset, min(length, symbol.size))
            case Group.SYMBOL_INFO_BY_NAME:
                symbol = port.memory.find(_name(data))
                if symbol is None:
                    return AdsError.SYMBOL_NOT_FOUND
                return _ADDRESS.pack(Group.PLC_DATA, symbol.offset, symbol.size)[:length]
            case Group.SYMBOL_INFO_BY_NAME_EX:
                symbol = port.memory.find(_name(data))
                return AdsError.SYMBOL_NOT_FOUND if symbol is None else symbol.entry()[:length]
            case Group.DATA_TYPE_INFO_BY_NAME_EX:
                entry = port.memory.find_type(_name(data))
                return AdsError.SYMBOL_NOT_FOUND if entry is None else entry[:length]
            case Group.SUM_READ | Group.SUM_READ_EX | Group.SUM_READ_EX_2:
                return self._sum_read(frame, port, group, (offset, data))
            case Group.SUM_WRITE:
                return self._sum_write(frame, port, offset, data)
            case Group.SUM_READ_WRITE:
                return self._sum_read_write(frame, port, offset, data)
            case Group.SUM_ADD_NOTIFICATION:
                return self._sum_add(frame, port, offset, data)
            case Group.SUM_DELETE_NOTIFICATION:
                return self._sum_delete(offset, data)
        return AdsError.INVALID_GROUP

    def _handle(self, frame: Frame, port: Port, data: bytes) -> bytes | AdsError:
        symbol = port.memory.find(_name(data))
        if symbol is None:
            return AdsError.SYMBOL_NOT_FOUND
        if len(self._handles) >= MOST_HANDLES:
            return AdsError.NO_MORE_HANDLES
        self._count += 1
        self._handles[frame.target_port, self._count] = symbol
        return _ONE.pack(self._count)

    # -- sum commands ---------------------------------------------------------------------------------------

    def _sum_read(self, frame: Frame, port: Port, group: int, asked: tuple[int, bytes]) -> bytes | AdsError:
        """Read several values: their codes, then the values.

        The group says how long each of them is: as asked for, with the length that was read at its code, or
        as long as it was read.
        """
        number, data = asked
        if not 0 < number <= MOST_IN_SUM or len(data) != number * _ADDRESS.size:
            return AdsError.INVALID_SIZE
        codes, values, total = [], [], 0
        for one, offset, length in _ADDRESS.iter_unpack(data):
            total += length
            if total > MOST_READ:
                return AdsError.INVALID_SIZE
            found = self._read(frame, port, one, offset, length)
            code, value = (found, b"") if isinstance(found, AdsError) else (0, found)
            codes.append(_ONE.pack(code) if group == Group.SUM_READ else _TWO.pack(code, len(value)))
            values.append(value if group == Group.SUM_READ_EX_2 else value.ljust(length, b"\0"))
        return b"".join((*codes, *values))

    def _sum_write(self, frame: Frame, port: Port, number: int, data: bytes) -> bytes | AdsError:
        head = number * _ADDRESS.size
        if not 0 < number <= MOST_IN_SUM or len(data) < head:
            return AdsError.INVALID_SIZE
        requests = list(_ADDRESS.iter_unpack(data[:head]))
        if head + sum(length for _, _, length in requests) != len(data):
            return AdsError.INVALID_SIZE
        codes, place = [], head
        for group, offset, length in requests:
            codes.append(_ONE.pack(self._write(frame, port, group, offset, data[place : place + length])))
            place += length
        return b"".join(codes)

    def _sum_read_write(self, frame: Frame, port: Port, number: int, data: bytes) -> bytes | AdsError:
        head = number * _READ_WRITE.size
        if not 0 < number <= MOST_IN_SUM or len(data) < head:
            return AdsError.INVALID_SIZE
        requests = list(_READ_WRITE.iter_unpack(data[:head]))
        if head + sum(size for *_, size in requests) != len(data):
            return AdsError.INVALID_SIZE
        heads, values, place, total = [], [], head, 0
        for group, offset, length, size in requests:
            given = data[place : place + size]
            place += size
            nested = Group.SUM_READ <= group <= Group.SUM_DELETE_NOTIFICATION
            found = (
                AdsError.INVALID_GROUP
                if nested
                else self._read_write(frame, port, (group, offset, length), given)
            )
            if isinstance(found, AdsError):
                heads.append(_TWO.pack(found, 0))
                continue
            total += len(found)
            if total > MOST_READ:
                return AdsError.INVALID_SIZE
            heads.append(_TWO.pack(0, len(found)))
            values.append(found)
        return b"".join((*heads, *values))

    def _sum_add(self, frame: Frame, port: Port, number: int, data: bytes) -> bytes | AdsError:
        if not 0 < number <= MOST_IN_SUM or len(data) != number * _NOTIFICATION.size:
            return AdsError.INVALID_SIZE
        return b"".join(
            self._add_notification(frame._replace(data=data[place : place + _NOTIFICATION.size]), port)
            for place in range(0, len(data), _NOTIFICATION.size)
        )

    def _sum_delete(self, number: int, data: bytes) -> bytes | AdsError:
        if not 0 < number <= MOST_IN_SUM or len(data) != number * _ONE.size:
            return AdsError.INVALID_SIZE
        return b"".join(_ONE.pack(self._delete_notification(handle)) for (handle,) in _ONE.iter_unpack(data))

    # -- notifications --------------------------------------------------------------------------------------

    def _add_notification(self, frame: Frame, port: Port) -> bytes:
        group, offset, length, mode, _, cycle, _ = _NOTIFICATION.unpack(frame.data)
        if mode not in set(TransMode):
            return _TWO.pack(AdsError.MODE_NOT_SUPPORTED, 0)
        if group == Group.SYMBOL_VALUE_BY_HANDLE:
            symbol = self._handles.get((frame.target_port, offset))
            if symbol is None:
                return _TWO.pack(AdsError.SYMBOL_NOT_FOUND, 0)
            if length > symbol.size:
                return _TWO.pack(AdsError.INVALID_SIZE, 0)
            group, offset = Group.PLC_DATA, symbol.offset  # the handle may be released
        elif group not in _WATCHED:
            return _TWO.pack(AdsError.INVALID_GROUP, 0)
        read = partial(self._read, frame, port, group, offset, length)
        value = read()
        if isinstance(value, AdsError):
            return _TWO.pack(value, 0)
        if len(self._notifications) >= MOST_NOTIFICATIONS:
            return _TWO.pack(AdsError.NO_MORE_HANDLES, 0)
        self._count += 1
        self._notifications[self._count] = _Notification(frame, read, mode, cycle * 100)
        return _TWO.pack(0, self._count)

    def _delete_notification(self, handle: int) -> int:
        known = self._notifications.pop(handle, None) is not None
        return 0 if known else AdsError.NOTIFICATION_HANDLE_INVALID

    def sample(self, now_ns: int) -> None:
        """Look at what notifications are about, once per cycle of the controller, and send what is due.

        Args:
            now_ns: Time of the bench, ns.

        """
        for handle, one in self._notifications.items():
            if now_ns < one.due_ns:
                continue
            value = one.read()
            if isinstance(value, AdsError):
                continue
            changed = value != one.last
            if one.mode == TransMode.ON_CHANGE and not changed:
                continue
            one.due_ns = now_ns + one.cycle_ns
            one.last = value
            self._send(_stamped(one.frame, handle, value, now_ns).pack())


def _stamped(request: Frame, handle: int, value: bytes, now_ns: int) -> Frame:
    """Return a notification with one sample."""
    sample = _TWO.pack(handle, len(value)) + value
    size = _STAMP.size - _ONE.size + len(sample)
    data = _STAMP.pack(size, 1, _EPOCH + now_ns // 100, 1) + sample
    return request.answer(data)._replace(command=Command.NOTIFICATION, flags=REQUEST, invoke=0)


def _with_length(result: bytes | AdsError) -> bytes:
    if isinstance(result, AdsError):
        return _TWO.pack(result, 0)
    return _TWO.pack(0, len(result)) + result


def _name(data: bytes) -> str:
    return data.split(b"\0", 1)[0].decode("latin-1")


def _upload_info(memory: Memory) -> bytes:
    return _TWO.pack(len(memory.symbols), sum(len(symbol.entry()) for symbol in memory.symbols))


def _types_info(memory: Memory) -> bytes:
    types = memory.types
    return _TWO.pack(len(types), sum(map(len, types)))


__all__ = ["AdsSession", "AdsState", "Port"]
