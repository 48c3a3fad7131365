"""The same line shaft with drives of both profiles: cylinders turn alike."""

from __future__ import annotations

import numpy as np
import pytest

from hil.bench import load_bench
from hil.expect import run_checkers
from hil.record import Trace
from reports.model import Verdict

pytestmark = pytest.mark.exhaustive

CYLINDERS = [f"cylinder{number}" for number in range(1, 9)]
PROFIDRIVE = {
    "drive": {
        f"drive{number}": {"profile": "profidrive", "telegram": 105, "increments_per_revolution": 2048}
        for number in range(1, 9)
    },
    "axis": {
        name: {
            "variables": {
                "Sensor[1].Parameter.StepsPerRevolution": 2048,
                "Sensor[1].Parameter.FineResolutionXist1": 11,
            }
        }
        for name in CYLINDERS
    },
}


def run(tables: dict) -> Trace:
    """Bring all cylinders into step at standstill, turn, put one into register, and stop the shaft."""
    with load_bench("line_shaft").configured(tables).build(seed=1) as bench:
        shaft, *cylinders = (bench.axis(name) for name in ("shaft", *CYLINDERS))
        powers = [axis.power() for axis in (shaft, *cylinders)]
        bench.wait_until(lambda: all(power.Status for power in powers), 3.0)
        jobs = [axis.gear_in(shaft, number, 4) for number, axis in enumerate(cylinders, 1)]
        bench.wait_until(lambda: all(job.InGear for job in jobs), 1.0)
        shaft.move_velocity(360.0)
        bench.run_for(0.3)
        cylinders[2].phasing_relative(10.0)
        bench.run_for(0.3)
        shaft.halt()
        bench.run_for(0.4)
        return bench.trace()


@pytest.mark.requirement("SYN-015")
def test_a_line_shaft_moves_alike_on_drives_of_both_profiles():
    """The controller asks both for the same, all cylinders in the same cycle, and the motors agree within a
    hundredth of a turn.
    """
    cia402, profidrive = run({}), run(PROFIDRIVE)
    begins = [
        min(e.time_ns for e in trace.events if e.kind == "job.active" and e.source == "shaft") * 1e-9
        for trace in (cia402, profidrive)
    ]
    for trace in (cia402, profidrive):  # a virtual axis among them, whose velocity is its setpoint
        broken = [check for check in run_checkers(trace) if check.verdict is Verdict.FAILED]
        assert [f"{check.name}: {check.observed}" for check in broken] == []
    times = np.arange(0.0, 0.9, 0.004)
    for number, name in enumerate(CYLINDERS, 1):
        for signal, tolerance in ((f"{name}.position_setpoint", 1e-6), (f"drive{number}.position", 1e-4)):
            ways = []
            for trace, begin in zip((cia402, profidrive), begins, strict=True):
                recorded = trace[signal]
                at = np.interp(times + begin, recorded.time_s, recorded.values)
                ways.append(at - at[0])
            assert np.max(np.abs(ways[0])) > 10 * tolerance, signal
            assert np.max(np.abs(ways[0] - ways[1])) < tolerance, signal
