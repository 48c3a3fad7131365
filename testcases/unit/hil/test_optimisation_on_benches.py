"""The optimisation of the position controller against drives with inertia, cycle times and quantised words
(§6.7).
"""

from __future__ import annotations

from contextlib import contextmanager
from math import e

import pytest

from fieldbus.errors import ConfigurationError
from hil.bench import BenchFile, load_bench
from motion.s7.commissioning import CommissioningError, Optimisation, TestStep

pytestmark = pytest.mark.exhaustive

STEP = TestStep(distance=5.0, velocity=60.0, acceleration=1000.0)
DSC = '"PositionControl.EnableDSC" = true\n'
SLOW = "off3_ramp_s = 0.5\nvelocity_time_constant_ms = 20.0\ntorque_precontrol = false"


@contextmanager
def optimisation(name, *, extra="", replace=("", ""), step=STEP):
    text = load_bench(name).text.replace(*replace) + extra
    with BenchFile("own.toml", text).build(seed=0) as machine:
        panel = machine.axis().control_panel()
        panel.take_control()
        panel.enable()
        assert machine.run_until(lambda: panel.enabled, timeout=3.0)

        def wait(condition, seconds):
            return machine.scheduler.run_until(condition, round(seconds * 1e9))

        yield machine, panel, Optimisation(panel, machine.runtime, wait, step)


@pytest.mark.requirement("COM-055", "COM-060", "COM-062", "COM-063", "COM-065", "COM-067")
@pytest.mark.parametrize(
    ("name", "extra", "low", "high"),
    [
        ("reference", "", 35.0, 50.0),
        ("profidrive", "", 35.0, 50.0),
        ("profidrive", DSC, 120.0, 300.0),
        ("analog", "", 35.0, 50.0),
        ("stepper", "", 60.0, 100.0),
        ("profidrive_rtu", "", 5.0, 9.0),
    ],
    ids=["cia402", "profidrive", "profidrive-dsc", "analog", "stepper", "profidrive-rtu"],
)
def test_the_recommended_gain(name, extra, low, high):
    """With it nothing overshoots, with twice as much it does.

    A loop of nothing but dead time T does not overshoot up to 1 / (e T). With DSC that is not the time of the
    bus; analog drive and stepper have lags and steps of their own.
    """
    with optimisation(name, extra=extra) as (machine, _, routine):
        found = routine.run()
        assert low < found.kv < high
        if not extra and name not in ("analog", "stepper"):
            best = 1.0 / (e * machine.axis().port.delay_ns * 1e-9)
            assert found.kv / 0.9 == pytest.approx(best, rel=0.1)
        assert found.kpc == 100.0
        assert found.attempts[-1].good
        assert (found.attempts[-1].kv, found.attempts[-1].time_constant) == (found.kv, found.time_constant)
        assert routine.attempt(found.kv, 0.0, 0.0).good
        twice = routine.attempt(2.0 * found.kv, 0.0, 0.0)
        assert not twice.good
        assert twice.overshoot > found.attempts[0].tolerance
        assert (
            max(one.overshoot for one in found.attempts) < 0.1 * STEP.distance
        )  # nothing began to oscillate


@pytest.mark.requirement("COM-060", "COM-068")
def test_a_slow_speed_loop():
    """A speed loop of 20 ms: near 1 / (4 * 20 ms) = 12.5 1/s of an ideal loop, and the substitute time comes
    near those 20 ms.
    """
    long = TestStep(distance=20.0, velocity=100.0, acceleration=1000.0, tolerance=0.01)
    with optimisation("reference", replace=("off3_ramp_s = 0.5", SLOW), step=long) as (_, _, routine):
        found = routine.run()
        assert 7.0 < found.kv < 13.0
        assert found.time_constant == pytest.approx(0.020, abs=0.005)


@pytest.mark.requirement("COM-060", "COM-065")
def test_a_gain_that_lets_the_axis_oscillate():
    """It is taken back before the load has gone far, the axis comes to rest, and the next attempt is judged
    by itself.
    """
    with optimisation("analog") as (machine, _, routine):
        good = routine.attempt(20.0, 0.0, 0.0)
        wild = routine.attempt(320.0, 0.0, 0.0)
        assert not wild.good
        assert wild.overshoot >= 0.05 * STEP.distance
        true = machine.trace()["drive1.position"].values * 1000.0
        assert true.max() - true.min() < 2.0 * STEP.distance
        assert routine.attempt(20.0, 0.0, 0.0).overshoot == pytest.approx(good.overshoot, abs=5e-4)


@pytest.mark.requirement("COM-052")
def test_what_cannot_be_optimised():
    """A speed axis, and a test step beyond the dynamic limits of the axis: refused with what is allowed."""
    with pytest.raises(CommissioningError, match="no position control"), optimisation("speed"):
        pass
    for values, reported in (
        ({"velocity": 501.0}, "test step: velocity: 501.0 .* at most 500"),
        ({"acceleration": 2001.0}, "test step: acceleration: 2001.0 .* at most 2000"),
    ):
        fast = TestStep(**{"distance": 5.0, "velocity": 60.0, "acceleration": 1000.0} | values)
        with pytest.raises(ConfigurationError, match=reported), optimisation("reference", step=fast):
            pass
    for values in (
        {"tolerance": -1.0},
        {"tolerance": 5.0},
        {"tolerance": float("nan")},
        {"velocity": float("inf")},
    ):
        with pytest.raises(ConfigurationError, match="test step"):
            TestStep(**{"distance": 5.0, "velocity": 60.0, "acceleration": 1000.0} | values)
