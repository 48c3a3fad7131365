"""The ramps of stops where the source contradicts itself (section 0.2), and the emergency ramp (§5.7.7)."""

from __future__ import annotations

from itertools import pairwise

import pytest

from motion.s7.axis import AxisState
from testcases.unit.motion_axis.conftest import CYCLE

S = AxisState


def slopes(rig, since):
    return [(b - a) / CYCLE for a, b in pairwise(rig.column("velocity_setpoint")[since:])]


def jerks(rig, since):
    a = rig.column("acceleration_setpoint")[since:]
    return [abs(q - p) / CYCLE for p, q in pairwise(a)]


STOPS = {
    "StopMode 0": (lambda rig: rig.axis.power(False, stop_mode=0), 4000.0, 0.0),
    "StopMode 2": (lambda rig: rig.axis.power(False, stop_mode=2), 2000.0, 20000.0),
    "MC_Stop 0": (lambda rig: rig.axis.stop(0), 4000.0, 0.0),
    "MC_Stop 2": (lambda rig: rig.axis.stop(2), 2000.0, 20000.0),
    "reaction 2": (lambda rig: rig.axis.object.alarms.raise_alarm(533, reaction=2), 2000.0, 20000.0),
    "reaction 3": (lambda rig: rig.axis.object.alarms.raise_alarm(304), 4000.0, 0.0),
}


@pytest.mark.requirement("STP-001", "STP-101", "STP-123")
@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("acceleration", [100.0, 50000.0])
def test_emergency_ramps_have_no_jerk_limit_and_accelerations_do_not_matter(make_rig, stop, acceleration):
    """Emergency: full deceleration in one cycle. Maximum: MaxDeceleration with MaxJerk. MaxAcceleration takes
    no part.
    """
    give, deceleration, jerk = STOPS[stop]
    rig = make_rig(variables={"DynamicLimits.MaxAcceleration": acceleration})
    rig.enabled()
    job = rig.axis.move_velocity(300.0, Acceleration=acceleration, Jerk=0.0)
    rig.until(job.in_velocity)
    rig.run(0.1)
    since = len(rig.rows) - 1
    give(rig)
    rig.run(0.4)
    assert min(slopes(rig, since)) == pytest.approx(-deceleration, rel=0.01)
    steepest = max(jerks(rig, since))
    if jerk:
        assert steepest == pytest.approx(jerk, rel=0.01)
    else:
        assert steepest > 0.5 * deceleration / CYCLE


@pytest.mark.requirement("STP-002", "STP-004")
@pytest.mark.parametrize(
    ("first", "second", "shown"), [(1, 2, 2), (2, 1, 2), (2, 3, 3), (3, 1, 3), (1, 4, 4)]
)
def test_codes_of_reactions_are_ordered_by_severity(rig, first, second, shown):
    """ErrorDetail.Reaction 1 is current, 2 maximum dynamic values; the more severe one of two is shown and
    acts.
    """
    numbers = {1: (533, 1), 2: (533, 2), 3: (304, 3), 4: (521, 4)}
    rig.travelling(300.0)
    alarms = rig.axis.object.alarms
    for reaction in (first, second):
        number, code = numbers[reaction]
        alarms.raise_alarm(number, reaction=code)
    assert rig.axis.var("ErrorDetail.Reaction") == shown
    since = len(rig.rows) - 1
    rig.run(0.5)
    if shown < 4:
        assert min(slopes(rig, since)) == pytest.approx({2: -2000.0, 3: -4000.0}[shown], rel=0.01)


@pytest.mark.requirement("STP-003", "STP-404", "STP-405")
@pytest.mark.parametrize(("mode", "left"), [(0, 0.0), (1, 50.0)])
def test_modes_of_the_halt(rig, mode, left):
    """Mode 0 stops basic and superimposed motion, Mode 1 the basic motion alone."""
    rig.enabled()
    basic = rig.axis.move_velocity(100.0)
    rig.until(basic.in_velocity)
    rig.axis.move_superimposed(500.0, VelocityDiff=50.0)
    rig.run(0.5)
    assert rig.column("velocity_setpoint")[-1] == pytest.approx(150.0)
    halt = rig.axis.halt(Mode=mode)
    rig.until(halt.done)
    assert rig.column("velocity_setpoint")[-1] == pytest.approx(left)


@pytest.mark.requirement("STP-005")
@pytest.mark.parametrize("cause", ["power", "alarm"])
def test_where_an_off3_stop_ends(rig, cause):
    """By StopMode 1 the drive is ready again afterwards (S2), by an alarm it stays inhibited (S1) until
    re-enabled.
    """
    rig.travelling(300.0)
    if cause == "power":
        rig.axis.power(False, stop_mode=1)
    else:
        rig.axis.object.alarms.raise_alarm(521)
    rig.run(1.0)
    assert rig.port.stage.name == ("S2" if cause == "power" else "S1")
    assert int(rig.column("stw1")[-1]) == (0x047E if cause == "power" else 0x0478)


@pytest.mark.requirement("STP-006", "STP-123", "STP-149", "STP-150")
@pytest.mark.parametrize(
    ("stop", "from_actual"),
    [
        ("StopMode 0", True),
        ("MC_Stop 0", True),
        ("reaction 3", True),
        ("MC_Stop 2", False),
        ("MC_Stop 3", False),
        ("halt", False),
    ],
)
def test_which_stops_start_from_actual_values(make_rig, stop, from_actual):
    """With a following error of many mm the emergency ramp starts where the axis is, all others where the
    setpoint is.
    """
    rig = make_rig(variables={"PositionControl.Kpc": 0.0, "FollowingError.EnableMonitoring": False})
    rig.travelling(300.0)
    error = rig.column("following_error")[-1]
    assert error > 10.0
    setpoint, actual = rig.column("position_setpoint")[-1], rig.column("actual_position")[-1]
    if stop in STOPS:
        STOPS[stop][0](rig)
    elif stop == "halt":
        rig.axis.halt()
    else:
        rig.axis.stop(3)
    rig.cycles(3)
    began = rig.column("position_setpoint")[-1]
    start = actual if from_actual else setpoint
    # Three cycles later, and ahead of the actual value by the transport delay.
    assert 0.0 < began - start < 300.0 * 5 * CYCLE
    assert error > 5 * CYCLE * 300.0


# -- emergency deceleration
# ------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-126", "MC-423", "STP-576")
@pytest.mark.parametrize(("emergency", "doubted"), [(1999.0, True), (2000.0, False)])
def test_an_emergency_deceleration_below_the_maximum_is_doubted(make_rig, emergency, doubted):
    """The configuration is taken, with a warning that names both variables; again at a restart, without an
    alarm.
    """
    rig = make_rig(variables={"DynamicDefaults.EmergencyDeceleration": emergency})
    texts = [event.data["text"] for event in rig.events("axis.doubt")]
    assert bool(texts) is doubted
    if doubted:
        assert "EmergencyDeceleration = 1999" in texts[0]
        assert "MaxDeceleration = 2000" in texts[0]
    rig.run(0.05)
    rig.until(rig.axis.reset(restart=True).done)
    assert len(rig.events("axis.doubt")) == 2 * doubted
    assert not rig.events("alarm.raised")


@pytest.mark.requirement("STP-126", "MC-423", "STP-576", "STP-445")
def test_a_flat_emergency_ramp_is_longer_than_the_maximum_ramp(make_rig):
    """What the warning is about: superseded by the emergency ramp the stop becomes longer, behind any
    limit.
    """
    travels = []
    for emergency in (500.0, 4000.0):
        rig = make_rig(
            variables={"DynamicDefaults.EmergencyDeceleration": emergency, "PositionLimits_SW.Active": False}
        )
        rig.travelling(300.0)
        at = rig.column("actual_position")[-1]
        rig.axis.object.alarms.raise_alarm(533, reaction=2)
        rig.cycles(2)
        rig.axis.object.alarms.raise_alarm(304)
        rig.run(1.5)
        travels.append(rig.column("actual_position")[-1] - at)
    assert travels[0] > 300.0**2 / 2 / 500.0
    assert travels[1] < 300.0**2 / 2 / 2000.0


# -- smoothing of the switch-over
# -------------------------------------------------------------------------------------------


def output_steps(rig, since):
    """Return the steps of the speed output from cycle to cycle, rpm."""
    return [abs(b - a) for a, b in pairwise(rig.column("speed_output")[since:])]


@pytest.mark.requirement("STP-128", "VAR-171")
@pytest.mark.parametrize("smoothing", [0.0, 0.05])
def test_the_switch_to_the_emergency_ramp_may_be_smoothed(make_rig, smoothing):
    """Without it the speed output loses Kv times the control difference in a cycle; with it this fades with
    the time.
    """
    rig = make_rig(
        variables={
            "PositionControl.Kpc": 0.0,
            "PositionControl.Kv": 20.0,
            "FollowingError.EnableMonitoring": False,
            "PositionControl.SmoothingTimeByChangeDifference": smoothing,
        }
    )
    rig.travelling(300.0)
    assert rig.column("speed_output")[-1] == pytest.approx(1800.0, rel=0.01)
    since = len(rig.rows) - 1
    rig.axis.stop(0)
    rig.run(0.3)
    largest = max(output_steps(rig, since))
    if smoothing:
        # exp(-4 ms / 50 ms) of 1800 rpm, and what the controller itself does in a cycle.
        assert largest < 1800.0 * 0.2
    else:
        assert largest > 1500.0
    assert rig.column("velocity_setpoint")[-1] == 0.0
    rig.run(1.0)
    assert abs(rig.column("actual_velocity")[-1]) < 0.1
