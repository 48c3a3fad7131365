"""Which instruction takes which technology object (CFG section 3, section 1.2 of the instruction
specification).
"""

from __future__ import annotations

import pytest

import motion.s7.instructions as instructions
from fieldbus.errors import ConfigurationError
from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import ExternalEncoder, PositioningAxis, SpeedAxis, SynchronousAxis
from motion.s7.cams import Cam
from testcases.unit.motion_axis.conftest import Rig, TorquePort

KINDS = {"S": SpeedAxis, "P": PositioningAxis, "Y": SynchronousAxis, "E": ExternalEncoder}
# identifiers of the cell and of the input `Axis`, instruction, objects
SUPPORT = [
    (("MC-037", "MC-134"), "MC_Power", "SPE"),
    (("CFG-041", "MC-038"), "MC_Reset", "SPE"),
    (("CFG-042", "MC-039", "MC-191"), "MC_Home", "PE"),
    (("CFG-043", "MC-040", "MC-223"), "MC_Halt", "SP"),
    (("CFG-044", "MC-041", "MC-247"), "MC_MoveAbsolute", "P"),
    (("CFG-045", "MC-041", "MC-275"), "MC_MoveRelative", "P"),
    (("CFG-046", "MC-042", "MC-292"), "MC_MoveVelocity", "SP"),
    (("CFG-047", "MC-042", "MC-316"), "MC_MoveJog", "SP"),
    (("CFG-048", "MC-043", "MC-342"), "MC_MoveSuperimposed", "P"),
    (("CFG-049", "MC-043", "MC-362"), "MC_HaltSuperimposed", "P"),
    (("CFG-050", "MC-044", "MC-378"), "MC_SetSensor", "P"),
    (("CFG-051", "MC-040", "MC-394"), "MC_Stop", "SP"),
    (("CFG-052", "MC-045", "MC-434"), "MC_SetAxisSTW", "SP"),
    (("CFG-053", "MC-046", "MC-448"), "MC_WriteParameter", "SPE"),
    (("CFG-058", "MC-050", "MC-513"), "MC_TorqueAdditive", "SP"),
    (("CFG-059", "MC-050", "MC-523"), "MC_TorqueRange", "SP"),
    (("CFG-060", "MC-050", "MC-542"), "MC_TorqueLimiting", "SP"),
    (("CFG-055", "MC-048", "MC-482"), "MC_MotionInVelocity", "SP"),
    (("CFG-056", "MC-049", "MC-492"), "MC_MotionInPosition", "P"),
    (("CFG-057", "MC-049", "MC-502"), "MC_MotionInSuperimposed", "P"),
    ((), "MC_GearIn", "Y"),
    ((), "MC_CamIn", "Y"),
    ((), "MC_CamOut", "Y"),
    ((), "MC_GearInPos", "Y"),
    ((), "MC_GearOut", "Y"),
    ((), "MC_GearInVelocity", "Y"),
    ((), "MC_PhasingAbsolute", "Y"),
    ((), "MC_PhasingRelative", "Y"),
    ((), "MC_OffsetAbsolute", "Y"),
    ((), "MC_OffsetRelative", "Y"),
    (("SYN-214",), "MC_LeadingValueAdditive", "Y"),
    ((), "MC_SynchronizedMotionSimulation", "Y"),
]
START = {
    "MC_Power": "Enable",
    "MC_MoveJog": "JogForward",
    "MC_TorqueAdditive": "Enable",
    "MC_LeadingValueAdditive": "Enable",
    "MC_SynchronizedMotionSimulation": "Enable",
    "MC_TorqueRange": "Enable",
    "MC_TorqueLimiting": "Enable",
    "MC_MotionInVelocity": "Enable",
    "MC_MotionInPosition": "Enable",
    "MC_MotionInSuperimposed": "Enable",
}


@pytest.mark.parametrize(
    ("name", "objects"),
    [
        pytest.param(name, objects, marks=[pytest.mark.requirement(*ids)] if ids else [], id=name)
        for ids, name, objects in SUPPORT
    ],
)
def test_objects(name, objects):
    """An external encoder is refused when the instance is made; an axis of another type with 16#8002 at the
    call.

    A synchronous axis is taken wherever a positioning axis is.
    """
    kind = getattr(instructions, name)
    objects = objects.replace("P", "PY")
    for letter, type_of_object in KINDS.items():
        axis = type_of_object("axis1", SimulatedDrivePort(cycle_s=0.001), cycle_ns=1_000_000)
        if letter == "E" and letter not in objects:
            with pytest.raises(
                ConfigurationError, match=f"{name}.Axis: 'axis1' is not allowed; allowed: one of "
            ):
                kind(axis)
            continue
        instance = kind(axis)
        if "Master" in kind.inputs:
            instance.set(
                Master=PositioningAxis("leader", SimulatedDrivePort(cycle_s=0.001), cycle_ns=1_000_000)
            )
        if "Cam" in kind.inputs:
            instance.set(Cam=Cam("cam"), MasterStartDistance=1.0)
        word = axis.var("StatusWord")
        instance(**{START.get(name, "Execute"): True})
        assert (instance.ErrorID == 0x8002) is (letter not in objects), (name, letter, hex(instance.ErrorID))
        if letter not in objects:
            assert (instance.Error, instance.Busy, axis.var("StatusWord")) == (True, False, word)


def test_the_table_has_every_instruction_with_an_axis():
    """What the package offers and takes an object is in the table above."""
    offered = {name for name in instructions.__all__ if name.startswith("MC_")}
    others = (("Cam",), ("MeasuringInput",))
    offered = {
        one for one in offered if getattr(getattr(instructions, one), "object_types", ()) not in others
    }
    assert offered - {"MC_SaveAbsoluteEncoderData"} == {name for _, name, _ in SUPPORT}


@pytest.mark.requirement("MC-050", "MC-541")
def test_fixed_stop_detection_needs_a_position():
    """MC_TorqueLimiting Mode 1 on a speed axis: 16#800A; Mode 0 is accepted."""
    rig = Rig(speed=True, port=TorquePort()).enabled()
    detection = rig.axis.torque_limiting(1.0, mode=1)
    rig.cycles(2)
    assert (detection.ErrorID, detection.Busy) == (0x800A, False)
    limiting = rig.axis.torque_limiting(1.0)
    rig.cycles(2)
    assert limiting.Busy
