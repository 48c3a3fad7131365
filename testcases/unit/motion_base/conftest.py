"""Checks of motion profiles that several test files share."""

import math
from types import SimpleNamespace

import pytest


def end_of(phase):
    """Return way, velocity and acceleration at the end of a phase."""
    t = phase.duration
    return (
        phase.position + t * (phase.velocity + t * (phase.acceleration / 2 + t * phase.jerk / 6)),
        phase.velocity + t * (phase.acceleration + t * phase.jerk / 2),
        phase.acceleration + t * phase.jerk,
    )


def continuous(profile, *, velocity, acceleration, position=0.0):
    """Check way, velocity and (unless None) acceleration over all joints, against rounding of the largest
    values.
    """
    phases = profile.phases
    speed = max([abs(velocity), abs(profile.end_velocity)] + [abs(phase.velocity) for phase in phases])
    way = max([abs(profile.distance), abs(position)] + [abs(phase.position) for phase in phases])
    pull = max([0.0] + [abs(phase.acceleration) for phase in phases])
    for number, phase in enumerate(phases, start=1):
        end = end_of(phase)
        after = phases[number] if number < len(phases) else None
        position, v, a = after[2:5] if after else (profile.distance, profile.end_velocity, 0.0)
        assert end[0] == pytest.approx(position, abs=1e-12 * way + 1e-12 * speed * profile.duration + 1e-29)
        assert end[1] == pytest.approx(v, abs=1e-11 * speed + 1e-300)
        if acceleration is not None:
            assert end[2] == pytest.approx(a, abs=1e-9 * pull + 1e-300)
    if phases:
        assert phases[0].velocity == pytest.approx(velocity, abs=1e-11 * speed)
        if acceleration is not None:
            assert phases[0].acceleration == pytest.approx(acceleration, abs=1e-9 * pull)


def within_limits(profile, limits, *, top=math.inf):
    """Check that growth and reduction of |v| keep their limits; beyond them only the way back, with full
    jerk.
    """
    pull = max([0.0] + [abs(phase.acceleration) for phase in profile.phases])
    speed = max([0.0] + [abs(phase.velocity) for phase in profile.phases])
    for phase in profile.phases:
        assert abs(phase.jerk) in (0.0, limits["jerk"])
        # Points inside the phase only: at its ends rounding decides what is growth of |v| and what is
        # reduction.
        for part in (1e-6, 0.25, 0.5, 0.75, 1 - 1e-6):
            t = part * phase.duration
            v = phase.velocity + t * (phase.acceleration + t * phase.jerk / 2)
            a = phase.acceleration + t * phase.jerk
            if abs(v) <= 1e-9 * speed:
                continue
            limit = limits["acceleration"] if v * a > 0 else limits["deceleration"]
            if abs(a) > limit * (1 + 1e-9) + 1e-12 * pull:
                assert phase.jerk * a < 0
            if abs(v) > top * (1 + 1e-9):
                assert v * a <= 1e-12 * abs(v) * pull or phase.jerk * a < 0


@pytest.fixture(scope="session")
def check():
    """Return the checks."""
    return SimpleNamespace(continuous=continuous, within_limits=within_limits, end_of=end_of)
