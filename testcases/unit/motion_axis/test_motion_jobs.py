"""Inputs and outputs of the motion jobs (§5.8), superimposed motion on every basic motion, what one
acknowledgement takes.
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from motion.s7.axis import AxisState
from testcases.unit.motion_axis.conftest import CYCLE

NAMES = ("Velocity", "Acceleration", "Deceleration", "Jerk")


def since(rig, name, start):
    return rig.column(name)[start:]


# -- MC_MoveVelocity
# ---------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-212", "STP-216")
@pytest.mark.parametrize("kind", ["move_velocity", "move_relative", "move_absolute"])
def test_zero_velocity(rig, kind):
    """MC_MoveVelocity takes 0.0 as a velocity, positioning jobs refuse it with 16#8003."""
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    first = rig.axis.move_velocity(100.0)
    rig.until(first.in_velocity)
    job = (
        rig.axis.move_velocity(0.0)
        if kind == "move_velocity"
        else getattr(rig.axis, kind)(50.0, Velocity=0.0)
    )
    rig.run(0.5)
    if kind == "move_velocity":
        assert (job.InVelocity, job.Busy, job.Error) == (True, True, False)
        assert [rig.axis.var(f"StatusWord.X{bit}") for bit in (7, 12)] == [True, True]
    else:
        assert job.ErrorID == 0x8003
        assert rig.column("velocity_setpoint")[-1] == pytest.approx(100.0)


@pytest.mark.requirement("STP-212")
@pytest.mark.parametrize(
    ("inputs", "reached"),
    [
        ({"Velocity": 80.0}, 80.0), ({"Velocity": -80.0}, -80.0), ({"Velocity": 80.0, "Direction": 1}, 80.0),
        ({"Velocity": 80.0, "Direction": 2}, -80.0), ({"Velocity": 80.0, "Current": True}, 120.0),
    ],
)  # fmt: skip
def test_direction_and_current(rig, inputs, reached):
    """The sign or Direction says the way; Current keeps the present velocity."""
    rig.enabled()
    first = rig.axis.move_velocity(120.0)
    rig.until(first.in_velocity)
    velocity = inputs.pop("Velocity")
    job = rig.axis.move_velocity(velocity, **inputs)
    rig.until(job.in_velocity)
    assert rig.column("velocity_setpoint")[-1] == pytest.approx(reached)


@pytest.mark.requirement("STP-212", "STP-221")
@pytest.mark.parametrize("kind", ["move_velocity", "move_relative", "move_absolute"])
def test_given_dynamics_are_those_of_the_motion(rig, kind):
    """Velocity, acceleration, deceleration and jerk of the inputs are reached, none is passed."""
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    start = len(rig.rows)
    dynamics = {"Acceleration": 800.0, "Deceleration": 400.0, "Jerk": 8000.0}
    if kind == "move_velocity":
        job = rig.axis.move_velocity(200.0, **dynamics)
        rig.until(job.in_velocity)
        rig.until(rig.axis.move_velocity(0.0, **dynamics).in_velocity)
    else:
        job = getattr(rig.axis, kind)(200.0, Velocity=200.0, **dynamics)
        rig.until(job.done)
    accelerations = since(rig, "acceleration_setpoint", start)
    assert max(since(rig, "velocity_setpoint", start)) == pytest.approx(200.0)
    assert max(accelerations) == pytest.approx(800.0)
    assert min(accelerations) == pytest.approx(-400.0)
    assert max(abs(b - a) / CYCLE for a, b in pairwise(accelerations)) == pytest.approx(8000.0)


@pytest.mark.requirement("STP-221", "STP-082", "STP-083")
@pytest.mark.parametrize("kind", ["move_relative", "move_absolute"])
@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("Velocity", 0.0, 0x8003),
        ("Acceleration", 0.0, 0x8004),
        ("Deceleration", 0.0, 0x8005),
        ("Jerk", 0.0, 0),
        *((name, -1.0, 0) for name in NAMES),
    ],
)
def test_zero_and_negative_dynamics(rig, kind, name, value, error):
    """0.0 is refused but for the jerk, where it means none; a negative value takes the default."""
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    start = len(rig.rows)
    job = getattr(rig.axis, kind)(100.0, **{name: value})
    rig.until(job.ended)
    assert job.ErrorID == error
    if error:
        return
    accelerations = since(rig, "acceleration_setpoint", start)
    steepest = max(abs(b - a) / CYCLE for a, b in pairwise(accelerations))
    assert steepest == pytest.approx(1000.0 / CYCLE if name == "Jerk" and value == 0.0 else 10000.0)
    assert max(since(rig, "velocity_setpoint", start)) == pytest.approx(100.0)
    assert (max(accelerations), min(accelerations)) == (pytest.approx(1000.0), pytest.approx(-1000.0))


@pytest.mark.requirement("STP-219", "STP-220")
def test_target_and_distance(rig):
    """Position is a place, Distance is counted from where the job begins, with its sign."""
    rig.enabled()
    rig.until(rig.axis.home(20.0).done)
    for start, value, place in (
        (rig.axis.move_absolute, 35.0, 35.0),
        (rig.axis.move_relative, -10.0, 25.0),
        (rig.axis.move_absolute, -12.0, -12.0),
        (rig.axis.move_relative, 5.0, -7.0),
    ):
        rig.until(start(value).done)
        assert rig.axis.var("Position") == pytest.approx(place)


# -- MC_MoveJog
# -----------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-228", "STP-215")
@pytest.mark.parametrize("kind", ["jog", "move_velocity"])
def test_override_takes_in_velocity_away_until_it_is_reached(rig, kind):
    """300 mm/s, override 100 to 50 %: InVelocity FALSE while braking, TRUE again at 150 mm/s."""
    rig.enabled()
    job = getattr(rig.axis, kind)(300.0)
    rig.until(lambda: job.InVelocity)
    rig.axis.write("Override.Velocity", 50.0)
    rig.cycles(3)
    assert not job.InVelocity
    assert job.Busy
    rig.until(lambda: job.InVelocity)
    assert rig.column("velocity_setpoint")[-1] == pytest.approx(150.0, abs=0.01)


@pytest.mark.requirement("STP-230", "STP-217")
@pytest.mark.parametrize("kind", ["jog", "move_velocity"])
@pytest.mark.parametrize("controlled", [True, False])
def test_position_control_is_what_the_job_asks_for(rig, kind, controlled):
    """The axis is switched as soon as the job takes effect, whatever it was before."""
    rig.enabled(start_mode=0 if controlled else 1)
    assert rig.axis.var("StatusWord.X28") is controlled
    job = getattr(rig.axis, kind)(100.0, PositionControlled=controlled)
    rig.cycles(2)
    assert job.Busy
    assert rig.axis.var("StatusWord.X28") is not controlled


# -- superimposed motion
# -------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-193", "STP-199", "STP-203")
@pytest.mark.parametrize("basic", ["absolute", "relative", "velocity", "jog"])
def test_every_motion_of_one_axis_carries_a_superimposed_one(rig, basic):
    """100 + 50 mm/s are 150; the data block shows the sum, and the basic motion ends as it would have."""
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    job = {
        "absolute": lambda: rig.axis.move_absolute(300.0),
        "relative": lambda: rig.axis.move_relative(300.0),
        "velocity": lambda: rig.axis.move_velocity(100.0),
        "jog": lambda: rig.axis.jog(100.0),
    }[basic]()
    rig.run(0.4)
    more = rig.axis.move_superimposed(40.0, VelocityDiff=50.0)
    rig.run(0.4)
    assert rig.axis.var("Velocity") == pytest.approx(150.0)
    assert rig.axis.var("StatusWord.X23")
    rig.until(more.done)
    assert job.Busy
    if basic in ("absolute", "relative"):
        rig.until(job.done)
        assert rig.axis.var("Position") == pytest.approx(340.0)
    else:
        rig.run(0.2)
        assert rig.axis.var("Velocity") == pytest.approx(100.0)


# -- variables
# ------------------------------------------------------------------------------------------------------------

VARIABLES = (
    "StatusWord",
    "StatusWord2",
    "Position",
    "Velocity",
    "Acceleration",
    "VelocitySetpoint",
    "ActualPosition",
    "ActualVelocity",
    "ActualAcceleration",
    "ActualSpeed",
    "StatusPositioning.SuperimposedDistance",
    "StatusMotionIn.FunctionState",
    "StatusMotionIn.StatusWord",
    "StatusWord.X23",
    "StatusWord.X31",
    "StatusWord2.X6",
    "StatusWord2.X7",
    "Override.Velocity",
    "DynamicLimits.MaxVelocity",
    "DynamicLimits.Velocity",
    "DynamicLimits.MaxAcceleration",
    "DynamicLimits.MaxDeceleration",
    "DynamicLimits.MaxJerk",
    "DynamicDefaults.Velocity",
    "DynamicDefaults.Acceleration",
    "DynamicDefaults.Deceleration",
    "DynamicDefaults.Jerk",
    "DynamicDefaults.EmergencyDeceleration",
    "TorqueLimiting.LimitDefaults.Torque",
    "TorqueLimiting.LimitDefaults.Force",
    "TorqueLimiting.LimitBase",
    "TorqueLimiting.PositionBasedMonitorings",
    "StatusTorqueData.CommandAdditiveTorqueActive",
    "StatusTorqueData.CommandTorqueRangeActive",
    "StatusTorqueData.ActualTorque",
    "StatusTorqueData.ActualForce",
    "Clamping.FollowingErrorDeviation",
    "Clamping.PositionTolerance",
)


@pytest.mark.requirement("STP-210")
def test_variables_of_a_motion_in_every_cycle(rig):
    """All are readable in every cycle, and those of the motion agree with each other and with the trace of
    the cycle.
    """
    rows = []
    rig.runtime.after_cycle.append(lambda: rows.append({path: rig.axis.var(path) for path in VARIABLES}))
    rig.travelling(200.0)
    rig.axis.move_superimposed(30.0, VelocityDiff=50.0)
    rig.run(0.5)
    rig.axis.write("Override.Velocity", 50.0)
    rig.run(0.5)
    rig.until(rig.axis.halt().done)
    assert len(rows) == len(rig.rows)
    for name, path in (
        ("position_setpoint", "Position"),
        ("velocity_setpoint", "Velocity"),
        ("acceleration_setpoint", "Acceleration"),
        ("actual_position", "ActualPosition"),
        ("actual_velocity", "ActualVelocity"),
        ("actual_speed", "ActualSpeed"),
    ):
        assert [row[path] for row in rows][10:] == pytest.approx(rig.column(name)[10:]), path
    velocity = [row["ActualVelocity"] for row in rows]
    slopes = [(b - a) / CYCLE for a, b in pairwise(velocity)]
    assert [row["ActualAcceleration"] for row in rows][11:] == pytest.approx(slopes[10:], abs=1e-6)
    covered = [row["StatusPositioning.SuperimposedDistance"] for row in rows]
    assert max(covered) == pytest.approx(30.0)
    assert {row["StatusWord.X23"] for row in rows} == {True, False}
    assert {row["Override.Velocity"] for row in rows} == {100.0, 50.0}


# -- acknowledging
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-071", "STP-066")
@pytest.mark.parametrize("enabled", [False, True])
def test_all_alarms_are_acknowledged_whatever_is_in_use(rig, enabled):
    """Alarms of encoder, drive, limit switches, homing, clamping and configuration go together, also of a
    disabled axis.
    """
    numbers = (106, 108, 411, 421, 431, 501, 521, 522, 531, 533, 541, 542)
    if enabled:
        rig.enabled()
    else:
        rig.run(0.1)
    for number in numbers:
        rig.axis.object.alarms.raise_alarm(number)
    rig.run(1.0)
    assert len(rig.axis.object.alarms.engine.pending) == len(numbers)
    rig.until(rig.axis.reset().done)
    assert not rig.axis.object.alarms.engine.pending
    assert [rig.axis.var(name) for name in ("ErrorWord", "WarningWord", "ErrorDetail.Number")] == [0, 0, 0]
    if enabled:
        rig.until(rig.axis.power_instance.status)
    else:
        assert rig.axis.object.state is AxisState.DISABLED


@pytest.mark.requirement("STP-608")
def test_a_drive_that_shuts_down_by_itself(rig):
    """Operation gone without fault and without OFF: 421 whose text says that the drive has switched itself
    off.
    """
    rig.travelling(200.0)
    rig.port.stage = type(rig.port.stage).S2
    rig.cycles(3)
    (entry,) = rig.axis.object.alarms.engine.pending
    assert (entry.number, entry.reaction) == (421, 4)
    assert "switched itself off" in entry.text
    assert rig.axis.var("ErrorWord") == 1 << 4


# -- MC_MoveRelative in nanometres
# -------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-277")
@pytest.mark.parametrize(
    ("distance", "way"), [(999.9, 0.0), (-999.9, 0.0), (1000.0, 1000.0), (-1000.0, -1000.0)]
)
def test_the_shortest_way_in_nanometres(make_rig, distance, way):
    """With the unit nm a distance of less than 1000.0 is Done without motion; with mm any distance is one."""
    window = {"PositioningMonitoring.Window": 1.0e6, "FollowingError.EnableMonitoring": False}
    rig = make_rig(variables={"Units.LengthUnit": 1015, "Mechanics.LeadScrew": 1.0e7} | window).enabled()
    before = rig.axis.var("Position")
    rig.until(
        rig.axis.move_relative(distance, Velocity=500.0, Acceleration=2000.0, Deceleration=2000.0).done, 9.0
    )
    assert rig.axis.var("Position") - before == pytest.approx(way, abs=1e-6)


# -- MC_MoveJog that changes while it runs
# ------------------------------------------------------------------------------


@pytest.mark.requirement("MC-071", "MC-329", "MC-085")
@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("Velocity", float("nan"), 0x8003), ("Acceleration", 0.0, 0x8004), ("Deceleration", 0.0, 0x8005),
        ("Jerk", float("inf"), 0x8006),
    ],
)  # fmt: skip
def test_an_input_that_gets_wrong_while_jogging(rig, name, value, error):
    """Error and not Busy, braking with the deceleration of the instruction; over when the jog input falls."""
    rig.enabled()
    jog = rig.axis.jog(100.0, Deceleration=500.0, Jerk=0.0)
    rig.until(jog.in_velocity)
    start = len(rig.rows)
    jog.set(**{name: value})
    for _ in range(3):
        rig.cycles()
        assert (jog.Busy, jog.InVelocity, jog.Error, jog.ErrorID) == (False, False, True, error)
    rig.run(0.3)
    assert min(since(rig, "acceleration_setpoint", start)) == pytest.approx(-500.0)
    assert rig.axis.state is AxisState.STANDSTILL
    jog.set(JogForward=False)
    rig.cycles()
    assert not jog.Error


@pytest.mark.requirement("MC-026", "MC-323", "STP-230", "MC-098", "MC-099")
def test_position_control_is_switched_while_jogging(rig):
    """PositionControlled is taken over with every call, without a step of the velocity; superimposed motion
    ends without it.
    """
    rig.enabled()
    jog = rig.axis.jog(100.0)
    rig.until(jog.in_velocity)
    start = len(rig.rows) - 1
    jog.set(PositionControlled=False)
    rig.cycles(2)
    assert rig.axis.var("StatusWord.X28")
    jog.set(PositionControlled=True)
    rig.run(0.1)
    assert not rig.axis.var("StatusWord.X28")
    assert jog.InVelocity
    assert max(abs(one - 100.0) for one in since(rig, "velocity_setpoint", start)) < 1e-6
    top = rig.axis.move_superimposed(50.0, VelocityDiff=40.0)
    rig.run(0.2)
    jog.set(PositionControlled=False)
    rig.cycles(2)
    assert (top.CommandAborted, jog.Busy, rig.axis.var("StatusWord.X28")) == (True, True, True)
    velocities = since(rig, "velocity_setpoint", start)
    assert max(abs(b - a) for a, b in pairwise(velocities)) <= 2000.0 * CYCLE + 1e-6
