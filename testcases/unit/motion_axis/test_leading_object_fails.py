"""A leading object that is defective or leaves position control, seen by its followers: alarms 601, 603."""

from __future__ import annotations

import pytest

from motion.s7.axis.technology_object import ACTUAL
from testcases.unit.motion_axis.conftest import Rig, TorquePort
from testcases.unit.motion_axis.test_gear_in import SYNCHRONIZING, gear, in_gear, word
from testcases.unit.motion_axis.test_torque_precontrol import INERTIA, PRECONTROL


def open_position_control(rig, on=False):
    rig.leader.object.motion.set_position_control(on)


SERVO = {"VirtualAxis.Mode": 0}


@pytest.mark.requirement("SYN-311", "SYN-025", "SYN-358")
@pytest.mark.parametrize("profile", [0, 1])
def test_position_control_that_is_left_on_the_way(profile):
    """While the follower synchronises, or leaves its leading value: alarm 603 with reaction 4, at once; the
    job ends with 16#8001.
    """
    rig = gear(100.0, Acceleration=100.0, leader=SERVO)
    rig.run(0.1)
    assert word(rig.axis) == SYNCHRONIZING
    open_position_control(rig)
    rig.cycles(2)
    (alarm,) = rig.axis.object.engine.pending
    assert (alarm.number, alarm.reaction, rig.axis.var("ErrorWord.X14")) == (603, 4, True)
    assert (rig.job.ErrorID, rig.job.InGear) == (0x8001, False)
    rig = in_gear(100.0, leader=SERVO)
    out = rig.axis.gear_out(
        rig.axis.var("Position") + 30.0,
        SyncProfileReference=profile,
        MasterStopDistance=40.0,
        Deceleration=200.0,
        Jerk=0.0,
    )
    rig.until(out.start_sync_out)
    open_position_control(rig)
    rig.cycles(2)
    assert (out.ErrorID, rig.alarms_of("axis1")) == (0x8001, [603])


@pytest.mark.requirement("SYN-310", "SYN-358")
@pytest.mark.parametrize("synchronous", [False, True])
def test_a_defective_leading_object(synchronous):
    """Alarm 601 with reaction 2 while it synchronises and in gear, and at the start of a job; afterwards it
    follows again.
    """
    rig = (in_gear if synchronous else gear)(100.0, Acceleration=200.0)
    rig.leader.object.leading_defective = True
    rig.cycles(2)
    (alarm,) = rig.axis.object.engine.pending
    assert (alarm.number, alarm.reaction, rig.job.ErrorID) == (601, 2, 0x8001)
    rig.run(0.5)
    rig.until(rig.axis.reset().done)
    again = rig.axis.gear_in(rig.leader)
    rig.cycles(2)
    assert (again.ErrorID, rig.alarms_of("axis1"), rig.alarms_of("leader")) == (0x8001, [601, 601], [])
    rig.leader.object.leading_defective = False
    rig.run(0.1)
    rig.until(rig.axis.reset().done)
    rig.until(rig.axis.gear_in(rig.leader).in_gear)


@pytest.mark.requirement("SYN-069")
@pytest.mark.parametrize(
    ("mode", "coupling", "doubted"), [(1, ACTUAL, 1), (1, "setpoint", 0), (0, ACTUAL, 0)]
)
def test_torque_precontrol_behind_actual_values(mode, coupling, doubted):
    """A doubt about the configuration, once; the follower works, with its torque."""
    rig = Rig(
        synchronous=True,
        port=TorquePort(),
        variables=INERTIA | PRECONTROL | {"TorquePreControl.Mode": mode},
        leader_variables=SERVO,
    )
    rig.axis.object.couplings = {"leader": coupling}
    rig.runtime.order_axes()
    texts = [event.data["text"] for event in rig.events("axis.doubt") if "SYN-069" in event.data["text"]]
    assert len(texts) == doubted
    rig.enabled().leader_at(50.0)
    torques = []
    rig.runtime.after_cycle.append(lambda: torques.append(abs(rig.port.additive_nm)))
    rig.until(rig.axis.gear_in(rig.leader).in_gear)
    assert (max(torques) > 0.0) is bool(mode)
    assert rig.alarms_of("axis1") == []
