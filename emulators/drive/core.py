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

Closed velocity loop: `ServoTuning.velocity_time_constant_ms` (T_vtc, default 2 ms) is inertia / proportional
gain. It is how fast a disturbance is countered; a velocity demand passes it as a first-order lag only where
the pre-control cannot know the acceleration: with `torque_precontrol=False`, and for the velocity that
follows from interpolated positions.

All quantities are those of the motor shaft: rad, rad/s, Nm, as the encoder shows them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from emulators.drive.brake import HoldingBrake
from emulators.drive.ramp import PositionProfile
from emulators.drive.rounded_ramp import RoundedRamp, Rounding
from emulators.drive.tuning import RPM, ServoTuning
from emulators.encoder import RotaryEncoder
from emulators.mechanics import AxisMechanics
from fieldbus.clock import CALM_STEPS
from fieldbus.errors import ConfigurationError

__all__ = ["RPM", "ServoCore", "ServoTuning"]

# What the demand comes from.
_VELOCITY: Final = 0
_SERVO: Final = 1
_SERVO_OR_VELOCITY: Final = 1
"""Sources from here on are the others."""
_RAMP: Final = 2
_POSITION: Final = 3
_PROFILE: Final = 4
_TORQUE: Final = 5
_SMOOTHED: Final = 6


_HEADROOM: Final = 1.05
"""Share of the speed limit up to which the position controller may catch up: at the limit itself it needs
some reserve.
"""


class ServoCore:
    """Cascade, ramp generator, pulse enable and brake on a plant and an encoder.

    Args:
        mechanics: The plant.
        encoder: The motor encoder.
        period_s: Servo period, s.
        tuning: Gains.
        brake: Holding brake; None = the motor has none.

    """

    __slots__ = (
        "_braking_step",
        "_catching_up_limit",
        "_coast",
        "_coast_length",
        "_correction_gain",
        "_factors",
        "_feedforward",
        "_inertia_per_step",
        "_integral",
        "_integral_gain",
        "_inverse_period",
        "_lag",
        "_left",
        "_limit_high",
        "_limit_low",
        "_middle",
        "_model",
        "_model_share",
        "_next_position",
        "_offset_left",
        "_offset_step",
        "_offset_target",
        "_period",
        "_position_target",
        "_predicted",
        "_profile",
        "_proportional_gain",
        "_ramped_velocity",
        "_reference_share",
        "_reference_step",
        "_rounded",
        "_sample",
        "_servo_gain",
        "_source",
        "_speed_limit",
        "_standing_steps",
        "_step_mechanics",
        "_stop_pending",
        "_stop_steps",
        "_torque",
        "_tracks_position",
        "_velocity_source",
        "_velocity_step",
        "_velocity_target",
        "brake",
        "enabled",
        "encoder",
        "mechanics",
        "on_standstill",
        "position",
        "position_demand",
        "speed_limited",
        "standstill_speed",
        "standstill_steps",
        "standstill_timeout_s",
        "torque",
        "torque_demand",
        "torque_limited",
        "torque_offset",
        "tuning",
        "velocity",
        "velocity_demand",
    )

    def __init__(
        self,
        *,
        mechanics: AxisMechanics,
        encoder: RotaryEncoder,
        period_s: float,
        tuning: ServoTuning | None = None,
        brake: HoldingBrake | None = None,
    ) -> None:
        tuning = ServoTuning() if tuning is None else tuning
        if not 0.0 < period_s <= tuning.velocity_time_constant_s / 3.0:
            raise ConfigurationError(
                "period_s", period_s, "0 < period <= a third of velocity_time_constant_ms"
            )
        self.mechanics = mechanics
        """The plant."""
        self.encoder = encoder
        """The motor encoder."""
        self._step_mechanics = mechanics.step
        self._sample = encoder.sample
        self._period = period_s
        self._inverse_period = 1.0 / period_s
        self.tuning = tuning
        self.brake = HoldingBrake(mechanics) if brake is None else brake
        inertia = mechanics.motor_inertia if tuning.inertia_kgm2 is None else tuning.inertia_kgm2
        self._proportional_gain = inertia / tuning.velocity_time_constant_s
        self._integral_gain = (
            self._proportional_gain * period_s / tuning.velocity_integral_time_s
            if tuning.velocity_integral_time_s
            else 0.0
        )
        self._model_share = period_s / tuning.velocity_time_constant_s
        self._inertia_per_step = inertia / period_s
        # What several steps at once calculate with.
        self._factors: tuple[float, float, float, float, float] = (
            self._inverse_period,
            self._proportional_gain,
            self._integral_gain,
            self._inertia_per_step,
            self._model_share,
        )
        self._correction_gain = tuning.position_gain
        self._reference_share = period_s / (tuning.velocity_time_constant_s + period_s)
        self._velocity_source = _VELOCITY if tuning.torque_precontrol else _SMOOTHED
        time_constant = tuning.current_time_constant_s
        self._lag = period_s / (time_constant + period_s) if time_constant else 0.0
        self.standstill_speed = tuning.standstill_speed_rpm * RPM
        """Speed below which the axis counts as standing, rad/s."""
        self.standstill_steps = max(1, round(tuning.standstill_time_s / period_s))
        self.standstill_timeout_s = tuning.standstill_timeout_s
        """Time after the end of a ramp to zero from which on the stop counts as finished anyway, s."""
        self.position = encoder.sample(mechanics.motor_angle)
        """Measured angle, rad."""
        self.velocity = 0.0
        """Measured velocity (mean of the last servo period), rad/s."""
        self.position_demand = self.position
        """Position demand for now, rad; without position control the measured angle."""
        self.velocity_demand = 0.0
        """Velocity demand including the position controller's part, rad/s."""
        self.torque_demand = 0.0
        """Demand to the current loop, Nm."""
        self.torque = 0.0
        """Torque in the air gap, Nm."""
        self.torque_offset = 0.0
        """Additive torque demand, Nm."""
        self.torque_limited = False
        """Whether the last torque demand was cut."""
        self.speed_limited = False
        """Whether the last torque command was cut because of the speed limit."""
        self.enabled = False
        """Whether the pulses are enabled."""
        self.on_standstill: Callable[[], None] | None = None
        """Called once when a stop commanded by `stop` has ended in standstill."""
        self._limit_high = math.inf
        self._limit_low = -math.inf
        self._speed_limit = math.inf
        self._catching_up_limit = math.inf
        self._profile = PositionProfile(step_s=period_s)
        self._offset_left = 0
        self._offset_step = self._offset_target = 0.0
        self._source = _VELOCITY
        self._feedforward = self._middle = self._integral = 0.0
        self._model = self._predicted = 0.0
        self._velocity_target = self._velocity_step = self._braking_step = 0.0
        self._next_position = self._position_target = self.position
        self._ramped_velocity = self._torque = 0.0
        self._rounded: RoundedRamp | None = None
        self._reference_step = self._servo_gain = 0.0
        self._left = self._coast = self._coast_length = 0
        self._tracks_position = False
        self._stop_pending = False
        self._standing_steps = self._stop_steps = 0

    # -- what a profile reads ---------------------------------------------------------------------------

    @property
    def profile(self) -> PositionProfile:
        """Generator used by `follow_profile`."""
        return self._profile

    @property
    def period_s(self) -> float:
        """Servo period, s."""
        return self._period

    @property
    def speed_rpm(self) -> float:
        """Measured speed, rpm."""
        return self.velocity / RPM

    @property
    def following_error(self) -> float:
        """Position demand minus measured position, rad; 0 without position control."""
        return self.position_demand - self.position

    @property
    def controls_position(self) -> bool:
        """Whether a position is controlled, rather than velocity or torque alone."""
        return self._source in (_POSITION, _PROFILE) or (self._source == _RAMP and self._tracks_position)

    @property
    def position_command(self) -> float:
        """Where the position demand will be at the end of the servo interval, rad."""
        return self._next_position if self.controls_position else self.position

    @property
    def position_ahead(self) -> float:
        """Where the demand, or an axis without position control, will be at the next servo instant, rad."""
        if self.controls_position:
            return self._next_position
        return self.position + self.velocity * self._period

    @property
    def interpolating(self) -> bool:
        """Whether the last `command_velocity` or `command_position` is still on its way."""
        return self._left > 0

    @property
    def phase_steps(self) -> int:
        """Servo steps by which the present instant lies before (> 0) or
        behind the end of the interpolation.
        """
        return self._left or self._coast - self._coast_length

    @property
    def precontrol_velocity(self) -> float:
        """Velocity demand without the position controller's part, rad/s."""
        return self._feedforward

    @property
    def commanded_torque(self) -> float:
        """Present value of the torque command without the offset, Nm; meaningful in torque control."""
        return self._torque

    @property
    def controls_torque(self) -> bool:
        """Whether the torque is commanded."""
        return self._source == _TORQUE

    @property
    def stopping(self) -> bool:
        """Whether a stop commanded by `stop` has not ended yet."""
        return self._stop_pending

    @property
    def standing(self) -> bool:
        """Whether the measured speed is below the standstill speed."""
        return abs(self.velocity) <= self.standstill_speed

    def reinitialise(self) -> None:
        """Read the encoder again, as after its power-on; pulses are inhibited."""
        self.inhibit_pulses()
        self.position = self.encoder.sample(self.mechanics.motor_angle)
        self.velocity = 0.0
        self._clear_setpoints()

    # -- commands --------------------------------------------------------------------------------------

    def set_torque_limits(self, positive_Nm: float, negative_Nm: float) -> None:
        """Limit the torque to -negative..positive, Nm, both >= 0."""
        if positive_Nm != self._limit_high or -negative_Nm != self._limit_low:
            self._limit_high = positive_Nm
            self._limit_low = -negative_Nm
            self.mechanics.calm_low = self.mechanics.calm_high = 0.0  # more torque reaches further

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
            target - (self._feedforward if source == _VELOCITY else self._ramped_velocity)
        ) / steps

    def command_position(
        self, target: float, steps: int, *, precontrol: float | None = None, coast: int = 0
    ) -> None:
        """Reach a position linearly within a number of servo steps.

        Args:
            target: rad.
            steps: Servo steps, >= 1.
            precontrol: Velocity pre-control, rad/s; None = that of the way, by `velocity_feedforward`.
            coast: Servo steps for which the demand continues beyond the target when nothing new comes.

        """
        if self._source != _POSITION:
            self._take_over(_POSITION)
        self._velocity_step = step = (target - self._next_position) / steps
        if precontrol is None:
            precontrol = step * self._inverse_period * self.tuning.velocity_feedforward
        self._velocity_target = precontrol
        self._position_target = target
        self._left = steps
        self._coast = self._coast_length = coast

    def command_servo(self, velocity: float, reference: float, gain: float, steps: int) -> None:
        """Close a position loop around a velocity that comes from outside: velocity +
        gain * (reference - position).

        The loop runs in every servo step (dynamic servo control, PD-195). Velocity and
        reference are reached linearly.

        Args:
            velocity: rad/s.
            reference: Position that the axis should have, rad.
            gain: 1/s, >= 0.
            steps: Servo steps, >= 1; 1 = at once.

        """
        if self._source != _SERVO:
            self._take_over(_SERVO)
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
        """Take the demand from `profile`, which starts from the present demand
        when another source was active.
        """
        if self._source != _PROFILE:
            self._take_over(_PROFILE)
            self._profile.reset(self._next_position, self._feedforward)
        return self._profile

    def command_torque(self, torque_Nm: float, steps: int = 1) -> None:
        """Control the torque, limited by torque and speed limits.

        Args:
            torque_Nm: Torque, Nm.
            steps: Servo steps within which it is reached linearly; 1 = with the next one.

        """
        if self._source != _TORQUE:
            present = self.torque_demand - self.torque_offset
            self._take_over(_TORQUE)
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
            rounded: A ramp with rounding, which has its target already; the slopes do not count then.

        """
        self._rounded = rounded
        if self._source != _RAMP or track_position is not self._tracks_position:
            self._take_over(_RAMP)
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
        if not (self._source == _RAMP and self._stop_pending):
            self._feedforward = self._middle = self.velocity
        if rounded is not None:
            rounded[0].aim(self._feedforward, 0.0, rounded[1])
        self.ramp(0.0, slope, track_position=track_position, rounded=None if rounded is None else rounded[0])
        self._stop_pending = True
        self._standing_steps = self._stop_steps = 0

    def stop_torque(self, slope: float) -> None:
        """Take the torque to zero with a slope (Nm/s) and report by
        `on_standstill` when it is; the axis coasts.
        """
        present = self._torque if self._source == _TORQUE else self.torque_demand - self.torque_offset
        steps = abs(present) / (slope * self._period) if slope > 0.0 else 0.0
        self.command_torque(0.0, max(1, math.ceil(steps - 1e-9)))
        self._stop_pending = True

    # -- additive torque -------------------------------------------------------------------------------

    def add_torque(self, torque_Nm: float, steps: int = 1) -> None:
        """Add a torque to what the velocity controller wants, Nm, reached linearly
        within servo steps; 1 = at once.
        """
        if steps == 1:
            self.torque_offset = torque_Nm
            self._offset_left = 0
            return
        self._offset_target = torque_Nm
        self._offset_step = (torque_Nm - self.torque_offset) / steps
        self._offset_left = steps

    def take_torque_offset(self, torque_Nm: float) -> None:
        """Replace the additive torque without changing the torque: the integral
        part takes the difference, Nm.
        """
        self._integral += self.torque_offset - torque_Nm
        self.add_torque(torque_Nm)

    # -- one servo step --------------------------------------------------------------------------------

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
        if source == _VELOCITY:
            left = self._left
            if left:
                self._left = left = left - 1
                new = old + self._velocity_step if left else self._velocity_target
            else:
                new = old
            self.position_demand = angle
            wanted = self._middle
            self.velocity_demand = new
        elif source == _SERVO:
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
        if source == _TORQUE:
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
            # At the limit nothing is integrated, and the model follows what the torque can do. An integral
            # part beyond the limit, as after a jump of the encoder, would keep the torque there forever.
            torque = self._limit_high if torque > 0.0 else self._limit_low
            self._integral = min(max(self._integral, self._limit_low), self._limit_high)
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

    def calm(self) -> bool:
        """Return whether the next `CALM_STEPS` steps certainly have no effect but on axis and control: no
        stop ends in them, no switch, end stop or zero mark is met, the brake does not move.
        """
        if self._stop_pending or self.brake.busy or not self.encoder.plain:
            return False
        mechanics = self.mechanics
        if (
            mechanics.calm_low < mechanics.position < mechanics.calm_high
            and -mechanics.calm_speed <= mechanics.velocity <= mechanics.calm_speed
        ):
            return True
        torque = (
            max(abs(self.torque), self._limit_high, -self._limit_low) if self.enabled else abs(self.torque)
        )
        return mechanics.find_calm(CALM_STEPS, self._period, torque)

    def advance(self, steps: int) -> None:
        """Make so many steps at once, while `calm`."""
        source = self._source
        if source > _SERVO_OR_VELOCITY or not self.enabled or self._offset_left or self._lag:
            for _ in range(steps):
                self.step()
            return
        # As `step`, with all values at hand; in ordinary Python a single step takes a third longer so.
        mechanics, encoder = self.mechanics, self.encoder
        force_per_torque, load_force, breakaway, decay, gain, friction, half_period, per_unit = (
            mechanics.factors
        )
        position, speed, shaft = mechanics.position, mechanics.velocity, mechanics.motor_angle
        direction, offset = encoder.direction, encoder.offset
        inverse_period, proportional, integrating, inertia, share = self._factors
        low, high, torque_offset = self._limit_low, self._limit_high, self.torque_offset
        angle, torque, velocity = self.position, self.torque, self.velocity
        new, middle, left = self._feedforward, self._middle, self._left
        velocity_step, target = self._velocity_step, self._velocity_target
        integral, predicted, model = self._integral, self._predicted, self._model
        limited, demanded, correction = False, 0.0, 0.0
        servo = source == _SERVO
        for _ in range(steps):
            force = torque * force_per_torque + load_force
            if speed != 0.0 or not -breakaway <= force <= breakaway:
                moved = speed * decay + force * gain
                if moved > friction:
                    moved -= friction
                elif moved < -friction:
                    moved += friction
                else:
                    moved = 0.0
                position += (speed + moved) * half_period
                speed = moved
                shaft = position * per_unit
            measured = shaft * direction + offset
            velocity = (measured - angle) * inverse_period
            angle = measured
            old = new
            wanted = middle
            if servo:
                correction = self._servo_gain * (self._next_position - angle)
                wanted += correction
                self.position_demand = self._next_position
            if left:
                left -= 1
                new = old + velocity_step if left else target
                if servo:
                    self._next_position = (
                        self._next_position + self._reference_step if left else self._position_target
                    )
            demanded = new
            if servo:
                limit = self._catching_up_limit
                self.speed_limited = not -limit <= wanted <= limit
                if self.speed_limited:
                    demanded = wanted = math.copysign(limit, wanted)
                else:
                    demanded += correction
            middle = 0.5 * (old + new)
            change = new - old
            torque = proportional * (wanted - velocity) + integral + inertia * change + torque_offset
            if low <= torque <= high:
                limited = False
                integral += integrating * (predicted - velocity)
                change += share * (wanted - predicted)
                predicted = model + 0.5 * change
                model += change
            else:
                torque = high if torque > 0.0 else low
                integral = min(max(integral, low), high)
                limited = True
                change = torque / inertia
                predicted = velocity + change
                model = velocity + 1.5 * change
        mechanics.take_motion(position, speed, shaft)
        encoder.note_sample(shaft)
        self.position = angle
        self.velocity = velocity
        self._feedforward = new
        self._middle = middle
        self._left = left
        self._integral = integral
        self._predicted = predicted
        self._model = model
        self.torque = self.torque_demand = torque
        self.torque_limited = limited
        self.velocity_demand = demanded
        if not servo:
            self.position_demand = angle

    # -- inside ----------------------------------------------------------------------------------------

    def _switched_off(self) -> bool:
        return not self.enabled

    def _other_source(self, source: int, old: float, angle: float) -> tuple[float, float]:
        """Return the velocity that the controller wants to see now, and the
        pre-control for the end of the interval.
        """
        if source == _POSITION:
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
        elif source == _PROFILE:
            self.position_demand = demand = self._next_position
            correction = self._correction_gain * (demand - angle)
            profile = self._profile
            profile.advance()
            self._next_position = profile.position
            new = profile.velocity
        elif source == _RAMP:
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
        elif source == _SMOOTHED:
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
        """Return the demand one step nearer to the target: acceleration away
        from zero, braking towards it.
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
        if previous == _TORQUE:
            self._feedforward = self._middle = self._model = self._predicted = self.velocity
            self._integral = self.torque_demand - self.torque_offset
        elif previous == _SERVO and source == self._velocity_source:
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
        self._source = _VELOCITY
        self._left = self._coast = self._coast_length = 0
        self._stop_pending = False
        self._integral = self._feedforward = self._middle = self._model = self._predicted = 0.0
        self._velocity_target = self.velocity_demand = self._ramped_velocity = self._torque = 0.0
        self.position_demand = self._next_position = self.position
        self.add_torque(0.0)
        self.torque_limited = self.speed_limited = False
