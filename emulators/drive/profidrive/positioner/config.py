"""Settings of the basic positioner: scaling, limits, homing, traversing blocks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.words import POS_STW2

LAST_BLOCK = 63


class BlockTask(Enum):
    """What a traversing block does."""

    ABSOLUTE = "absolute"
    RELATIVE = "relative"
    ENDLESS_POSITIVE = "endless positive"
    ENDLESS_NEGATIVE = "endless negative"
    WAIT = "wait"
    """For `parameter` milliseconds."""
    GOTO = "goto"
    """Block `parameter` is next."""
    SET_OUTPUT = "set output"
    """Direct outputs by the bits of `parameter`, 1..3."""
    RESET_OUTPUT = "reset output"


_PARAMETERS: Final = {
    BlockTask.WAIT: range(1_000_001),
    BlockTask.GOTO: range(LAST_BLOCK + 1),
    BlockTask.SET_OUTPUT: range(1, 4),
    BlockTask.RESET_OUTPUT: range(1, 4),
}
"""Range of `TraversingBlock.parameter` of the tasks that do not move."""


class Continuation(Enum):
    """What follows a traversing block."""

    END = "end"
    STOP = "continue with stop"
    FLYING = "continue flying"
    EXTERNAL = "continue external"
    """With the edge of STW1 bit 13, at whatever place; without it the axis waits at the target."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TraversingBlock:
    """A row of the table of blocks.

    Args:
        task: Kind of motion.
        position: Target or way, LU.
        velocity: 1000 LU/min, > 0.
        acceleration_percent: Of the maximum acceleration, 1..100.
        deceleration_percent: Of the maximum deceleration, 1..100.
        continuation: What follows.
        parameter: Of a block that does not move: ms, block number, or outputs as bits.

    Raises:
        ConfigurationError: A value is out of its range, or an endless block waits for its target.

    """

    task: BlockTask = BlockTask.ABSOLUTE
    position: int = 0
    velocity: float = 600.0
    acceleration_percent: float = 100.0
    deceleration_percent: float = 100.0
    continuation: Continuation = Continuation.END
    parameter: int = 0

    def __post_init__(self) -> None:
        allowed = _PARAMETERS.get(self.task)
        if allowed is not None and self.parameter not in allowed:
            raise ConfigurationError(
                f"block parameter of {self.task.value}",
                self.parameter,
                f"{allowed.start}..{allowed.stop - 1}",
            )
        _positive("block velocity", self.velocity)
        for name in ("acceleration_percent", "deceleration_percent"):
            if not 1.0 <= getattr(self, name) <= 100.0:
                raise ConfigurationError(f"block {name}", getattr(self, name), "1..100")
        if self.endless and self.continuation in {Continuation.STOP, Continuation.FLYING}:
            raise ConfigurationError(
                "block continuation", self.continuation.value, "end or continue external"
            )

    @property
    def endless(self) -> bool:
        """Whether it has no target."""
        return self.task in {BlockTask.ENDLESS_POSITIVE, BlockTask.ENDLESS_NEGATIVE}

    @property
    def moves(self) -> bool:
        """Whether it is a motion."""
        return self.task not in _PARAMETERS


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionerSettings:
    """Settings of the positioner.

    Args:
        lu_per_revolution: Length units per revolution of the motor, > 0.
        max_velocity: p2571, 1000 LU/min, > 0.
        max_acceleration: p2572, 1000 LU/s^2, > 0.
        max_deceleration: p2573, 1000 LU/s^2, > 0; also that of a rejected task.
        software_limits: p2580, p2581, LU.
        window: p2544, LU, > 0.
        positioning_time_s: p2545: so long after the demand the axis may need into the window, s; 0 = not
            watched.
        standstill_window: p2542, LU, > 0: while the demand stands, the axis stays within it ...
        standstill_time_s: p2543: ... or is out of it for this long at most, s; 0 = not watched.
        following_tolerance: p2546, LU, > 0.
        clamping_torque_Nm: Torque limit while STW2 bit 8 asks to travel to a fixed stop, Nm, > 0; inf =
            that of the drive.
        fixed_stop_tolerance: p2634, LU, > 0: following error from which on the stop counts as reached.
        modulo_range: p2576, LU, of a modulo axis; 0 = none.
        max_cam_distance: p2606, LU, > 0: way within which homing has to find the cam, and its end.
        max_mark_distance: p2609, LU, > 0: way from the cam within which it has to find the zero mark.
        jog_velocities: p2585, p2586, 1000 LU/min, the sign is the direction.
        jog_increments: p2587, p2588, LU, >= 0; the direction is that of the velocity.
        reference_position: p2599, LU.
        reference_offset: p2600, way from the zero mark to the reference point, LU.
        cam_velocity: p2605, 1000 LU/min, > 0.
        mark_velocity: p2608, 1000 LU/min, > 0.
        approach_velocity: p2611, 1000 LU/min, > 0.
        has_cam: p2607: homing looks for the cam first.
        search_negative: p2604: homing looks in negative direction; POS_STW2 bit 9 turns that round.
        software_limits_on: p2582 = 1: the software limits count without POS_STW2 bit 14.
        limit_cams_on: p2568 = 1: the limit cams count without POS_STW2 bit 15.
        mdi_target: p2690, LU: target of MDI where the telegram has none.
        mdi_velocity: p2691, 1000 LU/min: velocity of MDI where the telegram has none.
        position_cams: p2547, p2548, LU.
        rest_is_reached: ZSW1 bit 10 is also 1 while the axis stands without a task: after homing, jog and
            a rejection, as Festo drives show it; otherwise after MDI and blocks alone.
        blocks: Traversing blocks by number, 0..63.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    lu_per_revolution: float = 10_000.0
    max_velocity: float = 30_000.0
    max_acceleration: float = 1_000.0
    max_deceleration: float = 1_000.0
    software_limits: tuple[int, int] = (-2_147_482_648, 2_147_482_647)
    window: float = 40.0
    positioning_time_s: float = 1.0
    standstill_window: float = 200.0
    standstill_time_s: float = 0.2
    following_tolerance: float = 1_000.0
    clamping_torque_Nm: float = math.inf
    fixed_stop_tolerance: float = 1_000.0
    modulo_range: float = 0.0
    max_cam_distance: float = 2_147_482_647.0
    max_mark_distance: float = 20_000.0
    jog_velocities: tuple[float, float] = (-300.0, 300.0)
    jog_increments: tuple[int, int] = (1_000, 1_000)
    reference_position: int = 0
    reference_offset: int = 0
    cam_velocity: float = 5_000.0
    mark_velocity: float = 300.0
    approach_velocity: float = 300.0
    has_cam: bool = True
    search_negative: bool = False
    software_limits_on: bool = False
    limit_cams_on: bool = False
    mdi_target: int = 0
    mdi_velocity: int = 600
    position_cams: tuple[int, int] = (0, 0)
    rest_is_reached: bool = False
    blocks: tuple[tuple[int, TraversingBlock], ...] = ()

    def __post_init__(self) -> None:
        for name in (
            "lu_per_revolution",
            "max_velocity",
            "max_acceleration",
            "max_deceleration",
            "window",
            "following_tolerance",
            "cam_velocity",
            "mark_velocity",
            "approach_velocity",
            "standstill_window",
            "max_cam_distance",
            "max_mark_distance",
            "fixed_stop_tolerance",
        ):
            _positive(name, getattr(self, name))
        for name in ("positioning_time_s", "standstill_time_s", "modulo_range"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise ConfigurationError(name, getattr(self, name), "a number >= 0")
        if not self.clamping_torque_Nm > 0.0:
            raise ConfigurationError("clamping_torque_Nm", self.clamping_torque_Nm, "a number > 0, or inf")
        if not self.software_limits[0] < self.software_limits[1]:
            raise ConfigurationError("software_limits", self.software_limits, "the lower one first")
        for velocity, way in zip(self.jog_velocities, self.jog_increments, strict=True):
            if not (math.isfinite(velocity) and velocity) or way < 0:
                raise ConfigurationError("jog_velocities, jog_increments", (velocity, way), "not 0; >= 0")
        numbers = [number for number, _ in self.blocks]
        if len(set(numbers)) != len(numbers) or not all(0 <= number <= LAST_BLOCK for number in numbers):
            raise ConfigurationError("blocks", numbers, f"each number once, 0..{LAST_BLOCK}")

    @property
    def always_on(self) -> int:
        """Bits of POS_STW2 that are 1 whatever the telegram says."""
        return (POS_STW2.SOFTWARE_LIMITS if self.software_limits_on else 0) | (
            POS_STW2.LIMIT_CAMS if self.limit_cams_on else 0
        )


def _positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ConfigurationError(name, value, "a number > 0")
