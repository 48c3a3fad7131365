"""Passive homing: the mark is noticed during motions that others make (§5.11.4, `MC_Home` with `Mode` 2, 8
and 10).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from motion.s7.axis.homing.direct import relate, take_relation
from motion.s7.axis.homing.finder import ALARM_NOT_FOUND, ALARM_NOT_SUPPORTED, DIGITAL_INPUT, MarkFinder, Way
from motion.s7.axis.jobs import ERROR_ALARM

if TYPE_CHECKING:
    from motion.s7.axis.homing.direct import Homing, HomingObject
    from motion.s7.axis.jobs import Job

_DIRECTIONS = (1, -1, 0)


class PassiveHoming:
    """One passive homing, from its start on.

    Args:
        owner: Axis or external encoder.
        job: Its job, already started.
        position: Position at the mark, axis unit.
        mode: `MC_Home.Mode`: 2 leaves the homed state as it is until the mark, 8 and 10 reset it.

    """

    def __init__(self, owner: HomingObject, job: Job, position: float, mode: int) -> None:
        self._owner = owner
        self._job = job
        self._mode = mode
        self.reference = position
        """`ReferenceMarkPosition`."""
        self._path = path = f"{owner.sensor_path(owner.operative_sensor)}.PassiveHoming"
        read = owner.variables.read
        kind = owner.variables.read_int(f"{path}.Mode")
        if owner.incremental and mode != 2:
            owner.homed = False
        search = owner.feedback.source.mark
        self._way = Way(owner.feedback)
        self._finder = MarkFinder(
            owner.feedback,
            search,
            mode=kind,
            direction=_DIRECTIONS[owner.variables.read_int(f"{path}.Direction")],
            positive_side=owner.variables.read_bool(f"{path}.SideInput"),
            switch=owner.homing_switch(path),
        )
        if owner.simulated:
            self._arrive(owner.feedback.position)
        elif kind != DIGITAL_INPUT and search is None:
            owner.alarm(ALARM_NOT_SUPPORTED)
            job.fail(ERROR_ALARM)
        else:
            owner.homings.append(self)
            if owner.history is not None:
                owner.history.emit(
                    owner.name,
                    "homing.started",
                    job=job.name,
                    mode=mode,
                    mark=kind,
                    direction=_DIRECTIONS[owner.variables.read_int(f"{path}.Direction")],
                    level=read(f"{path}.SwitchLevel"),
                    approach=0.0,
                    homing=0.0,
                )

    @property
    def busy(self) -> bool:
        """Whether its job has not ended yet."""
        return self._job.busy

    def step(self) -> None:
        """Advance by one application cycle."""
        owner = self._owner
        job = self._job
        if job.busy:
            ended_by = owner.ends_passive_homing()
            if ended_by is None and owner.sensor_valid:
                mark = self._finder.step(self._way.step(), owner.homing_switch(self._path))
                if mark is not None:
                    self._arrive(mark)
                elif self._finder.failed:
                    owner.alarm(ALARM_NOT_FOUND if self._finder.supported else ALARM_NOT_SUPPORTED)
                    job.fail(ERROR_ALARM)
            elif ended_by == 0:
                job.abort()
            elif ended_by is not None:
                job.fail(ended_by)
        if not job.busy:
            owner.homings.remove(self)
            self._finder.close()

    def abort(self) -> None:
        """End with `CommandAborted`: another homing, or a stop, takes over."""
        self._job.abort()
        self._owner.homings.remove(self)
        self._finder.close()

    def _arrive(self, mark: float) -> None:
        owner = self._owner
        offset = owner.modulo.homed(self.reference) - mark
        relate(owner, offset)
        take_relation(owner, mode=self._mode, offset=offset, mark=mark + offset)
        self._job.finish()


def abort_passive(homings: list[Homing]) -> None:
    """End a passive homing with `CommandAborted`; harmless when there is none."""
    for homing in homings[:]:
        if isinstance(homing, PassiveHoming):
            homing.abort()
