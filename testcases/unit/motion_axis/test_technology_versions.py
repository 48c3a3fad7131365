"""Technology versions V7, V8 and V9 of S7-1500 and S7-1500T: what synchronous operation has in each (SYN
section 1).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

import motion.s7.instructions as instructions
from fieldbus.errors import ConfigurationError
from hil.bench.bench_file import parse
from motion.kernel.cams import Point
from motion.kernel.synchronous import LeadingMotion
from motion.s7.cams import Cam
from motion.s7.compatibility import LEVELS, TECHNOLOGY_ONLY
from motion.s7.variables import VariableAccessError
from testcases.unit.hil.test_bench_gearing import SHAFT
from testcases.unit.motion_axis.conftest import CYCLE, Rig
from testcases.unit.motion_axis.override_cells import cam_of
from testcases.unit.motion_axis.test_gear_in import FIXTURE, places
from testcases.unit.motion_axis.test_gear_in_pos import standing, travel
from testcases.unit.motion_axis.test_leading_objects import behind_belt

INTERFACE = "CrossPlcSynchronousOperation.Interface[{}].EnableLeadingValueOutput"


def errors(rig, name, profiles, **inputs):
    """ErrorIDs of an instruction with these values of its profile."""
    found = []
    for profile in profiles:
        job = getattr(instructions, name)(rig.axis.object, Execute=True)
        job.set(**{"Master": rig.leader.object} if "Master" in job.inputs else {}, **inputs)
        key = "ProfileReference" if "ProfileReference" in job.inputs else "SyncProfileReference"
        job.set(**{key: profile})
        rig.axis.run(job)
        rig.cycles(2)
        found.append(job.ErrorID)
        rig.axis.halt()
        rig.cycles(2)
    return found


@pytest.mark.requirement("SYN-376", "SYN-350", "SYN-013")
@pytest.mark.parametrize(
    ("cpu", "extra"), [("S7-1500T", True), ("S7-1500T V8", False), ("S7-1500T V7", False)]
)
def test_profiles_by_version(cpu, extra):
    """MC_GearInPos 4 and MC_CamIn 7 came with V9.0; reserved ones are 16#8036 or 16#8083 in every version."""
    rig = Rig(synchronous=True, variables=FIXTURE, leader_variables=FIXTURE, cpu=cpu)
    rig.enabled().leader_at(0.0)
    rig.axis.home(0.0)
    rig.cycles(2)
    newest = 0 if extra else 0x8036
    assert errors(rig, "MC_GearInPos", (2, 4, 5, 6)) == [0x8036, newest, 0x8036, 0x8036]
    cam = Cam("cam", points=[Point(0.0, 0.0), Point(100.0, 50.0)], cpu=cpu)
    rig.runtime.add_cam(cam)
    rig.cycles(2)
    found = errors(rig, "MC_CamIn", (8, -1), Cam=cam, MasterStartDistance=10.0)
    assert found == [0x8036, 0x8036]
    assert (errors(rig, "MC_CamIn", (7,), Cam=cam)[0] == 0x8036) is not extra
    rig = standing()
    rig.until(rig.axis.gear_in(rig.leader).in_gear)
    for name in ("MC_OffsetAbsolute", "MC_OffsetRelative"):
        for profile in (0, 3, 4):
            job = getattr(instructions, name)(
                rig.axis.object, Execute=True, ProfileReference=profile, OffsetDistance=1.0
            )
            rig.axis.run(job)
            rig.cycles()
            assert job.ErrorID == 0x8083
    for profile in (2, 3, 4):
        for name in ("MC_GearOut", "MC_CamOut"):
            job = getattr(instructions, name)(rig.axis.object, Execute=True, SyncProfileReference=profile)
            rig.axis.run(job)
            rig.cycles()
            assert job.ErrorID == 0x8036


@pytest.mark.requirement("SYN-008", "SYN-009", "SYN-010", "SYN-011", "SYN-012", "CAM-248")
def test_instructions_by_version():
    """MC_GearIn exists on the S7-1500, everything else on the T alone; the cyclic reading of cams, and the
    scaling of both other instructions that read them, came with V8.0.
    """
    for name, level in LEVELS.items():
        wanted = set() if level.technology else set(TECHNOLOGY_ONLY)
        if level.version == "V7.0":
            wanted.add("MC_GetCamFollowingValueCyclic")
        if name == "S7-1200 G2":
            wanted.add("MC_GearIn")
        assert (name, level.without) == (name, wanted)
    new = ("MasterOffset", "SlaveOffset", "MasterScaling", "SlaveScaling")
    for cpu, absent in (("S7-1500T V7", True), ("S7-1500T V8", False), ("S7-1500T", False)):
        cam = Cam("cam", points=[Point(0.0, 0.0), Point(100.0, 50.0)], cpu=cpu)
        for name, keys in (
            ("MC_GetCamLeadingValue", ("ApproachDirection", *new)),
            ("MC_GetCamFollowingValue", new),
        ):
            for key in keys:
                if absent:
                    with pytest.raises(ConfigurationError, match=f"{name}.{key}: .* technology version V7.0"):
                        getattr(instructions, name)(cam, **{key: 1})
                else:
                    getattr(instructions, name)(cam, **{key: 1})
    for cpu in ("S7-1500", "S7-1500 V8", "S7-1500 V7", "S7-1200 G2"):
        with pytest.raises(ConfigurationError, match="technology CPU"):
            Cam("cam", cpu=cpu)


@pytest.mark.requirement("SYN-071", "SYN-473", "SYN-480")
def test_outputs_for_leading_values_by_version():
    """32 in V9.0, 8 before; they are set with the configuration."""
    Rig(variables={INTERFACE.format(32): True})
    Rig(variables={INTERFACE.format(8): True}, cpu="S7-1500T V8")
    for cpu in ("S7-1500T V8", "S7-1500 V7"):
        with pytest.raises(ConfigurationError, match=r"Interface\[9\].* FALSE: .* has 8 outputs"):
            Rig(variables={INTERFACE.format(9): True}, cpu=cpu)
    with pytest.raises(VariableAccessError, match="read only"):
        Rig().axis.write(INTERFACE.format(1), True)


@pytest.mark.requirement("MC-018", "SYN-077")
def test_a_virtual_axis_of_v7_is_delayed_as_a_simulated_one():
    """Up to V7.0 the actual position lags as in a simulation, from V8.0 by the cycle alone."""

    def lag(cpu, mode):
        rig = Rig(variables={mode: 1, "DynamicAxisModel.VelocityTimeConstant": 0.02}, cpu=cpu)
        rig.enabled()
        rig.until(rig.axis.move_velocity(100.0).in_velocity)
        rig.run(0.5)
        return rig.axis.var("Position") - rig.axis.var("ActualPosition")

    virtual, simulated = "VirtualAxis.Mode", "Simulation.Mode"
    assert lag("S7-1500T V7", virtual) == pytest.approx(lag("S7-1500T V7", simulated))
    assert lag("S7-1500T V8", virtual) == pytest.approx(lag("S7-1500T", virtual))
    assert lag("S7-1500T V8", virtual) < 0.5 * lag("S7-1500T V7", virtual)


def leading(positions, tolerance):
    """Leading positions that a function gets while it is approached in positive direction."""
    given = iter(positions)
    value = [next(given)]
    motion = LeadingMotion(lambda: (value[0], 10.0, 0.0), lambda: True, tolerance=tolerance)
    motion.sense = 1.0
    found = [motion.position]
    for position in given:
        value[0] = position
        motion.step()
        found.append(motion.position)
    return found


@pytest.mark.requirement("SYN-075")
def test_a_way_back_within_the_tolerance_is_held():
    """80.00, 80.05, 79.97, 80.10 with 0.1 mm: the lowest one is held at 80.05; 79.90 is not."""
    assert leading([80.0, 80.05, 79.97, 80.1], 0.1) == [80.0, 80.05, 80.05, 80.1]
    assert leading([80.0, 80.05, 79.90, 80.1], 0.1) == [80.0, 80.05, 79.9, 80.1]


@pytest.mark.requirement("SYN-074", "SYN-348", "SYN-361", "SYN-127")
@pytest.mark.parametrize(("tolerance", "back", "alarms"), [(0.0, 5, [608]), (0.1, 5, []), (0.1, 15, [608])])
@pytest.mark.parametrize("phase", ["gear", "position", "leave"])
def test_hold_tolerance(phase, tolerance, back, alarms):
    """While an axis synchronises, or leaves over a distance: a way back of 0.05 mm is alarm 608 without a
    tolerance, and none with 0.1 mm; 0.15 mm is one.
    """
    rig = behind_belt(20, **{"Settings.SystemDefinedExtrapolation": 0})
    axis = rig.axis
    axis.object.hold_tolerance = tolerance
    axis.home(0.0)
    rig.encoder.home(0.0)
    rig.cycles(2)
    if phase == "leave":
        rig.until(axis.gear_in(rig.encoder).in_gear)
        job = axis.gear_out(axis.var("Position") + 40.0, MasterStopDistance=40.0)
        rig.until(job.start_sync_out)
    elif phase == "gear":
        job = axis.gear_in(rig.encoder, 2, 1, Acceleration=50.0, Jerk=0.0)
    else:
        job = axis.gear_in_pos(rig.encoder, 20.0, 0.0, SyncProfileReference=3, MasterStartDistance=40.0)
        rig.until(job.start_sync)
    rig.run(0.2)
    rig.belt.step = -back
    rig.cycles()
    rig.belt.step = 20
    rig.run(3.0)
    assert rig.alarms_of("axis1") == alarms
    reached = {"gear": "InGear", "position": "InSync", "leave": "Done"}[phase]
    assert getattr(job, reached) is not bool(alarms)
    if phase != "leave" and not alarms:
        rig.belt.step = -20
        rig.run(0.1)  # once it is synchronous every way back is followed
        assert axis.var("Velocity") < 0.0


@pytest.mark.requirement("SYN-476", "SYN-006")
def test_the_tolerance_is_a_key_of_the_bench():
    """It belongs to synchronous axes of V9.0."""
    tolerant = SHAFT.replace('type = "synchronous"', 'type = "synchronous"\nhold_tolerance = 0.1', 1)
    assert tolerant != SHAFT
    config = parse(tolerant, "shaft.toml")
    assert [one.hold_tolerance for one in config.s7_axes.values()].count(0.1) == 1
    with pytest.raises(ConfigurationError, match=r"hold_tolerance: S7-1500T V8 has .* V8.0; it needs V9.0"):
        parse(tolerant.replace("cycle_ms = 4", 'cycle_ms = 4\ncpu = "S7-1500T V8"'), "shaft.toml")


@pytest.mark.requirement("CAM-131")
def test_a_cam_directly_at_the_present_leading_value():
    """Profile 7 waits until the axis stands on its cam, moves nothing, and is synchronous then, at any
    leading value; outside of the cam 16#80AD.
    """
    rig = standing(leader_at=40.0)
    cam = cam_of(rig, ((0.0, 0.0), (100.0, 50.0)))
    job = rig.axis.cam_in(rig.leader, cam, SyncProfileReference=7, SlaveOffset=5.0)
    rig.run(0.2)
    assert (job.Busy, job.StartSync, job.InSync, rig.axis.var("Position")) == (True, False, False, 0.0)
    assert rig.axis.var("StatusSynchronizedMotion.WaitingFunctionState") == 3
    rig.axis.move_absolute(25.0)
    rig.until(job.in_sync)
    places_ = []
    rig.runtime.after_cycle.append(lambda: places_.append(places(rig)))
    travel(rig, 50.0)
    rig.run(0.5)
    assert all(y == pytest.approx(0.5 * x + 5.0) for x, y in places_[1:])
    assert max(b[1] - a[1] for a, b in pairwise(places_)) <= 25.0 * CYCLE + 1e-9
    rig = standing(leader_at=140.0)
    outside = rig.axis.cam_in(rig.leader, cam_of(rig, ((0.0, 0.0), (100.0, 50.0))), SyncProfileReference=7)
    rig.cycles(2)
    assert outside.ErrorID == 0x80AD
