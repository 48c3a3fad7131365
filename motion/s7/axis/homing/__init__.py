"""Homing: how the position of a technology object gets its relation to the machine (§5.11, `MC_Home`)."""

from motion.s7.axis.homing.active import ActiveHoming
from motion.s7.axis.homing.direct import home_directly
from motion.s7.axis.homing.passive import PassiveHoming, abort_passive

__all__ = ["ActiveHoming", "PassiveHoming", "abort_passive", "home_directly"]
