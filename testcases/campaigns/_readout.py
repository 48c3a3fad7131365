"""All CANopen devices of a bench, each with its own dictionary, and everything that can be read of them."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from typing import Any, Final

import canopen

from fieldbus.canopen.dictionary import INTEGERS
from hil.campaign import CaseContext
from hil.errors import BlockedError
from testcases.campaigns._led_servo import Node

Place = tuple[int, int]
"""Index and sub-index."""
Readout = dict[Place, bytes | int]
"""Content, or abort code, of every entry of a dictionary."""

_REAL32: Final = 0x08
_PROFILE: Final = 0x1000
_READ_ONLY: Final = ("ro", "const")
_TOLD: Final = 6
"""So many deviations are named."""


class Item:
    """An entry of a dictionary: what its EDS says of it.

    Args:
        variable: The entry as the EDS has it.
        node: Node-ID of the device, which the file counts from 1.

    """

    def __init__(self, variable: canopen.objectdictionary.ODVariable, node: int) -> None:
        self.place: Place = variable.index, variable.subindex
        self.text = f"{variable.index:04X}h:{variable.subindex}"
        self.access = str(variable.access_type)
        width = INTEGERS.get(variable.data_type)
        self.bits, self.signed = width or (32 if variable.data_type == _REAL32 else 0, False)
        self.whole = width is not None
        given = str(getattr(variable, "default_raw", "") or "").replace(" ", "").upper()
        self.default: Any = variable.default
        if "$NODEID" in given:
            rest = given.replace("$NODEID", "").strip("+")
            self.default = node + (int(rest, 0) if rest else 0)
        self.low, self.high = variable.min, variable.max

    @property
    def readable(self) -> bool:
        """Whether it may be read."""
        return self.access != "wo"

    @property
    def writable(self) -> bool:
        """Whether it may be written."""
        return self.access not in _READ_ONLY

    @property
    def size(self) -> int:
        """Bytes on the bus; 0: any number of them."""
        return (self.bits + 7) // 8

    def packed(self, value: Any) -> bytes:
        """Return a value as it is on the bus."""
        if self.whole:
            return int(value & (1 << self.bits) - 1).to_bytes(self.size, "little")
        if self.bits:
            return struct.pack("<f", value)
        return str(value).encode("latin-1") if not isinstance(value, bytes) else value

    def number(self, content: bytes) -> int:
        """Return a content that is a whole number."""
        return int.from_bytes(content, "little", signed=self.signed)

    @property
    def range(self) -> tuple[int, int]:
        """Ends of the range, those of the data type included."""
        low, high = (
            (-(1 << self.bits - 1), (1 << self.bits - 1) - 1) if self.signed else (0, (1 << self.bits) - 1)
        )
        return (
            low if self.low is None else max(low, self.low),
            high if self.high is None else min(high, self.high),
        )


class Device(Node):
    """A CANopen device of the bench: its objects by SDO, its dictionary, its supply.

    Args:
        ctx: The case.
        name: Its name in the bench file.
        section: Its table there.
        device: The emulated device.

    """

    def __init__(self, ctx: CaseContext, name: str, section: Any, device: Any) -> None:
        super().__init__(ctx, int(section.node_id))
        self.ctx, self.name, self.section, self.device = ctx, name, section, device
        self.items: dict[Place, Item] = {}
        for entry in section.dictionary().values():
            one = isinstance(entry, canopen.objectdictionary.ODVariable)
            for variable in (entry,) if one else entry.values():
                if variable.index >= _PROFILE:
                    self.items[variable.index, variable.subindex] = Item(variable, self.node)

    def none(self, what: str, found: Iterable[str], *ids: str) -> None:
        """Expect that a list of deviations is empty."""
        told = list(found)
        more = f" and {len(told) - _TOLD} more" if len(told) > _TOLD else ""
        self.equal(f"{self.name}: {what}: {'; '.join(told[:_TOLD]) or 'all right'}{more}", len(told), 0, *ids)

    def readout(self) -> Readout:
        """Return everything that can be read now."""
        return {place: self.upload(*place) for place in self.items}

    def same(self, what: str, found: Readout, wanted: Readout, *ids: str, but: tuple[int, ...] = ()) -> None:
        """Expect that two readouts agree, in all but some objects."""
        self.none(
            f"objects {what}",
            (
                told(self.items[place].text, found[place], wanted[place])
                for place in wanted
                if place[0] not in but and found[place] != wanted[place]
            ),
            *ids,
        )

    def off_and_on(self, off_s: float = 0.05, boot_s: float = 0.3) -> None:
        """Switch it off and on again."""
        self.ctx.do(f"switch {self.name} off and on")
        self.device.power_off()
        self.ctx.run_for(off_s)
        self.device.power_on()
        self.ctx.run_for(boot_s)


def devices(ctx: CaseContext) -> Iterator[Device]:
    """Return the CANopen devices of the first segment of the bench.

    Raises:
        BlockedError: There is none that is emulated.

    """
    bench = ctx.bench
    config = bench.config
    kinds = ((config.drive, bench.drive), (config.encoder, bench.encoder), (config.device, bench.device))
    found = [
        (name, section, find(name))
        for table, find in kinds
        for name, section in table.items()
        if getattr(section, "node_id", None) is not None
        and section.device == "emulated"
        and section.segment == bench.segment_names[0]
    ]
    if not found:
        raise BlockedError("the case needs an emulated CANopen device, and the bench has none")
    for name, section, device in found:
        yield Device(ctx, name, section, device)


def told(what: str, found: object, wanted: object) -> str:
    """Return a deviation in words."""
    return f"{what} is {_shown(found)}, not {_shown(wanted)}"


def _shown(value: object) -> object:
    if isinstance(value, bytes):
        return value.hex() or "empty"
    return f"{value:08X}h" if isinstance(value, int) and value > 0xFFFF else value
