"""Limits and overrides that change while an axis moves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hil.campaign import Campaign, CaseContext
from testcases.campaigns._reactions import cycles
from testcases.campaigns.own_axis import Own, own
from testcases.campaigns.support import axis_name, enable, equal

Numbers = NDArray[np.float64]
_NEEDS: Final = {
    "cpu": "S7-1500T", "interpolator": "1", "program": "1", "software-limits": "off",
    "motion": ("linear", "rotary"), "neighbours": "none", "load": "not heavy",
}  # fmt: skip
CAMPAIGN: Final = Campaign("limits in motion", tags=("axis", "dynamics"), bench="reference", needs=_NEEDS)


_TOP, _WAY = 0.5, 0.95
"""Velocity and way of the jobs, shares of the greatest velocity and of its way in a second."""


class Slopes:
    """What the setpoint of the axis has done since an instant.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self._ctx = ctx
        self._name = axis_name(ctx)
        self.values: Own = own(ctx)

    def _since(self, column: str, since: float) -> Numbers:
        signal = self._ctx.trace()[f"{self._name}.{column}"]
        return np.asarray(signal.values)[np.asarray(signal.time_s) > since + 1e-9]

    def constant(self, what: str, since: float, wanted: float, *ids: str, skip: int = 1) -> None:
        """Expect an acceleration of the setpoint, from the second cycle on."""
        found = self._since("acceleration_setpoint", since)[skip:]
        self._ctx.require(bool(len(found)), "there are samples")
        within = 1e-6 * abs(wanted) + 1e-6
        equal(self._ctx, f"{what}: least", float(found.min()), wanted, *ids, within=within)
        equal(self._ctx, f"{what}: greatest", float(found.max()), wanted, *ids, within=within)

    def steepest(self, since: float) -> float:
        """Return the greatest change of the acceleration since an instant, per s."""
        cycle = self._ctx.bench.interpolator_ns * 1e-9
        return float(np.abs(np.diff(self._since("acceleration_setpoint", since))).max()) / cycle

    @property
    def velocity(self) -> float:
        """Velocity setpoint, position unit/s."""
        return float(self._ctx.axis.var("Velocity")) * self.values.golden.velocity_unit


def _movers(ctx: CaseContext, values: Own, sign: float) -> dict[str, Callable[[dict[str, float]], Any]]:
    """Return what starts each kind of job, with its velocity and dynamic inputs."""
    axis = ctx.axis
    velocity, far = values.given(values.speed(_TOP)), sign * values.way(_WAY)
    return {
        "velocity": lambda inputs: axis.move_velocity(sign * velocity, **inputs),
        "jog": lambda inputs: axis.jog(velocity, backward=sign < 0.0, **inputs),
        "relative": lambda inputs: axis.move_relative(far, Velocity=velocity, **inputs),
        "absolute": lambda inputs: axis.move_absolute(
            float(axis.var("Position")) + far, Velocity=velocity, **inputs
        ),
    }


@CAMPAIGN.product(
    "job/{job}-{way}",
    parameters={"job": ("velocity", "jog", "relative", "absolute"), "way": ("forward", "backward")},
    title="limits change during {job} {way}",
    requirements=("VAR-001", "VAR-004", "STP-106", "STP-107", "STP-108", "STP-113", "VAR-164"),
)
def during(ctx: CaseContext, job: str, way: str) -> None:
    """A limit that is lowered acts from the next cycle on; raised again, the value of the job is back; so
    does the override, also 0 and back, and the job ends where it was to end.
    """
    enable(ctx)
    slopes, axis = Slopes(ctx), ctx.axis
    values, limits = slopes.values, slopes.values.golden
    sign = 1.0 if way == "forward" else -1.0
    if job == "absolute":
        ctx.wait_until(axis.home(0.0).done, 2.0, "homed")
    inputs = values.dynamics("job").without_jerk().inputs
    up, down = inputs["Acceleration"], inputs["Deceleration"]
    begun = float(axis.var("Position"))
    running = _movers(ctx, values, sign)[job](inputs)
    few = cycles(ctx, 3)
    ctx.run_for(few)

    def changed(path: str, value: float, wanted: float, *ids: str) -> None:
        axis.write(path, value)
        since = ctx.now_s
        ctx.run_for(few)
        slopes.constant(f"acceleration with {path} = {value:.6g}", since, wanted, *ids)

    changed("DynamicLimits.MaxAcceleration", 0.4 * up, sign * 0.4 * up, "STP-106")
    changed("DynamicLimits.MaxAcceleration", limits.maximum_acceleration, sign * up, "VAR-001")
    top = values.speed(_TOP)
    ctx.wait_until(lambda: abs(slopes.velocity) > 0.999 * top, 3.0, "the velocity is there")
    ctx.run_for(cycles(ctx, 4))
    if job in ("velocity", "jog"):
        equal(ctx, "InVelocity", running.InVelocity, 1.0)
    near = 1e-9 * top
    # Velocities: the limit, then the override, then both.
    for limit, percent in ((0.3, 100.0), (0.9, 100.0), (0.9, 50.0), (0.15, 50.0), (2.0, 100.0)):
        axis.write("DynamicLimits.Velocity", values.given(values.speed(min(limit, 1.0))))
        axis.write("Override.Velocity", percent)
        since, before = ctx.now_s, abs(slopes.velocity)
        wanted = min(top * percent / 100.0, values.speed(min(limit, 1.0)))
        slope = down if wanted < before else up
        ctx.run_for(cycles(ctx, 2))
        if abs(wanted - before) > slope * cycles(ctx, 4):
            signed = sign * slope * (-1.0 if wanted < before else 1.0)
            slopes.constant(f"slope to {wanted:.5g}", since, signed, "VAR-164")
            if job in ("velocity", "jog"):
                equal(ctx, "InVelocity on the way", running.InVelocity, 0.0, "MC-303")
        ctx.wait_until(lambda w=wanted: abs(abs(slopes.velocity) - w) < near, 3.0, "the velocity is there")
        ctx.run_for(cycles(ctx, 3))
        what = f"velocity with {limit} and {percent} %"
        equal(ctx, what, slopes.velocity, sign * wanted, "STP-113", within=near)
        if job in ("velocity", "jog"):
            equal(ctx, "InVelocity there", running.InVelocity, 1.0, "MC-303")
    # Override 0 holds the job, and another one lets it go on.
    axis.write("Override.Velocity", 0.0)
    since = ctx.now_s
    ctx.run_for(few)
    slopes.constant("slope with override 0", since, -sign * down, "VAR-164")
    axis.write("DynamicLimits.MaxDeceleration", 0.45 * down)
    since = ctx.now_s
    ctx.run_for(few)
    slopes.constant("slope with a lower deceleration", since, -sign * 0.45 * down, "STP-107")
    axis.write("DynamicLimits.MaxDeceleration", limits.maximum_deceleration)
    ctx.wait_until(lambda: slopes.velocity == 0.0, 3.0, "it stands")
    ctx.run_for(few)
    equal(ctx, "Busy with override 0", running.Busy, 1.0)
    equal(ctx, "it stands with override 0", slopes.velocity, 0.0)
    axis.write("Override.Velocity", 100.0)
    ctx.run_for(few)
    ctx.measure("velocity with the override again", sign * slopes.velocity, low=1e-6)
    if job in ("relative", "absolute"):
        ctx.wait_until(running.done, 6.0, "the job ends where it was to end")
        equal(ctx, "way", float(axis.var("Position")) - begun, sign * values.way(_WAY), within=1e-6)
    else:
        running.set(Execute=False) if job == "velocity" else running.set(JogForward=False, JogBackward=False)
        if job == "velocity":
            ctx.wait_until(axis.halt().done, 3.0, "it stands")
        ctx.wait_until(lambda: not running.Busy, 3.0, "the job has ended")


@CAMPAIGN.product(
    "ramp/{what}",
    parameters={
        "what": ("halt", "stop-0", "stop-2", "stop-3", "power-0", "power-2", "reaction-2", "reaction-3"),
    },
    title="the limit of a ramp changes on it: {what}",
    requirements=("VAR-001", "STP-107", "STP-239", "STP-241", "STP-386", "STP-387"),
    without=("STP-245",),  # its formula has the limit of the beginning
)
def ramp(ctx: CaseContext, what: str) -> None:
    """A ramp that runs goes on with the new value of what limits it, ends, and nothing else changes it."""
    enable(ctx)
    slopes, axis = Slopes(ctx), ctx.axis
    values, limits = slopes.values, slopes.values.golden
    inputs = values.dynamics("job").without_jerk()
    job = axis.move_velocity(-values.given(values.speed(0.8)), **inputs.inputs)
    ctx.wait_until(job.in_velocity, 3.0, "constant")
    own_value = inputs.deceleration
    emergency = float(axis.variables.read("DynamicDefaults.EmergencyDeceleration"))
    paths = {
        "halt": ("DynamicLimits.MaxDeceleration", own_value),
        "stop-3": ("DynamicLimits.MaxDeceleration", own_value),
        "stop-0": ("DynamicDefaults.EmergencyDeceleration", emergency),
        "power-0": ("DynamicDefaults.EmergencyDeceleration", emergency),
        "reaction-3": ("DynamicDefaults.EmergencyDeceleration", emergency),
    }
    path, value = paths.get(what, ("DynamicLimits.MaxDeceleration", limits.maximum_deceleration))
    axis.write("DynamicLimits.MaxJerk", 1e12)
    ended: Any = None
    if what == "halt":
        ended = axis.halt(**inputs.braking)
    elif what.startswith("stop"):
        mode = int(what[-1])
        ended = axis.stop(mode, **(inputs.braking if mode == 3 else {}))
    elif what.startswith("power"):
        axis.power(False, stop_mode=int(what[-1]))
    else:
        ctx.inject("axis.alarm", axis_name(ctx), number=307 if what == "reaction-2" else 321)
    ctx.run_for(cycles(ctx, 2))
    changed = 0.35 * value
    axis.write(path, changed)
    since = ctx.now_s
    ctx.run_for(cycles(ctx, 4))
    tail = 1 if what in ("halt", "stop-3", "stop-0", "power-0", "reaction-3") else 2
    slopes.constant(f"slope after {path} = {changed:.5g}", since, changed, "STP-107", "VAR-001", skip=tail)
    ctx.wait_until(lambda: slopes.velocity == 0.0, 6.0, "it stands")
    ctx.run_for(cycles(ctx, 2) + values.settling_s)
    if ended is not None:
        ctx.wait_until(ended.done, 3.0, "the stop is done")
    axis.write(path, value if path.startswith("DynamicDefaults") else limits.maximum_deceleration)
    axis.write("DynamicLimits.MaxJerk", limits.maximum_jerk)


@CAMPAIGN.product(
    "superimposed/{part}",
    parameters={"part": ("moving", "halting")},
    title="limits change while a superimposed motion is {part}",
    requirements=("VAR-001", "MC-352"),
)
def superimposed(ctx: CaseContext, part: str) -> None:
    """A superimposed motion takes over limits that change, as the basic one does, and covers its distance."""
    enable(ctx)
    slopes, axis = Slopes(ctx), ctx.axis
    values, limits = slopes.values, slopes.values.golden
    basic = axis.move_velocity(values.given(values.speed(0.2)))
    ctx.wait_until(basic.in_velocity, 3.0, "constant")
    inputs = values.dynamics("on top").without_jerk().inputs
    begun, at = float(axis.var("Position")), ctx.now_s
    distance = values.way(0.15)
    moving = axis.move_superimposed(distance, VelocityDiff=values.given(values.speed(0.5)), **inputs)
    ctx.run_for(cycles(ctx, 4))
    axis.write("DynamicLimits.MaxAcceleration", 0.5 * inputs["Acceleration"])
    since = ctx.now_s
    ctx.run_for(cycles(ctx, 5))
    slopes.constant("slope with a lower limit", since, 0.5 * inputs["Acceleration"], "VAR-001")
    if part == "halting":
        ended = axis.halt_superimposed(Deceleration=inputs["Deceleration"], Jerk=0.0)
        ctx.run_for(cycles(ctx, 3))
        axis.write("DynamicLimits.MaxDeceleration", 0.3 * inputs["Deceleration"])
        since = ctx.now_s
        ctx.run_for(cycles(ctx, 4))
        slopes.constant("slope while it halts", since, -0.3 * inputs["Deceleration"], "VAR-001")
        ctx.wait_until(ended.done, 4.0, "the superimposed motion has halted")
        equal(ctx, "the motion is aborted", moving.CommandAborted, 1.0)
    else:
        ctx.wait_until(moving.done, 6.0, "the superimposed motion is done")
        took = ctx.now_s - at
        way = float(axis.var("Position")) - begun - values.speed(0.2) * took
        equal(ctx, "way on top", way, distance, "MC-352", within=values.speed(0.2) * cycles(ctx, 2))
    ctx.run_for(cycles(ctx, 3))
    near = 1e-6 * limits.maximum_velocity
    equal(ctx, "velocity in the end", slopes.velocity, values.speed(0.2), within=near)
    axis.write("DynamicLimits.MaxAcceleration", limits.maximum_acceleration)
    axis.write("DynamicLimits.MaxDeceleration", limits.maximum_deceleration)


@CAMPAIGN.product(
    "zero/{limit}",
    parameters=[
        {"limit": limit, "number": number, "info": info}
        for limit, number, info in (
            ("MaxAcceleration", 305, 1),
            ("MaxDeceleration", 305, 2),
            ("MaxJerk", 306, 1),
        )
    ],
    title="{limit} becomes 0",
    requirements=("STP-607",),
)
def zero(ctx: CaseContext, limit: str, number: int, info: int) -> None:
    """A limit of zero, from which no motion can be planned, is an alarm at the next job, and in a motion that
    runs at once; with the limit back it is acknowledged, and the axis moves.
    """
    enable(ctx)
    axis, values = ctx.axis, own(ctx)
    path = f"DynamicLimits.{limit}"
    before = float(axis.var(path))
    for runs in (False, True):
        if runs:
            job = axis.move_velocity(values.given(values.speed(0.3)))
            ctx.wait_until(job.in_velocity, 3.0, "constant")
        axis.write(path, 0.0)
        ctx.run_for(cycles(ctx, 3))
        if not runs:
            job = axis.move_velocity(values.given(values.speed(0.3)))
            ctx.run_for(cycles(ctx, 3))
        axis.write(path, before)
        shown = {alarm.number: alarm.info for alarm in axis.object.engine.pending}
        equal(ctx, f"alarm, running {runs}: {shown}", shown.get(number) == info, 1.0, "STP-607")
        ctx.wait_until(lambda: axis.var("Velocity") == 0.0, 4.0, "it stands")
        ctx.run_for(values.settling_s)
        equal(ctx, "ErrorID of the job", job.ErrorID, 0x8001, "STP-607")
        ctx.wait_until(axis.reset().done, 3.0, "acknowledged")
        ctx.wait_until(axis.power_instance.status, 3.0, "enabled")
        ctx.wait_until(axis.move_relative(values.way(0.01)).done, 3.0, "it moves")
