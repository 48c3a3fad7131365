"""Motion commands of an axis, as blocks give them to it."""

from __future__ import annotations

from enum import IntEnum
from typing import Final


class CommandState(IntEnum):
    """How a command stands (`CmdState`)."""

    BUFFERED = 0
    ACTIVE = 1
    DONE = 2
    ABORTED = 3
    ERROR = 4


class BufferMode(IntEnum):
    """`MC_BufferMode`: when a command takes over from the one before, and with which velocity."""

    Aborting = 0
    Buffered = 1
    BlendingLow = 2
    BlendingPrevious = 3
    BlendingNext = 4
    BlendingHigh = 5


POSITION: Final = 0
"""To a position, and stand there."""
ENDLESS: Final = 1
"""With a velocity, on and on."""
CONTINUOUS: Final = 2
"""To a position, and on from there with a velocity."""
STOP: Final = 3
"""To standstill."""


class Command:
    """One motion command.

    Args:
        kind: `POSITION`, `ENDLESS`, `CONTINUOUS` or `STOP`.
        velocity: Magnitude of the velocity, position unit/s.
        acceleration: Position unit/s2.
        deceleration: Position unit/s2.
        jerk: Position unit/s3; 0.0 for none.
        target: Target position, position unit; of an endless motion its direction, -1 or 1.
        end_velocity: Magnitude of the velocity at the target of `CONTINUOUS`, position unit/s.
        buffer_mode: When it takes over.
        locks: Nothing else is accepted until it is released (`MC_Stop`).
        relative: `target` is a distance from the set position at which the command begins.

    """

    __slots__ = (
        "acceleration",
        "buffer_mode",
        "deceleration",
        "end_velocity",
        "error_id",
        "in_velocity",
        "jerk",
        "kind",
        "locks",
        "number",
        "relative",
        "state",
        "target",
        "velocity",
    )

    def __init__(
        self,
        kind: int,
        *,
        velocity: float = 0.0,
        acceleration: float,
        deceleration: float,
        jerk: float,
        target: float = 0.0,
        end_velocity: float = 0.0,
        buffer_mode: BufferMode = BufferMode.Aborting,
        locks: bool = False,
        relative: bool = False,
    ) -> None:
        self.kind = kind
        self.velocity = velocity
        self.acceleration = acceleration
        self.deceleration = deceleration
        self.jerk = jerk
        self.target = target
        self.end_velocity = end_velocity
        self.buffer_mode = buffer_mode
        self.locks = locks
        self.relative = relative
        self.number = 0
        self.state = CommandState.BUFFERED
        self.error_id = 0
        self.in_velocity = False
        """An endless command has reached its velocity."""

    @property
    def ended(self) -> bool:
        """Whether it is over, one way or another."""
        return self.state >= CommandState.DONE
