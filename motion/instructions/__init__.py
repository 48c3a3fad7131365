"""PLCopen `MC_` instructions as function blocks: called once per cycle, with edge and level semantics."""

from motion.instructions.base import ExecuteInstruction, Instruction
from motion.instructions.control_words import MC_SetAxisSTW
from motion.instructions.home import MC_Home
from motion.instructions.jog import MC_MoveJog
from motion.instructions.motion_in import MC_MotionInPosition, MC_MotionInSuperimposed, MC_MotionInVelocity
from motion.instructions.move import MC_MoveAbsolute, MC_MoveRelative, MC_MoveVelocity
from motion.instructions.power import MC_Power
from motion.instructions.reset import MC_Reset
from motion.instructions.save_encoder_data import MC_SaveAbsoluteEncoderData
from motion.instructions.set_sensor import MC_SetSensor
from motion.instructions.stop import MC_Halt, MC_Stop
from motion.instructions.superimposed import MC_HaltSuperimposed, MC_MoveSuperimposed
from motion.instructions.torque import MC_TorqueAdditive, MC_TorqueLimiting, MC_TorqueRange
from motion.instructions.write_parameter import MC_WriteParameter

__all__ = [
    "ExecuteInstruction",
    "Instruction",
    "MC_Halt",
    "MC_HaltSuperimposed",
    "MC_Home",
    "MC_MotionInPosition",
    "MC_MotionInSuperimposed",
    "MC_MotionInVelocity",
    "MC_MoveAbsolute",
    "MC_MoveJog",
    "MC_MoveRelative",
    "MC_MoveSuperimposed",
    "MC_MoveVelocity",
    "MC_Power",
    "MC_Reset",
    "MC_SaveAbsoluteEncoderData",
    "MC_SetAxisSTW",
    "MC_SetSensor",
    "MC_Stop",
    "MC_TorqueAdditive",
    "MC_TorqueLimiting",
    "MC_TorqueRange",
    "MC_WriteParameter",
]
