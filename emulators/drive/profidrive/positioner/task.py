"""The task of the basic positioner: what it is to do, whether it was accepted, where positions are."""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.core import ServoCore
from emulators.drive.positioner_config import PositionerSettings
from emulators.drive.profidrive.positioner.motion import Motion, ProfileMotion
from emulators.drive.profidrive.positioner.terms import Mode, Refused, Words
from fieldbus.profidrive.words import POS_STW2

_SOFTWARE_LIMITS: Final = int(POS_STW2.SOFTWARE_LIMITS)


class Task:
    """Accepts, refuses and ends tasks; homing, traversing blocks and the fixed stop work on it.

    Args:
        core: Servo core.
        motion: Positions in LU on the profile of the servo core.
        settings: Scaling, limits, blocks.

    """

    def __init__(self, core: ServoCore, motion: ProfileMotion, settings: PositionerSettings) -> None:
        self.core = core
        self.motion = motion
        self.settings = settings
        self.mode = Mode.NONE
        self.wanted: Motion | None = None
        """Motion of the task; None: it does not move."""
        self.homed = False
        """Whether the home position is set (PD-071)."""
        self.refused: Refused | None = None
        """Why the last task was refused, while its request stands; None after one was accepted."""
        self.refusals = 0
        """How many were so far."""
        self.target_reached = False
        self.stop_reached = False
        """The fixed stop has been reached."""

    @property
    def demand(self) -> float:
        """Position demand, LU; not wrapped."""
        return self.motion.demand

    @property
    def rests(self) -> bool:
        """Whether the axis stands, with its position held, without a task or in an intermediate stop."""
        core = self.core
        if self.mode is not Mode.NONE and not self.motion.held:
            return False
        return core.enabled and core.standing and not self.motion.moving

    def accept(self, mode: Mode, motion: Motion | None) -> None:
        """Begin a task; None: one that does not move."""
        self.mode = mode
        self.wanted = motion
        self.stop_reached = False
        self.target_reached = False
        self.refused = None

    def finish(self) -> None:
        """End a task that is done and shows nothing any more."""
        self.mode = Mode.NONE
        self.wanted = None

    def abandon(self) -> None:
        """Give the task up: brake with the maximum deceleration."""
        if self.mode is not Mode.NONE:
            self.target_reached = False
        self.finish()

    def refuse(self, reason: Refused) -> None:
        """Refuse a task, or give it up, for a reason."""
        self.refused = reason
        self.refusals += 1
        self.abandon()

    def place(self, angle: float, position: float) -> None:
        """Call the place at a measured angle (rad) a position, LU; a
        relative task under way keeps its way.
        """
        offset = angle - position * self.motion.scale
        wanted = self.wanted
        if wanted is not None and wanted.relative:
            moved = (self.motion.offset - offset) / self.motion.scale
            self.wanted = wanted._replace(target=wanted.target + moved)
        self.motion.offset = offset

    def absolute(self, target: float, sign: int) -> float | None:
        """Return where an absolute target is, LU: of a modulo axis in the direction
        wanted, or on the shorter way.

        None, and the task is refused, when it is outside of the modulo range.
        """
        modulo = self.settings.modulo_range
        if not modulo:
            return target
        if not 0.0 <= target < modulo:
            self.refuse(Refused.OUTSIDE_MODULO_RANGE)
            return None
        demand = self.demand
        way = (target - demand) % modulo
        if (sign < 0 and way) or (sign == 0 and way > modulo / 2.0):
            way -= modulo
        return demand + way

    def allowed(self, target: float, words: Words, *, absolute: bool) -> bool:
        """Say whether a target, LU, may be gone to; if not, the task is refused."""
        if absolute and not self.homed:
            self.refuse(Refused.NOT_HOMED)
            return False
        if self.limited(words) and math.isfinite(target):
            low, high = self.settings.software_limits
            if target < low:
                self.refuse(Refused.TARGET_BELOW_LIMIT)
                return False
            if target > high:
                self.refuse(Refused.TARGET_ABOVE_LIMIT)
                return False
        return True

    def limited(self, words: Words) -> bool:
        """Say whether the software limits are in effect; a modulo axis has none."""
        return self.homed and bool(words.pos_stw2 & _SOFTWARE_LIMITS) and not self.settings.modulo_range
