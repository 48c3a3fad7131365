"""Settings of the basic positioner: scaling, limits, homing, traversing blocks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal

from annotated_types import Ge, Gt, Le, Unit

from emulators.checked_fields import BENCH_FILE_TABLE, Positive, check_fields
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.words import POS_STW2

LAST_BLOCK: Final = 63


Position = Annotated[int, Ge(-2_147_482_648), Le(2_147_482_647), Unit("LU")]
Length = Annotated[float, Gt(0.0), Unit("LU")]
Velocity = Annotated[float, Gt(0.0), Unit("1000 LU/min")]
Acceleration = Annotated[float, Gt(0.0), Unit("1000 LU/s²")]
Percent = Annotated[float, Ge(1.0), Le(100.0)]
Time_ms = Annotated[float, Ge(0.0), Le(100_000.0)]

BlockTask = Literal[
    "absolute",
    "relative",
    "endless positive",
    "endless negative",
    "wait",
    "goto",
    "set output",
    "reset output",
]
Continuation = Literal["end", "continue with stop", "continue flying", "continue external"]

_PARAMETERS: Final[dict[BlockTask, range]] = {
    "wait": range(1_000_001),
    "goto": range(LAST_BLOCK + 1),
    "set output": range(1, 4),
    "reset output": range(1, 4),
}
"""Range of `TraversingBlock.parameter` of the tasks that do not move."""


@dataclass(frozen=True, kw_only=True)
class TraversingBlock:
    """`[[drive.NAME.positioner.block]]`: a traversing block.

    Raises:
        ConfigurationError: A value is out of its range, or an endless block waits for its target.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    number: Annotated[int, Ge(0), Le(LAST_BLOCK)]
    """Number of the block."""
    task: BlockTask = "absolute"
    """What it does."""
    position: Position = 0
    """Target or way."""
    velocity: Velocity = 600.0
    """Velocity of a motion."""
    acceleration_percent: Percent = 100.0
    """Of `max_acceleration`."""
    deceleration_percent: Percent = 100.0
    """Of `max_deceleration`."""
    continuation: Continuation = "end"
    """What follows: nothing, the next number at rest or in motion, or the next number with the edge of STW1
    bit 13.
    """
    parameter: int = 0
    """Ms of `wait`, block of `goto`, outputs as bits (1 to 3)."""

    def __post_init__(self) -> None:
        check_fields(self, "block")
        allowed = _PARAMETERS.get(self.task)
        if allowed is not None and self.parameter not in allowed:
            raise ConfigurationError(
                f"block parameter of {self.task}", self.parameter, f"{allowed.start}..{allowed.stop - 1}"
            )
        if self.endless and self.continuation in ("continue with stop", "continue flying"):
            raise ConfigurationError("block continuation", self.continuation, "end or continue external")

    @property
    def endless(self) -> bool:
        """Whether it has no target."""
        return self.task in ("endless positive", "endless negative")

    @property
    def moves(self) -> bool:
        """Whether it is a motion."""
        return self.task not in _PARAMETERS


@dataclass(frozen=True, kw_only=True)
class PositionerSettings:
    """`[drive.NAME.positioner]`: lengths in LU, velocities in 1000 LU/min, accelerations in 1000 LU/s².

    Raises:
        ConfigurationError: A value is out of its range.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    lu_per_revolution: Length = 10_000.0
    """Length units per revolution of the motor (p2506); on a screw of 10 mm the default is 1 µm."""
    max_velocity: Velocity = 30_000.0
    """p2571."""
    max_acceleration: Acceleration = 1_000.0
    """p2572."""
    max_deceleration: Acceleration = 1_000.0
    """p2573; also that of a rejected task."""
    software_limits: tuple[Position, Position] = (-2_147_482_648, 2_147_482_647)
    """p2580, p2581."""
    software_limits_on: bool = False
    """They count without POS_STW2 bit 14 (p2582)."""
    limit_cams_on: bool = False
    """The limit switches stop the axis without POS_STW2 bit 15 (p2568)."""
    window: Length = 40.0
    """Positioning window (p2544)."""
    positioning_time_ms: Time_ms = 1_000.0
    """After the demand the axis may need so long into the window, else F07451 (p2545); 0 = not watched."""
    standstill_window: Length = 200.0
    """While the demand stands, the axis stays within this window (p2542)."""
    standstill_time_ms: Time_ms = 200.0
    """Out of that window for longer than this is F07450 (p2543); 0 = not watched."""
    following_tolerance: Length = 1_000.0
    """Following error beyond which the drive trips with F07452 (p2546)."""
    clamping_torque_nm: Positive | None = None
    """Torque limit on the way to a fixed stop, while STW2 bit 8 is 1; none: that of the drive."""
    fixed_stop_tolerance: Length = 1_000.0
    """Following error from which on the stop counts as reached (p2634)."""
    modulo_range: Annotated[float, Ge(0.0), Unit("LU")] = 0.0
    """Range of a modulo axis (p2576); 0 = none."""
    jog_velocities: Annotated[tuple[float, float], Unit("1000 LU/min")] = (-300.0, 300.0)
    """Of jog 1 and 2 (p2585, p2586); the sign is the direction; not 0."""
    jog_increments: Annotated[tuple[Annotated[int, Ge(0)], Annotated[int, Ge(0)]], Unit("LU")] = (
        1_000,
        1_000,
    )
    """p2587, p2588; the direction is that of the velocity."""
    reference_position: Position = 0
    """p2599."""
    reference_offset: Position = 0
    """From the zero mark to the reference point (p2600)."""
    search_negative: bool = False
    """Homing looks in negative direction (p2604); POS_STW2 bit 9 turns that round."""
    has_cam: bool = True
    """Homing looks for the home switch first, then for the zero mark (p2607)."""
    home_here: bool = False
    """Homing looks for nothing: the present position becomes the reference point, as in method 37 of CiA 402.
    """
    cam_velocity: Velocity = 5_000.0
    """p2605."""
    mark_velocity: Velocity = 300.0
    """p2608."""
    approach_velocity: Velocity = 300.0
    """p2611."""
    max_cam_distance: Length = 2_147_482_647.0
    """Way within which homing has to find the cam, and its end (p2606)."""
    max_mark_distance: Length = 20_000.0
    """Way within which it has to find the zero mark (p2609)."""
    mdi_target: Position = 0
    """Target of MDI where the telegram has none (p2690)."""
    mdi_velocity: Annotated[int, Ge(0), Le(40_000_000), Unit("1000 LU/min")] = 600
    """Velocity of MDI where the telegram has none (p2691)."""
    position_cams: tuple[Position, Position] = (0, 0)
    """p2547, p2548: POS_ZSW2 bits 8 and 9."""
    rest_is_reached: bool = False
    """ZSW1 bit 10 is also 1 while the axis stands without a task or in an intermediate stop: after homing,
    jog and a rejection, as Festo drives show it; otherwise after MDI and blocks alone.
    """
    negative_velocity: Literal["zero", "absolute"] = "zero"
    """What a velocity below 0 means in MDI: the axis stands, or it moves with the absolute value."""
    refused_task: Literal["warning", "fault"] = "warning"
    """What a task is that cannot be carried out (no such block, not homed, target beyond a limit): a warning
    while its request stands, or a fault with OFF1 under the number of that warning.
    """
    block: tuple[TraversingBlock, ...] = ()
    """Traversing blocks; see the next section."""

    def __post_init__(self) -> None:
        check_fields(self, "positioner")
        if not self.software_limits[0] < self.software_limits[1]:
            raise ConfigurationError("software_limits", self.software_limits, "the lower one first")
        if not all(self.jog_velocities):
            raise ConfigurationError("jog_velocities", self.jog_velocities, "not 0")
        numbers = [one.number for one in self.block]
        if len(set(numbers)) != len(numbers):
            raise ConfigurationError("block", numbers, "each number once")

    @property
    def always_on(self) -> int:
        """Bits of POS_STW2 that are 1 whatever the telegram says."""
        return (POS_STW2.SOFTWARE_LIMITS if self.software_limits_on else 0) | (
            POS_STW2.LIMIT_CAMS if self.limit_cams_on else 0
        )
