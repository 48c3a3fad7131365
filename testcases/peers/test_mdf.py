"""MDF4 files of a run, read by asammdf."""

from __future__ import annotations

import numpy as np
import pytest

from hil.bench import load_bench
from hil.record import Trace, TraceGroup
from hil.record._signal import PART
from hil.record.export import write_signals

pytestmark = pytest.mark.peers


def test_every_signal_of_a_run_comes_back(tmp_path):
    """Units, samples and times of all signals; the texts of states too."""
    with load_bench("reference").build(seed=1) as bench:
        bench.axis().power()
        bench.run_for(0.1)
        bench.axis().move_velocity(100.0)
        bench.run_for(0.2)
        trace = bench.trace()
    import asammdf  # only the environment of these tests has it

    path = write_signals(trace, tmp_path / "run.mf4")
    with asammdf.MDF(path) as mdf:
        assert mdf.version >= "4.10"
        for name in trace.names():
            channel = mdf.get(name, raw=True)
            assert channel.unit == trace[name].unit
            assert np.array_equal(channel.samples, trace[name].values, equal_nan=True)
            assert np.array_equal(channel.timestamps, trace[name].time_s)
        states = {bytes(text) for text in mdf.get("axis1.state").samples}
    assert {b"DISABLED", b"STANDSTILL", b"MOTION"} <= states


def test_a_long_signal_comes_back_from_its_pieces(tmp_path):
    """A recording that is longer than two pieces has every sample once, in order, in all columns; so has one
    that ends with a piece, and each group keeps its own times.
    """
    import asammdf

    def group(name, rows, step_ns):
        number = np.arange(rows)
        values = np.column_stack((number * 0.5, number % 3.0))
        columns = (("way", "mm"), ("state", ""))
        return TraceGroup(name, columns, {"state": {0: "OFF", 1: "ON", 2: "FAULT"}}, number * step_ns, values)

    groups = [group("long", 2 * PART + 5, 4_000_000), group("whole", PART, 1_000_000)]
    trace = Trace(groups, end_ns=10**12)
    with asammdf.MDF(write_signals(trace, tmp_path / "long.mf4")) as mdf:
        for one in trace:
            channel = mdf.get(one.name, raw=True)
            assert np.array_equal(channel.samples, one.values), one.name
            assert np.array_equal(channel.timestamps, one.time_s), one.name
        texts = [bytes(text) for text in mdf.get("long.state").samples[PART - 1 : PART + 2]]
        assert texts == [[b"OFF", b"ON", b"FAULT"][number % 3] for number in range(PART - 1, PART + 2)]
