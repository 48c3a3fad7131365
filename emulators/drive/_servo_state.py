"""State of the servo core: its parts, converted gains and present values."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from emulators.drive.brake import HoldingBrake
from emulators.drive.ramp import PositionProfile
from emulators.drive.rounded_ramp import RoundedRamp
from emulators.drive.tuning import RPM, ServoTuning
from emulators.encoder import RotaryEncoder
from emulators.mechanics import AxisMechanics
from fieldbus.errors import ConfigurationError

# What the demand comes from.
VELOCITY: Final = 0
RAMP: Final = 1
POSITION: Final = 2
PROFILE: Final = 3
TORQUE: Final = 4
SMOOTHED: Final = 5
SERVO: Final = 6


class ServoState:
    """Parts, gains and present values of a servo core; see `ServoCore`.

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
        "_encoder",
        "_feedforward",
        "_inertia_per_step",
        "_integral",
        "_integral_gain",
        "_inverse_period",
        "_lag",
        "_left",
        "_limit_high",
        "_limit_low",
        "_mechanics",
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
                "period_s", period_s, "0 < period <= a third of velocity_time_constant_s"
            )
        self._mechanics = mechanics
        self._encoder = encoder
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
        self._correction_gain = tuning.position_gain
        self._reference_share = period_s / (tuning.velocity_time_constant_s + period_s)
        self._velocity_source = VELOCITY if tuning.torque_feedforward else SMOOTHED
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
        self._source = VELOCITY
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

    # -- additive torque
    # -----------------------------------------------------------------------------------------------

    def add_torque(self, torque_Nm: float, steps: int = 1) -> None:
        """Add a torque to what the velocity controller wants, Nm, reached linearly within servo steps; 1 = at
        once.
        """
        if steps == 1:
            self.torque_offset = torque_Nm
            self._offset_left = 0
            return
        self._offset_target = torque_Nm
        self._offset_step = (torque_Nm - self.torque_offset) / steps
        self._offset_left = steps

    def take_torque_offset(self, torque_Nm: float) -> None:
        """Replace the additive torque without changing the torque: the integral part takes the difference,
        Nm.
        """
        self._integral += self.torque_offset - torque_Nm
        self.add_torque(torque_Nm)

    # -- what the face may ask
    # ---------------------------------------------------------------------------------

    @property
    def profile(self) -> PositionProfile:
        """Generator used by `follow_profile`."""
        return self._profile

    @property
    def mechanics(self) -> AxisMechanics:
        """The plant."""
        return self._mechanics

    @property
    def encoder(self) -> RotaryEncoder:
        """The motor encoder."""
        return self._encoder

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
        return self._source in (POSITION, PROFILE) or (self._source == RAMP and self._tracks_position)

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
        """Servo steps by which the present instant lies before (> 0) or behind the end of the
        interpolation.
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
        return self._source == TORQUE

    @property
    def stopping(self) -> bool:
        """Whether a stop commanded by `stop` has not ended yet."""
        return self._stop_pending

    @property
    def standing(self) -> bool:
        """Whether the measured speed is below the standstill speed."""
        return abs(self.velocity) <= self.standstill_speed
