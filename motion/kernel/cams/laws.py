"""Laws of motion of VDI 2143 in normalised form: f(0) = 0, f(1) = 1 (CAM section 16).

A law leads from one boundary to another: dwell (R), constant velocity (G), reversal (U), motion (B). Most
of them are made of phases of the acceleration, which are integrated in closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb, cos, factorial, inf, pi, sin, sqrt
from typing import Final, NamedTuple

import numpy as np

from motion.kernel.cams.pieces import Values

HARMONIC_LAMBDA: Final = 4.0 - 2.0 * sqrt(3.0)
"""Turning point of the harmonic combination at which its jerk is continuous."""
TRAPEZOID_LAMBDA: Final = 1.0 / (1.0 + sqrt((0.5 + 1.0 / pi) / (0.75 + 0.5 / pi)))
"""Turning point of the modified acceleration trapezoid R-U with ramps of equal jerk."""
_K1: Final = (2.0 / pi - 4.0 / pi**2) / 16.0 + 3.0 / (8.0 * pi) + 9.0 / (4.0 * pi**2)
"""Way of a quarter sine ramp over 1/4 and a quarter cosine over 3/4, for acceleration and length 1."""
_SAMPLES: Final = 400
_REFINEMENTS: Final = 80


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a law: a polynomial and sines of `z - start`."""

    start: float
    end: float
    coefficients: tuple[float, ...]
    """Those of the powers 0, 1, .., at most 7."""
    sines: tuple[tuple[float, float, float], ...] = ()
    """Amplitude, rate, phase of each sine."""

    def derivative(self, z: float, order: int) -> float:
        """Return the derivative of an order, 0 for the value itself."""
        s = z - self.start
        value = 0.0
        for power in range(len(self.coefficients) - 1, order - 1, -1):
            factor = factorial(power) / factorial(power - order)
            value = value * s + factor * self.coefficients[power]
        for amplitude, rate, phase in self.sines:
            value += amplitude * rate**order * sin(rate * s + phase + 0.5 * pi * order)
        return value

    def mirrored(self) -> Part:
        """Return the part of the law `1 - f(1 - z)`."""
        length = self.end - self.start
        count = len(self.coefficients)
        # Powers of (length - t), multiplied out.
        turned = [
            -sum(
                self.coefficients[power] * comb(power, k) * length ** (power - k) * (-1.0) ** k
                for power in range(k, count)
            )
            for k in range(count)
        ]
        turned[0] += 1.0
        sines = tuple((amp, rate, -(rate * length + phase)) for amp, rate, phase in self.sines)
        return Part(1.0 - self.end, 1.0 - self.start, tuple(turned), sines)


class Characteristics(NamedTuple):
    """Characteristic values of a normalised law."""

    cv: float
    """Greatest velocity."""
    ca: float
    """Greatest acceleration."""
    ca_star: float
    """Greatest deceleration, as a positive number."""
    cj: float
    """Greatest jerk; infinite where the acceleration has a step inside."""
    cmdyn: float
    """Greatest product of velocity and acceleration."""


class Law:
    """A normalised law.

    Args:
        name: As in `LAWS`.
        parts: From 0 to 1.

    """

    def __init__(self, name: str, parts: Sequence[Part]) -> None:
        self.name = name
        self.parts = tuple(parts)

    def _part(self, z: float) -> Part:
        for part in self.parts:
            if z < part.end:
                return part
        return self.parts[-1]

    def evaluate(self, z: float) -> Values:
        """Return f, f' and f'' at 0 to 1."""
        part = self._part(z)
        return part.derivative(z, 0), part.derivative(z, 1), part.derivative(z, 2)

    def third(self, z: float) -> float:
        """Return f''' at 0 to 1."""
        return self._part(z).derivative(z, 3)

    def mirrored(self) -> Law:
        """Return the law for the transition in the other direction: 1 - f(1 - z) (CAM-152)."""
        return Law(self.name, [part.mirrored() for part in reversed(self.parts)])

    @property
    def greatest_acceleration(self) -> float:
        """`Ca`."""
        return self._largest(lambda part, z: part.derivative(z, 2))

    @property
    def greatest_deceleration(self) -> float:
        """`Ca*`."""
        return self._largest(lambda part, z: -part.derivative(z, 2))

    @cached_property
    def characteristics(self) -> Characteristics:
        """Characteristic values, from the extrema of every part."""
        largest = self._largest
        jumps = any(
            abs(one.derivative(one.end, 2) - two.derivative(two.start, 2)) > 1e-9
            for one, two in zip(self.parts, self.parts[1:], strict=False)
        )
        return Characteristics(
            cv=largest(lambda part, z: abs(part.derivative(z, 1))),
            ca=self.greatest_acceleration,
            ca_star=self.greatest_deceleration,
            cj=inf if jumps else largest(lambda part, z: abs(part.derivative(z, 3))),
            cmdyn=largest(lambda part, z: abs(part.derivative(z, 1) * part.derivative(z, 2))),
        )

    def _largest(self, of: Callable[[Part, float], float]) -> float:
        return max(0.0, *(_largest_in(part, of) for part in self.parts))


def _largest_in(part: Part, of: Callable[[Part, float], float]) -> float:
    step = (part.end - part.start) / _SAMPLES
    grid = [part.start + number * step for number in range(_SAMPLES)] + [part.end]
    values = [of(part, z) for z in grid]
    best = max(range(len(grid)), key=values.__getitem__)
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, _SAMPLES)]
    found = values[best]
    for _ in range(_REFINEMENTS):
        one, two = low + (high - low) / 3.0, high - (high - low) / 3.0
        first, second = of(part, one), of(part, two)
        found = max(found, first, second)
        if first < second:
            low = one
        else:
            high = two
    return found


# -- phases of the acceleration

RISE: Final = "rise"
"""Quarter sine from 0 to the amplitude."""
FALL: Final = "fall"
"""Quarter cosine from the amplitude to 0."""
HOLD: Final = "hold"
"""Constant."""
HALF: Final = "half"
"""Half a sine."""
TURN: Final = "turn"
"""Half a cosine, from the amplitude to the negative one."""
FULL: Final = "full"
"""A whole sine."""
_SINES: Final = {RISE: (0.5, 0.0), FALL: (0.5, 0.5), HALF: (1.0, 0.0), TURN: (1.0, 0.5), FULL: (2.0, 0.0)}
"""Of each phase: angle over its length and at its start, in units of pi."""

_Phase = tuple[float, str, float]
"""Length, kind, amplitude."""


def _integrated(phases: Sequence[_Phase], v0: float = 0.0) -> list[Part]:
    """Return the parts with the accelerations of the phases; the last one ends at 1."""
    parts: list[Part] = []
    start, y, v = 0.0, 0.0, v0
    phases = [one for one in phases if one[0] > 0.0]
    for number, (length, kind, amplitude) in enumerate(phases):
        end = 1.0 if number == len(phases) - 1 else start + length
        if kind == HOLD:
            part = Part(start, end, (y, v, 0.5 * amplitude))
        else:
            angle, offset = _SINES[kind]
            rate, phase = angle * pi / length, offset * pi
            wave = -amplitude / rate**2
            part = Part(
                start,
                end,
                (y - wave * sin(phase), v - wave * rate * cos(phase)),
                ((wave, rate, phase),),
            )
        parts.append(part)
        start, y, v = end, part.derivative(end, 0), part.derivative(end, 1)
    return parts


def _scaled(phases: Sequence[_Phase]) -> list[_Phase]:
    """Return phases from rest whose way is 1."""
    way = _integrated(phases)[-1].derivative(1.0, 0)
    return [(length, kind, amplitude / way) for length, kind, amplitude in phases]


# -- the laws


def straight_line() -> Law:
    """F = z: G-G with equal slopes."""
    return Law("straight line", [Part(0.0, 1.0, (0.0, 1.0))])


def quadratic_parabola(lam: float = 0.5, v0: float = 0.0, v1: float = 0.0) -> Law:
    """Constant acceleration, then constant deceleration: R-R, G-G."""
    vm = 2.0 - lam * v0 - (1.0 - lam) * v1
    phases = [(lam, HOLD, (vm - v0) / lam), (1.0 - lam, HOLD, (v1 - vm) / (1.0 - lam))]
    return Law("quadratic parabola", _integrated(phases, v0))


def simple_sine(lam: float = 0.5) -> Law:
    """R-R with steps of the acceleration at the ends, U-U without."""
    ca = 0.25 * pi**2 / lam
    if lam == 0.5:
        return Law("simple sine", _integrated([(1.0, TURN, ca)]))
    phases = [(lam, FALL, ca), (1.0 - lam, RISE, -0.25 * pi**2 / (1.0 - lam))]
    return Law("simple sine", _integrated(phases))


def inclined_sine(lam: float = 0.5) -> Law:
    """R-R, also called cycloid."""
    if lam == 0.5:
        return Law("inclined sine", _integrated([(1.0, FULL, 2.0 * pi)]))
    return Law("inclined sine", _integrated([(lam, HALF, pi / lam), (1.0 - lam, HALF, -pi / (1.0 - lam))]))


def modified_sine(v0: float = 0.0, v1: float = 0.0, lam: float = 0.5) -> Law:
    """R-R, R-G, G-R, G-G with boundary slopes."""
    mean = 1.0 - lam
    # Two equations for both amplitudes: end velocity and way.
    a, b, c = lam, -mean, (v1 - v0) * 0.5 * pi
    d, e, f = lam**2 * _K1, mean**2 * _K1, 1.0 - v0 * lam - v1 * mean
    determinant = a * e - b * d
    ca, ca_star = (c * e - b * f) / determinant, (a * f - c * d) / determinant
    first: list[_Phase] = [(0.25 * lam, RISE, ca)]
    last: list[_Phase] = [(0.25 * mean, FALL, -ca_star)]
    if lam == 0.5 and v0 == v1 == 0.0:
        middle: list[_Phase] = [(0.75, TURN, ca)]
    else:
        middle = [(0.75 * lam, FALL, ca), (0.75 * mean, RISE, -ca_star)]
    return Law("modified sine", _integrated(first + middle + last, v0))


def modified_trapezoid(lam: float = 0.5) -> Law:
    """R-R: modified acceleration trapezoid."""
    phases: list[_Phase] = []
    for length, sign in ((lam, 1.0), (1.0 - lam, -1.0)):
        amplitude = sign / length
        phases += [
            (0.25 * length, RISE, amplitude),
            (0.5 * length, HOLD, amplitude),
            (0.25 * length, FALL, amplitude),
        ]
    return Law("modified acceleration trapezoid", _integrated(_scaled(phases)))


def modified_trapezoid_to_reversal(lam: float = TRAPEZOID_LAMBDA) -> Law:
    """R-U: the deceleration stays until the reversal."""
    mean = 1.0 - lam
    star = lam * (0.5 + 1.0 / pi) / (mean * (0.75 + 0.5 / pi))
    phases = [
        (0.25 * lam, RISE, 1.0),
        (0.5 * lam, HOLD, 1.0),
        (0.25 * lam, FALL, 1.0),
        (0.25 * mean, RISE, -star),
        (0.75 * mean, HOLD, -star),
    ]
    return Law("modified acceleration trapezoid", _integrated(_scaled(phases)))


def harmonic_combination(v0: float = 0.0, lam: float = HARMONIC_LAMBDA) -> Law:
    """R-U, G-U with the slope at the start."""
    mean = 1.0 - lam
    ca = (1.0 - v0 * lam - v0 * (2.0 / pi) * mean) / (lam**2 * _K1 + (4.0 / pi**2) * lam * mean)
    star = (v0 + 2.0 * ca * lam / pi) * 0.5 * pi / mean
    phases = [(0.25 * lam, RISE, ca), (0.75 * lam, FALL, ca), (mean, RISE, -star)]
    return Law("harmonic combination", _integrated(phases, v0))


def double_harmonic() -> Law:
    """R-U; two sines, so that a cam holds it as points."""
    sines = ((-0.5, pi, 0.5 * pi), (0.125, 2.0 * pi, 0.5 * pi))
    return Law("double harmonic", [Part(0.0, 1.0, (0.375,), sines)])


def sine_straight_line(share: float = 0.5, lam: float = 0.5) -> Law:
    """U-U: sine, straight line, sine.

    Args:
        share: That of the sines in the whole, above 0 to 1; 1 is the simple sine.
        lam: Turning point.

    """
    a, b = lam * share, (1.0 - lam) * share
    v = 1.0 / (1.0 - share * (1.0 - 2.0 / pi))
    phases = [(a, FALL, 0.5 * pi * v / a), (1.0 - a - b, HOLD, 0.0), (b, RISE, -0.5 * pi * v / b)]
    return Law("sine-straight-line combination", _integrated(phases))


def polynomial(
    v0: float = 0.0, a0: float = 0.0, v1: float = 0.0, a1: float = 0.0, lam: float | None = None
) -> Law:
    """The polynomial of the fifth order with given velocities and accelerations at both ends; the 3-4-5
    polynomial without.

    Args:
        v0: Slope at the start.
        a0: Second derivative at the start.
        v1: Slope at the end.
        a1: Second derivative at the end.
        lam: Turning point; None: where it falls. With one there are two polynomials of the fourth order
            (CAM-245).

    """
    if lam is not None:
        return _joined_polynomials(v0, a0, v1, a1, lam)
    c3 = 10.0 - 6.0 * v0 - 4.0 * v1 - 0.5 * (3.0 * a0 - a1)
    c4 = -15.0 + 8.0 * v0 + 7.0 * v1 + 0.5 * (3.0 * a0 - 2.0 * a1)
    c5 = 6.0 - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
    return Law("polynomial", [Part(0.0, 1.0, (0.0, v0, 0.5 * a0, c3, c4, c5))])


def cubic_polynomial() -> Law:
    """R-R with steps of the acceleration at the ends."""
    return Law("3rd-order polynomial", [Part(0.0, 1.0, (0.0, 0.0, 3.0, -2.0))])


def polynomial_4567() -> Law:
    """R-R without a step of the jerk at the ends."""
    return Law("4-5-6-7 polynomial", [Part(0.0, 1.0, (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0))])


def _joined_polynomials(v0: float, a0: float, v1: float, a1: float, lam: float) -> Law:
    """Two polynomials of the fourth order that join at `lam` with an acceleration of 0."""

    def row(s: float, order: int) -> list[float]:
        return [
            factorial(k) / factorial(k - order) * s ** (k - order) if k >= order else 0.0 for k in range(5)
        ]

    none = [0.0] * 5
    mean = 1.0 - lam
    # At the start, at the end, value and slope at the joint, acceleration 0 on both sides of it.
    rows = [row(0.0, order) + none for order in range(3)] + [none + row(mean, order) for order in range(3)]
    rows += [row(lam, order) + [-one for one in row(0.0, order)] for order in range(2)]
    rows += [row(lam, 2) + none, none + row(0.0, 2)]
    right = [0.0, v0, a0, 1.0, v1, a1, 0.0, 0.0, 0.0, 0.0]
    solved = [float(one) for one in np.linalg.solve(np.array(rows), np.array(right))]
    return Law("polynomial", [Part(0.0, lam, tuple(solved[:5])), Part(lam, 1.0, tuple(solved[5:]))])
