"""Axes of a bench that follow each other: `leading` of a bench file, `gear_in` of a handle, drives of both
profiles as followers.
"""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from hil import load_bench
from hil.expect import run_checkers
from reports.model import Verdict

SHAFT = """
[bench]
name = "shaft"
cycle_ms = 4

[segment.can0]
kind = "can"

[drive.leader_drive]
profile = "cia402"
segment = "can0"
node_id = 1

[drive.a_drive]
profile = "cia402"
segment = "can0"
node_id = 2

[drive.b_drive]
profile = "profidrive"
telegram = 105
segment = "can0"
node_id = 3

[axis.follower_a]
type = "synchronous"
drive = "a_drive"
leading = ["leader"]

[axis.follower_b]
type = "synchronous"
drive = "b_drive"
leading = ["follower_a", "leader"]

[axis.leader]
drive = "leader_drive"
"""


def bench_file(folder, text):
    """Write a bench file and load it."""
    path = folder / "shaft.toml"
    path.write_text(text, encoding="utf-8")
    return load_bench(path)


def geared(bench):
    """Enable all axes and couple both followers to the leading axis at 1:2 and -3:2."""
    axes = [bench.axis(name) for name in ("leader", "follower_a", "follower_b")]
    for axis in axes:
        power = axis.power()
        assert bench.run_until(power.status, timeout=5.0)
    leader, first, second = axes
    assert bench.run_until(leader.move_velocity(50.0).in_velocity, timeout=2.0)
    jobs = [first.gear_in(leader, 1, 2), second.gear_in(leader, -3, 2)]
    assert bench.run_until(lambda: all(job.InGear for job in jobs), timeout=2.0)
    return axes, jobs


@pytest.mark.requirement("SYN-015")
def test_drives_of_both_profiles_follow_one_leading_axis(tmp_path):
    """Both keep their relation with moving drives; when the leading drive fails, they follow it to rest and
    stay in gear.
    """
    with bench_file(tmp_path, SHAFT).build(seed=1) as bench:
        (leader, first, second), jobs = geared(bench)
        begin = [axis.var("Position") for axis in (leader, first, second)]
        bench.run_for(0.5)
        ways = [axis.var("Position") - at for axis, at in zip((leader, first, second), begin, strict=True)]
        assert ways[1:] == [pytest.approx(0.5 * ways[0]), pytest.approx(-1.5 * ways[0])]
        assert first.var("ActualPosition") == pytest.approx(first.var("Position"), abs=0.5)
        bench.drive("leader_drive").raise_fault(0x2310)
        bench.run_for(1.0)
        assert leader.var("ErrorDetail.Number") == 421
        assert [job.InGear for job in jobs] == [True, True]
        assert abs(first.var("Velocity")) < 0.5


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('["leader"]', '["ledaer"]', "follower_a.leading: 'ledaer' is not an axis"),
        ('leading = ["leader"]', 'leading = ["follower_a"]', "'follower_a' is the axis itself"),
        (
            'leading = ["leader"]',
            'leading = ["leader"]\ncoupling = { ledaer = "actual" }',
            "follower_a.coupling: 'ledaer' is not one of `leading`; there are: leader",
        ),
        (
            'type = "synchronous"\ndrive = "a_drive"',
            'drive = "a_drive"',
            'only an axis of type = "synchronous" follows others',
        ),
    ],
)
def test_mistakes_in_interconnections(tmp_path, old, new, text):
    """An axis that does not exist, the axis itself and one of another type are refused with the place."""
    with pytest.raises(ConfigurationError, match=text):
        bench_file(tmp_path, SHAFT.replace(old, new, 1))


def test_actual_values_lead_axes_of_a_technology_processor(tmp_path):
    """Another processor has no coupling of actual values; the message names the place."""
    text = SHAFT.replace("cycle_ms = 4", 'cycle_ms = 4\ncpu = "S7-1500"').replace(
        'leading = ["leader"]', 'leading = ["leader"]\ncoupling = { leader = "actual" }'
    )
    with pytest.raises(ConfigurationError, match=r"follower_a.coupling.leader: .* S7-1500T only"):
        bench_file(tmp_path, text)


CAM = """
[cam.knife]
boundary = "equal_velocity"
points = [[0.0, 0.0], [10.0, 8.0], [30.0, 20.0], [40.0, 0.0]]
"""


@pytest.mark.exhaustive
def test_cams_and_stops_on_drives_of_both_profiles(tmp_path):
    """One axis follows a cam, the other one a gear with synchronous positions, with ramps beyond the limits;
    both leave at a position, and no rule that always holds finds anything.
    """
    with bench_file(tmp_path, SHAFT + CAM).build(seed=1) as bench:
        leader, first, second = (bench.axis(name) for name in ("leader", "follower_a", "follower_b"))
        for axis in (leader, first, second):
            assert bench.run_until(axis.power().status, timeout=5.0)
            assert bench.run_until(axis.home(0.0).done, timeout=1.0)
        cam = bench.cam("knife")
        assert bench.run_until(cam.interpolate().done, timeout=1.0)
        jobs = [
            first.cam_in(leader, cam, MasterSyncPosition=10.0, MasterStartDistance=5.0, ApplicationMode=1),
            second.gear_in_pos(leader, 20.0, 50.0, 3, 1, MasterStartDistance=18.0),
        ]
        limit = first.var("DynamicLimits.MaxAcceleration")
        leader.move_velocity(60.0)
        assert bench.run_until(lambda: all(job.InSync for job in jobs), timeout=3.0)
        leader.move_velocity(66.0, Acceleration=limit, Jerk=0.0)
        for _ in range(100):
            bench.run_for(0.004)
            x = leader.var("Position")
            assert first.var("Position") == pytest.approx(cam.curve.evaluate(x % 40.0)[0], abs=1e-6)
            assert second.var("Position") == pytest.approx(50.0 + 3.0 * (x - 20.0), abs=1e-6)
        ends = [
            first.cam_out(10.0, MasterStopDistance=5.0),
            second.gear_out(second.var("Position") + 200.0, SyncProfileReference=0),
        ]
        assert bench.run_until(lambda: all(end.Done for end in ends), timeout=5.0)
        assert first.var("ActualPosition") == pytest.approx(10.0, abs=0.1)
        bench.run_for(0.1)
        assert [check.name for check in run_checkers(bench.trace()) if check.verdict is Verdict.FAILED] == []
