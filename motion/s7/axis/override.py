"""What a new job does to a running one, and what becomes of itself: the overriding
tables as data (OVR-001 to OVR-121).

A job is named by its instruction and what distinguishes it: `MC_Halt Mode 1`, `MC_MoveAbsolute waiting`. Rows
are new jobs, columns running ones. Cells speak of the running job, fates of the new one.
`Overriding` is what an axis asks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from motion.s7.axis.jobs import JobClass

CELLS: Final = {
    "A": "aborted with CommandAborted",
    "B": "see the note of the table",
    "C": "see the note of the table",
    "N": "goes on; the new job is refused",
    "-": "goes on",
}
"""Letters of the running job (OVR-001 to OVR-007)."""

FATES: Final = {
    "T": "takes over",
    "P": "runs in parallel",
    "W": "waits",
    "R": "refused",
    "D": "Done at once",
    "?": "not said by the source",
}
"""Letters of the new job (OVR-084 to OVR-102)."""


@dataclass(frozen=True)
class Row:
    """New jobs that are treated alike.

    Args:
        identifier: Requirement of the row.
        jobs: Names of the new jobs.
        cells: One letter of `CELLS` per column, with `/` or `,` between alternatives.
        fates: One letter of `FATES` per column; empty = as the cells alone say.

    """

    identifier: str
    jobs: tuple[str, ...]
    cells: tuple[str, ...]
    fates: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Cell:
    """One running job under one new job."""

    table: str
    identifier: str
    column: str
    new: str
    active: str
    letter: str
    fate: str


@dataclass(frozen=True)
class OverrideTable:
    """A table of the specification: running jobs by column, new jobs by row."""

    section: str
    title: str
    columns: dict[str, tuple[str, ...]]
    rows: tuple[Row, ...]
    notes: dict[str, str] = field(default_factory=dict)
    """Meaning of letters that differ from `CELLS`."""

    def cells(self) -> Iterator[Cell]:
        """Return every running job under every new job (OVR-117)."""
        for row in self.rows:
            fates = row.fates or tuple({"A": "T", "N": "R"}.get(letter, "?") for letter in row.cells)
            for (column, running), letter, fate in zip(self.columns.items(), row.cells, fates, strict=True):
                for new in row.jobs:
                    for active in running:
                        yield Cell(self.section, row.identifier, column, new, active, letter, fate)

    def row(self, identifier: str) -> tuple[str, ...]:
        """Return the letters of a row, one cell per column."""
        return next(row.cells for row in self.rows if row.identifier == identifier)


def _row(identifier: str, jobs: tuple[str, ...], cells: str, fates: str = "") -> Row:
    return Row(identifier, jobs, tuple(cells.split()), tuple(fates.split()))


_POSITIONING: Final = ("MC_MoveAbsolute", "MC_MoveRelative")
_APPENDED: Final = tuple(f"{name} BufferMode 1" for name in _POSITIONING)
_ACTIVE_HOMING: Final = ("MC_Home Mode 3", "MC_Home Mode 5")
_MOTION_IN: Final = ("MC_MotionInVelocity", "MC_MotionInPosition")
_SUPERIMPOSED: Final = ("MC_MoveSuperimposed", "MC_MotionInSuperimposed", "MC_HaltSuperimposed")
_SINGLE: Final = (*_POSITIONING, "MC_MoveVelocity", "MC_MoveJog")
_SYNC_WAITING: Final = ("MC_GearInPos waiting", "MC_CamIn waiting")
_SYNC_ACTIVE: Final = ("MC_GearInPos active", "MC_CamIn active")
_PHASING: Final = ("MC_PhasingAbsolute", "MC_PhasingRelative")
_OFFSET: Final = ("MC_OffsetAbsolute", "MC_OffsetRelative")
_OUT_WAITING: Final = ("MC_GearOut waiting", "MC_CamOut waiting")
_OUT_ACTIVE: Final = ("MC_GearOut active", "MC_CamOut active")

MOTION: Final = OverrideTable(
    "3.1",
    "Homing and motion jobs",
    {
        "H1": ("MC_Home Mode 2", "MC_Home Mode 8", "MC_Home Mode 10"),
        "H2": _ACTIVE_HOMING,
        "H3": ("MC_Halt Mode 1", *_SINGLE, *_APPENDED),
        "H4": tuple(f"{name} waiting" for name in _POSITIONING),
        "H5": ("MC_Halt Mode 0",),
        "H6": ("MC_Stop",),
        "H7": _SUPERIMPOSED,
        "H8": _MOTION_IN,
    },
    (
        _row("OVR-011", _ACTIVE_HOMING, "A A A A A - A A", "T T T T T R T T"),
        _row("OVR-012", ("MC_Home Mode 9",), "A - - - - - - -", "D D D D D D D D"),
        _row("OVR-013", ("MC_Halt Mode 1",), "- A A A - - - A", "P T T T W R P T"),
        _row("OVR-014", ("MC_Halt Mode 0", *_SINGLE, *_MOTION_IN), "- A A A A - A A", "P T T T T R T T"),
        _row("OVR-015", _APPENDED, "- - - - - - - -", "P W W W W R P W"),
        _row("OVR-016", _SUPERIMPOSED, "- - - - - - A -", "P R P P P R T P"),
        _row("OVR-017", ("MC_Stop",), "A A A A A B A A", "T T T T T T T T"),
        _row("OVR-018", ("MC_GearIn", "MC_GearInVelocity"), "- A A A A - A A", "P T T T T R T T"),
        _row("OVR-019", _SYNC_WAITING, "- - - A - - - -", "P W W W W R W W"),
        _row("OVR-020", _SYNC_ACTIVE, "- A A A A - A A", "P T T T T R T T"),
        _row("OVR-021", ("MC_LeadingValueAdditive",), "- - - - - - - -", "P P P P P P P P"),
        _row("OVR-022", _OUT_WAITING, "- - - - - - - -", "R R R R R R W R"),
        _row("OVR-023", _OUT_ACTIVE, "- - - - - - A -", "R R R R R R T R"),
    ),
    {
        "B": "an MC_Stop of equal or higher stop response aborts the running one, a lower one ends itself "
        "with CommandAborted",
    },
)

SYNCHRONOUS: Final = OverrideTable(
    "3.2",
    "Synchronous operation jobs",
    {
        "S1": ("MC_GearIn",),
        "S2": ("MC_GearInVelocity",),
        "S3": _SYNC_WAITING,
        "S4": _SYNC_ACTIVE,
        "S5": _PHASING,
        "S6": _OFFSET,
        "S7": ("MC_LeadingValueAdditive",),
        "S8": _OUT_WAITING,
        "S9": _OUT_ACTIVE,
    },
    (
        _row("OVR-025", _ACTIVE_HOMING, "A A - - - - - - -", "T T P R R R P R R"),
        _row(
            "OVR-026",
            ("MC_Halt Mode 0", "MC_Halt Mode 1", *_SINGLE),
            "A A - A A A - A A",
            "T T P T T T P T T",
        ),
        _row("OVR-027", _APPENDED, "- - - - - - - - -", "W W P W W W P W W"),
        _row("OVR-028", _MOTION_IN, "A A - A A A - A A", "T T P T T T P T T"),
        _row("OVR-029", _SUPERIMPOSED, "- -/N - - - - - - -", "P P P P P P P P P"),
        _row("OVR-030", ("MC_Stop",), "A A A A A A - A A", "T T T T T T P T T"),
        _row("OVR-031", ("MC_GearIn", "MC_GearInVelocity"), "A A A A A A - A A", "T T T T T T P T T"),
        _row("OVR-032", _SYNC_WAITING, "- - A - - - - A -", "W W W W W W W W W"),
        _row("OVR-033", _SYNC_ACTIVE, "A A/N A A A A - A A", "T T T T T T P T T"),
        _row("OVR-034", _PHASING, "- N - - A N - - -", "P R R P T R P P R"),
        _row("OVR-035", _OFFSET, "- N - - N A - - -", "P R R P R T P P R"),
        _row("OVR-036", ("MC_LeadingValueAdditive",), "- - - - - - A - -", "P P P P P P T P P"),
        _row("OVR-037", _OUT_WAITING, "- N A - - - - A -", "W R D W W W W W R"),
        _row("OVR-038", _OUT_ACTIVE, "A N A A A A - A -", "T R D T T T P T R"),
    ),
    {
        "-/N": "in position control the running job goes on, without it the new job is refused",
        "A/N": "in position control the running job is aborted, without it the new job is refused (OVR-039)",
    },
)

_MEASURING: Final = ("MC_MeasuringInput", "MC_MeasuringInputCyclic")
MEASURING: Final = OverrideTable(
    "3.3",
    "Measuring-input jobs",
    {"M1": _MEASURING[:1], "M2": _MEASURING[1:]},
    (
        _row("OVR-041", tuple(f"MC_Home Mode {mode}" for mode in (2, 3, 5, 8, 9, 10)), "B B", "T T"),
        _row("OVR-042", tuple(f"MC_Home Mode {mode}" for mode in (0, 1, 6, 7, 11, 12, 13)), "- -", "D D"),
        _row("OVR-043", (*_MEASURING, "MC_AbortMeasuringInput"), "A A"),
    ),
    {"B": "ended with Error, 16#80A3"},
)

_PATHS: Final = tuple(
    f"MC_Move{kind}{way}" for kind in ("Linear", "Circular", "Direct") for way in ("Absolute", "Relative")
)
_ZONES: Final = (
    "MC_DefineWorkspaceZone",
    "MC_DefineKinematicsZone",
    "MC_SetWorkspaceZoneActive",
    "MC_SetWorkspaceZoneInactive",
    "MC_SetKinematicsZoneActive",
    "MC_SetKinematicsZoneInactive",
)
KINEMATICS: Final = OverrideTable(
    "3.4",
    "Single-axis jobs and kinematics jobs",
    {
        "K1": (*_PATHS, "MC_TrackConveyorBelt", *_ZONES, "MC_SetOcsFrame"),
        "K2": ("MC_GroupInterrupt",),
        "K3": ("MC_GroupStop",),
    },
    (
        _row("OVR-045", ("MC_Home", "MC_MoveSuperimposed", "MC_GearOut", "MC_CamOut"), "N N N"),
        _row(
            "OVR-046",
            (
                "MC_Halt",
                *_SINGLE,
                "MC_Stop",
                "MC_GearIn",
                "MC_GearInPos",
                "MC_GearInVelocity",
                "MC_CamIn",
                *_MOTION_IN,
            ),
            "A A A",
        ),
        _row("OVR-047", ("MC_GroupStop",), "A A N"),
        _row("OVR-048", ("MC_GroupInterrupt", "MC_GroupContinue"), "B A N", "T T R"),
        _row("OVR-049", (*_PATHS, "MC_TrackConveyorBelt", *_ZONES), "- - N", "W W R"),
        _row("OVR-050", ("MC_SetOcsFrame",), "C,- - N", "W W R"),
        _row("OVR-053", (*_APPENDED, "MC_HaltSuperimposed", "MC_MotionInSuperimposed"), "N N N"),
    ),
    {
        "B": "interrupted, or continued",
        "C,-": "the synchronisation of the OCS with a conveyor is aborted, anything else goes on",
    },
)

INTERPRETER: Final = OverrideTable(
    "3.5",
    "Interpreter jobs",
    {"I1": ("MC_LoadProgram",), "I2": ("MC_RunProgram",), "I3": ("MC_StopProgram",)},
    (
        _row("OVR-054", ("MC_LoadProgram",), "- - -"),
        _row("OVR-055", ("MC_RunProgram",), "- - -", "P ? ?"),
        _row("OVR-056", ("MC_StopProgram",), "A A A"),
        _row("OVR-057", ("MC_Reset",), "- - -"),
    ),
)

TABLES: Final = (MOTION, SYNCHRONOUS, MEASURING, KINEMATICS, INTERPRETER)


@dataclass(frozen=True)
class InterpreterRow:
    """What jobs of the user program do while the interpreter controls their object (table 3.5, second part).

    Args:
        identifier: Requirement of the row.
        jobs: Names of the jobs.
        executed: Whether the job is executed.
        aborts: `yes`, `no`, or when it aborts the program of the interpreter.

    """

    identifier: str
    jobs: tuple[str, ...]
    executed: bool
    aborts: str


def _interpreted(number: int, jobs: str, executed: bool, aborts: str = "no") -> InterpreterRow:
    return InterpreterRow(
        f"OVR-{number:03}", tuple(f"MC_{job}" for job in jobs.split(", ")), executed, aborts
    )


UNDER_INTERPRETER: Final = (
    _interpreted(58, "Power", True, "yes"),
    _interpreted(59, "Reset Restart TRUE", True, "yes"),
    _interpreted(60, "Reset Restart FALSE", True),
    _interpreted(61, "Home, Halt, Stop", True, "yes"),
    _interpreted(62, "MoveAbsolute, MoveRelative, MoveVelocity, MoveJog", True, "yes"),
    _interpreted(63, "SetAxisSTW, WriteParameter", True),
    _interpreted(64, "MoveSuperimposed, MotionInSuperimposed, HaltSuperimposed", False),
    _interpreted(65, "MotionInVelocity, MotionInPosition", True, "yes"),
    _interpreted(
        66,
        "GearIn, GearInPos, GearInVelocity, GearOut, CamIn, CamOut",
        True,
        "when (de)synchronisation starts",
    ),
    _interpreted(67, "PhasingRelative, PhasingAbsolute", False),
    _interpreted(68, "LeadingValueAdditive", True),
    _interpreted(69, "OffsetRelative, OffsetAbsolute", False),
    _interpreted(70, "TorqueAdditive, TorqueRange", True),
    _interpreted(71, "TorqueLimiting", True, "by an alarm of the fixed stop"),
    _interpreted(72, "SynchronizedMotionSimulation", True),
    _interpreted(73, ", ".join(name.removeprefix("MC_") for name in _PATHS), False),
    _interpreted(74, "GroupInterrupt, GroupContinue", False),
    _interpreted(75, "GroupStop", True, "yes"),
    _interpreted(76, "KinematicsMotionSimulation", True),
    _interpreted(77, "TrackConveyorBelt", False),
    _interpreted(78, "DefineTool, SetTool, SetOcsFrame", False),
    _interpreted(79, "KinematicsTransformation, InverseKinematicsTransformation", True),
    _interpreted(80, ", ".join(name.removeprefix("MC_") for name in _ZONES), False),
)
"""Rows OVR-058 to OVR-080."""


COLUMNS: Final = (*MOTION.columns, *SYNCHRONOUS.columns)
"""H1 passive homing; H2 active homing; H3 `MC_Halt` Mode 1, positioning in control, `MC_MoveVelocity`,
`MC_MoveJog`; H4 positioning that waits; H5 `MC_Halt` Mode 0; H6 `MC_Stop`; H7 superimposed; H8 MotionIn;
S1 `MC_GearIn`; S2 `MC_GearInVelocity` in position control; S3, S4 `MC_GearInPos` and `MC_CamIn` waiting and
active; S5 phasing; S6 offset; S7 additive leading value; S8, S9 `MC_GearOut` and `MC_CamOut` waiting and
active.
"""


def _whole(motion: str, synchronous: str) -> tuple[str, ...]:
    return MOTION.row(motion) + SYNCHRONOUS.row(synchronous)


TABLE: Final[dict[str, tuple[str, ...]]] = {
    "MC_Home 3, 5": _whole("OVR-011", "OVR-025"),
    "MC_Home 9": MOTION.row("OVR-012") + ("-",) * len(SYNCHRONOUS.columns),
    "MC_Halt 1": _whole("OVR-013", "OVR-026"),
    "move": _whole("OVR-014", "OVR-026"),
    "MotionIn": _whole("OVR-014", "OVR-028"),
    "BufferMode 1": _whole("OVR-015", "OVR-027"),
    "superimposed": _whole("OVR-016", "OVR-029"),
    "MC_Stop": _whole("OVR-017", "OVR-030"),
    "MC_GearIn": _whole("OVR-018", "OVR-031"),
    "sync waiting": _whole("OVR-019", "OVR-032"),
    "sync active": _whole("OVR-020", "OVR-033"),
    "desync waiting": _whole("OVR-022", "OVR-037"),
    "desync active": _whole("OVR-023", "OVR-038"),
}
"""Rows of tables 3.1 and 3.2 over all columns. "move" is OVR-014: `MC_Halt` Mode 0, positioning with
`BufferMode` 0, `MC_MoveVelocity`, `MC_MoveJog`; "MotionIn" `MC_MotionInVelocity`, `MC_MotionInPosition`.
"""

_OTHER_BEFORE_V9: Final = {
    ("OVR-018", "H8"): ("-", "R"),
    ("OVR-020", "H8"): ("-", "W"),
    ("OVR-028", "S3"): ("A", "T"),
}
"""Cells of V7 and V8 that differ, with the fate of the new job (SYN-458 to SYN-460)."""


def _exists_before_v9(job: str) -> bool:
    """Return whether V7 and V8 have a job: there is neither `MC_Halt.Mode` nor `BufferMode`."""
    return "BufferMode" not in job and job not in {
        "MC_Halt Mode 1",
        "MC_MoveAbsolute waiting",
        "MC_MoveRelative waiting",
    }


def before_v9(table: OverrideTable) -> OverrideTable:
    """Return what V7 and V8 have of a table (SYN-257, SYN-462)."""
    columns = {name: tuple(filter(_exists_before_v9, jobs)) for name, jobs in table.columns.items()}
    kept = [number for number, jobs in enumerate(columns.values()) if jobs]
    rows = []
    for row in table.rows:
        jobs = tuple(filter(_exists_before_v9, row.jobs))
        if not jobs:
            continue
        cells, fates = list(row.cells), list(row.fates)
        for number, name in enumerate(columns):
            other = _OTHER_BEFORE_V9.get((row.identifier, name))
            if other is not None:
                cells[number], fates[number] = other
        taken = [cells[number] for number in kept]
        rows.append(Row(row.identifier, jobs, tuple(taken), tuple(fates[number] for number in kept if fates)))
    columns = {name: jobs for name, jobs in columns.items() if jobs}
    return OverrideTable(table.section, table.title, columns, tuple(rows), table.notes)


TABLE_BEFORE_V9: Final[dict[str, tuple[str, ...]]] = TABLE | {
    "MC_GearIn": (*MOTION.row("OVR-018")[:-1], "-", *SYNCHRONOUS.row("OVR-031")),
    "sync active": (*MOTION.row("OVR-020")[:-1], "-", *SYNCHRONOUS.row("OVR-033")),
    "MotionIn": tuple(
        "A" if column == "S3" else letter for column, letter in zip(COLUMNS, TABLE["MotionIn"], strict=True)
    ),
}
"""`TABLE` of V7 and V8."""

_ROW: Final = {
    JobClass.HALT_BASIC: "MC_Halt 1",
    JobClass.HALT: "move",
    JobClass.POSITIONING: "move",
    JobClass.VELOCITY: "move",
    JobClass.MOTION_IN: "MotionIn",
    JobClass.STOP: "MC_Stop",
    JobClass.SUPERIMPOSED: "superimposed",
    JobClass.HOMING: "MC_Home 3, 5",
    JobClass.GEAR_IN: "MC_GearIn",
    JobClass.GEAR_IN_VELOCITY: "MC_GearIn",
    JobClass.SYNCHRONISE: "sync active",
    JobClass.DESYNCHRONISE: "desync active",
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
    JobClass.GEAR_IN: "S1",
    JobClass.GEAR_IN_VELOCITY: "S2",
    JobClass.SYNCHRONISE: "S4",
    JobClass.DESYNCHRONISE: "S9",
}
_COLUMN_WAITING: Final = {
    JobClass.POSITIONING: "H4",
    JobClass.SYNCHRONISE: "S3",
    JobClass.DESYNCHRONISE: "S8",
}
_ROW_WAITING: Final = {JobClass.SYNCHRONISE: "sync waiting", JobClass.DESYNCHRONISE: "desync waiting"}


class Overriding:
    """What a new job does to a running one, of one technology version.

    Args:
        table: Rows of new jobs over all `COLUMNS`.

    """

    def __init__(self, table: Mapping[str, tuple[str, ...]]) -> None:
        self._table = table

    def cell(self, row: str, column: str) -> str:
        """Return the cell of a new job `row` over an active job `column`."""
        return self._table[row][COLUMNS.index(column)]

    def aborts(self, new: JobClass, active: JobClass, *, append: bool = False) -> bool:
        """Return whether a new job of class `new`, with `append` one with `BufferMode` 1, aborts an active
        one (cell `A`).
        """
        return self.cell("BufferMode 1" if append else _ROW[new], _COLUMN[active]).startswith("A")

    def aborts_waiting(
        self, new: JobClass, waiting: JobClass, *, waits: bool = False, append: bool = False
    ) -> bool:
        """Return whether a new job of class `new` aborts one that waits; `waits`: the new one waits, too;
        `append`: with `BufferMode` 1.
        """
        row = "BufferMode 1" if append else _ROW_WAITING[new] if waits else _ROW[new]
        return self.cell(row, _COLUMN_WAITING[waiting]) == "A"


V9: Final = Overriding(TABLE)
BEFORE_V9: Final = Overriding(TABLE_BEFORE_V9)
"""The same of V7 and V8, which are alike (SYN-257)."""
