"""Interpolated position mode (ip): buffer, periods, starvation, halt, by true motion."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.cia402 import DriveConfig
from emulators.drive.cia402.modes import InterpolationBuffer
from fieldbus.canopen import NmtCommand, SdoAbort
from fieldbus.cia402 import DriveState as S
from fieldbus.clock import MS
from testcases.unit.emulators.conftest import DriveBench

REV = 131072
STEP = 2000
"""Increments per period of 4 ms: 229 rpm."""
INTERPOLATE = 0x1F


def ip_bench(*, size: int = 0, organisation: int = 0, config: DriveConfig | None = None) -> DriveBench:
    """Return a bench in ip, enabled, bit 4 still 0; `size` > 0 enables a buffer of that size."""
    bench = DriveBench(config or DriveConfig.reference())
    if size:
        bench.write(0x60C4, size, 2)
        bench.write(0x60C4, organisation, 3)
        bench.write(0x60C4, 1, 6)
    bench.enable(7)
    return bench


def put(bench: DriveBench, *positions: int) -> None:
    for position in positions:
        bench.write(0x60C1, position, 1)


def refused(bench: DriveBench, index: int, value: int, sub: int = 0) -> int:
    with pytest.raises(SdoAbort) as refusal:
        bench.write(index, value, sub)
    return refusal.value.code


@pytest.mark.requirement("C402-083", "C402-099", "C402-172", "C402-253", "C402-033", "C402-046")
def test_one_set_point_per_period():
    """Bit 4 starts; every 4 ms (60C2h) one setpoint of the buffer is reached in a straight line; bit 12
    tells of it.
    """
    bench = ip_bench(size=16)
    put(bench, *(STEP * n for n in range(1, 11)))
    bench.run(0.05)
    assert bench.read(0x6062) == 0
    assert bench.status & 0x1400 == 0x0400
    start = bench.scheduler.now
    bench.control(INTERPOLATE, 0.0)
    bench.until(lambda: bench.status & 0x1000, 0.01)
    for n in range(1, 10):
        bench.until(lambda n=n: bench.read(0x6062) >= STEP * n, 0.01)
        assert (bench.scheduler.now - start) / 1e6 == pytest.approx(4 * n, abs=1.3)
        assert bench.status & 0x1400 == 0x1000
    assert bench.drive.core.velocity * REV / 6.283185 * 0.004 == pytest.approx(STEP, rel=0.02)
    bench.run(0.3)
    assert bench.read(0x6064) == pytest.approx(10 * STEP, abs=1)


@pytest.mark.requirement("C402-099", "C402-041")
def test_an_empty_buffer_holds_and_warns():
    """Empty: the axis stays at the last setpoint, bit 12 = 0, bit 7 = 1, EMCY FF70h; a new one goes on."""
    bench = ip_bench(size=4)
    put(bench, 500, 1000)
    bench.control(INTERPOLATE, 0.3)
    assert bench.read(0x6064) == pytest.approx(1000, abs=1)
    assert bench.status & 0x1480 == 0x0480
    assert [code for code, _ in bench.emcys] == [0xFF70]
    assert bench.state is S.OPERATION_ENABLED
    put(bench, 1500)
    bench.until(lambda: bench.status & 0x1480 == 0x1000, 0.006)
    bench.run(0.001)
    assert [code for code, _ in bench.emcys] == [0xFF70, 0]
    bench.run(0.3)
    assert bench.read(0x6062) == 1500
    assert bench.read(0x6064) == pytest.approx(1500, abs=10)  # friction holds it
    assert bench.status & 0x1080 == 0x0080
    bench.control(0x0F, 0.01)
    assert not bench.status & 0x80


@pytest.mark.requirement("C402-099")
def test_a_buffer_that_runs_empty_at_speed_brakes_with_60c6h():
    """The axis cannot stop at once: it brakes with 60C6h and comes back to the last setpoint."""
    bench = ip_bench(size=16)
    bench.write(0x60C6, 6_000_000)
    put(bench, *(STEP * n for n in range(1, 17)))
    bench.control(INTERPOLATE, 0.1)
    samples = bench.observe()
    bench.run(0.6)
    assert bench.read(0x6064) == pytest.approx(16 * STEP, abs=1)
    assert max(position for _, position, _ in samples) > 16 * STEP / REV * 0.01
    assert bench.status & 0x400


@pytest.mark.requirement("C402-172", "C402-255")
def test_first_in_first_out():
    """60C4h:3 = 0: setpoints come out in order; a full buffer refuses with 08000022h and the warning bit."""
    bench = ip_bench(size=3)
    put(bench, 100, 200, 300)
    assert refused(bench, 0x60C1, 400, 1) == 0x08000022
    bench.run(0.002)
    assert bench.status & 0x80
    bench.control(INTERPOLATE, 0.1)
    assert bench.read(0x6062) == 300
    put(bench, 250)
    bench.run(0.05)
    assert bench.read(0x6062) == 250


@pytest.mark.requirement("C402-172", "C402-255")
def test_ring():
    """60C4h:3 = 1: a full ring gives the oldest place away; 60C4h:4 moves the next setpoint to another
    place.
    """
    bench = ip_bench(size=3, organisation=1)
    put(bench, 100, 200, 300, 400)
    assert bench.read(0x60C4, 4) == 1
    visited = set()
    bench.scheduler.every(
        bench.drive.config.servo_period_ns,
        lambda: visited.add(bench.drive.axis.demand_position),
        priority=5,
    )
    bench.control(INTERPOLATE, 0.05)
    assert {200, 300, 400} <= visited
    assert bench.read(0x6062) == 400
    bench.control(0x0F)
    put(bench, 500, 600, 700)
    bench.write(0x60C4, 2, 4)
    put(bench, 650)
    visited.clear()
    bench.control(INTERPOLATE, 0.05)
    assert bench.read(0x6062) == 650
    assert max(visited) == 650
    assert 500 in visited


@pytest.mark.requirement("C402-172", "C402-255")
def test_configuration_of_the_buffer():
    """Size 1..60C4h:1, organisation 0/1, record size 1, clear 0/1; each of them empties the buffer; others:
    06090030h.
    """
    bench = ip_bench(size=4)
    assert bench.read(0x60C4, 1) == 16
    for sub, good, bad in (
        (2, (1, 16, 5), (0, 17)),
        (3, (1, 0), (2,)),
        (6, (0, 1), (2, 255)),
        (5, (1,), (0, 2, 4)),
    ):
        for value in good:
            put(bench, 123)
            bench.write(0x60C4, value, sub)
            assert bool(len(bench.drive.function.modes[7].buffer)) == (sub == 5)
        for value in bad:
            assert refused(bench, 0x60C4, value, sub) == 0x06090030
    assert refused(bench, 0x60C4, 3, 4) == 0x06090030  # a queue has no place to choose
    for sub in (5, 6):
        with pytest.raises(SdoAbort) as refusal:
            bench.read(0x60C4, sub)
        assert refusal.value.code == 0x06010001
    assert refused(bench, 0x60C0, 1) == 0x06090030
    assert refused(bench, 0x60C0, -1) == 0x06090030


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-099", "C402-172")
def test_without_a_buffer_the_record_itself_counts():
    """60C4h:6 = 0 (default): the latest 60C1h:1 is taken in each period, by RPDO and SYNC."""
    bench = ip_bench()
    bench.write(0x1401, 1 << 31, 1)
    bench.map_rpdo(1, (0x60400010, 0x60C10120))
    bench.master.nmt(NmtCommand.START, 1)
    bench.master.start_sync(4 * MS)
    position = 0
    for n in range(100):
        position += STEP if n > 3 else 0
        bench.master.send(0x201, (INTERPOLATE).to_bytes(2, "little") + position.to_bytes(4, "little"))
        bench.run(0.004)
        if n > 40:
            assert bench.status & 0x1080 == 0x1000
            assert abs(bench.read(0x60F4)) < 50
    bench.run(0.3)
    assert bench.read(0x6064) == pytest.approx(position, abs=1)
    assert bench.status & 0x1000 == 0


@pytest.mark.requirement("C402-099", "C402-033")
def test_bit_4_stops_and_starts():
    """Bit 4 = 0 brakes and keeps what waits; bit 4 = 1 goes on with the next setpoint."""
    bench = ip_bench(size=16)
    put(bench, *(STEP * n for n in range(1, 17)))
    bench.control(INTERPOLATE, 0.02)
    bench.control(0x0F, 0.3)
    assert bench.drive.core.standing
    assert bench.status & 0x1480 == 0x0400
    held = bench.read(0x6062)
    waiting = len(bench.drive.function.modes[7].buffer)
    assert 8 < waiting < 14
    bench.run(0.2)
    assert bench.read(0x6062) == held
    bench.control(INTERPOLATE, 0.5)
    assert bench.read(0x6064) == pytest.approx(16 * STEP, abs=1)


@pytest.mark.requirement("C402-076", "C402-036", "C402-044")
def test_halt_skips_what_runs_out_meanwhile():
    """Halt: standstill and bit 10; setpoints of that time are not resumed, the release goes on with the
    next.
    """
    bench = ip_bench(size=16)
    bench.write(0x6084, 60_000_000)
    put(bench, *(STEP * n for n in range(1, 17)))
    bench.control(INTERPOLATE, 0.012)
    bench.control(INTERPOLATE | 0x100, 0.03)
    waiting = len(bench.drive.function.modes[7].buffer)
    assert 2 < waiting < 9
    bench.run(0.1)
    assert len(bench.drive.function.modes[7].buffer) == 0
    assert bench.drive.core.standing
    assert bench.status & 0x1400 == 0x0400
    held = bench.read(0x6062)
    assert held < 12 * STEP
    bench.control(INTERPOLATE, 0.1)
    assert bench.read(0x6062) == held
    put(bench, held + 300)
    bench.run(0.3)
    assert bench.read(0x6064) == pytest.approx(held + 300, abs=1)


@pytest.mark.requirement("C402-153", "C402-047")
def test_following_error():
    """ip: |6062h - 6064h| above 6065h for 6066h ms is bit 13 and fault 8611h."""
    bench = ip_bench(size=16)
    bench.configure({0x6065: 300, 0x6066: 10})
    bench.drive.jam(True)
    put(bench, *(STEP * n for n in range(1, 17)))
    bench.control(INTERPOLATE, 0.1)
    assert bench.state is S.FAULT
    assert bench.emcys[0][0] == 0x8611


@pytest.mark.requirement("C402-103", "C402-224")
def test_speed_limit():
    """A setpoint beyond the reach of 6080h in one period: the axis follows at the limit with bit 11 = 1."""
    bench = ip_bench(size=4)
    bench.write(0x6080, 600)
    put(bench, 4 * REV)
    bench.control(INTERPOLATE, 0.2)
    assert bench.drive.core.speed_rpm == pytest.approx(600, rel=0.01)
    assert bench.status & 0x800
    bench.run(1.0)
    assert bench.read(0x6064) == pytest.approx(4 * REV, abs=1)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-172")
@given(
    size=st.integers(1, 16),
    organisation=st.integers(0, 1),
    actions=st.lists(st.one_of(st.integers(-1000, 1000), st.none()), max_size=60),
)
def test_buffer_against_a_list(size, organisation, actions):
    """Any order of writing (number) and taking (None): like a list that refuses, or drops its oldest, when
    full.
    """
    buffer = InterpolationBuffer()
    buffer.configure(size=size, organisation=organisation, enabled=True)
    model: list[int] = []
    for action in actions:
        if action is None:
            assert buffer.take() == (model.pop(0) if model else None)
            continue
        full = len(model) == size
        assert buffer.put(action) == (not full or organisation == 1)
        if full and organisation:
            model.pop(0)
        if not full or organisation:
            model.append(action)
        assert len(buffer) == len(model)
        assert 0 <= buffer.write < size


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-099")
@settings(max_examples=10, deadline=None)
@given(ways=st.lists(st.integers(-700, 700), min_size=1, max_size=16))
def test_any_path_ends_on_its_last_set_point(ways):
    """Setpoints within the limits: each is passed at its time, the last one is held."""
    bench = ip_bench(size=16)
    positions = [sum(ways[: n + 1]) for n in range(len(ways))]
    put(bench, *positions)
    demands: list[int] = []
    bench.control(INTERPOLATE, 0.0)
    bench.scheduler.every(
        bench.drive.config.servo_period_ns,
        lambda: demands.append(bench.drive.axis.demand_position),
        priority=5,
    )
    bench.run(0.004 * len(ways) + 0.4)
    # The demand has passed every corner of the path, in order.
    at = 0
    for position in positions:
        while demands[at] != position:
            at += 1
            assert at < len(demands), position
    assert bench.read(0x6062) == positions[-1]
    assert bench.read(0x6064) == pytest.approx(positions[-1], abs=20)  # friction holds it
