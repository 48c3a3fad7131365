"""`[drive.NAME.positioner]` of a bench file: the basic positioner of a drive behind a positioning
telegram.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from fieldbus.errors import ConfigurationError
from hil.bench._drive_sections import NotNegative, Positive, Section

if TYPE_CHECKING:
    from emulators.drive.profidrive.positioner.config import PositionerSettings

Position = Annotated[int, Field(ge=-2_147_482_648, le=2_147_482_647)]
"""LU."""


class BlockSection(Section):
    """`[[drive.NAME.positioner.block]]`: a traversing block."""

    number: Annotated[int, Field(ge=0, le=63)]
    task: Literal[
        "absolute",
        "relative",
        "endless positive",
        "endless negative",
        "wait",
        "goto",
        "set output",
        "reset output",
    ] = "absolute"
    position: Position = 0
    """Target or way, LU."""
    velocity: Positive = 600.0
    """1000 LU/min."""
    acceleration_percent: Annotated[float, Field(ge=1.0, le=100.0)] = 100.0
    deceleration_percent: Annotated[float, Field(ge=1.0, le=100.0)] = 100.0
    continuation: Literal["end", "continue with stop", "continue flying", "continue external"] = "end"
    parameter: int = 0
    """Of a block that does not move: ms, block number, or outputs as bits."""


class PositionerSection(Section):
    """`[drive.NAME.positioner]`: lengths in LU, velocities in 1000 LU/min, accelerations in 1000 LU/s^2."""

    lu_per_revolution: Positive = 10_000.0
    """Length units per revolution of the motor; on a screw of 10 mm the default is 1 um."""
    max_velocity: Positive = 30_000.0
    max_acceleration: Positive = 1_000.0
    max_deceleration: Positive = 1_000.0
    software_limits: tuple[Position, Position] = (-2_147_482_648, 2_147_482_647)
    software_limits_on: bool = False
    """They count without POS_STW2 bit 14."""
    limit_cams_on: bool = False
    """The limit switches stop the axis without POS_STW2 bit 15."""
    window: Positive = 40.0
    following_tolerance: Positive = 1_000.0
    clamping_torque_nm: Positive | None = None
    """Torque limit on the way to a fixed stop (STW2 bit 8); None = that of the drive."""
    fixed_stop_tolerance: Positive = 1_000.0
    modulo_range: NotNegative = 0.0
    """0 = no modulo axis."""
    jog_velocities: tuple[float, float] = (-300.0, 300.0)
    jog_increments: tuple[int, int] = (1_000, 1_000)
    reference_position: Position = 0
    reference_offset: Position = 0
    search_negative: bool = False
    """Homing looks in negative direction; POS_STW2 bit 9 turns that round."""
    has_cam: bool = True
    """Homing looks for the home switch first, then for the zero mark."""
    cam_velocity: Positive = 5_000.0
    mark_velocity: Positive = 300.0
    approach_velocity: Positive = 300.0
    max_cam_distance: Positive = 2_147_482_647.0
    max_mark_distance: Positive = 20_000.0
    position_cams: tuple[Position, Position] = (0, 0)
    block: tuple[BlockSection, ...] = ()

    @model_validator(mode="after")
    def _fits(self) -> PositionerSection:
        if self.model_fields_set:
            try:
                self.build()
            except ConfigurationError as error:
                raise ValueError(str(error)) from None
        return self

    def build(self) -> PositionerSettings:
        """Return the settings of the emulated positioner."""
        from emulators.drive.profidrive.positioner.config import (
            BlockTask,
            Continuation,
            PositionerSettings,
            TraversingBlock,
        )

        blocks = tuple(
            (
                row.number,
                TraversingBlock(
                    task=BlockTask(row.task),
                    position=row.position,
                    velocity=row.velocity,
                    acceleration_percent=row.acceleration_percent,
                    deceleration_percent=row.deceleration_percent,
                    continuation=Continuation(row.continuation),
                    parameter=row.parameter,
                ),
            )
            for row in self.block
        )
        plain = self.model_dump(exclude={"block", "clamping_torque_nm"})
        clamping = math.inf if self.clamping_torque_nm is None else self.clamping_torque_nm
        return PositionerSettings(**plain, clamping_torque_Nm=clamping, blocks=blocks)
