"""Cases of `instructions`: inputs at and beyond what is allowed, and what dynamic ones make of the motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from testcases.campaigns._instruction_jobs import Stage, stage
from testcases.campaigns._reactions import calls
from testcases.campaigns.support import axis_name, travel_time

CASES: Final = Campaign("instructions", tags=("axis", "inputs"), bench="reference")

VELOCITY, ACCELERATION, DECELERATION, JERK, DIRECTION = 0x8003, 0x8004, 0x8005, 0x8006, 0x8007
DISTANCE, POSITION, MODE, STOP_MODE, NUMBER, TYPE = 0x8008, 0x8009, 0x800A, 0x800B, 0x805A, 0x805C
SENSOR, REFERENCE = 0x8050, 0x8051
ANY: Final = -1
"""Some ErrorID: the source names none (MC-014)."""
_NAN: Final = math.nan

_DYNAMICS: Final = (
    ("Acceleration", (0.0, _NAN), ACCELERATION, "MC-087"),
    ("Deceleration", (0.0, _NAN), DECELERATION, "MC-088"),
    ("Jerk", (_NAN,), JERK, "MC-089"),
)
_BRAKING: Final = _DYNAMICS[1:]
_SPEED: Final = ("Velocity", (0.0, _NAN), VELOCITY, "MC-086")

Row = tuple[str, tuple[Any, ...], int, str]


@dataclass(frozen=True)
class Instruction:
    """An instruction, how it is called, and its inputs with what they do not take."""

    call: Callable[[Stage, dict[str, Any]], Any]
    rows: tuple[Row, ...]
    """Input, values, ErrorID, requirement."""
    allowed: tuple[tuple[str, float], ...] = ()
    """Inputs at the border of what they take."""


def _way(on: Stage) -> float:
    return on.values.way(0.2)


def _jog(on: Stage, given: dict[str, Any]) -> Any:
    backward = given.pop("JogBackward", False)
    job = on.axis.jog(**{"velocity": on.given(0.1)} | given)
    job.set(JogBackward=backward)
    return job


TINY: Final = 1e-3
_LEAST: Final = (("Acceleration", TINY), ("Deceleration", TINY), ("Jerk", 0.0))
INSTRUCTIONS: Final[dict[str, Instruction]] = {
    "MC_MoveAbsolute": Instruction(
        lambda on, given: on.axis.move_absolute(**{"position": _way(on)} | given),
        (
            _SPEED,
            *_DYNAMICS,
            ("position", (_NAN, math.inf), POSITION, "MC-007"),
            ("BufferMode", (2, -1), ANY, "MC-254"),
        ),
        (("Velocity", TINY), *_LEAST, ("BufferMode", 1), ("Direction", 3)),
    ),
    "MC_MoveRelative": Instruction(
        lambda on, given: on.axis.move_relative(**{"distance": _way(on)} | given),
        (
            _SPEED,
            *_DYNAMICS,
            ("distance", (_NAN, -math.inf), DISTANCE, "MC-007"),
            ("BufferMode", (2, -1), ANY, "MC-282"),
        ),
        (("Velocity", TINY), *_LEAST, ("BufferMode", 1), ("distance", 0.0)),
    ),
    "MC_MoveVelocity": Instruction(
        lambda on, given: on.axis.move_velocity(**{"velocity": on.given(0.1)} | given),
        (
            *_DYNAMICS,
            ("velocity", (_NAN, math.inf), VELOCITY, "MC-007"),
            ("Direction", (3, -1), DIRECTION, "MC-298"),
        ),
        (("velocity", 0.0), ("velocity", -TINY), *_LEAST, ("Direction", 2)),
    ),
    "MC_MoveJog": Instruction(
        _jog,
        (
            *_DYNAMICS,
            ("velocity", (_NAN, math.inf), VELOCITY, "MC-007"),
            ("JogBackward", (True,), DIRECTION, "MC-329"),
        ),
        (("velocity", 0.0), ("velocity", -TINY), *_LEAST),
    ),
    "MC_MoveSuperimposed": Instruction(
        lambda on, given: on.axis.move_superimposed(**{"distance": _way(on)} | given),
        (
            ("VelocityDiff", (0.0, _NAN), VELOCITY, "MC-086"),
            *_DYNAMICS,
            ("distance", (_NAN,), DISTANCE, "MC-007"),
        ),
        (("VelocityDiff", TINY), *_LEAST),
    ),
    "MC_HaltSuperimposed": Instruction(
        lambda on, given: on.axis.halt_superimposed(**given),
        _BRAKING,
        (("Deceleration", TINY), ("Jerk", 0.0)),
    ),
    "MC_Halt": Instruction(
        lambda on, given: on.axis.halt(**given), _BRAKING, (("Deceleration", TINY), ("Mode", 1))
    ),
    "MC_Stop": Instruction(
        lambda on, given: on.axis.stop(**{"mode": 3} | given),
        (*_BRAKING, ("mode", (1, 4, -1), MODE, "MC-396")),
        (("Deceleration", TINY), ("mode", 2), ("mode", 0)),
    ),
    "MC_Home": Instruction(
        lambda on, given: on.axis.home(**{"position": on.setpoint} | given),
        (
            ("position", (_NAN,), POSITION, "MC-007"),
            ("mode", (4, 14, -1), MODE, "MC-194"),
            ("mode", (6, 7), 0x8010, "MC-011"),
        ),
        (("mode", 0), ("mode", 11), ("mode", 9)),
    ),
    "MC_WriteParameter": Instruction(
        lambda on, given: on.axis.write_parameter(**{"number": 1000, "value": False} | given),
        (("number", (0, 999, 1001, 1013), NUMBER, "MC-450"), ("value", (1.5,), TYPE, "MC-451")),
        (("number", 1000),),
    ),
    "MC_SetSensor": Instruction(
        lambda on, given: on.axis.set_sensor(**{"sensor": 1} | given),
        (("sensor", (0, 5), SENSOR, "MC-618"),),
        (("sensor", 1),),
    ),
}


@CASES.product(
    "range/{instruction}",
    parameters={"instruction": tuple(INSTRUCTIONS)},
    title="{instruction}: inputs that it takes and does not take",
    tags=("ranges",),
    requirements=lambda instruction: (
        "MC-059",
        "MC-080",
        *dict.fromkeys(row[3] for row in INSTRUCTIONS[instruction].rows),
    ),
)
def ranges(ctx: CaseContext, instruction: str) -> None:
    """A value outside is refused at once, with its ErrorID, and disturbs nothing; one at the border is
    taken.
    """
    on = stage(ctx)
    about = INSTRUCTIONS[instruction]
    running = on.travel(0.15)
    ctx.run_for(0.05)
    velocity = on.velocity
    for name, values, error_id, requirement in about.rows:
        for value in values:
            one = on.outputs.watch(about.call(on, {name: value}))
            on.outputs.calls(3)
            shown = one.calls[0]
            good = shown.error and not any(call.busy for call in one.calls)
            good = good and (error_id == ANY or shown.error_id == error_id)
            ctx.measure(
                f"{instruction} with {name} {value:g} shows {shown.text}",
                float(good),
                low=1.0,
                requirements=(requirement, "MC-059"),
            )
    ctx.measure(
        "the running job goes on",
        float(running.last.success and abs(on.velocity - velocity) < 1e-9 * abs(velocity)),
        low=1.0,
        requirements=("MC-059", "MC-642"),
    )
    on.back()
    for name, value in about.allowed:
        one = on.outputs.watch(about.call(on, {name: value}))
        on.outputs.calls(3)
        ctx.measure(
            f"{instruction} with {name} {value:g} shows {one.last.text}",
            float(not any(call.error for call in one.calls)),
            low=1.0,
            requirements=("MC-014",),
        )
        on.back()


# -- dynamic inputs ----------------------------------------------------------------------------------------


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
    unit = limits.velocity_unit
    read = on.axis.variables.read
    if source == "default":
        names = ("Velocity", "Acceleration", "Deceleration", "Jerk")
        default = [float(read(f"DynamicDefaults.{name}")) for name in names]
        return dict.fromkeys(names, -1.0), _limited(
            on, default[0] * unit, *(one * unit for one in default[1:])
        )
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


@CASES.product(
    "dynamics/{job}/{source}/{percent}",
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
    tags=("dynamics",),
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


@CASES.product(
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
