"""A position loop around a first-order speed loop, with and without DSC: what gain, pre-control and
substitute time do (section 8.2).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from testcases.unit.hil.test_hil_profidrive import bench, enabled

pytestmark = pytest.mark.exhaustive

SPEED_LOOP_MS = 20.0
"""Large, so that the cycle of 4 ms counts for little; the largest gain without overshoot is about 1 / (4 * 20
ms) = 12.5 1/s.
"""


def response(*, dsc, kv, kpc=0.0, vtc=0.0):
    """Return overshoot, mm, settling time to 0.05 mm, s (None: not within 2 s), and whether the position
    reversed.
    """
    variables = {
        "PositionControl.EnableDSC": dsc,
        "PositionControl.Kv": kv,
        "PositionControl.Kpc": kpc,
        "DynamicAxisModel.VelocityTimeConstant": vtc,
        "FollowingError.EnableMonitoring": False,
        "PositioningMonitoring.ToleranceTime": 5.0,
    }
    with bench(
        velocity_time_constant_ms=SPEED_LOOP_MS, torque_precontrol=False, variables=variables
    ) as machine:
        axis = enabled(machine)
        began = machine.now_s
        axis.move_relative(20.0, Velocity=100.0, Acceleration=1000.0, Deceleration=1000.0, Jerk=0.0)
        machine.run_for(2.0)
        signal = machine.trace()["drive1.position"]
        rows = [(t - began, v * 1e3) for t, v in zip(signal.time_s, signal.values, strict=True) if t >= began]
    target = rows[0][1] + 20.0
    away = [t for t, v in rows if abs(v - target) > 0.05]
    settled = away[-1] if away[-1] < 1.99 else None
    return max(v for _, v in rows) - target, settled, any(b < a - 0.002 for (_, a), (_, b) in pairwise(rows))


@pytest.mark.requirement("MC-578")
@pytest.mark.parametrize("dsc", [False, True])
def test_gain(dsc):
    """Too low a gain settles late, the right one early without overshoot, too high a gain overshoots."""
    low, right, high = (response(dsc=dsc, kv=kv) for kv in (5.0, 12.0, 30.0))
    assert low[0] < 0.005
    assert right[0] < 0.005
    assert right[1] < 0.5 * low[1]
    assert not right[2]
    assert high[0] > 0.1


@pytest.mark.requirement("MC-578")
def test_substitute_time():
    """With pre-control the axis overshoots unless the substitute time is that of the speed loop; without it
    the time does nothing.
    """
    without = response(dsc=False, kv=8.0, kpc=100.0, vtc=0.0)
    assert without[0] > 0.5
    assert without[2]
    right = response(dsc=False, kv=8.0, kpc=100.0, vtc=SPEED_LOOP_MS * 1e-3)
    assert right[0] < 0.005
    assert not right[2]
    assert right[1] < 0.7
    plain = [response(dsc=False, kv=8.0, kpc=0.0, vtc=vtc) for vtc in (0.0, SPEED_LOOP_MS * 1e-3)]
    assert plain[0][0] < 0.005
    assert plain[1][1] == pytest.approx(plain[0][1], abs=0.1)
