"""Curves of cams: segments, gaps, what counts, inverse, scaling (CAM sections 12 to 14)."""

from math import inf, isclose, nan, pi, radians, sin

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from motion.kernel.cams import (
    APPENDING,
    CYCLIC,
    NEGATIVE,
    ONCE,
    POSITIVE,
    Boundary,
    EmptyCamError,
    Interpolation,
    InvalidCamError,
    Inverse,
    Point,
    ScaledCurve,
    Segment,
    interpolate,
)

LINEAR, CUBIC, BEZIER = Interpolation
EQUAL = Boundary.EQUAL_VELOCITY


def points(*pairs):
    return [Point(float(x), float(y)) for x, y in pairs]


def segment(xmin, xmax, *a, sine=(0.0, 0.0, 0.0)):
    coefficients = [float(one) for one in a] + [0.0] * (7 - len(a))
    return Segment(float(xmin), float(xmax), tuple(coefficients), *sine)


def numbers(count):
    """Distances between leading values and following values of as many points."""
    steps = st.lists(st.floats(0.1, 100.0), min_size=2, max_size=count)
    return steps.flatmap(
        lambda found: st.tuples(
            st.just(found),
            st.lists(st.floats(-1e3, 1e3), min_size=len(found), max_size=len(found)),
            st.floats(-1e3, 1e3),
        )
    )


def made(drawn):
    steps, following, start = drawn
    leading = [start]
    for step in steps[1:]:
        leading.append(leading[-1] + step)
    return [Point(x, y) for x, y in zip(leading, following, strict=True)]


def solved_spline(given, ends):
    """Return the second derivatives of a cubic spline, from the dense system of equations for them.

    Args:
        given: The points.
        ends: (slope at the first point, slope at the last point), "natural" or "periodic".

    """
    x, y = np.array([one.x for one in given]), np.array([one.y for one in given])
    h, n = np.diff(x), len(x)
    legs = np.diff(y) / h
    matrix, right = np.zeros((n, n)), np.zeros(n)
    for i in range(1, n - 1):
        matrix[i, i - 1 : i + 2] = h[i - 1], 2.0 * (h[i - 1] + h[i]), h[i]
        right[i] = 6.0 * (legs[i] - legs[i - 1])
    if ends == "natural":
        matrix[0, 0] = matrix[-1, -1] = 1.0
    elif ends == "periodic":
        matrix[0, [0, -1]] = 1.0, -1.0
        matrix[-1, [0, 1, n - 2, n - 1]] += 2.0 * h[0], h[0], h[-1], 2.0 * h[-1]
        right[-1] = 6.0 * (legs[0] - legs[-1])
    else:
        matrix[0, :2] = 2.0 * h[0], h[0]
        matrix[-1, -2:] = h[-1], 2.0 * h[-1]
        right[0], right[-1] = 6.0 * (legs[0] - ends[0]), 6.0 * (ends[1] - legs[-1])
    return np.linalg.solve(matrix, right)


@pytest.mark.requirement("CAM-016", "CAM-017", "CAM-074", "CAM-205")
def test_segment_is_a_polynomial_of_the_distance_from_its_start_and_a_sine():
    """Value and derivatives of the worked examples; every coefficient acts on its own power of x - xmin."""
    curve = interpolate([], [segment(0, 10, 1, 2, 0.5)])
    assert curve.evaluate(4.0) == pytest.approx((17.0, 6.0, 1.0), abs=1e-12)
    curve = interpolate([], [segment(100, 104, 0, 1, sine=(3.0, pi / 2, 0.0))])
    assert curve.evaluate(101.0) == pytest.approx((4.0, 1.0, -3.0 * (pi / 2) ** 2), abs=1e-12)
    curve = interpolate([], [segment(0, 10, 0, 0, 0, 2)])
    assert curve.evaluate(3.0) == pytest.approx((54.0, 54.0, 36.0), abs=1e-12)
    for power in range(7):
        curve = interpolate([], [segment(5, 9, *[0.0] * power, 1.5)])
        y, d, dd = curve.evaluate(7.0)
        assert isclose(y, 1.5 * 2.0**power)
        assert isclose(d, 1.5 * power * 2.0 ** (power - 1))
        assert isclose(dd, 1.5 * power * (power - 1) * 2.0 ** (power - 2))
        third = 1.5 * power * (power - 1) * (power - 2) * 2.0 ** (power - 3)
        assert isclose(curve.third(7.0), third)


@pytest.mark.requirement("CAM-036", "CAM-037")
def test_linear_interpolation_closes_gaps_with_straight_lines():
    """At a point the slope of the next line counts, at the end of the cam that of the last one."""
    curve = interpolate(points((0, 0), (10, 20), (30, 0)), [], LINEAR)
    assert curve.evaluate(5.0) == (10.0, 2.0, 0.0)
    assert curve.evaluate(20.0) == (10.0, -1.0, 0.0)
    assert curve.evaluate(10.0) == (20.0, -1.0, 0.0)
    assert curve.evaluate(30.0) == (0.0, -1.0, 0.0)
    mixed = interpolate(points((0, 0), (40, 8)), [segment(10, 20, 5, 1)], LINEAR)
    assert mixed.evaluate(4.0) == (2.0, 0.5, 0.0)
    assert mixed.evaluate(30.0) == pytest.approx((11.5, -0.35, 0.0))


@pytest.mark.requirement("CAM-040", "CAM-041")
def test_cubic_splines_of_the_worked_examples():
    """Natural ends without a boundary condition; periodic ones where first derivatives are to be equal."""
    curve = interpolate(points((0, 0), (1, 1), (2, 0)), [], CUBIC)
    assert curve.evaluate(0.5)[0] == pytest.approx(0.6875, abs=1e-12)
    assert curve.evaluate(0.0)[1] == pytest.approx(1.5, abs=1e-12)
    assert curve.evaluate(1.0)[1:] == pytest.approx((0.0, -3.0), abs=1e-12)
    curve = interpolate(points((0, 0), (1, 1), (2, 0), (3, -1), (4, 0)), [], CUBIC, EQUAL)
    for end in (0.0, 4.0):
        assert curve.evaluate(end)[1:] == pytest.approx((1.5, 0.0), abs=1e-12)
    assert curve.evaluate(0.5)[0] == pytest.approx(0.6875, abs=1e-12)


@pytest.mark.requirement("CAM-038", "CAM-039")
def test_cubic_spline_has_a_continuous_second_derivative_that_is_linear_between_points():
    """It passes through points and segments; next to a segment it has the slope of the segment, and at an end
    that is free the second derivative 0.
    """
    rng = np.random.default_rng(5)
    for count in (2, 3, 8, 25):
        given = points(*zip(np.cumsum(rng.uniform(0.5, 3.0, count)), rng.normal(size=count), strict=True))
        curve = interpolate(given, [], CUBIC)
        expected = solved_spline(given, "natural")
        for one, bend in zip(given, expected, strict=True):
            assert curve.evaluate(one.x)[0] == pytest.approx(one.y, abs=1e-12)
            assert curve.evaluate(one.x)[2] == pytest.approx(bend, abs=1e-9)
        for (one, first), (two, last) in zip(
            zip(given, expected, strict=True), list(zip(given, expected, strict=True))[1:], strict=False
        ):
            middle = curve.evaluate(0.5 * (one.x + two.x))[2]
            assert middle == pytest.approx(0.5 * (first + last), abs=1e-9)
    gap = points((10, 5), (12, 9), (15, 1))
    curve = interpolate(
        [points((0, 3))[0], gap[1]], [segment(4, 10, 2, 0.5), segment(15, 20, 1, -2, 0.3)], CUBIC
    )
    bends = solved_spline(gap, (0.5, -2.0))
    assert curve.evaluate(12.0) == pytest.approx((9.0, curve.evaluate(12.0)[1], bends[1]))
    slope = curve.evaluate(12.0)[1]
    assert curve.evaluate(12.0 - 1e-9)[1] == pytest.approx(slope, abs=1e-6)
    assert curve.evaluate(10.0 + 1e-12)[:2] == pytest.approx((5.0, 0.5))
    assert curve.evaluate(15.0 - 1e-12)[:2] == pytest.approx((1.0, -2.0))
    assert curve.evaluate(0.0)[2] == pytest.approx(0.0, abs=1e-12)
    peak = interpolate(points((0, 0), (1, 1), (2, 1), (3, 0)), [], CUBIC)
    assert peak.evaluate(1.5)[0] > 1.0


def b_spline(given, u):
    """Return leading and following value of the clamped cubic B-spline at a parameter, by the recursion of
    Cox and de Boor.
    """
    count = len(given)
    knots = [0.0] * 3 + [float(i) for i in range(count - 2)] + [float(count - 3)] * 3

    def basis(i, k):
        if k == 0:
            inside = knots[i] <= u < knots[i + 1]
            return float(inside or (u == knots[-1] and knots[i] < u == knots[i + 1]))
        total = 0.0
        if knots[i + k] > knots[i]:
            total += (u - knots[i]) / (knots[i + k] - knots[i]) * basis(i, k - 1)
        if knots[i + k + 1] > knots[i + 1]:
            total += (knots[i + k + 1] - u) / (knots[i + k + 1] - knots[i + 1]) * basis(i + 1, k - 1)
        return total

    weights = [basis(i, 3) for i in range(count)]
    return sum(w * p.x for w, p in zip(weights, given, strict=True)), sum(
        w * p.y for w, p in zip(weights, given, strict=True)
    )


@pytest.mark.requirement("CAM-042", "CAM-043", "CAM-045")
def test_bezier_interpolation_follows_its_points_as_control_points():
    """It is the clamped cubic B-spline, touches first and last point, passes through segments, and bends
    less than the cubic spline.
    """
    curve = interpolate(points((0, 0), (1, 1), (2, 0), (3, 0)), [], BEZIER)
    assert curve.evaluate(1.5)[0] == pytest.approx(0.375, abs=1e-12)
    assert max(curve.evaluate(x)[0] for x in np.linspace(0.0, 3.0, 301)) < 1.0
    given = points((0, 1), (1, 4), (3, -2), (3.5, 2), (6, 0), (9, 3), (10, 3))
    curve = interpolate(given, [], BEZIER)
    for u in np.linspace(0.0, 4.0, 81):
        x, y = b_spline(given, float(u))
        assert curve.evaluate(x)[0] == pytest.approx(y, abs=1e-12)
    for one in (given[0], given[-1]):
        assert curve.evaluate(one.x)[0] == pytest.approx(one.y, abs=1e-12)
    for x in (1.5, 3.2, 7.0):
        step = 1e-5
        before, at, after = (curve.evaluate(x + d) for d in (-step, 0.0, step))
        assert at[1] == pytest.approx((after[0] - before[0]) / (2 * step), abs=1e-6)
        assert at[2] == pytest.approx((after[1] - before[1]) / (2 * step), abs=1e-6)
        assert curve.third(x) == pytest.approx((after[2] - before[2]) / (2 * step), rel=1e-4, abs=1e-4)
    mixed = interpolate(given, [segment(4, 5, 7)], BEZIER)
    assert mixed.evaluate(4.5)[0] == 7.0
    assert mixed.evaluate(5.0 + 1e-12)[0] == pytest.approx(7.0, abs=1e-9)
    assert mixed.evaluate(4.0 - 1e-12)[0] == pytest.approx(7.0, abs=1e-9)
    zigzag = points((0, 0), (1, 1), (2, 0), (3, 1), (4, 0))
    grid = np.linspace(0.0, 4.0, 401)
    bends = [max(abs(interpolate(zigzag, [], mode).evaluate(x)[2]) for x in grid) for mode in (BEZIER, CUBIC)]
    assert bends[0] <= bends[1]


@pytest.mark.exhaustive
@pytest.mark.requirement("CAM-044")
@settings(max_examples=60, deadline=None)
@given(numbers(9))
def test_first_derivatives_are_equal_at_start_and_end_where_demanded(drawn):
    """For points in mode 1 and 2, and next to a segment at one end; straight lines stay as they are."""
    found = made(drawn)
    for mode in (CUBIC, BEZIER):
        curve = interpolate(found, [], mode, EQUAL)
        scale = max(1.0, *(abs(curve.evaluate(one.x)[1]) for one in found))
        assert abs(curve.evaluate(curve.start)[1] - curve.evaluate(curve.end)[1]) <= 1e-9 * scale
        last = found[-1].x
        tail = segment(last + 5.0, last + 9.0, 3.0, 0.7, 0.1)
        mixed = interpolate(found, [tail], mode, EQUAL)
        assert mixed.evaluate(mixed.start)[1] == pytest.approx(0.7 + 2 * 0.1 * 4.0, rel=1e-9)
        head = segment(found[0].x - 5.0, found[0].x - 2.0, 3.0, 0.7, 0.1)
        mixed = interpolate(found, [head], mode, EQUAL)
        assert mixed.evaluate(mixed.end)[1] == pytest.approx(0.7, rel=1e-9)
        between = segment(last + 5.0, last + 9.0, 3.0, 0.7, 0.1)
        both = interpolate([*found, Point(last + 20.0, 1.0)], [between], mode, EQUAL)
        ends = both.evaluate(both.start)[1], both.evaluate(both.end)[1]
        assert abs(ends[0] - ends[1]) <= 1e-9 * max(1.0, abs(ends[0]), scale)
    lines = [interpolate(found, [], LINEAR, boundary) for boundary in Boundary]
    for one in found:
        assert lines[0].evaluate(one.x) == lines[1].evaluate(one.x)


@pytest.mark.exhaustive
@pytest.mark.requirement("CAM-206", "CAM-217")
@settings(max_examples=100, deadline=None)
@given(numbers(12), st.sampled_from(Boundary))
def test_lines_and_splines_pass_through_points_and_bezier_curves_stay_between_them(drawn, boundary):
    """Whatever the points; the ends of a Bezier curve are its first and last point."""
    found = made(drawn)
    largest = max(1.0, *(abs(one.y) for one in found))
    for mode in (LINEAR, CUBIC):
        curve = interpolate(found, [], mode, boundary)
        for one in found:
            assert abs(curve.evaluate(one.x)[0] - one.y) <= 1e-9 * largest
            if one.x > curve.start:
                before = curve.pieces[[p.end for p in curve.pieces].index(one.x)]
                assert abs(before.evaluate(one.x)[0] - one.y) <= 1e-9 * largest
    curve = interpolate(found, [], BEZIER, boundary)
    low, high = min(one.y for one in found), max(one.y for one in found)
    for x in np.linspace(curve.start, curve.end, 97):
        assert low - 1e-9 * largest <= curve.evaluate(float(x))[0] <= high + 1e-9 * largest
    assert curve.evaluate(curve.end)[0] == pytest.approx(found[-1].y, rel=1e-12, abs=1e-9)
    assert curve.evaluate(curve.start)[0] == pytest.approx(found[0].y, rel=1e-12, abs=1e-9)


@pytest.mark.requirement("CAM-019", "CAM-020", "CAM-021", "CAM-022", "CAM-024")
def test_what_counts_of_points_and_segments():
    """A segment hides points; one that begins later is used completely; small gaps are none; any order."""
    hidden = interpolate(points((0, 0), (5, 99), (8, 1), (4, 3)), [segment(4, 8, 2)], LINEAR)
    assert [hidden.evaluate(x)[0] for x in (2.0, 4.0, 5.0, 8.0)] == [1.0, 2.0, 2.0, 2.0]
    assert (hidden.end, hidden.evaluate(7.0)[0]) == (8.0, 2.0)
    for order in (1, -1):
        both = [segment(0, 100, 0, 1), segment(60, 80, 5)][::order]
        curve = interpolate([], both, LINEAR)
        found = [curve.evaluate(x)[0] for x in (0.0, 59.999, 60.0, 70.0, 80.0, 80.001, 100.0)]
        assert found == pytest.approx([0.0, 59.999, 5.0, 5.0, 5.0, 80.001, 100.0], abs=1e-12)
    three = interpolate([], [segment(0, 10, 1), segment(2, 8, 2), segment(3, 9, 3)], LINEAR)
    assert [three.evaluate(x)[0] for x in (1.0, 2.5, 3.0, 8.5, 9.0, 9.5)] == [1, 2, 3, 3, 3, 1]
    for gap, slope in ((0.99e-4, 0.0), (1e-4, 0.0), (1.01e-4, 1.0 / 1.01e-4)):
        curve = interpolate([], [segment(0, 10, 1), segment(10 + gap, 20, 2)], LINEAR)
        assert curve.evaluate(10.0 + 0.5 * gap)[1] == pytest.approx(slope, rel=1e-6)
        assert curve.evaluate(10.0 + gap)[0] == 2.0
    rng = np.random.default_rng(3)
    given = points((10, 3), (20, 1), (30, 7), (70, 2), (44, 4))
    pieces = [segment(50, 60, 1, 2), segment(33, 40, 5)]
    for mode in Interpolation:
        ordered = interpolate(
            sorted(given, key=lambda one: one.x), sorted(pieces, key=lambda one: one.xmin), mode
        )
        for _ in range(4):
            mixed = interpolate(list(rng.permutation(given)), list(rng.permutation(pieces)), mode)
            assert (mixed.start, mixed.end) == (10.0, 70.0)
            assert [mixed.evaluate(x) for x in range(10, 71)] == [ordered.evaluate(x) for x in range(10, 71)]
    curve = interpolate(points((10, 0), (20, 1), (30, 0)), [segment(50, 60, 1)], CUBIC)
    assert (curve.start, curve.end) == (10.0, 60.0)


def test_what_is_no_cam_is_refused(subtests):
    """Nothing at all; a single point; segments without length; numbers that are not finite."""
    with pytest.raises(EmptyCamError, match="neither point nor segment"):
        interpolate([], [])
    bad = {
        "single point": (points((1, 1)), []),
        "one leading value": (points((1, 1), (1, 2)), []),
        "no length": ([], [segment(5, 5, 1)]),
        "backwards": (points((0, 1), (9, 1)), [segment(5, 4, 1)]),
        "no number": (points((1, nan), (2, 1)), []),
        "endless": ([], [segment(0, inf, 1)]),
        "too steep": (points((0, 0), (1e-310, 1e12), (1, 1)), []),
        "too large": ([], [segment(0, 1e12, 0, 0, 0, 0, 0, 0, 1e300)]),
        "too fast": ([], [segment(0, 1e12, 0, sine=(1.0, 1e300, 0.0))]),
    }
    for name, (found, pieces) in bad.items():
        with subtests.test(name), pytest.raises(InvalidCamError):
            interpolate(found, pieces)


@pytest.mark.requirement("CAM-063", "CAM-064", "CAM-209")
def test_leading_value_of_a_following_value_is_the_nearest_one():
    """With several the one next to the approach value, of two at the same distance the larger one."""
    curve = interpolate([Point(float(x), sin(radians(x))) for x in range(361)], [], CUBIC)
    inverse = Inverse(curve)
    for approach, expected in ((0.0, 30.0), (180.0, 150.0), (225.0, 150.0), (89.9, 30.0), (90.1, 150.0)):
        assert inverse.find(0.5, approach) == pytest.approx(expected, abs=1e-9)
    valley = Inverse(interpolate(points((0, 1), (10, 0), (20, 1)), [], LINEAR))
    assert valley.find(0.5, 10.0) == 15.0


@pytest.mark.exhaustive
@settings(max_examples=150, deadline=None)
@given(numbers(9), st.sampled_from(Interpolation), st.floats(0.0, 1.0))
def test_curves_invert(drawn, mode, share):
    """A leading value is found again from its following value, and every solution has it."""
    curve = interpolate(made(drawn), [], mode)
    inverse = Inverse(curve)
    x = min(curve.start + share * curve.period, curve.end)
    y = curve.evaluate(x)[0]
    found = inverse.find(y, x)
    assert found is not None
    scale = max(1.0, abs(inverse.highest), abs(inverse.lowest))
    assert abs(curve.evaluate(found)[0] - y) <= 1e-9 * scale
    for low, high in inverse.solutions(y):
        for at in (low, high):
            assert abs(curve.evaluate(at)[0] - y) <= 1e-9 * scale
    grid = [curve.evaluate(float(at))[0] for at in np.linspace(curve.start, curve.end, 200)]
    assert min(grid) >= inverse.lowest - 1e-9 * scale
    assert max(grid) <= inverse.highest + 1e-9 * scale
    assert not inverse.reaches(inverse.highest + 1e-6 * scale)


@pytest.mark.exhaustive
@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=7, max_size=7), st.floats(-2.0, 2.0), st.floats(-12.0, 12.0))
def test_every_solution_in_a_segment_is_found(coefficients, amplitude, rate):
    """As many as changes of sign that a fine grid shows, for polynomials with a sine."""
    curve = interpolate([], [segment(0, 2, *coefficients, sine=(amplitude, rate, 0.4))])
    grid = np.linspace(0.0, 2.0, 1501)
    values = np.array([curve.evaluate(float(x))[0] for x in grid])
    assume(np.ptp(values) > 1e-3)
    y = float(0.37 * values.min() + 0.63 * values.max())
    changes = grid[:-1][np.diff(np.sign(values - y)) != 0]
    found = [low for low, _ in Inverse(curve).solutions(y)]
    for x in changes:
        assert min(abs(one - x) for one in found) <= 2.0 / 1500 + 1e-9


@pytest.mark.exhaustive
def test_search_in_a_wild_sine_ends():
    """More turning points than anybody can use; solutions that are found have the following value."""
    curve = interpolate([], [segment(0, 1e6, 0, sine=(1.0, 1e9, 0.0))])
    inverse = Inverse(curve)
    for low, _ in inverse.solutions(0.5)[:50]:
        assert abs(curve.evaluate(low)[0] - 0.5) <= 1e-6 or abs(curve.evaluate(low)[1]) >= 1e3
    assert not inverse.reaches(1.5)


@pytest.mark.requirement("CAM-102", "CAM-105")
def test_scaling_and_shifting_leave_the_curve_itself_as_it_is():
    """Value, derivatives and range follow the formula; two users have different ones at the same time."""
    curve = interpolate([], [segment(0, 100, 0, 0, 0.01)])
    plain = ScaledCurve(curve)
    used = ScaledCurve(curve, master_offset=50.0, master_scaling=2.0, slave_scaling=3.0, slave_offset=10.0)
    y, slope, bend = used.evaluate(150.0)
    assert (y, slope) == pytest.approx((85.0, 1.5), abs=1e-12)
    assert bend == pytest.approx(0.02 * 3.0 / 4.0, abs=1e-12)
    assert (used.low, used.high, used.period) == (50.0, 250.0, 200.0)
    assert plain.evaluate(50.0) == (25.0, 1.0, 0.02)
    assert curve.evaluate(50.0) == (25.0, 1.0, 0.02)


@pytest.mark.requirement("CAM-104")
def test_negative_scaling_mirrors_the_cam():
    """In the leading value; a scaling of 0 in the following value makes it constant."""
    curve = interpolate([], [segment(0, 100, 0, 0, 0.01)])
    mirrored = ScaledCurve(curve, master_scaling=-1.0, master_offset=100.0)
    assert mirrored.evaluate(30.0) == pytest.approx((49.0, -1.4, 0.02), abs=1e-12)
    assert (mirrored.low, mirrored.high, mirrored.first, mirrored.last) == (0.0, 100.0, 100.0, 0.0)
    flat = ScaledCurve(curve, slave_scaling=0.0, slave_offset=4.0)
    assert flat.evaluate(30.0) == (4.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="master_scaling is 0"):
        ScaledCurve(curve, master_scaling=0.0)
    with pytest.raises(ValueError, match="mode is 3"):
        ScaledCurve(curve, mode=3)


@pytest.mark.exhaustive
@settings(max_examples=100, deadline=None)
@given(
    numbers(6),
    st.tuples(st.floats(0.1, 9.0), st.floats(0.1, 9.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)),
    st.floats(0.0, 1.0),
)
def test_scaling_a_cam_is_interpolating_scaled_points(drawn, factors, share):
    """Scaling and shift commute with the interpolation, and the inverse undoes them."""
    master, slave, dx, dy = factors
    found = made(drawn)
    curve = interpolate(found, [], CUBIC)
    scaled = ScaledCurve(curve, master_scaling=master, slave_scaling=slave, master_offset=dx, slave_offset=dy)
    other = interpolate([Point(p.x * master + dx, p.y * slave + dy) for p in found], [], CUBIC)
    x = min(other.start + share * other.period, other.end)
    size = max(abs(one.y) for one in found) * slave + abs(dy) + 1.0
    assert scaled.evaluate(x)[0] == pytest.approx(other.evaluate(x)[0], abs=1e-7 * size)
    inverse = Inverse(curve)
    y = scaled.evaluate(x)[0]
    if scaled.contains(x):
        back = scaled.leading_value(inverse, y, x)
        assert back is not None
        assert scaled.evaluate(back)[0] == pytest.approx(y, abs=1e-9 * size)


def test_a_cam_runs_once_or_repeats_or_continues_where_it_ended():
    """Outside of the range: the value at its end, the same again, or the lift added for every run."""
    curve = interpolate([], [segment(0, 360, 0, 0, 0, 100 / 360.0**3)])

    def f(x):
        return 100.0 * (x / 360.0) ** 3

    once, cyclic, appending = (ScaledCurve(curve, mode=mode) for mode in (ONCE, CYCLIC, APPENDING))
    assert once.evaluate(400.0) == (pytest.approx(100.0), 0.0, 0.0)
    assert once.evaluate(-1.0) == (0.0, 0.0, 0.0)
    assert cyclic.evaluate(361.0)[0] == pytest.approx(f(1.0))
    assert cyclic.evaluate(360.0)[0] == pytest.approx(0.0, abs=1e-9)
    assert appending.evaluate(900.0)[0] == pytest.approx(200.0 + f(180.0))
    assert appending.evaluate(-90.0)[0] == pytest.approx(-100.0 + f(270.0))
    assert [one.cycle(-90.0) for one in (once, cyclic, appending)] == [0, -1, -1]


def test_direction_of_the_search_is_that_of_the_scaled_leading_value():
    """A mirrored cam is searched the other way round; the approach value itself does not count."""
    curve = interpolate(points((0, 0), (10, 1), (20, 0)), [], LINEAR)
    inverse = Inverse(curve)
    assert inverse.find(0.5, 5.0, POSITIVE) == 15.0
    assert inverse.find(0.5, 5.0, NEGATIVE) is None
    mirrored = ScaledCurve(curve, master_scaling=-1.0)
    assert mirrored.leading_value(inverse, 0.5, -10.0, POSITIVE) == -5.0
    assert mirrored.leading_value(inverse, 0.5, -10.0, NEGATIVE) == -15.0
    assert mirrored.reaches(inverse, 1.0)
    assert not mirrored.reaches(inverse, 1.1)
