"""Fault buffer and warnings of a PROFIdrive axis (PD-133 to PD-138)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

SITUATIONS: Final = 8
"""PNU 950[0]."""
MESSAGES: Final = 8
"""PNU 950[1]: messages of one situation."""


@dataclass(frozen=True, slots=True)
class FaultMessage:
    """An entry of the buffer.

    Args:
        number: PNU 947, 1..65535.
        value: PNU 949.
        time_ms: PNU 948, ms since power-on.
        code: PNU 945.

    """

    number: int
    value: int = 0
    time_ms: int = 0
    code: int = 0


class FaultBuffer:
    """The present fault situation and those that were acknowledged, newest first."""

    def __init__(self) -> None:
        self.current: list[FaultMessage] = []
        """The present situation itself, to be read only: what every bus cycle asks."""
        self._situations: list[list[FaultMessage]] = [self.current]
        self.counter = 0
        """PNU 944: counts messages and acknowledgements, 65535 is followed by 1."""

    @property
    def present(self) -> tuple[FaultMessage, ...]:
        """Messages of the present situation, in the order in which they came."""
        return tuple(self._situations[0])

    @property
    def situations(self) -> int:
        """PNU 952: number of situations in the buffer."""
        return sum(bool(situation) for situation in self._situations)

    def enter(self, message: FaultMessage) -> bool:
        """Add a message to the present situation; return whether it is new there (PD-133).

        When the situation is full, its last entry is overwritten (PD-135).
        """
        present = self._situations[0]
        if any(message.number == other.number for other in present):
            return False
        if len(present) == MESSAGES:
            present[-1] = message
        else:
            present.append(message)
        self._count()
        return True

    def acknowledge(self) -> bool:
        """Shift the present situation into the history; return whether there was one (PD-137)."""
        if not self._situations[0]:
            return False
        self.current = []
        self._situations.insert(0, self.current)
        del self._situations[SITUATIONS:]
        self._count()
        return True

    def clear(self) -> None:
        """Forget everything, as writing 0 to PNU 952 does (PD-136)."""
        self.current = []
        self._situations = [self.current]

    def entry(self, index: int) -> FaultMessage | None:
        """Return the message at a sub-index of PNU 945 to 949: 0..7 the present situation, 8..15 the one
        before, ...
        """
        situation, place = divmod(index, MESSAGES)
        if situation < len(self._situations) and place < len(self._situations[situation]):
            return self._situations[situation][place]
        return None

    def _count(self) -> None:
        self.counter = self.counter + 1 if self.counter < 0xFFFF else 1
