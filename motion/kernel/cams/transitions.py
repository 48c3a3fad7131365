"""Which law leads from one boundary to another, and what becomes of it in a cam (CAM sections 12.3 and
16.1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from typing import Final, NamedTuple

import numpy as np

from motion.kernel.cams import laws
from motion.kernel.cams.laws import Law, Part
from motion.kernel.cams.pieces import Point, Segment

APPROXIMATION: Final = 32
"""Points that a law gets that cannot be segments (CAM-030)."""
_STEPS: Final = 60


class LawError(ValueError):
    """A law does not fit its boundaries or parameters; the message says what is allowed."""


class Elements(NamedTuple):
    """Points and segments that a cam needs for something."""

    points: list[Point]
    segments: list[Segment]


@dataclass(frozen=True, slots=True)
class End:
    """What holds at one end of a transition; derivatives are real ones, per unit of the leading value
    (CAM-246).
    """

    x: float
    """Leading value."""
    y: float
    """Following value."""
    slope: float = 0.0
    """First derivative."""
    bend: float | None = None
    """Second derivative; None: 0, or what the law brings along at a reversal."""
    reversal: bool = False
    """It is a turning point, at which the law brings its own second derivative along."""

    @property
    def task(self) -> str:
        """R dwell, G constant velocity, U reversal, B motion (CAM-146 to CAM-149)."""
        bent = self.reversal or self.bend not in (None, 0.0)
        if self.slope == 0.0:
            return "U" if bent else "R"
        return "B" if bent else "G"


class _Normal(NamedTuple):
    """Normalised values at both ends, and the parameters of a law."""

    v0: float
    a0: float
    v1: float
    a1: float
    lam: float | None
    share: float


def _half(lam: float | None) -> float:
    return 0.5 if lam is None else lam


def _reversal(
    to_reversal: Callable[[float, float | None], Law],
) -> Callable[[_Normal, str], Law]:
    """Return a builder for both directions of a law to a reversal."""

    def build(given: _Normal, task: str) -> Law:
        if task.endswith("U"):
            return to_reversal(given.v0, given.lam)
        lam = None if given.lam is None else 1.0 - given.lam
        return to_reversal(given.v1, lam).mirrored()

    return build


def _trapezoid(given: _Normal, task: str) -> Law:
    if task == "RR":
        return laws.modified_trapezoid(_half(given.lam))

    def to_reversal(v0: float, lam: float | None) -> Law:
        del v0  # from rest
        return laws.modified_trapezoid_to_reversal(laws.TRAPEZOID_LAMBDA if lam is None else lam)

    return _reversal(to_reversal)(given, task)


def _harmonic(v0: float, lam: float | None) -> Law:
    return laws.harmonic_combination(v0, laws.HARMONIC_LAMBDA if lam is None else lam)


@dataclass(frozen=True, slots=True)
class LawKind:
    """A law that can be selected."""

    name: str
    """As in the bench file."""
    tasks: tuple[str, ...]
    """Transitions that it is for, by their letters; empty: for all."""
    build: Callable[[_Normal, str], Law]
    continuity: int
    """What is continuous at a dwell: 0 position, 1 velocity, 2 acceleration, 3 jerk."""
    takes_lambda: bool = True
    """Whether its turning point can be given."""


_REVERSALS: Final = ("RU", "UR")
LAWS: Final = {
    one.name: one
    for one in (
        LawKind("straight_line", ("GG",), lambda _, __: laws.straight_line(), 0, takes_lambda=False),
        LawKind("quadratic_parabola", ("RR", "GG"),
                lambda n, _: laws.quadratic_parabola(_half(n.lam), n.v0, n.v1), 1),
        LawKind("simple_sine", ("RR", "UU"), lambda n, _: laws.simple_sine(_half(n.lam)), 1),
        LawKind("polynomial", (), lambda n, _: laws.polynomial(n.v0, n.a0, n.v1, n.a1, n.lam), 2),
        LawKind("polynomial_3", ("RR",), lambda _, __: laws.cubic_polynomial(), 1, takes_lambda=False),
        LawKind("polynomial_4567", ("RR",), lambda _, __: laws.polynomial_4567(), 3, takes_lambda=False),
        LawKind("inclined_sine", ("RR",), lambda n, _: laws.inclined_sine(_half(n.lam)), 2),
        LawKind("modified_sine", ("RR", "RG", "GR", "GG"),
                lambda n, _: laws.modified_sine(n.v0, n.v1, _half(n.lam)), 2),
        LawKind("modified_trapezoid", ("RR", *_REVERSALS), _trapezoid, 2),
        LawKind("harmonic_combination", (*_REVERSALS, "GU", "UG"), _reversal(_harmonic), 2),
        LawKind("double_harmonic", _REVERSALS, _reversal(lambda _, __: laws.double_harmonic()), 3,
                takes_lambda=False),
        LawKind("sine_straight_line", ("UU",),
                lambda n, _: laws.sine_straight_line(n.share, _half(n.lam)), 2),
    )
}  # fmt: skip
"""All laws by name."""

_VARIANTS: Final = ("polynomial_3", "polynomial_4567")
"""Other orders of the polynomial, for a dwell at both ends."""


def selectable(task: str) -> tuple[str, ...]:
    """Return the laws for a transition, by the letters of its ends (CAM-153 to CAM-159)."""
    if "B" in task:
        return ("polynomial",)
    return tuple(
        name
        for name, kind in LAWS.items()
        if name not in _VARIANTS and (not kind.tasks or task in kind.tasks)
    )


def proposed(task: str, target: str = "", continuity: int = 2) -> str:
    """Return the law with the lowest characteristic value among those that can be selected (CAM-160).

    Args:
        task: Letters of both ends: `RR`, `RG`, ...
        target: `cv`, `ca`, `cj`, `cmdyn`; empty: the first law that is continuous enough.
        continuity: What has to be continuous at the ends: 0 position, 1 velocity, 2 acceleration, 3 jerk.

    Raises:
        LawError: No law is continuous enough.

    """
    names = [name for name in selectable(task) if LAWS[name].continuity >= continuity]
    if task == "RR" and continuity >= 3:
        names = ["polynomial_4567"]
    if not names:
        raise LawError(f"no law for {task} is continuous enough")
    if not target:
        return names[0]
    given = _Normal(*_standard(task), None, 0.5)

    def value(name: str) -> float:
        found: float = getattr(LAWS[name].build(given, task).characteristics, target)
        return found

    return min(names, key=value)


def _standard(task: str) -> tuple[float, float, float, float]:
    """Return normalised values for a comparison of laws: slopes of 0.5, accelerations of 6 at a reversal."""
    slopes = [0.5 if one in "GB" else 0.0 for one in task]
    bends = [6.0 if one in "UB" else 0.0 for one in task]
    return slopes[0], bends[0], slopes[1], -bends[1]


def law_between(
    name: str,
    start: End,
    end: End,
    *,
    lam: float | None = None,
    ca: float | None = None,
    ca_star: float | None = None,
    share: float = 0.5,
) -> Law:
    """Return the normalised law from one end to the other.

    Args:
        name: One of `LAWS`.
        start: Its first end.
        end: Its last end, at another following value.
        lam: Turning point, between 0 and 1; at most one of this and the next two is given (CAM-161).
        ca: Greatest normalised acceleration.
        ca_star: Greatest normalised deceleration.
        share: Of the sines in the sine-straight-line combination, above 0 to 1.

    Raises:
        LawError: There is no such law, it does not fit the ends, or a parameter is not allowed.

    """
    kind = LAWS.get(name)
    if kind is None:
        raise LawError(f"there is no law {name!r}; there are {', '.join(LAWS)}")
    dx, dy = end.x - start.x, end.y - start.y
    if dx <= 0.0:
        raise LawError(f"it ends at {end.x:g}, not behind its start at {start.x:g}")
    task = start.task + end.task
    if kind.tasks and task not in kind.tasks:
        others = ", ".join(selectable(task))
        raise LawError(f"{name} is for {', '.join(kind.tasks)}, not for {task}; for that: {others}")
    if dy == 0.0:
        raise LawError("start and end have the same following value: use polynomial (CAM-150)")
    if not 0.0 < share <= 1.0:
        raise LawError(f"share is {share:g}; allowed: above 0 to 1")
    if sum(one is not None for one in (lam, ca, ca_star)) > 1:
        raise LawError("only one of lambda, ca and ca_star can be given (CAM-161)")
    if not kind.takes_lambda and not (lam is ca is ca_star is None):
        raise LawError(f"{name} has no turning point that can be given")
    if lam is not None and not 0.0 < lam < 1.0:
        raise LawError(f"lambda is {lam:g}; allowed: above 0 and below 1")
    values = (
        start.slope * dx / dy,
        (start.bend or 0.0) * dx * dx / dy,
        end.slope * dx / dy,
        (end.bend or 0.0) * dx * dx / dy,
    )

    def build(turning: float | None) -> Law:
        return kind.build(_Normal(*values, turning, share), task)

    if ca is None and ca_star is None:
        return build(lam)
    return _with_acceleration(build, ca, ca_star)


def _with_acceleration(build: Callable[[float | None], Law], ca: float | None, ca_star: float | None) -> Law:
    """Return the law whose acceleration or deceleration has a greatest value, by its turning point."""

    def excess(lam: float) -> float:
        law = build(lam)
        if ca is not None:
            return law.greatest_acceleration - ca
        assert ca_star is not None  # one of them is given
        return ca_star - law.greatest_deceleration

    low, high = 1e-3, 1.0 - 1e-3
    if excess(low) * excess(high) > 0.0:
        wanted = f"ca = {ca:g}" if ca is not None else f"ca_star = {ca_star:g}"
        raise LawError(f"{wanted}: no turning point gives it")
    rising = excess(low) < 0.0
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        if (excess(middle) < 0.0) is rising:
            low = middle
        else:
            high = middle
    return build(0.5 * (low + high))


# -- elements of a cam


def law_elements(law: Law, start: Point, end: Point, *, approximation: int = APPROXIMATION) -> Elements:
    """Return the segments of a law between two points; points where it has more than a segment can hold
    (CAM-030).

    Args:
        law: The law.
        start: Where it begins.
        end: Where it ends.
        approximation: Number of points, both ends included.

    """
    dx, dy = end.x - start.x, end.y - start.y
    if any(len(part.sines) > 1 for part in law.parts):
        step = 1.0 / (approximation - 1)
        places = [number * step for number in range(approximation - 1)]
        found = [Point(start.x + dx * z, start.y + dy * law.evaluate(z)[0]) for z in places]
        return Elements([*found, end], [])
    parts: list[Part] = []
    for part in law.parts:
        parts += _halves(part) if len(part.coefficients) > 7 else (part,)
    borders = [start.x + dx * part.start for part in parts] + [end.x]
    segments = []
    for number, part in enumerate(parts):
        scaled = [dy * value / dx**power for power, value in enumerate(part.coefficients)]
        scaled += [0.0] * (7 - len(scaled))
        scaled[0] += start.y
        amplitude, rate, phase = part.sines[0] if part.sines else (0.0, 0.0, 0.0)
        segments.append(
            Segment(
                borders[number],
                borders[number + 1],
                (scaled[0], scaled[1], scaled[2], scaled[3], scaled[4], scaled[5], scaled[6]),
                dy * amplitude,
                rate / dx,
                phase,
            )
        )
    return Elements([], segments)


def _halves(part: Part) -> tuple[Part, Part]:
    """Return two polynomials of the sixth order for one of the seventh: with its three derivatives at the
    ends, and its value and two derivatives in the middle (CAM-029).
    """
    length = part.end - part.start
    half = 0.5 * length
    middle = part.start + half

    def taylor(z: float, orders: int) -> list[float]:
        return [part.derivative(z, order) / factorial(order) for order in range(orders)]

    def completed(known: list[float], wanted: list[float]) -> tuple[float, ...]:
        """Return the polynomial with known lower coefficients whose derivatives at `half` are wanted."""
        count = len(known)
        rows = [
            [
                factorial(k) / factorial(k - order) * half ** (k - order) if k >= order else 0.0
                for k in range(7)
            ]
            for order in range(len(wanted))
        ]
        right = [
            value * factorial(order) - sum(rows[order][k] * known[k] for k in range(count))
            for order, value in enumerate(wanted)
        ]
        solved = np.linalg.solve(np.array([row[count:] for row in rows]), np.array(right))
        return (*known, *(float(one) for one in solved))

    first = completed(taylor(part.start, 4), taylor(middle, 3))
    second = completed(taylor(middle, 3), taylor(part.end, 4))
    return Part(part.start, middle, first), Part(middle, part.end, second)


def transition(
    name: str,
    start: End,
    end: End,
    *,
    lam: float | None = None,
    ca: float | None = None,
    ca_star: float | None = None,
    share: float = 0.5,
    approximation: int = APPROXIMATION,
) -> Elements:
    """Return what a cam needs for a law between two ends; the arguments are those of `law_between`.

    Between two equal following values only a polynomial can be meant: that of the fifth order (CAM-150).

    Raises:
        LawError: As `law_between`; or there are less than two points for an approximation.

    """
    if approximation < 2:
        raise LawError(f"approximation is {approximation}; allowed: 2 or more points")
    if name == "polynomial" and start.y == end.y and end.x > start.x and lam is ca is ca_star is None:
        return Elements([], [quintic(start, end)])
    law = law_between(name, start, end, lam=lam, ca=ca, ca_star=ca_star, share=share)
    return law_elements(law, Point(start.x, start.y), Point(end.x, end.y), approximation=approximation)


def quintic(start: End, end: End) -> Segment:
    """Return the polynomial of the fifth order with value and two derivatives at both ends."""
    dx = end.x - start.x
    v0, v1 = start.slope * dx, end.slope * dx
    a0, a1 = (start.bend or 0.0) * dx * dx, (end.bend or 0.0) * dx * dx
    dy = end.y - start.y
    c3 = 10.0 * dy - 6.0 * v0 - 4.0 * v1 - 0.5 * (3.0 * a0 - a1)
    c4 = -15.0 * dy + 8.0 * v0 + 7.0 * v1 + 0.5 * (3.0 * a0 - 2.0 * a1)
    c5 = 6.0 * dy - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
    c = (c3 / dx**3, c4 / dx**4, c5 / dx**5)
    return Segment(start.x, end.x, (start.y, start.slope, 0.5 * (start.bend or 0.0), *c, 0.0))
