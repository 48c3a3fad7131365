"""How every job of the overriding tables is brought about, which cells that makes testable, and the page that
says so.

`python -m testcases.unit.motion_axis.override_cells` writes `docs/reference/overriding.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import motion.s7.instructions as instructions
from motion.kernel.cams import Point
from motion.s7.axis.override import CELLS, FATES, TABLES, UNDER_INTERPRETER, Cell, OverrideTable
from motion.s7.cam_handle import CamHandle
from motion.s7.cams import Cam
from motion.s7.compatibility import level_of
from testcases.unit.motion_axis.conftest import CYCLE, Rig

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "overriding.md"
NO_SUCH_MODE = 0x800A

ON_A_SYNCHRONOUS_JOB = (
    "MC_PhasingAbsolute",
    "MC_PhasingRelative",
    "MC_OffsetAbsolute",
    "MC_OffsetRelative",
    "MC_LeadingValueAdditive",
)
"""Jobs that change the leading or following value of another job."""

Make = Callable[[Rig], Any]


class Start(NamedTuple):
    """How a job is started, and what shows that it has got what it wants."""

    make: Make
    reached: str
    """Output that becomes TRUE; `busy` where being in control is all."""


def _motion_in_position(rig: Rig) -> Any:
    return rig.axis.motion_in_position(rig.axis.var("Position"))


def _gear_in(rig: Rig) -> Any:
    rig.leader_at(60.0)
    return rig.axis.gear_in(rig.leader, 3, 2)


def _gear_in_velocity(rig: Rig) -> Any:
    rig.leader_at(60.0)
    return rig.axis.gear_in_velocity(rig.leader, 3, 2, PositionControlled=True)


def _gear_in_pos(rig: Rig) -> Any:
    """Synchronise at once, to where the axis is now."""
    rig.leader_at(60.0)
    master, slave = rig.leader.var("Position"), rig.axis.var("Position")
    profile = 4
    if level_of(rig.axis.object.cpu).before_v9:  # without profile 4: from a place in the next cycle but one
        profile, master = 3, master + 1.5 * CYCLE * rig.leader.var("Velocity")
    return rig.axis.gear_in_pos(
        rig.leader, master, slave, 3, 2, SyncProfileReference=profile, MasterStartDistance=60.0
    )


def _gear_in_pos_waiting(rig: Rig) -> Any:
    rig.leader_at(0.0)
    return rig.axis.gear_in_pos(rig.leader, 5000.0, 0.0)


def cam_of(rig: Rig, points: Any = ((0.0, 0.0), (1000.0, 500.0)), **variables: Any) -> Any:
    """Return a cam of the rig with these points, interpolated."""
    cam = Cam("cam", points=[Point(*point) for point in points], variables=variables, history=rig.history)
    rig.runtime.add_cam(cam)
    handle = CamHandle(rig.runtime, cam)
    rig.until(handle.interpolate().done)
    return handle


def _cam_in(rig: Rig) -> Any:
    """Synchronise at once, to where the axis is now."""
    rig.leader_at(60.0)
    cam = cam_of(rig)
    master, slave = rig.leader.var("Position"), rig.axis.var("Position")
    return rig.axis.cam_in(
        rig.leader, cam, MasterOffset=master - 1.0, SlaveOffset=slave,
        SyncProfileReference=4, MasterStartDistance=60.0,
    )  # fmt: skip


def _cam_in_waiting(rig: Rig) -> Any:
    rig.leader_at(0.0)
    return rig.axis.cam_in(rig.leader, cam_of(rig), MasterOffset=5000.0, MasterStartDistance=1.0)


def _leave(rig: Rig, name: str, *, deceleration: float, far: float = 0.0) -> Any:
    """Let the synchronous axis brake to where this deceleration takes it from the call on, or farther."""
    if rig.axis.var("StatusWord.X21"):
        rig.until(lambda: not rig.axis.var("StatusWord.X21"))
        rig.cycles()
    velocity = rig.axis.var("Velocity")
    position = rig.axis.var("Position") + velocity * (0.5 * velocity / deceleration + 1.5 * CYCLE)
    return getattr(rig.axis, name)(
        position + far, SyncProfileReference=0, Deceleration=deceleration, Jerk=0.0
    )


def _leaving(start: Make, name: str, *, deceleration: float, far: float = 0.0) -> Make:
    """Return how an axis gets synchronous and leaves its leading value again."""

    def prepared(rig: Rig) -> Any:
        first = start(rig)
        rig.until(lambda: first.InSync)
        rig.cycles()
        return _leave(rig, name, deceleration=deceleration, far=far)

    return prepared


def _shift(name: str, distance: float) -> Make:
    """Return how a value of the synchronous job in control is shifted over a way of the leading value."""

    def prepared(rig: Rig) -> Any:
        start = getattr(rig.axis, name)
        if "offset" in name:
            return start(2.0, distance)
        return start(2.0, ProfileReference=1, PhasingDistance=distance)

    return prepared


def _shifting(name: str) -> Make:
    """Return how the gear of the axis gets synchronous and its value is shifted slowly."""

    def prepared(rig: Rig) -> Any:
        gear = _gear_in_pos(rig)
        rig.until(gear.in_sync)
        return _shift(name, 5000.0)(rig)

    return prepared


SHIFTS = {
    "MC_PhasingAbsolute": "phasing_absolute",
    "MC_PhasingRelative": "phasing_relative",
    "MC_OffsetAbsolute": "offset_absolute",
    "MC_OffsetRelative": "offset_relative",
}


def other_kind(cell: Cell) -> bool:
    """Return whether the new job ends gears and the running one is a cam, or the other way round: then the
    letters of the cell are not meant for them (note 6 of table 3.2).
    """
    if "Out" in cell.new and cell.active in SHIFTS:
        return "Cam" in cell.new  # a gear is shifted
    kinds = [name.removeprefix("MC_")[:3] for name in (cell.new, cell.active)]
    return "Out" in cell.new and sorted(kinds) == ["Cam", "Gea"]


def synchronous(*jobs: str) -> bool:
    """Return whether one of these jobs needs a leading axis."""
    return any(job.startswith(("MC_Gear", "MC_Cam", *ON_A_SYNCHRONOUS_JOB)) for job in jobs)


NEW: dict[str, Start] = {
    "MC_Home Mode 2": Start(lambda rig: rig.axis.home(5.0, mode=2), "busy"),
    "MC_Home Mode 3": Start(lambda rig: rig.axis.home(5.0, mode=3), "busy"),
    "MC_Home Mode 5": Start(lambda rig: rig.axis.home(mode=5), "busy"),
    "MC_Home Mode 8": Start(lambda rig: rig.axis.home(5.0, mode=8), "busy"),
    "MC_Home Mode 9": Start(lambda rig: rig.axis.home(mode=9), "Done"),
    "MC_Home Mode 10": Start(lambda rig: rig.axis.home(mode=10), "busy"),
    "MC_Halt Mode 0": Start(lambda rig: rig.axis.halt(), "Done"),
    "MC_Halt Mode 1": Start(lambda rig: rig.axis.halt(Mode=1), "Done"),
    "MC_MoveAbsolute": Start(lambda rig: rig.axis.move_absolute(-20.0), "Done"),
    "MC_MoveRelative": Start(lambda rig: rig.axis.move_relative(20.0), "Done"),
    "MC_MoveAbsolute BufferMode 1": Start(lambda rig: rig.axis.move_absolute(-20.0, BufferMode=1), "Done"),
    "MC_MoveRelative BufferMode 1": Start(lambda rig: rig.axis.move_relative(20.0, BufferMode=1), "Done"),
    "MC_MoveVelocity": Start(lambda rig: rig.axis.move_velocity(50.0), "InVelocity"),
    "MC_MoveJog": Start(lambda rig: rig.axis.jog(30.0, backward=True), "InVelocity"),
    "MC_Stop": Start(lambda rig: rig.axis.stop(0), "Done"),
    "MC_MoveSuperimposed": Start(lambda rig: rig.axis.move_superimposed(20.0), "Done"),
    "MC_HaltSuperimposed": Start(lambda rig: rig.axis.halt_superimposed(Deceleration=100.0), "Done"),
    "MC_GearIn": Start(_gear_in, "InGear"),
    "MC_GearInVelocity": Start(_gear_in_velocity, "InSync"),
    "MC_GearInPos waiting": Start(_gear_in_pos_waiting, "busy"),
    "MC_GearInPos active": Start(_gear_in_pos, "InSync"),
    "MC_CamIn waiting": Start(_cam_in_waiting, "busy"),
    "MC_CamIn active": Start(_cam_in, "InSync"),
    "MC_GearOut waiting": Start(lambda rig: _leave(rig, "gear_out", deceleration=500.0, far=5000.0), "busy"),
    "MC_CamOut waiting": Start(lambda rig: _leave(rig, "cam_out", deceleration=500.0, far=5000.0), "busy"),
    "MC_GearOut active": Start(lambda rig: _leave(rig, "gear_out", deceleration=500.0), "Done"),
    "MC_CamOut active": Start(lambda rig: _leave(rig, "cam_out", deceleration=500.0), "Done"),
    **{name: Start(_shift(call, 30.0), "Done") for name, call in SHIFTS.items()},
    "MC_LeadingValueAdditive": Start(lambda rig: rig.axis.leading_value_additive(0.0), "busy"),
    "MC_MotionInVelocity": Start(lambda rig: rig.axis.motion_in_velocity(rig.axis.var("Velocity")), "busy"),
    "MC_MotionInPosition": Start(_motion_in_position, "busy"),
    "MC_MotionInSuperimposed": Start(lambda rig: rig.axis.motion_in_superimposed(0.0), "busy"),
}
"""New jobs, by their name in the tables."""


def _braking(make: Make) -> Make:
    """Let there be something to brake: the job must still be on its way when the next one comes."""

    def prepared(rig: Rig) -> Any:
        rig.axis.move_velocity(200.0)
        rig.run(0.5)
        return make(rig)

    return prepared


def _waiting(make: Make) -> Make:
    def prepared(rig: Rig) -> Any:
        rig.axis.move_relative(300.0)
        rig.run(0.1)
        return make(rig)

    return prepared


def _halts_superimposed(rig: Rig) -> Any:
    rig.axis.move_superimposed(300.0)
    rig.run(0.5)
    return rig.axis.halt_superimposed(Deceleration=50.0)


ACTIVE: dict[str, Make] = {
    "MC_Home Mode 2": lambda rig: rig.axis.home(5.0, mode=2),
    "MC_Home Mode 3": lambda rig: rig.axis.home(5.0, mode=3),
    "MC_Home Mode 5": lambda rig: rig.axis.home(mode=5),
    "MC_Home Mode 8": lambda rig: rig.axis.home(5.0, mode=8),
    "MC_Home Mode 10": lambda rig: rig.axis.home(mode=10),
    "MC_Halt Mode 0": _braking(lambda rig: rig.axis.halt(Deceleration=50.0)),
    "MC_Halt Mode 1": _braking(lambda rig: rig.axis.halt(Mode=1, Deceleration=50.0)),
    "MC_MoveAbsolute": lambda rig: rig.axis.move_absolute(300.0),
    "MC_MoveRelative": lambda rig: rig.axis.move_relative(300.0),
    "MC_MoveAbsolute BufferMode 1": lambda rig: rig.axis.move_absolute(300.0, BufferMode=1),
    "MC_MoveRelative BufferMode 1": lambda rig: rig.axis.move_relative(300.0, BufferMode=1),
    "MC_MoveAbsolute waiting": _waiting(lambda rig: rig.axis.move_absolute(100.0, BufferMode=1)),
    "MC_MoveRelative waiting": _waiting(lambda rig: rig.axis.move_relative(100.0, BufferMode=1)),
    "MC_MoveVelocity": lambda rig: rig.axis.move_velocity(100.0),
    "MC_MoveJog": lambda rig: rig.axis.jog(100.0),
    "MC_Stop": _braking(lambda rig: rig.axis.stop(3, Deceleration=50.0)),
    "MC_MoveSuperimposed": lambda rig: rig.axis.move_superimposed(300.0),
    "MC_HaltSuperimposed": _halts_superimposed,
    "MC_GearIn": _gear_in,
    "MC_GearInVelocity": _gear_in_velocity,
    "MC_GearInPos waiting": _gear_in_pos_waiting,
    "MC_GearInPos active": _gear_in_pos,
    "MC_CamIn waiting": _cam_in_waiting,
    "MC_CamIn active": _cam_in,
    "MC_GearOut waiting": _leaving(_gear_in_pos, "gear_out", deceleration=500.0, far=5000.0),
    "MC_CamOut waiting": _leaving(_cam_in, "cam_out", deceleration=500.0, far=5000.0),
    "MC_GearOut active": _leaving(_gear_in_pos, "gear_out", deceleration=20.0),
    "MC_CamOut active": _leaving(_cam_in, "cam_out", deceleration=5.0),
    **{name: _shifting(call) for name, call in SHIFTS.items()},
    "MC_LeadingValueAdditive": lambda rig: rig.axis.leading_value_additive(0.0),
    "MC_MotionInVelocity": lambda rig: rig.axis.motion_in_velocity(20.0),
    "MC_MotionInPosition": _motion_in_position,
    "MC_MotionInSuperimposed": lambda rig: rig.axis.motion_in_superimposed(0.0),
}
"""Running jobs, by their name in the tables."""


@cache
def _homing_mode_exists(mode: int) -> bool:
    rig = Rig().enabled()
    job = rig.axis.home(0.0, mode=mode)
    rig.cycles(2)
    return bool(job.ErrorID != NO_SUCH_MODE)


OTHERWISE_TESTED = ("MC_MeasuringInput", "MC_MeasuringInputCyclic", "MC_AbortMeasuringInput")
"""Jobs of a measuring input: `test_measuring_input.py` has the cells of their table."""


def exists(job: str) -> bool:
    """Return whether the product has the instruction of a job of the tables, and the tests here bring it
    about.
    """
    name, _, which = job.partition(" ")
    if name in OTHERWISE_TESTED:
        return False
    if not hasattr(instructions, name):
        return False
    return not which.startswith("Mode") or name != "MC_Home" or _homing_mode_exists(int(which[5:]))


def missing(cell: Cell) -> tuple[str, ...]:
    """Return the jobs of a cell that cannot be brought about, because their instruction does not exist
    yet.
    """
    return tuple(dict.fromkeys(job for job in (cell.new, cell.active) if not exists(job)))


def cells() -> list[Cell]:
    """Return all cells of all tables."""
    return [cell for table in TABLES for cell in table.cells()]


# -- the page
# ------------------------------------------------------------------------------------------------------------

_HEAD = """# Overriding

What a new job does to a running one, and what becomes of itself. Rows are new jobs, columns running ones; the first letter of a
cell speaks of the running job, the second of the new one. The data are `motion/s7/axis/override.py`; a test starts every
running job under every new one, for all instructions that there are. This page is written by
`python -m testcases.unit.motion_axis.override_cells`.

| letter | running job |
|---|---|
"""  # noqa: E501


def _table(table: OverrideTable) -> list[str]:
    everything = list(table.cells())
    lines = [f"## {table.section} {table.title}", "", "| column | running job |", "|---|---|"]
    lines += [f"| {column} | {_code(jobs)} |" for column, jobs in table.columns.items()]
    lines += ["", f"| | new job | {' | '.join(table.columns)} |", "|---|---|" + "---|" * len(table.columns)]
    for row in table.rows:
        shown = []
        for column in table.columns:
            there = [one for one in everything if (one.identifier, one.column) == (row.identifier, column)]
            open_ones = any(missing(one) for one in there)
            shown.append(f"{there[0].letter} {there[0].fate}{' *' if open_ones else ''}")
        lines.append(f"| {row.identifier} | {_code(row.jobs)} | {' | '.join(shown)} |")
    for letter, meaning in table.notes.items():
        lines += ["", f"{letter}: {meaning}."]
    done = sum(not missing(one) for one in everything)
    lines += ["", f"{done} of {len(everything)} pairs of jobs are tested."]
    absent = sorted({job for one in everything for job in missing(one)})
    if absent:
        why = "is a cell some of whose jobs do not exist yet, or have a test of their own"
        lines[-1] += f" \\* {why}: {_code(absent)}."
    return [*lines, ""]


def _code(jobs: Any) -> str:
    return ", ".join(f"`{job}`" for job in jobs)


def page() -> str:
    """Return the text of the page."""
    lines = [_HEAD + "\n".join(f"| {letter} | {meaning} |" for letter, meaning in CELLS.items()), ""]
    lines += ["| letter | new job |", "|---|---|"]
    lines += [f"| {letter} | {meaning} |" for letter, meaning in FATES.items()]
    lines.append("")
    for table in TABLES:
        lines += _table(table)
    lines += [
        "## Jobs on an object that the interpreter controls",
        "",
        "There is no interpreter yet, so none of this is tested.",
        "",
        "| | new job | executed | aborts the program of the interpreter |",
        "|---|---|---|---|",
    ]
    lines += [
        f"| {row.identifier} | {_code(row.jobs)} | {'yes' if row.executed else 'no'} | {row.aborts} |"
        for row in UNDER_INTERPRETER
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
