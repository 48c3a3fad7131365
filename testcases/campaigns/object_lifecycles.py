"""Technology objects that are no axes, over everything that happens to their controller: leading axis
proxies, measuring inputs, external encoders.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.controllers import CELL
from testcases.campaigns.support import enable, equal

_HERE: Final = "testcases.campaigns.object_lifecycles"
_CYCLE_S: Final = 0.004


def _delayed(delay_s: float) -> BenchFile:
    path = "CrossPlcSynchronousOperation.LocalLeadingValueDelayTime"
    return CELL.configured({"axis": {"leader": {"variables": {path: delay_s}}}})


DELAYED: Final = _delayed(0.03)
FAR: Final = _delayed(0.5)
OF_PROXIES: Final = Campaign(
    "life of a proxy", tags=("synchronous", "controller"), bench="testcases.campaigns.controllers:CELL"
)
OF_DELAYED: Final = Campaign("delayed proxy", tags=("synchronous",), bench=f"{_HERE}:DELAYED")
OF_FAR: Final = Campaign("proxy too far behind", tags=("synchronous",), bench=f"{_HERE}:FAR")
OF_INPUTS: Final = Campaign(
    "life of a measuring input", tags=("axis", "measuring", "controller"),
    bench="testcases.campaigns.axis_options:PROBES",
)  # fmt: skip
OF_ENCODERS: Final = Campaign(
    "life of an external encoder", tags=("encoder", "controller"),
    bench="testcases.campaigns.external_encoder:REFERENCE",
)  # fmt: skip
EVENTS: Final = ("stop", "breakpoint", "power", "memory-reset", "download", "project", "upgrade")


def happen(ctx: CaseContext, controller: Any, event: str, name: str) -> None:
    """Let something happen to a controller and its object, and bring it to RUN again."""
    if event == "power":
        controller.power_off()
        ctx.run_for(0.2)
        controller.power_on()
    elif event == "breakpoint":
        controller.breakpoint()
        ctx.run_for(0.8)
        controller.run()
    else:
        controller.stop()
        ctx.run_for(0.8)
        acts: dict[str, Callable[[], object]] = {
            "stop": lambda: None,
            "memory-reset": controller.memory_reset,
            "download": lambda: controller.download(name, {}),
            "project": controller.load_project,
            "upgrade": lambda: controller.load_project(upgraded=True),
        }
        acts[event]()
        controller.run()
    ctx.wait_until(lambda: controller.state.name == "RUN", 10.0, "RUN")
    ctx.run_for(0.3)


# -- proxies -------------------------------------------------------------------------------------------------


def _led(ctx: CaseContext) -> tuple[Any, Any, Any]:
    """Return the leading axis at 50 mm/s, its follower in gear, and the proxy."""
    leader, follower = ctx.bench.axis("leader"), ctx.bench.axis("follower")
    for axis in (leader, follower):
        ctx.wait_until(axis.reset().done, 3.0, "acknowledged")
        ctx.wait_until(axis.power().status, 5.0, "enabled")
    line = ctx.bench.proxy("line")
    job = follower.gear_in(line, 1, 1)
    running = leader.move_velocity(50.0)
    ctx.wait_until(running.in_velocity, 3.0, "constant")
    ctx.wait_until(lambda: job.InGear, 3.0, "in gear")
    return leader, follower, line


@OF_PROXIES.product(
    "after/{event}",
    parameters={"event": EVENTS},
    title="a leading axis proxy after {event} of its controller",
    requirements=("SYN-357", "MC-630"),
)
def proxy_after(ctx: CaseContext, event: str) -> None:
    """The proxy has no alarm, shows the leading value again as soon as its controller runs, and leads its
    follower.
    """
    leader, follower, line = _led(ctx)
    happen(ctx, ctx.bench.controllers["plc2"], event, "line")
    equal(ctx, "ErrorWord of the proxy", line.var("ErrorWord"), 0.0, "MC-630")
    equal(ctx, "X0 of the proxy", line.var("StatusWord.X0"), 1.0)
    equal(ctx, "velocity of the proxy", line.var("Velocity"), 50.0, "SYN-357", within=1e-6)
    equal(ctx, "enabled follower", follower.var("StatusWord.X0"), 0.0)
    ctx.wait_until(follower.reset().done, 3.0, "acknowledged")
    ctx.wait_until(follower.power().status, 5.0, "enabled")
    job = follower.gear_in(line, 2, 1)
    ctx.wait_until(lambda: job.InGear, 3.0, "in gear again")
    ctx.run_for(0.1)
    equal(ctx, "velocity of the follower", follower.var("Velocity"), 100.0, "SYN-357", within=1e-6)
    equal(ctx, "velocity of the leader", leader.var("Velocity"), 50.0, within=1e-6)


@OF_PROXIES.case("modulo-changed", requirements=("SYN-357",))
def modulo_changed(ctx: CaseContext) -> None:
    """Another modulo range of the leading axis is an alarm of the proxy, which is no leading value until it
    restarts.
    """
    ctx.run_for(0.2)
    line, leader = ctx.bench.proxy("line"), ctx.bench.axis("leader")
    equal(ctx, "X4 of the proxy", line.var("StatusWord.X4"), 1.0)
    leader.variables.write_start("Modulo.Length", 90.0)
    ctx.wait_until(leader.reset(restart=True).done, 3.0, "the leading axis has restarted")
    ctx.run_for(0.1)
    equal(ctx, "ErrorDetail.Number", line.var("ErrorDetail.Number"), 903.0, "SYN-357")
    equal(ctx, "X4 with the alarm", line.var("StatusWord.X4"), 0.0, "SYN-357")
    ctx.wait_until(line.reset(restart=True).done, 3.0, "the proxy has restarted")
    ctx.run_for(0.1)
    equal(ctx, "ErrorWord after the restart", line.var("ErrorWord"), 0.0, "SYN-357")
    equal(ctx, "X4 after the restart", line.var("StatusWord.X4"), 1.0, "SYN-357")


@OF_DELAYED.case("value", requirements=("SYN-348", "SYN-073"))
def delayed(ctx: CaseContext) -> None:
    """The value of the proxy is that of the leading axis a delay ago, interpolated between two cycles, also
    while it accelerates.
    """
    _led(ctx)
    leader, line = ctx.bench.axis("leader"), ctx.bench.proxy("line")
    since = ctx.now_s
    leader.move_velocity(120.0, Acceleration=300.0, Jerk=0.0)
    ctx.run_for(0.3)
    leader.move_velocity(-40.0, Acceleration=300.0, Deceleration=400.0, Jerk=0.0)
    ctx.run_for(0.6)
    time = line.var("StatusExternalLeadingValue.AdjustmentTime")
    equal(ctx, "AdjustmentTime", time, 2.0 * _CYCLE_S - 0.03, "SYN-348", within=1e-9)
    trace = ctx.trace()
    given, shown = trace["leader.velocity_setpoint"], trace["line.velocity"]
    rows = shown.time_s > since + 0.1
    wanted = np.interp(shown.time_s[rows] - 0.03, given.time_s, given.values)
    off = float(np.abs(shown.values[rows] - wanted).max())
    ctx.measure("velocity off the delayed one", off, "mm/s", high=400.0 * _CYCLE_S, requirements=("SYN-348",))
    ctx.measure("range of the velocity", float(np.ptp(shown.values[rows])), low=100.0)


@OF_FAR.case("alarm", requirements=("SYN-348",))
def far(ctx: CaseContext) -> None:
    """A delay beyond what the proxy keeps of the past is an alarm of its accuracy, not a value of nowhere."""
    leader = ctx.bench.axis("leader")
    line = ctx.bench.proxy("line")
    ctx.wait_until(leader.power().status, 5.0, "enabled")
    leader.move_velocity(50.0)
    ctx.run_for(1.0)
    equal(ctx, "ErrorDetail.Number", line.var("ErrorDetail.Number"), 902.0, "SYN-348")
    velocity = float(line.var("Velocity"))
    ctx.measure("velocity", velocity, low=-1e-6, high=50.0 + 1e-6)


# -- measuring inputs and encoders ---------------------------------------------------------------------------


@OF_INPUTS.product(
    "after/{event}-{which}",
    parameters={"event": EVENTS, "which": ("own", "central")},
    title="measuring input {which} after {event} of the controller",
    requirements=("MC-630", "CFG-200"),
)
def input_after(ctx: CaseContext, event: str, which: str) -> None:
    """A measurement that runs is over, without an alarm, and the next one finds its edge."""
    axis, one = ctx.axis, ctx.bench.measuring_input(which)
    enable(ctx)
    job = one.measure(0)
    ctx.run_for(0.03)
    equal(ctx, "Busy", job.Busy, 1.0)
    happen(ctx, ctx.bench.controller, event, which if event == "download" else axis.name)
    equal(ctx, "Busy afterwards", job.Busy, 0.0, "MC-630")
    equal(ctx, "ErrorWord of the input", one.var("ErrorWord"), 0.0, "MC-630")
    ctx.wait_until(axis.reset().done, 3.0, "acknowledged")
    enable(ctx)
    again = one.measure(0)
    machine = float(ctx.trace()["drive1.position"].values[-1]) * 1000.0
    zero = float(axis.var("ActualPosition")) - machine
    ctx.run_for(0.03)
    ctx.wait_until(axis.move_relative(40.0 - machine, Velocity=200.0).done, 3.0, "past the edge")
    equal(ctx, "Done", again.Done, 1.0, "CFG-200")
    equal(ctx, "place", again.MeasuredValue1 - zero, 21.3, "CFG-200", within=0.03)


@OF_ENCODERS.product(
    "after/{event}",
    parameters={"event": EVENTS},
    title="external encoders after {event} of the controller",
    requirements=("MC-630", "CFG-153"),
)
def encoder_after(ctx: CaseContext, event: str) -> None:
    """External encoders have no alarm, are not enabled, keep the position that their type keeps, and are
    enabled again.
    """
    ctx.run_for(0.3)
    names = ctx.bench.external_encoder_names
    before = {}
    for name in names:
        one = ctx.bench.external_encoder(name)
        ctx.wait_until(one.power().status, 3.0, f"{name} is enabled")
        before[name] = float(one.var("ActualPosition"))
    happen(ctx, ctx.bench.controller, event, names[0])
    for name in names:
        one = ctx.bench.external_encoder(name)
        if event == "power":  # encoders miss their controller, which is told
            ctx.wait_until(one.reset().done, 5.0, f"{name} is acknowledged")
        equal(ctx, f"ErrorWord of {name}", one.var("ErrorWord"), 0.0, "MC-630")
        equal(ctx, f"X0 of {name}", one.var("StatusWord.X0"), 0.0, "MC-630")
        if event == "stop":
            # The shafts of this bench turn: they have gone on by their speed.
            speed = float(one.var("ActualVelocity"))
            moved = float(one.var("ActualPosition")) - before[name]
            ctx.measure(f"way of {name}", abs(moved), high=2.0 * abs(speed) + 1e-3, requirements=("CFG-153",))
        one.power(False)
        ctx.run_for(0.02)
        ctx.wait_until(one.reset().done, 3.0, f"{name} is acknowledged")
        power = one.power()
        ctx.wait_until(power.status, 3.0, f"{name} is enabled again")
