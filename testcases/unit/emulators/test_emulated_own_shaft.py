"""A shaft that is moved from outside, turns counted by electronics, lost steps, and how encoders are
mounted.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulators.encoder import IncrementalEncoder, Mounting, RotaryEncoder, TurnCountingEncoder
from emulators.mechanics import DrivenShaft
from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError

TURN = 2 * math.pi
DURATIONS = st.integers(0, 5000)
SPEEDS = st.integers(-50, 50)


@pytest.mark.exhaustive
@given(
    profile=st.lists(st.tuples(DURATIONS, SPEEDS), min_size=1, max_size=6),
    moments=st.lists(st.integers(0, 40_000), min_size=1, max_size=5),
)
def test_shaft_follows_its_profile(profile, moments):
    """At any moment position and velocity are those of the integrated profile, however seldom somebody
    looks.
    """
    scheduler = VirtualScheduler()
    shaft = DrivenShaft(scheduler, position=1.5)
    shaft.follow([(duration / 1000, float(speed)) for duration, speed in profile])
    for moment in sorted(moments):
        scheduler.run_for(moment * MS - scheduler.now)
        left, position, velocity = moment / 1000, 1.5, 0.0
        for duration, target in ((duration / 1000, speed) for duration, speed in profile):
            if left < duration:
                position += velocity * left + 0.5 * (target - velocity) / duration * left**2
                velocity += (target - velocity) * left / duration
                break
            position += 0.5 * (velocity + target) * duration
            velocity = target
            left -= duration
        else:
            position += velocity * left
        assert shaft.position == pytest.approx(position, abs=1e-6)
        assert shaft.velocity == pytest.approx(velocity, abs=1e-6)


def test_repeated_profile():
    """A repeated profile goes on from the speed and place that it has reached, for as long as nobody stops
    it.
    """
    scheduler = VirtualScheduler()
    shaft = DrivenShaft(scheduler)
    shaft.follow([(1.0, 10.0), (1.0, 0.0)], repeat=True)
    scheduler.run_for(100 * S)
    assert shaft.position == pytest.approx(500.0)
    shaft.place(2.0)
    scheduler.run_for(S)
    assert (shaft.position, shaft.velocity) == (2.0, 0.0)


def test_shaft_turns_from_where_it_is():
    """A new command begins with the present place and speed, in the middle of a ramp too."""
    scheduler = VirtualScheduler()
    shaft = DrivenShaft(scheduler)
    shaft.turn(10.0, ramp_s=1.0)
    scheduler.run_for(S // 2)
    assert (shaft.position, shaft.velocity) == (1.25, 5.0)
    shaft.turn(0.0, ramp_s=0.5)
    scheduler.run_for(S)
    assert (shaft.position, shaft.velocity) == (2.5, 0.0)


@pytest.mark.parametrize(
    "order",
    [
        lambda shaft: shaft.turn(math.inf),
        lambda shaft: shaft.turn(1.0, ramp_s=-1.0),
        lambda shaft: shaft.follow([(math.nan, 1.0)]),
        lambda shaft: shaft.follow([(0.0, 1.0)], repeat=True),
        lambda shaft: shaft.place(math.nan),
    ],
)
def test_shaft_refuses_what_cannot_be(order):
    """Speeds and times that are no numbers, and a repeated profile that takes no time."""
    with pytest.raises(ConfigurationError):
        order(DrivenShaft(VirtualScheduler()))


@pytest.mark.parametrize(
    "options",
    [{"ratio": 0.0}, {"ratio": math.nan}, {"offset": math.inf}, {"backlash": -1.0}, {"backlash": math.nan}],
)
def test_mounting_refuses_what_cannot_be(options):
    """A coupling has a ratio other than zero, a finite place and no negative play."""
    with pytest.raises(ConfigurationError, match="mounting"):
        Mounting(lambda: 0.0, **options)


@pytest.mark.exhaustive
@given(
    turned=st.integers(-20_000, 20_000),
    meanwhile=st.integers(-499, 499),
    offset=st.integers(-5000, 5000),
)
def test_counted_turns_survive_up_to_half_a_turn(turned, meanwhile, offset):
    """What the shaft turns without supply is known as long as it is less than half a turn."""
    encoder = TurnCountingEncoder(counts_per_revolution=1000, mounting_offset=offset)
    encoder.power_on(0.0)
    start = encoder.increments
    assert start == offset % 1000
    encoder.sample(turned * TURN / 1000)
    encoder.power_off()
    encoder.power_on((turned + meanwhile) * TURN / 1000)
    assert encoder.increments == start + turned + meanwhile


def test_restart_under_supply_keeps_the_turns():
    """A restart of the electronics, without a loss of supply, goes on from the present count."""
    encoder = TurnCountingEncoder(counts_per_revolution=1000)
    encoder.power_on(0.0)
    for turns in (1, 2, 3):
        encoder.sample(turns * TURN)
    encoder.power_on(3 * TURN)
    assert encoder.increments == 3000


def test_more_than_half_a_turn_is_taken_for_the_shorter_way():
    """700 of 1000 steps forward without supply look like 300 back."""
    encoder = TurnCountingEncoder(counts_per_revolution=1000)
    encoder.power_on(0.0)
    encoder.sample(5 * TURN)
    encoder.power_off()
    encoder.power_on(5.7 * TURN)
    assert encoder.increments == 4700


@pytest.mark.exhaustive
@given(every=st.integers(2, 50), places=st.lists(st.integers(-2000, 2000), min_size=1, max_size=8))
def test_lost_steps(every, places):
    """One of `every` steps away from the place where the loss began is missing, and stays missing when it
    ends.
    """
    encoder: RotaryEncoder = IncrementalEncoder(counts_per_revolution=1000)
    encoder.power_on(0.0)
    encoder.sample(0.123 * TURN)
    encoder.lose_steps(every)
    for place in places:
        encoder.sample((123 + place) * TURN / 1000)
        assert encoder.increments == 123 + place - int(place / every)
    encoder.lose_steps(0)
    encoder.sample(0.0)
    assert encoder.increments == -int(places[-1] / every)


@pytest.mark.parametrize("every", [1, -1])
def test_not_every_step_can_be_lost(every):
    """Losing each step would be a standstill, which `freeze` is for."""
    with pytest.raises(ConfigurationError, match="every"):
        IncrementalEncoder().lose_steps(every)
