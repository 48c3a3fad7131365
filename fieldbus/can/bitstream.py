"""A CAN frame bit by bit: which field every bit of the wire belongs to,
and which bits are stuff bits.

For what happens inside of a frame; the length alone is `fieldbus.can.timing.frame_bits`, which is faster.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from fieldbus.can.fd import EXTENDED_FDF, EXTENDED_HEADER, STANDARD_FDF, STANDARD_HEADER, FdBits, fast_bits
from fieldbus.can.frame import FD_LENGTHS, CanFrame
from fieldbus.can.timing import CRC_POLYNOMIAL, INTERMISSION_BITS, TAIL_BITS, wire_bits
from fieldbus.errors import BusError

_STANDARD: Final = (("sof", 1), ("id", 11), ("rtr", 1), ("ide", 1), ("reserved", 1), ("dlc", 4))
_EXTENDED: Final = (
    ("sof", 1),
    ("id", 11),
    ("srr", 1),
    ("ide", 1),
    ("id_extension", 18),
    ("rtr", 1),
    ("reserved", 2),
    ("dlc", 4),
)
_FD_STANDARD: Final = (
    ("sof", 1), ("id", 11), ("rtr", 1), ("ide", 1), ("fdf", 1), ("reserved", 1), ("brs", 1), ("esi", 1),
    ("dlc", 4),
)  # fmt: skip
_FD_EXTENDED: Final = (
    ("sof", 1), ("id", 11), ("srr", 1), ("ide", 1), ("id_extension", 18), ("rtr", 1), ("fdf", 1),
    ("reserved", 1), ("brs", 1), ("esi", 1), ("dlc", 4),
)  # fmt: skip
_TAIL: Final = (
    ("crc_delimiter", 1),
    ("ack_slot", 1),
    ("ack_delimiter", 1),
    ("eof", 7),
    ("intermission", INTERMISSION_BITS),
)

FIELDS: Final = (
    "sof", "id", "srr", "ide", "id_extension", "rtr", "fdf", "reserved", "brs", "esi", "dlc", "data",
    "stuff_count", "crc", "stuff", "crc_delimiter", "ack_slot", "ack_delimiter", "eof", "intermission",
)  # fmt: skip
"""The fields that a bit error can be aimed at, in the order of the wire; `stuff` counts
the stuff bits (CANP-001..008). `fdf`, `brs`, `esi` and `stuff_count` are of CAN FD (CANP-073, CANP-075).
"""

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


class FrameImage:
    """The bits of a frame on the wire, from SOF to the last bit of the stuffed
    region, and where its fields are.

    Args:
        frame: The frame.

    """

    __slots__ = ("arbitration_end", "bits", "data_end", "fast", "fields", "fixed", "places", "stuff")

    def __init__(self, frame: CanFrame) -> None:
        if frame.fd:
            self._of_fd(frame)
            return
        self.fast: range = range(0)
        """Bits of the data bit rate."""
        self.fixed: frozenset[int] = frozenset()
        """Positions of the stuff bits of the CRC field of CAN FD."""
        self.data_end = 0
        """CAN FD: number of bits up to the end of the data."""
        self.bits: list[int] = wire_bits(frame)
        """0 dominant, 1 recessive, stuff bits included."""
        fields = [name for name, width in (_EXTENDED if frame.extended else _STANDARD) for _ in range(width)]
        fields += ["data"] * (8 * len(frame.data)) + ["crc"] * 15
        places: dict[str, list[int]] = {name: [] for name in FIELDS}
        stuff: list[int] = []
        along: list[str] = []
        last, run, taken = -1, 0, 0
        for index, bit in enumerate(self.bits):
            if run == 5:
                stuff.append(index)
                run = 1
            else:
                places[fields[taken]].append(index)
                taken += 1
                run = run + 1 if bit == last else 1
            along.append(fields[taken - 1])
            last = bit
        places["stuff"] = stuff
        self.fields: tuple[str, ...] = tuple(along)
        """Name of the field of every bit; a stuff bit belongs to that of the bit before."""
        index = len(self.bits)
        for name, width in _TAIL:
            places[name] = list(range(index, index + width))
            index += width
        assert index == len(self.bits) + TAIL_BITS + INTERMISSION_BITS
        self.places: dict[str, list[int]] = places
        """Positions on the wire by field."""
        self.stuff = frozenset(stuff)
        self.arbitration_end: int = places["rtr"][0] + 1
        """Number of bits from SOF to RTR: who reads dominant for recessive
        before it has lost the arbitration.
        """

    def _of_fd(self, frame: CanFrame) -> None:
        wire = FdBits(frame)
        self.bits = wire.bits
        self.fast = fast_bits(frame, wire)
        self.fixed = frozenset(wire.fixed)
        self.data_end = wire.data_end
        names = [
            name for name, width in (_FD_EXTENDED if frame.extended else _FD_STANDARD) for _ in range(width)
        ]
        names += ["data"] * (8 * len(frame.data)) + ["stuff_count"] * 4
        names += ["crc"] * (len(wire.places) - len(names))
        places: dict[str, list[int]] = {name: [] for name in FIELDS}
        along = [""] * len(wire.bits)
        for name, index in zip(names, wire.places, strict=True):
            places[name].append(index)
            along[index] = name
        for index, name in enumerate(along):
            along[index] = name or along[index - 1]
        places["stuff"] = sorted((*wire.dynamic, *wire.fixed))
        index = len(wire.bits)
        for name, width in _TAIL:
            places[name] = list(range(index, index + width))
            index += width
        self.fields = tuple(along)
        self.places = places
        self.stuff = frozenset(wire.dynamic)
        self.arbitration_end = places["rtr"][0] + 1

    def position(self, field: str, bit: int) -> int | None:
        """Return the position on the wire of bit `bit` of `field` (-1: its last); None when this frame has no
        such bit.
        """
        places = self.places[field]
        return places[bit] if -len(places) <= bit < len(places) else None


@lru_cache(maxsize=512)
def image_of(frame: CanFrame) -> FrameImage:
    """Return the image of `frame`.

    Raises:
        BusError: It is no CAN frame.

    """
    return FrameImage(frame)


class FrameParser:
    """Takes the bits from SOF to CRC without the stuff bits."""

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
        self.fd = False
        """Whether it is a frame of CAN FD; `total` then ends with the data."""
        self._value = 0

    def at_fdf(self) -> bool:
        """Return whether the bit taken last is that where a frame of CAN FD is recessive."""
        return self.taken == (EXTENDED_FDF if self.header == _EXTENDED_HEADER else STANDARD_FDF)

    def begin_fd(self) -> None:
        """Take the frame for one of CAN FD: the bit taken last was FDF."""
        self.fd = True
        self.header = EXTENDED_HEADER if self.header == _EXTENDED_HEADER else STANDARD_HEADER

    def parse_fd(self, bit: int) -> None:
        """Take a bit of a CAN FD frame behind FDF, without stuff bits, up to the end of the data."""
        self._value = value = self._value << 1 | bit
        self.taken = taken = self.taken + 1
        if taken == self.header:
            self.total = taken + 8 * FD_LENGTHS[value & 0xF]

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
        if self.fd:
            widths = _FD_EXTENDED if self.header == EXTENDED_HEADER else _FD_STANDARD
            names = [name for name, width in widths for _ in range(width)]
            return names[self.taken - 1] if self.taken <= len(names) else "data"
        extended = self.header == _EXTENDED_HEADER
        for name, end in _EXTENDED_ENDS if extended else _STANDARD_ENDS:
            if self.taken <= end:
                return name
        return "data" if self.taken <= self.total - CRC_BITS else "crc"

    def received_frame(self) -> CanFrame:
        """Return what has been received."""
        if self.fd:
            return self._received_fd()
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

    def _received_fd(self) -> CanFrame:
        data_bits = self.total - self.header
        value = self._value
        data = (value & (1 << data_bits) - 1).to_bytes(data_bits // 8, "big")
        value >>= data_bits
        dlc, esi, brs = value & 0xF, bool(value >> 4 & 1), bool(value >> 5 & 1)
        if self.header == EXTENDED_HEADER:
            can_id = (value >> 29 & 0x7FF) << 18 | value >> 9 & 0x3FFFF
            return CanFrame(can_id, data, extended=True, dlc=dlc, fd=True, brs=brs, esi=esi)
        return CanFrame(value >> 10 & 0x7FF, data, dlc=dlc, fd=True, brs=brs, esi=esi)


class BitError:
    """One wrong bit in a frame: where, and who reads it wrongly.

    Args:
        field: One of `FIELDS`.
        bit: Number of the bit in the field from 0 on, MSB first; -1 is the last one.
        nodes: Names of the nodes that read the bit inverted; None: all, the transmitter included.

    Raises:
        BusError: There is no such field, or no field has such a bit.

    """

    __slots__ = ("bit", "field", "nodes")

    def __init__(self, field: str = "crc", bit: int = -1, nodes: frozenset[str] | None = None) -> None:
        if field not in FIELDS:
            raise BusError(f"{field!r} is no field of a frame; fields: {', '.join(FIELDS)}")
        if not -64 <= bit < 64:
            raise BusError(f"bit {bit} of a field is outside -64..63")
        self.field: Final = field
        self.bit: Final = bit
        self.nodes: Final = nodes

    def __repr__(self) -> str:
        who = "all" if self.nodes is None else ", ".join(sorted(self.nodes))
        return f"<BitError {self.field} bit {self.bit} for {who}>"
