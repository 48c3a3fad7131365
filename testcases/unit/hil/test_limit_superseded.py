"""Jobs that supersede each other close to a software limit, drawn from a seed."""

from __future__ import annotations

import random
from typing import Any

import pytest

from hil.bench import load_bench

pytestmark = pytest.mark.exhaustive

LIMIT = 40.0
TRIALS = 4


def _dynamics(source: random.Random) -> dict[str, float]:
    return {
        "Acceleration": source.choice((50.0, 100.0, 400.0, 1000.0, 2000.0)),
        "Deceleration": source.choice((50.0, 100.0, 400.0, 1000.0, 2000.0)),
        "Jerk": source.choice((0.0, 0.0, 500.0, 5000.0, 20000.0)),
    }


def _start(axis: Any, source: random.Random) -> None:
    dynamics, velocity = _dynamics(source), source.uniform(20.0, 480.0)
    sign = source.choice((1.0, 1.0, -1.0))
    kind = source.choice(("velocity", "velocity", "velocity", "relative", "absolute", "jog", "halt"))
    if kind == "velocity":
        axis.move_velocity(sign * velocity, **dynamics)
    elif kind == "relative":
        axis.move_relative(sign * source.uniform(1.0, 120.0), Velocity=velocity, **dynamics)
    elif kind == "absolute":
        axis.move_absolute(sign * source.uniform(0.0, 80.0), Velocity=velocity, **dynamics)
    elif kind == "jog":
        axis.jog(velocity, backward=sign < 0.0, **dynamics)
    else:
        del dynamics["Acceleration"]
        axis.halt(**dynamics)


@pytest.mark.requirement("LIM-075", "LIM-084")
@pytest.mark.parametrize("behavior", [0, 1])
def test_no_superseding_job_passes_the_limit(behavior: int, subtests: pytest.Subtests) -> None:
    """With the maximum dynamics the setpoint ends at the limit, whatever supersedes what; with those of the
    job it passes only where a job that brakes less came too late, and then with alarm 534.
    """
    for seed in range(TRIALS):
        source = random.Random(f"{behavior} {seed}")
        variables = {
            "PositionLimits_SW.Active": True,
            "PositionLimits_SW.LimitReachedBehavior": behavior,
            "PositionLimits_SW.MinPosition": -LIMIT,
            "PositionLimits_SW.MaxPosition": LIMIT,
            "DynamicDefaults.Jerk": source.choice((0.0, 5000.0)),
        }
        file = load_bench("reference").configured({"axis": {"axis1": {"variables": variables}}})
        with subtests.test(seed=seed), file.build(seed=1) as bench:
            axis = bench.axis()
            bench.wait_until(axis.power().status, timeout=2.0)
            bench.wait_until(axis.home(source.uniform(-30.0, 30.0)).done, timeout=1.0)
            bench.run_for(0.02)
            homed_s = bench.scheduler.now * 1e-9
            for _ in range(source.randint(2, 4)):
                _start(axis, source)
                bench.run_for(source.uniform(0.004, 0.4))
            bench.run_for(0.6)
            trace = bench.trace()
            signal = trace["axis1.position_setpoint"]
            passed = abs(signal.values[signal.time_s > homed_s]).max() > LIMIT + 1e-6
            raised = {event.data["number"] for event in trace.select(kind="alarm.raised")}
            assert not passed or (behavior == 1 and 534 in raised)
