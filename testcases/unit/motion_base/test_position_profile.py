"""Point-to-point profiles: exact end, limits, and the special start states."""

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fieldbus.errors import ConfigurationError
from motion.setpoint import plan_position, plan_velocity, stop_distance

pytestmark = pytest.mark.exhaustive

LIMITS = st.floats(1e-1, 1e5)
JERKS = st.floats(1.0, 1e7)
POSITIONS = st.floats(-1e4, 1e4).map(lambda value: round(value, 9))


@st.composite
def plans(draw, *, jerks=JERKS):
    """Return start state, target and limits of a motion, often with special values."""
    position = draw(st.one_of(st.just(0.0), POSITIONS))
    target = draw(st.one_of(st.just(position), st.just(0.0), POSITIONS))
    velocity = round(draw(st.one_of(st.just(0.0), st.floats(-1e3, 1e3))), 9)
    present = round(draw(st.one_of(st.just(0.0), st.floats(-1e4, 1e4))), 9)
    limits = {
        "max_velocity": draw(st.floats(1e-1, 2e3)),
        "acceleration": draw(LIMITS),
        "deceleration": draw(LIMITS),
        "jerk": draw(jerks),
    }
    return (position, velocity, present, target), limits


def positive_decade(low, high):
    """Return numbers spread evenly over the decades."""
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


WIDE = positive_decade(-9, 9)
SIGNED = st.one_of(st.just(0.0), WIDE, WIDE.map(lambda value: -value))


class TestExamples:
    """Motions that can be calculated by hand."""

    def test_trapezoid(self):
        """100 mm with 100 mm/s, 1000 and 500 mm/s2 without jerk limit: 0.1 s up, 0.85 s constant, 0.2 s
        down.
        """
        profile = plan_position(20, 0, 0, 120, max_velocity=100, acceleration=1000, deceleration=500, jerk=0)

        assert [phase.duration for phase in profile.phases] == [
            pytest.approx(0.1),
            pytest.approx(0.85),
            pytest.approx(0.2),
        ]
        assert profile.sample(profile.duration) == (100, 0, 0)

    def test_triangle(self):
        """10 mm with equal 1000 mm/s2 and no velocity limit in the way: peak 100 mm/s, 0.2 s."""
        profile = plan_position(0, 0, 0, -10, max_velocity=1e3, acceleration=1000, deceleration=1000, jerk=0)

        assert profile.duration == pytest.approx(0.2)
        assert profile.sample(0.1)[:2] == (pytest.approx(-5), pytest.approx(-100))

    def test_seven_phases(self):
        """100 mm with 100 mm/s, 1000 mm/s2, 10000 mm/s3: 2 x 0.2 s ramps with 100 ms jerk each, 0.8 s
        constant.
        """
        profile = plan_position(
            0, 0, 0, 100, max_velocity=100, acceleration=1000, deceleration=1000, jerk=10_000
        )

        assert profile.duration == pytest.approx(1.2)
        assert profile.sample(0.6) == (pytest.approx(50), 100, 0)
        assert [round(phase.duration, 9) for phase in profile.phases] == [0.1, 0.1, 0.8, 0.1, 0.1]

    def test_four_jerk_phases(self):
        """A short way is four equal phases of jerk: 4 (s / 2j)^(1/3) s."""
        profile = plan_position(0, 0, 0, 2, max_velocity=1e3, acceleration=1e5, deceleration=1e5, jerk=1000)

        assert profile.duration == pytest.approx(4 * (2 / 2000) ** (1 / 3))
        assert profile.sample(profile.duration / 2)[0] == pytest.approx(1)

    def test_at_the_target(self):
        """Without a way and at rest there is nothing to do, whatever the velocity."""
        profile = plan_position(5, 0, 0, 5, max_velocity=0, acceleration=1, deceleration=1, jerk=1)

        assert profile.phases == ()
        assert profile.duration == 0

    def test_start_faster_than_the_limit(self):
        """A start velocity above the limit is reduced with the deceleration; the target is reached all the
        same.
        """
        profile = plan_position(
            0, 300, 0, 500, max_velocity=100, acceleration=1, deceleration=1000, jerk=10_000
        )

        assert profile.phases[0].jerk == -10_000
        assert profile.sample(1.0)[1:] == (100, 0)
        assert profile.sample(profile.duration) == (500, 0, 0)

    @pytest.mark.parametrize("jerk", [0, 10_000])
    def test_too_fast_to_stop(self, jerk):
        """An axis that cannot stop before the target passes it, and comes back to it."""
        profile = plan_position(
            0, 100, 0, 2, max_velocity=100, acceleration=500, deceleration=1000, jerk=jerk
        )

        farthest = max(profile.sample(profile.duration * k / 1000)[0] for k in range(1001))
        # With a jerk limit the deceleration does not fade out at the turn, which makes it shorter than a
        # stop.
        stop = stop_distance(100, 0, 1000, jerk)
        assert farthest == pytest.approx(stop, rel=1e-3) if jerk == 0 else 5 < farthest < stop
        assert profile.sample(profile.duration) == (2, 0, 0)

    def test_start_away_from_the_target(self):
        """An axis that moves away stops first and turns without a pause at velocity zero."""
        profile = plan_position(
            0, -100, 0, 50, max_velocity=200, acceleration=800, deceleration=1000, jerk=10_000
        )

        turn = next(phase for phase in profile.phases[1:] if phase.velocity == 0)
        assert turn.acceleration == pytest.approx(800)
        assert min(profile.sample(0.001 * k)[0] for k in range(400)) < 0
        assert profile.sample(profile.duration) == (50, 0, 0)

    def test_braking_is_relaxed(self):
        """A present deceleration that would stop short of the target is relaxed just long enough."""
        limits = {"acceleration": 1000, "deceleration": 1000, "jerk": 10_000}
        least = stop_distance(100, -800, 1000, 10_000)

        profile = plan_position(0, 100, -800, least + 0.4, max_velocity=100, **limits)

        assert [math.copysign(1, phase.jerk) for phase in profile.phases if phase.jerk] == [1, -1, 1]
        assert max(phase.acceleration for phase in profile.phases) < 0
        assert profile.sample(profile.duration) == (least + 0.4, 0, 0)

    def test_replanning_on_the_way_changes_nothing(self):
        """A plan made again in the middle of the same motion takes the rest of the time, in every phase."""
        limits = {"max_velocity": 100, "acceleration": 700, "deceleration": 900, "jerk": 10_000}
        profile = plan_position(0, 0, 0, 60, **limits)

        for k in range(100):
            time = profile.duration * k / 100
            way, v, a = profile.sample(time)
            rest = plan_position(way, v, a, 60, **limits)
            assert time + rest.duration == pytest.approx(profile.duration, abs=1e-4)


class TestAlways:
    """What holds for every start state, target and limit."""

    @given(plans())
    @pytest.mark.requirement("STP-114", "STP-116")
    def test_continuous_and_exact(self, check, plan):
        """Way, velocity and acceleration have no step; the end is exactly the target at rest."""
        (position, velocity, present, target), limits = plan

        profile = plan_position(position, velocity, present, target, **limits)

        check.continuous(profile, velocity=velocity, acceleration=present, position=position)
        assert profile.sample(profile.duration) == (target - position, 0.0, 0.0)
        assert profile.sample(profile.duration + 1.0) == (target - position, 0.0, 0.0)

    @given(plans(jerks=st.just(0.0)))
    @pytest.mark.requirement("STP-114", "STP-115")
    def test_trapezoid(self, check, plan):
        """Without a jerk limit way and velocity have no step, accelerations are those of the limits, the end
        is exact.
        """
        (position, velocity, present, target), limits = plan

        profile = plan_position(position, velocity, present, target, **limits)

        check.continuous(profile, velocity=velocity, acceleration=None, position=position)
        for phase in profile.phases:
            assert abs(phase.acceleration) in (0.0, limits["acceleration"], limits["deceleration"])
        assert profile.sample(profile.duration) == (target - position, 0.0, 0.0)

    @given(plans(jerks=st.one_of(st.just(0.0), JERKS)))
    @pytest.mark.requirement("STP-116")
    def test_limits(self, check, plan):
        """Velocity, acceleration and deceleration keep their limits; a start beyond them returns the shortest
        way.
        """
        state, limits = plan

        check.within_limits(plan_position(*state, **limits), limits, top=limits["max_velocity"])

    @given(plans(jerks=st.one_of(st.just(0.0), JERKS)))
    def test_mirror(self, plan):
        """Mirrored states and targets give the mirrored motion."""
        state, limits = plan

        profile = plan_position(*state, **limits)
        mirrored = plan_position(*(-value for value in state), **limits)

        assert mirrored.duration == profile.duration
        assert mirrored.distance == -profile.distance

    @given(plans(jerks=st.one_of(st.just(0.0), JERKS)))
    def test_no_faster_than_stopping(self, plan):
        """No motion ends before the axis could stand still."""
        (position, velocity, present, target), limits = plan
        stop = {name: limits[name] for name in ("acceleration", "deceleration", "jerk")}

        profile = plan_position(position, velocity, present, target, **limits)

        fastest = plan_velocity(velocity, present, 0.0, **stop).duration
        assert profile.duration >= fastest * (1 - 1e-9)

    @given(
        st.tuples(SIGNED, SIGNED, SIGNED, SIGNED),
        st.fixed_dictionaries(
            {
                "max_velocity": WIDE,
                "acceleration": WIDE,
                "deceleration": WIDE,
                "jerk": st.one_of(st.just(0.0), WIDE),
            }
        ),
    )
    @example(  # one step of the peak velocity is worth millimetres
        (0.0, 868.6966800322824, -502442.1131325237, -4.5588505937874815e-07),
        {
            "max_velocity": 2566389.0714347437,
            "acceleration": 2.0860763560308104e-09,
            "deceleration": 1138829.1610578063,
            "jerk": 111563153.46586119,
        },
    )
    @example(
        (0.16507481103328583, -42.58825082211953, 0.0, 0.0),
        {
            "max_velocity": 15416.697086260354,
            "acceleration": 2.229336013642626e-09,
            "deceleration": 12929551.01991973,
            "jerk": 0.0,
        },
    )
    @settings(max_examples=300)
    def test_eighteen_decades(self, check, state, limits):
        """Values from 1e-9 to 1e9 in any mixture give finite profiles that end at the target within
        rounding.
        """
        position, _, _, target = state

        profile = plan_position(*state, **limits)

        assert math.isfinite(profile.duration)
        size = abs(position) + abs(target)
        for phase in profile.phases:
            assert all(math.isfinite(value) for value in phase)
            assert phase.duration >= 0
            size = max(size, *(abs(value) for value in (phase.position, phase.velocity * phase.duration)))
            size = max(size, abs(phase.acceleration) * phase.duration**2)
        if profile.phases:
            assert check.end_of(profile.phases[-1])[0] == pytest.approx(
                target - position, abs=1e-12 * size + 1e-29
            )


@given(
    st.tuples(*[st.floats(-1e-20, 1e-20, allow_subnormal=True)] * 4),
    st.tuples(*[st.sampled_from([1e-9, 1.0, 1e9])] * 4),
)
def test_vanishing_values(state, limits):
    """Values next to zero, down to the smallest numbers there are, give finite profiles that end at the
    target.
    """
    top, acceleration, deceleration, jerk = limits

    profile = plan_position(
        *state, max_velocity=top, acceleration=acceleration, deceleration=deceleration, jerk=jerk
    )

    assert math.isfinite(profile.duration)
    assert profile.sample(profile.duration) == (state[3] - state[0], 0.0, 0.0)


@pytest.mark.parametrize("velocity", [0.0, -1.0, math.inf, math.nan])
def test_velocity_limit_is_checked(velocity):
    """A velocity limit that cannot bring the axis to the target is refused."""
    with pytest.raises(
        ConfigurationError, match=r"max_velocity: .* is not allowed; allowed: a finite number above 0"
    ):
        plan_position(0, 0, 0, 1, max_velocity=velocity, acceleration=1, deceleration=1, jerk=1)
