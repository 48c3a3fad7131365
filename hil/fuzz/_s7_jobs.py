"""Instructions for technology objects as steps of fuzz programs: their inputs are the parameters, by their
own names.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil.faults import Parameter
from hil.fuzz._nc_jobs import UNITS
from motion.s7 import instructions
from motion.s7.compatibility import check_instruction, level_of
from motion.s7.instructions import Instruction

if TYPE_CHECKING:
    from collections.abc import Mapping

STARTERS: Final = ("Execute", "Enable", "JogForward", "JogBackward")
"""Inputs that start something."""
_BORDER: Final = 1e12
_FLOATS: Final = ("Value",)
"""Inputs whose default is a whole number, and that take others as well."""


def job_of(instruction: str) -> str:
    """Return the name of the step for an instruction: `move_absolute` for `MC_MoveAbsolute`."""
    if instruction == "MC_WriteParameter":
        return "set_parameter"  # a step of an NC axis has the other name
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", instruction.removeprefix("MC_")).lower()


INSTRUCTIONS: Final[Mapping[str, type[Instruction]]] = {
    job_of(one.instruction): one
    for one in (getattr(instructions, name) for name in instructions.__all__)
    if isinstance(one, type) and issubclass(one, Instruction) and one.instruction
}
"""Every instruction by the name of its step."""


def _parameter(name: str, default: float) -> Parameter:
    summary, unit = f"Input {name}", UNITS.get(name, "")
    if isinstance(default, bool):
        return Parameter(name, "bool", summary, default=default)
    if isinstance(default, int) and name not in _FLOATS:
        return Parameter(name, "int", summary, unit, -_BORDER, _BORDER, default=default)
    return Parameter(name, "float", summary, unit, -_BORDER, _BORDER, default=float(default))


def inputs_of(job: str) -> tuple[Parameter, ...]:
    """Return the inputs of an instruction that are numbers or flags and start nothing, as parameters."""
    return tuple(
        _parameter(name, value)
        for name, value in INSTRUCTIONS[job].inputs.items()
        if name not in STARTERS and isinstance(value, bool | int | float)
    )


def is_complete(job: str) -> bool:
    """Return whether an instruction needs no other object but its own."""
    return all(value is not None for value in INSTRUCTIONS[job].inputs.values())


def jobs_of(technology_object: Any) -> tuple[str, ...]:
    """Return the instructions that a technology object knows on its controller."""
    kinds = getattr(technology_object, "kinds", None) or (technology_object.object_type,)
    level = level_of(technology_object.cpu)

    def known(instruction: type[Instruction]) -> bool:
        try:
            check_instruction(level, instruction.instruction)
        except ConfigurationError:
            return False
        return any(kind in instruction.object_types for kind in kinds)

    return tuple(job for job, one in INSTRUCTIONS.items() if is_complete(job) and known(one))


def values_of(job: str, given: Mapping[str, Any], scale: Any) -> dict[str, Any]:
    """Return the inputs that a step gives by their own names, in the units of the object.

    Args:
        job: Name of the step.
        given: Parameters of the step.
        scale: Units of the object, `UnitScale`.

    """
    found = {}
    for parameter in inputs_of(job):
        value = given.get(parameter.name)
        if value is None:
            continue
        factor = scale.of(parameter.unit) if parameter.type == "float" else 1.0
        found[parameter.name] = value if factor == 1.0 else value * factor
    return found
