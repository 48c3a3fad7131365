"""Travel limits of a positioning axis: hardware and software limit switches (LIM section 1)."""

from __future__ import annotations

from motion.s7.axis.limits.software import TravelLimits

__all__ = ["TravelLimits"]
