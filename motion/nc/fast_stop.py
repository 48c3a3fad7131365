"""Fast axis stop: an input of the drive stops the axis within the SAF task (section 7.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.nc.parameters import ParameterSet

_RISING: Final = 1
_FALLING: Final = 2
_BOTH: Final = 3
_HIGH: Final = 4
_LOW: Final = 5
"""Index of the texts of `axis.fast_axis_stop_signal_type`."""


class FastStop:
    """Evaluation of the signal of the fast axis stop.

    Args:
        parameters: Parameters of the axis.

    """

    def __init__(self, parameters: ParameterSet) -> None:
        cell = parameters.cell
        self._type = cell("axis.fast_axis_stop_signal_type")
        self._fast_deceleration = cell("axis.fast_deceleration")
        self._fast_jerk = cell("axis.fast_jerk")
        self._deceleration = cell("axis.default_deceleration")
        self._jerk = cell("axis.default_jerk")
        self.last: bool | None = None
        """Signal of the last cycle; None: there was none."""
        self.active = False
        """A level keeps the axis from moving."""

    @property
    def watches(self) -> bool:
        """Whether a signal type is selected, or its level has just been given up."""
        return self._type.value != 0.0 or self.active

    @property
    def deceleration(self) -> float:
        """Deceleration of the stop, position unit/s2; without a value of its own the default (NC-111)."""
        return self._fast_deceleration.value or self._deceleration.value

    @property
    def jerk(self) -> float:
        """Jerk of the stop, position unit/s3; without a value of its own the default (NC-112)."""
        return self._fast_jerk.value or self._jerk.value

    def step(self, signal: bool) -> bool:
        """Evaluate the signal of this cycle; returns whether the axis has to stop (NC-114 to NC-119)."""
        last, self.last = self.last, signal
        kind = int(self._type.value)
        self.active = (kind == _HIGH and signal) or (kind == _LOW and not signal)
        if self.active:
            return True
        if last is None or last is signal:  # the first state after a start is no edge (NC-121)
            return False
        return kind in {_BOTH, _RISING if signal else _FALLING}
