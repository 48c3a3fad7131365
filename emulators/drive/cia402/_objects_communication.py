"""Communication objects 1000h..1FFFh (CiA 301; C301-132 to C301-152) and the default PDOs (C402-279 to C402-294)."""

from __future__ import annotations

from typing import Final

from emulators.drive.cia402.objects import STRING, U8, U16, U32, Item, ObjectRow, array, record, var

DEVICE_TYPE: Final = 0x00020192
"""Servo drive of profile 402."""
_INVALID: Final = 1 << 31
_NO_RTR: Final = 1 << 30
_MAPPABLE: Final = 8

# (COB-ID base or None for an invalid PDO, transmission type, mapped objects as index << 16 | sub << 8 | bits)
_RPDOS: Final[tuple[tuple[int | None, int, tuple[int, ...]], ...]] = (
    (0x200, 255, (0x60400010,)),
    (0x300, 255, (0x60400010, 0x60600008)),
    (0x400, 1, (0x60400010, 0x607A0020)),
    (0x500, 1, (0x60400010, 0x60FF0020)),
    (None, 1, (0x60400010, 0x60710010)),
    (None, 255, (0x60400010, 0x60420010)),
    (None, 255, (0x60400010, 0x60FE0120)),
    (None, 255, (0x60400010, 0x60600008)),
)
_TPDOS: Final[tuple[tuple[int | None, int, tuple[int, ...]], ...]] = (
    (0x180, 255, (0x60410010,)),
    (0x280, 255, (0x60410010, 0x60610008)),
    (0x380, 1, (0x60410010, 0x60640020)),
    (0x480, 1, (0x60410010, 0x606C0020)),
    (None, 1, (0x60410010, 0x60770010)),
    (None, 255, (0x60410010, 0x60440010)),
    (None, 255, (0x60410010, 0x60FD0020)),
    (None, 1, (0x60B90010, 0x60BA0020)),
)


def communication_objects() -> tuple[ObjectRow, ...]:
    """Return the rows of 1000h..1FFFh."""
    return (*_general(), *_pdos())


def _general() -> tuple[ObjectRow, ...]:
    return (
        var(0x1000, "Device type", U32, "ro", "-", DEVICE_TYPE),
        var(0x1001, "Error register", U8, "ro", "T"),
        var(0x1002, "Manufacturer status register", U32, "ro", "T"),
        ObjectRow(
            0x1003,
            "Pre-defined error field",
            8,
            {
                0: Item("Number of errors", U8, "rw", "-", 0, volatile=True),
                **{sub: Item(f"Standard error field {sub}", U32, "ro") for sub in range(1, 9)},
            },
        ),
        var(0x1005, "COB-ID SYNC", U32, "rw", "-", 0x80),
        var(0x1006, "Communication cycle period", U32),
        var(0x1007, "Synchronous window length", U32),
        var(0x1008, "Manufacturer device name", STRING, "const", "-", "Emulated servo drive CiA 402"),
        var(0x1009, "Manufacturer hardware version", STRING, "const", "-", "emulated"),
        var(0x100A, "Manufacturer software version", STRING, "const", "-", "1.0"),
        var(0x100C, "Guard time", U16),
        var(0x100D, "Life time factor", U8),
        array(0x1010, "Store parameters", _MEMORY_GROUPS, U32, "rw", "-", (1, 1, 1)),
        array(0x1011, "Restore default parameters", _MEMORY_GROUPS, U32, "rw", "-", (1, 1, 1)),
        var(0x1012, "COB-ID TIME", U32, "rw", "-", 0x100),
        var(0x1014, "COB-ID EMCY", U32, "rw", "-", "$NODEID+0x80"),
        var(0x1015, "Inhibit time EMCY", U16),
        array(
            0x1016, "Consumer heartbeat time", tuple(f"Consumer heartbeat time {n}" for n in range(1, 5)), U32
        ),
        var(0x1017, "Producer heartbeat time", U16),
        record(
            0x1018,
            "Identity object",
            Item("Vendor-ID", U32, "ro", "-", 0),
            Item("Product code", U32, "ro", "-", 0x402),
            Item("Revision number", U32, "ro", "-", 0x00010000),
            Item("Serial number", U32, "ro", "-", 1),
        ),
        var(0x1019, "Synchronous counter overflow value", U8),
        array(0x1020, "Verify configuration", ("Configuration date", "Configuration time"), U32),
        array(0x1029, "Error behaviour", ("Communication error", "Drive error"), U8),
        record(
            0x1200,
            "SDO server parameter",
            Item("COB-ID client to server", U32, "ro", "-", "$NODEID+0x600"),
            Item("COB-ID server to client", U32, "ro", "-", "$NODEID+0x580"),
        ),
    )


_MEMORY_GROUPS: Final = ("All parameters", "Communication parameters", "Application parameters")


def _cob_id(base: int | None, flags: int) -> int | str:
    return flags | _INVALID if base is None else f"$NODEID+0x{flags | base:X}"


def _mapping(index: int, name: str, objects: tuple[int, ...]) -> ObjectRow:
    entries = {
        sub: Item(f"Mapped object {sub}", U32, "rw", "-", objects[sub - 1] if sub <= len(objects) else 0)
        for sub in range(1, _MAPPABLE + 1)
    }
    return ObjectRow(
        index, name, 9, {0: Item("Number of mapped objects", U8, "rw", "-", len(objects)), **entries}
    )


def _pdos() -> tuple[ObjectRow, ...]:
    rows: list[ObjectRow] = []
    for number, (base, kind, objects) in enumerate(_RPDOS):
        communication = {
            0: Item("Highest sub-index supported", U8, "const", "-", 5),
            1: Item("COB-ID", U32, "rw", "-", _cob_id(base, 0)),
            2: Item("Transmission type", U8, "rw", "-", kind),
            5: Item("Event timer", U16, "rw", "-", 0),
        }
        rows.append(
            ObjectRow(0x1400 + number, f"RPDO {number + 1} communication parameter", 9, communication)
        )
        rows.append(_mapping(0x1600 + number, f"RPDO {number + 1} mapping parameter", objects))
    for number, (base, kind, objects) in enumerate(_TPDOS):
        communication = {
            0: Item("Highest sub-index supported", U8, "const", "-", 6),
            1: Item("COB-ID", U32, "rw", "-", _cob_id(base, _NO_RTR)),
            2: Item("Transmission type", U8, "rw", "-", kind),
            3: Item("Inhibit time", U16, "rw", "-", 0),
            5: Item("Event timer", U16, "rw", "-", 0),
            6: Item("SYNC start value", U8, "rw", "-", 0),
        }
        rows.append(
            ObjectRow(0x1800 + number, f"TPDO {number + 1} communication parameter", 9, communication)
        )
        rows.append(_mapping(0x1A00 + number, f"TPDO {number + 1} mapping parameter", objects))
    return tuple(rows)
