"""Positioning with two speeds: fast travel, creep, brake, with a looping distance (section 19)."""

from __future__ import annotations

from struct import Struct
from typing import TYPE_CHECKING, Final

from motion.nc.errors import LOOPING_TOO_SMALL, NO_ERROR, VELOCITY_NOT_ALLOWED

if TYPE_CHECKING:
    from motion.nc.parameters import ParameterSet

IDLE: Final = 0
STANDS: Final = 20
"""Override 0 within a command (NC-653)."""
TRAVELS: Final = 21
PAUSES: Final = 22
"""From fast to slow travel."""
CREEPS: Final = 23
BRAKES: Final = 24
"""Until the brake is applied."""
_FAST_ABOVE: Final = 50.0
"""Commanded velocity and override in percent above which the axis travels fast (NC-610, NC-613)."""
_NO_OVERRIDE: Final = 0.01
"""Override that counts as 0 %, percent (NC-615)."""
_IMAGE: Final = Struct("<IIBBH")
_STOPPED: Final = (0x80, 0x80)
_RELEASED: Final = (0x40, 0x40)
_SPEEDS: Final = {
    (-1, True): (0x41, 0x49),
    (-1, False): (0x42, 0x45),
    (1, False): (0x44, 0x46),
    (1, True): (0x48, 0x4A),
}
"""Both control bytes by direction and speed (NC-637)."""
_SLACK: Final = 1e-9


class TwoSpeed:
    """Sequence of a two-speed axis.

    Args:
        parameters: Parameters of the axis.
        cycle_s: Cycle of the axis, s.

    """

    def __init__(self, parameters: ParameterSet, *, cycle_s: float) -> None:
        cell = parameters.cell
        self._cycle_s = cycle_s
        self._creep = {1: cell("drv.creep_distance_pos"), -1: cell("drv.creep_distance_neg")}
        self._braking = {1: cell("drv.braking_distance_pos"), -1: cell("drv.braking_distance_neg")}
        self._brake_delay = {1: cell("drv.brake_delay_pos"), -1: cell("drv.brake_delay_neg")}
        self._to_slow = cell("drv.delay_fast_to_slow")
        self._creep_stop = cell("drv.creep_distance_stop")
        self._release = cell("drv.brake_release_delay")
        self._looping = cell("drv.looping_enable")
        self._looping_distance = cell("drv.looping_distance")
        self._direction = 1
        self._target = 0.0
        self._approach: float | None = None
        """Target of the second leg; None: there is none."""
        self._velocity = 0.0
        self._timer = 0.0
        self._releasing = False
        self._stop_from: float | None = None
        """Position from which the creep distance of a stop counts; None: no stop."""
        self._stopping = False
        self.state = IDLE
        """`nAxisState`."""
        self.control_byte, self.ext_control_byte = _STOPPED

    @property
    def image(self) -> bytes:
        """The 12 byte for the drive (NC-619 to NC-635)."""
        return _IMAGE.pack(0, 0, self.control_byte, self.ext_control_byte, 0)

    @property
    def braked(self) -> bool:
        """Whether the brake is applied."""
        return self.control_byte & 0x80 != 0

    @property
    def _loop(self) -> float:
        return self._looping_distance.value if self._looping.value else 0.0

    def refusal(self, velocity: float) -> int:
        """Return the error code with which a command of a velocity is refused, 0 for none."""
        if velocity <= 0.0:
            return VELOCITY_NOT_ALLOWED
        loop = self._loop
        if loop and abs(loop) < max(self._braking[1].value, self._braking[-1].value):
            return LOOPING_TOO_SMALL
        return NO_ERROR

    @property
    def direction(self) -> int:
        """Direction in which it travels, -1 or 1; 0 while no speed is on."""
        return self._direction if self.control_byte & 0x0F else 0

    def abort(self) -> None:
        """Switch off and apply the brake at once."""
        self.state = IDLE
        self._approach = None
        self._releasing = False
        self._stop_from, self._stopping = None, False
        self.control_byte, self.ext_control_byte = _STOPPED

    def start(self, position: float, target: float, velocity: float) -> int:
        """Begin a motion to `target`; one that is not longer than the braking distance is over at once
        (NC-608).

        Args:
            position: Actual position, position unit.
            target: Where to, position unit.
            velocity: Commanded velocity: above 50 it travels fast.

        Returns:
            An error code, 0 for none.

        """
        refused = self.refusal(velocity)
        if refused:
            return refused
        loop = self._loop
        way = target - position
        direction = 1 if way > 0.0 else -1
        self.state = IDLE
        if abs(way) <= self._braking[direction].value:
            return NO_ERROR
        self._velocity = velocity
        self._direction = direction
        self._stop_from, self._stopping = None, False
        away = loop * direction > 0.0
        self._target = target + loop if away else target
        self._approach = target if away else None
        self._begin_release()
        return NO_ERROR

    def _begin_release(self) -> None:
        self.state = TRAVELS
        self._releasing = True
        self._timer = self._release.value
        self._off()

    def stop(self, position: float) -> None:
        """Stop soon, not exactly; no looping (NC-673 to NC-676)."""
        if self.state in {IDLE, BRAKES} and self._approach is None:
            return
        self._approach = None
        self._stopping = True
        if self.state == STANDS or self._releasing:
            self._releasing = False
            self._begin_brake()
        elif self.state == TRAVELS and self.control_byte in {0x41, 0x48}:
            self._begin_pause()
        elif self.state in {TRAVELS, CREEPS}:
            self._stop_from = position
            self._creep_on()

    def step(self, position: float, override: float) -> None:
        """Run one cycle.

        Args:
            position: Actual position, position unit.
            override: Override, percent.

        """
        if self.state in {TRAVELS, STANDS}:
            self._travel(position, override)
        elif self.state == PAUSES:
            if self._elapsed():
                if self._stopping:
                    self._stop_from = position
                self._creep_on()
                self._creep_to_end(position)
        elif self.state == CREEPS:
            self._creep_to_end(position)
        elif self.state == BRAKES and self._elapsed():
            if self._approach is not None:
                self._turn_back()
            else:
                self.state = IDLE
                self.control_byte, self.ext_control_byte = _STOPPED

    def _elapsed(self) -> bool:
        """Count the timer down by a cycle; returns whether its time is over."""
        self._timer -= self._cycle_s
        return self._timer <= _SLACK

    def _remaining(self, position: float) -> float:
        return (self._target - position) * self._direction

    def _travel(self, position: float, override: float) -> None:
        if override < _NO_OVERRIDE:
            self._stand()
            return
        if self.state == STANDS:
            self._begin_release()
            if self._timer > _SLACK:
                return
        elif self._releasing and not self._elapsed():
            return
        self._releasing = False
        self.state = TRAVELS
        remaining = self._remaining(position)
        if remaining <= self._braking[self._direction].value:
            self._begin_brake()
        elif remaining <= self._creep[self._direction].value:
            if self.control_byte in {0x41, 0x48}:
                self._begin_pause()
            else:
                self._creep_on()
        else:
            fast = self._velocity > _FAST_ABOVE and override > _FAST_ABOVE
            self._go(fast=fast)

    def _stand(self) -> None:
        if self.state != STANDS:
            self.state = STANDS
            self._releasing = False
            self._timer = self._brake_delay[self._direction].value
            if not self.braked:
                self._off()
        elif not self.braked and self._elapsed():
            self.control_byte, self.ext_control_byte = _STOPPED

    def _begin_pause(self) -> None:
        self.state = PAUSES
        self._timer = self._to_slow.value
        self._off()

    def _creep_on(self) -> None:
        self.state = CREEPS
        self._go(fast=False)

    def _creep_to_end(self, position: float) -> None:
        stopped = (
            self._stop_from is not None
            and (position - self._stop_from) * self._direction >= self._creep_stop.value
        )
        if stopped or self._remaining(position) <= self._braking[self._direction].value:
            self._begin_brake()

    def _begin_brake(self) -> None:
        self.state = BRAKES
        self._timer = self._brake_delay[self._direction].value
        self._off()

    def _turn_back(self) -> None:
        """Begin the second leg: slow travel towards the target (NC-671)."""
        assert self._approach is not None
        self._target, self._approach = self._approach, None
        self._direction = -self._direction
        self._creep_on()

    def _off(self) -> None:
        self.control_byte, self.ext_control_byte = _RELEASED

    def _go(self, *, fast: bool) -> None:
        self.control_byte, self.ext_control_byte = _SPEEDS[self._direction, fast]
