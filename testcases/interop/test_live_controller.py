"""The controller of a live bench stops, hangs and loses its supply while its drive, in another process, runs
on.
"""

from __future__ import annotations

import pytest

from hil.bench.bench import Bench
from hil.bench.bench_file import parse
from hil.faults import Injector
from motion.s7.controller import OperatingState
from testcases.interop.test_live_modbus import bench_text

pytestmark = pytest.mark.realtime


@pytest.mark.parametrize("kind", ["controller.stop", "controller.power_off"])
@pytest.mark.requirement("MC-629", "MC-630")
def test_away_and_back(kind):
    """The axis comes to rest, the controller comes back to RUN, and the axis can be enabled again."""
    with Bench(parse(bench_text("tcp"), "live.toml"), seed=1) as bench:
        axis = bench.axis()
        assert bench.run_until(axis.power().status, 10.0)
        job = axis.move_velocity(50.0)
        assert bench.run_until(job.in_velocity, 10.0)
        Injector(bench).inject(kind, duration_s=2.0)
        bench.run_for(1.0)
        expected = OperatingState.STOP if kind == "controller.stop" else OperatingState.POWER_OFF
        assert bench.controller.state is expected
        assert bench.run_until(lambda: bench.controller.state is OperatingState.RUN, 15.0)
        bench.run_for(1.0)
        assert axis.state.name in {"DISABLED", "ALARM_DISABLED"}
        assert abs(axis.var("ActualVelocity")) < 1.0
        axis.reset()
        bench.run_for(0.5)
        assert bench.run_until(axis.power().status, 10.0)
