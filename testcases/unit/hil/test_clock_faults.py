"""A node whose clock runs fast, slow or unevenly: what its partners see of it on the bus, and what its motion
makes of it.
"""

from __future__ import annotations

import numpy as np
import pytest

from hil.bench import load_bench
from hil.faults import Injector

FAST = 20_000.0
"""Two per cent, so that it shows within tenths of a second."""


@pytest.fixture
def bench():
    with load_bench("reference").build(seed=5) as bench:
        assert bench.run_until(bench.axis().power().status, 2.0)
        yield bench


def sent(bench, name, since_s):
    """Return the times of a message, s."""
    wanted = bench.cob_ids("drive1")[name]
    return (
        np.array(
            [
                time
                for time, _, frame, _ in bench.segment().log
                if frame.can_id == wanted and time > since_s * 1e9
            ]
        )
        / 1e9
    )


@pytest.mark.exhaustive
def test_heartbeats_come_by_the_clock_of_the_drive(bench):
    """Two per cent early while the fault acts, in the old distance afterwards, and the axis goes on all the
    time.
    """
    period = 0.1
    begin = bench.now_s
    fault = Injector(bench).inject("drive.clock_drift", drift_ppm=FAST)
    bench.run_for(0.75)
    fault.remove()
    middle = bench.now_s
    bench.run_for(0.6)
    during, after = (
        np.diff(sent(bench, "heartbeat", begin + 0.11)),
        np.diff(sent(bench, "heartbeat", middle + 0.11)),
    )
    period = after[0]
    assert during[:4] == pytest.approx(period / (1.0 + FAST * 1e-6), abs=300e-6)
    assert after == pytest.approx(period, abs=300e-6)
    assert not any(event.kind == "alarm.raised" for event in bench.history.events)


@pytest.mark.exhaustive
@pytest.mark.parametrize("ppm", [FAST, -FAST])
def test_a_ramp_of_the_drive_takes_its_own_time(ppm):
    """Quick stop from 300 mm/s at the 0.5 s per 500 mm/s of OFF3: by the clock of the drive, seen by that of
    the bench.
    """
    times = []
    for drift in (0.0, ppm):
        with load_bench("reference").build(seed=5) as bench:
            axis = bench.axis()
            power = axis.power()
            assert bench.run_until(power.status, 2.0)
            assert bench.run_until(axis.move_velocity(300.0).in_velocity, 2.0)
            bench.run_for(0.1)
            Injector(bench).inject("drive.clock_drift", drift_ppm=drift)
            # The controller has stopped: the ramp is that of the drive.
            Injector(bench).inject("drive.ss1")
            begin = bench.now_s
            mechanics = bench.drive().mechanics
            assert bench.run_until(lambda mechanics=mechanics: abs(mechanics.velocity) < 1e-4, 2.0)
            times.append(bench.now_s - begin)
    assert times[0] == pytest.approx(0.3, abs=0.02)
    assert times[1] == pytest.approx(times[0] / (1.0 + ppm * 1e-6), abs=0.002)


def test_the_grid_of_the_drive_slides_along_that_of_the_bus(bench):
    """Control cycles of the drive lie at another phase of SYNC in every cycle, and stand still again at the
    end, apart from before.
    """
    drive = bench.drive()
    cycles = []
    sample = drive.core.step
    assert sample is not None
    clock = drive.scheduler
    clock.every(1_000_000, lambda: cycles.append(bench.scheduler.now))
    bench.run_for(0.01)
    fault = Injector(bench).inject("drive.clock_drift", drift_ppm=500.0)
    bench.run_for(0.4)
    fault.remove()
    bench.run_for(0.05)
    phases = np.array(cycles) % 1_000_000
    assert set(phases[:5]) == {0}
    early = (1_000_000 - phases[-1]) % 1_000_000
    assert early == pytest.approx(0.4 * 500e3, abs=600)
    assert np.ptp(phases[-20:]) <= 20
    assert clock.now - bench.scheduler.now == pytest.approx(0.4 * 500e3, abs=2)


def test_what_the_drive_measures_is_in_its_own_time():
    """A drive that is two per cent fast regulates the speed that it measures: by the clock of the others it
    is two per cent more.
    """
    with load_bench("speed").build(seed=5) as bench:
        axis = bench.axis()
        assert bench.run_until(axis.power().status, 2.0)
        axis.move_velocity(100.0)
        bench.run_for(0.6)
        mechanics = bench.drive().mechanics

        def measured():
            begin = mechanics.position
            bench.run_for(0.2)
            return (mechanics.position - begin) / 0.2

        before = measured()
        Injector(bench).inject("drive.clock_drift", drift_ppm=FAST)
        bench.run_for(0.2)
        assert measured() / before == pytest.approx(1.0 + FAST * 1e-6, rel=1e-3)


@pytest.mark.exhaustive
def test_uneven_cycles_are_repeatable_and_end(bench):
    """The same seed gives the same run; afterwards the cycles are even again, and nothing was alarmed."""

    def run():
        with load_bench("reference").build(seed=5) as own:
            axis = own.axis()
            assert own.run_until(axis.power().status, 2.0)
            axis.move_velocity(100.0)
            Injector(own).inject("drive.clock_jitter", jitter_us=100.0, duration_s=0.2)
            own.run_for(0.3)
            assert not any(event.kind == "alarm.raised" for event in own.history.events)
            return own.trace().digest()

    assert run() == run()
