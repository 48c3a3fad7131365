"""The same stops on a drive with an analog setpoint, step by step at its terminals (sections 8.3 to 8.6,
8.8.4 and 8.9).
"""

from __future__ import annotations

from functools import cache

import pytest

from emulators.drive.analog_config import AnalogSettings
from testcases.unit.stop_timelines.telegram_record import (
    CYCLE_S,
    AnalogBench,
    after,
    before,
    end,
    event,
    setpoint_zero,
    step,
    steps,
    when,
)

pytestmark = pytest.mark.exhaustive

READY_FALLS = ("enable", "standstill", "never")


@cache
def record(what, falls="enable", stop="ramp", off3_s=0.5, value=7):
    """Return the record of a travelling axis that is stopped, and acknowledged where an alarm has done it."""
    drive = {"analog": AnalogSettings(ready_falls=falls, stop=stop), "off3_ramp_s": off3_s}
    with AnalogBench(variables={"Actor.RemoveEnableReaction": value}, drive=drive).travelling() as bench:
        bench.now()
        if what.startswith("StopMode"):
            bench.axis.power(False, stop_mode=int(what[-1]))
            bench.run(1.6 if stop == "coast" else 1.0)
        else:
            bench.alarm(
                {"4": 521, "1": 533, "2": 104, "3": 321}[what[-1]], int(what[-1]) if what[-1] == "1" else None
            )
            bench.run(0.8)
            bench.watch("reset", bench.axis.reset())
            bench.run(0.2)
        return bench


MOVING = {"enable_output": True, "ready_input": True, "status": True, "busy": True}
START = step(
    "STP-308", before, analog_output=(6.0, 0.01), on="0 10 12", job_move="Busy", in_operation=True, **MOVING
)
AT_ZERO = {"enable_output": False, "analog_output": (0.0, 0.0)}
OFF = {"status": False, "busy": False, "in_operation": False, "off": "0"}


def ramp_of_the_axis(first, zero, complete, middle_ms, volts):
    """Return the steps of StopMode 0 and 2."""
    return [
        START,
        step(first, event, job_move="CommandAborted", on="0", off="10", **MOVING),
        step(first, after(middle_ms), analog_output=(volts, 0.3), on="0 14", in_operation=True, **MOVING),
        step(f"{zero} STP-297", setpoint_zero, enable_output=True, status=True, busy=True),
        step(f"{zero} STP-297", when(lambda row: row.setpoint == 0.0, plus=1), **AT_ZERO),
        step(complete, when(lambda row: not row.busy), on="6", **AT_ZERO, **OFF),
        step(complete, end, on="6 7", **AT_ZERO, **OFF),
    ]


TIMELINES = {
    "StopMode 0": ramp_of_the_axis("STP-308", "STP-309", "STP-310", 40, 3.1),
    "StopMode 2": ramp_of_the_axis("STP-330", "STP-330", "STP-330", 104, 4.0),
    "StopMode 1": [
        step("STP-321", event, job_move="CommandAborted", on="0", off="10", status=True, busy=True),
        step("STP-321", after(8), on="0 14", status=True, busy=True, in_operation=False, **AT_ZERO),
        step(
            "STP-322",
            after(160),
            state="Stopping",
            actual_velocity=(150.0, 5.0),
            status=True,
            busy=True,
            **AT_ZERO,
        ),
        step("STP-323", when(lambda row: not row.busy), on="6", actual_velocity=(0.0, 2.0), **AT_ZERO, **OFF),
        step("STP-323", end, on="6 7", **AT_ZERO, **OFF),
    ],
    "StopMode 3": [
        step("STP-341", event, job_move="CommandAborted", off="10", busy=True),
        step(
            "STP-332 STP-341",
            after(8),
            on="6",
            off="0 7",
            actual_velocity=(300.0, 2.0),
            status=False,
            busy=False,
            **AT_ZERO,
        ),
        step("STP-341", end, on="6 7", **AT_ZERO, **OFF),
    ],
    "Reaction 4": [
        step("STP-377", event, on="1", off="0", status=False, busy=True, reaction=4, job_move="Error 8001"),
        step("STP-377", after(4), status=False, busy=True, reaction=4, on="1", off="0", **AT_ZERO),
        step(
            "STP-378",
            after(160),
            state="Stopping",
            actual_velocity=(150.0, 8.0),
            status=False,
            busy=True,
            **AT_ZERO,
        ),
        step("STP-378", after(400), state="Standby", on="1 6 7", off="0", status=False, busy=True, **AT_ZERO),
        step("STP-380", when(lambda row: row.reaction == 0), off="1", status=False, job_reset="Done"),
        step("STP-380", when(lambda row: row.reaction == 0 and row.enable_output), status=False, busy=True),
        step(
            "STP-380",
            end,
            enable_output=True,
            ready_input=True,
            on="0 6",
            status=True,
            busy=True,
            in_operation=True,
        ),
    ],
    **{
        f"Reaction {reaction}": [
            step("STP-398", event, on="0 1 14", job_move="Error 8001", reaction=reaction, **MOVING),
            step(
                "STP-398", after(half), analog_output=(volts, 0.3), on="0 1 14", reaction=reaction, **MOVING
            ),
            step(
                "STP-399",
                when(lambda row: row.setpoint == 0.0, plus=2),
                status=False,
                busy=True,
                on="1",
                off="0",
                **AT_ZERO,
            ),
            step(
                "STP-399",
                after(600),
                status=False,
                busy=True,
                on="1 6 7",
                off="0",
                reaction=reaction,
                **AT_ZERO,
            ),
            step("STP-401", when(lambda row: row.reaction == 0), off="1", job_reset="Done"),
            step("STP-401", end, enable_output=True, on="0 6", status=True, busy=True, in_operation=True),
        ]
        for reaction, half, volts in ((2, 104, 4.0), (3, 40, 2.5))
    },
}


@pytest.mark.parametrize(("timeline", "step"), steps(TIMELINES))
def test_step(timeline, step):
    """What the step prints is at the terminals, in the status word and at the outputs of the jobs."""
    step.check(record(timeline, stop="coast" if timeline == "StopMode 3" else "ramp"))


@pytest.mark.parametrize(
    ("what", "seconds"),
    [
        pytest.param("StopMode 0", 0.075, marks=pytest.mark.requirement("STP-308", "STP-239")),
        pytest.param("StopMode 2", 0.250, marks=pytest.mark.requirement("STP-330", "STP-241")),
        pytest.param("Reaction 1", 0.400, marks=pytest.mark.requirement("STP-398", "STP-243")),
        pytest.param("Reaction 2", 0.250, marks=pytest.mark.requirement("STP-398", "STP-244")),
        pytest.param("Reaction 3", 0.075, marks=pytest.mark.requirement("STP-398", "STP-245")),
    ],
)
def test_ramp_of_the_axis(what, seconds):
    """The analog output falls from 6 V to 0 in the time of the ramp, the enable output stays until then."""
    bench = record(what)
    rows = bench.rows
    zero = bench.first(lambda row: row.setpoint == 0.0)
    assert bench.ramp("setpoint")[0] == pytest.approx(seconds, abs=2 * CYCLE_S)
    assert all(row.enable_output for row in rows[bench.edge : zero + 1])
    for number in range(
        bench.edge, zero
    ):  # V are 50 mm/s; the terminal shows the setpoint of the cycle before
        assert rows[number + 1].analog_output == pytest.approx(rows[number].setpoint / 50.0, abs=0.4)


@pytest.mark.requirement("STP-322", "STP-378")
@pytest.mark.parametrize("what", ["StopMode 1", "Reaction 4"])
@pytest.mark.parametrize("off3_s", [0.5, 0.25])
def test_ramp_of_the_drive(what, off3_s):
    """Quick stop and reaction 4 take what is configured at the drive."""
    bench = record(what, off3_s=off3_s)
    first = bench.first(lambda row: not row.enable_output)
    stands = bench.first(lambda row: abs(row.actual_velocity) < 2.5, first)
    assert (stands - first) * CYCLE_S == pytest.approx(0.6 * off3_s, abs=3 * CYCLE_S)


@pytest.mark.requirement("STP-378")
def test_remove_enable_reaction_means_nothing():
    """There is one enable wire: whatever the value, the same happens at the terminals in every cycle."""
    seen = [
        [
            (row.enable_output, row.analog_output, round(row.actual_velocity))
            for row in bench.rows[bench.edge : bench.edge + 120]
        ]
        for bench in (record("Reaction 4", value=value) for value in (1, 3, 5, 7))
    ]
    assert seen.count(seen[0]) == 4


@pytest.mark.parametrize(
    "what",
    [
        pytest.param("StopMode 0", marks=pytest.mark.requirement("STP-310", "STP-563")),
        pytest.param("StopMode 1", marks=pytest.mark.requirement("STP-323", "STP-563")),
        pytest.param("StopMode 2", marks=pytest.mark.requirement("STP-330", "STP-563")),
        pytest.param("StopMode 3", marks=pytest.mark.requirement("STP-341", "STP-563")),
        pytest.param("Reaction 4", marks=pytest.mark.requirement("STP-379")),
        pytest.param("Reaction 2", marks=pytest.mark.requirement("STP-400")),
        pytest.param("Reaction 3", marks=pytest.mark.requirement("STP-400")),
    ],
)
def test_nothing_waits_for_the_ready_signal(what):
    """Whether it falls with the enable, at standstill or never: outputs, Status and Busy are the same in
    every cycle.
    """
    seen = [
        [
            (row.enable_output, row.analog_output, row.status, row.busy, row.x & 0x43)
            for row in bench.rows[bench.edge : bench.edge + 150]
        ]
        for bench in (record(what, falls=falls) for falls in READY_FALLS)
    ]
    assert seen.count(seen[0]) == 3
    levels = [record(what, falls=falls).rows[record(what).edge + 150].ready_input for falls in READY_FALLS]
    assert levels == [False, False, True]
