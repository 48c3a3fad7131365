"""Basic positioner on the position profile of the servo core (PD-045 to PD-075,
PD-086 to PD-092). Knows no bus.

`step` is called once per bus cycle with the words of telegram 111; `Positioner.words_of_satzanw` turns those
of the telegrams 7, 9 and 110 into them. Positions are in LU, velocities in 1000 LU/min.
"""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.core import ServoCore
from emulators.drive.positioner_config import PositionerSettings
from emulators.drive.profidrive.positioner import status as show
from emulators.drive.profidrive.positioner.blocks import BlockRun
from emulators.drive.profidrive.positioner.fixed_stop import FixedStop
from emulators.drive.profidrive.positioner.homing import Homing
from emulators.drive.profidrive.positioner.motion import Motion, ProfileMotion
from emulators.drive.profidrive.positioner.task import Task
from emulators.drive.profidrive.positioner.terms import Mode, Refused, Words, mdi_part, share
from emulators.drive.protection import WindowTimer
from fieldbus.profidrive.formats import N2_ONE
from fieldbus.profidrive.words import POS_STW1, POS_STW2, STW1

_BLOCK: Final = 0x7F
_SATZANW_MDI: Final = 0x8000
_JOGS: Final = int(STW1.JOG_1 | STW1.JOG_2)
_ACTIVATE: Final = int(STW1.ACTIVATE_TASK)
_GO_ON: Final = int(STW1.NO_INTERMEDIATE_STOP)
_NO_REJECT: Final = int(STW1.NO_REJECT_TASK)
_HOME: Final = int(STW1.START_HOMING)
_MDI: Final = int(POS_STW1.MDI)
_TRACK: Final = int(POS_STW2.TRACKING)
_SET_REFERENCE: Final = int(POS_STW2.SET_REFERENCE_POINT)
_SOFTWARE_LIMITS: Final = int(POS_STW2.SOFTWARE_LIMITS)
_LIMIT_CAMS: Final = int(POS_STW2.LIMIT_CAMS)
_REQUESTS: Final = int(_JOGS | STW1.ACTIVATE_TASK | STW1.START_HOMING)


class Positioner:
    """Traversing blocks, MDI, set-up, jog and homing of one axis.

    Args:
        core: The servo core; who calls `step` enables its pulses and stops it on OFF1 and OFF3.
        settings: Scaling, limits, blocks.
        cycle_s: Time between two calls of `step`, s.

    """

    def __init__(
        self, core: ServoCore, settings: PositionerSettings | None = None, *, cycle_s: float = 0.004
    ) -> None:
        self.core = core
        self._cycle_s = cycle_s
        settings = PositionerSettings() if settings is None else settings
        self.motion = ProfileMotion(core, settings)
        self.task = Task(core, self.motion, settings)
        """What the axis is to do, and whether it was accepted."""
        self.blocks = BlockRun(self.task)
        self.homing = Homing(self.task)
        self.fixed_stop = FixedStop(self.task)
        self._settling = WindowTimer()
        self._standing = WindowTimer()
        self.zsw1 = self.pos_zsw1 = self.pos_zsw2 = 0
        self.acknowledged = False
        """The edge of the bit that still stands was accepted (ZSW1 bit 12)."""
        self.referencing = False
        """The bit that has set the reference point still stands."""
        self.clamping_torque_Nm = math.inf
        """Torque limit on the way to a fixed stop, Nm; inf: that of the drive."""
        self.tracking = False
        """The position demand follows the axis."""
        self._last = Words()
        self._last_velocity = 0.0
        self._clear()
        self.apply(settings)

    def apply(self, settings: PositionerSettings) -> None:
        """Take changed settings over; a motion under way is planned again with them."""
        self.task.settings = settings
        self.motion.apply(settings)
        self.blocks.table = {one.number: one for one in settings.block}
        self._settling.time_s = settings.positioning_time_ms / 1000.0
        self._standing.time_s = settings.standstill_time_ms / 1000.0
        clamping = settings.clamping_torque_nm
        self.clamping_torque_Nm = math.inf if clamping is None else clamping

    def _clear(self) -> None:
        self.task.mode = Mode.NONE
        self.task.wanted = None
        self.motion.clear()
        self.homing.clear()
        self.blocks.active = 0
        self._settling.reset()
        self._standing.reset()

    @staticmethod
    def words_of_satzanw(satzanw: int, mdi_mod: int = 0) -> int:
        """Return POS_STW1 for SATZANW and MDI_MOD of the telegrams 7, 9 and 110 (PD-086, PD-092)."""
        return show.pos_stw1_of(satzanw, mdi_mod)

    @property
    def settings(self) -> PositionerSettings:
        """Scaling, limits, blocks; `apply` changes them."""
        return self.task.settings

    @property
    def mode(self) -> Mode:
        """Kind of the task."""
        return self.task.mode

    @property
    def refused(self) -> Refused | None:
        """Why the last task was refused, while its request stands; None after one was accepted."""
        return self.task.refused

    @property
    def refusals(self) -> int:
        """How many tasks were refused so far."""
        return self.task.refusals

    @property
    def homed(self) -> bool:
        """Whether the home position is set (PD-071)."""
        return self.task.homed

    # -- what it shows ---------------------------------------------------------------------------------

    @property
    def position(self) -> float:
        """Measured position, LU (XIST_A); of a modulo axis within its range."""
        modulo = self.task.settings.modulo_range
        return self.motion.position % modulo if modulo else self.motion.position

    @property
    def velocity(self) -> float:
        """Measured velocity, 1000 LU/min (VIST_A)."""
        return self.motion.velocity

    @property
    def demand(self) -> float:
        """Position demand, LU; not wrapped."""
        return self.motion.demand

    @property
    def aktsatz(self) -> int:
        """AKTSATZ: the active block, or MDI (PD-087)."""
        if self.task.mode in {Mode.MDI, Mode.SETUP}:
            return _SATZANW_MDI
        return self.blocks.active if self.task.mode is Mode.BLOCK else 0

    @property
    def off_course(self) -> bool:
        """Whether the following error is beyond its tolerance."""
        if self.fixed_stop.active or self.fixed_stop.released:
            return False
        tolerance = self.task.settings.following_tolerance * self.motion.scale
        return self.core.controls_position and abs(self.core.following_error) > tolerance

    # -- one bus cycle ---------------------------------------------------------------------------------

    def restart(self, *, keep_home: bool) -> None:
        """Begin as after power-on; the home position is lost unless the encoder has kept it."""
        self._clear()
        self.task.refused = None
        self.zsw1 = self.pos_zsw1 = self.pos_zsw2 = 0
        self.task.target_reached = self.acknowledged = self.referencing = self.tracking = False
        self.fixed_stop.clear()
        self.blocks.outputs = 0
        self._last = Words()
        self._last_velocity = 0.0
        if not keep_home:
            self.task.homed = False
            self.motion.offset = 0.0

    def step(
        self,
        words: Words,
        *,
        operating: bool = True,
        minus_cam: bool = False,
        plus_cam: bool = False,
        fixed_stop: bool = False,
    ) -> None:
        """Take the words of a bus cycle, move, and form the status words.

        Args:
            words: Setpoint words in effect.
            operating: The drive follows the positioner; it does not while it brakes for OFF1 or OFF3. A
                task waits meanwhile.
            minus_cam: The limit switch in negative direction is actuated.
            plus_cam: That in positive direction.
            fixed_stop: The motion is to end at a fixed stop (STW2 bit 8).

        """
        rising = words.stw1 & ~self._last.stw1
        if not words.stw1 & _ACTIVATE:
            self.acknowledged = False
        if not (words.stw1 & _REQUESTS and words.stw1 & _NO_REJECT):
            self.task.refused = None
        self.homing.watch(words, rising)
        self.tracking = bool(words.pos_stw2 & _TRACK) or not self.core.enabled
        self.fixed_stop.take(fixed_stop and self.core.enabled)
        if self.core.enabled and operating:
            if self.tracking:
                self.task.abandon()
                self.motion.track()
            else:
                self._operate(words, rising)
                self._watch_cams(words, minus_cam, plus_cam)
                self._move(words)
                self._progress(words, rising)
                self._monitor()
        elif not self.core.enabled:
            passing = self.homing.passing
            self._clear()
            self.homing.passing = passing
            self.task.target_reached = False
        if not words.pos_stw2 & _SET_REFERENCE:
            self.referencing = False
        elif not self._last.pos_stw2 & _SET_REFERENCE and not self.motion.moving:
            self.set_reference_point()
            self.referencing = True
        if self.homing.here and not words.stw1 & _HOME:
            self.homing.here = False
        self._last = words
        self._show(words, minus_cam, plus_cam)

    def _move(self, words: Words) -> None:
        self.motion.drive(
            self.task.wanted,
            override=min(2.0, max(0, words.override) / N2_ONE),
            held=not words.stw1 & _GO_ON,
            limits=self.task.settings.software_limits if self.task.limited(words) else None,
        )

    def _show(self, words: Words, minus_cam: bool, plus_cam: bool) -> None:
        velocity = self.core.precontrol_velocity if self.core.enabled else 0.0
        task = self.task
        self.zsw1 = show.zsw1(
            task,
            velocity,
            self._last_velocity,
            off_course=self.off_course,
            acknowledged=self.acknowledged,
        )
        self.pos_zsw1 = show.pos_zsw1(
            task.mode,
            self.blocks.active,
            minus_cam=minus_cam,
            plus_cam=plus_cam,
            referencing=self.referencing or self.homing.here,
            passing=self.homing.passing,
        )
        self.pos_zsw2 = show.pos_zsw2(
            task,
            words,
            velocity,
            position=self.position,
            outputs=self.blocks.outputs,
            tracking=self.tracking,
            to_stop=self.fixed_stop.active,
        )
        self._last_velocity = velocity

    def set_reference_point(self) -> None:
        """Make the present position the reference point (POS_STW2 bit 1)."""
        self.task.place(self.core.position, self.task.settings.reference_position)
        self.task.homed = True
        self.task.abandon()
        self.motion.planned = None

    def probe_edge(self, number: int, rising: bool, angle: float) -> None:
        """Take an edge of probe input 1 or 2 at a measured angle, rad (passive homing)."""
        self.homing.probe_edge(self._last, number, rising, angle)

    # -- which task ------------------------------------------------------------------------------------

    def _operate(self, words: Words, rising: int) -> None:
        stw1 = words.stw1
        if not stw1 & _NO_REJECT:
            self.task.abandon()
            return
        jogs = stw1 & _JOGS
        if (
            (self.task.mode is Mode.JOG and (jogs != self._last.stw1 & _JOGS or jogs in {0, _JOGS}))
            or (self.task.mode is Mode.HOMING and not stw1 & _HOME)
            or (self.task.mode in {Mode.MDI, Mode.SETUP} and not words.pos_stw1 & _MDI)
        ):
            self.task.abandon()
        if jogs not in {0, _JOGS}:
            if (self._idle or self.task.mode is Mode.JOG) and rising & _JOGS:
                self._start_jog(words, 0 if jogs & STW1.JOG_1 else 1)
            return
        if rising & _HOME and self._idle and not self.homing.passing:
            if self.task.settings.home_here:
                self.set_reference_point()
                self.homing.here = True
            else:
                self.homing.start(words)
        if self.task.mode in {Mode.JOG, Mode.HOMING}:
            return
        activated = bool(rising & _ACTIVATE)
        if words.pos_stw1 & _MDI:
            changed = mdi_part(words) != mdi_part(self._last)
            continuous = words.pos_stw1 & POS_STW1.CONTINUOUS and changed
            if activated or continuous or (self.task.mode is Mode.SETUP and changed):
                self._start_mdi(words)
        elif activated:
            self.blocks.start(words.pos_stw1 & _BLOCK, words)
        if activated and self.task.refused is None:
            self.acknowledged = True

    @property
    def _idle(self) -> bool:
        return self.task.mode is Mode.NONE or self.task.target_reached

    def _start_mdi(self, words: Words) -> None:
        settings = self.task.settings
        acceleration = settings.max_acceleration * share(words.acceleration)
        deceleration = settings.max_deceleration * share(words.deceleration)
        velocity = float(words.velocity)
        if velocity < 0.0:
            velocity = -velocity if settings.negative_velocity == "absolute" else 0.0
        sign = bool(words.pos_stw1 & POS_STW1.POSITIVE) - bool(words.pos_stw1 & POS_STW1.NEGATIVE)
        if words.pos_stw1 & POS_STW1.SETUP:
            speed = velocity if sign else 0.0
            self.task.accept(Mode.SETUP, Motion(math.inf * (sign or 1), speed, acceleration, deceleration))
            return
        absolute = bool(words.pos_stw1 & POS_STW1.ABSOLUTE)
        target = self.task.absolute(float(words.target), sign) if absolute else self.demand + words.target
        if target is not None and self.task.allowed(target, words, absolute=absolute):
            motion = Motion(target, velocity, acceleration, deceleration, relative=not absolute)
            self.task.accept(Mode.MDI, motion)

    def _start_jog(self, words: Words, which: int) -> None:
        settings = self.task.settings
        velocity = settings.jog_velocities[which]
        target = math.copysign(math.inf, velocity)
        if words.pos_stw2 & POS_STW2.INCREMENTAL_JOG:
            target = self.demand + math.copysign(settings.jog_increments[which], velocity)
            if not self.task.allowed(target, words, absolute=False):
                return
        self.task.accept(
            Mode.JOG,
            Motion(
                target, abs(velocity), settings.max_acceleration, settings.max_deceleration, relative=True
            ),
        )

    # -- motion ----------------------------------------------------------------------------------------

    def _watch_cams(self, words: Words, minus_cam: bool, plus_cam: bool) -> None:
        wanted = self.task.wanted
        if wanted is None or not words.pos_stw2 & _LIMIT_CAMS:
            return
        if minus_cam and wanted.target < self.demand:
            self.task.refuse(Refused.MINUS_CAM)
        elif plus_cam and wanted.target > self.demand:
            self.task.refuse(Refused.PLUS_CAM)

    def _progress(self, words: Words, rising: int) -> None:
        """Go on to what follows: the next block, the next phase of homing, the end of the task."""
        if self.motion.halted if self.task.wanted is not None else not words.stw1 & _GO_ON:
            return
        if self.task.mode is Mode.BLOCK:
            self.blocks.step(words, rising, self._cycle_s)
        elif self.task.wanted is None:
            return
        elif self.task.mode is Mode.HOMING:
            self.homing.step(words)
        elif math.isfinite(self.task.wanted.target) and self.motion.arrived():
            self.motion.moving = False
            self.task.target_reached = self.task.mode is Mode.MDI

    def _monitor(self) -> None:
        """Watch that the axis gets to its target and stays there (p2543, p2545)."""
        settings = self.task.settings
        if self.fixed_stop.active:
            self.fixed_stop.look()
            return
        if settings.positioning_time_ms and self._settling.update(self.motion.settling, self._cycle_s):
            self._settling.reset()
            self.task.refuse(Refused.POSITIONING)
        if settings.standstill_time_ms and self._standing.update(self.motion.displaced, self._cycle_s):
            self._standing.reset()
            self.task.refuse(Refused.STANDSTILL)


__all__ = ["Mode", "Positioner", "Refused", "Words"]
