"""Laws of motion of VDI 2143: closed forms, characteristic values, function values, segments (CAM section
16).
"""

from math import cos, inf, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motion.kernel.cams import (
    LAWS,
    Curve,
    End,
    Interpolation,
    LawError,
    Point,
    interpolate,
    law_between,
    law_elements,
    proposed,
    selectable,
    transition,
)
from motion.kernel.cams import elements as profile
from motion.kernel.cams import laws as law

HARMONIC = 4.0 - 2.0 * sqrt(3.0)
CASES = {
    # identifier of the characteristic values, of the function values, the law, its values
    "straight line": (law.straight_line(), (1, 0, 0, 0, 0), ()),
    "parabola": (law.quadratic_parabola(), (2, 4, 4, inf, 8), (0.02, 0.125, 0.32, 0.5, 0.875, 0.98)),
    "parabola 0.25": (law.quadratic_parabola(0.25), (2, 8, 2.666667, inf, 16), ()),
    "simple sine": (
        law.simple_sine(), (1.570796, 4.934802, 4.934802, 15.503138, 3.875785),
        (0.024472, 0.146447, 0.345492, 0.5, 0.853553, 0.975528),
    ),
    "3rd order": (
        law.cubic_polynomial(), (1.5, 6, 6, 12, 3.464102), (0.028, 0.15625, 0.352, 0.5, 0.84375, 0.972),
    ),
    "3-4-5": (
        law.polynomial(), (1.875, 5.773503, 5.773503, 60, 6.694270),
        (0.00856, 0.103516, 0.31744, 0.5, 0.896484, 0.99144),
    ),
    "4-5-6-7": (
        law.polynomial_4567(), (2.1875, 7.513188, 7.513188, 52.5, 10.750233),
        (0.002728, 0.070557, 0.289792, 0.5, 0.929443, 0.997272),
    ),
    "inclined sine": (
        law.inclined_sine(), (2, 6.283185, 6.283185, 39.478418, 8.162097),
        (0.006451, 0.090845, 0.306451, 0.5, 0.909155, 0.993549),
    ),
    "modified sine": (
        law.modified_sine(), (1.759603, 5.527957, 5.527957, 69.466357, 5.457750),
        (0.010697, 0.117178, 0.327865, 0.5, 0.882822, 0.989303),
    ),
    "modified trapezoid": (
        law.modified_trapezoid(), (2, 4.888124, 4.888124, 61.425974, 8.089980),
        (0.009459, 0.104480, 0.309459, 0.5, 0.895520, 0.990541),
    ),
    "double harmonic": (
        law.double_harmonic(), (2.040524, 5.551652, 9.869604, 42.41372, 9.894850),
        (0.000599, 0.021447, 0.119364, 0.25, 0.728553, 0.951655),
    ),
    "harmonic combination": (
        law.harmonic_combination(), (1.66663, 4.88514, 5.64087, 57.27624, 4.70063),
        (0.008911, 0.100949, 0.288965, 0.447901, 0.833992, 0.972064),
    ),
    "harmonic combination 0.5": (
        law.harmonic_combination(lam=0.5), (1.65985, 5.21457, 5.21457, 65.52817, 4.85647),
        (0.010091, 0.110535, 0.309278, 0.471654, 0.845251, 0.974141),
    ),
    "harmonic combination G-U": (
        law.harmonic_combination(0.5, 0.5), (1.48071, 3.08100, 4.65180, 38.71700, 3.44399),
        (0.055962, 0.190309, 0.382735, 0.528674, 0.861952, 0.976932),
    ),
    "modified trapezoid R-U": (
        law.modified_trapezoid_to_reversal(), (1.91882, 4.56948, 4.33518, 55.94963, 7.25566),
        (0.008650, 0.096665, 0.287473, 0.467104, 0.864526, 0.978324),
    ),
    "modified sine R-G": (
        law.modified_sine(0.0, 1.0), (1.37980, 4.33477, 1.19318, 54.47239, 3.35597),
        (0.008388, 0.091886, 0.257097, 0.392077, 0.724708, 0.897691),
    ),
    "modified sine G-G": (
        law.modified_sine(0.5, 0.5), (1.37980, 2.76398, 2.76398, 34.73318, 2.51377),
        (0.055349, 0.183589, 0.363933, 0.5, 0.816411, 0.944651),
    ),
    "sine-straight line": (
        law.sine_straight_line(0.3), (1.12235, 11.75324, 11.75324, 123.07969, 6.59564),
        (0.053588, 0.219412, 0.387765, 0.5, 0.780588, 0.946412),
    ),
    "quintic R-G": (law.polynomial(v1=1.0), (1.512, 3.94023, 1.94912, 36, 3.62247), ()),
    "quintic R-U": (law.polynomial(a1=-8.0), (1.728, 4.38553, 8, 36, 5.82133), ()),
    "quintic U-U": (law.polynomial(a0=8.0, a1=-8.0), (1.375, 8, 8, 36, 3.29960), ()),
    "quintic G-U": (law.polynomial(v0=1.0, a1=-6.0), (1.25, 0.75, 6, 18, 2.56224), ()),
    "quintic B-B": (law.polynomial(0.5, 2.0, 0.5, -2.0), (1.3125, 2.32379, 2.32379, 9, 2.06110), ()),
    "quintic G-G": (law.polynomial(v0=1.0, v1=1.0), (1, 0, 0, 0, 0), ()),
}  # fmt: skip
PLACES = (0.1, 0.25, 0.4, 0.5, 0.75, 0.9)


@pytest.mark.exhaustive
@pytest.mark.requirement(*(f"CAM-{number}" for number in range(162, 186)))
def test_characteristic_values(subtests):
    """Velocity, acceleration, deceleration, jerk and torque of every law; closed forms to 1e-12 where there
    are some.
    """
    assert len(CASES) == 24
    for name, (one, expected, _) in CASES.items():
        with subtests.test(name):
            assert tuple(one.characteristics) == pytest.approx(expected, rel=1e-6, abs=6e-6)
    closed = {
        "inclined sine": (2.0, 2.0 * pi, 2.0 * pi, 4.0 * pi**2),
        "3-4-5": (1.875, 10.0 / sqrt(3.0), 10.0 / sqrt(3.0), 60.0),
        "modified sine": (
            4 * pi / (4 + pi),
            4 * pi**2 / (4 + pi),
            4 * pi**2 / (4 + pi),
            16 * pi**3 / (4 + pi),
        ),
        "modified trapezoid": (2.0, 8 * pi / (2 + pi), 8 * pi / (2 + pi), 32 * pi**2 / (2 + pi)),
        "simple sine": (pi / 2, pi**2 / 2, pi**2 / 2, pi**3 / 2),
        "4-5-6-7": (35.0 / 16.0, 84.0 * sqrt(5.0) / 25.0, 84.0 * sqrt(5.0) / 25.0, 52.5),
    }
    for name, values in closed.items():
        with subtests.test(f"closed form of {name}"):
            assert CASES[name][0].characteristics[:4] == pytest.approx(values, rel=1e-12)


@pytest.mark.requirement(*(f"CAM-{number}" for number in range(186, 203)))
def test_function_values(subtests):
    """Of every law at six places; of the quintics at the middle."""
    tables = {name: (one, values) for name, (one, _, values) in CASES.items() if values}
    assert len(tables) == 16
    for name, (one, values) in tables.items():
        with subtests.test(name):
            assert [one.evaluate(z)[0] for z in PLACES] == pytest.approx(values, abs=6e-7)
    quintics = {"quintic R-G": 0.34375, "quintic R-U": 0.375, "quintic G-U": 0.5625}
    for name, value in quintics.items():
        with subtests.test(name):
            assert CASES[name][0].evaluate(0.5)[0] == value


def way_of_trapezoid(tu, share):
    """Way of the trapezoid to a reversal for an acceleration of 1, phase by phase."""
    way = velocity = 0.0
    for length, start, end in ((tu / 4, 0.0, 1.0), (tu / 2, 1.0, 1.0), (tu / 4, 1.0, 0.0)):
        if start == end:
            way, velocity = way + velocity * length + length**2 / 2, velocity + length
        else:
            part = 2 / pi - 4 / pi**2 if start == 0.0 else 4 / pi**2
            way, velocity = way + velocity * length + part * length**2, velocity + 2 / pi * length
    length = (1 - tu) / 4
    way += velocity * length - share * (2 / pi - 4 / pi**2) * length**2
    velocity -= share * 2 / pi * length
    return way + velocity * 3 * length - share * (3 * length) ** 2 / 2


def accelerations():
    """Accelerations of laws as functions, piece by piece, from their definitions; with the initial slope."""
    k = 1.0 / (4.0 + pi)
    mt = 8.0 * pi / (2.0 + pi)
    ms = 4.0 * pi**2 * k
    lam = HARMONIC
    k1 = (2 / pi - 4 / pi**2) / 16 + 6 / (16 * pi) + 9 / (4 * pi**2)
    hc = 1.0 / (lam**2 * k1 + 4.0 / pi**2 * lam * (1.0 - lam))
    # Of the trapezoid to a reversal: turning point, and both accelerations from end velocity 0 and way 1.
    tu = 1.0 / (1.0 + sqrt((0.5 + 1.0 / pi) / (0.75 + 0.5 / pi)))
    share = tu * (0.5 + 1.0 / pi) / ((1.0 - tu) * (0.75 + 0.5 / pi))
    ca = 1.0 / way_of_trapezoid(tu, share)
    star = ca * share
    return {
        "modified sine": [
            (0.125, lambda z: ms * sin(4 * pi * z)),
            (0.875, lambda z: ms * sin(4 * pi * z / 3 + pi / 3)),
            (1.0, lambda z: ms * sin(4 * pi * z)),
        ],
        "modified trapezoid": [
            (0.125, lambda z: mt * sin(4 * pi * z)),
            (0.375, lambda _: mt),
            (0.5, lambda z: mt * cos(4 * pi * (z - 0.375))),
            (0.625, lambda z: mt * cos(4 * pi * (z - 0.375))),
            (0.875, lambda _: -mt),
            (1.0, lambda z: -mt * cos(4 * pi * (z - 0.875))),
        ],
        "harmonic combination": [
            (lam / 4, lambda z: hc * sin(2 * pi * z / lam)),
            (lam, lambda z: hc * cos(2 * pi / (3 * lam) * (z - lam / 4))),
            (1.0, lambda z: -hc * lam / (1 - lam) * sin(pi / 2 * (z - lam) / (1 - lam))),
        ],
        "modified trapezoid R-U": [
            (tu / 4, lambda z: ca * sin(2 * pi * z / tu)),
            (3 * tu / 4, lambda _: ca),
            (tu, lambda z: ca * cos(2 * pi / tu * (z - 3 * tu / 4))),
            (tu + (1 - tu) / 4, lambda z: -star * sin(2 * pi * (z - tu) / (1 - tu))),
            (1.0, lambda _: -star),
        ],
        "inclined sine": [(1.0, lambda z: 2 * pi * sin(2 * pi * z))],
        "double harmonic": [(1.0, lambda z: pi**2 / 2 * (cos(pi * z) - cos(2 * pi * z)))],
        "simple sine": [(1.0, lambda z: pi**2 / 2 * cos(pi * z))],
    }


@pytest.mark.requirement("CAM-208")
def test_function_values_are_the_double_integral_of_the_acceleration(subtests):
    """To 1e-12, by numerical integration of independent formulas; derivatives as well."""
    nodes, weights = np.polynomial.legendre.leggauss(30)
    for name, pieces in accelerations().items():
        with subtests.test(name):
            for z in np.linspace(0.0, 1.0, 23):
                slope = way = start = 0.0
                for end, formula in pieces:
                    top = min(end, z)
                    if top > start:
                        half = 0.5 * (top - start)
                        places = [start + half * (1.0 + node) for node in nodes]
                        values = np.array([formula(one) for one in places])
                        slope += half * float(values @ weights)
                        way += half * float((values * (z - np.array(places))) @ weights)
                    start = end
                bend = next(formula for end, formula in pieces if z <= end)(z)
                assert CASES[name][0].evaluate(z) == pytest.approx((way, slope, bend), abs=1e-12)


@pytest.mark.exhaustive
@pytest.mark.requirement("CAM-151", "CAM-216")
@settings(max_examples=80, deadline=None)
@given(
    st.sampled_from(("quadratic_parabola", "modified_sine", "polynomial", "harmonic", "sine_straight_line")),
    st.tuples(*[st.floats(-1.5, 2.5)] * 2),
    st.tuples(*[st.floats(-10.0, 10.0)] * 2),
    st.floats(0.15, 0.85),
)
def test_laws_keep_their_boundary_values(name, slopes, bends, lam):
    """Whatever is admissible; derivatives agree with differences of the function."""
    (v0, v1), (a0, a1) = slopes, bends
    made = {
        "quadratic_parabola": (lambda: law.quadratic_parabola(lam, v0, v1), (v0, v1, None, None)),
        "modified_sine": (lambda: law.modified_sine(v0, v1, lam), (v0, v1, 0.0, 0.0)),
        "polynomial": (lambda: law.polynomial(v0, a0, v1, a1, None), (v0, v1, a0, a1)),
        "harmonic": (lambda: law.harmonic_combination(v0, lam), (v0, 0.0, 0.0, None)),
        "sine_straight_line": (lambda: law.sine_straight_line(0.1 + 0.8 * lam, lam), (0.0, 0.0, None, None)),
    }
    build, (first, last, begins, ends) = made[name]
    one = build()
    check(one, first, last, begins, ends)
    if name == "polynomial":
        check(law.polynomial(v0, a0, v1, a1, lam), v0, v1, a0, a1)


def check(one, first, last, begins, ends):
    size = max(1.0, *(abs(part.derivative(part.start, 2)) for part in one.parts))
    start, end = one.evaluate(0.0), one.evaluate(1.0)
    assert (start[0], end[0]) == pytest.approx((0.0, 1.0), abs=1e-12 * size)
    assert (start[1], end[1]) == pytest.approx((first, last), abs=1e-12 * size)
    if begins is not None:
        assert start[2] == pytest.approx(begins, abs=1e-11 * size)
    if ends is not None:
        assert end[2] == pytest.approx(ends, abs=1e-11 * size)
    for left, right in zip(one.parts, one.parts[1:], strict=False):
        for order in (0, 1):
            joint = left.derivative(left.end, order), right.derivative(right.start, order)
            assert joint[0] == pytest.approx(joint[1], abs=1e-10 * size)
    step = 1e-5
    for part in one.parts:
        z = 0.5 * (part.start + part.end)
        before, at, after = one.evaluate(z - step), one.evaluate(z), one.evaluate(z + step)
        assert at[1] == pytest.approx((after[0] - before[0]) / (2 * step), abs=1e-6 * size)
        assert at[2] == pytest.approx((after[1] - before[1]) / (2 * step), abs=1e-5 * size)
        assert one.third(z) == pytest.approx((after[2] - before[2]) / (2 * step), abs=1e-4 * size * size)


def test_every_law_keeps_the_values_of_its_boundaries(subtests):
    """Those without parameters too, and the continuity that is promised inside."""
    for name, (one, _, _) in CASES.items():
        with subtests.test(name):
            start, end = one.evaluate(0.0), one.evaluate(1.0)
            check(one, start[1], end[1], None, None)
            if "parabola" not in name:
                for left, right in zip(one.parts, one.parts[1:], strict=False):
                    assert left.derivative(left.end, 2) == pytest.approx(
                        right.derivative(right.start, 2), abs=1e-11
                    )
    for name in ("3-4-5", "4-5-6-7", "inclined sine", "modified sine", "modified trapezoid"):
        assert CASES[name][0].evaluate(0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
        assert CASES[name][0].evaluate(1.0) == pytest.approx((1.0, 0.0, 0.0), abs=1e-11)
    assert CASES["4-5-6-7"][0].third(1.0) == pytest.approx(0.0, abs=1e-11)


@pytest.mark.exhaustive
@pytest.mark.requirement("CAM-152")
def test_mirrored_laws_are_point_reflections():
    """Ca and Ca* change places, for every law that goes from one kind of boundary to another."""
    for name in ("U-R", "U-G", "G-R"):
        ends = {"U": {"reversal": True}, "G": {"slope": 0.5}, "R": {}}
        start, end = End(0.0, 0.0, **ends[name[0]]), End(1.0, 1.0, **ends[name[2]])
        turned = End(0.0, 0.0, **ends[name[2]]), End(1.0, 1.0, **ends[name[0]])
        kinds = [one for one in selectable(name[0] + name[2]) if one != "polynomial"]
        assert kinds
        for kind in kinds:
            mirrored, plain = law_between(kind, start, end), law_between(kind, *turned)
            for z in np.linspace(0.0, 1.0, 21):
                assert mirrored.evaluate(z)[0] == pytest.approx(1.0 - plain.evaluate(1.0 - z)[0], abs=1e-12)
            values, others = mirrored.characteristics, plain.characteristics
            assert (values.ca, values.ca_star) == pytest.approx((others.ca_star, others.ca))
            if LAWS[kind].takes_lambda:
                moved, other = law_between(kind, start, end, lam=0.4), law_between(kind, *turned, lam=0.6)
                assert moved.evaluate(0.3)[0] == pytest.approx(1.0 - other.evaluate(0.7)[0], abs=1e-12)


@pytest.mark.requirement("CAM-146", "CAM-147", "CAM-148", "CAM-149")
def test_motion_task_follows_from_the_derivatives():
    """R: both 0; G: a slope; U: an acceleration, given or left to the law; B: both."""
    assert End(0, 0).task == End(0, 0, 0.0, 0.0).task == "R"
    assert End(0, 0, -0.5).task == End(0, 0, 0.5, 0.0).task == "G"
    assert End(0, 0, 0.0, -2.0).task == End(0, 0, reversal=True).task == "U"
    assert End(0, 0, 0.1, 2.0).task == End(0, 0, 0.1, reversal=True).task == "B"


@pytest.mark.requirement(*(f"CAM-{number}" for number in range(153, 160)))
def test_laws_that_can_be_selected(subtests):
    """By the motion tasks at both ends; others are refused with those that are possible."""
    tables = {
        "RR": {"quadratic_parabola", "simple_sine", "polynomial", "inclined_sine", "modified_trapezoid",
               "modified_sine"},
        "RU": {"modified_trapezoid", "harmonic_combination", "double_harmonic", "polynomial"},
        "RG": {"modified_sine", "polynomial"},
        "GG": {"straight_line", "quadratic_parabola", "modified_sine", "polynomial"},
        "UU": {"simple_sine", "sine_straight_line", "polynomial"},
        "GU": {"harmonic_combination", "polynomial"},
        "RB": {"polynomial"}, "GB": {"polynomial"}, "UB": {"polynomial"}, "BB": {"polynomial"},
    }  # fmt: skip
    ends = {"R": {}, "G": {"slope": 0.25}, "U": {"bend": 2.0}, "B": {"slope": 0.25, "bend": 2.0}}
    variants = {"polynomial_3", "polynomial_4567"}
    for task, expected in tables.items():
        for letters in {task, task[::-1]}:
            with subtests.test(letters):
                assert set(selectable(letters)) == expected
                first, last = End(0.0, 0.0, **ends[letters[0]]), End(2.0, 3.0, **ends[letters[1]])
                for name in LAWS:
                    if name in expected or (letters == "RR" and name in variants):
                        assert law_between(name, first, last).evaluate(1.0)[0] == pytest.approx(1.0)
                    else:
                        with pytest.raises(LawError, match=f"not for {letters}"):
                            law_between(name, first, last)


@pytest.mark.exhaustive
@pytest.mark.requirement("CAM-160")
def test_law_with_the_lowest_characteristic_value_is_proposed():
    """Among those that are continuous enough."""
    jerk_free = {target: proposed("RR", target) for target in ("cv", "ca", "cj", "cmdyn")}
    assert jerk_free == {
        "cv": "modified_sine", "ca": "modified_trapezoid", "cj": "inclined_sine", "cmdyn": "modified_sine",
    }  # fmt: skip
    assert [proposed("RR", target, 1) for target in ("cv", "cmdyn", "ca")] == [
        "simple_sine", "simple_sine", "quadratic_parabola",
    ]  # fmt: skip
    assert proposed("RR", "cv", 3) == "polynomial_4567"
    for task in ("RU", "UR", "RG", "GG", "UU", "GU", "BB"):
        assert proposed(task, "ca", 1) in selectable(task)
    with pytest.raises(LawError, match="continuous enough"):
        proposed("BB", "ca", 4)


@pytest.mark.exhaustive
@pytest.mark.requirement("CAM-161")
def test_turning_point_or_greatest_acceleration_can_be_given():
    """One of them; of the parabola Ca = 8 gives 0.25; without any the law has its own."""
    ends = End(0.0, 0.0), End(1.0, 1.0)

    def turning(**given):
        return law_between("quadratic_parabola", *ends, **given).parts[0].end

    assert turning(ca=8.0) == pytest.approx(0.25)
    assert turning(ca_star=8.0) == pytest.approx(0.75)
    assert turning(lam=0.3) == 0.3
    assert turning() == 0.5
    harmonic = law_between("harmonic_combination", End(0, 0), End(1, 1, reversal=True), ca=6.0)
    assert harmonic.characteristics.ca == pytest.approx(6.0)
    for given_ in ({"ca": 8.0, "lam": 0.5}, {"ca": 8.0, "ca_star": 3.0}, {"lam": 0.5, "ca_star": 3.0}):
        with pytest.raises(LawError, match="only one"):
            turning(**given_)
    with pytest.raises(LawError, match="no turning point gives it"):
        turning(ca=0.1)
    for lam in (0.0, 1.0, -0.2):
        with pytest.raises(LawError, match="lambda"):
            turning(lam=lam)
    with pytest.raises(LawError, match="no turning point that can be given"):
        law_between("polynomial_3", *ends, lam=0.4)


@pytest.mark.exhaustive
@pytest.mark.requirement("CAM-243", "CAM-244")
def test_turning_point_moves_along_the_straight_line(subtests):
    """Symmetric laws are stretched on both sides of it; velocity stays, accelerations follow."""
    ends = End(80.0, 58.0), End(200.0, 110.0)
    for name in ("quadratic_parabola", "simple_sine", "inclined_sine", "modified_trapezoid", "modified_sine"):
        for lam in (0.28, 0.7):
            with subtests.test(f"{name} {lam}"):
                plain, moved = law_between(name, *ends), law_between(name, *ends, lam=lam)
                for z in np.linspace(0.0, 1.0, 41):
                    inside = z <= lam
                    length = lam if inside else 1.0 - lam
                    at = (z if inside else 1.0 - z) / (2.0 * length)
                    part = 2.0 * length * plain.evaluate(at)[0]
                    assert moved.evaluate(z)[0] == pytest.approx(part if inside else 1.0 - part, abs=1e-12)
                symmetric, values = plain.characteristics, moved.characteristics
                assert values.cv == pytest.approx(symmetric.cv, rel=1e-9)
                assert values.ca == pytest.approx(symmetric.ca * 0.5 / lam, rel=1e-9)
                assert values.ca_star == pytest.approx(symmetric.ca * 0.5 / (1.0 - lam), rel=1e-9)
    inclined = law_between("inclined_sine", *ends, lam=0.28)
    assert inclined.evaluate(0.14)[0] == pytest.approx(0.050873, abs=1e-6)
    assert inclined.characteristics[:3] == pytest.approx((2.0, 11.219974, 4.363323), abs=1e-6)
    curve = interpolate([], transition("inclined_sine", *ends, lam=0.28).segments)
    y, _, bend = curve.evaluate(113.6)
    assert y == pytest.approx(72.56, abs=1e-9)
    assert bend == pytest.approx(0.0, abs=1e-9)


@pytest.mark.requirement("CAM-245")
def test_polynomial_with_a_turning_point_is_two_polynomials():
    """They keep the values of both ends and have their turning point where it was demanded."""
    ends = End(0.0, 0.0, 0.1, 0.02), End(50.0, 20.0, 0.3, -0.01)
    made = transition("polynomial", *ends, lam=0.3)
    assert (len(made.points), len(made.segments)) == (0, 2)
    curve = interpolate([], made.segments)
    assert curve.evaluate(0.0) == pytest.approx((0.0, 0.1, 0.02), abs=1e-12)
    assert curve.evaluate(50.0) == pytest.approx((20.0, 0.3, -0.01), abs=1e-12)
    assert curve.evaluate(15.0)[2] == pytest.approx(0.0, abs=1e-12)
    assert curve.evaluate(15.0 - 1e-9)[:2] == pytest.approx(curve.evaluate(15.0)[:2], abs=1e-8)
    assert all(one.a[5] == one.a[6] == 0.0 for one in made.segments)
    third = [curve.third(15.0 - 1e-9), curve.third(15.0)]
    assert third[0] != pytest.approx(third[1])


@pytest.mark.requirement("CAM-150", "CAM-246")
def test_derivatives_are_real_ones():
    """Per unit of the leading value; between equal following values the polynomial is not normalised."""
    start, end = End(10.0, 5.0, 0.2, 0.01), End(60.0, 5.0, -0.3, 0.02)
    curve = interpolate([], transition("polynomial", start, end).segments)
    assert curve.evaluate(10.0) == pytest.approx((5.0, 0.2, 0.01), abs=1e-12)
    assert curve.evaluate(60.0) == pytest.approx((5.0, -0.3, 0.02), abs=1e-12)
    with pytest.raises(LawError, match="use polynomial"):
        transition("modified_sine", End(10.0, 5.0, 0.2), End(60.0, 5.0, 0.2))
    rising = End(60.0, 25.0, -0.3, 0.02)
    curve = interpolate([], transition("polynomial", start, rising).segments)
    assert curve.evaluate(10.0) == pytest.approx((5.0, 0.2, 0.01), abs=1e-12)
    assert curve.evaluate(60.0) == pytest.approx((25.0, -0.3, 0.02), abs=1e-12)
    curve = interpolate([], transition("modified_sine", End(10.0, 5.0, 0.2), End(60.0, 25.0)).segments)
    assert curve.evaluate(10.0) == pytest.approx((5.0, 0.2, 0.0), abs=1e-12)


@pytest.mark.requirement("CAM-203")
def test_values_over_time_of_a_transition():
    """From (100, 10) to (200, 60) with the 3-4-5 polynomial at 200 per second."""
    curve = interpolate([], transition("polynomial", End(100.0, 10.0), End(200.0, 60.0)).segments)
    assert curve.evaluate(150.0)[0] == pytest.approx(35.0)
    grid = np.linspace(100.0, 200.0, 20_001)
    values = np.array([curve.evaluate(float(x)) for x in grid])
    assert max(values[:, 1]) * 200.0 == pytest.approx(187.5)
    assert max(values[:, 2]) * 200.0**2 == pytest.approx(1154.70, abs=0.01)
    assert abs(curve.third(100.0)) * 200.0**3 == pytest.approx(24_000.0)


@pytest.mark.exhaustive
def test_every_law_becomes_the_same_curve_in_a_cam(subtests):
    """Within 1e-9 of the rise where it is made of segments; the seventh order and the double harmonic are
    approximated.
    """
    start, end = Point(-20.0, 300.0), Point(140.0, -60.0)
    for name, (one, _, _) in CASES.items():
        with subtests.test(name):
            made = law_elements(one, start, end)
            curve: Curve = interpolate(*made, Interpolation.CUBIC)
            allowed = {"4-5-6-7": 2e-3, "double harmonic": 1e-3}.get(name, 1e-9) * 360.0
            for z in np.linspace(0.0, 1.0, 201):
                expected = one.evaluate(z)
                y, slope, _ = curve.evaluate(start.x + 160.0 * z)
                assert y == pytest.approx(300.0 - 360.0 * expected[0], abs=allowed)
                if allowed < 1e-5:
                    assert slope == pytest.approx(-360.0 / 160.0 * expected[1], abs=1e-9)
    two = law_elements(law.polynomial_4567(), start, end).segments
    curve = interpolate([], two)
    for x, place in ((-20.0, 0.0), (140.0, 1.0)):
        assert curve.evaluate(x)[1:] == pytest.approx((0.0, 0.0), abs=1e-12)
        assert curve.third(x) == pytest.approx(0.0, abs=1e-12), place


@pytest.mark.requirement(
    "CAM-027", "CAM-028", "CAM-029", "CAM-030", "CAM-031", "CAM-032", "CAM-033", "CAM-034", "CAM-035"
)
def test_elements_occupy_points_and_segments(subtests):
    """As many as the editor of the engineering system shows."""
    first, last = Point(0.0, 0.0), Point(90.0, 40.0)
    group = [Point(float(x), sin(x)) for x in range(10)]
    made = {
        "point group as points": (profile.point_group(group), 32, 0),
        "point group, 50": (profile.point_group(group, approximation=50), 50, 0),
        "point group as segments": (profile.point_group(group, segments=True), 0, 31),
        "line": (profile.line(first, last), 0, 1),
        "sine": (profile.sine(0.0, 90.0, offset=1.0, amplitude=2.0, rate=0.1, phase=0.2), 0, 1),
        "polynomial of the sixth order": (profile.polynomial(0.0, 2.0, [1.0] * 7), 0, 1),
        "polynomial of the seventh order": (profile.polynomial(0.0, 2.0, [1.0] * 8), 0, 2),
        "inverse sine": (profile.inverse_sine(first, last), 32, 0),
        "inverse sine after a transition": (
            profile.inverse_sine(first, last, after_transition=True), 31, 0,
        ),
    }  # fmt: skip
    ends = {"R": {}, "G": {"slope": 0.1}, "U": {"reversal": True}}
    numbers = [
        ("simple_sine", "RR", None, 1), ("simple_sine", "RR", 0.4, 2), ("inclined_sine", "RR", None, 1),
        ("inclined_sine", "RR", 0.4, 2), ("polynomial", "RR", None, 1), ("polynomial", "RR", 0.4, 2),
        ("quadratic_parabola", "RR", None, 2), ("modified_trapezoid", "RU", None, 5),
        ("modified_trapezoid", "UR", None, 5), ("modified_trapezoid", "RR", None, 6),
        ("modified_sine", "RR", None, 3), ("modified_sine", "GG", None, 4), ("modified_sine", "GR", None, 4),
        ("modified_sine", "RG", None, 4), ("sine_straight_line", "UU", None, 3),
        ("harmonic_combination", "RU", None, 3), ("harmonic_combination", "GU", None, 3),
        ("polynomial_4567", "RR", None, 2),
    ]  # fmt: skip
    for name, task, lam, segments in numbers:
        start, end = End(0.0, 0.0, **ends[task[0]]), End(90.0, 40.0, **ends[task[1]])
        made[f"{name} {task} {lam}"] = (transition(name, start, end, lam=lam), 0, segments)
    reversal = End(0.0, 0.0), End(90.0, 40.0, reversal=True)
    made["double harmonic"] = (transition("double_harmonic", *reversal), 32, 0)
    made["double harmonic, 80"] = (transition("double_harmonic", *reversal, approximation=80), 80, 0)
    for name, (elements, points, segments) in made.items():
        with subtests.test(name):
            assert (len(elements.points), len(elements.segments)) == (points, segments)
            curve = interpolate(*elements)
            assert curve.period > 0.0
    grid = np.linspace(0.0, 2.0, 21)
    for order in (6, 7):
        curve = interpolate([], profile.polynomial(0.0, 2.0, [1.0] * (order + 1)).segments)
        expected = [sum(x**power for power in range(order + 1)) for x in grid]
        found = [curve.evaluate(float(x))[0] for x in grid]
        assert found == pytest.approx(expected, rel=1e-12 if order == 6 else 2e-2, abs=0.3 * (order == 7))
    curve = interpolate(*profile.inverse_sine(Point(0.0, -1.0), Point(2.0, 1.0), first=-0.5, last=0.5))
    assert curve.evaluate(1.0)[0] == pytest.approx(0.0, abs=1e-9)


def test_wrong_laws_are_refused():
    """With what is allowed."""
    start, end = End(0.0, 0.0), End(1.0, 1.0)
    with pytest.raises(LawError, match="there are straight_line"):
        law_between("cycloid", start, end)
    with pytest.raises(LawError, match="not behind its start"):
        law_between("polynomial", end, start)
    with pytest.raises(LawError, match="share is 0"):
        law_between("sine_straight_line", End(0, 0, reversal=True), End(1, 1, reversal=True), share=0.0)
    with pytest.raises(LawError, match="2 or more points"):
        transition("double_harmonic", start, End(1.0, 1.0, reversal=True), approximation=1)
    with pytest.raises(ValueError, match="up to 7"):
        profile.polynomial(0.0, 1.0, [1.0] * 9)
