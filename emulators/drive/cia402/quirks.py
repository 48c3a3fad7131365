"""Where drives on the market differ from the profile, as a few named switches (C402-009 and others say what
the profile wants).

The code asks for a behaviour, never for a manufacturer. A personality (`emulators.drive.cia402.personality`)
sets them from a file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fieldbus.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class Quirks:
    """Deviations from the profile; all off by default.

    Args:
        halt_blocks_acknowledge: pp: while halt is set, a new setpoint is not acknowledged; it is taken
            when halt is withdrawn with bit 4 still set.
        auto_reset_s: A fault clears itself this long after its cause is gone, s; 0 = never.
        auto_reset_attempts: So often in a row, until a reset by the controller or a restart.
        falls_back_without_power_s: Transition 3 is made without mains too; when the DC link has been
            missing for this time in Switched on, the drive falls back to Switch on disabled, s; 0 =
            transition 3 waits for the DC link.
        csp_jumps_unprimed: csp follows 607Ah at once, also when it has never been written and still is 0.
        silent_until_ready: In Not ready to switch on no PDO with the status word is sent and 6041h cannot
            be read.
        single_setpoint: pp: there is no buffer; a setpoint during a motion is taken only with bit 5.
        setpoint_needs_bit_5: pp: a setpoint without bit 5 is ignored.
        status_homed: Bits of the status word that show "homed", until power is switched off.
        status_homing_refused: Bits of the status word that show that the last homing was refused or failed.
        skips_switched_on: 000Fh in Ready to switch on leads straight to Operation enabled; Switched on is
            not seen.
        homing_finishes_on_release: hm: homing counts as finished (bit 10) only when bit 4 of the control
            word is withdrawn.

    Raises:
        ConfigurationError: A number is out of range.

    """

    halt_blocks_acknowledge: bool = False
    auto_reset_s: float = 0.0
    auto_reset_attempts: int = 3
    falls_back_without_power_s: float = 0.0
    csp_jumps_unprimed: bool = False
    silent_until_ready: bool = False
    single_setpoint: bool = False
    setpoint_needs_bit_5: bool = False
    status_homed: int = 0
    status_homing_refused: int = 0
    skips_switched_on: bool = False
    homing_finishes_on_release: bool = False

    def __post_init__(self) -> None:
        for name in ("auto_reset_s", "falls_back_without_power_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0.0 <= value <= 3600.0):
                raise ConfigurationError(name, value, "0..3600 s")
        if not 1 <= self.auto_reset_attempts <= 1000:
            raise ConfigurationError("auto_reset_attempts", self.auto_reset_attempts, "1..1000")
        for name in ("status_homed", "status_homing_refused"):
            value = getattr(self, name)
            if value & ~0xC100:
                raise ConfigurationError(
                    name, f"{value:04X}h", "manufacturer bits of 6041h: 0100h, 4000h, 8000h"
                )

    @property
    def shown_in_status(self) -> bool:
        """Whether a quirk changes bits of the status word."""
        return bool(self.status_homed or self.status_homing_refused or self.homing_finishes_on_release)


@dataclass(frozen=True, kw_only=True)
class EmcyCode:
    """What is sent instead of an EMCY code of the profile.

    Args:
        code: Error code, 1..FFFFh; also shown in 603Fh.
        register: Bits of 1001h; None = by the code (C402-308).
        data: Up to five manufacturer-specific bytes.

    Raises:
        ConfigurationError: A value is out of range.

    """

    code: int
    register: int | None = None
    data: bytes = b""

    def __post_init__(self) -> None:
        if not 1 <= self.code <= 0xFFFF:
            raise ConfigurationError("emcy code", self.code, "1..65535")
        if self.register is not None and not 0 <= self.register <= 0xFF:
            raise ConfigurationError("emcy register", self.register, "0..255")
        if len(self.data) > 5:
            raise ConfigurationError("emcy data", self.data.hex(), "0 to 5 bytes")
