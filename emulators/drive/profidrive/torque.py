"""Torque limits of a PROFIdrive axis: parameters, words of the telegram, protection,
injected faults (PD-037, PD-038).
"""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.core import ServoCore
from emulators.drive.profidrive.config import DriveSettings
from emulators.drive.profidrive.process_data import ProcessData
from fieldbus.profidrive.formats import from_n2, torque_factor
from fieldbus.profidrive.words import STW2

_INTERPOLATES: Final = 1
"""Bit of p1409 with which the additive torque goes in a straight line from telegram to telegram (CTL-058)."""
_FIXED_STOP: Final = int(STW2.TRAVEL_TO_FIXED_STOP)


class TorqueLimits:
    """What limits the torque, and the additive torque of telegram 750.

    Args:
        core: Servo core.
        data: Setpoints of the telegram.
        settings: Parameters in effect.
        steps: Servo steps of a bus cycle.

    """

    def __init__(self, core: ServoCore, data: ProcessData, settings: DriveSettings, *, steps: int) -> None:
        self._core = core
        self._data = data
        self._settings = settings
        self._steps = steps
        self.upper_Nm = math.inf
        """Upper torque limit in effect, Nm."""
        self.lower_Nm = math.inf
        """Torque limit in the other direction, Nm, >= 0."""
        self.protection_Nm = math.inf
        """Limit because of heat, Nm; inf = none."""
        self.injected_Nm = math.inf
        """Limit from a test, Nm; inf = none."""
        self.current_Nm = math.inf
        """Limit because of the current limit p0640, Nm; inf = none."""
        self.clamping_Nm = math.inf
        """Limit of the positioner while it travels to a fixed stop, Nm; inf = none."""
        place = data.place
        self._momred_at = place("MOMRED")
        self._add_at = place("M_ADD1")
        self._high_at = place("M_LIMIT_POS")
        self._low_at = place("M_LIMIT_NEG")
        self.follows_telegram = self._momred_at >= 0 or self._add_at >= 0
        """Whether the telegram has words about torque."""
        self._words = (0, 0, 0)
        """MOMRED, M_LIMIT_POS, M_LIMIT_NEG for which the limits in effect hold."""
        self._stale = True
        """The limits have to be formed whatever the words are."""

    def lead(self) -> None:
        """Let the words of the telegram act; in every bus cycle while there are pulses."""
        if self._add_at >= 0:
            settings = self._settings
            torque = from_n2(self._data.row[self._add_at]) * settings.reference_torque_nm
            self._core.add_torque(
                torque, self._steps if settings.speed_control_extended & _INTERPOLATES else 1
            )
        self.apply()

    def renew(self) -> None:
        """Apply them although no word has changed: a parameter has, or the pulses have come."""
        self._stale = True
        self.apply()

    def cap(
        self,
        *,
        protection_Nm: float | None = None,
        injected_Nm: float | None = None,
        current_Nm: float | None = None,
        clamping_Nm: float | None = None,
    ) -> None:
        """Limit the torque because of heat, from a test, because of the current, or at a fixed stop, Nm; inf
        = not.
        """
        if clamping_Nm is not None:
            self.clamping_Nm = clamping_Nm
        if protection_Nm is not None:
            self.protection_Nm = protection_Nm
        if injected_Nm is not None:
            self.injected_Nm = injected_Nm
        if current_Nm is not None:
            self.current_Nm = current_Nm
        self._stale = True
        self.apply()

    def apply(self) -> None:
        """Give the limits to the servo core if they have changed."""
        row = self._data.row
        momred = row[self._momred_at] if self._momred_at >= 0 else 0
        high_word, low_word = (row[self._high_at], row[self._low_at]) if self._add_at >= 0 else (0, 0)
        before = self._words
        if not self._stale and momred == before[0] and high_word == before[1] and low_word == before[2]:
            return
        self._words = (momred, high_word, low_word)
        self._stale = False
        cap = min(self.protection_Nm, self.injected_Nm, self.current_Nm, self.clamping_Nm)
        settings = self._settings
        high, low = (
            limit if share is None else 0.01 * share * settings.reference_torque_nm
            for limit, share in zip(settings.torque_limits_Nm, settings.torque_limits_percent, strict=True)
        )
        if self._add_at >= 0 and self._data.controlled_cyclically:
            high = min(high, max(0.0, from_n2(high_word) * settings.reference_torque_nm))
            low = min(low, max(0.0, -from_n2(low_word) * settings.reference_torque_nm))
        factor = torque_factor(momred, settings.momred_evaluation_percent)
        self.upper_Nm = min(cap, high * factor)
        self.lower_Nm = min(cap, low * factor)
        self._core.set_torque_limits(self.upper_Nm, self.lower_Nm)

    @property
    def utilised(self) -> bool:
        """Whether the torque is at or above the threshold of its limit, p2194 (STP-156, STP-157)."""
        core = self._core
        if not core.enabled:
            return False
        torque = core.torque_demand
        limit = self.upper_Nm if torque >= 0.0 else self.lower_Nm
        return abs(torque) >= self._settings.torque_threshold_percent * 0.01 * limit

    @property
    def at_fixed_stop(self) -> bool:
        """Whether the controller travels to a fixed stop: STW2 bit 8, in operation (PD-082, PD-083)."""
        return bool(self._data.stw2 & _FIXED_STOP) and self._core.enabled
