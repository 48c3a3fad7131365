"""MC_Halt and MC_Stop behind a PROFIdrive telegram (sections 8.10 and 8.11)."""

from __future__ import annotations

from functools import cache

import pytest

from motion.s7.axis import AxisState
from testcases.unit.stop_timelines.telegram_record import (
    CYCLE_S,
    StopBench,
    after,
    answer,
    before,
    end,
    event,
    setpoint_zero,
    step,
    steps,
    when,
)

ON = {"stw1": 0x047F, "zsw1": 0x0237, "state": "S4", "status": True, "busy": True, "in_operation": True}


@cache
def halted():
    """Return the record of a travelling axis that is halted with the defaults, and of a job afterwards."""
    with StopBench().travelling() as bench:
        bench.now()
        bench.watch("halt", bench.axis.halt())
        bench.run(0.6)
        bench.watch("again", bench.axis.move_velocity(50.0))
        bench.run(0.2)
        bench.telegrams()
        return bench


@cache
def stopped(mode=2, **inputs):
    """Return the record of a travelling axis that MC_Stop stops and holds; jobs before, during and after the
    hold.
    """
    with StopBench().travelling() as bench:
        bench.now()
        stop = bench.watch("stop", bench.axis.stop(mode, **inputs))
        bench.run(0.04)
        bench.watch("late", bench.axis.move_velocity(50.0))
        bench.run(0.46)
        bench.watch("held", bench.axis.move_velocity(50.0))
        bench.run(0.1)
        stop.set(Execute=False)
        bench.run(0.1)
        bench.watch("again", bench.axis.move_velocity(50.0))
        bench.run(0.2)
        bench.telegrams()
        return bench


RELEASED = after(604)
HALT = [
    step("STP-409", before, job_move="Busy", **ON),
    step("STP-409", event, job_halt="Busy", **ON),
    step("STP-409 STP-254", answer, job_move="CommandAborted", job_halt="Busy", on="0 14", off="10 12", **ON),
    step("STP-410 STP-451", after(200), job_halt="Busy", on="0 14", setpoint=(150.0, 8.0), **ON),
    step("STP-411", setpoint_zero, off="14", on="12", **ON),
    step("STP-411", when(lambda row: row.jobs["halt"]["Done"]), job_halt="Done", off="14", on="0 6 12", **ON),
    step("STP-412", after(500), on="6 7", job_halt="Done", **ON),
    step("STP-402 STP-413 STP-254", end, job_again="Busy", on="0 10", nact=(50.0, 1.0), **ON),
]
STOP = [
    step("STP-427", before, job_move="Busy", **ON),
    step("STP-427", event, job_stop="Busy", on2="0", **ON),
    step(
        "STP-427 STP-255",
        answer,
        job_move="CommandAborted",
        job_stop="Busy",
        on="0 14",
        off="10 12",
        on2="0",
        **ON,
    ),
    step("STP-428 STP-452", after(44), job_late="Error 800F", job_stop="Busy", on="0 14", on2="0", **ON),
    step("STP-428", after(104), setpoint=(200.0, 16.0), acceleration=(-2000.0, 1.0), on2="0", **ON),
    step("STP-429", setpoint_zero, on="12", off="14", on2="0", **ON),
    step(
        "STP-429 STP-421",
        when(lambda row: row.jobs["stop"]["Done"]),
        job_stop="Done",
        on="0 6 12",
        on2="0",
        **ON,
    ),
    step(
        "STP-429 STP-414 STP-453", after(500), job_stop="Done", on="0 6 7 12", on2="0", nact=(0.0, 0.05), **ON
    ),
    step("STP-430 STP-415 STP-255", after(504), job_held="Error 800F", nact=(0.0, 0.05), on2="0", **ON),
    step("STP-431 STP-478", RELEASED, job_stop="", off2="0", on="0 6 7", **ON),
    step("STP-431", after(700), job_late="Error 800F", job_held="Error 800F", nact=(0.0, 0.05), **ON),
    step("STP-431 STP-415", end, job_again="Busy", on="0 10", nact=(50.0, 1.0), **ON),
]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("timeline", "step"), steps({"MC_Halt": HALT, "MC_Stop": STOP}))
def test_step(timeline, step):
    """What the step prints is on the wire, in the status words and at the outputs of the jobs."""
    step.check(halted() if timeline == "MC_Halt" else stopped())


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-406", "STP-414", "STP-511")
@pytest.mark.parametrize("record", [halted, stopped])
def test_the_drive_stays_on(record):
    """From the stop to the next motion one word is sent and one answer comes; Status never falls."""
    bench = record()
    assert bench.sequence("stw1") == [0x047F]
    assert bench.sequence("zsw1") == [0x0237]
    assert all(row.status and row.x & 1 for row in bench.rows[bench.edge :])


@pytest.mark.parametrize(
    ("mode", "inputs", "seconds", "travel"),
    [
        pytest.param(
            None, (), 0.400, 60.0, marks=pytest.mark.requirement("STP-012", "STP-247", "STP-402", "STP-410")
        ),
        pytest.param(0, (), 0.075, 11.25, marks=pytest.mark.requirement("STP-008", "STP-248", "STP-416")),
        pytest.param(
            2, (), 0.250, 37.5, marks=pytest.mark.requirement("STP-009", "STP-249", "STP-418", "STP-428")
        ),
        pytest.param(3, (), 0.400, 60.0, marks=pytest.mark.requirement("STP-012", "STP-250", "STP-419")),
        pytest.param(
            3,
            (("Deceleration", 3000.0), ("Jerk", 10000.0)),
            0.346,
            51.96,
            marks=pytest.mark.requirement("STP-013", "STP-419"),
        ),
        pytest.param(
            3,
            (("Deceleration", 1500.0), ("Jerk", 0.0)),
            0.200,
            30.0,
            marks=pytest.mark.requirement("STP-419"),
        ),
    ],
)
def test_ramp(mode, inputs, seconds, travel):
    """Duration and travel of the setpoint, which the drive follows in every telegram."""
    bench = halted() if mode is None else stopped(mode, **dict(inputs))
    duration, way = bench.ramp("setpoint")
    assert duration == pytest.approx(seconds, abs=2 * CYCLE_S)
    assert way == pytest.approx(travel, abs=300.0 * 2 * CYCLE_S)
    standing = bench.first(lambda row: row.setpoint == 0.0)
    assert max(abs(row.nset - row.setpoint) for row in bench.rows[bench.edge : standing]) < 1.0


@pytest.mark.requirement("STP-411", "STP-429")
@pytest.mark.parametrize(("record", "name"), [(halted, "halt"), (stopped, "stop")])
def test_done_waits_for_the_position(record, name):
    """Done comes when the actual position has been in its window for the minimum dwell time of 10 ms."""
    bench = record()
    zero = bench.first(lambda row: row.setpoint == 0.0)
    window = bench.axis.object.variables.read("PositioningMonitoring.Window")
    inside = bench.first(lambda row: abs(row.position - row.actual_position) <= window, zero)
    done = bench.first(lambda row: row.jobs[name]["Done"])
    assert (done - inside) * CYCLE_S == pytest.approx(0.012, abs=CYCLE_S)


@pytest.mark.requirement("STP-417", "STP-419")
@pytest.mark.parametrize(
    ("mode", "inputs", "error"),
    [(1, {}, 0x800A), (4, {}, 0x800A), (-1, {}, 0x800A), (3, {"Deceleration": 0.0}, 0x8005)],
)
def test_inputs_that_are_refused(mode, inputs, error):
    """The job ends with its error and the axis travels on."""
    with StopBench().travelling(100.0) as bench:
        job = bench.axis.stop(mode, **inputs)
        bench.run(0.05)
        assert (job.Error, job.ErrorID, job.Busy) == (True, error, False)
        assert bench.jobs["move"].Busy
        assert bench.axis.actual_velocity == pytest.approx(100.0, abs=1.0)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("give", "abort", "peak"),
    [
        pytest.param("halt", False, 250.0, marks=pytest.mark.requirement("STP-403")),
        pytest.param("halt", True, 200.0, marks=pytest.mark.requirement("STP-403")),
        pytest.param("stop", False, 250.0, marks=pytest.mark.requirement("STP-420")),
        pytest.param("stop", True, 200.0, marks=pytest.mark.requirement("STP-420")),
    ],
)
def test_acceleration_at_the_start(give, abort, peak):
    """With +1000 mm/s2 at 200 mm/s and a jerk of 10 000 the velocity rises by 50 mm/s, or not at all."""
    with StopBench().enabled() as bench:
        bench.axis.move_velocity(450.0, Acceleration=1000.0, Jerk=10000.0)
        bench.until(lambda: bench.rows[-1].setpoint >= 200.0 - 4.0 - 1e-6)
        assert bench.rows[-1].acceleration == pytest.approx(1000.0)
        bench.now()
        arguments = {"AbortAcceleration": abort, "Jerk": 10000.0}
        if give == "halt":
            bench.axis.halt(**arguments)
        else:
            bench.axis.stop(3, **arguments)
        bench.run(0.6)
        found = max(row.setpoint for row in bench.telegrams()[bench.edge :])
        assert found == pytest.approx(peak, abs=1000.0 * 2 * CYCLE_S)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-470")
def test_a_job_that_is_through():
    """From MOTION to STANDSTILL by itself: setpoint zero, Done, X6; the drive stays on."""
    with StopBench().enabled() as bench:
        bench.now()
        bench.watch("move", bench.axis.move_relative(50.0))
        bench.run(1.5)
        rows = bench.telegrams()
        done = bench.first(lambda row: row.jobs["move"]["Done"])
        assert (rows[done].setpoint, rows[done].x >> 6 & 1, rows[done].axis_state) == (0.0, 1, "STANDSTILL")
        assert {row.axis_state for row in rows[bench.edge + 1 : done - 1]} == {"MOTION"}
        assert not any(row.x >> 6 & 1 for row in rows[bench.edge + 1 : done - 1])
        assert bench.sequence("stw1") == [0x047F]


# -- superimposed motion
# ------------------------------------------------------------------------------------------------------------


def superimposed(bench):
    """Bring the axis to 100 mm/s with 50 mm/s on top."""
    bench.travelling(100.0)
    bench.watch("top", bench.axis.move_superimposed(500.0, VelocityDiff=50.0))
    bench.run(0.3)
    assert bench.rows[-1].setpoint == pytest.approx(150.0)
    bench.now()
    return bench


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-404", "STP-003")
def test_halt_mode_0_stops_both():
    """Basic and superimposed job are aborted; Done when the sum is zero."""
    with superimposed(StopBench()) as bench:
        bench.watch("halt", bench.axis.halt())
        bench.run(0.5)
        rows = bench.telegrams()
        assert rows[bench.edge + 1].jobs["move"]["CommandAborted"]
        assert rows[bench.edge + 1].jobs["top"]["CommandAborted"]
        done = bench.first(lambda row: row.jobs["halt"]["Done"])
        assert all(row.setpoint == 0.0 for row in rows[done:])
        assert bench.sequence("stw1") == [0x047F]


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-405", "STP-003", "STP-473")
def test_halt_mode_1_stops_the_basic_motion():
    """The axis goes from 150 to 50 mm/s; there MC_Halt is Done and the superimposed motion goes on."""
    with superimposed(StopBench()) as bench:
        bench.watch("halt", bench.axis.halt(Mode=1))
        bench.run(0.6)
        rows = bench.telegrams()
        assert rows[bench.edge + 1].jobs["move"]["CommandAborted"]
        done = bench.first(lambda row: row.jobs["halt"]["Done"])
        assert rows[done].setpoint == pytest.approx(50.0, abs=0.01)
        assert rows[done - 3].setpoint > 50.0
        assert rows[-1].jobs["top"]["Busy"]
        assert rows[-1].nact == pytest.approx(50.0, abs=1.0)
        assert bench.axis.state is AxisState.MOTION


# -- position control, torque limit, what aborts it
# ------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("give", "controlled"),
    [
        pytest.param(give, controlled, marks=pytest.mark.requirement(identifier))
        for give, identifier in (("halt", "STP-407"), ("stop", "STP-426"))
        for controlled in (True, False)
    ],
)
def test_position_control_is_left_as_it_is(give, controlled):
    """X28 does not change from before the stop to its end; without position control Done comes with setpoint
    zero.
    """
    with StopBench().enabled() as bench:
        bench.axis.move_velocity(200.0, PositionControlled=controlled)
        bench.run(0.5)
        bench.now()
        job = bench.watch("job", bench.axis.halt() if give == "halt" else bench.axis.stop(2))
        bench.run(0.6)
        rows = bench.telegrams()
        assert {row.x >> 28 & 1 for row in rows[bench.edge - 1 :]} == {int(not controlled)}
        assert job.Done
        zero = bench.first(lambda row: row.setpoint == 0.0)
        done = bench.first(lambda row: row.jobs["job"]["Done"])
        assert (done == zero) is not controlled


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-407")
def test_position_monitoring_after_a_halt():
    """An axis that never gets to its place after MC_Halt has alarm 541 after the tolerance time."""
    variables = {"PositioningMonitoring.ToleranceTime": 0.2, "PositioningMonitoring.Window": 0.001}
    with StopBench(variables=variables | {"FollowingError.EnableMonitoring": False}).travelling(
        100.0
    ) as bench:
        halt = bench.axis.halt()
        bench.until(lambda: bench.rows[-1].setpoint < 50.0)
        bench.machine.drive().core.inhibit_pulses()  # nobody brakes the axis any more
        bench.until(lambda: bench.rows[-1].setpoint == 0.0)
        stopped = bench.machine.now_s
        bench.until(lambda: bench.axis.var("ErrorDetail.Number") == 541, 1.0)
        assert bench.machine.now_s - stopped == pytest.approx(0.2, abs=2 * CYCLE_S)
        bench.cycles(1)
        assert halt.ErrorID == 0x8001


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-408", "STP-148")
@pytest.mark.parametrize("monitored", [0, 1])
@pytest.mark.parametrize("give", ["halt", "stop"])
def test_done_with_an_active_torque_limit(give, monitored):
    """Done comes with the standstill signal, whether positions are monitored meanwhile or not."""
    variables = {
        "TorqueLimiting.PositionBasedMonitorings": monitored,
        "Actor.DriveParameter.ReferenceTorque": 2.0,
        "FollowingError.EnableMonitoring": False,
        "StandstillSignal.MinDwellTime": 0.1,
    }
    with StopBench(variables=variables).enabled() as bench:
        bench.axis.torque_limiting(0.5)
        bench.axis.move_velocity(150.0)
        bench.run(0.5)
        bench.now()
        bench.watch("job", bench.axis.halt() if give == "halt" else bench.axis.stop(0))
        bench.run(1.5)
        bench.telegrams()
        done = bench.first(lambda row: row.jobs["job"]["Done"])
        signal = bench.first(lambda row: row.x >> 7 & 1)
        assert abs(done - signal) <= 1


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-422", "STP-477")
def test_released_during_the_ramp():
    """Execute FALSE after 40 ms: the ramp is completed, the block ends at standstill, jobs are possible
    again.
    """
    with StopBench().travelling() as bench:
        bench.now()
        stop = bench.watch("stop", bench.axis.stop(2))
        bench.run(0.04)
        stop.set(Execute=False)
        bench.run(0.5)
        rows = bench.telegrams()
        assert bench.ramp("setpoint")[0] == pytest.approx(0.250, abs=2 * CYCLE_S)
        assert rows[bench.edge + 40].jobs["stop"]["Busy"]
        ended = bench.first(lambda row: row.jobs["stop"]["Done"])
        assert rows[ended].setpoint == 0.0
        assert not rows[ended + 1].x2 & 1
        assert bench.axis.state is AxisState.STANDSTILL


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-424", "STP-423", "STP-578")
def test_what_aborts_mc_stop():
    """No motion job does; another MC_Stop of the same or a higher severity does; a lower one is aborted
    itself, without error.
    """
    severity = {3: 1, 2: 2, 0: 3}
    with StopBench().enabled() as bench:
        axis = bench.axis
        for running in (3, 2, 0):
            for other in (3, 2, 0):
                job = axis.move_velocity(200.0)
                bench.until(job.in_velocity)
                first = axis.stop(running)
                bench.cycles(4)
                jobs = [
                    axis.move_velocity(20.0),
                    axis.move_absolute(0.0),
                    axis.move_relative(1.0),
                    axis.halt(),
                    axis.move_superimposed(5.0),
                    axis.jog(20.0),
                ]
                bench.cycles(2)
                assert [one.ErrorID for one in jobs] == [0x800F] * len(jobs)
                assert first.Busy
                jobs[-1].set(JogForward=False)
                second = axis.stop(other)
                bench.cycles(2)
                wins = severity[other] >= severity[running]
                assert (first.CommandAborted, second.CommandAborted) == (wins, not wins)
                assert not second.Error
                bench.until(lambda: axis.state is AxisState.STOP_HOLD)
                first.set(Execute=False)
                second.set(Execute=False)
                bench.cycles(3)
                axis.move_velocity(-200.0)
                bench.run(0.5)
                halt = axis.halt()
                bench.until(halt.done)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-421")
@pytest.mark.parametrize("cause", ["power", "stop", "alarm"])
def test_command_aborted_of_mc_stop(cause):
    """By MC_Power, another MC_Stop and an alarm of higher severity; never with an error."""
    with StopBench().travelling() as bench:
        stop = bench.axis.stop(3)
        bench.cycles(4)
        assert (stop.Busy, bench.axis.var("StatusWord2.X0")) == (True, True)
        if cause == "power":
            bench.axis.power(False)
        elif cause == "stop":
            bench.axis.stop(0)
        else:
            bench.alarm(104)
        bench.cycles(3)
        assert (stop.CommandAborted, stop.Busy, stop.Error, stop.Done) == (True, False, False, False)
