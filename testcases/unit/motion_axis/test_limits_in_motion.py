"""Limits, override and targets that change while the axis moves: they act at once, and nothing steps."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from motion.s7.axis import AxisState as S
from testcases.unit.motion_axis.conftest import CYCLE, Rig

LIMITS = "DynamicLimits."
DYNAMICS = {"Velocity": 400.0, "Acceleration": 1000.0, "Deceleration": 1000.0, "Jerk": 0.0}


def slopes(rig, since, name="velocity_setpoint"):
    return [(b - a) / CYCLE for a, b in pairwise(rig.column(name)[since:])]


def moving(rig, velocity, **inputs):
    """An enabled axis that accelerates and has come to `velocity`."""
    rig.enabled()
    rig.job = rig.axis.move_velocity(
        DYNAMICS["Velocity"],
        **{name: value for name, value in (DYNAMICS | inputs).items() if name != "Velocity"},
    )
    rig.until(lambda: rig.column("velocity_setpoint")[-1] >= velocity)
    return rig


@pytest.mark.requirement("VAR-001", "STP-106")
@pytest.mark.parametrize("limit", [250.0, 600.0])
def test_maximum_acceleration(rig, limit):
    """A limit lowered while the axis accelerates acts in the next cycle; raised again, the value of the job
    is back.
    """
    moving(rig, 100.0)
    rig.axis.write(f"{LIMITS}MaxAcceleration", limit)
    since = len(rig.rows)
    rig.cycles(20)
    assert slopes(rig, since) == pytest.approx([limit] * 19)
    rig.axis.write(f"{LIMITS}MaxAcceleration", 2000.0)
    since = len(rig.rows)
    rig.cycles(10)
    assert slopes(rig, since) == pytest.approx([1000.0] * 9)
    rig.until(rig.job.in_velocity)
    assert rig.events("job.leaves_velocity") == []


@pytest.mark.requirement("VAR-001", "STP-107")
def test_maximum_deceleration_of_a_halt(rig):
    """A halt in progress goes on with the new limit and ends with Done."""
    moving(rig, 350.0)
    halt = rig.axis.halt(Deceleration=1000.0, Jerk=0.0)
    rig.cycles(10)
    rig.axis.write(f"{LIMITS}MaxDeceleration", 400.0)
    since = len(rig.rows)
    rig.cycles(20)
    assert slopes(rig, since) == pytest.approx([-400.0] * 19)
    rig.until(halt.done)


@pytest.mark.requirement("VAR-001", "STP-108", "STP-116")
def test_maximum_jerk(rig):
    """The acceleration changes by the lower limit from the next cycle on, and the motion still ends at its
    target.
    """
    rig.enabled()
    job = rig.axis.move_relative(
        200.0, Velocity=300.0, Acceleration=1000.0, Deceleration=1000.0, Jerk=10000.0
    )
    rig.until(lambda: rig.column("acceleration_setpoint")[-1] > 200.0)
    rig.axis.write(f"{LIMITS}MaxJerk", 4000.0)
    since = len(rig.rows)
    rig.until(job.done)
    assert max(map(abs, slopes(rig, since, "acceleration_setpoint"))) == pytest.approx(4000.0)
    assert rig.column("position_setpoint")[-1] == 200.0
    assert max(rig.column("position_setpoint")) == 200.0


@pytest.mark.requirement("VAR-001")
def test_deceleration_lowered_too_late_to_stop_at_the_target(rig):
    """The axis keeps to the limit, passes its target, comes back, and the job is done there."""
    rig.enabled()
    job = rig.axis.move_relative(100.0, **(DYNAMICS | {"Velocity": 200.0}))
    rig.until(lambda: rig.column("acceleration_setpoint")[-1] < 0.0)
    rig.axis.write(f"{LIMITS}MaxDeceleration", 500.0)
    since = len(rig.rows)
    rig.until(job.done)
    assert max(rig.column("position_setpoint")) > 101.0
    assert rig.column("position_setpoint")[-1] == 100.0
    assert min(slopes(rig, since)) >= -1000.0 - 1e-6
    assert min(slopes(rig, since)[:20]) == pytest.approx(-500.0)


RAMPS = {
    "emergency ramp of MC_Stop": (
        lambda rig: rig.axis.stop(0),
        "DynamicDefaults.EmergencyDeceleration",
        4000.0,
        2500.0,
    ),
    "emergency ramp of MC_Power": (
        lambda rig: rig.axis.power(False, stop_mode=0),
        "DynamicDefaults.EmergencyDeceleration",
        4000.0,
        6000.0,
    ),
    "emergency ramp of an alarm": (
        lambda rig: rig.axis.object.alarms.raise_alarm(321),
        "DynamicDefaults.EmergencyDeceleration",
        4000.0,
        1500.0,
    ),
    "maximum dynamics": (
        lambda rig: rig.axis.stop(2, AbortAcceleration=True),
        f"{LIMITS}MaxDeceleration",
        2000.0,
        3000.0,
    ),
    "given dynamics": (
        lambda rig: rig.axis.stop(3, Deceleration=1500.0, Jerk=0.0),
        f"{LIMITS}MaxDeceleration",
        1500.0,
        700.0,
    ),
}


@pytest.mark.requirement("VAR-001", "VAR-004", "STP-125")
@pytest.mark.parametrize("ramp", RAMPS)
def test_ramp_in_progress(make_rig, ramp):
    """A stop that has begun goes on with the new deceleration, and ends where every stop ends."""
    begin, path, before, after = RAMPS[ramp]
    rig = make_rig(variables={f"{LIMITS}MaxJerk": 1e9})
    moving(rig, 399.0)
    rig.run(0.05)
    begin(rig)
    rig.cycles(8)
    assert min(slopes(rig, len(rig.rows) - 4)) == pytest.approx(-before, rel=1e-3)
    rig.axis.write(path, after)
    since = len(rig.rows)
    rig.cycles(8)
    assert slopes(rig, since)[2:] == pytest.approx([-after] * 5, rel=1e-3)
    rig.until(lambda: rig.axis.state in (S.STOP_HOLD, S.DISABLED, S.ALARM_DISABLED))
    assert rig.column("velocity_setpoint")[-1] == 0.0


@pytest.mark.requirement("VAR-001", "VAR-200")
@pytest.mark.parametrize("halt", [False, True])
def test_superimposed_motion(rig, halt):
    """Limits act on the motion on top as well, while it moves and while it is halted."""
    rig.enabled()
    job = rig.axis.move_superimposed(
        300.0, VelocityDiff=300.0, Acceleration=500.0, Deceleration=500.0, Jerk=0.0
    )
    rig.until(lambda: rig.column("velocity_setpoint")[-1] > 100.0)
    if halt:
        job = rig.axis.halt_superimposed(Deceleration=500.0, Jerk=0.0)
        rig.cycles(4)
    rig.axis.write(f"{LIMITS}Max{'Deceleration' if halt else 'Acceleration'}", 250.0)
    since = len(rig.rows)
    rig.cycles(10)
    assert slopes(rig, since) == pytest.approx([-250.0 if halt else 250.0] * 9)
    rig.until(job.done)


@pytest.mark.requirement("STP-607")
@pytest.mark.parametrize(
    ("name", "alarm"), [("MaxAcceleration", 305), ("MaxDeceleration", 305), ("MaxJerk", 306)]
)
def test_limit_becomes_zero(rig, name, alarm):
    """A limit of zero in a running motion is the alarm that it is at the start of one, and the axis stops."""
    moving(rig, 200.0)
    rig.axis.write(f"{LIMITS}{name}", 0.0)
    rig.run(1.0)
    assert [event.data["number"] for event in rig.events("alarm.raised")] == [alarm]
    assert rig.column("velocity_setpoint")[-1] == 0.0


@pytest.mark.requirement("VAR-165")
def test_warning_comes_again_while_the_velocity_is_limited(rig):
    """Acknowledged in a motion that is still limited, 501 is pending again; in one that is not, it stays
    away.
    """
    rig.enabled()
    rig.axis.move_velocity(900.0)
    rig.run(0.1)
    for pending in (1 << 6, 0):
        if not pending:
            rig.axis.write("Override.Velocity", 50.0)
            rig.cycles(2)
        rig.until(rig.axis.reset().done)
        rig.cycles(2)
        assert rig.axis.var("WarningWord") == pending


@pytest.mark.requirement("STP-110", "STP-107")
def test_stop_at_a_software_limit_keeps_the_maximum_deceleration(make_rig):
    """LimitReachedBehavior 1: the deceleration of the job is limited, and the axis still stops at the
    limit.
    """
    rig = make_rig(
        variables={
            "PositionLimits_SW.Active": True,
            "PositionLimits_SW.MaxPosition": 150.0,
            "PositionLimits_SW.LimitReachedBehavior": 1,
        }
    )
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    rig.axis.move_velocity(400.0, Deceleration=9000.0, Jerk=0.0)
    rig.until(lambda: rig.axis.state is S.ALARM_RAMP)
    since = len(rig.rows)
    rig.run(1.0)
    assert min(slopes(rig, since)) == pytest.approx(-2000.0, rel=0.01)
    assert max(rig.column("position_setpoint")) == pytest.approx(150.0, abs=1e-6)
    assert 534 not in [event.data["number"] for event in rig.events("alarm.raised")]


@pytest.mark.requirement("STP-119", "STP-122")
@pytest.mark.parametrize("target", [-300.0, 0.0])
def test_deceleration_that_leads_through_zero(rig, target):
    """It is carried over by the small jerk of a job that leads to the other side, and not through zero by a
    stop.
    """
    rig.travelling(100.0)
    rig.axis.halt(Deceleration=1000.0, Jerk=0.0)
    rig.until(lambda: rig.column("velocity_setpoint")[-1] < 40.0)
    since = len(rig.rows)
    rig.axis.move_velocity(target, Acceleration=1000.0, Deceleration=1000.0, Jerk=5000.0)
    rig.run(0.6)
    steepest = max(map(abs, slopes(rig, since, "acceleration_setpoint")))
    velocities = rig.column("velocity_setpoint")[since:]
    if target:
        assert steepest <= 5000.0 * (1 + 1e-9)
        assert min(velocities) < -200.0
    else:
        assert steepest > 5000.0
        assert min(velocities) >= -1e-9


@pytest.mark.requirement("STP-116", "STP-122")
@pytest.mark.parametrize("new", ["halt", "back", "override"])
def test_reversal_that_is_superseded_as_it_passes_zero(rig, new):
    """What the same jerk has built up on the way to the other side is carried through zero: no step of
    acceleration.
    """
    dynamics = {"Acceleration": 1000.0, "Deceleration": 1000.0, "Jerk": 5000.0}
    rig.travelling(100.0)
    rig.axis.move_velocity(-300.0, **dynamics)
    rig.until(lambda: rig.column("velocity_setpoint")[-1] < 12.0)
    since = len(rig.rows) - 1
    if new == "halt":
        rig.axis.halt(Deceleration=1000.0, Jerk=5000.0)
    elif new == "back":
        rig.axis.move_velocity(50.0, **dynamics)
    else:
        rig.axis.write("Override.Velocity", 0.0)
    rig.run(0.8)
    assert max(map(abs, slopes(rig, since, "acceleration_setpoint"))) == pytest.approx(5000.0)
    assert min(rig.column("velocity_setpoint")[since:]) < -50.0
    assert rig.column("velocity_setpoint")[-1] == (50.0 if new == "back" else 0.0)


CHANGES = st.one_of(
    st.tuples(st.just("Override.Velocity"), st.sampled_from([0.0, 25.0, 100.0, 150.0, 200.0])),
    st.tuples(st.just(f"{LIMITS}Velocity"), st.sampled_from([40.0, 200.0, 500.0])),
    st.tuples(st.just(f"{LIMITS}MaxAcceleration"), st.sampled_from([300.0, 1000.0, 2000.0])),
    st.tuples(st.just(f"{LIMITS}MaxJerk"), st.sampled_from([5000.0, 20000.0])),
    st.tuples(st.just("target"), st.integers(-300, 300).map(float)),
)


@pytest.mark.exhaustive
@pytest.mark.requirement("VAR-001", "STP-114", "STP-116", "STP-117")
@settings(max_examples=25)
@given(
    changes=st.lists(st.tuples(st.integers(1, 120), CHANGES), min_size=1, max_size=5),
    jerk=st.sampled_from([0.0, 5000.0]),
)
@example(changes=[(6, ("Override.Velocity", 0.0)), (1, ("target", 0.0)), (9, ("target", 1.0))], jerk=5000.0)
def test_any_changes_on_the_way(changes, jerk):
    """Override, limits and targets in any order: no step, no limit broken, and the end is the target,
    exactly, from one side.

    The jerk of the jobs is the lowest limit of jerk, so that nothing has to be given up for a new one.
    """
    rig = Rig(variables={"VirtualAxis.Mode": 1, "FollowingError.EnableMonitoring": False})
    rig.enabled()
    rig.until(rig.axis.home(0.0).done)
    inputs = {"Velocity": 250.0, "Acceleration": 1500.0, "Deceleration": 1500.0, "Jerk": jerk}
    job, target, since = rig.axis.move_absolute(200.0, **inputs), 200.0, len(rig.rows)
    for cycles, (what, value) in changes:
        rig.cycles(cycles)
        if what == "target":
            job, target = rig.axis.move_absolute(value, **inputs), value
        else:
            rig.axis.write(what, value)
    rig.axis.write("Override.Velocity", 100.0)
    rig.axis.write(f"{LIMITS}MaxAcceleration", 600.0)
    rig.cycles(2)
    last = len(rig.rows) - 1
    passes = rig.axis.object.motion.gen.overshoots
    rig.until(job.done, 30.0)

    assert rig.column("position_setpoint")[-1] == target
    s, v, a = (rig.column(f"{name}_setpoint")[since:] for name in ("position", "velocity", "acceleration"))
    assert max(map(abs, v)) <= 500.0 * (1 + 1e-9)
    assert max(map(abs, a)) <= 2000.0 * (1 + 1e-9)
    for now, then, speed, after in zip(s, s[1:], v, v[1:], strict=False):
        assert abs(then - now - 0.5 * (speed + after) * CYCLE) <= 2000.0 * CYCLE**2
    if jerk:
        assert max(abs(q - p) for p, q in pairwise(a)) <= jerk * CYCLE * (1 + 1e-6)
    growth = [abs(q) - abs(p) for p, q in pairwise(rig.column("velocity_setpoint")[last:])]
    if not jerk:  # with a jerk limit a higher acceleration falls to the new limit first
        assert max(growth, default=0.0) <= 600.0 * CYCLE * (1 + 1e-6)
    if not passes:
        rest = [target - one for one in rig.column("position_setpoint")[last:]]
        assert min(rest) >= -1e-9 or max(rest) <= 1e-9
