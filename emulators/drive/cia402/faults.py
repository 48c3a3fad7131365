"""Fault memory of the drive and its monitors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.drive.cia402.axis import UNLIMITED
from emulators.drive.protection import ThermalModel, WindowTimer
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.cia402 import emcy_text
from fieldbus.history import History

if TYPE_CHECKING:
    from emulators.drive.cia402.device import DriveDevice

FOLLOWING_ERROR: Final = 0x8611
LIMIT_SWITCH: Final = 0x8612
OVERLOAD: Final = 0x2310
BLOCKED: Final = 0x7121
UNDERVOLTAGE: Final = 0x3220
OVERVOLTAGE: Final = 0x3210
COMMUNICATION: Final = 0x8130
BUS_OFF: Final = 0x8140
RPDO_TIMEOUT: Final = 0x8250
SYNC_LOST: Final = 0x8700
SAFE_TORQUE_OFF: Final = 0xFF80


class FaultMemory:
    """The faults that are latched, with EMCY, 603Fh and history (C402-014, C402-016).

    Args:
        slave: Sends the EMCYs and holds 603Fh.
        name: Source in the history.
        history: Log; None for none.

    """

    __slots__ = ("_history", "_name", "_slave", "causes")

    def __init__(self, slave: CanopenSlave, *, name: str, history: History | None) -> None:
        self._slave = slave
        self._name = name
        self._history = history
        self.causes: dict[int, bool] = {}
        """Latched EMCY codes, oldest first, each with whether its cause is still there."""

    @property
    def persistent(self) -> bool:
        """Whether the cause of a latched fault is still there."""
        return any(self.causes.values())

    @property
    def latest(self) -> int:
        """EMCY code of the latest fault, 0 = none."""
        return next(reversed(self.causes), 0)

    def enter(self, code: int, *, persistent: bool) -> None:
        """Latch a fault."""
        known = code in self.causes
        self.causes[code] = persistent or self.causes.get(code, False)
        self._slave.emcy(code)
        self._slave.set(0x603F, 0, code)
        if self._history is not None and not known:
            self._history.emit(
                self._name, "drive.fault", code=code, text=emcy_text(code), persistent=persistent
            )

    def end_causes(self, code: int | None) -> None:
        """Note that the cause of one fault, or of all, is gone; the faults stay latched."""
        for latched in self.causes:
            if code is None or latched == code:
                self.causes[latched] = False

    def acknowledge(self) -> None:
        """Forget all faults: EMCY 0000h for each."""
        codes = list(self.causes)
        self.causes.clear()
        self._slave.set(0x603F, 0, 0)
        for code in codes:
            self._slave.emcy_clear(code)
        if self._history is not None:
            self._history.emit(
                self._name, "drive.fault_cleared", codes=", ".join(f"{code:04X}h" for code in codes)
            )

    def clear(self) -> None:
        """Forget everything silently, as at power-on or reset."""
        self.causes.clear()


class Monitors:
    """What is watched in every control cycle.

    Args:
        drive: The drive.

    """

    __slots__ = ("_blocked", "_drive", "_following", "thermal")

    def __init__(self, drive: DriveDevice) -> None:
        config = drive.config
        self._drive = drive
        self._following = WindowTimer()
        self._blocked = WindowTimer(config.blocked_time_s)
        self.thermal = ThermalModel(
            rated_torque_Nm=config.rated_torque_Nm, time_constant_s=config.thermal_time_constant_s
        )

    @property
    def warning(self) -> bool:
        """Whether the motor is near its thermal limit."""
        return self.thermal.utilisation > 0.95 * self.thermal.trip

    def reset(self) -> None:
        """Start anew with a cold motor."""
        self.thermal.utilisation = 0.0
        self._following.reset()
        self._blocked.reset()

    def update(self, dt_s: float) -> None:
        """Watch for `dt_s`; faults go to the drive."""
        drive = self._drive
        core = drive.core
        if self.thermal.update(core.torque, dt_s):
            drive.raise_fault(OVERLOAD)
        if not core.enabled:
            self._following.reset()
            self._blocked.reset()
            return
        mode = drive.mode
        if mode.position_controlled and core.controls_position:
            values = drive.slave.values
            window = values[0x606500]
            exceeded = False
            if window != UNLIMITED:
                self._following.time_s = values[0x606600] * 1e-3
                exceeded = self._following.update(abs(drive.axis.following_error) > window, dt_s)
            if exceeded is not mode.following_error:
                mode.following_error = exceeded
                if exceeded and drive.config.following_error_reaction == "fault":
                    drive.raise_fault(FOLLOWING_ERROR)
        elif mode.following_error:
            mode.following_error = False
        if self._blocked.time_s and self._blocked.update(core.torque_limited and core.standing, dt_s):
            drive.raise_fault(BLOCKED)
