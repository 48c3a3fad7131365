"""Positioning, following-error and standstill monitoring with the printed numbers (§5.12)."""

from __future__ import annotations

from math import log, tau

import pytest

from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.lagging_drive import LaggingDrivePort

LOOSE = {"FollowingError.EnableMonitoring": False}
WINDOW = {
    "PositioningMonitoring.Window": 1.0, "PositioningMonitoring.ToleranceTime": 1.0,
    "PositioningMonitoring.MinDwellTime": 0.1, "PositionControl.Kpc": 0.0,
}  # fmt: skip
DYNAMIC = {
    "FollowingError.MinValue": 10.0, "FollowingError.MaxValue": 100.0, "FollowingError.MinVelocity": 10.0,
    "FollowingError.WarningLevel": 90.0,
}  # fmt: skip


def displace(rig, distance):
    """Turn the motor by `distance`, mm, without the controller's doing (pitch 10 mm)."""
    rig.port.turn(distance / 10.0 * tau)


def numbers(rig):
    return [entry.data["number"] for entry in rig.events("alarm.raised")]


def settling(constant_s, *, deviation=5.0, **variables):
    """Return a rig whose actual value closes a deviation with the time constant 1/Kv since its setpoint has
    ended.

    With it come the job, the instant, and the deviation at this instant.
    """
    rig = Rig(variables=WINDOW | LOOSE | variables | {"PositionControl.Kv": 1.0 / constant_s}).enabled()
    job = rig.axis.move_relative(0.5, Velocity=100.0, Jerk=0.0)
    rig.cycles(3)
    displace(rig, -deviation)
    rig.until(lambda: rig.axis.motion.gen.done)
    return rig, job, rig.times()[-1], abs(rig.axis.var("Position") - rig.axis.var("ActualPosition"))


# -- positioning
# ---------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MON-001", "MON-002", "MON-003", "MON-016", "MON-017", "MON-023", "MON-013")
def test_settling_in_time():
    """Lag 0.2 s from 5.0: entry after 0.2 ln 5 = 0.322 s, Done at 0.422 s, X6 with it."""
    rig, job, start, deviation = settling(0.2)
    assert deviation > 4.5
    rig.until(job.done)
    assert rig.times()[-1] - start == pytest.approx(0.2 * log(deviation) + 0.1, abs=4 * CYCLE)
    assert rig.axis.var("StatusWord.X6")
    assert not numbers(rig)


@pytest.mark.requirement("MON-018", "MON-024", "MON-020", "MON-056", "MON-015", "VAR-176")
def test_settling_too_late():
    """Lag 1.0 s: the window would be entered at 1.609 s; 541 with info 1 at 1.0 s, disabled, 16#8001, never
    Done.
    """
    rig, job, start, _ = settling(1.0)
    rig.until(lambda: job.Error)
    assert rig.times()[-1] - start == pytest.approx(1.0, abs=3 * CYCLE)
    assert numbers(rig) == [541]
    assert rig.events("alarm.raised")[0].data["info"] == 1
    assert (job.Error, job.ErrorID, job.Done) == (True, 0x8001, False)
    assert rig.axis.var("ErrorDetail.Reaction") == 4
    assert rig.axis.var("ErrorWord.X12")
    assert rig.axis.var("StatusWord.X1")
    assert not rig.axis.var("StatusWord.X0")
    rig.run(1.0)
    rig.until(rig.axis.reset().done)
    rig.run(0.3)
    assert rig.axis.var("StatusWord.X0")
    assert numbers(rig) == [541]
    assert not job.Done


@pytest.mark.requirement("MON-019", "VAR-176")
def test_leaving_the_window_again():
    """Left before the dwell time is over: 541 with info 2."""
    rig, job, *_ = settling(0.2, deviation=0.0)
    rig.run(0.03)
    displace(rig, 3.0)
    rig.cycles(2)
    assert [(entry.data["number"], entry.data["info"]) for entry in rig.events("alarm.raised")] == [(541, 2)]
    assert job.ErrorID == 0x8001


@pytest.mark.requirement("MON-025")
def test_no_dwell_time():
    """MinDwellTime 0: Done in the cycle of entry."""
    rig, job, start, deviation = settling(0.2, **{"PositioningMonitoring.MinDwellTime": 0.0})
    rig.until(job.done)
    assert rig.times()[-1] - start == pytest.approx(0.2 * log(deviation), abs=4 * CYCLE)


@pytest.mark.requirement("MON-017")
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_window_is_symmetric(side):
    """0.9 of the window on either side is inside, 1.1 is not."""
    for share, inside in ((0.9, True), (1.1, False)):
        rig, job, *_ = settling(1000.0, deviation=side * share - 0.5)
        rig.run(0.2)
        assert job.Done is inside


@pytest.mark.requirement("MON-021", "VAR-176")
@pytest.mark.parametrize("instruction", ["halt", "stop"])
def test_halts_and_stops_are_watched_too(instruction):
    """MC_Halt and MC_Stop under position control end with 541 when the drive does not settle."""
    rig = Rig(variables=WINDOW | LOOSE | {"PositionControl.Kv": 0.5}).enabled()
    rig.until(rig.axis.move_velocity(20.0, Jerk=0.0).in_velocity)
    rig.run(1.0)
    job = rig.axis.halt() if instruction == "halt" else rig.axis.stop(3)
    rig.cycles(3)
    rig.until(lambda: rig.axis.motion.gen.done)
    start = rig.times()[-1]
    rig.until(job.ended)
    assert numbers(rig) == [541]
    assert rig.times()[-1] - start == pytest.approx(1.0, abs=4 * CYCLE)
    if instruction == "halt":
        assert job.ErrorID == 0x8001
    else:
        assert job.CommandAborted  # a stop gives way to a stronger reaction without an error (STP-253)


@pytest.mark.requirement("MON-022")
@pytest.mark.parametrize("instruction", ["halt", "stop"])
def test_without_position_control_nothing_is_watched(instruction):
    """X28: Done with the velocity setpoint at zero, however far away the axis is."""
    rig = Rig(variables=WINDOW | LOOSE).enabled()
    rig.until(rig.axis.move_velocity(20.0, PositionControlled=False).in_velocity)
    job = getattr(rig.axis, instruction)()
    rig.until(job.done)
    displace(rig, 20.0)
    rig.run(2.0)
    assert not numbers(rig)


@pytest.mark.requirement("MON-026")
def test_after_done_only_the_following_error_is_watched():
    """A displacement afterwards gives 521, not 541; without that monitoring nothing."""
    for watched in (True, False):
        rig = Rig(variables=WINDOW | {"FollowingError.EnableMonitoring": watched}).enabled()
        rig.until(rig.axis.move_relative(5.0).done)
        rig.run(0.2)
        displace(rig, 4.0)
        rig.run(1.5)
        assert numbers(rig) == ([521] if watched else [])


@pytest.mark.requirement("MON-027")
@pytest.mark.parametrize("when", [0.1, 0.35])
def test_a_new_job_ends_the_supervision_of_the_old_one(when):
    """Within tolerance or dwell time: the old job is aborted, no alarm comes of it."""
    rig, job, *_ = settling(0.2)
    rig.run(when)
    assert job.Busy
    other = rig.axis.move_relative(50.0, Velocity=20.0)
    rig.run(1.2)
    assert job.CommandAborted
    assert other.Busy
    assert not numbers(rig)


# -- following error
# --------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("MON-005", "MON-006", "MON-007", "MON-040", "MON-012")
@pytest.mark.parametrize(("velocity", "permitted"), [(5.0, 10.0), (255.0, 55.0)])
def test_the_limit_depends_on_the_setpoint_velocity(velocity, permitted):
    """0.85 and 1.1 of the permitted value at both velocities: nothing, and 521 with reaction 4."""
    for share, alarm in ((0.85, False), (1.1, True)):
        rig = Rig(variables=DYNAMIC | {"PositionControl.Kv": 0.01}).travelling(velocity)
        displace(rig, -share * permitted)
        job = rig.job
        rig.cycles(2)
        assert abs(rig.column("following_error")[-2]) == pytest.approx(share * permitted, rel=0.03)
        assert (521 in numbers(rig)) is alarm
        assert job.Error is alarm
        assert rig.axis.var("ErrorWord.X11") is alarm
        assert rig.axis.var("StatusWord.X0") is not alarm


@pytest.mark.requirement("MON-008", "MON-041", "MON-042")
def test_the_warning_level():
    """90 % of 10: warning above 9 mm, no reaction; raised once per exceedance, again after it has fallen
    below the level.
    """
    rig = Rig(variables=DYNAMIC | {"PositionControl.Kv": 0.01}).enabled()
    displace(rig, 8.5)
    rig.run(0.1)
    assert not numbers(rig)
    displace(rig, 0.8)
    rig.run(0.2)
    assert numbers(rig) == [522]
    assert rig.axis.var("WarningWord.X11")
    assert rig.axis.var("StatusWord.X0")
    displace(rig, -3.0)
    rig.run(0.1)
    rig.until(rig.axis.reset().done)
    assert not rig.axis.var("WarningWord.X11")
    displace(rig, 3.0)
    rig.run(0.1)
    assert numbers(rig) == [522, 522]


@pytest.mark.requirement("MON-004", "MON-043")
def test_monitoring_switched_off():
    """Neither 521 nor 522, whatever the limits are."""
    rig = Rig(variables=DYNAMIC | LOOSE | {"PositionControl.Kv": 0.01}).enabled()
    displace(rig, 500.0)
    rig.run(0.5)
    assert not numbers(rig)


@pytest.mark.requirement("MON-046", "MON-038")
def test_the_limit_shrinks_while_braking():
    """A following error of 20 mm from 500 mm/s: 521 when the setpoint has fallen below 64.4 mm/s."""
    rig = Rig(variables=DYNAMIC | {"PositionControl.Kv": 0.001}).travelling(500.0)
    displace(rig, -20.0)
    rig.cycles(2)
    assert 521 not in numbers(rig)
    rig.axis.halt(Deceleration=500.0, Jerk=0.0)
    rig.until(lambda: 521 in numbers(rig))
    at = numbers(rig).index(521)
    velocity = rig.column("velocity_setpoint")[-2]
    assert velocity == pytest.approx(10.0 + 490.0 * 10.0 / 90.0, abs=2 * 500.0 * CYCLE)
    assert at >= 0


@pytest.mark.requirement("MON-036")
def test_without_position_control_there_is_none():
    """X28: the tag shows 0.0 and nothing is monitored."""
    rig = Rig(variables=DYNAMIC).enabled()
    rig.until(rig.axis.move_velocity(50.0, PositionControlled=False).in_velocity)
    displace(rig, 60.0)
    rig.run(0.5)
    assert rig.axis.var("StatusPositioning.FollowingError") == 0.0
    assert not numbers(rig)


@pytest.mark.requirement("MON-010", "MON-011", "MON-047", "MON-049", "MON-014")
def test_standstill_needs_its_time():
    """Below the threshold for MinDwellTime; an excess on the way starts the time again."""
    rig = Rig(
        variables=LOOSE | {"StandstillSignal.VelocityThreshold": 5.0, "StandstillSignal.MinDwellTime": 0.1}
    ).travelling(50.0)
    assert not rig.axis.var("StatusWord.X7")
    rig.axis.move_velocity(4.0, PositionControlled=False)
    rig.until(lambda: rig.axis.var("ActualVelocity") < 5.0)
    rig.run(0.06)
    displace(rig, 0.2)  # one cycle with 50 mm/s more
    rig.cycles()
    rig.run(0.06)
    assert not rig.axis.var("StatusWord.X7")
    rig.run(0.06)
    assert rig.axis.var("StatusWord.X7")


@pytest.mark.requirement("MON-048")
def test_standstill_has_a_hysteresis_with_numbers():
    """Threshold 5.0: 5.2 keeps the signal, 6.0 ends it."""
    rig = Rig(variables=LOOSE | {"StandstillSignal.VelocityThreshold": 5.0}).enabled()
    rig.run(0.2)
    rig.until(rig.axis.move_velocity(5.2).in_velocity)
    rig.run(0.2)
    assert rig.axis.var("StatusWord.X7")
    rig.until(rig.axis.move_velocity(6.0).in_velocity)
    rig.run(0.2)
    assert not rig.axis.var("StatusWord.X7")


@pytest.mark.requirement("MON-050")
def test_a_speed_axis_has_no_standstill_signal(make_rig):
    """StatusWord.X7 stays FALSE, and there are no variables for it."""
    rig = make_rig(speed=True).enabled()
    rig.run(0.5)
    assert not rig.axis.status_word & 1 << 7
    assert not any(path.startswith("StandstillSignal") for path in rig.axis.variables.paths())


@pytest.mark.requirement("MON-052")
def test_recovery_waits_for_standstill():
    """After remove enable at speed X7 tells when the axis rests; then the acknowledgement enables it without
    a jump.
    """
    rig = Rig(port=LaggingDrivePort(cycle_s=CYCLE, lag_s=0.0), variables=LOOSE).travelling(200.0)
    rig.axis.alarms.raise_alarm(531)
    rig.cycles(2)
    assert not rig.axis.var("StatusWord.X7")
    rig.until(lambda: rig.axis.var("StatusWord.X7"))
    assert abs(rig.axis.var("ActualVelocity")) < 2.0
    rig.until(rig.axis.reset().done)
    rig.run(0.5)
    assert rig.axis.var("StatusWord.X0")
    assert abs(rig.axis.var("ActualVelocity")) < 0.1
