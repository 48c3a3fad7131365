"""The clock of a node on top of that of the bench: two times, events that stay due, cycles that come late."""

from __future__ import annotations

import numpy as np
import pytest

from fieldbus.clock import MS, US, S, VirtualScheduler
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.node_clock import NodeClock, own_clock


@pytest.fixture
def bench():
    return VirtualScheduler()


@pytest.fixture
def clock(bench):
    return NodeClock(bench, lambda: np.random.default_rng(3))


def test_without_drift_it_is_the_bench(bench, clock):
    """Times are equal, and events of one instant keep the order in which they were entered on either."""
    seen = []
    bench.at(MS, lambda: seen.append(1))
    clock.at(MS, lambda: seen.append(2))
    bench.after(MS, lambda: seen.append(3))
    clock.after(MS, lambda: seen.append(4))
    bench.run_for(2 * MS)
    assert seen == [1, 2, 3, 4]
    assert clock.now == bench.now == 2 * MS


@pytest.mark.parametrize("ppm", [100_000.0, 200.0, 0.1, -0.1, -200.0, -100_000.0])
def test_a_delay_is_one_of_the_nodes_time(bench, clock, ppm):
    """What is entered for a time of the node fires in the first nanosecond in which its clock shows that
    time.
    """
    bench.run_for(7 * MS + 1)
    clock.drift(ppm)
    seen = []
    for delay in (1, 999, MS, 123_456_789):
        due = clock.now + delay
        clock.at(due, lambda due=due: seen.append((due, clock.now)))
    bench.run_for(S)
    assert len(seen) == 4
    assert all(due <= shown <= due + 1 for due, shown in seen)
    assert clock.now - bench.now == pytest.approx(ppm * 1e3, abs=2)


def test_what_is_entered_stays_due_at_its_time(bench, clock):
    """A change of pace moves events that wait, single and periodic ones, and back; the clock is not set."""
    single, cycles = [], []
    clock.at(10 * MS, lambda: single.append(bench.now))
    timer = clock.every(MS, lambda: cycles.append(bench.now))
    bench.run_for(4 * MS)
    clock.drift(100_000.0)  # ten per cent fast
    bench.run_for(MS)
    clock.drift(0.0)
    assert clock.now == bench.now + 100 * US
    bench.run_for(10 * MS)
    assert single == [10 * MS - 100 * US]
    assert cycles[:5] == [0, MS, 2 * MS, 3 * MS, 4 * MS]
    assert cycles[5] == pytest.approx(4 * MS + MS / 1.1, abs=2)
    assert cycles[7] - cycles[6] == pytest.approx(MS, abs=1)
    assert timer.period_ns == pytest.approx(MS, abs=1)


def test_a_cancelled_event_stays_cancelled(bench, clock):
    """Also when the clock changes its pace in between; one that is entered again is moved too."""
    seen = []
    gone = clock.after(MS, lambda: seen.append("gone"))
    again = clock.after(MS, lambda: seen.append(bench.now))
    bench.run_for(MS)
    gone.cancel()
    clock.again(again, clock.now + MS)
    clock.drift(-100_000.0)
    bench.run_for(5 * MS)
    assert seen[-1] == pytest.approx(MS + MS / 0.9, abs=2)


def test_frames_are_heard_by_the_nodes_clock(bench, clock):
    """A receiver gets the time that its own clock shows."""
    heard = []
    receive = clock.to_local_time(lambda frame, time_ns: heard.append((frame, time_ns)))
    receive("a", bench.now)
    clock.drift(1000.0)
    bench.run_for(S)
    receive("b", bench.now)
    assert heard == [("a", 0), ("b", S + MS)]


def test_jitter_is_late_bounded_and_repeatable(bench, clock):
    """Cycles begin up to the given time late, each by its own, from the stream; the grid stays, and so does
    what was cancelled.
    """

    def lateness():
        scheduler = VirtualScheduler()
        node = NodeClock(scheduler, lambda: np.random.default_rng(3))
        seen = []
        timer = node.every(MS, lambda: seen.append(scheduler.now))
        scheduler.run_for(MS)
        node.jitter(100 * US)
        scheduler.run_for(200 * MS)
        node.jitter(0)
        scheduler.run_for(5 * MS)
        timer.cancel()
        scheduler.run_for(5 * MS)
        assert len(seen) == 207
        return [time - number * MS for number, time in enumerate(seen)]

    late = lateness()
    assert late[:2] == [0, 0]
    assert late[-4:] == [0, 0, 0, 0]
    assert max(late) <= 100 * US
    assert min(late) >= 0
    assert np.std(late) > 20 * US
    assert late == lateness()


def test_what_is_no_pace_is_refused(clock):
    """Values beyond the limits are refused with the limits; a device on the time of the bench has no clock
    of its own.
    """
    with pytest.raises(
        ConfigurationError, match="drift: 100001 is not allowed; allowed: a number within 100000 ppm"
    ):
        clock.drift(100_001)
    with pytest.raises(ConfigurationError, match="jitter: -1"):
        clock.jitter(-1)

    with pytest.raises(UnsupportedFaultError, match="device has no clock of its own"):
        own_clock(VirtualScheduler(), "device")
