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
        technology: A technology processor (S7-1500T): cams, actual values that lead, leading-axis proxies.
        gear_profiles: `SyncProfileReference` of `MC_GearInPos`.
        cam_profiles: `SyncProfileReference` of `MC_CamIn`.
        leading_interfaces: Outputs for leading values of an object (SYN-071, SYN-473).

    """

    name: str
    version: str
    encoders: int
    without: frozenset[str] = frozenset()
    without_inputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    without_outputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    without_parameters: frozenset[int] = frozenset()
    technology: bool = False
    gear_profiles: tuple[int, ...] = (0, 1, 3)
    cam_profiles: tuple[int, ...] = (0, 1, 2, 3, 4, 5, 6)
    leading_interfaces: int = 8

    @property
    def before_v9(self) -> bool:
        """Whether the overriding tables and the configuration before V9.0 hold: no hold tolerance
        (SYN-257, SYN-476).
        """
        return self.version < "V9.0"

    @property
    def simulates_virtual_axes(self) -> bool:
        """Whether a virtual axis is delayed as a simulated one (MC-018, SYN-077)."""
        return self.version < "V8.0"

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
_NO_ACTIVE: Final = {"MC_MoveAbsolute": ("Active",), "MC_MoveRelative": ("Active",)}
_NO_1020: Final = frozenset({1020})
_SHIFTED: Final = ("MasterOffset", "SlaveOffset", "MasterScaling", "SlaveScaling")
_BEFORE_V8: Final = _BEFORE_V9 | {
    "MC_GetCamLeadingValue": ("ApproachDirection", *_SHIFTED), "MC_GetCamFollowingValue": _SHIFTED,
}  # fmt: skip
"""The same, and those of V8.0 (SYN-012, CAM-248)."""


def _earlier(name: str, version: str) -> CompatibilityLevel:
    """Return an S7-1500 or S7-1500T with an earlier technology version: `S7-1500T V8`."""
    technology = name == "S7-1500T"
    without = frozenset() if technology else TECHNOLOGY_ONLY
    before_v8 = version == "V7.0"
    return CompatibilityLevel(
        f"{name} {version[:2]}",
        version,
        encoders=4 if technology else 1,
        without=without | {"MC_GetCamFollowingValueCyclic"} if before_v8 else without,
        without_inputs=_BEFORE_V8 if before_v8 else _BEFORE_V9,
        without_outputs=_NO_ACTIVE,
        without_parameters=_NO_1020,
        technology=technology,
    )


LEVELS: Final = {
    one.name: one
    for one in (
        CompatibilityLevel(
            "S7-1500T",
            "V9.0",
            encoders=4,
            technology=True,
            gear_profiles=(0, 1, 3, 4),
            cam_profiles=(0, 1, 2, 3, 4, 5, 6, 7),
            leading_interfaces=32,
        ),
        CompatibilityLevel("S7-1500", "V9.0", encoders=1, without=TECHNOLOGY_ONLY, leading_interfaces=32),
        CompatibilityLevel(
            "S7-1200 G2",
            "V8.0",
            encoders=1,
            without=TECHNOLOGY_ONLY | {"MC_GearIn"},
            without_inputs=_BEFORE_V9,
            without_outputs=_NO_ACTIVE,
            without_parameters=_NO_1020,
        ),
        _earlier("S7-1500T", "V8.0"),
        _earlier("S7-1500T", "V7.0"),
        _earlier("S7-1500", "V8.0"),
        _earlier("S7-1500", "V7.0"),
    )
}
"""All controllers; 1020 is the number that V9.0 made writable (MC-016)."""

DEFAULT: Final = "S7-1500T"
"""Of an object that says nothing of its controller."""


def level_of(cpu: str) -> CompatibilityLevel:
    """Return the controller of this name, one of `LEVELS`.

    Raises:
        ConfigurationError: There is none.

    """
    if cpu not in LEVELS:
        raise ConfigurationError("cpu", cpu, ", ".join(LEVELS))
    return LEVELS[cpu]


def check_instruction(level: CompatibilityLevel, instruction: str) -> None:
    """Check that a controller has an instruction.

    Raises:
        ConfigurationError: It does not.

    """
    if instruction in level.without:
        having = [one.name for one in LEVELS.values() if instruction not in one.without]
        raise ConfigurationError(instruction, level.name, f"cpu {', '.join(having)} (CFG-062)")
