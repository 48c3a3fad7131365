"""Profile position mode: handshake, buffer of one setpoint, linear and rotary axes, four profiles (C402-091
to C402-095).
"""

from __future__ import annotations

from typing import Final, NamedTuple

from typing_extensions import override

from emulators.drive.cia402.axis import UNLIMITED, ProfileAxis
from emulators.drive.cia402.modes._base import BIT_10, BIT_12, BIT_13, ModeOfOperation
from emulators.drive.protection import WindowTimer
from emulators.drive.ramp import STEEPNESS, ProfileForm

_NEW_SETPOINT: Final = 0x10
_IMMEDIATELY: Final = 0x20
_RELATIVE: Final = 0x40
_PASS: Final = 0x200
_ONLY_NEGATIVE: Final = 1
_ONLY_POSITIVE: Final = 2
_SHORTEST: Final = 3
_STEEPEST: Final = 1e9
"""rad/s^2 that stand for "no limit"."""


class _SetPoint(NamedTuple):
    position: int
    angle: float
    velocity: float
    acceleration: float
    deceleration: float
    form: ProfileForm
    end_velocity: float


class ProfilePosition(ModeOfOperation):
    """pp: point-to-point motion made by the drive."""

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
        self._target: int | None = None
        self._target_angle = 0.0
        self._word = 0

    @override
    def enter(self) -> None:
        super().enter()
        self._forget()

    @override
    def leave(self) -> None:
        super().leave()
        self._forget()

    def _forget(self) -> None:
        """Give all setpoints up. Until the next one the target is the
        demand: where a motion comes to rest.
        """
        self._current = self._next = None
        self._acknowledge = self._held = False
        self._arrived = True
        self._target = None

    def control(self, word: int, changed: int) -> None:
        """Take a setpoint with a rising edge of bit 4."""
        self._word = word
        if word & changed & _NEW_SETPOINT:
            if self.axis.halted and self.axis.config.quirks.halt_blocks_acknowledge:
                self._held = True
            else:
                self._take(word)
        elif not word & _NEW_SETPOINT and self._next is None:
            self._acknowledge = False
        self._update_status()

    @override
    def cycle(self) -> None:
        profile = self.axis.core.profile
        if self._current is not None:
            if self._next is not None and (profile.raw_done if self._passes else profile.done):
                self._start(self._next)
                self._next = None
                if not self._word & _NEW_SETPOINT:
                    self._acknowledge = False
            elif profile.raw_done and profile.velocity != 0.0 and self._current.end_velocity > 0.0:
                # Nothing follows the end velocity: come to rest behind the target.
                mean = self._current.deceleration / STEEPNESS[self._current.form.shape]
                rest = profile.position + 0.5 * profile.velocity * abs(profile.velocity) / mean
                self._current = self._current._replace(angle=rest, end_velocity=0.0)
                self._move(self._current)
            elif profile.done:
                self._current = None
                self._arrived = True
        self._update_status()

    @override
    def stopped(self) -> None:
        self.status = (BIT_12 if self._acknowledge else 0) | (0 if self.axis.core.stopping else BIT_10)

    def resume(self) -> None:
        """Go on to the interrupted setpoint (C402-076)."""
        if self._held:
            self._held = False
            if self._word & _NEW_SETPOINT:
                self._current = self._next = None
                self._take(self._word)
                return
        if self._current is None:
            self.rest()
        else:
            self._start(self._current)
            self._pass_by()

    # -- setpoints ------------------------------------------------------------------------------------

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
        self._target_angle = set_point.angle
        if self._current is None or word & _IMMEDIATELY:
            self._start(set_point)
            return
        self._next = set_point
        self._passes = bool(word & _PASS)
        self._pass_by()

    def _pass_by(self) -> None:
        """Go past the present target with its velocity, if the waiting setpoint asks for it."""
        current = self._current
        if self._next is not None and current is not None and self._passes and not self.axis.halted:
            self._move(current._replace(end_velocity=current.velocity))

    def _read(self, word: int) -> _SetPoint:
        axis = self.axis
        values = axis.values
        units = axis.units
        position, angle = self._destination(word)
        return _SetPoint(
            position=position,
            angle=angle,
            velocity=min(values[0x608100] * units.velocity, axis.max_speed),
            acceleration=min(axis.acceleration(0x6083, 0x60C5), _STEEPEST),
            deceleration=min(axis.acceleration(0x6084, 0x60C6), _STEEPEST),
            form=axis.profile_form(),
            end_velocity=values[0x608200] * units.velocity,
        )

    def _destination(self, word: int) -> tuple[int, float]:
        """Return where 607Ah leads to, in position units and as motor angle (C402-093, C402-094)."""
        axis = self.axis
        units = axis.units
        option = axis.values[0x60F200]
        wanted = axis.values[0x607A00]
        if word & _RELATIVE:
            origin = option & 3
            if origin == 2:
                start, start_angle = axis.actual_position, axis.core.position
            elif origin == 1:
                start, start_angle = axis.demand_position, axis.core.position_command
            elif self._target is None:
                start, start_angle = axis.commanded_position, axis.core.position_command
            else:
                start, start_angle = self._target, self._target_angle
            position = axis.within_software_limits(start + wanted)
            self.limited = position != start + wanted
            if not units.turn:
                return position, axis.angle_of(position)
            # On a rotary axis the way counts, also over several turns.
            near = start_angle + (position - start) * units.position * units.position_sign
            return units.wrap(position), axis.angle_of(units.wrap(position), near)
        position = axis.within_software_limits(wanted)
        self.limited = position != wanted
        if not units.turn:
            return position, axis.angle_of(position)
        start = axis.commanded_position
        way = position - start
        direction = option >> 6 & 3
        if direction == _ONLY_NEGATIVE:
            way = -(-way % units.turn)
        elif direction == _ONLY_POSITIVE:
            way %= units.turn
        elif direction == _SHORTEST:
            way = units.difference(position, start)
        near = axis.core.position_command + way * units.position * units.position_sign
        return position, axis.angle_of(position, near)

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
        speed = min(set_point.velocity, axis.forward_speed if distance >= 0.0 else -axis.backward_speed)
        if blocked or not speed > 0.0:
            # There is no way to this target, and none of those behind it would ever be reached in its turn.
            self.limited = True
            self._current = self._next = None
            if not self._word & _NEW_SETPOINT:
                self._acknowledge = False
            self.rest()
            return
        axis.core.follow_profile().move(
            set_point.angle,
            velocity=speed,
            acceleration=set_point.acceleration,
            deceleration=set_point.deceleration,
            end_velocity=set_point.end_velocity,
            form=set_point.form,
        )

    def _update_status(self) -> None:
        axis = self.axis
        values = axis.values
        status = BIT_12 if self._acknowledge else 0
        if self.following_error:
            status |= BIT_13
        window = values[0x606700]
        if self._target is None:
            reached = axis.core.precontrol_velocity == 0.0
        elif window == UNLIMITED:
            reached = self._arrived
        else:
            self._window.time_s = values[0x606800] * 1e-3
            inside = abs(axis.units.difference(self._target, axis.actual_position)) <= window
            reached = self._window.update(inside, axis.control_period_s)
        if reached and self._next is None:
            status |= BIT_10
        self.status = status
