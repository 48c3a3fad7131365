"""How the parts of a device write events into the log."""

from __future__ import annotations

from typing import Protocol


class Emit(Protocol):
    """Writes an event of one device into the log, if there is one."""

    def __call__(self, kind: str, **data: str | float | bool) -> None:
        """Write an event.

        Args:
            kind: Name of the event, such as `drive.state`.
            data: Its values.

        """
