"""A session saved as a matrix file, where it is one job and one way to stop it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Final

from fieldbus.clock import S
from hil.cockpit.steps import Command, Step
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from hil.cockpit.written_test import Recorded
    from hil.record import Trace

_JOBS: Final = {
    "move_velocity": "velocity",
    "move_absolute": "absolute",
    "move_relative": "relative",
    "jog": "jog",
}
_WAYS: Final = {"move_velocity": "velocity", "move_relative": "distance"}
"""Input whose sign says in which direction a job travels."""
_READY: Final = {"power", "power_when_ready", "home", "reset"}
_CRAWL: Final = 0.02
"""Share of the velocity limit below which a job starts or arrives."""
_STEADY: Final = 1e-3
"""Share of the acceleration limit below which the velocity is constant."""


def write_matrix(session: Recorded, *, bench: str, title: str = "session") -> str:
    """Return the text of a matrix file with the one case of a session.

    The case is of the vocabulary of the product: job, moment, stop. What is expected follows from its words.

    Args:
        session: What was done.
        bench: Bench file or embedded name.
        title: Of the matrix.

    Raises:
        CannotRunError: The session is something else; the message says what a matrix is made of.

    """
    commands = [(one.time_ns, one.step) for one in session.steps if not _prepares(one.step)]
    if len(commands) != 2:
        raise _other(f"it has {len(commands)} steps besides enabling, homing and acknowledging")
    (_, job), (stop_ns, stop) = commands
    if not isinstance(job, Command) or job.name not in _JOBS:
        raise _other(f"its first step is {job}")
    if not isinstance(stop, Command) or not (word := _stop_word(stop)):
        raise _other(f"its second step is {stop}")
    if job.axis != stop.axis:
        raise _other(f"it moves {job.axis} and stops {stop.axis}")
    factors = {
        "bench": bench,
        "job": _job_word(job),
        "moment": _moment(session.trace, job.axis, stop_ns / S),
        "stop": word,
    }
    rows = [f"{name} = [{json.dumps(value)}]" for name, value in factors.items()]
    return "\n".join([f"title = {json.dumps(title)}", "", "[factors]", *rows, ""])


def _other(what: str) -> CannotRunError:
    return CannotRunError(
        f"this session is no case of a matrix: {what}; allowed: one job (move, jog) and one stop "
        "(halt, stop, power off) of an axis"
    )


def _prepares(step: Step) -> bool:
    return isinstance(step, Command) and step.name in _READY and step.inputs.get("enable") is not False


def _stop_word(step: Command) -> str:
    if step.name == "power":
        return f"power-{step.inputs.get('stop_mode', 0)}"
    if step.name == "stop":
        return f"stop-{step.inputs.get('mode', 0)}"
    return "halt" if step.name == "halt" else ""


def _job_word(step: Command) -> str:
    sign = step.inputs.get(_WAYS.get(step.name, ""), 1.0)
    back = step.inputs.get("backward") is True or (isinstance(sign, int | float) and sign < 0)
    return f"{_JOBS[step.name]}{'-backward' if back else ''}"


def _moment(trace: Trace, axis: str, at_s: float) -> str:
    """Return the phase of the motion at an instant, in the words of a matrix."""
    velocity = trace[f"{axis}.velocity_setpoint"].at(at_s)
    acceleration = trace[f"{axis}.acceleration_setpoint"].at(at_s)
    limits = trace.constants
    crawls = abs(velocity) < _CRAWL * limits[f"{axis}.max_velocity"]
    if abs(acceleration) < _STEADY * limits[f"{axis}.max_acceleration"]:
        return "standstill" if crawls else "constant"
    if velocity * acceleration > 0.0:
        return "starting" if crawls else "accelerating"
    return "arriving" if crawls else "decelerating"
