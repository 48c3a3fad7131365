"""Shifts of leading and following value, additive leading value (SYN sections 3.1, 7.4, 7.5, 7.7, 8.5)."""

from __future__ import annotations

from itertools import pairwise
from math import nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motion.kernel.synchronous import ShiftOverDistance
from testcases.unit.motion_axis.conftest import CYCLE
from testcases.unit.motion_axis.override_cells import cam_of
from testcases.unit.motion_axis.test_gear_in import SYNCHRONOUS, gear, in_gear, places
from testcases.unit.motion_axis.test_gear_in_pos import standing, travel

DYNAMICS = {"Velocity": 50.0, "Acceleration": 1000.0, "Deceleration": 1000.0, "Jerk": 0.0}
SYNC = "StatusSynchronizedMotion."
PHASING, PHASING_WAITS, OFFSET, OFFSET_WAITS = 1 << 24, 1 << 3, 1 << 4, 1 << 5


def tag(rig, name):
    return rig.axis.var(f"{SYNC}{name}")


def words(rig):
    """Status bits of both kinds of shift."""
    return (
        rig.axis.var("StatusWord") & PHASING,
        rig.axis.var("StatusWord2") & (PHASING_WAITS | OFFSET | OFFSET_WAITS),
    )


def relation(rig, ratio=1.0):
    """Position of the follower less the ratio times that of the leading axis."""
    x, y = places(rig)
    return y - ratio * x


@pytest.mark.requirement("SYN-183", "SYN-184")
def test_phasing_with_dynamics():
    """10 mm with 50 mm/s: 0.25 s, wherever the leading axis is; again: nothing; relative adds up."""
    rig = in_gear(0.0)
    base = relation(rig)
    job = rig.axis.phasing_absolute(10.0, **DYNAMICS)
    rig.cycles()
    begin = rig.scheduler.now
    assert (job.StartPhasing, words(rig)[0]) == (True, PHASING)
    rig.until(job.done)
    assert (rig.scheduler.now - begin) * 1e-9 == pytest.approx(0.25, abs=1.5 * CYCLE)
    assert relation(rig) - base == pytest.approx(10.0)
    assert (tag(rig, "PhaseShift"), job.AbsolutePhaseShift) == (10.0, 10.0)
    again = rig.axis.phasing_absolute(10.0, **DYNAMICS)
    rig.cycles()
    assert (again.Done, again.StartPhasing, relation(rig) - base) == (True, False, pytest.approx(10.0))
    more = rig.axis.phasing_relative(10.0, **DYNAMICS)
    rig.until(more.done)
    assert (tag(rig, "PhaseShift"), more.CoveredPhaseShift) == (20.0, 10.0)
    back = rig.axis.phasing_relative(-10.0, **DYNAMICS)
    rig.until(back.done)
    assert (tag(rig, "PhaseShift"), back.CoveredPhaseShift) == (10.0, -10.0)
    assert relation(rig) - base == pytest.approx(10.0)


@pytest.mark.requirement("SYN-424")
def test_the_dynamics_of_phasing_are_those_of_the_follower():
    """Ratio 2:1: 20 mm in 0.45 s on top of the motion, at most 50 mm/s more; velocity is the change of the
    position.
    """
    rig = in_gear(100.0, 2, 1)
    job = rig.axis.phasing_absolute(10.0, **DYNAMICS)
    rig.cycles()
    begin, places_, velocities = rig.scheduler.now, [], []
    while not job.Done:
        rig.cycles()
        places_.append(rig.axis.var("Position"))
        velocities.append(rig.axis.var("Velocity"))
    assert (rig.scheduler.now - begin) * 1e-9 == pytest.approx(0.45, abs=1.5 * CYCLE)
    assert max(velocities) == pytest.approx(250.0)
    means = [(b - a) / CYCLE for a, b in pairwise(places_)]
    halves = [(a + b) / 2 for a, b in pairwise(velocities)]
    assert means == pytest.approx(halves, abs=1.0)


@pytest.mark.requirement("SYN-187", "SYN-430")
@pytest.mark.parametrize("kind", ["phasing", "offset"])
def test_a_shift_from_a_position_on(kind):
    """It waits while the leading value stands and until it is at the start, then shifts, as bits show."""
    rig = in_gear(0.0)
    x = rig.leader.var("Position")
    way = {"ProfileReference": 2, "StartPosition": x + 5.0}
    if kind == "phasing":
        job = rig.axis.phasing_relative(4.0, PhasingDistance=10.0, **way)
        waits, shifts = (0, PHASING_WAITS), (PHASING, 0)
    else:
        job = rig.axis.offset_relative(4.0, 10.0, **way)
        waits, shifts = (0, OFFSET_WAITS), (0, OFFSET)
    rig.run(0.5)
    started = job.start_phasing if kind == "phasing" else job.start_offset
    assert (words(rig), started(), job.Busy) == (waits, False, True)
    rig.leader.move_relative(30.0, Velocity=20.0)
    rig.until(started)
    rig.cycles()
    assert words(rig) == shifts
    assert rig.leader.var("Position") == pytest.approx(x + 5.0, abs=3 * 20.0 * CYCLE)
    rig.until(job.done)
    assert rig.leader.var("Position") == pytest.approx(x + 15.0, abs=3 * 20.0 * CYCLE)
    rig.cycles()
    assert words(rig) == (0, 0)


@pytest.mark.requirement("SYN-194", "SYN-132")
def test_an_offset_over_a_way():
    """Ratio 2:1, 10 mm over 100 mm: half of it after half the way, all of it at the end."""
    rig = in_gear(100.0, 2, 1)
    base = relation(rig, 2.0)
    job = rig.axis.offset_absolute(10.0, 100.0)
    rig.cycles()
    x = rig.leader.var("Position")
    seen = {}
    while not job.Done:
        rig.cycles()
        z = (rig.leader.var("Position") - x) / 100.0
        seen[round(z, 3)] = relation(rig, 2.0) - base
        assert tag(rig, "Offset") == pytest.approx(relation(rig, 2.0) - base)
    assert seen[0.5] == pytest.approx(5.0)
    assert seen[0.252] == pytest.approx(10.0 * (10 * 0.252**3 - 15 * 0.252**4 + 6 * 0.252**5))
    assert max(seen) == pytest.approx(1.0, abs=0.01)
    assert (tag(rig, "Offset"), job.AbsoluteOffset) == (10.0, 10.0)


@pytest.mark.requirement("SYN-188", "SYN-337")
def test_a_reversal_ends_a_shift_on_its_way():
    """16#808C and the shift that is reached stays; a job that waits goes on."""
    rig = in_gear(0.0)
    base = relation(rig)
    rig.until(rig.leader.move_relative(10.0).done)
    job = rig.axis.phasing_relative(4.0, ProfileReference=1, PhasingDistance=20.0)
    rig.until(rig.leader.move_relative(10.0).done)
    assert job.Busy
    rig.until(rig.leader.move_relative(-1.0).done)
    assert (job.Error, job.ErrorID) == (True, 0x808C)
    assert relation(rig) - base == pytest.approx(2.0, abs=0.02)
    waiting = rig.axis.phasing_relative(4.0, ProfileReference=1, PhasingDistance=20.0, Direction=1)
    rig.until(rig.leader.move_relative(-5.0).done)
    assert (waiting.Busy, waiting.StartPhasing) == (True, False)
    cancel = rig.axis.phasing_relative(0.0, ProfileReference=5)
    rig.cycles(2)
    assert (cancel.Done, waiting.CommandAborted) == (True, True)


@pytest.mark.requirement("SYN-425", "SYN-432")
def test_what_shifts_is_not_cancelled():
    """ProfileReference 5 leaves a job that shifts alone, and is done."""
    rig = in_gear(100.0)
    for job, cancel in (
        (rig.axis.phasing_relative(4.0, ProfileReference=1, PhasingDistance=50.0), rig.axis.phasing_relative),
        (None, rig.axis.offset_relative),
    ):
        active = job or rig.axis.offset_relative(3.0, 50.0)
        rig.cycles(5)
        done = cancel(0.0, ProfileReference=5)
        rig.cycles(2)
        assert (done.Done, active.Busy) == (True, True)
        rig.until(active.done)


@pytest.mark.requirement("SYN-189")
def test_another_synchronous_job_begins_without_shifts():
    """A new MC_GearIn aborts the job that shifts; both shifts are 0 again, and nothing steps."""
    rig = in_gear(100.0)
    rig.until(rig.axis.offset_absolute(3.0, 20.0).done)
    job = rig.axis.phasing_absolute(10.0, **DYNAMICS)
    rig.run(0.1)
    before = rig.axis.var("Position")
    again = rig.axis.gear_in(rig.leader, Acceleration=2000.0, Jerk=0.0)
    rig.cycles(2)
    assert (job.CommandAborted, tag(rig, "PhaseShift"), tag(rig, "Offset")) == (True, 0.0, 0.0)
    assert rig.axis.var("Position") - before == pytest.approx(2 * 150.0 * CYCLE, rel=0.1)
    rig.until(again.in_gear)


AT = {"ProfileReference": 2, "StartPosition": nan}
WRONG = [
    ("phasing_absolute", (nan,), {}, 0x8070),
    ("phasing_absolute", (1.0,), {"ProfileReference": 3}, 0x8083),
    ("phasing_absolute", (1.0,), {"ProfileReference": 4}, 0x8083),
    ("phasing_absolute", (1.0,), {"ProfileReference": 1}, 0x8082),
    ("phasing_absolute", (1.0,), {"Velocity": 0.0}, 0x8003),
    (
        "phasing_absolute",
        (1.0,),
        {"ProfileReference": 2, "PhasingDistance": 1.0, "StartPosition": nan},
        0x8084,
    ),
    ("phasing_absolute", (1.0,), {"ProfileReference": 1, "PhasingDistance": 1.0, "Direction": 4}, 0x8007),
    ("phasing_relative", (1.0,), {"Master": None}, 0x8002),
    ("offset_absolute", (nan, 1.0), {}, 0x8080),
    ("offset_absolute", (1.0, 0.0), {}, 0x8081),
    ("offset_absolute", (1.0, 1.0), {"ProfileReference": 0}, 0x8083),
    ("offset_relative", (1.0, 1.0), AT, 0x8084),
    ("offset_relative", (1.0, 1.0), {"Direction": 0}, 0x8007),
]


def refused(rig, name, arguments, inputs):
    """The ErrorID of a shift that is refused; the gear goes on."""
    inputs = {"Master": rig.leader.object} | inputs if name.startswith("phasing") else inputs
    handle = rig.axis
    kind = {
        "phasing_absolute": handle.phasing_absolute,
        "phasing_relative": handle.phasing_relative,
        "offset_absolute": handle.offset_absolute,
        "offset_relative": handle.offset_relative,
    }[name]
    job = kind(*arguments)
    job.set(Execute=True, **inputs)
    rig.cycles(2)
    assert job.Error
    return job.ErrorID


@pytest.mark.requirement("SYN-328", "SYN-334", "SYN-345")
def test_wrong_inputs_of_shifts(subtests):
    """Each has its ErrorID; the gear and its relation go on."""
    rig = in_gear(100.0)
    base = relation(rig)
    for name, arguments, inputs, error in WRONG:
        with subtests.test(f"{name} {inputs}"):
            assert refused(rig, name, arguments, inputs) == error
    assert (rig.job.InGear, relation(rig) - base) == (True, pytest.approx(0.0, abs=1e-9))


@pytest.mark.requirement("SYN-186", "SYN-335")
def test_when_nothing_can_be_shifted():
    """Without a synchronous job 16#8075, before it is synchronous 16#80A9, with velocity gearing 16#8079,
    while the other value is shifted or waits for it 16#808A.
    """
    both = (("phasing_absolute", (1.0,), {}), ("offset_absolute", (1.0, 10.0), {}))
    rig = gear(100.0, Acceleration=100.0)
    assert [refused(rig, *one) for one in both] == [0x80A9, 0x80A9]
    rig.until(rig.axis.halt().done)
    assert [refused(rig, *one) for one in both] == [0x8075, 0x8075]
    rig.until(rig.axis.gear_in_velocity(rig.leader, PositionControlled=True).in_sync)
    assert [refused(rig, *one) for one in both] == [0x8079, 0x8079]
    rig.until(rig.axis.gear_in(rig.leader).in_gear)
    for profile in (1, 2):
        far = {"ProfileReference": profile, "StartPosition": 1e6}
        first = rig.axis.phasing_relative(1.0, PhasingDistance=50.0, **far)
        rig.cycles(2)
        assert refused(rig, *both[1]) == 0x808A
        rig.axis.phasing_relative(0.0, ProfileReference=5)
        rig.until(first.ended)
        first = rig.axis.offset_relative(1.0, 50.0, **far)
        rig.cycles(2)
        assert refused(rig, *both[0]) == 0x808A
        rig.axis.offset_relative(0.0, ProfileReference=5)
        rig.until(first.ended)


@pytest.mark.requirement("SYN-029", "SYN-030", "SYN-040", "SYN-384", "SYN-033", "STP-202")
@pytest.mark.parametrize("ratio", [1, 2])
def test_the_chain_from_leading_to_following_value(ratio):
    """Additive 3, phase 5, offset 7, superimposed 2: only what is before the function is multiplied; the
    leading axis sees nothing of it, while its own superimposed motion goes through the function.
    """
    rig = in_gear(0.0, ratio, 1)
    x, y = places(rig)
    rig.axis.leading_value_additive(3.0)
    rig.cycles(3)
    rig.until(rig.axis.phasing_absolute(5.0, **DYNAMICS).done)
    offset = rig.axis.offset_absolute(7.0, 100.0)
    rig.until(rig.leader.move_relative(98.0).done, timeout=10.0)
    rig.until(rig.leader.move_superimposed(2.0).done)
    assert offset.Done
    rig.until(rig.axis.move_superimposed(2.0).done)
    rig.cycles(2)
    assert rig.leader.var("Position") - x == pytest.approx(100.0)
    assert tag(rig, "EffectiveLeadingValue.Position") - x == pytest.approx(103.0)
    assert tag(rig, "FunctionLeadingValue.Position") - x == pytest.approx(108.0)
    assert (tag(rig, "PhaseShift"), tag(rig, "Offset")) == (5.0, 7.0)
    assert tag(rig, "FunctionFollowingValue.Position") - y == pytest.approx(108.0 * ratio)
    assert rig.axis.var("Position") - y == pytest.approx(108.0 * ratio + 9.0)
    assert rig.axis.var("StatusPositioning.SuperimposedDistance") == pytest.approx(2.0)


@pytest.mark.requirement("CAM-136", "SYN-189", "SYN-431")
def test_the_next_cam_takes_shifts_over_without_a_step():
    """Phase 6 and offset 7 of a cam: with profile 5 the next one begins where the end of the shifted cam is,
    shifts are 0, and the setpoint goes on evenly.
    """
    rig = standing()
    cam = cam_of(rig, ((0.0, 0.0), (100.0, 100.0)))
    job = rig.axis.cam_in(
        rig.leader, cam, MasterStartDistance=10.0, MasterSyncPosition=15.0, ApplicationMode=2
    )
    rig.leader.move_velocity(50.0)
    rig.until(job.in_sync)
    rig.until(rig.axis.phasing_relative(6.0, ProfileReference=1, PhasingDistance=10.0).done)
    rig.until(rig.axis.offset_relative(7.0, 10.0).done)
    following = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=5, ApplicationMode=2)
    places_ = []
    rig.runtime.after_cycle.append(lambda: places_.append(places(rig)[1]))
    rig.until(following.in_sync)
    assert places(rig)[0] == pytest.approx(94.0, abs=0.3)
    assert (job.CommandAborted, tag(rig, "PhaseShift"), tag(rig, "Offset")) == (
        True,
        0.0,
        pytest.approx(107.0),
    )
    rig.run(0.3)
    assert [b - a for a, b in pairwise(places_)] == pytest.approx([50.0 * CYCLE] * (len(places_) - 1))


@pytest.mark.exhaustive
@pytest.mark.requirement("SYN-488", "SYN-383")
@settings(max_examples=6)
@given(
    st.lists(
        st.tuples(st.sampled_from(("phase", "offset", "superimpose", "lead", "cam")), st.floats(-8.0, 8.0)),
        min_size=3,
        max_size=8,
    )
)
def test_what_the_setpoint_consists_of(jobs):
    """Any sequence of jobs in camming: in every cycle function, offset and superimposed distance are the
    setpoint.
    """
    rig = standing()
    cam = cam_of(
        rig,
        ((0.0, 0.0), (90.0, 60.0), (180.0, 20.0), (360.0, 0.0)),
        **{"InterpolationSettings.InterpolationMode": 1},
    )
    job = rig.axis.cam_in(
        rig.leader,
        cam,
        MasterStartDistance=30.0,
        MasterSyncPosition=40.0,
        SlaveOffset=20.0,
        ApplicationMode=1,
    )
    rig.leader.move_velocity(100.0)
    rig.until(job.in_sync)
    seen = []

    def sample():
        if rig.axis.var("StatusWord") & SYNCHRONOUS:
            parts = tag(rig, "FunctionFollowingValue.Position") + tag(rig, "Offset")
            parts += rig.axis.var("StatusPositioning.SuperimposedDistance")
            seen.append(parts - rig.axis.var("Position"))

    rig.runtime.after_cycle.append(sample)
    for kind, value in jobs:
        if kind == "phase":
            rig.axis.phasing_relative(value, ProfileReference=1, PhasingDistance=30.0)
        elif kind == "offset":
            rig.axis.offset_relative(value, 20.0)
        elif kind == "superimpose":
            rig.axis.move_superimposed(value)
        elif kind == "lead":
            rig.leader.move_velocity(100.0 + 5.0 * value)
        else:
            rig.axis.cam_in(
                rig.leader, cam, SyncProfileReference=5, ApplicationMode=1, SlaveScaling=1.0 + 0.1 * value
            )
        rig.run(0.35)
    assert len(seen) > 150
    assert max(map(abs, seen)) < 1e-9


@pytest.mark.requirement("SYN-347", "SYN-370", "SYN-222", "SYN-227", "SYN-046", "SYN-219")
def test_the_additive_value_acts_at_once():
    """10 mm are a step of leading value and follower in the next cycle; FALSE is the step back."""
    rig = in_gear(0.0)
    job = rig.axis.leading_value_additive(0.0)
    rig.cycles(2)
    x, y = tag(rig, "EffectiveLeadingValue.Position"), rig.axis.var("Position")
    assert (job.Busy, tag(rig, "StatusWord") & 1 << 4) == (True, 1 << 4)
    for value, enable in ((10.0, True), (10.0, False)):
        job.set(Position=value, Enable=enable)
        rig.cycles(2)
        shown = value if enable else 0.0
        assert tag(rig, "EffectiveLeadingValue.Position") - x == pytest.approx(shown)
        assert rig.axis.var("Position") - y == pytest.approx(shown)
        assert (job.Busy, bool(tag(rig, "StatusWord") & 1 << 4)) == (enable, enable)


@pytest.mark.requirement("SYN-220", "SYN-226", "SYN-439", "SYN-229")
def test_the_additive_value_belongs_to_the_axis():
    """Accepted without a synchronous job, kept by the next ones; a second instance takes over; disabling ends
    it, and a disabled axis refuses it with 16#800F.
    """
    rig = in_gear(0.0)
    rig.until(rig.axis.halt().done)
    x = rig.leader.var("Position")
    first = rig.axis.leading_value_additive(3.0)
    rig.cycles(2)
    for _ in range(2):
        rig.until(rig.axis.gear_in(rig.leader).in_gear)
        assert (first.Busy, tag(rig, "EffectiveLeadingValue.Position") - x) == (True, pytest.approx(3.0))
    second = rig.axis.leading_value_additive(4.0)
    rig.cycles(3)
    assert (first.Busy, second.Busy) == (False, True)
    assert tag(rig, "EffectiveLeadingValue.Position") - x == pytest.approx(4.0)
    rig.until(rig.axis.power(False).off)
    rig.cycles(2)
    assert (second.Busy, tag(rig, "StatusWord") & 1 << 4) == (False, 0)
    rig.until(rig.axis.power().status)
    for name, error in (("Position", 0x8009), ("Velocity", 0x8003), ("Acceleration", 0x8004)):
        wrong = rig.axis.leading_value_additive(0.0)
        wrong.set(**{name: nan})
        rig.cycles(2)
        assert (wrong.Error, wrong.ErrorID, wrong.Busy) == (True, error, False)
    rig.until(rig.axis.power(False).off)
    third = rig.axis.leading_value_additive(4.0)
    rig.cycles(2)
    assert (third.Error, third.ErrorID) == (True, 0x800F)


@pytest.mark.requirement("SYN-428")
@pytest.mark.parametrize(("speed", "growth"), [(40.0, 0.0), (5.0, 60.0), (-30.0, -20.0)])
def test_velocity_and_acceleration_of_a_shift_are_its_derivatives(speed, growth):
    """At constant and at changing velocity of the leading value; both are continuous, and 0 at its ends."""
    shift = ShiftOverDistance(1.0, 9.0, distance=40.0, direction=3, start=None, modulo=0.0)
    step, x, rows = 1e-3, 0.0, []
    for number in range(1, 2000):
        time = number * step
        before, x = x, speed * time + 0.5 * growth * time * time
        shift.step(x, x - before, speed + growth * time, growth)
        rows.append((shift.value, shift.velocity, shift.acceleration))
    assert shift.done
    for (s0, v0, _), (_, v1, a1), (s2, v2, _) in zip(rows, rows[1:], rows[2:], strict=False):
        assert (s2 - s0) / (2.0 * step) == pytest.approx(v1, abs=0.02)
        assert (v2 - v0) / (2.0 * step) == pytest.approx(a1, abs=0.6)
    top = max(abs(a) for *_, a in rows)
    assert top > 5.0
    assert max(abs(b[2] - a[2]) for a, b in pairwise(rows)) < 0.05 * top


@given(
    target=st.floats(-50.0, 50.0),
    distance=st.floats(1.0, 100.0),
    steps=st.lists(st.floats(0.0, 3.0), min_size=2, max_size=80),
    sign=st.sampled_from((-1.0, 1.0)),
)
def test_a_shift_over_a_way_goes_on_evenly(target, distance, steps, sign):
    """Any speed of the leading value, standstill included: the shift never goes back, its velocity is its
    change with the leading value, and it ends exactly on its target.
    """
    shift = ShiftOverDistance(0.0, target, distance=distance, direction=3, start=None, modulo=0.0)
    x = before = 0.0
    for step in steps:
        x += sign * step
        shift.step(x, sign * step, sign * step / CYCLE, 0.0)
        assert abs(before) - 1e-12 <= abs(shift.value) <= abs(target) * (1.0 + 1e-12)
        # mean velocity of the cycle: between those of its ends but for the curvature of the polynomial
        slope = abs(shift.velocity) * CYCLE - abs(shift.value - before)
        assert abs(slope) <= abs(target) * 5.8 * (step / distance) ** 2 + 1e-9
        before = shift.value
    assert shift.done is (abs(x) >= distance)
    assert not shift.done or shift.value == target


@pytest.mark.requirement("SYN-429", "SYN-195")
def test_offsets_of_a_cam_contain_its_slave_offset():
    """SlaveOffset 20: relative 10 makes 30, absolute 30 is there already, absolute 0 takes all of it out; a
    phase is shifted over a way alone (16#80A8).
    """
    rig = standing()
    cam = cam_of(rig, ((0.0, 0.0), (360.0, 360.0)))
    job = rig.axis.cam_in(
        rig.leader,
        cam,
        MasterSyncPosition=50.0,
        MasterStartDistance=40.0,
        SlaveOffset=20.0,
        ApplicationMode=1,
    )
    rig.cycles()
    rig.leader.move_velocity(100.0)
    rig.until(job.in_sync)
    assert tag(rig, "Offset") == 20.0
    base = relation(rig)
    more = rig.axis.offset_relative(10.0, 20.0)
    rig.until(more.done)
    assert (tag(rig, "Offset"), more.CoveredOffset) == (30.0, 10.0)
    assert relation(rig) - base == pytest.approx(10.0)
    there = rig.axis.offset_absolute(30.0, 20.0)
    rig.cycles(2)
    assert (there.Done, there.AbsoluteOffset) == (True, 30.0)
    out = rig.axis.offset_absolute(0.0, 20.0)
    rig.until(out.done)
    assert relation(rig) - base == pytest.approx(-20.0)
    assert tag(rig, "Offset") == 0.0
    assert refused(rig, "phasing_absolute", (1.0,), {}) == 0x80A8
    rig.until(rig.axis.phasing_absolute(5.0, ProfileReference=1, PhasingDistance=20.0).done)
    assert relation(rig) - base == pytest.approx(-15.0)


@pytest.mark.exhaustive
@settings(max_examples=6)
@given(
    numerator=st.integers(-40, 40).filter(bool),
    denominator=st.integers(1, 13),
    profile=st.sampled_from([1, 3, 4]),
    modulo=st.sampled_from([(0.0, 0.0), (36.0, 0.0), (0.0, 50.0), (65.7, 47.3)]),
    shifts=st.lists(st.tuples(st.booleans(), st.floats(-4.0, 4.0)), min_size=1, max_size=3),
    reverses=st.booleans(),
)
def test_any_gear_with_any_shifts(numerator, denominator, profile, modulo, shifts, reverses):
    """A gear between positions, with modulo ranges on either side and shifts of both values one after the
    other: F = N / D * M from the synchronous positions in every cycle, and the axis is at F and its offset.
    """
    ratio = numerator / denominator
    fast = {"DynamicLimits.MaxVelocity": 20_000.0, "DynamicLimits.Velocity": 20_000.0}
    ranges = [
        fast | ({"Modulo.Enable": True, "Modulo.Length": length} if length else {}) for length in modulo
    ]
    rig = standing(leader=ranges[0], follower=ranges[1])
    job = rig.axis.gear_in_pos(
        rig.leader, 20.0, 10.0, numerator, denominator, SyncProfileReference=profile, MasterStartDistance=15.0
    )
    travel(rig, 60.0)
    rig.until(job.in_sync)
    x0, y0 = places(rig)
    seen = []

    def look():
        phase, offset = tag(rig, "PhaseShift"), tag(rig, "Offset")
        x, y = places(rig)
        seen.append((y - offset - y0 - ratio * (x + phase - x0), rig.axis.var("Velocity"), y))

    rig.runtime.after_cycle.append(look)
    for phases, amount in shifts:
        if phases:
            shift = rig.axis.phasing_relative(amount, ProfileReference=1, PhasingDistance=12.0)
        else:
            shift = rig.axis.offset_relative(amount, 12.0)
        rig.until(shift.done)
    if reverses:
        travel(rig, -45.0)
        rig.run(0.3)
    assert job.InSync
    assert rig.alarms_of("axis1") == []
    assert max(abs(off) for off, *_ in seen) < 1e-7
    for (_, before, y), (_, after, later) in pairwise(seen):
        ways = sorted((before, after))
        slack = 0.02 * (abs(before) + abs(after)) + 5.0
        assert ways[0] - slack <= (later - y) / CYCLE <= ways[1] + slack
    if profile != 4 and not any(modulo):
        assert y0 - 10.0 == pytest.approx(ratio * (x0 - 20.0), abs=1e-7)


@pytest.mark.requirement("SYN-192", "SYN-384", "SYN-191")
def test_an_offset_counts_the_effective_leading_value():
    """Start position and distance are those of the leading value with what is added, without the phase shift;
    the direction waits for its own; profile 5 cancels what waits.
    """
    rig = in_gear(0.0)
    x = rig.leader.var("Position")
    rig.axis.leading_value_additive(3.0)
    rig.cycles(2)
    rig.until(rig.axis.phasing_absolute(20.0, **DYNAMICS).done)
    job = rig.axis.offset_relative(4.0, 10.0, ProfileReference=2, StartPosition=x + 33.0, Direction=1)
    travel(rig, 50.0)
    rig.until(lambda: job.StartOffset)
    assert rig.leader.var("Position") - x == pytest.approx(30.0, abs=50.0 * CYCLE * 2.0)
    rig.until(job.done)
    assert rig.leader.var("Position") - x == pytest.approx(40.0, abs=50.0 * CYCLE * 2.5)
    travel(rig, -50.0)
    rig.run(0.1)
    waits = rig.axis.offset_relative(1.0, 5.0, Direction=1)
    rig.run(0.2)
    assert (waits.Busy, waits.StartOffset, tag(rig, "Offset")) == (True, False, 4.0)
    rig.axis.offset_relative(0.0, ProfileReference=5)
    rig.until(waits.aborted)


@pytest.mark.requirement("SYN-185", "SYN-433", "SYN-339")
def test_shifts_need_a_synchronous_gear():
    """Without a synchronous job 16#8075, while one synchronises 16#80A9, in simulation 16#8076, on a gear of
    velocities 16#8079; in gear they run.
    """

    def errors(rig):
        jobs = rig.axis.phasing_relative(1.0, **DYNAMICS), rig.axis.offset_relative(1.0, 5.0)
        rig.cycles(2)
        return {job.ErrorID for job in jobs}

    rig = standing()
    assert errors(rig) == {0x8075}
    assert errors(gear(50.0, Acceleration=50.0)) == {0x80A9}
    rig = in_gear(0.0)
    rig.axis.synchronized_motion_simulation()
    rig.cycles(2)
    assert errors(rig) == {0x8076}
    rig = standing()
    rig.until(rig.axis.gear_in_velocity(rig.leader, PositionControlled=True).in_sync)
    assert errors(rig) == {0x8079}
    assert errors(in_gear(0.0)) == {0, 0x808A}  # the second one only because the first runs
