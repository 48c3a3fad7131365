"""Inputs, outputs and defaults of every instruction, and what dynamic inputs make of the motion (section 2 of
the specification).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

import motion.s7.instructions as instructions
from motion.s7.instructions import ExecuteInstruction
from testcases.catalogue import each
from testcases.unit.motion_axis.conftest import Rig

CYCLE = 0.004

# instruction, identifier, input, default as printed
INPUTS = [
    ("MC_Power", "MC-135", "Enable", False),
    ("MC_Power", "MC-136", "StartMode", 1),
    ("MC_Power", "MC-137", "StopMode", 0),
    ("MC_Reset", "MC-174", "Execute", False),
    ("MC_Reset", "MC-175", "Restart", False),
    ("MC_Home", "MC-192", "Execute", False),
    ("MC_Home", "MC-193", "Position", 0.0),
    ("MC_Home", "MC-194", "Mode", 0),
    ("MC_Halt", "MC-224", "Execute", False),
    ("MC_Halt", "MC-225", "Deceleration", -1.0),
    ("MC_Halt", "MC-226", "Jerk", -1.0),
    ("MC_Halt", "MC-227", "AbortAcceleration", False),
    ("MC_Halt", "MC-228", "Mode", 0),
    ("MC_MoveAbsolute", "MC-248", "Execute", False),
    ("MC_MoveAbsolute", "MC-249", "Position", 0.0),
    ("MC_MoveAbsolute", "MC-250", "Velocity", -1.0),
    ("MC_MoveAbsolute", "MC-251", "Acceleration", -1.0),
    ("MC_MoveAbsolute", "MC-252", "Deceleration", -1.0),
    ("MC_MoveAbsolute", "MC-253", "Jerk", -1.0),
    ("MC_MoveAbsolute", "MC-254", "BufferMode", 0),
    ("MC_MoveAbsolute", "MC-255", "Direction", 1),
    ("MC_MoveRelative", "MC-276", "Execute", False),
    ("MC_MoveRelative", "MC-277", "Distance", 0.0),
    ("MC_MoveRelative", "MC-278", "Velocity", -1.0),
    ("MC_MoveRelative", "MC-279", "Acceleration", -1.0),
    ("MC_MoveRelative", "MC-280", "Deceleration", -1.0),
    ("MC_MoveRelative", "MC-281", "Jerk", -1.0),
    ("MC_MoveRelative", "MC-282", "BufferMode", 0),
    ("MC_MoveVelocity", "MC-293", "Execute", False),
    ("MC_MoveVelocity", "MC-294", "Velocity", 100.0),
    ("MC_MoveVelocity", "MC-295", "Acceleration", -1.0),
    ("MC_MoveVelocity", "MC-296", "Deceleration", -1.0),
    ("MC_MoveVelocity", "MC-297", "Jerk", -1.0),
    ("MC_MoveVelocity", "MC-298", "Direction", 0),
    ("MC_MoveVelocity", "MC-299", "Current", False),
    ("MC_MoveVelocity", "MC-300", "PositionControlled", True),
    ("MC_MoveJog", "MC-317", "JogForward", False),
    ("MC_MoveJog", "MC-318", "JogBackward", False),
    ("MC_MoveJog", "MC-319", "Velocity", 100.0),
    ("MC_MoveJog", "MC-320", "Acceleration", -1.0),
    ("MC_MoveJog", "MC-321", "Deceleration", -1.0),
    ("MC_MoveJog", "MC-322", "Jerk", -1.0),
    ("MC_MoveJog", "MC-323", "PositionControlled", True),
    ("MC_MoveSuperimposed", "MC-343", "Execute", False),
    ("MC_MoveSuperimposed", "MC-344", "Distance", 0.0),
    ("MC_MoveSuperimposed", "MC-345", "VelocityDiff", -1.0),
    ("MC_MoveSuperimposed", "MC-346", "Acceleration", -1.0),
    ("MC_MoveSuperimposed", "MC-347", "Deceleration", -1.0),
    ("MC_MoveSuperimposed", "MC-348", "Jerk", -1.0),
    ("MC_HaltSuperimposed", "MC-363", "Execute", False),
    ("MC_HaltSuperimposed", "MC-364", "Deceleration", -1.0),
    ("MC_HaltSuperimposed", "MC-365", "Jerk", -1.0),
    ("MC_HaltSuperimposed", "MC-366", "AbortAcceleration", False),
    ("MC_Stop", "MC-395", "Execute", False),
    ("MC_Stop", "MC-396", "Mode", 0),
    ("MC_Stop", "MC-397", "Deceleration", -1.0),
    ("MC_Stop", "MC-398", "Jerk", -1.0),
    ("MC_Stop", "MC-399", "AbortAcceleration", False),
    ("MC_SetAxisSTW", "MC-435", "Execute", False),
    ("MC_SetAxisSTW", "MC-436", "STW1", 0),
    ("MC_SetAxisSTW", "MC-437", "STW1BitMask", 0),
    ("MC_SetAxisSTW", "MC-438", "STW2", 0),
    ("MC_SetAxisSTW", "MC-439", "STW2BitMask", 0),
    ("MC_SetSensor", "MC-379", "Execute", False),
    ("MC_SetSensor", "MC-380", "Sensor", 1),
    ("MC_SetSensor", "MC-381", "Mode", 0),
    ("MC_SetSensor", "MC-382", "ReferenceSensor", 1),
    ("MC_WriteParameter", "MC-449", "Execute", False),
    ("MC_WriteParameter", "MC-450", "ParameterNumber", 0),
    ("MC_WriteParameter", "MC-451", "Value", 0),
    ("MC_MotionInVelocity", "MC-483", "Enable", False),
    ("MC_MotionInVelocity", "MC-484", "Velocity", 0.0),
    ("MC_MotionInVelocity", "MC-485", "Acceleration", 0.0),
    ("MC_MotionInVelocity", "MC-486", "PositionControlled", True),
    ("MC_MotionInPosition", "MC-493", "Enable", False),
    ("MC_MotionInPosition", "MC-494", "Position", 0.0),
    ("MC_MotionInPosition", "MC-495", "Velocity", 0.0),
    ("MC_MotionInPosition", "MC-496", "Acceleration", 0.0),
    ("MC_MotionInSuperimposed", "MC-503", "Enable", False),
    ("MC_MotionInSuperimposed", "MC-504", "Distance", 0.0),
    ("MC_MotionInSuperimposed", "MC-505", "VelocityDiff", 0.0),
    ("MC_MotionInSuperimposed", "MC-506", "AccelerationDiff", 0.0),
    ("MC_TorqueAdditive", "MC-514", "Enable", False),
    ("MC_TorqueAdditive", "MC-515", "Value", 0.0),
    ("MC_TorqueRange", "MC-524", "Enable", False),
    ("MC_TorqueRange", "MC-525", "UpperLimit", 1.0e12),
    ("MC_TorqueRange", "MC-526", "LowerLimit", -1.0e12),
    ("MC_TorqueLimiting", "MC-543", "Enable", False),
    ("MC_TorqueLimiting", "MC-544", "Limit", -1.0),
    ("MC_TorqueLimiting", "MC-545", "Mode", 0),
    ("MC_GearIn", "SYN-136", "Execute", False),
    ("MC_GearIn", "SYN-136", "Master", None),
    ("MC_GearIn", "SYN-137", "RatioNumerator", 1),
    ("MC_GearIn", "SYN-138", "RatioDenominator", 1),
    ("MC_GearIn", "SYN-139", "Acceleration", -1.0),
    ("MC_GearIn", "SYN-139", "Deceleration", -1.0),
    ("MC_GearIn", "SYN-139", "Jerk", -1.0),
    ("MC_CamIn", "CAM-114", "Execute", False),
    ("MC_CamIn", "CAM-114", "Master", None),
    ("MC_CamIn", "CAM-114", "Cam", None),
    ("MC_CamIn", "CAM-115", "MasterOffset", 0.0),
    ("MC_CamIn", "CAM-115", "SlaveOffset", 0.0),
    ("MC_CamIn", "CAM-116", "MasterScaling", 1.0),
    ("MC_CamIn", "CAM-116", "SlaveScaling", 1.0),
    ("MC_CamIn", "CAM-117", "MasterSyncPosition", 0.0),
    ("MC_CamIn", "CAM-118", "SyncProfileReference", 1),
    ("MC_CamIn", "CAM-119", "MasterStartDistance", 0.0),
    ("MC_CamIn", "CAM-120", "Velocity", -1.0),
    ("MC_CamIn", "CAM-120", "Acceleration", -1.0),
    ("MC_CamIn", "CAM-120", "Deceleration", -1.0),
    ("MC_CamIn", "CAM-120", "Jerk", -1.0),
    ("MC_CamIn", "CAM-121", "ApplicationMode", 0),
    ("MC_CamIn", "CAM-122", "SyncDirection", 3),
    ("MC_GearOut", "SYN-197", "Execute", False),
    ("MC_GearOut", "SYN-198", "SyncProfileReference", 1),
    ("MC_GearOut", "SYN-199", "SlavePosition", 0.0),
    ("MC_GearOut", "SYN-200", "MasterStopDistance", 0.0),
    ("MC_GearOut", "SYN-201", "Deceleration", -1.0),
    ("MC_GearOut", "SYN-201", "Jerk", -1.0),
    ("MC_GearOut", "SYN-202", "SyncOutDirection", 3),
    ("MC_CamOut", "SYN-197", "Execute", False),
    ("MC_CamOut", "SYN-198", "SyncProfileReference", 1),
    ("MC_CamOut", "SYN-199", "SlavePosition", 0.0),
    ("MC_CamOut", "SYN-200", "MasterStopDistance", 0.0),
    ("MC_CamOut", "SYN-201", "Deceleration", -1.0),
    ("MC_CamOut", "SYN-201", "Jerk", -1.0),
    ("MC_CamOut", "SYN-202", "SyncOutDirection", 3),
    ("MC_GearInPos", "SYN-148", "Execute", False),
    ("MC_GearInPos", "SYN-148", "Master", None),
    ("MC_GearInPos", "SYN-148", "RatioNumerator", 1),
    ("MC_GearInPos", "SYN-148", "RatioDenominator", 1),
    ("MC_GearInPos", "SYN-149", "MasterSyncPosition", 0.0),
    ("MC_GearInPos", "SYN-150", "SlaveSyncPosition", 0.0),
    ("MC_GearInPos", "SYN-151", "SyncProfileReference", 1),
    ("MC_GearInPos", "SYN-152", "MasterStartDistance", 1.0),
    ("MC_GearInPos", "SYN-153", "Velocity", -1.0),
    ("MC_GearInPos", "SYN-153", "Acceleration", -1.0),
    ("MC_GearInPos", "SYN-153", "Deceleration", -1.0),
    ("MC_GearInPos", "SYN-153", "Jerk", -1.0),
    ("MC_GearInPos", "SYN-154", "SyncDirection", 3),
    ("MC_GearInVelocity", "SYN-165", "Execute", False),
    ("MC_GearInVelocity", "SYN-165", "Master", None),
    ("MC_GearInVelocity", "SYN-165", "RatioNumerator", 1),
    ("MC_GearInVelocity", "SYN-165", "RatioDenominator", 1),
    ("MC_GearInVelocity", "SYN-165", "Acceleration", -1.0),
    ("MC_GearInVelocity", "SYN-165", "Deceleration", -1.0),
    ("MC_GearInVelocity", "SYN-165", "Jerk", -1.0),
    ("MC_GearInVelocity", "SYN-166", "ContinuousUpdate", False),
    ("MC_GearInVelocity", "SYN-167", "PositionControlled", False),
    ("MC_PhasingAbsolute", "SYN-175", "Execute", False),
    ("MC_PhasingAbsolute", "SYN-175", "Master", None),
    ("MC_PhasingAbsolute", "SYN-176", "PhaseShift", 0.0),
    ("MC_PhasingAbsolute", "SYN-177", "Velocity", -1.0),
    ("MC_PhasingAbsolute", "SYN-177", "Acceleration", -1.0),
    ("MC_PhasingAbsolute", "SYN-177", "Deceleration", -1.0),
    ("MC_PhasingAbsolute", "SYN-177", "Jerk", -1.0),
    ("MC_PhasingAbsolute", "SYN-178", "ProfileReference", 0),
    ("MC_PhasingAbsolute", "SYN-179", "PhasingDistance", 0.0),
    ("MC_PhasingAbsolute", "SYN-180", "StartPosition", 0.0),
    ("MC_PhasingAbsolute", "SYN-181", "Direction", 3),
    ("MC_PhasingRelative", "SYN-175", "Execute", False),
    ("MC_PhasingRelative", "SYN-175", "Master", None),
    ("MC_PhasingRelative", "SYN-176", "PhaseShift", 0.0),
    ("MC_PhasingRelative", "SYN-177", "Velocity", -1.0),
    ("MC_PhasingRelative", "SYN-177", "Acceleration", -1.0),
    ("MC_PhasingRelative", "SYN-177", "Deceleration", -1.0),
    ("MC_PhasingRelative", "SYN-177", "Jerk", -1.0),
    ("MC_PhasingRelative", "SYN-178", "ProfileReference", 0),
    ("MC_PhasingRelative", "SYN-179", "PhasingDistance", 0.0),
    ("MC_PhasingRelative", "SYN-180", "StartPosition", 0.0),
    ("MC_PhasingRelative", "SYN-181", "Direction", 3),
    ("MC_OffsetAbsolute", "SYN-190", "Execute", False),
    ("MC_OffsetAbsolute", "SYN-190", "Offset", 0.0),
    ("MC_OffsetAbsolute", "SYN-191", "ProfileReference", 1),
    ("MC_OffsetAbsolute", "SYN-192", "OffsetDistance", 0.0),
    ("MC_OffsetAbsolute", "SYN-192", "StartPosition", 0.0),
    ("MC_OffsetAbsolute", "SYN-192", "Direction", 3),
    ("MC_OffsetRelative", "SYN-190", "Execute", False),
    ("MC_OffsetRelative", "SYN-190", "Offset", 0.0),
    ("MC_OffsetRelative", "SYN-191", "ProfileReference", 1),
    ("MC_OffsetRelative", "SYN-192", "OffsetDistance", 0.0),
    ("MC_OffsetRelative", "SYN-192", "StartPosition", 0.0),
    ("MC_OffsetRelative", "SYN-192", "Direction", 3),
    ("MC_LeadingValueAdditive", "SYN-215", "Enable", False),
    ("MC_LeadingValueAdditive", "SYN-216", "Position", 0.0),
    ("MC_LeadingValueAdditive", "SYN-217", "Velocity", 0.0),
    ("MC_LeadingValueAdditive", "SYN-218", "Acceleration", 0.0),
    ("MC_SynchronizedMotionSimulation", "SYN-230", "Enable", False),
]

# instruction, identifiers, outputs other than Error and ErrorID, which all have
OUTPUTS = {
    "MC_Power": (["MC-138", "MC-139", "MC-140", "MC-141"], ["Status", "Busy"]),
    "MC_Reset": (["MC-176", "MC-177"], ["Done", "Busy", "CommandAborted"]),
    "MC_Home": (["MC-197"], ["Done", "Busy", "CommandAborted"]),
    "MC_Halt": (["MC-229", "MC-230"], ["Done", "Busy", "CommandAborted"]),
    "MC_MoveAbsolute": (
        ["MC-256", "MC-257", "MC-258", "MC-259"],
        ["Done", "Busy", "Active", "CommandAborted"],
    ),
    "MC_MoveRelative": (["MC-283"], ["Done", "Busy", "Active", "CommandAborted"]),
    "MC_MoveVelocity": (["MC-301", "MC-302"], ["InVelocity", "Busy", "CommandAborted"]),
    "MC_MoveJog": (["MC-324", "MC-325"], ["InVelocity", "Busy", "CommandAborted"]),
    "MC_MoveSuperimposed": (["MC-349", "MC-350"], ["Done", "Busy", "CommandAborted"]),
    "MC_HaltSuperimposed": (["MC-367", "MC-368"], ["Done", "Busy", "CommandAborted"]),
    "MC_Stop": (["MC-400", "MC-401", "MC-402", "MC-403"], ["Done", "Busy", "CommandAborted"]),
    "MC_SetAxisSTW": (["MC-440", "MC-441"], ["Done", "Busy", "CommandAborted"]),
    "MC_SetSensor": (["MC-383", "MC-384"], ["Done", "Busy", "CommandAborted"]),
    "MC_WriteParameter": (["MC-452", "MC-453"], ["Done", "Busy", "CommandAborted"]),
    "MC_MotionInVelocity": (["MC-487"], ["Busy", "CommandAborted"]),
    "MC_MotionInPosition": (["MC-497"], ["Busy", "CommandAborted"]),
    "MC_MotionInSuperimposed": (["MC-507"], ["Busy", "CommandAborted"]),
    "MC_TorqueAdditive": (["MC-516"], ["Busy"]),
    "MC_TorqueRange": (["MC-527"], ["Busy"]),
    "MC_TorqueLimiting": (["MC-546", "MC-547", "MC-548"], ["InClamping", "InLimitation", "Busy"]),
    "MC_GearIn": (["SYN-141"], ["InGear", "Busy", "CommandAborted"]),
    "MC_CamIn": (["CAM-123"], ["StartSync", "InSync", "EndOfProfile", "Busy", "CommandAborted"]),
    "MC_GearOut": (["SYN-203"], ["StartSyncOut", "Done", "Busy", "CommandAborted"]),
    "MC_CamOut": (["SYN-203"], ["StartSyncOut", "Done", "Busy", "CommandAborted"]),
    "MC_GearInPos": (["SYN-155"], ["StartSync", "InSync", "Busy", "CommandAborted"]),
    "MC_GearInVelocity": (
        ["SYN-168"],
        ["StartSync", "InSync", "ContinuousUpdateActive", "Busy", "CommandAborted"],
    ),
    "MC_PhasingAbsolute": (
        ["SYN-182"],
        ["StartPhasing", "AbsolutePhaseShift", "Done", "Busy", "CommandAborted"],
    ),
    "MC_PhasingRelative": (
        ["SYN-182"],
        ["StartPhasing", "CoveredPhaseShift", "Done", "Busy", "CommandAborted"],
    ),
    "MC_OffsetAbsolute": (["SYN-193"], ["StartOffset", "AbsoluteOffset", "Done", "Busy", "CommandAborted"]),
    "MC_OffsetRelative": (["SYN-193"], ["StartOffset", "CoveredOffset", "Done", "Busy", "CommandAborted"]),
    "MC_LeadingValueAdditive": (["SYN-219"], ["Busy"]),
    "MC_SynchronizedMotionSimulation": (["SYN-231"], ["InSimulation", "Busy"]),
}


@pytest.mark.parametrize(
    ("name", "inputs"),
    [
        pytest.param(
            name,
            {row[2]: row[3] for row in INPUTS if row[0] == name},
            marks=pytest.mark.requirement(*[row[1] for row in INPUTS if row[0] == name]),
        )
        for name in OUTPUTS
    ],
)
def test_inputs_have_the_printed_names_types_and_defaults(rig, name, inputs):
    """Neither more nor fewer inputs than printed (MC_Home has no choice of encoder yet), with type and
    default.
    """
    kind = getattr(instructions, name)
    offered = {key: value for key, value in kind.inputs.items() if (name, key) != ("MC_Home", "Sensor")}
    assert offered == inputs
    assert {key: type(value) for key, value in offered.items()} == {
        key: type(value) for key, value in inputs.items()
    }
    instance = kind(rig.axis.object)
    assert {key: getattr(instance, key) for key in inputs} == inputs


@pytest.mark.parametrize(
    ("name", "outputs"),
    [pytest.param(name, row[1], marks=pytest.mark.requirement(*row[0])) for name, row in OUTPUTS.items()],
)
def test_outputs_are_false_before_the_first_call(rig, name, outputs):
    """All outputs exist, BOOL FALSE and ErrorID 16#0000."""
    instance = getattr(instructions, name)(rig.axis.object)
    assert [getattr(instance, one) for one in (*outputs, "Error")] == [False] * (len(outputs) + 1)
    assert instance.ErrorID == 0


def test_the_tables_name_every_instruction():
    """What the package offers is in the tables above."""
    apart = ("Cam",), ("MeasuringInput",)  # with tests of their own
    offered = {name for name in instructions.__all__ if name.startswith("MC_")}
    offered = {one for one in offered if getattr(getattr(instructions, one), "object_types", ()) not in apart}
    assert offered - {"MC_SaveAbsoluteEncoderData"} == set(OUTPUTS)


# -- what dynamic inputs make of the motion
# ----------------------------------------------------------------------------------


def extremes(rig, since):
    """Return greatest velocity, acceleration, deceleration and jerk of the setpoint from row `since` on.

    Acceleration is the one that makes the axis faster; jerk is the slope of the acceleration between two
    cycles.
    """
    v = rig.column("velocity_setpoint")[since:]
    a = rig.column("acceleration_setpoint")[since:]
    faster = [abs(acc) for vel, acc in zip(v, a, strict=True) if vel * acc > 0.0]
    slower = [abs(acc) for vel, acc in zip(v, a, strict=True) if vel * acc < 0.0]
    jerk = max(abs(two - one) / CYCLE for one, two in pairwise(a))
    return max(map(abs, v)), max(faster, default=0.0), max(slower, default=0.0), jerk


MOVES = {
    "MC_MoveAbsolute": lambda axis, **given: axis.move_absolute(200.0, **given),
    "MC_MoveRelative": lambda axis, **given: axis.move_relative(200.0, **given),
    "MC_MoveVelocity": lambda axis, **given: axis.move_velocity(given.pop("Velocity", 100.0), **given),
    "MC_MoveJog": lambda axis, **given: axis.jog(given.pop("Velocity", 100.0), **given),
    "MC_MoveSuperimposed": lambda axis, **given: axis.move_superimposed(
        200.0, **{("VelocityDiff" if key == "Velocity" else key): value for key, value in given.items()}
    ),
}  # fmt: skip
IDENTIFIERS = {
    "MC_MoveAbsolute": ("MC-250", "MC-251", "MC-252", "MC-253"),
    "MC_MoveRelative": ("MC-278", "MC-279", "MC-280", "MC-281"),
    "MC_MoveVelocity": ("MC-294", "MC-295", "MC-296", "MC-297"),
    "MC_MoveJog": ("MC-319", "MC-320", "MC-321", "MC-322"),
    "MC_MoveSuperimposed": ("MC-345", "MC-346", "MC-347", "MC-348"),
}


def drive_through(rig, name, **given):
    """Let a job with these inputs run from standstill to standstill; returns the extremes of its motion."""
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    since = len(rig.rows)
    job = MOVES[name](rig.axis, **given)
    if isinstance(job, ExecuteInstruction) and name != "MC_MoveVelocity":
        rig.until(job.done, 20.0)
    else:
        rig.until(job.in_velocity, 20.0)
        rig.run(0.1)
        if name == "MC_MoveJog":
            job.set(JogForward=False)
        else:
            job.set(Execute=False)
            MOVES[name](rig.axis, **{**given, "Velocity": 0.0})
        rig.until(lambda: rig.column("velocity_setpoint")[-1] == 0.0, 20.0)
    return extremes(rig, since)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.requirement(*IDENTIFIERS[name])) for name in MOVES]
)
def test_values_above_zero_are_used(rig, name):
    """Velocity, acceleration, deceleration and jerk of the setpoint are those of the inputs."""
    velocity, faster, slower, jerk = drive_through(
        rig, name, Velocity=150.0, Acceleration=600.0, Deceleration=400.0, Jerk=5000.0
    )
    assert velocity == pytest.approx(150.0)
    assert faster == pytest.approx(600.0, rel=0.04)
    assert slower == pytest.approx(400.0, rel=0.04)
    assert jerk == pytest.approx(5000.0, rel=0.01)


@pytest.mark.requirement("STP-227", "MC-086", "MC-087", "MC-088", "MC-089", "MC-091")
@pytest.mark.parametrize("name", list(MOVES))
def test_values_below_zero_are_the_defaults(rig, name):
    """-1.0 selects DynamicDefaults; MC_MoveJog takes the absolute value of its velocity, MC_MoveVelocity
    reverses.
    """
    given = {"Acceleration": -1.0, "Deceleration": -1.0, "Jerk": -1.0}
    if name not in ("MC_MoveVelocity", "MC_MoveJog"):
        given["Velocity"] = -1.0
    if name == "MC_MoveJog":
        given["Velocity"] = -100.0
    velocity, faster, slower, jerk = drive_through(rig, name, **given)
    assert velocity == pytest.approx(100.0)
    # With 10000 mm/s3 the velocity of 100 mm/s is reached exactly at the acceleration of 1000 mm/s2.
    assert faster == pytest.approx(1000.0, rel=0.05)
    assert slower == pytest.approx(1000.0, rel=0.05)
    assert jerk == pytest.approx(10000.0, rel=0.01)
    if name == "MC_MoveJog":
        assert max(rig.column("velocity_setpoint")) == pytest.approx(100.0)


@pytest.mark.requirement("MC-089")
@pytest.mark.parametrize("name", list(MOVES))
def test_jerk_zero_is_a_trapezoid(rig, name):
    """Without jerk limit the acceleration is there at once."""
    _, faster, slower, _ = drive_through(
        rig, name, Velocity=150.0, Acceleration=600.0, Deceleration=400.0, Jerk=0.0
    )
    accelerations = {round(abs(a), 3) for a in rig.column("acceleration_setpoint")}
    assert accelerations == {0.0, 600.0, 400.0}
    assert (faster, slower) == (600.0, 400.0)


VALUES_THAT_ARE_NOT_ALLOWED_CASES = [
    (name, key, error, value)
    for name in MOVES
    for key, error in (("Velocity", 0x8003), ("Acceleration", 0x8004), ("Deceleration", 0x8005))
    for value in (0.0, float("nan"), float("inf"), "fast")
    if not (value == 0.0 and key == "Velocity" and name in ("MC_MoveVelocity", "MC_MoveJog"))
]


def check_values_that_are_not_allowed(rig, name, key, error, value):
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    job = MOVES[name](rig.axis, **{key: value})
    rig.cycles(1)
    assert (job.Error, job.ErrorID, job.Busy) == (True, error, False)
    job.set(**({"JogForward": False} if name == "MC_MoveJog" else {"Execute": False}))
    rig.cycles(1)
    assert (job.Error, job.ErrorID) == (False, 0)


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-086", "MC-087", "MC-088", "MC-080", "MC-007")
def test_values_that_are_not_allowed(subtests):
    """0.0 where it is no value (see the next test), no number, or infinity: the ErrorID of this input."""
    for label, values in each(VALUES_THAT_ARE_NOT_ALLOWED_CASES):
        with subtests.test(label):
            check_values_that_are_not_allowed(Rig(), *values)


@pytest.mark.requirement("MC-090", "MC-091")
@pytest.mark.parametrize("name", ["MC_MoveVelocity", "MC_MoveJog"])
def test_velocity_zero_is_allowed_where_a_velocity_is_the_aim(rig, name):
    """MC_MoveVelocity and MC_MoveJog with 0.0 stand, in velocity."""
    rig.enabled()
    job = MOVES[name](rig.axis, Velocity=0.0)
    rig.until(job.in_velocity)
    assert rig.column("velocity_setpoint")[-1] == 0.0


@pytest.mark.requirement("MC-093")
@pytest.mark.parametrize(
    ("default", "given", "limit", "effective"),
    [
        (200.0, -1.0, 400.0, 200.0),
        (200.0, -1.0, 50.0, 50.0),
        (200.0, 300.0, 400.0, 300.0),
        (200.0, 600.0, 400.0, 400.0),
    ],
)
def test_effective_velocity(make_rig, default, given, limit, effective):
    """The smaller of the resolved value and the dynamic limit, in the relations of the printed vectors; 501
    when limited.
    """
    rig = make_rig(
        variables={
            "DynamicDefaults.Velocity": default,
            "DynamicLimits.Velocity": limit,
            "DynamicLimits.MaxVelocity": 500.0,
        }
    )
    rig.enabled()
    job = rig.axis.move_relative(300.0, Velocity=given)
    rig.until(job.done, 20.0)
    assert max(rig.column("velocity_setpoint")) == pytest.approx(effective)
    warned = [event.data["number"] for event in rig.events("alarm.raised")]
    assert (501 in warned) is (effective < (default if given < 0.0 else given))
