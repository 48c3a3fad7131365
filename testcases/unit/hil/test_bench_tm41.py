"""An encoder-signal output in the bench file: the signal follows the setpoint of its axis, and an encoder
input reads it.
"""

from __future__ import annotations

import pytest

from hil.bench.bench import Bench
from hil.bench.bench_file import BenchFileError, parse

pytestmark = pytest.mark.exhaustive

BENCH = """
[bench]
name = "encoder signal"

[segment.can0]
bitrate = 1_000_000

[segment.net0]
kind = "modbus_tcp"

[drive.signal]
profile = "tm41"
segment = "can0"
node_id = 9
max_speed_rpm = 3000.0
increments_per_revolution = 4096

[station.counter]
segment = "net0"
counters = ["signal.encoder"]

[axis.lead]
drive = "signal"

[axis.lead.variables]
"Mechanics.LeadScrew" = 10.0
"Sensor[1].Parameter.StepsPerRevolution" = 4096
"Sensor[1].Parameter.FineResolutionXist1" = 0
"DynamicLimits.MaxVelocity" = 500.0
"FollowingError.EnableMonitoring" = false
"""


@pytest.mark.requirement("CFG-409", "CFG-410", "CFG-415")
def test_the_signal_follows_the_setpoint():
    """An ordinary axis moves; the count follows its setpoint with a constant delay, without an error that
    grows with the speed.
    """
    with Bench(parse(BENCH, "bench.toml"), seed=1) as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 3.0)
        delays = []
        for velocity in (50.0, 200.0, 400.0):
            job = axis.move_velocity(velocity)
            assert bench.run_until(job.in_velocity, 3.0)
            bench.run_for(0.5)
            emitted = bench.station("counter").counter(0).count / 4096 * 10.0
            delays.append((axis.motion.gen.s - emitted) / velocity)
        assert max(delays) - min(delays) < 0.0002
        assert 0.0 < delays[0] < 0.012
        job = axis.move_relative(100.0, Velocity=300.0)
        assert bench.run_until(job.done, 5.0)
        bench.run_for(0.2)
        count = bench.station("counter").counter(0).count
        assert count / 4096 * 10.0 == pytest.approx(axis.var("Position"), abs=0.003)
        assert bench.station_link("counter").counters[0] == count


WRONG = [
    ('"FollowingError.EnableMonitoring" = false', "FollowingError.EnableMonitoring has to be false"),
    ('"FollowingError.EnableMonitoring" = false', "PositionLimits_HW.Active has to be false"),
    ('"FollowingError.EnableMonitoring" = false', "Sensor[1].Backlash.Enable has to be false"),
    ('"FollowingError.EnableMonitoring" = false', "PositionControl.Kpc has to be 100.0"),
    ('"FollowingError.EnableMonitoring" = false', "DynamicAxisModel.VelocityTimeConstant has to be 0.0"),
]
ADDED = [
    '"FollowingError.EnableMonitoring" = true',
    '"FollowingError.EnableMonitoring" = false\n"PositionLimits_HW.Active" = true',
    '"FollowingError.EnableMonitoring" = false\n"Sensor[1].Backlash.Enable" = true',
    '"FollowingError.EnableMonitoring" = false\n"PositionControl.Kpc" = 90.0',
    '"FollowingError.EnableMonitoring" = false\n"DynamicAxisModel.VelocityTimeConstant" = 0.002',
]


@pytest.mark.requirement("CFG-413", "CFG-414")
@pytest.mark.parametrize(
    ("row", "variables"), list(zip(WRONG, ADDED, strict=True)), ids=[one[1] for one in WRONG]
)
def test_settings_that_do_not_fit(row, variables):
    """Following-error monitoring, hardware limits and backlash compensation are off, precontrol is 100 %, and
    there is no time constant; else it is reported.
    """
    text, message = row
    with pytest.raises(BenchFileError, match="CFG-413") as caught:
        parse(BENCH.replace(text, variables), "bench.toml")
    assert message in str(caught.value)


def test_what_it_has_not():
    """No machine, no terminals of a drive, and no more edges than the tracks can carry."""
    for change, message in (
        ("node_id = 9", "node_id = 9\noff3_ramp_s = 0.2"),
        ("node_id = 9", "node_id = 9\n[drive.signal.switches]\nhome_mm = 1.0\n"),
        ('counters = ["signal.encoder"]', 'digital_inputs = ["signal.home"]'),
        ("= 4096\n\n[station", "= 65536\n\n[station"),
    ):
        with pytest.raises(BenchFileError):
            parse(BENCH.replace(change, message), "bench.toml")
