"""The load of a segment as a recorded signal, against a calculation that shares nothing with the medium."""

from __future__ import annotations

import numpy as np
import pytest

from hil._commands._measurements import MovingBench, with_axes
from hil.bench import BenchFile, BenchFileError, load_bench

pytestmark = pytest.mark.exhaustive

CRC_POLYNOMIAL = 0x4599


def bits_of(can_id: int, data: bytes) -> int:
    """Return the bits of a standard data frame with intermission, bit by bit as the specification describes
    it.
    """
    bits = [0, *(can_id >> shift & 1 for shift in range(10, -1, -1)), 0, 0, 0]
    bits += [len(data) >> shift & 1 for shift in (3, 2, 1, 0)]
    bits += [byte >> shift & 1 for byte in data for shift in range(7, -1, -1)]
    crc = 0
    for bit in bits:
        crc = crc << 1 ^ (CRC_POLYNOMIAL if bit != crc >> 14 & 1 else 0)
        crc &= 0x7FFF
    bits += [crc >> shift & 1 for shift in range(14, -1, -1)]
    run, last, stuffed = 0, None, 0
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed, last, run = stuffed + 1, 1 - bit, 1
    return len(bits) + stuffed + 10 + 3


@pytest.mark.requirement("CANP-012", "CANP-017", "CANP-069")
def test_load_of_four_axes_is_the_computed_one():
    """Four axes at 1 Mbit/s and 2 ms: the load that is recorded is that of the frames in the log, within
    1 %.
    """
    with MovingBench(with_axes(load_bench("reference").config, 4, cycle_ms=2)).bench as bench:
        begin = bench.now_s
        moves = [bench.axis(f"axis{number}").move_absolute(50.0) for number in range(1, 5)]
        bench.run_for(1.0)
        trace = bench.trace()
        assert not any(move.Error for move in moves)
    load = trace["can0.load"]
    recorded = load.values[load.time_s > begin]
    frames = [frame for frame in trace.frames if begin < frame.time_ns / 1e9 <= begin + 1.0]
    computed = 100.0 * sum(bits_of(frame.can_id, frame.data) for frame in frames) / 1_000_000
    assert np.mean(recorded) == pytest.approx(computed, rel=0.01)
    # Per cycle: SYNC, and per drive one setpoint and two actual-value PDOs; heartbeats in addition.
    assert len(frames) == pytest.approx(500 * (1 + 4 * 3), rel=0.03)
    assert 60.0 < computed < 85.0


def test_load_doubles_with_half_of_the_bit_rate():
    """The signal counts bit times of the bit rate of its own segment."""
    loads = []
    for bitrate in (1_000_000, 500_000):
        config = load_bench("reference").config
        segment = config.segment["can0"].model_copy(update={"bitrate": bitrate})
        with MovingBench(config.model_copy(update={"segment": {"can0": segment}})).bench as bench:
            begin = bench.now_s
            bench.run_for(0.4)
            load = bench.trace()["can0.load"]
        loads.append(np.mean(load.values[load.time_s > begin]))
    assert loads[1] == pytest.approx(2.0 * loads[0], rel=0.01)


def test_a_segment_and_an_axis_of_one_name_are_refused():
    """Segments have signals too, so that their names are taken."""
    text = '[bench]\nname = "own"\n[segment.can0]\n[drive.d]\nsegment = "can0"\nnode_id = 5\n[axis.can0]\ndrive = "d"\n'  # noqa: E501
    with pytest.raises(BenchFileError, match=r"axis\.can0"):
        BenchFile("own.toml", text)
