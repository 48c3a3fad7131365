"""What the cases of `homing` share: the machine's geometry by the bench file, configuration, start, verdict.

The numbers are those of the machine: where its cam, its zero marks and its switches are. Nothing here asks
the axis what it thinks of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor, inf
from typing import Any, Final

from hil.campaign import CaseContext
from hil.expect import happens, job_output, no_alarm, status_word_bit, stays_within, value_at
from hil.record import event
from testcases.campaigns.support import axis_name, drive_name, enable, restart, settle_s

ZERO_MARK: Final = 0
CAM: Final = 1
INPUT: Final = 2
MARKS: Final = {"zero-mark": ZERO_MARK, "cam": CAM, "input": INPUT}
"""`ActiveHoming.Mode` and `PassiveHoming.Mode` by the word in the names of cases."""

SIGN: Final = {"positive": 1, "negative": -1}
APPROACH: Final = 100.0
HOMING: Final = 20.0
OFFSET: Final = 25.0
"""Home position offset, into the travel range: away from the negative switch, next to which the cam is,
mm.
"""
HOME: Final = 1000.0
"""Home position: nothing that the axis could show without having homed, mm."""


@dataclass(frozen=True)
class Machine:
    """Places along the travel, mm, by the bench file."""

    cam: tuple[float, float]
    hysteresis: float
    limits: tuple[float, float]
    stops: tuple[float, float]
    pitch: float
    first_mark: float
    increment: float

    def next_mark(self, place: float, direction: int) -> float:
        """Return the zero mark that is met first from `place` in `direction`."""
        turns = (place - self.first_mark) / self.pitch
        number = floor(turns) + 1 if direction > 0 else ceil(turns) - 1
        return self.first_mark + number * self.pitch

    def leaves_cam(self, direction: int) -> float:
        """Return where the cam is left in `direction`."""
        return self.cam[1] + self.hysteresis if direction > 0 else self.cam[0] - self.hysteresis

    def edge(self, direction: int, positive_side: bool) -> float:
        """Return where the edge of a side of the cam comes when it is met in `direction`."""
        side = self.cam[1] if positive_side else self.cam[0]
        leaves = (direction > 0) is positive_side
        return side + (direction * self.hysteresis if leaves else 0.0)


def machine(ctx: CaseContext) -> Machine:
    """Return the geometry of the drive under test.

    Raises:
        BlockedError: The home switch is no cam between the limit switches.

    """
    section = ctx.bench.config.drive[drive_name(ctx)]
    switches, mechanics = section.switches, section.mechanics
    low = -inf if switches.home_from_mm is None else switches.home_from_mm
    high = inf if switches.home_to_mm is None else switches.home_to_mm
    limits = (switches.negative_limit_mm, switches.positive_limit_mm)
    ctx.require(
        limits[0] + 25.0 <= low < high <= limits[1] - 100.0,
        "a cam (home_from_mm, home_to_mm) 25 mm and more inside of the limit switches",
    )
    pitch = mechanics.lead_screw_mm * mechanics.gear_denominator / mechanics.gear_numerator
    increment = pitch / section.increments_per_revolution
    return Machine(
        (low, high),
        switches.hysteresis_mm,
        limits,
        (mechanics.negative_stop_mm, mechanics.positive_stop_mm),
        pitch,
        section.index_increments * increment,
        increment,
    )


def configure(ctx: CaseContext, start: dict[str, Any], **now: Any) -> None:
    """Set variables of homing: those that need a restart, and by their last name those that act at once."""
    restart(ctx, start)
    axis = ctx.axis
    axis.write("Homing.ApproachVelocity", APPROACH)
    axis.write("Homing.ReferencingVelocity", HOMING)
    axis.write("Sensor[1].ActiveHoming.HomePositionOffset", OFFSET)
    for name, value in now.items():
        axis.write(name.replace("__", ".").replace("Sensor.", "Sensor[1]."), value)


def prepare(
    ctx: CaseContext,
    mark: str,
    *,
    direction: str,
    positive_side: bool = False,
    approach: str = "negative",
    reversal: bool = False,
) -> Machine:
    """Configure active homing; returns the geometry."""
    places = machine(ctx)
    configure(
        ctx,
        {"Sensor[1].ActiveHoming.Mode": MARKS[mark], "Homing.AutoReversal": reversal},
        Sensor__ActiveHoming__Direction=int(direction == "negative"),
        Sensor__ActiveHoming__SideInput=positive_side,
        Homing__ApproachDirection=approach == "negative",
    )
    return places


def go_to(ctx: CaseContext, place: float) -> None:
    """Enable the axis, and bring the load to a place of the machine, mm; the bench starts where the count is
    0.
    """
    enable(ctx)
    start = ctx.bench.config.drive[drive_name(ctx)].mechanics.start_position_mm
    ctx.do(f"MC_MoveRelative to {place:g} mm of the machine")
    job = ctx.axis.move_relative(place - start, Velocity=400.0)
    ctx.wait_until(job.done, 10.0, "the load is at the start of the homing")


def home(ctx: CaseContext, *, mode: int = 3, position: float = HOME, timeout: float = 60.0) -> Any:
    """Home actively and wait for the end, whatever it is."""
    ctx.do(f"MC_Home Mode {mode}, Position {position:g} mm")
    job = ctx.axis.home(position, mode=mode)
    ctx.wait_until(job.ended, timeout, "the homing ends")
    ctx.run_for(0.2 + settle_s(ctx))
    return job


def tolerance_mm(ctx: CaseContext, places: Machine, mark: str, velocity: float = HOMING) -> float:
    """Return how far the assigned position may lie from the mark, mm: an increment, or for an input the way
    of its delay.
    """
    if mark != "input":
        return 2.0 * places.increment
    delay_s = 2.0 * ctx.bench.cycle_ns * 1e-9 + ctx.bench.config.input_filter_s(axis_name(ctx), "home")
    return velocity * delay_s + 2.0 * places.increment


def homed_at(
    ctx: CaseContext, job: Any, places: Machine, mark: str, expected: float, *, since: float
) -> None:
    """Expect the axis homed on the mark at `expected` mm of the machine, at its home position, without an
    alarm.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    now = ctx.now_s
    deviation = tolerance_mm(ctx, places, mark)
    settled = float(ctx.axis.variables.read("PositioningMonitoring.Window"))
    ctx.expect(
        job_output(job.name, "Done", since=since).covers("HOM-083"),
        happens(event("axis.homed", axis, mode=3), since=since).covers("HOM-081"),
        value_at(f"{axis}.actual_position", now, HOME, tolerance=settled).covers("HOM-042", "HOM-083"),
        value_at(
            f"{drive}.position", now, (expected + OFFSET) / 1000.0, tolerance=(deviation + settled) / 1000.0
        )
        .named("place of the load at the home position")
        .covers("HOM-081"),
        no_alarm(since=since, axis=axis),
    )
    shown = _bit(ctx, 5, since=now)
    ctx.expect(shown)
    never_in_a_stop(ctx, places)


def not_homed(ctx: CaseContext, job: Any, *, since: float) -> None:
    """Expect the job to have ended with 16#8001, the axis not homed, and no homing job any more."""
    ctx.expect(
        job_output(job.name, "Error", since=since, error_id=0x8001).covers("HOM-097", "MC-220"),
        _bit(ctx, 5, since=ctx.now_s, state=False),
        _bit(ctx, 11, since=ctx.now_s, state=False).covers("HOM-034"),
    )


def _bit(ctx: CaseContext, number: int, *, since: float, state: bool = True) -> Any:
    return status_word_bit(number, state, at=since, axis=axis_name(ctx)).covers("HOM-033")


def never_in_a_stop(ctx: CaseContext, places: Machine) -> None:
    """Expect the load never in an end stop (HOM-111, HOM-122)."""
    low, high = places.stops
    ctx.expect(
        stays_within(f"{drive_name(ctx)}.position", low=low / 1000.0, high=high / 1000.0).named(
            "the load stays out of the end stops"
        )
    )
