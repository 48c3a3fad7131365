"""The overriding tables, cell by cell, for all instructions that exist (section 3 of the instruction
specification).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

import motion.s7.instructions as instructions
from motion.s7.axis.override import (
    COLUMNS,
    MOTION,
    SYNCHRONOUS,
    TABLE,
    TABLE_BEFORE_V9,
    TABLES,
    UNDER_INTERPRETER,
    before_v9,
)
from testcases.catalogue import each, requirements_in
from testcases.unit.motion_axis.conftest import Rig
from testcases.unit.motion_axis.override_cells import (
    ACTIVE,
    NEW,
    PAGE,
    SHIFTS,
    cells,
    exists,
    missing,
    other_kind,
    page,
    synchronous,
)

PRINTED = """
MC_Home 3, 5   A A A A A - A A A A - - - - - - -
MC_Home 9      A - - - - - - - - - - - - - - - -
MC_Halt 1      - A A A - - - A A A - A A A - A A
move           - A A A A - A A A A - A A A - A A
MotionIn       - A A A A - A A A A - A A A - A A
BufferMode 1   - - - - - - - - - - - - - - - - -
superimposed   - - - - - - A - - -/N - - - - - - -
MC_Stop        A A A A A B A A A A A A A A - A A
MC_GearIn      - A A A A - A A A A A A A A - A A
sync waiting   - - - A - - - - - - A - - - - A -
sync active    - A A A A - A A A A/N A A A A - A A
desync waiting - - - - - - - - - N A - - - - A -
desync active  - - - - - - A - A N A A A A - A -
"""
"""Tables 3.1 and 3.2, rows OVR-011 to OVR-023 and OVR-025 to OVR-038, as printed."""

PRINTED_BEFORE_V9 = """
MC_Home 3, 5   A A A - A A A A - - - - - - -
MC_Home 9      A - - - - - - - - - - - - - -
move           - A A - A A A A - A A A - A A
MotionIn       - A A - A A A A A A A A - A A
superimposed   - - - - A - - -/N - - - - - - -
MC_Stop        A A A B A A A A A A A A - A A
MC_GearIn      - A A - A - A A A A A A - A A
sync waiting   - - - - - - - - A - - - - A -
sync active    - A A - A - A A/N A A A A - A A
desync waiting - - - - - - - N A - - - - A -
desync active  - - - - A - A N A A A A - A -
"""
"""Tables of V7 and V8, without the rows and columns that they do not have."""
TESTABLE = [cell for cell in cells() if not missing(cell)]


def test_the_table_is_the_printed_one():
    """The data are the printed table, row by row."""
    printed = {}
    for line in PRINTED.strip().splitlines():
        name, letters = line[:14].strip(), line[14:].split()
        printed[name] = tuple(letters)
    assert printed == TABLE
    assert len(COLUMNS) == 17


@pytest.mark.requirement(
    *(f"SYN-{number}" for number in (255, 256, *range(450, 461), 462)), "SYN-349", "SYN-474", "SYN-475"
)
def test_the_table_before_v9_is_the_printed_one():
    """V7 and V8: the data are the printed table; against V9 three cells differ."""
    columns = [column for column in COLUMNS if column not in {"H4", "H5"}]
    for line in PRINTED_BEFORE_V9.strip().splitlines():
        name, letters = line[:14].strip(), line[14:].split()
        found = dict(zip(COLUMNS, TABLE_BEFORE_V9[name], strict=True))
        assert (name, [found[column] for column in columns]) == (name, letters)
    differ = {
        (name, column)
        for name, row in TABLE.items()
        for column, letter, other in zip(COLUMNS, row, TABLE_BEFORE_V9[name], strict=True)
        if letter != other
    }
    assert differ == {("MC_GearIn", "H8"), ("sync active", "H8"), ("MotionIn", "S3")}
    for table, whole in ((MOTION, TABLE), (SYNCHRONOUS, TABLE)):
        assert len(whole) == 13
        for row in before_v9(table).rows:
            assert len(row.cells) == len(before_v9(table).columns)


@pytest.mark.requirement("OVR-117", "OVR-118")
def test_size_of_the_tables():
    """Rows and columns as printed (3.4 with the row of what is not listed, OVR-053), and a letter for every
    cell.
    """
    sizes = [(table.section, len(table.rows), len(table.columns)) for table in TABLES]
    assert sizes == [("3.1", 13, 8), ("3.2", 14, 9), ("3.3", 3, 2), ("3.4", 7, 3), ("3.5", 4, 3)]
    assert len(UNDER_INTERPRETER) == 23
    for table in TABLES:
        assert all(len(row.cells) == len(table.columns) for row in table.rows)
        assert all(not row.fates or len(row.fates) == len(table.columns) for row in table.rows)


@pytest.mark.requirement("OVR-117", "OVR-118")
def test_every_cell_of_existing_instructions_can_be_brought_about():
    """An instruction that comes to exist needs a line in NEW and ACTIVE; without it this fails."""
    assert {cell.new for cell in TESTABLE} <= set(NEW)
    assert {cell.active for cell in TESTABLE} <= set(ACTIVE)
    assert len(TESTABLE) >= 143


def test_no_interpreter_yet():
    """As soon as there is one, the rows OVR-058 to OVR-080 need tests."""
    assert not hasattr(instructions, "MC_RunProgram")


def test_the_page_is_what_the_tables_say():
    """`docs/reference/overriding.md` is what `python -m testcases.unit.motion_axis.override_cells` writes."""
    assert PAGE.read_text(encoding="utf-8") == page()


FATE_ROWS = {
    ("OVR-013", "H5"): ["OVR-089"],
    ("OVR-013", "H7"): ["OVR-090"],
    ("OVR-015", "H2"): ["OVR-091", "MC-267"],
    ("OVR-015", "H3"): ["OVR-091", "MC-267"],
    ("OVR-015", "H4"): ["OVR-092"],
    ("OVR-015", "H5"): ["OVR-091", "MC-267"],
    ("OVR-015", "H7"): ["OVR-093"],
    ("OVR-015", "H8"): ["OVR-091", "MC-267"],
    **{("OVR-019", column): ["OVR-096"] for column in ("H2", "H3", "H5", "H7", "H8")},
    **{("OVR-022", column): ["OVR-102"] for column in ("H2", "H3", "H5", "H8")},
    ("OVR-025", "S3"): ["OVR-098"],
    ("OVR-025", "S4"): ["OVR-099"],
    ("OVR-025", "S9"): ["OVR-099"],
    ("OVR-026", "S3"): ["OVR-100"],
    ("OVR-028", "S3"): ["OVR-100"],
    ("OVR-037", "S1"): ["OVR-101"],
    ("OVR-037", "S4"): ["OVR-101"],
    ("OVR-016", "H2"): ["OVR-095"],
    ("OVR-016", "H3"): ["OVR-094"],
    ("OVR-016", "H4"): ["OVR-094"],
    ("OVR-016", "H5"): ["OVR-094"],
    ("OVR-016", "H8"): ["OVR-094"],
}
"""Rows of 3.6 by row and column of a cell with "-"."""


def identifiers(cell):
    """Return what a cell checks: its row, the meaning of its letter (3.0), and the fate of the new job
    (3.6).
    """
    meaning = "OVR-001" if cell.letter == "A" else "OVR-006" if cell.letter == "N" else "OVR-007"
    found = [cell.identifier, "OVR-117", "OVR-118", meaning]
    if cell.identifier in {"OVR-019", "OVR-032"} and cell.letter == "A":
        found.append("OVR-040")
    if cell.column == "S2" and cell.letter == "N":
        found.append("SYN-173")
    if cell.identifier in {"OVR-021", "OVR-036"} and cell.letter == "-":
        found.append("OVR-097")
    row = int(cell.identifier[4:])
    if 18 <= row <= 23 or 25 <= row <= 38:
        found.append(f"SYN-{row + 240}")
    if cell.letter == "A" and cell.fate == "T":
        found.append("OVR-008")
    if cell.identifier == "OVR-025" and cell.column == "S4":
        found += ["HOM-194", "MC-624"]
    if cell.fate == "R" and cell.column == "H6":
        found.append("OVR-084")
    elif cell.new == "MC_Home Mode 9":
        found.append("OVR-086")
    elif cell.column == "H1" and cell.letter == "-":
        found.append("OVR-085")
    elif cell.letter == "-":
        found += FATE_ROWS.get((cell.identifier, cell.column), [])
    return found


def running(rig, cell):
    """Bring the axis into the state that a column means; returns the running job."""
    rig.enabled()
    rig.axis.home(0.0)
    rig.cycles(2)
    if cell.column == "S7" and (cell.new.startswith(tuple(SHIFTS)) or "Out" in cell.new):
        gear = ACTIVE["MC_CamIn active" if "Cam" in cell.new else "MC_GearInPos active"](rig)
        rig.until(gear.in_sync)
    on_top = cell.column == "H7"
    if on_top and "BufferMode" not in cell.new:
        if "Out" in cell.new:  # it needs something to leave
            gear = ACTIVE["MC_GearInPos active" if "Gear" in cell.new else "MC_CamIn active"](rig)
            rig.until(gear.in_sync)
        else:
            rig.axis.move_velocity(60.0)
            rig.run(0.5)
    job = ACTIVE[cell.active](rig)
    if cell.active.startswith("MC_Home"):
        rig.axis.home(
            rig.axis.var("ActualPosition")
        )  # it has reset the homed state, which absolute positioning needs
    rig.run(0.5 if on_top and "Out" in cell.new else 0.1)
    if cell.column in {"S1", "S2", "S4"} and cell.new in SHIFTS:
        rig.until(job.in_gear if cell.column == "S1" else job.in_sync)
    if cell.new == "MC_HaltSuperimposed" and not on_top and cell.column != "H6" and cell.fate == "P":
        # Something to halt: without it the job is Done at once (MC-369).
        rig.axis.move_superimposed(300.0)
        rig.run(0.1)
    assert job.Busy
    assert not job.Error
    if cell.active.endswith("waiting"):
        assert not getattr(job, "Active", getattr(job, "StartSync", False))
    return job


def steps(rig, since):
    """Return the greatest change of the velocity setpoint from one cycle to the next, mm/s, and of the
    position, mm.
    """
    v, s = rig.column("velocity_setpoint")[since:], rig.column("position_setpoint")[since:]
    return max(abs(b - a) for a, b in pairwise(v)), max(abs(b - a) for a, b in pairwise(s))


REFUSES_SHIFTS = {"S2": 0x8079, "S3": 0x8075, "S5": 0x808A, "S6": 0x808A, "S9": 0x80A9}
"""ErrorIDs of phasing and offset over a running job."""


def aborted(job):
    """Return whether another job has ended this one; `MC_LeadingValueAdditive` shows it by `Busy` alone."""
    return job.CommandAborted if hasattr(job, "CommandAborted") else not (job.Busy or job.Error)


def fate_of_new_job(rig, job, cell, old):
    """Check what becomes of the new job."""
    fate, reached = cell.fate, NEW[cell.new].reached
    if fate == "R":
        assert job.Error
        if cell.column == "H6":
            assert job.ErrorID == 0x800F
        elif cell.identifier == "OVR-025":
            assert job.ErrorID == 0x80A1
        elif "Out" in cell.new:
            assert job.ErrorID == (0x8077 if "Gear" in cell.new else 0x8078)
        elif cell.column in REFUSES_SHIFTS:
            assert job.ErrorID == REFUSES_SHIFTS[cell.column]
        assert job.ErrorID
        return
    assert not job.Error
    assert not aborted(job)
    if fate == "D":
        assert job.Done
        return
    assert job.Busy or job.Done
    if fate == "W":
        assert job.Busy
        assert not getattr(job, "Active", False)
        assert not getattr(job, "StartSync", False)
    elif hasattr(job, "Active"):
        assert job.Active
    if reached != "busy" and (fate in "TP" or cell.active.startswith(("MC_Halt", "MC_Home"))):
        # It gets what it wants: the axis moves, or stops, as the new job says; one that waits, after the
        # running one.
        rig.until(lambda: getattr(job, reached), 12.0)
        assert fate != "W" or old.Done


CELL_CASES = [
    pytest.param(
        cell,
        id=f"{cell.new} over {cell.active}",
        marks=pytest.mark.requirement(*identifiers(cell)),
    )
    for cell in TESTABLE
]


def check_cell(rig, cell):
    if other_kind(cell):
        cell = replace(cell, letter="-", fate="R")
    old = running(rig, cell)
    since = len(rig.rows) - 1
    job = NEW[cell.new].make(rig)
    rig.cycles(2)
    # MC_Stop Mode 0 over the running Mode 3 has the higher stop response.
    if cell.letter in {"A", "A/N"} or (cell.letter == "B" and cell.column == "H6"):
        assert (aborted(old), old.Busy, getattr(old, "Active", False)) == (True, False, False)
    else:
        assert not aborted(old)
        assert not old.Error
        assert old.Busy
    fate_of_new_job(rig, job, cell, old)
    if "MotionIn" in cell.new:
        return  # takes its setpoints as they are given (OVR-008)
    velocity, position = steps(rig, since)
    # No more than the greatest deceleration makes in a cycle, and what the emergency ramp takes from
    # quantised actual values.
    assert velocity <= 4000.0 * 0.004 + 0.5
    shifts = [abs(event.data["offset"]) for event in rig.events("axis.homed") if event.data["mode"] in (3, 5)]
    assert position <= 500.0 * 0.004 + max(shifts, default=0.0)


def _braking_without_control(rig):
    rig.axis.move_velocity(200.0, PositionControlled=False)
    rig.run(0.5)
    return rig.axis.halt(Deceleration=50.0)


def _velocity_gear_without_control(rig):
    rig.leader_at(60.0)
    job = rig.axis.gear_in_velocity(rig.leader, 3, 2)
    rig.until(job.in_sync)
    return job


@pytest.mark.exhaustive
@requirements_in(CELL_CASES)
def test_cell(subtests):
    """A new job over a running one does to both what the cell says; the setpoint has no step but that of a
    MotionIn job.
    """
    for label, values in each(CELL_CASES):
        with subtests.test(label):
            (cell,) = values
            check_cell(Rig(synchronous=synchronous(cell.new, cell.active)), cell)


EARLIER = [
    pytest.param(cpu, cell, id=f"{cpu}: {cell.new} over {cell.active}")
    for cpu in ("S7-1500T V7", "S7-1500T V8")
    for table in (MOTION, SYNCHRONOUS)
    for cell in before_v9(table).cells()
    if cell.column in {"H8", "S3"} and synchronous(cell.new, cell.active)
]
"""Cells around those that differ from V9: the others are the same data."""


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "SYN-257", "SYN-453", "SYN-454", "SYN-455", "SYN-456", "SYN-457", "SYN-458", "SYN-459", "SYN-460",
    "SYN-462", "SYN-480",
)  # fmt: skip
def test_cell_before_v9(subtests):
    """V7 and V8: MC_MotionIn... goes on under a gear, and ends one that waits; the rest is as in V9."""
    for label, (cpu, cell) in each(EARLIER):
        with subtests.test(label):
            check_cell(Rig(synchronous=synchronous(cell.new, cell.active), cpu=cpu), cell)


@pytest.mark.requirement(
    "OVR-121", "OVR-039", "SYN-174", "SYN-269", "SYN-273", "SYN-333", "SYN-329", "SYN-385"
)
def test_velocity_gearing_without_position_control():
    """It refuses superimposed jobs with 16#8071, MC_GearInPos and MC_CamIn with 16#8079, and goes on; in
    position control it carries the first, and makes room for the others.
    """
    on_top = ("MC_MoveSuperimposed", "MC_MotionInSuperimposed", "MC_HaltSuperimposed")
    absolute = ("MC_GearInPos active", "MC_GearInPos waiting", "MC_CamIn active", "MC_CamIn waiting")
    for controlled in (False, True):
        for new in (*on_top, *absolute):
            rig = Rig(synchronous=True).enabled()
            rig.axis.home(0.0)
            rig.leader_at(0.0 if "waiting" in new else 60.0)
            gear = rig.axis.gear_in_velocity(rig.leader, 3, 2, PositionControlled=controlled)
            rig.until(gear.in_sync)
            job = NEW[new].make(rig)
            rig.cycles(2)
            if controlled:
                assert not job.Error
                assert gear.CommandAborted is new.endswith("active")
            else:
                assert job.ErrorID == (0x8071 if new in on_top else 0x8079)
                assert gear.InSync


UNCONTROLLED = {
    "MC_Halt Mode 0": _braking_without_control,
    "MC_MoveVelocity": lambda rig: rig.axis.move_velocity(100.0, PositionControlled=False),
    "MC_MoveJog": lambda rig: rig.axis.jog(100.0, PositionControlled=False),
    "MC_MotionInVelocity": lambda rig: rig.axis.motion_in_velocity(20.0, PositionControlled=False),
    "MC_GearInVelocity": _velocity_gear_without_control,
}
"""Running jobs that may have no position control."""
CLOSES = ("MC_GearIn", "MC_GearInPos active", "MC_CamIn active")
"""New jobs that close position control."""


@pytest.mark.exhaustive
@pytest.mark.requirement("SYN-374", "SYN-380")
def test_cell_without_position_control(subtests):
    """Running jobs without position control end and go on as the cells say; what follows positions closes it,
    without a step of the velocity.
    """
    cells_of = {(cell.new, cell.active): cell for cell in TESTABLE}
    for label, (active, new) in each(
        list(UNCONTROLLED), ["MC_GearIn", "MC_GearInVelocity", "MC_GearInPos active", "MC_CamIn active",
                             "MC_GearInPos waiting", "MC_LeadingValueAdditive", "MC_Stop", "MC_MoveVelocity"]
    ):  # fmt: skip
        with subtests.test(label):
            cell = cells_of[new, active]
            rig = Rig(synchronous=True).enabled()
            rig.axis.home(0.0)
            rig.cycles(2)
            old = UNCONTROLLED[active](rig)
            rig.run(0.1)
            assert (old.Busy, rig.axis.var("StatusWord.X28")) == (True, True)
            since = len(rig.rows) - 1
            job = NEW[new].make(rig)
            rig.cycles(2)
            refused = active == "MC_GearInVelocity" and new.startswith(("MC_GearInPos", "MC_CamIn"))
            if refused:  # note 5
                assert (job.ErrorID, old.Busy) == (0x8079, True)
                continue
            assert not job.Error
            assert aborted(old) is (cell.letter in {"A", "A/N"})
            if new in CLOSES:
                assert not rig.axis.var("StatusWord.X28")
            velocities = rig.column("velocity_setpoint")[since:]
            assert max(abs(b - a) for a, b in pairwise(velocities)) <= 4000.0 * 0.004 + 0.5


@pytest.mark.requirement("OVR-112", "OVR-120", "SYN-096", "SYN-302", "SYN-292", "SYN-097")
@pytest.mark.parametrize("active", ["MC_GearInPos waiting", "MC_CamIn waiting", "MC_GearOut waiting"])
def test_what_ends_a_waiting_synchronous_job(active):
    """MC_Halt leaves it waiting (a way out has nothing to leave any more); MC_Stop and MC_Power end it."""
    for end in ("halt", "stop", "power"):
        rig = Rig(synchronous=True).enabled()
        rig.axis.home(0.0)
        rig.cycles(2)
        job = ACTIVE[active](rig)
        rig.cycles(2)
        assert job.Busy
        if end == "power":
            rig.axis.power(False)
        else:
            getattr(rig.axis, end)()
        rig.cycles(2)
        assert job.CommandAborted is (end != "halt" or "Out" in active)


@pytest.mark.requirement("OVR-114", "SYN-223", "SYN-225", "SYN-270")
def test_what_ends_the_additive_value():
    """Neither a motion job nor MC_Stop; a restart does."""
    rig = Rig(synchronous=True).enabled()
    rig.leader_at(60.0)
    job = rig.axis.leading_value_additive(0.0)
    for other in ("gear_in", "move_velocity", "halt", "stop"):
        start = getattr(rig.axis, other)
        start(*{"gear_in": (rig.leader,), "move_velocity": (10.0,)}.get(other, ()))
        rig.run(0.1)
        assert job.Busy
    rig.axis.power(False)
    rig.run(0.5)
    again = rig.axis.leading_value_additive(0.0)
    rig.axis.reset(restart=True)
    rig.run(0.1)
    assert (job.Busy, again.Busy) == (False, False)


@pytest.mark.requirement("OVR-116")
def test_a_waiting_gear_removes_appended_positioning():
    """A job that waits with BufferMode 1 is aborted, the one in control goes on."""
    rig = Rig(synchronous=True).enabled()
    rig.axis.home(0.0)
    rig.leader_at(0.0)
    active = rig.axis.move_absolute(300.0)
    appended = rig.axis.move_absolute(100.0, BufferMode=1)
    rig.run(0.1)
    rig.axis.gear_in_pos(rig.leader, 5000.0, 0.0)
    rig.cycles(2)
    assert (active.Busy, appended.CommandAborted) == (True, True)


@pytest.mark.requirement("OVR-002", "OVR-017", "OVR-105", "MC-419", "G2-024")
@pytest.mark.parametrize("first", [0, 2, 3])
@pytest.mark.parametrize("second", [0, 2, 3])
def test_stop_over_stop(rig, first, second):
    """Order 0 > 2 > 3: an equal or higher one takes over, a lower one ends with CommandAborted and changes
    nothing.
    """
    rig.travelling(400.0)
    old = rig.axis.stop(first, Deceleration=800.0)
    rig.run(0.03)
    job = rig.axis.stop(second, Deceleration=800.0)
    rig.cycles(2)
    order = (3, 2, 0)
    if order.index(second) >= order.index(first):
        assert (old.CommandAborted, job.Busy) == (True, True)
        rig.until(job.done)
    else:
        assert (old.Busy, job.CommandAborted, job.Error) == (True, True, False)
        rig.until(old.done)


def check_homing_without_motion_over_anything(rig, mode, active):
    cell = next(cell for cell in cells() if cell.active == active)
    old = running(rig, cell)
    job = rig.axis.home(1.0, mode=mode)
    rig.cycles(2)
    assert job.Done
    assert old.Busy
    assert not aborted(old)


@pytest.mark.exhaustive
@pytest.mark.requirement("OVR-088")
def test_homing_without_motion_over_anything(subtests):
    """Modes that set the position are Done at once, and abort nothing."""
    for label, values in each([0, 1, 11, 12], [name for name in ACTIVE if exists(name)]):
        with subtests.test(label):
            check_homing_without_motion_over_anything(Rig(synchronous=synchronous(values[1])), *values)


@pytest.mark.requirement("OVR-009", "MC-268")
@pytest.mark.parametrize("new", ["MC_MoveVelocity", "MC_Halt Mode 0", "MC_Halt Mode 1", "MC_Stop"])
def test_waiting_jobs_are_aborted_too(rig, new):
    """Column H4: a job that waits with BufferMode 1 is aborted together with the active one."""
    rig.enabled()
    rig.axis.home(0.0)
    rig.axis.move_absolute(300.0)
    waiting = rig.axis.move_absolute(100.0, BufferMode=1)
    rig.run(0.1)
    assert waiting.Busy
    assert not waiting.Active
    NEW[new].make(rig)
    rig.cycles(2)
    assert waiting.CommandAborted


@pytest.mark.requirement("OVR-010", "OVR-113", "OVR-089")
def test_halt_mode_1_during_halt_mode_0(rig):
    """MC_Halt Mode 1 does not override Mode 0; both are Done at standstill."""
    rig.travelling(100.0)
    first = rig.axis.halt(Mode=0)
    rig.run(0.02)
    second = rig.axis.halt(Mode=1)
    rig.until(lambda: first.Done and second.Done)


@pytest.mark.requirement("STP-251", "OVR-103")
def test_disabling_aborts_waiting_jobs(rig):
    """Enable = FALSE aborts active and waiting jobs."""
    rig.enabled()
    active = rig.axis.move_relative(300.0)
    waiting = rig.axis.move_relative(10.0, BufferMode=1)
    rig.run(0.1)
    rig.axis.power(False, stop_mode=2)
    rig.cycles(2)
    assert active.CommandAborted
    assert waiting.CommandAborted


@pytest.mark.requirement("STP-252", "MC-268")
def test_alarm_fails_waiting_jobs(rig):
    """An alarm with a stop reaction ends active and waiting jobs with 16#8001."""
    rig.enabled()
    active = rig.axis.move_relative(300.0)
    waiting = rig.axis.move_relative(10.0, BufferMode=1)
    rig.run(0.1)
    rig.axis.alarms.raise_alarm(104)
    rig.cycles(2)
    assert (active.ErrorID, waiting.ErrorID) == (0x8001, 0x8001)
