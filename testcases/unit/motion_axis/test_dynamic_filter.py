"""The dynamic filter of the setpoints (§5.13.6)."""

from __future__ import annotations

from math import exp, pi, sqrt
from types import SimpleNamespace

import numpy as np
import pytest

from motion.kernel.setpoint_filter import DynamicFilter
from testcases.unit.motion_axis.conftest import CYCLE, REFERENCE, Rig
from testcases.unit.motion_axis.lagging_drive import LaggingDrivePort

LOOSE = {"FollowingError.EnableMonitoring": False}
PREFIX = "SetpointFilter.DynamicFilter."


def times(mode, t1=0.0, t2=0.0, tt=0.0):
    return {f"{PREFIX}Mode": mode, f"{PREFIX}T1": t1, f"{PREFIX}T2": t2, f"{PREFIX}Tt": tt}


def filtering(mode, t1=0.0, t2=0.0, tt=0.0, cycle_s=CYCLE):
    cells = tuple(SimpleNamespace(value=value) for value in (t1, t2, tt))
    return DynamicFilter(mode, cells, cycle_s=cycle_s), cells


def step_response(mode, t1=0.0, t2=0.0, tt=0.0, *, cycles=400):
    """Return the position behind the filter for a step from 0 to 1 in the first cycle."""
    one, _ = filtering(mode, t1, t2, tt)
    one.reset(0.0)
    return np.array([one.step(1.0, 0.0)[0] for _ in range(cycles)])


# -- the elements
# -----------------------------------------------------------------------------------------------


@pytest.mark.requirement("CTL-073", "CTL-065", "CTL-066")
@pytest.mark.parametrize("t1", [0.02, 0.1])
def test_low_pass_reaches_63_percent(t1):
    """63.2 % of a step within one cycle of t = T1; T2 alone does the same."""
    response = step_response(1, t1)
    at = int(np.argmax(response >= 1.0 - exp(-1.0)))
    assert abs((at + 1) * CYCLE - t1) <= CYCLE * 1.001
    assert np.array_equal(response, step_response(1, 0.0, t1))


@pytest.mark.requirement("CTL-072", "CTL-067")
@pytest.mark.parametrize(("t1", "t2"), [(0.001, 0.004), (0.03, 0.03), (0.01, 0.2)])
def test_two_low_passes_never_overshoot(t1, t2):
    """D = (T1 + T2) / (2 sqrt(T1 T2)) >= 1; the answer to a ramp is that of the two poles in series."""
    response = step_response(1, t1, t2)
    assert (np.diff(response) >= -1e-12).all()
    assert response[-1] == pytest.approx(1.0, abs=1e-3)
    one, _ = filtering(1, t1, t2)
    one.reset(0.0)
    ramp = [one.step(k * CYCLE, 1.0)[0] for k in range(1, 200)]
    t = CYCLE * np.arange(1, 200)
    if t1 == t2:
        exact = t - 2 * t1 + (t + 2 * t1) * np.exp(-t / t1)
    else:
        exact = t - t1 - t2 + (t1**2 * np.exp(-t / t1) - t2**2 * np.exp(-t / t2)) / (t1 - t2)
    # The second element gets the output of the first in samples, so that it sees its curvature only in part.
    assert ramp == pytest.approx(exact, abs=0.3 * CYCLE)
    assert sqrt(t1 * t2) * (1.0 / t1 + 1.0 / t2) / 2.0 >= 1.0


@pytest.mark.requirement("CTL-075", "CTL-076", "CTL-065", "VAR-186")
@pytest.mark.parametrize(
    ("t1", "expected"),
    [
        (0.012, [0.25, 0.5, 0.75, 1.0, 1.0]),
        (0.013, [1 / 4.25, 2 / 4.25, 3 / 4.25, 4 / 4.25, 1.0]),
        (0.004, [0.5, 1.0, 1.0]),
        (0.002, [1 / 1.5, 1.0]),
    ],
)
def test_moving_average(t1, expected):
    """T1 = 12 ms of 4 ms: the present value and the last three; 13 ms: the fourth-last with a quarter."""
    assert step_response(2, t1)[: len(expected)] == pytest.approx(expected, abs=1e-12)


@pytest.mark.requirement("CTL-067", "CTL-066", "CTL-069", "CTL-070", "CTL-071")
def test_elements_in_series():
    """Two averages are one after the other; a dead time comes on top, for low-passes too."""
    once = step_response(2, 0.012, cycles=30)
    weights = np.full(3, 1 / 3)
    twice = np.convolve(once, weights)[:30]
    twice[0:2] = [once[0] / 3, (once[0] + once[1]) / 3]
    assert step_response(2, 0.012, 0.008, cycles=30) == pytest.approx(twice, abs=1e-12)
    assert np.array_equal(step_response(2, 0.012, cycles=30), step_response(2, 0.0, 0.012, cycles=30))
    for mode, t1, t2 in (
        (1, 0.02, 0.0),
        (1, 0.0, 0.02),
        (1, 0.02, 0.01),
        (2, 0.012, 0.0),
        (2, 0.0, 0.012),
        (2, 0.012, 0.008),
    ):
        plain, late = step_response(mode, t1, t2, cycles=60), step_response(mode, t1, t2, 0.012, cycles=60)
        assert late[:3] == pytest.approx([0.0] * 3, abs=1e-12)
        assert late[3:] == pytest.approx(plain[:-3], abs=1e-12)


@pytest.mark.requirement("CTL-068", "MON-032")
@pytest.mark.parametrize("mode", [1, 2])
@pytest.mark.parametrize("tt", [0.004, 0.006, 0.0, 0.05])
def test_dead_time_alone_is_exact(mode, tt):
    """A ramp comes later by exactly Tt, whole cycles or not."""
    one, _ = filtering(mode, tt=tt)
    one.reset(0.0)
    for k in range(1, 100):
        position, velocity = one.step(k * CYCLE, 1.0)
    assert position == pytest.approx(99 * CYCLE - tt, abs=1e-12)
    assert velocity == 1.0


@pytest.mark.requirement("CTL-074", "CTL-077")
@pytest.mark.parametrize(
    ("mode", "t1", "t2", "tt"),
    [
        (1, 0.002, 0.0, 0.0),
        (1, 0.02, 0.03, 0.01),
        (2, 0.012, 0.0, 0.0),
        (2, 0.012, 0.02, 0.007),
        (2, 0.0, 0.0, 0.003),
    ],
)
def test_effective_delay(mode, t1, t2, tt):
    """At constant velocity: the sum of the times with low-passes, half of T1 and T2 with averages over whole
    cycles.
    """
    one, _ = filtering(mode, t1, t2, tt)
    one.reset(0.0)
    for k in range(1, 400):
        position, _ = one.step(k * CYCLE * 100.0, 100.0)
    expected = t1 + t2 + tt if mode == 1 else 0.5 * (t1 + t2) + tt
    assert (399 * CYCLE * 100.0 - position) / 100.0 == pytest.approx(expected, abs=1e-9)
    assert one.delay_s == pytest.approx(expected, abs=1e-12)


@pytest.mark.requirement("CTL-078", "CTL-079", "VAR-185")
def test_windows_are_limited():
    """16 servo cycles: all times with averages, the dead time only with low-passes; 43.5 ms of 2 ms act as 32
    ms.
    """
    one, _ = filtering(2, 0.0435, 0.0, 0.0, cycle_s=0.002)
    assert one.delay_s == pytest.approx(0.5 * 0.032)
    one, _ = filtering(2, 1.0, 1.0, 1.0)
    assert one.delay_s == pytest.approx(2 * 0.5 * 16 * CYCLE + 16 * CYCLE)
    one, _ = filtering(1, 1.0, 2.0, 3.0)
    assert one.delay_s == pytest.approx(3.0 + 16 * CYCLE)


@pytest.mark.requirement("CTL-021", "CTL-064", "CTL-062", "VAR-185")
@pytest.mark.parametrize("mode", [1, 2])
def test_times_change_at_run_time(mode):
    """Without a time nothing is filtered; one that is written later acts from the next cycle on."""
    one, cells = filtering(mode)
    one.reset(0.0)
    assert [one.step(float(k), 250.0)[0] for k in range(1, 10)] == [float(k) for k in range(1, 10)]
    cells[2].value = 2 * CYCLE
    assert one.step(10.0, 250.0)[0] == pytest.approx(8.0)


# -- the axis
# -----------------------------------------------------------------------------------------------------


@pytest.mark.requirement("CTL-061", "CTL-022", "CTL-020", "CTL-060")
@pytest.mark.parametrize(("mode", "delay"), [(1, 0.02), (2, 0.012)])
def test_the_axis_follows_the_filtered_setpoint(mode, delay):
    """Position stays unfiltered, PositionAfterDynamicFilter comes later, and the axis with it."""
    rig = Rig(variables=times(mode, 0.02 if mode == 1 else 0.024) | LOOSE).travelling(100.0)
    behind = rig.axis.var("Position") - rig.axis.var("StatusServo.PositionAfterDynamicFilter")
    assert behind == pytest.approx(100.0 * delay, abs=1e-2)
    assert rig.axis.var("Position") - rig.axis.var("ActualPosition") == pytest.approx(
        100.0 * (delay + CYCLE), abs=1e-2
    )
    halt = rig.axis.halt()
    rig.until(halt.done)
    assert rig.axis.var("ActualPosition") == pytest.approx(rig.axis.var("Position"), abs=0.1)


@pytest.mark.requirement("MON-037", "CTL-084", "MON-009", "VAR-187")
@pytest.mark.parametrize(("additional", "error"), [(0.0, 0.2), (0.002, 0.0)])
def test_delay_of_the_filter_in_the_following_error(additional, error):
    """PT1 with 2 ms at 100 mm/s adds 0.2 mm, unless AdditionalSetpointDelayTime takes it out."""
    own = times(1, 0.002) | LOOSE | {"FollowingError.AdditionalSetpointDelayTime": additional}
    rig = Rig(variables=own).travelling(100.0)
    rig.run(0.5)
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(error, abs=1e-3)


@pytest.mark.requirement("CTL-060", "CFG-149")
@pytest.mark.parametrize("kind", ["VirtualAxis.Mode", "Simulation.Mode"])
def test_virtual_and_simulated_axes_are_filtered_too(kind):
    """Actual values of a virtual axis are the filtered setpoints, one cycle later, which is two behind the
    interpolator; with every further setting they stay so.
    """
    plain = Rig(variables={kind: 1} | LOOSE)
    filtered = Rig(variables={kind: 1} | times(1, 0.02) | LOOSE)
    for rig in (plain, filtered):
        rig.enabled()
        rig.until(rig.axis.move_relative(30.0, Jerk=0.0).done)
        rig.run(0.3)
    assert filtered.axis.var("ActualPosition") == pytest.approx(30.0, abs=1e-3)
    if kind == "VirtualAxis.Mode":
        positions = np.array(filtered.column("position_setpoint"))
        one, _ = filtering(1, 0.02)
        one.reset(0.0)
        expected = [one.step(position, 0.0)[0] for position in positions]
        assert filtered.column("actual_position")[2:] == pytest.approx(expected[:-2], abs=1e-9)
    assert not np.allclose(
        plain.column("actual_position")[:150], filtered.column("actual_position")[:150], atol=0.1
    )


@pytest.mark.requirement("CTL-062", "STP-123")
@pytest.mark.parametrize("mode", [1, 2])
def test_an_emergency_ramp_starts_without_a_step(mode):
    """The setpoint that is taken from the actual values is ahead by the delay of the filter too."""
    rig = Rig(variables=times(mode, 0.04) | LOOSE).travelling(300.0)
    before = len(rig.rows)
    rig.axis.power(False, stop_mode=0)
    rig.until(lambda: rig.axis.var("Velocity") == 0.0)
    outputs = np.array(rig.column("speed_output")[before - 1 :]) / 6.0
    assert abs(np.diff(outputs)).max() <= 4000.0 * CYCLE * 1.05


@pytest.mark.requirement("CTL-061")
def test_a_shift_of_the_coordinates_goes_through(make_rig):
    """Direct homing while moving shifts the filter with everything else: the speed does not notice."""
    rig = make_rig(variables=times(2, 0.03, 0.02, 0.01) | LOOSE).travelling(100.0)
    before = len(rig.rows)
    rig.axis.home(1000.0)
    rig.run(0.1)
    assert rig.axis.var("ActualPosition") > 990.0
    assert max(rig.column("speed_output")[before:]) == pytest.approx(600.0, abs=1.0)
    assert min(rig.column("speed_output")[before:]) == pytest.approx(600.0, abs=1.0)


def coupled(filter_times, additional):
    """Return lags behind the setpoint of two axes, with drives of 4 and 6 ms, the first one with a filter, at
    100 mm/s.
    """
    lags, shown = [], []
    for lag, own in ((0.004, times(*filter_times)), (0.006, {})):
        rig = Rig(
            port=LaggingDrivePort(cycle_s=CYCLE, lag_s=lag),
            variables=LOOSE
            | own
            | {
                "DynamicAxisModel.VelocityTimeConstant": lag,
                "FollowingError.AdditionalSetpointDelayTime": additional if own else 0.0,
                "PositionControl.Kpc": 100.0,
            },
        ).travelling(100.0)
        rig.run(0.5)
        lags.append(rig.axis.var("Position") - rig.axis.var("ActualPosition") - 100.0 * CYCLE)
        shown.append(rig.axis.var("StatusPositioning.FollowingError"))
    return lags, shown


@pytest.mark.exhaustive
@pytest.mark.requirement("CTL-080", "CTL-081", "MON-035", "SYN-080", "SYN-081")
@pytest.mark.parametrize(
    "filter_times",
    [(1, 0.002), (1, 0.001, 0.001), (1, 0.0, 0.0, 0.002), (2, 0.004), (2, 0.0, 0.004), (2, 0.0, 0.0, 0.002)],
)
def test_two_axes_with_different_drives_lag_alike(filter_times):
    """The faster axis gets the difference as a filter: both are 0.6 mm behind; what they show differs by the
    filter alone. No dead time is longer than 16 servo cycles.
    """
    assert filtering(filter_times[0], 0.0, 0.0, 1.0)[0].delay_s == pytest.approx(16 * CYCLE)
    lags, shown = coupled(filter_times, 0.002)
    assert lags == pytest.approx([0.6, 0.6], rel=0.01)
    assert shown == pytest.approx([0.4, 0.6], rel=0.01)
    _, without = coupled(filter_times, 0.0)
    assert without == pytest.approx([0.6, 0.6], rel=0.01)


def residual_vibration(rig, frequency):
    """Return the amplitude of a weakly damped oscillator on the axis after a move from rest to rest, mm."""
    omega, damping, fine = 2 * pi * frequency, 0.002, 40
    position = np.interp(
        np.arange(len(rig.rows) * fine) / fine, np.arange(len(rig.rows)), rig.column("actual_position")
    )
    x = v = 0.0
    dt = CYCLE / fine
    tail = []
    rest = (len(rig.rows) - 60) * fine
    for at, base in enumerate(position):
        v += dt * (omega * omega * (base - x) - 2 * damping * omega * v)
        x += dt * v
        if at > rest:
            tail.append(x - base)
    return max(tail) - min(tail)


@pytest.mark.requirement("CTL-082", "CTL-083", "CTL-063")
@pytest.mark.parametrize("t2", [0.0, 0.0205])
def test_a_window_of_one_period_calms_a_resonance(t2):
    """T1 = 1/23 Hz takes at least 80 % of what a move from rest to rest leaves behind."""
    left = []
    for own in ({}, times(2, 0.0435, t2)):
        rig = Rig(variables=LOOSE | own | {"VirtualAxis.Mode": 1}).enabled()
        rig.until(rig.axis.move_relative(25.0, Velocity=200.0, Acceleration=2000.0, Jerk=0.0).done)
        rig.run(0.5)
        left.append(residual_vibration(rig, 23.0))
    assert left[0] > 0.05
    assert left[1] < 0.2 * left[0]


def test_no_filter_is_there_unless_it_is_asked_for():
    """Without a mode the cycle has nothing to step through."""
    assert Rig(variables=dict(REFERENCE)).axis.servo.controller.filter is None
