"""MC_MotionInSuperimposed: distances from the user program on top of a basic motion (§5.14.2, §8.16.3)."""

from __future__ import annotations

from itertools import pairwise

import pytest

from motion.s7.axis import AxisState
from motion.s7.instructions import MC_MotionInVelocity

X6_DONE, X23_SUPERIMPOSED, X31_MOTION_IN = 1 << 6, 1 << 23, 1 << 31
X6_GIVEN_SUPERIMPOSED, X7_HALT_SUPERIMPOSED = 1 << 6, 1 << 7
CYCLE = 0.004
LOOSE = {"FollowingError.EnableMonitoring": False}


@pytest.mark.requirement(
    "MIN-014",
    "MIN-033",
    "MIN-034",
    "MIN-016",
    "MIN-035",
    "MC-504",
    "MC-505",
    "MC-510",
    "MC-511",
    "MC-111",
    "VAR-063",
)
def test_a_distance_on_top_of_a_basic_motion(rig):
    """The setpoints are sums in every cycle; the command bit is X6 of the second word, not X23, and
    FunctionState stays 0.
    """
    rig.enabled()
    rig.axis.home(0.0)
    basic = rig.axis.move_absolute(100.0)
    rig.until(basic.done)
    top = rig.axis.motion_in_superimposed(0.0)
    rig.cycles()
    steps = [{"Distance": -2.5 * n / 50, "VelocityDiff": -2.5 / 50 / CYCLE} for n in range(1, 51)]
    for vector in steps:
        rig.feed(top, [vector])
        rig.cycles()
        assert rig.axis.var("Position") == pytest.approx(100.0 + vector["Distance"])
        assert rig.axis.var("Velocity") == pytest.approx(vector["VelocityDiff"])
        assert rig.axis.status_word2 & X6_GIVEN_SUPERIMPOSED
        assert not rig.axis.status_word & (X23_SUPERIMPOSED | X31_MOTION_IN | X6_DONE)
        assert rig.axis.var("StatusMotionIn.FunctionState") == 0
    assert rig.axis.var("Position") == pytest.approx(97.5)
    assert rig.axis.var("StatusPositioning.SuperimposedDistance") == pytest.approx(-2.5)


@pytest.mark.requirement("MIN-033", "MC-506", "MC-511")
def test_velocities_and_accelerations_add_up(rig):
    """On top of MC_MoveVelocity and of MC_MotionInPosition."""
    rig.travelling(100.0)
    rig.axis.motion_in_superimposed(0.0, VelocityDiff=3.0, AccelerationDiff=8.0)
    rig.cycles(2)
    assert rig.axis.var("Velocity") == pytest.approx(103.0)
    assert rig.axis.var("Acceleration") == pytest.approx(8.0)


@pytest.mark.requirement("MIN-031", "MC-501")
def test_position_control_is_needed(rig):
    """X28 TRUE: 16#8071, the basic motion goes on."""
    rig.enabled()
    basic = rig.axis.move_velocity(50.0, PositionControlled=False)
    rig.run(0.5)
    top = rig.axis.motion_in_superimposed(1.0)
    rig.cycles(2)
    assert (top.Error, top.ErrorID) == (True, 0x8071)
    assert basic.Busy


@pytest.mark.requirement("MIN-036", "MC-508", "MIN-030")
def test_the_basic_motion_ends_first(rig):
    """Its end does not end the superimposed job; the sum may exceed the velocity limit that holds for the
    basic motion.
    """
    rig.enabled()
    basic = rig.axis.move_relative(20.0)
    top = rig.axis.motion_in_superimposed(0.0)
    rig.feed(top, [{"Distance": 0.8 * n, "VelocityDiff": 200.0} for n in range(1, 60)])
    top.set(VelocityDiff=0.0)
    rig.until(basic.done)
    assert top.Busy
    assert rig.axis.state is AxisState.MOTION
    assert rig.axis.var("Position") == pytest.approx(20.0 + 0.8 * 59)


@pytest.mark.requirement("MIN-036", "MIN-038")
@pytest.mark.parametrize("basic", ["MC_MoveVelocity", "MC_MotionInVelocity"])
def test_the_sum_is_not_limited(make_rig, basic):
    """450 and 200 mm/s make 650 of 500."""
    rig = make_rig(variables=LOOSE)
    if basic == "MC_MoveVelocity":
        rig.travelling(450.0)
    else:
        rig.enabled()
        rig.feed(rig.axis.motion_in_velocity(0.0), [{"Velocity": 9.0 * step} for step in range(51)])
    rig.axis.motion_in_superimposed(0.0, VelocityDiff=200.0)
    rig.cycles(3)
    assert rig.axis.var("Velocity") == pytest.approx(650.0)


@pytest.mark.requirement("MIN-040", "MC-503")
@pytest.mark.parametrize("basic", ["none", "MC_MotionInPosition", "MC_MoveRelative"])
def test_falling_enable_keeps_the_distance(rig, basic):
    """The differences are 0 at once, the last distance stays in effect, also under positions that come from
    outside.
    """
    rig.enabled()
    outer = rig.axis.motion_in_position(0.0) if basic == "MC_MotionInPosition" else None
    moving = rig.axis.move_relative(1.0) if basic == "MC_MoveRelative" else None
    if moving is not None:
        rig.run(0.1)
    top = rig.axis.motion_in_superimposed(0.0)
    rig.cycles()
    rig.feed(top, [{"Distance": 0.05 * n, "VelocityDiff": 12.5} for n in range(1, 101)])
    rig.cycles()
    top.set(Enable=False)
    rig.cycles(2)
    assert not top.Busy
    assert not rig.axis.status_word2 & X6_GIVEN_SUPERIMPOSED
    rig.run(1.0)
    end = 5.0 + (1.0 if moving is not None else 0.0)
    assert rig.axis.var("Position") == pytest.approx(end)
    assert rig.axis.var("Velocity") == 0.0
    if outer is not None:
        assert outer.Busy
        rig.feed(outer, [{"Position": -0.2}])
        rig.cycles()
        assert rig.axis.var("Position") == pytest.approx(end - 0.2)
        outer.set(Enable=False)
        rig.cycles(2)
        assert rig.axis.var("Position") == pytest.approx(end - 0.2)


@pytest.mark.requirement("MIN-041", "MIN-015", "STP-206", "MC-506")
@pytest.mark.parametrize("abort_acceleration", [False, True])
def test_halt_superimposed_starts_from_the_given_state(make_rig, abort_acceleration):
    """AbortAcceleration FALSE: the given acceleration is first reduced with the jerk, so that the velocity
    grows further.
    """
    rig = make_rig(variables=LOOSE).travelling(100.0)
    top = rig.axis.motion_in_superimposed(0.0, VelocityDiff=50.0, AccelerationDiff=400.0)
    rig.cycles(3)
    halt = rig.axis.halt_superimposed(Deceleration=400.0, Jerk=2000.0, AbortAcceleration=abort_acceleration)
    rig.cycles(2)
    assert top.CommandAborted
    assert rig.axis.status_word2 & X7_HALT_SUPERIMPOSED
    rig.until(halt.done)
    highest = max(rig.column("velocity_setpoint"))
    assert highest == pytest.approx(150.0 if abort_acceleration else 150.0 + 400.0**2 / (2 * 2000.0), abs=2.0)
    assert rig.axis.var("Velocity") == pytest.approx(100.0)
    assert rig.job.Busy


@pytest.mark.exhaustive
@pytest.mark.requirement("MIN-042")
@pytest.mark.parametrize("mode", [0, 1])
def test_halt_modes(rig, mode):
    """MC_Halt Mode 0 ends basic and superimposed motion, Mode 1 the basic one only."""
    rig.travelling(100.0)
    top = rig.axis.motion_in_superimposed(0.0)
    rig.cycles(2)
    halt = rig.axis.halt(Mode=mode)
    rig.cycles(2)
    assert top.CommandAborted is (mode == 0)
    assert top.Busy is (mode == 1)
    rig.until(lambda: rig.axis.var("Velocity") == 0.0)
    rig.run(0.5)
    assert halt.Done
    assert top.Busy is (mode == 1)


@pytest.mark.requirement("MIN-049", "OVR-016")
@pytest.mark.parametrize("active", ["MC_MoveSuperimposed", "MC_MotionInSuperimposed", "MC_HaltSuperimposed"])
def test_a_new_one_aborts_superimposed_jobs_only(rig, active):
    """Column H7; distances go on to count from where the new job takes over, without a step."""
    rig.travelling(50.0)
    if active == "MC_MotionInSuperimposed":
        running = rig.axis.motion_in_superimposed(0.0)
        rig.feed(running, [{"Distance": 0.02 * n, "VelocityDiff": 5.0} for n in range(1, 50)])
    else:
        running = rig.axis.move_superimposed(100.0)
        rig.run(0.2)
        if active == "MC_HaltSuperimposed":
            running = rig.axis.halt_superimposed(Deceleration=50.0)
            rig.run(0.05)
    new = rig.axis.motion_in_superimposed(0.0)
    rig.cycles(3)
    assert running.CommandAborted
    assert new.Busy
    assert rig.job.Busy
    positions = rig.column("position_setpoint")[-6:]
    assert max(b - a for a, b in pairwise(positions)) < 1.0


@pytest.mark.requirement("MIN-002", "MC-473")
def test_the_latest_vector_of_a_cycle_acts(rig):
    """Several calls between two cycles of the axis: the last one counts, and stays until it is replaced."""
    rig.enabled()
    instance = MC_MotionInVelocity(rig.axis.object)
    instance(Enable=True, Velocity=5.0)
    instance(Velocity=7.0)
    instance(Velocity=9.0)
    rig.cycles(4)
    assert rig.axis.var("Velocity") == 9.0
    assert set(rig.column("velocity_setpoint")) == {0.0, 9.0}
