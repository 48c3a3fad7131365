"""The override table of homing and motion jobs as data (table 3.1 of the instruction specification).

Rows are new jobs, columns jobs that are active. `A`: the active job is aborted; `B`: `MC_Stop` over `MC_Stop` by
severity; `-`: no effect on the active job.
"""

from __future__ import annotations

from typing import Final

from motion.axis.jobs import JobClass

COLUMNS: Final = ("H1", "H2", "H3", "H4", "H5", "H6", "H7", "H8")
"""H1 passive homing; H2 active homing; H3 `MC_Halt` Mode 1, positioning in control, `MC_MoveVelocity`,
`MC_MoveJog`; H4 positioning that waits; H5 `MC_Halt` Mode 0; H6 `MC_Stop`; H7 superimposed; H8 MotionIn."""

TABLE: Final[dict[str, str]] = {
    "MC_Home 3, 5": "AAAAA-AA",
    "MC_Home 9": "A-------",
    "MC_Halt 1": "-AAA---A",
    "move": "-AAAA-AA",
    "BufferMode 1": "--------",
    "superimposed": "------A-",
    "MC_Stop": "AAAAABAA",
}
"""Rows OVR-011 to OVR-017; "move" is OVR-014: `MC_Halt` Mode 0, positioning with `BufferMode` 0,
`MC_MoveVelocity`, `MC_MoveJog`."""

_ROW: Final = {
    JobClass.HALT_BASIC: "MC_Halt 1",
    JobClass.HALT: "move",
    JobClass.POSITIONING: "move",
    JobClass.VELOCITY: "move",
    JobClass.STOP: "MC_Stop",
    JobClass.SUPERIMPOSED: "superimposed",
}
_COLUMN: Final = {
    JobClass.HALT_BASIC: "H3",
    JobClass.POSITIONING: "H3",
    JobClass.VELOCITY: "H3",
    JobClass.HALT: "H5",
    JobClass.STOP: "H6",
    JobClass.SUPERIMPOSED: "H7",
}


def cell(row: str, column: str) -> str:
    """Return the cell of a new job `row` over an active job `column`."""
    return TABLE[row][COLUMNS.index(column)]


def aborts(new: JobClass, active: JobClass, *, append: bool = False) -> bool:
    """Return whether a new job of class `new`, with `append` one with `BufferMode` 1, aborts an active one (cell `A`)."""
    return cell("BufferMode 1" if append else _ROW[new], _COLUMN[active]) == "A"
