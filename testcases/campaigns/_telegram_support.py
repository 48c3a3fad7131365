"""What the cases of `telegram_faults` share."""

from __future__ import annotations

from hil.campaign import CaseContext
from hil.errors import BlockedError
from hil.expect import alarm, state_at, value_at
from hil.record import EventSelector, event
from testcases.campaigns._reactions import cycles, disabled_by_alarm, recovers, stopped_for_good
from testcases.campaigns.support import axis_name, drive_name, settle_s

APPLIED = event("fault.applied")


def need_sign_of_life(ctx: CaseContext) -> None:
    """Block the case on a bench whose drive and controller do not watch each other's sign of life.

    Raises:
        BlockedError: The telegram has none, or the bench file switches it off.

    """
    port = ctx.bench.port(drive_name(ctx))
    if not getattr(port, "watches_sign_of_life", False):
        raise BlockedError(f"drive and controller of {port.name} do not watch a sign of life")


def drive_enters(ctx: CaseContext, state: str) -> EventSelector:
    """Select the instant at which the drive enters a state of the general state machine."""
    return event("drive.state", drive_name(ctx), to=state)


def drive_faults(ctx: CaseContext, text: str) -> EventSelector:
    """Select the fault of the drive with this text."""
    return event("drive.fault", drive_name(ctx), text=text)


def ends_disabled(
    ctx: CaseContext, number: int, *, within: float, identifiers: tuple[str, ...], stop_s: float = 1.5
) -> float:
    """Let the stop happen; expect the alarm with reaction 4 within so many cycles, standstill, a disabled
    axis.
    """
    ctx.run_for(stop_s + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(number, reaction=4, since=APPLIED, within_s=cycles(ctx, within), axis=axis_name(ctx)).covers(
            *identifiers
        )
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    return ended


def goes_on(ctx: CaseContext) -> None:
    """Expect an enabled axis in motion now."""
    axis = axis_name(ctx)
    ctx.expect(
        state_at(axis, ctx.now_s, "MOTION"), value_at(f"{axis}.power_status", ctx.now_s, 1.0, tolerance=0.0)
    )


__all__ = [
    "APPLIED",
    "disabled_by_alarm",
    "drive_enters",
    "drive_faults",
    "ends_disabled",
    "goes_on",
    "need_sign_of_life",
    "recovers",
    "stopped_for_good",
]
