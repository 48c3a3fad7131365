"""Synchronous operation over buses and drives: safety functions, faults and saturation of one of several
drives, and what a recording shows of them (SYN sections 5, 10 and 18).
"""

from __future__ import annotations

import numpy as np
import pytest

from hil.bench import BenchFile
from hil.faults import Injector

pytestmark = pytest.mark.exhaustive

LEADER, FOLLOWER = "leader", "follower"
OFF3 = 0.3, 0.8
"""OFF3 ramps of both drives from 3000 rpm, s."""
HEAD = """
[bench]
name = "two profidrive axes"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000
"""
DRIVE = """
[drive.{name}_drive]
profile = "profidrive"
telegram = {telegram}
segment = "can0"
node_id = {node}
increments_per_revolution = 2048
off3_ramp_s = {off3}
{more}

[drive.{name}_drive.profidrive]
safety_telegram = 701

[drive.{name}_drive.safety]
ss1_time_ms = {ss1}
ss1_external = {external}

[drive.{name}_drive.mechanics]
negative_stop_mm = -100000.0
positive_stop_mm = {stop}
"""
AXIS = """
[axis.{name}]
type = "synchronous"
drive = "{name}_drive"
{leading}

[axis.{name}.variables]
"Mechanics.LeadScrew" = 10.0
"DynamicLimits.MaxVelocity" = 500.0
"DynamicLimits.Velocity" = 500.0
"DynamicLimits.MaxAcceleration" = 2000.0
"DynamicLimits.MaxDeceleration" = 2000.0
"DynamicLimits.MaxJerk" = 50000.0
"DynamicDefaults.Velocity" = 100.0
"DynamicDefaults.Acceleration" = 1000.0
"DynamicDefaults.Deceleration" = 1000.0
"DynamicDefaults.Jerk" = 10000.0
"DynamicDefaults.EmergencyDeceleration" = 4000.0
"PositionControl.Kv" = 20.0
"PositionControl.Kpc" = 100.0
"FollowingError.MinValue" = 2.0
"FollowingError.MaxValue" = 10.0
"FollowingError.MinVelocity" = 50.0
"Sensor[1].Parameter.StepsPerRevolution" = 2048
"Sensor[1].Parameter.FineResolutionXist1" = 11
{more}
"""


def machine(
    *, off3=OFF3, external=False, follower="", telegrams=(105, 105), drive="", stop=100000.0, ss1=800.0
):
    """A leading and a following axis, each on a PROFIdrive drive of its own with safety functions."""
    text = HEAD
    for number, name in enumerate((LEADER, FOLLOWER)):
        text += DRIVE.format(
            name=name, telegram=telegrams[number], node=number + 1, off3=off3[number], ss1=ss1,
            external=str(external).lower(), more=drive if number else "", stop=stop if number else 100000.0,
        ) + AXIS.format(
            name=name, leading='leading = ["leader"]' if number else "", more=follower if number else "",
        )  # fmt: skip
    return BenchFile("own.toml", text).build(seed=3)


class Geared:
    """The machine in gear at 200 mm/s."""

    def __init__(self, bench, velocity=200.0, numerator=1):
        self.bench = bench
        self.leader, self.follower = bench.axis(LEADER), bench.axis(FOLLOWER)
        self.faults = Injector(bench)
        for axis in (self.leader, self.follower):
            assert bench.run_until(axis.power().status, timeout=3.0)
            assert bench.run_until(axis.home(0.0).done, timeout=1.0)
        self.moving = self.leader.move_velocity(velocity)
        self.job = self.follower.gear_in(self.leader, numerator, 1)
        assert bench.run_until(self.job.in_gear, timeout=5.0)
        bench.run_for(0.3)
        self.since = bench.now_s

    def alarms(self, name):
        found = self.bench.history.events
        return [one.data["number"] for one in found if one.kind == "alarm.raised" and one.source == name]

    def ways(self):
        """Return how far both machines have gone from the beginning of the fault to rest, mm."""
        trace = self.bench.trace()
        found = []
        for name in (LEADER, FOLLOWER):
            place = trace[f"{name}_drive.position"]
            at = place.values[np.searchsorted(place.time_s, self.since)]
            found.append(abs(place.values[-1] - at) * 1000.0)
        return found


@pytest.mark.requirement("SYN-298", "SYN-368", "CFG-451")
@pytest.mark.parametrize(
    ("kind", "on"),
    [("drive.ss1", (LEADER, FOLLOWER)), ("safety.ss2", (FOLLOWER,)), ("drive.sto", (FOLLOWER,))],
)
def test_stops_of_the_drives_end_the_coupling(kind, on):
    """SS1, SS2 or STO: each drive stops by itself, with ways as different as its ramps, and the gear is lost;
    a leading axis without it goes on.
    """
    with machine() as bench:
        here = Geared(bench)
        for name in on:
            here.faults.inject(kind, f"{name}_drive")
        bench.run_for(1.0)
        assert (here.job.InGear, here.job.ErrorID) == (False, 0x8001)
        assert here.alarms(FOLLOWER)[0] == (421 if kind == "drive.sto" else 550)
        leading, following = here.ways()
        if LEADER not in on:
            assert (here.leader.var("Velocity"), here.alarms(LEADER)) == (200.0, [])
        else:
            assert leading == pytest.approx(0.5 * 200.0 * OFF3[0] * 200.0 / 500.0, rel=0.5)
            assert following > 1.5 * leading


@pytest.mark.requirement("SYN-299", "SYN-300", "SYN-368", "CFG-452")
def test_external_safe_stop_1_leaves_time_to_stop_together():
    """SS1E: no drive brakes by itself; the leading axis is halted within the delay, the gear holds to the
    standstill; then STO by itself, whose alarms MC_Reset acknowledges.
    """
    with machine(external=True, ss1=500.0) as bench:
        here = Geared(bench)
        armed = [here.faults.inject("drive.ss1", f"{name}_drive") for name in (LEADER, FOLLOWER)]
        bench.run_for(0.04)
        assert here.follower.var("Velocity") == 200.0
        halt = here.leader.halt(Deceleration=1000.0, Jerk=0.0)
        assert bench.run_until(halt.done, timeout=0.35)
        assert here.job.InGear
        ways = here.ways()
        assert ways[0] == pytest.approx(ways[1], abs=0.5)
        assert here.follower.var("ActualVelocity") == pytest.approx(0.0, abs=0.5)
        bench.run_for(0.6)
        for name in (LEADER, FOLLOWER):
            assert (name, here.alarms(name)) == (name, [421])
        for one in armed:
            one.remove()
        bench.run_for(0.1)
        for axis in (here.leader, here.follower):
            bench.run_until(axis.reset().done, timeout=2.0)
            assert bench.run_until(lambda axis=axis: axis.var("StatusWord.X0"), timeout=2.0)


@pytest.mark.requirement("SYN-364")
@pytest.mark.parametrize(
    ("fault", "options"),
    [("drive.fault", {"code": 0x2310}), ("telegram.bits", {"signal": "ZSW1", "clear": 0x0004})],
)
def test_the_drive_of_the_follower_fails(fault, options):
    """A fault, or a lost enable: an alarm at the follower, its job ends with 16#8001, the leading axis goes
    on.
    """
    with machine() as bench:
        here = Geared(bench)
        here.faults.inject(fault, "follower_drive", **options)
        bench.run_for(0.5)
        assert (here.job.ErrorID, here.job.InGear) == (0x8001, False)
        assert here.alarms(FOLLOWER)[0] == 421
        assert (here.leader.var("Velocity"), here.alarms(LEADER)) == (200.0, [])
