"""Speed mode of a PROFIdrive axis: its setpoints in the telegram, jog, dynamic servo control (PD-119 to
PD-122, PD-195 to PD-198).
"""

from __future__ import annotations

from typing import Final

from emulators.drive.core import RPM, ServoCore
from emulators.drive.profidrive.config import DriveSettings
from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.faults.state import FaultState
from emulators.drive.profidrive.modes.setpoint_channel import SetpointChannel
from emulators.drive.profidrive.process_data import ProcessData
from emulators.drive.protection import WindowTimer
from fieldbus.profidrive.words import STW1, ZSW1

_JOG: Final = int(STW1.JOG_1 | STW1.JOG_2)
_IN_TOLERANCE: Final = int(ZSW1.DEVIATION_IN_TOLERANCE)
_REACHED: Final = int(ZSW1.SPEED_REACHED)
_TORQUE: Final = int(ZSW1.TORQUE_LIMIT_NOT_REACHED)
_BRAKE: Final = int(ZSW1.BRAKE_OPEN)
_COOL_MOTOR: Final = int(ZSW1.NO_MOTOR_OVERTEMPERATURE)
_POSITIVE: Final = int(ZSW1.POSITIVE_DIRECTION)
_NO_OVERLOAD: Final = int(ZSW1.NO_POWER_UNIT_OVERLOAD)
_N2_TO_N4: Final = 16


class SpeedDeviation:
    """Watches the deviation of the speed from its setpoint (PD-079).

    Args:
        core: Servo core.
        settings: Parameters in effect.
        cycle_s: Bus cycle, s.

    """

    def __init__(self, core: ServoCore, settings: DriveSettings, *, cycle_s: float) -> None:
        self._core = core
        self._settings = settings
        self._cycle_s = cycle_s
        self._window = WindowTimer()
        self.in_tolerance = True
        """Whether the speed is, or was a moment ago, near its setpoint."""

    def restart(self) -> None:
        """Begin as after power-on."""
        self._window.reset()
        self.in_tolerance = True

    def watch(self) -> None:
        """Compare speed and setpoint; once per bus cycle."""
        core = self._core
        if not core.enabled:
            self._window.reset()
            self.in_tolerance = True
            return
        settings = self._settings
        self._window.time_s = settings.deviation_time_s
        difference = abs(core.precontrol_velocity - core.velocity)
        self.in_tolerance = not self._window.update(difference > settings.deviation_rpm * RPM, self._cycle_s)


class SpeedMode:
    """Leads the axis by speed setpoints.

    Args:
        channel: Setpoint channel.
        core: Servo core.
        data: Setpoints of the telegram.
        settings: Parameters in effect.
        faults: Faults and warnings.
        deviation: Deviation of the speed.
        isochronous: Whether the telegram comes with the clock.

    """

    def __init__(
        self,
        channel: SetpointChannel,
        core: ServoCore,
        data: ProcessData,
        *,
        settings: DriveSettings,
        faults: FaultState,
        deviation: SpeedDeviation,
        isochronous: bool,
    ) -> None:
        self.channel = channel
        self._core = core
        self._data = data
        self._settings = settings
        self._faults = faults
        self._deviation = deviation
        self._isochronous = isochronous
        place = data.place
        self._narrow = place("NSOLL_A") >= 0 and place("NSOLL_B") < 0
        self._nsoll_at = place("NSOLL_A" if self._narrow else "NSOLL_B")
        self._xerr_at = place("XERR")
        self._kpc_at = place("KPC")

    def restart(self) -> None:
        """Begin as after power-on."""

    def jogs(self, stw1: int) -> bool:
        """Say whether a control word switches on by a jog bit (PD-122); a
        contradiction of both bits is a warning.
        """
        self._faults.warn(DriveWarning.JOG_CONTRADICTION, stw1 & _JOG == _JOG)
        return self.channel.jogging(stw1)

    def lead(self, row: tuple[int, ...]) -> None:
        """Let the setpoints act; in every bus cycle of operation."""
        faults = self._faults
        nsoll = row[self._nsoll_at]
        if self._narrow:
            nsoll <<= _N2_TO_N4
        kpc = row[self._kpc_at]
        if kpc and not (self._isochronous and self._settings.operating_mode == 3):
            faults.warn(DriveWarning.DSC_WITHOUT_CLOCK, True)
            kpc = 0
        elif faults.warnings:
            faults.warn(DriveWarning.DSC_WITHOUT_CLOCK, False)
        self.channel.step(self._data.stw1, nsoll, row[self._xerr_at], kpc)

    def watch(self) -> None:
        """Do what is due in every bus cycle, whatever the state is."""

    def stop(self, *, quick: bool) -> None:
        """Brake to standstill: OFF1, or OFF3."""
        self.channel.stop_ramp(self._data.stw1, quick=quick)

    def inhibited(self) -> None:
        """The pulses have been taken away."""
        self.channel.inhibited()

    # -- status words ----------------------------------------------------------------------------------

    def zsw1(self) -> int:
        """Return the bits of ZSW1 that speed mode has in its own way (PD-068 to PD-075)."""
        core = self._core
        word = _IN_TOLERANCE if self._deviation.in_tolerance else 0
        velocity = core.velocity
        limit = self._settings.comparison_speed_rpm * RPM
        if not -limit < velocity < limit:
            word |= _REACHED
        if velocity >= 0.0:
            word |= _POSITIVE
        if not core.torque_limited:
            word |= _TORQUE
        brake = core.brake
        if not brake.closed and brake.fitted:
            word |= _BRAKE
        warnings = self._faults.warnings
        if not warnings:
            return word | _COOL_MOTOR | _NO_OVERLOAD
        if DriveWarning.MOTOR_TEMPERATURE not in warnings:
            word |= _COOL_MOTOR
        if DriveWarning.STAGE_TEMPERATURE not in warnings:
            word |= _NO_OVERLOAD
        return word
