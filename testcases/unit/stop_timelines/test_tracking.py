"""A drive that brakes by itself, behind a PROFIdrive telegram (states TRACKING and ALARM_DRIVE_STOP of
section 9).
"""

from __future__ import annotations

import pytest

from hil.faults import Injector
from testcases.unit.stop_timelines.telegram_record import StopBench


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-446", "CTL-003", "CFG-561", "STP-460", "STP-595")
def test_setpoints_follow_a_drive_that_brakes_by_itself():
    """Safe stop 1: alarm 550, STW1 stays 16#047F, position and velocity are the actual ones, nothing is put
    out.
    """
    with StopBench().travelling() as bench:
        bench.now()
        Injector(bench.machine).inject("drive.ss1", "drive1")
        read = bench.axis.var
        seen = []
        bench.machine.on_cycle(
            lambda: seen.append((read("Velocity"), read("ActualVelocity"), read("ErrorDetail.Reaction")))
        )
        bench.run(0.2)
        rows = bench.telegrams()[bench.edge + 4 :]
        assert {row.stw1 & 0x04FF for row in rows} == {0x047F}
        assert {row.output for row in rows} == {0.0}
        assert {row.number for row in rows} == {550}
        assert not any(row.x & 1 or row.status for row in rows)
        assert all(row.busy for row in rows)
        assert all(abs(row.position - row.actual_position) < 1e-6 for row in rows)
        velocities = [row[:2] for row in seen if row[2] == 5]
        assert len(velocities) > 40
        assert all(setpoint == actual for setpoint, actual in velocities)
        assert velocities[0][0] - velocities[-1][0] > 100.0
        assert rows[-1].jobs["move"]["ErrorID"] == 0x8001
