"""A control unit with its telegram, led cycle by cycle."""

from __future__ import annotations

from typing import Any

from emulators.drive.profidrive.control_unit import ControlUnit
from fieldbus.clock import MS, US, VirtualScheduler
from fieldbus.profidrive import telegram
from fieldbus.profidrive.sign_of_life import next_sign

__all__ = ["ACKNOWLEDGE", "CONTROL", "CYCLE", "MS", "PING", "US", "Rig"]

CONTROL, ACKNOWLEDGE, PING = 0x0400, 0x0080, 0x0001
CYCLE = 4 * MS


class Rig:
    """The unit and its controller.

    Args:
        number: Telegram.
        options: Of the unit.

    """

    def __init__(self, number: int = 391, **options: Any) -> None:
        self.scheduler = VirtualScheduler()
        self.unit = ControlUnit(self.scheduler, number=number, **options)
        self.layout = telegram(number)
        self.sign = 0
        self.counts = True

    def cycle(self, word: int = CONTROL, *, count: int = 1, **signals: int) -> dict[str, int]:
        """Make bus cycles; returns the last answer."""
        for _ in range(count):
            if self.counts:
                self.sign = next_sign(self.sign)
            values = {"CU_STW1": word | self.sign << 12, **signals}
            assert self.unit.receive(self.layout.setpoint.encode(values))
            self.unit.cycle()
            answer = self.layout.actual.decode(self.unit.transmit())
            self.scheduler.run_for(CYCLE)
        return answer
