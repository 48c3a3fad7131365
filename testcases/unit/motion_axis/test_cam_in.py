"""`MC_CamIn` and `MC_CamOut`: camming (CAM sections 14 and 15)."""

from __future__ import annotations

import pytest

from motion.kernel.cams import Point
from motion.s7.cam_handle import CamHandle
from motion.s7.cams import Cam
from testcases.unit.motion_axis.override_cells import cam_of
from testcases.unit.motion_axis.test_gear_in import SYNCHRONOUS, places, word
from testcases.unit.motion_axis.test_gear_in_pos import MODULO, TAGS, phase, standing, travel, until_place

LINE = ((0.0, 0.0), (360.0, 360.0))
HILL = ((0.0, 0.0), (90.0, 60.0), (180.0, 100.0), (270.0, 40.0), (360.0, 0.0))
RISE = ((0.0, 0.0), (180.0, 30.0), (360.0, 100.0))


def f(cam, x):
    """Following value of the cam."""
    return cam.curve.evaluate(x)[0]


@pytest.mark.requirement("CAM-125", "CAM-132", "CAM-139", "SYN-037", "SYN-038", "SYN-383")
def test_in_advance_over_a_distance():
    """The numbers of the gear with a cam y = x; the cam is in use until the job ends, and its shifts are
    shown.
    """
    rig = standing()
    cam = cam_of(rig, LINE)
    job = rig.axis.cam_in(
        rig.leader, cam, MasterSyncPosition=100.0, MasterStartDistance=50.0, SlaveOffset=-75.0
    )
    read = rig.axis.var
    travel(rig, 100.0)
    until_place(rig, 49.0)
    assert (phase(job), word(rig.axis)) == ((True, False, False), 0)
    assert (read(TAGS + "WaitingFunctionState"), read(TAGS + "ActualCam"), cam.var("StatusWord.X0")) == (
        3,
        0,
        1,
    )
    until_place(rig, 75.0)
    x, y = places(rig)
    z = (x - 50.0) / 50.0
    assert y == pytest.approx(25.0 * (2.0 * z**3 - z**4), abs=1e-9)
    assert (phase(job), read(TAGS + "FunctionState")) == ((True, True, False), 3)
    assert read(TAGS + "ActualCam") == cam.object.db_number > 0
    rig.until(job.in_sync)
    assert (phase(job), word(rig.axis)) == ((True, False, True), SYNCHRONOUS)
    x, y = places(rig)
    assert y == pytest.approx(x - 75.0, abs=1e-9)
    shown = ("MasterOffset", "MasterScaling", "SlaveOffset", "SlaveScaling")
    assert [read(TAGS + name) for name in shown] == [0.0, 1.0, -75.0, 1.0]
    assert (read(TAGS + "Offset"), read(TAGS + "FunctionFollowingValue.Position")) == (
        -75.0,
        pytest.approx(x),
    )
    rig.axis.halt()
    rig.cycles(2)
    assert (job.CommandAborted, cam.var("StatusWord.X0"), read(TAGS + "ActualCam")) == (True, 0, 0)


@pytest.mark.requirement("CAM-106", "CAM-111")
@pytest.mark.parametrize(("velocity", "end"), [(100.0, 360.0), (-100.0, 0.0)])
def test_a_cam_that_is_run_once(velocity, end):
    """It ends the job at its end in the direction of the leading value, with EndOfProfile; the axis stays
    there.
    """
    rig = standing(leader_at=180.0)
    cam = cam_of(rig, RISE)
    job = rig.axis.cam_in(rig.leader, cam, MasterSyncPosition=180.0, SyncProfileReference=2)
    rig.until(job.in_sync)
    travel(rig, velocity)
    while not job.EndOfProfile:
        assert job.InSync
        x, y = places(rig)
        assert y == pytest.approx(f(cam, x) - 30.0, abs=1e-9)
        rig.cycles()
    assert (job.Busy, job.InSync, job.CommandAborted, job.Error, job.Done) == (False,) * 5
    assert places(rig)[0] == pytest.approx(end, abs=1.3)
    rig.run(0.1)
    assert (rig.axis.var("Position"), rig.axis.var("Velocity")) == (f(cam, end) - 30.0, 0.0)
    assert (job.EndOfProfile, word(rig.axis), rig.axis.var(TAGS + "FunctionState")) == (True, 0, 0)
    assert cam.var("StatusWord.X0") == 0


@pytest.mark.requirement("CAM-107", "CAM-108", "CAM-109", "CAM-112", "CAM-141", "SYN-363")
@pytest.mark.parametrize(("mode", "points", "lift"), [(1, HILL, 0.0), (2, RISE, 100.0)])
def test_cyclic_cams(mode, points, lift):
    """The cam is repeated, with its lift where it appends; a reversal leads back on the same curve, and every
    end is shown once.
    """
    rig = standing()
    cam = cam_of(rig, points)
    job = rig.axis.cam_in(
        rig.leader, cam, SyncProfileReference=3, MasterStartDistance=90.0, ApplicationMode=mode
    )
    ends = []
    rig.runtime.after_cycle.append(lambda: ends.append(job.EndOfProfile))
    travel(rig, 300.0)
    rig.until(job.in_sync)
    for velocity, target in ((300.0, 900.0), (-300.0, -90.0)):
        travel(rig, velocity)
        sign = 1.0 if velocity > 0.0 else -1.0
        while sign * (target - places(rig)[0]) > 0.0:
            rig.cycles()
            x, y = places(rig)
            assert y == pytest.approx(f(cam, x % 360.0) + (x // 360.0) * lift, abs=1e-6)
    assert job.InSync
    assert sum(ends) == 2 + 3


@pytest.mark.requirement("CAM-126", "CAM-133")
def test_direct():
    """Both axes where they are become the synchronous position: at once, without a step."""
    rig = standing(at=12.0, leader_at=37.5)
    cam = cam_of(rig, HILL)
    job = rig.axis.cam_in(rig.leader, cam, MasterSyncPosition=90.0, SyncProfileReference=2, SlaveOffset=99.0)
    rig.cycles(3)
    assert (phase(job), rig.axis.var("Position")) == ((True, False, True), 12.0)
    assert rig.axis.var(TAGS + "MasterOffset") == -52.5
    assert rig.axis.var(TAGS + "SlaveOffset") == pytest.approx(12.0 - f(cam, 90.0))
    travel(rig, 100.0)
    rig.run(0.5)
    x, y = places(rig)
    assert y == pytest.approx(f(cam, x + 52.5) + 12.0 - f(cam, 90.0), abs=1e-9)
    rig.until(rig.axis.move_superimposed(5.0).done)
    rig.axis.home(rig.axis.var("ActualPosition") + 100.0)
    rig.run(0.1)
    assert job.InSync
    assert rig.axis.var(TAGS + "SlaveOffset") == pytest.approx(12.0 - f(cam, 90.0))


@pytest.mark.requirement("CAM-127", "CAM-237")
def test_subsequent_with_scaling():
    """The synchronous position is start * scaling + offset + MasterSyncPosition, and the end of synchronising
    the distance behind it.
    """
    rig = standing()
    cam = cam_of(rig, ((30.0, 0.0), (130.0, 50.0)))
    job = rig.axis.cam_in(
        rig.leader, cam, MasterScaling=2.0, MasterOffset=50.0, SlaveScaling=3.0, SlaveOffset=-20.0,
        MasterSyncPosition=40.0, SyncProfileReference=3, MasterStartDistance=30.0,
    )  # fmt: skip
    travel(rig, 100.0)
    rig.until(job.start_sync)
    assert places(rig)[0] == pytest.approx(150.0, abs=0.9)
    rig.until(job.in_sync)
    x, y = places(rig)
    assert x == pytest.approx(180.0, abs=0.9)
    assert y == pytest.approx(3.0 * f(cam, (x - 50.0) / 2.0) - 20.0, abs=1e-9)
    assert rig.axis.var("Velocity") == pytest.approx(3.0 * 0.5 / 2.0 * 100.0)


@pytest.mark.requirement("CAM-128", "CAM-130", "CAM-134", "CAM-238", "CAM-239")
@pytest.mark.parametrize("profile", [4, 6])
def test_from_the_present_leading_value(profile):
    """It waits while the leading axis stands, and begins where it is; profile 6 puts the synchronous position
    at the end of the distance.
    """
    rig = standing(leader_at=270.0, leader=MODULO)
    cam = cam_of(rig, HILL)
    job = rig.axis.cam_in(
        rig.leader, cam, SyncProfileReference=profile, MasterStartDistance=180.0, MasterSyncPosition=180.0,
        ApplicationMode=1,
    )  # fmt: skip
    rig.run(0.2)
    assert (phase(job), rig.axis.var(TAGS + "WaitingFunctionState")) == ((True, False, False), 3)
    travel(rig, 200.0)
    rig.cycles(3)
    assert job.StartSync
    rig.until(job.in_sync)
    place = rig.leader.var("Position")
    assert place == pytest.approx(90.0, abs=1.7)
    assert rig.axis.var("Position") == pytest.approx(
        f(cam, place if profile == 4 else place + 90.0), abs=1e-6
    )
    assert rig.axis.var(TAGS + "MasterOffset") == pytest.approx(0.0 if profile == 4 else -90.0)


@pytest.mark.requirement("CAM-124")
def test_in_advance_with_dynamic_values():
    """With the dynamic values of the job, to the place and the velocity of the cam at the synchronous
    position.
    """
    rig = standing()
    cam = cam_of(rig, HILL)
    job = rig.axis.cam_in(
        rig.leader, cam, MasterOffset=100.0, MasterSyncPosition=90.0, SyncProfileReference=0,
        Velocity=200.0, Acceleration=1000.0, Deceleration=1000.0, Jerk=0.0,
    )  # fmt: skip
    travel(rig, 100.0)
    rig.until(job.in_sync)
    x, y = places(rig)
    assert x == pytest.approx(190.0, abs=0.9)
    assert y == pytest.approx(f(cam, x - 100.0), abs=1e-9)
    assert max(rig.column("velocity_setpoint")) <= 200.0 + 1e-6


@pytest.mark.requirement("CAM-129", "CAM-135", "CAM-136", "SYN-336")
def test_another_cam_at_the_end_of_the_active_one():
    """It waits for the end, takes over in that cycle at its synchronous position, and is synchronous all the
    time; without active camming it is refused.
    """
    rig = standing(at=10.0)
    cam, other = cam_of(rig, RISE), cam_of(rig, HILL)
    none = rig.axis.cam_in(rig.leader, other, SyncProfileReference=5)
    rig.cycles(2)
    assert none.ErrorID == 0x808B
    first = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2)
    rig.until(first.in_sync)
    travel(rig, 200.0)
    second = rig.axis.cam_in(rig.leader, other, SyncProfileReference=5, MasterSyncPosition=90.0)
    words = []
    rig.runtime.after_cycle.append(lambda: words.append(word(rig.axis)))
    shift = rig.axis.move_superimposed(20.0, VelocityDiff=1.0)
    while not second.InSync:
        rig.cycles()
        assert first.InSync != second.InSync
    assert (first.CommandAborted, set(words), shift.Busy) == (True, {SYNCHRONOUS}, True)
    assert rig.axis.var(TAGS + "ActualCam") == other.object.db_number
    assert rig.axis.var(TAGS + "MasterOffset") == pytest.approx(270.0)
    assert rig.axis.var(TAGS + "SlaveOffset") == pytest.approx(110.0 - f(other, 90.0))
    rig.run(0.2)
    x, y = rig.leader.object.servo.total.s, rig.axis.object.servo.basic.s
    assert y == pytest.approx(f(other, x - 270.0) + 110.0 - f(other, 90.0), abs=1e-6)


@pytest.mark.requirement("CAM-240")
def test_another_cam_over_a_distance():
    """The first cam is followed until StartSync of the second one."""
    rig = standing()
    cam, other = cam_of(rig, RISE), cam_of(rig, HILL)
    first = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2)
    rig.until(first.in_sync)
    travel(rig, 100.0)
    second = rig.axis.cam_in(rig.leader, other, MasterSyncPosition=200.0, MasterStartDistance=80.0)
    until_place(rig, 119.0)
    assert (first.InSync, second.Busy, second.StartSync) == (True, True, False)
    rig.until(second.start_sync)
    assert first.CommandAborted
    assert places(rig)[0] == pytest.approx(120.0, abs=0.9)
    rig.until(second.in_sync)
    x, y = places(rig)
    assert (x, y) == (pytest.approx(200.0, abs=0.9), pytest.approx(f(other, x), abs=1e-9))


@pytest.mark.requirement("CAM-144", "SYN-246", "SYN-248", "SYN-249", "SYN-250", "SYN-251")
def test_cam_out_in_negative_direction():
    """MC_CamOut with SyncOutDirection 2 waits while the cam rises, and leaves it on the falling side."""
    rig = standing()
    cam = cam_of(rig, HILL)
    camming = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2, ApplicationMode=1)
    rig.until(camming.in_sync)
    travel(rig, 100.0)
    job = rig.axis.cam_out(50.0, MasterStopDistance=20.0, SyncOutDirection=2)
    until_place(rig, 170.0)
    assert (camming.InSync, job.Busy, job.StartSyncOut) == (True, True, False)
    assert rig.axis.var(TAGS + "WaitingFunctionState") == 5
    rig.until(job.start_sync_out)
    assert (camming.CommandAborted, camming.InSync, rig.axis.var(TAGS + "FunctionState")) == (True, False, 5)
    assert places(rig)[0] > 180.0
    rig.until(job.done)
    assert rig.axis.var("Position") == 50.0
    assert cam.var("StatusWord.X0") == 0


@pytest.mark.requirement("CAM-137", "SYN-313", "CAM-249")
def test_a_cam_that_is_not_interpolated():
    """Alarm 612 with reaction 4, ErrorWord.X2, 16#8001."""
    rig = standing()
    cam = Cam("raw", history=rig.history)
    rig.runtime.add_cam(cam)
    job = rig.axis.cam_in(rig.leader, CamHandle(rig.runtime, cam), MasterStartDistance=1.0)
    rig.cycles(3)
    (alarm,) = rig.axis.object.engine.pending
    assert (job.ErrorID, alarm.number, alarm.reaction, rig.axis.var("ErrorWord.X2")) == (0x8001, 612, 4, True)


@pytest.mark.requirement(
    "CAM-103", "CAM-115", "CAM-116", "CAM-117", "CAM-118", "CAM-119", "CAM-121", "CAM-138"
)
@pytest.mark.parametrize(
    ("inputs", "error"),
    [
        ({"Cam": None}, 0x8002),
        ({"MasterOffset": float("nan")}, 0x8021),
        ({"SlaveOffset": 2e12}, 0x8022),
        ({"MasterScaling": 0.0}, 0x8023),
        ({"SlaveScaling": float("inf")}, 0x8024),
        ({"MasterStartDistance": 0.0}, 0x8026),
        ({"ApplicationMode": 3}, 0x8027),
        ({"MasterSyncPosition": float("nan")}, 0x8034),
        ({"SyncProfileReference": 8}, 0x8036),
        ({"MasterSyncPosition": 361.0}, 0x80AD),
        ({"MasterSyncPosition": -1.0}, 0x80AD),
        ({"SyncProfileReference": 4, "MasterOffset": 5.0}, 0x80AD),
        ({"MasterSyncPosition": 360.0}, 0),
        ({"SyncProfileReference": 2, "MasterOffset": 2e12, "MasterStartDistance": 0.0}, 0),
    ],
)
def test_wrong_inputs(inputs, error):
    """Every input that is not permitted has its ErrorID; what the profile does not use is not looked at."""
    rig = standing()
    job = rig.axis.cam_in(rig.leader, cam_of(rig, HILL), MasterStartDistance=10.0)
    job.set(**inputs)
    rig.cycles(3)
    assert (job.ErrorID, job.Busy) == (error, not error)


@pytest.mark.requirement("CAM-211")
def test_cams_that_cannot_be_used():
    """Not interpolated: alarm 612 at the axis; in use: 16#80AB; being copied or interpolated: 16#80E7, E8."""
    rig = standing(leader_at=40.0)
    cam = Cam("raw", kind="TO_Cam_10k", points=[Point(0.0, 0.0), Point(100.0, 50.0)], history=rig.history)
    rig.runtime.add_cam(cam)
    raw = CamHandle(rig.runtime, cam)

    def error(job):
        rig.cycles(2)
        return job.ErrorID

    given = {"SyncProfileReference": 2, "MasterSyncPosition": 40.0}
    assert (error(rig.axis.cam_in(rig.leader, raw, **given)), rig.alarms_of("axis1")) == (0x8001, [612])
    rig.until(rig.axis.reset().done)
    copying = raw.copy([(float(x), 2.0) for x in range(2500)], [], Mode=1)
    rig.cycles()
    assert copying.Busy
    assert error(raw.interpolate()) == 0x80E7
    rig.until(copying.done)
    interpolating = raw.interpolate()
    rig.cycles()
    assert error(raw.copy([(1.0, 1.0)])) == 0x80E8
    rig.until(interpolating.done)
    rig.until(rig.axis.power().status)
    rig.until(rig.axis.cam_in(rig.leader, raw, **given).in_sync)
    assert error(raw.interpolate()) == 0x80AB
