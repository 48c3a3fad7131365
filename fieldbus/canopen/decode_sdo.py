"""Listening to the SDO conversation of one node: words, and what was written."""

from __future__ import annotations

from typing import Final, Protocol

from fieldbus.canopen.abort import ABORT_TEXTS

_IDLE: Final = 0
_BLOCK_DOWNLOAD: Final = 1
_BLOCK_DOWNLOAD_END: Final = 2
_BLOCK_UPLOAD: Final = 3
_BLOCK_UPLOAD_END: Final = 4

Written = tuple[int, int, bytes]


class Vocabulary(Protocol):
    """Names and values of the node's objects."""

    def object_name(self, index: int, sub: int) -> str:
        """Return the name of an object."""

    def value_text(self, index: int, sub: int, data: bytes) -> str:
        """Return a value in words."""


class SdoListener:
    """Follows the transfers on one channel from both sides' frames; wrong
    frames are described, never raised.
    """

    def __init__(self, words: Vocabulary) -> None:
        self._words = words
        self._mode = _IDLE
        self._index = 0
        self._sub = 0
        self._data = bytearray()
        self._pending: bytes | None = None
        self._complete = False
        self._last = 0

    def reset(self) -> None:
        """Forget the running transfer."""
        self._mode = _IDLE
        self._pending = None
        self._complete = False
        self._data = bytearray()

    def decode(self, data: bytes, *, request: bool) -> tuple[str, Written | None]:
        """Take a frame; return its words, and the write that it has completed, if any."""
        if len(data) != 8:
            return f"malformed {data.hex(' ').upper()}", None
        if data[0] == 0x80:
            self.reset()
            self._take_address(data)
            code = int.from_bytes(data[4:], "little")
            who = "abort by client" if request else "abort"
            return f"{who} {code:08X}h {ABORT_TEXTS.get(code, 'unknown code')} ({self._place()})", None
        if request:
            return self._request(data), None
        return self._answer(data)

    def _place(self) -> str:
        sub = f":{self._sub}" if self._sub else ""
        name = self._words.object_name(self._index, self._sub)
        place = f"{self._index:04X}h{sub}"
        return place if name == place else f"{place} {name}"

    def _take_address(self, data: bytes) -> None:
        self._index = int.from_bytes(data[1:3], "little")
        self._sub = data[3]

    def _value(self, content: bytes) -> str:
        return self._words.value_text(self._index, self._sub, content)

    # -- client to server
    # -------------------------------------------------------------------------------------

    def _request(self, data: bytes) -> str:
        command = data[0]
        if self._mode == _BLOCK_DOWNLOAD:
            self._last = command
            self._data += data[1:]
            return f"block segment {command & 0x7F}" + (", last" if command & 0x80 else "")
        specifier = command >> 5
        if specifier == 1:
            self.reset()
            self._take_address(data)
            if command & 0x02:
                count = 4 - (command >> 2 & 3) if command & 0x01 else 4
                self._pending = data[4 : 4 + count]
                self._complete = True
                return f"write {self._place()} = {self._value(self._pending)}"
            size = f", {int.from_bytes(data[4:], 'little')} bytes" if command & 0x01 else ""
            return f"write {self._place()} segmented{size}"
        if specifier == 0:
            self._data += data[1 : 8 - (command >> 1 & 7)]
            if command & 0x01:
                self._pending = bytes(self._data)
                self._complete = True
                return f"segment, last: {self._place()} = {self._value(self._pending)}"
            return "segment"
        if specifier == 2:
            self.reset()
            self._take_address(data)
            return f"read {self._place()}"
        if specifier == 3:
            return "next segment"
        if specifier == 5:
            return self._block_upload_request(command, data)
        if specifier == 6:
            return self._block_download_request(command, data)
        return f"unknown request {data.hex(' ').upper()}"

    def _block_download_request(self, command: int, data: bytes) -> str:
        if command & 0x01:
            unused = command >> 2 & 7
            self._pending = bytes(self._data[: len(self._data) - unused])
            self._complete = True
            return f"block end: {self._place()} = {self._value(self._pending)}"
        self.reset()
        self._take_address(data)
        size = f", {int.from_bytes(data[4:], 'little')} bytes" if command & 0x02 else ""
        return f"write {self._place()} in blocks{size}"

    def _block_upload_request(self, command: int, data: bytes) -> str:
        service = command & 0x03
        if service == 0:
            self.reset()
            self._take_address(data)
            return f"read {self._place()} in blocks of {data[4]}"
        if service == 3:
            self._mode = _BLOCK_UPLOAD
            return "block start"
        if service == 2:
            if self._last & 0x80 and data[1] == self._last & 0x7F:
                self._mode = _BLOCK_UPLOAD_END
            return f"block received up to {data[1]}"
        self.reset()
        return "block end"

    # -- server to client
    # -------------------------------------------------------------------------------------

    def _answer(self, data: bytes) -> tuple[str, Written | None]:
        command = data[0]
        if self._mode == _BLOCK_UPLOAD:
            self._last = command
            return f"block segment {command & 0x7F}" + (", last" if command & 0x80 else ""), None
        specifier = command >> 5
        if specifier == 3:
            self._take_address(data)
            return (
                f"written {self._place()}" if self._complete else f"ready for {self._place()}",
                self._finish(),
            )
        if specifier == 1:
            return ("segment received, written" if self._complete else "segment received"), self._finish()
        if specifier == 2:
            self._take_address(data)
            if command & 0x02:
                count = 4 - (command >> 2 & 3) if command & 0x01 else 4
                return f"read {self._place()} = {self._value(data[4 : 4 + count])}", None
            size = f", {int.from_bytes(data[4:], 'little')} bytes" if command & 0x01 else ""
            return f"read {self._place()} segmented{size}", None
        if specifier == 0:
            self._data += data[1 : 8 - (command >> 1 & 7)]
            if command & 0x01:
                content = bytes(self._data)
                self.reset()
                return f"segment, last: {self._place()} = {self._value(content)}", None
            return "segment", None
        if specifier == 5:
            return self._block_download_answer(command, data)
        if specifier == 6:
            if command & 0x01:
                return "block end, CRC", None
            self._take_address(data)
            return f"read {self._place()} in blocks, {int.from_bytes(data[4:], 'little')} bytes", None
        return f"unknown answer {data.hex(' ').upper()}", None

    def _block_download_answer(self, command: int, data: bytes) -> tuple[str, Written | None]:
        service = command & 0x03
        if service == 0:
            self._mode = _BLOCK_DOWNLOAD
            return f"ready for {self._place()} in blocks of {data[4]}", None
        if service == 2:
            if self._last & 0x80 and data[1] == self._last & 0x7F:
                self._mode = _BLOCK_DOWNLOAD_END
            return f"block received up to {data[1]}", None
        return f"written {self._place()}", self._finish()

    def _finish(self) -> Written | None:
        if not self._complete or self._pending is None:
            return None
        written = (self._index, self._sub, self._pending)
        self.reset()
        return written
