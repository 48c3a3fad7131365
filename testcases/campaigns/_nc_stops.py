"""What the cases of `stop_modes` are on axes of an NC: `MC_Power` off, `MC_Stop`, `MC_Halt`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from hil.campaign import CaseContext, Counterpart, NotApplicable
from hil.expect import axis_error, command_refused, golden, no_axis_error, no_motion_after, ramp, value_at
from testcases.campaigns._nc import (
    NC_NEEDS,
    NO_ENABLE,
    Numbers,
    Table,
    at_rest,
    axis_name,
    axis_of,
    bring_into,
    code_at,
    enable,
    moves_again,
    reset,
    step_back,
)
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import drive_name, settle_s


@dataclass(frozen=True)
class Stop:
    """A stop of an NC axis."""

    block: str
    """`power`, `stop` or `halt`."""
    inputs: bool = False
    """The block has its own deceleration and jerk; else those of the axis count."""
    requirements: tuple[str, ...] = ()


STOPS: Final = {
    "power-0": Stop("power", requirements=("NC-733",)),
    "stop-0": Stop("stop", requirements=("NC-035", "NC-724")),
    "stop-3": Stop("stop", inputs=True, requirements=("NC-035",)),
    "halt": Stop("halt"),
}
NO_STOP_MODE: Final = NotApplicable(
    "MC_Power of the NC has no StopMode: without Enable the axis is shut down, as in power-0"
)
NO_MODE: Final = NotApplicable("MC_Stop of the NC has no Mode: its inputs say the ramp, as in stop-3")
NO_REACTION: Final = NotApplicable(
    "an NC axis has no alarms with reactions: every error shuts it down, as the campaign fault_reactions "
    "shows"
)


def _counterpart(stop: str, phase: str, words: str) -> Counterpart:
    del words
    facts = STOPS[stop]
    name = {"power": "MC_Power Enable = FALSE", "stop": "MC_Stop", "halt": "MC_Halt"}[facts.block]
    ramp_words = ", deceleration and jerk by its inputs" if facts.inputs else ""
    title = f"{name}{ramp_words}, {phase}"
    return Counterpart(stop_case, {"stop": stop, "phase": phase}, facts.requirements, title, NC_NEEDS)


STOP_MODES: Final = Table(
    {
        **{f"{name}/*": _counterpart for name in STOPS},
        "power-*": NO_STOP_MODE,
        "stop-*": NO_MODE,
        "reaction-*": NO_REACTION,
    }
)


def stop_case(ctx: CaseContext, stop: str, phase: str) -> None:
    """Stop an NC axis and compare ramp, travel, outputs of the blocks and error with what the NC owes."""
    facts = STOPS[stop]
    enable(ctx)
    running = bring_into(ctx, phase)
    if facts.block == "power":
        _disable(ctx, running)
    else:
        _brake(ctx, facts, phase, running)


def _disable(ctx: CaseContext, running: Any) -> None:
    """Without controller enable a moving axis is in error and is shut down; at rest it is only disabled."""
    axis, name = axis_of(ctx), axis_name(ctx)
    before = ctx.now_s
    ctx.do("MC_Power Enable = FALSE")
    power = axis.power(False)
    ctx.run_for(4.0 + settle_s(ctx))
    ended = ctx.now_s
    at_rest(ctx, ended)
    ctx.measure("MC_Power.Status", float(power.Status), high=0.0)
    if running is None:
        ctx.expect(no_axis_error(axis=name), no_motion_after(before, position=f"{drive_name(ctx)}.position"))
    else:
        ctx.expect(
            axis_error(NO_ENABLE, since=before, within_s=cycles(ctx, 2), axis=name).covers("NC-733"),
            value_at(f"{name}.set_velocity", before + cycles(ctx, 3), 0.0, tolerance=0.0).named("no ramp"),
        )
        code_at(ctx, ended, NO_ENABLE)
        ctx.measure("ErrorID of the running block", float(running.ErrorID), low=NO_ENABLE, high=NO_ENABLE)
        reset(ctx)
    refused = step_back(ctx)
    ctx.run_for(cycles(ctx, 3))
    ctx.expect(command_refused(NO_ENABLE, since=ended, axis=name).covers("NC-733"))
    ctx.measure("ErrorID of a command without enable", float(refused.ErrorID), low=NO_ENABLE, high=NO_ENABLE)
    enable(ctx)
    moves_again(ctx)


def _brake(ctx: CaseContext, facts: Stop, phase: str, running: Any) -> None:
    """`MC_Stop` and `MC_Halt` brake with their inputs or the defaults of the axis; a stop locks the axis."""
    axis, name = axis_of(ctx), axis_name(ctx)
    inputs = Numbers(ctx).braking if facts.inputs else {}
    before = ctx.now_s
    words = "".join(f", {key} {value:g}" for key, value in inputs.items())
    ctx.do(f"MC_{facts.block.capitalize()}{words}")
    block = axis.stop(**inputs) if facts.block == "stop" else axis.halt(**inputs)
    ctx.run_for(1.2 + cycles(ctx, 50) + settle_s(ctx))
    ended = ctx.now_s
    at_rest(ctx, ended)
    ctx.expect(no_axis_error(axis=name))
    ctx.measure("Done of the block", float(block.Done), low=1.0)
    if running is not None:
        ctx.measure("CommandAborted of the block before", float(running.CommandAborted), low=1.0)
        _on_ramp(ctx, phase, inputs, before)
    if facts.block == "stop":
        refused = step_back(ctx)
        ctx.run_for(cycles(ctx, 3))
        ctx.measure(
            "ErrorID of a command while MC_Stop locks", float(refused.ErrorID), low=0x42EF, high=0x42EF
        )
        ctx.expect(command_refused(0x42EF, since=ended, axis=name).covers("NC-741"))
        ctx.do("MC_Stop Execute = FALSE")
        block.set(Execute=False)
        ctx.run_for(cycles(ctx, 3))
    moves_again(ctx)


def _on_ramp(ctx: CaseContext, phase: str, inputs: dict[str, float], before: float) -> None:
    """Expect time and travel of the ramp by formula, from the setpoints in the trace at its beginning."""
    name, trace = axis_name(ctx), ctx.trace()
    cycle_s = ctx.bench.cycle_ns * 1e-9
    # Without inputs those of the last motion count, not the defaults of the axis (NC-724).
    given = {**Numbers(ctx).dynamics, **inputs}
    deceleration, jerk = given["Deceleration"], given["Jerk"]
    velocity = trace[f"{name}.set_velocity"].at(before)
    present = trace[f"{name}.set_acceleration"].at(before) * math.copysign(1.0, velocity)
    if phase == "constant":
        present = 0.0
    # A ramp that already brakes harder than it may is eased off first; the formula has no case for that.
    expected = golden.stop_ramp(abs(velocity), deceleration, jerk, acceleration=max(present, -deceleration))
    ctx.expect(
        ramp(
            before,
            velocity=f"{name}.set_velocity",
            position=f"{name}.set_position",
            time_s=expected.time_s,
            time_tolerance_s=3 * cycle_s,
            distance=expected.distance,
            distance_tolerance=abs(velocity) * 3.2 * cycle_s,
            threshold=1e-6,
            until=before + 1.0,
        )
    )
