"""What a new job does to a running one, and what becomes of itself: the table of homing and motion jobs
(OVR-011 to OVR-017), what it leaves open (OVR-084 to OVR-095), and the rules beside it (OVR-103 to OVR-111),
as data.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

LOCKED: Final = 0x800F
"""ErrorID: the object is locked (MC-010)."""
ALARM: Final = 0x8001
"""ErrorID: an alarm with a reaction (MC-002)."""

_COLUMNS: Final[Mapping[str, str]] = {
    "passive-2": "H1", "passive-8": "H1", "passive-10": "H1",
    "homing-3": "H2", "homing-5": "H2",
    "halt-basic": "H3", "absolute": "H3", "relative": "H3", "velocity": "H3", "jog": "H3",
    "absolute-waiting": "H4", "relative-waiting": "H4",
    "halt": "H5",
    "stop": "H6",
    "superimposed": "H7", "motion-in-superimposed": "H7", "halt-superimposed": "H7",
    "motion-in-velocity": "H8", "motion-in-position": "H8",
}  # fmt: skip
RUNNING: Final = tuple(_COLUMNS)
"""Running jobs, each of them in its column of the table."""
_TABLE: Final = """
OVR-011 homing-3 homing-5                                            : A A A A A - A A
OVR-012 cancel-homing                                                : A - - - - - - -
OVR-013 halt-basic                                                   : - A A A - - - A
OVR-014 halt absolute relative velocity jog motion-in-velocity motion-in-position : - A A A A - A A
OVR-015 absolute-buffered relative-buffered                          : - - - - - - - -
OVR-016 superimposed motion-in-superimposed halt-superimposed        : - - - - - - A -
OVR-017 stop                                                         : A A A A A B A A
OVR-087 passive-2 passive-8 passive-10                               : A ? - - - ? - -
OVR-088 position-set position-shifted                                : - - - - - - - -
OVR-104 reset                                                        : - - - - - - - -
OVR-106 parameter                                                    : - - - - - - - -
OVR-103 disable                                                      : A A A A A A A A
"""
"""A the running job is aborted, - it goes on, B it is aborted by a stop that is as strong; ?: nothing is
said."""
MOTION: Final = frozenset(
    {
        "homing-3", "homing-5", "halt-basic", "halt", "absolute", "relative", "velocity", "jog",
        "motion-in-velocity", "motion-in-position", "absolute-buffered", "relative-buffered",
        "superimposed", "motion-in-superimposed",
    }
)  # fmt: skip
"""New jobs that `MC_Stop` keeps from the axis (OVR-084)."""
_AT_ONCE: Final = frozenset(["cancel-homing", "position-set", "position-shifted", "reset", "parameter"])
"""New jobs that are done within a few cycles, whatever runs."""
_NOT_HOMED: Final = frozenset(["passive-8", "passive-10", "homing-3", "homing-5"])
"""Running jobs with which an axis with an incremental encoder is no longer homed (MC-216)."""


class Cell(NamedTuple):
    """A pair of jobs."""

    identifiers: tuple[str, ...]
    new: str
    aborts: bool
    """Whether the running job is aborted."""
    fate: str
    """Of the new job: `takes`, `beside`, `waits`, `done`, `refused`, `not homed` (alarm 321 ends both), or
    `open` (nothing is said)."""


def cells(running: str) -> list[Cell]:
    """Return the pairs of a running job with every new one of which the specification says something."""
    column = int(_COLUMNS[running][1]) - 1
    found = []
    for line in _TABLE.strip().splitlines():
        head, _, letters = line.partition(":")
        identifier, *jobs = head.split()
        letter = letters.split()[column]
        if letter == "?":
            continue
        for new in jobs:
            if running in _NOT_HOMED and new.startswith("absolute"):
                found.append(Cell(("MC-246", "MC-216"), new, False, "not homed"))
                continue
            more, fate = _fate(new, column + 1, letter)
            found.append(Cell((identifier, *more), new, letter in "AB", fate))
    return found


def _fate(new: str, column: int, letter: str) -> tuple[tuple[str, ...], str]:
    """Return what becomes of a new job (OVR-084 to OVR-095), with the identifiers that say so."""
    if new in _AT_ONCE:
        return (("OVR-086",) if new == "cancel-homing" else ()), "done"
    if new == "disable":
        return ("MC-163",), "takes"
    if letter in "AB":
        return ("OVR-001", "OVR-008"), "takes"
    if column == 6 and new in MOTION:
        return ("OVR-084", "MC-409"), "refused"
    if column == 1:
        return ("OVR-085", "OVR-115"), "beside" if new != "halt-superimposed" else "open"
    if new == "halt-superimposed":  # without a superimposed motion it has nothing to do (MC-369)
        return ("MC-369",), "open" if column in {2, 6} else "done"
    if new in {"superimposed", "motion-in-superimposed"}:
        return (("OVR-095",), "refused") if column == 2 else (("OVR-094",), "beside")
    if new in {"absolute-buffered", "relative-buffered"}:
        if column == 7:
            return ("OVR-093",), "beside"
        return (("OVR-092",) if column == 4 else ("OVR-091", "MC-267")), "waits"
    return (("OVR-089", "OVR-113") if column == 5 else ("OVR-090",)), "beside"
