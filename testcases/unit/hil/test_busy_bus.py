"""A telegram in several PDOs on a busy bus: the last one comes after the controller has read."""

import numpy as np

from hil.bench import load_bench
from hil.expect.rules import judge
from reports.model import Verdict

LATE = load_bench("profidrive").configured(
    {
        "segment": {"can0": {"bitrate": 250_000}},
        "drive": {
            "drive1": {
                "telegram": 103,
                "encoder2": {
                    "type": "multi_turn",
                    "mounting": "load",
                    "steps_per_revolution": 16384,
                    "revolutions": 512,
                },
            }
        },
        "axis": {
            "axis1": {
                "encoders": ["drive1.encoder2"],
                "variables": {
                    "PositionLimits_HW.Active": False,
                    "Sensor[1].Parameter.StepsPerRevolution": 16384,
                },
            }
        },
    }
)
"""Telegram 103 has the halves of G2_XIST1 in its third and fourth PDO, 2.1 ms behind SYNC at 250 kbit/s."""


def test_halves_of_a_position_are_of_the_same_cycle():
    """The position of an encoder whose halves come in two PDOs never jumps, however late the second is."""
    with LATE.build(seed=1) as bench:
        axis = bench.axis()
        bench.wait_until(axis.power().status, 2.0)
        begin = len(bench.trace()["axis1.actual_position"].values)
        bench.wait_until(axis.move_relative(40.0, Velocity=100.0).done, 3.0)
        trace = bench.trace()
    last = [frame.time_ns % 4_000_000 for frame in trace.frames if frame.can_id == 0x485]
    assert min(last[-50:]) > 2_000_000, "the last PDO comes in time: the bus is not busy enough"
    step = np.abs(np.diff(trace["axis1.actual_position"].values[begin:]))
    assert step.max() < 1.05 * 100.0 * 0.004
    found = {check.name: check for check in judge(trace)}
    assert found["actual position of axis1"].verdict is Verdict.PASSED
    assert found["actual speed of axis1"].verdict is Verdict.PASSED
