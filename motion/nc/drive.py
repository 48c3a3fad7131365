"""The drive component: from velocities to the output of the drive (section 14 of the specification)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.nc.filters import MovingAverage, Pt1, PTn

if TYPE_CHECKING:
    from motion.kernel.cell import Cell
    from motion.nc.parameters import ParameterSet
    from motion.nc.tables import Table, TableSpace

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


_MOVING_AVERAGE: Final = 1
_P_TN: Final = 2
"""Index of the texts of `drv.smoothing_type`."""
_WITH_ACCELERATION: Final = 2
"""Index of the text of `drv.time_comp_mode` with velocity and acceleration."""
FULL_TORQUE: Final = 100.0
"""Torque of full output, percent of the rated torque."""


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
    """Output of an axis: velocity, position or torque, and what goes with it.

    Args:
        parameters: Parameters of the axis.
        cycle_s: Cycle of the axis, s.
        saf_cycle_s: Cycle of the SAF task and of the fieldbus, s.
        tables: Tables of the NC, with the valve characteristics.

    """

    def __init__(
        self,
        parameters: ParameterSet,
        *,
        cycle_s: float,
        saf_cycle_s: float | None = None,
        tables: TableSpace | None = None,
    ) -> None:
        cell = parameters.cell
        self._parameters = parameters
        self._cycle_s = cycle_s
        self._saf_cycle_s = cycle_s if saf_cycle_s is None else saf_cycle_s
        self._tables = tables
        self._reference = cell("axis.reference_velocity")
        self._ratio = cell("drv.output_ratio")
        self._inverted = cell("drv.invert_motor_polarity")
        self._low = cell("drv.output_limit_min")
        self._high = cell("drv.output_limit_max")
        self._drift = cell("drv.drift_compensation")
        self._scaling = cell("drv.output_scaling_velocity")
        self._control_limit = cell("ctrl.output_limit")
        self.digital = parameters.read("drv.type") in DIGITAL
        """The drive takes an absolute velocity value."""
        self._delay_time = cell("drv.output_delay_velocity")
        self._delay = Delay(self._delay_time, cycle_s)
        self._delayed = False
        self._table_id = cell("drv.valve_table_id")
        self._table_interpolation = cell("drv.valve_interpolation")
        self._valve_offset = cell("drv.valve_offset")
        self._table_in_use = 0
        self._table: Table | None = None
        self._smoothing = cell("drv.smoothing_type")
        self._average = MovingAverage(cell("drv.smoothing_time"), cycle_s)
        self._stages = PTn(cell("drv.smoothing_time"), cell("drv.smoothing_order"), cycle_s)
        self._time_mode = cell("drv.time_comp_mode")
        self._time_absolute = cell("drv.time_comp_absolute")
        self._time_task = cell("drv.time_comp_task_cycles")
        self._time_cycles = cell("drv.time_comp_cycles")
        self._time_additional = cell("drv.time_comp_additional")
        self._torque_scaling = cell("drv.output_scaling_torque")
        self._torque_delay = Delay(cell("drv.output_delay_torque"), cycle_s)
        self._acceleration_scaling = cell("drv.output_scaling_acceleration")
        self._acceleration_delay = Delay(cell("drv.output_delay_acceleration"), cycle_s)
        self._torque_in_scaling = cell("drv.input_scaling_torque")
        self._torque_filter = Pt1(cell("drv.input_filter_torque"), cycle_s)
        self._derivative_filter = Pt1(cell("drv.input_filter_torque_derivative"), cycle_s)
        self.output = 0.0
        """Share of full scale, -1 to 1."""
        self.control = 0.0
        """Share of the position controller in it, limited, position unit/s."""
        self.total = 0.0
        """Velocity output before the limits of the output, position unit/s (NC-428)."""
        self.actual_torque = 0.0
        """`ActTorque`: actual torque of the device times its input scaling, filtered."""
        self.actual_torque_derivative = 0.0
        """`ActTorqueDerivative`, 1/s."""
        self.torque = 0.0
        """Torque output, scaled and delayed (`nDataOut4`)."""
        self.acceleration = 0.0
        """Acceleration output, scaled and delayed (`nDataOut3`)."""
        # What `step` needs of the parameters, as of their last change.
        self._taken = -1
        self._full = self._limit = self._bottom = self._top = self._added = 0.0
        self._negates = False
        self._shapes = False
        """The share goes through a table, an offset or a delay, or has done so."""

    def _take_parameters(self) -> None:
        """Take over what has changed of the parameters."""
        self._taken = self._parameters.changes
        self._full = full = self._reference.value / self._ratio.value
        self._limit = self._control_limit.value * full
        self._bottom, self._top = self._low.value, self._high.value
        self._added = self._drift.value
        self._negates = self._inverted.value != 0.0
        shapes = self._table_id.value or self._valve_offset.value or self._delay_time.value
        self._shapes = self._shapes or shapes != 0.0

    @property
    def full(self) -> float:
        """Velocity of full scale, position unit/s (NC-336)."""
        return self._reference.value / self._ratio.value

    @property
    def velocity_factor(self) -> float:
        """Output Scaling Factor (Velocity)."""
        return self._scaling.value

    def limited(self, control: float) -> float:
        """Return the output of the position controller within its limit, position unit/s (NC-554)."""
        limit = self._control_limit.value * self.full
        self.control = limit if control > limit else max(control, -limit)
        return self.control

    def step(self, feedforward: float, control: float) -> float:
        """Form the output of this cycle.

        Args:
            feedforward: Velocity and acceleration feedforward, position unit/s.
            control: Output of the position controller, position unit/s.

        Returns:
            Velocity for the drive, position unit/s, with the sign of its motor.

        """
        if self._taken != self._parameters.changes:
            self._take_parameters()
        full, limit = self._full, self._limit
        if control > limit:
            control = limit
        elif control < -limit:
            control = -limit
        self.control = control
        self.total = total = feedforward + control + self._added
        share = total / full
        low, high = self._bottom, self._top
        if self._shapes:
            share = self._shaped(share, low, high)
        elif share < low:
            share = low
        elif share > high:
            share = high
        if self._negates:
            share = -share
        self.output = share
        # An analog output carries the reference velocity at the output ratio; a digital one the velocity
        # itself.
        velocity = share * full
        return velocity * self._scaling.value / VELOCITY_UNITS if self.digital else velocity

    def _shaped(self, share: float, low: float, high: float) -> float:
        """Return a share of full scale behind valve characteristic, offset, limits and delay."""
        number = self._table_id.value
        if number or self._table_in_use:
            share = self._linearised(share, int(number))
        offset = self._valve_offset.value
        if offset:
            share += offset
        share = low if share < low else min(share, high)
        if self._delay_time.value or self._delayed:
            share = self._delay.step(share)
            self._delayed = self._delay_time.value > 0.0
        return share

    def _linearised(self, share: float, number: int) -> float:
        """Return the output of the valve characteristic (NC-353, NC-370)."""
        if number != self._table_in_use:
            self._table_in_use = number
            self._table = None if self._tables is None else self._tables.get(number, "valve")
        table = self._table
        return share if table is None else table.value(share, int(self._table_interpolation.value))

    def torque_step(self, torque: float) -> None:
        """Form the torque output of a torque controller.

        Args:
            torque: Output of the velocity controller, percent of the rated torque.

        """
        share = torque / FULL_TORQUE
        low, high = self._low.value, self._high.value
        share = low if share < low else min(share, high)
        if self._inverted.value:
            share = -share
        self.output = share
        self.total = torque
        self.give_torque(share * FULL_TORQUE)

    def give_torque(self, torque: float) -> None:
        """Output a torque, percent of the rated torque, scaled and delayed (NC-349, NC-350)."""
        self.torque = self._torque_delay.step(torque * self._torque_scaling.value)

    def give_acceleration(self, acceleration: float) -> None:
        """Output an acceleration, position unit/s2, scaled and delayed (NC-351, NC-352)."""
        self.acceleration = self._acceleration_delay.step(acceleration * self._acceleration_scaling.value)

    @property
    def feeds_forward(self) -> bool:
        """Whether torque or acceleration are output beside the setpoint (NC-369)."""
        return self._torque_scaling.value != 0.0 or self._acceleration_scaling.value != 0.0

    def take_torque(self, raw: float) -> None:
        """Take over the actual torque as the device sends it (NC-346 to NC-348)."""
        scaling = self._torque_in_scaling.value
        if scaling == 0.0:
            if self.actual_torque or self.actual_torque_derivative:
                self.actual_torque = self.actual_torque_derivative = 0.0
                self._torque_filter.value = self._derivative_filter.value = 0.0
            return
        before = self.actual_torque
        self.actual_torque = torque = self._torque_filter.step(raw * scaling)
        self.actual_torque_derivative = self._derivative_filter.step((torque - before) / self._cycle_s)

    def position(self, position: float, velocity: float, acceleration: float, stamp_s: float = 0.0) -> float:
        """Form the position output of this cycle: smoothed, then brought forward by the dead time (NC-364,
        NC-372).

        Args:
            position: Set position without the position correction, position unit.
            velocity: Position unit/s.
            acceleration: Position unit/s2.
            stamp_s: Time from now until the drive takes the setpoint over, by its time stamp, s; counts with
                `drv.time_comp_absolute` (NC-365).

        """
        smoothing = int(self._smoothing.value)
        if smoothing == _MOVING_AVERAGE:
            position = self._average.step(position)
        elif smoothing == _P_TN:
            position = self._stages.step(position)
        mode = int(self._time_mode.value)
        if mode:
            delay = self.dead_time(stamp_s)
            position += velocity * delay
            if mode == _WITH_ACCELERATION:
                position += 0.5 * acceleration * delay * delay
        return position

    def dead_time(self, stamp_s: float = 0.0) -> float:
        """Return the delay that is compensated, s (NC-365 to NC-368)."""
        cycle = self._saf_cycle_s
        delay = (self._time_task.value + self._time_cycles.value) * cycle + self._time_additional.value * 1e-6
        return delay + stamp_s if self._time_absolute.value else delay

    def raw(self, share: float) -> float:
        """Output a fixed share of full scale without position control (NC-241); returns the velocity."""
        return self.step(share * self.full, 0.0)

    def off(self) -> None:
        """Output nothing."""
        self.output = self.control = self.total = 0.0
        self.torque = self.acceleration = 0.0

    def restart(self) -> None:
        """Forget past positions: the loop closes anew."""
        self._average.reset()
        self._stages.reset()
