"""Global data blocks of the user program that technology objects read by address
(LIM-069 to LIM-072, VAR-023).

An object that looks at a single bit, such as a hardware limit switch, gets its address as a structure
`VREF`: `RID`, `Area`, `DbNumber` and `Offset` in bits. That needs a block with standard access (not
optimised), because only there an address is a place.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from fieldbus.errors import ConfigurationError

BOOL_RID: Final = 0x0200_0001
"""`RID` of a BOOL."""
DATA_BLOCK_AREA: Final = 0x84
"""`Area` of the data blocks."""
LARGEST_NUMBER: Final = 59_999
LARGEST_SIZE: Final = 65_536
"""Bytes of a block with standard access."""


class BitAddress(NamedTuple):
    """Address of a Boolean variable (`VREF`)."""

    rid: int = 0
    area: int = 0
    number: int = 0
    offset: int = 0

    @classmethod
    def of_bit(cls, number: int, byte: int, bit: int) -> BitAddress:
        """Return the address of `DBn.DBXbyte.bit`.

        Raises:
            ConfigurationError: There can be no such bit.

        """
        for what, value, high in (
            ("data block", number, LARGEST_NUMBER),
            ("byte", byte, LARGEST_SIZE - 1),
            ("bit", bit, 7),
        ):
            low = 1 if what == "data block" else 0
            if not low <= value <= high:
                raise ConfigurationError(f"bit address: {what}", value, f"{low} to {high}")
        return cls(BOOL_RID, DATA_BLOCK_AREA, number, 8 * byte + bit)

    @property
    def given(self) -> bool:
        """Whether there is an address at all."""
        return any(self)


class GlobalDataBlock:
    """A data block of the user program, as bytes.

    Args:
        number: Its number, 1 to 59999.
        size: Bytes, 1 to 65536.
        optimized: Attribute "optimized block access": its bits then have no addresses.

    Raises:
        ConfigurationError: Number or size is out of range.

    """

    def __init__(self, number: int, size: int, *, optimized: bool = False) -> None:
        if not 1 <= number <= LARGEST_NUMBER:
            raise ConfigurationError("data block: number", number, f"1 to {LARGEST_NUMBER}")
        if not 1 <= size <= LARGEST_SIZE:
            raise ConfigurationError(f"DB{number}: size", size, f"1 to {LARGEST_SIZE} bytes")
        self.number = number
        self.optimized = optimized
        self.data = bytearray(size)

    def bit(self, byte: int, bit: int) -> bool:
        """Return `DBXbyte.bit`."""
        return bool(self.data[byte] >> bit & 1)

    def set_bit(self, byte: int, bit: int, value: bool) -> None:
        """Assign `DBXbyte.bit`, as the user program does.

        Raises:
            ConfigurationError: The block has no such bit.

        """
        if not (0 <= byte < len(self.data) and 0 <= bit <= 7):
            raise ConfigurationError(
                f"DB{self.number}.DBX{byte}.{bit}", value, f"byte 0 to {len(self.data) - 1}, bit 0 to 7"
            )
        mask = 1 << bit
        self.data[byte] = self.data[byte] | mask if value else self.data[byte] & ~mask


class DataBlocks:
    """The global data blocks of a controller: `blocks.add(7, 16)`, `blocks[7].set_bit(4, 0, True)`."""

    def __init__(self) -> None:
        self._blocks: dict[int, GlobalDataBlock] = {}

    def add(self, number: int, size: int, *, optimized: bool = False) -> GlobalDataBlock:
        """Make a block, all zero.

        Raises:
            ConfigurationError: There is one of this number, or number or size is out of range.

        """
        if number in self._blocks:
            raise ConfigurationError(
                "data block: number", number, "one that is not taken: " + ", ".join(map(str, self._blocks))
            )
        block = self._blocks[number] = GlobalDataBlock(number, size, optimized=optimized)
        return block

    def __getitem__(self, number: int) -> GlobalDataBlock:
        """Return a block.

        Raises:
            ConfigurationError: There is none.

        """
        block = self._blocks.get(number)
        if block is None:
            raise ConfigurationError(
                "data block", number, ", ".join(map(str, self._blocks)) or "none has been made"
            )
        return block

    def clear(self) -> None:
        """Give all of them their initial values back: they are not retentive."""
        for block in self._blocks.values():
            block.data[:] = bytes(len(block.data))

    def problem(self, address: BitAddress) -> str:
        """Return why there is no bit at an address; empty where there is one."""
        if address.rid != BOOL_RID:
            return f"RID = 16#{address.rid:08X}; allowed: 16#{BOOL_RID:08X}, a BOOL"
        if address.area != DATA_BLOCK_AREA:
            return f"Area = 16#{address.area:02X}; allowed: 16#{DATA_BLOCK_AREA:02X}, a data block"
        block = self._blocks.get(address.number)
        if block is None:
            return f"DbNumber = {address.number}: there is no such data block"
        if block.optimized:
            return f"DbNumber = {address.number}: its access is optimized, so that its bits have no addresses"
        if not 0 <= address.offset < 8 * len(block.data):
            return (
                f"Offset = {address.offset}; allowed: 0 to {8 * len(block.data) - 1}, "
                f"DB{address.number} ends there"
            )
        return ""

    def reader(self, address: BitAddress) -> Callable[[], bool]:
        """Return what reads the bit at an address in which there is no problem."""
        data = self._blocks[address.number].data
        byte, shift = divmod(address.offset, 8)
        return lambda: bool(data[byte] >> shift & 1)
