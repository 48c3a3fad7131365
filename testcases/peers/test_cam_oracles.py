"""Cams, calculated by software of others: splines by SciPy, laws of motion by pyplcopen."""

from __future__ import annotations

import numpy as np
import pytest

from motion.kernel.cams import Boundary, Interpolation, Point, interpolate
from motion.kernel.cams import laws as law


@pytest.mark.parametrize("count", [2, 3, 4, 7, 40])
def test_cubic_splines_are_those_of_scipy(count):
    """Value and both derivatives, natural and periodic."""
    from scipy.interpolate import CubicSpline  # only the environment of these tests has it

    rng = np.random.default_rng(count)
    x, y = np.cumsum(rng.uniform(0.5, 20.0, count)), rng.normal(size=count)
    y[-1] = y[0]
    points = [Point(float(a), float(b)) for a, b in zip(x, y, strict=True)]
    for boundary, ends in ((Boundary.NONE, "natural"), (Boundary.EQUAL_VELOCITY, "periodic")):
        curve = interpolate(points, [], Interpolation.CUBIC, boundary)
        other = CubicSpline(x, y, bc_type=ends)
        for place in np.linspace(x[0], x[-1], 301)[:-1]:
            expected = [float(other(place, order)) for order in range(3)]
            assert curve.evaluate(float(place)) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("count", [4, 5, 9, 30])
def test_bezier_curves_are_the_b_splines_of_scipy(count):
    """Value and slope at the same parameters."""
    from scipy.interpolate import BSpline

    rng = np.random.default_rng(count)
    x, y = np.cumsum(rng.uniform(0.5, 20.0, count)), rng.normal(size=count)
    knots = np.r_[[0.0] * 3, np.arange(count - 2), [count - 3.0] * 3]
    of_x, of_y = BSpline(knots, x, 3), BSpline(knots, y, 3)
    points = [Point(float(a), float(b)) for a, b in zip(x, y, strict=True)]
    curve = interpolate(points, [], Interpolation.BEZIER)
    for u in np.linspace(0.0, count - 3.0, 301)[1:-1]:
        value, slope, _ = curve.evaluate(float(of_x(u)))
        assert value == pytest.approx(float(of_y(u)), abs=1e-11)
        assert slope == pytest.approx(float(of_y(u, 1) / of_x(u, 1)), abs=1e-9)


@pytest.mark.parametrize(
    ("name", "own"),
    [("cycloidal", law.inclined_sine), ("poly345", law.polynomial), ("modified_sine", law.modified_sine)],
)
def test_laws_are_those_of_pyplcopen(name, own):
    """At 64 places each, for a rise and for a fall."""
    import pyplcopen

    one = own()
    for span, rise in ((1.0, 1.0), (360.0, -50.0)):
        points = pyplcopen.generate_cam_law(name, span, rise, 64)
        assert len(points) == 64
        for x, y in points:
            assert rise * one.evaluate(x / span)[0] == pytest.approx(y, abs=1e-12 * abs(rise))
