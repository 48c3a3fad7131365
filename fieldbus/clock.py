"""Time: one scheduler interface, in virtual and in real time.

Everything in a bench is callback code on one scheduler. `VirtualScheduler` jumps from event to event;
`RealtimeScheduler` runs the same callbacks against the monotonic clock and takes work over from the threads
of real I/O through `Scheduler.post`.

Events of the same instant fire by ascending priority, then in the order in which they were entered. A
periodic event is entered once, by `Scheduler.every`, and keeps its place for good: two of them meet in the
same order at every instant that they share, whatever their periods.

What calculates its own state only, in steps of a fixed length, is entered by `Scheduler.every_step`. In
virtual time several of its steps are then made in one call, just before the next event that could see the
result. Nobody can tell the difference: an event that sees no such state says so itself (`Timer.apart`), and
in front of all others the steps are up to date.
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from heapq import heapify, heappop, heappush, heapreplace
from threading import Condition
from typing import Final, Protocol

from typing_extensions import override

from fieldbus.errors import SchedulerError

# Constants of a module are at hand in the compiled core; what is imported is looked up by name.
_push: Final = heappush
_pop: Final = heappop
_replace: Final = heapreplace

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

    __slots__ = ("apart", "callback", "cancelled", "due_ns", "period_ns", "priority")

    def __init__(self, due_ns: int, callback: Callback, priority: int, period_ns: int = 0) -> None:
        self.due_ns = due_ns
        """Time of the next firing, ns."""
        self.callback = callback
        self.priority = priority
        self.period_ns = period_ns
        """Distance of firings, ns; 0 for a single event."""
        self.cancelled = False
        self.apart = False
        """Whether the callback neither sees nor changes what `Scheduler.every_step` calculates; where it may,
        it calls `Scheduler.catch_up` before.
        """

    def cancel(self) -> None:
        """Withdraw the event; harmless when it has already fired or was cancelled before."""
        self.cancelled = True


class Stepper(Protocol):
    """A calculation in steps of a fixed length."""

    def step(self) -> object:
        """Make one step."""

    def calm(self) -> bool:
        """Return whether the next `CALM_STEPS` steps can have no effect but on what they calculate, and
        depend on nothing else, as long as nobody gives orders.
        """

    def advance(self, steps: int) -> object:
        """Make up to `CALM_STEPS` steps while calm: the same as so many calls of `step`."""


CALM_STEPS: Final = 16
"""Steps that are made in one call at most."""


class Scheduler:
    """What a bench component may ask of time.

    All times are integer nanoseconds from the start of the bench. Callbacks run in one thread and must not
    block; code that has to wait calls `run_until` from outside of callbacks.
    """

    realtime: bool = False
    """Whether `now` follows the wall clock."""

    def __init__(self) -> None:
        self.time_ns = 0
        """Present time of the bench, ns: what `now` returns, but for the clock of a node."""
        self._heap: list[tuple[int, int, int, Timer]] = []
        self._sequence = 0  # number of the last event that was entered
        self._running = False

    # An entry is (due, priority, sequence, timer); sequence numbers are unique, so timers are never compared.

    @property
    def now(self) -> int:
        """Present time, ns."""
        return self.time_ns

    def at(self, time_ns: int, callback: Callback, *, priority: int = 0) -> Timer:
        """Enter `callback` for `time_ns`.

        Raises:
            SchedulerError: `time_ns` is in the past (virtual time only; in real time it fires at once).

        """
        if time_ns < self.time_ns:
            if not self.realtime:
                raise SchedulerError(f"event at {time_ns} ns is before the present time {self.time_ns} ns")
            time_ns = self.time_ns
        timer = Timer(time_ns, callback, priority)
        self._sequence = sequence = self._sequence + 1
        _push(self._heap, (time_ns, priority, sequence, timer))
        return timer

    def again(self, timer: Timer, time_ns: int) -> None:
        """Enter a single event again that has fired; cheaper than a new one. It
        must not be entered or cancelled.

        Args:
            timer: The event.
            time_ns: Not before now.

        """
        timer.due_ns = time_ns
        self._sequence = sequence = self._sequence + 1
        _push(self._heap, (time_ns, timer.priority, sequence, timer))

    def after(self, delay_ns: int, callback: Callback, *, priority: int = 0) -> Timer:
        """Enter `callback` for `delay_ns` (>= 0) from now."""
        if delay_ns < 0:
            raise SchedulerError(f"delay {delay_ns} ns is negative")
        return self.at(self.time_ns + delay_ns, callback, priority=priority)

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
        due = -(-(self.time_ns - phase_ns) // period_ns) * period_ns + phase_ns
        timer = Timer(due, callback, priority, period_ns)
        self._sequence = sequence = self._sequence + 1
        _push(self._heap, (due, priority, sequence, timer))
        return timer

    def every_step(self, period_ns: int, stepper: Stepper) -> Timer:
        """Make a step of a calculation at every instant `k * period_ns`, as `every` with priority 0 would."""
        return self.every(period_ns, stepper.step)

    def catch_up(self) -> None:
        """Make all steps that are due before the present event; for an event that is `Timer.apart`."""

    def make_steps_events(self) -> None:
        """Make each step of `every_step` an event of its own from now on: its timer can be changed."""

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
            _pop(heap)
        return heap[0][0] if heap else None

    def _enter(self, timeout_ns: int) -> None:
        if self._running:
            raise SchedulerError("the scheduler is already running: a callback must not wait")
        if timeout_ns < 0:
            raise SchedulerError(f"timeout {timeout_ns} ns is negative")
        self._running = True


def _never() -> bool:
    return False


_NO_STEP: Final = 1 << 61
"""A time that never comes, ns."""
_LAST: Final = 1 << 30
"""Priority behind all others."""
_NO_EVENT: Final = (_NO_STEP, _LAST, 0, Timer(_NO_STEP, _never, _LAST))


class VirtualScheduler(Scheduler):
    """Simulated time: jumps from event to event, as fast as the callbacks allow, and is fully repeatable."""

    def __init__(self) -> None:
        super().__init__()
        self._steps: list[tuple[int, int, _Steps]] = []
        """Due, ns, sequence and calculation; a heap."""
        self._step_due = _NO_STEP
        """Time of the first step that has not been made, ns."""
        self._calm_until = 0
        """Time up to which no step has an effect outside, ns; 0: not known."""
        # An event that was entered again while `_run` executes another one, and goes before all in the heap.
        # Most frames on a bus follow each other like that; they take no operation of the heap.
        self._first: Timer | None = None
        self._first_sequence = 0
        self._takes_first = False
        # The event that is running without the steps before it.
        self._apart_due = self._apart_priority = self._apart_sequence = 0

    def post(self, callback: Callback) -> None:
        """Enter `callback` at the present instant; virtual time has no other threads."""
        self.at(self.time_ns, callback)

    @override
    def again(self, timer: Timer, time_ns: int) -> None:
        timer.due_ns = time_ns
        self._sequence = sequence = self._sequence + 1
        heap = self._heap
        if self._takes_first and self._first is None and heap and time_ns < heap[0][0]:
            self._first = timer
            self._first_sequence = sequence
        else:
            _push(heap, (time_ns, timer.priority, sequence, timer))

    def _settle_first(self) -> None:
        """Put the first event into the heap, for whoever looks there."""
        timer = self._first
        if timer is not None:
            self._first = None
            _push(self._heap, (timer.due_ns, timer.priority, self._first_sequence, timer))

    @property
    @override
    def next_due_ns(self) -> int | None:
        self._settle_first()
        event = super().next_due_ns
        if not self._steps:
            return event
        return self._step_due if event is None else min(self._step_due, event)

    @override
    def every_step(self, period_ns: int, stepper: Stepper) -> Timer:
        timer = self.every(period_ns, stepper.step)
        if self._running:
            return timer  # entered by an event: one itself
        # It keeps its place among the events, without being one.
        entry = max(self._heap, key=_sequence_of)
        self._heap.remove(entry)
        heapify(self._heap)
        _push(self._steps, (timer.due_ns, entry[2], _Steps(timer, stepper)))
        self._note_next_step()
        return timer

    @override
    def make_steps_events(self) -> None:
        for due, sequence, steps in self._steps:
            _push(self._heap, (due, 0, sequence, steps.timer))
        self._steps.clear()
        self._note_next_step()

    @override
    def move(self, new_due_ns: Callable[[Timer], int | None]) -> None:
        self._settle_first()
        self.make_steps_events()
        super().move(new_due_ns)

    @override
    def catch_up(self) -> None:
        if self._step_due <= self._apart_due:
            self._advance(self._apart_due, self._apart_priority, self._apart_sequence)

    @override
    def run_until(self, predicate: Callable[[], object], timeout_ns: int) -> bool:
        self._enter(timeout_ns)
        end = self.time_ns + timeout_ns
        try:
            if predicate is not _never:
                return self._run_asking(predicate, end)
            self._run(end)
        except BaseException:
            self.catch_up()  # what is read now is as old as the error
            raise
        finally:
            self._running = self._takes_first = False
            self._settle_first()
        return False

    def _run(self, end: int) -> None:
        """Run all events up to `end`."""
        heap = self._heap
        self._takes_first = True
        while heap or self._steps or self._first is not None:
            due, priority, sequence, timer = heap[0] if heap else _NO_EVENT
            first = self._first
            if first is not None:
                # What was entered later may still go before it.
                at = first.due_ns
                if at < due or (at == due and (first.priority, self._first_sequence) < (priority, sequence)):
                    due, priority, sequence, timer = at, first.priority, self._first_sequence, first
            if due > end:
                if self._step_due > end:
                    break
                self._make_steps(end, _LAST, 0)
                continue
            if due >= self._step_due:
                if due < self._calm_until or self._calm(due):
                    if timer.apart:
                        self._apart_due = due
                        self._apart_priority = priority
                        self._apart_sequence = sequence
                    else:
                        self._advance(due, priority, sequence)
                else:
                    if first is not None:
                        self._settle_first()
                        continue
                    self._make_steps(due, priority, sequence)
                    if heap[0][2] != sequence:
                        continue  # a step has entered an event that comes first
            self.time_ns = due
            if timer is first:
                self._first = None
                if not timer.cancelled:
                    timer.callback()
                continue
            if timer.cancelled:
                _pop(heap)
                continue
            period = timer.period_ns
            if period:
                timer.due_ns = following = due + period
                _replace(heap, (following, priority, sequence, timer))
            else:
                _pop(heap)
            timer.callback()
        self.time_ns = end

    def _run_asking(self, predicate: Callable[[], object], end: int) -> bool:
        """Run events up to `end`, or until a predicate is true: it is asked after every instant, that of a
        step too. Steps are events meanwhile.
        """
        heap = self._heap
        if predicate():
            return True
        lent = self._steps.copy()
        self.make_steps_events()
        try:
            while heap:
                due, priority, sequence, timer = heap[0]
                if due > end:
                    break
                self.time_ns = due
                if timer.cancelled:
                    _pop(heap)
                else:
                    period = timer.period_ns
                    if period:
                        timer.due_ns = following = due + period
                        _replace(heap, (following, priority, sequence, timer))
                    else:
                        _pop(heap)
                    timer.callback()
                if not (heap and heap[0][0] == due) and predicate():
                    return True
            self.time_ns = end
        finally:
            for _, sequence, steps in lent:
                timer = steps.timer
                # One that a clock has taken for itself meanwhile stays an event.
                if timer.callback == steps.step and timer.period_ns == steps.period_ns:
                    heap.remove((timer.due_ns, 0, sequence, timer))
                    _push(self._steps, (timer.due_ns, sequence, steps))
            heapify(heap)
            self._note_next_step()
        return False

    # -- steps

    def _calm(self, due: int) -> bool:
        """Return whether the steps up to an instant have no effect but on what they calculate."""
        if self._calm_until:
            return due < self._calm_until
        until = _NO_STEP
        for first, _, steps in self._steps:
            if not steps.calm():
                return False
            last = first + steps.calm_ns
            if last < until:  # noqa: PLR1730 - min() is a call on the cyclic path
                until = last
        self._calm_until = until
        return due < until

    def _make_steps(self, due: int, priority: int, sequence: int) -> None:
        """Make the steps before an event that is the next one, or those before what they have entered."""
        while not self._calm(due):
            until = self._calm_until
            if not until:
                self._step_singly(due)
                return
            self._advance(until - 1, _LAST, 0)
        self._advance(due, priority, sequence)

    def _advance(self, due: int, priority: int, sequence: int) -> None:
        """Make all steps before an event, those of each calculation in one call."""
        entries = self._steps
        for place, (first, number, steps) in enumerate(entries):
            # A step has priority 0.
            last = due if priority > 0 or (priority == 0 and sequence > number) else due - 1
            if first <= last:
                period = steps.period_ns
                count = (last - first) // period + 1
                steps.timer.due_ns = following = first + count * period
                entries[place] = (following, number, steps)
                steps.advance(count)
        if len(entries) > 1:
            heapify(entries)
        self._step_due = entries[0][0]
        self._calm_until = 0

    def _step_singly(self, end: int) -> None:
        """Make steps up to `end`, each at its time, until an event comes first."""
        heap = self._heap
        entries = self._steps
        self._takes_first = False
        while entries:
            due, sequence, steps = entries[0]
            if due > end or (heap and heap[0] < (due, 0, sequence)):
                break
            self.time_ns = due
            steps.timer.due_ns = following = due + steps.period_ns
            _replace(entries, (following, sequence, steps))
            self._step_due = entries[0][0]
            steps.step()
        self._takes_first = True
        self._note_next_step()

    def _note_next_step(self) -> None:
        self._step_due = self._steps[0][0] if self._steps else _NO_STEP
        self._calm_until = 0


class _Steps:
    """A calculation in steps and its timer."""

    __slots__ = ("advance", "calm", "calm_ns", "period_ns", "step", "timer")

    def __init__(self, timer: Timer, stepper: Stepper) -> None:
        self.timer = timer
        self.period_ns = timer.period_ns
        self.calm_ns = CALM_STEPS * timer.period_ns
        self.step: Callback = stepper.step
        self.calm: Callable[[], bool] = stepper.calm
        self.advance: Callable[[int], object] = stepper.advance


def _sequence_of(entry: tuple[int, int, int, Timer]) -> int:
    return entry[2]


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
        self.time_ns = max(0, time.monotonic_ns() - self.origin_ns)
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
            self.time_ns = max(self.time_ns, time.monotonic_ns() - self.origin_ns)

    @override
    def run_until(self, predicate: Callable[[], object], timeout_ns: int) -> bool:
        self._enter(timeout_ns)
        heap = self._heap
        posted = self._posted
        self.time_ns = max(self.time_ns, time.monotonic_ns() - self.origin_ns)
        end = self.time_ns + timeout_ns
        asked = predicate is not _never
        try:
            if asked and predicate():
                return True
            while True:
                # Work that is posted during that waits for the next round, so that a flood of it cannot keep
                # the timed events from firing.
                waiting = len(posted)
                for _ in range(waiting):
                    self.time_ns = max(self.time_ns, time.monotonic_ns() - self.origin_ns)
                    posted.popleft()()
                clock = time.monotonic_ns() - self.origin_ns
                fired = bool(heap) and heap[0][0] <= clock and heap[0][0] <= end
                if fired:
                    self.time_ns = max(self.time_ns, clock)
                    self._fire_instant(clock)
                if asked and (waiting or fired) and predicate():
                    return True
                if clock >= end and not (heap and heap[0][0] <= end):
                    self.time_ns = max(self.time_ns, end)
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
                _pop(heap)
                continue
            if timer.period_ns:
                timer.due_ns = due + timer.period_ns
                _replace(heap, (timer.due_ns, priority, sequence, timer))
            else:
                _pop(heap)
            self.worst_lateness_ns = max(self.worst_lateness_ns, clock - due)
            timer.callback()
