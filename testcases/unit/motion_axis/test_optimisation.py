"""Optimisation of the position controller on a drive with a known lag (§6.7)."""

from __future__ import annotations

import numpy as np
import pytest

from fieldbus.errors import ConfigurationError
from motion.s7.commissioning import CommissioningError, Optimisation, TestStep, tuned_by_drive
from motion.s7.controller import OperatingState
from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.lagging_drive import LaggingDrivePort

pytestmark = pytest.mark.exhaustive

STEP = TestStep(distance=10.0, velocity=100.0, acceleration=2000.0, tolerance=0.02)


def optimisation(lag_s, *, step=STEP, **variables):
    rig = Rig(port=LaggingDrivePort(cycle_s=CYCLE, lag_s=lag_s), variables=variables)
    rig.cycles(5)
    panel = rig.axis.control_panel()
    panel.take_control()
    panel.enable()
    rig.until(lambda: panel.enabled)

    def wait(condition, seconds):
        return rig.scheduler.run_until(condition, round(seconds * 1e9))

    return rig, panel, Optimisation(panel, rig.runtime, wait, step)


@pytest.fixture(scope="module", params=[0.01, 0.015])
def tuned(request):
    rig, panel, routine = optimisation(request.param)
    return request.param, rig, panel, routine.run()


@pytest.mark.requirement("COM-055", "COM-057", "COM-058", "COM-060", "COM-065")
def test_the_gain_is_raised_to_the_first_overshoot(tuned):
    """From 10 1/s without precontrol; the last gain without overshoot is kept, the next one, 5 % higher,
    overshoots.
    """
    _, _, _, result = tuned
    plain = [one for one in result.attempts if one.kpc == 0.0]
    assert (plain[0].kv, plain[0].time_constant) == (10.0, 0.0)
    good = max(one.kv for one in plain if one.good)
    bad = min(one.kv for one in plain if not one.good)
    assert bad == pytest.approx(1.05 * good)
    assert result.kv == pytest.approx(0.9 * good)


@pytest.mark.requirement("COM-062", "COM-063", "COM-068")
def test_the_time_constant_is_that_of_the_drive(tuned):
    """With precontrol it is raised by 1 ms until nothing overshoots: near the lag of the drive; without it
    the axis overshoots.
    """
    lag, _, _, result = tuned
    steps = [one for one in result.attempts if one.kpc == 100.0]
    assert np.diff([one.time_constant for one in steps[:-1]]) == pytest.approx(0.001)
    assert steps[0].time_constant == 0.0
    assert not steps[0].good
    assert [one.good for one in steps] == [False] * (len(steps) - 2) + [True] * 2  # the last one twice
    assert result.time_constant == steps[-1].time_constant == pytest.approx(lag, abs=0.006)
    assert result.kpc == 100.0


@pytest.mark.requirement("COM-067", "COM-066", "COM-017")
def test_the_result_is_better_than_what_it_began_with(tuned):
    """No overshoot, no reversal, and settled far sooner than with the first setting."""
    _, _, _, result = tuned
    first, last = result.attempts[0], result.attempts[-1]
    assert last.good
    assert last.overshoot <= STEP.tolerance
    assert last.settling_s < 0.4 * first.settling_s
    assert abs(last.actual[len(last.actual) // 2 - 1] - last.setpoint[len(last.setpoint) // 2 - 1]) < 0.02


@pytest.mark.requirement("COM-071", "COM-064", "COM-069", "COM-018", "COM-004", "COM-020")
def test_only_what_is_downloaded_stays(tuned):
    """Returning control discards what was tried; gain, precontrol and time constant come with a download in
    STOP.
    """
    _, rig, panel, result = tuned
    panel.release()
    rig.until(lambda: not panel.active)
    rig.cycles(2)
    assert rig.axis.var("PositionControl.Kv") == 20.0
    assert rig.axis.var("FollowingError.MaxValue") == 10.0
    controller = rig.runtime.controller
    controller.stop()
    rig.until(lambda: controller.state is OperatingState.STOP)
    rig.run(0.1)
    controller.download("axis1", result.start_values)
    controller.run()
    rig.until(lambda: controller.state is OperatingState.RUN)
    rig.run(0.2)
    assert rig.axis.var("PositionControl.Kv") == pytest.approx(result.kv)
    assert rig.axis.var("DynamicAxisModel.VelocityTimeConstant") == result.time_constant
    power = rig.axis.power(False)
    rig.cycles(2)
    rig.enabled()
    assert power.Status
    rig.until(rig.axis.move_relative(5.0).done)


@pytest.mark.requirement("COM-053", "COM-054", "CTL-035")
def test_values_of_the_one_button_tuning():
    """r5276 = 6.0 and r5277 = 4.0 ms are Kv = 49.99998 1/s and 0.004 s."""
    values = tuned_by_drive(6.0, 4.0)
    assert values == {
        "PositionControl.Kv": pytest.approx(49.99998),
        "DynamicAxisModel.VelocityTimeConstant": pytest.approx(0.004),
    }


@pytest.mark.requirement("COM-059")
def test_a_torque_limit_ends_it():
    """What is found at a limit says nothing: refused with what to do."""
    rig, _, routine = optimisation(0.01)
    rig.port.torque_limit_reached = True
    with pytest.raises(CommissioningError, match="less acceleration"):
        routine.run()


@pytest.mark.requirement("COM-052", "CFG-065")
def test_preconditions():
    """A positioning axis, enabled in the panel; a step that can be made."""
    rig = Rig(speed=True)
    rig.cycles(5)
    panel = rig.axis.control_panel()
    with pytest.raises(CommissioningError, match="no position control"):
        Optimisation(panel, rig.runtime, lambda condition, _: condition(), STEP)
    rig = Rig()
    panel = rig.axis.control_panel()
    with pytest.raises(CommissioningError, match="needs master control"):
        Optimisation(panel, rig.runtime, lambda condition, _: condition(), STEP)
    with pytest.raises(ConfigurationError, match="distance"):
        TestStep(distance=0.0, velocity=1.0, acceleration=1.0, tolerance=0.1)


@pytest.mark.requirement("COM-065", "COM-057")
def test_a_drive_that_is_slow():
    """It overshoots with the first gain already: the search goes down, and then up in fine steps."""
    _, _, routine = optimisation(0.05)
    result = routine.run()
    gains = [one.kv for one in result.attempts if one.kpc == 0.0]
    assert gains[:2] == [10.0, 8.0]
    assert 3.0 < result.kv < 6.0  # near 1 / (4 T) = 5 1/s of a loop without dead time
    assert result.time_constant == pytest.approx(0.05, abs=0.003)
    assert result.attempts[-1].good


@pytest.mark.requirement("COM-065")
def test_a_drive_that_is_too_slow():
    """It overshoots with the smallest gain still: the drive comes first."""
    _, _, routine = optimisation(5.0)
    with pytest.raises(CommissioningError, match="speed controller of the drive"):
        routine.run()


@pytest.mark.requirement("COM-061")
def test_a_step_that_is_too_soft(monkeypatch):
    """Nothing overshoots up to the greatest gain: the routine says that the step needs more acceleration."""
    monkeypatch.setattr("motion.s7.commissioning.optimisation._GREATEST_GAIN", 30.0)
    soft = TestStep(distance=1.0, velocity=1.0, acceleration=2.0, tolerance=0.9)
    _, _, routine = optimisation(0.0, step=soft)
    with pytest.raises(CommissioningError, match="more acceleration"):
        routine.run()


@pytest.mark.requirement("COM-056")
def test_an_alarm_on_the_way():
    """A test step that fails is reported with the alarm."""
    rig, _, routine = optimisation(0.01, **{"PositionLimits_HW.Active": True})
    rig.scheduler.at(rig.scheduler.now + 300_000_000, lambda: setattr(rig.port, "switches", 2))
    with pytest.raises(CommissioningError, match="alarm 531"):
        routine.run()
