"""Velocity profiles: the numbers of the reference axis, and what holds for every start state and limit."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.errors import ConfigurationError
from motion.setpoint import plan_velocity

pytestmark = pytest.mark.exhaustive

SPEEDS = st.floats(-1e3, 1e3).map(lambda value: round(value, 9))
LIMITS = st.floats(1e-1, 1e5)
JERKS = st.floats(1.0, 1e7)


@st.composite
def plans(draw, *, jerks=JERKS):
    """Return the arguments of a plan, often with zeros, equal values and accelerations within the limits."""
    velocity = draw(st.one_of(st.just(0.0), SPEEDS))
    target = draw(st.one_of(st.just(0.0), st.just(velocity), SPEEDS))
    limits = {"acceleration": draw(LIMITS), "deceleration": draw(LIMITS), "jerk": draw(jerks)}
    highest = min(limits["acceleration"], limits["deceleration"])
    present = draw(st.one_of(st.just(0.0), st.floats(-highest, highest), st.floats(-1e5, 1e5)))
    present = round(present, 9)
    return velocity, present, target, limits


class TestReferenceAxis:
    """Numbers of the reference axis."""

    @pytest.mark.parametrize(
        ("deceleration", "jerk", "time", "way"),
        [
            pytest.param(4000, 0, 0.075, 11.25, id="emergency (STP-008)"),
            pytest.param(2000, 20_000, 0.250, 37.5, id="maximum (STP-009)"),
            pytest.param(1000, 10_000, 0.400, 60.0, id="job (STP-012)"),
        ],
    )
    def test_stop_from_300(self, deceleration, jerk, time, way):
        """A stop from 300 mm/s takes the ramp time and the way of the table of reference numbers."""
        profile = plan_velocity(300, 0, 0, acceleration=1, deceleration=deceleration, jerk=jerk)

        assert profile.duration == pytest.approx(time, rel=1e-12)
        assert profile.distance == pytest.approx(way, rel=1e-12)

    def test_triangular_stop(self):
        """A stop that does not reach its deceleration takes 2 sqrt(v / j) (numbers of STP-013)."""
        profile = plan_velocity(300, 0, 0, acceleration=1, deceleration=2000 * 1.5, jerk=10_000)

        assert profile.duration == pytest.approx(0.346, abs=0.0005)
        assert profile.distance == pytest.approx(51.96, abs=0.005)

    @pytest.mark.requirement("STP-116", "STP-327")
    def test_phases_of_the_maximum_stop(self):
        """The stop with 2000 and 20000 has 100 ms jerk to 200 mm/s, 50 ms constant to 100 mm/s, 100 ms
        jerk.
        """
        profile = plan_velocity(300, 0, 0, acceleration=1, deceleration=2000, jerk=20_000)

        assert [round(phase.duration, 12) for phase in profile.phases] == [0.1, 0.05, 0.1]
        assert [round(phase.velocity, 9) for phase in profile.phases] == [300, 200, 100]
        assert [phase.jerk for phase in profile.phases] == [-20_000, 0, 20_000]
        assert profile.sample(0.125)[2] == -2000

    def test_stop_takes_over_from_a_weaker_stop(self):
        """From 100 ms into the stop with 1000 and 10000, the stop with maximum values ends after 287.5 ms
        (STP-440).
        """
        _, velocity, present = plan_velocity(
            300, 0, 0, acceleration=1, deceleration=1000, jerk=10_000
        ).sample(0.1)
        assert (velocity, present) == (pytest.approx(250), pytest.approx(-1000))

        profile = plan_velocity(velocity, present, 0, acceleration=1, deceleration=2000, jerk=20_000)

        assert 0.1 + profile.duration == pytest.approx(0.2875)

    def test_emergency_stop_takes_over(self):
        """From 100 ms into the maximum stop, the emergency stop ends after 150 ms and 31.67 mm (STP-439)."""
        way, velocity, present = plan_velocity(
            300, 0, 0, acceleration=1, deceleration=2000, jerk=20_000
        ).sample(0.1)

        profile = plan_velocity(velocity, present, 0, acceleration=1, deceleration=4000, jerk=0)

        assert 0.1 + profile.duration == pytest.approx(0.150)
        assert way + profile.distance == pytest.approx(31.667, abs=0.001)

    @pytest.mark.requirement("STP-119", "STP-120", "STP-122")
    @pytest.mark.parametrize(("jerk", "rise"), [(1000, 500), (10_000, 50)])
    def test_present_acceleration_is_carried_over(self, jerk, rise):
        """Braking while accelerating with 1000: the velocity first rises by a0^2 / (2 j), for a0 / j."""
        profile = plan_velocity(200, 1000, 0, acceleration=1000, deceleration=1000, jerk=jerk)

        turn = profile.sample(1000 / jerk)
        assert turn[1:] == (pytest.approx(200 + rise), pytest.approx(0, abs=1e-9))
        assert max(profile.sample(0.001 * k)[1] for k in range(3000)) <= 200 + rise + 1e-9

    @pytest.mark.requirement("STP-121", "STP-122", "STP-115")
    def test_without_jerk_limit_the_new_deceleration_acts_at_once(self):
        """Without a jerk limit a present acceleration is dropped and the velocity falls from the first
        moment.
        """
        profile = plan_velocity(200, 1000, 0, acceleration=1000, deceleration=500, jerk=0)

        assert profile.sample(0.0) == (0, 200, -500)
        assert [phase.acceleration for phase in profile.phases] == [-500]
        assert profile.duration == pytest.approx(0.4)

    @pytest.mark.requirement("STP-325")
    def test_maximum_stop_while_accelerating(self):
        """With +1000 and jerk 20000 the acceleration is gone after 50 ms, the velocity 25 mm/s higher."""
        profile = plan_velocity(300, 1000, 0, acceleration=2000, deceleration=2000, jerk=20_000)

        assert profile.sample(0.05)[1:] == (pytest.approx(325), pytest.approx(0, abs=1e-9))

    @pytest.mark.requirement("MC-095", "MC-096")
    @pytest.mark.parametrize(("jerk", "rise", "time"), [(200, 25, 0.5), (2000, 2.5, 0.05)])
    def test_vector_of_jerk_limited_overriding(self, jerk, rise, time):
        """A = 100 overridden by velocity 0 with deceleration 100: jerk 200 rises 25 in 0.5 s, 2000 rises 2.5
        in 0.05 s.
        """
        profile = plan_velocity(50, 100, 0, acceleration=100, deceleration=100, jerk=jerk)

        assert profile.sample(time)[1] == pytest.approx(50 + rise)
        assert profile.sample(time * 1.01)[1] < 50 + rise

    @pytest.mark.requirement("MC-096")
    def test_vector_of_overriding_without_jerk_limit(self):
        """A = 100 overridden by velocity 0 with deceleration 100 and jerk 0 falls at once with -100."""
        profile = plan_velocity(50, 100, 0, acceleration=100, deceleration=100, jerk=0)

        assert profile.sample(0.1) == (pytest.approx(4.5), pytest.approx(40), -100)

    @pytest.mark.requirement("MC-227")
    def test_halt_with_and_without_abort_of_the_acceleration(self):
        """V 50, a 100, halt 100 / 200: 1.75 s over 75 mm/s; 1.0 s and never faster with AbortAcceleration
        (MC-236 ff.).
        """
        limits = {"acceleration": 100, "deceleration": 100, "jerk": 200}
        gentle = plan_velocity(50, 100, 0, **limits)
        abrupt = plan_velocity(50, 100, 0, **limits, abort_acceleration=True)

        assert gentle.duration == pytest.approx(1.75)
        assert gentle.sample(0.5)[1] == pytest.approx(75)
        assert abrupt.duration == pytest.approx(1.0)
        assert max(abrupt.sample(0.01 * k)[1] for k in range(101)) == 50

    @pytest.mark.requirement("STP-403")
    def test_abort_acceleration(self):
        """a0 +1000, jerk 10000, v 200: the velocity rises to 250 without and never above 200 with the
        option.
        """
        limits = {"acceleration": 1000, "deceleration": 1000, "jerk": 10_000}
        peaks = [
            max(profile.sample(0.001 * k)[1] for k in range(1000))
            for profile in (
                plan_velocity(200, 1000, 0, **limits),
                plan_velocity(200, 1000, 0, **limits, abort_acceleration=True),
            )
        ]

        assert peaks == [pytest.approx(250), 200]

    @pytest.mark.requirement("STP-403")
    def test_abort_acceleration_keeps_a_braking_one(self):
        """A deceleration that is present at the start is no acceleration in the direction of motion and
        stays.
        """
        limits = {"acceleration": 1000, "deceleration": 1000, "jerk": 10_000}

        kept = plan_velocity(200, -1000, 0, **limits, abort_acceleration=True)

        assert kept.phases == plan_velocity(200, -1000, 0, **limits).phases

    @pytest.mark.requirement("MC-089")
    def test_jerk_selects_trapezoid_or_smooth_profile(self):
        """Jerk 0 gives a trapezoid of velocity, a jerk a continuous acceleration."""
        trapezoid = plan_velocity(0, 0, 100, acceleration=1000, deceleration=1000, jerk=0)
        smooth = plan_velocity(0, 0, 100, acceleration=1000, deceleration=1000, jerk=10_000)

        assert trapezoid.duration == pytest.approx(0.1)
        assert smooth.duration == pytest.approx(0.2)
        assert smooth.phases[0].acceleration == 0


class TestReversal:
    """Separate limits when the motion reverses."""

    def test_without_jerk_limit(self):
        """A reversal reduces with the deceleration to zero and grows with the acceleration from there."""
        profile = plan_velocity(100, 0, -200, acceleration=1000, deceleration=500, jerk=0)

        assert [(phase.duration, phase.velocity, phase.acceleration) for phase in profile.phases] == [
            (pytest.approx(0.2), 100, -500),
            (pytest.approx(0.2), 0, -1000),
        ]

    @pytest.mark.parametrize(("acceleration", "deceleration"), [(1000, 400), (400, 1000), (700, 700)])
    def test_passes_zero_with_the_lower_limit(self, acceleration, deceleration):
        """With a jerk limit the axis passes zero without waiting, with the lower of both limits."""
        profile = plan_velocity(
            300, 0, -300, acceleration=acceleration, deceleration=deceleration, jerk=20_000
        )

        crossing = next(phase for phase in profile.phases[1:] if phase.velocity == 0)
        assert crossing.acceleration == pytest.approx(-min(acceleration, deceleration))
        deepest = min(phase.acceleration for phase in profile.phases if phase.start < crossing.start)
        assert deepest == pytest.approx(-deceleration)
        assert min(phase.acceleration for phase in profile.phases) == pytest.approx(
            -max(acceleration, deceleration)
        )

    def test_start_beyond_the_limit_of_the_other_side(self, check):
        """Deceleration that cannot be taken back before zero is taken back behind it, with full jerk, and no
        further.
        """
        profile = plan_velocity(1, -1000, -500, acceleration=100, deceleration=1000, jerk=10_000)

        assert profile.phases[0].jerk == 10_000
        check.within_limits(profile, {"acceleration": 100, "deceleration": 1000, "jerk": 10_000})


class TestAlways:
    """What holds for every start state, target and limit."""

    @given(plans())
    @pytest.mark.requirement("STP-116")
    def test_continuous_and_exact(self, check, plan):
        """Way, velocity and acceleration have no step, and the end is exactly the target without
        acceleration.
        """
        velocity, present, target, limits = plan

        profile = plan_velocity(velocity, present, target, **limits)

        check.continuous(profile, velocity=velocity, acceleration=present)
        assert profile.sample(profile.duration)[1:] == (target, 0.0)
        later = profile.sample(profile.duration + 2.0)
        assert later == (pytest.approx(profile.distance + 2.0 * target, abs=1e-9), target, 0.0)

    @given(plans())
    @pytest.mark.requirement("STP-116")
    def test_limits(self, check, plan):
        """Growth and reduction of |v| keep their limits; a start beyond them returns with full jerk."""
        velocity, present, target, limits = plan

        check.within_limits(plan_velocity(velocity, present, target, **limits), limits)

    @given(plans(jerks=st.just(0.0)))
    @pytest.mark.requirement("STP-115")
    def test_trapezoid(self, check, plan):
        """Without a jerk limit the acceleration takes the values of the limits and nothing else."""
        velocity, present, target, limits = plan

        profile = plan_velocity(velocity, present, target, **limits)

        check.continuous(profile, velocity=velocity, acceleration=None)
        for phase in profile.phases:
            growing = abs(check.end_of(phase)[1]) > abs(phase.velocity)
            assert abs(phase.acceleration) == limits["acceleration" if growing else "deceleration"]
        assert profile.sample(profile.duration)[1:] == (target, 0.0)

    @given(plans(jerks=st.one_of(st.just(0.0), JERKS)))
    def test_mirror(self, plan):
        """Mirrored states and targets give the mirrored motion."""
        velocity, present, target, limits = plan

        profile = plan_velocity(velocity, present, target, **limits)
        mirrored = plan_velocity(-velocity, -present, -target, **limits)

        assert mirrored.duration == profile.duration
        assert mirrored.distance == -profile.distance

    @given(plans(jerks=st.one_of(st.just(0.0), JERKS)))
    def test_way_is_the_integral_of_the_velocity(self, check, plan):
        """The sampled way is the integral of the sampled velocity (Simpson's rule is exact within a
        phase).
        """
        velocity, present, target, limits = plan
        profile = plan_velocity(velocity, present, target, **limits)

        total = size = 0.0
        for phase in profile.phases:
            start, middle, end = (
                profile.sample(phase.start + phase.duration * part)[1] for part in (0.0, 0.5, 1.0)
            )
            if abs(limits["jerk"]) == 0.0:
                end = check.end_of(phase)[1]
            total += phase.duration * (start + 4 * middle + end) / 6
            size += phase.duration * (abs(start) + 4 * abs(middle) + abs(end))

        assert profile.distance == pytest.approx(total, abs=1e-9 * size + 1e-300)

    @given(
        plans(jerks=st.one_of(st.just(0.0), JERKS)), st.lists(st.floats(-0.1, 1.5), min_size=1, max_size=20)
    )
    def test_sampling_in_any_order(self, plan, parts):
        """A sample depends on its time only, not on the samples before it; before the start it is the
        start.
        """
        velocity, present, target, limits = plan
        profile = plan_velocity(velocity, present, target, **limits)

        for part in parts:
            time = part * profile.duration
            fresh = plan_velocity(velocity, present, target, **limits)
            assert profile.sample(time) == fresh.sample(max(time, 0.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"acceleration": 0.0}, "acceleration: 0.0 is not allowed; allowed: a finite number above 0"),
        ({"deceleration": -1.0}, "deceleration: -1.0 is not allowed; allowed: a finite number above 0"),
        ({"jerk": -1.0}, "jerk: -1.0 is not allowed; allowed: a finite number, 0 (no jerk limit) or above"),
        (
            {"jerk": math.nan},
            "jerk: nan is not allowed; allowed: a finite number, 0 (no jerk limit) or above",
        ),
        ({"acceleration": math.inf}, "acceleration: inf is not allowed; allowed: a finite number above 0"),
    ],
)
def test_limits_are_checked(change, message):
    """A limit that no motion can be planned with is refused with its name and what is allowed."""
    with pytest.raises(ConfigurationError) as caught:
        plan_velocity(1, 0, 2, **({"acceleration": 1, "deceleration": 1, "jerk": 1} | change))

    assert str(caught.value) == message


def test_state_is_checked():
    """A state that is no number is refused instead of spreading."""
    with pytest.raises(ConfigurationError, match="velocity: nan is not allowed"):
        plan_velocity(math.nan, 0, 2, acceleration=1, deceleration=1, jerk=1)
