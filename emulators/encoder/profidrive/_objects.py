"""The objects that a PROFIdrive encoder shows on CANopen: free process data words, and a few parameters
(PD-338 to PD-343).

Its PDOs are mapped when it leaves the factory: the two words of the controller in RPDO1, up to ten words to
him in TPDO1 to TPDO3, all of them with every SYNC.
"""

from __future__ import annotations

from typing import Final

from emulators.encoder.profidrive.format import ELEMENTS
from fieldbus.canopen.communication_objects import PdoDefaults, communication_objects
from fieldbus.canopen.object_table import I16, U16, U32, ObjectRow, array, var

RECEIVE_WORD: Final = 0x5800
SEND_WORD: Final = 0x5810
WORDS_IN: Final = 2
WORDS_OUT: Final = 10
WORDS_PER_PDO: Final = 4
TELEGRAM: Final = 0x2000 + 922
PROFILE: Final = 0x2000 + 965
FORMAT: Final = 0x2000 + 979
FAULT_NUMBER: Final = 0x2000 + 2131

DEVICE_NAME: Final = "Emulated encoder PROFIdrive"
PRODUCT_CODE: Final = 0x3100
PROFILE_NUMBER: Final = 3 << 8 | 41
"""Profile 3, version 4.1."""


def _mapped(first: int, words: range) -> tuple[int, ...]:
    return tuple((first + word) << 16 | 0x10 for word in words)


def all_objects() -> tuple[ObjectRow, ...]:
    """Return the whole table in ascending order."""
    step = WORDS_PER_PDO
    rows = (
        *communication_objects(
            device_type=0,
            device_name=DEVICE_NAME,
            product_code=PRODUCT_CODE,
            error_classes=("Communication error",),
            rpdos=(PdoDefaults(0x200, 1, _mapped(RECEIVE_WORD, range(WORDS_IN))),),
            tpdos=tuple(
                PdoDefaults(
                    0x180 + 0x100 * number,
                    1,
                    _mapped(SEND_WORD, range(step * number, min(step * number + step, WORDS_OUT))),
                )
                for number in range(-(-WORDS_OUT // step))
            ),
        ),
        *(
            var(RECEIVE_WORD + word, f"Free PZD receive word {word + 1}", I16, "rw", "R", volatile=True)
            for word in range(WORDS_IN)
        ),
        *(
            var(SEND_WORD + word, f"Free PZD send word {word + 1}", I16, "ro", "T", volatile=True)
            for word in range(WORDS_OUT)
        ),
        var(TELEGRAM, "p0922 telegram", U16, "ro"),
        var(PROFILE, "r0965 profile number", U16, "ro", "-", PROFILE_NUMBER),
        array(FORMAT, "r0979 encoder format", tuple(f"r0979[{at}]" for at in range(ELEMENTS)), U32, "ro"),
        var(FAULT_NUMBER, "r2131 fault number", U16, "ro", "T"),
    )
    return tuple(sorted(rows, key=lambda row: row.index))
