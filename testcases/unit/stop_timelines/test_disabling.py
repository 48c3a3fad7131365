"""What holds for disabling with MC_Power whatever its stop mode: general rules, brake, enabling again
(sections 8.0, 8.2, 8.4, 8.6).
"""

from __future__ import annotations

import pytest

from emulators.drive.machine import BrakeConfig
from hil.faults import Injector
from motion.s7.axis import AxisState
from testcases.unit.motion_axis.conftest import Rig
from testcases.unit.stop_timelines.telegram_record import CYCLE_S, StopBench

pytestmark = pytest.mark.exhaustive

MODES = pytest.mark.parametrize("mode", [0, 1, 2, 3])


@MODES
@pytest.mark.requirement("STP-251", "STP-291", "MC-163")
def test_all_jobs_end_in_the_cycle_of_the_falling_edge(mode):
    """The job in control, a waiting and a superimposed one show CommandAborted at once, and nobody is Busy
    any more.
    """
    with StopBench().enabled() as bench:
        axis = bench.axis
        bench.watch("basic", axis.move_relative(400.0, Velocity=200.0))
        bench.watch("waiting", axis.move_relative(50.0, BufferMode=1))
        bench.run(0.3)
        bench.watch("on top", axis.move_superimposed(20.0, VelocityDiff=20.0))
        bench.run(0.1)
        assert all(job.Busy for job in bench.jobs.values())
        bench.now()
        axis.power(False, stop_mode=mode)
        bench.run(0.1)
        row = bench.telegrams()[bench.edge]
        for outputs in row.jobs.values():
            assert (outputs["CommandAborted"], outputs["Busy"], outputs["Error"]) == (True, False, False)


@MODES
@pytest.mark.requirement("STP-298")
def test_disabling_at_standstill(mode):
    """Status and Busy fall within the few cycles that the drive needs, and nothing moves."""
    with StopBench().enabled() as bench:
        bench.run(0.1)
        bench.now()
        bench.axis.power(False, stop_mode=mode)
        bench.run(0.2)
        rows = bench.telegrams()
        assert bench.first(lambda row: not row.busy and not row.status) - bench.edge <= 6
        assert max(abs(row.nact) for row in rows[bench.edge :]) < 0.05
        assert rows[-1].actual_position == pytest.approx(rows[bench.edge].actual_position, abs=0.001)


@pytest.mark.requirement("STP-299", "STP-573")
@MODES
def test_a_drive_that_never_shows_that_it_is_off(mode):
    """ZSW1.2 stuck at 1: Busy and Status stay, for as long as one waits; when it lets go the disabling
    completes.
    """
    with StopBench().travelling(100.0) as bench:
        bench.now()
        fault = Injector(bench.machine).inject("telegram.bits", "drive1", signal="ZSW1", set=0x0004)
        power = bench.axis.power(False, stop_mode=mode)
        bench.run(5.0)
        assert (power.Status, power.Busy) == (True, True)
        fault.remove()
        bench.until(power.off)


@pytest.mark.requirement("STP-313", "STP-571")
def test_quick_stop_knows_the_drives_ramp_only():
    """Other dynamics of the object and of the job change nothing; p1135 = 0.25 s halves the time."""
    times = {}
    other = {
        "DynamicDefaults.EmergencyDeceleration": 9000.0,
        "DynamicLimits.MaxDeceleration": 900.0,
        "DynamicDefaults.Deceleration": 300.0,
    }
    for name, variables, drive in (
        ("as it is", {}, {}),
        ("other dynamics", other, {}),
        ("p1135", {}, {"off3_ramp_s": 0.25}),
    ):
        with StopBench(variables=variables, drive=drive).travelling() as bench:
            bench.now()
            bench.until(bench.axis.power(False, stop_mode=1).off)
            bench.telegrams()
            times[name] = bench.ramp("nact")[0]
    assert times["as it is"] == pytest.approx(0.300, abs=2 * CYCLE_S)
    assert times["other dynamics"] == times["as it is"]
    assert times["p1135"] == pytest.approx(0.150, abs=2 * CYCLE_S)


@pytest.mark.requirement("STP-566", "STP-567", "STP-296", "STP-502", "MC-154")
@pytest.mark.parametrize("other", [0, 1, 2, 3])
@pytest.mark.parametrize("mode", [0, 1, 2])
def test_nothing_cancels_or_changes_a_disabling(mode, other):
    """Enable TRUE and FALSE again with another StopMode during the ramp: words and time stay; afterwards the
    axis is enabled.
    """

    def stopped(disturbed):
        with StopBench().travelling() as bench:
            bench.now()
            bench.axis.power(False, stop_mode=mode)
            bench.cycles(6)
            if disturbed:
                bench.axis.power(True, stop_mode=other)
                bench.cycles(2)
                bench.axis.power(False, stop_mode=other)
                bench.cycles(2)
                bench.axis.power(True, stop_mode=other)
            bench.until(lambda: bench.axis.state is AxisState.DISABLED)
            length = len(bench.rows) - bench.edge
            bench.run(0.1)
            bench.telegrams()
            words = [row.stw1 & 0x04FF for row in bench.rows[bench.edge : bench.edge + length - 1]]
            return words, [round(row.nact) for row in bench.rows[bench.edge :][: length - 1]], bench.power

    words, speeds, _ = stopped(False)
    disturbed_words, disturbed_speeds, power = stopped(True)
    assert disturbed_words == words
    assert disturbed_speeds == speeds
    assert power.Status


@pytest.mark.requirement("STP-300", "CFG-136")
@pytest.mark.parametrize("kind", ["VirtualAxis.Mode", "Simulation.Mode"])
@pytest.mark.parametrize(("mode", "seconds"), [(0, 0.075), (1, 0.0), (2, 0.250), (3, 0.0)])
def test_axis_without_a_drive(kind, mode, seconds):
    """Ramps of the object run on the model; without a drive a quick stop and coasting end at once."""
    rig = Rig(variables={kind: 1}).travelling()
    start = rig.scheduler.now / 1e9
    power = rig.axis.power(False, stop_mode=mode)
    if not seconds:
        rig.cycles(4)
        assert rig.axis.var("ActualVelocity") == 0.0
    rig.until(power.off)
    if seconds:
        duration, _ = rig.stop_of_setpoint(start)
        assert duration == pytest.approx(seconds, abs=2 * CYCLE_S)
    else:
        assert rig.scheduler.now / 1e9 - start < 6 * CYCLE_S
    rig.cycles(1)
    assert rig.axis.var("ActualVelocity") == pytest.approx(0.0, abs=0.5)


# -- brake and control words of the user
# ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("open_brake", "closes"),
    [
        pytest.param(False, True, marks=pytest.mark.requirement("STP-333", "STP-334", "STP-579")),
        pytest.param(True, False, marks=pytest.mark.requirement("STP-334", "STP-266")),
    ],
)
def test_coasting_with_a_holding_brake(open_brake, closes):
    """The brake closes with the pulses, at whatever speed; STW1.12 = 1 holds it open."""
    with StopBench(drive={"brake": BrakeConfig(torque_nm=0.5)}).travelling() as bench:
        if open_brake:
            bench.until(bench.axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000).done)
        bench.run(0.1)
        bench.now()
        closed = []
        drive = bench.machine.drive()
        bench.machine.scheduler.every(
            125_000,
            lambda: closed.append(
                (drive.core.enabled, drive.core.brake.closed, drive.mechanics.velocity * 1000.0)
            ),
            priority=50,
        )
        bench.axis.power(False, stop_mode=3)
        bench.run(0.1)
        rows = bench.telegrams()
        assert bool(rows[-1].stw1 & 0x1000) is open_brake
        without_pulses = [entry for entry in closed if not entry[0]]
        assert {brake for _, brake, _ in without_pulses} == {closes}
        assert without_pulses[0][2] > 290.0


@pytest.mark.requirement("STP-335", "STP-257")
def test_control_word_job_during_disabling():
    """MC_SetAxisSTW is aborted while the object is being disabled and its bit stays 0; written again
    afterwards it is there.
    """
    with StopBench().travelling() as bench:
        bench.now()
        power = bench.axis.power(False, stop_mode=1)
        bench.cycles(3)
        job = bench.axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
        bench.cycles(2)
        assert (job.CommandAborted, job.Error) == (True, False)
        bench.until(power.off)
        bench.cycles(2)
        bench.until(bench.axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000).done)
        written = len(bench.rows) - 1
        bench.run(0.1)
        rows = bench.telegrams()
        assert not any(row.stw1 & 0x1000 for row in rows[bench.edge : written])
        assert rows[-1].stw1 == 0x047E | 0x1000


# -- enabling again
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("STP-340", "STP-288", "STP-039", "STP-046", "STP-510")
def test_enabling_while_the_axis_coasts():
    """16#047C, then 16#047E until the drive shows S2, then 16#047F; the axis is caught with
    MaxDeceleration.
    """
    with StopBench().travelling() as bench:
        bench.until(bench.axis.power(False, stop_mode=3).off)
        bench.run(0.1)
        bench.now()
        power = bench.axis.power(True)
        bench.until(power.status)
        assert bench.axis.actual_velocity > 200.0
        assert bench.axis.state is AxisState.ENABLE_RAMP
        bench.run(0.5)
        bench.telegrams()
        assert bench.sequence("stw1") == [0x047C, 0x047E, 0x047F]
        assert bench.sequence("zsw1") == [0x0260, 0x0270, 0x0231, 0x0233, 0x0237] or bench.sequence(
            "zsw1"
        ) == [
            0x0260,
            0x0231,
            0x0233,
            0x0237,
        ]
        assert bench.states() == ["S1", "S2", "S3", "S4"]
        assert bench.axis.state is AxisState.STANDSTILL


@MODES
@pytest.mark.requirement("STP-287", "STP-288", "STP-340", "STP-373")
def test_enabling_after_every_stop(mode):
    """From the word in which the stop has left the drive the next Enable leads through S2 and S3 to S4,
    without motion.
    """
    with StopBench().travelling(100.0) as bench:
        bench.until(bench.axis.power(False, stop_mode=mode).off)
        bench.run(3.0)
        bench.now()
        power = bench.axis.power(True)
        bench.until(power.status)
        bench.run(0.1)
        rows = bench.telegrams()
        assert bench.sequence("stw1") == ([0x047C] if mode == 3 else []) + [0x047E, 0x047F]
        assert bench.states() == (["S1"] if mode == 3 else []) + ["S2", "S3", "S4"]
        assert max(abs(row.nact) for row in rows[bench.edge :]) < 0.1
