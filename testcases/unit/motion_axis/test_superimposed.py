"""Superimposed motion on top of a basic one (sections 2.9 and 2.10 of the instruction specification)."""

from __future__ import annotations

import itertools

import pytest

from motion.s7.axis import AxisState

X6_DONE, X23_SUPERIMPOSED = 1 << 6, 1 << 23
X7_HALT_SUPERIMPOSED = 1 << 7


@pytest.mark.requirement("STP-192", "STP-199", "STP-203", "MC-351", "MC-359")
@pytest.mark.parametrize("distance", [50.0, 20.0])
def test_both_distances_add_up(rig, distance):
    """MC_MoveRelative 50 with a superimposed distance on top ends at the sum; the axis shows the sum all the
    time.
    """
    rig.enabled()
    basic = rig.axis.move_relative(50.0)
    rig.run(0.2)
    top = rig.axis.move_superimposed(distance)
    rig.run(0.1)
    assert basic.Busy
    assert top.Busy
    assert rig.axis.var("StatusPositioning.TargetPosition") == pytest.approx(50.0 + distance)
    rig.until(top.done)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL)
    assert basic.Done
    assert rig.column("position_setpoint")[-1] == pytest.approx(50.0 + distance, abs=1e-6)
    assert rig.axis.var("Position") == pytest.approx(50.0 + distance, abs=1e-6)


@pytest.mark.requirement("MC-360")
def test_opposite_distance_takes_the_axis_back(rig):
    """50 and -50 on top: the axis reverses, since the superimposed velocity exceeds the basic one, and ends
    at 0.
    """
    rig.enabled()
    basic = rig.axis.move_relative(50.0, Velocity=50.0)
    rig.run(0.3)
    top = rig.axis.move_superimposed(-50.0, VelocityDiff=200.0)
    rig.until(top.done)
    rig.until(basic.done)
    assert min(rig.column("velocity_setpoint")) < -50.0
    assert rig.column("position_setpoint")[-1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.requirement("STP-200", "STP-198", "MC-352", "MC-345")
def test_the_sum_respects_the_velocity_limit(rig):
    """At 400 of 500 mm/s the superimposed motion gets 100 mm/s, whatever VelocityDiff says; -1 is the default
    velocity.
    """
    rig.travelling(400.0)
    top = rig.axis.move_superimposed(60.0, VelocityDiff=300.0)
    rig.until(top.done)
    assert max(rig.column("velocity_setpoint")) == pytest.approx(500.0, abs=1e-6)
    slow = rig.axis.move_superimposed(-30.0)
    rig.until(slow.done)
    assert min(rig.column("velocity_setpoint")[-200:]) == pytest.approx(300.0, abs=1e-6)


@pytest.mark.requirement("MC-352")
def test_a_basic_motion_that_accelerates_takes_the_room_away(rig):
    """The limit holds also where the basic motion gets faster while the superimposed one runs."""
    rig.travelling(100.0)
    top = rig.axis.move_superimposed(400.0, VelocityDiff=300.0)
    rig.run(0.6)
    rig.axis.write("Override.Velocity", 200.0)
    rig.run(0.5)
    rig.axis.write("Override.Velocity", 100.0)
    rig.until(top.done)
    rig.axis.halt()
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL)
    assert max(rig.column("velocity_setpoint")) <= 500.0 + 1e-6


@pytest.mark.requirement("STP-200", "MC-352")
def test_a_basic_motion_that_reverses_takes_the_room_away_in_time(make_rig):
    """What a reversal leads to counts from its beginning, so that the sum is within the limit when the basic
    motion gets there.
    """
    rig = make_rig(variables={"DynamicLimits.MaxJerk": 1.0e6}).travelling(240.0)
    rig.axis.move_velocity(-500.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0)
    rig.cycles()
    rig.axis.move_superimposed(-36.0, VelocityDiff=125.0, Acceleration=900.0, Deceleration=1200.0)
    rig.run(0.6)
    assert min(rig.column("velocity_setpoint")) == pytest.approx(-500.0, abs=1e-6)


@pytest.mark.requirement("STP-119", "STP-195", "STP-200")
@pytest.mark.parametrize("new", ["move", "halt"])
def test_what_is_carried_over_keeps_the_limit(rig, new):
    """A superimposed job with a low jerk takes the acceleration of the one before over, as far as the limit
    of the sum allows.
    """
    rig.enabled()
    rig.axis.move_superimposed(80.0, VelocityDiff=400.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0)
    rig.run(0.1)
    if new == "move":
        rig.axis.move_superimposed(18.0, VelocityDiff=30.0, Jerk=2000.0)
    else:
        rig.axis.halt_superimposed(Jerk=2000.0)
    rig.run(1.5)
    assert 300.0 < max(rig.column("velocity_setpoint")) <= 500.0 + 1e-6


@pytest.mark.requirement("MC-352", "MC-355")
def test_no_room_at_all_lets_the_superimposed_motion_wait(rig):
    """At full velocity nothing can be added in its direction: the distance comes when the basic motion leaves
    room.
    """
    rig.travelling(500.0)
    before = rig.axis.var("Position")
    top = rig.axis.move_superimposed(10.0)
    rig.run(0.2)
    assert top.Busy
    assert max(rig.column("velocity_setpoint")) <= 500.0 + 1e-6
    rig.axis.move_velocity(500.0)
    rig.cycles(2)
    assert top.CommandAborted
    again = rig.axis.move_superimposed(10.0)
    rig.axis.halt(Mode=1)
    rig.until(again.done)
    assert rig.axis.var("Position") > before


@pytest.mark.requirement("STP-197", "STP-007", "MC-353", "MC-110", "VAR-047")
def test_status_bit_and_distance(rig):
    """X23 while it runs, SuperimposedDistance counts what it has covered, and is 0 again when both have
    ended.
    """
    rig.enabled()
    rig.axis.move_relative(100.0)
    rig.run(0.2)
    top = rig.axis.move_superimposed(30.0)
    rig.run(0.2)
    assert rig.axis.var("StatusWord") & X23_SUPERIMPOSED
    assert 0.0 < rig.axis.var("StatusPositioning.SuperimposedDistance") < 30.0
    rig.until(top.done)
    assert rig.axis.var("StatusPositioning.SuperimposedDistance") == pytest.approx(30.0)
    assert not rig.axis.var("StatusWord") & X23_SUPERIMPOSED
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL)
    assert rig.axis.var("StatusPositioning.SuperimposedDistance") == 0.0


@pytest.mark.requirement("MC-355")
def test_superimposed_motion_outlives_the_basic_one(rig):
    """A basic motion that ends first is Done; the superimposed one goes on to its end."""
    rig.enabled()
    basic = rig.axis.move_relative(5.0)
    top = rig.axis.move_superimposed(100.0)
    rig.until(basic.done)
    assert top.Busy
    assert not rig.axis.var("StatusWord") & X6_DONE
    rig.until(top.done)
    assert rig.column("position_setpoint")[-1] == pytest.approx(105.0, abs=1e-6)
    rig.cycles(1)
    assert rig.axis.var("StatusWord") & X6_DONE


@pytest.mark.requirement("MC-356", "OVR-093")
def test_without_a_basic_motion_it_moves_the_axis(rig):
    """At standstill the axis moves by the distance; an appended positioning becomes the basic motion at
    once.
    """
    rig.enabled()
    top = rig.axis.move_superimposed(100.0)
    rig.run(0.2)
    assert rig.axis.state is AxisState.MOTION
    basic = rig.axis.move_relative(20.0, BufferMode=1)
    rig.cycles(2)
    assert basic.Active
    assert top.Busy
    rig.until(top.done)
    rig.until(lambda: rig.axis.state is AxisState.STANDSTILL)
    assert rig.column("position_setpoint")[-1] == pytest.approx(120.0, abs=1e-6)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-195", "MC-357", "OVR-016")
def test_a_new_superimposed_motion_replaces_the_running_one(rig):
    """The old one is aborted; the new distance counts from where the superimposed motion is."""
    rig.travelling(100.0)
    first = rig.axis.move_superimposed(200.0)
    rig.run(0.5)
    covered = rig.axis.var("StatusPositioning.SuperimposedDistance")
    second = rig.axis.move_superimposed(50.0)
    rig.cycles(2)
    assert first.CommandAborted
    rig.until(second.done)
    assert rig.axis.var("StatusPositioning.SuperimposedDistance") == pytest.approx(covered + 50.0, abs=1.0)


@pytest.mark.requirement(
    "STP-196", "STP-206", "STP-209", "MC-371", "MC-372", "MC-374", "MC-370", "MC-112", "MC-367"
)
def test_halt_superimposed_leaves_the_basic_motion_alone(rig):
    """X23 falls, X7 rises until the superimposed velocity is 0; the basic positioning arrives as if nothing
    was.
    """
    rig.enabled()
    basic = rig.axis.move_relative(300.0)
    rig.run(0.3)
    top = rig.axis.move_superimposed(300.0)
    rig.run(0.2)
    assert rig.axis.var("StatusWord") & X23_SUPERIMPOSED
    halt = rig.axis.halt_superimposed()
    rig.cycles(2)
    assert top.CommandAborted
    assert halt.Busy
    assert not rig.axis.var("StatusWord") & X23_SUPERIMPOSED
    assert rig.axis.var("StatusWord2") & X7_HALT_SUPERIMPOSED
    rig.until(halt.done)
    assert not rig.axis.var("StatusWord2") & X7_HALT_SUPERIMPOSED
    assert rig.column("velocity_setpoint")[-1] == pytest.approx(100.0, abs=1e-6)
    added = rig.axis.var("StatusPositioning.SuperimposedDistance")
    rig.until(basic.done)
    assert rig.column("position_setpoint")[-1] == pytest.approx(300.0 + added, abs=1e-6)


@pytest.mark.requirement("STP-208", "MC-366", "MC-372", "MC-373")
def test_abort_acceleration_of_the_halt(rig):
    """Without AbortAcceleration the acceleration first ends with the jerk; with it, braking begins at
    once.
    """
    peaks = []
    for abort in (False, True):
        rig.enabled()
        rig.axis.move_velocity(50.0)
        rig.run(0.5)
        rig.axis.move_superimposed(200.0, Jerk=2000.0, Acceleration=500.0)
        rig.run(0.2)
        at = rig.column("velocity_setpoint")[-1]
        halt = rig.axis.halt_superimposed(AbortAcceleration=abort, Jerk=2000.0)
        seen = len(rig.rows)
        rig.until(halt.done)
        peaks.append(max(rig.column("velocity_setpoint")[seen:]) - at)
        rig.until(rig.axis.halt().done)
    assert peaks[0] > 20.0
    assert peaks[1] < 5.0


@pytest.mark.requirement("STP-207", "MC-369")
def test_halt_without_superimposed_motion_is_done_at_once(rig):
    """Nothing to halt: Done in the call that starts it, never Busy, and the basic motion goes on."""
    rig.travelling(100.0)
    halt = rig.axis.halt_superimposed()
    rig.cycles(1)
    assert halt.Done
    assert not halt.Busy
    assert rig.column("velocity_setpoint")[-1] == pytest.approx(100.0)


@pytest.mark.requirement("MC-086", "MC-087", "MC-088", "MC-346", "MC-347", "MC-364")
@pytest.mark.parametrize(
    ("name", "error"), [("VelocityDiff", 0x8003), ("Acceleration", 0x8004), ("Deceleration", 0x8005)]
)
def test_zero_is_no_dynamic_value(rig, name, error):
    """0.0 is not allowed for velocity, acceleration and deceleration; the basic motion goes on."""
    rig.travelling(100.0)
    job = rig.axis.move_superimposed(10.0, **{name: 0.0})
    rig.cycles(1)
    assert job.ErrorID == error
    if name == "Deceleration":
        halt = rig.axis.halt_superimposed(Deceleration=0.0)
        rig.cycles(1)
        assert halt.ErrorID == error
    assert rig.job.InVelocity


@pytest.mark.requirement("MC-341")
def test_a_disabled_axis_refuses(rig):
    """The axis has to be enabled."""
    job = rig.axis.move_superimposed(10.0)
    rig.cycles(1)
    assert job.ErrorID == 0x800F


@pytest.mark.requirement("MC-051", "MC-043")
def test_a_speed_axis_has_no_superimposed_motion(make_rig):
    """The instruction needs a position: 16#8002 on a speed axis."""
    rig = make_rig(speed=True)
    for job in (rig.axis.move_superimposed(10.0), rig.axis.halt_superimposed()):
        rig.cycles(1)
        assert job.ErrorID == 0x8002


@pytest.mark.requirement("MC-118", "MC-063")
@pytest.mark.parametrize("number", [321, 533])
def test_an_alarm_brakes_the_sum_without_a_step(rig, number):
    """The ramp of an alarm starts from the velocity of the sum, and both jobs end with 16#8001."""
    rig.travelling(200.0)
    top = rig.axis.move_superimposed(300.0)
    rig.run(0.5)
    rig.axis.object.alarms.raise_alarm(number)
    rig.cycles(2)
    assert top.ErrorID == 0x8001
    assert rig.job.ErrorID == 0x8001
    velocity = rig.column("velocity_setpoint")
    steps = [abs(b - a) for a, b in itertools.pairwise(velocity)]
    assert max(steps[-20:]) <= 4000.0 * 0.004 + 0.1  # the actual velocity is quantised
    rig.until(lambda: rig.column("velocity_setpoint")[-1] == 0.0)


@pytest.mark.requirement("OVR-014", "OVR-017", "OVR-008")
@pytest.mark.parametrize("new", ["halt", "stop", "velocity", "relative"])
def test_what_aborts_it_continues_from_the_sum(rig, new):
    """A job that aborts the superimposed motion takes position, velocity and acceleration of the sum over."""
    rig.travelling(100.0)
    top = rig.axis.move_superimposed(300.0, VelocityDiff=150.0)
    rig.run(0.4)
    {
        "halt": rig.axis.halt,
        "stop": lambda: rig.axis.stop(3),
        "velocity": lambda: rig.axis.move_velocity(20.0),
        "relative": lambda: rig.axis.move_relative(40.0),
    }[new]()
    rig.run(1.5)
    assert top.CommandAborted
    velocity = rig.column("velocity_setpoint")
    position = rig.column("position_setpoint")
    assert max(abs(b - a) for a, b in itertools.pairwise(velocity)) <= 1000.0 * 0.004 + 1e-6
    assert max(abs(b - a) for a, b in itertools.pairwise(position)) <= 251.0 * 0.004


@pytest.mark.requirement("OVR-013", "OVR-090")
def test_halt_mode_1_takes_the_basic_motion_only(rig):
    """MC_Halt Mode 1 ends the basic motion; the superimposed one goes on to its end."""
    rig.travelling(100.0)
    top = rig.axis.move_superimposed(200.0)
    rig.run(0.3)
    halt = rig.axis.halt(Mode=1)
    rig.until(halt.done)
    assert top.Busy
    rig.until(top.done)


@pytest.mark.requirement("LIM-075")
def test_software_limit_counts_the_sum(make_rig):
    """The axis stops at the software limit although the basic motion alone would stay inside."""
    rig = make_rig(
        variables={
            "PositionLimits_SW.Active": True,
            "PositionLimits_SW.MaxPosition": 100.0,
            "PositionLimits_SW.MinPosition": -100.0,
        }
    )
    rig.enabled()
    rig.axis.home(0.0)
    rig.cycles(2)
    rig.axis.move_absolute(80.0)
    rig.run(0.2)
    rig.axis.move_superimposed(60.0)
    rig.run(3.0)
    assert [event.data["number"] for event in rig.events("alarm.raised")] == [533]
    assert rig.axis.var("Position") == pytest.approx(100.0, abs=1e-3)


@pytest.mark.requirement("MC-351")
def test_homing_moves_the_scale_of_both(rig):
    """Setting the position during superimposed motion shifts the sum and loses nothing of the distance."""
    rig.travelling(100.0)
    top = rig.axis.move_superimposed(100.0)
    rig.run(0.3)
    before = rig.axis.var("Position")
    rig.axis.home(1000.0, mode=1)
    rig.cycles(1)
    assert rig.axis.var("Position") - before == pytest.approx(1000.0, abs=1.0)
    rig.until(top.done)
    assert rig.axis.var("StatusPositioning.SuperimposedDistance") == pytest.approx(100.0)


@pytest.mark.requirement("STP-607")
@pytest.mark.parametrize("moving", [False, True], ids=["at rest", "under a basic motion"])
@pytest.mark.parametrize(
    ("limit", "alarm"), [("MaxAcceleration", 305), ("MaxDeceleration", 305), ("MaxJerk", 306)]
)
def test_limit_of_zero(rig, limit, alarm, moving):
    """A dynamic limit of zero: alarm 305 or 306, and the superimposed job ends with an error."""
    rig.enabled()
    basic = rig.axis.move_velocity(100.0) if moving else None
    rig.run(0.2)
    rig.axis.write(f"DynamicLimits.{limit}", 0.0)
    top = rig.axis.move_superimposed(50.0)
    rig.cycles(3)
    assert rig.events("alarm.raised")[0].data["number"] == alarm
    assert (top.Error, top.ErrorID, top.Busy) == (True, 0x8001, False)
    assert basic is None or basic.Error
