"""Speed mode of a PROFIdrive axis: its setpoints in the telegram, jog, dynamic servo control (PD-119 to
PD-122, PD-195 to PD-198).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.drive.core import RPM
from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.modes.setpoint_channel import SetpointChannel
from fieldbus.profidrive.words import STW1, ZSW1

if TYPE_CHECKING:
    from emulators.drive.profidrive.drive import ProfidriveDrive

_JOG: Final = int(STW1.JOG_1 | STW1.JOG_2)
_IN_TOLERANCE: Final = int(ZSW1.DEVIATION_IN_TOLERANCE)
_REACHED: Final = int(ZSW1.SPEED_REACHED)
_TORQUE: Final = int(ZSW1.TORQUE_LIMIT_NOT_REACHED)
_BRAKE: Final = int(ZSW1.BRAKE_OPEN)
_COOL_MOTOR: Final = int(ZSW1.NO_MOTOR_OVERTEMPERATURE)
_POSITIVE: Final = int(ZSW1.POSITIVE_DIRECTION)
_NO_OVERLOAD: Final = int(ZSW1.NO_POWER_UNIT_OVERLOAD)
_N2_TO_N4: Final = 16


class SpeedMode:
    """Leads the axis by speed setpoints.

    Args:
        drive: The drive.

    """

    __slots__ = ("_drive", "_kpc_at", "_narrow", "_nsoll_at", "_xerr_at", "channel")

    def __init__(self, drive: ProfidriveDrive) -> None:
        self._drive = drive
        config = drive.config
        self.channel = SetpointChannel(
            drive.core,
            drive.settings,
            steps=config.cycle_ns // config.servo_period_ns,
            cycle_s=config.cycle_ns / 1e9,
            interpolation=config.interpolation,
        )
        place = drive.setpoint_place
        self._narrow = place("NSOLL_A") >= 0 and place("NSOLL_B") < 0
        self._nsoll_at = place("NSOLL_A" if self._narrow else "NSOLL_B")
        self._xerr_at = place("XERR")
        self._kpc_at = place("KPC")

    def restart(self) -> None:
        """Begin as after power-on."""

    def jogs(self, stw1: int) -> bool:
        """Say whether a control word switches on by a jog bit (PD-122); a contradiction of both bits is a
        warning.
        """
        self._drive.faults.warn(DriveWarning.JOG_CONTRADICTION, stw1 & _JOG == _JOG)
        return self.channel.jogging(stw1)

    def lead(self, row: tuple[int, ...]) -> None:
        """Let the setpoints act; in every bus cycle of operation."""
        drive = self._drive
        nsoll = row[self._nsoll_at]
        if self._narrow:
            nsoll <<= _N2_TO_N4
        kpc = row[self._kpc_at]
        if kpc and not (drive.isochronous and drive.settings.operating_mode == 3):
            drive.faults.warn(DriveWarning.DSC_WITHOUT_CLOCK, True)
            kpc = 0
        elif drive.faults.warnings:
            drive.faults.warn(DriveWarning.DSC_WITHOUT_CLOCK, False)
        self.channel.step(drive.stw1, nsoll, row[self._xerr_at], kpc)

    def watch(self) -> None:
        """Do what is due in every bus cycle, whatever the state is."""

    def stop(self, *, quick: bool) -> None:
        """Brake to standstill: OFF1, or OFF3."""
        self.channel.stop_ramp(self._drive.stw1, quick=quick)

    def inhibited(self) -> None:
        """The pulses have been taken away."""
        self.channel.inhibited()

    # -- status words ----------------------------------------------------------------------------------

    def zsw1(self) -> int:
        """Return the bits of ZSW1 that speed mode has in its own way (PD-068 to PD-075)."""
        drive = self._drive
        core = drive.core
        word = _IN_TOLERANCE if drive.words.in_tolerance else 0
        velocity = core.velocity
        limit = drive.settings.comparison_speed_rpm * RPM
        if not -limit < velocity < limit:
            word |= _REACHED
        if velocity >= 0.0:
            word |= _POSITIVE
        if not core.torque_limited:
            word |= _TORQUE
        brake = core.brake
        if not brake.closed and brake.fitted:
            word |= _BRAKE
        warnings = drive.faults.warnings
        if not warnings:
            return word | _COOL_MOTOR | _NO_OVERLOAD
        if DriveWarning.MOTOR_TEMPERATURE not in warnings:
            word |= _COOL_MOTOR
        if DriveWarning.STAGE_TEMPERATURE not in warnings:
            word |= _NO_OVERLOAD
        return word
