"""Two controllers on one bench, and a leading axis of one for axes of the other (`[controller.NAME]`,
`[proxy.NAME]`).
"""

from __future__ import annotations

import numpy as np
import pytest

from fieldbus.errors import ConfigurationError
from hil.bench import load_bench
from motion.s7.controller import OperatingState

CELL = """
[bench]
name = "cell"
cycle_ms = 4

[segment.can0]
kind = "can"

[controller.plc2]
phase_us = 500

[drive.leader_drive]
profile = "cia402"
segment = "can0"
node_id = 1

[drive.follower_drive]
profile = "profidrive"
telegram = 105
segment = "can0"
node_id = 2

[axis.leader]
drive = "leader_drive"

[proxy.line]
axis = "leader"
plc = "plc2"
variables = { "Parameter.ToleranceTimeExternalLeadingValueInvalid" = 0.02 }

[axis.follower]
type = "synchronous"
plc = "plc2"
drive = "follower_drive"
leading = ["line"]
"""


def bench_of(tmp_path, text=CELL):
    path = tmp_path / "cell.toml"
    path.write_text(text)
    return load_bench(path)


def geared(bench):
    """The leading axis at 50 mm/s, and the follower in gear behind the proxy."""
    leader, follower = bench.axis("leader"), bench.axis("follower")
    for axis in (leader, follower):
        bench.run_until(axis.power().status, timeout=3.0)
    bench.run_until(leader.move_velocity(50.0).in_velocity, timeout=3.0)
    job = follower.gear_in(bench.proxy("line"))
    bench.run_until(job.in_gear, timeout=3.0)
    bench.run_for(0.2)
    return leader, follower, job


@pytest.mark.requirement("SYN-357", "SYN-073")
def test_an_axis_of_one_controller_leads_one_of_the_other(tmp_path):
    """It follows with its own cycle, and goes on through a short outage; a long one is alarms 900 and 601;
    STOP of the second controller disables its axis alone.
    """
    with bench_of(tmp_path).build(seed=1) as bench:
        leader, follower, job = geared(bench)
        trace = bench.trace()
        x, y = trace["line.position"], trace["follower.position_setpoint"]
        late = slice(-40, None)
        assert np.ptp(x.values[late] - y.values[late]) < 1e-6
        assert {round(time * 1e3 % 4.0, 3) for time in x.time_s[late]} == {0.5}
        assert follower.var("Velocity") == pytest.approx(50.0)
        line = bench.proxy("line")
        line.link.lost = True
        bench.run_for(0.012)
        line.link.lost = False
        bench.run_for(0.1)
        assert (job.InGear, line.var("StatusWord.X4")) == (True, True)
        line.link.lost = True
        bench.run_for(0.5)
        assert (job.ErrorID, follower.var("Velocity")) == (0x8001, 0.0)
        assert leader.var("Velocity") == pytest.approx(50.0)
        assert line.var("ErrorDetail.Number") == 900
        line.link.lost = False
        bench.run_for(0.1)
        bench.run_until(line.reset().done, timeout=1.0)
        bench.run_until(follower.reset().done, timeout=1.0)
        bench.run_until(follower.gear_in(line).in_gear, timeout=3.0)
        bench.controllers["plc2"].stop()
        bench.run_for(1.0)
        assert bench.controllers["plc2"].state is OperatingState.STOP
        assert bench.controller.state is OperatingState.RUN
        assert (follower.var("StatusWord.X0"), leader.var("StatusWord.X0")) == (False, True)


MISTAKES = [
    (
        'plc = "plc2"\ndrive',
        'plc = "plc3"\ndrive',
        r"axis.follower.plc: there is no \[controller.plc3\].*plc2",
    ),
    ('plc = "plc2"\ndrive', "drive", "the proxy 'line' belongs to another controller"),
    ('leading = ["line"]', 'leading = ["leader"]', r"another controller, which leads by a \[proxy.NAME\]"),
    ('axis = "leader"\nplc = "plc2"', 'axis = "follower"\nplc = "plc2"', "belongs to the same controller"),
    ("phase_us = 500", "phase_us = 4000", "phase_us: 4000; allowed: below the cycle of 4000 us"),
    ("phase_us = 500", 'cpu = "S7-1500"', "S7-1500T only"),
    ('axis = "leader"\n', 'axis = "leader"\ninterface = 33\n', "interface"),
]


@pytest.mark.parametrize(("old", "new", "message"), MISTAKES)
def test_mistakes_of_the_bench_file(tmp_path, old, new, message):
    """Each says what is wrong, and where."""
    assert old in CELL
    with pytest.raises(ConfigurationError, match=message):
        bench_of(tmp_path, CELL.replace(old, new, 1)).build(seed=1)
