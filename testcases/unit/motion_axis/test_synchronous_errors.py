"""ErrorIDs of synchronous operation and cams by their table (SYN section 11.2), and cams at their edges (CAM
sections 14 and 15).
"""

from __future__ import annotations

from itertools import pairwise
from math import inf, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motion.kernel.cams import Point, Segment
from motion.s7.axis import PositioningAxis
from motion.s7.cam_handle import CamHandle
from motion.s7.cams import Cam
from motion.s7.instructions import MC_GearIn
from testcases.unit.motion_axis.conftest import CYCLE
from testcases.unit.motion_axis.override_cells import cam_of
from testcases.unit.motion_axis.test_gear_in import SYNCHRONOUS, in_gear, places, word
from testcases.unit.motion_axis.test_gear_in_pos import standing, travel, until_place
from testcases.unit.motion_axis.test_leading_objects import behind_belt

SYNC = "StatusSynchronizedMotion."
RISE = ((0.0, 0.0), (360.0, 100.0))


def tag(rig, name):
    return rig.axis.var(f"{SYNC}{name}")


def error_of(rig, job):
    rig.cycles(2)
    assert job.Error
    assert not job.Busy
    return job.ErrorID


@pytest.mark.requirement(
    "SYN-319", "SYN-323", "SYN-324", "SYN-325", "SYN-326", "SYN-328", "SYN-334", "SYN-345"
)
def test_values_that_are_not_permitted():
    """Every input of every instruction has its ErrorID; the gear that runs goes on."""
    rig = in_gear(0.0)
    rig.axis.home(0.0)
    rig.cycles(2)
    axis, leader, cam = rig.axis, rig.leader, cam_of(rig)
    y = rig.axis.var("Position")
    way = {"MasterStartDistance": 10.0}
    phase = {"ProfileReference": 1, "PhasingDistance": 1.0}
    table = [
        (0x8007, lambda v: axis.gear_in_pos(leader, 50.0, 0.0, SyncDirection=v), (0, 4, -1)),
        (0x8007, lambda v: axis.cam_in(leader, cam, SyncDirection=v, **way), (0, 4)),
        (0x8007, lambda v: axis.gear_out(0.0, MasterStopDistance=1.0, SyncOutDirection=v), (0, 4)),
        (0x8007, lambda v: axis.phasing_absolute(1.0, **phase, Direction=v), (0, 4)),
        (0x8007, lambda v: axis.offset_absolute(1.0, 1.0, Direction=v), (0, 4)),
        (0x8021, lambda v: axis.cam_in(leader, cam, MasterOffset=v, **way), (nan, inf, 2e12)),
        (0x8022, lambda v: axis.cam_in(leader, cam, SlaveOffset=v, **way), (nan, -inf)),
        (0x8023, lambda v: axis.cam_in(leader, cam, MasterScaling=v, **way), (0.0, nan)),
        (0x8024, lambda v: axis.cam_in(leader, cam, SlaveScaling=v, **way), (nan,)),
        (0x8026, lambda v: axis.gear_in_pos(leader, 50.0, 0.0, MasterStartDistance=v), (0.0, -1.0, nan)),
        (0x8026, lambda v: axis.cam_in(leader, cam, MasterStartDistance=v), (0.0, -1.0)),
        (0x8026, lambda v: axis.gear_out(0.0, MasterStopDistance=v), (0.0, -1.0, nan)),
        (0x8027, lambda v: axis.cam_in(leader, cam, ApplicationMode=v, **way), (-1, 3)),
        (0x8034, lambda v: axis.gear_in_pos(leader, v, 0.0), (nan, 2e12)),
        (0x8034, lambda v: axis.cam_in(leader, cam, MasterSyncPosition=v, **way), (nan,)),
        (0x8035, lambda v: axis.gear_in_pos(leader, 50.0, v), (nan, -2e12)),
        (0x8036, lambda v: axis.gear_in_pos(leader, 50.0, 0.0, SyncProfileReference=v), (2, 5, -1)),
        (0x8036, lambda v: axis.cam_in(leader, cam, SyncProfileReference=v, **way), (8, -1)),
        (0x8036, lambda v: axis.gear_out(0.0, SyncProfileReference=v), (2, 3, 4, 6)),
        (0x8037, lambda v: axis.gear_out(v, MasterStopDistance=1.0), (nan, 2e12)),
        (0x8070, axis.phasing_absolute, (nan, inf)),
        (0x8070, axis.phasing_relative, (nan,)),
        (0x8080, lambda v: axis.offset_absolute(v, 1.0), (nan,)),
        (0x8080, lambda v: axis.offset_relative(v, 1.0), (inf,)),
        (0x8081, lambda v: axis.offset_relative(1.0, v), (0.0, -1.0, nan)),
        (0x8082, lambda v: axis.phasing_relative(1.0, ProfileReference=1, PhasingDistance=v), (0.0, nan)),
        (0x8083, lambda v: axis.phasing_relative(1.0, ProfileReference=v), (3, 4, 6, -1)),
        (0x8083, lambda v: axis.offset_relative(1.0, 1.0, ProfileReference=v), (0, 3, 4)),
        (0x8084, lambda v: axis.offset_relative(1.0, 1.0, ProfileReference=2, StartPosition=v), (nan,)),
    ]  # fmt: skip
    for error, start, values in table:
        for value in values:
            assert (hex(error), value, hex(error_of(rig, start(value)))) == (hex(error), value, hex(error))
    assert (rig.job.InGear, rig.axis.var("Position")) == (True, y)


@pytest.mark.requirement("SYN-316", "SYN-317", "SYN-322", "SYN-318", "SYN-135", "SYN-016")
def test_objects_that_do_not_fit():
    """16#8002: what does not lead, an external encoder on an S7-1500, no synchronous axis; 16#8001 behind an
    alarm; 16#8019 for the axis itself.
    """
    rig = standing()
    axis = rig.axis
    for master in (None, 5, Cam("c")):
        assert error_of(rig, axis.run(MC_GearIn(axis.object, Execute=True, Master=master))) == 0x8002
    wrong = MC_GearIn(rig.leader.object, Execute=True, Master=axis.object)
    assert error_of(rig, rig.axis.run(wrong)) == 0x8002
    assert error_of(rig, axis.gear_in(axis)) == 0x8019
    belt = behind_belt()
    belt.axis.object.cpu = "S7-1500"
    assert error_of(belt, belt.axis.gear_in(belt.encoder)) == 0x8002
    job = belt.axis.gear_in(belt.leader)
    belt.cycles(2)
    assert not job.Error
    rig.axis.object.alarm(104)
    rig.cycles(2)
    assert error_of(rig, axis.gear_in(rig.leader)) == 0x8001
    assert isinstance(rig.leader.object, PositioningAxis)


@pytest.mark.requirement("SYN-327", "SYN-340", "SYN-339")
def test_error_ids_of_cams():
    """Reading, interpolating and using them; shifts in camming, and before it is synchronous."""
    rig = standing()
    cam = cam_of(rig, ((0.0, 0.0), (100.0, 50.0), (200.0, 0.0)))
    assert error_of(rig, cam.leading_value(10.0, nan)) == 0x8062
    assert error_of(rig, cam.leading_value(99.0)) == 0x8063
    assert error_of(rig, cam.following_value(201.0)) == 0x8064
    assert error_of(rig, cam.leading_value(10.0, ApproachDirection=0)) == 0x8065
    assert error_of(rig, cam.leading_value(10.0, 190.0, ApproachDirection=1)) == 0x8066

    def other(name, *points):
        one = Cam(name, points=[Point(*point) for point in points], history=rig.history)
        rig.runtime.add_cam(one)
        return CamHandle(rig.runtime, one)

    assert error_of(rig, other("nothing").interpolate()) == 0x80AA
    assert error_of(rig, other("one", (0.0, 0.0)).interpolate()) == 0x80AC
    for profile in (0, 1, 2, 3, 6):
        for position in (-1.0, 201.0):
            way = {"MasterStartDistance": 10.0, "MasterSyncPosition": position}
            assert (
                error_of(rig, rig.axis.cam_in(rig.leader, cam, SyncProfileReference=profile, **way)) == 0x80AD
            )
    far = {"MasterStartDistance": 10.0, "MasterOffset": 50.0}
    assert error_of(rig, rig.axis.cam_in(rig.leader, cam, SyncProfileReference=4, **far)) == 0x80AD
    job = rig.axis.cam_in(rig.leader, cam, MasterSyncPosition=150.0, MasterStartDistance=100.0)
    travel(rig, 50.0)
    rig.until(job.start_sync)
    assert error_of(rig, cam.interpolate()) == 0x80AB
    for shift in (rig.axis.phasing_absolute(1.0), rig.axis.offset_absolute(1.0, 1.0)):
        assert error_of(rig, shift) == 0x80A9
    rig.until(job.in_sync)
    assert error_of(rig, rig.axis.phasing_absolute(1.0)) == 0x80A8
    assert job.InSync


@pytest.mark.requirement("CAM-110", "CAM-212", "CAM-113")
def test_a_cam_that_does_not_close_steps():
    """Cyclic, not appending: behind its end the follower is at the begin again, at once; before its begin and
    behind its end it is continued periodically.
    """
    rig = standing()
    cam = cam_of(rig, RISE)
    job = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2, ApplicationMode=1)
    rig.until(job.in_sync)
    seen = []
    rig.runtime.after_cycle.append(lambda: seen.append(places(rig)))
    travel(rig, 400.0)
    until_place(rig, 800.0)
    for x, y in seen:
        assert y == pytest.approx((x % 360.0) * 100.0 / 360.0, abs=1e-6) or x % 360.0 < 1e-6
    steps = [b[1] - a[1] for a, b in pairwise(seen)]
    assert min(steps) == pytest.approx(-100.0, abs=1.0)
    assert sum(step < 0.0 for step in steps) == 2
    assert (job.InSync, rig.alarms_of("axis1")) == (True, [])
    rig = standing(at=25.0, leader_at=450.0)
    job = rig.axis.cam_in(rig.leader, cam_of(rig, RISE), MasterSyncPosition=90.0, ApplicationMode=1,
                          MasterOffset=360.0, MasterStartDistance=10.0)  # fmt: skip
    rig.until(job.in_sync)
    travel(rig, -400.0)
    rig.run(1.0)
    x, y = places(rig)
    assert y == pytest.approx((x % 360.0) * 100.0 / 360.0, abs=1e-6)


@pytest.mark.requirement("CAM-213", "CAM-111", "CAM-207", "CAM-106")
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_the_end_of_a_cam_at_full_speed(sense):
    """Run once with slope 0.5 at both ends: EndOfProfile, not InSync, velocity 0 in one cycle, the position
    of the end is kept, whatever the leading axis does.
    """
    rig = standing(leader_at=10.0 if sense > 0 else 90.0, at=5.0 if sense > 0 else 45.0)
    cam = cam_of(rig, ((0.0, 0.0), (100.0, 50.0)))
    job = rig.axis.cam_in(
        rig.leader, cam, SyncProfileReference=2, MasterSyncPosition=10.0 if sense > 0 else 90.0
    )
    rig.until(job.in_sync)
    travel(rig, sense * 100.0)
    velocities = []
    rig.runtime.after_cycle.append(lambda: velocities.append(rig.axis.var("Velocity")))
    rig.until(job.end_of_profile)
    assert (job.InSync, job.Busy, job.CommandAborted, job.Error) == (False, False, False, False)
    assert velocities[-3:].count(0.0) >= 1
    last = [velocity for velocity in velocities if velocity][-1]
    assert last == pytest.approx(sense * 50.0)
    travel(rig, -sense * 100.0)
    rig.run(1.0)
    assert (rig.axis.var("Position"), word(rig.axis)) == (pytest.approx(50.0 if sense > 0 else 0.0), 0)


@pytest.mark.requirement("CAM-142")
def test_phasing_of_a_cam():
    """6 over 60 mm: afterwards the argument of the cam is shifted by 6; with dynamic values 16#80A8."""
    rig = standing()
    cam = cam_of(
        rig, ((0.0, 0.0), (100.0, 30.0), (400.0, 300.0)), **{"InterpolationSettings.InterpolationMode": 1}
    )
    job = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2)
    rig.until(job.in_sync)
    assert error_of(rig, rig.axis.phasing_absolute(6.0)) == 0x80A8
    travel(rig, 100.0)
    rig.run(0.1)
    shift = rig.axis.phasing_absolute(6.0, ProfileReference=1, PhasingDistance=60.0)
    rig.cycles(2)
    x = places(rig)[0]
    rig.until(shift.done)
    assert places(rig)[0] - x == pytest.approx(60.0, abs=1.0)
    for _ in range(20):
        rig.cycles()
        x, y = places(rig)
        assert y == pytest.approx(cam.object.curve.evaluate(x + 6.0)[0], abs=1e-9)


@pytest.mark.requirement("CAM-215", "CAM-129")
def test_a_reversal_in_front_of_the_end():
    """With profile 5 the new cam goes on waiting, and takes over where the end is passed at last."""
    rig = standing()
    cam = cam_of(rig, ((0.0, 0.0), (100.0, 100.0)))
    job = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2, ApplicationMode=2)
    rig.until(job.in_sync)
    following = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=5, ApplicationMode=2, SlaveScaling=0.5)
    rig.until(rig.leader.move_absolute(99.0).done)
    rig.until(rig.leader.move_absolute(40.0).done)
    assert (following.Busy, following.InSync, job.InSync, tag(rig, "WaitingFunctionState")) == (
        True,
        False,
        True,
        3,
    )
    travel(rig, 50.0)
    rig.until(following.in_sync)
    assert (places(rig)[0], job.CommandAborted) == (pytest.approx(100.0, abs=0.5), True)
    x, y = places(rig)
    assert y == pytest.approx(100.0 + 0.5 * (x - 100.0))


@pytest.mark.requirement("CAM-241")
@pytest.mark.parametrize(("scaling", "even"), [(2.0, True), (1.0, False)])
def test_derivatives_say_whether_the_next_cam_goes_on_evenly(scaling, even):
    """FirstDerivative of the old cam at its end, and of the new one at its synchronous position times its
    scaling: when they agree the velocity is continuous.
    """
    rig = standing()
    old = cam_of(rig, ((0.0, 0.0), (100.0, 100.0)))
    new = Cam(
        "new",
        segments=[Segment(0.0, 100.0, (0.0, 0.5, 0.001, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0)],
        history=rig.history,
    )
    rig.runtime.add_cam(new)
    handle = CamHandle(rig.runtime, new)
    rig.until(handle.interpolate().done)
    end, begin = old.following_value(100.0), handle.following_value(0.0)
    rig.cycles(3)
    assert (end.FirstDerivative == pytest.approx(scaling * begin.FirstDerivative)) is even
    job = rig.axis.cam_in(rig.leader, old, SyncProfileReference=2)
    rig.until(job.in_sync)
    following = rig.axis.cam_in(rig.leader, handle, SyncProfileReference=5, SlaveScaling=scaling)
    travel(rig, 50.0)
    rig.run(0.5)
    velocities, positions = [], []
    rig.runtime.after_cycle.append(lambda: velocities.append(rig.axis.var("Velocity")))
    rig.runtime.after_cycle.append(lambda: positions.append(places(rig)[1]))
    rig.until(following.in_sync)
    rig.cycles(5)
    jump = max(abs(b - a) for a, b in pairwise(velocities))
    assert (jump < 1.0) is even
    assert max(abs(b - a) for a, b in pairwise(positions)) <= 50.0 * CYCLE + 0.01


@pytest.mark.requirement("CAM-242")
@pytest.mark.parametrize("profile", [1, 3, 4])
def test_axes_that_are_in_place_for_a_cam(profile):
    """Both at their synchronous positions: synchronous in the next cycle, without StartSync."""
    rig = standing(at=25.0, leader_at=90.0)
    job = rig.axis.cam_in(
        rig.leader,
        cam_of(rig, RISE),
        SyncProfileReference=profile,
        MasterSyncPosition=90.0,
        MasterStartDistance=20.0,
    )
    rig.cycles(3)
    assert (job.Busy, job.StartSync, job.InSync, word(rig.axis)) == (True, False, True, SYNCHRONOUS)


@pytest.mark.requirement("CAM-252")
def test_what_is_no_cam():
    """A number, a point list and nothing at the input Cam are 16#8002; a cam that is not interpolated is
    alarm 612.
    """
    rig = standing()
    for wrong in (3, None, [(0.0, 0.0)], rig.leader.object):
        job = rig.axis.cam_in(rig.leader, cam_of(rig), MasterStartDistance=10.0)
        job.set(Cam=wrong)
        assert error_of(rig, job) == 0x8002
    fresh = Cam("fresh", points=[Point(float(x), float(x)) for x in range(900)], history=rig.history)
    rig.runtime.add_cam(fresh)
    handle = CamHandle(rig.runtime, fresh)
    job = rig.axis.cam_in(rig.leader, handle, MasterStartDistance=10.0)
    assert (error_of(rig, job), rig.alarms_of("axis1")) == (0x8001, [612])
    assert rig.axis.var("ErrorDetail.Reaction") == 4


@pytest.mark.exhaustive
@pytest.mark.requirement("CAM-140", "CAM-141", "CAM-063")
@settings(max_examples=10)
@given(
    points=st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=7),
    moves=st.lists(st.floats(5.0, 355.0), min_size=2, max_size=4),
    mode=st.sampled_from((0, 1)),
)
def test_any_cam_and_any_leading_motion(points, moves, mode):
    """Linear and cubic: in every cycle the follower is on the curve, forwards and backwards; reading the
    leading value of a following value finds that following value again.
    """
    rig = standing()
    step = 360.0 / (len(points) - 1)
    cam = cam_of(
        rig,
        [(number * step, y) for number, y in enumerate(points)],
        **{"InterpolationSettings.InterpolationMode": mode},
    )
    job = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2)
    rig.until(job.in_sync)
    curve = cam.object.curve
    base = places(rig)[1] - curve.evaluate(0.0)[0]
    worst = []
    rig.runtime.after_cycle.append(
        lambda: worst.append(abs(places(rig)[1] - base - curve.evaluate(places(rig)[0])[0]))
    )
    for target in moves:
        rig.until(rig.leader.move_absolute(target, Velocity=500.0).done)
        x = places(rig)[0]
        y = curve.evaluate(x)[0]
        found = cam.leading_value(y, x)
        rig.until(lambda found=found: found.Done or found.Error)
        assert found.Done
        assert curve.evaluate(found.Value)[0] == pytest.approx(y, abs=1e-6)
    assert job.InSync
    assert max(worst) < 1e-9
