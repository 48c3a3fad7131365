"""Faults of coupling, guides and clock on a bench: what they do to the machine, and what the controller sees
of it.
"""

from dataclasses import replace

import numpy as np
import pytest

from hil.bench import load_bench
from hil.faults import Injector


def machine(fault, *, velocity=0.0, after_s=0.3, gravity_n=0.0, **options):
    """Return the trace of an enabled axis to which a fault happens at about 0.5 s, and that time."""
    file = load_bench("reference")
    if gravity_n:
        section = file.config.drive["drive1"]
        heavy = replace(section.mechanics, gravity_n=gravity_n)
        drives = {"drive1": section.model_copy(update={"mechanics": heavy})}
        file.config = file.config.model_copy(update={"drive": drives})
    with file.build() as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        if velocity:
            axis.move_velocity(velocity)
        bench.run_for(0.5)
        when = bench.now_s
        Injector(bench).inject(fault, **options)
        bench.run_for(after_s)
        return bench.trace(), when


def change(trace, name, when, after=0.2):
    return trace[name].at(when + after) - trace[name].at(when - 0.004)


def test_a_coupling_that_slips_moves_the_load_and_shows_to_nobody():
    """The load is displaced by half a screw pitch; encoder, axis and motor see nothing, not even for a
    moment.
    """
    trace, when = machine("mechanics.slip", revolutions=-0.5)
    assert change(trace, "drive1.position", when) == pytest.approx(-0.005, abs=1e-6)
    assert change(trace, "axis1.actual_position", when) == pytest.approx(0.0, abs=1e-4)
    assert np.abs(trace["axis1.actual_velocity"].between(when, trace.end_s).values).max() < 0.5
    assert trace["axis1.alarm_number"].at(trace.end_s) == 0


def test_a_slip_in_motion_adds_to_the_way_of_the_load():
    """In motion the load goes on with its velocity from another place."""
    trace, when = machine("mechanics.slip", velocity=100.0, revolutions=2.0)
    moved = change(trace, "axis1.actual_position", when)
    assert moved == pytest.approx(20.4, abs=0.5)
    assert change(trace, "drive1.position", when) * 1000.0 == pytest.approx(moved + 20.0, abs=0.01)


@pytest.mark.exhaustive
def test_a_broken_coupling_leaves_the_load_to_itself():
    """The motor goes on as commanded with less torque; the load coasts with what it has and comes to rest by
    friction.
    """
    trace, when = machine("mechanics.coupling_break", velocity=200.0, after_s=0.5, motor_share=0.4)
    assert trace["axis1.actual_velocity"].at(trace.end_s) == pytest.approx(200.0, abs=1.0)
    load = trace["drive1.velocity"].between(when, trace.end_s).values
    assert load[0] == pytest.approx(0.2, abs=0.002)
    assert load[-1] < load[0] - 0.001, "friction brakes it"
    assert np.all(np.diff(load) <= 1e-12), "nothing drives it any more"
    assert trace["drive1.motor_speed"].at(trace.end_s) == pytest.approx(1200.0, abs=6.0)


@pytest.mark.exhaustive
def test_a_hanging_load_falls_when_its_coupling_breaks():
    """The axis stands still for its controller while the load falls with the acceleration of its own
    inertia.
    """
    trace, when = machine("mechanics.coupling_break", gravity_n=-200.0, after_s=0.2)
    assert change(trace, "drive1.position", when, 0.19) < -0.005
    fall = trace["drive1.velocity"].between(when + 0.05, when + 0.15)
    slopes = np.diff(fall.values) / np.diff(fall.time_s)
    assert slopes.max() < 0.0
    assert abs(change(trace, "axis1.actual_position", when, 0.19)) < 0.05


@pytest.mark.exhaustive
def test_more_friction_costs_torque_and_goes_again():
    """Friction of 250 N at a screw of 10 mm costs 0.4 Nm at constant velocity, and is gone at the end."""
    trace, when = machine("mechanics.friction", velocity=100.0, after_s=0.6, duration_s=0.3, force_N=250.0)
    before, during, later = (trace["drive1.torque"].at(when + at) for at in (-0.004, 0.28, 0.58))
    assert during - before == pytest.approx(250.0 * 0.010 / (2.0 * np.pi), rel=0.02)
    assert later == pytest.approx(before, abs=0.01)


@pytest.mark.exhaustive
def test_jitter_of_sync_is_random_bounded_and_repeatable():
    """Every SYNC comes 0 to 0.5 ms late, evenly, each by its own time; the same seed gives the same times."""

    def lateness():
        trace, when = machine("frame.jitter", after_s=0.8, message="sync", jitter_s=0.0005)
        times = np.array([t for t, _, f, _ in trace.raw_frames("can0") if f.can_id == 0x80])
        phase = times % 4_000_000
        quiet = phase[(times > 0.2e9) & (times < when * 1e9)]
        return phase[times > when * 1e9 + 4_000_000] - np.median(quiet)

    late = lateness()
    assert len(late) > 150
    assert late.min() >= -2_000
    assert late.max() <= 500_000 + 300_000, "and once more the length of a frame that is in the way"
    assert 180_000 < late.mean() < 320_000
    assert late.std() > 100_000
    assert np.array_equal(late, lateness())


@pytest.mark.exhaustive
def test_a_clock_that_drifts_makes_sync_later_and_later():
    """At 1000 ppm a SYNC comes 1 us later for every ms since the first; the axis goes on."""
    trace, when = machine("frame.drift", after_s=0.8, message="sync", drift_ppm=1000.0)
    times = np.array([t for t, _, f, _ in trace.raw_frames("can0") if f.can_id == 0x80])
    late = times[times > when * 1e9]
    steps = np.diff(late)
    assert np.median(steps) == pytest.approx(4_004_000, abs=1_000)
    assert late[-1] - late[0] == pytest.approx((len(late) - 1) * 4_004_000, abs=300_000)
    assert trace["axis1.alarm_number"].at(trace.end_s) == 0


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-511")
def test_a_slow_interpolator_switches_off_behind_its_setpoint(new_bench):
    """The emergency ramp of a jammed axis ends at once: ON goes with the setpoint of the next call of the
    interpolator, not before it.
    """
    with new_bench(tables={"bench": {"interpolator_ms": 12}}) as bench:
        axis = bench.axis()
        bench.wait_until(axis.power().status, 2.0)
        bench.wait_until(axis.move_velocity(200.0).in_velocity, 2.0)
        Injector(bench).inject("mechanics.jam", bench.drive().name)
        bench.run_for(0.02)
        Injector(bench).inject("axis.alarm", axis.name, number=304, reaction=3)
        bench.run_for(0.1)
        trace = bench.trace()
        stw1 = trace[f"{axis.name}.stw1"].values.astype(int)
        off = int(np.flatnonzero(stw1 == 0x047E)[-1])
        while stw1[off - 1] == 0x047E:
            off -= 1
        assert stw1[off - 1] == 0x047F
        assert trace[f"{axis.name}.velocity_setpoint"].values[off] == 0.0
