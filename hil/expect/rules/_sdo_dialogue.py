"""What an SDO server may answer to what it was asked (CiA 301, 7.2.4), from the frames alone.

Every request that the frames show is followed as a server has to follow it. What a server may know better
than the frames, the value of an object or the reason of a refusal, is not judged.
"""

from __future__ import annotations

from binascii import crc_hqx
from typing import Final

ABORT_CODES: Final = frozenset(
    (
        0x05030000, 0x05040000, 0x05040001, 0x05040002, 0x05040003, 0x05040004, 0x05040005, 0x06010000,
        0x06010001, 0x06010002, 0x06020000, 0x06040041, 0x06040042, 0x06040043, 0x06040047, 0x06060000,
        0x06070010, 0x06070012, 0x06070013, 0x06090011, 0x06090030, 0x06090031, 0x06090032, 0x06090036,
        0x060A0023, 0x08000000, 0x08000020, 0x08000021, 0x08000022, 0x08000023, 0x08000024,
    )
)  # fmt: skip
"""Abort codes of CiA 301, table 22."""
TIMED_OUT, TOGGLE_WRONG, COMMAND_UNKNOWN = 0x05040000, 0x05030000, 0x05040001
BLOCK_SIZE_WRONG, SEQUENCE_WRONG, CRC_WRONG, TOO_LONG, TOO_SHORT = (
    0x05040002,
    0x05040003,
    0x05040004,
    0x06070012,
    0x06070013,
)
_SEGMENT: Final = 7
_WITHOUT_DATA: Final = {"20": b"\x20" + bytes(7), "30": b"\x30" + bytes(7), "A1": b"\xa1" + bytes(7)}
"""Answers of a server to a segment, and to the end of a block download."""


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little")


class Dialogue:
    """One server channel.

    `request` and `answer` take the frames in the order in which they were on the bus and return what is wrong
    with an answer, or an empty text.
    """

    def __init__(self) -> None:
        self._what = ""
        """The service that is under way; empty: none."""
        self._object = bytes(3)
        self._waits = ""
        """Which answer is awaited; empty: none."""
        self._abort: int | None = None
        """The only abort code that is right now; None: any, 0: none."""
        self._toggle = 0
        self._size: int | None = None
        self._content = bytearray()
        self._numbers = 0
        self._block = 0
        self._gap = False
        self._crc = False
        self._sent = 0
        self._known = False
        """Whether the begin of the transfer was seen, and its length."""

    # -- requests -------------------------------------------------------------------------------------------

    def request(self, data: bytes) -> None:
        """Take the eight bytes of a client; others are no request."""
        if len(data) != 8:
            return
        self._abort = None
        if self._what == "block download":
            self._take_segment(data)
            return
        specifier = data[0] >> 5
        if specifier == 4:
            self._begin("", b"")
        elif specifier == 1:
            self._begin("download", data)
            self._waits = "60"
            if data[0] & 2:
                self._what = ""
            elif data[0] & 1:
                self._size = _number(data[4:])
        elif specifier == 2:
            self._begin("upload", data)
            self._waits = "40"
        elif specifier == 0:
            self._download_segment(data)
        elif specifier == 3:
            self._upload_segment(data)
        elif specifier == 5:
            self._block_upload(data)
        elif specifier == 6:
            self._block_download(data)
        else:
            self._refuse(COMMAND_UNKNOWN)

    def _begin(self, what: str, data: bytes) -> None:
        self._what, self._object, self._waits = what, data[1:4], ""
        self._toggle = self._numbers = self._sent = 0
        self._size, self._gap = None, False
        self._content.clear()
        self._known = True

    def _refuse(self, code: int) -> None:
        """The only right answer is an abort with this code."""
        self._waits, self._abort = "abort", code
        self._what = ""

    def _download_segment(self, data: bytes) -> None:
        if self._what != "download":
            self._refuse(COMMAND_UNKNOWN)
        elif data[0] >> 4 & 1 != self._toggle:
            self._refuse(TOGGLE_WRONG)
        else:
            self._content += data[1 : 8 - (data[0] >> 1 & 7)]
            self._waits = f"{0x20 | self._toggle << 4:02X}"
            self._toggle ^= 1
            if self._size is not None and len(self._content) > self._size:
                self._refuse(TOO_LONG)
            elif data[0] & 1:
                if self._size is not None and len(self._content) < self._size:
                    self._refuse(TOO_SHORT)
                self._what = ""

    def _upload_segment(self, data: bytes) -> None:
        if self._what != "segments":
            self._refuse(COMMAND_UNKNOWN)
        elif data[0] >> 4 & 1 != self._toggle:
            self._refuse(TOGGLE_WRONG)
        else:
            self._waits = "segment"

    def _block_upload(self, data: bytes) -> None:
        service = data[0] & 3
        if service == 0:
            self._begin("block upload", data)
            self._block, self._crc = data[4], bool(data[0] & 4)
            self._waits = "C0"
            if not 1 <= self._block <= 127:
                self._refuse(BLOCK_SIZE_WRONG)
        elif service == 3 and self._what == "block upload" and self._size is not None:
            self._what = "blocks"
            self._next_block()
        elif service == 2 and self._what == "blocks":
            if data[1] > self._numbers:
                self._refuse(SEQUENCE_WRONG)
            elif not 1 <= data[2] <= 127:
                self._refuse(BLOCK_SIZE_WRONG)
            else:
                # What was not acknowledged comes again.
                del self._content[self._sent + _SEGMENT * data[1] :]
                self._sent, self._block = len(self._content), data[2]
                if self._size is not None and data[1] and self._sent >= self._size:
                    self._waits = "C1"
                    self._what = "end of blocks"
                else:
                    self._next_block()
        elif service == 1 and self._what == "end of blocks":
            self._begin("", b"")
        else:
            self._refuse(COMMAND_UNKNOWN)

    def _next_block(self) -> None:
        self._waits, self._numbers = "segments", 0

    def _block_download(self, data: bytes) -> None:
        if not data[0] & 1:
            self._begin("block download asked", data)
            self._size = _number(data[4:]) if data[0] & 2 else None
            self._crc = bool(data[0] & 4)
            self._waits = "A0"
        elif self._what != "block download ends":
            self._refuse(COMMAND_UNKNOWN)
        else:
            unused = data[0] >> 2 & 7
            content = bytes(self._content[: len(self._content) - unused])
            self._waits, self._what = "A1", ""
            if self._crc and crc_hqx(content, 0) != _number(data[1:3]):
                self._refuse(CRC_WRONG)
            elif self._size is not None and len(content) != self._size:
                self._refuse(TOO_SHORT if len(content) < self._size else TOO_LONG)

    def _take_segment(self, data: bytes) -> None:
        """Take a segment of a block that is downloaded."""
        number, last = data[0] & 0x7F, bool(data[0] & 0x80)
        if not number:
            if last:
                self._begin("", b"")
            else:
                self._refuse(SEQUENCE_WRONG)
            return
        if number > self._block:
            self._refuse(SEQUENCE_WRONG)
            return
        in_order = number == self._numbers + 1 and not self._gap
        if in_order:
            self._numbers = number
            self._content += data[1:]
        elif number > self._numbers:
            self._gap = True
        if last or number == self._block:
            self._waits = "A2"
            if last and in_order:
                self._what = "block download ends"

    # -- answers --------------------------------------------------------------------------------------------

    def answer(self, data: bytes) -> str:
        """Take the bytes of the server; return what is wrong with them."""
        if len(data) != 8:
            return f"an answer has {len(data)} bytes"
        if not self._known:
            return ""
        waits, abort = self._waits, self._abort
        if data[0] == 0x80 and waits != "segments":
            return self._aborted(data, waits, abort)
        if not waits:
            return f"{data.hex(' ')} answers nothing"
        if abort:
            return f"{data.hex(' ')} in place of abort {abort:08X}h"
        if waits != "segments":
            self._waits = ""
        if waits == "segments":
            return self._block_segment(data)
        if waits == "segment":
            return self._segment(data)
        if waits == "40" or (waits == "C0" and data[0] >> 5 == 2):
            return self._upload_begins(data)
        if waits == "C0":
            return self._block_upload_begins(data)
        if waits == "A0":
            return self._block_download_begins(data)
        wanted = b"\x60" + self._object + bytes(4) if waits == "60" else _WITHOUT_DATA.get(waits)
        if waits == "A2":
            wanted = bytes((0xA2, self._numbers, data[2])) + bytes(5)
            self._block, self._numbers, self._gap = data[2], 0, False
            if not 1 <= data[2] <= 127:
                return f"a block of {data[2]} segments"
        elif waits == "C1":
            size = self._size or 0
            checksum = crc_hqx(bytes(self._content[:size]), 0) if self._crc else 0
            wanted = bytes((0xC1 | (-size % _SEGMENT) << 2,)) + checksum.to_bytes(2, "little") + bytes(5)
        return "" if data == wanted else f"{data.hex(' ')} in place of {(wanted or b'').hex(' ')}"

    def _aborted(self, data: bytes, waits: str, abort: int | None) -> str:
        code, what, of = _number(data[4:]), self._what, data[1:4]
        # A server that has lost the transfer may name nothing; what it names without one is its own business.
        ours = not self._object or of == self._object or abort == COMMAND_UNKNOWN
        ours = ours or (of == bytes(3) and (waits == "abort" or not waits))
        wrong = "" if ours else f"abort of {of.hex(' ')} in place of {self._object.hex(' ')}"
        self._begin("", bytes(1) + self._object)
        if not waits:
            # A time-out is reported only to a client that has sent nothing in the middle of a transfer.
            early = what == "block download" and code in ABORT_CODES
            return wrong if early or (what and code == TIMED_OUT) else f"abort {code:08X}h of nothing"
        if code not in ABORT_CODES:
            return f"abort code {code:08X}h is none of CiA 301"
        if abort and code != abort:
            return f"abort {code:08X}h in place of {abort:08X}h"
        return wrong

    def _upload_begins(self, data: bytes) -> str:
        command = data[0]
        if command >> 5 != 2 or data[1:4] != self._object or command & 0x10:
            return f"{data.hex(' ')} does not begin the upload of {self._object.hex(' ')}"
        if command & 2:
            self._what = ""
            unused = command >> 2 & 3 if command & 1 else 0
            return (
                ""
                if not any(data[8 - unused :] if unused else b"")
                else f"{data.hex(' ')} has more than its size"
            )
        if command & 0x0C:
            return f"{data.hex(' ')} has bits of an expedited transfer"
        self._what = "segments"
        self._size = _number(data[4:]) if command & 1 else None
        return ""

    def _segment(self, data: bytes) -> str:
        toggle, unused, last = data[0] >> 4 & 1, data[0] >> 1 & 7, bool(data[0] & 1)
        if data[0] >> 5 or toggle != self._toggle:
            return f"{data.hex(' ')} is no segment with toggle bit {self._toggle}"
        self._toggle ^= 1
        self._content += data[1 : 8 - unused]
        if last:
            self._what = ""
        if any(data[8 - unused :] if unused else b""):
            return f"{data.hex(' ')} has more than its size"
        if self._size is not None and (
            last != (len(self._content) == self._size) or len(self._content) > self._size
        ):
            return (
                f"segment with {'' if last else 'out'} end after {len(self._content)} of {self._size} bytes"
            )
        return ""

    def _block_upload_begins(self, data: bytes) -> str:
        if data[0] & 0xF9 != 0xC0 or data[1:4] != self._object:
            return f"{data.hex(' ')} does not begin the upload of {self._object.hex(' ')} in blocks"
        self._crc = self._crc and bool(data[0] & 4)
        self._size = _number(data[4:]) if data[0] & 2 else None
        self._known = self._size is not None
        return ""

    def _block_segment(self, data: bytes) -> str:
        number, last = data[0] & 0x7F, bool(data[0] & 0x80)
        self._numbers += 1
        if number != self._numbers or number > self._block:
            self._waits = ""
            return f"segment {number} of a block in place of {self._numbers}"
        self._content += data[1:]
        if last or number == self._block:
            self._waits = ""
        if self._size is not None:
            if last != (len(self._content) >= self._size):
                end = "ends" if last else "does not end"
                return f"segment {number} {end} {self._size} bytes with {len(self._content)}"
            if last and any(self._content[self._size :]):
                return f"segment {number} has more than {self._size} bytes"
        return ""

    def _block_download_begins(self, data: bytes) -> str:
        if data[0] & 0xFB != 0xA0 or data[1:4] != self._object or any(data[5:]):
            return f"{data.hex(' ')} does not begin the download of {self._object.hex(' ')} in blocks"
        self._crc = self._crc and bool(data[0] & 4)
        self._block = data[4]
        self._what = "block download"
        return "" if 1 <= self._block <= 127 else f"blocks of {self._block} segments"
