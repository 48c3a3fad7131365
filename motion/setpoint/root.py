"""Where a rising function is zero."""

from __future__ import annotations

from collections.abc import Callable

_MAX_ITERATIONS = 200
"""Root finding converges in about ten steps; the bound is for magnitudes at the ends of the number range."""


def find_root(  # noqa: PLR0917 - a bracket and its values
    function: Callable[[float], float],
    low: float,
    high: float,
    at_low: float,
    at_high: float,
    tolerance: float,
) -> tuple[float, float]:
    """Return where the rising `function` is zero between `low` and `high`, and its value there.

    The value is not above zero, unless its magnitude is below `tolerance`. Method of Chandrupatla: inverse
    quadratic interpolation where it is safe, bisection where it is not.
    """
    a, fa = high, at_high
    b, fb = low, at_low
    fraction = 0.5
    for _ in range(_MAX_ITERATIONS):
        x = a + fraction * (b - a)
        fx = function(x)
        if (fx < 0.0) == (fa < 0.0):
            c, fc = a, fa
        else:
            c, fc = b, fb
            b, fb = a, fa
        a, fa = x, fx
        if abs(fa) <= tolerance:
            return a, fa
        best = abs(a if abs(fa) < abs(fb) else b)
        if abs(b - a) <= 4e-16 * best:
            break
        xi = (a - b) / (c - b)
        phi = (fa - fb) / (fc - fb)
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            fraction = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        else:
            fraction = 0.5
        least = 2e-16 * best / abs(b - a)
        fraction = min(max(fraction, least), 1.0 - least)
    return (a, fa) if fa <= 0.0 else (b, fb)
