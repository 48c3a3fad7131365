"""Golden numbers of an axis of one's own: they follow from its bench file, and its stops keep to them."""

import pytest

from hil.bench import load_bench
from hil.bench.units import variables_in_units
from hil.errors import ConfigurationError
from hil.expect import golden, ramp
from hil.testing import CurrentTrace
from testcases.unit.hil import three_axes

pytestmark = pytest.mark.exhaustive


def test_the_numbers_are_those_of_the_bench_file():
    """Limits of the axis, ramp times of the drive, travel per revolution; of the reference bench those of the
    reference axis.
    """
    with three_axes.BENCH.build(seed=1) as bench:
        z = bench.golden("z")
        assert (z.emergency_deceleration, z.maximum_deceleration, z.maximum_jerk) == (2000.0, 1000.0, 20000.0)
        assert (z.off1_time_s, z.off3_time_s, z.cycle_s) == (0.8, 0.3, 0.004)
        assert z.drive_velocity == pytest.approx(500.0)
        assert z.emergency(100.0).distance == pytest.approx(2.5)
        assert z.off3(100.0).time_s == pytest.approx(0.06)
        assert z.job().time_s == pytest.approx(100.0 / 500.0 + 500.0 / 10000.0)
        assert bench.golden() == bench.golden("x")
        with pytest.raises(ConfigurationError, match="x, y, z"):
            bench.golden("u")
    assert golden.REFERENCE_AXIS.drive_velocity == 500.0


@pytest.mark.parametrize("turned", [False, True])
def test_the_numbers_are_in_position_units_and_s(turned):
    """Whatever the unit of velocity is, and whichever way the motor turns: the same machine in m and m/min
    has the same ramps.
    """
    mm = load_bench("reference").build(seed=1)
    tables = variables_in_units(load_bench("reference").config.axis["axis1"], 1010, 1525)
    variables = tables | dict.fromkeys(("Actor.InverseDirection", "Sensor[1].InverseDirection"), turned)
    m = load_bench("reference").configured(
        {
            "axis": {"axis1": {"variables": variables}},
            "drive": {"drive1": {"mechanics": {"reversed": turned}}},
        }
    )
    with mm, m.build(seed=1) as bench:
        assert bench.axis().var("DynamicLimits.MaxVelocity") == pytest.approx(30.0)
        usual, own = mm.golden(), bench.golden()
        assert own.velocity_unit == pytest.approx(1.0 / 60.0)
        assert own.machine_m == pytest.approx(1.0)
        assert usual.machine_m == pytest.approx(0.001)
        for kind in ("emergency", "maximum", "off1", "off3", "job"):
            expected, found = getattr(usual, kind)(300.0), getattr(own, kind)(0.3)
            assert found.time_s == pytest.approx(expected.time_s)
            assert found.distance == pytest.approx(expected.distance / 1000.0)


@pytest.mark.parametrize(
    ("axis", "mode", "maker"), [("x", 0, None), ("z", 0, None), ("x", 1, "drive"), ("z", 2, None)]
)
def test_stops_keep_to_the_numbers(axis, mode, maker):
    """Emergency ramp, quick stop of the drive and maximum dynamics of both profiles last as long as
    calculated.
    """
    with three_axes.BENCH.build(seed=1) as bench:
        handle, trace = bench.axis(axis), CurrentTrace(bench)
        power = handle.power()
        bench.wait_until(power.status, 2.0)
        bench.wait_until(handle.move_velocity(120.0, Jerk=0.0).in_velocity, 2.0)
        stop_s = bench.now_s
        handle.power(False, stop_mode=mode)
        bench.run_for(0.8)
        own = bench.golden(axis)
        expected = {0: own.emergency, 1: own.off3, 2: own.maximum}[mode](120.0)
        trace.check(
            ramp(
                stop_s,
                expected,
                axis=axis,
                made_by=maker or "controller",
                time_tolerance_s=own.time_tolerance_s,
                distance_tolerance=own.distance_tolerance(120.0, following_error=0.5),
            )
        )
