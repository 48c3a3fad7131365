"""Leading values and followers under disturbances: encoders that lie, overflow or come late, limits, a fixed
stop, an axis that fails (SYN sections 3.3, 5 and 18.2).
"""

from __future__ import annotations

from itertools import pairwise
from math import sqrt, tau

import pytest

from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import PositioningAxis
from motion.s7.axis.technology_object import ACTUAL
from motion.s7.handles import AxisHandle
from testcases.unit.motion_axis.conftest import CYCLE, REFERENCE, Rig, TorquePort
from testcases.unit.motion_axis.test_gear_in import FIXTURE, in_gear, word
from testcases.unit.motion_axis.test_leading_objects import HALF, Belt, behind_belt

SYNC = "StatusSynchronizedMotion."


def increments(values):
    return [b - a for a, b in pairwise(values)]


class LyingPort(SimulatedDrivePort):
    """A drive whose reported speed is wrong by `wrong_rpm`."""

    def __init__(self) -> None:
        super().__init__(cycle_s=CYCLE)
        self.brings_speed = True
        self.wrong_rpm = 0.0

    def read(self) -> None:
        super().read()
        self.actual_speed_rpm += self.wrong_rpm


def behind_lying(mode, wrong_rpm):
    """A follower of the actual value of an axis at 100 mm/s whose drive lies about its speed since 50 cycles;
    the course of the leading axis and of its extrapolated position.
    """
    rig = Rig(synchronous=True, variables=FIXTURE)
    port = LyingPort()
    leader = PositioningAxis(
        "lying",
        port,
        cycle_ns=rig.cycle_ns,
        variables=REFERENCE
        | {"Sensor[1].ActualVelocityMode": mode, "Extrapolation.FollowingAxisDependentTime": 0.010},
        history=rig.history,
        delay_s=CYCLE,
    )
    rig.runtime.add(leader)
    rig.axis.object.leading_objects += (leader,)
    rig.axis.object.couplings = {"lying": ACTUAL}
    rig.runtime.order_axes()
    rig.enabled()
    handle = AxisHandle(rig.runtime, leader)
    rig.until(handle.power().status)
    rig.until(handle.move_velocity(100.0).in_velocity)
    rig.until(rig.axis.gear_in(handle).in_gear)
    rig.run(0.2)
    port.wrong_rpm = wrong_rpm
    course, extrapolated = [], []
    for _ in range(50):
        rig.cycles()
        course.append((handle.var("Position"), port.written, handle.var("ActualPosition")))
        extrapolated.append(handle.var("StatusExtrapolation.ExtrapolatedPosition"))
    time = 0.010 + handle.var("Extrapolation.LeadingAxisDependentTime")
    return course, extrapolated, time


@pytest.mark.requirement("SYN-068", "CFG-337")
def test_the_speed_that_the_drive_reports_acts_on_the_extrapolation_alone():
    """With ActualVelocityMode 1 a wrong NIST_B of dv moves the extrapolated position by dv times its time;
    with 0 nothing changes, and position control and motion do not in either.
    """
    for mode, per_time in ((1, 10.0), (0, 0.0)):  # 60 rpm are 10 mm/s
        course, right, time = behind_lying(mode, 0.0)
        same, wrong, _ = behind_lying(mode, 60.0)
        assert same == course
        off = [b - a for a, b in zip(right, wrong, strict=True)][1:]
        assert off == pytest.approx([per_time * time] * len(off), abs=1e-9)


@pytest.mark.requirement("SYN-371")
@pytest.mark.parametrize("length", [0.0, 7.0])
def test_counters_and_modulo_ranges_overflow_without_a_step(length):
    """The 32-bit counter of the leading encoder overflows, its modulo range ends: the follower sees none of
    it, in either direction.
    """
    modulo = {"Modulo.Enable": True, "Modulo.Length": length} if length else {}
    for step in (40, -40):
        edge = HALF - 120 * 40
        rig = behind_belt(step, at=edge if step > 0 else -edge, encoder=modulo)
        rig.until(rig.axis.gear_in(rig.encoder).in_gear)
        counts, seen = [rig.belt.encoder_increments], []
        rig.runtime.after_cycle.append(lambda rig=rig, seen=seen: seen.append(rig.axis.object.servo.total.s))
        rig.run(0.3)
        counts.append(rig.belt.encoder_increments)
        assert counts[0] * counts[1] < 0, "the counter has not overflowed"
        assert increments(seen) == pytest.approx([step * 0.01] * (len(seen) - 1), abs=1e-6)


class LateBelt(Belt):
    """A belt whose values come late by a cycle, now and then."""

    __slots__ = ("_seed", "_true")

    def __init__(self) -> None:
        super().__init__()
        self._true = 0
        self._seed = 1

    def read(self) -> None:
        self._seed = (self._seed * 1103515245 + 12345) % HALF
        self.link_ok = True
        self._true += self.step
        self.encoder_increments = self._true - (self.step if self._seed >> 16 & 1 else 0)


@pytest.mark.requirement("SYN-372")
def test_values_that_come_a_cycle_late_are_filtered():
    """Jitter of a cycle on the counter: without filters the extrapolation makes a ripple of some hundred
    percent of it; the filters keep the velocity of the follower within 10 %.
    """
    ripple = []
    for seconds in (0.0, 0.1):
        rig = behind_belt(
            belt=LateBelt,
            FollowingAxisDependentTime=0.010,
            **{f"VelocityFilter.{name}": seconds for name in ("T1", "T2")},
            **{f"PositionFilter.{name}": 0.5 * seconds for name in ("T1", "T2")},
            **{"Settings.SystemDefinedExtrapolation": 1},
        )
        rig.run(1.0)
        if seconds:
            rig.until(rig.axis.gear_in(rig.encoder).in_gear)
        seen = []
        rig.runtime.after_cycle.append(
            lambda rig=rig, seen=seen: seen.append(
                (rig.encoder.var("StatusExtrapolation.ExtrapolatedVelocity"), rig.axis.object.servo.total.s)
            )
        )
        rig.run(1.0)
        velocities, places = zip(*seen, strict=True)
        ripple.append(max(velocities) - min(velocities))
        if seconds:
            speeds = [step / CYCLE for step in increments(places)]
            ripple.append(max(speeds) - min(speeds))
    assert ripple[0] == pytest.approx(200.0)
    assert max(ripple[1:]) < 10.0


@pytest.mark.requirement("SYN-365")
@pytest.mark.parametrize("coupling", ["setpoint", ACTUAL])
def test_the_drive_of_the_leading_axis_fails(coupling):
    """Its setpoint tracks the actual value, and the follower that, or the actual value itself, to the
    standstill of the machine that coasts; the gear is kept.
    """
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables={"VirtualAxis.Mode": 0})
    rig.axis.object.couplings = {"leader": coupling}
    rig.enabled().leader_at(200.0)
    job = rig.axis.gear_in(rig.leader, 2, 1)
    rig.until(job.in_gear)
    rig.run(0.1)
    seen = []
    followed = "ActualPosition" if coupling == "setpoint" else "StatusExtrapolation.ExtrapolatedPosition"
    rig.runtime.after_cycle.append(
        lambda: seen.append((rig.axis.object.servo.total.s, rig.leader.var(followed)))
    )
    rig.leader.object.servo.port.fault = True
    rig.run(3.0)
    assert rig.alarms_of("leader")[0] == 421
    assert (job.InGear, rig.alarms_of("axis1")) == (True, [])
    late = seen[10:]
    assert late[-1][1] - late[0][1] > 20.0
    assert [y - 2.0 * x for y, x in late] == pytest.approx(
        [late[-1][0] - 2.0 * late[-1][1]] * len(late), abs=1e-6
    )
    assert rig.axis.var("Velocity") == pytest.approx(0.0, abs=1e-6)


LIMITED = {
    "VirtualAxis.Mode": 0,
    "PositionLimits_HW.Active": True,
    "FollowingError.EnableMonitoring": False,
}


BEHAVIORS = ("PositionLimits_SW.LimitReachedBehavior", "PositionLimits_SW.LimitExceededBehavior")


class StopPort(TorquePort):
    """A drive that meets a fixed stop at an angle of its shaft, rad."""

    def __init__(self, stop: float) -> None:
        super().__init__()
        self._stop = stop

    def _move(self) -> None:
        super()._move()
        if self._angle > self._stop:
            self._angle, self._speed = self._stop, 0.0


@pytest.mark.requirement("SYN-117", "SYN-282", "SYN-367")
@pytest.mark.parametrize("on_top", ["", "phasing", "leaving", "superimposed", "waiting"])
def test_a_fixed_stop_aborts_everything(on_top):
    """InClamping TRUE: the gear and what shifts it, waits behind it or is on top of it are aborted; the drive
    holds at the stop, and the leading axis goes on.
    """
    rig = Rig(
        synchronous=True,
        port=StopPort(5.0 * tau),
        variables={"Clamping.FollowingErrorDeviation": 2.0, "Clamping.PositionTolerance": 1.0}
        | {"FollowingError.EnableMonitoring": False},
        leader_variables=FIXTURE,
    ).enabled()
    rig.axis.home(0.0)
    rig.leader_at(60.0)
    jobs = [rig.axis.gear_in(rig.leader)]
    rig.until(jobs[0].in_gear)
    limiting = rig.axis.torque_limiting(0.5, mode=1)
    rig.cycles(2)
    if on_top == "phasing":
        jobs.append(rig.axis.phasing_relative(5.0, ProfileReference=1, PhasingDistance=500.0))
    elif on_top == "leaving":
        jobs.append(rig.axis.gear_out(5000.0, MasterStopDistance=20.0))
    elif on_top == "superimposed":
        jobs.append(rig.axis.move_superimposed(200.0, VelocityDiff=5.0))
    elif on_top == "waiting":
        jobs.append(rig.axis.gear_in_pos(rig.leader, 5000.0, 0.0))
    rig.cycles(2)
    assert all(job.Busy for job in jobs)
    rig.until(limiting.in_clamping)
    rig.cycles(2)
    assert [job.CommandAborted for job in jobs] == [True] * len(jobs)
    assert (rig.axis.var("Velocity"), rig.axis.var("StatusWord.X0"), word(rig.axis)) == (0.0, True, 0)
    assert rig.axis.var(f"{SYNC}WaitingFunctionState") == 0
    rig.run(0.2)
    assert (limiting.InClamping, rig.leader.var("Velocity"), rig.alarms_of("axis1")) == (True, 60.0, [])


@pytest.mark.requirement("SYN-367", "SYN-114", "SYN-115", "LIM-078")
def test_limits_of_the_follower():
    """The software limit stops it with the maximum dynamics, enabled: 533; behind it 534 disables it, or is
    an emergency stop, as configured; a limit switch is 531. The gear has ended in every case, the leading
    axis goes on.
    """
    software = {
        "PositionLimits_SW.Active": True,
        "PositionLimits_SW.MaxPosition": 40.0,
        "PositionLimits_SW.MinPosition": -1e6,
    }
    for number, behavior, enabled in (
        (533, 0, True),
        (533, 1, True),
        (534, 0, False),
        (534, 1, True),
        (531, 0, False),
    ):
        both = dict.fromkeys(BEHAVIORS, behavior)
        rig = in_gear(100.0, follower=LIMITED | both)
        rig.axis.home(0.0)
        rig.cycles(2)
        rig.rows.clear()
        if number == 531:
            rig.port.switches = 2
        else:
            for path, value in software.items():
                rig.axis.write(path, value)
            if number == 534:
                rig.leader.home(rig.leader.var("Position") + 45.0)  # the follower steps across
        rig.run(0.8)
        assert rig.alarms_of("axis1")[0] == number
        assert rig.job.ErrorID == 0x8001
        assert (rig.axis.var("StatusWord.X0"), rig.axis.var("Velocity")) == (enabled, 0.0)
        assert rig.leader.var("Velocity") == 100.0
        if number == 533:
            assert rig.axis.var("ActualPosition") <= 40.0 + 0.05
            assert min(rig.column("acceleration_setpoint")) == pytest.approx(
                -sqrt(100.0 * 20_000.0), rel=0.02
            )


@pytest.mark.requirement("SYN-470", "SYN-389")
def test_extrapolation_of_an_accelerating_leading_object():
    """At constant velocity nothing is left; at constant acceleration a the leading value is behind the true
    one by a t^2 / 2, because the formula is linear.
    """
    rig = behind_belt(40, FollowingAxisDependentTime=0.042)
    encoder = rig.encoder
    places, leads = [], []

    def look():
        rig.belt.step += growth
        places.append(encoder.object.feedback.position)
        leads.append(encoder.object.leading_value.position)

    growth = 0
    rig.runtime.after_cycle.append(look)
    rig.run(0.2)
    time = encoder.object.leading_value.time_s
    ahead = round(time / CYCLE)
    assert time == pytest.approx(ahead * CYCLE)
    assert leads[-1 - ahead] == pytest.approx(places[-1], abs=1e-9)
    growth = 2  # 2 increments of 0.01 mm more in each cycle
    rig.run(0.4)
    acceleration = 0.02 / CYCLE**2
    # the velocity is that of the last cycle, half a cycle ago
    lag = 0.5 * acceleration * time * (time + CYCLE)
    assert places[-1] - leads[-1 - ahead] == pytest.approx(lag, rel=1e-6)


@pytest.mark.requirement("SYN-049", "SYN-388")
def test_bits_of_status_word_2():
    """Each job has its bit, and no reserved one is ever set; superimposed motion is X23, or X6 or X7 of the
    second word.
    """
    rig = in_gear(50.0)
    bits = set()
    rig.runtime.after_cycle.append(lambda: bits.add(rig.axis.var("StatusWord2")))

    def shown(expected, job, *, ends=True):
        rig.cycles(2)
        assert (job.Busy, rig.axis.var("StatusWord2")) == (True, 1 << expected)
        if ends:
            rig.until(job.done)
        rig.cycles(2)

    far = rig.leader.var("Position") + 30.0
    shown(3, rig.axis.phasing_relative(1.0, ProfileReference=2, PhasingDistance=5.0, StartPosition=far))
    shown(4, rig.axis.offset_relative(1.0, 20.0))
    far = rig.leader.var("Position") + 30.0
    shown(5, rig.axis.offset_relative(1.0, 5.0, ProfileReference=2, StartPosition=far))
    given = rig.axis.motion_in_superimposed(0.0)
    shown(6, given, ends=False)
    given.set(Enable=False)
    rig.cycles(2)
    rig.axis.move_superimposed(50.0)
    rig.run(0.2)
    assert (rig.axis.var("StatusWord.X23"), rig.axis.var("StatusWord2")) == (True, 0)
    shown(7, rig.axis.halt_superimposed(Deceleration=100.0))
    out = rig.axis.gear_out(rig.axis.var("Position") + 30.0, MasterStopDistance=20.0)
    rig.until(out.start_sync_out)
    shown(1, out)
    shown(0, rig.axis.stop(0))
    assert {1 << number for number in (0, 1, 3, 4, 5, 6, 7)} <= bits
    assert not any(word & ~0xFB for word in bits)
