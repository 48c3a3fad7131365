"""EMCY codes of the drive, and its fault memory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from emulators.drive.cia402.faults.log import FaultLog
from emulators.drive.cia402.quirks import EmcyCode
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.cia402 import emcy_text
from fieldbus.history import History

FOLLOWING_ERROR: Final = 0x8611
SLIPPAGE: Final = 0x8400
LIMIT_SWITCH: Final = 0x8612
OVERLOAD: Final = 0x2310
STAGE_OVERLOAD: Final = 0x2350
PHASE_LOSS: Final = 0x3130
OVERVOLTAGE: Final = 0x3210
UNDERVOLTAGE: Final = 0x3220
STAGE_TEMPERATURE: Final = 0x4210
MOTOR_TEMPERATURE: Final = 0x4310
CHOPPER_OVERLOAD: Final = 0x7112
BLOCKED: Final = 0x7121
INCREMENTAL_SENSOR: Final = 0x7305
POSITION_SENSOR: Final = 0x7320
LEFT_OPERATIONAL: Final = 0x8100
"""The master has ended communication by NMT: no peer is missing, so it is not 8130h."""
COMMUNICATION: Final = 0x8130
BUS_OFF: Final = 0x8140
RPDO_TIMEOUT: Final = 0x8250
SYNC_LOST: Final = 0x8700
EXTERNAL: Final = 0x9000
SAFE_TORQUE_OFF: Final = 0xFF80
BUFFER_EMPTY: Final = 0xFF70
"""Warning: interpolated position mode has run out of setpoints."""
SAFE_STOP: Final = 0xFF81


class FaultMemory:
    """The faults that are latched, with EMCY, 603Fh and history (C402-014, C402-016).

    Args:
        slave: Sends the EMCYs and holds 603Fh.
        name: Source in the history.
        history: Log; None for none.
        codes: What is sent instead of a code of the profile.
        log: Faults of the past.

    """

    def __init__(
        self,
        slave: CanopenSlave,
        *,
        name: str,
        history: History | None,
        codes: Mapping[int, EmcyCode],
        log: FaultLog,
    ) -> None:
        self._slave = slave
        self._name = name
        self._history = history
        self._codes = codes
        # In the slave, so that the errors of its own services are sent in the same way.
        slave.errors.replacements = {
            code: (sent.code, sent.register, sent.data) for code, sent in codes.items()
        }
        self.causes: dict[int, bool] = {}
        """Latched EMCY codes of the profile, oldest first, each with whether its cause is still there."""
        self.log = log
        """Faults of the past; kept over power-off."""

    @property
    def persistent(self) -> bool:
        """Whether the cause of a latched fault is still there."""
        return any(self.causes.values())

    @property
    def latest(self) -> int:
        """EMCY code of the latest fault, 0 = none."""
        return next(reversed(self.causes), 0)

    def enter(self, code: int, *, persistent: bool, state: int, mode: int) -> None:
        """Latch a fault that strikes in `state` and `mode`."""
        known = code in self.causes
        self.causes[code] = persistent or self.causes.get(code, False)
        sent = self._codes.get(code)
        shown = code if sent is None else sent.code
        self._slave.emcy(code)
        self._slave.set(0x603F, 0, shown)
        if known:
            return
        self.log.add(shown, state, mode)
        if self._history is not None:
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
