"""Profile position mode: handshake, buffer of one set-point, trapezoid or jerk-limited profile (C402-091 to C402-095)."""

from __future__ import annotations

from typing import Final, NamedTuple

from emulators.drive.cia402.axis import UNLIMITED, ProfileAxis
from emulators.drive.cia402.modes._base import BIT_10, BIT_12, BIT_13, ModeOfOperation
from emulators.drive.protection import WindowTimer

_NEW_SETPOINT: Final = 0x10
_IMMEDIATELY: Final = 0x20
_RELATIVE: Final = 0x40
_PASS: Final = 0x200
_STEEPEST: Final = 1e9
"""rad/s^2 that stand for "no limit"."""


class _SetPoint(NamedTuple):
    position: int
    angle: float
    velocity: float
    acceleration: float
    deceleration: float
    jerk: float
    end_velocity: float


class ProfilePosition(ModeOfOperation):
    """pp: point-to-point motion made by the drive."""

    __slots__ = (
        "_acknowledge",
        "_arrived",
        "_current",
        "_held",
        "_next",
        "_passes",
        "_target",
        "_window",
        "_word",
    )

    number = 1

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._window = WindowTimer()
        self._acknowledge = False
        self._arrived = True
        self._current: _SetPoint | None = None
        self._next: _SetPoint | None = None
        self._passes = False
        self._held = False
        self._target = 0
        self._word = 0

    def enter(self) -> None:
        """See `ModeOfOperation.enter`."""
        super().enter()
        self._current = self._next = None
        self._acknowledge = self._held = False
        self._arrived = True
        self._target = self.axis.actual_position

    def control(self, word: int, changed: int) -> None:
        """Take a set-point with a rising edge of bit 4."""
        self._word = word
        if word & changed & _NEW_SETPOINT:
            if self.axis.halted and self.axis.config.quirks.halt_blocks_acknowledge:
                self._held = True
            else:
                self._take(word)
        elif not word & _NEW_SETPOINT and self._next is None:
            self._acknowledge = False
        self._update_status()

    def cycle(self) -> None:
        """See `ModeOfOperation.cycle`."""
        profile = self.axis.core.profile
        if self._current is not None:
            if self._next is not None and (profile.raw_done if self._passes else profile.done):
                self._start(self._next)
                self._next = None
                if not self._word & _NEW_SETPOINT:
                    self._acknowledge = False
            elif profile.done:
                self._current = None
                self._arrived = True
            elif profile.raw_done and profile.velocity != 0.0 and self._current.end_velocity > 0.0:
                # Nothing follows the end velocity: come to rest behind the target.
                rest = (
                    profile.position
                    + 0.5 * profile.velocity * abs(profile.velocity) / self._current.deceleration
                )
                self._move(self._current._replace(angle=rest, end_velocity=0.0))
        self._update_status()

    def stopped(self) -> None:
        """See `ModeOfOperation.stopped`."""
        self.status = (BIT_12 if self._acknowledge else 0) | (0 if self.axis.core.stopping else BIT_10)

    def resume(self) -> None:
        """Go on to the interrupted set-point (C402-076)."""
        if self._held:
            self._held = False
            if self._word & _NEW_SETPOINT:
                self._current = self._next = None
                self._take(self._word)
                return
        if self._current is None:
            self.axis.core.hold_position()
        else:
            self._start(self._current)

    # -- set-points --------------------------------------------------------------------------------------------

    def _take(self, word: int) -> None:
        quirks = self.axis.config.quirks
        if not word & _IMMEDIATELY and (
            quirks.setpoint_needs_bit_5 or (quirks.single_setpoint and self._current is not None)
        ):
            return
        if self._next is not None:
            return  # the buffer is full: bit 12 has stayed 1, the edge is ignored
        set_point = self._read(word)
        self._acknowledge = True
        self._target = set_point.position
        if self._current is None or word & _IMMEDIATELY:
            self._start(set_point)
            return
        self._next = set_point
        self._passes = bool(word & _PASS)
        if self._passes and not self.axis.halted:
            self._move(self._current._replace(end_velocity=self._current.velocity))

    def _read(self, word: int) -> _SetPoint:
        axis = self.axis
        values = axis.values
        units = axis.units
        wanted = values[0x607A00]
        if word & _RELATIVE:
            origin = values[0x60F200] & 3
            wanted += (
                axis.actual_position if origin == 2 else axis.demand_position if origin == 1 else self._target
            )
        position = axis.within_software_limits(wanted)
        self.limited = position != wanted
        return _SetPoint(
            position=position,
            angle=axis.angle_of(position),
            velocity=min(values[0x608100] * units.velocity, axis.max_speed),
            acceleration=min(axis.acceleration(0x6083, 0x60C5), _STEEPEST),
            deceleration=min(axis.acceleration(0x6084, 0x60C6), _STEEPEST),
            jerk=axis.profile_jerk(),
            end_velocity=values[0x608200] * units.velocity,
        )

    def _start(self, set_point: _SetPoint) -> None:
        self._current = set_point
        self._arrived = False
        self._window.reset()
        if not self.axis.halted:
            self._move(set_point)

    def _move(self, set_point: _SetPoint) -> None:
        axis = self.axis
        distance = set_point.angle - axis.core.position_command
        blocked = (distance > 0.0 and axis.blocked_positive) or (distance < 0.0 and axis.blocked_negative)
        if blocked or not set_point.velocity > 0.0:
            self.limited = True
            self._current = None
            if blocked:
                axis.core.hold_position()
            return
        axis.core.follow_profile().move(
            set_point.angle,
            velocity=set_point.velocity,
            acceleration=set_point.acceleration,
            deceleration=set_point.deceleration,
            end_velocity=set_point.end_velocity,
            jerk=set_point.jerk,
        )

    def _update_status(self) -> None:
        axis = self.axis
        values = axis.values
        status = BIT_12 if self._acknowledge else 0
        if self.following_error:
            status |= BIT_13
        window = values[0x606700]
        if window == UNLIMITED:
            reached = self._arrived
        else:
            self._window.time_s = values[0x606800] * 1e-3
            inside = abs(self._target - axis.actual_position) <= window
            reached = self._window.update(inside, axis.control_period_s)
        if reached and self._next is None:
            status |= BIT_10
        self.status = status
