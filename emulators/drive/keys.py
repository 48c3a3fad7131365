"""Keys of `[drive.NAME]` that describe the emulated drive: range, unit, default and meaning, once for the
tables of the bench file and for the configurations of the emulators.

A group of keys is what several of them take over as it is. A key that a configuration calls otherwise has
its type here, and takes its default from the configuration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Unit
from typing_extensions import Doc

Increments = Annotated[int, Ge(4), Le(2**24), Unit("inc/rev"), Doc("Resolution of the encoder (608Fh).")]
EncoderKind = Annotated[
    Literal["incremental", "absolute"], Doc("An absolute encoder keeps its position over a loss of supply.")
]
IndexIncrements = Annotated[
    int,
    Ge(0),
    Unit("inc"),
    Doc("Place of the index (zero mark) within the revolution; below `increments_per_revolution`."),
]
MountingIncrements = Annotated[
    int,
    Ge(-(2**31)),
    Le(2**31 - 1),
    Unit("inc"),
    Doc("Value of an absolute encoder where the shaft is at zero: how it has been mounted."),
]


@dataclass(frozen=True, kw_only=True)
class SpeedKeys:
    """Speed of a drive of any kind."""

    max_speed_rpm: Annotated[float, Ge(1.0), Le(200_000.0)] = 3000.0
    """Maximum speed, to which the ramp times refer (p1082, 6080h)."""


@dataclass(frozen=True, kw_only=True)
class TorqueKeys:
    """Torque of a servo drive."""

    rated_torque_nm: Annotated[float, Ge(0.001), Le(1_000_000.0)] = 2.0
    """Rated torque (6076h); torques on the bus are permille of it. The default limit is three times this."""


@dataclass(frozen=True, kw_only=True)
class PullOutTorqueKeys:
    """Torque of a stepper motor."""

    rated_torque_nm: Annotated[float, Ge(0.001), Le(1_000_000.0)] = 2.0
    """Pull-out torque of the motor at low speed."""


@dataclass(frozen=True, kw_only=True)
class Off3Keys:
    """Quick stop of a servo drive."""

    off3_ramp_s: Annotated[float, Ge(0.001), Le(1000.0)] = 0.5
    """From maximum speed to zero with OFF3 (p1135, 6085h); at a CiA 402 drive the slope has to fit into
    6085h.
    """


@dataclass(frozen=True, kw_only=True)
class SpeedLoopKeys:
    """Speed loop of a servo drive."""

    velocity_time_constant_ms: Annotated[float, Gt(0.0), Le(1000.0)] = 2.0
    """Time constant of the closed speed loop of the emulated drive, at least three servo periods."""
    torque_precontrol: bool = True
    """The emulated drive pre-controls the torque of its inertia and follows an interpolated speed without
    lag; without it the speed loop is a first-order lag, as position loops are tuned against.
    """


@dataclass(frozen=True, kw_only=True)
class PowerKeys:
    """Power stage of a servo drive on a bus."""

    power_on_delay_ms: Annotated[float, Ge(0.0), Le(5000.0)] = 0.0
    """Time of transition 3 in the emulated drive (C402-173, PD-103)."""
    blocked_time_ms: Annotated[float, Ge(0.0), Le(60_000.0)] = 0.0
    """Torque limit at standstill for this long is fault 7121h of the emulated drive; 0 = not watched."""


@dataclass(frozen=True, kw_only=True)
class BootKeys:
    """Start of a drive on a bus."""

    boot_time_ms: Annotated[float, Ge(0.0), Le(5000.0)] = 0.0
    """From power-on of the emulated drive to its boot-up frame, on Modbus to its first response."""


@dataclass(frozen=True, kw_only=True)
class Cia402Keys:
    """What a CiA 402 drive does in operation."""

    sync_loss: Literal["fault", "warning", "none"] = "fault"
    """What the emulated drive does when SYNC is missing (C301-037)."""
    sync_jitter_percent: Annotated[float, Ge(0.0), Le(50.0)] = 0.0
    """SYNC that comes early or late by more than this part of the bus cycle has the effect of `sync_loss`;
    0 = not watched (CANP-071).
    """
    missing_setpoints: Annotated[int, Ge(0), Le(1000), Unit("cycles")] = 2
    """Setpoints in a row that may be missing before the emulated drive reacts as 6007h says (C402-104);
    0 = never.
    """
    following_error: Literal["fault", "status"] = "fault"
    """What the emulated drive does when its own following error exceeds 6065h: fault 8611h, or bit 13
    only (C402-153).
    """
    csv_interpolation: bool = True
    """The emulated drive reaches a csv setpoint linearly within the cycle; false: at once."""


@dataclass(frozen=True, kw_only=True)
class ModbusKeys:
    """A PROFIdrive axis as a server on Modbus."""

    unit: Annotated[int, Ge(0), Le(255)] = 1
    """Address on Modbus, each once per line; on a line 1 to 247."""
    map: str = "sinamics_g120"
    """Register map on Modbus: `sinamics_g120`, `sinamics_g220`, `festo`, or a file `*.toml`, which is
    relative to the bench file and part of its digest.
    """
    processing_ms: Annotated[float, Ge(0.0), Le(10_000.0)] = 1.0
    """From a request to its response in the emulated drive (p2024[0])."""


@dataclass(frozen=True, kw_only=True)
class TelegramKeys:
    """Supplements and process data of a PROFIdrive axis."""

    torque_telegram: bool = False
    """Telegram 750 follows: additive torque, torque limits, actual torque."""
    safety_telegram: Literal[700, 701] | None = None
    """Telegram 700 or 701 follows: the safety information channel. On CAN a telegram with its supplements
    has at most 16 words.
    """
    fine_resolution_bits: Annotated[int, Ge(0), Le(20)] = 11
    """Fine resolution of G1_XIST1 (p0418); `increments_per_revolution` are without it (P979[2])."""
    interpolation: bool = True
    """The emulated drive reaches a setpoint of operating mode 3 linearly within the bus cycle; false: at
    once.
    """
