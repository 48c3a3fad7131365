"""Monitoring at its edges: what the signals mean, values that change while they are in use, and times to the
microsecond (§5.12).
"""

from __future__ import annotations

from math import log, tau

import pytest

from motion.drives.simulated import SimulatedDrivePort
from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.lagging_drive import LaggingDrivePort
from testcases.unit.motion_axis.test_dynamic_filter import times
from testcases.unit.motion_axis.test_position_monitoring import DYNAMIC, LOOSE, displace, numbers, settling

DELAY_TIME = "FollowingError.AdditionalSetpointDelayTime"


# -- what the signals mean
# ------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MON-028", "MON-013", "MON-025")
def test_done_is_about_the_position():
    """X6 comes with the entry into the window while the axis still creeps: the position counts, the velocity
    does not.
    """
    rig, job, start, deviation = settling(0.2, **{"PositioningMonitoring.MinDwellTime": 0.0})
    rig.until(lambda: rig.axis.var("StatusWord.X6"))
    assert rig.times()[-1] - start == pytest.approx(0.2 * log(deviation), abs=4 * CYCLE)
    assert rig.axis.var("ActualVelocity") > 2.0
    assert not rig.axis.var("StatusWord.X7")
    assert job.Done


@pytest.mark.requirement("MON-028")
def test_done_needs_a_disabled_control_panel(rig):
    """X6 is FALSE while a control panel has the axis, though no job is in progress."""
    rig.enabled()
    rig.cycles(2)
    assert rig.axis.var("StatusWord.X6")
    rig.axis.object.master = rig
    assert not rig.axis.var("StatusWord.X6")
    rig.axis.object.master = None
    assert rig.axis.var("StatusWord.X6")


class TogglingPort(SimulatedDrivePort):
    """An encoder of 1000 increments a revolution whose last one comes and goes; the drive says that the motor
    stands.
    """

    def __init__(self) -> None:
        super().__init__(cycle_s=CYCLE, increments_per_revolution=1000)
        self._tick = 0

    def read(self) -> None:
        super().read()
        self._tick ^= 1
        self.encoder_increments += self._tick
        self.actual_speed_rpm = self._speed


@pytest.mark.requirement("MON-051", "MON-047")
@pytest.mark.parametrize("mode", [0, 1])
def test_standstill_by_the_configured_velocity(mode):
    """An increment per cycle is 2.5 mm/s: above the threshold of 2, X7 never comes; with the speed of the
    telegram it does.
    """
    rig = Rig(
        port=TogglingPort(),
        variables=LOOSE
        | {"Sensor[1].ActualVelocityMode": mode, "Sensor[1].Parameter.StepsPerRevolution": 1000},
    )
    rig.run(0.5)
    assert rig.axis.var("StatusWord.X7") is bool(mode)
    assert abs(rig.axis.var("ActualVelocity")) == pytest.approx(0.0 if mode else 2.5)


@pytest.mark.requirement("MON-047", "MON-010")
def test_a_threshold_of_zero_still_knows_standstill():
    """An axis that does not move at all stands, whatever the threshold; any motion ends that."""
    rig = Rig(variables=LOOSE | {"StandstillSignal.VelocityThreshold": 0.0}).enabled()
    rig.run(0.2)
    assert rig.axis.var("StatusWord.X7")
    rig.axis.move_velocity(0.5)
    rig.run(0.1)
    assert not rig.axis.var("StatusWord.X7")
    rig.axis.object.alarms.raise_alarm(531)
    rig.run(0.5)
    assert rig.axis.var("StatusWord.X7")
    rig.until(rig.axis.reset().done)
    rig.run(0.3)
    assert rig.axis.var("StatusWord.X0")  # the recovery waits for the signal (MON-052)


# -- values that change while they are in use
# ------------------------------------------------------------------------------


@pytest.mark.requirement("MON-001", "MON-018", "MON-024")
@pytest.mark.parametrize("written", [0.5, 1.3])
def test_tolerance_time_counts_from_the_end_of_the_setpoint(written):
    """Changed while it runs it acts at once, still counted from the end of the setpoint."""
    rig, job, start, _ = settling(1.0)
    rig.run(0.3)
    rig.axis.write("PositioningMonitoring.ToleranceTime", written)
    rig.until(lambda: job.Error)
    assert rig.times()[-1] - start == pytest.approx(written, abs=3 * CYCLE)
    assert rig.events("alarm.raised")[0].data["info"] == 1


@pytest.mark.requirement("MON-003", "MON-017")
def test_window_and_dwell_time_act_at_once():
    """A wider window is entered in the next cycle; a longer dwell time counts from the entry."""
    rig, job, *_ = settling(1000.0)
    rig.run(0.3)
    rig.axis.write("PositioningMonitoring.MinDwellTime", 0.2)
    rig.axis.write("PositioningMonitoring.Window", 20.0)
    rig.cycles(2)
    entered = rig.times()[-1]
    rig.until(job.done)
    assert rig.times()[-1] - entered == pytest.approx(0.2, abs=2 * CYCLE)
    assert not numbers(rig)


@pytest.mark.requirement("MON-001", "MON-018")
@pytest.mark.parametrize(("deviation", "alarm"), [(5.0, True), (0.5, False)])
def test_no_tolerance_time(deviation, alarm):
    """ToleranceTime 0: whoever is not in the window when the setpoint ends is too late; who is there is
    not.
    """
    rig, job, start, _ = settling(1000.0, deviation=deviation, **{"PositioningMonitoring.ToleranceTime": 0.0})
    rig.run(0.3)
    assert (541 in numbers(rig)) is alarm
    assert job.Done is not alarm
    if alarm:
        assert rig.events("alarm.raised")[0].time_ns * 1e-9 - start <= 2 * CYCLE


@pytest.mark.exhaustive
@pytest.mark.requirement("MON-038", "MON-006", "MON-040", "MON-041")
def test_a_limit_that_falls_with_the_velocity():
    """MaxValue below MinValue, as it can be written while moving: 521 by the formula, also below the warning
    level of MinValue.
    """
    falling = DYNAMIC | {"FollowingError.MinValue": 20.0, "FollowingError.MaxValue": 4.0}
    for share, alarms in ((0.85, []), (0.95, [522]), (1.1, [521])):
        rig = Rig(variables=falling | {"PositionControl.Kv": 0.01}).travelling(500.0)
        displace(rig, -share * 4.0)
        rig.cycles(2)
        assert [number for number in numbers(rig) if number != 504] == alarms


@pytest.mark.requirement("MON-007", "MON-038", "MON-005")
def test_the_limits_change_while_moving():
    """FE_perm(255) is 55; with MinVelocity 300 it is MinValue, and that can be raised: 521 when the error is
    above, not before.
    """
    rig = Rig(variables=DYNAMIC | {"PositionControl.Kv": 0.01}).travelling(255.0)
    displace(rig, -30.0)
    rig.cycles(2)
    assert not numbers(rig)
    rig.axis.write("FollowingError.MinValue", 40.0)
    rig.axis.write("FollowingError.MinVelocity", 300.0)
    rig.cycles(2)
    assert not numbers(rig)
    rig.axis.write("FollowingError.MinValue", 27.0)
    rig.cycles(2)
    assert numbers(rig) == [521]


@pytest.mark.requirement("MON-008", "MON-041")
def test_a_warning_level_of_zero():
    """0 %: every following error warns, none at all does not."""
    level = {"FollowingError.WarningLevel": 0.0, "VirtualAxis.Mode": 1}
    rig = Rig(variables=DYNAMIC | level).enabled()
    rig.until(rig.axis.move_relative(5.0).done)
    assert not numbers(rig)
    rig = Rig(variables=DYNAMIC | {"FollowingError.WarningLevel": 0.0}).enabled()
    displace(rig, 0.1)
    rig.cycles(2)
    assert numbers(rig) == [522]


# -- delays of the following error
# ---------------------------------------------------------------------------------------


class DelayedPort(SimulatedDrivePort):
    """An ideal drive whose actual values are older by a time than those of the cycle before, at constant
    velocity.
    """

    def __init__(self, delay_s: float, **options) -> None:
        super().__init__(cycle_s=CYCLE, **options)
        self.delay_s = delay_s

    def read(self) -> None:
        super().read()
        angle = self._angle - self._speed / 60.0 * tau * self.delay_s
        self.encoder_increments = round(angle / tau * self._increments)


@pytest.mark.requirement("MON-031", "MON-030", "CTL-101", "MON-034", "MON-032", "MON-055")
@pytest.mark.parametrize("configured", [True, False])
def test_transmission_is_excluded_to_a_micrometre(configured):
    """T_i = T_o = 0.125 ms, T_DC = 2 ms, T_servo = 4 ms at 100 mm/s: 0.625 mm apart, 0 following error; 0.225
    mm if the times are not configured.
    """
    steps = 1 << 23
    rig = Rig(
        port=DelayedPort(0.00225, increments_per_revolution=steps),
        connection="data_block",
        variables=LOOSE | {"Mechanics.LeadScrew": 5.0, "Sensor[1].Parameter.StepsPerRevolution": steps},
    )
    axis = rig.axis.object
    if configured:
        for number, seconds in ((1010, 0.000125), (1011, 0.000125), (1012, 0.002)):
            axis.variables.write_parameter(number, seconds)
        axis.variables.restart()
        axis.apply_configuration()
    rig.travelling(100.0)
    rig.run(1.0)
    apart, error = (
        rig.axis.var("Position") - rig.axis.var("ActualPosition"),
        rig.axis.var("StatusPositioning.FollowingError"),
    )
    if configured:
        assert apart == pytest.approx(0.625, abs=1e-6)
        assert error == pytest.approx(0.0, abs=1e-6)
        assert rig.axis.var("StatusServo.ControlDifference") == pytest.approx(0.0, abs=1e-6)
    else:
        # The controller takes the time on the way for a lag and corrects it; the rest of its model is the
        # error that it shows.
        assert error == pytest.approx(rig.axis.var("StatusServo.ControlDifference"), abs=1e-6)


@pytest.mark.requirement("MON-009", "MON-037", "CTL-084", "VAR-187", "MON-032")
@pytest.mark.parametrize("tt", [0.008, 0.010, 0.0213])
def test_an_additional_delay_is_a_delay(tt):
    """The dead time of the filter, given as additional delay, leaves the same error in every phase, not at
    constant velocity only.
    """
    own = LOOSE | {"PositioningMonitoring.Window": 5.0}
    plain, delayed = (
        Rig(port=LaggingDrivePort(cycle_s=CYCLE, lag_s=0.004), variables=own | more)
        for more in ({}, times(1, tt=tt) | {DELAY_TIME: tt})
    )
    for rig in (plain, delayed):
        rig.enabled()
        rig.axis.move_relative(30.0, Velocity=200.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0)
        rig.run(0.6)
    cycles = tt / CYCLE
    whole, rest = int(cycles + 1e-9), cycles - int(cycles + 1e-9)
    error, shown = plain.column("following_error"), delayed.column("following_error")
    expected = [
        (1.0 - rest) * error[at - whole] + rest * error[at - whole - 1] for at in range(whole + 1, len(error))
    ]
    assert max(abs(value) for value in expected) > 0.3
    # The speed is interpolated differently within the cycle in which the acceleration changes, where the rest
    # is not 0.
    assert shown[whole + 1 :] == pytest.approx(expected, abs=2e-3 if rest < 1e-6 else 0.02)


@pytest.mark.requirement("MON-009")
def test_an_additional_delay_that_changes_while_moving():
    """At 100 mm/s every 10 ms are 1 mm, from the next cycle on, up and down; as long as nobody can wait it is
    bounded.
    """
    rig = Rig(variables=LOOSE).travelling(100.0)
    for delay, error in ((0.01, -1.0), (0.05, -5.0), (0.003, -0.3), (0.0, 0.0)):
        rig.axis.write(DELAY_TIME, delay)
        rig.cycles(2)
        assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(error, abs=5e-3)
    rig.axis.write(DELAY_TIME, 1.0e12)
    rig.cycles(2)
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(
        -100.0 * (16384 - 1) * CYCLE, rel=1e-3
    )
    rig.axis.home(0.0)
    rig.axis.write(DELAY_TIME, 0.0)
    rig.run(0.1)
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(0.0, abs=5e-3)


# -- an interpolator that is slower than the servo
# ----------------------------------------------------------------------------


@pytest.mark.requirement("MON-016", "MON-018", "MON-030", "MON-040", "CFG-168")
@pytest.mark.parametrize("ratio", [2, 4])
def test_a_slower_interpolator_changes_no_number(ratio):
    """Following error, tolerance time and 521 are those of one cycle, within an interpolator cycle."""
    rig = Rig(ratio=ratio, variables=LOOSE | {"PositionControl.Kpc": 0.0, "PositionControl.Kv": 20.0})
    rig.travelling(100.0)
    rig.run(1.0)
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(5.0, rel=0.01)
    own = {"PositioningMonitoring.Window": 0.01, "PositioningMonitoring.ToleranceTime": 0.2}
    rig = Rig(ratio=ratio, variables=LOOSE | own | {"PositionControl.Kv": 0.001, "PositionControl.Kpc": 95.0})
    rig.enabled()
    job = rig.axis.move_relative(20.0)
    rig.until(lambda: not rig.axis.motion.gen.done)
    rig.until(lambda: rig.axis.motion.gen.done)
    start = rig.times()[-1]
    rig.until(lambda: job.Error)
    assert rig.times()[-1] - start == pytest.approx(0.2, abs=(ratio + 1) * CYCLE)
    assert numbers(rig) == [541]
    rig = Rig(ratio=ratio, variables=DYNAMIC | {"PositionControl.Kv": 0.01}).travelling(255.0)
    displace(rig, -60.5)
    rig.cycles(ratio + 1)
    assert 521 in numbers(rig)
