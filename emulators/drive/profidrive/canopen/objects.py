"""The objects that the PROFIdrive axis shows on CANopen: free process data words and a few parameters (PD-338
to PD-343).
"""

from __future__ import annotations

from typing import Final

from emulators.process_words import RECEIVE_WORD, SEND_WORD, WORDS
from fieldbus.canopen.communication_objects import PdoDefaults, communication_objects
from fieldbus.canopen.object_table import I16, U16, U32, ObjectRow, var

ABORT_CONNECTION: Final = 0x6007
DIGITAL_INPUTS: Final = 0x2000 + 722
FAULT_NUMBER: Final = 0x2000 + 2131
WARNING_NUMBER: Final = 0x2000 + 2132

DEVICE_NAME: Final = "Emulated servo drive PROFIdrive"
PRODUCT_CODE: Final = 0x3000

_NOT_VALID: Final = PdoDefaults(None, 254, ())


def all_objects() -> tuple[ObjectRow, ...]:
    """Return the whole table in ascending order."""
    rows = (
        *communication_objects(
            device_type=0,
            device_name=DEVICE_NAME,
            product_code=PRODUCT_CODE,
            error_classes=("Communication error",),
            rpdos=(
                PdoDefaults(0x200, 254, (0x58000010,)),
                PdoDefaults(0x300, 254, (0x58000010, 0x58010010)),
                *[_NOT_VALID] * 6,
            ),
            tpdos=(
                PdoDefaults(0x180, 254, (0x58100010,)),
                PdoDefaults(0x280, 254, (0x58100010, 0x58110010)),
                *[_NOT_VALID] * 6,
            ),
        ),
        *(
            var(RECEIVE_WORD + word, f"Free PZD receive word {word + 1}", I16, "rw", "R", volatile=True)
            for word in range(WORDS)
        ),
        *(
            var(SEND_WORD + word, f"Free PZD send word {word + 1}", I16, "ro", "T", volatile=True)
            for word in range(WORDS)
        ),
        var(DIGITAL_INPUTS, "r0722 digital inputs", U32, "ro", "T"),
        var(FAULT_NUMBER, "r2131 fault number", U16, "ro", "T"),
        var(WARNING_NUMBER, "r2132 warning number", U16, "ro", "T"),
        var(ABORT_CONNECTION, "Abort connection option code", I16, "rw", "-", 3),
    )
    return tuple(sorted(rows, key=lambda row: row.index))
