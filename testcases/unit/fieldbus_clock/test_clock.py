"""The scheduler: order, grids, waiting, and the same contract in virtual and in real time."""

import threading
import time

import pytest

from fieldbus.clock import MS, US, RealtimeScheduler, S, Scheduler, VirtualScheduler, seconds_to_ns
from fieldbus.errors import HilError, SchedulerError

UNIT = 2 * MS
"""Distance of events in the contract suite: long enough for real time, short enough to run often."""


@pytest.fixture(params=[VirtualScheduler, RealtimeScheduler])
def scheduler(request) -> Scheduler:
    return request.param()


def unit_grid(scheduler: Scheduler) -> int:
    """Return an instant on the grid of `UNIT`, far enough ahead that a busy machine has entered its events by
    then.
    """
    return (scheduler.now // UNIT + 12) * UNIT


def run_past(scheduler: Scheduler, time_ns: int) -> None:
    """Run until two units after `time_ns`."""
    scheduler.run_for(max(0, time_ns + 2 * UNIT - scheduler.now))


class TestContract:
    """What every scheduler promises."""

    def test_events_fire_in_time_order(self, scheduler):
        """Events fire by ascending time, however they were entered."""
        base = unit_grid(scheduler)
        fired = []
        for step in (3, 1, 2, 0):
            scheduler.at(base + step * UNIT, lambda step=step: fired.append(step))
        run_past(scheduler, base + 3 * UNIT)
        assert fired == [0, 1, 2, 3]

    def test_an_event_never_fires_before_its_time(self, scheduler):
        """`now` inside a callback is at or after the due time; in virtual time it is exactly that."""
        base = unit_grid(scheduler)
        seen = []
        for step in range(5):
            scheduler.at(base + step * UNIT, lambda due=base + step * UNIT: seen.append((scheduler.now, due)))
        run_past(scheduler, base + 4 * UNIT)
        assert len(seen) == 5
        assert all(now >= due for now, due in seen)
        if not scheduler.realtime:
            assert all(now == due for now, due in seen)

    def test_same_instant_by_priority_then_entry(self, scheduler):
        """Events of one instant fire by ascending priority, then in the order of their entering."""
        base = unit_grid(scheduler)
        fired = []
        for name, priority in (("a", 0), ("b", 5), ("c", -10), ("d", 0), ("e", -10)):
            scheduler.at(base, lambda name=name: fired.append(name), priority=priority)
        run_past(scheduler, base)
        assert fired == ["c", "e", "a", "d", "b"]

    def test_an_urgent_event_entered_in_a_callback_overtakes_the_rest_of_the_instant(self, scheduler):
        """A callback can enter an event of the same instant, which takes its place among those that are
        left.
        """
        base = unit_grid(scheduler)
        fired = []

        def first():
            fired.append("first")
            if not scheduler.realtime:
                scheduler.at(scheduler.now, lambda: fired.append("urgent"), priority=-1)

        scheduler.at(base, first)
        scheduler.at(base, lambda: fired.append("second"))
        run_past(scheduler, base)
        assert fired == (["first", "second"] if scheduler.realtime else ["first", "urgent", "second"])

    def test_a_cancelled_event_does_not_fire(self, scheduler):
        """`cancel` withdraws an event, also from within another callback of the same instant."""
        base = unit_grid(scheduler)
        fired = []
        early = scheduler.at(base, lambda: fired.append("early"))
        late = scheduler.at(base + UNIT, lambda: fired.append("late"))
        scheduler.at(base + UNIT, late.cancel, priority=-1)
        early.cancel()
        early.cancel()
        run_past(scheduler, base + UNIT)
        assert fired == []

    def test_cancelling_a_fired_event_is_harmless(self, scheduler):
        """`cancel` after the firing does nothing."""
        fired = []
        timer = scheduler.after(0, lambda: fired.append(1))
        scheduler.run_for(UNIT)
        timer.cancel()
        scheduler.run_for(UNIT)
        assert fired == [1]

    def test_every_lies_on_the_grid_of_time_zero(self, scheduler):
        """Periodic events are due at k * period + phase, however late they are entered."""
        scheduler.run_for(UNIT // 3)
        entered = scheduler.now
        dues = []
        timer = scheduler.every(2 * UNIT, lambda: dues.append(timer.due_ns - 2 * UNIT), phase_ns=UNIT)
        scheduler.run_for(10 * UNIT)
        assert dues
        assert all(due % (2 * UNIT) == UNIT for due in dues)
        assert dues[0] >= entered
        if not scheduler.realtime:
            assert dues[0] < entered + 2 * UNIT
        assert dues == list(range(dues[0], dues[-1] + 1, 2 * UNIT))

    def test_every_stops_when_cancelled_by_itself(self, scheduler):
        """A periodic callback can end its own timer."""
        fired = []

        def tick():
            fired.append(scheduler.now)
            if len(fired) == 3:
                timer.cancel()

        timer = scheduler.every(UNIT, tick)
        scheduler.run_for(8 * UNIT)
        assert len(fired) == 3

    def test_periodic_events_keep_their_order_at_every_common_instant(self, scheduler):
        """Two periodic events of the same priority meet in the order of their entering, whatever their
        periods.
        """
        fired = []
        fast = scheduler.every(UNIT, lambda: fired.append(("fast", fast.due_ns - UNIT)))
        slow = scheduler.every(4 * UNIT, lambda: fired.append(("slow", slow.due_ns - 4 * UNIT)))
        scheduler.run_for(13 * UNIT)
        # the first instant of all may lie between the two entries in real time
        common = [due for name, due in fired if name == "slow" and ("fast", due) in fired]
        assert len(common) >= 3
        assert all(fired.index(("fast", due)) < fired.index(("slow", due)) for due in common)

    def test_run_until_asks_before_the_first_event(self, scheduler):
        """A predicate that is true from the start runs no event and takes no time."""
        fired = []
        scheduler.after(0, lambda: fired.append(1))
        assert scheduler.run_until(lambda: True, S)
        assert fired == []

    def test_run_until_finishes_the_instant(self, scheduler):
        """The predicate is evaluated after all events of an instant, and later ones stay in place."""
        base = unit_grid(scheduler)
        fired = []
        scheduler.at(base, lambda: fired.append("a"))
        scheduler.at(base, lambda: fired.append("b"))
        later = scheduler.at(base + 50 * UNIT, lambda: fired.append("later"))
        assert scheduler.run_until(lambda: "a" in fired, S)
        assert fired == ["a", "b"]
        assert base <= scheduler.now < later.due_ns
        assert scheduler.run_until(lambda: "later" in fired, S)

    def test_run_until_times_out(self, scheduler):
        """A predicate that stays false ends the run at the time-out and gives False."""
        start = scheduler.now
        assert not scheduler.run_until(lambda: False, 3 * UNIT)
        assert scheduler.now >= start + 3 * UNIT
        if not scheduler.realtime:
            assert scheduler.now == start + 3 * UNIT

    def test_run_for_includes_its_end(self):
        """Events at the very end of the duration belong to it, those one nanosecond later do not."""
        scheduler = VirtualScheduler()
        fired = []
        scheduler.at(UNIT, lambda: fired.append("end"))
        scheduler.at(UNIT + 1, lambda: fired.append("after"))
        scheduler.run_for(UNIT)
        assert fired == ["end"]
        assert scheduler.now == UNIT

    def test_post_runs_on_the_scheduler(self, scheduler):
        """Posted callbacks run at the next run, in their order."""
        fired = []
        scheduler.post(lambda: fired.append(1))
        scheduler.post(lambda: fired.append(2))
        assert fired == []
        assert scheduler.run_until(lambda: len(fired) == 2, S)
        assert fired == [1, 2]

    def test_waiting_inside_a_callback_is_refused(self, scheduler):
        """`run_until` and `run_for` in a callback raise, and the scheduler is usable afterwards."""
        scheduler.after(0, lambda: scheduler.run_for(UNIT))
        with pytest.raises(SchedulerError, match="already running: a callback must not wait"):
            scheduler.run_for(UNIT)
        assert not scheduler.running
        fired = []
        scheduler.after(UNIT, lambda: fired.append(scheduler.running))
        scheduler.run_for(2 * UNIT)
        assert fired == [True]
        assert not scheduler.running

    def test_an_exception_of_a_callback_comes_out_and_leaves_the_rest_in_place(self, scheduler):
        """The exception ends the run at once; everything that was still to come fires in the next one."""
        base = unit_grid(scheduler)
        fired = []

        def fail():
            fired.append("fail")
            raise ValueError("boom")

        scheduler.at(base, fail)
        scheduler.at(base, lambda: fired.append("same instant"))
        scheduler.at(base + UNIT, lambda: fired.append("later"))
        with pytest.raises(ValueError, match="boom"):
            run_past(scheduler, base + UNIT)
        assert fired == ["fail"]
        assert not scheduler.running
        run_past(scheduler, base + UNIT)
        assert fired == ["fail", "same instant", "later"]

    def test_a_periodic_event_survives_its_exception(self, scheduler):
        """A periodic callback that raises is called again at its next instant."""
        fired = []

        def tick():
            fired.append(timer.due_ns)
            if len(fired) == 1:
                raise ValueError("boom")

        timer = scheduler.every(UNIT, tick)
        with pytest.raises(ValueError, match="boom"):
            scheduler.run_for(S)
        assert scheduler.run_until(lambda: len(fired) == 3, S)
        assert [due - fired[0] for due in fired] == [0, UNIT, 2 * UNIT]

    @pytest.mark.parametrize(
        ("misuse", "message"),
        [
            (lambda s: s.after(-1, print), "delay -1 ns is negative"),
            (lambda s: s.every(0, print), "period 0 ns is not positive"),
            (lambda s: s.every(-5, print), "period -5 ns is not positive"),
            (lambda s: s.every(10, print, phase_ns=10), r"phase 10 ns is outside 0\.\.9 ns"),
            (lambda s: s.every(10, print, phase_ns=-1), r"phase -1 ns is outside 0\.\.9 ns"),
            (lambda s: s.run_for(-1), "duration -1 ns is negative"),
            (lambda s: s.run_until(lambda: False, -1), "timeout -1 ns is negative"),
        ],
    )
    def test_misuse_is_refused(self, scheduler, misuse, message):
        """Impossible times are refused at once, with the value, and leave the clock and the heap alone."""
        before = scheduler.now
        with pytest.raises(SchedulerError, match=message):
            misuse(scheduler)
        assert not scheduler.running
        if not scheduler.realtime:
            assert scheduler.now == before
        scheduler.run_for(0)


class TestVirtual:
    """What only simulated time can promise."""

    def test_starts_at_zero_and_jumps(self):
        """Simulated years pass as fast as their events allow, to the nanosecond."""
        scheduler = VirtualScheduler()
        assert scheduler.now == 0
        year = 365 * 86400 * S
        fired = []
        scheduler.at(year - 1, lambda: fired.append(scheduler.now))
        scheduler.run_for(year)
        assert fired == [year - 1]
        assert scheduler.now == year

    def test_an_event_in_the_past_is_refused(self):
        """The past cannot be changed; the present instant can."""
        scheduler = VirtualScheduler()
        scheduler.run_for(100)
        with pytest.raises(
            SchedulerError, match="event at 99 ns is before the present time 100 ns"
        ) as caught:
            scheduler.at(99, print)
        assert isinstance(caught.value, HilError)
        fired = []
        scheduler.at(100, lambda: fired.append(scheduler.now))
        scheduler.run_for(0)
        assert fired == [100]

    def test_predicate_stops_at_the_instant(self):
        """After success `now` is the instant that made the predicate true."""
        scheduler = VirtualScheduler()
        ticks = []
        scheduler.every(7, lambda: ticks.append(scheduler.now))
        assert scheduler.run_until(lambda: len(ticks) == 4, 1000)
        assert ticks == [0, 7, 14, 21]
        assert scheduler.now == 21

    def test_splitting_a_run_changes_nothing(self):
        """One long run and many short ones fire the same events at the same times."""

        def run(pieces):
            scheduler = VirtualScheduler()
            log = []
            scheduler.every(3, lambda: log.append(("three", scheduler.now)))
            scheduler.every(5, lambda: log.append(("five", scheduler.now)), phase_ns=1)
            scheduler.every(4, lambda: scheduler.after(2, lambda: log.append(("child", scheduler.now))))
            for piece in pieces:
                scheduler.run_for(piece)
            return log

        assert run([60]) == run([1] * 60) == run([0, 7, 13, 0, 40])

    def test_joining_at_a_grid_instant_fires_there(self):
        """`every` entered exactly on its grid fires at that instant already."""
        scheduler = VirtualScheduler()
        scheduler.run_for(20)
        fired = []
        scheduler.every(10, lambda: fired.append(scheduler.now))
        scheduler.run_for(10)
        assert fired == [20, 30]


class TestRealtime:
    """What real time adds."""

    def test_waiting_uses_no_processor_time(self):
        """While nothing is due the thread sleeps instead of polling."""
        scheduler = RealtimeScheduler()
        scheduler.after(10 * S, print)
        before = time.thread_time()
        scheduler.run_for(200 * MS)
        assert time.thread_time() - before < 0.1

    def test_post_from_a_thread_wakes_the_wait(self):
        """Work that another thread posts is done at once, not when the time-out ends."""
        scheduler = RealtimeScheduler()
        runners = []
        thread = threading.Timer(
            0.02, lambda: scheduler.post(lambda: runners.append(threading.current_thread()))
        )
        thread.start()
        assert scheduler.run_until(lambda: runners, 60 * S)
        thread.join()
        assert scheduler.now < 30 * S
        assert runners == [threading.current_thread()]

    def test_posts_of_many_threads_all_arrive_in_the_order_of_each(self):
        """No post is lost, and those of one thread keep their order."""
        scheduler = RealtimeScheduler()
        got = []

        def feed(thread):
            for number in range(200):
                scheduler.post(lambda item=(thread, number): got.append(item))

        threads = [threading.Thread(target=feed, args=(index,)) for index in range(4)]
        for thread in threads:
            thread.start()
        assert scheduler.run_until(lambda: len(got) == 800, 60 * S)
        for thread in threads:
            thread.join()
        for index in range(4):
            assert [number for thread, number in got if thread == index] == list(range(200))

    def test_a_flood_of_posts_neither_starves_the_timers_nor_the_time_out(self):
        """Work that posts itself again and again leaves room for timed events, and the run ends on time."""
        scheduler = RealtimeScheduler()
        flooding = [True]

        def again():
            if flooding[0]:
                scheduler.post(again)

        again()
        fired = []
        scheduler.after(5 * MS, lambda: fired.append(1))
        guard = threading.Timer(30, lambda: flooding.__setitem__(0, False))
        guard.start()
        assert not scheduler.run_until(lambda: False, 20 * MS)
        flooded_to_the_end = flooding[0]
        guard.cancel()
        assert flooded_to_the_end
        assert fired == [1]

    def test_lateness_is_recorded(self):
        """`worst_lateness_ns` shows how far an event came behind its time."""
        scheduler = RealtimeScheduler()
        base = unit_grid(scheduler)
        scheduler.at(base, lambda: time.sleep(0.02))
        scheduler.at(base + 5 * MS, lambda: None)
        scheduler.run_for(50 * MS)
        assert scheduler.worst_lateness_ns >= 14 * MS

    def test_falling_behind_skips_no_instant(self):
        """After a stall the missed instants of a grid are made up for, in order."""
        scheduler = RealtimeScheduler()
        dues = []
        timer = scheduler.every(MS, lambda: dues.append(timer.due_ns))
        scheduler.after(5 * MS, lambda: time.sleep(0.02))
        scheduler.run_for(40 * MS)
        assert dues == list(range(dues[0], dues[0] + len(dues) * MS, MS))
        assert len(dues) >= 40

    def test_now_is_ascending(self):
        """`now` never goes back, across timed events, posts and runs."""
        scheduler = RealtimeScheduler()
        seen = []
        scheduler.every(MS, lambda: seen.append(scheduler.now))
        scheduler.every(MS, lambda: scheduler.post(lambda: seen.append(scheduler.now)), phase_ns=300 * US)
        for _ in range(4):
            scheduler.run_for(5 * MS)
            seen.append(scheduler.now)
        assert seen == sorted(seen)

    def test_a_delay_starts_when_it_is_entered(self):
        """Time that passes between two runs does not count into a delay entered after it."""
        scheduler = RealtimeScheduler()
        scheduler.run_for(0)
        time.sleep(0.03)
        entered = time.monotonic_ns() - scheduler.origin_ns
        fired = []
        scheduler.after(10 * MS, lambda: fired.append(scheduler.now))
        grid = scheduler.every(MS, lambda: None)
        assert grid.due_ns >= entered
        assert scheduler.run_until(lambda: fired, S)
        assert fired[0] >= entered + 10 * MS

    def test_an_event_in_the_past_fires_at_once(self):
        """In real time the past is no error: a peer's clock may be ahead of ours."""
        scheduler = RealtimeScheduler()
        scheduler.run_for(2 * MS)
        fired = []
        scheduler.at(MS, lambda: fired.append(scheduler.now))
        assert scheduler.run_until(lambda: fired, 10 * S)
        assert fired[0] >= 2 * MS

    def test_a_shared_origin_shares_the_time_base(self):
        """Two schedulers with the same origin agree about the time."""
        origin = time.monotonic_ns() - 5 * S
        first = RealtimeScheduler(origin)
        second = RealtimeScheduler(origin)
        assert 5 * S <= first.now <= second.now <= time.monotonic_ns() - origin


@pytest.mark.parametrize(
    ("seconds", "ns"), [(0.0, 0), (1e-9, 1), (0.001, MS), (2.5, 2_500_000_000), (0.1 + 0.2, 300 * MS)]
)
def test_seconds_to_ns(seconds, ns):
    """Seconds become the nearest whole nanosecond."""
    assert seconds_to_ns(seconds) == ns


def test_an_event_entered_again_by_itself_keeps_the_order_of_events():
    """What is entered behind it goes before it where it is earlier, or has a lower priority at the same
    instant; a run that ends before it, and an error, leave it for the next run.
    """
    scheduler = VirtualScheduler()
    fired = []

    def enter(name, time_ns, priority=0):
        scheduler.at(time_ns, lambda: fired.append((name, scheduler.now)), priority=priority)

    def fire():
        fired.append(("itself", scheduler.now))
        if scheduler.now == 10:
            scheduler.again(timer, 20)
            enter("behind", 20)
            enter("in front", 20, -1)
            enter("earlier", 15)
        elif scheduler.now < 50:
            scheduler.again(timer, scheduler.now + 15)

    timer = scheduler.at(10, fire)
    enter("last", 1000)
    scheduler.run_for(30)
    assert fired == [("itself", 10), ("earlier", 15), ("in front", 20), ("itself", 20), ("behind", 20)]
    assert scheduler.next_due_ns == 35
    fired.clear()
    scheduler.at(40, lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        scheduler.run_for(100)
    assert scheduler.next_due_ns == 50
    timer.cancel()
    scheduler.run_for(1000)
    assert fired == [("itself", 35), ("last", 1000)]


def test_an_event_that_has_fired_can_be_entered_again():
    """A handle that has fired serves again, fires behind what was entered before it, and can be cancelled."""
    scheduler = VirtualScheduler()
    fired: list[tuple[str, int]] = []
    timer = scheduler.at(10, lambda: fired.append(("again", scheduler.now)))
    scheduler.run_for(10)
    scheduler.at(30, lambda: fired.append(("other", scheduler.now)))
    scheduler.again(timer, 30)
    assert timer.due_ns == 30
    scheduler.run_for(30)
    scheduler.again(timer, 50)
    timer.cancel()
    scheduler.run_for(30)
    assert fired == [("again", 10), ("other", 30), ("again", 30)]
