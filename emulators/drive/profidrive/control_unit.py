"""Control unit of a PROFIdrive device: digital inputs and outputs, and probes with time stamps, behind
telegrams 390 to 394.

It takes and gives frames and knows no bus (PD-021 to PD-025, PD-093 to PD-095).
"""

from __future__ import annotations

from typing import Final

from emulators.drive.profidrive.faults.buffer import FaultBuffer, FaultMessage
from fieldbus.clock import MS, Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import telegram
from fieldbus.profidrive.sign_of_life import SignOfLife
from fieldbus.profidrive.words import CU_STW1, CU_ZSW1, SIGN_OF_LIFE_SHIFT

TELEGRAMS: Final = (390, 391, 392, 393, 394)
STAMP_NS: Final = 250
"""Unit of a time stamp: 0.25 microseconds (PD-095)."""
_SIGN_OF_LIFE: Final = 1912
_LARGEST_STAMP: Final = 0xFFFF


class ControlUnit:
    """A control unit. Per bus cycle: `receive` with the frame that has come, `cycle`, then `transmit`.

    A time stamp says when the first awaited edge of the last bus cycle came, counted from the beginning of
    that cycle; it is shown for one cycle, and 0 is no edge.

    Args:
        scheduler: Time of the bench.
        number: Telegram, one of `TELEGRAMS`.
        isochronous: The sign of life is evaluated and sent.
        tolerance: Tolerated failures of the sign of life (PNU 925).

    Raises:
        ConfigurationError: There is no such telegram.

    """

    def __init__(
        self, scheduler: Scheduler, *, number: int = 391, isochronous: bool = True, tolerance: int = 1
    ) -> None:
        if number not in TELEGRAMS:
            raise ConfigurationError("control unit telegram", number, ", ".join(map(str, TELEGRAMS)))
        self._scheduler = scheduler
        self._telegram = telegram(number)
        self.isochronous = isochronous
        self._signs = SignOfLife(tolerance=tolerance)
        self.probes: Final = sum(
            name.startswith("MT") and name.endswith("_ZS_F") for name in self._telegram.actual.names
        )
        """Number of probes."""
        self.faults: Final = FaultBuffer()
        self.warnings: Final[set[int]] = set()
        """Numbers of the warnings that are there."""
        self.inputs = 0
        """Digital inputs: E_DIGITAL in the low word, E_DIGITAL_1 in the high one."""
        self.analog_input = 0
        """E_ANALOG, -8000h..7FFFh."""
        self.time_synchronised = False
        """A ping of the real-time clock has come (CU_STW1 bit 0)."""
        self.controlled_cyclically = False
        self.refused = 0
        """Frames of a wrong length."""
        self._pending: bytes | None = None
        self._row: dict[str, int] = dict.fromkeys(self._telegram.setpoint.names, 0)
        self._levels = 0
        self._stamps: dict[str, int] = {}
        self._shown: dict[str, int] = {}
        self._cycle_ns = scheduler.now
        self._frame = bytes(self._telegram.actual.length)

    # -- process ---------------------------------------------------------------------------------------

    @property
    def outputs(self) -> int:
        """Digital outputs: A_DIGITAL in the low word, A_DIGITAL_1 in the high one."""
        return self._row["A_DIGITAL"] | self._row.get("A_DIGITAL_1", 0) << 16

    def set_input(self, bit: int, state: bool) -> None:
        """Set a digital input, 0..31."""
        self.inputs = self.inputs | 1 << bit if state else self.inputs & ~(1 << bit)

    def probe_edge(self, number: int, rising: bool) -> None:
        """Bring an edge of a probe, 1..`probes`, now.

        Raises:
            ConfigurationError: There is no such probe.

        """
        if not 1 <= number <= self.probes:
            raise ConfigurationError("probe", number, f"1..{self.probes}")
        bit = 1 << (number - 1)
        self._levels = self._levels | bit if rising else self._levels & ~bit
        awaited = self._row["MT_STW"] >> (8 if rising else 0) & bit
        name = f"MT{number}_ZS_{'S' if rising else 'F'}"
        if awaited and name not in self._stamps:
            ticks = (self._scheduler.now - self._cycle_ns) // STAMP_NS
            self._stamps[name] = min(max(ticks, 1), _LARGEST_STAMP)

    def raise_fault(self, number: int) -> None:
        """Enter a fault, 1..65535."""
        self.faults.enter(FaultMessage(number, time_ms=self._scheduler.now // MS, code=number))

    # -- bus -------------------------------------------------------------------------------------------

    def receive(self, frame: bytes) -> bool:
        """Take a frame for the next cycle; False: its length is wrong (PD-030)."""
        if len(frame) != self._telegram.setpoint.length:
            self.refused += 1
            return False
        self._pending = frame
        return True

    def cycle(self) -> None:
        """Evaluate what has come, and form the answer."""
        if self._pending is not None:
            self._take_over(self._pending)
            self._pending = None
        if self.isochronous and self._signs.step(self._row["CU_STW1"] >> SIGN_OF_LIFE_SHIFT):
            self.raise_fault(_SIGN_OF_LIFE)
        self._cycle_ns = self._scheduler.now
        self._shown, self._stamps = self._stamps, {}
        word = self._signs.value << SIGN_OF_LIFE_SHIFT if self.isochronous else 0
        if self.faults.present:
            word |= CU_ZSW1.FAULT
        if self.warnings:
            word |= CU_ZSW1.ALARM
        if self.time_synchronised:
            word |= CU_ZSW1.TIME_SYNCHRONISED
        known = {
            "CU_ZSW1": word,
            "E_DIGITAL": self.inputs & 0xFFFF,
            "E_DIGITAL_1": self.inputs >> 16 & 0xFFFF,
            "E_ANALOG": self.analog_input,
            "MT_ZSW": self._levels,
            **self._shown,
        }
        layout = self._telegram.actual
        self._frame = layout.pack(*[known.get(name, 0) for name in layout.names])

    def transmit(self) -> bytes:
        """Return the answer of the last cycle."""
        return self._frame

    def _take_over(self, frame: bytes) -> None:
        before = self._row["CU_STW1"]
        row = self._telegram.setpoint.decode(frame)
        self.controlled_cyclically = True
        word = row["CU_STW1"]
        if word & ~before & CU_STW1.CLOCK_PING:
            self.time_synchronised = True
        if not word & CU_STW1.CONTROL_BY_PLC:
            self._row["CU_STW1"] = word  # outputs and probes stay as they were; the sign of life is followed
            return
        if word & ~before & CU_STW1.ACKNOWLEDGE:
            self.faults.acknowledge()
        self._row = row
