"""A campaign for the tests of the runner: cases of every kind of end, on the toy bench."""

import os

from hil.campaign import Campaign
from hil.errors import BlockedError
from hil.expect import alarm, event, standstill

CAMPAIGN = Campaign("toy", tags=("toy",), bench="testcases.unit.hil.toybench:BENCH")
FATAL = Campaign("fatal", bench="testcases.unit.hil.toybench:BENCH")


def enable(ctx):
    ctx.do("enable")
    ctx.axis.power()
    ctx.wait_until(lambda: ctx.axis.state == "STANDSTILL", 1.0, "enabled")


@CAMPAIGN.product(
    "move-{velocity}",
    parameters={"velocity": [50, 100, 200]},
    title="Trip at {velocity} mm/s",
    requirements=("STP-559",),
)
def trip(ctx, velocity):
    enable(ctx)
    ctx.do(f"move with {velocity} mm/s", velocity=velocity)
    ctx.axis.move_velocity(float(velocity))
    ctx.run_for(0.3)
    ctx.inject("drive.fault", code=0x2310)
    ctx.run_for(0.5)
    ctx.expect(alarm(421, reaction=4, within_s=0.02, since=event("fault.applied")))
    ctx.expect(standstill(by=event("fault.applied").plus(0.4)))


@CAMPAIGN.case("wrong", title="An expectation that does not hold")
def wrong(ctx):
    enable(ctx)
    ctx.expect(alarm(999))


@CAMPAIGN.case("blocked", title="A bench that is not as needed")
def blocked(ctx):
    raise BlockedError("no hydraulic unit")


@CAMPAIGN.case("broken", title="A case with a mistake")
def broken(ctx):
    enable(ctx)
    raise ValueError("a mistake in the case")


@CAMPAIGN.case("chance", title="A case that draws from the seed")
def chance(ctx):
    ctx.measure("drawn", float(ctx.rng().uniform()), low=0.0, high=1.0)


@FATAL.case("first")
def first(ctx):
    """A case before the fatal one."""
    ctx.run_for(0.1)


@FATAL.case("exit")
def fatal(ctx):
    """A case that kills its process."""
    os._exit(3)


@FATAL.case("last")
def last(ctx):
    """A case after the fatal one."""
    ctx.run_for(0.1)
