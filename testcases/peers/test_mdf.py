"""MDF4 files of a run, read by asammdf."""

from __future__ import annotations

import numpy as np
import pytest

from hil.bench import load_bench
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
