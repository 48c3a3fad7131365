"""The length of a classical CAN frame on the wire, by the standard alone: bit by bit, as text."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from fieldbus.can.frame import CanFrame

TAIL_BITS: Final = 10
"""CRC delimiter, acknowledge and end of frame, which have no stuff bits."""
INTERMISSION_BITS: Final = 3


def stuffed(text: str) -> str:
    """Return bits with the stuff bits of classical CAN, also behind a run at the end (CANP-014)."""
    wire, run = "", ""
    for mark in text:
        wire += mark
        run = run + mark if run[-1:] == mark else mark
        if len(run) == 5:
            run = "1" if mark == "0" else "0"
            wire += run
    return wire


@lru_cache(maxsize=1024)
def length_of(frame: CanFrame) -> int:
    """Return the bits of a frame from SOF to EOF (CANP-001 to CANP-017)."""
    if frame.extended:
        text = f"0{frame.can_id >> 18:011b}11{frame.can_id & 0x3FFFF:018b}{frame.remote:d}00"
    else:
        text = f"0{frame.can_id:011b}{frame.remote:d}00"
    text += f"{frame.dlc:04b}" + "".join(f"{byte:08b}" for byte in frame.data)
    crc = 0
    for mark in text:
        feedback = int(mark) ^ crc >> 14
        crc = crc << 1 & 0x7FFF ^ 0x4599 * feedback
    # A run that ends with the CRC gets its stuff bit too.
    return len(stuffed(text + f"{crc:015b}")) + TAIL_BITS
