"""Homing mode (C402-105 to C402-141).

Switches are seen as the drive's inputs show them, at servo instants and behind the input filter; the index is
latched by the encoder. The mode moves the axis with the drive's own position profile, so that jerk limits and
following error monitoring hold.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from typing import Final

from typing_extensions import override

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.homing_methods import (
    NEGATIVE_LIMIT,
    POSITIVE_LIMIT,
    Here,
    Method,
    OnIndex,
    OnStop,
    OnSwitch,
    supported_methods,
)
from emulators.drive.cia402.modes._base import BIT_10, BIT_12, BIT_13, ModeOfOperation
from emulators.drive.protection import WindowTimer
from emulators.drive.ramp import TRAPEZOID

_FAR_RAD: Final = 1e6
"""A target that is never reached."""
_STEEPEST: Final = 1e9
"""rad/s^2 that stand for "no limit"."""

THRESHOLD: Final = 0x201001
DETECTION_TIME: Final = 0x201002
RETRACTION: Final = 0x201003
TIME_OUT: Final = 0x201004
SEARCH_DISTANCE: Final = 0x201005
"""Keys of the manufacturer's homing parameters (2010h)."""
_START: Final = 0x10
_LIMITS: Final = NEGATIVE_LIMIT | POSITIVE_LIMIT
_INDEX_TURNS: Final = 1.5
"""An index has to come within this many revolutions (C402-136)."""


class _Phase(Enum):
    IDLE = 0
    """Not started, interrupted, finished or failed."""
    SWITCH = 1
    INDEX = 2
    PRESS = 3
    """Against a hard stop."""
    RETRACT = 4
    ATTAINED = 5
    """The home position is known; the axis comes to rest or moves to zero."""


_HEEDING: Final = (_Phase.SWITCH, _Phase.INDEX, _Phase.ATTAINED)
"""Phases in which limit switches mean something; hard stops lie behind them."""


class Homing(ModeOfOperation):
    """hm: a rising edge of bit 4 starts a homing run by the method of 6098h."""

    number = 6

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._direction = 0
        """Where the axis moves: -1, +1, 0 = to rest."""
        self._slow = False
        self._fast_speed = self._slow_speed = 0.0
        self._acceleration = _STEEPEST
        self._form = TRAPEZOID
        self._methods = supported_methods(axis.config.homing)
        self._method: Method = Here()
        self._phase = _Phase.IDLE
        self._failed = self._succeeded = False
        self._zone: int | None = None
        self._turned = False
        self._inputs = 0
        self._origin = 0
        self._index: int | None = None
        self._elapsed_s = 0.0
        self._blocked = WindowTimer()
        self.on_homed: Callable[[bool], None] | None = None
        """Called at the end of every run that was not interrupted, with the success."""
        self.on_search_failed: Callable[[bool], None] | None = None
        """Called with True when a search has failed (EMCY 8612h), with False when that is over."""

    # -- mode ------------------------------------------------------------------------------------------

    @override
    def enter(self) -> None:
        self._reset()
        super().enter()
        self._update_status()

    @override
    def leave(self) -> None:
        self._reset()
        super().leave()

    def control(self, word: int, changed: int) -> None:
        """Start with a rising edge of bit 4; its falling edge interrupts (C402-134)."""
        if not changed & _START:
            return
        if not word & _START:
            self._interrupt()
        elif not self.axis.halted:
            self._start()
        self._update_status()

    @override
    def cycle(self) -> None:
        phase = self._phase
        if phase is _Phase.ATTAINED:
            self._settle_down()
        elif phase is not _Phase.IDLE:
            self._watch()
        self._update_status()

    @override
    def stopped(self) -> None:
        self._update_status()

    def resume(self) -> None:
        """Search again from where the axis stands; a home position that is known stays (C402-076)."""
        if self._phase is _Phase.IDLE:
            self.axis.core.hold_position()
        elif self._phase is _Phase.ATTAINED:
            self._attained()
        else:
            self._start()

    def inputs_changed(self) -> None:
        """Look at the inputs: at a servo instant, when the encoder shows the position that goes with them."""
        inputs = self.axis.inputs
        changed = inputs ^ self._inputs
        self._inputs = inputs
        method = self._method
        if self._phase not in _HEEDING or not self._direction or self.axis.halted:
            return
        reference = method.switch if isinstance(method, OnSwitch) else 0
        risen = changed & inputs & _LIMITS & ~reference
        if inputs & _LIMITS == _LIMITS or (risen and risen == self._wrong_limit()):
            self._fail()
            return
        if self._phase is _Phase.SWITCH and isinstance(method, OnSwitch) and changed & reference:
            self._pass_edge(method, bool(inputs & reference))
        self._heed_limits()

    # -- start and end ---------------------------------------------------------------------------------

    def _start(self) -> None:
        axis = self.axis
        self._reset()
        method = self._methods.get(axis.values[0x609800])
        if method is None:
            self._end(False)
            return
        self._method = method
        self._inputs = axis.inputs
        self._elapsed_s = 0.0
        self._origin = axis.core.encoder.increments
        self._read_dynamics()
        if isinstance(method, Here):
            self._take_home(self._origin)
        elif self._slow_speed <= 0.0 or (isinstance(method, OnSwitch) and self._fast_speed <= 0.0):
            self._fail()
        elif isinstance(method, OnSwitch):
            self._look_for_switch(method)
        elif isinstance(method, OnIndex):
            self._look_for_index(method.direction)
        elif axis.values[THRESHOLD]:
            self._phase = _Phase.PRESS
            self._press_against(method.direction)
        else:
            self._fail()  # without torque everything is a stop

    def _reset(self) -> None:
        """Forget the last run."""
        self._free_torque()
        self.axis.core.encoder.unwatch_zero_mark(self._on_index)
        if self._failed and self.on_search_failed is not None:
            self.on_search_failed(False)
        self._phase = _Phase.IDLE
        self._failed = self._succeeded = False
        self._direction = 0
        self._slow = False
        self._turned = False
        self._zone = None
        self._blocked.reset()

    def _interrupt(self) -> None:
        if self._phase is _Phase.IDLE:
            return
        known = self._phase is _Phase.ATTAINED
        self._reset()
        self._succeeded = known
        if not self.axis.halted:
            self._come_to_rest()

    def _fail(self) -> None:
        """End a search without result: bit 13, EMCY 8612h, stop with 609Ah (C402-137)."""
        self._reset()
        if not self.axis.halted:
            self._come_to_rest()
        self._end(False)
        if self.on_search_failed is not None:
            self.on_search_failed(True)

    def _end(self, success: bool) -> None:
        self._succeeded = success
        self._failed = not success
        if self.on_homed is not None:
            self.on_homed(success)

    def _take_home(self, increments: int) -> None:
        """Make a position (increments of the encoder) the home position."""
        axis = self.axis
        offset = axis.values[0x607C00]
        axis.set_home(increments, offset if axis.config.homing.offset == "vendor" else -offset)
        axis.homed = True
        self._end(True)
        self._attained()

    def _attained(self) -> None:
        """Come to rest, or go to position zero where that is wanted (C402-138)."""
        axis = self.axis
        self._phase = _Phase.ATTAINED
        if axis.config.homing.move == "zero" and self._slow_speed > 0.0:
            target = axis.angle_of(0)
            self._direction = 1 if target > axis.core.position_command else -1
            self._go_to(target, self._slow_speed)
            self._heed_limits()
        elif isinstance(self._method, Here):
            self._phase = _Phase.IDLE
        else:
            self._come_to_rest()

    def _settle_down(self) -> None:
        core = self.axis.core
        if core.profile.done if self._direction else not core.stopping:
            self._phase = _Phase.IDLE

    def _update_status(self) -> None:
        """C402-135."""
        resting = self._phase is _Phase.IDLE or self.axis.halted
        status = BIT_10 if resting and not self.axis.core.stopping else 0
        if self._succeeded:
            status |= BIT_12
        elif self._failed:
            status |= BIT_13
        self.status = status

    # -- switches --------------------------------------------------------------------------------------

    def _look_for_switch(self, method: OnSwitch) -> None:
        axis = self.axis
        inputs = axis.inputs
        if not axis.fitted_inputs & method.switch or inputs & _LIMITS == _LIMITS:
            self._fail()
            return
        if inputs & method.switch:
            self._zone = 0
        elif not method.start:
            self._zone = method.outside
        # Who stands on the switch and leaves it across the home edge does so slowly from the start.
        self._slow = self._zone == 0 == method.before
        self._phase = _Phase.SWITCH
        self._move(method.way(self._zone))
        self._heed_limits()

    def _pass_edge(self, method: OnSwitch, active: bool) -> None:
        """Note an edge of the switch, by the direction in which the load really moves."""
        velocity = self.axis.core.velocity
        moving = self._direction if velocity == 0.0 else 1 if velocity > 0.0 else -1
        before, after = (-moving, 0) if active else (0, moving)
        self._zone = after
        self._slow = True
        if (before, after) == (method.before, method.after):
            increments = self.axis.core.encoder.increments
            if method.index:
                self._look_for_index(method.direction)
            else:
                self._take_home(increments)
        else:
            self._move(method.way(after))

    def _heed_limits(self) -> None:
        """React to an active limit switch in the direction of motion (C402-136)."""
        method = self._method
        phase = self._phase
        if phase not in _HEEDING or not self._direction:
            return
        ahead = POSITIVE_LIMIT if self._direction > 0 else NEGATIVE_LIMIT
        search = method if phase is _Phase.SWITCH and isinstance(method, OnSwitch) else None
        if search is not None:
            ahead &= ~search.switch
        if not self._inputs & ahead:
            return
        if search is None or not search.start or self._turned:
            self._fail()
            return
        self._turned = True
        if self._zone != 0:
            self._zone = self._direction
        way = search.way(self._zone)
        if way == self._direction:
            self._fail()  # the home edge lies beyond the limit switch, or the home switch is stuck
        else:
            self._move(way)

    def _wrong_limit(self) -> int:
        """Return the limit switch that cannot come in this motion: it is behind the axis."""
        velocity = self.axis.core.velocity
        if self._direction > 0 and velocity > 0.0:
            return NEGATIVE_LIMIT
        if self._direction < 0 and velocity < 0.0:
            return POSITIVE_LIMIT
        return 0

    # -- index -----------------------------------------------------------------------------------------

    def _look_for_index(self, direction: int) -> None:
        self._phase = _Phase.INDEX
        self._index = None
        self._origin = self.axis.core.encoder.increments
        self.axis.core.encoder.watch_zero_mark(self._on_index)
        self._slow = True
        self._move(direction)
        self._heed_limits()

    def _on_index(self, increments: int, _before: float, _mark: float, _after: float) -> None:
        """Hold the first index; the servo step is not over yet."""
        if self._index is None:
            self._index = increments

    # -- hard stop -------------------------------------------------------------------------------------

    def _leave_stop(self, method: OnStop) -> None:
        axis = self.axis
        self._free_torque()
        self._blocked.reset()
        if method.index:
            self._look_for_index(-method.direction)
            return
        distance = axis.values[RETRACTION] * axis.units.position
        axis.core.hold_position()
        if distance:
            self._phase = _Phase.RETRACT
            self._go_to(axis.core.position_command - method.direction * distance, self._slow_speed)
        else:
            self._take_home(axis.core.encoder.increments)

    # -- every control cycle ---------------------------------------------------------------------------

    def _watch(self) -> None:
        axis = self.axis
        core = axis.core
        values = axis.values
        method = self._method
        if self._phase is _Phase.INDEX and self._index is not None:
            core.encoder.unwatch_zero_mark(self._on_index)
            self._take_home(self._index)
            return
        self._elapsed_s += axis.control_period_s
        travelled = abs(core.encoder.increments - self._origin)
        distance = values[SEARCH_DISTANCE] * axis.units.inc_numerator / axis.units.inc_denominator
        if (
            self._elapsed_s > (values[TIME_OUT] * 1e-3 or math.inf)
            or (distance and travelled > distance)
            or (self._phase is _Phase.INDEX and travelled > _INDEX_TURNS * core.encoder.counts_per_revolution)
        ):
            self._fail()
            return
        self._blocked.time_s = values[DETECTION_TIME] * 1e-3
        blocked = self._blocked.update(core.torque_limited and core.standing, axis.control_period_s)
        if self._phase is _Phase.PRESS and isinstance(method, OnStop):
            if blocked:
                self._leave_stop(method)
        elif blocked:
            self._fail()  # an end stop where none was expected
        elif self._phase is _Phase.RETRACT and core.profile.done and core.standing:
            self._take_home(core.encoder.increments)

    # -- motion ------------------------------------------------------------------------------------------

    def _read_dynamics(self) -> None:
        axis = self.axis
        values = axis.values
        self._fast_speed = min(float(values[0x609901]) * axis.units.velocity, axis.max_speed)
        self._slow_speed = min(float(values[0x609902]) * axis.units.velocity, axis.max_speed)
        self._acceleration = min(axis.acceleration(0x609A, 0x60C5), _STEEPEST)
        self._form = axis.profile_form()

    def _move(self, direction: int) -> None:
        """Move in a direction until the next command: fast, or slowly once an
        edge has been passed (C402-133).
        """
        self._direction = direction
        self._go_to(
            self.axis.core.position_command + direction * _FAR_RAD,
            self._slow_speed if self._slow else self._fast_speed,
        )

    def _go_to(self, angle: float, speed: float) -> None:
        """Move to an angle, rad, with a speed > 0, rad/s."""
        self.axis.core.follow_profile().move(
            angle,
            velocity=speed,
            acceleration=self._acceleration,
            deceleration=self._acceleration,
            form=self._form,
        )

    def _press_against(self, direction: int) -> None:
        """Move slowly against a stop, with no more torque than the threshold (C402-131)."""
        axis = self.axis
        axis.torque_cap = axis.values[THRESHOLD] * axis.units.torque
        axis.refresh()
        self._direction = direction
        # Velocity control: a position loop would wind up a following error at the stop.
        axis.core.ramp(direction * self._slow_speed, self._acceleration)

    def _free_torque(self) -> None:
        """End the limit of `_press_against`."""
        if self.axis.torque_cap is not None:
            self.axis.torque_cap = None
            self.axis.refresh()

    def _come_to_rest(self) -> None:
        self._direction = 0
        self.axis.core.stop(self._acceleration, track_position=True)
