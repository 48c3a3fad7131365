"""The data of a device as Modbus sees it: coils, discrete inputs, holding and input
registers, in blocks with hooks.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from typing import Final

from fieldbus.errors import ConfigurationError
from fieldbus.modbus.codes import ExceptionCode
from fieldbus.modbus.errors import ModbusError

_ADDRESSES: Final = 65536

ReadHook = Callable[[int, int], Sequence[int]]
"""Called with the offset in the block and a quantity; returns that many values."""
WriteHook = Callable[[int, Sequence[int]], object]
"""Called with the offset in the block and the new values, before they are stored."""


class Area(Enum):
    """The four kinds of data."""

    COILS = "coils"
    DISCRETE_INPUTS = "discrete inputs"
    HOLDING_REGISTERS = "holding registers"
    INPUT_REGISTERS = "input registers"

    __hash__ = object.__hash__  # that of enumerations is a call in Python, for every request


class WordOrder(Enum):
    """Which half of a 32-bit value comes first (MODB-033)."""

    HIGH_FIRST = "high_first"
    LOW_FIRST = "low_first"


class RegisterRefusal(ModbusError):  # noqa: N818 - what happens, not what is wrong with the program
    """Raised by a hook to answer with an exception code.

    Args:
        code: The exception code; default 04.

    """

    def __init__(self, code: int = ExceptionCode.SERVER_DEVICE_FAILURE) -> None:
        super().__init__(f"exception {code:02X}h")
        self.code = code


class NoAnswer(ModbusError):  # noqa: N818 - what happens, not what is wrong with the program
    """Raised by a hook to leave the request unanswered."""

    def __init__(self) -> None:
        super().__init__("the request stays unanswered")


class Block:
    """A run of registers or coils.

    Args:
        start: First address on the wire.
        count: Number of registers or coils, at least 1.
        name: For messages and logs.
        writable: Whether it may be written over the bus.
        readable: Whether it may be read over the bus.
        minimum: Smallest value that may be written; negative values make the registers signed.
        maximum: Largest value that may be written.
        read: Called for the values before they are read.
        write: Called with values before they are stored; raises `RegisterRefusal` to refuse them.

    """

    def __init__(
        self,
        start: int,
        count: int,
        *,
        name: str = "",
        writable: bool = True,
        readable: bool = True,
        minimum: int = 0,
        maximum: int = 0xFFFF,
        read: ReadHook | None = None,
        write: WriteHook | None = None,
    ) -> None:
        if not 0 <= start < _ADDRESSES:
            raise ConfigurationError(f"block {name!r}, start", start, f"0..{_ADDRESSES - 1}")
        if not 1 <= count <= _ADDRESSES - start:
            raise ConfigurationError(f"block {name!r}, count", count, f"1..{_ADDRESSES - start}")
        if minimum > maximum or minimum < -0x8000 or maximum > (0x7FFF if minimum < 0 else 0xFFFF):
            raise ConfigurationError(
                f"block {name!r}, limits", (minimum, maximum), "0..65535 or -32768..32767"
            )
        self.start = start
        self.count = count
        self.name = name
        self.writable = writable
        self.readable = readable
        self.minimum = minimum
        self.maximum = maximum
        self.read = read
        self.write = write
        self.values = [0] * count
        """What is stored, as the unsigned words of the bus."""

    @property
    def unlimited(self) -> bool:
        """Whether every word is within the limits."""
        return self.minimum == 0 and self.maximum == 0xFFFF

    def accepts(self, value: int) -> bool:
        """Return whether a word that comes from the bus is within the limits."""
        if self.minimum < 0 and value & 0x8000:
            value -= 0x10000
        return self.minimum <= value <= self.maximum


class RegisterMap:
    """All that a device shows over Modbus. An address that nothing was added for does not exist.

    Args:
        name: For messages.
        word_order: Of 32-bit values in two registers.
        refused: Exception code for writing what is read-only or a value that is out of its limits (PD-337).
        partial_writes: Whether a write that is refused for one register stores the valid ones before and
            behind it all the same (PD-293).

    """

    def __init__(
        self,
        name: str = "",
        *,
        word_order: WordOrder = WordOrder.HIGH_FIRST,
        refused: ExceptionCode = ExceptionCode.SERVER_DEVICE_FAILURE,
        partial_writes: bool = False,
    ) -> None:
        self.name = name
        self.word_order = word_order
        self.refused = refused
        self.partial_writes = partial_writes
        self._blocks: dict[Area, list[Block]] = {area: [] for area in Area}
        self._starts: dict[Area, list[int]] = {area: [] for area in Area}

    def add(self, area: Area, block: Block) -> Block:
        """Add a block and return it.

        Raises:
            ConfigurationError: It overlaps another one.

        """
        starts, blocks = self._starts[area], self._blocks[area]
        at = bisect_right(starts, block.start)
        before = blocks[at - 1] if at else None
        behind = blocks[at] if at < len(blocks) else None
        for other in (before, behind):
            if other and other.start < block.start + block.count and block.start < other.start + other.count:
                raise ConfigurationError(
                    f"{self.name or 'register map'}, {area.value}, block {block.name!r}",
                    f"{block.start}..{block.start + block.count - 1}",
                    f"addresses that {other.name!r} ({other.start}..{other.start + other.count - 1}) "
                    f"leaves free",
                )
        starts.insert(at, block.start)
        blocks.insert(at, block)
        return block

    def blocks(self, area: Area) -> tuple[Block, ...]:
        """Return the blocks of an area by address."""
        return tuple(self._blocks[area])

    def _pieces(self, area: Area, address: int, count: int) -> list[tuple[Block, int, int]] | None:
        """Return blocks with offset and quantity that cover a range; None
        where one address does not exist.
        """
        blocks = self._blocks[area]
        at = bisect_right(self._starts[area], address) - 1
        pieces = []
        while count:
            if at < 0 or at >= len(blocks):
                return None
            block = blocks[at]
            offset = address - block.start
            if not 0 <= offset < block.count:
                return None
            taken = min(count, block.count - offset)
            pieces.append((block, offset, taken))
            address += taken
            count -= taken
            at += 1
        return pieces

    def exists(self, area: Area, address: int, count: int) -> bool:
        """Return whether every address of a range exists."""
        return self._pieces(area, address, count) is not None

    def read(self, area: Area, address: int, count: int) -> tuple[int, ...] | ExceptionCode:
        """Return values as the bus asks for them, or the exception code."""
        pieces = self._pieces(area, address, count)
        if pieces is None:
            return ExceptionCode.ILLEGAL_DATA_ADDRESS
        values: list[int] = []
        for block, offset, taken in pieces:
            if not block.readable:
                return ExceptionCode.ILLEGAL_DATA_VALUE
            if block.read is not None:
                try:
                    block.values[offset : offset + taken] = _words(block.read(offset, taken), taken, block)
                except RegisterRefusal as refusal:
                    return _code(refusal.code)
            values += block.values[offset : offset + taken]
        return tuple(values)

    def write(self, area: Area, address: int, values: Sequence[int]) -> ExceptionCode | None:
        """Store values as the bus asks for it; return the exception code or None."""
        pieces = self._pieces(area, address, len(values))
        if pieces is None:
            return ExceptionCode.ILLEGAL_DATA_ADDRESS
        if self.partial_writes:
            return self._write_what_can_be(pieces, values)
        at = 0
        for block, _, taken in pieces:
            if not block.writable or not (
                block.unlimited or all(map(block.accepts, values[at : at + taken]))
            ):
                return self.refused
            at += taken
        at = 0
        for block, offset, taken in pieces:
            code = self._store(block, offset, values[at : at + taken])
            if code is not None:
                return code
            at += taken
        return None

    def _write_what_can_be(
        self, pieces: list[tuple[Block, int, int]], values: Sequence[int]
    ) -> ExceptionCode | None:
        first: ExceptionCode | None = None
        at = 0
        for block, offset, taken in pieces:
            for start, run in _runs(block, values[at : at + taken]):
                code = self.refused if run is None else self._store(block, offset + start, run)
                first = first or code
            at += taken
        return first

    @staticmethod
    def _store(block: Block, offset: int, values: Sequence[int]) -> ExceptionCode | None:
        if block.write is not None:
            try:
                block.write(offset, values)
            except RegisterRefusal as refusal:
                return _code(refusal.code)
        block.values[offset : offset + len(values)] = values
        return None

    # For the device behind the map: no hooks, no limits.

    def get(self, area: Area, address: int) -> int:
        """Return the stored word or bit.

        Raises:
            ModbusError: The address does not exist.

        """
        block, offset = self._place(area, address)
        return block.values[offset]

    def set(self, area: Area, address: int, *values: int) -> None:
        """Store words or bits; negative words are stored as their two's complement.

        Raises:
            ModbusError: An address does not exist.

        """
        for number, value in enumerate(values):
            block, offset = self._place(area, address + number)
            block.values[offset] = value & 0xFFFF

    def get_long(self, area: Area, address: int, *, signed: bool = False) -> int:
        """Return the 32-bit value in two registers, in the word order of the device."""
        first, second = self.get(area, address), self.get(area, address + 1)
        high, low = (first, second) if self.word_order is WordOrder.HIGH_FIRST else (second, first)
        value = high << 16 | low
        return value - (1 << 32) if signed and value & 1 << 31 else value

    def set_long(self, area: Area, address: int, value: int) -> None:
        """Store a 32-bit value in two registers, in the word order of the device."""
        high, low = value >> 16 & 0xFFFF, value & 0xFFFF
        self.set(area, address, *((high, low) if self.word_order is WordOrder.HIGH_FIRST else (low, high)))

    def _place(self, area: Area, address: int) -> tuple[Block, int]:
        pieces = self._pieces(area, address, 1)
        if pieces is None:
            raise ModbusError(f"{self.name or 'register map'}: there is no {area.value} {address}")
        return pieces[0][0], pieces[0][1]


def _words(values: Sequence[int], count: int, block: Block) -> list[int]:
    words = [value & 0xFFFF for value in values]
    if len(words) != count:
        raise ModbusError(f"block {block.name!r}: its read hook gave {len(words)} values, not {count}")
    return words


def _code(code: int) -> ExceptionCode:
    return (
        ExceptionCode(code)
        if code in ExceptionCode._value2member_map_
        else ExceptionCode.SERVER_DEVICE_FAILURE
    )


def _runs(block: Block, values: Sequence[int]) -> Iterator[tuple[int, Sequence[int] | None]]:
    """Yield the runs of acceptable values with their offset, and None for each value that is refused."""
    if block.writable and block.unlimited:
        yield 0, values
        return
    start = 0
    for number, value in enumerate(values):
        if not (block.writable and block.accepts(value)):
            if number > start:
                yield start, values[start:number]
            yield number, None
            start = number + 1
    if start < len(values):
        yield start, values[start:]
