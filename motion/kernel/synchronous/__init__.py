"""Synchronous operation: leading values, and what a following axis makes of them."""

from motion.kernel.synchronous.coupling import Coupling, Leaving, Waiting
from motion.kernel.synchronous.function import Entry, FunctionCoupling, Line
from motion.kernel.synchronous.gear import GearCoupling
from motion.kernel.synchronous.leading import LeadingMotion
from motion.kernel.synchronous.leaving import DistanceLeaving, TimeLeaving

__all__ = [
    "Coupling",
    "DistanceLeaving",
    "Entry",
    "FunctionCoupling",
    "GearCoupling",
    "LeadingMotion",
    "Leaving",
    "Line",
    "TimeLeaving",
    "Waiting",
]
