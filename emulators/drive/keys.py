"""Keys of `[drive.NAME]` that describe the emulated drive: range, unit and meaning, once for the bench file
and for the configuration of the drive.
"""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Unit
from typing_extensions import Doc

Increments = Annotated[int, Ge(4), Le(2**24), Unit("inc/rev"), Doc("Resolution of the encoder (608Fh).")]
MaxSpeed_rpm = Annotated[
    float,
    Ge(1.0),
    Le(200_000.0),
    Doc("Maximum speed, to which the ramp times refer (p1082, 6080h)."),
]
EncoderKind = Annotated[
    Literal["incremental", "absolute"], Doc("An absolute encoder keeps its position over a loss of supply.")
]
IndexIncrements = Annotated[
    int,
    Ge(0),
    Unit("inc"),
    Doc("Place of the index (zero mark) within the revolution; below `increments_per_revolution`."),
]
Off1Ramp_s = Annotated[
    float,
    Ge(0.001),
    Le(1000.0),
    Doc(
        "From maximum speed to zero with OFF1 (p1121, 6084h); at a CiA 402 drive the slope has to "
        "fit into 6084h."
    ),
]
Off3Ramp_s = Annotated[
    float,
    Ge(0.001),
    Le(1000.0),
    Doc(
        "From maximum speed to zero with OFF3 (p1135, 6085h); at a CiA 402 drive the slope has to "
        "fit into 6085h."
    ),
]
RatedTorque_nm = Annotated[
    float,
    Ge(0.001),
    Le(1_000_000.0),
    Doc(
        "Rated torque (6076h); torques on the bus are permille of it. The default limit is three times this."
    ),
]
VelocityTimeConstant_ms = Annotated[
    float,
    Gt(0.0),
    Le(1000.0),
    Doc("Time constant of the closed speed loop of the emulated drive, at least three servo periods."),
]
TorquePrecontrol = Annotated[
    bool,
    Doc(
        "The emulated drive pre-controls the torque of its inertia and follows an interpolated "
        "speed without lag; without it the speed loop is a first-order lag, as position loops are "
        "tuned against."
    ),
]
PowerOnDelay_ms = Annotated[float, Ge(0.0), Le(5000.0), Doc("Time of transition 3 in the emulated drive.")]
BlockedTime_ms = Annotated[
    float,
    Ge(0.0),
    Le(60_000.0),
    Doc("Torque limit at standstill for this long is fault 7121h of the emulated drive; 0 = not watched."),
]
BootTime_ms = Annotated[
    float, Ge(0.0), Le(5000.0), Doc("From power-on of the emulated drive to its boot-up frame.")
]
SyncLoss = Annotated[
    Literal["fault", "warning", "none"], Doc("What the emulated drive does when SYNC is missing.")
]
SyncJitter_percent = Annotated[
    float,
    Ge(0.0),
    Le(50.0),
    Doc(
        "SYNC that comes early or late by more than this part of the bus cycle has the effect of "
        "`sync_loss`; 0 = not watched."
    ),
]
MissingSetpoints = Annotated[
    int,
    Ge(0),
    Le(1000),
    Unit("cycles"),
    Doc("Setpoints in a row that may be missing before the emulated drive reacts as 6007h says; 0 = never."),
]
FollowingError = Annotated[
    Literal["fault", "status"],
    Doc(
        "What the emulated drive does when its own following error exceeds 6065h: fault 8611h, or "
        "bit 13 only."
    ),
]
CsvInterpolation = Annotated[
    bool,
    Doc("The emulated drive reaches a csv setpoint linearly within the cycle; false: at once."),
]
