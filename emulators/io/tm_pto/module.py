"""The module: two channels with one supply and one diagnosis of the digital outputs
(PTO-204 to PTO-210, PTO-290).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from emulators.io.tm_pto.channel import PtoChannel
from emulators.io.tm_pto.config import PtoConfig
from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError

CHANNELS: Final = 2


class PtoModule:
    """TM PTO 2x24V.

    Args:
        scheduler: Time of the bench.
        configs: One per channel, two.
        watchdog_cycles: As `PtoChannel`.

    Raises:
        ConfigurationError: There are not two channels.

    """

    def __init__(
        self, scheduler: Scheduler, configs: Sequence[PtoConfig], *, watchdog_cycles: int = 3
    ) -> None:
        if len(configs) != CHANNELS:
            raise ConfigurationError("channels of the pulse module", len(configs), str(CHANNELS))
        self._scheduler = scheduler
        self.channels: Final = tuple(
            PtoChannel(scheduler, config, watchdog_cycles=watchdog_cycles) for config in configs
        )
        """Channel 0 and 1."""
        self._shorts = [False] * CHANNELS
        self._supply = True
        self.failed = False
        """Whether the module is pulled or broken: its input data are 0 and bad (PTO-210)."""
        self.diagnostics: Final[list[tuple[int, int, str]]] = []
        """Diagnostic interrupts: time in ns, channel, text; of channels that have them switched on."""

    def receive(self, channel: int, frame: bytes) -> bool:
        """Hand a frame to a channel; False: refused."""
        return not self.failed and self.channels[channel].receive(frame)

    def cycle(self) -> None:
        """Let both channels do their bus cycle."""
        if not self.failed:
            for channel in self.channels:
                channel.cycle()

    def transmit(self, channel: int) -> tuple[bytes, bool]:
        """Return the frame of a channel, and whether its data are good."""
        frame = self.channels[channel].transmit()
        return (bytes(len(frame)), False) if self.failed else (frame, True)

    def short_circuit(self, channel: int, present: bool) -> None:
        """Bring about a short circuit at an output of a channel, or remove
        it: both channels stop (PTO-207).
        """
        if self._shorts[channel] is present:
            return
        before = any(self._shorts)
        self._shorts[channel] = present
        if present:
            self._tell(channel, "error at a digital output")
        if any(self._shorts) is not before:
            for one in self.channels:
                one.output_error(present)

    def supply(self, present: bool) -> None:
        """Take the load supply away, or bring it back (PTO-209)."""
        if present is self._supply:
            return
        self._supply = present
        for number, channel in enumerate(self.channels):
            channel.supply(present)
            if not present:
                self._tell(number, "load supply is missing")

    def stop_controller(self, stopped: bool) -> None:
        """Let the controller go to STOP, or back to RUN (PTO-204, PTO-205)."""
        for channel in self.channels:
            channel.stop_controller(stopped)

    def _tell(self, channel: int, text: str) -> None:
        if self.channels[channel].config.diagnostics:
            self.diagnostics.append((self._scheduler.now, channel, text))
