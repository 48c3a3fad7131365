"""Levels that take time: what comes later, what is missing, and what stops the controller (MC-636,
MC-637).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from motion.s7.axis.state import AxisState
from motion.s7.controller import OperatingState
from motion.s7.runtime import Runtime

STOP, RUN = OperatingState.STOP, OperatingState.RUN
T = 4 * MS


class TestServo:
    """MC_Servo with its blocks."""

    @pytest.mark.requirement("MC-636")
    @pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
    def test_within_the_send_clock(self, rig, share):
        """It ends in time: nothing is reported, and the axis moves as always, its outputs later by the
        time.
        """
        rig.travelling(100.0)
        rig.controller.levels.set_computing_time(servo_ns=round(share * T))
        rig.cycles(2)
        rig.rows.clear()
        rig.run(1.0)
        assert rig.controller.state is RUN
        assert len(rig.rows) == 250
        position = rig.column("position_setpoint")
        assert {round(b - a, 9) for a, b in pairwise(position)} == {0.4}
        assert rig.times()[-1] % 0.004 == pytest.approx((0.002 + 0.004 * share) % 0.004, abs=1e-9)
        assert not rig.reported("overflow")

    @pytest.mark.requirement("MC-636")
    def test_longer_than_the_application_cycle(self, rig):
        """The next call finds it still running: STOP, and every axis stops as Actor.RemoveEnableReaction
        says.
        """
        rig.travelling(200.0)
        rig.controller.levels.set_computing_time(servo_ns=round(1.1 * T))
        rig.cycles(3)
        assert rig.controller.state is STOP
        assert rig.column("stw1")[-1] == 0x047B
        rig.controller.levels.set_computing_time(servo_ns=0)
        rig.until(lambda: rig.axis.state is AxisState.DISABLED)
        assert rig.reported("MC_Servo runs longer than the application cycle")
        rig.running().enabled()

    @pytest.mark.requirement("MC-636", "CFG-187")
    def test_longer_than_the_send_clock(self):
        """With an application cycle of two send clocks: an entry, once, no longer isochronous, but no
        STOP.
        """
        scheduler = VirtualScheduler()
        runtime = Runtime(scheduler, cycle_ns=4 * MS, send_clock_ns=2 * MS, history=History(scheduler))
        calls = []
        runtime.call(lambda: calls.append(scheduler.now))
        runtime.start()
        levels, buffer = runtime.controller.levels, runtime.controller.diagnostics_buffer
        levels.set_computing_time(servo_ns=2 * MS)
        scheduler.run_for(40 * MS)
        assert levels.isochronous
        assert not buffer.entries
        levels.set_computing_time(servo_ns=3 * MS)
        scheduler.run_for(40 * MS)
        assert not levels.isochronous
        assert [entry.text for entry in buffer.entries] == [
            "overflow of MC_Servo: longer than the send clock, no longer isochronous"
        ]
        assert runtime.controller.state is RUN
        assert len(calls) == 19  # the one that has begun ends 1 ms later
        levels.set_computing_time(servo_ns=5 * MS)
        scheduler.run_for(12 * MS)
        assert runtime.controller.state is STOP


class TestInterpolator:
    """MC_Interpolator, which MC_Servo interrupts."""

    def run_for(self, rig, calls):
        """Let `calls` cycles pass; returns how often the axis got a new setpoint."""
        rig.rows.clear()
        rig.cycles(calls)
        position = rig.column("position_setpoint")
        return sum(1 for a, b in pairwise(position) if b != a)

    @pytest.mark.requirement("MC-637")
    def test_within_its_cycle(self, rig):
        """It has its setpoints ready when MC_Servo wants them."""
        rig.travelling(100.0)
        rig.controller.levels.set_computing_time(interpolator_ns=round(0.95 * T))
        assert self.run_for(rig, 50) == 49
        assert not rig.reported("overflow")

    @pytest.mark.requirement("MC-637")
    @pytest.mark.parametrize("hits", [1, 2, 3])
    def test_up_to_three_overflows_in_a_row(self, rig, hits):
        """One call of MC_Servo may interrupt it: each time an entry, the setpoint stays, and it goes on
        afterwards.
        """
        rig.travelling(100.0)
        levels = rig.controller.levels
        levels.set_computing_time(interpolator_ns=round(1.2 * T))
        rig.cycles(1)
        rig.rows.clear()
        rig.cycles(hits)
        levels.set_computing_time(interpolator_ns=round(0.3 * T))
        rig.cycles(30)
        assert rig.controller.state is RUN
        assert len(rig.reported("overflow of MC_Interpolator")) == hits
        position = rig.column("position_setpoint")
        assert (
            sum(1 for a, b in pairwise(position) if a == b) == hits - 1
        )  # the first one repeats what was before the rows
        assert rig.axis.state is AxisState.MOTION

    @pytest.mark.requirement("MC-637")
    def test_the_fourth_in_a_row(self, rig):
        """STOP; the entries tell all four."""
        rig.travelling(100.0)
        rig.controller.levels.set_computing_time(interpolator_ns=round(1.2 * T))
        rig.cycles(10)
        assert rig.controller.state is STOP
        assert len(rig.reported("overflow of MC_Interpolator")) == 3
        assert rig.reported("MC_Interpolator, 4 times in a row")

    @pytest.mark.requirement("MC-637")
    def test_interrupted_twice(self, rig):
        """A run that a second call of MC_Servo finds still going: STOP at that call."""
        rig.travelling(100.0)
        rig.controller.levels.set_computing_time(interpolator_ns=round(2.1 * T))
        rig.cycles(2)
        assert rig.controller.state is RUN
        rig.cycles(1)
        assert rig.controller.state is STOP
        assert rig.reported("interrupted by a second call of MC_Servo")

    @pytest.mark.requirement("MC-637")
    def test_the_servo_takes_its_share(self, rig):
        """0.6 T and 0.5 T do not fit into one cycle together, 0.5 T and 0.4 T do."""
        rig.travelling(100.0)
        levels = rig.controller.levels
        levels.set_computing_time(servo_ns=round(0.5 * T), interpolator_ns=round(0.4 * T))
        rig.cycles(20)
        assert not rig.reported("overflow")
        levels.set_computing_time(servo_ns=round(0.6 * T), interpolator_ns=round(0.5 * T))
        rig.cycles(2)
        assert rig.reported("overflow of MC_Interpolator")

    @pytest.mark.exhaustive
    def test_a_longer_cycle(self, make_rig):
        """An interpolator that is due every fourth cycle may be interrupted by the servo calls in between."""
        rig = make_rig(cycle_ns=2 * MS, ratio=4).travelling(100.0)
        levels = rig.controller.levels
        levels.set_computing_time(servo_ns=MS // 2, interpolator_ns=5 * MS)
        rig.rows.clear()
        rig.cycles(80)
        assert not rig.reported("overflow")
        position = rig.column("position_setpoint")
        assert {round(b - a, 9) for a, b in pairwise(position)} == {0.2}
        levels.set_computing_time(interpolator_ns=7 * MS)
        rig.cycles(40)
        assert rig.controller.state is STOP


@pytest.mark.requirement("STP-588")
def test_a_stall(rig):
    """Nobody notices in the controller: no telegrams while it lasts, then everything goes on where it was."""
    rig.travelling(100.0)
    rig.rows.clear()
    rig.controller.levels.stall(True)
    rig.cycles(25)
    assert rig.controller.state is RUN
    assert len(set(rig.column("position_setpoint"))) == 1
    rig.controller.levels.stall(False)
    rig.cycles(3)
    assert len(set(rig.column("position_setpoint")[-3:])) == 3


def test_times_that_are_none(rig):
    """A negative time is refused."""
    with pytest.raises(ConfigurationError, match="servo_ns"):
        rig.controller.levels.set_computing_time(servo_ns=-1)
    assert rig.controller.levels.computing_time == (0, 0)


def test_a_time_that_ends_in_the_middle(rig):
    """What has begun still comes, once."""
    rig.travelling(100.0)
    levels = rig.controller.levels
    levels.set_computing_time(servo_ns=3 * MS)
    rig.cycles(3)
    rig.rows.clear()
    levels.set_computing_time(servo_ns=0)
    rig.cycles(5)
    position = rig.column("position_setpoint")
    assert {round(b - a, 9) for a, b in pairwise(position)} == {0.4}
