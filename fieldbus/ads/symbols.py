"""Memory of an ADS device and the symbols that name parts of it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from struct import Struct, calcsize
from typing import Final

from fieldbus.ads.codes import BIG, TYPES, AdsError, Group

_ENTRY: Final = Struct("<IIIIIIHHH")
_TYPE_ENTRY: Final = Struct("<IIIIIIIIHHHHH")
_IS_TYPE: Final = 0x1
_IS_MEMBER: Final = 0x2
_TYPE_VERSION: Final = 1
_ALIGN: Final = 8


@dataclass(frozen=True)
class Area:
    """A piece of memory.

    Args:
        size: Its bytes.
        read: Returns them.
        write: Takes them all, some of them changed, and returns an error code, 0 for none; None: they cannot
            be written.

    """

    size: int
    read: Callable[[], bytes]
    write: Callable[[bytes], int] | None = None


@dataclass(frozen=True)
class Symbol:
    """A name for a part of the memory."""

    name: str
    type_name: str
    offset: int
    size: int
    comment: str = ""

    @property
    def type_number(self) -> int:
        """`ADST_...` of its type; that of a structure where the type is none of IEC 61131-3."""
        known = TYPES.get(self.type_name)
        return BIG if known is None else known.number

    def entry(self) -> bytes:
        """Return its entry in the symbol table."""
        lengths, tail = _texts(self.name, self.type_name, self.comment)
        size = -(-(_ENTRY.size + len(tail)) // _ALIGN) * _ALIGN
        head = _ENTRY.pack(size, Group.PLC_DATA, self.offset, self.size, self.type_number, 0x8, *lengths)
        return (head + tail).ljust(size, b"\0")


@dataclass(frozen=True)
class Member:
    """A member of a structure: name, type of IEC 61131-3, and place in it, byte."""

    name: str
    type_name: str
    offset: int


def _texts(*texts: str) -> tuple[list[int], bytes]:
    """Return the lengths of texts, and the texts as an entry has them."""
    coded = [one.encode("latin-1", "replace") for one in texts]
    return [len(one) for one in coded], b"".join(one + b"\0" for one in coded)


def _type_entry(
    name: str, type_name: str, *, size: int, offset: int, flags: int, members: tuple[bytes, ...] = ()
) -> bytes:
    """Return an entry of the table of data types, with those of its members behind it."""
    known = TYPES.get(type_name or name)
    lengths, texts = _texts(name, type_name, "")
    tail = texts + b"".join(members)
    whole = -(-(_TYPE_ENTRY.size + len(tail)) // _ALIGN) * _ALIGN
    head = _TYPE_ENTRY.pack(
        whole,
        _TYPE_VERSION,
        0,
        0,
        size,
        offset,
        BIG if known is None else known.number,
        flags,
        *lengths,
        0,
        len(members),
    )
    return (head + tail).ljust(whole, b"\0")


@dataclass(frozen=True)
class Structure:
    """A data type with members.

    Args:
        name: Its name.
        size: Its bytes.
        members: What it has.

    """

    name: str
    size: int
    members: tuple[Member, ...]

    def entry(self) -> bytes:
        """Return its entry in the table of data types."""
        members = tuple(
            _type_entry(
                one.name, one.type_name, size=size_of(one.type_name), offset=one.offset, flags=_IS_MEMBER
            )
            for one in self.members
        )
        return _type_entry(self.name, "", size=self.size, offset=0, flags=_IS_TYPE, members=members)


def size_of(type_name: str) -> int:
    """Return the bytes of a type of IEC 61131-3, one of `TYPES`."""
    return calcsize("<" + TYPES[type_name].format)


class Memory:
    """Memory of one AMS port, with its symbols and their data types."""

    def __init__(self) -> None:
        self._starts: list[int] = []
        self._areas: list[Area] = []
        self._end = 0
        self.symbols: list[Symbol] = []
        self._by_name: dict[str, Symbol] = {}
        self._types = {
            name: _type_entry(name, "", size=size_of(name), offset=0, flags=_IS_TYPE) for name in TYPES
        }

    def add(self, area: Area) -> int:
        """Add an area behind the others; returns its offset."""
        offset = self._end
        self._starts.append(offset)
        self._areas.append(area)
        # A gap of one step: a wrong length does not run into the next area.
        self._end = -(-(offset + area.size) // _ALIGN) * _ALIGN + _ALIGN
        return offset

    def name(self, symbol: Symbol) -> None:
        """Add a symbol; upper and lower case are the same."""
        self.symbols.append(symbol)
        self._by_name[symbol.name.upper()] = symbol

    def declare(self, structure: Structure) -> None:
        """Add a data type; a second one of the same name takes its place."""
        self._types[structure.name.upper()] = structure.entry()

    @property
    def types(self) -> list[bytes]:
        """Entries of the table of data types: those of IEC 61131-3, then the structures."""
        return list(self._types.values())

    def find_type(self, name: str) -> bytes | None:
        """Return the entry of a data type by its name; None: there is none."""
        return self._types.get(name.upper())

    def find(self, name: str) -> Symbol | None:
        """Return a symbol by its name; None: there is none."""
        return self._by_name.get(name.upper())

    def _area(self, offset: int) -> tuple[int, Area] | None:
        index = bisect_right(self._starts, offset) - 1
        if index < 0 or offset >= self._starts[index] + self._areas[index].size:
            return None
        return self._starts[index], self._areas[index]

    def read(self, offset: int, length: int) -> bytes | AdsError:
        """Return bytes of the memory, or why not."""
        found = self._area(offset)
        if found is None:
            return AdsError.INVALID_OFFSET
        start, area = found
        begin = offset - start
        if begin + length > area.size:
            return AdsError.INVALID_SIZE
        return area.read()[begin : begin + length]

    def write(self, offset: int, data: bytes) -> int:
        """Write bytes; returns an error code, 0 for none."""
        found = self._area(offset)
        if found is None:
            return AdsError.INVALID_OFFSET
        start, area = found
        begin = offset - start
        if not data or begin + len(data) > area.size:
            return AdsError.INVALID_SIZE
        if area.write is None:
            return AdsError.INVALID_ACCESS
        whole = bytearray(area.read())
        whole[begin : begin + len(data)] = data
        return area.write(bytes(whole))


def variable(
    memory: Memory,
    name: str,
    type_name: str,
    get: Callable[[], float],
    set_: Callable[[float], int] | None = None,
    *,
    comment: str = "",
) -> None:
    """Add a variable of a type of IEC 61131-3 with its symbol.

    Args:
        memory: Where it goes.
        name: Its name.
        type_name: Its type, one of `TYPES`.
        get: Returns its value.
        set_: Takes a value and returns an error code, 0 for none; None: it cannot be written.
        comment: What it is.

    """
    layout = Struct("<" + TYPES[type_name].format)

    def write(data: bytes) -> int:
        assert set_ is not None
        return set_(layout.unpack(data)[0])

    area = Area(layout.size, lambda: layout.pack(get()), None if set_ is None else write)
    memory.name(Symbol(name, type_name, memory.add(area), layout.size, comment))
