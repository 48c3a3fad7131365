"""What a controller offers its program: instructions, their parameters, encoders of an axis (sections 0.3 and
6 of the specification).

A controller is a family of processors with the technology version of its objects. `LEVELS` is the data;
instructions and configuration ask it when they are made, never in a cycle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from fieldbus.errors import ConfigurationError

TECHNOLOGY_ONLY: Final = frozenset({
    "MC_SetSensor", "MC_MotionInVelocity", "MC_MotionInPosition", "MC_MotionInSuperimposed",
    "MC_InterpolateCam", "MC_GetCamLeadingValue", "MC_GetCamFollowingValue", "MC_GetCamFollowingValueCyclic",
    "MC_CopyCamData", "MC_GearInVelocity", "MC_GearInPos", "MC_GearOut", "MC_CamIn", "MC_CamOut",
    "MC_PhasingAbsolute", "MC_PhasingRelative", "MC_OffsetAbsolute", "MC_OffsetRelative",
    "MC_LeadingValueAdditive", "MC_SynchronizedMotionSimulation",
})  # fmt: skip
"""Instructions of the technology processors alone (CFG-062)."""


@dataclass(frozen=True)
class CompatibilityLevel:
    """One kind of controller.

    Args:
        name: As at `[bench] cpu`.
        version: Technology version of its objects.
        encoders: Most encoders of an axis (CFG-177).
        without: Instructions that it does not have.
        without_inputs: Inputs that it does not have, by instruction.
        without_outputs: Outputs that it does not have, by instruction.
        without_parameters: Numbers that `MC_WriteParameter` does not know.

    """

    name: str
    version: str
    encoders: int
    without: frozenset[str] = frozenset()
    without_inputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    without_outputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    without_parameters: frozenset[int] = frozenset()

    def absent_inputs(self, instruction: str) -> tuple[str, ...]:
        """Return the inputs that an instruction does not have here."""
        return self.without_inputs.get(instruction, ())

    def has_output(self, instruction: str, output: str) -> bool:
        """Return whether an instruction has an output here."""
        return output not in self.without_outputs.get(instruction, ())


_BEFORE_V9: Final = {
    "MC_Halt": ("Mode",), "MC_MoveAbsolute": ("BufferMode",), "MC_MoveRelative": ("BufferMode",),
}  # fmt: skip
"""Inputs that came with technology version V9.0 (MC-015, MC-017)."""

LEVELS: Final = {
    one.name: one
    for one in (
        CompatibilityLevel("S7-1500T", "V9.0", encoders=4),
        CompatibilityLevel("S7-1500", "V9.0", encoders=1, without=TECHNOLOGY_ONLY),
        CompatibilityLevel(
            "S7-1200 G2",
            "V8.0",
            encoders=1,
            without=TECHNOLOGY_ONLY | {"MC_GearIn"},
            without_inputs=_BEFORE_V9,
            without_outputs={"MC_MoveAbsolute": ("Active",), "MC_MoveRelative": ("Active",)},
            without_parameters=frozenset({1020}),
        ),
    )
}
"""All controllers; 1020 is the number that V9.0 made writable (MC-016)."""

DEFAULT: Final = "S7-1500T"
"""Of an object that says nothing of its controller."""


def level_of(cpu: str) -> CompatibilityLevel:
    """Return the controller of this name, one of `LEVELS`."""
    return LEVELS[cpu]


def check_instruction(level: CompatibilityLevel, instruction: str) -> None:
    """Check that a controller has an instruction.

    Raises:
        ConfigurationError: It does not.

    """
    if instruction in level.without:
        having = [one.name for one in LEVELS.values() if instruction not in one.without]
        raise ConfigurationError(instruction, level.name, f"cpu {', '.join(having)} (CFG-062)")
