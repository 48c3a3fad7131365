"""The encoder component: from the counter of the device to actual position, velocity and acceleration
(section 12 of the specification).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor
from typing import TYPE_CHECKING, Final

from motion.nc.errors import ENCODER_OVERFLOW, ENCODER_UNDERFLOW, INITIALISATION, NO_ERROR
from motion.nc.filters import Pt1

if TYPE_CHECKING:
    from motion.nc.parameters import ParameterSet

INCREMENTAL: Final = 0
SINGLETURN: Final = 1
ABSOLUTE: Final = 2
MULTITURN_RANGE: Final = 3
SINGLETURN_RANGE: Final = 4
ABSOLUTE_MODULO: Final = 5
"""Index of the texts of `enc.reference_system`."""
_POSVELOACC: Final = 2
_SLACK: Final = 1e-9


@dataclass(frozen=True)
class Retained:
    """What is kept of an axis over power-off.

    Args:
        position: Position, position unit.
        raw: Count of the device that belonged to it.

    """

    position: float
    raw: int


def wrap(difference: int, span: int) -> int:
    """Return a difference of two counts in [-span / 2, span / 2) (NC-260)."""
    half = span // 2
    return (difference + half) % span - half


class Encoder:
    """Actual values of an axis.

    Args:
        parameters: Parameters of the axis.
        cycle_s: Cycle of the axis, s.
        io_cycle_s: Cycle of the fieldbus, s.
        signed: The device counts around zero; False: from 0 to the encoder mask.

    """

    def __init__(
        self, parameters: ParameterSet, *, cycle_s: float, io_cycle_s: float, signed: bool = False
    ) -> None:
        cell = parameters.cell
        self._parameters = parameters
        self._cycle_s = cycle_s
        self._io_cycle_s = io_cycle_s
        self._signed_count = signed
        self._invert = cell("enc.invert_counting_direction")
        self._numerator = cell("enc.scaling_numerator")
        self._denominator = cell("enc.scaling_denominator")
        self._bias = cell("enc.position_bias")
        self._mask = cell("enc.encoder_mask")
        self._sub_mask = cell("enc.encoder_sub_mask")
        self._reference_system = cell("enc.reference_system")
        self._mode = cell("enc.encoder_mode")
        self._modulo = cell("enc.modulo_factor")
        self._time_mode = cell("enc.time_comp_mode")
        self._time_absolute = cell("enc.time_comp_absolute")
        self._time_cycles = cell("enc.time_comp_cycles")
        self._time_additional = cell("enc.time_comp_additional")
        self._low_on = cell("axis.soft_limit_min_enable")
        self._low = cell("axis.soft_limit_min")
        self._high_on = cell("axis.soft_limit_max_enable")
        self._high = cell("axis.soft_limit_max")
        self._position_time = cell("enc.filter_time_position")
        self._position_filter = Pt1(cell("enc.filter_time_position"), cycle_s)
        self._velocity_time = cell("enc.filter_time_velocity")
        self._acceleration_filter = Pt1(cell("enc.filter_time_acceleration"), cycle_s)
        self._offset = 0.0
        self.started = False
        """The position has been defined."""
        self._unwrapped = 0
        self._range = 0
        self._last = 0.0
        self._last_velocity = 0.0
        self._filtered = 0.0
        """Filtered velocity, position unit/s."""
        self.hard_increments = 0
        """Count of the device."""
        self.soft_increments = 0
        """Count of the NC, with the overflows of the device."""
        self.correction = 0.0
        """Acting position correction, position unit."""
        self.uncorrected = 0.0
        """Position before correction and filter (NC-292)."""
        self.position = 0.0
        self.derivative = 0.0
        """Derivative of the position without filter, position unit/s."""
        self.velocity = 0.0
        self.acceleration = 0.0
        self.homed = False
        """The reference to the machine is known (`Homed`)."""
        # What `update` needs of the parameters, as of their last change.
        self._taken = -1
        self._span = 1
        self._half = 0
        self._inverted = False
        self._scale = 1.0
        self._origin = 0.0
        self._share = self._rest = 0.0
        self._derives = 0
        self._compensates = False
        self._smooths = False

    def _take_parameters(self) -> None:
        """Take over what has changed of the parameters."""
        self._taken = self._parameters.changes
        self._span = span = int(self._mask.value) + 1
        self._half = span // 2
        self._inverted = self._invert.value != 0.0
        self._scale = self._numerator.value / self._denominator.value
        self._origin = self._bias.value
        self._derives = int(self._mode.value)
        time = self._velocity_time.value
        self._share = self._cycle_s / (self._cycle_s + time) if time > 0.0 else 1.0
        self._rest = 1.0 - self._share
        self._compensates = self._time_mode.value != 0.0
        self._smooths = self._position_time.value > 0.0

    @property
    def scaling(self) -> float:
        """Position units per increment."""
        return self._numerator.value / self._denominator.value

    @property
    def span(self) -> int:
        """Increments after which the count of the device begins again."""
        return int(self._mask.value) + 1

    @property
    def turn(self) -> int:
        """Increments of a turn of the motor."""
        return int(self._sub_mask.value) + 1

    @property
    def overflows(self) -> int:
        """How often the count has gone beyond its range, signed."""
        return self.soft_increments // self.span

    def update(self, raw: int, correction: float = 0.0, age_s: float = 0.0) -> int:
        """Take over the count of this cycle; returns an error code, 0 for none.

        Args:
            raw: Count of the device.
            correction: Position correction, position unit.
            age_s: Time since the device took its value, by its time stamp, s; counts with
                `enc.time_comp_absolute` (NC-287).

        """
        error = NO_ERROR
        if self._taken != self._parameters.changes:
            self._take_parameters()
        if not self.started:
            error = self.begin(raw, None)
        step = raw - self.hard_increments
        if step:
            self.hard_increments = raw
            half = self._half
            step = (step + half) % self._span - half
            if self._range:
                self._unwrapped += step
                beyond = self._unwrapped // self._range
                if beyond:
                    error = self._beyond(beyond)
            self.soft_increments += -step if self._inverted else step
        cycle_s = self._cycle_s
        self.uncorrected = position = self.soft_increments * self._scale + self._origin + self._offset
        self.derivative = velocity = (position - self._last) / cycle_s
        self._last = position
        acceleration = (velocity - self._last_velocity) / cycle_s
        self._last_velocity = velocity
        derives = self._derives
        if derives:
            self.velocity = filtered = self._share * velocity + self._rest * self._filtered
            self._filtered = filtered
            if derives == _POSVELOACC:
                self.acceleration = self._acceleration_filter.step(acceleration)
            elif self.acceleration:
                self.acceleration = 0.0
        else:
            self.velocity = self.acceleration = 0.0
        if self._compensates:
            delay = self._time_cycles.value * self._io_cycle_s + self._time_additional.value * 1e-6
            if self._time_absolute.value:
                delay += age_s
            position += velocity * delay
            if self._time_mode.value > 1.0:
                position += 0.5 * acceleration * delay * delay
        self.correction = correction
        if self._smooths:
            self.position = self._position_filter.step(position) + correction
        else:
            self._position_filter.value = position
            self.position = position + correction
        return error

    def _beyond(self, overflows: int) -> int:
        """Return the error of overflows of an absolute count, signed: none is allowed, or a single one
        (NC-271, NC-274).
        """
        allowed = 0 if int(self._reference_system.value) == ABSOLUTE else 1
        if abs(overflows) <= allowed:
            return NO_ERROR
        return ENCODER_OVERFLOW if overflows > 0 else ENCODER_UNDERFLOW

    def begin(self, raw: int, retained: Retained | None) -> int:
        """Define the position from the first count after a start, and from what was kept (NC-268 to NC-279).

        Returns:
            An error code, 0 for none.

        """
        self.started = True
        self.hard_increments = raw
        sign = -1 if self._invert.value else 1
        self.soft_increments = sign * raw
        self._offset = 0.0
        system = int(self._reference_system.value)
        error = NO_ERROR
        self._range = self.turn if system == SINGLETURN_RANGE else self.span
        if system not in {ABSOLUTE, MULTITURN_RANGE, SINGLETURN_RANGE}:
            self._range = 0  # overflows are counted without end
        low = -(self.span // 2) if self._signed_count and system != SINGLETURN_RANGE else 0
        self._unwrapped = (raw - low) % self._range if self._range else 0
        self.homed = system in {ABSOLUTE, MULTITURN_RANGE, SINGLETURN_RANGE}
        if system in {MULTITURN_RANGE, SINGLETURN_RANGE}:
            if not self._place_in_range(self.span if system == MULTITURN_RANGE else self.turn):
                self.homed = False
                error = INITIALISATION
        elif system in {SINGLETURN, ABSOLUTE_MODULO} and retained is not None:
            moved = sign * wrap(wrap(raw - retained.raw, self.span), self.turn) * self.scaling
            position = retained.position + moved
            if system == ABSOLUTE_MODULO:
                position -= floor(position / self._modulo.value + _SLACK) * self._modulo.value
            self._offset = position - (self.soft_increments * self.scaling + self._bias.value)
            self.homed = True
        self._restart()
        return error

    def _place_in_range(self, span: int) -> bool:
        """Choose the turn of the count that lies between the end positions; False where there is none."""
        if not (self._low_on.value and self._high_on.value):
            return False
        low, high, length = self._low.value, self._high.value, span * self.scaling
        if not 0.0 < high - low < length:
            return False
        sign = -1 if self._invert.value else 1
        position = sign * (self.hard_increments % span) * self.scaling + self._bias.value
        position += floor((high - position) / length + _SLACK) * length
        if position < low - _SLACK:
            return False
        self._offset = position - (self.soft_increments * self.scaling + self._bias.value)
        return True

    def _restart(self) -> None:
        """Begin filters and differences at the present count."""
        position = self.soft_increments * self.scaling + self._bias.value + self._offset
        self._last = self._position_filter.value = position
        self._last_velocity = self._filtered = self._acceleration_filter.value = 0.0
        self.uncorrected = self.position = position

    def shift(self, offset: float) -> None:
        """Move the coordinate system so that the position grows by `offset`; velocities stay."""
        self._offset += offset
        self._last += offset
        self._position_filter.value += offset
        self.uncorrected += offset
        self.position += offset

    def position_of(self, raw: int) -> float:
        """Return the position of a count near the present one, for example a latched one (NC-313)."""
        step = wrap(raw - self.hard_increments, self.span)
        return self.uncorrected + (-step if self._invert.value else step) * self.scaling

    def raw_of(self, position: float) -> int:
        """Return the count at a position, for a drive that takes positions: signed 32 bit, wraps (NC-344,
        NC-416).
        """
        step = round((position - self.uncorrected) / self.scaling)
        count = self.hard_increments + (-step if self._invert.value else step)
        return (count + 0x80000000 & 0xFFFFFFFF) - 0x80000000

    def increments_to_units(self, increments: int) -> float:
        """Return a difference of counts as a way, position unit (NC-404)."""
        return (-increments if self._invert.value else increments) * self.scaling

    def retain(self) -> Retained:
        """Return what is to be kept over power-off."""
        return Retained(self.uncorrected, self.hard_increments)

    def modulo(self, position: float) -> tuple[int, float]:
        """Return turns and position within the turn; the turns of a negative position are negative
        (NC-267).
        """
        factor = self._modulo.value
        turns = floor(position / factor)
        return turns, position - turns * factor
