"""What everything on a bench stands on: events in their order, the clock of a node that runs fast, slow and
unevenly, and logs of which only the newest entries are in memory.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np

from fieldbus.clock import VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.growing_log import GrowingLog, LogPart
from fieldbus.node_clock import NodeClock
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.support import equal, same

CAMPAIGN: Final = Campaign("time and logs", controller="", bench="testcases.campaigns.can_bus:BENCH")
MS: Final = 1_000_000


# -- events -----------------------------------------------------------------------------------------------


@CAMPAIGN.case("events")
def events(ctx: CaseContext) -> None:
    """Drawn events fire by time, then priority, then the order in which they were entered; periodic ones keep
    their grid; those that are withdrawn do not fire, and one that is entered again counts from then on.
    """
    draw = random.Random(4)
    scheduler = VirtualScheduler()
    scheduler.run_for(3 * MS)
    fired: list[tuple[int, int]] = []
    wanted: list[tuple[int, int, int, int]] = []
    end = scheduler.now + 1000
    for number in range(300):
        due, priority = scheduler.now + draw.randint(0, 900), draw.choice((-1, 0, 0, 0, 5))
        timer = scheduler.at(
            due, lambda number=number: fired.append((scheduler.now, number)), priority=priority
        )
        if draw.random() < 0.2:
            timer.cancel()
            timer.cancel()
        else:
            wanted.append((due, priority, number, number))
    for number, (period, phase) in enumerate(((100, 0), (70, 30)), 1000):
        timer = scheduler.every(
            period, lambda number=number: fired.append((scheduler.now, number)), phase_ns=phase
        )
        first = -(-(scheduler.now - phase) // period) * period + phase
        grid = range(first, end + 1, period)
        wanted += [(due, 0, 10_000 + place, number) for place, due in enumerate(grid)]
    scheduler.run_for(1000)
    # Events of one instant and priority: single ones were entered first, periodic ones with every period.
    singles = [(when, number) for when, number in fired if number < 1000]
    same(
        ctx,
        "order of single events",
        singles,
        [(due, number) for due, _, _, number in sorted(wanted) if number < 1000],
    )
    for number in (1000, 1001):
        beats = [when for when, one in fired if one == number]
        same(ctx, f"beats of {number}", beats, [due for due, _, _, one in sorted(wanted) if one == number])
    same(ctx, "time in the end", scheduler.now, end)
    timer = scheduler.after(10, lambda: fired.append((scheduler.now, -1)))
    scheduler.run_for(20)
    scheduler.again(timer, scheduler.now + 5)
    scheduler.run_for(20)
    same(ctx, "an event that is entered again", [when - end for when, one in fired if one == -1], [10, 25])
    seen: list[int] = []
    scheduler.after(50, lambda: seen.append(scheduler.now))
    begun = scheduler.now
    met = scheduler.run_until(lambda: seen, 49)
    same(ctx, "a condition that comes too late", (met, scheduler.now - begun), (False, 49))
    met = scheduler.run_until(lambda: seen, 100)
    same(ctx, "a condition that comes in time", (met, scheduler.now - begun), (True, 50))
    for wrong in (-1, 0):
        try:
            scheduler.every(wrong, lambda: None)
            refused = False
        except Exception:  # noqa: BLE001 - any refusal
            refused = True
        same(ctx, f"period {wrong} is refused", refused, True)


# -- clock of a node -----------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "node-clock/{ppm}", parameters={"ppm": (100_000, 200, -200, -100_000)}, title="clock off by {ppm} ppm"
)
def node_clock(ctx: CaseContext, ppm: int) -> None:
    """Delays, times and periods are those of the node: in time of the bench they are as much shorter or
    longer as the clock is fast or slow, also those entered before; set right it keeps its difference.
    """
    bench = VirtualScheduler()
    clock = NodeClock(bench, lambda: np.random.default_rng(3))
    bench.run_for(7 * MS + 1)
    begun = bench.now
    same(ctx, "difference without drift", clock.now - bench.now, 0)
    seen: dict[str, list[int]] = {}

    def note(name: str) -> Any:
        return lambda: seen.setdefault(name, []).append(bench.now - begun)

    clock.after(10 * MS, note("before"))
    clock.every(4 * MS, note("grid"), phase_ns=MS)
    clock.drift(ppm)
    pace = 1.0 + ppm * 1e-6
    clock.after(10 * MS, note("after"))
    clock.at(clock.now + 20 * MS, note("at"))
    clock.every(5 * MS, note("new grid"))
    timer = clock.after(MS, note("again"))
    bench.run_for(40 * MS)
    for name, delay in (("before", 10 * MS), ("after", 10 * MS), ("at", 20 * MS)):
        equal(ctx, f"{name}, ns of the bench", seen[name][0], delay / pace, within=2)
    for name, period in (("grid", 4 * MS), ("new grid", 5 * MS)):
        gaps = [later - earlier for earlier, later in pairwise(seen[name])]
        equal(ctx, f"{name}: number", len(gaps) >= 6, 1)
        for gap in gaps[1:]:
            equal(ctx, f"{name}: period, ns", gap, period / pace, within=2)
    equal(ctx, "difference, ns", clock.now - bench.now, 40 * MS * ppm * 1e-6, within=2)
    equal(ctx, "there and back, ns", clock.at_bench(clock.local(bench.now)) - bench.now, 0, within=1)
    heard: list[int] = []
    clock.to_local_time(lambda _frame, when: heard.append(when))(None, bench.now)
    same(ctx, "time of a frame", heard, [clock.now])
    clock.again(timer, clock.now + 2 * MS)
    before = bench.now - begun
    bench.run_for(5 * MS)
    equal(ctx, "entered again, ns", seen["again"][-1] - before, 2 * MS / pace, within=2)
    kept = clock.now - bench.now
    clock.drift(0)
    bench.run_for(10 * MS)
    same(ctx, "difference behind the drift", clock.now - bench.now, kept)
    for wrong in (100_001, -100_001):
        try:
            clock.drift(wrong)
            refused = False
        except ConfigurationError:
            refused = True
        same(ctx, f"{wrong} ppm are refused", refused, True)


@CAMPAIGN.case("node-clock/jitter")
def jitter(ctx: CaseContext) -> None:
    """Cycles begin late by up to the jitter and never early, single events in time; with 0 in time again."""
    bench = VirtualScheduler()
    clock = NodeClock(bench, lambda: np.random.default_rng(3))
    beats: list[int] = []
    singles: list[int] = []
    clock.every(MS, lambda: beats.append(bench.now))
    bench.run_for(5 * MS)
    same(ctx, "beats without jitter", [when % MS for when in beats], [0] * len(beats))
    beats.clear()
    clock.jitter(200_000)
    clock.after(MS // 2, lambda: singles.append(bench.now))
    bench.run_for(200 * MS)
    late = [when % MS for when in beats]
    equal(ctx, "beats in 200 ms", len(late), 200, within=1)
    equal(ctx, "latest, us", max(late) / 1000, 190, within=10)
    equal(ctx, "earliest, us", min(late) / 1000, 5, within=5)
    equal(ctx, "mean, us", sum(late) / len(late) / 1000, 100, within=15)
    same(ctx, "a single event is in time", singles, [5 * MS + MS // 2])
    clock.jitter(0)
    bench.run_for(2 * MS)
    beats.clear()
    bench.run_for(5 * MS)
    same(ctx, "beats without jitter again", [when % MS for when in beats], [0] * 5)
    try:
        clock.jitter(-1)
        refused = False
    except ConfigurationError:
        refused = True
    same(ctx, "a negative jitter is refused", refused, True)


# -- logs ---------------------------------------------------------------------------------------------------


class _ListStore:
    """Keeps the older entries in a list."""

    def __init__(self) -> None:
        self._entries: list[int] = []

    def extend(self, entries: Sequence[int], /) -> None:
        """Add entries."""
        self._entries.extend(entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __getitem__(self, index: int, /) -> int:
        return self._entries[index]

    def __iter__(self) -> Iterator[int]:
        return iter(self._entries)

    def part(self, first: int, last: int, /) -> Sequence[int]:
        """Return entries by their numbers."""
        return self._entries[first:last]


@CAMPAIGN.case("growing-log")
def growing_log(ctx: CaseContext) -> None:
    """A log behaves as the list of all its entries, wherever they are; copies and parts do not grow."""
    draw = random.Random(6)
    log: GrowingLog[int] = GrowingLog([])
    plain: list[int] = []
    wrong: list[str] = []
    copies: list[tuple[Any, list[int]]] = []
    stores: list[_ListStore] = []

    def make() -> _ListStore:
        stores.append(_ListStore())
        return stores[-1]

    def expect(what: str, found: object, wanted: object) -> None:
        if found != wanted:
            wrong.append(f"{what}: {found} in place of {wanted}")

    for number in range(400):
        log.append(number)
        plain.append(number)
        if draw.random() < 0.05:
            log.move(
                draw.randint(0, len(log.newest)),
                make,
                draw.choice((None, lambda count: log.newest.__delitem__(slice(0, count)))),
            )
        expect("length", len(log), len(plain))
        expect("entries in two places", log.stored + len(log.newest), len(plain))
        at = draw.randint(-len(plain), len(plain) - 1)
        expect(f"entry {at}", log[at], plain[at])
        part = slice(
            draw.randint(-9, len(plain)), draw.randint(-9, len(plain) + 9), draw.choice((None, 1, 2, -1))
        )
        expect(f"entries {part}", list(log[part]), plain[part])
        if number % 40 == 7:
            copies.append((log.copy(), list(plain)))
            first, last = sorted((draw.randint(0, len(plain)), draw.randint(0, len(plain))))
            copies.append((LogPart(log, first, last), plain[first:last]))
    expect("all", list(log), plain)
    expect("equal to the list", log == plain, True)
    expect("unequal to a shorter one", log == plain[:-1], False)
    expect("unequal to another one", log == [*plain[:-1], -1], False)
    expect("stores", len(stores), 1)
    for copy, entries in copies:
        expect("a copy", list(copy), entries)
        expect("length of a copy", len(copy), len(entries))
        expect("slice of a copy", list(copy[1:-1]), entries[1:-1])
        expect("backwards", list(copy[-5:]), entries[-5:])
        if entries:
            expect("last entry of a copy", (copy[-1], copy[len(entries) - 1]), (entries[-1], entries[-1]))
    for far in (len(plain), -len(plain) - 1):
        try:
            log[far]
            wrong.append(f"entry {far} is there")
        except IndexError:
            pass
    log.forget_stored()
    expect("entries in memory alone", list(log), plain[-len(log.newest) :] if log.newest else [])
    log.clear()
    expect("a log that is cleared", (len(log), log.stored, list(log)), (0, 0, []))
    equal(ctx, f"differences: {wrong[:3]}", len(wrong), 0)
