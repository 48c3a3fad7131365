"""Torque data of an axis: additive torque, torque range, torque limiting, fixed stop (section 2.17 of the
instruction specification).

The values go to the drive as shares of `Actor.DriveParameter.ReferenceTorque`, which has to be p2003 of the
drive. Of a linear motor they are forces, N, where torques are named below, and shares of
`Actor.LinearMotorDriveParameter.ReferenceForce` (VAR-132).
"""

from __future__ import annotations

from math import tau
from typing import TYPE_CHECKING, Final

from motion.s7.axis.assembly import torque_precontrol_of
from motion.s7.axis.jobs import (
    ERROR_ADDITIVE_TORQUE,
    ERROR_ALARM,
    ERROR_CLAMPED,
    ERROR_EXCLUSIVE_TORQUE,
    ERROR_LIMIT,
    ERROR_LOCKED,
    ERROR_LOWER_TORQUE,
    ERROR_MODE,
    ERROR_NO_TORQUE_DATA,
    ERROR_NO_TORQUE_REDUCTION,
    ERROR_NOT_CONTROLLED,
    ERROR_TORQUE_RANGE,
    ERROR_UPPER_TORQUE,
    NO_ERROR,
)
from motion.s7.axis.state import AxisState
from motion.s7.units import millimetres

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.kernel.servo_axis import ServoAxis
    from motion.kernel.torque_limits import TorqueLimits
    from motion.kernel.torque_precontrol import TorquePrecontrol
    from motion.s7.axis.alarms import AxisAlarms
    from motion.s7.axis.control_words import ControlWords
    from motion.s7.axis.motion import MotionControl
    from motion.s7.axis.state import AxisStates
    from motion.s7.variables import VariableStore

ALARM_CLAMPING: Final = 542
TORQUE_DATA: Final = "Actor.Interface.EnableTorqueData"

LIMIT_RANGE: Final = 2147483648.0
"""Greatest magnitude of `MC_TorqueLimiting.Limit` (STP-603)."""
TORQUE_RANGE: Final = 1.0e12
"""Greatest magnitude of the other torque inputs."""
_THRESHOLD: Final = 0.9
"""Share of a limit of telegram 750 from which on it counts as reached (MC-532)."""


def _limit_scale(store: VariableStore, *, linear_motor: bool) -> tuple[float, str]:
    """Return the torque at the motor, Nm, per Nm or N of a limit, and which of the
    two it is (STP-138 to STP-142).
    """
    read = store.read
    if linear_motor:
        return 1.0, "Force"
    if read("TorqueLimiting.LimitBase") == 0:
        return 1.0, "Torque"
    ratio = read("LoadGear.Denominator") / read("LoadGear.Numerator") / (read("Actor.Efficiency") or 1.0)
    if store.object_type == "SpeedAxis" or read("Properties.MotionType") == 1:
        return ratio, "Torque"
    lead_m = read("Mechanics.LeadScrew") * millimetres(store.read_int("Units.LengthUnit")) * 1.0e-3
    return ratio * lead_m / tau, "Force"


class TorqueControl:
    """Torque functions of an axis. One object per axis; `step` runs once per application cycle.

    Args:
        name: Name of the axis in the history.
        history: Log for changes of limits, or None.
        store: Variables of the axis.
        servo: The axis in the kernel.
        states: State of the axis.
        alarms: Its alarms.
        motion: Its jobs.
        control_words: Its control words 1 and 2.
        limits: Torque limits in effect.

    """

    def __init__(
        self,
        name: str,
        history: History | None,
        store: VariableStore,
        *,
        servo: ServoAxis,
        states: AxisStates,
        alarms: AxisAlarms,
        motion: MotionControl,
        control_words: ControlWords,
        limits: TorqueLimits,
    ) -> None:
        self._name = name
        self._history = history
        self._store = store
        self._servo = servo
        self._states = states
        self._alarms = alarms
        self._motion = motion
        self._control_words = control_words
        self.limits = limits
        """Limits in effect, and the fixed stop."""
        self._selected = store.bind(TORQUE_DATA)
        if servo.has_position:
            self._deviation = store.bind("Clamping.FollowingErrorDeviation")
            self._tolerance = store.bind("Clamping.PositionTolerance")
        self.begin()

    def begin(self) -> None:
        """Derive references from the variables in effect, and begin without any torque function."""
        store = self._store
        linear_motor = self._servo.has_position and store.read("Actor.MotorType") == 1
        self._reference = store.bind(
            "Actor.LinearMotorDriveParameter.ReferenceForce"
            if linear_motor
            else "Actor.DriveParameter.ReferenceTorque"
        )
        self._per_limit, quantity = _limit_scale(store, linear_motor=linear_motor)
        self._default = store.bind(f"TorqueLimiting.LimitDefaults.{quantity}")
        factors = store.factors
        self._limit_unit = factors.of(quantity.lower())
        self._unit = factors.force if linear_motor else factors.torque
        self._sign = -1.0 if store.read("Actor.InverseDirection") else 1.0
        servo = self._servo
        self._precontrol: TorquePrecontrol | None = None
        sends = servo.drive_port.has_torque_data and self._selected.value and not servo.simulated
        if servo.has_position and sends and store.read("TorquePreControl.Mode") == 1:
            self._precontrol = torque_precontrol_of(store)
        self.precontrolled_nm = 0.0
        """Share of the pre-control in what was sent last, Nm, before the direction of the drive counts."""
        self.sends = self._precontrol is not None
        """There is a torque to be sent: `output_nm` has to be called."""
        self.additive: float | None = None
        """`MC_TorqueAdditive.Value` in effect, in Nm; None = the function is off."""
        self.limits.begin()
        self._clamp_position = 0.0

    @property
    def precontrols(self) -> bool:
        """Whether the acceleration setpoint gives a torque (`TorquePreControl.Mode`)."""
        return self._precontrol is not None

    # -- additive torque
    # ------------------------------------------------------------------------------------------

    @property
    def _has_data(self) -> bool:
        """Whether telegram 750 is connected (CFG-404)."""
        return self._servo.port.has_torque_data and bool(self._selected.value)

    def start_additive(self) -> int:
        """Return why `MC_TorqueAdditive` cannot start, 0 if it can (MC-512)."""
        if not self._has_data:
            return ERROR_NO_TORQUE_DATA
        return ERROR_LOCKED if not self._states.facts.enabled or self._motion.stopping else NO_ERROR

    def set_additive(self, value: float | None) -> int:
        """Add a torque, in the torque unit, or none; returns the ErrorID of a value that is not permitted."""
        if value is not None and not abs(value) <= TORQUE_RANGE:
            return ERROR_ADDITIVE_TORQUE
        self.additive = None if value is None else value * self._unit
        self.sends = value is not None or self._precontrol is not None
        return NO_ERROR

    @property
    def total_additive_nm(self) -> float:
        """Additive torque that is sent, before the direction of the drive
        counts, Nm (`StatusTorqueData.TotalTorqueAdditive`).
        """
        return (self.additive or 0.0) + self.precontrolled_nm

    def output_nm(self, acceleration: float) -> float:
        """Return the additive torque for the drive, Nm, in its direction (MC-518, CTL-052).

        Args:
            acceleration: Setpoint of a position-controlled axis, position unit/s²; 0 without position
                control (CTL-056).

        """
        if self._precontrol is not None:
            self.precontrolled_nm = self._precontrol.torque(acceleration)
        return self._sign * ((self.additive or 0.0) + self.precontrolled_nm)

    # -- torque range
    # ---------------------------------------------------------------------------------------------

    def start_range(self) -> int:
        """Return why `MC_TorqueRange` cannot start, 0 if it can (MC-522, MC-533)."""
        if not self._has_data:
            return ERROR_NO_TORQUE_DATA
        if self._motion.stopping:
            return ERROR_LOCKED
        return ERROR_EXCLUSIVE_TORQUE if self.limits.limiting else NO_ERROR

    def set_range(self, upper: float, lower: float) -> int:
        """Limit the torque to `lower`..`upper`, in the torque unit; returns the ErrorID of limits that are
        not permitted (STP-187).
        """
        if not abs(upper) <= TORQUE_RANGE:
            return ERROR_UPPER_TORQUE
        if not abs(lower) <= TORQUE_RANGE:
            return ERROR_LOWER_TORQUE
        if upper <= lower:
            return ERROR_TORQUE_RANGE
        limits = (upper * self._unit, lower * self._unit)
        if self.limits.range_nm != limits:
            self.limits.range_nm = limits
            self._send_range()
        return NO_ERROR

    def end_range(self) -> None:
        """Let the reference torque be the limit again (MC-529)."""
        self.limits.range_nm = None
        self._send_range()

    def _send_range(self) -> None:
        reference = self._reference.value
        limits = self.limits.range_nm
        if self._history is not None:
            upper, lower = limits or (0.0, 0.0)
            self._history.emit(
                self._name, "axis.torque_range", active=limits is not None, upper=upper, lower=lower
            )
        if limits is None or reference <= 0.0:
            self._servo.port.set_torque_range(1.0, -1.0)
            return
        upper, lower = limits
        if self._sign < 0.0:
            upper, lower = -lower, -upper
        self._servo.port.set_torque_range(upper / reference, lower / reference)

    # -- torque limiting
    # ------------------------------------------------------------------------------------------

    def start_limiting(self, mode: int) -> int:
        """Return why `MC_TorqueLimiting` cannot start with a `Mode`, 0 if it can (MC-536 to MC-541)."""
        if self._alarms.blocking:
            return ERROR_ALARM
        if self._motion.stopping:
            return ERROR_LOCKED
        return ERROR_EXCLUSIVE_TORQUE if self.limits.range_nm is not None else self._check_mode(mode)

    def _check_mode(self, mode: int) -> int:
        if mode not in (0, 1) or (mode == 1 and not self._servo.has_position):
            return ERROR_MODE
        if mode == 0 and not self._servo.port.has_torque_reduction:
            return ERROR_NO_TORQUE_REDUCTION
        if mode == 1 and not self._states.facts.enabled:
            return ERROR_LOCKED
        if mode == 1 and not self._servo.position_controlled:
            return ERROR_NOT_CONTROLLED
        return NO_ERROR

    def set_limiting(self, limit: float, mode: int) -> int:
        """Activate or change limit and mode; returns the ErrorID of values that are
        not permitted (STP-134, STP-603).

        Args:
            limit: As `MC_TorqueLimiting.Limit`.
            mode: 0 limiting alone, 1 with fixed-stop detection.

        """
        if not abs(limit) <= LIMIT_RANGE:
            return ERROR_LIMIT
        if mode != int(self.limits.detects) or not self.limits.limiting:
            error = self._check_mode(mode)
            if error:
                return error
            if mode == 0 and self.limits.clamped:
                return ERROR_CLAMPED
        limit_nm = self._at_motor(limit) if self._servo.port.has_torque_reduction else None
        if limit_nm != self.limits.limit_nm:
            self.limits.limit_nm = limit_nm
            self._note_limit()
            reference = self._reference.value
            if limit_nm is not None and reference > 0.0:
                self._servo.port.limit_torque(min(1.0, limit_nm / reference))
        if not self.limits.limiting:
            self._control_words.travel_to_fixed_stop(True)
        self.limits.limiting = True
        self.limits.detects = mode == 1
        return NO_ERROR

    def end_limiting(self) -> int:
        """Deactivate limit and detection; returns 16#8046 while the axis is clamped (MC-550)."""
        if self.limits.clamped:
            return ERROR_CLAMPED
        if self.limits.limiting:
            self.limits.limiting = self.limits.detects = False
            if self.limits.limit_nm is not None:
                self.limits.limit_nm = None
                self._note_limit()
            if self._servo.port.has_torque_reduction:
                self._servo.port.limit_torque(None)
            self._control_words.travel_to_fixed_stop(False)
        return NO_ERROR

    def _note_limit(self) -> None:
        limit = self.limits.limit_nm
        if self._history is not None:
            self._history.emit(
                self._name,
                "axis.torque_limit",
                active=limit is not None,
                limit=0.0 if limit is None else limit,
            )

    def end_all(self) -> None:
        """Take every torque function back, also at a fixed stop: the controller leaves RUN."""
        self.limits.clamped = False
        self.set_additive(None)
        if self.limits.range_nm is not None:
            self.end_range()
        self.end_limiting()

    def _at_motor(self, limit: float) -> float:
        """Return a limit as torque at the motor, Nm (STP-133, STP-137 to STP-142)."""
        return float(self._default.value if limit < 0.0 else limit * self._limit_unit) * self._per_limit

    # -- what it means for the others
    # -----------------------------------------------------------------------------

    @property
    def in_limitation(self) -> bool:
        """Whether the drive works at its torque limit (`StatusWord.X27`; MC-532, STP-157)."""
        port = self._servo.port
        if self.limits.limiting:
            return port.torque_limit_reached
        if self.limits.range_nm is None:
            return False
        if port.has_torque_reduction:
            return port.torque_limit_reached
        upper, lower = self.limits.range_nm
        torque = self._sign * port.actual_torque_nm
        return torque > _THRESHOLD * upper if torque > 0.0 else torque < _THRESHOLD * lower

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system."""
        self._clamp_position += offset

    # -- cycle
    # ------------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Watch for the fixed stop; runs after the position controller."""
        if not self.limits.clamped:
            if self._states.state is AxisState.MOTION and self._servo.position_controlled:
                error = self._servo.controller.following_error
                if abs(error) > self._deviation.value:
                    self._clamp(1.0 if error > 0.0 else -1.0)
            return
        if not self._states.facts.controlled:
            self.limits.clamped = False  # switched off, nothing is held any more
            return
        moved = self._servo.feedback.position - self._clamp_position
        if abs(moved) <= self._tolerance.value:
            return
        self.limits.clamped = False
        if not (self._states.state is AxisState.MOTION and moved * self.limits.direction < 0.0):
            self._alarms.raise_alarm(ALARM_CLAMPING)

    def _clamp(self, direction: float) -> None:
        """The stop is reached: jobs end, the setpoint stays where it is (STP-165)."""
        motion = self._motion
        self.limits.clamped = True
        self.limits.direction = direction
        self._clamp_position = self._servo.feedback.position
        motion.abort_all()
        motion.gen.set_state(motion.gen.s, 0.0)
        motion.come_to_rest()
