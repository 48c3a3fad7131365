"""Torque limits of a PROFIdrive axis: parameters, words of the telegram, protection, injected faults (PD-037, PD-038)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fieldbus.profidrive.formats import from_n2, torque_factor

if TYPE_CHECKING:
    from emulators.drive.profidrive.device import ProfidriveDrive


class TorqueLimits:
    """What limits the torque, and the additive torque of telegram 750.

    Args:
        drive: The drive.

    """

    __slots__ = (
        "_add_at", "_drive", "_high_at", "_low_at", "_momred_at", "_words", "follows_telegram", "injected_Nm", "protection_Nm",
        "upper_Nm",
    )  # fmt: skip

    def __init__(self, drive: ProfidriveDrive) -> None:
        self._drive = drive
        self.upper_Nm = math.inf
        """Upper torque limit in force, Nm."""
        self.protection_Nm = math.inf
        """Limit because of heat, Nm; inf = none."""
        self.injected_Nm = math.inf
        """Limit from a test, Nm; inf = none."""
        place = drive.setpoint_place
        self._momred_at = place("MOMRED")
        self._add_at = place("M_ADD1")
        self._high_at = place("M_LIMIT_POS")
        self._low_at = place("M_LIMIT_NEG")
        self.follows_telegram = self._momred_at >= 0 or self._add_at >= 0
        """Whether the telegram has words about torque."""
        self._words: tuple[int, int, int, float] | None = None

    def lead(self) -> None:
        """Let the words of the telegram act; in every bus cycle of operation."""
        if self._add_at >= 0:
            drive = self._drive
            drive.core.torque_offset = from_n2(drive.row[self._add_at]) * drive.settings.reference_torque_Nm
        self.apply()

    def renew(self) -> None:
        """Apply them although no word has changed: a parameter has, or the pulses have come."""
        self._words = None
        self.apply()

    def cap(self, *, protection_Nm: float | None = None, injected_Nm: float | None = None) -> None:
        """Limit the torque because of heat, or from a test, Nm; inf = not."""
        if protection_Nm is not None:
            self.protection_Nm = protection_Nm
        if injected_Nm is not None:
            self.injected_Nm = injected_Nm
        self.apply()

    def apply(self) -> None:
        """Give the limits to the servo core if they have changed."""
        drive = self._drive
        row = drive.row
        momred = row[self._momred_at] if self._momred_at >= 0 else 0
        high_word, low_word = (row[self._high_at], row[self._low_at]) if self._add_at >= 0 else (0, 0)
        cap = min(self.protection_Nm, self.injected_Nm)
        words = (momred, high_word, low_word, cap)
        if words == self._words:
            return
        self._words = words
        settings = drive.settings
        high, low = settings.torque_limits_Nm
        if self._add_at >= 0 and drive.controlled_cyclically:
            high = min(high, max(0.0, from_n2(high_word) * settings.reference_torque_Nm))
            low = min(low, max(0.0, -from_n2(low_word) * settings.reference_torque_Nm))
        factor = torque_factor(momred, settings.momred_evaluation_percent)
        self.upper_Nm = min(cap, high * factor)
        drive.core.set_torque_limits(self.upper_Nm, min(cap, low * factor))
