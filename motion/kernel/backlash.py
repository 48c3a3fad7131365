"""Backlash compensation of a motor encoder (CFG section 26).

Axis position = motor position + offset; the offset is 0 after positive motion and the size of the backlash
after negative motion. While the axis is position-controlled, a reversal of the setpoint moves the offset to
its other end, and the control difference that this makes lets the motor pass the backlash. Otherwise, and
while another encoder is in control, the offset follows the motor: the position stays while the motor moves
within the backlash.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from motion.kernel.feedback import VALID
from motion.kernel.mechanics import INCREMENTAL

if TYPE_CHECKING:
    from motion.kernel.cell import Cell
    from motion.kernel.feedback import Feedback


@dataclass(frozen=True, kw_only=True)
class BacklashSettings:
    """How a backlash is compensated.

    Args:
        enabled: Whether it is.
        size: Its size, position unit.
        velocity: Velocity with which the offset changes, position unit/s; 0 = at once.
        homing_direction: 0: the flank of positive motion was touched when an absolute encoder was adjusted.

    """

    enabled: Cell[bool]
    size: Cell[float]
    velocity: Cell[float]
    homing_direction: Cell[int]


class Backlash:
    """The compensation of one encoder; `step` runs once per cycle after the encoder has been read.

    Args:
        feedback: The encoder.
        settings: How it is compensated.
        cycle_s: Servo cycle, s.
        adjusted: An absolute encoder that has been adjusted: it is known which
            flank was touched then (CFG-568).

    """

    def __init__(
        self, feedback: Feedback, settings: BacklashSettings, *, cycle_s: float, adjusted: bool
    ) -> None:
        self.feedback = feedback
        self.enabled = settings.enabled
        """Whether the backlash is compensated."""
        self.used = False
        """It has been enabled, so that `step` has to notice its end."""
        self._cycle = cycle_s
        self._size = settings.size
        self._velocity = settings.velocity
        self._homing_direction = settings.homing_direction
        self._seen = (self.enabled.value, self._size.value)
        self.passing = False
        """The motor passes the backlash (`StatusWord2.X2`)."""
        self._begin(feedback.travel)
        self._waits = True
        if adjusted and feedback.scale.kind != INCREMENTAL:
            self._assume_flank()

    def _assume_flank(self) -> None:
        """Take it that the flank is the one that was touched when the absolute
        encoder was adjusted (CFG-568).
        """
        self._armed = True
        self._direction = 1.0 if self._homing_direction.value == 0 else -1.0
        self._offset = 0.0 if self._direction > 0.0 else self._size.value
        self._base = -self._offset

    def _begin(self, motor: float) -> None:
        """Wait until the whole backlash has been passed in one direction: before,
        nobody knows which flank is touched.
        """
        self._armed = False
        self._first = self._last = motor
        self._offset = self._base = self._rest = 0.0
        self.feedback.compensation = 0.0
        self._restarts = self.feedback.source.encoder_restarts
        self._direction = 0.0
        self.passing = False
        self._waits = False

    def step(self, velocity: float | None) -> bool:
        """Correct the position of this cycle.

        Args:
            velocity: Velocity setpoint while the position is controlled with this encoder, position unit/s;
                else None.

        Returns:
            Whether the settings have changed, so that positions mean something else now (CFG-551).

        """
        changed = False
        feedback = self.feedback
        motor = feedback.travel
        settings = (self.enabled.value, self._size.value)
        if settings != self._seen:
            self._seen = settings
            self._begin(motor)
            changed = True
        elif feedback.source.encoder_restarts != self._restarts:
            self._begin(motor)
        self.used = settings[0]
        if not self.used:
            return changed
        if self._waits:
            if feedback.state != VALID:
                return changed
            self._waits = False
            self._first = self._last = motor  # the first value is no way that the motor has gone
        moved = motor - self._last
        self._last = motor
        if feedback.compensation != self._base + self._offset:
            self._base = -self._offset  # `Feedback.keep_offset` has made it a part of the relation
        if self._armed:
            if velocity is not None:
                self._by_setpoint(velocity, moved)
            else:
                self._by_motor(moved)
        else:
            self._arm(motor, moved)
        feedback.compensation = compensation = self._base + self._offset
        feedback.position += compensation
        return changed

    def _arm(self, motor: float, moved: float) -> None:
        size = self._size.value
        if moved * (motor - self._first) < 0.0 or moved * (self._last - moved - self._first) < 0.0:
            self._first = self._last - moved  # it turned round: what counts is the way in one direction
        way = motor - self._first
        if abs(way) >= size and way:
            self._armed = True
            self._direction = 1.0 if way > 0.0 else -1.0
            self._offset = 0.0 if way > 0.0 else size
            self._base = -self._offset

    def _by_setpoint(self, velocity: float, moved: float) -> None:
        size = self._size.value
        direction = self._direction
        if velocity * direction < 0.0:
            self._direction = direction = -direction
            self.passing = size > 0.0
            self._rest = size
        if self.passing:
            self._rest -= moved * direction
            self.passing = self._rest > 1e-9 * size
        end = 0.0 if direction > 0.0 else size
        if self._offset != end:
            rate = self._velocity.value
            step = rate * self._cycle if rate > 0.0 else size
            gap = end - self._offset
            self._offset = end if abs(gap) <= step else self._offset + (step if gap > 0.0 else -step)

    def _by_motor(self, moved: float) -> None:
        size = self._size.value
        self._offset = offset = min(max(self._offset - moved, 0.0), size)
        self.passing = 0.0 < offset < size
        if moved:
            self._direction = 1.0 if moved > 0.0 else -1.0
