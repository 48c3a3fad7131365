"""The virtual scheduler against a reference that is too simple to be wrong."""

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.clock import VirtualScheduler

pytestmark = pytest.mark.exhaustive

HORIZON = 40


class ReferenceTimer:
    """An entry of `ReferenceScheduler`."""

    def __init__(self, due, priority, callback, period):
        self.due = due
        self.priority = priority
        self.callback = callback
        self.period = period
        self.alive = True

    def cancel(self):
        self.alive = False


class ReferenceScheduler:
    """Looks through all entries for the next one: slow, and nothing that could be got wrong."""

    def __init__(self):
        self.now = 0
        self.entered = []

    def _enter(self, due, priority, callback, period=0):
        timer = ReferenceTimer(due, priority, callback, period)
        self.entered.append(timer)
        return timer

    def at(self, time_ns, callback, *, priority):
        return self._enter(time_ns, priority, callback)

    def after(self, delay_ns, callback, *, priority):
        return self._enter(self.now + delay_ns, priority, callback)

    def every(self, period_ns, callback, *, phase_ns, priority):
        due = phase_ns
        while due < self.now:
            due += period_ns
        return self._enter(due, priority, callback, period_ns)

    def again(self, timer, time_ns):
        timer.due = time_ns
        timer.alive = True
        self.entered.remove(timer)
        self.entered.append(timer)

    @property
    def next_due_ns(self):
        return min((timer.due for timer in self.entered if timer.alive), default=None)

    def run_for(self, duration):
        end = self.now + duration
        while True:
            due = [timer for timer in self.entered if timer.alive and timer.due <= end]
            if not due:
                break
            # min() takes the first of equals, and the list is in order of entry
            timer = min(due, key=lambda timer: (timer.due, timer.priority))
            self.now = timer.due
            if timer.period:
                timer.due += timer.period
            else:
                timer.alive = False
            timer.callback()
        self.now = end


@dataclass
class Step:
    """One call of the scheduler's interface; `inner` is what the callback does in turn."""

    kind: str
    time: int
    phase: int
    priority: int
    target: int
    inner: list["Step"] = field(default_factory=list)


def steps(inner):
    return st.builds(
        Step,
        kind=st.sampled_from(["at", "after", "every", "again", "again", "cancel"]),
        time=st.integers(0, 12),
        phase=st.integers(0, 12),
        priority=st.integers(-1, 1),
        target=st.integers(0, 30),
        inner=inner,
    )


leaves = steps(st.just([]))
branches = steps(st.lists(leaves, max_size=2))
programs = st.lists(
    st.tuples(st.integers(0, 12), st.lists(steps(st.lists(branches, max_size=2)), max_size=4)), max_size=5
)


def execute(scheduler, program):
    """Run `program` and return the log of firings: (number of the timer, time)."""
    timers = []
    log = []
    cancelled = set()

    def enter(step):
        if step.kind == "cancel":
            if timers:
                number = step.target % len(timers)
                timers[number].cancel()
                cancelled.add(number)
            return
        number = len(timers)

        def fire():
            log.append((number, scheduler.now))
            # enough for every interleaving, and it ends
            if len(log) < 400:
                if step.kind == "again" and number not in cancelled:
                    scheduler.again(timers[number], scheduler.now + step.phase)
                for inner in step.inner:
                    enter(inner)
                if not step.target % 5:
                    log.append(("next", scheduler.next_due_ns or 0))

        timers.append(None)
        if step.kind in ("at", "again"):
            timers[number] = scheduler.at(scheduler.now + step.time, fire, priority=step.priority)
        elif step.kind == "after":
            timers[number] = scheduler.after(step.time, fire, priority=step.priority)
        else:
            period = step.time + 1
            timers[number] = scheduler.every(
                period, fire, phase_ns=step.phase % period, priority=step.priority
            )

    for duration, entered in program:
        for step in entered:
            enter(step)
        scheduler.run_for(duration)
    scheduler.run_for(HORIZON)
    return log


@given(programs)
def test_fires_like_the_reference(program):
    """Any interleaving of at, after, every, again and cancel, from in- and outside of callbacks, fires like
    the reference, and what is due next is the same.
    """
    log = execute(VirtualScheduler(), program)
    assert log == execute(ReferenceScheduler(), program)
    times = [time for number, time in log if number != "next"]
    assert times == sorted(times)


@given(programs)
def test_fires_the_same_twice(program):
    """Two runs of one program give the same log."""
    assert execute(VirtualScheduler(), program) == execute(VirtualScheduler(), program)
