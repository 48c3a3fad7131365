"""PDO records that an EDS does not write out (CiA 306: `CompactPDO`)."""

from __future__ import annotations

from typing import Any, Final

from fieldbus.canopen.eds_file import EdsSection

_UNSIGNED8: Final = 0x05
_UNSIGNED16: Final = 0x06
_UNSIGNED32: Final = 0x07
_MOST: Final = 512
_ENTRIES: Final = 64
_PREDEFINED: Final = 4
"""PDOs of each direction that have an identifier by default (C301-006)."""
_INVALID: Final = 0x80000000
_MEMBERS: Final = (
    ("COB-ID", _UNSIGNED32),
    ("Transmission type", _UNSIGNED8),
    ("Inhibit time", _UNSIGNED16),
    ("Compatibility entry", _UNSIGNED8),
    ("Event timer", _UNSIGNED16),
    ("SYNC start value", _UNSIGNED8),
)
"""Sub-indices 1 to 6 of a communication record: bits 0 to 5 of `CompactPDO` say which there are."""
_DIRECTIONS: Final = (("NrOfRXPDO", 0x1400, 0x200, "R"), ("NrOfTXPDO", 0x1800, 0x180, "T"))


def add_compact_pdos(library: Any, dictionary: Any, device: EdsSection, node_id: int | None) -> None:
    """Add the records that `[DeviceInfo]` counts and the file leaves out, with the lowest free numbers.

    Args:
        library: `canopen.objectdictionary`.
        dictionary: Has what the file writes out, which stays.
        device: `[DeviceInfo]`.
        node_id: For the default identifiers; None: not known.

    """
    mask = device.number("CompactPDO", 0)
    if not mask:
        return
    written = dictionary.indices
    added: list[str] = []
    for key, communication, cob_id, letter in _DIRECTIONS:
        count = device.number(key, 0, high=_MOST)
        there = {
            number
            for number in range(_MOST)
            if communication + number in written or communication + 0x200 + number in written
        }
        missing = [number for number in range(_MOST) if number not in there][: max(count - len(there), 0)]
        for number in sorted(there | set(missing)):
            if communication + number not in written:
                default = cob_id + 0x100 * number if number < _PREDEFINED else None
                record = _communication(library, communication + number, mask, default, node_id)
                dictionary.add_object(record)
            if communication + 0x200 + number not in written:
                dictionary.add_object(_mapping(library, communication + 0x200 + number))
        added += [f"{letter}PDO{number + 1}" for number in missing]
    device.note(
        "CompactPDO",
        f"the file does not write out {', '.join(added)}"
        if added
        else "not needed; the file has PDO records, and they count",
    )


def _communication(library: Any, index: int, mask: int, cob_id: int | None, node_id: int | None) -> Any:
    record = library.ODRecord("PDO communication parameter", index)
    present = [sub for sub in range(1, len(_MEMBERS) + 1) if mask >> sub - 1 & 1]
    _add(library, record, 0, "Highest sub-index", _UNSIGNED8)
    highest = record[0]
    highest.access_type = "const"
    highest.default, highest.default_raw = max(present, default=0), str(max(present, default=0))
    for sub in present:
        _add(library, record, sub, *_MEMBERS[sub - 1])
    if 1 in present and cob_id is not None:
        record[1].default, record[1].default_raw = cob_id + (node_id or 0), f"$NODEID+0x{cob_id:X}"
        record[1].relative = True
    elif 1 in present:
        record[1].default, record[1].default_raw = _INVALID, f"0x{_INVALID:X}"
    return record


def _mapping(library: Any, index: int) -> Any:
    record = library.ODRecord("PDO mapping parameter", index)
    _add(library, record, 0, "Number of entries", _UNSIGNED8)
    for sub in range(1, _ENTRIES + 1):
        _add(library, record, sub, f"Entry {sub}", _UNSIGNED32)
    return record


def _add(library: Any, record: Any, sub: int, name: str, data_type: int) -> None:
    variable = library.ODVariable(name, record.index, sub)
    variable.data_type = data_type
    variable.access_type = "rw"
    variable.default, variable.default_raw = 0, "0"
    record.add_member(variable)
