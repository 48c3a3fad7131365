"""What the modes of operation share: the servo core in user units, limits, offsets and option codes."""

from __future__ import annotations

import math
from typing import Any, Final

from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.statemachine import OptionCodes, StopOption
from emulators.drive.cia402.units import RANGE_OFF, Units
from emulators.drive.core import RPM, ServoCore
from emulators.drive.ramp import ProfileForm, RampShape
from fieldbus.errors import ConfigurationError

UNLIMITED: Final = 0xFFFFFFFF
"""A window of 6065h or 6067h that is switched off."""
_JERK_LIMITED: Final = 3
"""Value of 6086h."""
_SPAN: Final = 1 << 32
OPTION_CODES: Final = {
    "abort_connection": (0x6007, range(4), 1),
    "quick_stop": (0x605A, range(9), 2),
    "shutdown": (0x605B, range(2), 0),
    "disable_operation": (0x605C, range(2), 1),
    "halt": (0x605D, range(1, 5), 1),
    "fault_reaction": (0x605E, range(5), 2),
}
"""Object, allowed values and default of every option code (C402-049 to C402-073)."""


class ProfileAxis:
    """The motor as the profile sees it.

    Args:
        config: Configuration of the drive.
        core: Servo core.
        values: Values of the object dictionary, keyed `index << 8 | sub-index`.
        options: Option codes of the state machine; kept up to date here.

    """

    __slots__ = (
        "_rad_per_inc",
        "backward_speed",
        "blocked_negative",
        "blocked_positive",
        "config",
        "control_period_s",
        "control_steps",
        "control_word",
        "core",
        "demand_excess",
        "derated",
        "fitted_inputs",
        "forward_speed",
        "fresh",
        "halted",
        "home_shift",
        "homed",
        "inputs",
        "lower_speed",
        "max_speed",
        "missing_count",
        "options",
        "period_s",
        "period_steps",
        "primed",
        "protection_cap",
        "ramp_scale",
        "software_limits",
        "supervised",
        "synchronised",
        "torque_cap",
        "units",
        "upper_speed",
        "values",
    )

    def __init__(
        self, *, config: DriveConfig, core: ServoCore, values: dict[int, Any], options: OptionCodes
    ) -> None:
        self.config = config
        self.core = core
        self.values = values
        self.options = options
        self.units = Units(
            counts_per_revolution=core.encoder.counts_per_revolution, rated_torque_Nm=config.rated_torque_nm
        )
        self._rad_per_inc = core.encoder.radians_per_increment
        self.home_shift = 0
        """Added to the increments of the encoder, so that homing does not move the control loop."""
        self.homed = False
        self.control_word = 0
        """Last control word."""
        self.halted = False
        """Bit 8 of the control word has stopped the axis."""
        self.blocked_positive = False
        """The positive limit switch forbids motion in positive direction."""
        self.blocked_negative = False
        self.inputs = 0
        """60FDh."""
        self.fitted_inputs = 0
        """Bits of 60FDh that a switch is wired to."""
        self.torque_cap: float | None = None
        """Torque limit of the mode in effect, Nm; `refresh` puts it into effect."""
        self.demand_excess = 0.0
        """Part of the commanded position that a limit holds back, rad."""
        self.synchronised = False
        """SYNC drives the setpoints."""
        self.fresh = False
        """A cyclic setpoint has been written since the last SYNC."""
        self.primed = False
        """607Ah has been written since power-on."""
        self.ramp_scale = 1.0
        """All ramps of the drive are made with this share of their slope: a fault to inject."""
        self.protection_cap = math.inf
        """Torque limit because of overload or temperature, Nm, besides those of the objects."""
        self.derated = False
        """`protection_cap` is in effect."""
        self.supervised = False
        """A missing cyclic setpoint counts."""
        self.missing_count = 0
        """Cyclic setpoints that did not come."""
        self.control_period_s = config.control_period_ns / 1e9
        self.control_steps = config.control_period_ns // config.servo_period_ns
        self.period_s = self.control_period_s
        """60C2h, s."""
        self.period_steps = self.control_steps
        """60C2h in servo steps."""
        self.max_speed = self.upper_speed = math.inf
        """Largest speed, rad/s; `upper_speed` and `lower_speed` include 60C8h and 60C9h."""
        self.lower_speed = -math.inf
        self.forward_speed = math.inf
        """The same for positioning, rad/s: 60C8h and 60C9h hold a motion back, but start none."""
        self.backward_speed = -math.inf
        self.software_limits: tuple[int, int] | None = None
        """Effective 607Dh in position units; None = off."""

    # -- parameters ------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Take all parameters over from the values."""
        values = self.values
        units = self.units
        units.update(values)
        options = self.options
        options.abort_connection = self._option("abort_connection")
        options.quick_stop = self._option("quick_stop")
        options.shutdown = self._option("shutdown")
        options.disable_operation = self._option("disable_operation")
        options.halt = self._option("halt")
        options.fault_reaction = self._option("fault_reaction")
        torque = min(values[0x607200], values[0x607300])
        positive = min(torque, values[0x60E000]) * units.torque
        negative = min(torque, values[0x60E100]) * units.torque
        if units.torque_sign < 0:
            positive, negative = negative, positive
        if self.torque_cap is not None:
            positive, negative = min(positive, self.torque_cap), min(negative, self.torque_cap)
        cap = self.protection_cap
        self.derated = cap < max(positive, negative)
        positive, negative = min(positive, cap), min(negative, cap)
        self.core.set_torque_limits(positive, negative)
        motor_speed = values[0x608000] * RPM
        self.core.set_speed_limit(motor_speed)
        self.max_speed = min(values[0x607F00] * units.velocity, motor_speed)
        lower, upper = values[0x60C800] * units.velocity, values[0x60C900] * units.velocity
        if units.velocity_sign < 0:
            lower, upper = -upper, -lower
        self.lower_speed = max(-self.max_speed, lower)
        self.upper_speed = min(self.max_speed, upper)
        self.forward_speed = max(self.upper_speed, 0.0)
        self.backward_speed = min(self.lower_speed, 0.0)
        self.period_s = interpolation_period_s(values[0x60C201], values[0x60C202])
        self.period_steps = max(1, round(self.period_s / self.core.period_s))
        low, high, offset = values[0x607D01], values[0x607D02], values[0x607C00]
        off = (low, high) == RANGE_OFF or low > high
        self.software_limits = None if off else (low - offset, high - offset)

    def _option(self, name: str) -> int:
        """Return an option code; values of the manufacturer that an EDS brings count as the default."""
        index, allowed, default = OPTION_CODES[name]
        value: int = self.values[index << 8]
        return value if value in allowed else default

    # -- positions -------------------------------------------------------------------------------------

    @property
    def internal_increments(self) -> int:
        """6063h, not wrapped."""
        return self.core.encoder.increments + self.home_shift

    @property
    def actual_position(self) -> int:
        """6064h, position units."""
        return self.units.to_user_position(self.core.encoder.increments + self.home_shift)

    @property
    def demand_increments(self) -> int:
        """60FCh, not wrapped."""
        demand = self.core.position_demand + self.demand_excess
        return math.floor(demand / self._rad_per_inc + 0.5) + self.home_shift

    @property
    def demand_position(self) -> int:
        """6062h, position units; without position control the actual position."""
        if not self.core.controls_position:
            return self.actual_position
        return self.units.to_user_position(self.demand_increments)

    @property
    def following_error(self) -> int:
        """60F4h, position units."""
        if not self.core.controls_position:
            return 0
        return self.units.difference(self.demand_position, self.actual_position)

    @property
    def commanded_position(self) -> int:
        """Where the demand will be at the end of the servo interval, position units."""
        increments = math.floor(self.core.position_command / self._rad_per_inc + 0.5)
        return self.units.to_user_position(increments + self.home_shift)

    def angle_of(self, position: int, near: float | None = None) -> float:
        """Return the motor angle of a position in position units, rad.

        Where positions repeat, it is the one nearest to the angle `near`, rad; None = to the present demand.
        """
        increments = self.units.to_increments(position) - self.home_shift
        distance = increments - (self.core.position_command if near is None else near) / self._rad_per_inc
        span = (self.units.turn or _SPAN) * self.units.inc_numerator / self.units.inc_denominator
        if abs(distance) > 0.5 * span:
            increments -= round(distance / span) * span
        return increments * self._rad_per_inc

    def set_home(self, increments: int, position: int) -> None:
        """Shift the coordinate system so that a reading of the encoder, increments, becomes `position`,
        position units.
        """
        self.home_shift = round(self.units.to_increments(position)) - increments

    def within_software_limits(self, position: int) -> int:
        """Return the position clamped to 607Dh, where the limits are in effect (C402-140, C402-162)."""
        limits = self.software_limits
        if limits is None or not self.homed:
            return position
        return min(max(position, limits[0]), limits[1])

    # -- velocities, torques ---------------------------------------------------------------------------

    @property
    def actual_velocity(self) -> int:
        """606Ch, velocity units."""
        units = self.units
        return round(self.core.velocity / units.velocity) * units.velocity_sign

    @property
    def demand_velocity(self) -> int:
        """606Bh, velocity units."""
        units = self.units
        return round(self.core.velocity_demand / units.velocity) * units.velocity_sign

    def permille(self, torque_Nm: float) -> int:
        """Return a torque in permille of 6076h."""
        units = self.units
        return round(torque_Nm / units.torque) * units.torque_sign if units.torque else 0

    def allowed_velocity(self, velocity: float) -> float:
        """Return a velocity (rad/s) within the speed limits and not into an active limit switch."""
        if velocity > self.upper_speed:
            velocity = self.upper_speed
        elif velocity < self.lower_speed:
            velocity = self.lower_speed
        if (velocity > 0.0 and self.blocked_positive) or (velocity < 0.0 and self.blocked_negative):
            return 0.0
        return velocity

    # -- accelerations ---------------------------------------------------------------------------------

    def acceleration(self, index: int, limit_index: int) -> float:
        """Return an acceleration object within its limit object, rad/s^2; 0
        stands for the limit (C402-075).
        """
        limit = self.values[limit_index << 8]
        value = self.values[index << 8] or limit
        if limit:
            value = min(value, limit)
        return value * self.units.acceleration * self.ramp_scale if value else math.inf

    def profile_form(self) -> ProfileForm:
        """Return the shape of the motion profile: 6086h, 60A3h, 60A4h."""
        values = self.values
        kind = values[0x608600]
        if kind in (RampShape.SIN2, RampShape.JERK_FREE):
            return ProfileForm(shape=RampShape(kind))
        if kind != _JERK_LIMITED:
            return ProfileForm()
        jerk = braking = values[0x60A401]
        if values[0x60A300] == 2 and values[0x60A402]:
            braking = values[0x60A402]
        unit = self.units.acceleration
        return ProfileForm(jerk=float(jerk * unit), braking_jerk=float(braking * unit))

    @property
    def halt_option(self) -> StopOption:
        """How a halt stops (605Dh)."""
        return StopOption(self.options.halt)

    def stop_slope(self, option: int) -> float:
        """Return the deceleration of a stop option 1 to 4, rad/s^2; inf = at the torque limit."""
        if option == StopOption.SLOW_DOWN:
            value = self.values[0x608400] or self.values[0x60C600]
        elif option == StopOption.QUICK_STOP:
            value = self.values[0x608500] or self.values[0x60C600]
        else:
            return math.inf
        return value * self.units.acceleration * self.ramp_scale if value else math.inf


def interpolation_period_s(units: int, exponent: int) -> float:
    """Return 60C2h in seconds.

    Raises:
        ConfigurationError: The period is zero or beyond reason (C402-171).

    """
    if not 1 <= units <= 255 or not -9 <= exponent <= 1:
        raise ConfigurationError("60C2h", (units, exponent), "1..255 * 10^-9..10^1 s")
    return units * 10.0**exponent if exponent >= 0 else units / 10.0**-exponent
