"""States and transitions of the technology object on a PROFIdrive drive: outputs as printed, the control word
from the wire (section 9).
"""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from motion.s7.axis import AxisState
from testcases.catalogue import each, requirements_in
from testcases.unit.motion_axis.test_stop_states import OUTPUTS, TRANSITIONS, happen, reach, state
from testcases.unit.stop_timelines.telegram_record import STW1_MASK, StopBench

S = AxisState
CONTROLLED = {
    S.ENABLE_RAMP,
    S.STANDSTILL,
    S.MOTION,
    S.HALTING,
    S.STOPPING,
    S.STOP_HOLD,
    S.ALARM_RAMP,
    S.ALARM_STANDSTILL,
    S.DISABLING_RAMP,
}
"""Position and speed control are on (column of section 9.1)."""
DRIVE_STATES = {
    S.DISABLED: "S2",
    S.ENABLING: "S1 S2 S3 S4",
    S.ALARM_DRIVE_STOP: "S5",
    S.ALARM_DISABLED: "S1",
    S.DISABLING_QUICK: "S5",
    S.DISABLING_COAST: "S4 S1",
    S.RESTARTING: "S2",
}
"""Where the drive is then; S4 where nothing is said."""
SHORT = {S.ENABLING, S.RESTARTING}
"""States that last some cycles only: what is read there is the telegram of the present cycle."""


class Rig(StopBench):
    """The bench under the names that the tests of the simulated drive use."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.port = SimpleNamespace()
        self.runtime = self.machine.runtime

    def column(self, name: str) -> list[float]:
        return [getattr(row, {"velocity_setpoint": "setpoint"}.get(name, name)) for row in self.rows]


@pytest.mark.parametrize(
    ("wanted", "x0", "x1", "status", "busy", "stw1", "error"),
    [
        pytest.param(row[0], *row[2:], id=row[0].name, marks=pytest.mark.requirement(row[1]))
        for row in OUTPUTS
    ],
)
def test_outputs_of_a_state(wanted, x0, x1, status, busy, stw1, error):
    """X0, X1, Status, Busy, STW1 on the wire, who controls, and what happens to a motion job."""
    with Rig() as rig:
        reach(rig, wanted)
        if wanted not in SHORT:
            rig.cycles(1)
        row = rig.rows[-1]
        at = len(rig.rows) - 1
        assert (row.x & 1, row.x >> 1 & 1, int(row.status), int(row.busy)) == (x0, x1, status, busy)
        assert row.state in DRIVE_STATES.get(wanted, "S4").split()
        if wanted not in CONTROLLED:
            assert row.output == 0.0
            assert abs(row.position - row.actual_position) < 1e-6
        job = rig.axis.move_velocity(250.0)
        rig.cycles(1)
        assert job.ErrorID == error
        assert job.Busy is (error == 0)
        rig.cycles(1)
        rows = rig.telegrams()
        if stw1 is not None:
            assert f"{rows[at].stw1 & STW1_MASK:04X}" == f"{stw1:04X}"
        elif wanted is S.ENABLING:
            assert rows[at].stw1 & STW1_MASK in (0x047E, 0x047F)
        elif wanted is S.DISABLING_COAST:
            assert rows[at].stw1 & STW1_MASK == 0x047C
        else:
            assert rows[at].stw1 & STW1_MASK == 0x0478


TRANSITION_CASES = [
    pytest.param(
        start,
        event,
        end,
        id=f"{start.name}-{event.replace(' ', '_')}",
        marks=pytest.mark.requirement(identifier),
    )
    for identifier, start, event, end in TRANSITIONS
]


def check_transition(start, event, end):
    with Rig() as rig:
        extra = reach(rig, start)
        passed = []
        rig.runtime.after_cycle.append(lambda: passed.append(state(rig)))
        happen(rig, event, extra)
        passed.append(state(rig))
        rig.cycles(2)
        assert end in passed
        assert set(passed) <= {start, end, S.DISABLED, S.ALARM_DISABLED}
        rig.cycles(2)
        rig.telegrams()


@pytest.mark.exhaustive
@requirements_in(TRANSITION_CASES)
def test_transition(subtests):
    """The event leads to the printed state, through none that is not printed."""
    for label, values in each(TRANSITION_CASES):
        with subtests.test(label):
            check_transition(*values)
