"""Active homing: the axis looks for its homing mark by a motion of its own (§5.11.3, `MC_Home` with `Mode` 3
and 5).

    approach --cam or input--> [back] --> search --mark--> home position

*approach* goes in approach direction with approach velocity, *search* in homing direction with homing
velocity, *back* against the homing direction until cam or input has been passed. A hardware limit switch
turns the motion round where it is configured.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Final

from motion.s7.axis.homing.direct import relate, take_relation
from motion.s7.axis.homing.finder import (
    ALARM_NOT_FOUND,
    ALARM_NOT_SUPPORTED,
    DIGITAL_INPUT,
    ZERO_MARK,
    MarkFinder,
    Way,
)
from motion.s7.axis.jobs import Job, JobState

if TYPE_CHECKING:
    from motion.s7.axis.hardware_limits import HardwareLimits
    from motion.s7.axis.homing.direct import HomingObject
    from motion.s7.axis.motion import MotionControl

ALARM_DATA: Final = 341


class Phase(IntEnum):
    """What active homing does."""

    APPROACH = 0
    BACK = 1
    SEARCH = 2
    HOME = 3


class ActiveHoming:
    """One active homing; made with its job, it begins when the job gets control.

    Args:
        axis: The axis.
        job: Its job, class `HOMING`.
        home_position: Position of the axis at the end, axis unit.
        mode: `MC_Home.Mode`, for the event.
        motion: What moves the axis.
        limits: Its hardware limit switches, at which it may turn.

    """

    def __init__(
        self,
        axis: HomingObject,
        job: Job,
        home_position: float,
        mode: int,
        *,
        motion: MotionControl,
        limits: HardwareLimits,
    ) -> None:
        read = axis.variables.read
        prefix = f"Sensor[{axis.operative_sensor}].ActiveHoming"
        self._axis = axis
        self._motion = motion
        self._limits = limits
        self._job = job
        self._home = home_position
        self._mode = mode
        self._kind = axis.variables.read_int(f"{prefix}.Mode")
        self._path = prefix
        self._offset = read(f"{prefix}.HomePositionOffset")
        self._direction = -1 if read(f"{prefix}.Direction") else 1
        self._approach = -1 if read("Homing.ApproachDirection") else 1
        self._approach_velocity: float = axis.variables.bind("Homing.ApproachVelocity").value
        self._homing_velocity: float = axis.variables.bind("Homing.ReferencingVelocity").value
        self.reference = home_position - self._offset
        """`ReferenceMarkPosition`."""
        self.phase = Phase.APPROACH
        self._heading = 0
        self._turned: set[Phase] = set()
        self._seen = False
        """Cam or input has been active since the motion *back* began, other than
        on the way in homing direction.
        """
        self._way = Way(axis.feedback)
        self._finder: MarkFinder | None = None
        job.begin = self._begin

    # -- beginning and end
    # ------------------------------------------------------------------------------------

    def _begin(self) -> None:
        axis = self._axis
        if axis.incremental:
            axis.homed = False
        if self._approach_velocity <= 0.0 or self._homing_velocity <= 0.0:
            axis.alarm(ALARM_DATA)
            return
        if axis.simulated:
            self._arrive(
                axis.feedback.position - axis.modulo.shortest(self._offset)
            )  # already there (HOM-031)
            return
        search = axis.feedback.source.mark
        if self._kind != DIGITAL_INPUT and search is None:
            axis.alarm(ALARM_NOT_SUPPORTED)
            return
        axis.homings.append(self)
        if axis.variables.read("Homing.AutoReversal"):
            self._limits.begin_reversal()
        on = axis.homing_switch(self._path)
        self._finder = MarkFinder(
            axis.feedback,
            search,
            mode=self._kind,
            direction=self._direction,
            positive_side=axis.variables.read_bool(f"{self._path}.SideInput"),
            switch=on,
        )
        if axis.history is not None:
            axis.history.emit(
                axis.name,
                "homing.started",
                job=self._job.name,
                mode=self._mode,
                mark=self._kind,
                direction=self._direction,
                level=axis.variables.read(f"{self._path}.SwitchLevel"),
                approach=self._approach_velocity,
                homing=self._homing_velocity,
            )
        if self._kind == ZERO_MARK:
            self._enter(Phase.SEARCH, self._direction)
        elif on:
            self._on_switch()
        else:
            self._enter(Phase.APPROACH, self._approach)

    def _fail(self, number: int) -> None:
        """Give up with an alarm, which ends the job."""
        self._leave()
        self._axis.alarm(number)

    def _end(self) -> None:
        """The job has ended, by whomever."""
        self._leave()
        finder = self._finder
        if finder is None or self._job.state is not JobState.ERROR:
            return
        axis = self._axis
        limits = self._limits
        stopped = self.phase is not Phase.HOME and (limits.positive.active or limits.negative.active)
        if stopped or finder.failed or axis.feedback.source.sensor_fault:
            axis.alarm(ALARM_NOT_FOUND)  # HOM-078, HOM-097

    def _leave(self) -> None:
        axis = self._axis
        axis.homings.remove(self)
        self._limits.end_reversal()
        if self._finder is not None:
            self._finder.close()

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """Whether its job has not ended yet."""
        return self._job.busy

    def step(self) -> None:
        """Advance by one application cycle, before the setpoint does."""
        axis = self._axis
        finder = self._finder
        if not self._job.busy or finder is None:
            self._end()
            return
        if self.phase is Phase.HOME or not axis.sensor_valid:
            return
        way = self._way.step()
        on = axis.homing_switch(self._path)
        if self.phase is Phase.APPROACH:
            if on:
                self._on_switch()
        elif self.phase is Phase.BACK:
            if on:
                self._seen = self._seen or way != self._direction
            elif self._seen and way == -self._direction:
                self._enter(Phase.SEARCH, self._direction)
        mark = finder.step(way if self.phase is Phase.SEARCH else 0, on)
        if mark is not None:
            self._arrive(mark)
        elif finder.failed:
            self._fail(ALARM_NOT_FOUND if finder.supported else ALARM_NOT_SUPPORTED)
        elif (
            self._limits.reversing
            and (self._limits.positive if self._heading > 0 else self._limits.negative).active
        ):
            self._turn()

    def _on_switch(self) -> None:
        """Cam or input is active: look for the mark from the side from which it is passed in homing direction
        (HOM-090, HOM-104).
        """
        assert self._finder is not None  # made at the beginning
        if self._kind == DIGITAL_INPUT and self._finder.enters:
            self._enter(Phase.BACK, -self._direction)
            self._seen = self._way.direction != self._direction
        else:
            self._enter(Phase.SEARCH, self._direction)

    def _turn(self) -> None:
        """A limit switch is reached: continue in the other direction, or give up (HOM-108, HOM-114)."""
        phase = self.phase
        towards_mark = self._heading == self._direction
        place = Phase.SEARCH if towards_mark else Phase.BACK
        cam_missing = phase is Phase.BACK and self._kind != ZERO_MARK
        if place in self._turned or cam_missing:
            self._fail(ALARM_NOT_FOUND)
            return
        self._turned.add(place)
        if towards_mark:
            self._enter(Phase.BACK, -self._direction)
        elif phase is Phase.APPROACH:
            self._enter(Phase.APPROACH, self._direction)
        else:
            self._enter(Phase.SEARCH, self._direction)

    def _enter(self, phase: Phase, heading: int) -> None:
        self._show(phase, heading)
        self._seen = False
        velocity = self._homing_velocity if phase is Phase.SEARCH else self._approach_velocity
        self._motion.travel(self._job, heading * velocity)

    def _show(self, phase: Phase, heading: int) -> None:
        self.phase = phase
        self._heading = heading
        axis = self._axis
        if axis.history is not None:
            axis.history.emit(axis.name, "homing.phase", phase=phase.name.lower(), direction=heading)

    def _arrive(self, mark: float) -> None:
        """The mark has been passed at `mark`: from now on positions are those of
        the machine (HOM-081 to HOM-083).
        """
        axis = self._axis
        target = axis.modulo.homed(self._home)
        way = axis.modulo.shortest(self._offset)
        relate(axis, target - way - mark)
        take_relation(axis, mode=self._mode, offset=target - way - mark, mark=target - way)
        heading = 1 if target > axis.feedback.position else -1
        self._limits.mark_found(heading)
        self._show(Phase.HOME, heading)
        self._motion.travel_to(self._job, target, self._approach_velocity)
