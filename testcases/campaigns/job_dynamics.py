"""What dynamic inputs make of a motion: given, from the defaults, beyond the limits, under an override."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect.golden import travel_time
from testcases.campaigns._instruction_jobs import Stage, stage
from testcases.campaigns._reactions import calls
from testcases.campaigns.support import axis_name

CAMPAIGN: Final = Campaign(
    "job dynamics",
    tags=("axis", "dynamics"),
    bench="reference",
    needs={
        "cpu": "S7-1500T",
        "encoder": "incremental",
        "software-limits": "off",
        "motion": ("linear", "rotary"),
        "neighbours": "none",
        "load": "not heavy",
    },
)


@dataclass(frozen=True)
class Wanted:
    """Dynamic values that a motion has to have, position units and s."""

    velocity: float
    acceleration: float
    deceleration: float
    jerk: float


def _given(on: Stage, source: str) -> tuple[dict[str, Any], Wanted]:
    """Return the inputs of a job, and what they have to amount to (MC-086 to MC-093)."""
    limits, values = on.values.golden, on.values
    if source == "default":
        names, own = ("Velocity", "Acceleration", "Deceleration", "Jerk"), values.defaults()
        default = (limits.default_velocity, own.acceleration, own.deceleration, own.jerk)
        return dict.fromkeys(names, -1.0), _limited(on, *default)
    share = {"given": 1.0, "above": 4.0}[source]
    velocity = share * values.speed(values.draw("velocity", 0.41, 0.47))
    own = values.dynamics("inputs").with_jerk(limits)
    inputs = {
        "Velocity": values.given(velocity),
        "Acceleration": share * own.acceleration,
        "Deceleration": share * own.deceleration,
        "Jerk": share * own.jerk,
    }
    return inputs, _limited(
        on, velocity, share * own.acceleration, share * own.deceleration, share * own.jerk
    )


def _limited(on: Stage, velocity: float, acceleration: float, deceleration: float, jerk: float) -> Wanted:
    limits = on.values.golden
    return Wanted(
        min(velocity, limits.maximum_velocity),
        min(acceleration, limits.maximum_acceleration),
        min(deceleration, limits.maximum_deceleration),
        min(jerk, limits.maximum_jerk),
    )


@CAMPAIGN.product(
    "{job}/{source}/{percent}",
    parameters=[
        {"job": job, "source": source, "percent": percent}
        for job in ("absolute", "relative", "velocity", "jog")
        for source, percent in (
            ("given", 100),
            ("default", 100),
            ("above", 100),
            ("given", 50),
            ("default", 170),
        )
    ],
    title="{job}: dynamic inputs {source}, override {percent} %",
    requirements=("MC-086", "MC-087", "MC-088", "MC-089", "MC-093", "MC-094"),
)
def dynamics(ctx: CaseContext, job: str, source: str, percent: int) -> None:
    """Velocity, acceleration, deceleration and jerk of the setpoint are those of the inputs, of the defaults
    where they are negative, and of the limits where they are beyond.
    """
    on = stage(ctx)
    on.back()
    name = axis_name(ctx)
    ctx.axis.write("Override.Velocity", float(percent))
    inputs, wanted = _given(on, source)
    top = min(wanted.velocity * percent / 100.0, on.values.golden.maximum_velocity)
    begun, since = on.setpoint, ctx.now_s
    way = on.values.way(0.9)
    velocity = inputs.pop("Velocity")
    if job in {"absolute", "relative"}:
        move = ctx.axis.move_absolute if job == "absolute" else ctx.axis.move_relative
        one = on.outputs.watch(move(way, Velocity=velocity, **inputs))
        on.outputs.until(one, "done", 20.0, "the axis is there")
        ctx.measure("target", on.setpoint - begun, on.values.unit, low=way - 1e-6, high=way + 1e-6)
    else:
        given = on.given(0.2) if velocity < 0.0 else velocity
        if velocity < 0.0:
            wanted = _limited(on, on.values.speed(0.2), wanted.acceleration, wanted.deceleration, wanted.jerk)
            top = min(on.values.speed(0.2) * percent / 100.0, on.values.golden.maximum_velocity)
        if job == "velocity":
            one = on.outputs.watch(ctx.axis.move_velocity(given, **inputs))
        else:
            one = on.outputs.watch(ctx.axis.jog(given, **inputs))
        on.outputs.until(one, "success", 5.0, "the velocity is reached")
        ctx.run_for(0.1)
        if job == "velocity":
            ctx.axis.halt(Deceleration=inputs["Deceleration"], Jerk=inputs["Jerk"])
        one.lower()
        ctx.wait_until(lambda: on.velocity == 0.0, 10.0, "the axis stands")
    _profile(on, name, since, top, wanted)
    limited = source == "above" or top < wanted.velocity * percent / 100.0
    warned = float(any(event.data.get("number") == 501 for event in ctx.trace().select(kind="alarm.raised")))
    ctx.measure("warning 501", warned, low=limited, high=limited, requirements=("MC-093",))
    ctx.axis.write("Override.Velocity", 100.0)


def _profile(on: Stage, name: str, since: float, top: float, wanted: Wanted) -> None:
    """Measure the setpoint since a time against what was wanted."""
    ctx, trace = on.ctx, on.ctx.trace()
    speed, slope = trace[f"{name}.velocity_setpoint"], trace[f"{name}.acceleration_setpoint"]
    during = slope.time_s > since
    velocity, acceleration = speed.values[during], slope.values[during]
    cycle = ctx.bench.interpolator_ns * 1e-9
    fastest = float(np.abs(velocity).max())

    def near(what: str, value: float, goal: float, *requirements: str, slack: float = 2e-3) -> None:
        ctx.measure(
            what, value, low=(1.0 - slack) * goal, high=(1.0 + 1e-6) * goal, requirements=requirements
        )

    near("velocity", fastest, top, "MC-086", "MC-094", slack=1e-6)
    # With a ramp that ends before it is steepest, the greatest slope is that of the jerk.
    for what, value, goal, requirement in (
        ("acceleration", float(acceleration.max()), wanted.acceleration, "MC-087"),
        ("deceleration", float(-acceleration.min()), wanted.deceleration, "MC-088"),
    ):
        reached = not wanted.jerk or top * wanted.jerk > 1.1 * goal * goal
        if reached:
            slack = 2e-3 + (wanted.jerk * cycle / goal if wanted.jerk else 0.0)
            near(what, value, goal, requirement, slack=slack)
        else:
            ctx.measure(what, value, high=(1.0 + 1e-6) * goal, requirements=(requirement,))
    steepest = float(np.abs(np.diff(acceleration)).max()) / cycle
    if wanted.jerk:
        near("jerk", steepest, wanted.jerk, "MC-089")


@CAMPAIGN.product(
    "duration/{share}",
    parameters={"share": (0.02, 0.3)},
    title="MC_MoveRelative over {share} of a second's way takes the time of its dynamic values",
    requirements=("MC-278", "MC-279", "MC-280", "MC-281"),
)
def duration(ctx: CaseContext, share: float) -> None:
    """The time of a motion is that of its ramps, also where the way is too short for its velocity."""
    on = stage(ctx)
    inputs, wanted = _given(on, "given")
    way = on.values.way(share)
    since = ctx.now_s
    one = on.outputs.watch(ctx.axis.move_relative(-way, **inputs))
    on.outputs.until(one, "done", 10.0, "the axis is there")
    speed = ctx.trace()[f"{axis_name(ctx)}.velocity_setpoint"]
    moving = speed.time_s[(speed.time_s > since) & (speed.values != 0.0)]
    took = float(moving[-1] - moving[0])
    needed = travel_time(way, wanted.velocity, wanted.acceleration, wanted.deceleration, wanted.jerk)
    ctx.measure(
        "time of the motion", took, "s", low=needed - calls(ctx, 2), high=needed + calls(ctx, 2),
        requirements=("MC-279", "MC-280", "MC-281"),
    )  # fmt: skip
