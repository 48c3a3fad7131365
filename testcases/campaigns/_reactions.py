"""What the campaigns about faults expect of an axis afterwards: at rest, disabled, recovered."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.campaign import CaseContext
from hil.expect import no_motion_after, standstill, state_at, value_at
from testcases.campaigns.own_axis import own
from testcases.campaigns.support import acknowledge, axis_name, drive_name

_STANDSTILL: Final = 1 << 7


def cycles(ctx: CaseContext, number: float) -> float:
    """Return the time of `number` cycles plus the scheduling tolerance of the bench, s."""
    return number * ctx.bench.cycle_ns * 1e-9 + float(ctx.bench.config.tolerance.time_s)


def detection_s(ctx: CaseContext, number: float) -> float:
    """Return the time of `number` cycles behind the filter of the limit switches, s (LIM-026)."""
    filters = (
        ctx.bench.config.input_filter_s(axis_name(ctx), switch)
        for switch in ("negative_limit", "positive_limit")
    )
    return cycles(ctx, number) + max(filters)


def calls(ctx: CaseContext, number: float) -> float:
    """Return the time of `number` calls of the user program plus the scheduling tolerance of the bench, s."""
    return number * own(ctx).call_s + float(ctx.bench.config.tolerance.time_s)


def stopped_for_good(ctx: CaseContext, ended: float) -> None:
    """Expect the machine itself at rest, and no motion afterwards."""
    ctx.expect(standstill(by=ended - 0.3, axis=axis_name(ctx), until=ended))
    machine_at_rest(ctx, ended)


def machine_at_rest(ctx: CaseContext, ended: float) -> None:
    """Expect the machine itself at rest, whatever the axis knows of it."""
    ctx.expect(
        no_motion_after(
            ended - 0.3, position=f"{drive_name(ctx)}.position", tolerance=0.00005, until=ended
        ).named("machine at rest")
    )


def disabled_by_alarm(ctx: CaseContext, ended: float) -> None:
    """Expect the axis disabled by its alarm, with `MC_Power` still busy (STP-344)."""
    axis = axis_name(ctx)
    ctx.expect(
        state_at(axis, ended, "ALARM_DISABLED"),
        value_at(f"{axis}.power_status", ended, 0.0, tolerance=0.0).covers("STP-344"),
        value_at(f"{axis}.power_busy", ended, 1.0, tolerance=0.0).covers("STP-344"),
    )


def waited_for_standstill(
    ctx: CaseContext, name: str, velocity: str, threshold: float, *, since_s: float
) -> float:
    """Return how long the velocity of an object was below the threshold before StatusWord.X7 showed
    standstill, s.

    Raises:
        BlockedError: It has not moved since `since_s`.

    """
    trace = ctx.trace()
    word, speed = trace[f"{name}.status_word"], trace[velocity]
    fast = np.flatnonzero((speed.time_s > since_s) & (np.abs(speed.values) >= threshold))
    ctx.require(bool(len(fast)), f"{name} has moved")
    slow_s = float(speed.time_s[fast[-1]])
    shown = np.flatnonzero((word.time_s > slow_s) & ((word.values.astype(np.int64) & _STANDSTILL) != 0))
    return (float(word.time_s[shown[0]]) if len(shown) else ctx.now_s) - slow_s


def recovers(ctx: CaseContext) -> None:
    """Acknowledge, wait for the automatic enable, and move again."""
    acknowledge(ctx)
    ctx.wait_until(ctx.axis.power_instance.status, 5.0, "the axis is enabled again without a new edge")
    ctx.do("MC_MoveRelative -20 mm")
    move = ctx.axis.move_relative(-20.0)
    ctx.wait_until(move.done, 5.0, "the axis moves again")
