"""The setpoint generator: cyclic advance, takeover from one motion to the next, and what it reports."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motion.setpoint import MotionPhase, SetpointGenerator, plan_position, plan_velocity

CYCLE = 0.004
C, A, D = MotionPhase.CONSTANT, MotionPhase.ACCELERATING, MotionPhase.DECELERATING


def run(generator, *, cycles=10_000):
    """Advance until the end and return the states of all cycles."""
    states = []
    while not generator.done and cycles:
        generator.advance(CYCLE)
        states.append((generator.s, generator.v, generator.a))
        cycles -= 1
    assert generator.done
    return states


def test_follows_the_planned_motion():
    """The states of the cycles are those of the plan, shifted to the start position."""
    generator = SetpointGenerator(10.0)
    generator.start_position(110.0, 100.0, 1000.0, 800.0, 10_000.0)

    states = run(generator)

    plan = plan_position(10, 0, 0, 110, max_velocity=100, acceleration=1000, deceleration=800, jerk=10_000)
    for cycle, (s, v, a) in enumerate(states[:-1], start=1):
        way, velocity, acceleration = plan.sample(cycle * CYCLE)
        assert (s, v, a) == (
            pytest.approx(10 + way),
            pytest.approx(velocity, abs=1e-9),
            pytest.approx(acceleration, abs=1e-6),
        )


@pytest.mark.requirement("STP-114")
@pytest.mark.parametrize("start", [0.1, 1.1, 123.456, -0.7])
@pytest.mark.parametrize("target", [0.3, -1234.567, 1e6 / 3])
def test_position_ends_exactly(start, target):
    """At the end position, velocity and acceleration are exactly target, zero and zero, and stay so."""
    generator = SetpointGenerator(start)
    generator.start_position(target, 1e5, 1e6, 8e5, 1e7)
    run(generator)

    for _ in range(3):
        assert (generator.s, generator.v, generator.a) == (target, 0.0, 0.0)
        generator.advance(CYCLE)


def test_velocity_ends_exactly_and_goes_on():
    """At the end the velocity is exactly the target; the axis moves on with it."""
    generator = SetpointGenerator()
    generator.start_velocity(-70.0, 1000.0, 800.0, 10_000.0)
    run(generator)
    assert (generator.v, generator.a, generator.target) == (-70.0, 0.0, -70.0)

    before = generator.s
    generator.advance(2.0)
    assert generator.s == pytest.approx(before - 140.0)


def test_the_rest_of_the_last_cycle_is_travelled_with_the_end_velocity():
    """A ramp that ends inside a cycle is followed by constant velocity for the rest of that cycle."""
    generator = SetpointGenerator()
    generator.start_velocity(100.0, 50_000.0, 50_000.0, 0.0)

    generator.advance(CYCLE)

    assert (generator.v, generator.done) == (100.0, True)
    assert generator.s == pytest.approx(0.5 * 0.002 * 100 + 0.002 * 100)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-116", "MC-095")
@given(st.integers(0, 120), st.floats(-200, 200), st.sampled_from([1000.0, 20_000.0]))
def test_takeover_keeps_the_state(cycles, target, jerk):
    """A new jerk-limited motion starts from the present state: no cycle changes the acceleration by more than
    jerk * T.
    """
    generator = SetpointGenerator()
    generator.start_position(40.0, 150.0, 1000.0, 700.0, 20_000.0)
    for _ in range(cycles):
        generator.advance(CYCLE)
    before = generator.s, generator.v, generator.a
    generator.start_velocity(target, 900.0, 600.0, jerk)
    assert (generator.s, generator.v, generator.a) == before

    states = [before, *run(generator)]

    for (s0, v0, a0), (s1, v1, a1) in pairwise(states):
        assert abs(a1 - a0) <= jerk * CYCLE * (1 + 1e-9) + 1e-6
        assert abs(v1 - v0) <= max(abs(a0), abs(a1), 1000) * CYCLE + 1e-9
        assert abs(s1 - s0) <= max(abs(v0), abs(v1)) * CYCLE + 0.1


def test_stop_without_jerk_limit_drops_the_acceleration():
    """A stop without jerk limit brakes from the first cycle on, whatever acceleration is present."""
    generator = SetpointGenerator()
    generator.set_state(0.0, 100.0, 5000.0)
    generator.start_stop(1000.0, 0.0)

    generator.advance(CYCLE)

    assert (generator.v, generator.a) == (pytest.approx(96.0), -1000.0)


@pytest.mark.requirement("STP-403")
@pytest.mark.parametrize(("abort", "peak"), [(False, 250.0), (True, 200.0)])
def test_stop_with_abort_of_the_acceleration(abort, peak):
    """The option of the stop decides whether the velocity still rises."""
    generator = SetpointGenerator()
    generator.set_state(0.0, 200.0, 1000.0)
    generator.start_stop(1000.0, 10_000.0, abort_acceleration=abort)

    velocities = [v for _, v, _ in run(generator)]

    assert max(velocities) == pytest.approx(peak, abs=0.1)
    assert velocities[-1] == 0.0


def test_set_state_drops_the_motion():
    """A state taken over replaces the active motion; the axis moves on with the velocity taken over."""
    generator = SetpointGenerator()
    generator.start_position(100.0, 100.0, 1000.0, 1000.0, 0.0)
    generator.advance(CYCLE)

    generator.set_state(7.0, 3.0)

    assert (generator.s, generator.v, generator.a) == (7.0, 3.0, 0.0)
    assert (generator.done, generator.positioning, generator.remaining_time) == (True, False, 0.0)
    generator.advance(1.0)
    assert generator.s == 10.0


def test_shift_moves_the_scale_only():
    """A shift of the scale moves setpoint and target alike and leaves way, velocity and time as they were."""
    plain, shifted = SetpointGenerator(), SetpointGenerator()
    for generator in (plain, shifted):
        generator.start_position(50.0, 100.0, 1000.0, 1000.0, 10_000.0)
        for _ in range(30):
            generator.advance(CYCLE)
    shifted.shift(1000.0)
    assert shifted.s == pytest.approx(plain.s + 1000.0)

    here, there = run(plain), run(shifted)

    assert [v for _, v, _ in here] == [v for _, v, _ in there]
    assert (shifted.s, shifted.target) == (1050.0, 1050.0)


def test_shift_at_constant_velocity():
    """A shift in a motion without target position changes the position only."""
    generator = SetpointGenerator()
    generator.set_state(5.0, 10.0)
    generator.shift(-5.0)
    generator.advance(1.0)

    assert (generator.s, generator.v, generator.target) == (10.0, 10.0, 10.0)


def phases_of(generator):
    """Return the sequence of phases that the cycles show, from before the start."""
    seen = [generator.phase]
    for _ in range(400):
        generator.advance(CYCLE)
        if generator.phase is not seen[-1]:
            seen.append(generator.phase)
    return seen


class TestPhase:
    """Constant, accelerating, decelerating."""

    @pytest.mark.parametrize("jerk", [0.0, 10_000.0])
    def test_sequence(self, jerk):
        """From standstill: constant, accelerating, constant; when stopping: decelerating, constant (sequence
        of VAR-055).
        """
        generator = SetpointGenerator()
        assert generator.phase is C

        generator.start_velocity(-100.0, 1000.0, 1000.0, jerk)
        assert phases_of(generator) == [A, C]
        generator.start_stop(1000.0, jerk)
        assert phases_of(generator) == [D, C]

    def test_reversal(self):
        """A reversal decelerates to zero and accelerates from there, without a constant cycle between."""
        generator = SetpointGenerator()
        generator.set_state(0.0, 100.0)
        generator.start_velocity(-100.0, 1000.0, 1000.0, 10_000.0)

        assert phases_of(generator) == [D, A, C]

    def test_acceleration_turned_into_deceleration(self):
        """The instant without acceleration between accelerating and braking is not a constant velocity."""
        generator = SetpointGenerator()
        generator.set_state(0.0, 100.0, 1000.0)
        generator.start_stop(1000.0, 1000.0 / (25 * CYCLE))

        assert phases_of(generator) == [A, D, C]


class TestOvershoot:
    """Whether the way leaves the range between start and target."""

    def start(self, velocity, target):
        generator = SetpointGenerator()
        generator.set_state(0.0, velocity)
        generator.start_position(target, 100.0, 1000.0, 1000.0, 10_000.0)
        return generator

    @pytest.mark.parametrize(("velocity", "target"), [(0.0, 50.0), (100.0, 50.0), (-100.0, -50.0)])
    def test_direct(self, velocity, target):
        """A motion straight to the target does not leave the range."""
        assert not self.start(velocity, target).overshoots

    @pytest.mark.parametrize(
        ("velocity", "target"), [(100.0, 1.0), (100.0, -50.0), (-100.0, 50.0), (50.0, 0.0)]
    )
    def test_indirect(self, velocity, target):
        """A motion past the target or away from it leaves the range until it is back."""
        generator = self.start(velocity, target)
        assert generator.overshoots

        run(generator)

        assert not generator.overshoots

    @pytest.mark.parametrize(("velocity", "target"), [(100.0, 1.0), (-100.0, 50.0)])
    def test_until_the_turn_back(self, velocity, target):
        """What remains of the way lies between the present position and the target once the report has
        ended.
        """
        generator = self.start(velocity, target)
        while generator.overshoots:
            generator.advance(CYCLE)

        low, high = sorted((generator.s, target))
        assert all(low - 1e-9 <= s <= high + 1e-9 for s, _, _ in run(generator))


def test_remaining_time():
    """The remaining time counts down to zero at the end."""
    generator = SetpointGenerator()
    generator.start_velocity(100.0, 1000.0, 1000.0, 10_000.0)
    total = plan_velocity(0, 0, 100, acceleration=1000, deceleration=1000, jerk=10_000).duration
    assert generator.remaining_time == pytest.approx(total)

    generator.advance(0.05)
    assert generator.remaining_time == pytest.approx(total - 0.05)
    run(generator)
    assert generator.remaining_time == 0.0


def test_shift_and_takeover_at_rest():
    """A setpoint that rests goes on resting, wherever it is moved to, until a motion starts."""
    generator = SetpointGenerator(1.0)
    generator.start_position(5.0, 100.0, 1000.0, 1000.0, 0.0)
    run(generator)
    for _ in range(3):
        generator.advance(CYCLE)
    generator.shift(2.0)
    generator.advance(CYCLE)
    assert (generator.s, generator.v, generator.target, generator.remaining_time) == (7.0, 0.0, 7.0, 0.0)
    generator.set_state(3.0, 0.0, 50.0)
    generator.advance(CYCLE)
    assert (generator.s, generator.a) == (3.0, 0.0)
    generator.start_velocity(10.0, 1000.0, 1000.0, 0.0)
    generator.advance(0.1)
    assert generator.v == 10.0
    assert generator.s > 3.5
