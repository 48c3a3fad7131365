"""Jobs: what an `MC_` instruction has handed to the axis (section 1.3 of the instruction specification)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from fieldbus.history import History, Scalar
    from motion.kernel.synchronous import Coupling, Leaving, Shift, Waiting

NO_ERROR: Final = 0x0000
ERROR_ALARM: Final = 0x8001
ERROR_REFERENCE: Final = 0x8002
ERROR_VELOCITY: Final = 0x8003
ERROR_ACCELERATION: Final = 0x8004
ERROR_DECELERATION: Final = 0x8005
ERROR_JERK: Final = 0x8006
ERROR_DIRECTION: Final = 0x8007
ERROR_DISTANCE: Final = 0x8008
ERROR_POSITION: Final = 0x8009
ERROR_MODE: Final = 0x800A
ERROR_STOP_MODE: Final = 0x800B
ERROR_SECOND_INSTANCE: Final = 0x800C
ERROR_STATE: Final = 0x800D
ERROR_RESTART_ENABLED: Final = 0x800E
ERROR_LOCKED: Final = 0x800F
ERROR_INCREMENTAL: Final = 0x8010
ERROR_ABSOLUTE: Final = 0x8011
ERROR_CONTROL_PANEL: Final = 0x8012
"""A control panel has the axis (MC-004)."""
ERROR_JOB_MEMORY: Final = 0x8014
ERROR_CONFIGURATION: Final = 0x8015
ERROR_ACTUAL_VALUE: Final = 0x8016
ERROR_NUMERATOR: Final = 0x8017
ERROR_DENOMINATOR: Final = 0x8018
ERROR_CIRCLE: Final = 0x8019
"""The leading axis follows the following axis already (SYN-018)."""
ERROR_MASTER_OFFSET: Final = 0x8021
ERROR_SLAVE_OFFSET: Final = 0x8022
ERROR_MASTER_SCALING: Final = 0x8023
ERROR_SLAVE_SCALING: Final = 0x8024
ERROR_LEADING_DISTANCE: Final = 0x8026
ERROR_APPLICATION_MODE: Final = 0x8027
ERROR_MASTER_SYNC_POSITION: Final = 0x8034
ERROR_SLAVE_SYNC_POSITION: Final = 0x8035
ERROR_SYNC_PROFILE: Final = 0x8036
ERROR_SLAVE_POSITION: Final = 0x8037
ERROR_LIMIT: Final = 0x8043
ERROR_NO_TORQUE_REDUCTION: Final = 0x8044
ERROR_POSITION_CONTROL: Final = 0x8045
ERROR_CLAMPED: Final = 0x8046
ERROR_INTO_STOP: Final = 0x8047
ERROR_ADDITIVE_TORQUE: Final = 0x804A
ERROR_UPPER_TORQUE: Final = 0x804B
ERROR_LOWER_TORQUE: Final = 0x804C
ERROR_TORQUE_RANGE: Final = 0x804D
ERROR_EXCLUSIVE_TORQUE: Final = 0x804E
ERROR_NO_TORQUE_DATA: Final = 0x804F
ERROR_SENSOR: Final = 0x8050
ERROR_REFERENCE_SENSOR: Final = 0x8051
ERROR_STW_MASK: Final = 0x8055
ERROR_LIMIT_SWITCH: Final = 0x805B
ERROR_DIRECT_CONNECTION: Final = 0x805D
ERROR_PHASE_SHIFT: Final = 0x8070
ERROR_NOT_CONTROLLED: Final = 0x8071
ERROR_HOMING: Final = 0x8074
ERROR_NO_SYNCHRONOUS: Final = 0x8075
"""No synchronous job is active on the axis (SYN-330)."""
ERROR_SIMULATED: Final = 0x8076
"""The synchronous operation of the axis is simulated (SYN-331)."""
ERROR_NO_GEAR: Final = 0x8077
"""No `MC_GearIn` or `MC_GearInPos` waits or is active (SYN-208)."""
ERROR_NO_CAM: Final = 0x8078
"""No `MC_CamIn` waits or is active."""
ERROR_VELOCITY_GEARING: Final = 0x8079
"""The axis follows a velocity without position control (SYN-174)."""
ERROR_OFFSET: Final = 0x8080
ERROR_OFFSET_DISTANCE: Final = 0x8081
ERROR_PHASING_DISTANCE: Final = 0x8082
ERROR_PROFILE: Final = 0x8083
ERROR_START_POSITION: Final = 0x8084
ERROR_OTHER_SHIFT: Final = 0x808A
"""The other value of the synchronous job is being shifted (SYN-335)."""
ERROR_NO_CAMMING: Final = 0x808B
"""There is no camming at whose end another cam could begin (CAM-135)."""
ERROR_LEADING_REVERSED: Final = 0x808C
"""The leading value has turned round on the way of a shift (SYN-337)."""
ERROR_FOLLOWS: Final = 0x80A1
"""An axis whose positions follow a leading value is not homed actively (SYN-279)."""
ERROR_CAMMING: Final = 0x80A8
"""During camming a phase is shifted over a way of the leading value alone (SYN-178)."""
ERROR_NOT_SYNCHRONOUS: Final = 0x80A9
ERROR_SYNC_POSITION_OUTSIDE: Final = 0x80AD
ERROR_CARD_FULL: Final = 0x80EB
ERROR_CARD_WRITE: Final = 0x80EC
ERROR_SAVE_INSTANCES: Final = 0x80ED
ERROR_SAVE_RUNNING: Final = 0x80EE
ERROR_CARD_PROTECTED: Final = 0x80EF
ERROR_UNSPECIFIED: Final = 0x8FFF


class JobState(IntEnum):
    """State of a job (MC-052 to MC-057)."""

    WAITING = 0
    ACTIVE = 1
    DONE = 2
    ABORTED = 3
    ERROR = 4


_ACTIVE: Final = JobState.ACTIVE


class JobClass(IntEnum):
    """Column of the override table that an active job belongs to (table 3.1)."""

    HALT_BASIC = 0
    """`MC_Halt` with `Mode` 1 (column H3)."""
    POSITIONING = 1
    """`MC_MoveAbsolute`, `MC_MoveRelative` in control (H3)."""
    VELOCITY = 2
    """`MC_MoveVelocity`, `MC_MoveJog` (H3)."""
    HALT = 3
    """`MC_Halt` with `Mode` 0 (H5)."""
    STOP = 4
    """`MC_Stop` (H6)."""
    SUPERIMPOSED = 5
    """`MC_MoveSuperimposed`, `MC_HaltSuperimposed`, `MC_MotionInSuperimposed` (H7)."""
    MOTION_IN = 6
    """`MC_MotionInVelocity`, `MC_MotionInPosition` (H8)."""
    HOMING = 7
    """`MC_Home` with `Mode` 3 or 5 (H2)."""
    PASSIVE_HOMING = 8
    """`MC_Home` with `Mode` 2, 8 or 10 (H1); it waits while another job is in control."""
    GEAR_IN = 9
    """`MC_GearIn` (S1)."""
    GEAR_IN_VELOCITY = 10
    """`MC_GearInVelocity` (S2)."""
    NONE = 11
    """No motion: not in the table."""
    SYNCHRONISE = 12
    """`MC_GearInPos`, `MC_CamIn` (waiting S3, active S4)."""
    DESYNCHRONISE = 13
    """`MC_GearOut`, `MC_CamOut` (waiting S8, active S9)."""


_WITHOUT_DYNAMICS: Final = frozenset(
    (JobClass.MOTION_IN, JobClass.HOMING, JobClass.PASSIVE_HOMING, JobClass.NONE)
)
"""Jobs without dynamic values, or whose values change on the way."""


class Job:
    """One execution of a motion instruction.

    The axis moves the state; the instruction instance reads it at its next call.
    """

    __slots__ = (
        "abort_acceleration",
        "acceleration",
        "append",
        "begin",
        "cam_number",
        "coupling",
        "current",
        "deceleration",
        "direction",
        "distance",
        "entry",
        "error_id",
        "follows",
        "function",
        "history",
        "in_velocity",
        "instruction",
        "jerk",
        "job_class",
        "keeps_superimposed",
        "leader_number",
        "leaving",
        "mode",
        "name",
        "offset",
        "on_end",
        "position_controlled",
        "positions",
        "relative",
        "released",
        "source",
        "state",
        "synchronous",
        "target",
        "velocity",
    )

    def __init__(self, job_class: JobClass, *, instruction: str, name: str) -> None:
        self.job_class = job_class
        self.instruction = instruction
        self.name = name
        self.source = ""
        self.state = JobState.WAITING
        self.error_id = NO_ERROR
        self.in_velocity = False
        self.velocity = 0.0
        """Requested velocity after resolution of defaults, signed for velocity
        jobs, before override and limits.
        """
        self.acceleration = 0.0
        self.deceleration = 0.0
        self.jerk = 0.0
        """0 = no jerk limit."""
        self.target = 0.0
        """Absolute target position (positioning)."""
        self.direction = 0
        """Way to the target on a modulo axis: 1 positive, 2 negative, 3 shortest; 0: the target is no place
        in the range.
        """
        self.positions = job_class is JobClass.POSITIONING
        """It goes to `target`; otherwise it keeps `velocity`. Homing does one after the other."""
        self.begin: Callable[[], object] | None = None
        """What homing does when the job gets control."""
        self.distance = 0.0
        self.relative = False
        self.append = False
        """`BufferMode` 1."""
        self.abort_acceleration = False
        self.mode = 0
        self.position_controlled: bool | None = None
        """Position control forced on or off by the job; None leaves it."""
        self.current = False
        """Keep the velocity found at the start (`MC_MoveVelocity.Current`)."""
        self.released = False
        """Jog input gone: the job brakes to zero and then ends by itself."""
        self.coupling: Coupling | None = None
        """What a synchronous job makes of its leading value."""
        self.offset: Shift | None = None
        """Shift of the following value of `coupling`, axis unit; None: there has been none."""
        self.leader_number = 0
        """Number of the data block of the leading object of `coupling`."""
        self.entry: Waiting | None = None
        """The same, as one that waits for its start (`MC_GearInPos`, `MC_CamIn`)."""
        self.leaving: Leaving | None = None
        """The same, as one that waits for its end (`MC_GearOut`, `MC_CamOut`)."""
        self.keeps_superimposed = False
        """Superimposed motion goes on when the job takes over (`MC_CamIn` at the end of a cam, SYN-260)."""
        self.function = 0
        """`StatusSynchronizedMotion.FunctionState` of a synchronous job (SYN-034)."""
        self.follows: Mapping[str, Scalar] | None = None
        """What a synchronous job follows, and by which function, for the event log; None: nothing."""
        self.cam_number = 0
        """Number of the data block of its cam; 0 without one."""
        self.on_end: Callable[[], object] | None = None
        """Called once the job has ended."""
        self.synchronous = False
        """The axis moves as its leading value says."""
        self.history: History | None = None

    @property
    def busy(self) -> bool:
        """Whether the job waits or is in control."""
        return self.state <= _ACTIVE

    def _log(self, kind: str) -> None:
        if self.history is not None:
            self.history.emit(
                self.source, kind, job=self.name, instruction=self.instruction, error_id=self.error_id
            )

    def start(self, source: str, history: History | None) -> None:
        """Record the acceptance by axis `source`."""
        self.source = source
        self.history = history
        if history is not None:
            history.emit(
                source,
                "job.started",
                job=self.name,
                instruction=self.instruction,
                error_id=self.error_id,
                **self._asked(),
            )

    def _asked(self) -> dict[str, float]:
        """Return what a motion job is given: its way and its dynamic values, in the units of the runtime."""
        cls = self.job_class
        if cls is JobClass.STOP:
            asked: dict[str, float] = {"mode": self.mode}
        elif cls in _WITHOUT_DYNAMICS or self.deceleration == 0.0:
            return {}
        else:
            asked = {}
        if self.deceleration:
            asked |= {"acceleration": self.acceleration, "deceleration": self.deceleration, "jerk": self.jerk}
        if cls is JobClass.POSITIONING or cls is JobClass.VELOCITY or cls is JobClass.SUPERIMPOSED:
            asked["velocity"] = self.velocity
        if cls is JobClass.SUPERIMPOSED or (cls is JobClass.POSITIONING and self.relative):
            asked["distance"] = self.distance
        elif cls is JobClass.POSITIONING:
            asked["position"] = self.target
            if self.direction:
                asked["direction"] = self.direction
        return asked

    def activate(self) -> None:
        """Take control (MC-060)."""
        self.state = JobState.ACTIVE
        self._log("job.active")
        if self.follows is not None and self.history is not None:
            self.history.emit(self.source, "axis.follows", job=self.name, **self.follows)

    def set_in_velocity(self, reached: bool) -> None:
        """Show that the commanded velocity is reached, or left again."""
        if reached is not self.in_velocity:
            self.in_velocity = reached
            self._log("job.in_velocity" if reached else "job.leaves_velocity")

    def set_synchronous(self) -> None:
        """Show that the axis has reached its leading value."""
        self.synchronous = True
        self._log("job.synchronous")

    def finish(self) -> None:
        """End successfully."""
        if self.busy:
            self.state = JobState.DONE
            self.in_velocity = self.synchronous = False
            self._log("job.done")
            self._release()

    def abort(self) -> None:
        """End because another job or the disabling took over."""
        if self.busy:
            self.state = JobState.ABORTED
            self.in_velocity = self.synchronous = False
            self._log("job.aborted")
            self._release()

    def fail(self, error_id: int) -> None:
        """End with an error."""
        if self.busy:
            self.state = JobState.ERROR
            self.error_id = error_id
            self.in_velocity = self.synchronous = False
            self._log("job.error")
            self._release()

    def _release(self) -> None:
        if self.on_end is not None:
            self.on_end()
