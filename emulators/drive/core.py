"""Servo core: the cascade of a drive, its ramp-function generator, pulse enable and brake. Knows no profile.

One step at servo instant k:

1. the mechanics moves from k-1 to k under the torque decided at k-1; the encoder is read;
2. the *setpoint source* yields the velocity pre-control for the end of the coming interval;
3. position P control (where a position is commanded), velocity PI control and torque pre-control give the
torque for k..k+1.

Pre-control is symmetric: the velocity controller compares the measured mean velocity of the last interval
with the mean demand of the same interval, and the torque pre-control is the inertia times the change of the
demand. With the default tuning an undisturbed axis therefore follows a drive-made ramp or an interpolated
velocity without lag.

The integral part sees only what a model of the undisturbed loop cannot explain, so that neither a step of the
demand nor the torque limit winds it up.

Closed velocity loop: `ServoTuning.velocity_time_constant_s` (T_vtc, default 2 ms) is inertia / proportional
gain. It is how fast a disturbance is countered; a velocity demand passes it as a first-order lag only where
the pre-control cannot know the acceleration: with `torque_feedforward=False`, and for the velocity that
follows from interpolated positions.

All quantities are those of the motor shaft: rad, rad/s, Nm, as the encoder shows them.
"""

from __future__ import annotations

import math
from typing import Final

from emulators.drive._servo_state import (
    POSITION,
    PROFILE,
    RAMP,
    SERVO,
    SMOOTHED,
    TORQUE,
    VELOCITY,
    ServoState,
)
from emulators.drive.ramp import PositionProfile
from emulators.drive.rounded_ramp import RoundedRamp, Rounding
from emulators.drive.tuning import RPM, ServoTuning

__all__ = ["RPM", "ServoCore", "ServoTuning"]

_HEADROOM: Final = 1.05
"""Share of the speed limit up to which the position controller may catch up: at the limit itself it needs
some room.
"""


class ServoCore(ServoState):
    """Cascade, ramp generator, pulse enable and brake on a plant and an encoder.

    Args:
        mechanics: The plant.
        encoder: The motor encoder.
        period_s: Servo period, s.
        tuning: Gains.
        brake: Holding brake; None = the motor has none.

    """

    __slots__ = ()

    def reinitialise(self) -> None:
        """Read the encoder anew, as after its power-on; pulses are inhibited."""
        self.inhibit_pulses()
        self.position = self._encoder.sample(self._mechanics.motor_angle)
        self.velocity = 0.0
        self._clear_setpoints()

    # -- commands
    # ----------------------------------------------------------------------------------------------

    def set_torque_limits(self, positive_Nm: float, negative_Nm: float) -> None:
        """Limit the torque to -negative..positive, Nm, both >= 0."""
        self._limit_high = positive_Nm
        self._limit_low = -negative_Nm

    def set_speed_limit(self, speed: float) -> None:
        """Limit the speed in torque control and while the position controller catches up, rad/s."""
        self._speed_limit = speed
        self._catching_up_limit = speed * _HEADROOM

    def enable_pulses(self) -> None:
        """Close the loops at the present position and release the brake.

        A standing axis starts with velocity zero, one that turns with its actual velocity.
        """
        self.enabled = True
        self._clear_setpoints()
        if not self.standing:
            self._feedforward = self._middle = self.velocity_demand = self.velocity
            self._model = self._predicted = self.velocity
        self.brake.open()

    def inhibit_pulses(self) -> None:
        """Take the torque away at once: the axis coasts; the brake closes at whatever speed."""
        self.enabled = False
        self._clear_setpoints()
        self.torque = self.torque_demand = 0.0
        self.brake.close()

    def command_velocity(self, target: float, steps: int) -> None:
        """Reach a velocity linearly within a number of servo steps (>= 1); rad/s."""
        source = self._velocity_source
        if self._source != source:
            self._take_over(source)
        self._velocity_target = target
        self._left = steps
        self._velocity_step = (
            target - (self._feedforward if source == VELOCITY else self._ramped_velocity)
        ) / steps

    def command_position(
        self, target: float, steps: int, *, precontrol: float | None = None, coast: int = 0
    ) -> None:
        """Reach a position linearly within a number of servo steps.

        Args:
            target: rad.
            steps: Servo steps, >= 1.
            precontrol: Velocity pre-control, rad/s; None = that of the way, by `velocity_feedforward`.
            coast: Servo steps for which the demand goes on beyond the target when nothing new comes.

        """
        if self._source != POSITION:
            self._take_over(POSITION)
        self._velocity_step = step = (target - self._next_position) / steps
        if precontrol is None:
            precontrol = step * self._inverse_period * self.tuning.velocity_feedforward
        self._velocity_target = precontrol
        self._position_target = target
        self._left = steps
        self._coast = self._coast_length = coast

    def command_servo(self, velocity: float, reference: float, gain: float, steps: int) -> None:
        """Close a position loop around a velocity that comes from outside: velocity + gain * (reference -
        position).

        The loop runs in every servo step (dynamic servo control, PD-195). Velocity and reference are reached
        linearly.

        Args:
            velocity: rad/s.
            reference: Position that the axis should have, rad.
            gain: 1/s, >= 0.
            steps: Servo steps, >= 1; 1 = at once.

        """
        if self._source != SERVO:
            self._take_over(SERVO)
        self._velocity_target = velocity
        self._velocity_step = (velocity - self._feedforward) / steps
        self._servo_gain = gain
        self._left = steps
        self._position_target = reference
        if steps == 1:
            self._next_position = reference
            self._reference_step = 0.0
        else:
            self._reference_step = (reference - self._next_position) / steps

    def hold_position(self) -> None:
        """Stay at the present position demand (the present position, if no position is controlled)."""
        self.command_position(self._next_position if self.controls_position else self.position, 1)

    def follow_profile(self) -> PositionProfile:
        """Take the demand from `profile`, which starts from the present demand when another source was
        active.
        """
        if self._source != PROFILE:
            self._take_over(PROFILE)
            self._profile.reset(self._next_position, self._feedforward)
        return self._profile

    def command_torque(self, torque_Nm: float, steps: int = 1) -> None:
        """Control the torque, limited by torque and speed limits.

        Args:
            torque_Nm: Torque, Nm.
            steps: Servo steps within which it is reached linearly; 1 = with the next one.

        """
        if self._source != TORQUE:
            present = self.torque_demand - self.torque_offset
            self._take_over(TORQUE)
            self._torque = present
        self._stop_pending = False
        self._velocity_target = torque_Nm
        self._velocity_step = (torque_Nm - self._torque) / steps
        self._left = steps

    def limited_torque(self, torque_Nm: float) -> float:
        """Return a torque within the torque limits, Nm."""
        return min(max(torque_Nm, self._limit_low), self._limit_high)

    def ramp(
        self,
        target: float,
        acceleration: float,
        *,
        deceleration: float | None = None,
        track_position: bool = False,
        rounded: RoundedRamp | None = None,
    ) -> None:
        """Reach a velocity with the drive's own ramp, starting from the present velocity.

        Args:
            target: rad/s.
            acceleration: Slope away from zero, rad/s^2, > 0; inf = at once.
            deceleration: Slope towards zero, rad/s^2; None = as `acceleration`.
            track_position: Whether the position controller takes part.
            rounded: A ramp with rounding, which has been told where to go; the slopes do not count then.

        """
        self._rounded = rounded
        if self._source != RAMP or track_position is not self._tracks_position:
            self._take_over(RAMP)
        self._tracks_position = track_position
        self._stop_pending = False
        self._velocity_target = target
        self._velocity_step = acceleration * self._period
        self._braking_step = (acceleration if deceleration is None else deceleration) * self._period

    def stop(
        self,
        slope: float,
        *,
        track_position: bool = False,
        rounded: tuple[RoundedRamp, Rounding] | None = None,
    ) -> None:
        """Ramp down to standstill from the actual speed and report it by `on_standstill`; slope in rad/s^2.

        A slope of infinity brakes at the torque limit; a ramp with rounding has its own slope.
        """
        if not (self._source == RAMP and self._stop_pending):
            self._feedforward = self._middle = self.velocity
        if rounded is not None:
            rounded[0].aim(self._feedforward, 0.0, rounded[1])
        self.ramp(0.0, slope, track_position=track_position, rounded=None if rounded is None else rounded[0])
        self._stop_pending = True
        self._standing_steps = self._stop_steps = 0

    def stop_torque(self, slope: float) -> None:
        """Take the torque to zero with a slope (Nm/s) and report by `on_standstill` when it is; the axis
        coasts.
        """
        present = self._torque if self._source == TORQUE else self.torque_demand - self.torque_offset
        steps = abs(present) / (slope * self._period) if slope > 0.0 else 0.0
        self.command_torque(0.0, max(1, math.ceil(steps - 1e-9)))
        self._stop_pending = True

    # -- one servo step
    # ----------------------------------------------------------------------------------------

    def step(self) -> None:
        """Advance plant and control by one servo period."""
        angle = self._sample(self._step_mechanics(self.torque, self._period))
        self.velocity = velocity = (angle - self.position) * self._inverse_period
        self.position = angle
        if not self.enabled:
            self.position_demand = angle
            if self.brake.busy:
                self.brake.step(self._period)
            return
        old = self._feedforward
        source = self._source
        if self._offset_left:
            self._offset_left = left = self._offset_left - 1
            self.torque_offset = self.torque_offset + self._offset_step if left else self._offset_target
        if source == VELOCITY:
            left = self._left
            if left:
                self._left = left = left - 1
                new = old + self._velocity_step if left else self._velocity_target
            else:
                new = old
            self.position_demand = angle
            wanted = self._middle
            self.velocity_demand = new
        elif source == SERVO:
            self.position_demand = demand = self._next_position
            left = self._left
            if left:
                self._left = left = left - 1
                if left:
                    new = old + self._velocity_step
                    self._next_position = demand + self._reference_step
                else:
                    new = self._velocity_target
                    self._next_position = self._position_target
            else:
                new = old
            correction = self._servo_gain * (demand - angle)
            wanted = self._middle + correction
            limit = self._catching_up_limit
            if -limit <= wanted <= limit:
                self.speed_limited = False
                self.velocity_demand = new + correction
            else:
                self.speed_limited = True
                self.velocity_demand = wanted = math.copysign(limit, wanted)
        else:
            wanted, new = self._other_source(source, old, angle)
            if self._switched_off():
                return  # a ramp has just ended and taken the pulses away: no torque from this step on
        self._feedforward = new
        self._middle = 0.5 * (old + new)
        step = new - old
        if source == TORQUE:
            torque = self._torque_command(velocity)
        else:
            torque = (
                self._proportional_gain * (wanted - velocity)
                + self._integral
                + self._inertia_per_step * step
                + self.torque_offset
            )
        if self._limit_low <= torque <= self._limit_high:
            self.torque_limited = False
            predicted = self._predicted
            self._integral += self._integral_gain * (predicted - velocity)
            step += self._model_share * (wanted - predicted)
            model = self._model
            self._predicted = model + 0.5 * step
            self._model = model + step
        else:
            # At the limit nothing is integrated, and the model follows what the torque can do.
            torque = self._limit_high if torque > 0.0 else self._limit_low
            self.torque_limited = True
            step = torque / self._inertia_per_step
            self._predicted = velocity + step
            self._model = velocity + 1.5 * step
        self.torque_demand = torque
        if self._lag:
            self.torque += (torque - self.torque) * self._lag
        else:
            self.torque = torque
        if self.brake.busy:
            self.brake.step(self._period)

    # -- inside
    # ------------------------------------------------------------------------------------------------

    def _switched_off(self) -> bool:
        return not self.enabled

    def _other_source(self, source: int, old: float, angle: float) -> tuple[float, float]:
        """Return the velocity that the controller wants to see now, and the pre-control for the end of the
        interval.
        """
        if source == POSITION:
            self.position_demand = demand = self._next_position
            correction = self._correction_gain * (demand - angle)
            left = self._left
            if left:
                self._left = left = left - 1
                self._next_position = demand + self._velocity_step if left else self._position_target
                wanted_velocity = self._velocity_target
            elif self._coast:
                self._coast -= 1
                self._next_position = demand + self._velocity_step
                wanted_velocity = self._velocity_target
            else:
                wanted_velocity = 0.0
            # Linear positions have steps in velocity; the reference model turns them into bounded torque.
            new = old + (wanted_velocity - old) * self._reference_share
        elif source == PROFILE:
            self.position_demand = demand = self._next_position
            correction = self._correction_gain * (demand - angle)
            profile = self._profile
            profile.advance()
            self._next_position = profile.position
            new = profile.velocity
        elif source == RAMP:
            rounded = self._rounded
            new = self._ramped(old) if rounded is None else rounded.step(self._period)
            if self._tracks_position:
                self.position_demand = demand = self._next_position
                correction = self._correction_gain * (demand - angle)
                self._next_position = demand + 0.5 * (old + new) * self._period
            else:
                self.position_demand = angle
                correction = 0.0
            if self._stop_pending and new == 0.0:
                self._watch_standstill()
        elif source == SMOOTHED:
            left = self._left
            if left:
                self._left = left = left - 1
                self._ramped_velocity = (
                    self._ramped_velocity + self._velocity_step if left else self._velocity_target
                )
            self.position_demand = angle
            correction = 0.0
            new = old + (self._ramped_velocity - old) * self._reference_share
        else:
            left = self._left
            if left:
                self._left = left = left - 1
                self._torque = self._torque + self._velocity_step if left else self._velocity_target
            elif self._stop_pending:
                self._end_stop()
            self.position_demand = angle
            self.velocity_demand = self.velocity
            return self.velocity, self.velocity
        wanted = self._middle + correction
        limit = self._catching_up_limit
        if -limit <= wanted <= limit:
            self.speed_limited = False
            self.velocity_demand = new + correction
            return wanted, new
        self.speed_limited = True
        self.velocity_demand = wanted = math.copysign(limit, wanted)
        return wanted, new

    def _ramped(self, old: float) -> float:
        """Return the demand one step nearer to the target: acceleration away from zero, braking towards
        it.
        """
        target = self._velocity_target
        if old < target:
            if old < 0.0:
                new = old + self._braking_step
                target = min(target, 0.0)
            else:
                new = old + self._velocity_step
            return new if new < target else target  # noqa: FURB136 - a call costs more in the servo step
        if old > 0.0:
            new = old - self._braking_step
            target = max(target, 0.0)
        else:
            new = old - self._velocity_step
        return new if new > target else target  # noqa: FURB136 - as above

    def _torque_command(self, velocity: float) -> float:
        torque = self._torque + self.torque_offset
        high = self._proportional_gain * (self._speed_limit - velocity)
        low = -self._proportional_gain * (self._speed_limit + velocity)
        self.speed_limited = not low <= torque <= high
        return high if torque > high else max(low, torque)

    def _watch_standstill(self) -> None:
        self._stop_steps += 1
        if -self.standstill_speed <= self.velocity <= self.standstill_speed:
            self._standing_steps += 1
        else:
            self._standing_steps = 0
        if (
            self._standing_steps > self.standstill_steps
            or self._stop_steps * self._period >= self.standstill_timeout_s
        ):
            self._end_stop()

    def _end_stop(self) -> None:
        self._stop_pending = False
        if self.on_standstill is not None:
            self.on_standstill()

    def _take_over(self, source: int) -> None:
        """Change the setpoint source without a bump."""
        previous = self._source
        if previous == TORQUE:
            self._feedforward = self._middle = self._model = self._predicted = self.velocity
            self._integral = self.torque_demand - self.torque_offset
        elif previous == SERVO and source == self._velocity_source:
            # What the position loop has added belongs to the speed from which the new one is reached.
            self._feedforward = self._middle = self.velocity_demand
        self.speed_limited = False
        if not self.controls_position:
            # The next servo instant finds the axis one period further on.
            self._next_position = self.position + self.velocity * self._period
        self._ramped_velocity = self._feedforward
        self._source = source
        self._left = self._coast = self._coast_length = 0
        self._stop_pending = False

    def _clear_setpoints(self) -> None:
        self._source = VELOCITY
        self._left = self._coast = self._coast_length = 0
        self._stop_pending = False
        self._integral = self._feedforward = self._middle = self._model = self._predicted = 0.0
        self._velocity_target = self.velocity_demand = self._ramped_velocity = self._torque = 0.0
        self.position_demand = self._next_position = self.position
        self.add_torque(0.0)
        self.torque_limited = self.speed_limited = False
