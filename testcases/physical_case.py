"""One case that runs unchanged on every bench: virtual, live, and with drives that the bench did not bring.

It uses nothing but the axis and faults on the bus, as a test for real hardware does.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, event, job_output, no_alarm, no_motion_after, state_at, value_at
from testcases.campaigns.support import acknowledge, axis_name, enable, grace_s

CAMPAIGN: Final = Campaign("physical drive", bench="reference")

_WAIT_S: Final = 20.0
_VELOCITY: Final = 60.0


@CAMPAIGN.case("round trip", requirements=("STP-574", "TA-020"))
def round_trip(ctx: CaseContext) -> None:
    """Enable, home, move, stop; then the actual values are lost, which is alarm 431, and the axis recovers
    from it.
    """
    axis = axis_name(ctx)
    enable(ctx)
    ctx.do("MC_Home to 10 mm")
    home = ctx.axis.home(10.0)
    ctx.wait_until(home.done, _WAIT_S, "the axis is homed")
    ctx.do("MC_MoveAbsolute to 40 mm")
    move = ctx.axis.move_absolute(40.0, Velocity=_VELOCITY)
    ctx.wait_until(move.done, _WAIT_S, "the target is reached")
    # The machine that runs this may be late; the axis then comes to rest later.
    ctx.wait_until(
        lambda: abs(ctx.axis.var("ActualPosition") - 40.0) < 1.0, _WAIT_S, "the axis is at rest there"
    )
    ctx.expect(
        no_alarm(axis=axis, until=ctx.now_s),
        job_output(move.name, "Done"),
        value_at(f"{axis}.actual_position", ctx.now_s, 40.0, tolerance=2.0),
    )
    ctx.do("MC_MoveVelocity, then MC_Stop")
    travel = ctx.axis.move_velocity(_VELOCITY)
    ctx.wait_until(travel.in_velocity, _WAIT_S, "constant travel")
    stop = ctx.axis.stop(2)
    ctx.wait_until(stop.done, _WAIT_S, "the axis has stopped")
    ctx.run_for(1.0)
    ctx.expect(
        job_output(travel.name, "CommandAborted"),
        state_at(axis, ctx.now_s, "STOP_HOLD"),
        no_motion_after(ctx.now_s - 0.2, axis=axis, until=ctx.now_s),
    )
    stop.set(Execute=False)
    ctx.run_for(0.2)

    ctx.do("the actual values are lost")
    travel = ctx.axis.move_velocity(-_VELOCITY)
    ctx.wait_until(travel.in_velocity, _WAIT_S, "constant travel back")
    lost = ctx.inject("frame.drop", message="tpdo1", drive=next(iter(ctx.bench.config.drive)))
    ctx.wait_until(lambda: not ctx.axis.communication_ok, grace_s(ctx) + _WAIT_S, "the loss is noticed")
    ctx.run_for(1.0)
    ctx.expect(
        alarm(431, reaction=4, since=event("fault.applied"), axis=axis),
        job_output(travel.name, "Error"),
    )
    lost.remove()
    ctx.wait_until(lambda: ctx.axis.communication_ok, _WAIT_S, "the actual values are back")
    acknowledge(ctx)
    ctx.run_for(1.0)
    ctx.expect(
        state_at(axis, ctx.now_s, "STANDSTILL"),
        no_motion_after(ctx.now_s - 0.2, axis=axis),
    )
