"""PLCopen `MC_` instructions as function blocks: called once per cycle, with edge and level semantics."""

from motion.s7.instructions.base import ExecuteInstruction, Instruction
from motion.s7.instructions.cam_in import MC_CamIn
from motion.s7.instructions.cams import (
    MC_CopyCamData,
    MC_GetCamFollowingValue,
    MC_GetCamFollowingValueCyclic,
    MC_GetCamLeadingValue,
    MC_InterpolateCam,
)
from motion.s7.instructions.control_words import MC_SetAxisSTW
from motion.s7.instructions.gear import MC_GearIn, MC_GearInPos, MC_GearInVelocity
from motion.s7.instructions.home import MC_Home
from motion.s7.instructions.jog import MC_MoveJog
from motion.s7.instructions.leading_value import MC_LeadingValueAdditive
from motion.s7.instructions.measuring import (
    MC_AbortMeasuringInput,
    MC_MeasuringInput,
    MC_MeasuringInputCyclic,
)
from motion.s7.instructions.motion_in import MC_MotionInPosition, MC_MotionInSuperimposed, MC_MotionInVelocity
from motion.s7.instructions.move import MC_MoveAbsolute, MC_MoveRelative, MC_MoveVelocity
from motion.s7.instructions.power import MC_Power
from motion.s7.instructions.reset import MC_Reset
from motion.s7.instructions.save_encoder_data import MC_SaveAbsoluteEncoderData
from motion.s7.instructions.set_sensor import MC_SetSensor
from motion.s7.instructions.shifts import (
    MC_OffsetAbsolute,
    MC_OffsetRelative,
    MC_PhasingAbsolute,
    MC_PhasingRelative,
)
from motion.s7.instructions.simulation import MC_SynchronizedMotionSimulation
from motion.s7.instructions.stop import MC_Halt, MC_Stop
from motion.s7.instructions.superimposed import MC_HaltSuperimposed, MC_MoveSuperimposed
from motion.s7.instructions.sync_out import MC_CamOut, MC_GearOut
from motion.s7.instructions.torque import MC_TorqueAdditive, MC_TorqueLimiting, MC_TorqueRange
from motion.s7.instructions.write_parameter import MC_WriteParameter

__all__ = [
    "ExecuteInstruction",
    "Instruction",
    "MC_AbortMeasuringInput",
    "MC_CamIn",
    "MC_CamOut",
    "MC_CopyCamData",
    "MC_GearIn",
    "MC_GearInPos",
    "MC_GearInVelocity",
    "MC_GearOut",
    "MC_GetCamFollowingValue",
    "MC_GetCamFollowingValueCyclic",
    "MC_GetCamLeadingValue",
    "MC_Halt",
    "MC_HaltSuperimposed",
    "MC_Home",
    "MC_InterpolateCam",
    "MC_LeadingValueAdditive",
    "MC_MeasuringInput",
    "MC_MeasuringInputCyclic",
    "MC_MotionInPosition",
    "MC_MotionInSuperimposed",
    "MC_MotionInVelocity",
    "MC_MoveAbsolute",
    "MC_MoveJog",
    "MC_MoveRelative",
    "MC_MoveSuperimposed",
    "MC_MoveVelocity",
    "MC_OffsetAbsolute",
    "MC_OffsetRelative",
    "MC_PhasingAbsolute",
    "MC_PhasingRelative",
    "MC_Power",
    "MC_Reset",
    "MC_SaveAbsoluteEncoderData",
    "MC_SetAxisSTW",
    "MC_SetSensor",
    "MC_Stop",
    "MC_SynchronizedMotionSimulation",
    "MC_TorqueAdditive",
    "MC_TorqueLimiting",
    "MC_TorqueRange",
    "MC_WriteParameter",
]
