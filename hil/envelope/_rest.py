"""When a copy has nothing more to show: its machines are at rest, no axis is enabled, and nothing happens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from fieldbus.clock import seconds_to_ns
from hil.envelope._measures import rest_speed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from fieldbus.history import History
    from hil.record import Recorder

_ENABLED: Final = 1
"""Bit X0 of `StatusWord`."""


class RestWatch:
    """Watches the machines of a bench from cycle to cycle.

    An axis without a `StatusWord` never counts as disabled: what it may do next is not known.

    Args:
        recorder: Has the present values.
        history: Has what happened.
        drives: Drive of every axis whose machine is emulated.
        units: Unit of the position of each of these drives.
        axes: Every axis of the bench.
        rest_s: Time at rest without an event, s.
        begin_ns: Time from which it counts: the stimulus, or the end of a fault that lasts.

    """

    def __init__(
        self,
        recorder: Recorder,
        history: History,
        *,
        drives: Mapping[str, str],
        units: Mapping[str, str],
        axes: tuple[str, ...],
        rest_s: float,
        begin_ns: int,
    ) -> None:
        self._history = history
        self._rest_ns = seconds_to_ns(rest_s)
        self._since_ns = begin_ns
        self._speeds = [
            (recorder.reader(f"{drive}.velocity"), rest_speed(units[drive])) for drive in drives.values()
        ]
        words: list[Callable[[], float | None]] = []
        self._can_tell = all(recorder.has_signal(f"{axis}.status_word") for axis in axes)
        if self._can_tell:
            words = [recorder.reader(f"{axis}.status_word") for axis in axes]
        self._words = words

    def is_over(self, now_ns: int) -> bool:
        """Return whether nothing more is to come; ask in every cycle."""
        if not self._can_tell:
            return False
        events = self._history.events
        if events:
            self._since_ns = max(self._since_ns, events[-1].time_ns)
        if now_ns > self._since_ns and not self._at_rest():
            self._since_ns = now_ns
        return now_ns - self._since_ns >= self._rest_ns

    def _at_rest(self) -> bool:
        for speed, limit in self._speeds:
            if abs(speed() or 0.0) > limit:
                return False
        return all(not int(word() or 0) & _ENABLED for word in self._words)
