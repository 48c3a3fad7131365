"""Encoders on a live bench: in the process of the drives, on a real CAN interface, while the axis moves."""

from __future__ import annotations

import numpy as np
import pytest

from hil.bench import BenchFile
from hil.faults import Injector
from testcases.physical_support import bench_text

pytestmark = pytest.mark.vcan

ENCODERS = """
[encoder.scale]
segment = "can0"
node_id = 22
type = "absolute_linear"
on = "drive1"
mounting = "load"

[encoder.own]
segment = "can0"
node_id = 23
cyclic_timer_ms = 50
"""


def at_rest(trace):
    """Return whether the slide has not moved by more than a micrometre in the last half second."""
    true = trace["drive1.position"]
    late = true.values[true.time_s >= true.time_s[-1] - 0.5]
    return float(np.ptp(late)) < 1e-6


@pytest.mark.requirement("C406-008", "C406-009")
def test_encoders_on_a_live_bench(vcan_channel):
    """The scale shows where the slide is while the axis moves it, faults reach it, and its own shaft turns
    the other one.
    """
    text = bench_text({"interface": "socketcan", "channel": vcan_channel}, physical=False)
    with BenchFile("own.toml", text + ENCODERS).build() as bench:
        power = bench.axis().power()
        assert bench.run_until(power.status, timeout=5.0)
        bench.axis().move_velocity(50.0)
        bench.run_for(1.0)
        Injector(bench).inject("encoder.jump", "scale", increments=5000)
        bench.encoder("own").turn_shaft(6.2831853)
        bench.run_for(1.0)
        halt = bench.axis().halt()
        assert bench.run_until(halt.done, timeout=10.0), "a slow machine may need longer for it"
        # The drive's own position may still settle by micrometres, longer on a machine that is late.
        for _ in range(20):
            bench.run_for(0.5)
            trace = bench.trace()
            if at_rest(trace):
                break
        segment = bench.segment()
        seen = {frame.can_id for _, _, frame, _ in segment.log}
    position, true = trace["scale.position_value"].values[1:], trace["drive1.position"].values[1:]
    # The record is fetched between two events: one of the two may have a row more.
    rows = min(len(position), len(true))
    position = position[:rows]
    error = position - (1.0 + true[:rows]) * 1e6
    assert position[-1] > 1_050_000
    assert np.diff(position).max() > 4000
    assert np.abs(error[:10]).max() <= 1, "at rest; in motion two rows of one cycle are of two instants"
    assert np.abs(error[-10:] - 5000).max() <= 10, "the last micrometres of the halt may still be under way"
    assert trace["own.position_value"].values[-1] > 8192
    assert {0x280 + 22, 0x280 + 23, 0x180 + 23, 0x700 + 22} <= seen
