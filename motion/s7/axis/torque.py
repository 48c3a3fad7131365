"""Torque data of an axis: additive torque, torque range, torque limiting, fixed stop (section 2.17 of the
instruction specification).

The values go to the drive as shares of `Actor.DriveParameter.ReferenceTorque`, which has to be p2003 of the
drive. Of a linear motor they are forces, N, where torques are named below, and shares of
`Actor.LinearMotorDriveParameter.ReferenceForce` (VAR-132).
"""

from __future__ import annotations

from math import tau
from typing import TYPE_CHECKING, Final

from motion.kernel.torque_precontrol import TorquePrecontrol
from motion.s7.axis.jobs import (
    ERROR_ADDITIVE_TORQUE,
    ERROR_ALARM,
    ERROR_CLAMPED,
    ERROR_EXCLUSIVE_TORQUE,
    ERROR_INTO_STOP,
    ERROR_LIMIT,
    ERROR_LOCKED,
    ERROR_LOWER_TORQUE,
    ERROR_MODE,
    ERROR_NO_TORQUE_DATA,
    ERROR_NO_TORQUE_REDUCTION,
    ERROR_NOT_CONTROLLED,
    ERROR_POSITION_CONTROL,
    ERROR_TORQUE_RANGE,
    ERROR_UPPER_TORQUE,
    NO_ERROR,
    Job,
    JobClass,
)
from motion.s7.axis.state import AxisState
from motion.s7.units import millimetres

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

ALARM_CLAMPING: Final = 542
TORQUE_DATA: Final = "Actor.Interface.EnableTorqueData"

LIMIT_RANGE: Final = 2147483648.0
"""Greatest magnitude of `MC_TorqueLimiting.Limit` (STP-603)."""
TORQUE_RANGE: Final = 1.0e12
"""Greatest magnitude of the other torque inputs."""
_THRESHOLD: Final = 0.9
"""Share of a limit of telegram 750 from which on it counts as reached (MC-532)."""
_BY_VELOCITY: Final = ("MC_MoveVelocity", "MC_MoveJog", "MC_MotionInVelocity")
"""Jobs whose direction is that of their velocity."""


def _limit_scale(axis: TechnologyAxis, *, linear_motor: bool) -> tuple[float, str]:
    """Return the torque at the motor, Nm, per Nm or N of a limit, and which of the two it is (STP-138 to
    STP-142).
    """
    read = axis.variables.read
    if linear_motor:
        return 1.0, "Force"
    if read("TorqueLimiting.LimitBase") == 0:
        return 1.0, "Torque"
    ratio = read("LoadGear.Denominator") / read("LoadGear.Numerator") / (read("Actor.Efficiency") or 1.0)
    if not axis.has_position or read("Properties.MotionType") == 1:
        return ratio, "Torque"
    lead_m = read("Mechanics.LeadScrew") * millimetres(read("Units.LengthUnit")) * 1.0e-3
    return ratio * lead_m / tau, "Force"


class TorqueControl:
    """See the module. One object per axis; `step` runs once per application cycle.

    Args:
        axis: The axis.

    """

    __slots__ = (
        "_axis",
        "_clamp_position",
        "_default",
        "_deviation",
        "_direction",
        "_limit_unit",
        "_monitored",
        "_per_limit",
        "_precontrol",
        "_reference",
        "_selected",
        "_sign",
        "_tolerance",
        "_unit",
        "additive",
        "clamped",
        "detects",
        "limit_nm",
        "limiting",
        "precontrolled_nm",
        "range_nm",
        "sends",
    )  # fmt: skip

    def __init__(self, axis: TechnologyAxis) -> None:
        self._axis = axis
        store = axis.variables
        bind = store.bind
        linear_motor = axis.has_position and store.read("Actor.MotorType") == 1
        self._reference = bind(
            "Actor.LinearMotorDriveParameter.ReferenceForce"
            if linear_motor
            else "Actor.DriveParameter.ReferenceTorque"
        )
        self._per_limit, quantity = _limit_scale(axis, linear_motor=linear_motor)
        self._default = bind(f"TorqueLimiting.LimitDefaults.{quantity}")
        factors = store.factors
        self._limit_unit = factors.of(quantity.lower())
        self._unit = factors.force if linear_motor else factors.torque
        self._monitored = bind("TorqueLimiting.PositionBasedMonitorings")
        self._sign = -1.0 if store.read("Actor.InverseDirection") else 1.0
        if axis.has_position:
            self._deviation = bind("Clamping.FollowingErrorDeviation")
            self._tolerance = bind("Clamping.PositionTolerance")
        self._precontrol: TorquePrecontrol | None = None
        self._selected = bind(TORQUE_DATA)
        sends = axis.drive_port.has_torque_data and self._selected.value and not axis.simulated
        if axis.has_position and sends and store.read("TorquePreControl.Mode") == 1:
            self._precontrol = TorquePrecontrol(store)
        self.precontrolled_nm = 0.0
        """Share of the pre-control in what was sent last, Nm, before the direction of the drive counts."""
        self.sends = self._precontrol is not None
        """There is a torque to be sent: `output_nm` has to be called."""
        self.additive: float | None = None
        """`MC_TorqueAdditive.Value` in force, in Nm; None = the function is off."""
        self.range_nm: tuple[float, float] | None = None
        """Upper and lower limit of `MC_TorqueRange` in force, Nm; None = the function is off."""
        self.limiting = False
        """`MC_TorqueLimiting` is active (`StatusWord.X26`)."""
        self.limit_nm: float | None = None
        """Limit of `MC_TorqueLimiting` at the motor, Nm; None = none is sent."""
        self.detects = False
        """Fixed-stop detection is active (`Mode` 1)."""
        self.clamped = False
        """The drive is held at a fixed stop (`StatusWord.X30`)."""
        self._clamp_position = 0.0
        self._direction = 1.0

    @property
    def precontrols(self) -> bool:
        """Whether the acceleration setpoint gives a torque (`TorquePreControl.Mode`)."""
        return self._precontrol is not None

    # -- additive torque
    # ------------------------------------------------------------------------------------------

    @property
    def _has_data(self) -> bool:
        """Whether telegram 750 is connected (CFG-404)."""
        return self._axis.port.has_torque_data and bool(self._selected.value)

    def start_additive(self) -> int:
        """Return why `MC_TorqueAdditive` cannot start, 0 if it can (MC-512)."""
        axis = self._axis
        if not self._has_data:
            return ERROR_NO_TORQUE_DATA
        return ERROR_LOCKED if not axis.facts.enabled or self._axis.motion.stopping else NO_ERROR

    def set_additive(self, value: float | None) -> int:
        """Add a torque, in the torque unit, or none; returns the ErrorID of a value that is not permitted."""
        if value is not None and not abs(value) <= TORQUE_RANGE:
            return ERROR_ADDITIVE_TORQUE
        self.additive = None if value is None else value * self._unit
        self.sends = value is not None or self._precontrol is not None
        return NO_ERROR

    @property
    def total_additive_nm(self) -> float:
        """Additive torque that is sent, before the direction of the drive counts, Nm
        (`StatusTorqueData.TotalTorqueAdditive`).
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
        if self._axis.motion.stopping:
            return ERROR_LOCKED
        return ERROR_EXCLUSIVE_TORQUE if self.limiting else NO_ERROR

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
        if self.range_nm != limits:
            self.range_nm = limits
            self._send_range()
        return NO_ERROR

    def end_range(self) -> None:
        """Let the reference torque be the limit again (MC-529)."""
        self.range_nm = None
        self._send_range()

    def _send_range(self) -> None:
        reference = self._reference.value
        if self.range_nm is None or reference <= 0.0:
            self._axis.port.set_torque_range(1.0, -1.0)
            return
        upper, lower = self.range_nm
        if self._sign < 0.0:
            upper, lower = -lower, -upper
        self._axis.port.set_torque_range(upper / reference, lower / reference)

    # -- torque limiting
    # ------------------------------------------------------------------------------------------

    def start_limiting(self, mode: int) -> int:
        """Return why `MC_TorqueLimiting` cannot start with a `Mode`, 0 if it can (MC-536 to MC-541)."""
        axis = self._axis
        if axis.alarms.blocking:
            return ERROR_ALARM
        if self._axis.motion.stopping:
            return ERROR_LOCKED
        return ERROR_EXCLUSIVE_TORQUE if self.range_nm is not None else self._check_mode(mode)

    def _check_mode(self, mode: int) -> int:
        axis = self._axis
        if mode not in (0, 1) or (mode == 1 and not axis.has_position):
            return ERROR_MODE
        if mode == 0 and not axis.port.has_torque_reduction:
            return ERROR_NO_TORQUE_REDUCTION
        if mode == 1 and not axis.facts.enabled:
            return ERROR_LOCKED
        if mode == 1 and not axis.motion.position_controlled:
            return ERROR_NOT_CONTROLLED
        return NO_ERROR

    def set_limiting(self, limit: float, mode: int) -> int:
        """Activate or change limit and mode; returns the ErrorID of values that are not permitted (STP-134,
        STP-603).

        Args:
            limit: As `MC_TorqueLimiting.Limit`.
            mode: 0 limiting alone, 1 with fixed-stop detection.

        """
        if not abs(limit) <= LIMIT_RANGE:
            return ERROR_LIMIT
        if mode != int(self.detects) or not self.limiting:
            error = self._check_mode(mode)
            if error:
                return error
            if mode == 0 and self.clamped:
                return ERROR_CLAMPED
        axis = self._axis
        limit_nm = self._at_motor(limit) if axis.port.has_torque_reduction else None
        if limit_nm != self.limit_nm:
            self.limit_nm = limit_nm
            reference = self._reference.value
            if limit_nm is not None and reference > 0.0:
                axis.port.limit_torque(min(1.0, limit_nm / reference))
        if not self.limiting:
            axis.control_words.travel_to_fixed_stop(True)
        self.limiting = True
        self.detects = mode == 1
        return NO_ERROR

    def end_limiting(self) -> int:
        """Deactivate limit and detection; returns 16#8046 while the axis is clamped (MC-550)."""
        if self.clamped:
            return ERROR_CLAMPED
        if self.limiting:
            self.limiting = self.detects = False
            self.limit_nm = None
            if self._axis.port.has_torque_reduction:
                self._axis.port.limit_torque(None)
            self._axis.control_words.travel_to_fixed_stop(False)
        return NO_ERROR

    def end_all(self) -> None:
        """Take every torque function back, also at a fixed stop: the controller leaves RUN."""
        self.clamped = False
        self.set_additive(None)
        if self.range_nm is not None:
            self.end_range()
        self.end_limiting()

    def _at_motor(self, limit: float) -> float:
        """Return a limit as torque at the motor, Nm (STP-133, STP-137 to STP-142)."""
        return float(self._default.value if limit < 0.0 else limit * self._limit_unit) * self._per_limit

    # -- what it means for the others
    # -----------------------------------------------------------------------------

    @property
    def limits(self) -> bool:
        """Whether a torque limit or a torque range is active."""
        return self.limit_nm is not None or self.range_nm is not None

    @property
    def relaxes_monitoring(self) -> bool:
        """Whether position-related monitoring is suspended (STP-144, STP-184, MC-553)."""
        if self.clamped:
            return True
        return self.limits and self._monitored.value == 0

    @property
    def in_limitation(self) -> bool:
        """Whether the drive works at its torque limit (`StatusWord.X27`; MC-532, STP-157)."""
        axis = self._axis
        port = axis.port
        if self.limiting:
            return port.torque_limit_reached
        if self.range_nm is None:
            return False
        if port.has_torque_reduction:
            return port.torque_limit_reached
        upper, lower = self.range_nm
        torque = self._sign * port.actual_torque_nm
        return torque > _THRESHOLD * upper if torque > 0.0 else torque < _THRESHOLD * lower

    def refuses(self, job: Job) -> int:
        """Return why a motion job cannot start while a fixed stop is travelled to or held, 0 if it can
        (STP-600, STP-602).
        """
        if not self.detects:
            return NO_ERROR
        if job.position_controlled is False:
            return ERROR_POSITION_CONTROL
        if not self.clamped or job.job_class not in (
            JobClass.POSITIONING,
            JobClass.VELOCITY,
            JobClass.MOTION_IN,
        ):
            return NO_ERROR
        setpoint = self._axis.motion.gen.s
        if job.instruction in _BY_VELOCITY:
            way = job.velocity
        else:
            way = job.distance if job.relative else job.target - setpoint
        return ERROR_INTO_STOP if way * self._direction > 0.0 else NO_ERROR

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system."""
        self._clamp_position += offset

    # -- cycle
    # ------------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Watch for the fixed stop; runs after the position controller."""
        axis = self._axis
        motion = axis.motion
        if not self.clamped:
            if axis.state is AxisState.MOTION and motion.position_controlled:
                error = axis.controller.following_error
                if abs(error) > self._deviation.value:
                    self._clamp(1.0 if error > 0.0 else -1.0)
            return
        if not axis.facts.controlled:
            self.clamped = False  # switched off, nothing is held any more
            return
        moved = axis.feedback.position - self._clamp_position
        if abs(moved) <= self._tolerance.value:
            return
        self.clamped = False
        if not (axis.state is AxisState.MOTION and moved * self._direction < 0.0):
            axis.alarms.raise_alarm(ALARM_CLAMPING)

    def _clamp(self, direction: float) -> None:
        """The stop is reached: jobs end, the setpoint stays where it is (STP-165)."""
        axis = self._axis
        motion = axis.motion
        self.clamped = True
        self._direction = direction
        self._clamp_position = axis.feedback.position
        motion.abort_all()
        motion.gen.set_state(motion.gen.s, 0.0)
        motion.come_to_rest()
