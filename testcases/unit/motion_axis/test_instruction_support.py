"""Which instruction takes which technology object (CFG section 3)."""

from __future__ import annotations

import pytest

import motion.instructions as instructions
from fieldbus.errors import ConfigurationError
from motion.axis import ExternalEncoder, PositioningAxis, SpeedAxis
from motion.drives.simulated import SimulatedDrivePort

KINDS = {"S": SpeedAxis, "P": PositioningAxis, "E": ExternalEncoder}
SUPPORT = {
    "CFG-040": ("MC_Power", "SP"), "CFG-041": ("MC_Reset", "SPE"), "CFG-042": ("MC_Home", "PE"), "CFG-043": ("MC_Halt", "SP"),
    "CFG-044": ("MC_MoveAbsolute", "P"), "CFG-045": ("MC_MoveRelative", "P"), "CFG-046": ("MC_MoveVelocity", "SP"),
    "CFG-047": ("MC_MoveJog", "SP"), "CFG-048": ("MC_MoveSuperimposed", "P"), "CFG-049": ("MC_HaltSuperimposed", "P"),
    "CFG-050": ("MC_SetSensor", "P"), "CFG-051": ("MC_Stop", "SP"), "CFG-052": ("MC_SetAxisSTW", "SP"),
    "CFG-053": ("MC_WriteParameter", "SPE"), "CFG-058": ("MC_TorqueAdditive", "SP"), "CFG-059": ("MC_TorqueRange", "SP"),
    "CFG-060": ("MC_TorqueLimiting", "SP"),
}  # fmt: skip
START = {"MC_Power": "Enable", "MC_MoveJog": "JogForward", "MC_TorqueAdditive": "Enable", "MC_TorqueRange": "Enable",
         "MC_TorqueLimiting": "Enable"}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "objects"),
    [pytest.param(*cells, marks=pytest.mark.requirement(identifier), id=cells[0]) for identifier, cells in SUPPORT.items()],
)  # fmt: skip
def test_objects(name, objects):
    """An external encoder is refused when the instance is made; an axis of another type with 16#8002 at the call."""
    kind = getattr(instructions, name)
    for letter, type_of_object in KINDS.items():
        axis = type_of_object("axis1", SimulatedDrivePort(cycle_s=0.001), cycle_ns=1_000_000)
        if letter == "E" and letter not in objects:
            with pytest.raises(ConfigurationError, match=f"{name}.Axis: 'axis1' is not allowed"):
                kind(axis)
            continue
        instance = kind(axis)
        instance(**{START.get(name, "Execute"): True})
        assert (instance.ErrorID == 0x8002) is (letter not in objects), (name, letter, hex(instance.ErrorID))
