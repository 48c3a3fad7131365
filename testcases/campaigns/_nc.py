"""What cases on axes of an NC share: the axis in a phase of motion, a fault, and the reaction as data.

The faults are those of the cases for technology objects, in the same phase; codes, reactions and what it
takes to go on are those of the NC.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any, Final

from hil.campaign import CaseContext, Counterpart, NotApplicable
from hil.expect import (
    axis_error,
    command_refused,
    no_axis_error,
    no_motion_after,
    standstill,
    value_at,
)
from hil.record import EventSelector, event
from motion.nc.handles import NcAxisHandle
from testcases.campaigns._reactions import cycles, machine_at_rest
from testcases.campaigns.support import (
    ACCELERATION,
    JERK,
    VELOCITY,
    can_segment,
    drive_name,
    settle_s,
)

LAG: Final = 0x4550
TARGET: Final = 0x435C
NO_MOVEMENT: Final = 0x435D
NO_ENABLE: Final = 0x4356
NO_FEED: Final = {"positive": 0x4358, "negative": 0x4357}
LIMIT_AT_START: Final = {"positive": 0x4461, "negative": 0x4460}
LIMIT_IN_MOTION: Final = {"positive": 0x4463, "negative": 0x4462}
ENCODER: Final = 0x4464
NOT_READY: Final = 0x4650
LIFE_COUNTER: Final = 0x4651
DATA_INVALID: Final = 0x4655
INVALID_CYCLES: Final = 3
"""Cycles with invalid data that an axis bears (NC-427)."""
APPLIED: Final = event("fault.applied")
DYNAMICS: Final = {"Acceleration": ACCELERATION, "Deceleration": ACCELERATION, "Jerk": JERK}
SIGN: Final = {"positive": 1, "negative": -1}

Options = Mapping[str, Any] | Callable[[CaseContext], Mapping[str, Any]]


# -- the axis --------------------------------------------------------------------------------------------


def axis_of(ctx: CaseContext) -> NcAxisHandle:
    """Return the axis under test."""
    return ctx.bench.axis(controller="nc")


def axis_name(ctx: CaseContext) -> str:
    """Return the name of the axis under test."""
    return axis_of(ctx).name


def enable(ctx: CaseContext) -> Any:
    """Enable the axis and wait for it; returns the `MC_Power` block."""
    ctx.do("MC_Power Enable, Enable_Positive, Enable_Negative = TRUE, Override 100 %")
    power = axis_of(ctx).power()
    ctx.wait_until(power.status, 5.0, "the axis is enabled")
    return power


def bring_into(ctx: CaseContext, phase: str, *, direction: int = 1, velocity: float = VELOCITY) -> Any:
    """Bring the enabled axis into a phase of motion at `velocity`; returns the running block, None at
    standstill.
    """
    axis = axis_of(ctx)
    if phase == "standstill":
        ctx.run_for(0.1)
        return None
    top = velocity if phase == "constant" else velocity + 100.0
    ctx.do(f"MC_MoveVelocity {top * direction:g} mm/s")
    move = axis.move_velocity(top * direction, **DYNAMICS)
    if phase == "accelerating":
        ctx.wait_until(
            lambda: axis.object.motion.v * direction >= velocity,
            5.0,
            f"{velocity:g} mm/s are passed while accelerating",
        )
        return move
    ctx.wait_until(move.in_velocity, 5.0, "constant travel is reached")
    if phase == "constant":
        ctx.run_for(0.1)
        return move
    ctx.do("MC_Halt: the axis brakes")
    halt = axis.halt(Deceleration=ACCELERATION, Jerk=JERK)
    ctx.wait_until(
        lambda: axis.object.motion.v * direction <= velocity,
        5.0,
        f"{velocity:g} mm/s are passed while braking",
    )
    return halt


def reset(ctx: CaseContext) -> None:
    """Reset the error of the axis and wait for it."""
    ctx.do("MC_Reset")
    ctx.wait_until(axis_of(ctx).reset().done, 5.0, "the error is reset")


def moves_again(ctx: CaseContext) -> None:
    """Wait until the axis is enabled without a new edge of `MC_Power`, and move."""
    axis = axis_of(ctx)
    ctx.wait_until(lambda: axis.operational, 5.0, "the axis is operational without a new edge of Enable")
    ctx.do("MC_MoveRelative -20 mm")
    move = axis.move_relative(-20.0, Velocity=100.0)
    ctx.wait_until(move.done, 5.0, "the axis moves again")


def at_rest(ctx: CaseContext, ended: float) -> None:
    """Expect the machine at rest: actual values that do not arrive keep their last value (NC-427)."""
    velocity = f"{drive_name(ctx)}.velocity"
    ctx.expect(standstill(by=ended - 0.3, velocity=velocity, tolerance=0.0005, until=ended))
    machine_at_rest(ctx, ended)


def code_at(ctx: CaseContext, at: float, code: int) -> None:
    """Expect the error code of the axis at an instant: in its process image, and in the trace."""
    ctx.expect(value_at(f"{axis_name(ctx)}.error_code", at, float(code), tolerance=0.0))


# -- a fault and its reaction ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Reaction:
    """What an NC axis makes of a fault."""

    code: int
    """Error code of the axis; 0: none, and a motion goes on."""
    requirements: tuple[str, ...] = ()
    within_cycles: float = 4
    """Latest begin after the fault, in cycles of the controller."""
    within_s: float = 0.0
    """What comes on top of it, s."""
    stands: bool = True
    """The machine comes to rest; not so where the drive is blind and has no brake."""


@dataclass(frozen=True)
class Fault:
    """A fault, as an NC case injects it: the same as in the case for technology objects."""

    kind: str
    reaction: Reaction
    options: Options = field(default_factory=dict)
    on_bus: bool = False
    """It hits the segment of the drive; else the drive."""
    lasts_s: float | None = None
    """How long it is there; None: until the case takes it back, behind the stop."""
    watched_s: float = 2.0
    """What is watched after the injection, s."""
    phase: str = "constant"
    """Where the name of the case does not say it."""
    velocity: float = VELOCITY

    def parameters(self, ctx: CaseContext) -> Mapping[str, Any]:
        """Return the parameters on this bench."""
        return self.options(ctx) if callable(self.options) else self.options


def fault_case(ctx: CaseContext, fault: Fault, phase: str) -> None:
    """Bring the axis into a phase, inject the fault, expect code, stop, and what it takes to go on."""
    axis, reaction = axis_of(ctx), fault.reaction
    name = axis_name(ctx)
    enable(ctx)
    sign = -1 if fault.velocity < 0 else 1
    running = bring_into(ctx, phase, direction=sign, velocity=abs(fault.velocity))
    options: dict[str, Any] = dict(fault.parameters(ctx))
    if fault.lasts_s is not None:
        options["duration_s"] = fault.lasts_s
    target = can_segment(ctx) if fault.on_bus else drive_name(ctx)
    injected = ctx.inject(fault.kind, target, **options)
    ctx.run_for(fault.watched_s + settle_s(ctx))
    ended = ctx.now_s
    if not reaction.code:
        goes_on(
            ctx, ended, moving=phase != "standstill", velocity=fault.velocity, covers=reaction.requirements
        )
        return
    within = cycles(ctx, reaction.within_cycles) + reaction.within_s
    ctx.expect(
        axis_error(reaction.code, since=APPLIED, within_s=within, axis=name).covers(*reaction.requirements),
    )
    code_at(ctx, ended, reaction.code)
    if running is not None:
        ctx.measure(
            "ErrorID of the running block", float(running.ErrorID), low=reaction.code, high=reaction.code
        )
    if not reaction.stands:
        return
    at_rest(ctx, ended)
    ctx.do("MC_MoveRelative -20 mm, without a reset")
    refused = axis.move_relative(-20.0, Velocity=100.0)
    ctx.run_for(cycles(ctx, 3))
    ctx.expect(
        command_refused(reaction.code, since=ended, axis=name),
        no_motion_after(ended, position=f"{drive_name(ctx)}.position", tolerance=0.0001, until=ctx.now_s),
    )
    ctx.measure(
        "ErrorID of a block before the reset", float(refused.ErrorID), low=reaction.code, high=reaction.code
    )
    if fault.lasts_s is None:
        injected.remove()
        # Until signs of life are synchronous again (PD-125) the drive cannot be acknowledged.
        ctx.run_for(0.3)
    reset(ctx)
    moves_again(ctx)


def goes_on(
    ctx: CaseContext, at: float, *, moving: bool, velocity: float = VELOCITY, covers: Sequence[str] = ()
) -> None:
    """Expect no error, and the motion that ran."""
    name = axis_name(ctx)
    ctx.expect(no_axis_error(axis=name).covers(*covers))
    if moving:
        ctx.expect(value_at(f"{name}.set_velocity", at, velocity, tolerance=1e-6).named("the motion goes on"))


def switch_event(ctx: CaseContext) -> EventSelector:
    """Select the instant at which an input of the drive changes."""
    return event("drive.inputs", drive_name(ctx))


# -- tables ------------------------------------------------------------------------------------------------

Row = Fault | NotApplicable | Callable[..., Counterpart | NotApplicable]


class Table:
    """What the cases of a campaign are on an NC axis, by patterns of their names.

    Args:
        rows: By pattern (`*` for anything) a fault, a reason why there is none, or a function of the
        parameters;
            the first pattern that fits counts.

    """

    def __init__(self, rows: Mapping[str, Row]) -> None:
        self._rows = dict(rows)

    def __call__(self, name: str, parameters: Mapping[str, object]) -> Counterpart | NotApplicable | None:
        """Return what a case is."""
        row = next((row for pattern, row in self._rows.items() if fnmatchcase(name, pattern)), None)
        if isinstance(row, Fault):
            phase = str(parameters.get("phase", row.phase))
            return Counterpart(fault_case, {"fault": row, "phase": phase}, row.reaction.requirements)
        if row is None or isinstance(row, NotApplicable):
            return row
        return row(**parameters)


def after(fault: Fault, **changes: Any) -> Fault:
    """Return a fault with some of its reaction changed."""
    return replace(fault, reaction=replace(fault.reaction, **changes))
