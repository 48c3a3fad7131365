"""Interpolated position mode (C402-083, C402-099, C402-172)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from typing_extensions import override

from emulators.drive.cia402.axis import UNLIMITED, ProfileAxis
from emulators.drive.cia402.modes._base import BIT_10, BIT_12, BIT_13, ModeOfOperation
from emulators.drive.cia402.modes._interpolation_buffer import InterpolationBuffer
from emulators.drive.cia402.modes._position_follower import PositionFollower
from emulators.drive.protection import WindowTimer

_ENABLE: Final = 0x10


class InterpolatedPosition(ModeOfOperation):
    """ip: one setpoint of the buffer in every period 60C2h, joined by straight lines, while bit 4 is 1.

    With SYNC the periods begin at every SYNC, without one the drive counts them. When no setpoint waits, the
    axis holds the last one, bit 12 is 0, and a warning says so; the next setpoint resumes the motion. While a
    halt lasts, the setpoints run out unseen. Limits and the offsets 60B1h and 60B2h act as in csp.
    """

    number = 7

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._follower = PositionFollower(axis)
        self.buffer = InterpolationBuffer()
        self.on_empty: Callable[[bool], None] | None = None
        """Called with True when the buffer has run empty, with False when that is over."""
        self.starved = False
        """The axis waits for a setpoint in the middle of an interpolation."""
        self._active = False
        self._elapsed = 0.0
        self._last: int | None = None
        self._word = 0
        self._arrival = WindowTimer()

    @property
    def torque_offset(self) -> float:
        """Torque that the mode adds to the demand, Nm: 60B2h."""
        units = self.axis.units
        return float(self.axis.values[0x60B200] * units.torque * units.torque_sign)

    @override
    def enter(self) -> None:
        self._word = self.axis.control_word
        self._interrupt()

    @override
    def leave(self) -> None:
        super().leave()
        self._active = False
        self._starve(False)

    def control(self, word: int, changed: int) -> None:
        """Enable the interpolation with bit 4, or hold the axis."""
        self._word = word
        if changed & _ENABLE and not word & _ENABLE:
            self._interrupt()

    @override
    def sync(self) -> None:
        self._next()

    @override
    def cycle(self) -> None:
        axis = self.axis
        if not axis.synchronised:
            if self._elapsed > axis.period_s - 0.5 * axis.control_period_s:
                self._next()
            self._elapsed += axis.control_period_s
        status = BIT_12 if self._active else 0
        if self.following_error:
            status |= BIT_13
        core = axis.core
        slow = core.standstill_speed
        resting = (
            not self._active
            and abs(self._follower.velocity) <= slow
            and abs(core.precontrol_velocity) <= slow
        )
        window = axis.values[0x606700]
        if window != UNLIMITED:
            self._arrival.time_s = axis.values[0x606800] * 1e-3
            target = axis.commanded_position if self._last is None else self._last
            inside = resting and abs(axis.units.difference(target, axis.actual_position)) <= window
            resting = self._arrival.update(inside, axis.control_period_s)
        self.status = status | BIT_10 if resting else status

    def stopped(self) -> None:
        """Let the setpoints of a halt run out: they are not resumed (C402-076)."""
        axis = self.axis
        self._active = False
        if self._word & _ENABLE and axis.halted:
            self._elapsed += axis.control_period_s
            if self._elapsed > axis.period_s - 0.5 * axis.control_period_s:
                self._elapsed = 0.0
                self.buffer.take()
        self.status = 0 if axis.core.stopping else BIT_10

    def _next(self) -> None:
        """Begin a period: with the next setpoint, or on the way to the last one."""
        if not self._word & _ENABLE:
            return
        axis = self.axis
        self._elapsed = 0.0
        position = self.buffer.take()
        if position is None:
            if self._active:
                self._active = False
                self._starve(True)
            if self._last is not None:
                self.limited = self._follower.go_to(self._last, axis.period_steps)
            return
        if self._last is None:
            self._follower.restart(axis.core.precontrol_velocity)
        self._last = position
        self._active = True
        self._starve(False)
        self.limited = self._follower.go_to(position, axis.period_steps)

    def _interrupt(self) -> None:
        """Brake and hold; the next setpoint begins a period of its own."""
        self.rest()
        self._active = False
        self._last = None
        self._follower.velocity = 0.0
        self._elapsed = self.axis.period_s
        self._arrival.reset()
        self._starve(False)

    def _starve(self, starved: bool) -> None:
        if starved is not self.starved:
            self.starved = starved
            if self.on_empty is not None:
                self.on_empty(starved)
