"""Axes of a bench that follow each other: `leading` of a bench file, `gear_in` of a handle, drives of both
profiles as followers.
"""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from hil import load_bench

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
