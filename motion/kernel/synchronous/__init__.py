"""Synchronous operation: leading values, and what a following axis makes of them."""

from motion.kernel.synchronous.additive import AdditiveValue
from motion.kernel.synchronous.coupling import Coupling, Leaving, Waiting
from motion.kernel.synchronous.function import Entry, FunctionCoupling, Line
from motion.kernel.synchronous.gear import GearCoupling
from motion.kernel.synchronous.leading import LeadingMotion
from motion.kernel.synchronous.leaving import DistanceLeaving, TimeLeaving
from motion.kernel.synchronous.shift import Shift, Shifting, ShiftOverDistance, ShiftWithDynamics

__all__ = [
    "AdditiveValue",
    "Coupling",
    "DistanceLeaving",
    "Entry",
    "FunctionCoupling",
    "GearCoupling",
    "LeadingMotion",
    "Leaving",
    "Line",
    "Shift",
    "ShiftOverDistance",
    "ShiftWithDynamics",
    "Shifting",
    "TimeLeaving",
    "Waiting",
]
