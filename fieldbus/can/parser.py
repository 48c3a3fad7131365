"""A classical CAN frame as a receiver takes it from the wire, bit by bit."""

from __future__ import annotations

from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.can.timing import CRC_POLYNOMIAL

CRC_BITS: Final = 15
_STANDARD_HEADER: Final = 19  # SOF to DLC
_EXTENDED_HEADER: Final = 39
_IDE_COUNT: Final = 14  # bits from SOF to IDE
_NO_TOTAL: Final = 1 << 20
_STANDARD_ENDS: Final = (("sof", 1), ("id", 12), ("rtr", 13), ("ide", 14), ("reserved", 15), ("dlc", 19))
_EXTENDED_ENDS: Final = (
    ("sof", 1),
    ("id", 12),
    ("srr", 13),
    ("ide", 14),
    ("id_extension", 32),
    ("rtr", 33),
    ("reserved", 35),
    ("dlc", 39),
)


class FrameParser:
    """Takes the bits from SOF to CRC without the stuff bits."""

    __slots__ = ("_value", "crc", "header", "taken", "total")

    def begin_frame(self) -> None:
        """Expect SOF."""
        self.taken = 0
        """Number of bits so far."""
        self.crc = 0
        """Checksum of them; 0 at the end of a good frame (CANP-012)."""
        self.header = _STANDARD_HEADER
        """Number of bits from SOF to DLC."""
        self.total = _NO_TOTAL
        """Number of bits from SOF to CRC, as soon as it is known."""
        self._value = 0

    def parse(self, bit: int) -> None:
        """Take a bit of the frame without its stuff bits."""
        crc = self.crc << 1
        if (crc >> CRC_BITS ^ bit) & 1:
            crc ^= CRC_POLYNOMIAL
        self.crc = crc & 0x7FFF
        self._value = value = self._value << 1 | bit
        self.taken = taken = self.taken + 1
        if taken == _IDE_COUNT and bit:
            self.header = _EXTENDED_HEADER
        elif taken == self.header:
            remote = value >> 6 & 1
            length = 0 if remote else min(value & 0xF, 8)
            self.total = taken + 8 * length + CRC_BITS

    def field(self) -> str:
        """Return the name of the field of the last bit; see `fieldbus.can.bitstream.FIELDS`."""
        extended = self.header == _EXTENDED_HEADER
        for name, end in _EXTENDED_ENDS if extended else _STANDARD_ENDS:
            if self.taken <= end:
                return name
        return "data" if self.taken <= self.total - CRC_BITS else "crc"

    def received_frame(self) -> CanFrame:
        """Return what has been received."""
        data_bits = self.total - self.header - CRC_BITS
        value = self._value >> CRC_BITS
        data = (value & (1 << data_bits) - 1).to_bytes(data_bits // 8, "big")
        value >>= data_bits
        dlc = value & 0xF
        remote = bool(value >> 6 & 1)
        if self.header == _EXTENDED_HEADER:
            can_id = (value >> 27 & 0x7FF) << 18 | value >> 7 & 0x3FFFF
            return CanFrame(can_id, data, extended=True, remote=remote, dlc=dlc)
        return CanFrame(value >> 7 & 0x7FF, data, remote=remote, dlc=dlc)
