"""The clock of one node: a scheduler of its own on top of that of the bench, which can
run fast or slow, and unevenly.

All times that a node receives and calculates are those of its own clock. While that runs as the
bench does, they are equal. What the node has entered stays due at the same time of its clock
when the clock changes its pace.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TypeVar

from typing_extensions import override

from fieldbus.clock import Callback, Scheduler, Stepper, Timer
from fieldbus.errors import ConfigurationError, UnsupportedFaultError

if TYPE_CHECKING:
    from numpy.random import Generator

Received = TypeVar("Received")

PPB: Final = 1_000_000_000
LARGEST_DRIFT_PPM: Final = 100_000.0
_PRUNE: Final = 64
"""So many entered events are remembered before those that have fired are forgotten."""


class NodeClock(Scheduler):
    """Time as one node has it.

    Events are entered and fire at times of the node, an interval is one by this clock. Only `run_until` and
    `next_due_ns` are in the time of the bench.

    Args:
        bench: Time of the bench.
        rng: Returns the random stream of the unevenness.

    """

    def __init__(
        self, bench: Scheduler, rng: Callable[[], Generator]
    ) -> None:  # the base's heap is that of the bench
        self.bench: Final = bench
        self.realtime = bench.realtime
        self._make_rng = rng
        self._rng: Generator | None = None
        self._ppb = 0
        self._anchor_ns = self._offset_ns = 0
        self._straight = True
        self._jitter_ns = 0
        self._timers: dict[int, Timer] = {}
        self._even: dict[int, tuple[Timer, Callback]] = {}

    # -- two times
    # ---------------------------------------------------------------------------------------------------

    @property
    @override
    def now(self) -> int:
        """Present time of the node, ns."""
        now = self.bench.time_ns
        return now if self._straight else self.local(now)

    def local(self, bench_ns: int) -> int:
        """Return what this clock shows at a time of the bench."""
        if self._straight:
            return bench_ns
        elapsed = bench_ns - self._anchor_ns
        return self._anchor_ns + self._offset_ns + elapsed * (PPB + self._ppb) // PPB

    def at_bench(self, local_ns: int) -> int:
        """Return the first time of the bench at which this clock shows a time."""
        if self._straight:
            return local_ns
        elapsed = local_ns - self._anchor_ns - self._offset_ns
        return self._anchor_ns - (-elapsed * PPB // (PPB + self._ppb))

    def to_local_time(self, receive: Callable[[Received, int], None]) -> Callable[[Received, int], None]:
        """Return a receiver of frames that gets their time by this clock."""

        def take(frame: Received, time_ns: Any) -> None:  # compiled, the same object passes through
            receive(frame, time_ns if self._straight else self.local(time_ns))

        return take

    # -- faults
    # ------------------------------------------------------------------------------------------------------

    def drift(self, ppm: float) -> None:
        """Run fast (positive) or slow by so many parts per million from now on; 0 = as the bench, without
        setting the clock.

        Raises:
            ConfigurationError: More than 100000 ppm.

        """
        if not -LARGEST_DRIFT_PPM <= ppm <= LARGEST_DRIFT_PPM:
            raise ConfigurationError("drift", ppm, f"a number within {LARGEST_DRIFT_PPM:g} ppm either way")
        self.bench.make_steps_events()
        now = self.bench.now
        self._prune()
        due = {number: self.local(timer.due_ns) for number, timer in self._timers.items()}
        periods = {
            number: round(timer.period_ns * (PPB + self._ppb) / PPB) for number, timer in self._timers.items()
        }
        self._offset_ns = self.local(now) - now
        self._anchor_ns = now
        self._ppb = round(ppm * 1000.0)
        self._straight = not (self._ppb or self._offset_ns)

        def move(timer: Timer) -> int | None:
            number = id(timer)
            if number not in due:
                return None
            timer.period_ns = round(periods[number] * PPB / (PPB + self._ppb))
            return max(self.at_bench(due[number]), now)

        self.bench.move(move)

    def jitter(self, longest_ns: int) -> None:
        """Let each cycle of the node begin late by up to so much, evenly drawn from the seeded stream; 0 = in
        time again.

        Raises:
            ConfigurationError: It is negative.

        """
        if longest_ns < 0:
            raise ConfigurationError("jitter", longest_ns, "0 ns or more")
        self.bench.make_steps_events()
        self._jitter_ns = longest_ns
        if not longest_ns:
            for timer, callback in self._even.values():
                timer.callback = callback
            self._even.clear()
            return
        if self._rng is None:
            self._rng = self._make_rng()
        for number, timer in self._timers.items():
            if timer.period_ns and number not in self._even:
                self._even[number] = timer, timer.callback
                timer.callback = partial(self._late, timer.callback, timer)

    def _late(self, callback: Callback, timer: Timer) -> None:
        assert self._rng is not None
        late_ns = int(self._rng.integers(0, self._jitter_ns, endpoint=True))

        def begin() -> None:
            if not timer.cancelled:
                callback()

        self.bench.after(late_ns, begin, priority=timer.priority)

    # -- scheduler
    # ---------------------------------------------------------------------------------------------------

    @override
    def at(self, time_ns: int, callback: Callback, *, priority: int = 0) -> Timer:
        return self._note(self.bench.at(self.at_bench(time_ns), callback, priority=priority))

    @override
    def again(self, timer: Timer, time_ns: int) -> None:
        self.bench.again(self._note(timer), self.at_bench(time_ns))

    @override
    def after(self, delay_ns: int, callback: Callback, *, priority: int = 0) -> Timer:
        if self._straight:
            return self._note(self.bench.after(delay_ns, callback, priority=priority))
        return self.at(self.now + delay_ns, callback, priority=priority)

    @override
    def every(self, period_ns: int, callback: Callback, *, phase_ns: int = 0, priority: int = 0) -> Timer:
        timer = self.bench.every(period_ns, callback, phase_ns=phase_ns, priority=priority)
        if self._ppb:
            timer.period_ns = round(period_ns * PPB / (PPB + self._ppb))
        return self._note(timer)

    @override
    def every_step(self, period_ns: int, stepper: Stepper) -> Timer:
        if self._straight and not self._jitter_ns:
            return self._note(self.bench.every_step(period_ns, stepper))
        return self.every(period_ns, stepper.step)

    @override
    def catch_up(self) -> None:
        self.bench.catch_up()

    @override
    def make_steps_events(self) -> None:
        self.bench.make_steps_events()

    @override
    def post(self, callback: Callback) -> None:
        self.bench.post(callback)

    @override
    def run_until(self, predicate: Callable[[], object], timeout_ns: int) -> bool:
        return self.bench.run_until(predicate, timeout_ns)

    @property
    @override
    def running(self) -> bool:
        return self.bench.running

    @property
    @override
    def next_due_ns(self) -> int | None:
        return self.bench.next_due_ns

    def _note(self, timer: Timer) -> Timer:
        timers = self._timers
        if len(timers) >= self._limit:
            self._prune()
        timers[id(timer)] = timer
        return timer

    _limit = _PRUNE

    def _prune(self) -> None:
        """Forget what has fired or was withdrawn."""
        now = self.bench.now
        self._timers = {
            number: timer
            for number, timer in self._timers.items()
            if not timer.cancelled and (timer.period_ns or timer.due_ns >= now)
        }
        self._limit = max(_PRUNE, 2 * len(self._timers))


def own_clock(scheduler: Scheduler, name: str) -> NodeClock:
    """Return the clock of a node, for faults of it.

    Args:
        scheduler: What the node runs on.
        name: The node, in messages.

    Raises:
        UnsupportedFaultError: It runs on the time of the bench.

    """
    if not isinstance(scheduler, NodeClock):
        raise UnsupportedFaultError(f"{name} has no clock of its own")
    return scheduler
