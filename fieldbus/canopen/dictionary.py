"""Entries of an object dictionary: types, access rights, limits, defaults (CiA 301; C301-013, C301-014).

`entries_of` turns a `canopen.ObjectDictionary`, read from an EDS or DCF file, into a flat table keyed by
`index << 8 | sub-index`. It repairs what the library leaves open: defaults relative to the node-ID are
calculated for the node that the table is made for, and signed defaults written as hexadecimal patterns become
negative numbers.
"""

from __future__ import annotations

import re
from struct import Struct
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    import canopen

Value = int | float | str | bytes
"""What an entry holds."""
ObjectValue: TypeAlias = Any
"""A `Value` whose type follows from the data type of its entry, which a type checker cannot know."""

BOOLEAN: Final = 0x01
VISIBLE_STRING: Final = 0x09
OCTET_STRING: Final = 0x0A
UNICODE_STRING: Final = 0x0B
DOMAIN: Final = 0x0F

INTEGERS: Final[dict[int, tuple[int, bool]]] = {
    0x01: (1, False),
    0x02: (8, True),
    0x03: (16, True),
    0x04: (32, True),
    0x05: (8, False),
    0x06: (16, False),
    0x07: (32, False),
    0x10: (24, True),
    0x12: (40, True),
    0x13: (48, True),
    0x14: (56, True),
    0x15: (64, True),
    0x16: (24, False),
    0x18: (40, False),
    0x19: (48, False),
    0x1A: (56, False),
    0x1B: (64, False),
}
"""Data type code -> (bits, signed)."""

REALS: Final[dict[int, tuple[int, Struct]]] = {0x08: (32, Struct("<f")), 0x11: (64, Struct("<d"))}
"""Data type code -> (bits, coder)."""

OPAQUE_SIZES: Final[dict[int, int]] = {0x0C: 6, 0x0D: 6}
"""TIME_OF_DAY and TIME_DIFFERENCE: kept as bytes."""

MAX_STRING_BYTES: Final = 1024
"""Longest string that a device accepts."""
MAX_DOMAIN_BYTES: Final = 1 << 20
"""Longest domain that a device accepts."""

STORED_IN_RAM: Final = ("RAM", "ROM")
"""Storage locations of entries that 1010h does not store."""
_SUFFIX: Final = re.compile(r"(?<=[0-9A-Fa-f])[uUlL]{1,3}$")
_NODE_ID: Final = re.compile(r"\+?\$?(?:[A-Z]+_)*NODE_?ID\+?")
"""`$NODEID`, and as tools write it: `NODEID`, `$NODE_ID`, `$MY_NODE_ID`."""


def integer(text: str) -> int:
    """Return a number as an EDS writes it: decimal, hexadecimal with 0x, octal with a leading 0; perhaps
    with a suffix of C, as in `10UL`.

    Raises:
        ValueError: It is none.

    """
    body = _SUFFIX.sub("", text.strip())
    sign = -1 if body.startswith("-") else 1
    digits = body.lstrip("+-")
    if digits[:2].lower() == "0x":
        return sign * int(digits, 0)
    if len(digits) > 1 and digits.startswith("0") and digits.isdigit():
        return sign * int(digits, 8)
    return sign * int(digits, 10)


def relative(text: str) -> int | None:
    """Return what a value adds to the node-ID ("$NODEID+0x200"); None when the node-ID is not part of it.

    Raises:
        ValueError: What is added to $NODEID is no number.

    """
    squeezed = text.replace(" ", "").upper()
    rest, found = _NODE_ID.subn("", squeezed, count=1)
    if not found:
        return None
    return integer(rest) if rest else 0


class Entry:
    """One entry: an object or sub-object with its type and rights. Values live in the store, not here."""

    __slots__ = (
        "base",
        "bits",
        "data_type",
        "default",
        "given",
        "high",
        "index",
        "key",
        "low",
        "maps_receive",
        "maps_transmit",
        "name",
        "readable",
        "real",
        "signed",
        "size",
        "storable",
        "sub",
        "writable",
    )

    def __init__(self, variable: Any, *, node_id: int, name: str) -> None:
        self.index: int = variable.index
        self.sub: int = variable.subindex
        self.key: int = self.index << 8 | self.sub
        self.name = name
        self.data_type: int = variable.data_type if variable.data_type is not None else DOMAIN
        access = str(variable.access_type).lower()
        self.readable = "r" in access or access == "const"
        self.writable = "w" in access and access != "const"
        mappable = bool(variable.pdo_mappable)
        self.maps_receive = mappable and self.writable and access != "rwr"
        """May be mapped into an RPDO: writable, and not marked for process input alone (`rwr`)."""
        self.maps_transmit = mappable and self.readable and access not in ("rww", "const")
        """May be mapped into a TPDO: readable, and not marked for process output alone (`rww`)."""
        self.bits = 0
        """Length in bits; 0 for strings and domains, which have none."""
        self.size = 0
        """Length in bytes on the SDO; 0 when it varies."""
        self.signed = False
        self.real: Struct | None = None
        integer = INTEGERS.get(self.data_type)
        if integer is not None:
            self.bits, self.signed = integer
            self.size = (self.bits + 7) // 8
        elif self.data_type in REALS:
            self.bits, self.real = REALS[self.data_type]
            self.size = self.bits // 8
        elif self.data_type in OPAQUE_SIZES:
            self.size = OPAQUE_SIZES[self.data_type]
        self.base: int | None = None
        """What the default adds to the node-ID; None = the default has nothing to do with the node-ID."""
        self.low, self.high = self._limits(variable)
        self.given = False
        """The file, or the device, says what the default is."""
        self.default = self._default(variable, node_id)
        location = str(getattr(variable, "storage_location", None) or "").upper()
        self.storable = (
            self.readable and self.writable and self.data_type != DOMAIN and location not in STORED_IN_RAM
        )
        """Taken into non-volatile memory by 1010h."""

    @property
    def integer(self) -> bool:
        """Whether values are whole numbers."""
        return self.data_type in INTEGERS

    @property
    def type_range(self) -> tuple[int, int]:
        """Smallest and largest value of an integer type."""
        if self.signed:
            return -(1 << (self.bits - 1)), (1 << (self.bits - 1)) - 1
        return 0, (1 << self.bits) - 1

    def decode(self, data: bytes, *, exact: int = AbortCode.LENGTH) -> Value:
        """Return the value of the bytes of a transfer (C301-074).

        Args:
            data: Little-endian bytes.
            exact: Abort code for a length that does not fit; 0 = say whether too long or too short.

        Raises:
            SdoAbort: The length does not fit the type.

        """
        length = len(data)
        if self.size:
            if length != self.size:
                raise SdoAbort(exact or (AbortCode.TOO_LONG if length > self.size else AbortCode.TOO_SHORT))
            if self.real is not None:
                return float(self.real.unpack(data)[0])
            if self.bits:
                return int.from_bytes(data, "little", signed=self.signed)
            return bytes(data)
        if length > self.maximum_length:
            raise SdoAbort(AbortCode.TOO_LONG)
        if self.data_type == VISIBLE_STRING:
            return data.decode("latin-1").rstrip("\0")
        if self.data_type == UNICODE_STRING:
            return data.decode("utf-16-le", errors="replace").rstrip("\0")
        return bytes(data)

    def encode(self, value: ObjectValue) -> bytes:
        """Return the bytes of `value`; numbers outside the type are held at its end."""
        if self.integer:
            if type(value) is not int or not self.type_range[0] <= value <= self.type_range[1]:
                value = self.saturated(value)
            content: bytes = value.to_bytes(self.size, "little", signed=self.signed)
            return content
        if self.real is not None:
            try:
                return self.real.pack(value)
            except OverflowError:
                return self.real.pack(float("inf") if value > 0 else float("-inf"))
        if isinstance(value, str):
            return value.encode(
                "utf-16-le" if self.data_type == UNICODE_STRING else "latin-1", errors="replace"
            )
        return bytes(value)

    def saturated(self, value: ObjectValue) -> int:
        """Return `value` as a whole number of the integer type, held at the end of
        the range; 0 for not-a-number.
        """
        low, high = self.type_range
        try:
            number: int = round(value)
        except OverflowError:
            number = high if value > 0 else low
        except ValueError:
            number = 0
        return min(max(number, low), high)

    @property
    def maximum_length(self) -> int:
        """Most bytes that a download may bring."""
        return self.size or (MAX_DOMAIN_BYTES if self.data_type == DOMAIN else MAX_STRING_BYTES)

    def check_limits(self, value: ObjectValue) -> None:
        """Refuse a number outside the limits of the EDS (C301-076).

        Raises:
            SdoAbort: 06090031h too high, 06090032h too low, 06090036h limits crossed.

        """
        low, high = self.low, self.high
        if low is not None and high is not None and high < low:
            raise SdoAbort(AbortCode.MAXIMUM_BELOW_MINIMUM)
        if high is not None and value > high:
            raise SdoAbort(AbortCode.VALUE_HIGH)
        if low is not None and value < low:
            raise SdoAbort(AbortCode.VALUE_LOW)

    def _limits(self, variable: Any) -> tuple[float | None, float | None]:
        minimum, maximum = variable.min, variable.max
        if self.data_type == BOOLEAN:
            return None, 1
        if self.real is not None:
            return minimum, maximum
        if not self.integer:
            return None, None
        low, high = self.type_range
        # A limit at the end of the type checks nothing and would only cost time in the cycle.
        return (
            None if minimum is None or minimum <= low else int(minimum),
            None if maximum is None or maximum >= high else int(maximum),
        )

    def _default(self, variable: Any, node_id: int) -> Value:
        if variable.value is not None:
            raw, value = getattr(variable, "value_raw", None), variable.value
        else:
            raw, value = getattr(variable, "default_raw", None), variable.default
        self.given = value is not None or bool(raw)
        if isinstance(raw, str) and self.integer:
            self.base = relative(raw)
            if self.base is not None:
                value = self.base + node_id
        return self.coerce(value)

    def coerce(self, value: ObjectValue) -> Value:
        """Return `value` as the entry holds it; None becomes zero or empty."""
        if self.integer:
            number = int(value or 0)
            low, high = self.type_range
            if not low <= number <= high:
                number &= (1 << self.bits) - 1
                if self.signed and number > high:
                    number -= 1 << self.bits
            return number
        if self.real is not None:
            return float(value or 0.0)
        if self.data_type in (VISIBLE_STRING, UNICODE_STRING):
            return "" if value is None else str(value)
        if isinstance(value, str):
            value = value.encode("latin-1", errors="replace")
        if isinstance(value, int):
            value = (value & (1 << 8 * self.size) - 1).to_bytes(self.size, "little")
        content = bytes(value or b"")
        return content.ljust(self.size, b"\0")[: self.size] if self.size else content


_PROTOTYPES: Final = "_prototypes"
"""Attribute of a shared dictionary: its entries by node-ID, from which those of every device are copied."""


def share_entries(dictionary: canopen.ObjectDictionary) -> None:
    """Remember the entries of a dictionary that nobody changes, so that the next device has them sooner."""
    vars(dictionary)[_PROTOTYPES] = {}


def entries_of(dictionary: canopen.ObjectDictionary, node_id: int) -> dict[int, Entry]:
    """Return all entries from 1000h on, keyed `index << 8 | sub-index`, in ascending order.

    Args:
        dictionary: As the `canopen` library reads it from an EDS or DCF file.
        node_id: Node-ID for defaults that are relative to it, 1..127.

    Raises:
        ConfigurationError: The dictionary has no entry at 1000h or above.

    """
    known = readable_entries(dictionary, node_id)
    if _PROTOTYPES not in vars(dictionary):
        return known
    return {key: _copied(entry) for key, entry in known.items()}


def readable_entries(dictionary: canopen.ObjectDictionary, node_id: int) -> dict[int, Entry]:
    """Return the same for somebody who changes none of them: a shared dictionary has them once for all.

    Raises:
        ConfigurationError: As `entries_of`.

    """
    prototypes = vars(dictionary).get(_PROTOTYPES)
    if prototypes is None:
        return _read_entries(dictionary, node_id)
    known: dict[int, Entry] | None = prototypes.get(node_id)
    if known is None:
        known = prototypes[node_id] = _read_entries(dictionary, node_id)
    return known


def _copied(entry: Entry) -> Entry:
    # Attribute by attribute: every device has hundreds of entries.
    copy = Entry.__new__(Entry)
    copy.base = entry.base
    copy.bits = entry.bits
    copy.data_type = entry.data_type
    copy.default = entry.default
    copy.given = entry.given
    copy.high = entry.high
    copy.index = entry.index
    copy.key = entry.key
    copy.low = entry.low
    copy.maps_receive = entry.maps_receive
    copy.maps_transmit = entry.maps_transmit
    copy.name = entry.name
    copy.readable = entry.readable
    copy.real = entry.real
    copy.signed = entry.signed
    copy.size = entry.size
    copy.storable = entry.storable
    copy.sub = entry.sub
    copy.writable = entry.writable
    return copy


def _read_entries(dictionary: canopen.ObjectDictionary, node_id: int) -> dict[int, Entry]:
    entries: dict[int, Entry] = {}
    for index in sorted(dictionary.indices):
        if index < 0x1000:
            continue
        thing = dictionary.indices[index]
        members = getattr(thing, "subindices", None)
        if members is None:
            entry = Entry(thing, node_id=node_id, name=thing.name)
            entries[entry.key] = entry
            continue
        for sub in sorted(members):
            variable = members[sub]
            entry = Entry(variable, node_id=node_id, name=f"{thing.name}: {variable.name}")
            entry.sub = sub
            entry.key = index << 8 | sub
            entries[entry.key] = entry
    if not entries:
        raise ConfigurationError("dictionary", dictionary, "an object dictionary with entries from 1000h on")
    return entries
