"""Setpoints: velocity and point-to-point profiles with limited jerk, and the
generator that an axis advances.
"""

from motion.setpoint.generator import MotionPhase, SetpointGenerator
from motion.setpoint.limits import Resolved, resolve
from motion.setpoint.meeting import plan_meeting
from motion.setpoint.position import plan_position
from motion.setpoint.profile import Phase, Profile
from motion.setpoint.setpoint import Setpoint
from motion.setpoint.stopping import stop_distance, stop_time
from motion.setpoint.velocity import plan_velocity

__all__ = [
    "MotionPhase",
    "Phase",
    "Profile",
    "Resolved",
    "Setpoint",
    "SetpointGenerator",
    "plan_meeting",
    "plan_position",
    "plan_velocity",
    "resolve",
    "stop_distance",
    "stop_time",
]
