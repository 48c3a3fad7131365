"""An action that is repeated on the scheduler until it is stopped."""

from __future__ import annotations

from collections.abc import Callable

from fieldbus.clock import Scheduler, Timer


class Repetition:
    """Runs one action at once and then again and again.

    Args:
        scheduler: Clock.

    """

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._period_ns = 0
        self._action: Callable[[], None] | None = None
        self._timer: Timer | None = None

    def start(self, period_ns: int, action: Callable[[], None]) -> None:
        """Run an action now and every `period_ns`; an earlier one ends."""
        self.stop()
        self._period_ns = period_ns
        self._action = action
        self._run()

    def stop(self) -> None:
        """End the repetition; harmless without one."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._action = None

    def _run(self) -> None:
        action = self._action
        if action is None:
            return
        action()
        if self._action is action:
            self._timer = self._scheduler.after(self._period_ns, self._run)
