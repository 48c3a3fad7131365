"""Rows of an object dictionary: one source for the EDS file, the dictionary, the
defaults and the tests (C402-309).

A device lists its objects with type, access right, PDO direction and default in the form of the profile
tables; `fieldbus.canopen.eds_text` makes an EDS file of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

BOOLEAN: Final = 0x01
I8: Final = 0x02
I16: Final = 0x03
I32: Final = 0x04
U8: Final = 0x05
U16: Final = 0x06
U32: Final = 0x07
STRING: Final = 0x09
I64: Final = 0x15

VAR: Final = 7
ARRAY: Final = 8
RECORD: Final = 9

TYPE_NAMES: Final[dict[int, str]] = {
    I8: "I8",
    I16: "I16",
    I32: "I32",
    U8: "U8",
    U16: "U16",
    U32: "U32",
    STRING: "STRING",
    I64: "I64",
}
"""Short names of the data types in use."""


@dataclass(frozen=True)
class Item:
    """One entry that can be read or written: an object, or a sub-index of one.

    Args:
        name: Name in the EDS.
        data_type: CiA 301 type code.
        access: `ro`, `rw`, `wo` or `const`, as SDO sees it.
        pdo: `R` receive, `T` transmit, `RT` both, `-` not mappable.
        default: Value after power-on; a string may contain `$NODEID`; None = none given.
        volatile: A command or setpoint, which 1010h does not store.

    """

    name: str
    data_type: int
    access: str = "rw"
    pdo: str = "-"
    default: int | str | None = 0
    volatile: bool = False

    @property
    def eds_access(self) -> str:
        """Access type as an EDS writes it: `rww` and `rwr` name the only PDO
        direction of a read-write object.
        """
        if self.access == "rw" and self.pdo in ("R", "T"):
            return "rww" if self.pdo == "R" else "rwr"
        return self.access


@dataclass(frozen=True)
class ObjectRow:
    """One object of the dictionary.

    Args:
        index: 1000h..67FFh.
        name: Name in the EDS.
        kind: VAR, ARRAY or RECORD.
        items: By sub-index; sub-index 0 alone for VAR.

    """

    index: int
    name: str
    kind: int
    items: dict[int, Item]


def var(  # noqa: PLR0917 - rows of a table read like the table
    index: int,
    name: str,
    data_type: int,
    access: str = "rw",
    pdo: str = "-",
    default: int | str | None = 0,
    *,
    volatile: bool = False,
) -> ObjectRow:
    """Return a simple object."""
    return ObjectRow(index, name, VAR, {0: Item(name, data_type, access, pdo, default, volatile)})


def record(index: int, name: str, *members: Item, first: int = 1, highest: int | None = None) -> ObjectRow:
    """Return a record with the members at sub-indices `first`, `first` + 1, ..."""
    items = {first + offset: member for offset, member in enumerate(members)}
    count = max(items) if highest is None else highest
    return ObjectRow(
        index, name, RECORD, {0: Item("Highest sub-index supported", U8, "const", "-", count), **items}
    )


def array(  # noqa: PLR0917 - rows of a table read like the table
    index: int,
    name: str,
    names: tuple[str, ...],
    data_type: int,
    access: str = "rw",
    pdo: str = "-",
    defaults: tuple[int | str | None, ...] = (),
    *,
    volatile: bool = False,
) -> ObjectRow:
    """Return an array; `defaults` shorter than `names` is filled with zeros."""
    padded = defaults + (0,) * (len(names) - len(defaults))
    items = {
        sub: Item(member, data_type, access, pdo, default, volatile)
        for sub, (member, default) in enumerate(zip(names, padded, strict=True), 1)
    }
    return ObjectRow(
        index, name, ARRAY, {0: Item("Highest sub-index supported", U8, "const", "-", len(names)), **items}
    )
