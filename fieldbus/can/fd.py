"""CAN FD: what is allowed in a frame, how long it is on the wire, and its bits.

A frame has two rates. The data phase goes from ESI to the CRC delimiter; BRS and CRC delimiter change the
rate at their sample points. With the same sample point in both phases that is as long as if BRS were a
nominal bit and the CRC delimiter a data bit, so that the length is exact (CANP-073, CANP-075).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from fieldbus.can.frame import FD_LENGTHS, CanFrame
from fieldbus.can.timing import INTERMISSION_BITS, frame_bits
from fieldbus.clock import S
from fieldbus.errors import BusError

NO_FD: Final = "CAN FD messages are not supported: this is a classical CAN segment (no data_bitrate)"
"""What is said of a CAN FD frame on a segment without it."""
STANDARD_HEADER: Final = 22
"""Bits from SOF to DLC of a frame with an 11-bit identifier, without stuff bits."""
EXTENDED_HEADER: Final = 41
STANDARD_FDF: Final = 15
"""Number of the FDF bit, counted from 1 with SOF."""
EXTENDED_FDF: Final = 34

_FAST_HEADER_BITS: Final = 5  # ESI and DLC
_NOMINAL_TAIL: Final = 9 + INTERMISSION_BITS  # ACK slot and delimiter, EOF, intermission
_STUFF_COUNT_BITS: Final = 4
_SHORT: Final = 16  # bytes up to which the checksum has 17 bits
_CRCS: Final = ((17, 0x1685B), (21, 0x102899))
_FIXED_EVERY: Final = 4
_RUN: Final = 5


def check_fd(frame: CanFrame) -> None:
    """Refuse what is no CAN FD frame.

    Raises:
        BusError: Identifier, length or kind are not those of a CAN FD frame.

    """
    limit = 0x1FFFFFFF if frame.extended else 0x7FF
    if not 0 <= frame.can_id <= limit:
        raise BusError(f"CAN identifier {frame.can_id:X}h is outside 0..{limit:X}h")
    if not isinstance(frame.data, bytes):
        raise BusError(f"the data of a frame must be bytes, not {type(frame.data).__name__}")
    if frame.remote:
        raise BusError("CAN FD has no remote frames")
    if not 0 <= frame.dlc <= 15 or FD_LENGTHS[frame.dlc] != len(frame.data):
        allowed = ", ".join(map(str, FD_LENGTHS[9:]))
        raise BusError(f"a CAN FD frame carries 0 to 8, {allowed} bytes, not {len(frame.data)}")


def arbitration_key(frame: CanFrame) -> int:
    """Return the arbitration field as `fieldbus.can.timing.arbitration_key` does: that of a data frame."""
    if frame.extended:
        base, extension = frame.can_id >> 18, frame.can_id & 0x3FFFF
        return ((base << 2 | 0b11) << 18 | extension) << 1
    return frame.can_id << 21


def _header(frame: CanFrame) -> tuple[int, int]:
    """Return value and number of the bits from SOF to DLC."""
    control = (0b10 << 1 | frame.brs) << 5 | frame.esi << 4 | frame.dlc  # FDF, res, BRS, ESI, DLC
    if frame.extended:
        base, extension = frame.can_id >> 18, frame.can_id & 0x3FFFF
        return ((base << 2 | 0b11) << 18 | extension) << 9 | control, EXTENDED_HEADER
    return frame.can_id << 10 | control, STANDARD_HEADER


class FdBits:
    """The bits of a CAN FD frame from SOF to the end of the checksum.

    Args:
        frame: The frame.

    Raises:
        BusError: It is no CAN FD frame.

    """

    __slots__ = ("bits", "data_end", "dynamic", "fixed", "places")

    def __init__(self, frame: CanFrame) -> None:
        check_fd(frame)
        value, width = _header(frame)
        for byte in frame.data:
            value, width = value << 8 | byte, width + 8
        self.bits: Final[list[int]] = []
        """0 dominant, 1 recessive, stuff bits included."""
        self.places: Final[list[int]] = []
        """Where the bits without stuff bits are: header, data, stuff count, checksum."""
        self.dynamic: Final[list[int]] = []
        """Where the stuff bits up to the end of the data are."""
        self.fixed: Final[list[int]] = []
        """Where the stuff bits of the CRC field are."""
        last, run = -1, 0
        for shift in range(width - 1, -1, -1):
            if run == _RUN:
                last, run = 1 - last, 1
                self.dynamic.append(len(self.bits))
                self.bits.append(last)
            bit = value >> shift & 1
            last, run = bit, run + 1 if bit == last else 1
            self.places.append(len(self.bits))
            self.bits.append(bit)
        # Five equal bits at the end are followed by the first fixed stuff bit, not by one more.
        self.data_end: Final = len(self.bits)
        """Number of bits up to the end of the data."""
        count = len(self.dynamic) & 7
        gray = count ^ count >> 1
        checked = gray << 1 | gray.bit_count() & 1
        crc_bits, polynomial = _CRCS[len(frame.data) > _SHORT]
        crc = 1 << crc_bits - 1
        for bit in (*self.bits, *(checked >> shift & 1 for shift in (3, 2, 1, 0))):
            top = crc >> crc_bits - 1 ^ bit
            crc = (crc << 1 ^ polynomial if top else crc << 1) & (1 << crc_bits) - 1
        tail, length = checked << crc_bits | crc, _STUFF_COUNT_BITS + crc_bits
        for number in range(length):
            if number % _FIXED_EVERY == 0:
                self.fixed.append(len(self.bits))
                self.bits.append(1 - self.bits[-1])
            self.places.append(len(self.bits))
            self.bits.append(tail >> length - 1 - number & 1)


@lru_cache(maxsize=512)
def fd_bits(frame: CanFrame) -> tuple[int, int]:
    """Return how many bits a frame has with the nominal rate, and with that of the data phase.

    From SOF to the third intermission bit; without BRS all are nominal.

    Raises:
        BusError: It is no CAN FD frame.

    """
    wire = FdBits(frame)
    header = EXTENDED_HEADER if frame.extended else STANDARD_HEADER
    first_fast = wire.places[header - _FAST_HEADER_BITS]
    fast = len(wire.bits) - first_fast + 1  # with the CRC delimiter
    nominal = first_fast + _NOMINAL_TAIL
    return (nominal, fast) if frame.brs else (nominal + fast, 0)


def fd_time_ns(frame: CanFrame, bitrate: int, data_bitrate: int) -> int:
    """Return the time that a frame occupies, intermission included, ns.

    Raises:
        BusError: It is no CAN FD frame.

    """
    nominal, fast = fd_bits(frame)
    return nominal * S // bitrate + fast * S // data_bitrate


def wire_bits(frame: CanFrame, bitrate: int | None, data_bitrate: int | None) -> int:
    """Return the bits of a frame of either kind, those of the data phase as bits of the nominal rate.

    Args:
        frame: The frame.
        bitrate: bit/s; None: not known, every bit counts as one.
        data_bitrate: bit/s of the data phase, likewise.

    Raises:
        BusError: It is no CAN frame.

    """
    if not frame.fd:
        return frame_bits(frame)
    nominal, fast = fd_bits(frame)
    return nominal + (fast if not bitrate or not data_bitrate else round(fast * bitrate / data_bitrate))


def fast_bits(frame: CanFrame, wire: FdBits) -> range:
    """Return which bits have the data bit rate, the CRC delimiter behind the last one included."""
    if not frame.brs:
        return range(0)
    header = EXTENDED_HEADER if frame.extended else STANDARD_HEADER
    return range(wire.places[header - _FAST_HEADER_BITS], len(wire.bits) + 1)
