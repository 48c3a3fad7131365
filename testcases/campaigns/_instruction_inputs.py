"""Cases of `instructions`: inputs at and beyond what is allowed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from testcases.campaigns._instruction_jobs import Stage, stage

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
