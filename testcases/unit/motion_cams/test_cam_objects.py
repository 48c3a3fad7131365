"""Cam technology objects: data block, status, interpolation, copying, restart (CAM sections 12 and 13)."""

from math import nan, pi, radians, sin

import pytest

from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from motion.kernel.cams import Point, Segment
from motion.s7.cam_handle import CamHandle
from motion.s7.cams import CAM_TYPES, SEGMENT_FIELDS, Cam, PointArray, SegmentArray
from motion.s7.controller import OperatingState
from motion.s7.instructions import (
    MC_CopyCamData,
    MC_GetCamFollowingValue,
    MC_GetCamFollowingValueCyclic,
    MC_GetCamLeadingValue,
    MC_InterpolateCam,
    MC_Reset,
)
from motion.s7.runtime import Runtime
from motion.s7.variables import UnknownVariableError, VariableAccessError, VariableError

IN_USE, ERROR, RESTARTING, CHANGED, INTERPOLATED, INTERPOLATING, COPYING = (
    f"StatusWord.X{number}" for number in (0, 1, 2, 4, 5, 6, 7)
)
VALLEY = ((0.0, 1.0), (180.0, 0.0), (360.0, 1.0))


class Rig:
    """A controller with one cam."""

    def __init__(self, points=VALLEY, segments=(), **options):
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.runtime = Runtime(self.scheduler, cycle_ns=4 * MS, history=self.history)
        self.runtime.start()
        options.setdefault("variables", {"InterpolationSettings.InterpolationMode": 0})
        self.cam = self.add("profile", points, segments, **options)

    def add(self, name, points, segments=(), **options):
        found = [one if isinstance(one, Point) else Point(*one) for one in points]
        cam = Cam(name, points=found, segments=segments, history=self.history, **options)
        self.runtime.add_cam(cam)
        return CamHandle(self.runtime, cam)

    def cycles(self, count=1):
        self.scheduler.run_for(count * 4 * MS)

    def ended(self, instance, most=60):
        for _ in range(most):
            self.cycles()
            if instance.ended():
                return instance
        raise AssertionError(instance.summary())

    def interpolated(self):
        assert self.ended(self.cam.interpolate()).Done
        return self.cam

    def error(self, instance):
        return self.ended(instance).ErrorID


def segment(xmin, xmax, *a):
    return Segment(float(xmin), float(xmax), (*map(float, a), *[0.0] * (7 - len(a))))


@pytest.mark.requirement("CAM-001", "CAM-002", "CAM-003", "CAM-247")
def test_every_type_of_cam_has_its_number_of_points_and_segments():
    """The last index exists, the next one does not; configurations with more are refused."""
    expected = {"TO_Cam": (1000, 50), "TO_Cam_10k": (10_000, 50), "TO_Cam_600Seg": (1000, 600),
                "TO_Cam_6kSeg": (10_000, 6000)}  # fmt: skip
    assert {name: (one.points, one.segments) for name, one in CAM_TYPES.items()} == expected
    for kind, (points, segments) in expected.items():
        cam = Cam("c", kind=kind)
        for path in (f"Point[{points}].x", f"ValidPoint[{points}]", f"Segment[{segments}].a6",
                     f"ValidSegment[{segments}]", "Point[1].y", "Segment[1].xmin"):  # fmt: skip
            cam.write(path, True if path.startswith("Valid") else 1.5)
            assert cam.var(path) == (True if path.startswith("Valid") else 1.5)
        for path in (f"Point[{points + 1}].x", f"ValidSegment[{segments + 1}]", "Point[0].x"):
            with pytest.raises(UnknownVariableError, match=r"has (Point|ValidSegment)\[1\]"):
                cam.var(path)
        with pytest.raises(ConfigurationError, match=f"at most {points}"):
            Cam("c", kind=kind, points=[Point(float(x), 0.0) for x in range(points + 1)])
        many = [segment(2 * x, 2 * x + 1, 1) for x in range(segments + 1)]
        with pytest.raises(ConfigurationError, match=f"at most {segments}"):
            Cam("c", kind=kind, segments=many)
    with pytest.raises(ConfigurationError, match="TO_Cam_10k"):
        Cam("c", kind="TO_Cam_10K")
    with pytest.raises(ConfigurationError, match="only a technology CPU"):
        Cam("c", cpu="S7-1500")


@pytest.mark.requirement("CAM-004", "CAM-006", "CAM-007", "CAM-008", "CAM-010", "CAM-011")
def test_elements_and_settings_have_their_types_and_ranges(subtests):
    """LREAL beyond 1e12 becomes the bound; other values out of range are dropped and start OB 121."""
    rig = Rig(segments=[segment(400, 500, 1)])
    cam = rig.cam
    for path in ("Point[2].x", "Point[2].y", *(f"Segment[1].{field}" for field in SEGMENT_FIELDS)):
        with subtests.test(path):
            for value, kept in ((-1e12, -1e12), (1e12, 1e12), (2e12, 1e12), (-3e12, -1e12)):
                cam.write(path, value)
                assert cam.var(path) == kept
            cam.write(path, nan)
            assert cam.var(path) == -1e12
            with pytest.raises(VariableError, match="LREAL"):
                cam.write(path, True)
            assert cam.object.data.describe(path).access == "CAL"
    for name, highest in (("InterpolationMode", 2), ("BoundaryConditions", 1)):
        path = f"InterpolationSettings.{name}"
        with subtests.test(path):
            for value in range(highest + 1):
                cam.write(path, value)
                assert cam.var(path) == value
            events = len(rig.history.events)
            cam.write(path, highest + 1)
            cam.write(path, -1)
            assert cam.var(path) == highest
            assert [one.kind for one in rig.history.events[events:]] == ["program.error"] * 2
            assert cam.object.data.describe(path).data_type == "DINT"
    for path in ("StatusCam.StartLeadingValue", "StatusWord", "ErrorDetail.Number"):
        with pytest.raises(VariableAccessError, match="read only"):
            cam.write(path, 1)
    with pytest.raises(UnknownVariableError, match="similar: Point"):
        cam.var("Points[3].x")


@pytest.mark.requirement("CAM-005", "CAM-009", "CAM-013", "CAM-018", "CAM-219")
def test_only_valid_elements_take_part():
    """What an invalid element holds is of no matter; of points with one leading value that with the highest
    index counts; the valid ones are counted.
    """
    rig = Rig(points=[(0, 0), (10, 1), (20, 0)])
    cam = rig.cam
    cam.write_point(900, 5.0, -1e12, valid=False)
    cam.write_segment(7, segment(3, 2, 99), valid=False)
    rig.interpolated()
    assert cam.curve.evaluate(5.0)[0] == 0.5
    counts = [cam.var(f"StatusCam.NumberOfValid{what}") for what in ("Points", "Segments")]
    assert counts == [3, 0]
    cam.write_point(2, 10.0, 5.0)
    cam.write_point(1000, 10.0, 7.0)
    cam.write_point(999, 10.0, 6.0)
    cam.write_segment(50, segment(30, 40, 2))
    rig.interpolated()
    assert cam.curve.evaluate(10.0)[0] == 7.0
    assert cam.curve.evaluate(35.0)[0] == 2.0
    counts = [cam.var(f"StatusCam.NumberOfValid{what}") for what in ("Points", "Segments")]
    assert counts == [5, 1]
    cam.write("ValidPoint[1000]", False)
    cam.write("ValidSegment[50]", False)
    rig.interpolated()
    assert cam.curve.evaluate(10.0)[0] == 6.0
    assert cam.var("StatusCam.EndLeadingValue") == 20.0


@pytest.mark.requirement("CAM-012", "CAM-220")
def test_range_of_the_cam_is_shown_after_the_interpolation():
    """From the first point or segment to the last one; nothing else has an influence."""
    rig = Rig(points=[(10, 0), (20, 1), (30, 0)], segments=[segment(50, 60, 1)])
    ends = ("StatusCam.StartLeadingValue", "StatusCam.EndLeadingValue")
    assert [rig.cam.var(one) for one in ends] == [0.0, 0.0]
    rig.interpolated()
    assert [rig.cam.var(one) for one in ends] == [10.0, 60.0]
    rig.cam.write_segment(2, segment(-5, 0, 1))
    assert [rig.cam.var(one) for one in ends] == [10.0, 60.0]
    rig.interpolated()
    assert [rig.cam.var(one) for one in ends] == [-5.0, 60.0]


@pytest.mark.requirement("CAM-014")
def test_status_word_has_its_bits():
    """Every bit is set by its own cause, and the bits above X7 never are."""
    rig = Rig()
    cam = rig.cam
    assert cam.var("StatusWord") == 0
    job = cam.interpolate()
    rig.cycles()
    assert cam.var("StatusWord") == 1 << 6
    assert job.Busy
    rig.cycles()
    assert cam.var("StatusWord") == 1 << 5
    cam.object.use(rig)
    assert cam.var("StatusWord") == 1 << 5 | 1
    cam.object.release_use(rig)
    cam.copy([(0.0, 3.0)], Mode=1)
    rig.cycles()
    assert cam.var("StatusWord") == 1 << 7 | 1 << 5
    rig.cycles()
    assert cam.var("StatusWord") == 1 << 5 | 1 << 4
    cam.object.data.write_start("InterpolationSettings.InterpolationMode", 9)
    reset = cam.reset(restart=True)
    rig.cycles(2)
    assert cam.var("StatusWord") == 1 << 5 | 1 << 4 | 1 << 2
    rig.ended(reset)
    assert cam.var(ERROR) is True
    assert cam.var("StatusWord") >> 8 == 0


@pytest.mark.requirement("CAM-015", "CAM-218")
def test_configuration_error_ends_the_processing_of_the_cam():
    """A restart with a start value out of range raises 101 with reaction 9; jobs are refused until it is
    right.
    """
    rig = Rig(kind="TO_Cam_10k")
    cam = rig.cam
    running = cam.copy([(1.0, 1.0)] * 5000, Mode=1)
    rig.cycles()
    cam.object.data.write_start("InterpolationSettings.BoundaryConditions", 2)
    reset = rig.ended(cam.reset(restart=True))
    assert (running.Error, running.ErrorID) == (True, 0x800D)
    assert reset.Error
    assert reset.ErrorID == 0x8015
    assert (cam.var("ErrorWord"), cam.var("ErrorWord.X1"), cam.var("WarningWord")) == (2, True, 0)
    assert (cam.var("ErrorDetail.Number"), cam.var("ErrorDetail.Reaction")) == (101, 9)
    assert rig.error(cam.interpolate()) == 0x8001
    cam.object.data.write_start("InterpolationSettings.BoundaryConditions", 1)
    assert rig.ended(cam.reset(restart=True)).Done
    assert [cam.var(one) for one in ("ErrorWord", "ErrorDetail.Number", "ErrorDetail.Reaction")] == [0, 0, 0]
    rig.interpolated()


@pytest.mark.requirement("CAM-023")
def test_elements_that_make_no_cam_are_refused():
    """None at all: 16#80AA; a single point: 16#80AC; the function of before stays."""
    rig = Rig(points=())
    assert rig.error(rig.cam.interpolate()) == 0x80AA
    rig.cam.write_point(3, 1.0, 1.0)
    assert rig.error(rig.cam.interpolate()) == 0x80AC
    rig.cam.write_point(4, 2.0, 1.0)
    curve = rig.interpolated().curve
    rig.cam.write("ValidPoint[4]", False)
    assert rig.error(rig.cam.interpolate()) == 0x80AC
    assert rig.cam.curve is curve
    assert rig.cam.var(INTERPOLATED)


@pytest.mark.requirement("CAM-025", "CAM-210")
def test_changed_elements_act_with_the_next_interpolation():
    """The cam shows that it has changed and stays interpolated; the function stays what it was until then."""
    rig = Rig()
    cam = rig.interpolated()
    for path, value in (("Point[2].y", 0.5), ("ValidPoint[2]", False), ("Segment[4].a0", 1.0),
                        ("ValidSegment[4]", True)):  # fmt: skip
        assert not cam.var(CHANGED)
        cam.write(path, cam.var(path))
        assert not cam.var(CHANGED)
        curve = cam.curve
        cam.write(path, value)
        assert (cam.var(CHANGED), cam.var(INTERPOLATED)) == (True, True)
        assert cam.curve is curve
        assert cam.curve.evaluate(90.0) == curve.evaluate(90.0)
        if path == "ValidSegment[4]":
            cam.write("Segment[4].xmax", 5.0)
        rig.interpolated()
        assert cam.curve is not curve
    cam.interpolate()
    rig.cycles()
    cam.write("Point[1].y", 9.0)
    rig.cycles(3)
    assert cam.var(CHANGED)
    assert cam.curve.evaluate(10.0)[0] < 2.0


@pytest.mark.requirement("CAM-026", "CAM-221")
def test_loaded_and_restarted_cams_are_not_interpolated():
    """They have the start values of the project again; a warm restart of the controller leaves both."""
    rig = Rig()
    assert not rig.cam.var(INTERPOLATED)

    def changed():
        rig.interpolated()
        rig.cam.write_point(2, 100.0, 5.0)
        rig.cam.write_segment(3, segment(400, 500, 1))
        rig.cam.write("InterpolationSettings.InterpolationMode", 2)

    def fresh():
        data = rig.cam.object.data
        same = (data.points, data.segments) == ([Point(*one) for one in VALLEY], [])
        return same and data.mode == 0 and rig.cam.curve is None and not rig.cam.var(CHANGED)

    changed()
    assert rig.ended(rig.cam.reset(restart=True)).Done
    assert fresh()
    controller = rig.runtime.controller
    changed()
    controller.stop()
    rig.cycles(3)
    assert controller.state is OperatingState.STOP
    assert not fresh()
    controller.memory_reset()
    assert fresh()
    controller.run()
    rig.cycles(60)
    changed()
    controller.stop()
    rig.cycles(3)
    controller.run()
    rig.cycles(60)
    assert not fresh()
    assert rig.cam.var(INTERPOLATED)
    controller.stop()
    rig.cycles(3)
    controller.download("profile", {"Point[1].y": 4.0})
    assert rig.cam.curve is None
    assert rig.cam.var("Point[1].y") == 4.0
    with pytest.raises(ConfigurationError, match="0 \\(LINEAR\\)"):
        controller.download("profile", {"InterpolationSettings.InterpolationMode": 7})
    controller.power_off()
    rig.cycles()
    assert rig.cam.object.data.segments == []


@pytest.mark.requirement("CAM-046", "CAM-047", "CAM-048", "CAM-049", "CAM-050")
def test_interpolation_closes_the_gaps():
    """A rising edge starts the job; while it runs X6, afterwards Done, X5 and no X4."""
    rig = Rig()
    cam = rig.cam
    cam.write("Point[2].y", -1.0)
    job = MC_InterpolateCam(cam.object)
    assert (job.Done, job.Busy, job.Error, job.ErrorID) == (False, False, False, 0)
    rig.runtime.call(job)
    rig.cycles()
    assert not cam.var(INTERPOLATING)
    job.set(Execute=True)
    rig.cycles()
    assert (job.Busy, job.Done, cam.var(INTERPOLATING), cam.var(INTERPOLATED)) == (True, False, True, False)
    assert cam.var(CHANGED)
    rig.cycles()
    assert (job.Busy, job.Done, job.Error, job.ErrorID) == (False, True, False, 0)
    assert [cam.var(bit) for bit in (INTERPOLATING, INTERPOLATED, CHANGED)] == [False, True, False]
    curve = cam.curve
    rig.cycles(3)
    assert cam.curve is curve
    job.set(Execute=False)
    rig.cycles()
    assert not job.Done
    big = rig.add("big", [(float(x), 0.0) for x in range(5000)], kind="TO_Cam_10k")
    assert rig.ended(big.interpolate()).Done


@pytest.mark.requirement("CAM-051", "CAM-250", "SYN-464", "SYN-468")
def test_cam_in_use_is_neither_interpolated_nor_restarted():
    """16#80AB and no change; a restart leads to warning 322 and leaves the cam as it is."""
    rig = Rig()
    cam = rig.interpolated()
    curve = cam.curve
    cam.object.use(rig)
    assert cam.var(IN_USE)
    cam.write("Point[2].y", 0.7)
    assert rig.error(cam.interpolate()) == 0x80AB
    assert cam.curve is curve
    reset = rig.ended(cam.reset(restart=True))
    assert (reset.Error, reset.ErrorID) == (True, 0x800E)
    assert (cam.var("WarningWord.X3"), cam.var("ErrorDetail.Number"), cam.var("ErrorDetail.Reaction")) == (
        True,
        322,
        0,
    )
    assert cam.curve is curve
    assert cam.var("Point[2].y") == 0.7
    assert rig.ended(cam.reset()).Done
    assert cam.var("WarningWord") == 0
    cam.object.release_use(rig)
    assert not cam.var(IN_USE)
    rig.interpolated()


@pytest.mark.requirement("SYN-297")
def test_mc_reset_takes_every_type_of_cam(subtests):
    """It acknowledges and restarts them."""
    for kind in CAM_TYPES:
        with subtests.test(kind):
            rig = Rig(kind=kind)
            rig.interpolated()
            assert rig.ended(MC_Reset_of(rig, restart=False)).Done
            assert rig.cam.var(INTERPOLATED)
            assert rig.ended(MC_Reset_of(rig, restart=True)).Done
            assert not rig.cam.var(INTERPOLATED)


def MC_Reset_of(rig, *, restart):
    return rig.cam.run(MC_Reset(rig.cam.object, Execute=True, Restart=restart))


@pytest.mark.requirement("CAM-052", "CAM-067", "CAM-078", "CAM-101")
def test_jobs_of_cams_abort_nothing_and_are_not_aborted():
    """All kinds at the same time on two cams: every one ends with Done."""
    rig = Rig()
    rig.interpolated()
    other = rig.add("other", [(float(x), float(x % 7)) for x in range(9000)], kind="TO_Cam_10k")
    long = other.interpolate()
    rig.cycles()
    jobs = [
        rig.cam.leading_value(0.5),
        rig.cam.following_value(90.0),
        rig.cam.copy([(1.0, 2.0)]),
        rig.cam.leading_value(0.25),
        rig.cam.following_value(91.0),
    ]
    cyclic = rig.cam.following_value_cyclic(20.0)
    rig.cycles(5)
    assert [(job.Done, job.CommandAborted) for job in jobs] == [(True, False)] * 5
    assert long.Busy
    last = rig.cam.interpolate()
    rig.cycles(2)
    assert last.Error  # a single point is left
    assert cyclic.Valid
    assert rig.ended(long).Done


@pytest.mark.requirement("CAM-054")
def test_long_interpolations_take_several_cycles():
    """The more elements the more cycles; a short one of another cam ends meanwhile."""
    rig = Rig()
    big = rig.add("big", [(float(x), 0.0) for x in range(10_000)], kind="TO_Cam_10k")
    long = big.interpolate()
    short = rig.cam.interpolate()
    rig.cycles(3)
    assert (short.Done, long.Busy, big.var(INTERPOLATED)) == (True, True, False)
    before = rig.scheduler.now
    rig.ended(long)
    assert long.Done
    assert (rig.scheduler.now - before) // (4 * MS) > 10


@pytest.mark.requirement("CAM-053", "CAM-204")
def test_laws_of_motion_are_segments_of_the_data_block():
    """Inclined sine and 3-4-5 polynomial by their coefficients; the interpolation fills only what is
    between.
    """
    rise, span = 40.0, 120.0
    inclined = Segment(10.0, 130.0, (5.0, rise / span, 0, 0, 0, 0, 0), -rise / (2 * pi), 2 * pi / span, 0.0)
    quintic = Segment(
        200.0, 320.0, (45.0, 0, 0, -10 * rise / span**3, 15 * rise / span**4, -6 * rise / span**5, 0)
    )
    rig = Rig(points=(), segments=[inclined, quintic])
    curve = rig.interpolated().curve
    for step in range(101):
        z = step / 100
        expected = 5.0 + rise * (z - sin(2 * pi * z) / (2 * pi))
        assert curve.evaluate(10.0 + span * z)[0] == pytest.approx(expected, abs=1e-9 * rise)
        expected = 45.0 - rise * z**3 * (10 - 15 * z + 6 * z**2)
        assert curve.evaluate(200.0 + span * z)[0] == pytest.approx(expected, abs=1e-9 * rise)
    assert curve.evaluate(165.0)[0] == pytest.approx(45.0)


@pytest.mark.requirement("CAM-055", "CAM-056", "CAM-057", "CAM-058", "CAM-059", "CAM-060", "CAM-062")
def test_leading_value_is_read():
    """By the edge, next to the approach value; Value comes with Done."""
    rig = Rig(points=[(x, sin(radians(x))) for x in range(361)],
              variables={"InterpolationSettings.InterpolationMode": 1})  # fmt: skip
    rig.interpolated()
    job = MC_GetCamLeadingValue(rig.cam.object)
    assert (job.FollowingValue, job.ApproachLeadingValue, job.Done, job.Busy, job.Error) == (0, 0, 0, 0, 0)
    rig.runtime.call(job)
    rig.cycles()
    job.set(Execute=True, FollowingValue=0.5, ApproachLeadingValue=180.0)
    rig.cycles()
    assert (job.Busy, job.Done, job.Value) == (True, False, 0.0)
    assert rig.ended(job).Done
    assert (job.Busy, job.Error, job.ErrorID) == (False, False, 0)
    assert job.Value == pytest.approx(150.0, abs=1e-6)
    assert rig.ended(rig.cam.leading_value(0.5, 0.0)).Value == pytest.approx(30.0, abs=1e-6)
    assert rig.ended(rig.cam.leading_value(0.5, 225.0)).Value == pytest.approx(150.0, abs=1e-6)


@pytest.mark.requirement("CAM-065", "CAM-225")
def test_direction_of_the_search():
    """1 positive, 2 negative, 3 nearest, the default; an approach value that is a solution counts with 3
    only.
    """
    rig = Rig(points=[(0, 1), (90, 0.5), (180, 0), (270, 0.5), (360, 1)])
    rig.interpolated()

    def found(approach, **inputs):
        return rig.ended(rig.cam.leading_value(0.5, approach, **inputs)).Value

    assert [found(225.0, ApproachDirection=one) for one in (1, 2, 3)] == [270.0, 90.0, 270.0]
    assert found(225.0) == 270.0
    assert [found(90.0, ApproachDirection=one) for one in (1, 3)] == [270.0, 90.0]
    assert [found(270.0, ApproachDirection=one) for one in (2, 3)] == [90.0, 270.0]


@pytest.mark.requirement("CAM-061", "CAM-066")
def test_leading_values_that_are_not_there():
    """Not interpolated or out of the value range 16#8063, end in that direction 16#8066, illegal inputs
    16#8065, 16#8062.
    """
    rig = Rig()
    assert rig.error(rig.cam.leading_value(0.5)) == 0x8063
    rig.interpolated()
    assert rig.error(rig.cam.leading_value(1.01)) == 0x8063
    assert rig.error(rig.cam.leading_value(-0.01)) == 0x8063
    assert rig.error(rig.cam.leading_value(nan)) == 0x8063
    assert rig.error(rig.cam.leading_value(0.5, 300.0, ApproachDirection=1)) == 0x8066
    assert rig.error(rig.cam.leading_value(0.5, 60.0, ApproachDirection=2)) == 0x8066
    for direction in (0, 4, -1, 1.5):
        assert rig.error(rig.cam.leading_value(0.5, ApproachDirection=direction)) == 0x8065
    for approach in (nan, 2e12):
        assert rig.error(rig.cam.leading_value(0.5, approach)) == 0x8062


@pytest.mark.requirement("CAM-226", "CAM-227", "CAM-228", "CAM-229", "CAM-077", "CAM-103")
def test_read_instructions_scale_and_shift_by_their_own_inputs():
    """Values in and out are scaled and shifted ones; the cam itself is not changed; a MasterScaling of 0 is
    refused.
    """
    rig = Rig(points=(), segments=[segment(0, 100, 0, 0, 0.01)])
    rig.interpolated()
    scaled = {"MasterOffset": 50.0, "MasterScaling": 2.0, "SlaveScaling": 3.0, "SlaveOffset": 10.0}
    job = rig.ended(rig.cam.following_value(150.0, **scaled))
    assert (job.Value, job.FirstDerivative, job.SecondDerivative) == pytest.approx((85.0, 1.5, 0.015))
    for approach in (150.0, -500.0, 900.0):
        job = rig.ended(rig.cam.leading_value(85.0, approach, **scaled))
        assert job.Value == pytest.approx(150.0)
    assert rig.ended(rig.cam.following_value(50.0)).Value == 25.0
    assert rig.error(rig.cam.following_value(49.9, **scaled)) == 0x8064
    assert rig.ended(rig.cam.following_value(250.0, **scaled)).Value == pytest.approx(310.0)
    assert rig.cam.curve.evaluate(50.0)[0] == 25.0
    wrong = {"MasterOffset": 0x8021, "SlaveOffset": 0x8022, "MasterScaling": 0x8023, "SlaveScaling": 0x8024}
    for key, error_id in wrong.items():
        assert rig.error(rig.cam.following_value(50.0, **{key: nan})) == error_id
        assert rig.error(rig.cam.leading_value(25.0, **{key: 1e13})) == error_id
        cyclic = rig.cam.following_value_cyclic(50.0, **{key: nan})
        rig.cycles()
        assert cyclic.ErrorID == error_id
    assert rig.error(rig.cam.following_value(50.0, MasterScaling=0.0)) == 0x8023
    assert rig.error(rig.cam.leading_value(25.0, MasterScaling=0.0)) == 0x8023
    assert rig.ended(rig.cam.following_value(50.0, SlaveScaling=0.0, SlaveOffset=4.0)).Value == 4.0
    assert rig.ended(rig.cam.following_value(-50.0, MasterScaling=-1.0)).Value == 25.0


@pytest.mark.requirement("CAM-068", "CAM-069", "CAM-070", "CAM-071", "CAM-072", "CAM-073")
def test_following_value_and_derivatives_are_read():
    """By the edge; they come with Done."""
    rig = Rig(points=(), segments=[segment(0, 10, 0, 0, 0, 2)])
    rig.interpolated()
    job = MC_GetCamFollowingValue(rig.cam.object)
    assert (job.LeadingValue, job.Done, job.Busy, job.Error, job.ErrorID) == (0.0, False, False, False, 0)
    rig.runtime.call(job)
    rig.cycles()
    job.set(Execute=True, LeadingValue=3.0)
    rig.cycles()
    assert (job.Busy, job.Done, job.Value) == (True, False, 0.0)
    assert rig.ended(job).Done
    assert (job.Value, job.FirstDerivative, job.SecondDerivative) == (54.0, 54.0, 36.0)
    job.set(LeadingValue=4.0)
    rig.cycles(3)
    assert job.Value == 54.0


@pytest.mark.requirement("CAM-075", "CAM-076", "CAM-251")
def test_ends_of_the_range_belong_to_it():
    """At both ends the value is read, a little outside 16#8064; a cam that is not interpolated has no
    value.
    """
    rig = Rig(points=[(10, 1), (20, 3), (40, 2)])
    assert rig.ended(rig.cam.following_value(20.0)).Error
    cyclic = rig.cam.following_value_cyclic(20.0)
    rig.cycles()
    assert (cyclic.Error, cyclic.Valid) == (True, False)
    rig.interpolated()
    assert rig.ended(rig.cam.following_value(10.0)).Value == 1.0
    assert rig.ended(rig.cam.following_value(40.0)).Value == 2.0
    for value, edge in ((1.0, 10.0), (2.0, 40.0)):
        assert rig.ended(rig.cam.leading_value(value, edge)).Value == edge
        cyclic = rig.cam.following_value_cyclic(edge)
        rig.cycles()
        assert (cyclic.Valid, cyclic.Value) == (True, value)
    for outside in (10.0 - 1e-9, 40.0 + 1e-9, nan):
        assert rig.error(rig.cam.following_value(outside)) == 0x8064
        cyclic = rig.cam.following_value_cyclic(outside)
        rig.cycles()
        assert cyclic.ErrorID == 0x8064


@pytest.mark.requirement("CAM-230", "CAM-231", "CAM-232", "CAM-233", "CAM-234", "CAM-235")
def test_following_value_is_read_in_every_cycle():
    """The result belongs to the leading value of the same call; several may run; an error lasts until the
    next edge.
    """
    rig = Rig(points=(), segments=[segment(0, 10, 0, 0, 0, 2)])
    rig.interpolated()
    read = MC_GetCamFollowingValueCyclic(rig.cam.object)
    assert (read.Valid, read.Busy, read.Error, read.ErrorID, read.Value) == (False, False, False, 0, 0.0)
    read()
    assert not read.Busy
    second = MC_GetCamFollowingValueCyclic(rig.cam.object, Enable=True, SlaveScaling=-1.0)
    for leading in (0.0, 3.0, 9.5, 1.0):
        read(Enable=True, LeadingValue=leading)
        second(LeadingValue=leading)
        expected = (2 * leading**3, 6 * leading**2, 12 * leading)
        assert (read.Valid, read.Busy, read.Error) == (True, True, False)
        assert (read.Value, read.FirstDerivative, read.SecondDerivative) == pytest.approx(expected)
        assert second.Value == pytest.approx(-expected[0])
    read(LeadingValue=10.5)
    assert (read.Valid, read.Busy, read.Error, read.ErrorID) == (False, False, True, 0x8064)
    read(LeadingValue=5.0)
    assert (read.Valid, read.Error) == (False, True)
    read(Enable=False)
    assert (read.Valid, read.Error, read.ErrorID) == (False, False, 0)
    read(Enable=True)
    assert (read.Valid, read.Value) == (True, 250.0)
    read(Enable=False)
    assert (read.Valid, read.Busy) == (False, False)
    assert second.Valid


@pytest.mark.requirement("CAM-079", "CAM-080", "CAM-081", "CAM-090", "CAM-092", "CAM-093", "CAM-100")
def test_copied_elements_are_valid_and_wait_for_an_interpolation():
    """Mode 0: nothing else is valid; mode 1: what was valid stays valid."""
    for mode in (0, 1):
        rig = Rig(points=[(10.0 * x, 1.0) for x in range(10)], segments=[segment(200, 210, 1)])
        rig.interpolated()
        curve = rig.cam.curve
        job = MC_CopyCamData(rig.cam.object)
        assert (job.Mode, job.Done, job.Busy, job.Error, job.ErrorID) == (0, False, False, False, 0)
        rig.runtime.call(job)
        rig.cycles()
        points = PointArray([(41.0, 7.0), (51.0, 8.0), (61.0, 9.0)])
        job.set(Execute=True, Mode=mode, StartPointCam=5, NumberOfPoints=3, ArrayOfPoints=points)
        rig.cycles()
        assert (job.Busy, job.Done) == (True, False)
        rig.cycles()
        assert (job.Busy, job.Done, rig.cam.var(CHANGED)) == (False, True, True)
        valid = [number for number in range(1, 20) if rig.cam.var(f"ValidPoint[{number}]")]
        assert valid == ([5, 6, 7] if mode == 0 else [*range(1, 11)])
        assert rig.cam.var("ValidSegment[1]") is (mode == 1)
        assert [rig.cam.var(f"Point[{number}].y") for number in (4, 5, 6, 7, 8)] == [1, 7, 8, 9, 1]
        assert rig.cam.curve is curve
        assert rig.cam.var(INTERPOLATED)
        rig.interpolated()
        assert rig.cam.curve.evaluate(51.0)[0] == 8.0
        pieces = SegmentArray([segment(300, 310, 4), segment(310, 320, 5)], lower=0)
        job = rig.cam.run(MC_CopyCamData(
            rig.cam.object, Execute=True, Mode=mode, StartSegmentCam=49, NumberOfSegments=1,
            StartSegmentArray=1, ArrayOfSegments=pieces,
        ))  # fmt: skip
        assert rig.ended(job).Done
        assert (rig.cam.var("Segment[49].a0"), rig.cam.var("ValidSegment[49]")) == (5.0, True)
        assert rig.cam.var("ValidPoint[5]") is (mode == 1)


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "SYN-342", "CAM-082", "CAM-083", "CAM-084", "CAM-085", "CAM-086", "CAM-087", "CAM-094", "CAM-095",
    "CAM-096", "CAM-097", "CAM-214", "CAM-236",
)  # fmt: skip
def test_limits_of_indexes_and_numbers(subtests):
    """At a limit accepted, beyond it refused with the ErrorID of the input and without a trace in the cam."""
    hundred = PointArray([(float(x), 1.0) for x in range(100)], lower=0)
    many = PointArray([(float(x), 1.0) for x in range(20_000)])
    pieces = SegmentArray([segment(x, x + 1, 1) for x in range(60)])
    last = {"TO_Cam": 1000, "TO_Cam_10k": 10_000}
    for kind, points in last.items():
        cases = [
            ({"StartPointCam": 0}, 0x80E1),
            ({"StartPointCam": points}, 0),
            ({"StartPointCam": points + 1}, 0x80E1),
            ({"StartPointCam": points, "NumberOfPoints": 1, "ArrayOfPoints": many}, 0),
            ({"StartPointCam": points, "NumberOfPoints": 2, "ArrayOfPoints": many}, 0x80E5),
            ({"StartPointCam": points - 10, "NumberOfPoints": 11, "ArrayOfPoints": many}, 0),
            ({"StartPointCam": points - 10, "NumberOfPoints": 12, "ArrayOfPoints": many}, 0x80E5),
            ({"NumberOfPoints": points, "ArrayOfPoints": many}, 0),
            ({"NumberOfPoints": points + 1, "ArrayOfPoints": many}, 0x80E5),
            ({"NumberOfPoints": -1, "ArrayOfPoints": many}, 0x80E5),
            ({"StartSegmentCam": 0}, 0x80E2),
            ({"StartSegmentCam": 50}, 0),
            ({"StartSegmentCam": 51}, 0x80E2),
            ({"StartSegmentCam": 49, "NumberOfSegments": 2, "ArrayOfSegments": pieces}, 0),
            ({"StartSegmentCam": 49, "NumberOfSegments": 3, "ArrayOfSegments": pieces}, 0x80E6),
            ({"NumberOfSegments": 50, "ArrayOfSegments": pieces}, 0),
            ({"NumberOfSegments": 51, "ArrayOfSegments": pieces}, 0x80E6),
            ({"NumberOfSegments": -1, "ArrayOfSegments": pieces}, 0x80E6),
            ({"StartPointArray": 0, "NumberOfPoints": 1, "ArrayOfPoints": hundred}, 0),
            ({"StartPointArray": 99, "NumberOfPoints": 1, "ArrayOfPoints": hundred}, 0),
            ({"StartPointArray": -1, "NumberOfPoints": 1, "ArrayOfPoints": hundred}, 0x80E3),
            ({"StartPointArray": 100, "NumberOfPoints": 1, "ArrayOfPoints": hundred}, 0x80E3),
            ({"StartPointArray": 90, "NumberOfPoints": 10, "ArrayOfPoints": hundred}, 0),
            ({"StartPointArray": 90, "NumberOfPoints": 11, "ArrayOfPoints": hundred}, 0x80E5),
            ({"StartSegmentArray": 60, "NumberOfSegments": 1, "ArrayOfSegments": pieces}, 0),
            ({"StartSegmentArray": 61, "NumberOfSegments": 1, "ArrayOfSegments": pieces}, 0x80E4),
            ({"StartSegmentArray": 0, "NumberOfSegments": 1, "ArrayOfSegments": pieces}, 0x80E4),
            ({"StartSegmentArray": 60, "NumberOfSegments": 2, "ArrayOfSegments": pieces}, 0x80E6),
            ({"Mode": 2}, 0x800A),
        ]
        rig = Rig(kind=kind)
        for inputs, error_id in cases:
            with subtests.test(str({**inputs, "kind": kind})):
                before = rig.cam.object.data.revision, rig.cam.object.data.points
                job = rig.ended(rig.cam.run(MC_CopyCamData(rig.cam.object, Execute=True, **inputs)))
                assert (job.Done, job.ErrorID) == (error_id == 0, error_id)
                if error_id:
                    assert (rig.cam.object.data.revision, rig.cam.object.data.points) == before


@pytest.mark.requirement("SYN-344", "CAM-088", "CAM-089", "CAM-091")
def test_arrays_are_those_of_the_cam_and_have_optimised_access():
    """16#80E9 and 16#80EA otherwise, and where one is missing; what changes while the job runs is copied as
    it is then.
    """
    rig = Rig(kind="TO_Cam_10k")
    slow_points = PointArray([(1.0, 1.0)], optimised=False)
    slow_segments = SegmentArray([segment(0, 1, 1)], optimised=False)
    for wrong in (slow_points, [(1.0, 1.0)], None, slow_segments):
        job = MC_CopyCamData(rig.cam.object, Execute=True, NumberOfPoints=1, ArrayOfPoints=wrong)
        assert rig.error(rig.cam.run(job)) == 0x80E9
    for wrong in (slow_segments, [segment(0, 1, 1)], None, slow_points):
        job = MC_CopyCamData(rig.cam.object, Execute=True, NumberOfSegments=1, ArrayOfSegments=wrong)
        assert rig.error(rig.cam.run(job)) == 0x80EA
    points = PointArray([(float(x), 0.0) for x in range(3000)])
    job = rig.cam.run(MC_CopyCamData(rig.cam.object, Execute=True, NumberOfPoints=3000, ArrayOfPoints=points))
    rig.cycles(2)
    points.elements[2999] = Point(2999.0, 5.0)
    assert rig.ended(job).Done
    assert rig.cam.var("Point[3000].y") == 5.0


@pytest.mark.requirement("CAM-098", "CAM-222")
def test_cam_in_use_is_copied_into():
    """Its function stays; elements may be written by hand meanwhile, and nothing prevents it."""
    rig = Rig(kind="TO_Cam_10k")
    cam = rig.interpolated()
    curve = cam.curve
    cam.object.use(rig)
    job = cam.copy([(float(x), 2.0) for x in range(2500)])
    rig.cycles()
    cam.write("Point[2500].y", 9.0)
    assert cam.var("Point[2500].y") == 9.0
    assert rig.ended(job).Done
    assert (cam.var(CHANGED), cam.var(IN_USE)) == (True, True)
    assert cam.curve is curve
    assert cam.var("Point[2500].y") == 2.0


@pytest.mark.requirement("SYN-343", "CAM-099")
def test_one_copy_and_no_interpolation_at_a_time():
    """While a copy runs X7; a second one 16#80E7; while an interpolation runs 16#80E8."""
    rig = Rig(kind="TO_Cam_10k")
    first = rig.cam.copy([(float(x), 2.0) for x in range(2500)])
    rig.cycles()
    assert (first.Busy, rig.cam.var(COPYING)) == (True, True)
    second, third = rig.cam.copy([(1.0, 1.0)]), rig.cam.interpolate()
    rig.cycles()
    assert (second.ErrorID, third.ErrorID) == (0x80E7, 0x80E7)
    assert rig.ended(first).Done
    assert not rig.cam.var(COPYING)
    interpolation = rig.cam.interpolate()
    rig.cycles()
    assert rig.cam.var(INTERPOLATING)
    other, again = rig.cam.copy([(1.0, 1.0)]), rig.cam.interpolate()
    rig.cycles()
    assert (other.ErrorID, again.ErrorID) == (0x80E8, 0x80E8)
    assert rig.ended(interpolation).Done


def test_instructions_of_cams_take_cams_only_and_belong_to_technology_processors():
    """Instructions of axes refuse a cam when they are made; other controllers do not have those of cams."""
    from motion.s7.compatibility import LEVELS
    from motion.s7.instructions import MC_Halt, MC_Power

    rig = Rig()
    for wrong in (MC_Power, MC_Halt):
        with pytest.raises(ConfigurationError, match="SpeedAxis"):
            wrong(rig.cam.object)
    for name in ("S7-1500", "S7-1200 G2"):
        assert {"MC_InterpolateCam", "MC_GetCamLeadingValue", "MC_GetCamFollowingValue",
                "MC_GetCamFollowingValueCyclic", "MC_CopyCamData"} <= LEVELS[name].without  # fmt: skip


def test_handle_says_how_the_cam_stands():
    """In its summary, and with the right name for a wrong one."""
    rig = Rig()
    assert rig.cam.summary() == "profile: 3 points, 0 segments, not interpolated"
    rig.interpolated()
    rig.cam.write("Point[1].y", 3.0)
    assert rig.cam.summary() == "profile: 3 points, 0 segments, interpolated from 0 to 360, changed since"
    with pytest.raises(AttributeError, match="interpolate"):
        _ = rig.cam.interpolated


@pytest.mark.requirement("CAM-224")
def test_function_is_exported_as_points_at_equal_distances(tmp_path):
    """With following value, and with velocity, acceleration and jerk on demand; it can be read as a cam
    again.
    """
    from hil.bench.cam_config import read_points

    rig = Rig(points=(), segments=[segment(10, 20, 1, 0, 0, 2)])
    with pytest.raises(ConfigurationError, match="interpolated"):
        rig.cam.export(tmp_path / "early.csv")
    rig.interpolated()
    lines = rig.cam.export(tmp_path / "all.csv", number=6, derivatives=True).read_text().splitlines()
    assert lines[0] == "leading value,following value,velocity,acceleration,jerk"
    rows = [[float(one) for one in line.split(",")] for line in lines[1:]]
    assert [row[0] for row in rows] == [10.0, 12.0, 14.0, 16.0, 18.0, 20.0]
    for x, *values in rows:
        s = x - 10.0
        assert values == pytest.approx([1 + 2 * s**3, 6 * s**2, 12 * s, 12.0])
    points = read_points(rig.cam.export(tmp_path / "points.csv", number=11))
    assert [(one.x, one.y) for one in points] == [(10.0 + k, pytest.approx(1 + 2 * k**3)) for k in range(11)]
    with pytest.raises(ConfigurationError, match="2 or more"):
        rig.cam.export(tmp_path / "one.csv", number=1)


def test_warm_restart_ends_jobs():
    """STOP ends what is under way; the instances begin again."""
    rig = Rig(kind="TO_Cam_10k")
    job = rig.cam.copy([(float(x), 2.0) for x in range(5000)], Mode=1)
    rig.cycles(2)
    rig.runtime.controller.stop()
    rig.cycles(3)
    assert not rig.cam.var(COPYING)
    rig.runtime.controller.run()
    rig.cycles(60)
    assert (job.Busy, job.Execute) == (False, False)
    assert rig.ended(rig.cam.interpolate()).Done
