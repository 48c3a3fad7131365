"""How bench time passes: at a speed, not at all, by cycles, or until a condition holds."""

from __future__ import annotations

import time
from collections.abc import Callable
from math import inf
from typing import TYPE_CHECKING, Final, Protocol

from fieldbus.clock import S
from hil.cockpit.messages import MessageError

if TYPE_CHECKING:
    from fieldbus.clock import Scheduler

_SLICE_S: Final = 0.02
"""Wall time after which others have their turn, s."""
_LIVE_SLICE_S: Final = 0.01
_CHUNK_S: Final = 0.02
"""Bench time that passes at once, s."""
_MOST_S: Final = 0.2
"""Bench time of a slice, s: the sign of life of a control panel is renewed between slices."""
_LAG_S: Final = 1.0
"""Wall time that is made up for at once when the machine was busy, s."""
_MEASURED_S: Final = 1.0


class Clock(Protocol):
    """Time of a bench."""

    @property
    def scheduler(self) -> Scheduler:
        """Its scheduler."""

    @property
    def now_s(self) -> float:
        """Bench time, s."""

    @property
    def cycle_ns(self) -> int:
        """Cycle of the bus, ns."""

    def run_for(self, seconds: float) -> None:
        """Let time pass."""

    def run_until(self, predicate: Callable[[], object], timeout: float) -> bool:
        """Let time pass until a condition holds; returns whether it did within `timeout`, s."""


class Pace:
    """Time control of one bench; a live bench takes its time from the clock.

    Args:
        clock: Time of the bench.
        live: Whether it is a live one.

    """

    def __init__(self, clock: Clock, *, live: bool) -> None:
        self._clock = clock
        self.live = live
        self.running = True
        self.factor = 1.0
        """Bench time per time on the clock; infinite: as fast as the machine can."""
        self.condition_text = ""
        """What is run to; empty: nothing."""
        self.met = ""
        """Condition that the last run has ended with."""
        self.held = ""
        """Why time was stopped by the cockpit itself; empty: it was not."""
        self.speed = 0.0
        """Bench time per time on the clock, measured."""
        self._condition: Callable[[], object] | None = None
        self._wall_s = time.monotonic()
        self._base_s = clock.now_s
        self._mark = (self._wall_s, clock.now_s)

    def run(self, factor: float | None = None) -> None:
        """Let time pass, at another speed where one is given.

        Raises:
            MessageError: The bench is a live one, whose time is that of the clock.

        """
        if self.live and factor not in {None, 1.0}:
            raise MessageError("a live bench runs with the clock: it has no other speed")
        if factor is not None:
            self.factor = factor
        self.running = True
        self.met = self.held = ""
        self._rebase()

    def pause(self) -> None:
        """Let time stand still.

        Raises:
            MessageError: The bench is a live one.

        """
        self._virtual("pause")
        self.running = False
        self._forget()

    def hold(self, why: str) -> None:
        """Let the time of a virtual bench stand still, for a reason that the pages show."""
        self.pause()
        self.held = why

    def step(self, cycles: int) -> None:
        """Let whole bus cycles pass, up to the end of the last one, and stand still.

        Raises:
            MessageError: The bench is a live one.

        """
        self._virtual("step")
        self.running = False
        self._forget()
        cycle, now = self._clock.cycle_ns, self._clock.scheduler.now
        self._clock.scheduler.run_for((now // cycle + cycles) * cycle - now)

    def run_to(self, condition: Callable[[], object], text: str) -> None:
        """Run on until a condition holds, then stand still.

        Raises:
            MessageError: The bench is a live one.

        """
        self._virtual("run until a condition")
        self._condition = condition
        self.condition_text = text
        self.run()

    def _virtual(self, what: str) -> None:
        if self.live:
            raise MessageError(f"a live bench runs with the clock: it does not {what}")

    def _forget(self) -> None:
        self._condition = None
        self.condition_text = ""

    def _rebase(self) -> None:
        self._wall_s = time.monotonic()
        self._base_s = self._clock.now_s

    def advance(self) -> float:
        """Let a slice of time pass; returns how long nothing is to do, s."""
        wait_s = self._advance()
        now_s = time.monotonic()
        wall_s, bench_s = self._mark
        if now_s - wall_s >= _MEASURED_S:
            self.speed = (self._clock.now_s - bench_s) / (now_s - wall_s)
            self._mark = (now_s, self._clock.now_s)
        return wait_s

    def _advance(self) -> float:
        clock = self._clock
        if self.live:
            clock.run_for(_LIVE_SLICE_S)
            return 0.0
        if not self.running:
            return _SLICE_S
        begun_s = time.monotonic()
        due_s = self._base_s + (begun_s - self._wall_s) * self.factor if self.factor < inf else inf
        if due_s - clock.now_s > _LAG_S * max(self.factor, 1.0):
            self._rebase()
            due_s = clock.now_s + (_SLICE_S * self.factor if self.factor < inf else inf)
        end_s = min(due_s, clock.now_s + _MOST_S)
        while (left_s := end_s - clock.now_s) > 0.5 / S:
            if self._passed(min(left_s, _CHUNK_S)):
                return _SLICE_S
            if time.monotonic() - begun_s > _SLICE_S:
                return 0.0
        return 0.0 if self.factor == inf else min(_SLICE_S, 0.005 / min(self.factor, 1.0))

    def _passed(self, seconds: float) -> bool:
        """Let time pass; returns whether the condition has come true meanwhile."""
        condition = self._condition
        if condition is None:
            self._clock.run_for(seconds)
            return False
        if not self._clock.run_until(condition, seconds):
            return False
        self.met = self.condition_text
        self.running = False
        self._forget()
        return True
