"""Alarms that keep the axis enabled or not, raised by their causes: switches, software limits, the drive, the
bus (sections 8.9.1 and 11.6).
"""

from __future__ import annotations

import pytest

from hil.faults import Injector
from motion.s7.axis import AxisState
from testcases.unit.stop_timelines.telegram_record import StopBench

pytestmark = pytest.mark.exhaustive

HW, SW = "PositionLimits_HW", "PositionLimits_SW"
KEPT, REMOVED = [0x047F], [0x047B, 0x0478]


def approach(number, variables):
    """Return the record of an axis that meets a limit, as the configuration says, and stands then."""
    bench = StopBench(variables=variables).enabled()
    axis = bench.axis
    if number != 531:
        bench.until(axis.home(499.5 if number == 534 else 0.0).done)
    if number == 534:
        given = bench.watch("move", axis.motion_in_position(499.5))
        bench.cycles(3)
        bench.now()
        given.set(
            Position=500.5
        )  # only a setpoint from outside gets beyond a limit without having reached it
    else:
        bench.watch("move", axis.move_velocity(200.0, Deceleration=1000.0, Jerk=10000.0))
        bench.until(bench.jobs["move"].in_velocity)
        bench.run(0.1)
        bench.now()
        if number == 531:
            Injector(bench.machine).inject("switch.stuck", input="positive_limit", state=True)
    bench.until(lambda: bench.axis.var("ErrorDetail.Number"), 4.0)
    bench.run(0.8)
    return bench


@pytest.mark.parametrize(
    ("number", "variables", "reaction", "words"),
    [
        pytest.param(
            531,
            {f"{HW}.Mode": 0, f"{HW}.ApproachBehavior": 1},
            3,
            KEPT,
            marks=pytest.mark.requirement("STP-589"),
        ),
        pytest.param(
            531,
            {f"{HW}.Mode": 0, f"{HW}.ApproachBehavior": 0},
            4,
            REMOVED,
            marks=pytest.mark.requirement("STP-594"),
        ),
        pytest.param(
            531,
            {f"{HW}.Mode": 1, f"{HW}.ApproachBehavior": 1},
            4,
            REMOVED,
            marks=pytest.mark.requirement("STP-594"),
        ),
        pytest.param(
            533,
            {f"{SW}.Active": True, f"{SW}.LimitReachedBehavior": 0},
            2,
            KEPT,
            marks=pytest.mark.requirement("STP-590"),
        ),
        pytest.param(
            533,
            {f"{SW}.Active": True, f"{SW}.LimitReachedBehavior": 1},
            1,
            KEPT,
            marks=pytest.mark.requirement("STP-590"),
        ),
        pytest.param(
            534,
            {f"{SW}.Active": True, f"{SW}.LimitExceededBehavior": 1},
            3,
            KEPT,
            marks=pytest.mark.requirement("STP-591"),
        ),
        pytest.param(
            534,
            {f"{SW}.Active": True, f"{SW}.LimitExceededBehavior": 0},
            4,
            REMOVED,
            marks=pytest.mark.requirement("STP-594"),
        ),
    ],
)
def test_limits(number, variables, reaction, words):
    """The reaction of the configuration; enabled to the end with 16#047F, or the enable removed at once."""
    with approach(number, variables) as bench:
        rows = bench.telegrams()
        assert (rows[-1].number, rows[-1].reaction) == (number, reaction)
        raised = bench.first(lambda row: row.number)
        assert bench.sequence("stw1", raised) == words
        assert {row.stw1 & 0x04FF for row in rows[bench.edge : raised]} <= {0x047F}
        assert rows[-1].status is (words == KEPT)
        assert bench.axis.state is (AxisState.ALARM_STANDSTILL if words == KEPT else AxisState.ALARM_DISABLED)
        assert bench.jobs["move"].ErrorID == 0x8001
        assert abs(rows[-1].nact) < 0.1
        if number == 533:
            assert rows[-1].position == pytest.approx(500.0, abs=0.01)


@pytest.mark.requirement("STP-598", "STP-072")
@pytest.mark.parametrize("number", [531, 533])
def test_the_way_back(number):
    """Acknowledged at the limit, no word changes but bit 7; the way back is free at once, the way on raises
    the alarm again.
    """
    variables = {f"{SW}.Active": number == 533}
    with approach(number, variables) as bench:
        bench.now()
        bench.until(bench.axis.reset().done)
        assert bench.axis.state is AxisState.STANDSTILL
        on = bench.axis.move_velocity(20.0)
        bench.run(0.3)
        assert on.ErrorID == 0x8001
        assert bench.axis.var("ErrorDetail.Number") == number
        bench.until(bench.axis.reset().done)
        back = bench.axis.move_velocity(-50.0)
        bench.until(back.in_velocity)
        bench.run(0.1)
        bench.telegrams()
        assert {f"{word:04X}" for word in bench.sequence("stw1")} == {"047F", "04FF"}
        assert bench.axis.actual_velocity == pytest.approx(-50.0, abs=1.0)


@pytest.mark.requirement("STP-594")
@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        pytest.param("drive.fault", {"code": 0x2310}, id="fault", marks=pytest.mark.requirement("STP-559")),
        pytest.param(
            "telegram.bits",
            {"signal": "ZSW1", "clear": 0x0200},
            id="no control",
            marks=pytest.mark.requirement("STP-558"),
        ),
        pytest.param("drive.sto", {}, id="STO", marks=pytest.mark.requirement("STP-560")),
        pytest.param(
            "telegram.bits",
            {"signal": "ZSW1", "set": 0x0040, "clear": 0x0007},
            id="off",
            marks=pytest.mark.requirement("STP-608"),
        ),
    ],
)
def test_drive_that_drops_out(kind, parameters):
    """Fault, control taken away, safe torque off, switched off by itself: 421 with reaction 4, Status FALSE,
    Busy TRUE.
    """
    with StopBench().travelling() as bench:
        fault = Injector(bench.machine).inject(kind, "drive1", **parameters)
        bench.until(lambda: bench.axis.var("ErrorDetail.Number"), 0.1)
        bench.run(2.0)
        row = bench.rows[-1]
        assert (row.number, row.reaction) == (421, 4)
        assert (row.status, row.busy, row.enable) == (False, True, True)
        assert bench.axis.var("ErrorWord.X4")
        assert abs(row.actual_velocity) < 0.1
        fault.remove()
        bench.run(3.0)
        bench.until(bench.axis.reset().done)
        bench.until(bench.power.status)
        bench.run(0.02)
        assert bench.telegrams()[-1].state == "S4"
