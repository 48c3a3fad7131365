"""SDO client transfers: expedited, segmented and block (CiA 301; C301-057 to C301-073). Bytes in, bytes out.

A transfer knows neither CAN nor time: `start` returns its first requests, `receive` takes the eight bytes of
an answer and returns the next ones. Its owner keeps the time-out and calls `expire`. Answers that do not
belong to it - another object's, late ones of an earlier transfer - are ignored and counted, because the
identifier of a server is common to everything that it says.
"""

from __future__ import annotations

from binascii import crc_hqx
from struct import Struct
from typing import Final

from typing_extensions import override

from fieldbus.canopen.abort import AbortCode
from fieldbus.errors import ConfigurationError

_END: Final = Struct("<BH5x")

_INITIATE: Final = 0
_SEGMENTS: Final = 1
_BLOCK_INITIATE: Final = 2
_BLOCK: Final = 3
_BLOCK_END: Final = 4
_OVER: Final = 5

LONGEST_UPLOAD: Final = 1 << 24
"""Bytes after which an upload is broken off: a server that never ends must not fill the memory."""

Requests = list[bytes]


class SdoTransfer:
    """Base of both directions.

    Args:
        index: Object index, 0..FFFFh.
        sub: Sub-index, 0..255.
        block: Use the block protocol. A server that does not know it (05040001h) is asked again without.
        block_size: Segments per block that an upload asks for, 1..127.

    Raises:
        ConfigurationError: A number is out of range.

    """

    def __init__(self, index: int, sub: int, *, block: bool = False, block_size: int = 127) -> None:
        if not 0 <= index <= 0xFFFF:
            raise ConfigurationError("SDO index", f"{index:X}h", "0..FFFFh")
        if not 0 <= sub <= 0xFF:
            raise ConfigurationError(f"SDO sub-index of {index:04X}h", sub, "0..255")
        if not 1 <= block_size <= 127:
            raise ConfigurationError("SDO block size", block_size, "1..127")
        self.index = index
        self.sub = sub
        self.block = block
        """Whether the block protocol is used; becomes False when the server does not know it."""
        self.done = False
        """Whether the transfer has ended, well or not."""
        self.abort_code = 0
        """Why it failed; 0 = it did not."""
        self.strays = 0
        """Answers that did not belong to the transfer."""
        self._mux = bytes((index & 0xFF, index >> 8, sub))
        self._block_size = block_size
        self._buffer = bytearray()
        self._crc = False
        self._offset = 0
        self._sequence = 0
        self._size: int | None = None
        self._state = _OVER
        self._toggle = 0

    def start(self) -> Requests:
        """Return the first requests; also begins again after `expire`."""
        raise NotImplementedError

    def _step(self, data: bytes) -> Requests:
        raise NotImplementedError

    def receive(self, data: bytes) -> Requests:
        """Take the eight bytes of an answer and return the next requests, possibly none; never raises."""
        if self.done or len(data) != 8:
            self.strays += 1
            return []
        if data[0] == 0x80 and self._state != _BLOCK:
            return self._aborted(data)
        return self._step(data)

    def expire(self) -> bytes:
        """End the transfer because the server is silent; return the abort frame (C301-072)."""
        return self._break_off(AbortCode.TIMEOUT)[0]

    def cancel(self) -> bytes:
        """End the transfer because it is not needed any more; return the abort frame."""
        return self._break_off(AbortCode.GENERAL)[0]

    def _break_off(self, code: int) -> Requests:
        self._state = _OVER
        self.done = True
        self.abort_code = int(code)
        return [b"\x80" + self._mux + int(code).to_bytes(4, "little")]

    def _aborted(self, data: bytes) -> Requests:
        # An abort names the object of the transfer; zeros come from servers that had lost it already.
        initiating = self._state in (_INITIATE, _BLOCK_INITIATE)
        if data[1:4] != self._mux and (initiating or data[1:4] != b"\0\0\0"):
            return self._stray()
        code = int.from_bytes(data[4:8], "little")
        if self._state == _BLOCK_INITIATE and code == AbortCode.COMMAND:
            self.block = False
            return self.start()
        self._state = _OVER
        self.done = True
        self.abort_code = code or int(AbortCode.GENERAL)
        return []

    def _stray(self) -> Requests:
        self.strays += 1
        return []

    def _finish(self) -> Requests:
        self._state = _OVER
        self.done = True
        return []

    def _mine(self, data: bytes) -> bool:
        return data[1:4] == self._mux


class SdoUpload(SdoTransfer):
    """Reads an entry of the server's dictionary; `data` has the bytes when it has ended well.

    Args:
        index: Object index, 0..FFFFh.
        sub: Sub-index, 0..255.
        block: Ask for the block protocol, with a switch to the normal one for up to 28 bytes (C301-071).
        block_size: Segments per block, 1..127.

    """

    _SWITCH: Final = 28

    @property
    def data(self) -> bytes:
        """What has been read; of a running transfer, as far as it is."""
        return bytes(self._buffer)

    @override
    def start(self) -> Requests:
        self.done = False
        self.abort_code = 0
        self._buffer.clear()
        self._size = None
        if self.block:
            self._state = _BLOCK_INITIATE
            return [b"\xa4" + self._mux + bytes((self._block_size, self._SWITCH, 0, 0))]
        self._state = _INITIATE
        return [b"\x40" + self._mux + b"\0\0\0\0"]

    def _step(self, data: bytes) -> Requests:
        state = self._state
        specifier = data[0] >> 5
        if state == _INITIATE or (state == _BLOCK_INITIATE and specifier == 2):
            return self._initiated(data) if specifier == 2 and self._mine(data) else self._stray()
        if state == _SEGMENTS:
            return self._segment(data) if specifier == 0 else self._stray()
        if state == _BLOCK_INITIATE:
            return self._block_initiated(data) if specifier == 6 and self._mine(data) else self._stray()
        if state == _BLOCK:
            return self._block_segment(data)
        return self._block_ended(data) if data[0] & 0xE3 == 0xC1 else self._stray()

    def _initiated(self, data: bytes) -> Requests:
        command = data[0]
        if command & 0x02:
            count = 4 - (command >> 2 & 3) if command & 0x01 else 4
            self._buffer += data[4 : 4 + count]
            return self._finish()
        self._size = int.from_bytes(data[4:8], "little") if command & 0x01 else None
        if self._size is not None and self._size > LONGEST_UPLOAD:
            return self._break_off(AbortCode.MEMORY)
        self._state = _SEGMENTS
        self._toggle = 0
        return [b"\x60\0\0\0\0\0\0\0"]

    def _segment(self, data: bytes) -> Requests:
        command = data[0]
        if command & 0x10 != self._toggle:
            return self._break_off(AbortCode.TOGGLE)
        self._buffer += data[1 : 8 - (command >> 1 & 7)]
        if len(self._buffer) > (LONGEST_UPLOAD if self._size is None else self._size):
            return self._break_off(AbortCode.TOO_LONG)
        if command & 0x01:
            return self._complete()
        self._toggle ^= 0x10
        return [bytes((0x60 | self._toggle, 0, 0, 0, 0, 0, 0, 0))]

    def _complete(self) -> Requests:
        if self._size is not None and len(self._buffer) != self._size:
            short = len(self._buffer) < self._size
            return self._break_off(AbortCode.TOO_SHORT if short else AbortCode.TOO_LONG)
        return self._finish()

    def _block_initiated(self, data: bytes) -> Requests:
        self._crc = bool(data[0] & 0x04)
        self._size = int.from_bytes(data[4:8], "little") if data[0] & 0x02 else None
        if self._size is not None and self._size > LONGEST_UPLOAD:
            return self._break_off(AbortCode.MEMORY)
        self._sequence = 0
        self._state = _BLOCK
        return [b"\xa3\0\0\0\0\0\0\0"]

    def _block_segment(self, data: bytes) -> Requests:
        sequence = data[0] & 0x7F
        if sequence == 0:
            # Number 0 is no segment: it is the server's abort, or nothing of ours.
            return self._aborted(data) if data[0] == 0x80 else self._stray()
        last = bool(data[0] & 0x80)
        in_order = sequence == self._sequence + 1
        if in_order:
            self._sequence = sequence
            self._buffer += data[1:8]
            if len(self._buffer) > (LONGEST_UPLOAD if self._size is None else self._size) + 7:
                return self._break_off(AbortCode.TOO_LONG)
        if not last and sequence < self._block_size:
            return []
        # The block is over: what is missing after the acknowledged number is sent again (C301-070).
        acknowledged = self._sequence
        self._sequence = 0
        if last and in_order:
            self._state = _BLOCK_END
        return [bytes((0xA2, acknowledged, self._block_size, 0, 0, 0, 0, 0))]

    def _block_ended(self, data: bytes) -> Requests:
        unused = data[0] >> 2 & 7
        if unused:
            del self._buffer[-unused:]
        if self._crc and crc_hqx(self._buffer, 0) != int.from_bytes(data[1:3], "little"):
            return self._break_off(AbortCode.CRC)
        self._complete()
        if self.abort_code:
            return self._break_off(self.abort_code)
        return [b"\xa1\0\0\0\0\0\0\0"]


class SdoDownload(SdoTransfer):
    """Writes an entry of the server's dictionary.

    Args:
        index: Object index, 0..FFFFh.
        sub: Sub-index, 0..255.
        data: The bytes; up to four go with the first request.
        block: Use the block protocol for more than four bytes.

    """

    def __init__(self, index: int, sub: int, data: bytes, *, block: bool = False) -> None:
        super().__init__(index, sub, block=block and len(data) > 4)
        self.data = bytes(data)
        """What is written."""
        self._acknowledged = 0
        self._expected = 0

    @override
    def start(self) -> Requests:
        self.done = False
        self.abort_code = 0
        self._offset = 0
        data = self.data
        size = len(data)
        if self.block:
            self._state = _BLOCK_INITIATE
            return [b"\xc6" + self._mux + size.to_bytes(4, "little")]
        self._state = _INITIATE
        if 0 < size <= 4:
            return [bytes((0x23 | (4 - size) << 2,)) + self._mux + data.ljust(4, b"\0")]
        return [b"\x21" + self._mux + size.to_bytes(4, "little")]

    def _step(self, data: bytes) -> Requests:
        state = self._state
        specifier = data[0] >> 5
        if state == _INITIATE:
            if specifier != 3 or not self._mine(data):
                return self._stray()
            if 0 < len(self.data) <= 4:
                return self._finish()
            self._state = _SEGMENTS
            self._toggle = 0
            return self._next_segment()
        if state == _SEGMENTS:
            return self._segment_taken(data) if specifier == 1 else self._stray()
        if state == _BLOCK_INITIATE:
            if specifier != 5 or data[0] & 0x03 or not self._mine(data):
                return self._stray()
            self._crc = bool(data[0] & 0x04)
            self._acknowledged = 0
            self._state = _BLOCK
            return self._next_block(data[4])
        if state == _BLOCK:
            return self._block_taken(data)
        return self._finish() if data[0] & 0xE3 == 0xA1 else self._stray()

    def _next_segment(self) -> Requests:
        part = self.data[self._offset : self._offset + 7]
        self._offset += len(part)
        command = self._toggle | (7 - len(part)) << 1 | (self._offset >= len(self.data))
        return [bytes((command,)) + part.ljust(7, b"\0")]

    def _segment_taken(self, data: bytes) -> Requests:
        if data[0] & 0x10 != self._toggle:
            return self._break_off(AbortCode.TOGGLE)
        if self._offset >= len(self.data):
            return self._finish()
        self._toggle ^= 0x10
        return self._next_segment()

    def _next_block(self, size: int) -> Requests:
        if not 1 <= size <= 127:
            return self._break_off(AbortCode.BLOCK_SIZE)
        content = self.data
        offset = self._acknowledged
        requests: Requests = []
        for sequence in range(1, size + 1):
            part = content[offset : offset + 7]
            offset += 7
            last = offset >= len(content)
            requests.append(bytes((sequence | last << 7,)) + part.ljust(7, b"\0"))
            if last:
                break
        self._expected = len(requests)
        return requests

    def _block_taken(self, data: bytes) -> Requests:
        if data[0] == 0x80:
            return self._aborted(data)
        if data[0] & 0xE3 != 0xA2:
            return self._stray()
        if data[1] > self._expected:
            return self._break_off(AbortCode.SEQUENCE)
        self._acknowledged += 7 * data[1]
        size = len(self.data)
        if self._acknowledged < size:
            return self._next_block(data[2])
        self._state = _BLOCK_END
        crc = crc_hqx(self.data, 0) if self._crc else 0
        return [_END.pack(0xC1 | (self._acknowledged - size) << 2, crc)]
