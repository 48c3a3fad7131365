"""`MC_GearIn`: relative gearing with setpoint coupling (SYN sections 2, 5 to 7.1)."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import SynchronousAxis
from motion.s7.handles import AxisHandle
from testcases.unit.motion_axis.conftest import CYCLE, REFERENCE, Rig

FIXTURE = {
    "DynamicLimits.MaxAcceleration": 5000.0,
    "DynamicLimits.MaxDeceleration": 5000.0,
    "VirtualAxis.Mode": 1,
}
SYNCHRONIZING, SYNCHRONOUS, NON_POSITION_CONTROLLED = 1 << 21, 1 << 22, 1 << 28


def gear(velocity=100.0, numerator=1, denominator=1, *, leader=None, follower=None, **inputs):
    """A leading axis with a constant velocity, and an axis that synchronises to it since this cycle."""
    rig = Rig(
        synchronous=True, variables=FIXTURE | (follower or {}), leader_variables=FIXTURE | (leader or {})
    )
    rig.enabled().leader_at(velocity)
    rig.job = rig.axis.gear_in(rig.leader, numerator, denominator, **inputs)
    rig.cycles()  # the instruction is called
    return rig


def in_gear(*arguments, **options):
    """The same, synchronous."""
    rig = gear(*arguments, **options)
    rig.until(rig.job.in_gear)
    return rig


def places(rig):
    """Positions of leading and following axis."""
    return rig.leader.object.servo.total.s, rig.axis.object.servo.total.s


def word(axis):
    """Status bits of synchronous operation."""
    return axis.var("StatusWord") & (SYNCHRONIZING | SYNCHRONOUS)


@pytest.mark.requirement("SYN-088", "SYN-140", "SYN-126", "SYN-142", "SYN-414")
def test_synchronising_takes_the_time_of_the_dynamics_and_keeps_the_offset():
    """From rest to 200 mm/s with 1000 mm/s2: 50 cycles in which the leading axis goes 20 mm and the follower
    20 mm; the offset that this makes stays.
    """
    rig = gear(100.0, 2, 1, Acceleration=1000.0, Jerk=0.0)
    x, y = places(rig)
    for cycle in range(1, 51):
        assert not rig.job.InGear
        assert word(rig.axis) == SYNCHRONIZING
        rig.cycles()
        assert rig.axis.var("Velocity") == pytest.approx(cycle * 1000.0 * CYCLE)
    assert rig.job.InGear
    assert word(rig.axis) == SYNCHRONOUS
    leading, following = places(rig)
    assert (leading - x, following - y) == (pytest.approx(20.0), pytest.approx(20.0))
    rig.run(1.0)
    later = places(rig)
    assert later[1] - following == pytest.approx(2.0 * (later[0] - leading), abs=1e-9)


@pytest.mark.requirement("SYN-137", "SYN-138", "SYN-143")
@pytest.mark.parametrize(("numerator", "denominator"), [(5, 1), (-3, 1), (1, 3), (-2, 7)])
def test_the_ratio_is_that_of_the_ways(numerator, denominator):
    """The follower goes N / D times the way of the leading axis, with a negative N the other way."""
    rig = in_gear(20.0, numerator, denominator)
    x, y = places(rig)
    rig.run(0.5)
    leading, following = places(rig)
    assert leading - x == pytest.approx(10.0)
    assert following - y == pytest.approx(numerator * 10.0 / denominator)


@pytest.mark.requirement("SYN-144", "SYN-301", "SYN-100")
def test_it_stays_in_gear_while_the_leading_axis_halts_and_starts():
    """The relation holds on the ramps and at rest; Execute FALSE does not end the job."""
    rig = in_gear(100.0, 2, 1)
    x, y = places(rig)
    rig.job.set(Execute=False)
    rig.until(rig.leader.halt().done)
    for _ in range(2):
        leading, following = places(rig)
        assert following - y == pytest.approx(2.0 * (leading - x), abs=1e-9)
        assert (rig.job.InGear, rig.job.Busy, word(rig.axis)) == (True, True, SYNCHRONOUS)
        rig.leader.move_relative(-7.0)
        rig.run(1.0)


@pytest.mark.requirement("SYN-118", "SYN-119")
def test_the_relation_is_exact_after_a_long_way():
    """The function is evaluated from its anchor: after thousands of cycles with a ratio of 1/3 nothing has
    added up.
    """
    rig = in_gear(300.0, 1, 3)
    x, y = places(rig)
    rig.run(40.0)
    leading, following = places(rig)
    assert following - y == pytest.approx((leading - x) / 3.0, abs=3e-12)


@pytest.mark.requirement("SYN-024")
def test_modulo_ranges_are_passed_without_a_step():
    """Leading and following axis with modulo ranges: the ways are counted on over both."""
    modulo = {"Modulo.Enable": True, "Modulo.Length": 50.0}
    rig = in_gear(200.0, 3, 2, leader=modulo, follower=modulo)
    rig.rows.clear()
    rig.run(2.0)
    velocities = rig.column("velocity_setpoint")
    assert velocities == pytest.approx([300.0] * len(velocities))
    assert 0.0 <= rig.axis.var("Position") < 50.0


@pytest.mark.requirement("SYN-145")
def test_an_accelerating_leading_axis_is_caught_up_with():
    """The leading axis accelerates with 500 mm/s2 while the follower synchronises with 2000: velocity and
    acceleration agree when InGear comes, and there is no step.
    """
    rig = gear(50.0, Acceleration=2000.0, Jerk=100_000.0)
    rig.leader.move_velocity(400.0, Acceleration=500.0, Jerk=0.0)
    rig.until(rig.job.in_gear)
    assert rig.leader.var("Acceleration") == pytest.approx(500.0)
    assert rig.axis.var("Velocity") == pytest.approx(rig.leader.var("Velocity"))
    assert rig.axis.var("Acceleration") == pytest.approx(500.0)
    changes = [b - a for a, b in zip(*(rig.column("velocity_setpoint")[n:] for n in (0, 1)), strict=False)]
    assert max(changes) <= 2000.0 * CYCLE + 1e-9


@pytest.mark.requirement("SYN-146")
def test_a_leading_axis_that_is_too_fast_is_waited_for():
    """The follower goes on with its highest velocity, without alarm 501, and reaches the leading value when
    that gets slow enough.
    """
    rig = gear(400.0, 2, 1, Acceleration=1e6)
    rig.run(1.0)
    assert rig.axis.var("Velocity") == pytest.approx(500.0)
    assert not rig.job.InGear
    assert rig.alarms_of("axis1") == [502]
    rig.leader.move_velocity(200.0)
    rig.until(rig.job.in_gear)
    assert rig.axis.var("Velocity") == pytest.approx(400.0)


@pytest.mark.requirement(
    "SYN-107", "SYN-112", "SYN-409", "SYN-042", "SYN-043", "SYN-044", "STP-201", "STP-211", "VAR-069"
)
def test_synchronous_travel_knows_no_dynamic_limits():
    """In gear the follower goes faster, accelerates and brakes harder than its limits allow; the bits of
    StatusSynchronizedMotion say so while it does, and no alarm comes.
    """
    rig = in_gear(
        200.0,
        2,
        1,
        follower={"DynamicLimits.MaxAcceleration": 1500.0, "DynamicLimits.MaxDeceleration": 1500.0},
    )
    seen = []
    rig.runtime.after_cycle.append(
        lambda: seen.append(
            (rig.axis.var("Velocity"), rig.axis.var("Acceleration"),
             rig.axis.var("StatusSynchronizedMotion.StatusWord"))
        )
    )  # fmt: skip
    rig.until(rig.leader.move_velocity(300.0, Acceleration=1000.0, Jerk=0.0).in_velocity)
    rig.run(0.2)
    rig.until(rig.leader.halt(Deceleration=1000.0, Jerk=0.0).done)
    rig.cycles(2)
    assert max(velocity for velocity, _, _ in seen) == pytest.approx(600.0)
    for velocity, acceleration, bits in seen:
        expected = (
            (velocity > 500.0 + 1e-6)
            | (acceleration > 1500.0 + 1e-6) << 1
            | (acceleration < -1500.0 - 1e-6) << 2
        )
        assert bits == expected
    assert {bits for *_, bits in seen} >= {0, 1, 2, 4}
    assert rig.alarms_of("axis1") == []


def test_a_second_gear_takes_over_without_a_step_of_the_velocity():
    """The first job ends with CommandAborted, and the axis synchronises again from its velocity."""
    rig = in_gear(100.0, 1, 1)
    rig.rows.clear()
    second = rig.axis.gear_in(rig.leader, 3, 1, Acceleration=1000.0)
    rig.cycles(2)
    assert (rig.job.CommandAborted, rig.job.InGear, second.Busy) == (True, False, True)
    rig.until(second.in_gear)
    velocity = rig.column("velocity_setpoint")
    assert max(b - a for a, b in itertools.pairwise(velocity)) <= 1000.0 * CYCLE + 1e-9
    assert velocity[-1] == pytest.approx(300.0)


@pytest.mark.requirement("SYN-036", "SYN-039")
def test_status_variables():
    """FunctionState, ActualMaster, leading and following value while a gear is active, zeros before and
    after.
    """
    rig = gear(100.0, 2, 1)
    prefix = "StatusSynchronizedMotion."
    rig.until(rig.job.in_gear)
    read = rig.axis.var
    assert (read(prefix + "FunctionState"), read(prefix + "ActualMaster")) == (1, rig.leader.object.db_number)
    assert rig.leader.object.db_number > 0
    assert read(prefix + "EffectiveLeadingValue.Position") == rig.leader.var("Position")
    assert read(prefix + "EffectiveLeadingValue.Velocity") == rig.leader.var("Velocity") == 100.0
    assert read(prefix + "FunctionFollowingValue.Position") == rig.axis.var("Position")
    assert read(prefix + "FunctionFollowingValue.Velocity") == 200.0
    rig.axis.halt()
    rig.cycles(2)
    assert (read(prefix + "FunctionState"), read(prefix + "ActualMaster"), word(rig.axis)) == (0, 0, 0)


@pytest.mark.requirement("SYN-321", "SYN-137", "SYN-138")
@pytest.mark.parametrize(
    ("inputs", "error"),
    [
        ({"RatioNumerator": 0}, 0x8017),
        ({"RatioNumerator": 1 << 31}, 0x8017),
        ({"RatioDenominator": 0}, 0x8018),
        ({"RatioDenominator": -1}, 0x8018),
        ({"Acceleration": 0.0}, 0x8004),
        ({"Deceleration": 0.0}, 0x8005),
        ({"Jerk": float("nan")}, 0x8006),
        ({"Master": None}, 0x8002),
    ],
)
def test_wrong_inputs(inputs, error):
    """Every input that is not permitted has its ErrorID, and nothing moves."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE)
    rig.enabled().leader_at(100.0)
    job = rig.axis.gear_in(rig.leader)
    job.set(**inputs)
    rig.cycles(3)
    assert (job.Error, job.ErrorID, job.Busy) == (True, error, False)
    assert rig.axis.var("Velocity") == 0.0


@pytest.mark.requirement("SYN-017")
def test_a_leading_axis_that_is_not_interconnected():
    """Alarm 601 with reaction 2 and ErrorWord.X14, and the job ends with 16#8001."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE)
    rig.enabled().leader_at(100.0)
    rig.axis.object.leading_objects = ()
    job = rig.axis.gear_in(rig.leader)
    rig.cycles(2)
    assert (job.Error, job.ErrorID) == (True, 0x8001)
    (alarm,) = rig.axis.object.engine.pending
    assert (alarm.number, alarm.reaction) == (601, 2)
    assert rig.axis.var("ErrorWord") == 1 << 14


@pytest.mark.requirement("SYN-025", "SYN-311")
def test_a_leading_axis_without_position_control():
    """Alarm 603 with reaction 4 and ErrorWord.X14."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables={"VirtualAxis.Mode": 0})
    rig.enabled().leader_at(0.0)
    rig.until(rig.leader.move_velocity(50.0, PositionControlled=False).in_velocity)
    job = rig.axis.gear_in(rig.leader)
    rig.cycles(2)
    assert (job.Error, job.ErrorID) == (True, 0x8001)
    (alarm,) = rig.axis.object.engine.pending
    assert (alarm.number, alarm.reaction, rig.axis.var("ErrorWord")) == (603, 4, 1 << 14)


@pytest.mark.requirement("SYN-127", "SYN-312", "SYN-101")
def test_a_leading_value_that_turns_round_too_early():
    """While the follower synchronises a reversal is alarm 608 with reaction 2, and the job ends with
    16#8001; in gear it is followed.
    """
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE)
    rig.enabled().leader_at(100.0)
    rig.until(rig.axis.move_velocity(-100.0).in_velocity)
    rig.job = rig.axis.gear_in(rig.leader, Acceleration=20.0, Deceleration=20.0, Jerk=0.0)
    rig.leader.move_velocity(-50.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0)
    rig.run(0.2)
    assert (rig.job.Error, rig.job.ErrorID, rig.job.InGear) == (True, 0x8001, False)
    (alarm,) = rig.axis.object.engine.pending
    assert (alarm.number, alarm.reaction, rig.axis.var("ErrorWord")) == (608, 2, 1 << 14)
    other = in_gear(100.0)
    other.leader.move_velocity(-100.0)
    other.run(1.0)
    assert other.job.InGear
    assert other.axis.var("Velocity") == pytest.approx(-100.0)


def test_a_follower_that_is_not_enabled_or_stops():
    """16#800F, and no alarm."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE)
    rig.leader_at(100.0)
    job = rig.axis.gear_in(rig.leader)
    rig.cycles(2)
    assert (job.Error, job.ErrorID) == (True, 0x800F)
    rig.enabled()
    rig.axis.stop(0)
    rig.cycles(2)
    late = rig.axis.gear_in(rig.leader)
    rig.cycles(2)
    assert (late.Error, late.ErrorID) == (True, 0x800F)
    assert rig.alarms_of("axis1") == []


@pytest.mark.requirement("SYN-369", "SYN-028")
def test_homing_the_leading_axis_steps_the_follower():
    """The coordinate system of the leading axis moves by 5 mm, and with it the setpoint of the follower."""
    rig = in_gear(0.0, 2, 1)
    before = places(rig)[1]
    rig.leader.home(rig.leader.var("Position") + 5.0)
    rig.cycles(2)
    assert places(rig)[1] - before == pytest.approx(10.0)
    assert rig.job.InGear


def test_homing_the_follower_shifts_its_positions_only():
    """The coordinate system of the follower moves, the axis does not, and the relation of the ways stays."""
    rig = in_gear(100.0, 2, 1)
    rig.rows.clear()
    rig.axis.home(500.0)
    rig.cycles(3)
    x, y = places(rig)
    assert y == pytest.approx(500.0, abs=4.0)
    rig.run(0.5)
    leading, following = places(rig)
    assert following - y == pytest.approx(2.0 * (leading - x), abs=1e-9)
    velocities = rig.column("velocity_setpoint")
    assert velocities == pytest.approx([200.0] * len(velocities))
    assert rig.job.InGear


@pytest.mark.requirement("SYN-293")
def test_disabling_the_leading_axis_ends_nothing():
    """The follower goes down the ramp with the leading axis, and follows again after it."""
    rig = in_gear(100.0)
    x, y = places(rig)
    rig.leader_power.set(Enable=False)
    rig.run(1.0)
    leading, following = places(rig)
    assert rig.leader.var("Velocity") == 0.0
    assert following - y == pytest.approx(leading - x, abs=1e-9)
    rig.leader_at(50.0)
    assert rig.job.InGear
    assert rig.axis.var("Velocity") == pytest.approx(50.0)


@pytest.mark.parametrize("synchronous", [False, True])
def test_disabling_the_follower_ends_the_gear(synchronous):
    """In either phase; it does not come back by itself."""
    rig = (in_gear if synchronous else gear)(100.0, Acceleration=100.0)
    rig.power.set(Enable=False)
    rig.run(1.0)
    assert (rig.job.CommandAborted, rig.job.InGear) == (True, False)
    rig.enabled()
    rig.run(0.2)
    assert rig.axis.var("Velocity") == 0.0
    assert rig.leader.var("Velocity") == pytest.approx(100.0)


@pytest.mark.requirement("SYN-322", "SYN-018", "SYN-015")
def test_chains_and_circles():
    """A chain of three moves within one cycle, whatever the order in which the axes were made; an axis at its
    end cannot lead the first one (16#8019), nor an axis itself.
    """
    rig = in_gear(100.0, 2, 1)
    third = SynchronousAxis(
        "third",
        SimulatedDrivePort(cycle_s=CYCLE),
        cycle_ns=rig.cycle_ns,
        variables=REFERENCE | FIXTURE | {"DynamicLimits.MaxVelocity": 5000.0},
        history=rig.history,
    )
    third.leading_objects = (rig.axis.object,)
    rig.runtime.add(third)
    rig.runtime.axes.reverse()
    rig.runtime.order_axes()
    last = AxisHandle(rig.runtime, third)
    rig.until(last.power().status)
    job = last.gear_in(rig.axis, 3, 1)
    rig.until(job.in_gear)
    x, z = rig.leader.object.servo.total.s, third.servo.total.s
    rig.until(rig.leader.move_velocity(150.0).in_velocity)
    rig.run(0.1)
    assert third.servo.total.s - z == pytest.approx(6.0 * (rig.leader.object.servo.total.s - x), abs=1e-9)
    for leader in (last, rig.axis):
        circle = rig.axis.gear_in(leader)
        rig.cycles(2)
        assert (circle.Error, circle.ErrorID) == (True, 0x8019)
    assert rig.job.InGear


@pytest.mark.exhaustive
@given(
    numerator=st.integers(-9, 9).filter(bool),
    denominator=st.integers(1, 9),
    velocities=st.lists(st.floats(5.0, 50.0), min_size=1, max_size=3),
    jerk=st.sampled_from([0.0, 20_000.0]),
)
def test_any_ratio_and_any_leading_motion(numerator, denominator, velocities, jerk):
    """In gear the relation of the positions is exact, and velocity and acceleration are its derivatives."""
    rig = in_gear(velocities[0], numerator, denominator, Jerk=jerk)
    ratio = numerator / denominator
    x, y = places(rig)
    for velocity in velocities:
        rig.leader.move_velocity(velocity)
        for _ in range(20):
            rig.cycles()
            leading, following = places(rig)
            assert following - y == pytest.approx(ratio * (leading - x), abs=1e-9)
            assert rig.axis.var("Velocity") == pytest.approx(ratio * rig.leader.var("Velocity"), abs=1e-9)
            assert rig.axis.var("Acceleration") == pytest.approx(
                ratio * rig.leader.var("Acceleration"), abs=1e-6
            )
