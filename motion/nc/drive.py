"""The drive component: from velocities to the output of the drive (section 14 of the specification)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.kernel.cell import Cell
    from motion.nc.parameters import ParameterSet

DIGITAL: Final = frozenset(
    (
        "SERCOS",
        "AX2000_B200",
        "SIMO611U",
        "CANOPEN_LENZE",
        "DS402_MDP742",
        "KL2531",
        "KL2532",
        "TCOM_DRV",
        "MDP_733",
        "MDP_703",
    )
)
"""Types that take an absolute velocity value, which `drv.output_scaling_velocity` scales (NC-343)."""
VELOCITY_UNITS: Final = 6.0
"""Output Scaling Factor (Velocity) at which a digital drive of this product runs at the commanded velocity:
its default.
"""


class Delay:
    """A value that acts some cycles later.

    Args:
        time: Delay, s; 0 for none.
        cycle_s: Cycle, s.

    """

    def __init__(self, time: Cell[float], cycle_s: float) -> None:
        self._time = time
        self._cycle_s = cycle_s
        self._kept: list[float] = []
        self._at = 0

    def step(self, value: float) -> float:
        """Take the value of this cycle; returns that of `time` ago (NC-340)."""
        time = self._time.value
        kept = self._kept
        if time <= 0.0:
            if kept:
                self._kept = []
            return value
        cycles = max(1, round(time / self._cycle_s))
        if len(kept) != cycles:
            kept = self._kept = [value] * cycles
            self._at = 0
        at = self._at
        result = kept[at]
        kept[at] = value
        self._at = (at + 1) % cycles
        return result


class Drive:
    """Output of an axis to a drive that takes velocities.

    Args:
        parameters: Parameters of the axis.
        cycle_s: Cycle of the axis, s.

    """

    def __init__(self, parameters: ParameterSet, *, cycle_s: float) -> None:
        cell = parameters.cell
        self._reference = cell("axis.reference_velocity")
        self._ratio = cell("drv.output_ratio")
        self._inverted = cell("drv.invert_motor_polarity")
        self._low = cell("drv.output_limit_min")
        self._high = cell("drv.output_limit_max")
        self._drift = cell("drv.drift_compensation")
        self._scaling = cell("drv.output_scaling_velocity")
        self._control_limit = cell("ctrl.output_limit")
        self._digital = parameters.read("drv.type") in DIGITAL
        self._delay = Delay(cell("drv.output_delay_velocity"), cycle_s)
        self.output = 0.0
        """Share of full scale, -1 to 1."""
        self.control = 0.0
        """Share of the position controller in it, limited, position unit/s."""
        self.total = 0.0
        """Velocity output before the limits of the output, position unit/s (NC-428)."""

    @property
    def full(self) -> float:
        """Velocity of full scale, position unit/s (NC-336)."""
        return self._reference.value / self._ratio.value

    def step(self, feedforward: float, control: float) -> float:
        """Form the output of this cycle.

        Args:
            feedforward: Velocity and acceleration feedforward, position unit/s.
            control: Output of the position controller, position unit/s.

        Returns:
            Velocity for the drive, position unit/s, with the sign of its motor.

        """
        full = self.full
        limit = self._control_limit.value * full
        control = limit if control > limit else max(control, -limit)
        self.control = control
        self.total = total = feedforward + control + self._drift.value
        share = total / full
        low, high = self._low.value, self._high.value
        share = low if share < low else min(share, high)
        share = self._delay.step(share)
        if self._inverted.value:
            share = -share
        self.output = share
        # An analog output carries the reference velocity at the output ratio; a digital one the velocity
        # itself.
        velocity = share * full
        return velocity * self._scaling.value / VELOCITY_UNITS if self._digital else velocity

    def raw(self, share: float) -> float:
        """Output a fixed share of full scale without position control (NC-241); returns the velocity."""
        return self.step(share * self.full, 0.0)

    def off(self) -> None:
        """Output nothing."""
        self.output = self.control = self.total = 0.0
