"""Rows of the communication objects that `CanopenSlave` serves, 1000h..1FFFh
(CiA 301; C301-132 to C301-152).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from fieldbus.canopen.object_table import RECORD, STRING, U8, U16, U32, Item, ObjectRow, array, record, var

_INVALID: Final = 1 << 31
_NO_RTR: Final = 1 << 30
_MAPPABLE: Final = 8
_MEMORY_GROUPS: Final = ("All parameters", "Communication parameters", "Application parameters")


@dataclass(frozen=True)
class PdoDefaults:
    """How a PDO is set when the device leaves the factory.

    Args:
        base: CAN identifier of node 0, for example 180h; None = none, the PDO is not valid.
        kind: Transmission type.
        objects: Mapped objects, `index << 16 | sub-index << 8 | bits`.
        valid: False: switched off although it has an identifier.

    """

    base: int | None
    kind: int
    objects: tuple[int, ...]
    valid: bool = True


def communication_objects(
    *,
    device_type: int,
    device_name: str,
    product_code: int,
    error_classes: tuple[str, ...],
    rpdos: Sequence[PdoDefaults] = (),
    tpdos: Sequence[PdoDefaults] = (),
) -> tuple[ObjectRow, ...]:
    """Return the rows of 1000h..1FFFh of a device.

    Args:
        device_type: 1000h.
        device_name: 1008h.
        product_code: 1018h:2.
        error_classes: Names of the sub-indices of 1029h; the first one is the communication error.
        rpdos: Receive PDOs, from 1400h on.
        tpdos: Transmit PDOs, from 1800h on.

    """
    return (
        *_general(device_type, device_name, product_code, error_classes),
        *_receive_pdos(rpdos),
        *_transmit_pdos(tpdos),
    )


def _general(
    device_type: int, device_name: str, product_code: int, error_classes: tuple[str, ...]
) -> tuple[ObjectRow, ...]:
    return (
        var(0x1000, "Device type", U32, "ro", "-", device_type),
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
        var(0x1008, "Manufacturer device name", STRING, "const", "-", device_name),
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
            Item("Product code", U32, "ro", "-", product_code),
            Item("Revision number", U32, "ro", "-", 0x00010000),
            Item("Serial number", U32, "ro", "-", 1),
        ),
        var(0x1019, "Synchronous counter overflow value", U8),
        array(0x1020, "Verify configuration", ("Configuration date", "Configuration time"), U32),
        array(0x1029, "Error behaviour", error_classes, U8),
        record(
            0x1200,
            "SDO server parameter",
            Item("COB-ID client to server", U32, "ro", "-", "$NODEID+0x600"),
            Item("COB-ID server to client", U32, "ro", "-", "$NODEID+0x580"),
        ),
    )


def _cob_id(pdo: PdoDefaults, flags: int) -> int | str:
    if pdo.base is None:
        return flags | _INVALID
    return f"$NODEID+0x{flags | pdo.base | (0 if pdo.valid else _INVALID):X}"


def _mapping(index: int, name: str, objects: tuple[int, ...]) -> ObjectRow:
    entries = {
        sub: Item(f"Mapped object {sub}", U32, "rw", "-", objects[sub - 1] if sub <= len(objects) else 0)
        for sub in range(1, _MAPPABLE + 1)
    }
    return ObjectRow(
        index, name, RECORD, {0: Item("Number of mapped objects", U8, "rw", "-", len(objects)), **entries}
    )


def _receive_pdos(pdos: Sequence[PdoDefaults]) -> list[ObjectRow]:
    rows: list[ObjectRow] = []
    for number, pdo in enumerate(pdos):
        communication = {
            0: Item("Highest sub-index supported", U8, "const", "-", 5),
            1: Item("COB-ID", U32, "rw", "-", _cob_id(pdo, 0)),
            2: Item("Transmission type", U8, "rw", "-", pdo.kind),
            5: Item("Event timer", U16, "rw", "-", 0),
        }
        name = f"RPDO {number + 1}"
        rows.append(ObjectRow(0x1400 + number, f"{name} communication parameter", RECORD, communication))
        rows.append(_mapping(0x1600 + number, f"{name} mapping parameter", pdo.objects))
    return rows


def _transmit_pdos(pdos: Sequence[PdoDefaults]) -> list[ObjectRow]:
    rows: list[ObjectRow] = []
    for number, pdo in enumerate(pdos):
        communication = {
            0: Item("Highest sub-index supported", U8, "const", "-", 6),
            1: Item("COB-ID", U32, "rw", "-", _cob_id(pdo, _NO_RTR)),
            2: Item("Transmission type", U8, "rw", "-", pdo.kind),
            3: Item("Inhibit time", U16, "rw", "-", 0),
            5: Item("Event timer", U16, "rw", "-", 0),
            6: Item("SYNC start value", U8, "rw", "-", 0),
        }
        name = f"TPDO {number + 1}"
        rows.append(ObjectRow(0x1800 + number, f"{name} communication parameter", RECORD, communication))
        rows.append(_mapping(0x1A00 + number, f"{name} mapping parameter", pdo.objects))
    return rows
