"""What an axis asks of the override table of homing and motion jobs (table 3.1,
`motion.s7.axis.override_tables`).

Rows are new jobs, columns jobs that are active. `A`: the active job is aborted; `B`: `MC_Stop` over `MC_Stop`
by severity; `-`: no effect on the active job.
"""

from __future__ import annotations

from typing import Final

from motion.s7.axis.jobs import JobClass
from motion.s7.axis.override_tables import MOTION

COLUMNS: Final = tuple(MOTION.columns)
"""H1 passive homing; H2 active homing; H3 `MC_Halt` Mode 1, positioning in control, `MC_MoveVelocity`,
`MC_MoveJog`; H4 positioning that waits; H5 `MC_Halt` Mode 0; H6 `MC_Stop`; H7 superimposed; H8 MotionIn."""

TABLE: Final[dict[str, str]] = {
    "MC_Home 3, 5": MOTION.row("OVR-011"),
    "MC_Home 9": MOTION.row("OVR-012"),
    "MC_Halt 1": MOTION.row("OVR-013"),
    "move": MOTION.row("OVR-014"),
    "BufferMode 1": MOTION.row("OVR-015"),
    "superimposed": MOTION.row("OVR-016"),
    "MC_Stop": MOTION.row("OVR-017"),
}
"""Rows OVR-011 to OVR-017; "move" is OVR-014: `MC_Halt` Mode 0, positioning with `BufferMode` 0,
`MC_MoveVelocity`, `MC_MoveJog`, `MC_MotionInVelocity`, `MC_MotionInPosition`."""

_ROW: Final = {
    JobClass.HALT_BASIC: "MC_Halt 1",
    JobClass.HALT: "move",
    JobClass.POSITIONING: "move",
    JobClass.VELOCITY: "move",
    JobClass.MOTION_IN: "move",
    JobClass.STOP: "MC_Stop",
    JobClass.SUPERIMPOSED: "superimposed",
    JobClass.HOMING: "MC_Home 3, 5",
}
_COLUMN: Final = {
    JobClass.HALT_BASIC: "H3",
    JobClass.POSITIONING: "H3",
    JobClass.VELOCITY: "H3",
    JobClass.HALT: "H5",
    JobClass.STOP: "H6",
    JobClass.SUPERIMPOSED: "H7",
    JobClass.MOTION_IN: "H8",
    JobClass.HOMING: "H2",
    JobClass.PASSIVE_HOMING: "H1",
}


def cell(row: str, column: str) -> str:
    """Return the cell of a new job `row` over an active job `column`."""
    return TABLE[row][COLUMNS.index(column)]


def aborts(new: JobClass, active: JobClass, *, append: bool = False) -> bool:
    """Return whether a new job of class `new`, with `append` one with `BufferMode` 1, aborts an active one
    (cell `A`).
    """
    return cell("BufferMode 1" if append else _ROW[new], _COLUMN[active]) == "A"
