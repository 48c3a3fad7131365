"""Terms of the basic positioner: what it is asked to do, why it refuses, the setpoint words."""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import Final, NamedTuple

from fieldbus.profidrive.formats import N2_ONE


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

    STANDSTILL = 7450
    POSITIONING = 7451
    FOLLOWING_ERROR = 7452
    CAM_NOT_FOUND = 7458
    MARK_NOT_FOUND = 7459
    END_OF_CAM_NOT_FOUND = 7460
    NOT_HOMED = 7461
    NO_SUCH_BLOCK = 7462
    INCONSISTENT_BLOCK = 7464
    NO_SUCCESSOR = 7465
    NO_JUMP_TARGET = 7468
    TARGET_BELOW_LIMIT = 7469
    TARGET_ABOVE_LIMIT = 7470
    OUTSIDE_MODULO_RANGE = 7471
    MINUS_CAM = 7491
    PLUS_CAM = 7492

    @property
    def is_fault(self) -> bool:
        """Whether the axis stops with a fault; the others are warnings."""
        return self in _FAULTS


_FAULTS: Final = frozenset(
    {
        Refused.STANDSTILL,
        Refused.POSITIONING,
        Refused.FOLLOWING_ERROR,
        Refused.CAM_NOT_FOUND,
        Refused.MARK_NOT_FOUND,
        Refused.END_OF_CAM_NOT_FOUND,
        Refused.MINUS_CAM,
        Refused.PLUS_CAM,
    }
)


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


def share(word: float) -> float:
    """Return an acceleration override, 1..100 %; what is not positive is 1 %."""
    return min(1.0, max(0.01, word / N2_ONE))


def mdi_part(words: Words) -> tuple[float, ...]:
    """Return what an MDI task consists of."""
    return (words.pos_stw1, words.target, words.velocity, words.acceleration, words.deceleration)
