"""`MC_Home` (section 2.3 of the instruction specification, §5.11)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Final

from motion.kernel.mechanics import INCREMENTAL
from motion.s7.axis.external_encoder import ExternalEncoder
from motion.s7.axis.homing import ActiveHoming, PassiveHoming, abort_passive
from motion.s7.axis.jobs import (
    ERROR_ABSOLUTE,
    ERROR_ACCELERATION,
    ERROR_ACTUAL_VALUE,
    ERROR_ALARM,
    ERROR_DECELERATION,
    ERROR_INCREMENTAL,
    ERROR_JERK,
    ERROR_LOCKED,
    ERROR_MODE,
    ERROR_NOT_CONTROLLED,
    ERROR_POSITION,
    ERROR_SENSOR,
    ERROR_STATE,
    NO_ERROR,
    Job,
    JobClass,
    JobState,
)
from motion.s7.axis.state import AxisState
from motion.s7.instructions.base import ExecuteInstruction
from motion.s7.instructions.dynamics import POSITION_LIMIT, is_dynamic, is_number, is_whole

if TYPE_CHECKING:
    from motion.s7.axis.axis import PositioningAxis

_ACTIVE: Final = frozenset((3, 5))
_PASSIVE: Final = frozenset((2, 8, 10))
_CANCEL: Final = 9
_DIRECT: Final = frozenset((0, 1, 6, 7, 11, 12, 13))
_CONFIGURED: Final = frozenset((5, 10))
"""Modes with `Homing.HomePosition` in place of `Position`."""
_ADJUSTS: Final = frozenset((6, 7, 13))
_SENSORS: Final = 4


class MC_Home(ExecuteInstruction):
    """Relate the position of a technology object to the machine.

    Inputs: `Execute`; `Position`, axis unit; `Mode`: 0 and 1 direct (absolute, relative), 2, 8 and 10
    passive, 3 and 5 active, 9 ends a passive homing, 6 and 7 absolute encoder, 11 and 12 position setpoint,
    13 incremental encoder; `Sensor`: encoder for modes 6, 7 and 13, 0 = the operative one. Outputs:
    `ReferenceMarkPosition`, axis unit, and the common ones.
    """

    instruction = "MC_Home"
    object_types = ("PositioningAxis", "ExternalEncoder")
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Position": 0.0, "Mode": 0, "Sensor": 0}
    Position: float
    Mode: int
    Sensor: int
    axis: PositioningAxis | ExternalEncoder  # type: ignore[assignment]

    def __init__(self, axis: Any, *, name: str | None = None, **inputs: float) -> None:
        self.ReferenceMarkPosition = 0.0
        self._reference = 0.0
        self.dynamics: tuple[float, float, float] | None = None
        """Acceleration, deceleration, jerk of active homing, axis units; None =
        the dynamic defaults (COM-042).
        """
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        axis = self.axis
        mode = self.Mode
        if axis.state is AxisState.RESTARTING:
            return ERROR_STATE
        if not is_whole(mode):
            return ERROR_MODE
        if mode == _CANCEL:
            return self._cancel()
        moves = axis.object_type != "ExternalEncoder"
        if mode not in _DIRECT and mode not in _PASSIVE and not (moves and mode in _ACTIVE):
            return ERROR_MODE
        if not is_number(self.Position, POSITION_LIMIT):
            return ERROR_POSITION
        if self._refuses():
            return ERROR_NOT_CONTROLLED
        if mode in _DIRECT:
            return self._home_directly()
        if not axis.sensor_valid:
            return ERROR_ACTUAL_VALUE
        position = axis.variables.read("Homing.HomePosition") if mode in _CONFIGURED else self.Position
        return self._home_passively(position) if mode in _PASSIVE else self._home_actively(position)

    # -- without motion
    # -----------------------------------------------------------------------------------------

    def _refuses(self) -> bool:
        """Return whether the axis follows a velocity without position control (SYN-422)."""
        axis = self.axis
        if isinstance(axis, ExternalEncoder):
            return False
        follows = axis.motion.moving_job is JobClass.GEAR_IN_VELOCITY
        return follows and not axis.servo.position_controlled

    def _home_directly(self) -> Job | int:
        axis = self.axis
        number = axis.operative_sensor
        if self.Mode in _ADJUSTS and self.level.technology:
            if self.Sensor not in range(_SENSORS + 1) or self.Sensor > len(axis.sensors):
                return ERROR_SENSOR
            number = self.Sensor or number
        sensor = axis.sensors[number - 1]
        if not (axis.sensor_valid if sensor is axis.feedback else sensor.state == axis.feedback.state):
            return ERROR_ACTUAL_VALUE
        if self.Mode in _ADJUSTS:
            absolute = sensor.scale.kind != INCREMENTAL
            if absolute is (self.Mode == 13):
                return ERROR_ABSOLUTE if absolute else ERROR_INCREMENTAL
        refusal = self._uncontrolled()
        if refusal:
            return refusal
        if self.Mode == 13 and self._blocked():
            return ERROR_ALARM
        job = self._accepted(JobClass.NONE)
        axis.home(self.Mode, self.Position, number if self.Mode in _ADJUSTS else 0)
        self._reference = sensor.position
        job.finish()
        return job

    def _uncontrolled(self) -> int:
        axis = self.axis
        if "PositioningAxis" not in axis.kinds:
            return NO_ERROR
        enabled_without = axis.states.facts.controlled and not axis.servo.position_controlled  # type: ignore[union-attr]
        return ERROR_NOT_CONTROLLED if enabled_without else NO_ERROR

    def _blocked(self) -> bool:
        axis = self.axis
        if "PositioningAxis" not in axis.kinds:
            return bool(axis.engine.error_word)
        return axis.alarms.blocking  # type: ignore[union-attr]

    # -- with a homing mark
    # -------------------------------------------------------------------------------------

    def _home_actively(self, position: float) -> Job | int:
        axis: PositioningAxis = self.axis  # type: ignore[assignment]
        bind = axis.variables.bind
        job = Job(JobClass.HOMING, instruction=self.instruction, name=self.name)
        job.acceleration = bind("DynamicDefaults.Acceleration").value
        job.deceleration = bind("DynamicDefaults.Deceleration").value
        job.jerk = bind("DynamicDefaults.Jerk").value
        if self.dynamics is not None:
            factor = axis.variables.factors.acceleration
            job.acceleration, job.deceleration = (factor * value for value in self.dynamics[:2])
            job.jerk = factor * self.dynamics[2]
        if not is_dynamic(job.acceleration):
            return ERROR_ACCELERATION
        if not is_dynamic(job.deceleration):
            return ERROR_DECELERATION
        if not is_dynamic(job.jerk, zero=True):
            return ERROR_JERK
        job.position_controlled = True
        assert axis.position is not None  # an axis with positions only is homed actively
        homing = ActiveHoming(
            axis, job, position, self.Mode, motion=axis.motion, limits=axis.position.hardware
        )
        refusal = axis.motion.submit(job)
        self._reference = homing.reference
        if not refusal:
            self._take_encoder()
        return refusal or job

    def _home_passively(self, position: float) -> Job | int:
        axis = self.axis
        if self._blocked():
            return ERROR_ALARM
        if self._locked():
            return ERROR_LOCKED
        refusal = self._uncontrolled()
        if refusal:
            return refusal
        abort_passive(axis.homings)
        self._take_encoder()
        job = self._accepted(JobClass.PASSIVE_HOMING)
        self._reference = PassiveHoming(axis, job, position, self.Mode).reference
        return job

    def _locked(self) -> bool:
        axis = self.axis
        if "PositioningAxis" not in axis.kinds:
            return not axis.enabling.enabled
        return not axis.states.facts.enabled or axis.motion.stopping  # type: ignore[union-attr]

    def _cancel(self) -> Job:
        job = self._accepted(JobClass.NONE)
        abort_passive(self.axis.homings)
        self._take_encoder()
        job.finish()
        return job

    def _take_encoder(self) -> None:
        """End the measuring jobs on the encoder (OVR-041)."""
        for notify in self.axis.on_homing:
            notify()

    def _accepted(self, job_class: JobClass) -> Job:
        axis = self.axis
        job = Job(job_class, instruction=self.instruction, name=self.name)
        job.start(axis.name, axis.history)
        job.activate()
        return job

    def _show(self, job: Job) -> None:
        if job.state is JobState.DONE:
            self.ReferenceMarkPosition = self._reference
        super()._show(job)
