"""Exact length of a classical CAN frame on the wire, and its rank in arbitration.

The length counts every bit from the start of frame to the end of the intermission, with the stuff bits that
this very frame has (CANP-014, -015, -017), so that bus times are those of a real segment and not an average.

A frame costs about a microsecond when it is new and nothing when it is sent again: the header is looked up
whole, data and checksum go through tables, byte by byte, and the result is kept in the frame.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.errors import BusError

INTERMISSION_BITS: Final = 3
"""Recessive bits between two frames (CANP-008); part of `frame_bits`."""
TAIL_BITS: Final = 10
"""Bits from the CRC delimiter to the end of frame, never stuffed: CRC delimiter, ACK slot and delimiter, EOF.
"""

CRC_POLYNOMIAL: Final = 0x4599
"""Generator of the 15-bit checksum without its leading term (CANP-012)."""

# The wire is in one of eight states, the run of equal bits that it shows so far, and so many stuff bits have
# been inserted behind the header: state + 8 * stuff bits. For each next byte the stuff tables have a row with
# what comes after it; behind these 256 rows there are 128 for 7 bits more, the rest of a checksum.
_STATES: Final = 8
_MOST_STUFFED: Final = 26
"""More stuff bits than eight bytes and a checksum can have, which is 20."""
_Run = tuple[int, int]  # last bit, how many of it in a row (1..4)

_RUNS: Final[tuple[_Run, ...]] = tuple((bit, length) for bit in (0, 1) for length in (1, 2, 3, 4))


def _advance(run: _Run, value: int, width: int) -> tuple[_Run, int]:
    """Return the run and the number of stuff bits after the `width` bits of `value`, MSB first."""
    last, length = run
    stuffed = 0
    for shift in range(width - 1, -1, -1):
        bit = value >> shift & 1
        length = length + 1 if bit == last else 1
        last = bit
        if length == 5:
            stuffed += 1
            last, length = 1 - bit, 1
    return (last, length), stuffed


def _build_stuff_tables() -> list[bytes]:
    nibbles = {run: [_advance(run, value, 4) for value in range(16)] for run in _RUNS}
    after: list[list[int]] = []  # by value of the byte, then by state
    for value in range(256):
        row = []
        for run in _RUNS:
            high, high_stuffed = nibbles[run][value >> 4]
            low, low_stuffed = nibbles[high][value & 15]
            row.append(_RUNS.index(low) + _STATES * (high_stuffed + low_stuffed))
        after.append(row)
    after += [[_STATES * _advance(run, value, 7)[1] for run in _RUNS] for value in range(128)]
    more = range(0, _STATES * _MOST_STUFFED, _STATES)
    return [bytes(one + before for before in more for one in row) for row in after]


def _build_crc_table() -> list[int]:
    table = []
    for byte in range(256):
        crc = byte << 7
        for _ in range(8):
            crc = crc << 1 ^ CRC_POLYNOMIAL if crc & 0x4000 else crc << 1
            crc &= 0x7FFF
        table.append(crc)
    return table


def _build_position_tables() -> list[list[int]]:
    """Return, by number of data bytes that follow, what a data byte adds to
    the checksum (which is linear).
    """
    tables = [_CRC]
    for _ in range(7):
        tables.append([crc << 8 & 0x7FFF ^ _CRC[crc >> 7] for crc in tables[-1]])
    return tables


_STUFF: Final = _build_stuff_tables()
_CRC: Final = _build_crc_table()
_POSITIONS: Final = _build_position_tables()
_P0: Final = _POSITIONS[0]
_P1: Final = _POSITIONS[1]
_P2: Final = _POSITIONS[2]
_P3: Final = _POSITIONS[3]
_P4: Final = _POSITIONS[4]
_P5: Final = _POSITIONS[5]
_P6: Final = _POSITIONS[6]
_P7: Final = _POSITIONS[7]


def _header_bits(can_id: int, extended: bool, remote: bool, dlc: int) -> tuple[int, int]:
    """Return value and number of the bits from SOF to DLC (CANP-001..003)."""
    if extended:
        base, extension = can_id >> 18, can_id & 0x3FFFF
        # SRR and IDE are recessive, then RTR, r1 and r0 follow the identifier's extension.
        return (((base << 2 | 0b11) << 18 | extension) << 1 | remote) << 6 | dlc, 39
    return (can_id << 1 | remote) << 6 | dlc, 19


@lru_cache(maxsize=4096)
def _header(can_id: int, extended: bool, remote: bool, dlc: int) -> tuple[int, int, int, int, int]:
    """Return arbitration key, CRC after the header and that 8 zero bytes later,
    state of the wire, bits without data.
    """
    limit = 0x1FFFFFFF if extended else 0x7FF
    if not 0 <= can_id <= limit:
        raise BusError(f"CAN identifier {can_id:X}h is outside 0..{limit:X}h")
    if not 0 <= dlc <= 15:
        raise BusError(f"DLC {dlc} is outside 0..15")
    value, width = _header_bits(can_id, extended, remote, dlc)
    # The checksum starts at 0, so leading zero bits (SOF is one) do not change it: pad to whole bytes.
    crc = 0
    for byte in value.to_bytes(5, "big"):
        crc = crc << 8 & 0x7FFF ^ _CRC[crc >> 7 ^ byte]
    crc_8 = crc
    for _ in range(8):
        crc_8 = crc_8 << 8 & 0x7FFF ^ _CRC[crc_8 >> 7]
    run, stuffed = _advance((0, 1), value, width - 1)  # behind SOF
    # The arbitration field, left-aligned in 32 bits: base identifier, RTR or SRR, IDE, extension, RTR.
    key = value >> 6 if extended else (value >> 6) << 20
    return key, crc, crc_8, _RUNS.index(run), (67 if extended else 47) + stuffed


def _bits_of_eight(data: bytes, crc: int, wire: int, bits: int) -> int:
    """Return the bits of a frame with eight bytes, from what `_header` says; twice as fast as a loop."""
    # Compiled, an index costs less than the iterator that unpacking makes.
    a, b, c, d, e, f, g, h = data[0], data[1], data[2], data[3], data[4], data[5], data[6], data[7]
    check = crc ^ _P7[a] ^ _P6[b] ^ _P5[c] ^ _P4[d] ^ _P3[e] ^ _P2[f] ^ _P1[g] ^ _P0[h]
    table = _STUFF
    wire = table[b][table[a][wire]]
    wire = table[d][table[c][wire]]
    wire = table[f][table[e][wire]]
    wire = table[h][table[g][wire]]
    return bits + 64 + (table[256 + (check & 0x7F)][table[check >> 7][wire]] >> 3)


def _bits_of_seven(data: bytes, crc: int, wire: int, bits: int) -> int:
    """Return the same of a frame with seven bytes: control word, velocity and mode."""
    a, b, c, d, e, f, g = data[0], data[1], data[2], data[3], data[4], data[5], data[6]
    check = crc ^ _P6[a] ^ _P5[b] ^ _P4[c] ^ _P3[d] ^ _P2[e] ^ _P1[f] ^ _P0[g]
    table = _STUFF
    wire = table[b][table[a][wire]]
    wire = table[d][table[c][wire]]
    wire = table[g][table[f][table[e][wire]]]
    return bits + 56 + (table[256 + (check & 0x7F)][table[check >> 7][wire]] >> 3)


def _bits_of_few(data: bytes, crc: int, wire: int, bits: int) -> int:
    """Return the bits of a frame with fewer bytes, whose own bits are counted already."""
    table, checks = _STUFF, _CRC
    for byte in data:
        crc = crc << 8 & 0x7FFF ^ checks[crc >> 7 ^ byte]
        wire = table[byte][wire]
    return bits + (table[256 + (crc & 0x7F)][table[crc >> 7][wire]] >> 3)


def _timing(can_id: int, data: bytes, extended: bool, remote: bool, dlc: int) -> tuple[int, int]:
    key, crc, crc_8, stuff, bits = _header(can_id, extended, remote, dlc)
    length = len(data)
    if length == dlc == 8 and not remote:
        return key, _bits_of_eight(data, crc_8, stuff, bits)
    if length != (0 if remote else min(dlc, 8)):
        raise BusError(
            f"a {'remote' if remote else 'data'} frame with DLC {dlc} carries "
            f"{0 if remote else min(dlc, 8)} data bytes, not {length}"
        )
    return key, _bits_of_few(data, crc, stuff, bits + 8 * length)


timing_of = lru_cache(maxsize=1024)(_timing)
"""Return `(arbitration key, bits)` of the frame with these fields; see `arbitration_key` and `frame_bits`.

Raises `BusError` if the fields do not make a classical CAN frame.
"""


def note_timing(frame: CanFrame) -> tuple[int, int]:
    """Return `timing_of` a frame, and keep it in the frame.

    Raises:
        BusError: It is no classical CAN frame.

    """
    if not isinstance(frame.data, bytes):
        raise BusError(f"the data of a frame must be bytes, not {type(frame.data).__name__}")
    frame.key, frame.bits = timing = _timing(
        frame.can_id, frame.data, frame.extended, frame.remote, frame.dlc
    )
    return timing


class FrameMaker:
    """Makes data frames with one 11-bit identifier, and the same frame again as
    long as the data are the same.

    Args:
        can_id: 0..7FFh.

    Raises:
        BusError: The identifier is out of range.

    """

    def __init__(self, can_id: int) -> None:
        self.can_id: Final = can_id
        self.last = CanFrame(can_id)
        """The frame that was made last."""
        self._dlc = 8
        self._key, _, self._crc, self._stuff, self._bits = _header(can_id, False, False, 8)

    def _prepare(self, dlc: int) -> None:
        """Be ready for frames with so many bytes: the next ones have as many, as a rule."""
        self._dlc = dlc
        self._key, crc, crc_8, self._stuff, bits = _header(self.can_id, False, False, dlc)
        if dlc == 8:
            self._crc, self._bits = crc_8, bits
        elif dlc == 7:
            for _ in range(7):
                crc = crc << 8 & 0x7FFF ^ _CRC[crc >> 7]
            self._crc, self._bits = crc, bits
        else:
            self._crc, self._bits = crc, bits + 8 * dlc

    def make(self, data: bytes) -> CanFrame:
        """Return a frame with `data`, 0 to 8 bytes."""
        frame = self.last
        if frame.data != data:
            self.last = frame = CanFrame(self.can_id, data)
            dlc = frame.dlc
            if dlc != self._dlc:
                self._prepare(dlc)
            if dlc == 8:
                bits = _bits_of_eight(data, self._crc, self._stuff, self._bits)
            elif dlc == 7:
                bits = _bits_of_seven(data, self._crc, self._stuff, self._bits)
            else:
                bits = _bits_of_few(data, self._crc, self._stuff, self._bits)
            frame.key = self._key
            frame.bits = bits
        return frame


def frame_bits(frame: CanFrame) -> int:
    """Return the bits that `frame` occupies on the wire, from SOF to the third
    intermission bit (CANP-015, -017).

    Raises:
        BusError: Identifier, DLC or length of the data do not make a classical CAN frame.

    """
    return timing_of(frame.can_id, bytes(frame.data), frame.extended, frame.remote, frame.dlc)[1]


def arbitration_key(frame: CanFrame) -> int:
    """Return the arbitration field as a number: of two frames the one with the
    lower number wins (CANP-027, -028).

    Raises:
        BusError: As `frame_bits`.

    """
    return timing_of(frame.can_id, bytes(frame.data), frame.extended, frame.remote, frame.dlc)[0]


def frame_time_ns(frame: CanFrame, bitrate: int) -> int:
    """Return the time that `frame` occupies at `bitrate` (bit/s), intermission included, ns."""
    return frame_bits(frame) * 1_000_000_000 // bitrate


def worst_case_bits(data_length: int, *, extended: bool = False) -> int:
    """Return the longest that a frame with `data_length` bytes (0..8) can become,
    intermission included (CANP-016).
    """
    if not 0 <= data_length <= 8:
        raise BusError(f"data length {data_length} is outside 0..8")
    stuffed_region = (54 if extended else 34) + 8 * data_length
    return stuffed_region + TAIL_BITS + INTERMISSION_BITS + (stuffed_region - 1) // 4


def wire_bits(frame: CanFrame) -> list[int]:
    """Return the bits of `frame` as sent, 0 dominant, from SOF to the last bit of the stuffed region.

    For what happens inside of a frame (collisions, errors); the length alone is
    `frame_bits`, which is faster.
    """
    bits = frame_bits(frame)  # validates
    value, width = _header_bits(frame.can_id, frame.extended, frame.remote, frame.dlc)
    for byte in frame.data:
        value, width = value << 8 | byte, width + 8
    crc = 0
    for byte in value.to_bytes(16, "big"):
        crc = crc << 8 & 0x7FFF ^ _CRC[crc >> 7 ^ byte]
    value, width = value << 15 | crc, width + 15
    wire: list[int] = []
    last, length = -1, 0
    for shift in range(width - 1, -1, -1):
        bit = value >> shift & 1
        length = length + 1 if bit == last else 1
        last = bit
        wire.append(bit)
        if length == 5:
            last, length = 1 - bit, 1
            wire.append(last)
    assert len(wire) + TAIL_BITS + INTERMISSION_BITS == bits
    return wire
