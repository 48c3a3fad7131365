"""Communication objects 1000h..1FFFh of the drive, and its default PDOs (C402-279 to C402-294)."""

from __future__ import annotations

from typing import Final

from fieldbus.canopen import communication_objects as rows
from fieldbus.canopen.communication_objects import PdoDefaults
from fieldbus.canopen.object_table import ObjectRow

DEVICE_TYPE: Final = 0x00020192
"""Servo drive of profile 402."""

_RPDOS: Final = (
    PdoDefaults(0x200, 255, (0x60400010,)),
    PdoDefaults(0x300, 255, (0x60400010, 0x60600008)),
    PdoDefaults(0x400, 1, (0x60400010, 0x607A0020)),
    PdoDefaults(0x500, 1, (0x60400010, 0x60FF0020)),
    PdoDefaults(None, 1, (0x60400010, 0x60710010)),
    PdoDefaults(None, 255, (0x60400010, 0x60420010)),
    PdoDefaults(None, 255, (0x60400010, 0x60FE0120)),
    PdoDefaults(None, 255, (0x60400010, 0x60600008)),
)
_TPDOS: Final = (
    PdoDefaults(0x180, 255, (0x60410010,)),
    PdoDefaults(0x280, 255, (0x60410010, 0x60610008)),
    PdoDefaults(0x380, 1, (0x60410010, 0x60640020)),
    PdoDefaults(0x480, 1, (0x60410010, 0x606C0020)),
    PdoDefaults(None, 1, (0x60410010, 0x60770010)),
    PdoDefaults(None, 255, (0x60410010, 0x60440010)),
    PdoDefaults(None, 255, (0x60410010, 0x60FD0020)),
    PdoDefaults(None, 1, (0x60B90010, 0x60BA0020)),
)


def communication_objects() -> tuple[ObjectRow, ...]:
    """Return the rows of 1000h..1FFFh."""
    return rows.communication_objects(
        device_type=DEVICE_TYPE,
        device_name="Emulated servo drive CiA 402",
        product_code=0x402,
        error_classes=("Communication error", "Drive error"),
        rpdos=_RPDOS,
        tpdos=_TPDOS,
    )
