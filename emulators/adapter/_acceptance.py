"""The acceptance filter of the controller in a serial-line adapter: two patterns of 16 bits, or one of 32."""

from __future__ import annotations

from typing import Final

from fieldbus.can.frame import CanFrame

_ALL: Final = 0xFFFF_FFFF


class AcceptanceFilter:
    """Code and mask as the SJA1000 interprets them in its PeliCAN mode.

    A mask bit of 1 means that the bit of the code does not matter. With two patterns (the state after
    power-on) a frame is taken when either fits.
    """

    def __init__(self) -> None:
        self.code = 0
        """ACR0 to ACR3, ACR0 in the upper byte."""
        self.mask = _ALL
        """AMR0 to AMR3; 1 = does not matter."""
        self.single = False
        """One pattern of 32 bits in place of two of 16."""

    def accepts(self, frame: CanFrame) -> bool:
        """Return whether the adapter takes `frame`."""
        if self.mask == _ALL:
            return True
        if self.single:
            word, known = _single(frame)
            return not (word ^ self.code) & ~self.mask & known
        # Only the first pattern can hold a data byte, whose lower half is in the last register.
        first, second, known_first, known_second = _dual(frame)
        code, mask = self.code, self.mask
        one = not (first ^ _first_pattern(code)) & ~_first_pattern(mask) & known_first
        two = not (second ^ (code & 0xFFFF)) & ~(mask & 0xFFFF) & known_second
        return one or two


def _first_pattern(registers: int) -> int:
    """Return registers 0 and 1 with the lower half of register 3 behind them: 20 bits."""
    return (registers >> 16) << 4 | registers & 0xF


def _single(frame: CanFrame) -> tuple[int, int]:
    """Return the bits of a frame that stand against the one pattern, and which of them exist."""
    if frame.extended:
        return frame.can_id << 3 | frame.remote << 2, 0xFFFF_FFFC
    data = frame.data[:2].ljust(2, b"\0")
    known = 0xFFF0_0000
    if not frame.remote:
        known |= (0, 0xFF00, 0xFFFF)[min(len(frame.data), 2)]
    return frame.can_id << 21 | frame.remote << 20 | data[0] << 8 | data[1], known


def _dual(frame: CanFrame) -> tuple[int, int, int, int]:
    """Return the bits that stand against the first and the second pattern, and which of them exist."""
    if frame.extended:
        word = frame.can_id >> 13
        return word << 4, word, 0xFFFF0, 0xFFFF
    head = frame.can_id << 5 | frame.remote << 4
    if frame.remote or not frame.data:
        return head << 4, head, 0xFFF00, 0xFFF0
    return head << 4 | frame.data[0], head, 0xFFFFF, 0xFFF0
