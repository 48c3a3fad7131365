"""Velocity mode (vl): ramps, control bits, limits, factors and percentages, by true motion."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.cia402 import DriveConfig, RotaryAxisConfig
from fieldbus.canopen import NmtCommand, SdoAbort
from fieldbus.cia402 import DriveState as S
from testcases.unit.emulators.conftest import DriveBench

RUN = 0x7F
"""Operation enabled with the three bits of the ramp set."""
RPM_PER_M_S = 6000.0
"""Screw of 10 mm."""


def frictionless() -> DriveConfig:
    config = DriveConfig.reference()
    return replace(
        config, mechanics=replace(config.mechanics, coulomb_friction_n=0.0, viscous_friction_n_per_m_s=0.0)
    )


def endless() -> DriveConfig:
    """Return the reference drive on a rotary axis without stops and friction."""
    return replace(
        DriveConfig.reference(), mechanics=RotaryAxisConfig(coulomb_friction=0.0, viscous_friction=0.0)
    )


def vl_bench(config: DriveConfig | None = None) -> DriveBench:
    """Return a bench in vl with the ramp bits set; defaults: 3000 rpm in 1 s."""
    bench = DriveBench(config or frictionless())
    bench.enable(2)
    bench.control(RUN)
    return bench


def rpm(bench: DriveBench) -> float:
    return bench.drive.core.speed_rpm


def slopes_rpm_s(samples: list[tuple[float, float, float]]) -> list[float]:
    """Return the accelerations between samples 10 ms apart, rpm/s."""
    picked = samples[::40]
    return [(b[2] - a[2]) * RPM_PER_M_S / (b[0] - a[0]) for a, b in pairwise(picked)]


@pytest.mark.requirement("C402-079", "C402-096", "C402-179", "C402-184", "C402-185")
def test_ramps_take_the_time_of_delta_speed_and_delta_time():
    """6048h = 2000 rpm / 2 s, 6049h = 3000 rpm / 1 s: 0 to 1000 rpm takes 1 s, back to 0 a third of one."""
    bench = vl_bench()
    bench.write(0x6048, 2000, 1)
    bench.write(0x6048, 2, 2)
    start = bench.scheduler.now
    bench.write(0x6042, 1000)
    bench.run(0.5)
    assert rpm(bench) == pytest.approx(500, abs=3)
    assert bench.read(0x6043) == pytest.approx(500, abs=3)
    assert bench.read(0x6044) == pytest.approx(500, abs=3)
    bench.until(lambda: bench.read(0x6043) == 1000, 2.0)
    assert (bench.scheduler.now - start) / 1e9 == pytest.approx(1.0, abs=0.002)
    start = bench.scheduler.now
    bench.write(0x6042, 0)
    bench.until(lambda: bench.read(0x6043) == 0, 2.0)
    assert (bench.scheduler.now - start) / 1e9 == pytest.approx(1 / 3, abs=0.002)


@pytest.mark.requirement("C402-096", "C402-034")
def test_reversal_brakes_with_the_one_ramp_and_speeds_up_with_the_other():
    """Through zero: 6049h while the speed falls, 6048h while it grows again."""
    bench = vl_bench()
    bench.write(0x6048, 1500, 1)
    bench.write(0x6042, 900)
    bench.run(1.0)
    samples = bench.observe()
    bench.write(0x6042, -900)
    bench.run(1.2)
    assert rpm(bench) == pytest.approx(-900, abs=1)
    falling = [s for s, (_, _, v) in zip(slopes_rpm_s(samples), samples[40::40], strict=True) if v > 0.01]
    growing = [
        s for s, (_, _, v) in zip(slopes_rpm_s(samples), samples[40::40], strict=True) if -0.14 < v < -0.01
    ]
    assert falling[1:] == pytest.approx([-3000] * (len(falling) - 1), rel=0.02)
    assert growing[1:] == pytest.approx([-1500] * (len(growing) - 1), rel=0.02)


@pytest.mark.requirement("C402-033", "C402-034", "C402-035")
def test_bits_of_the_ramp():
    """Bit 4 = 0 brakes as 605Dh says, bit 5 = 0 freezes the output of the ramp, bit 6 = 0 puts 0 on its
    input.
    """
    bench = vl_bench()
    bench.write(0x6084, 6_000_000)
    bench.write(0x6042, 1200)
    bench.run(0.2)
    bench.control(RUN & ~0x20, 0.3)
    frozen = rpm(bench)
    assert frozen == pytest.approx(606, abs=10)
    bench.control(RUN, 0.3)
    assert rpm(bench) == pytest.approx(1200, abs=1)
    bench.control(RUN & ~0x40, 0.2)
    assert rpm(bench) == pytest.approx(600, abs=10)
    bench.run(0.3)
    assert bench.drive.core.velocity == pytest.approx(0.0, abs=1e-3)
    bench.control(RUN, 0.5)
    assert rpm(bench) == pytest.approx(1200, abs=1)
    bench.write(0x6049, 6000, 1)
    bench.control(RUN & ~0x10, 0.1)
    assert rpm(bench) == pytest.approx(600, abs=15)
    bench.run(0.2)
    assert bench.drive.core.velocity == pytest.approx(0.0, abs=1e-3)
    assert bench.state is S.OPERATION_ENABLED
    assert bench.read(0x6043) == 0


@pytest.mark.requirement("C402-033")
def test_without_the_bits_the_target_does_not_count():
    """000Fh alone enables the drive, but the target needs bits 4, 5 and 6."""
    bench = DriveBench(frictionless())
    bench.write(0x6042, 500)
    bench.enable(2)
    bench.run(0.5)
    assert rpm(bench) == pytest.approx(0.0, abs=0.01)
    bench.control(RUN, 0.5)
    assert rpm(bench) == pytest.approx(500, abs=1)


@pytest.mark.requirement("C402-044", "C402-046", "C402-047")
def test_mode_bits_of_the_status_word_stay_zero():
    """vl: bits 10, 12 and 13 are reserved, also at the target, in a halt and in a quick stop."""
    bench = vl_bench()
    bench.write(0x605A, 6)
    seen = [bench.status]
    bench.write(0x6042, 600)
    for word in (RUN, RUN, RUN | 0x100, RUN | 0x100, 0x02, 0x02):
        bench.control(word, 0.3)
        seen.append(bench.status)
    assert bench.state is S.QUICK_STOP_ACTIVE
    assert all(not status & 0x3400 for status in seen)


@pytest.mark.requirement("C402-096", "C402-182", "C402-183", "C402-045")
@pytest.mark.parametrize(
    ("target", "expected"),
    [(5, 100), (100, 100), (450, 450), (900, 500), (0, 0), (-5, -40), (-40, -40), (-90, -90), (-3000, -300)],
)
def test_minimum_and_maximum_amount(target, expected):
    """6047h bounds the amount for each direction, 0 stays 0; bit 11 tells that the target is not what was
    asked.
    """
    bench = vl_bench()
    for sub, value in enumerate((100, 500, 40, 300), 1):
        bench.write(0x6047, value, sub)
    bench.write(0x6042, target)
    bench.run(0.4)
    assert rpm(bench) == pytest.approx(expected, abs=0.2)
    assert bool(bench.status & 0x800) == (target != expected)


@pytest.mark.requirement("C402-182")
def test_6046h_sets_both_directions():
    """6046h:1 and :2 are the minimum and maximum amount of 6047h for both directions, also as defaults of a
    drive.
    """
    bench = vl_bench()
    bench.write(0x6046, 50, 1)
    bench.write(0x6046, 700, 2)
    assert [bench.read(0x6047, sub) for sub in range(1, 5)] == [50, 700, 50, 700]
    bench.write(0x6042, -2000)
    bench.run(0.5)
    assert rpm(bench) == pytest.approx(-700, abs=1)
    configured = DriveBench(frictionless().with_objects({(0x6046, 2): 800}))
    assert [configured.read(0x6047, sub) for sub in range(1, 5)] == [0, 800, 0, 800]


@pytest.mark.requirement("C402-096", "C402-187", "C402-188", "C402-180", "C402-181")
def test_factors():
    """604Ch 1/10 and 604Bh -3/2: 6042h = 1000 is -150 rpm, and 6043h and 6044h show the units of 6042h."""
    bench = vl_bench()
    bench.write(0x604C, 10, 2)
    bench.write(0x604B, -3, 1)
    bench.write(0x604B, 2, 2)
    bench.write(0x6042, 1000)
    bench.run(0.3)
    assert rpm(bench) == pytest.approx(-150, abs=0.1)
    assert bench.read(0x6043) == 1000
    assert bench.read(0x6044) == pytest.approx(1000, abs=2)
    for index in (0x604B, 0x604C):
        for sub in (1, 2):
            with pytest.raises(SdoAbort) as refusal:
                bench.write(index, 0, sub)
            assert refusal.value.code == 0x06090030


@pytest.mark.requirement("C402-189", "C402-190", "C402-192")
def test_percentages():
    """6052h = 8192 is half of 604Eh and sets 6042h, 6042h sets 6052h; 6053h to 6055h show demand, actual,
    manipulated.
    """
    bench = vl_bench()
    bench.write(0x604E, 2000)
    bench.write(0x6052, 8192)
    assert bench.read(0x6042) == 1000
    bench.run(0.5)
    assert rpm(bench) == pytest.approx(1000, abs=1)
    for index in (0x6053, 0x6054, 0x6055):
        assert bench.read(index) == pytest.approx(8192, abs=3)
    bench.write(0x6042, -500)
    assert bench.read(0x6052) == -4096
    bench.write(0x604E, 1000)
    assert bench.read(0x6052) == -8192
    for index, value in ((0x604E, 0), (0x604D, 0), (0x604D, 3)):
        with pytest.raises(SdoAbort):
            bench.write(index, value)


@pytest.mark.requirement("C402-191", "C402-184", "C402-185", "C402-186")
@pytest.mark.parametrize(
    ("time_object", "ramp_object"), [(0x604F, 0x6048), (0x6050, 0x6049), (0x6051, 0x604A)]
)
def test_ramp_times_and_ramps_are_one(time_object, ramp_object):
    """604Fh, 6050h, 6051h: time from zero to 604Eh, ms; the last written of time and delta speed / delta time
    counts.
    """
    bench = vl_bench()
    for time_ms in (0, 1, 700, 1000, 2500, 65_000_000, 0xFFFFFFFF):
        bench.write(time_object, time_ms)
        speed, time = bench.read(ramp_object, 1), bench.read(ramp_object, 2)
        assert bench.read(time_object) == time_ms
        if 0 < time_ms < 100_000:
            assert speed / time == pytest.approx(3000 / time_ms * 1000, rel=1e-9)
        elif not time_ms:
            assert time == 0
    bench.write(ramp_object, 6000, 1)
    bench.write(ramp_object, 3, 2)
    assert bench.read(time_object) == 1500
    bench.write(0x604E, 1000)
    assert bench.read(time_object) == 500
    assert (bench.read(ramp_object, 1), bench.read(ramp_object, 2)) == (6000, 3)


@pytest.mark.requirement("C402-191")
def test_ramp_time_acts():
    """604Fh = 2000 ms with 604Eh = 3000 rpm: 600 rpm after 0.4 s; 0 stands for the limit 60C5h."""
    bench = vl_bench()
    bench.write(0x604F, 2000)
    bench.write(0x6042, 1200)
    bench.run(0.4)
    assert rpm(bench) == pytest.approx(600, abs=4)
    bench.write(0x60C5, 20_000_000)
    bench.write(0x604F, 0)
    bench.run(0.035)
    assert rpm(bench) == pytest.approx(1200, abs=5)


@pytest.mark.requirement("C402-074", "C402-064", "C402-063", "C402-186")
@pytest.mark.parametrize(("option", "time_s"), [(1, 0.9 / 3), (2, 0.9 / 9)])
@pytest.mark.parametrize("how", ["halt", "quick stop"])
def test_stops_use_the_ramps_of_vl(option, time_s, how):
    """Slow-down ramp 6049h (3000 rpm/s), quick-stop ramp 604Ah (9000 rpm/s), not those of pv."""
    bench = vl_bench()
    bench.write(0x604A, 9000, 1)
    bench.write(0x605D, option)
    bench.write(0x605A, option + 4)
    bench.write(0x6042, 900)
    bench.run(0.5)
    start = bench.scheduler.now
    bench.control(RUN | 0x100 if how == "halt" else 0x02, 0.0)
    bench.until(lambda: abs(rpm(bench)) < 0.5, 2.0)
    assert (bench.scheduler.now - start) / 1e9 == pytest.approx(time_s, abs=0.006)
    if how == "halt":
        bench.run(0.1)
        bench.control(RUN, 0.5)
        assert rpm(bench) == pytest.approx(900, abs=1)


@pytest.mark.requirement("C402-165")
def test_polarity_of_the_velocity():
    """607Eh bit 6: 6042h, 6043h and 6044h are turned together, and so are the limits of the directions."""
    bench = DriveBench(frictionless())
    bench.write(0x607E, 0x40)
    bench.write(0x6047, 300, 2)
    bench.enable(2)
    bench.control(RUN)
    bench.write(0x6042, 1000)
    bench.run(0.5)
    assert rpm(bench) == pytest.approx(-300, abs=1)
    assert bench.read(0x6043) == 300
    assert bench.read(0x6044) == pytest.approx(300, abs=1)
    assert bench.read(0x6054) > 0


@pytest.mark.requirement("C402-284", "C402-292", "C402-192")
def test_over_the_bus():
    """Setpoint and ramp bits by RPDO6 as it is mapped by default, the actual velocity by TPDO6."""
    bench = DriveBench(frictionless())
    bench.enable(2)
    seen: list[bytes] = []
    bench.master.subscribe(0x471, lambda data, _time: seen.append(bytes(data)))
    bench.write(0x1405, 0x471 + 0x100, 1)
    bench.write(0x1805, 10, 5)
    bench.write(0x1805, 0x40000471, 1)
    bench.master.nmt(NmtCommand.START, 1)
    bench.run(0.01)
    bench.master.send(0x571, bytes((RUN, 0)) + (-600).to_bytes(2, "little", signed=True))
    bench.run(0.5)
    assert rpm(bench) == pytest.approx(-600, abs=1)
    assert bench.read(0x6052) == round(-600 * 16383 / 3000)
    assert int.from_bytes(seen[-1][2:4], "little", signed=True) == pytest.approx(-600, abs=1)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-096")
@settings(max_examples=12, deadline=None)
@given(
    targets=st.lists(st.tuples(st.integers(-3500, 3500), st.floats(0.01, 0.3)), min_size=2, max_size=6),
    up=st.integers(500, 9000),
    down=st.integers(500, 9000),
)
def test_the_ramp_is_never_steeper_than_asked(targets, up, down):
    """Any sequence of targets: the demand rises with 6048h at most, falls with 6049h at most, within 6046h,
    to the last one.
    """
    bench = vl_bench(endless())
    bench.write(0x6048, up, 1)
    bench.write(0x6049, down, 1)
    demands = [0.0]
    bench.scheduler.every(
        bench.drive.config.servo_period_ns,
        lambda: demands.append(bench.drive.core.precontrol_velocity * 60 / 6.283185307179586),
        priority=5,
    )
    for target, wait in targets:
        bench.write(0x6042, target)
        bench.run(wait)
    for a, b in pairwise(demands):
        rising = abs(b) > abs(a) and a * b >= 0
        assert (
            abs(b - a) <= (up if rising else max(up, down) if a * b < 0 else down) * 0.00025 * 1.0001 + 1e-9
        )
        assert abs(b) <= 3000 * 1.0001
    bench.run(6100 / min(up, down))
    last = max(-3000, min(3000, targets[-1][0]))
    assert rpm(bench) == pytest.approx(last, abs=1)
    assert bool(bench.status & 0x800) == (last != targets[-1][0])
