"""SDO server: expedited, segmented and block transfers (CiA 301; C301-057 to C301-076). Bytes in, bytes out.

The server knows neither CAN nor time: it is given the eight bytes of a request and returns the eight-byte
answers. Its owner gates it by NMT state and calls `expire` when the client has been silent for too long.
"""

from __future__ import annotations

from binascii import crc_hqx
from struct import Struct
from typing import Final, Protocol

from fieldbus.canopen.abort import AbortCode, SdoAbort

_MUX: Final = Struct("<BHB")
_SIZED: Final = Struct("<BHBI")
_END: Final = Struct("<BH5x")

_IDLE: Final = 0
_DOWNLOAD: Final = 1
_UPLOAD: Final = 2
_BLOCK_DOWNLOAD: Final = 3
_BLOCK_DOWNLOAD_END: Final = 4
_BLOCK_UPLOAD_START: Final = 5
_BLOCK_UPLOAD: Final = 6
_BLOCK_UPLOAD_END: Final = 7

Answers = list[bytes]


class ObjectAccess(Protocol):
    """The dictionary as the server sees it; every method may raise `SdoAbort`."""

    def read(self, index: int, sub: int) -> bytes:
        """Return the bytes of an entry."""

    def check_write(self, index: int, sub: int, size: int | None) -> int:
        """Check a download at its initiation; return the most bytes that it may bring."""

    def write(
        self, index: int, sub: int, data: bytes, *, expedited: bool = False, sized: bool = True
    ) -> None:
        """Store the bytes of a download."""


class SdoServer:
    """One server channel; holds at most one transfer.

    Args:
        objects: The dictionary behind it.
        block_size: Segments per block that the server asks for in block downloads, 1..127.

    """

    def __init__(self, objects: ObjectAccess, *, block_size: int = 127) -> None:
        self._objects = objects
        self._block_size = block_size
        self._buffer = bytearray()
        self._crc = False
        self._gap = False
        self._index = 0
        self._limit = 0
        self._offset = 0
        self._sequence = 0
        self._size: int | None = None
        self._state = _IDLE
        self._sub = 0
        self._toggle = 0
        self.aborts = 0
        """Transfers that the server has aborted."""

    @property
    def active(self) -> bool:
        """Whether a transfer is waiting for the client's next frame."""
        return self._state != _IDLE

    def reset(self) -> None:
        """Drop the running transfer silently."""
        self._state = _IDLE
        if self._buffer:
            self._buffer = bytearray()

    def expire(self) -> bytes:
        """End the running transfer because the client has been silent; return the abort frame (C301-072)."""
        return self._abort(AbortCode.TIMEOUT)

    def request(self, data: bytes) -> Answers:
        """Take the eight bytes of a request and return the answers, possibly
        none; never raises on any bytes.
        """
        if len(data) != 8:
            return []
        try:
            if self._state == _BLOCK_DOWNLOAD:
                return self._block_segment(data)
            specifier = data[0] >> 5
            if specifier == 1:
                return self._initiate_download(data)
            if specifier == 2:
                return self._initiate_upload(data)
            if specifier == 0:
                return self._download_segment(data)
            if specifier == 3:
                return self._upload_segment(data)
            if specifier == 4:
                self.reset()
                return []
            if specifier == 5:
                return self._block_upload(data)
            if specifier == 6:
                return self._block_download(data)
            if self._state == _IDLE:
                self._address(data)
            return [self._abort(AbortCode.COMMAND)]
        except SdoAbort as abort:
            return [self._abort(abort.code)]

    def _abort(self, code: int) -> bytes:
        self.reset()
        self.aborts += 1
        return _SIZED.pack(0x80, self._index, self._sub, code)

    def _address(self, data: bytes) -> None:
        """Begin a transfer on the entry that the request names; the one that ran
        ends without a word (C301-073).
        """
        self.reset()
        _, self._index, self._sub = _MUX.unpack_from(data)

    # -- expedited and segmented
    # ------------------------------------------------------------------------------

    def _initiate_download(self, data: bytes) -> Answers:
        self._address(data)
        command = data[0]
        if command & 0x02:
            sized = bool(command & 0x01)
            count = 4 - (command >> 2 & 3) if sized else 4
            self._objects.write(self._index, self._sub, data[4 : 4 + count], expedited=True, sized=sized)
        else:
            self._size = int.from_bytes(data[4:8], "little") if command & 0x01 else None
            self._limit = self._objects.check_write(self._index, self._sub, self._size)
            self._toggle = 0
            self._state = _DOWNLOAD
        return [_SIZED.pack(0x60, self._index, self._sub, 0)]

    def _download_segment(self, data: bytes) -> Answers:
        command = data[0]
        if self._state != _DOWNLOAD:
            raise SdoAbort(AbortCode.COMMAND)
        if command & 0x10 != self._toggle:
            raise SdoAbort(AbortCode.TOGGLE)
        self._collect(data[1 : 8 - (command >> 1 & 7)])
        if command & 0x01:
            self._store()
        self._toggle ^= 0x10
        return [bytes((0x20 | command & 0x10, 0, 0, 0, 0, 0, 0, 0))]

    def _collect(self, part: bytes) -> None:
        self._buffer += part
        limit = self._limit if self._size is None else self._size
        if len(self._buffer) > limit:
            raise SdoAbort(AbortCode.TOO_LONG)

    def _store(self) -> None:
        content = bytes(self._buffer)
        if self._size is not None and len(content) != self._size:
            raise SdoAbort(AbortCode.TOO_SHORT if len(content) < self._size else AbortCode.TOO_LONG)
        self._objects.write(self._index, self._sub, content)
        self.reset()

    def _initiate_upload(self, data: bytes) -> Answers:
        self._address(data)
        return self._upload(self._objects.read(self._index, self._sub))

    def _upload(self, content: bytes) -> Answers:
        size = len(content)
        if 0 < size <= 4:
            head = _MUX.pack(0x43 | (4 - size) << 2, self._index, self._sub)
            return [head + content.ljust(4, b"\0")]
        self._buffer = bytearray(content)
        self._offset = 0
        self._toggle = 0
        self._state = _UPLOAD
        return [_SIZED.pack(0x41, self._index, self._sub, size)]

    def _upload_segment(self, data: bytes) -> Answers:
        if self._state != _UPLOAD:
            raise SdoAbort(AbortCode.COMMAND)
        if data[0] & 0x10 != self._toggle:
            raise SdoAbort(AbortCode.TOGGLE)
        part = self._buffer[self._offset : self._offset + 7]
        self._offset += len(part)
        command = self._toggle | (7 - len(part)) << 1
        self._toggle ^= 0x10
        if self._offset >= len(self._buffer):
            command |= 0x01
            self.reset()
        return [bytes((command,)) + part.ljust(7, b"\0")]

    # -- block download
    # ---------------------------------------------------------------------------------------

    def _block_download(self, data: bytes) -> Answers:
        command = data[0]
        if command & 0x01:
            return self._end_block_download(data)
        self._address(data)
        self._size = int.from_bytes(data[4:8], "little") if command & 0x02 else None
        self._limit = self._objects.check_write(self._index, self._sub, self._size)
        self._crc = bool(command & 0x04)
        self._sequence = 0
        self._gap = False
        self._state = _BLOCK_DOWNLOAD
        # CRC is offered only to a client that wants it: some clients use it as soon as the server offers it.
        return [_SIZED.pack(0xA0 | command & 0x04, self._index, self._sub, self._block_size)]

    def _block_segment(self, data: bytes) -> Answers:
        command = data[0]
        sequence = command & 0x7F
        if sequence == 0:
            if command == 0x80:
                self.reset()  # abort by the client; no segment has number 0
                return []
            raise SdoAbort(AbortCode.SEQUENCE)
        if sequence > self._block_size:
            raise SdoAbort(AbortCode.SEQUENCE)
        last = False
        if sequence == self._sequence + 1 and not self._gap:
            self._sequence = sequence
            self._buffer += data[1:8]
            last = bool(command & 0x80)
            if len(self._buffer) > (self._limit if self._size is None else self._size) + 7:
                raise SdoAbort(AbortCode.TOO_LONG)
        elif sequence > self._sequence:
            self._gap = True  # what follows a lost segment is sent again by the client (C301-070)
        if not last and sequence < self._block_size and not command & 0x80:
            return []
        acknowledged = self._sequence
        self._sequence = 0
        self._gap = False
        if last:
            self._state = _BLOCK_DOWNLOAD_END
        return [bytes((0xA2, acknowledged, self._block_size, 0, 0, 0, 0, 0))]

    def _end_block_download(self, data: bytes) -> Answers:
        if self._state != _BLOCK_DOWNLOAD_END:
            raise SdoAbort(AbortCode.COMMAND)
        unused = data[0] >> 2 & 7
        if unused:
            del self._buffer[-unused:]
        if self._crc and crc_hqx(self._buffer, 0) != int.from_bytes(data[1:3], "little"):
            raise SdoAbort(AbortCode.CRC)
        self._store()
        return [b"\xa1\0\0\0\0\0\0\0"]

    # -- block upload
    # -----------------------------------------------------------------------------------------

    def _block_upload(self, data: bytes) -> Answers:
        service = data[0] & 0x03
        if service == 0:
            return self._initiate_block_upload(data)
        if service == 3 and self._state == _BLOCK_UPLOAD_START:
            return self._send_block()
        if service == 2 and self._state == _BLOCK_UPLOAD:
            return self._acknowledged(data[1], data[2])
        if service == 1 and self._state == _BLOCK_UPLOAD_END:
            self.reset()
            return []
        raise SdoAbort(AbortCode.COMMAND)

    def _initiate_block_upload(self, data: bytes) -> Answers:
        self._address(data)
        if not 1 <= data[4] <= 127:
            raise SdoAbort(AbortCode.BLOCK_SIZE)
        content = self._objects.read(self._index, self._sub)
        if data[5] and len(content) <= data[5]:
            return self._upload(content)  # protocol switch (C301-071)
        self._buffer = bytearray(content)
        self._offset = 0
        self._limit = data[4]
        self._crc = bool(data[0] & 0x04)
        self._state = _BLOCK_UPLOAD_START
        return [_SIZED.pack(0xC2 | data[0] & 0x04, self._index, self._sub, len(content))]

    def _send_block(self) -> Answers:
        buffer = self._buffer
        answers: Answers = []
        offset = self._offset
        for sequence in range(1, self._limit + 1):
            part = bytes(buffer[offset : offset + 7])
            offset += 7
            if offset >= len(buffer):
                answers.append(bytes((0x80 | sequence,)) + part.ljust(7, b"\0"))
                break
            answers.append(bytes((sequence,)) + part)
        self._sequence = len(answers)
        self._state = _BLOCK_UPLOAD
        return answers

    def _acknowledged(self, acknowledged: int, block_size: int) -> Answers:
        if acknowledged > self._sequence:
            raise SdoAbort(AbortCode.SEQUENCE)
        if not 1 <= block_size <= 127:
            raise SdoAbort(AbortCode.BLOCK_SIZE)
        self._limit = block_size
        self._offset += 7 * acknowledged
        size = len(self._buffer)
        if acknowledged and self._offset >= size:
            unused = self._offset - size
            self._state = _BLOCK_UPLOAD_END
            return [_END.pack(0xC1 | unused << 2, crc_hqx(self._buffer, 0) if self._crc else 0)]
        return self._send_block()
