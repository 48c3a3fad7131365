"""Setpoints from the user program: MC_MotionInVelocity, MC_MotionInPosition, MC_MotionInSuperimposed (§5.14,
§8.16).
"""

from __future__ import annotations

from itertools import pairwise
from math import nan

import pytest

from fieldbus.errors import ConfigurationError
from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import AxisState, PositioningAxis
from motion.s7.instructions import MC_MotionInPosition, MC_MotionInSuperimposed, MC_MotionInVelocity

CYCLE = 0.004
X6_DONE, X10_VELOCITY, X23_SUPERIMPOSED = 1 << 6, 1 << 10, 1 << 23
X28_NOT_CONTROLLED, X31_MOTION_IN = 1 << 28, 1 << 31
X6_GIVEN_SUPERIMPOSED, X7_HALT_SUPERIMPOSED = 1 << 6, 1 << 7
LOOSE = {"FollowingError.EnableMonitoring": False}


# -- velocity
# ---------------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "MIN-001", "MIN-018", "MIN-019", "MC-473", "MC-484", "MC-485", "MC-486", "CFG-064", "MC-082"
)
def test_velocity_becomes_the_setpoint_in_the_next_cycle(rig):
    """Velocity 30 shows one application cycle later; the position advances by 30 * T per cycle; Acceleration
    is shown as given.
    """
    rig.enabled()
    job = rig.axis.motion_in_velocity(30.0, Acceleration=7.0)
    rig.cycles()
    assert job.Busy
    assert rig.axis.var("Velocity") == 0.0  # the call came after the setpoints of this cycle
    before = rig.axis.var("Position")
    for step in range(1, 6):
        rig.cycles()
        assert rig.axis.var("Velocity") == 30.0
        assert rig.axis.var("Acceleration") == 7.0
        assert rig.axis.var("Position") == pytest.approx(before + step * 30.0 * CYCLE, abs=1e-9)
    assert not rig.axis.alarms.engine.error_word


@pytest.mark.requirement("MC-488", "MC-098", "CTL-088", "MIN-020", "MC-489")
def test_without_position_control_every_cycle_is_followed(rig):
    """Timeline A: Velocity and Acceleration arrive unfiltered; the following error cannot be determined. B:
    nothing after Enable.
    """
    rig.enabled()
    job = rig.axis.motion_in_velocity(10.0, PositionControlled=False)
    rig.cycles(2)
    for velocity, acceleration in ((12.0, 500.0), (-40.0, -3.0), (0.0, 0.0), (25.0, 1.0)):
        rig.feed(job, [{"Velocity": velocity, "Acceleration": acceleration}])
        rig.cycles()
        assert (rig.axis.var("Velocity"), rig.axis.var("Acceleration")) == (velocity, acceleration)
        assert rig.axis.var("StatusPositioning.FollowingError") == 0.0
        assert rig.axis.status_word & X28_NOT_CONTROLLED
    job.set(Enable=False)
    rig.cycles(2)
    job.set(Velocity=80.0)
    rig.cycles(3)
    assert rig.axis.var("Velocity") == 0.0
    assert rig.axis.status_word & X28_NOT_CONTROLLED  # the selected mode stays


@pytest.mark.requirement("MIN-003")
def test_a_vector_that_is_not_renewed_goes_on(rig):
    """Nobody updates the vector: velocity mode keeps moving, position mode stands and still precontrols."""
    rig.enabled()
    rig.axis.motion_in_velocity(20.0)
    rig.run(0.5)
    assert rig.axis.var("Velocity") == 20.0
    there = rig.axis.var("Position")
    rig.axis.motion_in_position(there, Velocity=20.0)
    rig.run(1.0)
    assert rig.axis.var("Position") == pytest.approx(there)
    assert rig.axis.var("Velocity") == 20.0
    assert abs(rig.axis.var("StatusPositioning.FollowingError")) == pytest.approx(1.0, rel=0.05)  # v / Kv


@pytest.mark.requirement("MIN-004", "MIN-005", "MIN-012", "MC-474", "MC-479", "VAR-065")
def test_dynamic_limits_do_not_act_but_are_reported(make_rig):
    """600 mm/s of 500: shown in StatusMotionIn.StatusWord.X0, not reduced, no warning; the bit goes with the
    velocity.
    """
    rig = make_rig(variables=LOOSE | {"Actor.DriveParameter.MaxSpeed": 6000.0}).enabled()
    job = rig.axis.motion_in_velocity(0.0)
    rig.feed(job, [{"Velocity": 12.0 * step} for step in range(51)])
    rig.cycles()
    assert rig.axis.var("Velocity") == 600.0
    assert rig.axis.var("StatusMotionIn.StatusWord.X0") is True
    assert rig.axis.var("StatusMotionIn.StatusWord") == 1
    assert rig.axis.alarms.engine.warning_word == 0
    rig.feed(job, [{"Velocity": -500.0}])
    rig.cycles()
    assert rig.axis.var("StatusMotionIn.StatusWord.X0") is False
    rig.feed(job, [{"Velocity": -501.0}])
    rig.cycles()
    assert rig.axis.var("StatusMotionIn.StatusWord.X0") is True
    job.set(Enable=False)
    rig.cycles(2)
    assert rig.axis.var("StatusMotionIn.StatusWord.X0") is False


@pytest.mark.requirement("MIN-006", "MC-475", "MC-478")
def test_the_vector_acts_without_a_transition(make_rig):
    """At 100 mm/s a vector with velocity 0 lets the setpoint step to 0 in one cycle; one MotionIn job follows
    the other at once.
    """
    rig = make_rig(variables=LOOSE).travelling(100.0)
    rig.axis.motion_in_velocity(0.0)
    rig.cycles()
    assert rig.axis.var("Velocity") == 100.0
    rig.cycles()
    assert rig.axis.var("Velocity") == 0.0
    assert rig.job.CommandAborted
    rig.axis.motion_in_velocity(-60.0)
    rig.cycles(2)
    assert rig.axis.var("Velocity") == -60.0


@pytest.mark.requirement("MIN-026", "MIN-027", "MIN-028", "MC-477", "MC-483", "MC-083")
def test_falling_enable_is_a_step_to_zero(make_rig):
    """Velocity 0 in the next cycle, the position setpoint stays, the axis stays enabled and controlled."""
    rig = make_rig(variables=LOOSE).enabled()
    job = rig.axis.motion_in_velocity(100.0)
    rig.run(0.5)
    before = rig.axis.var("Position")
    job.set(Enable=False)
    rig.cycles()
    last = before + 100.0 * CYCLE
    rig.cycles()
    assert rig.axis.var("Velocity") == 0.0
    assert rig.axis.var("Position") == pytest.approx(last)
    assert not job.Busy
    assert not job.CommandAborted
    assert not rig.axis.status_word & (X31_MOTION_IN | X28_NOT_CONTROLLED)
    assert rig.axis.status_word & X6_DONE
    assert rig.axis.var("StatusMotionIn.FunctionState") == 0
    assert rig.axis.state is AxisState.STANDSTILL
    rig.run(0.5)
    assert rig.axis.var("ActualPosition") == pytest.approx(last, abs=0.01)


# -- position
# ---------------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "MC-498", "MC-494", "MC-495", "MC-496", "MC-499", "MIN-021", "MC-100", "CTL-089", "MC-491"
)
def test_position_vectors_are_followed_directly(rig):
    """Position, Velocity, Acceleration of the axis are those given; position control is forced; nothing acts
    after Enable.
    """
    rig.enabled(start_mode=0)
    assert rig.axis.status_word & X28_NOT_CONTROLLED
    job = rig.axis.motion_in_position(0.0)
    rig.cycles(2)
    assert not rig.axis.status_word & X28_NOT_CONTROLLED
    acceleration = 50.0
    for step in range(1, 100):
        t = step * CYCLE
        s, v = 0.5 * acceleration * t * t, acceleration * t
        rig.feed(job, [{"Position": s, "Velocity": v, "Acceleration": acceleration}])
        rig.cycles()
        assert rig.axis.var("Position") == pytest.approx(s)
        assert (rig.axis.var("Velocity"), rig.axis.var("Acceleration")) == (v, acceleration)
    job.set(Enable=False)
    rig.cycles(2)
    job.set(Position=77.0, Velocity=5.0)
    rig.cycles(2)
    assert rig.axis.var("Position") == pytest.approx(s)  # the last one stays valid
    assert rig.axis.var("Velocity") == 0.0


@pytest.mark.requirement("MC-500", "MC-493", "MIN-007")
@pytest.mark.parametrize("watched", [True, False])
def test_a_jump_of_the_position(make_rig, watched):
    """Position far from the present setpoint: 521 with monitoring; without it the axis goes there as fast as
    it can.
    """
    rig = make_rig(variables={"FollowingError.EnableMonitoring": watched}).enabled()
    job = rig.axis.motion_in_position(40.0)
    rig.run(0.1)
    if watched:
        assert [entry.data["number"] for entry in rig.events("alarm.raised")] == [521]
        assert (job.Error, job.ErrorID) == (True, 0x8001)
    else:
        rig.run(2.0)
        assert job.Busy
        assert rig.axis.var("ActualPosition") == pytest.approx(40.0, abs=0.01)
        assert max(rig.column("actual_velocity")) > 500.0


@pytest.mark.requirement("MIN-022")
@pytest.mark.parametrize(("velocity", "lag"), [(0.0, 5.0), (50.0, 0.0)])
def test_the_given_velocity_is_precontrolled(make_rig, velocity, lag):
    """50 mm/s with Kv 10: without a given velocity the axis lags 5 mm, with it not at all."""
    rig = make_rig(variables={"PositionControl.Kv": 10.0, "PositionControl.Kpc": 100.0} | LOOSE).enabled()
    job = rig.axis.motion_in_position(0.0)
    rig.feed(job, [{"Position": 50.0 * CYCLE * step, "Velocity": velocity} for step in range(1, 500)])
    assert rig.axis.var("StatusPositioning.FollowingError") == pytest.approx(lag, abs=0.02)


@pytest.mark.requirement("MIN-023")
@pytest.mark.parametrize("time_constant", [0.0, 0.02])
def test_a_velocity_that_does_not_belong_to_the_position(make_rig, time_constant):
    """A constant position with Velocity 10 leaves a deviation of 10 * Kpc / 100 / Kv, whatever the balancing
    filter is set to.
    """
    rig = make_rig(
        variables={
            "PositionControl.Kv": 10.0,
            "PositionControl.Kpc": 50.0,
            "DynamicAxisModel.VelocityTimeConstant": time_constant,
        }
    ).enabled()
    rig.axis.motion_in_position(0.0, Velocity=10.0)
    rig.run(2.0)
    assert rig.axis.var("ActualPosition") == pytest.approx(0.5, abs=1e-3)


@pytest.mark.requirement("MIN-025")
def test_position_on_a_modulo_axis(make_rig):
    """Across the end of the range the vector is given wrapped; the axis takes the shortest way."""
    rig = make_rig(
        variables={"Modulo.Enable": True, "Modulo.Length": 360.0, "Modulo.StartValue": 0.0}
    ).enabled()
    rig.axis.home(359.0)
    rig.cycles(2)
    turn = rig.axis.var("ModuloCycle")
    job = rig.axis.motion_in_position(359.0)
    rig.feed(job, [{"Position": (359.0 + step * 0.2) % 360.0, "Velocity": 50.0} for step in range(10)])
    rig.cycles()
    assert rig.axis.var("Position") == pytest.approx(0.8)
    assert rig.axis.var("ModuloCycle") == turn + 1
    positions = rig.column("position_setpoint")[-10:]
    assert max(abs(b - a) for a, b in pairwise(positions)) < 0.21


# -- what surrounds it
# --------------------------------------------------------------------------------------------


@pytest.mark.requirement("MIN-011", "MIN-013", "MC-114", "VAR-120", "VAR-054")
def test_status_of_the_jobs(rig):
    """FunctionState 1 and 2, X31 while one of them is in control, and none of the other command bits."""
    rig.enabled()
    rig.axis.motion_in_velocity(5.0)
    rig.cycles(2)
    assert rig.axis.var("StatusMotionIn.FunctionState") == 1
    assert rig.axis.status_word & X31_MOTION_IN
    assert not rig.axis.status_word & (X6_DONE | X10_VELOCITY)
    rig.axis.motion_in_position(rig.axis.var("Position"))
    rig.cycles(2)
    assert rig.axis.var("StatusMotionIn.FunctionState") == 2
    assert rig.axis.status_word & X31_MOTION_IN
    rig.axis.halt()
    rig.cycles(2)
    assert rig.axis.var("StatusMotionIn.FunctionState") == 0
    assert not rig.axis.status_word & X31_MOTION_IN


@pytest.mark.requirement("MIN-017", "MC-481", "MC-501")
@pytest.mark.parametrize("start", ["motion_in_velocity", "motion_in_position", "motion_in_superimposed"])
def test_a_disabled_axis_refuses(rig, start):
    """Not enabled: 16#800F; the error stays until Enable falls, and a new edge starts again (MC-085)."""
    rig.cycles(2)
    job = getattr(rig.axis, start)(0.0)
    rig.cycles(3)
    assert (job.Error, job.ErrorID, job.Busy) == (True, 0x800F, False)
    rig.enabled()
    assert job.Error
    job.set(Enable=False)
    rig.cycles()
    assert (job.Error, job.ErrorID) == (False, 0)
    job.set(Enable=True)
    rig.cycles()
    assert job.Busy


@pytest.mark.requirement("CFG-062")
@pytest.mark.parametrize("kind", [MC_MotionInVelocity, MC_MotionInPosition, MC_MotionInSuperimposed])
def test_an_s7_1500_has_none_of_them(kind):
    """Refused when the instance is made, with what would be allowed."""
    axis = PositioningAxis(
        "axis1", SimulatedDrivePort(cycle_s=0.001), cycle_ns=1_000_000, cpu="S7-1500", variables={}
    )
    with pytest.raises(ConfigurationError, match="cpu S7-1500T"):
        kind(axis)


@pytest.mark.requirement("MC-048", "MC-049", "MC-482", "MC-492", "MC-502", "MIN-021", "MIN-029")
def test_a_speed_axis_knows_velocity_only(make_rig):
    """MC_MotionInVelocity runs in rpm; the other two are rejected with 16#8002."""
    rig = make_rig(speed=True).enabled()
    job = rig.axis.motion_in_velocity(120.0)
    rig.cycles(3)
    assert job.Busy
    assert rig.axis.var("Velocity") == 120.0
    assert rig.axis.var("StatusMotionIn.FunctionState") == 1
    for other in (rig.axis.motion_in_position(1.0), rig.axis.motion_in_superimposed(1.0)):
        rig.cycles()
        assert (other.Error, other.ErrorID) == (True, 0x8002)
    assert job.Busy


@pytest.mark.requirement("MC-487", "MC-497", "MC-507", "MC-092")
@pytest.mark.parametrize(
    ("start", "inputs", "error_id"),
    [
        ("motion_in_velocity", {"Velocity": nan}, 0x8003),
        ("motion_in_velocity", {"Acceleration": float("inf")}, 0x8004),
        ("motion_in_position", {"Position": 2e12}, 0x8009),
        ("motion_in_position", {"Velocity": nan}, 0x8003),
        ("motion_in_superimposed", {"Distance": nan}, 0x8008),
        ("motion_in_superimposed", {"AccelerationDiff": nan}, 0x8004),
    ],
)
def test_a_vector_that_is_no_number(rig, start, inputs, error_id):
    """Given at the start it is rejected; given later it ends the job as a falling Enable would; negative
    values are raw values.
    """
    rig.enabled()
    job = getattr(rig.axis, start)(0.0)
    rig.feed(job, [{next(iter(inputs)): -0.01}])
    rig.cycles()
    assert job.Busy
    rig.feed(job, [inputs])
    assert (job.Error, job.ErrorID, job.Busy) == (True, error_id, False)
    rig.cycles(2)
    assert rig.axis.var("Velocity") == 0.0
    assert rig.axis.state is AxisState.STANDSTILL
    job.set(Enable=False)
    rig.cycles()
    job.set(Enable=True)
    rig.cycles()
    assert (job.Error, job.ErrorID) == (True, error_id)


@pytest.mark.requirement("MIN-009")
@pytest.mark.parametrize("jump", [False, True])
def test_software_limits_remain_effective(make_rig, jump):
    """Approached with 50 mm/s: 533 and at rest on the limit; with a jump past it: 534."""
    limits = {
        "PositionLimits_SW.Active": True,
        "PositionLimits_SW.MinPosition": -10.0,
        "PositionLimits_SW.MaxPosition": 20.0,
    }
    rig = make_rig(variables=limits | LOOSE).enabled()
    rig.axis.home(0.0)
    rig.cycles(2)
    job = rig.axis.motion_in_position(0.0)
    if jump:
        rig.feed(job, [{"Position": 25.0}])
    else:
        rig.feed(job, [{"Position": 50.0 * CYCLE * step, "Velocity": 50.0} for step in range(1, 120)])
    rig.run(0.5)
    assert [entry.data["number"] for entry in rig.events("alarm.raised")][:1] == [534 if jump else 533]
    assert (job.Error, job.ErrorID) == (True, 0x8001)
    if not jump:
        assert rig.axis.var("Position") == pytest.approx(20.0, abs=1e-6)


@pytest.mark.requirement("MIN-010")
def test_an_alarm_ends_the_job_for_good(make_rig):
    """Alarm with a reaction: Error 16#8001; later vectors do nothing until a new rising edge."""
    rig = make_rig(variables={"PositionLimits_HW.Active": True}).enabled()
    job = rig.axis.motion_in_velocity(50.0)
    rig.run(0.1)
    rig.port.switches = 2
    rig.cycles(3)
    assert (job.Error, job.ErrorID) == (True, 0x8001)
    rig.run(0.5)
    rig.port.switches = 0
    rig.until(rig.axis.reset().done)
    rig.run(0.5)
    job.set(Velocity=30.0)
    rig.cycles(3)
    assert rig.axis.var("Velocity") == 0.0
    assert job.Error
    job.set(Enable=False)
    rig.cycles()
    job.set(Enable=True)
    rig.cycles(2)
    assert rig.axis.var("Velocity") == 30.0
