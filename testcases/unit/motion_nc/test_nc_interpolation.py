"""Interpolation groups: G0, feeds, corners, tolerance balls, path override, stop; coordinated dynamics."""

from itertools import pairwise
from math import hypot, inf

import pytest

from fieldbus.errors import ConfigurationError
from motion.nc.coordinated import MC_Default, MC_Maximum, coordinated_dynamics
from motion.nc.interpolation import OVERRIDE_TYPES, InterpolationGroup
from motion.nc.parameters import ParameterSet, catalogue
from motion.nc.path import Arc, AxisLimits, Joint, Line, link_velocity, rapid_velocity, transition_class
from testcases.unit.motion_nc.nc_rig import Rig, T

pytestmark = pytest.mark.exhaustive


class _Pair:
    """Two axes in a group."""

    def __init__(self, c2=1.0, least=0.0, x=None, y=None, **dynamics):
        self.x = Rig(**(x or {}))
        self.y = Rig(with_=self.x, **(y or {}))
        self.x.enabled()
        self.y.enabled()
        dynamics = {"acceleration": 1000.0, "deceleration": 1000.0, "jerk": 50_000.0, **dynamics}
        self.group = InterpolationGroup(
            [self.x.axis, self.y.axis], cycle_s=T, c2=c2, least_velocity=least, **dynamics
        )
        self.x.runtime.groups.append(self.group)
        self.path = []

    def run(self, cycles=6000):
        assert self.group.start() == 0
        for _ in range(cycles):
            self.x.cycles()
            mx, my = self.x.axis.motion, self.y.axis.motion
            self.path.append((mx.s, my.s, mx.v, my.v))
            if not self.group.running:
                break
        return self

    @property
    def speeds(self):
        return [hypot(vx, vy) for _, _, vx, vy in self.path]


def _limits(**values):
    given = {"rapid": 1500.0, "reference": 2200.0, "maximum": 2000.0, "acceleration": 1000.0}
    return AxisLimits(**{**given, "deceleration": 800.0, **values})


@pytest.mark.requirement("NC-174", "NC-178", "NC-179")
def test_rapid_traverse():
    """G0 moves one axis with the least of its three velocities, several on a straight line with the velocity
    of the one that needs most time.
    """
    for values, expected in (
        ({}, 1500.0),
        ({"maximum": 900.0}, 900.0),
        ({"reference": 800.0}, 800.0),
    ):
        assert rapid_velocity((100.0, 0.0), [_limits(**values), _limits()]) == pytest.approx(expected)
    slow = _limits(rapid=100.0)
    assert rapid_velocity((30.0, 40.0), [_limits(), slow]) == pytest.approx(125.0)
    pair = _Pair(x={"axis__rapid_traverse_velocity": 300.0}, y={"axis__rapid_traverse_velocity": 90.0})
    pair.group.g0(x=40.0, x1=30.0)
    assert pair.group.rapid
    pair.run()
    assert max(pair.speeds) == pytest.approx(150.0)  # 90 mm/s of y
    for sx, sy, _, _ in pair.path:
        assert sy == pytest.approx(sx * 0.75)
    assert pair.path[-1][:2] == (pytest.approx(40.0), pytest.approx(30.0))
    pair.group.g1(50.0, x=50.0)
    assert not pair.group.rapid


@pytest.mark.requirement("NC-180", "NC-185")
def test_exact_stop():
    """G60 stops at every joint, also a straight one, until G0 ends it; without it a straight joint is passed
    with the smaller velocity and without acceleration.
    """
    for exact, cancelled, at_joint in ((False, False, 100.0), (True, False, 0.0), (True, True, 60.0)):
        pair = _Pair(y={"axis__rapid_traverse_velocity": 60.0})
        if exact:
            pair.group.exact_stop()
        if cancelled:
            pair.group.g0(x1=0.001)
        pair.group.g1(200.0, x=100.0)
        pair.group.g1(100.0, x=200.0)
        pair.run()
        passed = [v for (s, *_), v in zip(pair.path, pair.speeds, strict=True) if abs(s - 100.0) < 0.21]
        assert min(passed) == pytest.approx(at_joint if at_joint != 60.0 else 100.0, abs=1.0)
        assert max(pair.speeds) == pytest.approx(200.0)


@pytest.mark.requirement("NC-181", "NC-182", "NC-183", "NC-184")
def test_classes_of_transitions():
    """A corner is C0, a tangent arc C1, a joint with the same curvature C2, a straight line smooth."""
    line = Line((0.0, 0.0), (10.0, 0.0))
    assert transition_class(line, Line((10.0, 0.0), (10.0, 5.0))) == 0
    arc = Arc((10.0, 0.0), (15.0, 5.0), (10.0, 5.0), clockwise=False)
    assert transition_class(line, arc) == 1
    joint = Joint((10.0, 0.0), (1.0, 0.0), (15.0, 5.0), (0.0, 1.0))
    assert transition_class(line, joint) == 2
    assert transition_class(line, Line((10.0, 0.0), (20.0, 0.0))) == 3
    assert arc.at(0.0)[1] == pytest.approx((1.0, 0.0))
    end, tangent, curvature = arc.at(arc.length)
    assert end == pytest.approx((15.0, 5.0))
    assert tangent == pytest.approx((0.0, 1.0))
    assert hypot(*curvature) == pytest.approx(0.2)


@pytest.mark.requirement("NC-186", "NC-175", "NC-187", "NC-185")
def test_velocity_jump_at_corners(subtests):
    """VELOJUMP lowers the velocity at a corner until no axis steps by more than C0 min(A+, -A-) T, to the
    least velocity at most; a reversal is a step as well.
    """
    corner = Line((0.0, 0.0), (50.0, 0.0)), Line((50.0, 0.0), (50.0, 50.0))
    limits = [_limits(jump_factor=2.0)] * 2
    assert limits[0].velocity_jump(0.002) == pytest.approx(3.2)
    assert link_velocity(*corner, 100.0, 80.0, limits, cycle_s=T) == pytest.approx(3.2)
    assert link_velocity(*corner, 100.0, 80.0, limits, cycle_s=T, least=10.0) == pytest.approx(10.0)
    assert link_velocity(*corner, 100.0, 2.0, limits, cycle_s=T) == pytest.approx(2.0)
    back = Line((50.0, 0.0), (0.0, 0.0))
    assert link_velocity(corner[0], back, 100.0, 100.0, limits, cycle_s=T) == pytest.approx(1.6)
    for factor, step in ((0.0, 0.0), (2.0, 3.2), (4.0, 6.4)):
        with subtests.test(factor=factor):
            values = {
                "axis__velo_jump_factor": factor,
                "axis__maximum_acceleration": 1000.0,
                "axis__maximum_deceleration": 800.0,
            }
            pair = _Pair(x=values, y=values)
            pair.group.g1(100.0, x=50.0)
            pair.group.g1(100.0, x1=50.0)
            pair.run()
            steps = [abs(after[3] - before[3]) for before, after in pairwise(pair.path)]
            assert max(steps) <= step + 1000.0 * T + 1e-6
            assert max(steps) >= step * 0.9
            assert max(pair.speeds) == pytest.approx(100.0)


@pytest.mark.requirement("NC-188", "NC-189", "NC-190", "NC-192", "NC-193")
def test_tolerance_ball(subtests):
    """Within the ball the path is smooth, leaves the corner by less than the radius, and has the velocity C2
    times the one of the transition, without path acceleration; balls of short segments do not overlap.
    """
    for radius, c2 in ((5.0, 1.0), (5.0, 0.5), (100.0, 1.0)):
        with subtests.test(radius=radius, c2=c2):
            pair = _Pair(c2=c2)
            pair.group.tolerance_ball(radius)
            pair.group.g1(60.0, x=50.0)
            pair.group.g1(60.0, x1=50.0)
            pair.run()
            real = min(radius, 25.0)
            nearest = min(hypot(sx - 50.0, sy) for sx, sy, _, _ in pair.path)
            assert 0.0 < nearest < real
            inside = [
                speed
                for (sx, sy, _, _), speed in zip(pair.path, pair.speeds, strict=True)
                if 0.01 < 50.0 - sx < real * 0.9 and 0.01 < sy < real * 0.9
            ]
            assert len(inside) > 10
            assert max(inside) - min(inside) < 1e-3
            if c2 == 1.0:
                full = inside[0]
            else:
                assert inside[0] == pytest.approx(0.5 * 60.0, rel=0.6)
            steps = [
                hypot(after[2] - before[2], after[3] - before[3]) for before, after in pairwise(pair.path)
            ]
            assert max(steps) < 1100.0 * T * 1.5
            for sx, sy, _, _ in pair.path:
                assert (sy == 0.0 and sx <= 50.0) or sx <= 50.0 + 1e-9
                off = min(abs(sy), abs(50.0 - sx))
                assert off <= real
    assert full > 0.0
    pair = _Pair()
    pair.group.tolerance_ball(5.0)
    for corner in range(1, 4):
        pair.group.g1(60.0, x=4.0 * corner)
        pair.group.g1(60.0, x1=4.0 * corner)
    pair.run()
    assert pair.path[-1][:2] == (pytest.approx(12.0), pytest.approx(12.0))


@pytest.mark.requirement("NC-191")
def test_override_within_a_ball():
    """A new override has no effect within a ball; the velocity changes after it."""
    pair = _Pair()
    pair.group.tolerance_ball(20.0)
    pair.group.g1(40.0, x=50.0)
    pair.group.g1(40.0, x1=80.0)
    assert pair.group.start() == 0
    inside = None
    while pair.group.running:
        pair.x.cycles()
        mx, my = pair.x.axis.motion, pair.y.axis.motion
        if inside is None and my.s > 1.0:
            inside = hypot(mx.v, my.v)
            pair.group.override = 0.3
        if inside is not None and my.s < 18.0:
            assert hypot(mx.v, my.v) == pytest.approx(inside)
        if 40.0 < my.s < 60.0:
            assert hypot(mx.v, my.v) == pytest.approx(12.0, abs=0.5)


@pytest.mark.requirement("NC-170", "NC-171", "NC-172")
def test_path_override(subtests):
    """Reduced refers to what the segment reaches, Original to what is programmed; beyond 100 % only the type
    for it goes, up to the velocities of the axes.
    """
    assert OVERRIDE_TYPES[0] == "Reduced (iterated)"
    assert _Pair().group.override_type == "Reduced (iterated)"
    reached = max(_run_override("Reduced (iterated)", 1.0))
    assert reached < 400.0
    for kind, override, expected in (
        ("Reduced (iterated)", 0.5, 0.5 * reached),
        ("Reduced (iterated)", 1.5, reached),
        ("Original (iterated)", 0.9, reached),
        ("Original (iterated)", 0.1, 40.0),
        ("Reduced [0 ... >100%]", 0.5, 0.5 * reached),
    ):
        with subtests.test(kind, override=override):
            assert max(_run_override(kind, override)) == pytest.approx(expected, rel=0.02)
    fast = max(_run_override("Reduced [0 ... >100%]", 1.5, way=400.0, feed=100.0))
    assert fast == pytest.approx(150.0, rel=0.01)
    limited = max(_run_override("Reduced [0 ... >100%]", 9.0, way=400.0, feed=100.0, rapid=180.0))
    assert limited == pytest.approx(180.0, rel=0.01)


def _run_override(kind, override, way=40.0, feed=400.0, rapid=2000.0):
    pair = _Pair(x={"axis__rapid_traverse_velocity": rapid})
    pair.group.override_type, pair.group.override = kind, override
    pair.group.g1(feed, x=way)
    return pair.run().speeds


@pytest.mark.requirement("NC-035")
def test_stop_of_a_group():
    """A stop of one axis brakes the whole group on its path and is done when it stands; commands are refused,
    PTP mode is off.
    """
    pair = _Pair()
    pair.group.g1(100.0, x=300.0, x1=150.0)
    assert pair.group.start() == 0
    pair.x.cycles(300)
    assert not pair.x.axis.nc_to_plc.StateDWord & 1 << 25
    refused = pair.y.handle.move_absolute(5.0, Velocity=10.0)
    pair.x.cycles(2)
    assert refused.ErrorID == 0x4B05
    stop = pair.y.handle.stop()
    for _ in range(300):
        pair.x.cycles()
        assert stop.Done != pair.group.running
        assert pair.y.axis.motion.s == pytest.approx(0.5 * pair.x.axis.motion.s)
    assert stop.Done
    assert not pair.group.running
    assert pair.x.axis.motion.v == 0.0
    assert 20.0 < pair.x.axis.motion.s < 299.0
    assert pair.x.axis.nc_to_plc.StateDWord & 1 << 25
    stop.set(Execute=False)
    pair.x.cycles(2)
    pair.x.until(pair.x.handle.move_absolute(0.0, Velocity=100.0).done)


def test_error_and_enable_in_a_group():
    """An error of one axis, or its lost enable, shuts the others down with 0x43A0."""
    for cause, code in (("error", 0x4464), ("enable", 0x4356)):
        pair = _Pair()
        pair.group.g1(100.0, x=300.0, x1=150.0)
        pair.group.start()
        pair.x.cycles(200)
        stops = [pair.x.handle.stop(), pair.y.handle.stop()]
        pair.x.cycles(3)
        if cause == "error":
            pair.x.axis.raise_error(0x4464)
        else:
            pair.x.handle.power(False)
        pair.x.cycles(3)
        assert [(stop.Done, stop.ErrorID) for stop in stops[:1]] == [(False, code)]
        assert (stops[1].Done, stops[1].CommandAborted) == (False, True)
        assert pair.x.handle.error_id == code
        assert pair.y.handle.error_id == 0x43A0
        assert not pair.group.running


@pytest.mark.requirement("NC-177")
def test_reserved_parameter():
    """The maximum position deviation of auxiliary axes changes nothing."""
    paths = []
    for value in (0.0, 7.0):
        pair = _Pair(x={"axis__max_position_deviation_aux": value})
        pair.group.tolerance_ball(5.0)
        pair.group.g1(60.0, x=30.0)
        pair.group.g1(60.0, x1=30.0)
        paths.append(pair.run().path)
    assert paths[0] == paths[1]


def test_circle_and_mistakes():
    """An arc is followed with its feed; wrong feeds, axes and radii are refused."""
    pair = _Pair(acceleration=5000.0, deceleration=5000.0)
    pair.group.arc(50.0, (20.0, 0.0), clockwise=False, x=40.0)
    pair.run()
    for sx, sy, _, _ in pair.path:
        assert hypot(sx - 20.0, sy) == pytest.approx(20.0)
    assert max(pair.speeds) == pytest.approx(50.0)
    assert min(sy for _, sy, _, _ in pair.path) == pytest.approx(-20.0, abs=0.01)
    group = pair.group
    for call, words in (
        (lambda: group.g1(0.0, x=1.0), "feed"),
        (lambda: group.g1(5.0, z=1.0), "x1"),
        (lambda: group.tolerance_ball(-1.0), "tolerance ball"),
        (group.start, "no move"),
        (lambda: InterpolationGroup([], cycle_s=T, acceleration=1.0, deceleration=1.0, jerk=1.0), "no axis"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            call()


@pytest.mark.requirement("NC-096", "NC-097", "NC-098", "NC-099", "NC-084", "NC-085")
def test_coordinated_dynamics():
    """Coordinated motion refuses 0.0 and values above the maxima; MC_Default is limited to the maximum,
    MC_Maximum is it; a jerk has no maximum, infinite is none.
    """
    parameters = ParameterSet({"axis.default_acceleration": 20000.0, "axis.default_deceleration": 700.0})

    def dynamics(velocity=100.0, acceleration=1.0, deceleration=1.0, jerk=1.0):
        return coordinated_dynamics(
            parameters, velocity=velocity, acceleration=acceleration, deceleration=deceleration, jerk=jerk
        )

    assert dynamics() == (100.0, 1.0, 1.0, 1.0)
    for key in ("acceleration", "deceleration", "jerk"):
        assert dynamics(**{key: 0.0}) == 0x4B06
    assert dynamics(acceleration=15000.1) == dynamics(deceleration=15000.1) == 0x4B06
    assert dynamics(velocity=2000.1) == dynamics(velocity=0.0) == 0x4359
    assert dynamics(acceleration=MC_Default, deceleration=MC_Default, jerk=MC_Default) == (
        100.0,
        15000.0,
        700.0,
        2250.0,
    )
    assert dynamics(MC_Maximum, MC_Maximum, MC_Maximum, 1e12) == (2000.0, 15000.0, 15000.0, 1e12)
    assert dynamics(jerk=inf) == (100.0, 1.0, 1.0, 0.0)
    assert catalogue()["axis.maximum_acceleration"].default == 15000.0


@pytest.mark.requirement("NC-176")
def test_tolerance_ball_of_an_auxiliary_axis(subtests):
    """An auxiliary axis goes straight from knot to knot with 0.0, and the path slows down for the step of its
    velocity; with a radius it leaves its straight ways within the radius alone, with a smooth velocity, and
    the path keeps its feed.
    """
    for radius, ball in ((0.0, 0.0), (3.0, 0.0), (400.0, 0.0), (0.0, 4.0), (2.0, 4.0)):
        with subtests.test(radius=radius, ball=ball):
            pair = _Pair()
            c = Rig(with_=pair.x, axis__tolerance_ball_aux=radius, axis__velo_jump_factor=2.0)
            c.enabled()
            group = pair.group = InterpolationGroup(
                [pair.x.axis, pair.y.axis],
                auxiliary=[c.axis],
                cycle_s=T,
                acceleration=1000.0,
                deceleration=1000.0,
                jerk=50_000.0,
            )
            pair.x.runtime.groups[:] = [group]
            group.tolerance_ball(ball)
            name = c.axis.name
            group.g1(100.0, x=60.0, **{name: 30.0})
            group.g1(100.0, **({"x1": 40.0, name: -10.0} if ball else {"x": 100.0, name: -10.0}))
            seen = []
            assert group.start() == 0
            while group.running:
                pair.x.cycles()
                motions = [one.axis.motion for one in (pair.x, pair.y, c)]
                seen.append([value for one in motions for value in (one.s, one.v)])
            assert c.axis.motion.s == pytest.approx(-10.0)
            assert not c.axis.error
            # Slopes of 0.5 and -1 of the way; a ball that is too big ends at half of the shorter way.
            deviation, in_ball = 0.0, []
            for x, _, y, _, place, _ in seen:
                way = x + y
                ideal = 0.5 * way if way < 60.0 else 30.0 - (way - 60.0)
                if not ball or x == 60.0 or y == 0.0:
                    deviation = max(deviation, abs(ideal - place))
                    if abs(ideal - place) > 1e-6:
                        in_ball.append(abs(place - 30.0))
            if radius and not ball:
                assert max(in_ball) <= min(radius, 20.0) + 1e-6
                assert 0.1 * min(radius, 20.0) < deviation < 0.5 * min(radius, 20.0)
            elif not ball:
                assert deviation < 1e-6
            steps = [abs(b[5] - a[5]) for a, b in pairwise(seen)]
            feeds = [hypot(one[1], one[3]) for one in seen]
            passing = feeds[min(range(len(seen)), key=lambda at: abs(seen[at][0] + seen[at][2] - 60.0))]
            if radius:
                assert max(steps) < (9.0 if ball else 100.0 * 1.5 * 1.5 / (2 * min(radius, 20.0)) * 0.2 + 3.1)
            else:
                assert max(steps) <= 2.0 * 15_000.0 * T + 3.1
            if not ball:
                assert passing == pytest.approx(100.0 if radius else 40.0, abs=2.0)
    with pytest.raises(ConfigurationError, match="auxiliary axes alone"):
        group.g1(10.0, **{name: 5.0})


@pytest.mark.requirement("NC-176")
def test_an_auxiliary_axis_belongs_to_its_group():
    """It takes no other command, is stopped with the path, and its error stops the others."""
    pair = _Pair()
    c = Rig(with_=pair.x)
    c.enabled()
    group = InterpolationGroup(
        [pair.x.axis], auxiliary=[c.axis], cycle_s=T, acceleration=1000.0, deceleration=1000.0, jerk=50_000.0
    )
    pair.x.runtime.groups[:] = [group]
    group.g1(100.0, x=200.0, **{c.axis.name: 100.0})
    assert group.start() == 0
    pair.x.cycles(300)
    assert c.handle.move_absolute(1.0, Velocity=1.0).ended() is False
    pair.x.cycles(2)
    assert c.axis.motion.s == pytest.approx(0.5 * pair.x.axis.motion.s)
    c.axis.raise_error(0x4550)
    assert pair.x.axis.error_id == 0x43A0
    assert not group.running
