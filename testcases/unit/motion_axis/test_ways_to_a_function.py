"""Ways to a synchronous function and away from it: polynomial and profile by themselves (SYN section 6)."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from motion.kernel.synchronous.ways import DistanceWay
from testcases.unit.motion_axis.conftest import CYCLE
from testcases.unit.motion_axis.override_cells import cam_of
from testcases.unit.motion_axis.test_gear_in import SYNCHRONOUS, places, word
from testcases.unit.motion_axis.test_gear_in_pos import standing, travel

VALUES = st.tuples(st.floats(-100.0, 100.0), st.floats(-3.0, 3.0), st.floats(-0.1, 0.1))


@pytest.mark.requirement("SYN-469", "SYN-120")
@given(
    begin=st.floats(-500.0, 500.0), length=st.floats(1.0, 200.0), sense=st.sampled_from((-1.0, 1.0)),
    first=VALUES, last=VALUES,
)  # fmt: skip
def test_a_polynomial_meets_both_ends(begin, length, sense, first, last):
    """Position and both derivatives, in both directions, with any slopes and curvatures; between the ends the
    derivatives are those of the position.
    """
    end = begin + sense * length
    way = DistanceWay(begin, end, first, last)
    for x, wanted in ((begin, first), (end, last)):
        y, slope, curvature = way.evaluate(x)
        assert (y, slope, curvature) == (
            pytest.approx(wanted[0], abs=1e-7),
            pytest.approx(wanted[1], abs=1e-7),
            pytest.approx(wanted[2], abs=1e-7),
        )
    step = 1e-4 * length
    for share in (0.2, 0.5, 0.9):
        x = begin + share * (end - begin)
        lower, (_, slope, curvature), upper = (way.evaluate(x + one) for one in (-step, 0.0, step))
        assert (upper[0] - lower[0]) / (2.0 * step) == pytest.approx(slope, abs=1e-4)
        assert (upper[1] - lower[1]) / (2.0 * step) == pytest.approx(curvature, abs=1e-4)


def test_a_way_from_a_bent_cam():
    """A cam is left where it is curved: the first cycle of the way out goes on with its velocity and
    acceleration, and the last ones end at rest, in position, velocity and acceleration.
    """
    rig = standing()
    points = [(x, 0.004 * x * x) for x in range(0, 301, 5)]
    cam = cam_of(rig, points, **{"InterpolationSettings.InterpolationMode": 1})
    camming = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=2)
    rig.until(camming.in_sync)
    travel(rig, 50.0)
    rig.run(1.0)
    job = rig.axis.cam_out(80.0, MasterStopDistance=60.0)
    rig.until(job.start_sync_out)
    rig.rows.clear()
    rig.until(job.done)
    rig.run(0.1)
    accelerations, velocities = rig.column("acceleration_setpoint"), rig.column("velocity_setpoint")
    curvature = 0.008 * 50.0 * 50.0
    assert accelerations[0] == pytest.approx(curvature, rel=0.2)
    assert max(abs(b - a) for a, b in pairwise(accelerations)) < 3.0
    assert max(abs(b - a) for a, b in pairwise(velocities)) < 80.0 * CYCLE
    assert (rig.axis.var("Position"), velocities[-1], accelerations[-1]) == (pytest.approx(80.0), 0.0, 0.0)


@pytest.mark.requirement("SYN-159", "SYN-416")
@pytest.mark.parametrize(("velocity", "synchronous"), [(40.0, False), (0.0, True)])
def test_axes_in_place_with_other_velocities(velocity, synchronous):
    """A follower that only passes its synchronous position while the leading axis stands in its own is not
    synchronous: velocities have to agree, too.
    """
    rig = standing(at=0.0, leader_at=100.0)
    if velocity:
        rig.axis.move_velocity(velocity, Acceleration=5000.0, Jerk=0.0)
        rig.run(0.1)
    place = rig.axis.var("Position") + velocity * CYCLE * 2
    job = rig.axis.gear_in_pos(rig.leader, 100.0, place)
    rig.run(0.1)
    assert (word(rig.axis) == SYNCHRONOUS, job.InSync) == (synchronous, synchronous)


@pytest.mark.exhaustive
@pytest.mark.requirement("SYN-104", "SYN-123", "SYN-103")
@settings(max_examples=12)
@given(
    way=st.floats(-60.0, 60.0), speed=st.floats(10.0, 120.0), velocity=st.floats(20.0, 300.0),
    acceleration=st.floats(200.0, 3000.0), numerator=st.integers(-3, 3).filter(bool),
)  # fmt: skip
def test_synchronising_with_dynamic_values_keeps_them(way, speed, velocity, acceleration, numerator):
    """Any way, any speed: velocity and acceleration of the job are kept, and the axis is synchronous at its
    synchronous position; or it waits, because its velocity there would be too high.
    """
    assume(abs(numerator) * speed <= velocity * 0.999 or abs(numerator) * speed > 500.0)
    rig = standing()
    job = rig.axis.gear_in_pos(
        rig.leader, 300.0, way, numerator, 1, SyncProfileReference=0,
        Velocity=velocity, Acceleration=acceleration, Deceleration=acceleration, Jerk=0.0,
    )  # fmt: skip
    travel(rig, speed)
    rig.until(lambda: places(rig)[0] > 299.0, 40.0)
    rig.run(0.1)
    assert job.InSync
    velocities = rig.column("velocity_setpoint")
    assert max(map(abs, velocities)) <= velocity * (1.0 + 1e-9) + 1e-9
    assert max(abs(b - a) for a, b in pairwise(velocities)) <= acceleration * CYCLE * (1.0 + 1e-6) + 1e-6
    x, y = places(rig)
    assert y == pytest.approx(way + numerator * (x - 300.0), abs=1e-8)
