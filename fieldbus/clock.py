"""Time: one scheduler interface, in virtual and in real time.

Everything in a bench is callback code on one scheduler. `VirtualScheduler` jumps from event to event;
`RealtimeScheduler` runs the same callbacks against the monotonic clock and takes work over from the threads
of real I/O through `Scheduler.post`.

Events of the same instant fire by ascending priority, then in the order in which they were entered. A
periodic event is entered once, by `Scheduler.every`, and keeps its place for good: two of them meet in the
same order at every instant that they share, whatever their periods.
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from heapq import heapify, heappop, heappush, heapreplace
from itertools import count
from threading import Condition
from typing import Final

from typing_extensions import override

from fieldbus.errors import SchedulerError

Callback = Callable[[], object]

US: Final = 1_000
"""Nanoseconds in a microsecond."""
MS: Final = 1_000_000
"""Nanoseconds in a millisecond."""
S: Final = 1_000_000_000
"""Nanoseconds in a second."""


def seconds_to_ns(seconds: float) -> int:
    """Return `seconds` as whole nanoseconds, rounded to nearest."""
    return round(seconds * S)


class Timer:
    """Handle of an entered event; `cancel` withdraws it."""

    __slots__ = ("callback", "cancelled", "due_ns", "period_ns", "priority")

    def __init__(self, due_ns: int, callback: Callback, priority: int, period_ns: int = 0) -> None:
        self.due_ns = due_ns
        """Time of the next firing, ns."""
        self.callback = callback
        self.priority = priority
        self.period_ns = period_ns
        """Distance of firings, ns; 0 for a single event."""
        self.cancelled = False

    def cancel(self) -> None:
        """Withdraw the event; harmless when it has already fired or was cancelled before."""
        self.cancelled = True


class Scheduler:
    """What a bench component may ask of time.

    All times are integer nanoseconds from the start of the bench. Callbacks run in one thread and must not
    block; code that has to wait calls `run_until` from outside of callbacks.
    """

    realtime: bool = False
    """Whether `now` follows the wall clock."""

    def __init__(self) -> None:
        self._now = 0
        self._heap: list[tuple[int, int, int, Timer]] = []
        self._next_sequence = count(1).__next__
        self._running = False

    # An entry is (due, priority, sequence, timer); sequence numbers are unique, so timers are never compared.

    @property
    def now(self) -> int:
        """Present time, ns."""
        return self._now  # a property, because the clock of a node calculates it

    def at(self, time_ns: int, callback: Callback, *, priority: int = 0) -> Timer:
        """Enter `callback` for `time_ns`.

        Raises:
            SchedulerError: `time_ns` is in the past (virtual time only; in real time it fires at once).

        """
        if time_ns < self._now:
            if not self.realtime:
                raise SchedulerError(f"event at {time_ns} ns is before the present time {self._now} ns")
            time_ns = self._now
        timer = Timer(time_ns, callback, priority)
        heappush(self._heap, (time_ns, priority, self._next_sequence(), timer))
        return timer

    def again(self, timer: Timer, time_ns: int) -> None:
        """Enter a single event again that has fired; cheaper than a new one. It
        must not be entered or cancelled.

        Args:
            timer: The event.
            time_ns: Not before now.

        """
        timer.due_ns = time_ns
        heappush(self._heap, (time_ns, timer.priority, self._next_sequence(), timer))

    def after(self, delay_ns: int, callback: Callback, *, priority: int = 0) -> Timer:
        """Enter `callback` for `delay_ns` (>= 0) from now."""
        if delay_ns < 0:
            raise SchedulerError(f"delay {delay_ns} ns is negative")
        return self.at(self._now + delay_ns, callback, priority=priority)

    def every(self, period_ns: int, callback: Callback, *, phase_ns: int = 0, priority: int = 0) -> Timer:
        """Call `callback` at every instant `k * period_ns + phase_ns` that is not before now.

        The grid is anchored at time zero of the bench, so that components with the same period keep their
        phase relation however late they join. A realtime scheduler that falls behind skips no instant.

        Raises:
            SchedulerError: `period_ns` is not positive or `phase_ns` is outside 0..period_ns - 1.

        """
        if period_ns <= 0:
            raise SchedulerError(f"period {period_ns} ns is not positive")
        if not 0 <= phase_ns < period_ns:
            raise SchedulerError(f"phase {phase_ns} ns is outside 0..{period_ns - 1} ns")
        due = -(-(self._now - phase_ns) // period_ns) * period_ns + phase_ns
        timer = Timer(due, callback, priority, period_ns)
        heappush(self._heap, (due, priority, self._next_sequence(), timer))
        return timer

    def move(self, new_due_ns: Callable[[Timer], int | None]) -> None:
        """Ask for every entered event when it is due from now on, ns; None: as before."""
        heap = self._heap
        for place, (_, priority, sequence, timer) in enumerate(heap):
            moved = new_due_ns(timer)
            if moved is not None:
                timer.due_ns = moved
                heap[place] = (moved, priority, sequence, timer)
        heapify(heap)

    @abstractmethod
    def post(self, callback: Callback) -> None:
        """Hand `callback` over from another thread; it runs on the scheduler's thread as soon as possible."""

    @abstractmethod
    def run_until(self, predicate: Callable[[], object], timeout_ns: int) -> bool:
        """Run until `predicate` is true or `timeout_ns` has passed.

        The predicate is evaluated before the first event and after all events of one
        instant, and in real time also after the posted work. A predicate about time alone is
        therefore seen only at the next event.

        Returns:
            Whether the predicate became true.

        Raises:
            SchedulerError: Called from inside a callback, or `timeout_ns` is negative.

        """

    def run_for(self, duration_ns: int) -> None:
        """Run all events of the next `duration_ns`, those at the end included, and stand at that time."""
        if duration_ns < 0:
            raise SchedulerError(f"duration {duration_ns} ns is negative")
        self.run_until(_never, duration_ns)

    @property
    def running(self) -> bool:
        """Whether an event is being executed at this moment (so that waiting would be re-entrant)."""
        return self._running

    @property
    def next_due_ns(self) -> int | None:
        """Time of the next event that is entered, ns; None when there is
        none. Posted work is not an event.
        """
        heap = self._heap
        while heap and heap[0][3].cancelled:
            heappop(heap)
        return heap[0][0] if heap else None

    def _enter(self, timeout_ns: int) -> None:
        if self._running:
            raise SchedulerError("the scheduler is already running: a callback must not wait")
        if timeout_ns < 0:
            raise SchedulerError(f"timeout {timeout_ns} ns is negative")
        self._running = True


def _never() -> bool:
    return False


class VirtualScheduler(Scheduler):
    """Simulated time: jumps from event to event, as fast as the callbacks allow, and is fully repeatable."""

    def post(self, callback: Callback) -> None:
        """Enter `callback` at the present instant; virtual time has no other threads."""
        self.at(self._now, callback)

    @override
    def run_until(self, predicate: Callable[[], object], timeout_ns: int) -> bool:
        self._enter(timeout_ns)
        heap = self._heap
        end = self._now + timeout_ns
        asked = predicate is not _never
        try:
            if asked and predicate():
                return True
            while heap:
                due, priority, sequence, timer = heap[0]
                if due > end:
                    break
                self._now = due
                if timer.cancelled:
                    heappop(heap)
                else:
                    period = timer.period_ns
                    if period:
                        timer.due_ns = following = due + period
                        heapreplace(heap, (following, priority, sequence, timer))
                    else:
                        heappop(heap)
                    timer.callback()
                if asked and not (heap and heap[0][0] == due) and predicate():
                    return True
            self._now = end
        finally:
            self._running = False
        return False


class RealtimeScheduler(Scheduler):
    """The same callbacks against the monotonic clock.

    Args:
        origin_ns: Value of `time.monotonic_ns()` that is time zero of the bench; processes that share it
            share a time base. Default: now.

    """

    realtime = True

    def __init__(self, origin_ns: int | None = None) -> None:
        super().__init__()
        self.origin_ns = time.monotonic_ns() if origin_ns is None else origin_ns
        self._now = max(0, time.monotonic_ns() - self.origin_ns)
        self._posted: deque[Callback] = deque()
        self._wake = Condition()
        self.worst_lateness_ns = 0
        """Largest delay of an event after its due time since construction, ns."""

    def post(self, callback: Callback) -> None:
        """Hand `callback` over from any thread."""
        with self._wake:
            self._posted.append(callback)
            self._wake.notify()

    @override
    def at(self, time_ns: int, callback: Callback, *, priority: int = 0) -> Timer:
        self._refresh()
        return super().at(time_ns, callback, priority=priority)

    @override
    def after(self, delay_ns: int, callback: Callback, *, priority: int = 0) -> Timer:
        self._refresh()
        return super().after(delay_ns, callback, priority=priority)

    @override
    def every(self, period_ns: int, callback: Callback, *, phase_ns: int = 0, priority: int = 0) -> Timer:
        self._refresh()
        return super().every(period_ns, callback, phase_ns=phase_ns, priority=priority)

    def _refresh(self) -> None:
        # The clock runs on between runs: a delay must not start when the last run ended. Inside of a callback
        # `now` stands, as in virtual time.
        if not self._running:
            self._now = max(self._now, time.monotonic_ns() - self.origin_ns)

    @override
    def run_until(self, predicate: Callable[[], object], timeout_ns: int) -> bool:
        self._enter(timeout_ns)
        heap = self._heap
        posted = self._posted
        self._now = max(self._now, time.monotonic_ns() - self.origin_ns)
        end = self._now + timeout_ns
        asked = predicate is not _never
        try:
            if asked and predicate():
                return True
            while True:
                # Work that is posted during that waits for the next round, so that a flood of it cannot keep
                # the timed events from firing.
                waiting = len(posted)
                for _ in range(waiting):
                    self._now = max(self._now, time.monotonic_ns() - self.origin_ns)
                    posted.popleft()()
                clock = time.monotonic_ns() - self.origin_ns
                fired = bool(heap) and heap[0][0] <= clock and heap[0][0] <= end
                if fired:
                    self._now = max(self._now, clock)
                    self._fire_instant(clock)
                if asked and (waiting or fired) and predicate():
                    return True
                if clock >= end and not (heap and heap[0][0] <= end):
                    self._now = max(self._now, end)
                    return False
                if waiting or fired:
                    continue
                wait_ns = min(end, heap[0][0] if heap else end) - clock
                with self._wake:
                    if not posted and wait_ns > 0:
                        self._wake.wait(wait_ns / S)
        finally:
            self._running = False

    def _fire_instant(self, clock: int) -> None:
        """Fire all events of the first instant in the heap."""
        heap = self._heap
        due = heap[0][0]
        while heap and heap[0][0] == due:
            _, priority, sequence, timer = heap[0]
            if timer.cancelled:
                heappop(heap)
                continue
            if timer.period_ns:
                timer.due_ns = due + timer.period_ns
                heapreplace(heap, (timer.due_ns, priority, sequence, timer))
            else:
                heappop(heap)
            self.worst_lateness_ns = max(self.worst_lateness_ns, clock - due)
            timer.callback()
