"""Basic positioner on the position profile of the servo core (PD-045 to PD-075, PD-086 to PD-092). Knows no bus.

`step` is called once per bus cycle with the words of telegram 111; `Positioner.words_of_satzanw` turns those of the
telegrams 7, 9 and 110 into them. Positions are in LU, velocities in 1000 LU/min.
"""

from __future__ import annotations

import math
from enum import Enum, IntEnum
from typing import Final, NamedTuple

from emulators.drive.core import ServoCore
from emulators.drive.profidrive._positioner_motion import Motion, ProfileMotion
from emulators.drive.profidrive.positioner_config import (
    BlockTask,
    Continuation,
    PositionerSettings,
    TraversingBlock,
)
from fieldbus.profidrive.formats import N2_ONE
from fieldbus.profidrive.words import POS_STW1, POS_STW2, POS_ZSW1, POS_ZSW2, STW1, ZSW1

_BLOCK: Final = 0x7F
_SATZANW_MDI: Final = 0x8000
_JOGS: Final = STW1.JOG_1 | STW1.JOG_2
_REQUESTS: Final = int(_JOGS | STW1.ACTIVATE_TASK | STW1.START_HOMING)


class Mode(Enum):
    """What the axis is asked to do."""

    NONE = "nothing"
    BLOCK = "traversing blocks"
    MDI = "MDI"
    SETUP = "set-up"
    JOG = "jog"
    HOMING = "homing"


class Refused(IntEnum):
    """Why a task was not accepted or was given up; the numbers under which such drives report it."""

    FOLLOWING_ERROR = 7452
    NOT_HOMED = 7461
    NO_SUCH_BLOCK = 7462
    TARGET_BELOW_LIMIT = 7469
    TARGET_ABOVE_LIMIT = 7470
    MINUS_CAM = 7491
    PLUS_CAM = 7492

    @property
    def is_fault(self) -> bool:
        """Whether the axis stops with a fault; the others are warnings."""
        return self in _FAULTS


_FAULTS: Final = frozenset({Refused.FOLLOWING_ERROR, Refused.MINUS_CAM, Refused.PLUS_CAM})


class Words(NamedTuple):
    """Setpoint words of telegram 111."""

    stw1: int = 0
    pos_stw1: int = 0
    pos_stw2: int = 0
    override: int = N2_ONE
    target: int = 0
    """LU."""
    velocity: int = 0
    """1000 LU/min."""
    acceleration: float = N2_ONE
    deceleration: float = N2_ONE


class Positioner:
    """Traversing blocks, MDI, set-up, jog and homing of one axis.

    Args:
        core: The servo core; who calls `step` enables its pulses and stops it on OFF1 and OFF3.
        settings: Scaling, limits, blocks.

    """

    __slots__ = (
        "_acknowledged", "_active_block", "_blocks", "_core", "_last", "_last_velocity", "_motion", "_phase", "_referencing", "_wanted",
        "homed", "mode", "pos_zsw1", "pos_zsw2", "refusals", "refused", "settings", "target_reached", "zsw1",
    )  # fmt: skip

    def __init__(self, core: ServoCore, settings: PositionerSettings | None = None) -> None:
        self._core = core
        self.settings = PositionerSettings() if settings is None else settings
        self._motion = ProfileMotion(core, self.settings)
        self._blocks = dict(self.settings.blocks)
        self.homed = False
        """Whether the home position is set (PD-071)."""
        self.refused: Refused | None = None
        """Why the last task was refused, while its request stands; None after one was accepted."""
        self.refusals = 0
        """How many were so far."""
        self.zsw1 = self.pos_zsw1 = self.pos_zsw2 = 0
        self.target_reached = False
        self._acknowledged = False
        self._referencing = False
        self._last = Words()
        self._last_velocity = 0.0
        self._clear()

    def _clear(self) -> None:
        self.mode = Mode.NONE
        self._wanted: Motion | None = None
        self._motion.clear()
        self._active_block = 0
        self._phase = 0

    @staticmethod
    def words_of_satzanw(satzanw: int, mdi_mod: int = 0) -> int:
        """Return POS_STW1 for SATZANW and MDI_MOD of the telegrams 7, 9 and 110 (PD-086, PD-092)."""
        word = satzanw & _BLOCK
        if satzanw & _SATZANW_MDI:
            word |= POS_STW1.MDI
        if not mdi_mod & 1:  # bit 0: 0 = relative
            return word
        return word | POS_STW1.ABSOLUTE

    # -- what it shows -----------------------------------------------------------------------------------------

    @property
    def position(self) -> float:
        """Measured position, LU (XIST_A)."""
        return self._motion.position

    @property
    def velocity(self) -> float:
        """Measured velocity, 1000 LU/min (VIST_A)."""
        return self._motion.velocity

    @property
    def demand(self) -> float:
        """Position demand, LU."""
        return self._motion.demand

    @property
    def aktsatz(self) -> int:
        """AKTSATZ: the active block, or MDI (PD-087)."""
        if self.mode in {Mode.MDI, Mode.SETUP}:
            return _SATZANW_MDI
        return self._active_block if self.mode is Mode.BLOCK else 0

    # -- one bus cycle -----------------------------------------------------------------------------------------

    def restart(self, *, keep_home: bool) -> None:
        """Begin as after power-on; the home position is lost unless the encoder has kept it."""
        self._clear()
        self.refused = None
        self.zsw1 = self.pos_zsw1 = self.pos_zsw2 = 0
        self.target_reached = self._acknowledged = self._referencing = False
        self._last = Words()
        self._last_velocity = 0.0
        if not keep_home:
            self.homed = False
            self._motion.offset = 0.0

    @property
    def off_course(self) -> bool:
        """Whether the following error is beyond its tolerance."""
        tolerance = self.settings.following_tolerance * self._motion.scale
        return self._core.controls_position and abs(self._core.following_error) > tolerance

    def step(
        self, words: Words, *, operating: bool = True, minus_cam: bool = False, plus_cam: bool = False
    ) -> None:
        """Take the words of a bus cycle, move, and form the status words.

        Args:
            words: Setpoint words in force.
            operating: The drive follows the positioner; it does not while it brakes for OFF1 or OFF3. A task waits meanwhile.
            minus_cam: The limit switch in negative direction is actuated.
            plus_cam: That in positive direction.

        """
        rising = words.stw1 & ~self._last.stw1
        if not words.stw1 & STW1.ACTIVATE_TASK:
            self._acknowledged = False
        if not (words.stw1 & _REQUESTS and words.stw1 & STW1.NO_REJECT_TASK):
            self.refused = None
        if self._core.enabled and operating:
            self._operate(words, rising)
            self._watch_cams(words, minus_cam, plus_cam)
            self._motion.drive(
                self._wanted,
                override=min(2.0, max(0, words.override) / N2_ONE),
                held=not words.stw1 & STW1.NO_INTERMEDIATE_STOP,
                limits=self.settings.software_limits if self._limited(words) else None,
            )
            self._progress(words, rising)
        elif not self._core.enabled:
            self._clear()
            self.target_reached = False
        if not words.pos_stw2 & POS_STW2.SET_REFERENCE_POINT:
            self._referencing = False
        elif not self._last.pos_stw2 & POS_STW2.SET_REFERENCE_POINT and not self._motion.moving:
            self.set_reference_point()
            self._referencing = True
        self._last = words
        self._show(words, minus_cam, plus_cam)

    def set_reference_point(self) -> None:
        """Make the present position the reference point (POS_STW2 bit 1)."""
        self._motion.offset = self._core.position - self.settings.reference_position * self._motion.scale
        self.homed = True
        self._abandon()
        self._motion.planned = None

    # -- which task --------------------------------------------------------------------------------------------

    def _operate(self, words: Words, rising: int) -> None:
        stw1 = words.stw1
        if not stw1 & STW1.NO_REJECT_TASK:
            self._abandon()
            return
        jogs = stw1 & _JOGS
        if (
            (self.mode is Mode.JOG and (jogs != self._last.stw1 & _JOGS or jogs in {0, _JOGS}))
            or (self.mode is Mode.HOMING and not stw1 & STW1.START_HOMING)
            or (self.mode in {Mode.MDI, Mode.SETUP} and not words.pos_stw1 & POS_STW1.MDI)
        ):
            self._abandon()
        if jogs not in {0, _JOGS}:
            if (self._idle or self.mode is Mode.JOG) and rising & _JOGS:
                self._start_jog(words, 0 if jogs & STW1.JOG_1 else 1)
            return
        if rising & STW1.START_HOMING and self._idle:
            self._start_homing(words)
        if self.mode in {Mode.JOG, Mode.HOMING}:
            return
        activated = bool(rising & STW1.ACTIVATE_TASK)
        if words.pos_stw1 & POS_STW1.MDI:
            continuous = words.pos_stw1 & POS_STW1.CONTINUOUS and _mdi_part(words) != _mdi_part(self._last)
            if (
                activated
                or continuous
                or (self.mode is Mode.SETUP and _mdi_part(words) != _mdi_part(self._last))
            ):
                self._start_mdi(words)
        elif activated:
            self._start_block(words.pos_stw1 & _BLOCK, words)
        if activated and self.refused is None:
            self._acknowledged = True

    @property
    def _idle(self) -> bool:
        return self.mode is Mode.NONE or self.target_reached

    def _accept(self, mode: Mode, motion: Motion) -> None:
        self.mode = mode
        self._wanted = motion
        self.target_reached = False
        self.refused = None

    def _abandon(self) -> None:
        """Give the task up: brake with the maximum deceleration."""
        if self.mode is not Mode.NONE:
            self.target_reached = False
        self.mode = Mode.NONE
        self._wanted = None

    def _refuse(self, reason: Refused) -> None:
        self.refused = reason
        self.refusals += 1
        self._abandon()

    def _start_mdi(self, words: Words) -> None:
        settings = self.settings
        acceleration = settings.max_acceleration * _share(words.acceleration)
        deceleration = settings.max_deceleration * _share(words.deceleration)
        velocity = max(0.0, float(words.velocity))
        if words.pos_stw1 & POS_STW1.SETUP:
            sign = bool(words.pos_stw1 & POS_STW1.POSITIVE) - bool(words.pos_stw1 & POS_STW1.NEGATIVE)
            speed = velocity if sign else 0.0
            self._accept(Mode.SETUP, Motion(math.inf * (sign or 1), speed, acceleration, deceleration))
            return
        absolute = words.pos_stw1 & POS_STW1.ABSOLUTE
        target = float(words.target) if absolute else self.demand + words.target
        if self._allowed(target, words, absolute=bool(absolute)):
            self._accept(Mode.MDI, Motion(target, velocity, acceleration, deceleration))

    def _start_block(self, number: int, words: Words, base: float | None = None) -> None:
        block = self._blocks.get(number)
        if block is None:
            self._refuse(Refused.NO_SUCH_BLOCK)
            return
        target = self._target_of(block, self.demand if base is None else base)
        absolute = block.task is BlockTask.ABSOLUTE
        if not self._allowed(target, words, absolute=absolute):
            return
        self._active_block = number
        settings = self.settings
        self._accept(
            Mode.BLOCK,
            Motion(
                target,
                block.velocity,
                settings.max_acceleration * block.acceleration_percent / 100.0,
                settings.max_deceleration * block.deceleration_percent / 100.0,
                self._end_velocity(block, number, target),
            ),
        )

    @staticmethod
    def _target_of(block: TraversingBlock, base: float) -> float:
        if block.task is BlockTask.ABSOLUTE:
            return float(block.position)
        if block.task is BlockTask.RELATIVE:
            return base + block.position
        return math.inf if block.task is BlockTask.ENDLESS_POSITIVE else -math.inf

    def _end_velocity(self, block: TraversingBlock, number: int, target: float) -> float:
        """Return the speed with which a flying block change passes the target: only on in the same direction."""
        following = self._blocks.get(number + 1)
        if block.continuation is not Continuation.FLYING or following is None:
            return 0.0
        way, onward = target - self.demand, self._target_of(following, target) - target
        return min(block.velocity, following.velocity) if way * onward > 0.0 else 0.0

    def _allowed(self, target: float, words: Words, *, absolute: bool) -> bool:
        if absolute and not self.homed:
            self._refuse(Refused.NOT_HOMED)
            return False
        if self._limited(words) and math.isfinite(target):
            low, high = self.settings.software_limits
            if target < low:
                self._refuse(Refused.TARGET_BELOW_LIMIT)
                return False
            if target > high:
                self._refuse(Refused.TARGET_ABOVE_LIMIT)
                return False
        return True

    def _limited(self, words: Words) -> bool:
        return self.homed and bool(words.pos_stw2 & POS_STW2.SOFTWARE_LIMITS)

    def _start_jog(self, words: Words, which: int) -> None:
        settings = self.settings
        velocity = settings.jog_velocities[which]
        target = math.copysign(math.inf, velocity)
        if words.pos_stw2 & POS_STW2.INCREMENTAL_JOG:
            target = self.demand + math.copysign(settings.jog_increments[which], velocity)
            if not self._allowed(target, words, absolute=False):
                return
        self._accept(
            Mode.JOG, Motion(target, abs(velocity), settings.max_acceleration, settings.max_deceleration)
        )

    # -- homing ------------------------------------------------------------------------------------------------

    def _start_homing(self, words: Words) -> None:
        self.homed = False
        on_cam = bool(words.pos_stw2 & POS_STW2.REFERENCE_CAM)
        if self.settings.has_cam and not on_cam:
            self._home(0, self._search_direction(words) * math.inf, self.settings.cam_velocity)
        else:
            self._home(1 if not self.settings.has_cam else 2, *self._mark_search(words))

    def _home(self, phase: int, target: float, velocity: float) -> None:
        self._phase = phase
        settings = self.settings
        self._accept(
            Mode.HOMING, Motion(target, velocity, settings.max_acceleration, settings.max_deceleration)
        )

    @staticmethod
    def _search_direction(words: Words) -> int:
        return -1 if words.pos_stw2 & POS_STW2.SEARCH_NEGATIVE else 1

    def _mark_search(self, words: Words) -> tuple[float, float]:
        """Return where to look for the zero mark: back from the cam, or in the search direction without one."""
        back = -1 if self.settings.has_cam else 1
        return back * self._search_direction(words) * math.inf, self.settings.mark_velocity

    def _go_home(self, words: Words) -> None:
        """Cam, then back off it, then the next zero mark, then the reference point."""
        encoder = self._core.encoder
        cam = bool(words.pos_stw2 & POS_STW2.REFERENCE_CAM)
        if self._phase == 0:
            if cam:
                self._home(2, *self._mark_search(words))
        elif self._phase == 1:
            encoder.arm_zero_mark()
            self._phase = 3
        elif self._phase == 2:
            if not cam:
                self._phase = 1
        elif self._phase == 3:
            latched = encoder.latched_increments
            if latched is not None:
                mark = latched * encoder.radians_per_increment
                settings = self.settings
                self._motion.offset = (
                    mark - (settings.reference_position - settings.reference_offset) * self._motion.scale
                )
                self._home(4, float(settings.reference_position), settings.approach_velocity)
        elif self._phase == 4 and self._motion.arrived():
            self.homed = True
            self.mode = Mode.NONE
            self._wanted = None

    # -- motion ------------------------------------------------------------------------------------------------

    def _watch_cams(self, words: Words, minus_cam: bool, plus_cam: bool) -> None:
        wanted = self._wanted
        if wanted is None or not words.pos_stw2 & POS_STW2.LIMIT_CAMS:
            return
        if minus_cam and wanted.target < self.demand:
            self._refuse(Refused.MINUS_CAM)
        elif plus_cam and wanted.target > self.demand:
            self._refuse(Refused.PLUS_CAM)

    def _progress(self, words: Words, rising: int) -> None:
        """Go on to what follows: the next block, the next phase of homing, the end of the task."""
        if self._motion.halted or self._wanted is None:
            return
        if self.mode is Mode.HOMING:
            self._go_home(words)
        elif self.mode is Mode.BLOCK:
            self._progress_block(words, rising)
        elif math.isfinite(self._wanted.target) and self._motion.arrived():
            self._motion.moving = False
            self.target_reached = self.mode is Mode.MDI

    def _progress_block(self, words: Words, rising: int) -> None:
        wanted = self._wanted
        block = self._blocks[self._active_block]
        following = self._active_block + 1
        external = block.continuation is Continuation.EXTERNAL
        if wanted is None or (external and rising & STW1.EXTERNAL_BLOCK_CHANGE):
            self._start_block(following, words)
        elif wanted.end_velocity > 0.0:
            if self._core.profile.raw_done:
                self._start_block(following, words, wanted.target)
        elif math.isfinite(wanted.target) and self._motion.arrived():
            self._motion.moving = False
            if block.continuation in {Continuation.STOP, Continuation.FLYING}:
                self._start_block(following, words, wanted.target)
            else:
                self.target_reached = True

    # -- status ------------------------------------------------------------------------------------------------

    def _show(self, words: Words, minus_cam: bool, plus_cam: bool) -> None:
        core = self._core
        settings = self.settings
        velocity = core.precontrol_velocity if core.enabled else 0.0
        change = abs(velocity) - abs(self._last_velocity)
        self._last_velocity = velocity
        position, wanted = self.position, self._wanted
        low, high = settings.software_limits
        limited = self._limited(words)
        self.zsw1 = _bits(
            (
                ZSW1.DEVIATION_IN_TOLERANCE,
                abs(core.following_error) <= settings.following_tolerance * self._motion.scale,
            ),
            (ZSW1.TARGET_REACHED, self.target_reached),
            (ZSW1.HOME_POSITION_SET, self.homed),
            (ZSW1.TASK_ACKNOWLEDGED, self._acknowledged),
            (ZSW1.STANDSTILL, core.standing),
            (ZSW1.ACCELERATING, change > 1e-9),
            (ZSW1.DECELERATING, change < -1e-9),
        )
        self.pos_zsw1 = (self._active_block if self.mode is Mode.BLOCK else 0) | _bits(
            (POS_ZSW1.MINUS_CAM, minus_cam),
            (POS_ZSW1.PLUS_CAM, plus_cam),
            (POS_ZSW1.JOG, self.mode is Mode.JOG),
            (POS_ZSW1.HOMING, self.mode is Mode.HOMING or self._referencing),
            (POS_ZSW1.BLOCKS, self.mode is Mode.BLOCK),
            (POS_ZSW1.SETUP, self.mode is Mode.SETUP),
            (POS_ZSW1.MDI, self.mode is Mode.MDI),
        )
        override = max(0, words.override) / N2_ONE
        self.pos_zsw2 = _bits(
            (
                POS_ZSW2.VELOCITY_LIMITED,
                wanted is not None and wanted.velocity * override > settings.max_velocity,
            ),
            (POS_ZSW2.SETPOINT_STANDS, velocity == 0.0),
            (POS_ZSW2.FORWARD, velocity > 0.0),
            (POS_ZSW2.BACKWARD, velocity < 0.0),
            (POS_ZSW2.SOFTWARE_LIMIT_MINUS, limited and self.demand <= low + 0.5),
            (POS_ZSW2.SOFTWARE_LIMIT_PLUS, limited and self.demand >= high - 0.5),
            (POS_ZSW2.CAM_1, position <= settings.position_cams[0]),
            (POS_ZSW2.CAM_2, position <= settings.position_cams[1]),
            (POS_ZSW2.COMMAND_ACTIVE, wanted is not None and not self.target_reached),
        )


def _bits(*rows: tuple[int, bool]) -> int:
    return sum(mask for mask, holds in rows if holds)


def _share(word: float) -> float:
    """Return an acceleration override, 1..100 %; what is not positive is 1 %."""
    return min(1.0, max(0.01, word / N2_ONE))


def _mdi_part(words: Words) -> tuple[float, ...]:
    return (words.pos_stw1, words.target, words.velocity, words.acceleration, words.deceleration)
