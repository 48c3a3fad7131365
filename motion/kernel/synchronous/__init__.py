"""Synchronous operation: leading values, and what a following axis makes of them."""

from motion.kernel.synchronous.gear import GearCoupling
from motion.kernel.synchronous.leading import LeadingMotion

__all__ = ["GearCoupling", "LeadingMotion"]
