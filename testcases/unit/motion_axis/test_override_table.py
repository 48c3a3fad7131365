"""The override table of homing and motion jobs, cell by cell, for the instructions that exist (table 3.1)."""

from __future__ import annotations

import pytest

from motion.axis.override import COLUMNS, TABLE, cell

PRINTED = """
MC_Home 3, 5   A A A A A - A A
MC_Home 9      A - - - - - - -
MC_Halt 1      - A A A - - - A
move           - A A A A - A A
BufferMode 1   - - - - - - - -
superimposed   - - - - - - A -
MC_Stop        A A A A A B A A
"""
"""Table 3.1, rows OVR-011 to OVR-017, as printed."""

ACTIVE = {
    "MC_MoveAbsolute": ("H3", lambda axis: axis.move_absolute(300.0)),
    "MC_MoveRelative": ("H3", lambda axis: axis.move_relative(300.0)),
    "MC_MoveVelocity": ("H3", lambda axis: axis.move_velocity(100.0)),
    "MC_MoveJog": ("H3", lambda axis: axis.jog(100.0)),
    "MC_Halt Mode 1": ("H3", lambda axis: axis.halt(Mode=1, Deceleration=50.0)),
    "MC_Halt Mode 0": ("H5", lambda axis: axis.halt(Mode=0, Deceleration=50.0)),
    "MC_Stop": ("H6", lambda axis: axis.stop(3, Deceleration=50.0)),
    "MC_MoveSuperimposed": ("H7", lambda axis: axis.move_superimposed(300.0)),
    "MC_HaltSuperimposed": ("H7", lambda axis: axis.halt_superimposed(Deceleration=50.0)),
}
NEW = {
    "MC_MoveAbsolute": ("move", lambda axis: axis.move_absolute(-20.0)),
    "MC_MoveRelative": ("move", lambda axis: axis.move_relative(20.0)),
    "MC_MoveVelocity": ("move", lambda axis: axis.move_velocity(50.0)),
    "MC_MoveJog": ("move", lambda axis: axis.jog(30.0, backward=True)),
    "MC_Halt Mode 0": ("move", lambda axis: axis.halt(Mode=0)),
    "MC_Halt Mode 1": ("MC_Halt 1", lambda axis: axis.halt(Mode=1)),
    "MC_MoveAbsolute BufferMode 1": ("BufferMode 1", lambda axis: axis.move_absolute(-20.0, BufferMode=1)),
    "MC_MoveRelative BufferMode 1": ("BufferMode 1", lambda axis: axis.move_relative(20.0, BufferMode=1)),
    "MC_Stop": ("MC_Stop", lambda axis: axis.stop(0)),
    "MC_MoveSuperimposed": ("superimposed", lambda axis: axis.move_superimposed(50.0)),
    "MC_HaltSuperimposed": ("superimposed", lambda axis: axis.halt_superimposed(Deceleration=50.0)),
}
IDENTIFIERS = {
    "MC_Home 3, 5": "OVR-011", "MC_Home 9": "OVR-012", "MC_Halt 1": "OVR-013", "move": "OVR-014",
    "BufferMode 1": "OVR-015", "superimposed": "OVR-016", "MC_Stop": "OVR-017",
}  # fmt: skip


def test_the_table_is_the_printed_one():
    """The data are the printed table, row by row."""
    printed = {}
    for line in PRINTED.strip().splitlines():
        name, cells = line[:14].strip(), line[14:].split()
        printed[name] = "".join(cells)
    assert printed == TABLE
    assert len(COLUMNS) == 8


def started(rig, make):
    job = make(rig.axis)
    rig.run(0.1)
    assert job.Busy
    return job


@pytest.mark.parametrize(
    ("new", "active"),
    [
        pytest.param(new, active, marks=pytest.mark.requirement(IDENTIFIERS[NEW[new][0]], "OVR-117"))
        for new in NEW
        for active in ACTIVE
    ],
)
def test_cell(rig, new, active):
    """A new job over an active one does to both what the cell says."""
    rig.enabled()
    rig.axis.home(0.0)
    if active.startswith(("MC_Halt", "MC_Stop")):
        # Something to brake: the halt or stop must still be on its way when the new job comes.
        rig.axis.move_velocity(200.0)
        rig.run(0.5)
    if active.endswith("Superimposed"):
        rig.axis.move_velocity(60.0)
        if active == "MC_HaltSuperimposed":
            rig.axis.move_superimposed(300.0)
        rig.run(0.5)
    column, make = ACTIVE[active]
    running = started(rig, make)
    if new == "MC_HaltSuperimposed" and column in ("H3", "H5"):
        # Something to halt: without it the job is Done at once (MC-369).
        rig.axis.move_superimposed(300.0)
        rig.run(0.1)
    row, make_new = NEW[new]
    job = make_new(rig.axis)
    rig.cycles(2)
    what = cell(row, column)
    if what == "A" or (what == "B" and new == "MC_Stop"):
        assert running.CommandAborted
        assert job.Busy
    elif column == "H6":
        assert (job.Error, job.ErrorID) == (True, 0x800F)
        assert running.Busy
    else:
        assert running.Busy
        assert not running.CommandAborted
        assert job.Busy
        assert not getattr(job, "Active", False)


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
    NEW[new][1](rig.axis)
    rig.cycles(2)
    assert waiting.CommandAborted


@pytest.mark.requirement("OVR-113", "OVR-089")
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
