"""Ramps that are configured as times (§5.7.1, §5.7.2, §5.7.7)."""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from hil.bench import load_bench
from hil.bench.bench import Bench
from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import PositioningAxis, SpeedAxis

TIMES = {
    "maximum_up_s": 0.5,
    "maximum_down_s": 0.25,
    "default_up_s": 0.2,
    "default_down_s": 0.4,
    "emergency_s": 0.1,
}
UP, DOWN = "DynamicLimits.MaxAcceleration", "DynamicLimits.MaxDeceleration"
DEFAULT_UP, DEFAULT_DOWN = "DynamicDefaults.Acceleration", "DynamicDefaults.Deceleration"
EMERGENCY = "DynamicDefaults.EmergencyDeceleration"


def make(kind=PositioningAxis, times=TIMES, **variables):
    start = {"DynamicLimits.MaxVelocity": 500.0, "DynamicDefaults.Velocity": 100.0} | variables
    return kind(
        "axis1", SimulatedDrivePort(cycle_s=0.004), cycle_ns=4_000_000, variables=start, ramp_times=times
    )


def values(axis):
    return [axis.var(path) for path in (UP, DOWN, DEFAULT_UP, DEFAULT_DOWN, EMERGENCY)]


@pytest.mark.requirement("STP-098", "STP-109", "STP-127")
@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_times_stay_when_the_velocities_change(factor):
    """Twice the velocity is twice the acceleration, with the same times."""
    axis = make(**{"DynamicLimits.MaxVelocity": 500.0 * factor, "DynamicDefaults.Velocity": 100.0 * factor})
    assert values(axis) == pytest.approx(
        [1000.0 * factor, 2000.0 * factor, 500.0 * factor, 250.0 * factor, 5000.0 * factor]
    )


@pytest.mark.requirement("STP-098", "STP-109", "STP-127")
def test_times_stay_when_load_memory_changes():
    """A new maximum velocity in load memory is in force with a restart, and so is what follows from it; the
    rest stays.
    """
    axis = make(times={"maximum_up_s": 0.5, "emergency_s": 0.1})
    before = axis.var(DOWN)
    axis.variables.write_start("DynamicLimits.MaxVelocity", 800.0)
    assert axis.var(UP) == 1000.0
    assert axis.variables.restart() == ()
    assert [axis.var(UP), axis.var(EMERGENCY), axis.var(DOWN)] == [1600.0, 8000.0, before]


@pytest.mark.requirement("STP-098", "STP-109")
def test_in_the_units_of_the_axis():
    """Of an axis in mm/min the velocity is divided by 60 first; of a speed axis in 1/min accelerations are
    1/s2.
    """
    axis = make(
        **{
            "Units.VelocityUnit": 1524,
            "DynamicLimits.MaxVelocity": 30000.0,
            "DynamicDefaults.Velocity": 6000.0,
        }
    )
    assert values(axis) == pytest.approx([1000.0, 2000.0, 500.0, 250.0, 5000.0])
    speed = make(SpeedAxis, **{"DynamicLimits.MaxVelocity": 3000.0, "DynamicDefaults.Velocity": 1500.0})
    assert values(speed) == pytest.approx([100.0, 200.0, 125.0, 62.5, 500.0])


@pytest.mark.parametrize(
    ("times", "variables", "message"),
    [
        ({"maximum_s": 1.0}, {}, "ramp_times.maximum_s: 1.0 is not allowed; allowed: one of maximum_up_s"),
        ({"emergency_s": 0.0}, {}, "ramp_times.emergency_s: 0.0 is not allowed; allowed: a time above 0 s"),
        (
            {"maximum_up_s": 1e-12},
            {},
            "ramp_times.maximum_up_s: 1e-12 is not allowed; allowed: a time that gives",
        ),
        (
            {"maximum_up_s": 1.0},
            {UP: 1000.0},
            f"{UP}: 1000.0 is not allowed; allowed: no value together with ramp_times",
        ),
    ],
)
def test_mistakes(times, variables, message):
    """A time that does not exist or cannot be used, and a value together with a time, are refused by name."""
    with pytest.raises(ConfigurationError) as error:
        make(times=times, **variables)
    assert str(error.value).startswith(message)


@pytest.mark.requirement("STP-098", "STP-109", "STP-127")
def test_in_a_bench_file():
    """`ramp_times` of an axis section act on its axis."""
    config = load_bench("reference").config
    (name, section), *_ = config.axis.items()
    own = {path: value for path, value in section.variables.items() if path not in (UP, EMERGENCY)}
    changed = section.model_copy(
        update={"variables": own, "ramp_times": {"maximum_up_s": 0.5, "emergency_s": 0.1}}
    )
    with Bench(config.model_copy(update={"axis": {name: changed}})) as bench:
        axis = bench.axis(name)
        velocity = axis.var("DynamicLimits.MaxVelocity")
        assert axis.var(UP) == pytest.approx(velocity / 0.5)
        assert axis.var(EMERGENCY) == pytest.approx(velocity / 0.1)
