"""The scheduler's time for library code that reads the wall clock.

The `canopen` library measures its time-outs with `time.time()` and `time.monotonic()`. Inside `virtual_time`
its modules see a clock that follows a scheduler, so that `canopen.profiles.p402`, for example, commissions a
drive in simulated time.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any, Final

from fieldbus.clock import US, S, Scheduler, seconds_to_ns
from fieldbus.errors import BusError

EPOCH_S: Final = 946_684_800.0
"""Unix time of the start of a bench, s: 2000-01-01. `time.time()` must be after 1984 for CANopen's TIME."""

LIBRARY_MODULES: Final = (
    "canopen.nmt",
    "canopen.emcy",
    "canopen.lss",
    "canopen.timestamp",
    "canopen.sdo.client",
    "canopen.profiles.p402",
)
"""Modules of the library that read a clock or sleep."""

POLL_NS: Final = 100 * US
"""How far a look at the clock lets time pass by default, ns."""


class SchedulerClock:
    """Stands in for the module `time`.

    Looking at the clock lets a little time pass, as in a real program: a loop that polls until a time-out
    would never end otherwise. From inside a scheduler callback time stands still.

    Args:
        scheduler: Whose time to show.
        poll_ns: How far a look at the clock lets time pass, ns; 0 = not at all.

    """

    def __init__(self, scheduler: Scheduler, *, poll_ns: int) -> None:
        self._scheduler = scheduler
        self._poll_ns = poll_ns

    def _look(self) -> float:
        if self._poll_ns and not self._scheduler.running:
            self._scheduler.run_for(self._poll_ns)
        return self._scheduler.now / S

    def time(self) -> float:
        """Return Unix time, s: `EPOCH_S` plus the time of the bench."""
        return EPOCH_S + self._look()

    def monotonic(self) -> float:
        """Return the time of the bench, s."""
        return self._look()

    perf_counter = monotonic

    def sleep(self, seconds: float) -> None:
        """Let `seconds` of the scheduler's time pass.

        Raises:
            BusError: Called from inside a scheduler callback, which must not wait.

        """
        if self._scheduler.running:
            raise BusError("sleep from inside a scheduler callback: a callback must not wait")
        self._scheduler.run_for(seconds_to_ns(max(0.0, seconds)))

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)


@contextmanager
def virtual_time(
    scheduler: Scheduler, *modules: ModuleType | str, poll_ns: int = POLL_NS
) -> Iterator[SchedulerClock]:
    """Give library modules the scheduler's time while the context lasts.

    On a realtime scheduler the time shown is the wall clock's, counted from the start of the bench; what the
    context adds there is that looking at the clock and sleeping run the scheduler. May be nested. The modules
    are those of the whole process: no other thread may use the library in that time.

    Args:
        scheduler: Whose time to show.
        modules: Further modules, or their names, whose global `time` is the module `time`; those of the
            `canopen` library that read a clock are always included, as far as they are imported.
        poll_ns: How far a look at the clock lets time pass, ns.

    """
    clock = SchedulerClock(scheduler, poll_ns=poll_ns)
    replaced: list[tuple[ModuleType, Any]] = []
    for item in (*LIBRARY_MODULES, *modules):
        module = sys.modules.get(item) if isinstance(item, str) else item
        if module is not None and hasattr(module, "time"):
            replaced.append((module, module.time))
            vars(module)["time"] = clock
    try:
        yield clock
    finally:
        for module, original in reversed(replaced):
            vars(module)["time"] = original
