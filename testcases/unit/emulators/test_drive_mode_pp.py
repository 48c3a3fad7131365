"""Profile position: rotary axes, relative targets, profile types, end velocity, and any sequence of
setpoints.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.cia402 import DriveConfig, RotaryAxisConfig
from fieldbus.canopen import NmtCommand, SdoAbort
from fieldbus.cia402 import DriveState as S
from testcases.unit.emulators.conftest import DriveBench

REV = 131072
DT = 0.00025


def pp_bench(*, turn: tuple[int, int] | None = None, **objects: int) -> DriveBench:
    """Return a bench in pp, 1200 rpm and 6000 rpm/s, on an endless axis; `turn`: 607Bh in degrees of the
    motor.
    """
    config = replace(
        DriveConfig.reference(), mechanics=RotaryAxisConfig(coulomb_friction=0.0, viscous_friction=0.0)
    )
    if turn is not None:
        config = config.with_objects({(0x6092, 1): 360, (0x607B, 1): turn[0], (0x607B, 2): turn[1]})
    bench = DriveBench(config)
    bench.configure({0x6081: 1_200_000, 0x6083: 6_000_000, 0x6084: 6_000_000})
    bench.configure({int(key[1:], 16): value for key, value in objects.items()})
    bench.enable(1)
    return bench


def degrees(bench: DriveBench) -> float:
    """Return the true angle of the load, not wrapped."""
    return math.degrees(bench.drive.mechanics.position)


def move(bench: DriveBench, target: int, word: int = 0x1F, wait: float = 1.0) -> None:
    """Give a setpoint and wait."""
    bench.write(0x6040, word & ~0x10)
    bench.write(0x607A, target)
    bench.control(word, wait)
    bench.control(word & ~0x10)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-094", "C402-164", "C402-219", "C402-264")
@pytest.mark.parametrize(
    ("option", "targets", "angles"),
    [
        (0, (350, 10, 90, 350), (350, 10, 90, 350)),
        (1, (350, 350, 300, 10, 10), (-10, -10, -60, -350, -350)),
        (2, (350, 350, 300, 10), (350, 350, 660, 730)),
        (3, (350, 10, 170, 200, 330), (-10, 10, 170, 200, 330)),
    ],
    ids=["as linear", "only negative", "only positive", "shortest"],
)
def test_directions_on_a_rotary_axis(option, targets, angles):
    """60F2h bits 7..6 with 607Bh = 0..359: where the axis goes, and 6064h and 6062h wrap."""
    bench = pp_bench(turn=(0, 359), _60F2=option << 6)
    for target, angle in zip(targets, angles, strict=True):
        move(bench, target)
        assert degrees(bench) == pytest.approx(angle, abs=0.05)
        assert bench.read(0x6062) == target
        assert bench.read(0x6064) == target
        assert bench.status & 0x400


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-164")
def test_positions_wrap_in_motion():
    """6062h and 6064h stay in the range while the axis turns on, and the following error does not see the
    wrap.
    """
    bench = pp_bench(turn=(-180, 179), _6065=20, _6066=0)
    bench.configure({0x6081: 600_000})
    seen: list[tuple[int, int, int]] = []
    bench.scheduler.every(
        1_000_000, lambda: seen.append((bench.read(0x6062), bench.read(0x6064), bench.read(0x60F4)))
    )
    bench.write(0x6040, 0x4F)
    move(bench, 3600, word=0x5F, wait=2.0)
    assert degrees(bench) == pytest.approx(3600, abs=0.05)
    assert {sign for demand, _, _ in seen for sign in (demand > 90, demand < -90)} == {True, False}
    for demand, actual, error in seen:
        assert -180 <= demand <= 179
        assert -180 <= actual <= 179
        assert abs(error) <= 4
    assert bench.state is S.OPERATION_ENABLED
    assert bench.read(0x6064) == 0


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-093", "C402-094")
def test_relative_targets_of_a_rotary_axis_are_ways():
    """Bit 6: over several turns and back, from the previous target, whatever bits 7..6 of 60F2h say."""
    bench = pp_bench(turn=(0, 359), _60F2=0x40)
    bench.write(0x6040, 0x4F)
    for way, angle in ((800, 800), (-30, 770), (-1000, -230), (0, -230)):
        move(bench, way, word=0x5F, wait=1.5)
        assert degrees(bench) == pytest.approx(angle, abs=0.05)
        assert bench.read(0x6064) == angle % 360


@pytest.mark.requirement("C402-164")
def test_targets_outside_of_the_range():
    """By SDO 06090030h; by PDO ignored with the warning bit until a good one comes."""
    bench = pp_bench(turn=(0, 359))
    for target in (360, -1, 0x7FFFFFFF):
        with pytest.raises(SdoAbort) as refusal:
            bench.write(0x607A, target)
        assert refusal.value.code == 0x06090030
    move(bench, 100)
    bench.write(0x1401, 1 << 31, 1)
    bench.map_rpdo(1, (0x60400010, 0x607A0020), 255)
    bench.master.nmt(NmtCommand.START, 1)
    bench.run(0.01)

    def send(word: int, target: int) -> None:
        bench.master.send(0x201, word.to_bytes(2, "little") + target.to_bytes(4, "little"))
        bench.run(0.5)

    send(0x0F, 400)
    assert bench.status & 0x80
    assert bench.read(0x607A) == 100
    send(0x1F, 400)
    assert degrees(bench) == pytest.approx(100, abs=0.05)
    send(0x0F, 30)
    assert not bench.status & 0x80
    send(0x1F, 30)
    assert degrees(bench) == pytest.approx(30, abs=0.05)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-164", "C402-219")
def test_the_range_itself():
    """607Bh: not while enabled (08000022h), minimum above maximum 06090036h, equal or the defaults: off."""
    bench = pp_bench(turn=(0, 359))
    for sub, value in ((1, 5), (2, 400)):
        with pytest.raises(SdoAbort) as refusal:
            bench.write(0x607B, value, sub)
        assert refusal.value.code == 0x08000022
    bench.control(0x00)
    with pytest.raises(SdoAbort) as refusal:
        bench.write(0x607B, 360, 1)
    assert refusal.value.code == 0x06090036
    for low, high in ((359, 359), (-0x80000000, 0x7FFFFFFF)):
        bench.write(0x607B, high, 2)
        bench.write(0x607B, low, 1)
        bench.run(0.002)
        bench.write(0x607A, 100_000)
        assert bench.drive.axis.units.turn == 0


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-164", "C402-100")
def test_csp_goes_round():
    """csp: the next target beyond the end of the range is the near one, in both directions."""
    bench = pp_bench(turn=(0, 359))
    bench.control(0x00)
    bench.start_cyclic(8)
    bench.enable_cyclic()
    for angle in (*range(0, 1000, 2), *range(1000, -500, -2)):
        bench.target = angle % 360
        bench.run(0.004)
    bench.run(0.3)
    assert degrees(bench) == pytest.approx(-498, abs=0.1)
    assert bench.read(0x6064) == -498 % 360


@pytest.mark.requirement("C402-093", "C402-035", "C402-264")
@pytest.mark.parametrize("origin", [0, 1, 2])
def test_relative_to_target_demand_or_actual(origin):
    """60F2h bits 1..0 with a blocked shaft, so that target, demand and actual position all differ."""
    bench = pp_bench(_60F2=origin)
    move(bench, 20 * REV, wait=0.5)
    bench.drive.jam(True)
    bench.run(0.1)
    target, demand, actual = 20 * REV, bench.read(0x6062), bench.read(0x6064)
    assert target - demand > REV
    assert demand - actual > REV
    bench.write(0x607A, -3 * REV)
    bench.control(0x7F, 0.0015)
    bench.drive.jam(False)
    bench.control(0x6F, 3.0)
    expected = (target, demand, actual)[origin] - 3 * REV
    assert bench.read(0x6064) == pytest.approx(expected, abs=REV // 5 if origin == 1 else 300)


@pytest.mark.requirement("C402-264", "C402-093")
@pytest.mark.parametrize("value", [3, 4, 8, 0x10, 0x20, 0x100, 0x8000])
def test_reserved_bits_of_the_positioning_option(value):
    """60F2h: what the drive does not do is 06090030h."""
    with pytest.raises(SdoAbort) as refusal:
        pp_bench().write(0x60F2, value)
    assert refusal.value.code == 0x06090030


@pytest.mark.requirement("C402-095", "C402-229")
@pytest.mark.parametrize(("kind", "stretch"), [(0, 1.0), (1, math.pi / 2), (2, 1.875)])
def test_profile_types(kind, stretch):
    """6086h: the ramps of sin² and jerk-free take pi/2 and 15/8 times as long, and are steepest at 6083h and
    6084h.
    """
    bench = pp_bench(_6086=kind, _6084=3_000_000)
    noted: list[float] = []
    bench.scheduler.every(
        bench.drive.config.servo_period_ns,
        lambda: noted.append(bench.drive.core.precontrol_velocity),
        priority=5,
    )
    move(bench, 12 * REV, wait=2.5)
    assert bench.read(0x6064) == pytest.approx(12 * REV, abs=1)
    top = max(noted)
    assert top == pytest.approx(1200 / 60 * math.tau, rel=1e-4)
    moving = [i for i, v in enumerate(noted) if v > 0]
    cruising = [i for i, v in enumerate(noted) if v > top * (1 - 1e-9)]
    assert (cruising[0] - moving[0]) * DT == pytest.approx(0.2 * stretch, rel=0.02)
    assert (moving[-1] - cruising[-1]) * DT == pytest.approx(0.4 * stretch, rel=0.02)
    slopes = [(b - a) / DT / math.tau * 60 for a, b in pairwise(noted)]
    assert max(slopes) == pytest.approx(6000, rel=2e-3)
    assert min(slopes) == pytest.approx(-3000, rel=2e-3)
    steps = [abs(b - a) for a, b in pairwise(slopes)]
    if kind:
        assert max(steps) < 6000 * 0.03  # no step of the acceleration
        halfway = noted[(moving[0] + cruising[0]) // 2]
        assert halfway == pytest.approx(top / 2, rel=0.03)
    else:
        assert max(steps) == pytest.approx(6000, rel=0.01)


@pytest.mark.requirement("C402-095", "C402-243", "C402-244")
def test_jerks_of_both_ramps():
    """6086h = 3 with 60A3h = 2: 60A4h:1 holds the jerk while speeding up, 60A4h:2 while braking."""
    bench = pp_bench(_6086=3, _60A3=2)
    bench.write(0x60A4, 600_000_000, 1)
    bench.write(0x60A4, 60_000_000, 2)
    noted: list[float] = []
    bench.scheduler.every(
        bench.drive.config.servo_period_ns,
        lambda: noted.append(bench.drive.core.precontrol_velocity),
        priority=5,
    )
    move(bench, 12 * REV, wait=2.5)
    assert bench.read(0x6064) == pytest.approx(12 * REV, abs=1)
    slopes = [(b - a) / DT / math.tau * 60 for a, b in pairwise(noted)]
    jerks = [(b - a) / DT for a, b in pairwise(slopes)]
    middle = noted.index(max(noted))
    assert max(abs(j) for j in jerks[:middle]) <= 600_000 * 1.01
    assert max(abs(j) for j in jerks[middle:]) == pytest.approx(60_000, rel=0.05)


@pytest.mark.requirement("C402-095", "C402-226")
@pytest.mark.parametrize("kind", [0, 1, 2])
def test_end_velocity(kind):
    """6082h: the target is passed with it; when nothing follows, the axis comes to rest behind the target
    with 6084h.
    """
    bench = pp_bench(_6082=300_000, _6086=kind)
    samples = bench.observe()
    move(bench, 5 * REV, wait=2.0)
    passing = next(v for _, p, v in samples if p >= 5 * math.tau)
    assert passing == pytest.approx(300 / 60 * math.tau, rel=0.02)
    stretch = {0: 1.0, 1: math.pi / 2, 2: 1.875}[kind]
    behind = 0.5 * (300 / 60) ** 2 / (6000 / 60) * stretch
    assert degrees(bench) / 360 == pytest.approx(5 + behind, abs=0.01)
    assert bench.drive.core.standing


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-095", "C402-257")
def test_velocity_limits_of_the_directions():
    """60C8h and 60C9h hold each direction back; a lower limit above zero starts no motion."""
    bench = pp_bench(_60C9=500_000, _60C8=-200_000)
    samples = bench.observe()
    move(bench, 4 * REV)
    move(bench, 0, wait=2.0)
    rpm = [v / math.tau * 60 for _, _, v in samples]
    assert max(rpm) == pytest.approx(500, rel=0.01)
    assert min(rpm) == pytest.approx(-200, rel=0.01)
    bench.write(0x60C8, 100_000)
    bench.run(0.3)
    assert bench.drive.core.standing
    assert bench.read(0x6064) == pytest.approx(0, abs=1)


@pytest.mark.requirement("C402-281", "C402-091")
def test_set_point_and_edge_in_one_pdo():
    """RPDO3 as it is mapped by default: the target that comes with the edge of bit 4 counts, not the one
    before.
    """
    bench = pp_bench()
    bench.write(0x1402, 255, 2)
    bench.master.nmt(NmtCommand.START, 1)
    bench.run(0.01)
    for target in (2 * REV, 5 * REV):
        for word in (0x0F, 0x1F):
            value = target if word == 0x1F else 0
            bench.master.send(0x401, word.to_bytes(2, "little") + value.to_bytes(4, "little"))
            bench.run(0.01)
        bench.run(1.0)
        assert bench.read(0x6064) == pytest.approx(target, abs=1)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-091", "C402-092", "C402-093", "C402-095")
@settings(max_examples=25, deadline=None)
@given(
    steps=st.lists(
        st.tuples(
            st.integers(-12, 12),
            st.sampled_from([0x1F, 0x3F, 0x5F, 0x7F, 0x21F]),
            st.integers(2, 400),
            st.integers(100, 1500),
        ),
        min_size=1,
        max_size=6,
    ),
    kind=st.integers(0, 3),
    acceleration=st.integers(1500, 20_000),
    deceleration=st.integers(1500, 20_000),
)
def test_any_sequence_of_set_points(steps, kind, acceleration, deceleration):
    """Queued, immediate, relative and blended setpoints at any time, with any profile type.

    The demand never leaves the limits of speed and acceleration and has no jump, and the axis ends on the
    last target that was acknowledged, with bit 10.
    """
    bench = pp_bench(_6086=kind, _6083=acceleration * 1000, _6084=deceleration * 1000)
    bench.write(0x60A4, 200_000_000, 1)
    core = bench.drive.core
    noted: list[tuple[float, float]] = []
    bench.scheduler.every(
        bench.drive.config.servo_period_ns,
        lambda: noted.append((core.precontrol_velocity, core.position_command)),
        priority=5,
    )
    target = 0
    for revolutions, word, milliseconds, speed in steps:
        bench.write(0x6081, speed * 1000)
        bench.control(word & ~0x10)
        accepted = not bench.status & 0x1000
        bench.write(0x607A, revolutions * REV)
        bench.control(word, milliseconds / 1000)
        if accepted:
            target = target + revolutions if word & 0x40 else revolutions
    bench.control(0x0F)
    bench.until(lambda: bench.status & 0x400, 90.0)
    bench.run(0.2)
    assert bench.read(0x6064) == pytest.approx(target * REV, abs=2)
    fastest = max(speed for *_, speed in steps) / 60 * math.tau
    steepest = max(acceleration, deceleration) / 60 * math.tau * DT
    for (v0, p0), (v1, p1) in pairwise(noted):
        assert abs(v1) <= fastest * (1 + 1e-9)
        assert abs(v1 - v0) <= steepest * 1.001 + 1e-6
        assert abs(p1 - p0 - 0.5 * (v0 + v1) * DT) <= steepest * DT + 1e-6
