"""`[drive.NAME.pdo]`: the mapping of process data that a user wants in a CiA 402 drive."""

from __future__ import annotations

import re
from typing import Annotated, Final

from pydantic import AfterValidator

from hil.bench._table import Table

_OBJECT: Final = re.compile(r"([0-9A-Fa-f]{4})h(?::(\d{1,3}))?")


def _objects(names: tuple[str, ...]) -> tuple[str, ...]:
    for name in names:
        match = _OBJECT.fullmatch(name)
        if match is None or int(match[2] or 0) > 254:
            raise ValueError(f'{name!r} is no object; written as "6064h", with a sub-index as "60C1h:1"')
        if names.count(name) > 1:
            raise ValueError(f"{name} stands there twice")
    return names


Objects = Annotated[tuple[str, ...], AfterValidator(_objects)]


class PdoTable(Table, frozen=True):
    """Objects that the PDOs of a drive carry, in their order, as `["6041h", "6064h"]`.

    A direction of which the table says nothing is planned by the controller. PDOs of a direction that the
    table does not name are switched off. What the EDS does not allow is refused.
    """

    rpdo1: Objects = ()
    """From the controller: 6040h, the mode 6060h, and the setpoints 60FFh, 607Ah, 6071h and 60C1h:1."""
    rpdo2: Objects = ()
    """As `rpdo1`."""
    rpdo3: Objects = ()
    """As `rpdo1`."""
    rpdo4: Objects = ()
    """As `rpdo1`."""
    tpdo1: Objects = ()
    """From the drive, with SYNC; a PDO with nothing but 603Fh and 1001h comes when they change."""
    tpdo2: Objects = ()
    """As `tpdo1`."""
    tpdo3: Objects = ()
    """As `tpdo1`."""
    tpdo4: Objects = ()
    """As `tpdo1`."""

    @property
    def mapped(self) -> dict[tuple[bool, int], tuple[int, ...]]:
        """Keys of the objects, by whether the drive sends the PDO and its number; empty: all is planned."""
        found: dict[tuple[bool, int], tuple[int, ...]] = {}
        for letter, transmit in (("r", False), ("t", True)):
            for number in range(1, 5):
                names: tuple[str, ...] = getattr(self, f"{letter}pdo{number}")
                if names:
                    found[transmit, number] = tuple(_key(name) for name in names)
        return found


def _key(name: str) -> int:
    index, _, sub = name.partition("h")
    return int(index, 16) << 8 | int(sub.removeprefix(":") or 0)
