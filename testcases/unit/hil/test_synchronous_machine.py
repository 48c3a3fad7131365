"""A machine with several axes as its parts provide it: drives and an encoder on one bus with one time base,
leading values that a test scripts, and a recording of everything in the same cycle (SYN section 18.1).
"""

from __future__ import annotations

from itertools import pairwise
from math import cos, tau

import numpy as np
import pytest

from hil.bench import BenchFile, BenchFileError

pytestmark = pytest.mark.exhaustive

HEAD = """
[bench]
name = "several axes"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[encoder.wheel]
profile = "profidrive"
segment = "can0"
node_id = 20

[encoder.wheel.profidrive]
telegram = 83

[encoder.wheel.shaft]

[external_encoder.material]
encoder = "wheel"

[external_encoder.material.variables]
"Mechanics.LeadScrew" = 10.0

[axis.shaft]

[axis.shaft.variables]
"VirtualAxis.Mode" = 1
"Mechanics.LeadScrew" = 10.0
"DynamicLimits.MaxVelocity" = 500.0
"DynamicLimits.Velocity" = 500.0
"DynamicDefaults.Acceleration" = 1000.0
"DynamicDefaults.Deceleration" = 1000.0
"DynamicDefaults.Jerk" = 10000.0
"""
DRIVE = """
[drive.drive{number}]
profile = "profidrive"
telegram = {telegram}
segment = "can0"
node_id = {number}
increments_per_revolution = {steps}
max_speed_rpm = {speed}
velocity_time_constant_ms = {lag}

[drive.drive{number}.mechanics]
negative_stop_mm = -100000.0
positive_stop_mm = 100000.0

[axis.axis{number}]
type = "synchronous"
drive = "drive{number}"
leading = ["shaft", "material"{more}]

[axis.axis{number}.variables]
"Mechanics.LeadScrew" = 10.0
"DynamicLimits.MaxVelocity" = 500.0
"DynamicLimits.Velocity" = 500.0
"DynamicLimits.MaxAcceleration" = 5000.0
"DynamicLimits.MaxDeceleration" = 5000.0
"DynamicLimits.MaxJerk" = 100000.0
"DynamicDefaults.Velocity" = 100.0
"DynamicDefaults.Acceleration" = 1000.0
"DynamicDefaults.Deceleration" = 1000.0
"DynamicDefaults.Jerk" = 10000.0
"PositionControl.Kv" = 20.0
"PositionControl.Kpc" = 100.0
"DynamicAxisModel.VelocityTimeConstant" = {lag_s}
"FollowingError.EnableMonitoring" = false
"Actor.DriveParameter.MaxSpeed" = {speed}
{modulo}
"""
SYNC = "StatusSynchronizedMotion."


def bench_of(*, modulo=""):
    text = HEAD
    for number, telegram, steps, speed, lag, more in (
        (1, 3, 2048, 3000.0, 1.0, ""),
        (2, 5, 2048, 3000.0, 1.0, ', "axis1"'),
        (3, 105, 4096, 6000.0, 4.0, ', "axis1"'),
    ):
        text += DRIVE.format(
            number=number, telegram=telegram, steps=steps, speed=speed, lag=lag, lag_s=lag / 1000.0,
            more=more, modulo=modulo if number == 3 else "",
        )  # fmt: skip
    return BenchFile("own.toml", text).build(seed=2)


def ready(bench, *names):
    for name in names:
        axis = bench.axis(name)
        assert bench.run_until(axis.power().status, 3.0)
        assert bench.run_until(axis.home(0.0).done, 1.0)


@pytest.mark.requirement("SYN-353", "SYN-356")
def test_everything_is_sampled_in_the_same_cycle():
    """Drives with telegrams 3, 5 and 105 and an encoder with telegram 83, two followers and one behind one of
    them: in every cycle raw leading value, E, M, F and y keep the chain of values, and bits and outputs
    agree; the recording has one time base for all.
    """
    with bench_of() as bench:
        ready(bench, "shaft", "axis1", "axis2", "axis3")
        shaft, first, second, third = (bench.axis(name) for name in ("shaft", "axis1", "axis2", "axis3"))
        jobs = [
            first.gear_in_pos(shaft, 40.0, 20.0, 1, 2, MasterStartDistance=30.0),
            second.gear_in(shaft, -2, 1),
            third.gear_in(first, 3, 1),
        ]
        rows = []

        def look():
            read = first.var
            rows.append(
                (
                    shaft.var("Position"),
                    read(f"{SYNC}EffectiveLeadingValue.Position"),
                    read(f"{SYNC}PhaseShift"),
                    read(f"{SYNC}FunctionLeadingValue.Position"),
                    read(f"{SYNC}FunctionFollowingValue.Position"),
                    read(f"{SYNC}Offset"),
                    read("Position"),
                    (read("StatusWord.X21"), read("StatusWord.X22"), read("StatusWord.X24")),
                    (jobs[0].StartSync, jobs[0].InSync),
                    second.var("Position"),
                    third.var("Position"),
                )
            )

        end = bench.on_cycle(look)
        shaft.move_velocity(100.0)
        assert bench.run_until(jobs[0].in_sync, 3.0)
        additive = first.leading_value_additive(1.5)
        phasing = first.phasing_relative(4.0, Velocity=50.0)
        bench.run_for(0.2)
        assert bench.run_until(phasing.done, 3.0)
        offset = first.offset_relative(3.0, 10.0)
        assert bench.run_until(offset.done, 3.0)
        assert additive.Busy
        end()
        synchronous = [row for row in rows if row[7][1]]
        for raw, effective, phase, function, following, shift, place, *_ in synchronous:
            assert effective == pytest.approx(raw + (1.5 if effective > raw + 0.1 else 0.0), abs=1e-9)
            assert function == pytest.approx(effective + phase, abs=1e-9)
            assert following == pytest.approx(20.0 + 0.5 * (function - 40.0), abs=1e-9)
            assert place == pytest.approx(following + shift, abs=1e-9)
        last = rows[-1]
        assert (last[2], last[5]) == (pytest.approx(4.0), pytest.approx(3.0))
        # status bits are those of the cycle, outputs come with the next call of the program
        for before, after in pairwise(rows):
            assert before[7][1] == after[8][1] or after[7][1] == after[8][1]
        base = synchronous[0][9] + 2.0 * synchronous[0][0]
        assert [row[9] + 2.0 * row[0] for row in synchronous] == pytest.approx(
            [base] * len(synchronous), abs=1e-6
        )
        chain = synchronous[0][10] - 3.0 * synchronous[0][6]
        assert [row[10] - 3.0 * row[6] for row in synchronous] == pytest.approx(
            [chain] * len(synchronous), abs=1e-6
        )
        trace = bench.trace()
        names = (
            "shaft.position_setpoint",
            "axis1.leading_position",
            "axis3.sync_phase",
            "material.position",
        )
        times = [trace[name].time_s for name in names]
        assert all(np.array_equal(times[0], one) for one in times[1:])


@pytest.mark.requirement("SYN-354")
def test_drives_that_differ():
    """Each drive has its own time constant, resolution and maximum speed, its axis a modulo range of its own:
    the slower one lags more, and its modulo range counts.
    """
    with bench_of(modulo='"Modulo.Enable" = true\n"Modulo.Length" = 36.0\n') as bench:
        ready(bench, "shaft", "axis1", "axis3")
        shaft = bench.axis("shaft")
        for name in ("axis1", "axis3"):
            assert bench.run_until(bench.axis(name).gear_in(shaft).in_gear, 3.0)
        shaft.move_velocity(200.0)
        bench.run_for(0.8)
        lags = []
        for number in (1, 3):
            axis, drive = bench.axis(f"axis{number}"), bench.drive(f"drive{number}")
            lags.append(axis.object.servo.total.s - axis.object.servo.feedback.position)
            assert drive.mechanics.velocity == pytest.approx(0.2, rel=0.01)
        assert lags[1] - lags[0] == pytest.approx(200.0 * 0.003, abs=0.1)
        assert 0.0 <= bench.axis("axis3").var("Position") < 36.0
        assert bench.axis("axis1").var("Position") > 100.0
        assert [bench.axis(f"axis{number}").object.servo.max_speed for number in (1, 3)] == [3000.0, 6000.0]


@pytest.mark.requirement("SYN-355")
def test_a_leading_encoder_that_a_test_moves(subtests):
    """A leading object without a bus, and an encoder whose shaft a test turns as it wants: the follower is
    where the extrapolated value is, in every cycle.
    """
    with bench_of() as bench:
        material, follower, wheel = (
            bench.external_encoder("material"),
            bench.axis("axis1"),
            bench.encoder("wheel"),
        )
        ready(bench, "shaft", "axis1")
        shaft = bench.axis("shaft")
        assert bench.run_until(follower.gear_in(shaft).in_gear, 3.0)
        assert bench.run_until(shaft.move_relative(10.0).done, 3.0)
        assert follower.var("Position") == pytest.approx(10.0, abs=1e-6)
        assert bench.run_until(material.power().status, 3.0)
        job = follower.gear_in(material, 2, 1)
        assert bench.run_until(job.in_gear, 3.0)
        bench.run_for(0.02)

        def off():
            leading = material.var("StatusExtrapolation.ExtrapolatedPosition")
            return follower.object.servo.total.s - 2.0 * leading

        base, worst = off(), []
        bench.on_cycle(lambda: worst.append(abs(off() - base)))

        def sine():
            begin = bench.now_s
            return bench.on_cycle(
                lambda: wheel.turn_shaft(tau * 3.0 * cos(tau * (bench.now_s - begin) / 0.2))
            )

        scripts = {
            "standstill": lambda: None,
            "ramp": lambda: wheel.turn_shaft(tau * 5.0, 0.1),
            "reversal": lambda: wheel.turn_shaft(-tau * 5.0, 0.1),
            "sine": sine,
            "jump": lambda: wheel.place_shaft(tau * 0.3),
            "noise": lambda: wheel.set_encoder_noise(20),
        }
        for script, begin in scripts.items():
            with subtests.test(script):
                before, seen = material.var("ActualPosition"), []
                end_of = begin()
                watch = bench.on_cycle(lambda seen=seen: seen.append(material.var("ActualPosition")))
                bench.run_for(0.2)
                watch()
                if end_of is not None:
                    end_of()
                if script in ("sine", "reversal"):
                    wheel.turn_shaft(0.0, 0.0)
                assert max(worst) < 1e-6
                assert job.InGear
                moved = max(abs(place - before) for place in seen)
                assert (moved < 1e-9) is (script == "standstill")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"VirtualAxis.Mode" = 1\n', "", "axis.shaft.drive: missing; only a virtual axis has none"),
        (
            "[axis.shaft]\n",
            '[axis.shaft]\nencoders = ["wheel"]\n',
            "axis.shaft.encoders: an axis without a drive",
        ),
        (
            "[axis.shaft]\n",
            '[axis.shaft]\nconnection = "data_block"\n',
            "axis.shaft.connection: an axis without",
        ),
    ],
)
def test_an_axis_without_a_drive_is_a_virtual_one(old, new, message):
    """Any other axis needs its drive; what speaks of a drive is refused without one."""
    assert old in HEAD
    with pytest.raises(BenchFileError, match=message):
        BenchFile("own.toml", HEAD.replace(old, new, 1)).build(seed=1)
