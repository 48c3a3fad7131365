"""Holding brake of a motor."""

from __future__ import annotations

from typing import Final

from emulators.mechanics import AxisMechanics
from fieldbus.errors import ConfigurationError

_TURNING: Final = 1e-3
"""Velocity above which a closing brake wears, m/s or rad/s of the load."""


class HoldingBrake:
    """A brake that is closed without current: it opens and closes with a delay and holds by dry friction.

    Args:
        mechanics: Where the holding torque acts.
        torque_Nm: Holding torque at the motor shaft, Nm; 0 = there is no brake.
        opening_time_s: From the command to the released shaft, s.
        closing_time_s: From the command to the full torque, s.

    """

    def __init__(
        self,
        mechanics: AxisMechanics,
        *,
        torque_Nm: float = 0.0,
        opening_time_s: float = 0.0,
        closing_time_s: float = 0.0,
    ) -> None:
        for name, value in (
            ("torque_Nm", torque_Nm),
            ("opening_time_s", opening_time_s),
            ("closing_time_s", closing_time_s),
        ):
            if not value >= 0.0:
                raise ConfigurationError(f"brake {name}", value, ">= 0")
        self._mechanics = mechanics
        self.torque_Nm = torque_Nm
        self.fitted = torque_Nm > 0.0
        """Whether there is a brake at all."""
        self.opening_time_s = opening_time_s
        self.closing_time_s = closing_time_s
        self._command_open = False
        self._forced_open = False
        self._forced_closed = False
        self._elapsed_s = 0.0
        self.closed = torque_Nm > 0.0
        """Whether the drive takes the brake for closed; a stuck brake gives no signal."""
        self._stuck: bool | None = None
        self._slip_share = 1.0
        self.busy = False
        """Whether the brake is on its way."""
        self.worn = 0
        """How often it has closed on a turning shaft, which it is not made for (MC-572)."""
        mechanics.set_brake_torque(torque_Nm)

    @property
    def forced_open(self) -> bool:
        """Held open from outside, whatever the drive commands."""
        return self._forced_open

    @forced_open.setter
    def forced_open(self, value: bool) -> None:
        self._forced_open = value
        self._settle()

    @property
    def forced_closed(self) -> bool:
        """Held closed from outside, whatever the drive commands."""
        return self._forced_closed

    @forced_closed.setter
    def forced_closed(self, value: bool) -> None:
        self._forced_closed = value
        self._settle()

    @property
    def holding_torque_Nm(self) -> float:
        """Torque with which the brake really holds the shaft now, Nm."""
        closed = self.closed if self._stuck is None else self._stuck
        return self.torque_Nm * self._slip_share if closed else 0.0

    def set_stuck(self, closed: bool | None) -> None:
        """Let the brake be stuck closed or open whatever is commanded, or let it work again (None)."""
        self._stuck = closed
        self._mechanics.set_brake_torque(self.holding_torque_Nm)

    def set_torque_share(self, share: float) -> None:
        """Let the closed brake hold with a share 0..1 of its torque only; 1 = as new."""
        if not 0.0 <= share <= 1.0:
            raise ConfigurationError("brake slip share", share, "0..1")
        self._slip_share = share
        self._mechanics.set_brake_torque(self.holding_torque_Nm)

    def open(self) -> None:
        """Release the shaft after the opening time."""
        self._command_open = True
        self._settle()

    def close(self) -> None:
        """Hold the shaft after the closing time, at whatever speed it turns (STP-532)."""
        self._command_open = False
        self._settle()

    def step(self, dt_s: float) -> None:
        """Advance by `dt_s`; needed only while `busy`."""
        if not self.busy:
            return
        self._elapsed_s += dt_s
        self._finish_when_due()

    def _settle(self) -> None:
        if self.torque_Nm <= 0.0:
            return
        wanted_closed = self._forced_closed or not (self._command_open or self._forced_open)
        if wanted_closed is self.closed:
            self.busy = False
            return
        if not self.busy:
            self.busy = True
            self._elapsed_s = 0.0
        self._finish_when_due()

    def _finish_when_due(self) -> None:
        time_s = self.opening_time_s if self.closed else self.closing_time_s
        if self._elapsed_s + 1e-9 >= time_s:
            self.busy = False
            self.closed = not self.closed
            if self.closed and abs(self._mechanics.velocity) > _TURNING:
                self.worn += 1
            self._mechanics.set_brake_torque(self.holding_torque_Nm)
