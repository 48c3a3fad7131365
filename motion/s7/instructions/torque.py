"""`MC_TorqueAdditive`, `MC_TorqueRange`, `MC_TorqueLimiting` (section 2.17 of
the instruction specification).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from motion.s7.axis.jobs import (
    ERROR_ADDITIVE_TORQUE,
    ERROR_LIMIT,
    ERROR_LOWER_TORQUE,
    ERROR_UPPER_TORQUE,
    NO_ERROR,
)
from motion.s7.axis.torque import LIMIT_RANGE, TORQUE_RANGE
from motion.s7.instructions.dynamics import is_number
from motion.s7.instructions.enable import EnableInstruction

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis


class MC_TorqueAdditive(EnableInstruction):
    """Add a torque to the one that the speed controller of the drive demands.

    Inputs: `Enable`; `Value`, in the torque unit (linear motor: force unit), -1.0E12..1.0E12. Needs telegram
    750 and an enabled axis without `MC_Stop`.
    """

    instruction = "MC_TorqueAdditive"
    inputs: ClassVar[dict[str, float]] = {"Enable": False, "Value": 0.0}
    Value: float

    def _begin(self) -> int:
        return self.axis.torque.start_additive()

    def _update(self) -> int:
        if not is_number(self.Value, TORQUE_RANGE):
            return ERROR_ADDITIVE_TORQUE
        return self.axis.torque.set_additive(float(self.Value))

    def _end(self) -> int:
        return self.axis.torque.set_additive(None)


class MC_TorqueRange(EnableInstruction):
    """Limit the torque of the drive to a range.

    Inputs: `Enable`; `UpperLimit`, `LowerLimit`, in the torque unit (linear motor: force unit),
    -1.0E12..1.0E12. Needs telegram 750; excludes `MC_TorqueLimiting`.
    """

    instruction = "MC_TorqueRange"
    inputs: ClassVar[dict[str, float]] = {
        "Enable": False, "UpperLimit": TORQUE_RANGE, "LowerLimit": -TORQUE_RANGE,
    }  # fmt: skip
    UpperLimit: float
    LowerLimit: float

    def _begin(self) -> int:
        return self.axis.torque.start_range()

    def _update(self) -> int:
        if not is_number(self.UpperLimit, TORQUE_RANGE):
            return ERROR_UPPER_TORQUE
        if not is_number(self.LowerLimit, TORQUE_RANGE):
            return ERROR_LOWER_TORQUE
        return self.axis.torque.set_range(float(self.UpperLimit), float(self.LowerLimit))

    def _end(self) -> int:
        self.axis.torque.end_range()
        return NO_ERROR


class MC_TorqueLimiting(EnableInstruction):
    """Limit the torque of the drive in both directions, and detect a fixed stop.

    Inputs: `Enable`; `Limit`, in the torque or force unit, below 0 the default of the technology object;
    `Mode` 0 limiting, 1 with fixed-stop detection. Outputs: `InLimitation`, `InClamping`.
    """

    instruction = "MC_TorqueLimiting"
    inputs: ClassVar[dict[str, float]] = {"Enable": False, "Limit": -1.0, "Mode": 0}
    Limit: float
    Mode: int

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: float) -> None:
        self.InLimitation = False
        self.InClamping = False
        super().__init__(axis, name=name, **inputs)

    def _call(self) -> None:
        super()._call()
        torque = self.axis.torque
        self.InClamping = self._active and torque.limits.clamped
        self.InLimitation = self._active and torque.in_limitation

    def _begin(self) -> int:
        return self.axis.torque.start_limiting(self.Mode)

    def _update(self) -> int:
        if not is_number(self.Limit, LIMIT_RANGE):
            return ERROR_LIMIT
        return self.axis.torque.set_limiting(float(self.Limit), self.Mode)

    def _end(self) -> int:
        return self.axis.torque.end_limiting()

    def in_clamping(self) -> bool:
        """Return `InClamping`."""
        return self.InClamping

    def in_limitation(self) -> bool:
        """Return `InLimitation`."""
        return self.InLimitation
