"""A virtual leading axis that loses its enable: its setpoint and its followers see no step (SYN sections 3.6
and 10).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from testcases.catalogue import each
from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.test_gear_in import FIXTURE

FILTERS = {
    "plain": {},
    "filtered": {"SetpointFilter.DynamicFilter.Mode": 1, "SetpointFilter.DynamicFilter.T1": 0.03},
}


def coupled(own):
    """A follower that has just begun to synchronise to a virtual axis at constant velocity."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE | own)
    rig.enabled().leader_at(200.0)
    rig.job = rig.axis.gear_in(rig.leader, 1, 1, Acceleration=400.0, Jerk=0.0)
    rig.run(0.1)
    return rig


def lose(rig, how):
    """Take the enable of the leading axis away."""
    if how == "alarm":
        rig.leader.object.alarm(421)
    else:
        rig.leader.power(False, stop_mode=how)


@pytest.mark.requirement("SYN-482", "SYN-293")
def test_the_setpoint_never_steps_back(subtests):
    """Whatever takes the enable: the setpoint goes on or stops, the actual value comes to it, and a follower
    that synchronises gets no alarm 608.
    """
    for label, (filtered, how) in each(list(FILTERS), [0, 1, 2, "alarm"]):
        with subtests.test(label):
            rig = coupled(FILTERS[filtered])
            seen = []
            rig.runtime.after_cycle.append(
                lambda rig=rig, seen=seen: seen.append(
                    (rig.leader.var("Position"), rig.leader.var("ActualPosition"))
                )
            )
            lose(rig, how)
            rig.run(0.6)
            for before, after in pairwise(seen):
                assert after[0] >= before[0] - 1e-9
                assert after[1] >= before[1] - 1e-9
                assert after[1] - before[1] <= 1.01 * 200.0 * CYCLE
            assert seen[-1][0] == pytest.approx(seen[-1][1], abs=1e-4)
            assert rig.alarms_of("axis1") == []
            assert rig.job.Busy
