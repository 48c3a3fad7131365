"""Homing of the basic positioner: actively to cam and zero mark, or in passing at a probe (PD-055, PD-071,
PD-089, PD-090).
"""

from __future__ import annotations

import math
from enum import Enum

from emulators.drive.profidrive.positioner.motion import Motion
from emulators.drive.profidrive.positioner.task import Task
from emulators.drive.profidrive.positioner.terms import Mode, Refused, Words
from fieldbus.profidrive.words import POS_STW2, STW1


class _Phase(Enum):
    TO_CAM = 0
    OFF_CAM = 1
    ARM = 2
    TO_MARK = 3
    TO_REFERENCE = 4


class Homing:
    """Looks for the reference point.

    Args:
        task: Task of the positioner.

    """

    def __init__(self, task: Task) -> None:
        self._task = task
        self._phase = _Phase.TO_CAM
        self._start = 0.0
        self.passing = False
        """Passive homing waits for its probe."""
        self.here = False
        """The bit that has made the present position the reference point still stands."""

    def clear(self) -> None:
        """Forget what is under way."""
        self.passing = self.here = False

    # -- active ----------------------------------------------------------------------------------------

    def start(self, words: Words) -> None:
        """Begin: the home position is lost."""
        task = self._task
        settings = task.settings
        task.homed = False
        if settings.has_cam and not words.pos_stw2 & POS_STW2.REFERENCE_CAM:
            self._go(_Phase.TO_CAM, _direction(words) * math.inf, settings.cam_velocity)
        else:
            self._look_for_mark(words, _Phase.OFF_CAM if settings.has_cam else _Phase.ARM)

    def _look_for_mark(self, words: Words, phase: _Phase) -> None:
        """Go back from the cam, or on in the search direction without one."""
        settings = self._task.settings
        back = -1 if settings.has_cam else 1
        self._go(phase, back * _direction(words) * math.inf, settings.mark_velocity)

    def _go(self, phase: _Phase, target: float, velocity: float) -> None:
        task = self._task
        self._phase = phase
        self._start = task.demand
        settings = task.settings
        task.accept(
            Mode.HOMING, Motion(target, velocity, settings.max_acceleration, settings.max_deceleration)
        )

    def step(self, words: Words) -> None:
        """Cam, then back off it, then the next zero mark, then the reference point."""
        task = self._task
        settings = task.settings
        encoder = task.core.encoder
        cam = bool(words.pos_stw2 & POS_STW2.REFERENCE_CAM)
        way = abs(task.demand - self._start)
        phase = self._phase
        if phase is _Phase.TO_CAM:
            if cam:
                self._look_for_mark(words, _Phase.OFF_CAM)
            elif way > settings.max_cam_distance:
                task.refuse(Refused.CAM_NOT_FOUND)
        elif phase is _Phase.OFF_CAM:
            if not cam:
                self._phase = _Phase.ARM
            elif way > settings.max_cam_distance:
                task.refuse(Refused.END_OF_CAM_NOT_FOUND)
        elif phase is _Phase.ARM:
            encoder.arm_zero_mark()
            self._start = task.demand
            self._phase = _Phase.TO_MARK
        elif phase is _Phase.TO_MARK:
            latched = encoder.latched_increments
            if latched is not None:
                angle = latched * encoder.radians_per_increment
                task.place(angle, settings.reference_position - settings.reference_offset)
                self._go(_Phase.TO_REFERENCE, float(settings.reference_position), settings.approach_velocity)
            elif way > settings.max_mark_distance:
                encoder.arm_zero_mark(False)
                task.refuse(Refused.MARK_NOT_FOUND)
        elif task.motion.arrived():
            task.homed = True
            task.finish()

    # -- in passing ------------------------------------------------------------------------------------

    def watch(self, words: Words, rising: int) -> None:
        """Begin or end passive homing: it takes part in no motion."""
        if not words.stw1 & STW1.START_HOMING:
            self.passing = False
        elif rising & STW1.START_HOMING and words.pos_stw2 & POS_STW2.PASSIVE_HOMING:
            self.passing = True

    def probe_edge(self, words: Words, number: int, rising: bool, angle: float) -> None:
        """Take an edge of a probe input: the place of the edge becomes the reference point (p2599)."""
        if not self.passing:
            return
        wanted = 2 if words.pos_stw2 & POS_STW2.PROBE_2 else 1
        if number == wanted and rising is not bool(words.pos_stw2 & POS_STW2.PROBE_FALLING):
            task = self._task
            task.place(angle, task.settings.reference_position)
            task.homed = True
            self.passing = False


def _direction(words: Words) -> int:
    return -1 if words.pos_stw2 & POS_STW2.SEARCH_NEGATIVE else 1
