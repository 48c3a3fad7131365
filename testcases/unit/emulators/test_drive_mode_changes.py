"""Changing the mode in motion, between every two modes, and what each mode makes of the motion that it
finds.
"""

from __future__ import annotations

import math
from itertools import pairwise, permutations

import pytest

from fieldbus.canopen import SdoAbort
from fieldbus.cia402 import DriveState as S
from testcases.catalogue import each
from testcases.unit.emulators.moving import MODES, RPM, SLOW, MovingDrive

PERIOD = 0.00025
PAIRS = list(permutations(MODES, 2))


def check_no_jump(old, new):
    bench = MovingDrive()
    bench.set_moving(old)
    if old == 6:
        bench.run(0.4)  # hm has braked; the other way round it is met in motion
    bench.prime(new)
    core = bench.drive.core
    noted = [(core.velocity, core.velocity_demand, core.torque)]
    bench.scheduler.every(
        bench.drive.config.servo_period_ns,
        lambda: noted.append((core.velocity, core.velocity_demand, core.torque)),
        priority=5,
    )
    if new in (2, 7):
        bench.write(0x6040, bench.following_word(new))
    bench.write(0x6060, new)
    bench.run(0.03)
    assert bench.read(0x6061) == new
    braking = SLOW / 60.0 * math.tau
    for (v0, d0, t0), (v1, d1, t1) in pairwise(noted):
        assert abs(v1 - v0) <= braking * PERIOD * 1.3 + 0.02
        assert abs(d1 - d0) <= braking * PERIOD * 1.3 + 0.05
        assert abs(t1 - t0) <= bench.inertia * braking * 1.1 + 0.04
    if old == 6:
        return
    bench.run(0.4)
    assert bench.state is S.OPERATION_ENABLED
    assert bench.rpm == pytest.approx(0.0 if new in (1, 6) else RPM, abs=5)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-089")
def test_no_jump(subtests):
    """Between all modes in motion: velocity, demand and torque go on without a step; then the new mode is in
    control.

    Modes with a velocity or torque of their own go on; pp and hm brake with 6084h (3000 rpm/s). A step of the
    acceleration by 6084h is a step of the torque by inertia * 6084h; nothing larger is allowed but 2 % of
    rated torque.
    """
    for label, values in each(PAIRS):
        with subtests.test(label):
            check_no_jump(*values)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-089", "C402-005")
@pytest.mark.parametrize("new", MODES, ids=MODES.values())
def test_no_motion_at_standstill(new):
    """A mode that is entered at standstill with the setpoints of the standing axis does not move it."""
    bench = MovingDrive()
    bench.enable(3)
    bench.write(0x60FF, 100_000)
    bench.run(0.5)
    bench.write(0x60FF, 0)
    bench.run(0.2)
    bench.write(0x607A, bench.read(0x6064))
    start = bench.drive.mechanics.position
    bench.write(0x6060, new)
    bench.control(bench.following_word(new), 0.3)
    assert bench.read(0x6061) == new
    assert bench.drive.mechanics.position == pytest.approx(start, abs=2e-4)


@pytest.mark.requirement("C402-089", "C402-101", "C402-248")
@pytest.mark.parametrize(("old", "new"), [(9, 10), (10, 9), (9, 3), (3, 9), (8, 1), (10, 4)])
def test_the_torque_offset_is_no_jump(old, new):
    """60B2h holds a load up; when modes with and without it change, the torque goes on."""
    bench = MovingDrive(_60B2=100)
    bench.drive.set_load_force(-0.2)
    bench.enable(3)
    bench.run(0.5)
    bench.prime(8)
    bench.streaming = False
    bench.write(0x607A, bench.read(0x6064))
    # cst and tq: target plus offset is what holds the load.
    bench.write(0x6071, 0 if 10 in (old, new) and 4 not in (old, new) else 100)
    if (old, new) == (10, 4):
        bench.configure({0x6071: 0})
    bench.write(0x6060, old)
    bench.run(0.4 if old != 10 else 0.02)
    if (old, new) == (10, 4):
        bench.write(0x6071, 100)
        bench.write(0x60B2, 0)
        bench.run(0.002)
    noted: list[float] = []
    bench.scheduler.every(
        bench.drive.config.servo_period_ns, lambda: noted.append(bench.drive.core.torque), priority=5
    )
    bench.write(0x6060, new)
    bench.run(0.05)
    assert bench.read(0x6061) == new
    assert noted == pytest.approx([0.2] * len(noted), abs=0.03)


@pytest.mark.requirement("C402-090")
def test_modes_can_be_withheld():
    """6502h without bit 1 (vl): the mode is refused like one that does not exist."""
    bench = MovingDrive()
    bench.drive.slave.values[0x650200] = 0x3ED
    with pytest.raises(SdoAbort) as refusal:
        bench.write(0x6060, 2)
    assert refusal.value.code == 0x06090030
    bench.run(0.002)
    assert bench.status & 0x80
