"""What a program asks of devices on a bus, beside the controller's cyclic data, as steps: SDO, NMT, SYNC,
Modbus requests, PROFIdrive parameters, signals of the telegram of a drive without an axis.
"""

from __future__ import annotations

from typing import Final

from fieldbus.canopen.nmt import NmtCommand
from hil.faults import Parameter

_DEVICE: Final = Parameter("device", "text", "Drive, encoder, device or station, by name", required=True)
_OBJECT: Final = (
    Parameter("index", "int", "Index", minimum=0, maximum=0xFFFF, required=True),
    Parameter("sub", "int", "Sub-index", minimum=0, maximum=0xFF, default=0),
)
_NUMBER: Final = (
    Parameter("number", "int", "Number of the parameter", minimum=0, maximum=0xFFFF, required=True),
    Parameter("element", "int", "Sub-index", minimum=0, maximum=0xFFFF, default=0),
)

DEVICE_JOBS: Final[dict[str, tuple[Parameter, ...]]] = {
    "sdo_read": (
        _DEVICE,
        *_OBJECT,
        Parameter("block", "bool", "Whether the block protocol is asked for", default=False),
    ),
    "sdo_write": (_DEVICE, *_OBJECT, Parameter("data", "text", "Bytes, hexadecimal", required=True)),
    "sdo_frame": (_DEVICE, Parameter("data", "text", "Eight bytes, hexadecimal", required=True)),
    "nmt": (
        _DEVICE,
        Parameter(
            "command",
            "text",
            "NMT command",
            choices=tuple(NmtCommand.__members__),
            required=True,
        ),
    ),
    "sync": (
        _DEVICE,
        Parameter("period_ms", "float", "Period; 0: it ends", "ms", minimum=0.0, maximum=1000.0, default=4.0),
    ),
    "can_frame": (
        _DEVICE,
        Parameter("can_id", "int", "Identifier", minimum=0, maximum=0x7FF, required=True),
        Parameter("data", "text", "Bytes, hexadecimal", default=""),
    ),
    "modbus": (
        _DEVICE,
        Parameter("function", "int", "Function", minimum=1, maximum=127, required=True),
        Parameter(
            "address", "int", "First register or coil on the wire", minimum=0, maximum=0xFFFF, default=0
        ),
        Parameter("quantity", "int", "How many", minimum=0, maximum=0xFFFF, default=1),
        Parameter("values", "text", "What is written, numbers with spaces", default=""),
    ),
    "parameter_read": (_DEVICE, *_NUMBER),
    "parameter_write": (
        _DEVICE,
        *_NUMBER,
        Parameter("code", "int", "Data type", minimum=1, maximum=0xFF, default=8),
        Parameter("value", "float", "Value", required=True),
    ),
    "signal": (
        _DEVICE,
        Parameter("name", "text", "Signal of the telegram", required=True),
        Parameter("value", "int", "As the wire has it", required=True),
    ),
}
"""What is asked of devices, with its parameters."""
