"""The motion of an axis: which job is in control, what it makes of the setpoint, and when it ends.

Override tables, MC-265, STP-433 to STP-444.
"""

from __future__ import annotations

from math import copysign, inf, nan, sqrt
from typing import TYPE_CHECKING, Final

from motion.kernel.superposition import Superposition
from motion.kernel.synchronous import AdditiveValue
from motion.s7.axis.homing.passive import abort_passive
from motion.s7.axis.jobs import (
    ERROR_ALARM,
    ERROR_FOLLOWS,
    ERROR_INTO_STOP,
    ERROR_JOB_MEMORY,
    ERROR_LOCKED,
    ERROR_NO_CAM,
    ERROR_NO_GEAR,
    ERROR_NO_SYNCHRONOUS,
    ERROR_NOT_CONTROLLED,
    ERROR_NOT_SYNCHRONOUS,
    ERROR_POSITION_CONTROL,
    ERROR_SIMULATED,
    ERROR_STATE,
    ERROR_VELOCITY_GEARING,
    NO_ERROR,
    Job,
    JobClass,
    JobState,
)
from motion.s7.axis.shifts import ShiftJobs
from motion.s7.axis.state import ACCEPTS_MOTION, AxisState

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.kernel.cell import Cell
    from motion.kernel.monitoring import Monitoring
    from motion.kernel.servo_axis import ServoAxis
    from motion.kernel.synchronous import Coupling
    from motion.kernel.torque_limits import TorqueLimits
    from motion.s7.axis.alarms import AxisAlarms
    from motion.s7.axis.dynamic_limits import DynamicLimits
    from motion.s7.axis.homing.direct import Homing
    from motion.s7.axis.override import Overriding
    from motion.s7.axis.state import AxisStates, DriveCommand

ALARM_LEADING_VALUE: Final = 601
"""The leading object is no possible one of the axis, or gives no valid value (SYN-017, SYN-294, SYN-296)."""
ALARM_NOT_CONTROLLED: Final = 603
"""The setpoint of the leading axis has no positions: it is not position-controlled (SYN-025, SYN-311)."""
ALARM_SYNCHRONISING: Final = 608
"""The leading value has turned round before the axis had reached it (SYN-312)."""
_GEAR_OUT: Final = 4
"""`FunctionState` of `MC_GearOut`."""
_POSITIONS_FOLLOW: Final = (JobClass.SYNCHRONISE, JobClass.DESYNCHRONISE)
"""Jobs whose axis is not homed actively (SYN-279, OVR-099)."""
QUEUE_DEPTH: Final = 8
"""Waiting jobs per object (MC-265)."""

_LAST_RESORT: Final = 1.0e6
"""Deceleration of a stop for which every configured value is zero."""
_STOP_SEVERITY: Final = {0: 3, 2: 2, 3: 1}
"""Severity of `MC_Stop` by its mode (STP-433 to STP-435)."""
_BY_VELOCITY: Final = ("MC_MoveVelocity", "MC_MoveJog", "MC_MotionInVelocity")
"""Jobs whose direction is that of their velocity."""

PHASES: Final = ("none", "waiting", "synchronising", "synchronous", "desynchronising", "simulated")
"""Phases of synchronous operation, by their number in a recording."""
_NONE, _WAITING, _SYNCHRONISING, _SYNCHRONOUS, _DESYNCHRONISING, _SIMULATED = range(len(PHASES))

# Names of the module, because in every cycle an attribute of an enumeration would cost more than what is done
# with it.
_MOTION: Final = AxisState.MOTION
_STANDSTILL: Final = AxisState.STANDSTILL
_STOP_HOLD: Final = AxisState.STOP_HOLD
_ALARM_STANDSTILL: Final = AxisState.ALARM_STANDSTILL
_MOTION_IN: Final = JobClass.MOTION_IN
_SWITCHES_OFF: Final = (AxisState.ALARM_RAMP, AxisState.DISABLING_RAMP)
"""States after which the drive is switched off."""


def job_offset(job: Job | None) -> tuple[float, float, float]:
    """Return position, velocity and acceleration of the shift of the following value of a job."""
    offset = None if job is None else job.offset
    return (0.0, 0.0, 0.0) if offset is None else (offset.value, offset.velocity, offset.acceleration)


class MotionControl:
    """Job in control, waiting jobs and superimposed job of one axis, and the setpoint that they make.

    Args:
        name: Name of the axis.
        history: Event log, or None.
        servo: The axis in the kernel, whose basic and superimposed setpoints are led.
        states: State of the axis.
        command: Its control word.
        alarms: Its alarms.
        limits: Its dynamic limits.
        defaults: Deceleration and jerk of a stop without a job (`DynamicDefaults`).
        monitoring: Its monitoring, which says when an end position is reached; None without positions.
        torque: Its torque limits.
        homings: Active and passive homing under way.
        overriding: What its jobs do to each other, by the technology version.

    """

    def __init__(
        self,
        name: str,
        history: History | None,
        *,
        servo: ServoAxis,
        states: AxisStates,
        command: DriveCommand,
        alarms: AxisAlarms,
        limits: DynamicLimits,
        defaults: tuple[Cell[float], Cell[float]],
        monitoring: Monitoring | None,
        torque: TorqueLimits,
        homings: list[Homing],
        overriding: Overriding,
    ) -> None:
        self._overriding = overriding
        self._enters_over_motion_in = overriding.aborts(JobClass.SYNCHRONISE, JobClass.MOTION_IN)
        self._name = name
        self._history = history
        self._servo = servo
        self._states = states
        self._command = command
        self._alarms = alarms
        self._limits = limits
        self._default_deceleration, self._default_jerk = defaults
        self._monitoring = monitoring
        self._torque = torque
        self._homings = homings
        self.gen = servo.basic
        """Setpoint of the basic motion."""
        self.job: Job | None = None
        """Job in control, `MC_Stop` included."""
        self.queue: list[Job] = []
        """Jobs that wait for the one in control."""
        self.superimposed_job: Job | None = None
        """Job of the superimposed motion; it ends without one where its dynamic limits are zero."""
        self.entering: Job | None = None
        """Job that waits for the start of its synchronising (`MC_GearInPos`, `MC_CamIn`)."""
        self.leaving: Job | None = None
        """Job that waits for the start of its desynchronising (`MC_GearOut`, `MC_CamOut`)."""
        self.simulated: Job | None = None
        """Synchronous job in simulation: it goes on, and the axis does not follow it."""
        self.simulation_owner: object | None = None
        """Who simulates it."""
        self.shifts = ShiftJobs(name, history)
        """Job that shifts the leading or following value of the synchronous job in control."""
        self.additive = AdditiveValue()
        """What is added to every leading value that the axis follows."""
        self.severity = 0
        """Severity of the stop ramp in progress: 0 none, 1 current, 2 maximum, 3
        emergency (STP-432 to STP-435).
        """
        self.limits_assigned = False
        """A program has assigned variables since the last cycle; dynamic limits may be among them."""
        self._superimposed_before = 0.0
        self._carried = 0.0
        self._planned_velocity = 0.0
        self._planned_limits = (0.0, 0.0, 0.0)
        self._ramp = (0.0, 0.0)
        self._settling = False

    @property
    def stopping(self) -> bool:
        """Whether `MC_Stop` is in control."""
        job = self.job
        return job is not None and job.job_class is JobClass.STOP

    def power_down(self) -> None:
        """Stand at position 0 without motion and without position control; jobs have ended before."""
        self._sum_up()
        self.gen.set_state(0.0, 0.0)
        self._superimposed_before = 0.0
        self._servo.position_controlled = False
        self._leave_target()
        self.severity = 0

    # -- profiles -------------------------------------------------------------------------------------------

    def _plan_limits(self, job: Job, towards: float = 0.0) -> tuple[float, float, float]:
        """Return what `DynamicLimits.of` does, and remember that the motion is planned with
        it; `towards`: `_bound_acceleration`.
        """
        self._planned_limits = limits = self._limits.of(job)
        self._bound_acceleration(limits[2], towards)
        return limits

    def _bound_acceleration(self, jerk: float, towards: float = 0.0) -> None:
        """Let a present acceleration that `jerk` cannot end in time end at once, as far as needed (STP-119).

        What is carried over neither accelerates beyond the maximum velocity nor brakes through zero, unless
        the new motion leads there: `towards` is its velocity or way, 0 for a stop. This matters only after a
        ramp with a higher jerk or without jerk limit, an emergency ramp for example. What a jerk no higher
        than the new one has built up, on the way to the other side, is carried through zero (STP-116).
        """
        gen = self.gen
        a = gen.a
        if a == 0.0 or jerk <= 0.0:
            return
        v = gen.v
        if v * a >= 0.0:
            margin = max(0.0, self._limits.max_velocity.value - abs(v))
        elif 0.0 < gen.jerk <= jerk:
            return
        else:
            margin = abs(v) + (self._limits.max_velocity.value if towards * a > 0.0 else 0.0)
        bound = sqrt(2.0 * jerk * margin)
        if abs(a) > bound:
            gen.a = copysign(bound, a)

    def _plan_position(self, job: Job) -> None:
        velocity = self._planned_velocity = self._limits.velocity(job)
        towards = job.target - self.gen.s if velocity > 0.0 else 0.0
        acceleration, deceleration, jerk = self._plan_limits(job, towards)
        if velocity > 0.0:
            self.gen.start_position(job.target, velocity, acceleration, deceleration, jerk)
        else:
            # Override 0 %: the axis waits on its way and continues when the override does.
            self.gen.start_velocity(0.0, acceleration, deceleration, jerk)

    def _plan_velocity(self, job: Job) -> None:
        if job.released:
            self._limits.velocity_limited = False
        velocity = self._planned_velocity = 0.0 if job.released else self._limits.velocity(job)
        acceleration, deceleration, jerk = self._plan_limits(job, velocity)
        self.gen.start_velocity(velocity, acceleration, deceleration, jerk)

    def follow_limits(self) -> None:
        """Take velocity override and dynamic limits that have been assigned into the motion that runs
        (VAR-001, VAR-004).
        """
        servo = self._servo
        self.limits_assigned = False
        state = self._states.state
        if state is AxisState.MOTION or state is AxisState.HALTING:
            job, moving = self.job, servo.superimposed
            if job is not None and job.job_class is JobClass.MOTION_IN:
                job = None  # its setpoints know no limits (VAR-167)
            if moving is not None and moving.given:
                moving = None
            if (job is not None or moving is not None) and self._limits.are_zero():
                return
            if job is not None and not self._settling:
                self._follow_in_motion(job)
            if moving is not None and self.superimposed_job is not None:
                moving.change(*self._limits.of(self.superimposed_job))
        elif (
            self.severity
            and not (self.gen.done or self.gen.positioning)
            and self._ramp_limits() != self._planned_limits
        ):
            self._brake()

    def _follow_in_motion(self, job: Job) -> None:
        gen = self.gen
        if job.coupling is not None:
            self._planned_limits = self._limits.of(job)
            return
        changed = not gen.done and self._limits.of(job) != self._planned_limits
        cls = job.job_class
        if cls is JobClass.VELOCITY or (cls is JobClass.HOMING and not job.positions):
            if not job.released and self._limits.velocity(job) != self._planned_velocity:
                job.set_in_velocity(False)
                changed = True
            if changed:
                self._plan_velocity(job)
        elif job.positions:
            if changed or self._limits.velocity(job) != self._planned_velocity:
                self._plan_position(job)
        elif changed:
            _, deceleration, jerk = self._plan_limits(job)
            gen.start_stop(deceleration, jerk)

    def _repeat_warning(self) -> None:
        """Warn of a velocity that is still limited, in case it has been acknowledged (VAR-165)."""
        if not self._settling:
            self._limits.repeat_warning()

    def set_position_control(self, on: bool) -> None:
        """Close or open position control without a step of the speed setpoint."""
        servo = self._servo
        if on and not servo.position_controlled:
            servo.take_actual_position(self.gen.v, self.gen.a)
        servo.position_controlled = on

    # -- stops ----------------------------------------------------------------------------------------------

    def begin_stop(
        self, severity: int, deceleration: float, jerk: float, *, abort_acceleration: bool = False
    ) -> None:
        """Start a braking ramp from the setpoints with values that are limited by the dynamic limits.

        Args:
            severity: 1 current, 2 maximum dynamics.
            deceleration: Deceleration, axis unit per second squared; infinite for the limit.
            jerk: Jerk, axis unit per second cubed; 0 for none, infinite for the limit.
            abort_acceleration: Set a present acceleration to zero first.

        """
        self._sum_up()
        self.severity = severity
        self._leave_target()
        self._ramp = (deceleration, jerk)
        self._brake(abort_acceleration=abort_acceleration)

    def _ramp_limits(self) -> tuple[float, float, float]:
        """Return acceleration (none), deceleration and jerk of the braking ramp in
        progress, by the present limits.
        """
        limits = self._limits
        if self.severity == 3:
            return 0.0, limits.emergency.value or limits.max_deceleration.value or _LAST_RESORT, 0.0
        deceleration, jerk = self._ramp
        maximum = limits.max_jerk.value
        if maximum > 0.0 or jerk == inf:
            jerk = min(jerk, maximum)
        deceleration = min(deceleration, limits.max_deceleration.value)
        return 0.0, deceleration or limits.emergency.value or _LAST_RESORT, jerk

    def _brake(self, *, abort_acceleration: bool = False) -> None:
        """Plan the braking ramp of `begin_stop` or `begin_reaction` from the present setpoints."""
        _, deceleration, jerk = self._planned_limits = self._ramp_limits()
        self._bound_acceleration(jerk)
        self.gen.start_stop(deceleration, jerk, abort_acceleration=abort_acceleration)

    def begin_reaction(self, severity: int, *, abort_acceleration: bool = False) -> None:
        """Start the ramp of severity 1 (current), 2 (maximum) or 3 (emergency)
        dynamics (STP-386 to STP-388).
        """
        if severity == 3:
            self._switch_to_actual_values()
            self.severity = 3
            self._leave_target()
            self._brake()
        elif severity == 2:
            self.begin_stop(2, inf, inf, abort_acceleration=abort_acceleration)
        else:
            job = self.job
            if job is not None and job.deceleration > 0.0:
                self.begin_stop(1, job.deceleration, job.jerk)
            else:
                self.begin_stop(1, self._default_deceleration.value, self._default_jerk.value)

    def take_actual_values(self) -> None:
        """Let the setpoint start from the actual values, moved on by the
        transport delay (STP-123, STP-054).
        """
        self._sum_up()
        self._servo.take_actual_position(self._servo.actual_velocity)

    def _switch_to_actual_values(self) -> None:
        """Take the actual values; where a smoothing time is given, what the controller had to correct fades
        with it (STP-128).
        """
        servo = self._servo
        controlled = servo.has_position and servo.position_controlled
        difference = servo.controller.control_difference if controlled else 0.0
        self.take_actual_values()
        if controlled:
            servo.controller.absorb(difference)

    def _leave_target(self) -> None:
        """End the supervision of an end position that has not been reached for good yet: there is another
        motion (MON-027).
        """
        if self._settling:
            self._settling = False
            if self._monitoring is not None:
                self._monitoring.cancel()

    # -- setpoints from outside
    # -------------------------------------------------------------------------------

    def take_vector(self, job: Job, cycle_s: float) -> None:
        """Make what the user program has given the setpoint, without profile and limits (MC-473, MC-474)."""
        servo = self._servo
        gen = self.gen
        velocity = job.velocity
        if job.mode == 1:
            controlled = bool(job.position_controlled)
            if controlled is not servo.position_controlled and servo.has_position:
                self.set_position_control(controlled)
            gen.set_state(gen.s + velocity * cycle_s, velocity, job.acceleration)
        else:
            position = job.target
            if servo.modulo.enabled:
                position = servo.modulo.target(position, gen.s - job.distance, 3)
            gen.set_state(position + job.distance, velocity, job.acceleration)
            servo.controller.given = True

    # -- setpoints from a leading value
    # -------------------------------------------------------------------------------

    def _follow_leading_value(self, job: Job, cycle_s: float) -> None:
        """Make what the leading value asks for the setpoint; only the way there knows limits (SYN-103,
        SYN-107).
        """
        coupling = job.coupling
        assert coupling is not None  # every synchronous job has one
        gen = self.gen
        maximum = inf if coupling.by_velocity else self._limits.max_velocity.value  # SYN-106
        leaving = self.leaving
        watched = leaving is not None and coupling.synchronous
        if watched:
            before, slopes = (coupling.s, coupling.v, coupling.a), (coupling.slope, coupling.curvature)
        coupling.step(cycle_s, maximum, self._planned_limits)
        if not coupling.leading.valid:
            self._alarms.raise_alarm(ALARM_LEADING_VALUE)
            gen.advance(cycle_s)
            return
        if not job.synchronous:
            positions = coupling.leading.positions
            if positions is not None and not coupling.by_velocity and not positions():
                self._alarms.raise_alarm(ALARM_NOT_CONTROLLED)
                gen.advance(cycle_s)
                return
        if coupling.reversed:
            self._alarms.raise_alarm(ALARM_SYNCHRONISING)
            gen.advance(cycle_s)
            return
        if watched and leaving is not None and self._leaves(leaving, coupling, before, slopes, cycle_s):
            return
        offset = job.offset
        if offset is not None or self.shifts.job is not None:
            self._shift_values(job, coupling)
        s = coupling.s + self._carried
        if offset is None:
            gen.set_state(s, coupling.v, coupling.a)
        else:
            gen.set_state(s + offset.value, coupling.v + offset.velocity, coupling.a + offset.acceleration)
        if coupling.synchronous and not job.synchronous:
            job.set_synchronous()

    def _enter_when_due(self, job: Job, cycle_s: float) -> None:
        """Let a job that waits for its leading value take over where it comes (SYN-098)."""
        entry = job.entry
        assert entry is not None  # every job that waits here has one
        servo, limits = self._servo, self._limits
        total = servo.total
        acceleration, deceleration, jerk = limits.without_warning(job)
        maximum = limits.velocity_limit()
        reach = min(job.velocity, maximum)
        due = entry.due(
            cycle_s, (total.s, total.v, total.a), (reach, acceleration, deceleration, jerk, maximum)
        )
        if not entry.leading.valid:
            self._alarms.raise_alarm(ALARM_LEADING_VALUE)
            return
        if not due:
            return
        self.entering = None
        waiting, self.leaving = self.leaving, None
        if waiting is not None:
            waiting.abort()
        if servo.superimposed is None or not job.keeps_superimposed:
            self._abort_motion()
        else:
            self._abort_basic()
        if job.velocity > maximum:
            limits.repeat_warning()
        self._activate(job)

    def _leaves(
        self,
        job: Job,
        coupling: Coupling,
        before: tuple[float, float, float],
        slopes: tuple[float, float],
        cycle_s: float,
    ) -> bool:
        """Let a job take over that waits for the place from which the axis gets to its stop position
        (SYN-207); returns whether it does.
        """
        leaving = job.leaving
        assert leaving is not None  # every job that waits here has one
        total, gen = self._servo.total, self.gen
        shifted = job_offset(self.job)
        added = (
            total.s - gen.s + shifted[0] + self._carried,
            total.v - gen.v + shifted[1],
            total.a - gen.a + shifted[2],
        )
        if not leaving.due(cycle_s, coupling, before, slopes, added):
            return False
        self.leaving = None
        queue, self.queue = self.queue, []  # appended positioning goes on waiting (OVR-023)
        self._abort_motion()
        self.queue = queue
        self._activate(job)
        leaving.step(cycle_s, inf, self._planned_limits)
        self.gen.set_state(leaving.s, leaving.v, leaving.a)
        return True

    def limits_of(self, job: Job) -> tuple[float, float, float]:
        """Return acceleration, deceleration and jerk of a job after the dynamic limits, with their
        warnings.
        """
        return self._limits.of(job)

    @property
    def waiting_function(self) -> int:
        """`StatusSynchronizedMotion.WaitingFunctionState` (SYN-035)."""
        job = self.entering or self.leaving
        return 0 if job is None else job.function

    @property
    def synchronous_job(self) -> Job | None:
        """The synchronous job in control, or None."""
        job = self.job
        return job if job is not None and job.coupling is not None else None

    @property
    def following_job(self) -> Job | None:
        """The synchronous job in control, or the one in simulation; None without one."""
        return self.synchronous_job if self.simulated is None else self.simulated

    def synchronous_row(self) -> tuple[float, float, float, float, float, float, int]:
        """Return what a recording shows of synchronous operation: leading position and velocity that the
        function gets, what they differ by from the leading object, following position by the function, both
        positions of its zero, and the phase (`PHASES`).
        """
        job = self.following_job
        if job is None or job.coupling is None:
            entering = self.entering
            if entering is None or entering.entry is None:
                return (nan, nan, nan, nan, nan, nan, _NONE)
            leading = entering.entry.leading
            return (
                leading.position,
                leading.velocity,
                leading.position - leading.given,
                self.gen.s,
                0.0,
                0.0,
                _WAITING,
            )
        coupling, leading = job.coupling, job.coupling.leading
        beside = self._carried + (0.0 if job.offset is None else job.offset.value)
        if self.simulated is not None:
            phase = _SIMULATED
        elif job.job_class is JobClass.DESYNCHRONISE:
            phase = _DESYNCHRONISING
        else:
            phase = _SYNCHRONOUS if job.synchronous else _SYNCHRONISING
        return (
            leading.position,
            leading.velocity,
            leading.position - leading.given,
            coupling.s + beside,
            coupling.base_x,
            coupling.base_y + beside,
            phase,
        )

    # -- simulated synchronous operation (SYN section 7.8)

    def simulate(self, owner: object) -> int:
        """Let the synchronous job go on without moving the axis, or return the ErrorID of what prevents it;
        `owner` simulates it.
        """
        job = self.synchronous_job
        if job is None:
            return ERROR_NO_SYNCHRONOUS if self.entering is None else ERROR_NOT_SYNCHRONOUS
        if not job.synchronous:
            return ERROR_NOT_SYNCHRONOUS
        self.job = None
        self.simulated, self.simulation_owner = job, owner
        self.gen.set_state(self.gen.s, 0.0)
        if self._servo.superimposed is not None:
            self._servo.superimposed.refresh()
        self._next()
        return NO_ERROR

    def end_simulation(self) -> None:
        """Let the axis follow the simulated job again, with a step where it is elsewhere; one that is not
        enabled cannot, which ends the job (SYN-237, SYN-443).
        """
        job = self.simulated
        if job is None:
            return
        accepts = self._states.state in ACCEPTS_MOTION and not (self.stopping or self._alarms.blocking)
        if not accepts:
            self.abort_simulated()
            return
        self._abort_motion()
        self.simulated = self.simulation_owner = None
        self._activate(job, resumed=True)

    def abort_simulated(self) -> None:
        """End the simulation and its job with `CommandAborted`."""
        job = self._take_simulated()
        if job is not None:
            job.abort()

    def _take_simulated(self) -> Job | None:
        """End the simulation and what shifts its values; returns its job."""
        job = self.simulated
        if job is not None:
            self.simulated = self.simulation_owner = None
            if self.shifts.job is not None:
                self.shifts.end()
        return job

    def step_simulation(self, cycle_s: float) -> None:
        """Let the simulated job go on by one cycle."""
        job = self.simulated
        if job is None or job.coupling is None:
            return
        coupling = job.coupling
        coupling.step(cycle_s, inf, self._planned_limits)
        if not coupling.leading.valid:
            self._alarms.raise_alarm(ALARM_LEADING_VALUE)
            return
        self._shift_values(job, coupling)
        if coupling.ended:
            self._take_simulated()
            job.finish()

    def _shift_values(self, job: Job, coupling: Coupling) -> None:
        """Let the shifts of the following value go on, and what shifts a value."""
        if job.offset is not None:
            leading = coupling.leading
            job.offset.step(
                leading.effective_position,
                leading.effective_increment,
                leading.effective_velocity,
                leading.effective_acceleration,
            )
        if self.shifts.job is not None:
            self.shifts.step()

    @property
    def motion_in_state(self) -> int:
        """`StatusMotionIn.FunctionState`: 0 none, 1 velocity, 2 position (MIN-011)."""
        job = self.job
        return job.mode if job is not None and job.job_class is _MOTION_IN else 0

    @property
    def given(self) -> bool:
        """Whether setpoints come from the user program, basic or superimposed, or from a leading value."""
        job, moving = self.job, self._servo.superimposed
        return (job is not None and (job.job_class is _MOTION_IN or job.coupling is not None)) or (
            moving is not None and moving.given
        )

    @property
    def motion_in_exceeds(self) -> bool:
        """`StatusMotionIn.StatusWord.X0`: the given velocity is above the configured maximum (MIN-005)."""
        return self.motion_in_state != 0 and abs(self.gen.v) > self._limits.max_velocity.value

    # -- superimposed motion --------------------------------------------------------------------------------

    def _basic_velocity(self) -> float:
        """Return the velocity to which the basic motion accelerates, with its sign."""
        job = self.job
        if job is None or self._states.state is not AxisState.MOTION:
            return 0.0
        if job.coupling is not None:
            return self.gen.v
        velocity = self._planned_velocity
        return copysign(velocity, job.target - self.gen.s) if job.positions else velocity

    def _sum_up(self) -> None:
        """Make the basic setpoint the sum, from where one ramp can brake all of it."""
        servo = self._servo
        total, gen = servo.total, self.gen
        if total is not gen:
            gen.set_state(total.s, total.v, total.a)
            servo.total = gen

    def shift_coordinates(self, offset: float) -> None:
        """Let setpoints and a relative target follow a shift of the coordinate system."""
        servo = self._servo
        self.gen.shift(offset)
        self._shift_coupling(offset)
        if servo.fine is not None:
            servo.fine.shift(offset)
        if servo.superimposed is not None:
            servo.superimposed.refresh()
        servo.controller.shift(offset)

    def _shift_coupling(self, offset: float) -> None:
        job = self.following_job
        if job is not None and job.coupling is not None:
            job.coupling.shift(offset)

    def shift_target(self, offset: float) -> None:
        """Let the target of a relative positioning follow a shift of the
        coordinate system, and plan again.
        """
        job = self.job
        if job is not None and job.busy and job.relative:
            job.target += offset
        self.replan()

    @property
    def superimposed_distance(self) -> float:
        """What superimposed motions have covered since the axis was last
        without motion, axis unit (MC-353).
        """
        moving = self._servo.superimposed
        return self._superimposed_before + (moving.part.s if moving is not None else 0.0)

    @property
    def destination(self) -> float | None:
        """Where the motion ends by its own plan, axis unit; None if it has no target."""
        job, moving = self.job, self._servo.superimposed
        if job is None:
            return None if moving is None else self.gen.s + moving.part.s + moving.remaining
        if not job.positions:
            return None
        return job.target + (0.0 if moving is None else moving.part.s + moving.remaining)

    # -- acceptance -----------------------------------------------------------------------------------------

    def submit(self, job: Job) -> int:
        """Take `job` over, or return the ErrorID of its rejection (running jobs are then untouched)."""
        state = self._states.state
        if state is AxisState.RESTARTING:
            return ERROR_STATE
        if self._alarms.blocking:
            return ERROR_ALARM
        if state not in ACCEPTS_MOTION and state is not AxisState.ALARM_RAMP:
            return ERROR_LOCKED
        if state is AxisState.ALARM_RAMP and self._command.will_disable:
            return ERROR_LOCKED  # the ramp ends with the drive switched off (STP-396)
        active = self.job
        if self.stopping:
            return ERROR_LOCKED  # acknowledged before its end, the ramp still belongs to the stop (STP-415)
        refusal = self.refuses(job)
        if refusal:
            return refusal
        if job.coupling is not None and self.simulated is not None:
            return ERROR_SIMULATED
        if (
            job.coupling is not None
            and active is not None
            and not self._overriding.aborts(job.job_class, active.job_class)
        ):
            return ERROR_STATE  # before V9.0 setpoints from the program go on (SYN-458)
        if job.job_class is JobClass.HOMING and active is not None and active.job_class in _POSITIONS_FOLLOW:
            return ERROR_FOLLOWS
        self._abort_waiting(job)
        if job.append and active is not None:
            if len(self.queue) >= QUEUE_DEPTH:
                return ERROR_JOB_MEMORY
            job.start(self._name, self._history)
            self.queue.append(job)
            return NO_ERROR
        job.start(self._name, self._history)
        if active is not None and not self._overriding.aborts(job.job_class, active.job_class):
            # MC_Halt Mode 1 on top of MC_Halt Mode 0: without superimposed motion both end at the same zero
            # (OVR-089).
            self.queue.append(job)
            return NO_ERROR
        if self._homings and self._overriding.aborts(job.job_class, JobClass.PASSIVE_HOMING):
            abort_passive(self._homings)
        if self._servo.superimposed is None or self._overriding.aborts(
            job.job_class, JobClass.SUPERIMPOSED, append=job.append
        ):
            self._abort_motion()
        else:
            self._abort_basic()
        self._activate(job)
        return NO_ERROR

    def _abort_waiting(self, job: Job, *, waits: bool = False) -> None:
        """Abort the jobs that wait for their leading value, where the table says so; `waits`: the new one
        waits, too.
        """
        new, append = job.job_class, job.append
        entering, leaving = self.entering, self.leaving
        if entering is not None and self._overriding.aborts_waiting(
            new, JobClass.SYNCHRONISE, waits=waits, append=append
        ):
            self.entering = None
            entering.abort()
        if leaving is not None and self._overriding.aborts_waiting(
            new, JobClass.DESYNCHRONISE, waits=waits, append=append
        ):
            self.leaving = None
            leaving.abort()

    def submit_entry(self, job: Job) -> int:
        """Let `job` wait until the axis begins to synchronise, on top of what it does (SYN-096); or return
        the ErrorID of its rejection.
        """
        refusal = self._refuses_waiting() or self.refuses(job)
        if refusal:
            return refusal
        if self.moving_job is JobClass.GEAR_IN_VELOCITY and not self._servo.position_controlled:
            return ERROR_VELOCITY_GEARING  # SYN-174
        job.start(self._name, self._history)
        self._abort_waiting(job, waits=True)
        if self.queue:  # appended positioning waits, too (OVR-019)
            waiting, self.queue = self.queue, []
            for one in waiting:
                if one.append:
                    one.abort()
                else:
                    self.queue.append(one)
        self.entering = job
        return NO_ERROR

    def submit_leaving(self, job: Job, functions: tuple[int, ...]) -> int:
        """Let `job` wait until the axis has to leave its leading value; or return the ErrorID of its
        rejection.

        Args:
            job: Job with its `leaving`, or without one where it only ends jobs that wait (SYN-209).
            functions: `FunctionState` of the jobs that it may end.

        Returns:
            ErrorID; 16#8077 or 16#8078 where there is no such job (SYN-208).

        """
        refusal = self._refuses_waiting()
        if refusal:
            return refusal
        active, entering, leaving = self.synchronous_job, self.entering, self.leaving
        follows = active is not None and active.function in functions
        waits = entering is not None and entering.function in functions
        leaves = leaving is not None and leaving.function == job.function
        if not (follows or waits):
            return ERROR_NO_GEAR if job.function == _GEAR_OUT else ERROR_NO_CAM
        job.start(self._name, self._history)
        if waits and entering is not None:
            self.entering = None
            entering.abort()
        if leaves and leaving is not None:
            self.leaving = None
            leaving.abort()
        if job.leaving is None or not follows:
            job.activate()
            job.finish()
        else:
            self.leaving = job
        return NO_ERROR

    def _refuses_waiting(self) -> int:
        """Return why no job can wait for its leading value now, 0 if it can."""
        state = self._states.state
        if state is AxisState.RESTARTING:
            return ERROR_STATE
        if self.simulated is not None:
            return ERROR_SIMULATED
        if self._alarms.blocking:
            return ERROR_ALARM
        return ERROR_LOCKED if state not in ACCEPTS_MOTION or self.stopping else NO_ERROR

    def refuses(self, job: Job) -> int:
        """Return why a motion job cannot start while a fixed stop is travelled to or held, 0 if it can
        (STP-600, STP-602).
        """
        torque = self._torque
        if not torque.detects:
            return NO_ERROR
        if job.position_controlled is False:
            return ERROR_POSITION_CONTROL
        if not torque.clamped or job.job_class not in (
            JobClass.POSITIONING,
            JobClass.VELOCITY,
            JobClass.MOTION_IN,
        ):
            return NO_ERROR
        if job.instruction in _BY_VELOCITY:
            way = job.velocity
        else:
            way = job.distance if job.relative else job.target - self.gen.s
        return ERROR_INTO_STOP if way * torque.direction > 0.0 else NO_ERROR

    def submit_superimposed(self, job: Job) -> int:
        """Let `job` move the axis by its distance, or halt that, on top of what it does;
        or return an ErrorID (OVR-016).
        """
        servo = self._servo
        state = self._states.state
        if state is AxisState.RESTARTING:
            return ERROR_STATE
        if self._alarms.blocking:
            return ERROR_ALARM
        if state not in ACCEPTS_MOTION or self.stopping:
            return ERROR_LOCKED
        given = job.instruction == "MC_MotionInSuperimposed"
        if given and not servo.position_controlled:
            return ERROR_NOT_CONTROLLED
        if self.moving_job is JobClass.GEAR_IN_VELOCITY and not servo.position_controlled:
            return ERROR_NOT_CONTROLLED  # the basic motion has no positions (SYN-174)
        if self.moving_job is JobClass.HOMING:
            return ERROR_STATE  # active homing is no basic motion for it (OVR-095)
        job.start(self._name, self._history)
        moving = servo.superimposed
        halt = job.instruction == "MC_HaltSuperimposed"
        if moving is None and halt:
            job.activate()
            job.finish()  # nothing to halt (MC-369)
            return NO_ERROR
        if moving is None:
            self.set_position_control(True)
            self.superimposed_job = None
            moving = servo.superimposed = servo.total = Superposition(
                self.gen,
                velocity_limit=self._limits.velocity_limit,
                basic_velocity=self._basic_velocity,
            )
        elif self.superimposed_job is not None:
            self.superimposed_job.abort()
        self.superimposed_job = job
        job.activate()
        if given:
            moving.give(job)
        elif self._limits.are_zero():
            return NO_ERROR  # the alarm fails it
        else:
            acceleration, deceleration, jerk = self._limits.of(job)
            if halt:
                moving.halt(job, deceleration, jerk)
            else:
                moving.move(job, acceleration, deceleration, jerk)
        if state is AxisState.STANDSTILL:
            self._leave_target()
            self._states.enter(AxisState.MOTION)
        return NO_ERROR

    def submit_stop(self, job: Job) -> int:
        """Take an `MC_Stop` job over, end it with `CommandAborted`, or
        return the ErrorID of its rejection.
        """
        state = self._states.state
        severity = _STOP_SEVERITY[job.mode]
        if state is AxisState.RESTARTING:
            return ERROR_STATE
        if state in (AxisState.ALARM_DRIVE_STOP, AxisState.ALARM_DISABLED, AxisState.TRACKING):
            # A stronger alarm reaction turns the stop away without an error (STP-437, STP-444).
            job.start(self._name, self._history)
            job.abort()
            return NO_ERROR
        if not self._states.facts.enabled or state in (
            AxisState.DISABLING_RAMP,
            AxisState.DISABLING_QUICK,
            AxisState.DISABLING_COAST,
        ):
            return ERROR_LOCKED
        job.start(self._name, self._history)
        acknowledged = state is AxisState.ALARM_RAMP and not (
            self._alarms.blocking or self._command.will_disable
        )
        if state in (AxisState.ALARM_RAMP, AxisState.ALARM_STANDSTILL) and not acknowledged:
            # Harder than the alarm; of two stops the later one may be equal (STP-423, STP-441).
            least = max(self._alarms.stop_severity, self.severity - 1 if self.stopping else self.severity)
            if severity <= least or self._command.switching_off:
                job.abort()
                return NO_ERROR
            self._take_stop(job, severity)
            if state is AxisState.ALARM_STANDSTILL:
                self._states.enter(AxisState.ALARM_RAMP)
            return NO_ERROR
        if self.stopping and severity < self.severity:
            job.abort()  # only the same or a higher stop takes over (STP-423)
            return NO_ERROR
        if self._homings:
            abort_passive(self._homings)
        self.abort_all()
        self._take_stop(job, severity)
        self._states.enter(AxisState.STOPPING)
        return NO_ERROR

    def _take_stop(self, job: Job, severity: int) -> None:
        self.abort_all()
        self.job = job
        job.activate()
        if severity == 1:
            self.begin_stop(1, job.deceleration, job.jerk, abort_acceleration=job.abort_acceleration)
        else:
            self.begin_reaction(severity, abort_acceleration=job.abort_acceleration)

    def abort_all(self) -> None:
        """End the job in control, the waiting ones and the superimposed one with `CommandAborted`."""
        for one in (self.entering, self.leaving):
            if one is not None:
                one.abort()
        self.entering = self.leaving = None
        self._abort_motion()

    def _abort_motion(self) -> None:
        if self._servo.superimposed is not None:
            moved = self._merge()
            if moved is not None:
                moved.abort()
        self._abort_basic()

    def _abort_basic(self) -> None:
        job = self.job
        if self.shifts.job is not None and self.simulated is None:
            self.shifts.end()
        if job is not None:
            self.job = None
            job.abort()
        if self.queue:
            waiting, self.queue = self.queue, []
            for one in waiting:
                one.abort()

    def fail_all(self, error_id: int = ERROR_ALARM) -> None:
        """End motion jobs with an error because of an alarm; a stop job is left to the caller (STP-252)."""
        for one in (self.entering, self.leaving):
            if one is not None:
                one.fail(error_id)
        self.entering = self.leaving = None
        if self._servo.superimposed is not None:
            moved = self._merge()
            if moved is not None:
                moved.fail(error_id)
        if self.shifts.job is not None:
            self.shifts.end(error_id)
        simulated = self._take_simulated()
        if simulated is not None:
            simulated.fail(error_id)
        job = self.job
        if job is not None and job.job_class is not JobClass.STOP:
            self.job = None
            job.fail(error_id)
        if self.queue:
            waiting, self.queue = self.queue, []
            for one in waiting:
                one.fail(error_id)

    def _activate(self, job: Job, *, resumed: bool = False) -> None:
        """Give `job` control; `resumed`: it is synchronous already."""
        gen = self.gen
        self.job = job
        self.severity = 0
        self._leave_target()
        self.control_position_of(job)
        if not resumed:
            job.activate()
        cls = job.job_class
        if cls is _MOTION_IN:
            job.distance = 0.0
            self._limits.velocity_limited = False
            self._states.enter(AxisState.MOTION)
            return
        if self._limits.are_zero():
            return
        if job.coupling is not None:
            self._limits.velocity_limited = False
            self._plan_limits(job, gen.v)
            if resumed or not job.keeps_superimposed:
                self._carried = self._superimposed_before = 0.0
            if not resumed or job.coupling.by_velocity:
                job.coupling.begin(gen.s - self._carried, gen.v, gen.a)
            self._states.enter(AxisState.MOTION)
        elif cls is JobClass.POSITIONING:
            if job.relative:
                job.target = gen.s + job.distance
            elif job.direction:
                job.target = self._servo.modulo.target(job.target, gen.s, job.direction)
            self._plan_position(job)
            self._states.enter(AxisState.MOTION)
        elif cls is JobClass.VELOCITY:
            if job.current:
                override = self._limits.override.value
                job.velocity = gen.v / (override * 0.01) if override > 0.0 else 0.0
            self._plan_velocity(job)
            self._states.enter(AxisState.MOTION)
        elif cls is JobClass.HOMING:
            self._states.enter(AxisState.MOTION)
            if job.begin is not None:
                job.begin()
        else:
            _, deceleration, jerk = self._plan_limits(job)
            gen.start_stop(deceleration, jerk, abort_acceleration=job.abort_acceleration)
            self._states.enter(AxisState.HALTING)

    def control_position_of(self, job: Job) -> None:
        """Switch position control as `job` wants it; what is superimposed ends where
        there is none (MC-098 to MC-103).
        """
        servo = self._servo
        controlled = job.position_controlled
        if controlled is None or controlled is servo.position_controlled or not servo.has_position:
            return
        if not controlled and servo.superimposed is not None:
            moved = self._merge()
            if moved is not None:
                moved.abort()
        self.set_position_control(controlled)

    def _merge(self) -> Job | None:
        """End the superimposed motion by making it part of the basic one; returns its job."""
        self._sum_up()
        self._servo.superimposed = None
        self._superimposed_before = 0.0
        job, self.superimposed_job = self.superimposed_job, None
        return job

    @property
    def moving_job(self) -> JobClass | None:
        """Class of the job in control, None without one."""
        job = self.job
        return job.job_class if job is not None and job.state is JobState.ACTIVE else None

    # -- cycle

    def replan(self) -> None:
        """Take changed values of the job in control over (jog inputs, shifted coordinates)."""
        job = self.job
        if (
            job is None
            or self._states.state is not AxisState.MOTION
            or job.job_class is _MOTION_IN
            or job.coupling is not None
        ):
            return
        self._leave_target()
        if job.positions:
            self._plan_position(job)
        else:
            self._plan_velocity(job)

    def travel(self, job: Job, velocity: float) -> None:
        """Let homing keep `velocity` from now on, axis unit per second, signed."""
        job.positions = False
        job.velocity = velocity
        self.replan()

    def travel_to(self, job: Job, target: float, velocity: float) -> None:
        """Let homing go to `target`, axis unit, where its job ends."""
        job.positions = True
        job.target = target
        job.velocity = velocity
        self.replan()

    def step(self, cycle_s: float) -> None:
        """Advance the setpoint by one cycle."""
        servo = self._servo
        if self.limits_assigned:
            self.follow_limits()
        elif self._limits.velocity_limited and self._states.state is _MOTION and self.job is not None:
            self._repeat_warning()
        if self.simulated is not None:
            self.step_simulation(cycle_s)
        job = self.job
        entering = self.entering
        if entering is not None:
            beside = job is not None and job.job_class is _MOTION_IN and not self._enters_over_motion_in
            if self.simulated is None and not beside:
                self._enter_when_due(entering, cycle_s)
                job = self.job
            elif entering.entry is not None:
                entering.entry.leading.step()  # it waits for the end of what it does not abort
        if self.leaving is not None and self.simulated is None and (job is None or job.coupling is None):
            self.leaving.abort()  # there is nothing to leave any more
            self.leaving = None
        gen = self.gen
        if job is not None and job.job_class is _MOTION_IN and self._states.state is _MOTION:
            self.take_vector(job, cycle_s)
        elif (
            job is not None
            and job.coupling is not None
            and self._states.state is _MOTION
            and not job.coupling.ended
        ):
            self._follow_leading_value(job, cycle_s)
        else:
            gen.advance(cycle_s)
        moving = servo.superimposed
        if moving is not None and servo.total is not gen:
            moving.advance(cycle_s)
            if moving.given:
                servo.controller.given = True
        elif not servo.position_controlled and servo.has_position:
            gen.s = servo.feedback.position

    def finish_step(self) -> None:
        """End jobs and ramps whose setpoint has arrived; called after the monitoring of the cycle."""
        if not self._states.facts.controlled:
            return  # the monitoring of this cycle has taken the axis out of control
        gen = self.gen
        moving = self._servo.superimposed
        if moving is not None:
            if moving.ended:
                self._end_superimposed(moving)
            elif self.job is None:
                return
        job = self.job
        if job is not None and (job.job_class is _MOTION_IN or job.coupling is not None):
            if job.coupling is None or not job.coupling.ended:
                return
            if job.job_class is not JobClass.DESYNCHRONISE:
                self._end_function(job)
                return
        if not gen.done:
            if job is not None and job.in_velocity:
                job.set_in_velocity(False)
            return
        state = self._states.state
        if state is _STANDSTILL or state is _ALARM_STANDSTILL:
            return
        if state is _STOP_HOLD:
            if job is None or job.released:
                self.job = None
                self.severity = 0
                self._states.enter(AxisState.STANDSTILL)
            return
        if state is _MOTION and job is not None and not job.positions:
            if job.job_class is not JobClass.VELOCITY:
                return
            if job.released:
                self.job = None
                job.finish()
                self._next()
            else:
                job.set_in_velocity(True)
            return
        if gen.v != 0.0 or (
            state is AxisState.MOTION
            and self._planned_velocity == 0.0
            and (job is None or job.coupling is None)
        ):
            return
        if state in _SWITCHES_OFF and not self._arrived_at_drive():
            return
        if state is AxisState.ALARM_RAMP:
            if job is not None and job.job_class is JobClass.STOP:
                job.finish()
            self.alarm_ramp_ended()
            return
        if state is AxisState.DISABLING_RAMP:
            self._command.switch_off()
            return
        if state is AxisState.ENABLE_RAMP:
            self.severity = 0
            self._states.enter(AxisState.STANDSTILL)
            return
        if not self._settled():
            return
        if job is not None:
            job.finish()
        if state is AxisState.STOPPING:
            if self._alarms.disabling:
                self._states.enter(AxisState.ALARM_RAMP)
            self.alarm_ramp_ended()
            return
        self.job = None
        for waiting in [one for one in self.queue if one.job_class is JobClass.HALT_BASIC]:
            self.queue.remove(waiting)
            waiting.finish()
        self._next()

    def _end_function(self, job: Job) -> None:
        """End a job whose synchronous function has come to its end (CAM-106)."""
        self.job = None
        waiting = self.leaving
        if waiting is not None:
            self.leaving = None
            waiting.abort()
        if self.shifts.job is not None:
            self.shifts.end()
        job.finish()
        self._next()

    def _arrived_at_drive(self) -> bool:
        """Return whether the velocity that the drive is given has come to zero too, so that nothing is cut
        off (STP-511).
        """
        servo = self._servo
        fine = servo.fine
        if fine is not None and abs(fine.v) > servo.rest_velocity:
            return False  # the ramp began after the last interval: its first one is still to come
        dynamic_filter = servo.controller.filter if servo.has_position else None
        return dynamic_filter is None or abs(dynamic_filter.velocity) <= servo.rest_velocity

    def _settled(self) -> bool:
        """Return whether the end of the motion counts as reached (positioning
        monitoring, MON-016 to MON-022).
        """
        monitor = self._monitoring
        if monitor is None or not self._servo.position_controlled or self._servo.superimposed is not None:
            return True  # while something is superimposed the axis has not arrived anywhere yet
        if not self._settling:
            self._settling = True
            monitor.start_positioning()
        if not monitor.positioned():
            return False
        # With a torque limit an axis that is stopped creeps on to its setpoint: it has stopped when it stands
        # (STP-408).
        return monitor.standstill or not self._torque.limits or self._states.state is AxisState.MOTION

    def alarm_ramp_ended(self) -> None:
        """The setpoint of an alarm ramp is zero: switch off, or stay enabled where the alarm allows it."""
        command = self._command
        if self._alarms.disabling or command.will_disable:
            # An Enable that fell during the ramp disables whatever the alarm allows (STP-396).
            command.switch_off()
        elif self._alarms.blocking:
            self._states.enter(AxisState.ALARM_STANDSTILL)
        else:
            self.come_to_rest()

    def come_to_rest(self) -> None:
        """Go to standstill, held as long as `Execute` of the `MC_Stop` in control is TRUE (STP-415)."""
        job = self.job
        if job is not None and job.job_class is JobClass.STOP and not job.released:
            self._states.enter(AxisState.STOP_HOLD)
        else:
            self.job = None
            self.severity = 0
            self._states.enter(AxisState.STANDSTILL)

    def release(self, stop: Job) -> None:
        """End the lock of an `MC_Stop` that has stopped the axis; jobs that are called next are accepted
        (MC-407, STP-431).
        """
        if self.job is stop and self._states.state is _STOP_HOLD:
            self.come_to_rest()

    def _next(self) -> None:
        self.severity = 0
        if self.queue:
            self._activate(self.queue.pop(0))
        elif self._servo.superimposed is not None:
            self._states.enter(AxisState.MOTION)
        else:
            self._superimposed_before = 0.0
            self._states.enter(AxisState.STANDSTILL)

    def end_motion_in(self, job: Job, error_id: int = NO_ERROR) -> None:
        """End a job whose setpoints came from outside: they are zero at once, the
        position stays (MIN-026, MIN-040).
        """
        moving = self._servo.superimposed
        if moving is not None and self.superimposed_job is job:
            moving.freeze()
            self._end_superimposed(moving, error_id)
            return
        self.gen.set_state(self.gen.s, 0.0)
        if moving is not None:
            moving.refresh()
        self.job = None
        if error_id:
            job.fail(error_id)
        else:
            job.finish()
        self._next()

    def _end_superimposed(self, moving: Superposition, error_id: int = NO_ERROR) -> None:
        """Move setpoint and target of the basic motion by what has been
        superimposed, which has ended by itself.
        """
        servo = self._servo
        distance = moving.part.s
        servo.total = self.gen
        servo.superimposed = None
        self.gen.shift(distance)
        self._superimposed_before += distance
        basic = self.job
        if basic is not None and basic.coupling is not None:
            self._carried += distance  # beside the function, not in it (SYN-488)
        elif basic is not None and basic.job_class is _MOTION_IN:
            basic.distance += distance  # positions from outside continue to be counted from where they were
        elif basic is not None:
            basic.target += distance
        job, self.superimposed_job = self.superimposed_job, None
        if job is not None and error_id:
            job.fail(error_id)
        elif job is not None:
            job.finish()
        if self.job is None and self._states.state is AxisState.MOTION:
            self._next()
