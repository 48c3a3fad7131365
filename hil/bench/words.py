"""Frames of a bench in words, also where somebody else has set up the drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from fieldbus.can.arbitration import LogEntry
    from fieldbus.can.frame import CanFrame
    from fieldbus.canopen.decode import FrameDecoder

_TEACHING: Final = (0x580, 0x600, 0x700)
"""SDO in both directions, and boot-up: what changes a mapping."""


class BenchWords:
    """Describes frames.

    Args:
        build: Makes a decoder that knows names, dictionaries and the mapping that the bench itself has
            commissioned.
        logs: Logs of segments whose drives somebody else commissions: PDOs are described by the mapping
            that has been written there up to now, whatever the order in which frames are asked for.

    """

    def __init__(self, build: Callable[[], FrameDecoder], logs: Sequence[list[LogEntry]]) -> None:
        self._decoder = build()
        self._logs = logs
        self._read = [0] * len(logs)
        # A decoder learns from what it describes: old SDO frames must not undo what later ones have taught.
        self._services = build() if logs else self._decoder

    def decode(self, frame: CanFrame) -> str:
        """Return the meaning of `frame`."""
        if self._logs:
            self._learn()
            if frame.can_id & 0x780 in _TEACHING:
                return self._services.decode(frame)
        return self._decoder.decode(frame)

    def _learn(self) -> None:
        for number, log in enumerate(self._logs):
            for _, _, frame, error in log[self._read[number] :]:
                if not error:
                    self._decoder.observe(frame)
            self._read[number] = len(log)
