"""Why access to a data record is refused, as in Error_Code_1 of PROFINET (PD-232)."""

from __future__ import annotations

from enum import IntEnum

from fieldbus.errors import BusError


class RecordError(IntEnum):
    """Error_Code_1; A0h to A9h of the application, B0h to B9h of the access."""

    READ = 0xA0
    WRITE = 0xA1
    MODULE = 0xA2
    BUSY = 0xA7
    VERSION = 0xA8
    NOT_SUPPORTED = 0xA9
    INDEX = 0xB0
    LENGTH = 0xB1
    SLOT = 0xB2
    TYPE_CONFLICT = 0xB3
    STATE_CONFLICT = 0xB5
    DENIED = 0xB6
    RANGE = 0xB7
    PARAMETER = 0xB8
    TYPE = 0xB9

    @property
    def text(self) -> str:
        """A few words."""
        return _TEXTS[self]


_TEXTS = {
    RecordError.READ: "reading failed",
    RecordError.WRITE: "writing failed",
    RecordError.MODULE: "module failed",
    RecordError.BUSY: "busy",
    RecordError.VERSION: "version conflict",
    RecordError.NOT_SUPPORTED: "not supported",
    RecordError.INDEX: "no such record",
    RecordError.LENGTH: "wrong length",
    RecordError.SLOT: "no such slot",
    RecordError.TYPE_CONFLICT: "type conflict",
    RecordError.STATE_CONFLICT: "state conflict",
    RecordError.DENIED: "denied",
    RecordError.RANGE: "out of range",
    RecordError.PARAMETER: "wrong parameter",
    RecordError.TYPE: "wrong type",
}


class RecordRefusedError(BusError):
    """Access to a data record was refused.

    Args:
        code: Why.

    """

    def __init__(self, code: RecordError) -> None:
        super().__init__(f"{code:02X}h: {code.text}")
        self.code = code
