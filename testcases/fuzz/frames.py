"""Bytes as a course of CAN frames and pauses, so that any input of a fuzzer is one, and small changes stay
small.

One frame is a service byte, a form byte and its data:

    service  bits 0..3 an identifier of the list below; bit 7: two more bytes give the identifier
    form     bits 0..3 length (9..15: eight bytes), bit 4 remote, bit 5 extended, bits 6..7 pause after it
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fieldbus.can import CanFrame
from fieldbus.clock import MS, US

NODE: Final = 5
LONGEST: Final = 48
"""Frames of one input at most."""

SERVICES: Final = (
    0x600 + NODE, 0x000, 0x080, 0x200 + NODE, 0x300 + NODE, 0x400 + NODE, 0x500 + NODE, 0x700 + NODE,
    0x100, 0x7E5, 0x77F, 0x180 + NODE, 0x080 + NODE, 0x580 + NODE, 0x640, 0x281,
)  # fmt: skip
PAUSES_NS: Final = (0, 150 * US, 2 * MS, 40 * MS)


def frames(data: bytes) -> Iterator[tuple[CanFrame, int]]:
    """Yield frames, each with the pause after it in ns."""
    at, count = 0, 0
    while at + 2 <= len(data) and count < LONGEST:
        service, form = data[at], data[at + 1]
        at += 2
        can_id = SERVICES[service & 0x0F]
        if service & 0x80:
            can_id = int.from_bytes(data[at : at + 2], "little")
            at += 2
        extended, remote = bool(form & 0x20), bool(form & 0x10)
        length = min(form & 0x0F, 8)
        can_id &= 0x1FFFFFFF if extended else 0x7FF
        if remote:
            frame = CanFrame(can_id, extended=extended, remote=True, dlc=length)
        else:
            frame = CanFrame(can_id, data[at : at + length].ljust(length, b"\0"), extended=extended)
            at += length
        count += 1
        yield frame, PAUSES_NS[form >> 6]


def encode(*course: tuple[int, str] | tuple[int, str, int]) -> bytes:
    """Return the input for frames given as identifier, data in hexadecimal and number of the pause after
    them.
    """
    out = bytearray()
    for can_id, text, *pause in course:
        content = bytes.fromhex(text)
        form = len(content) | (pause[0] if pause else 0) << 6
        if can_id in SERVICES:
            out += bytes((SERVICES.index(can_id), form))
        else:
            out += bytes((0x80, form)) + can_id.to_bytes(2, "little")
        out += content
    return bytes(out)
