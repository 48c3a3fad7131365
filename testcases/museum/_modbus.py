"""Modbus clients that take an answer for another one."""

from __future__ import annotations

from typing import Final

from hil.museum import FieldError, Source
from testcases.museum._seeds import known

_AREA: Final = "Modbus"

ENTRIES: Final[tuple[FieldError, ...]] = (
    FieldError(
        name="late-answer-to-the-next-request",
        title="An answer that comes late is taken for that to the next request",
        area=_AREA,
        sources=(
            Source(
                "pymodbus-dev/pymodbus, pull request 2636",
                "https://github.com/pymodbus-dev/pymodbus/pull/2636",
            ),
            Source("rfporter/Modbus-Master, issue 1", "https://github.com/rfporter/Modbus-Master/issues/1"),
            Source("goburrow/modbus, issue 64", "https://github.com/goburrow/modbus/issues/64"),
        ),
        happened=(
            "A request timed out, the next one was sent, and then the first answer came. Clients without a "
            "look at the transaction identifier give the registers of one request to another; others "
            "notice, throw the answer away as an error, and stay one answer behind for ever."
        ),
        on_the_bus="The transaction identifier of an answer is that of an earlier request.",
        found_by=(
            "Delay one answer by more than the time-out. The request has to fail or be repeated, and the "
            "one behind it has to get its own values."
        ),
        campaign="modbus_faults",
        case="modbus-faults/wrong-transaction/standstill",
        bench="profidrive_tcp",
        defect=known("transaction-ignored"),
    ),
)
