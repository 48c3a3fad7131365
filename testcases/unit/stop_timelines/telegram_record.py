"""An axis on its bench, and what stands in the telegrams on the wire in every cycle of a stop.

A timeline of the specification is a list of steps; a step names a moment and what is to be seen at it.
Control and status words, speed setpoint and actual speed are read from the frames of the bus, everything else
is what a user program can see.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from struct import Struct
from typing import Any, Self

import pytest

from fieldbus.clock import S
from fieldbus.history import Event
from testcases.unit.hil.test_hil_profidrive import bench
from testcases.unit.stop_timelines.invariants import violations

CYCLE_S = 0.004
STW1_MASK, ZSW1_MASK = 0x04FF, 0x027F
"""Bits 8, 9 and 11 to 15 of STW1 belong to MC_SetAxisSTW; of ZSW1 the states are in bits 0 to 6 and 9
(section 0.1).
"""
WORDS = Struct("<4H")
RPDO1, TPDO1 = 0x205, 0x185
MM_S_PER_SHARE = 500.0 / 0x4000_0000
"""Normalised speed to mm/s: p2000 = 3000 rpm, 10 mm per revolution."""

Moment = Callable[["StopBench"], int]


def _speed(high: int, low: int) -> float:
    value = high << 16 | low
    return (value - (1 << 32) if value & 0x8000_0000 else value) * MM_S_PER_SHARE


@dataclass(slots=True)
class Row:
    """One application cycle: the answer of the drive that it has read, the telegram that it has sent, and
    what the program sees.
    """

    time_s: float
    x: int
    x2: int
    status: bool
    busy: bool
    in_operation: bool
    communication_ok: bool
    number: int
    reaction: int
    setpoint: float
    acceleration: float
    """Slope of the setpoint, mm/s2."""
    output: float
    position: float
    actual_position: float
    actual_velocity: float
    state: str
    """Drive state S1 to S5 as the drive records it."""
    pulses: bool
    brake: bool
    jobs: dict[str, dict[str, Any]]
    axis_state: str
    enable: bool
    alarmed: bool
    """An alarm of class F or R is pending."""
    zsw1: int = 0
    nact: float = 0.0
    stw1: int = 0
    nset: float = 0.0
    enable_output: bool = False
    analog_output: float = 0.0
    """V."""
    ready_input: bool = False


@dataclass
class StopBench:
    """The reference axis behind PROFIdrive telegram 105, written down from its start.

    Args:
        variables: Of the technology object, besides those of the bench file.
        drive: Values of the drive section.

    """

    variables: dict[str, Any] = field(default_factory=dict)
    drive: dict[str, Any] = field(default_factory=dict)
    name = "profidrive"

    def __post_init__(self) -> None:
        self.machine = bench(self.name, variables=self.variables, **self.drive)
        self.axis = self.machine.axis()
        self.rows: list[Row] = []
        self.jobs: dict[str, Any] = {}
        self.edge = 0
        self.machine.on_cycle(self._note)
        self.power = self.axis.power(False)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.machine.close()

    # -- what happens
    # -------------------------------------------------------------------------------------------

    def run(self, seconds: float) -> None:
        self.machine.run_for(seconds)

    def cycles(self, number: int = 1) -> None:
        self.machine.run_for(CYCLE_S * number)

    def until(self, predicate: Callable[[], object], timeout: float = 5.0) -> None:
        assert self.machine.run_until(predicate, timeout), "the condition did not come true in time"

    def enabled(self, **inputs: Any) -> StopBench:
        self.power = self.axis.power(**inputs)
        self.until(self.power.status)
        return self

    def travelling(self, velocity: float = 300.0) -> StopBench:
        """Bring the axis to the start condition of every stop test (section 0.3)."""
        self.enabled()
        self.watch("move", self.axis.move_velocity(velocity, Deceleration=1000.0, Jerk=10000.0))
        self.until(self.jobs["move"].in_velocity)
        self.run(0.1)
        return self

    def watch(self, name: str, job: Any) -> Any:
        """Write down the outputs of an instance from now on."""
        self.jobs[name] = job
        return job

    def now(self) -> None:
        """Say that what is done now is the event of the timeline: the user program of the next cycle sees it
        first.
        """
        self.edge = len(self.rows)

    def alarm(self, number: int, reaction: int | None = None) -> None:
        self.axis.object.alarms.raise_alarm(number, reaction=reaction)

    # -- what is written down
    # -----------------------------------------------------------------------------------

    def _note(self) -> None:
        axis = self.axis
        read = axis.var
        self.rows.append(
            Row(
                self.machine.now_s,
                read("StatusWord"),
                read("StatusWord2"),
                self.power.Status,
                self.power.Busy,
                read("StatusDrive.InOperation"),
                read("StatusDrive.CommunicationOK"),
                read("ErrorDetail.Number"),
                read("ErrorDetail.Reaction"),
                axis.servo.total.v,
                axis.servo.total.a,
                read("VelocitySetpoint"),
                read("Position"),
                read("ActualPosition"),
                read("ActualVelocity"),
                *self._drive(),
                {name: _outputs(job) for name, job in self.jobs.items()},
                axis.state.name,
                axis.enabling.enable,
                any(pending.entry.alarm_class != "W" for pending in axis.alarms.engine.pending),
            )
        )

    def _drive(self) -> tuple[str, bool, bool]:
        """Return the state of the drive, whether it has pulses, and whether its brake is closed."""
        drive = self.machine.drive()
        return drive.state.text[:2], drive.core.enabled, drive.core.brake.closed

    def telegrams(self) -> list[Row]:
        """Return the rows with the words of the bus in them."""
        frames = self.machine.trace().raw_frames("can0")
        wire = [
            (at / S, frame.can_id, WORDS.unpack(frame.data))
            for at, _, frame, error in frames
            if frame.can_id in (RPDO1, TPDO1) and not error and len(frame.data) == WORDS.size
        ]
        place = 0
        zsw1 = nact = 0
        for row in self.rows:
            while place < len(wire) and wire[place][0] < row.time_s + CYCLE_S / 2:
                _, can_id, words = wire[place]
                place += 1
                if can_id == TPDO1:
                    zsw1, nact = words[0], _speed(words[1], words[2])
                else:
                    row.stw1, row.nset = words[0], _speed(words[1], words[2])
            row.zsw1, row.nact = zsw1, nact
        while self.rows[-1].stw1 == 0:
            self.rows.pop()  # its telegram is not on the wire yet
        assert violations(self.rows[2:]) == []
        return self.rows

    def sequence(self, word: str, since: int | None = None) -> list[int]:
        """Return the different values of `stw1` or `zsw1`, in their order, from the event of the timeline
        on.
        """
        mask = STW1_MASK if word == "stw1" else ZSW1_MASK
        values = [getattr(row, word) & mask for row in self.rows[self.edge if since is None else since :]]
        return [values[0], *(value for before, value in pairwise(values) if value != before)]

    def states(self, since: int | None = None) -> list[str]:
        """Return the states that the drive has passed, in their order."""
        values = [row.state for row in self.rows[self.edge if since is None else since :]]
        return [values[0], *(value for before, value in pairwise(values) if value != before)]

    def events(self, kind: str) -> list[Event]:
        return list(self.machine.history.select(kind=kind))

    def ramp(self, value: str) -> tuple[float, float]:
        """Return (duration in s, travel in mm) from the last full value of `setpoint` or `nact` around the
        event to its zero.
        """
        rows = self.rows[self.edge - 1 :]
        place, tolerance, zero = (
            ("position", 1e-6, 1e-9) if value == "setpoint" else ("actual_position", 0.05, 0.5)
        )
        full = abs(getattr(rows[0], value))
        first = next(i for i, row in enumerate(rows) if abs(getattr(row, value)) < full - tolerance) - 1
        last = next(i for i, row in enumerate(rows) if i > first and abs(getattr(row, value)) < zero)
        way = getattr(rows[last], place) - getattr(rows[first], place)
        return rows[last].time_s - rows[first].time_s, abs(way)

    def first(self, predicate: Callable[[Row], object], since: int | None = None) -> int:
        """Return the number of the first row from the event on for which something holds."""
        start = self.edge if since is None else since
        return next(number for number in range(start, len(self.rows)) if predicate(self.rows[number]))


class AnalogBench(StopBench):
    """The reference axis on a drive with an analog setpoint: the terminals of its station in place of
    words.
    """

    name = "analog"

    def _note(self) -> None:
        super()._note()
        row, station = self.rows[-1], self.machine.station()
        row.enable_output = station.output(0).level
        row.analog_output = station.analog_output(0).value
        row.ready_input = station.input(0).value

    def _drive(self) -> tuple[str, bool, bool]:
        drive = self.machine.drive()
        return drive.state.value, drive.core.enabled, drive.core.brake.closed


def _outputs(job: Any) -> dict[str, Any]:
    names = ("Busy", "Done", "CommandAborted", "Error", "ErrorID", "instruction")
    return {name: getattr(job, name) for name in names if hasattr(job, name)}


# -- moments
# ------------------------------------------------------------------------------------------------------------


def before(bench: StopBench) -> int:
    """The last cycle that knows nothing of the event."""
    return bench.edge - 1


def event(bench: StopBench) -> int:
    """The cycle whose user program sees the event first."""
    return bench.edge


def answer(bench: StopBench) -> int:
    """The first telegram that knows of it."""
    return bench.edge + 1


def after(milliseconds: float) -> Moment:
    """So long after the event."""
    return lambda bench: bench.edge + round(milliseconds / 1000.0 / CYCLE_S)


def when(predicate: Callable[[Row], object], plus: int = 0) -> Moment:
    """The first cycle from the event on for which something holds, or so many later."""
    return lambda bench: bench.first(predicate) + plus


def end(bench: StopBench) -> int:
    """The last cycle that was written down."""
    return len(bench.rows) - 1


setpoint_zero = when(lambda row: row.setpoint == 0.0)
drive_off = when(lambda row: row.zsw1 & 0x0006 == 0)
"""ZSW1.1 = 0 and ZSW1.2 = 0 received (STP-290)."""


# -- steps
# ------------------------------------------------------------------------------------------------------------


@dataclass(slots=True, frozen=True)
class Step:
    """A step of a timeline.

    Args:
        ids: Its requirements.
        moment: When.
        seen: What is to be seen then. `stw1`, `zsw1`: the words under their masks; `state`: of the drive;
            `on`, `off`: bits of StatusWord; `on2`, `off2`: of StatusWord2; `job_<name>`: the one output that
            is TRUE, or `Error 8001`; `follows`: the setpoint of the position is the actual value; the rest by
            the names of `Row`, floats as (value, tolerance).

    """

    ids: tuple[str, ...]
    moment: Moment
    seen: dict[str, Any]

    def check(self, bench: StopBench) -> None:
        number = self.moment(bench)
        row = bench.rows[number]
        for name, expected in self.seen.items():
            found = _found(row, name, expected)
            where = f"{name} at {(number - bench.edge) * CYCLE_S * 1000:.0f} ms"
            if name in ("stw1", "zsw1"):
                assert f"{found:04X}" == f"{expected:04X}", where
            elif isinstance(expected, tuple) and name not in BITS:
                assert found == pytest.approx(expected[0], abs=expected[1]), where
            else:
                assert found == expected, where


BITS = {"on": ("x", 1), "off": ("x", 0), "on2": ("x2", 1), "off2": ("x2", 0)}


def _found(row: Row, name: str, expected: Any) -> Any:
    if name in ("stw1", "zsw1"):
        return getattr(row, name) & (STW1_MASK if name == "stw1" else ZSW1_MASK)
    if name in BITS:
        word, level = BITS[name]
        return tuple(bit for bit in expected if getattr(row, word) >> bit & 1 == level)
    if name.startswith("job_"):
        outputs = row.jobs[name[4:]]
        true = [output for output in ("Busy", "Done", "CommandAborted") if outputs.get(output)]
        return " ".join([*true, *([f"Error {outputs['ErrorID']:04X}"] if outputs["Error"] else [])])
    if name == "follows":
        return abs(row.position - row.actual_position) < 1e-6
    return getattr(row, name)


def step(ids: str, moment: Moment, **seen: Any) -> Step:
    """Return a step; `on`, `off`, `on2`, `off2` as text with the numbers of the bits."""
    for name in BITS:
        if name in seen:
            seen[name] = tuple(int(bit) for bit in seen[name].split())
    return Step(tuple(ids.split()), moment, seen)


def steps(timelines: dict[str, list[Step]]) -> list[Any]:
    """Return a parameter (timeline, step) for every step, with its requirements as marks."""
    return [
        pytest.param(name, one, id=f"{name}-{number}-{one.ids[0]}", marks=pytest.mark.requirement(*one.ids))
        for name, timeline in timelines.items()
        for number, one in enumerate(timeline)
    ]
