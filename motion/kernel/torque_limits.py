"""Torque limits that are in effect on an axis, and what they mean for its monitoring (STP-144, MC-553)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motion.kernel.cell import Cell


class TorqueLimits:
    """State of torque limiting, torque range and fixed stop of one axis.

    Args:
        monitored: Not 0: position-related monitoring continues while the torque is limited.

    """

    def __init__(self, monitored: Cell[int]) -> None:
        self._monitored = monitored
        self.begin()

    def begin(self) -> None:
        """Begin without any limit."""
        self.range_nm: tuple[float, float] | None = None
        """Upper and lower limit of a torque range in effect, Nm; None = there is none."""
        self.limiting = False
        """Torque limiting is active."""
        self.limit_nm: float | None = None
        """Limit of torque limiting at the motor, Nm; None = none is sent."""
        self.detects = False
        """Fixed-stop detection is active."""
        self.clamped = False
        """The drive is held at a fixed stop."""
        self.direction = 1.0
        """Direction in which the fixed stop lies."""

    @property
    def limits(self) -> bool:
        """Whether a torque limit or a torque range is active."""
        return self.limit_nm is not None or self.range_nm is not None

    @property
    def relaxes_monitoring(self) -> bool:
        """Whether position-related monitoring is suspended (STP-144, STP-184, MC-553)."""
        if self.clamped:
            return True
        return (self.limit_nm is not None or self.range_nm is not None) and self._monitored.value == 0
