"""Steps that are made several at once: nobody can tell them from events of their own."""

from __future__ import annotations

import random

import numpy as np
import pytest

from fieldbus.clock import CALM_STEPS, VirtualScheduler
from fieldbus.node_clock import NodeClock

LENGTH_NS = 2000


class Counter:
    """A calculation whose steps enter an event where it is not calm: a multiple of `rough`."""

    def __init__(self, scheduler, log, number, rough):
        self.scheduler = scheduler
        self.log = log
        self.number = number
        self.rough = rough
        self.value = 0
        self.calls = 0
        self.together = 0

    def step(self):
        self.calls += 1
        self.value += 1
        if self.value % self.rough == 0:
            self.log.append((self.scheduler.now, "step", self.number, self.value))
            self.scheduler.after(self.value % 3, self.note, priority=(self.value % 5) - 2)

    def calm(self):
        return self.value // self.rough == (self.value + CALM_STEPS) // self.rough

    def advance(self, steps):
        self.calls += 1
        self.together = max(self.together, steps)
        self.value += steps

    def note(self):
        self.log.append((self.scheduler.now, "entered", self.number, self.value))

    def order(self):
        self.value += 7
        self.note()


def played(seed, *, steps_are_events, ask):
    """Return what events of a random plan have seen, and the counters."""
    draw = random.Random(seed)
    scheduler = VirtualScheduler()
    log = []
    counters = []
    for number in range(draw.randint(1, 3)):
        counter = Counter(scheduler, log, number, draw.choice((9, 40, 300, 10_000)))
        counters.append(counter)
        scheduler.every_step(draw.choice((10, 10, 25)), counter)
        scheduler.every(
            draw.choice((35, 90, 210)),
            draw.choice((counter.note, counter.order)),
            priority=draw.choice((-10, 0, 0, 100)),
        )
        blind = scheduler.every(draw.choice((6, 15, 50)), lambda: log.append((scheduler.now, "blind")))
        blind.apart = True

        def look(counter=counter):
            if scheduler.now % 4 == 0:
                scheduler.catch_up()
                counter.order()

        scheduler.every(draw.choice((12, 44)), look, priority=draw.choice((-1, 0, 1))).apart = True
    if steps_are_events:
        scheduler.make_steps_events()
    while scheduler.now < LENGTH_NS:
        scheduler.run_for(draw.randint(1, 200))
        if ask:
            scheduler.run_until(lambda: counters[0].value % 23 == 0, draw.randint(0, 200))
        log.append((scheduler.now, [counter.value for counter in counters]))
    return log, counters


@pytest.mark.parametrize("ask", [False, True], ids=["run_for", "run_until"])
def test_steps_at_once_are_seen_as_events(ask):
    """Whatever is entered, in whatever order and calm or not: every event sees what it would see if each step
    was an event, and finds it at the same time.
    """
    together = 0
    for seed in range(25):
        log, counters = played(seed, steps_are_events=False, ask=ask)
        assert log == played(seed, steps_are_events=True, ask=ask)[0], f"seed {seed}"
        together = max(together, *(counter.together for counter in counters))
    assert together > 3


def test_steps_are_up_to_date_when_an_apart_event_fails():
    """An exception in an event that is apart leaves no step behind that was due."""
    scheduler = VirtualScheduler()
    counter = Counter(scheduler, [], 0, 10_000)
    scheduler.every_step(10, counter)
    timer = scheduler.at(35, lambda: 1 // 0)
    timer.apart = True
    with pytest.raises(ZeroDivisionError):
        scheduler.run_for(100)
    assert (scheduler.now, counter.value) == (35, 4)


@pytest.mark.parametrize("disturb", [lambda clock: clock.drift(1000.0), lambda clock: clock.jitter(3)])
def test_a_clock_that_goes_wrong_moves_steps_as_events(disturb):
    """Steps of a node whose clock drifts or jitters are events again, each at its time."""
    times = []
    for steps_are_events in (False, True):
        bench = VirtualScheduler()
        clock = NodeClock(bench, lambda: np.random.default_rng(1))
        counter = Counter(bench, [], 0, 10_000)
        clock.every_step(1_000_000, counter)
        if steps_are_events:
            bench.make_steps_events()
        bench.run_for(5_500_000)
        disturb(clock)
        seen = []
        bench.every(100_000, lambda seen=seen, counter=counter: seen.append(counter.value), priority=5)
        bench.run_for(20_000_000)
        times.append((seen, counter.value, bench.next_due_ns))
    assert times[0] == times[1]
