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
from hil.errors import BlockedError
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
    VELOCITY,
    can_segment,
    drive_name,
    drive_setting,
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
NC_NEEDS: Final[Mapping[str, str]] = {
    "bus": "not modbus-rtu",
    "feedback": "motor",
    "encoder": "incremental",
    "interpolator": "1",
    "program": "1",
    "dsc": "off",
    "play": "not compensated",
}
"""Configurations that an NC axis can have as they are; on a serial line its loop needs longer to come to
rest.
"""
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


class Numbers:
    """Velocities and ways of an axis, shares of its limits.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        read = axis_of(ctx).read_parameter
        self.maximum = float(read("axis.maximum_velocity"))
        """Greatest velocity, position unit/s."""
        self.velocity = 0.6 * self.maximum
        """Velocity at which stops begin."""
        self.top = 0.8 * self.maximum
        """A higher velocity."""
        self.dynamics = {
            "Acceleration": 0.5 * float(read("axis.maximum_acceleration")),
            "Deceleration": 0.5 * float(read("axis.maximum_deceleration")),
            "Jerk": 0.5 * float(read("axis.fast_jerk")),
        }
        """Inputs of motions."""
        self.braking = {
            "Deceleration": 0.8 * float(read("axis.maximum_deceleration")),
            "Jerk": 0.8 * float(read("axis.fast_jerk")),
        }
        """Inputs of a stop."""

    def way(self, share: float) -> float:
        """Return a share of what the axis travels in a second at its greatest velocity."""
        return share * self.maximum


def step_back(ctx: CaseContext) -> Any:
    """Start a short motion."""
    own = Numbers(ctx)
    return axis_of(ctx).move_relative(-own.way(0.04), Velocity=own.way(0.2))


def bring_into(ctx: CaseContext, phase: str, *, direction: int = 1, velocity: float | None = None) -> Any:
    """Bring the enabled axis into a phase of motion at `velocity`, that of `Numbers` where it is None;
    returns the running block, None at standstill.
    """
    axis, own = axis_of(ctx), Numbers(ctx)
    velocity = own.velocity if velocity is None else velocity
    if phase == "standstill":
        ctx.run_for(0.1)
        return None
    top = velocity if phase == "constant" else velocity + own.top - own.velocity
    ctx.do(f"MC_MoveVelocity {top * direction:g} mm/s")
    move = axis.move_velocity(top * direction, **own.dynamics)
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
    halt = axis.halt(Deceleration=own.dynamics["Deceleration"], Jerk=own.dynamics["Jerk"])
    ctx.wait_until(
        lambda: axis.object.motion.v * direction <= velocity,
        5.0,
        f"{velocity:g} mm/s are passed while braking",
    )
    return halt


def profile(ctx: CaseContext) -> str:
    """Return the profile of the drive under test."""
    return str(ctx.bench.config.drive[drive_name(ctx)].profile)


def need_encoder(ctx: CaseContext) -> None:
    """Block the case on a drive whose count follows its own pulses.

    Raises:
        BlockedError: It is one.

    """
    if profile(ctx) == "tm_pto":
        raise BlockedError(
            f"{drive_name(ctx)} is a stepper motor without encoder: its count follows its pulses, whatever "
            "the machine does"
        )


def need_cycle_of(ctx: CaseContext, most_s: float, reason: str) -> None:
    """Block the case on a bench with a longer bus cycle.

    Raises:
        BlockedError: It has one.

    """
    cycle_s = ctx.bench.cycle_ns * 1e-9
    if cycle_s > most_s:
        raise BlockedError(
            f"the case needs a bus cycle of at most {most_s * 1e3:g} ms, this bench has "
            f"{cycle_s * 1e3:g} ms: {reason}"
        )


def reset(ctx: CaseContext) -> None:
    """Reset the error of the axis and wait for it."""
    ctx.do("MC_Reset")
    ctx.wait_until(axis_of(ctx).reset().done, 5.0, "the error is reset")


def moves_again(ctx: CaseContext) -> None:
    """Wait until the axis is enabled without a new edge of `MC_Power`, and move."""
    axis = axis_of(ctx)
    ctx.wait_until(lambda: axis.operational, 5.0, "the axis is operational without a new edge of Enable")
    move = step_back(ctx)
    ctx.do(f"MC_MoveRelative {move.Distance:g}")
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
    needs_encoder: bool = False
    """It is seen by an encoder that shows what the machine does."""
    by_profile: Mapping[str, int] = field(default_factory=dict)
    """Other codes by the profile of the drive: it trips by itself, or its controller knows no more of it than
    the level of a ready output.
    """


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


BLOCKING: Final = frozenset(("mechanics.jam", "switch.stuck", "frame.drop"))
"""Kinds of faults that hold the machine, or its actual value, and leave the loop alone."""
_SERVO_SIGNALS: Final = frozenset(("NSOLL_B", "NIST_B", "MOMRED", "MELDW.0"))


def need_signals(ctx: CaseContext, fault: Fault, phase: str) -> None:
    """Block a fault of a telegram on a pulse module whose telegram, or whose ramp, is another one.

    Raises:
        BlockedError: It is one.

    """
    options = fault.parameters(ctx)
    signals = {str(value) for value in options.values()}
    segment = ctx.bench.config.segment[str(drive_setting(ctx, "segment"))]
    if fault.kind == "telegram.length" and "setpoint" in signals and segment.on_modbus:
        raise BlockedError("Modbus writes registers: a register less leaves the last word as it was")
    if profile(ctx) != "tm_pto":
        return
    if fault.reaction.code == LIFE_COUNTER or fault.kind == "telegram.sign_of_life":
        raise BlockedError(f"the telegram of {drive_name(ctx)}, a pulse module, has no sign of life")
    if signals & _SERVO_SIGNALS or fault.kind in {"telegram.swap", "telegram.late"}:
        raise BlockedError(f"the telegram of {drive_name(ctx)}, a pulse module, has other signals")
    if phase != "standstill" and signals & {"STW1.0", "STW1.2"}:
        raise BlockedError(f"{drive_name(ctx)}, a pulse module, operates on its ramp until it stands")


def expected_code(ctx: CaseContext, reaction: Reaction, *, moving: bool, velocity: float) -> int:
    """Return the code of a reaction on this bench.

    While actual values stay away the last ones count: on a slow bus the position lag is too large before they
    have been missed for too long.
    """
    code = reaction.by_profile.get(profile(ctx), reaction.code)
    if moving and code in {DATA_INVALID, LIFE_COUNTER}:
        axis = axis_of(ctx)
        lag_s = float(axis.read_parameter("axis.position_lag_max")) / abs(velocity)
        lag_s += float(axis.read_parameter("axis.position_lag_filter_time"))
        missed_s = cycles(ctx, ctx.bench.config.bench.grace_cycles + INVALID_CYCLES + 1)
        if lag_s < missed_s - cycles(ctx, 1) and reaction.within_s == 0.0:
            return LAG
    return code


def fault_case(ctx: CaseContext, fault: Fault, phase: str) -> None:
    """Bring the axis into a phase, inject the fault, expect code, stop, and what it takes to go on."""
    reaction = fault.reaction
    name = axis_name(ctx)
    if reaction.needs_encoder:
        need_encoder(ctx)
    if fault.kind.startswith("telegram."):
        need_signals(ctx, fault, phase)
    if reaction.code == LAG and fault.kind not in BLOCKING:
        need_cycle_of(ctx, 0.008, "its drive, or the loop with so much dead time, answers before")
    code = expected_code(ctx, reaction, moving=phase in {"constant", "accelerating"}, velocity=fault.velocity)
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
        axis_error(code, since=APPLIED, within_s=within, axis=name).covers(*reaction.requirements),
    )
    code_at(ctx, ended, code)
    if running is not None:
        ctx.measure("ErrorID of the running block", float(running.ErrorID), low=code, high=code)
    if not reaction.stands:
        return
    at_rest(ctx, ended)
    ctx.do("MC_MoveRelative, without a reset")
    refused = step_back(ctx)
    ctx.run_for(cycles(ctx, 3))
    ctx.expect(
        command_refused(code, since=ended, axis=name),
        no_motion_after(ended, position=f"{drive_name(ctx)}.position", tolerance=0.0001, until=ctx.now_s),
    )
    ctx.measure("ErrorID of a block before the reset", float(refused.ErrorID), low=code, high=code)
    if fault.lasts_s is None:
        injected.remove()
        # Until signs of life are synchronous again (PD-125) the drive cannot be acknowledged.
        ctx.run_for(max(0.3, cycles(ctx, 25)))
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
