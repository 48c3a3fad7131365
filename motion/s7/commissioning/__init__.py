"""Commissioning by hand: the axis control panel and the optimisation of the position controller (section 5 of
the instruction specification).
"""

from motion.s7.commissioning.optimisation import (
    Attempt,
    Optimisation,
    Recommendation,
    TestStep,
    tuned_by_drive,
)
from motion.s7.commissioning.panel import CommissioningError, ControlPanel
from motion.s7.commissioning.precautions import precautions

__all__ = [
    "Attempt",
    "CommissioningError",
    "ControlPanel",
    "Optimisation",
    "Recommendation",
    "TestStep",
    "precautions",
    "tuned_by_drive",
]
