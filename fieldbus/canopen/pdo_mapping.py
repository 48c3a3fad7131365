"""PDO mappings: their rules (CiA 301; C301-051 to C301-053) and their compilation into fast code.

A mapping of whole bytes becomes one precompiled `struct.Struct` and one `itemgetter`; mappings with single
bits or 24-bit numbers go through integer arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from operator import itemgetter
from struct import Struct, error
from typing import Any, Final, NamedTuple

from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import INTEGERS, Entry, ObjectValue
from fieldbus.canopen.store import ObjectStore, ReadHook, WriteHook

_CODES: Final = {
    (8, True): "b",
    (8, False): "B",
    (16, True): "h",
    (16, False): "H",
    (32, True): "i",
    (32, False): "I",
    (64, True): "q",
    (64, False): "Q",
}

_Key = Any
"""Key of an object, an integer that stays an object: compiled, it would be made again for every access."""
Sampler = Callable[[], bytes]
"""Returns the payload of a TPDO from the present values."""
Applier = Callable[[bytes], None]
"""Stores the payload of an RPDO; the payload has exactly the mapped length."""


class Field(NamedTuple):
    """One mapped object, or a gap (`entry` None)."""

    entry: Entry | None
    bits: int
    offset: int
    """First bit in the PDO."""


class Layout(NamedTuple):
    """A valid mapping."""

    fields: tuple[Field, ...]
    bits: int

    @property
    def size(self) -> int:
        """Length of the PDO in bytes."""
        return (self.bits + 7) // 8

    @property
    def keys(self) -> list[int]:
        """Keys of the mapped objects, in order, without gaps."""
        return [field.entry.key for field in self.fields if field.entry is not None]


EMPTY: Final = Layout((), 0)


def check_mapping_entry(store: ObjectStore, raw: int, *, receive: bool) -> tuple[Entry | None, int]:
    """Return entry and bits of one mapping value; the entry is None for a dummy (C301-053).

    Raises:
        SdoAbort: 06020000h, 06090011h no such object; 06040041h not mappable in
            this direction or wrong length.

    """
    index, sub, bits = raw >> 16, raw >> 8 & 0xFF, raw & 0xFF
    if 0x0002 <= index <= 0x0007:
        if not receive or sub or bits != INTEGERS[index][0]:
            raise SdoAbort(AbortCode.NOT_MAPPABLE)
        return None, bits
    entry = store.entry(index, sub)
    if not (entry.maps_receive if receive else entry.maps_transmit) or not entry.bits or bits != entry.bits:
        raise SdoAbort(AbortCode.NOT_MAPPABLE)
    return entry, bits


def check_mapping(store: ObjectStore, raw: Iterable[int], *, receive: bool) -> Layout:
    """Return the layout of mapping values in order.

    Raises:
        SdoAbort: As `check_mapping_entry`; 06040042h more than 64 bits.

    """
    fields = []
    offset = 0
    for value in raw:
        entry, bits = check_mapping_entry(store, value, receive=receive)
        fields.append(Field(entry, bits, offset))
        offset += bits
    if offset > 64:
        raise SdoAbort(AbortCode.PDO_LENGTH)
    return Layout(tuple(fields), offset)


def _compile(layout: Layout) -> Struct | None:
    """Return the struct of a mapping of whole bytes, None for any other."""
    code = "<"
    for field in layout.fields:
        entry = field.entry
        if entry is None:
            code += f"{field.bits // 8}x"
        elif entry.real is not None:
            code += "f" if field.bits == 32 else "d"
        elif (field.bits, entry.signed) in _CODES:
            code += _CODES[field.bits, entry.signed]
        else:
            return None
    return Struct(code)


def pack_saturated(layout: Layout, values: dict[int, ObjectValue]) -> bytes:
    """Return the payload of any layout; numbers outside their type are held at its end."""
    word = 0
    for entry, bits, offset in layout.fields:
        if entry is not None:
            word |= (int.from_bytes(entry.encode(values[entry.key]), "little") & (1 << bits) - 1) << offset
    return word.to_bytes(layout.size, "little")


def unpack_fields(layout: Layout, data: bytes) -> list[ObjectValue]:
    """Return the values of a payload in the order of `Layout.keys`; a short payload is filled with zeros."""
    word = int.from_bytes(data, "little")
    result: list[ObjectValue] = []
    for entry, bits, offset in layout.fields:
        if entry is None:
            continue
        number = word >> offset & (1 << bits) - 1
        if entry.real is not None:
            result.append(entry.real.unpack(number.to_bytes(bits // 8, "little"))[0])
        elif entry.signed and number >> (bits - 1):
            result.append(number - (1 << bits))
        else:
            result.append(number)
    return result


def sampler(layout: Layout, values: dict[int, ObjectValue], hooks: dict[int, ReadHook]) -> Sampler:
    """Return the code that reads all mapped objects at one instant and packs them (C301-056)."""
    keys = layout.keys
    code = _compile(layout)
    reads: list[tuple[_Key, ReadHook]] = [(key, hooks[key]) for key in keys if key in hooks]
    if code is None or not keys:

        def sample() -> bytes:
            _read(reads, values)
            return pack_saturated(layout, values)

        return sample

    pack = code.pack
    if len(keys) == 1:
        key = keys[0]

        def sample_one() -> bytes:
            if reads:
                _read(reads, values)
            try:
                return pack(values[key])
            except (error, TypeError, OverflowError):
                return pack_saturated(layout, values)

        return sample_one

    get = itemgetter(*keys)

    def sample_all() -> bytes:
        if reads:
            _read(reads, values)
        try:
            return pack(*get(values))
        except (error, TypeError, OverflowError):
            return pack_saturated(layout, values)

    return sample_all


def _read(reads: list[tuple[_Key, ReadHook]], values: dict[int, ObjectValue]) -> None:
    for key, hook in reads:
        try:
            values[key] = hook()
        except SdoAbort:
            continue


def applier(layout: Layout, store: ObjectStore) -> Applier:
    """Return the code that stores a payload: limits and device hooks first, object by object (C301-076)."""
    values = store.values
    code = _compile(layout)
    keys: list[_Key] = layout.keys
    plan: list[tuple[_Key, WriteHook | None]] = []
    for field in layout.fields:
        entry = field.entry
        if entry is not None:
            plan.append((entry.key, _checked(entry, store)))
    if code is None:

        def apply_bits(data: bytes) -> None:
            _store(plan, unpack_fields(layout, data), values)

        return apply_bits

    unpack = code.unpack
    if all(hook is None for _, hook in plan):

        def apply_plain(data: bytes) -> None:
            unpacked = unpack(data)
            for place, key in enumerate(keys):  # takes half as long as `update` with pairs
                values[key] = unpacked[place]

        return apply_plain

    def apply_hooked(data: bytes) -> None:
        place = 0
        unpacked = unpack(data)
        for key, hook in plan:
            value = unpacked[place]
            place += 1
            if hook is not None:
                try:
                    hook(value)
                except SdoAbort:
                    continue
            values[key] = value

    return apply_hooked


def _store(
    plan: Sequence[tuple[int, WriteHook | None]], data: Sequence[ObjectValue], values: dict[int, ObjectValue]
) -> None:
    for (key, hook), value in zip(plan, data, strict=True):
        if hook is not None:
            try:
                hook(value)
            except SdoAbort:
                continue
        values[key] = value


def _checked(entry: Entry, store: ObjectStore) -> WriteHook | None:
    """Return all that has to agree before a PDO may change the entry; None when nothing has."""
    hook = store.write_hooks.get(entry.key)
    guard = store.guards.get(entry.key)
    limited = entry.low is not None or entry.high is not None
    if guard is None and not limited:
        return hook

    def check(value: ObjectValue) -> None:
        if limited:
            entry.check_limits(value)
        if guard is not None:
            guard(value)
        if hook is not None:
            hook(value)

    return check
