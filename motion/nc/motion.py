"""The setpoint generator of an axis: commands in their order, override, feed enables (sections 4.4, 7, 9).

The profiles are those of `motion.setpoint`: seven phases with limited jerk (NC-165).
"""

from __future__ import annotations

from math import cbrt, sqrt
from typing import TYPE_CHECKING, Final

from motion.nc.commands import CONTINUOUS, ENDLESS, POSITION, STOP, BufferMode, Command, CommandState
from motion.setpoint import MotionPhase, SetpointGenerator, plan_position

if TYPE_CHECKING:
    from motion.nc.parameters import ParameterSet

_REDUCED: Final = 0
"""Index of `Reduced (iterated)` in `axis.velocity_override_type`."""
STANDS: Final = 1e-9
"""Velocity, position unit/s, and way, position unit, that count as none."""


class Motion:
    """Setpoints of an axis from its commands.

    Args:
        parameters: Parameters of the axis.
        cycle_s: Cycle of the axis, s.

    """

    def __init__(self, parameters: ParameterSet, *, cycle_s: float) -> None:
        cell = parameters.cell
        self._cycle_s = cycle_s
        self._override_type = cell("axis.velocity_override_type")
        self._low_on = cell("axis.soft_limit_min_enable")
        self._low = cell("axis.soft_limit_min")
        self._high_on = cell("axis.soft_limit_max_enable")
        self._high = cell("axis.soft_limit_max")
        self.override = 1.0
        """Override, 0 to 1; `set_override` changes it."""
        self._peak = 0.0
        self._direction = 0.0
        self._passed = False
        """The active command has passed its target, and goes on with its end velocity."""
        self._count = 0
        self.offset = 0.0
        """What external setpoints and superposed motions add to the position, position unit."""
        self.offset_v = 0.0
        """What they add to the velocity, position unit/s."""
        self.offset_a = 0.0
        """What they add to the acceleration, position unit/s2."""
        self.generator = SetpointGenerator()
        self.plans = True
        """Commands are executed by the generator; False: by something else (a discrete axis)."""
        self.active: Command | None = None
        self.queue: list[Command] = []
        self.limits_off = False
        """Homing runs: the software limits do not count (NC-133)."""
        self.has_target = False
        """The last command had a target position, which the monitoring of windows needs."""
        self.target = 0.0
        """Target position of the active command, or of the last one, position unit."""
        self.stopped = False
        """The last motion was ended by a stop (`HasBeenStopped`)."""
        self.missed = False
        """The last target was given up: the axis is not there, and will not be."""
        self.new_target = False
        """A command with a target has begun; the axis clears it."""

    # -- state

    @property
    def s(self) -> float:
        """Set position, position unit."""
        return self.generator.s + self.offset

    @property
    def v(self) -> float:
        """Set velocity, position unit/s."""
        return self.generator.v + self.offset_v

    @property
    def a(self) -> float:
        """Set acceleration, position unit/s2."""
        return self.generator.a + self.offset_a

    @property
    def standing(self) -> bool:
        """Whether the set velocity is 0."""
        generator = self.generator
        return generator.done and -STANDS <= generator.v + self.offset_v <= STANDS

    @property
    def arrived(self) -> bool:
        """Whether the set position has reached the target."""
        generator = self.generator
        return (
            self.has_target
            and generator.done
            and -STANDS <= generator.v + self.offset_v <= STANDS
            and abs(generator.s + self.offset - self.target) <= STANDS
        )

    def set_offset(self, s: float, v: float, a: float) -> None:
        """Add external setpoints to those of the profile (NC-584)."""
        self.offset, self.offset_v, self.offset_a = s, v, a

    def take_offset(self, *, moving: bool = False) -> None:
        """Stand where profile and external setpoints have led, or go on with their velocity, for a stop that
        follows; a running command goes on from there.
        """
        active = self.active
        if active is None:
            self.generator.set_state(self.s, self.v if moving else 0.0)
        else:
            self.generator.shift(self.offset)
            self.target += self.offset
            if active.kind in {POSITION, CONTINUOUS}:
                active.target += self.offset
        self.set_offset(0.0, 0.0, 0.0)

    def watch(self, target: float) -> None:
        """Let the monitoring of windows wait for a target without a command (NC-566)."""
        self.target = target
        self.has_target = self.new_target = True
        self.stopped = False

    @property
    def last_target(self) -> float:
        """Where the commands so far will have led, position unit: what a buffered one begins at."""
        place = self.generator.s
        for command in (*(() if self.active is None else (self.active,)), *self.queue):
            if command.kind in {POSITION, CONTINUOUS}:
                place = place + command.target if command.relative else command.target
        return place

    @property
    def locked(self) -> bool:
        """Whether a stop keeps the axis from other commands (`MotionCommandsLocked`)."""
        active = self.active
        return active is not None and active.locks

    def axis_state(self, *, standing: bool) -> int:
        """Return `AxisState` of a continuous master (NC-473): 0 inactive, 1 running, 2 override zero, 3
        constant velocity, 4 acceleration, 5 deceleration.
        """
        if standing:
            if self.active is None:
                return 0
            return 2 if self.override <= 0.0 else 1
        phase = self.generator.phase
        if phase is MotionPhase.CONSTANT:
            return 3
        return 4 if phase is MotionPhase.ACCELERATING else 5

    # -- commands

    def submit(self, command: Command) -> None:
        """Take a command; the axis has checked that it may be given."""
        self._count += 1
        command.number = self._count
        if command.buffer_mode is BufferMode.Aborting or command.kind == STOP or self.active is None:
            for waiting in self.queue:
                waiting.state = CommandState.ABORTED
            self.queue.clear()
            if self.active is not None:
                self.active.state = CommandState.ABORTED
            self._begin(command)
            return
        self.queue.append(command)
        if len(self.queue) == 1:
            self._blend(self.active, command)

    def _begin(self, command: Command) -> None:
        """Make a command the active one."""
        before = self.active
        self.active = command
        command.state = CommandState.ACTIVE
        generator = self.generator
        self.missed = command.kind == STOP and (
            self.missed or (before is not None and before.kind == POSITION)
        )
        self.stopped = command.kind == STOP
        self.has_target = command.kind == POSITION
        if command.kind in {POSITION, CONTINUOUS}:
            if command.relative:
                command.target += generator.s
                command.relative = False
            self.target = command.target
            self.new_target = True
        self._peak = 0.0
        self._direction = 0.0
        self._passed = False
        if not self.plans:
            return
        if command.kind == STOP:
            generator.start_stop(command.deceleration, command.jerk)
            return
        self._find_peak(command)
        self._plan(command)

    def _find_peak(self, command: Command) -> None:
        """Find the highest velocity that the profile reaches at an override of 100 %."""
        if command.kind != POSITION:
            self._peak = command.velocity
            self._direction = command.target if command.kind == ENDLESS else 0.0
            if command.kind == CONTINUOUS:
                self._direction = 1.0 if command.target >= self.generator.s else -1.0
            return
        generator = self.generator
        profile = plan_position(
            generator.s,
            generator.v,
            generator.a,
            command.target,
            max_velocity=command.velocity,
            acceleration=command.acceleration,
            deceleration=command.deceleration,
            jerk=command.jerk,
        )
        peak = max((abs(phase.velocity) for phase in profile.phases), default=command.velocity)
        self._peak = min(peak, command.velocity) or command.velocity

    def _velocity(self, command: Command) -> float:
        """Return the velocity that the override leaves (NC-168, NC-169)."""
        override = self.override
        if int(self._override_type.value) == _REDUCED:
            return self._peak * override
        return min(command.velocity * override, self._peak)

    def _plan(self, command: Command) -> None:
        """Plan from the present state with the present override."""
        generator = self.generator
        acceleration, deceleration, jerk = command.acceleration, command.deceleration, command.jerk
        velocity = self._velocity(command)
        if velocity <= 0.0:
            generator.start_stop(deceleration, jerk)
        elif command.kind == POSITION or (command.kind == CONTINUOUS and command.end_velocity == 0.0):
            generator.start_position(command.target, velocity, acceleration, deceleration, jerk)
        elif command.kind == CONTINUOUS and not self._passed:
            self._plan_through(command, velocity)
        else:
            if command.kind == CONTINUOUS:
                velocity = command.end_velocity * self.override
            limit = self.limit_ahead(self._direction)
            if limit is None:
                generator.start_velocity(self._direction * velocity, acceleration, deceleration, jerk)
            else:
                # The axis goes as far as the limit and stands there (NC-130).
                generator.start_position(limit, velocity, acceleration, deceleration, jerk)

    def _plan_through(self, command: Command, velocity: float) -> None:
        """Plan a motion that passes its target with the end velocity, and goes on with it.

        Before the target it is a motion with `velocity`; when the way that is left is what the change to the
        end velocity takes, `step` starts that change.
        """
        self.generator.start_velocity(
            self._direction * velocity, command.acceleration, command.deceleration, command.jerk
        )

    def limit_ahead(self, direction: float) -> float | None:
        """Return the software limit in a direction; None: there is none that counts."""
        if self.limits_off:
            return None
        if direction > 0.0:
            return self._high.value if self._high_on.value else None
        return self._low.value if self._low_on.value else None

    def _blend(self, running: Command, following: Command) -> None:
        """Let a running command pass its target with the velocity that the buffer mode of the next one
        says.
        """
        mode = following.buffer_mode
        if mode <= BufferMode.Buffered or running.kind != POSITION or not self.plans:
            return
        velocity = {
            BufferMode.BlendingLow: min(running.velocity, following.velocity),
            BufferMode.BlendingPrevious: running.velocity,
            BufferMode.BlendingNext: following.velocity,
            BufferMode.BlendingHigh: max(running.velocity, following.velocity),
        }[mode]
        way = following.target if following.relative else following.target - running.target
        ahead = running.target - self.generator.s
        if following.kind not in {POSITION, CONTINUOUS} or way * ahead <= 0.0:
            return
        if following.kind == POSITION:
            # The target of the next one is not passed; two cycles are for the change at the joint.
            deceleration, jerk = following.deceleration, following.jerk
            room = abs(way) - 2.0 * self._cycle_s * _stoppable(abs(way), deceleration, jerk)
            velocity = min(velocity, _stoppable(max(room, 0.0), deceleration, jerk))
        running.kind = CONTINUOUS
        running.end_velocity = velocity
        self.has_target = False
        self._direction = 1.0 if ahead > 0.0 else -1.0
        self._peak = running.velocity
        self._plan(running)

    # -- a cycle

    def set_override(self, override: float) -> None:
        """Take over the override, 0 to 1; ramps keep their acceleration and jerk (NC-167)."""
        if override == self.override:
            return
        self.override = override
        active = self.active
        if active is not None and active.kind != STOP and self.plans and not self.arrived:
            self._plan(active)

    def step(self) -> None:
        """Form the setpoint of this cycle."""
        active = self.active
        if active is not None and active.kind == CONTINUOUS:
            self._pass_target(active)
        self.generator.advance(self._cycle_s)

    def _pass_target(self, command: Command) -> None:
        generator, dt = self.generator, self._cycle_s
        direction = self._direction
        left = (command.target - generator.s) * direction
        end = command.end_velocity * self.override
        if command.end_velocity == 0.0:  # it is planned to stand at the target
            command.in_velocity = self.standing and abs(left) <= STANDS
            if command.in_velocity and self.queue:
                self._end(command)
            return
        if self._passed or left <= abs(generator.v) * dt * 0.5 + STANDS:
            self._go_beyond(command, end)
            return
        if end and generator.target != direction * end:
            way = self._way_of_change(command, direction * end)
            if left <= way + abs(generator.v) * dt:
                generator.start_velocity(
                    direction * end, command.acceleration, command.deceleration, command.jerk
                )

    def _go_beyond(self, command: Command, end: float) -> None:
        """Begin the next command at the target, or go on with the end velocity, as far as a software limit
        (NC-130).
        """
        if self.queue:
            command.state = CommandState.DONE
            self._begin(self.queue.pop(0))
            self._blend_on()
            return
        if not self._passed:
            self._passed = True
            self._plan(command)
        command.in_velocity = end > 0.0 and abs(abs(self.generator.v) - end) <= 1e-6

    def _blend_on(self) -> None:
        if self.active is not None and self.queue:
            self._blend(self.active, self.queue[0])

    def _way_of_change(self, command: Command, velocity: float) -> float:
        """Return the way of the change to `velocity` from the present state, in the direction of motion."""
        from motion.setpoint import plan_velocity

        generator = self.generator
        profile = plan_velocity(
            generator.v,
            generator.a,
            velocity,
            acceleration=command.acceleration,
            deceleration=command.deceleration,
            jerk=command.jerk,
        )
        return profile.distance * self._direction

    def finish(self, active: Command, *, arrived: bool, in_target: bool) -> None:
        """End the active command where it has arrived; the next one begins.

        Args:
            active: The active command.
            arrived: The set position has reached the target.
            in_target: The actual position is where the monitoring of the target wants it.

        """
        generator = self.generator
        kind = active.kind
        if kind == ENDLESS:
            wanted = self._direction * self._velocity(active)
            active.in_velocity = generator.v == wanted and generator.a == 0.0
            if self.queue and (active.in_velocity or self.standing):
                self._end(active)
        elif kind == STOP:
            if self.standing:
                active.state = CommandState.DONE
                if not active.locks:
                    self.active = None
        elif kind == POSITION and arrived and in_target:
            self._end(active)

    def complete(self, command: Command) -> None:
        """End a command that something else has executed; the next one begins."""
        if self.active is not command:
            return
        if command.kind == STOP and command.locks:
            command.state = CommandState.DONE
        else:
            self._end(command)

    def _end(self, command: Command) -> None:
        command.state = CommandState.DONE
        self.active = None
        if self.queue:
            self._begin(self.queue.pop(0))
            self._blend_on()

    def stop(self, deceleration: float, jerk: float) -> None:
        """Stop without a command of its own, for example without feed enable; all commands are aborted."""
        self.abort(CommandState.ABORTED, 0)
        self.generator.start_stop(deceleration, jerk)
        self.has_target = False
        self.stopped = True

    def abort(self, state: CommandState, error_id: int) -> None:
        """End all commands."""
        active = self.active
        if active is not None and active.kind == POSITION:
            self.missed = True
        for command in (*self.queue, *(() if active is None else (active,))):
            if not command.ended:
                command.state = state
                command.error_id = error_id
        self.queue.clear()
        self.active = None

    def release(self, command: Command) -> None:
        """Unlock the axis after a stop."""
        command.locks = False
        if self.active is command and command.ended:
            self.active = None

    def place(self, position: float) -> None:
        """Stand at a position, for example the actual one; nothing moves."""
        self.set_offset(0.0, 0.0, 0.0)
        self.generator.set_state(position, 0.0)

    def shift(self, offset: float) -> None:
        """Move the coordinate system; a running motion goes on (NC-242)."""
        self.generator.shift(offset)
        self.target += offset
        active = self.active
        if active is not None and active.kind in {POSITION, CONTINUOUS}:
            active.target += offset


def _stoppable(way: float, deceleration: float, jerk: float) -> float:
    """Return the velocity from which a stop takes a way, position unit/s.

    Args:
        way: Position unit, 0 or more.
        deceleration: Position unit/s2.
        jerk: Position unit/s3; 0.0 for none.

    """
    if not jerk:
        return sqrt(2.0 * way * deceleration)
    rise = deceleration / jerk
    velocity = 0.5 * deceleration * (sqrt(rise * rise + 8.0 * way / deceleration) - rise)
    if velocity >= deceleration * rise:
        return velocity
    return cbrt(way * way * jerk)
