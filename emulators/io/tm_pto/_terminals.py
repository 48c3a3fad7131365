"""Input terminals with their filter (PTO-016)."""

from __future__ import annotations

from collections.abc import Callable

from fieldbus.clock import MS, Scheduler, Timer


class InputTerminal:
    """A digital input: a level counts when it has stood for the whole delay.

    Args:
        scheduler: Time of the bench.
        delay_ms: Input delay.
        on_edge: Called at the end of the delay, with the new level.

    """

    __slots__ = ("_delay", "_on_edge", "_raw", "_scheduler", "_timer", "level")

    def __init__(self, scheduler: Scheduler, delay_ms: float, on_edge: Callable[[bool], None]) -> None:
        self._scheduler = scheduler
        self._delay = round(delay_ms * MS)
        self._on_edge = on_edge
        self._raw = False
        self._timer: Timer | None = None
        self.level = False
        """Level behind the filter."""

    def drive(self, level: bool) -> None:
        """Bring a level to the terminal, now."""
        if level is self._raw:
            return
        self._raw = level
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if level is not self.level:
            self._timer = self._scheduler.after(self._delay, self._settle)

    def _settle(self) -> None:
        self._timer = None
        self.level = self._raw
        self._on_edge(self.level)
