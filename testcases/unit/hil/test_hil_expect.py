"""Expectations on traces made by hand: each one passes and fails when it should, and says why."""

import numpy as np
import pytest

from fieldbus.errors import ConfigurationError
from fieldbus.history import Event
from hil.expect import (
    alarm,
    always,
    describe,
    drive_ramp,
    evaluate,
    event,
    event_order,
    happens,
    job_output,
    measure_stop,
    never,
    never_happens,
    no_alarm,
    no_motion_after,
    ramp,
    standstill,
    state_at,
    status_word_bit,
    stays_within,
    stop_ramp,
    stw1_sequence,
    value_at,
    word_sequence,
)
from hil.record import Trace, TraceGroup
from reports.model import Verdict

CYCLE = 0.004


def happened(time_s, source, kind, **data):
    return Event(round(time_s * 1e9), source, kind, data)


EVENTS = [
    happened(0.1, "drive1", "fault.applied", fault="drive.fault"),
    happened(0.104, "drive1", "drive.state", **{"from": "OPERATION_ENABLED", "to": "FAULT"}),
    happened(0.108, "axis1", "alarm.raised", number=421, reaction=4, text="Drive fault"),
    happened(0.108, "axis1", "job.error", job="move1", instruction="MC_MoveVelocity", error_id=0x8001),
    happened(0.108, "axis1", "axis.state", **{"from": "MOTION", "to": "ALARM_DRIVE_STOP"}),
    happened(0.3, "axis1", "axis.state", **{"from": "ALARM_DRIVE_STOP", "to": "ALARM_DISABLED"}),
    happened(0.4, "axis1", "alarm.raised", number=431, reaction=4, text="Drive failed"),
]
FAULT = event("fault.applied")


def make(columns=None, events=EVENTS, end_s=1.0, step_s=CYCLE):
    """Return a trace with columns of axis1 given as functions of time."""
    times = np.arange(0, round(end_s / step_s) + 1) * round(step_s * 1e9)
    columns = columns or {"state": (lambda t: 1.0, "")}
    values = np.array([[function(t * 1e-9) for function, _ in columns.values()] for t in times], dtype=float)
    group = TraceGroup(
        "axis1",
        tuple((name, unit) for name, (_, unit) in columns.items()),
        {},
        times.astype(np.int64),
        values,
    )
    return Trace([group], events=events, end_ns=round(end_s * 1e9))


def one(expectation, trace):
    checks = expectation.evaluate(trace)
    assert len(checks) == 1
    return checks[0]


def passed(expectation, trace):
    return one(expectation, trace).verdict is Verdict.PASSED


# -- events
# -----------------------------------------------------------------------------------------------------------


def test_an_alarm_is_judged_by_number_reaction_and_time():
    """Number, reaction and bound must all hold; the delay is measured from the reference."""
    trace = make()
    good = one(alarm(421, reaction=4, within_s=0.01, since=FAULT), trace)
    assert good.verdict is Verdict.PASSED
    assert (good.value, good.unit, good.high) == (pytest.approx(0.008), "s", 0.01)
    assert good.time_s == pytest.approx(0.108)
    assert passed(alarm(421, within_s=0.008, since=FAULT), trace), "the bound itself is still within"
    assert not passed(alarm(421, within_s=0.0079, since=FAULT), trace)
    assert not passed(alarm(421, reaction=3, since=FAULT), trace)
    assert not passed(alarm(421, axis="axis2"), trace)
    assert not passed(alarm(421, since=0.2), trace), "an alarm before the reference does not count"


def test_a_missing_alarm_says_what_came_instead():
    """The outcome of a failed expectation names what was there."""
    check = one(alarm(521, since=FAULT), make())
    assert "number 421" in check.observed
    assert "number 431" in check.observed
    assert check.expected == "alarm 521 after fault.applied"
    assert one(alarm(521, since=0.5), make()).observed == "no alarm"


def test_no_alarm_looks_at_its_interval_only():
    """Alarms outside of the interval, and those excepted, do not count."""
    trace = make()
    assert passed(no_alarm(until=0.1), trace)
    assert passed(no_alarm(since=0.2, until=0.3), trace)
    assert not passed(no_alarm(), trace)
    assert passed(no_alarm(besides=(421, 431)), trace)
    assert one(no_alarm(since=0.2), trace).time_s == pytest.approx(0.4)


def test_a_reference_that_did_not_happen_fails():
    """An expectation that counts from an event which never came is failed, and says so."""
    check = one(alarm(421, since=event("fault.removed")), make())
    assert check.verdict is Verdict.FAILED
    assert "reference event 'fault.removed' did not happen" in check.observed


def test_job_outputs():
    """The output of a job is found by name, with bound and ErrorID; what came instead is reported."""
    trace = make()
    assert passed(job_output("move1", "Error", within_s=0.01, since=FAULT, error_id=0x8001), trace)
    assert not passed(job_output("move1", "Error", error_id=0x800F), trace)
    assert not passed(job_output("move2", "Error"), trace)
    check = one(job_output("move1", "CommandAborted"), trace)
    assert check.verdict is Verdict.FAILED
    assert "instead: job.error 16#8001 at 0.108000 s" in check.observed
    with pytest.raises(ConfigurationError, match="Done, CommandAborted, Error"):
        job_output("move1", "Finished")


def test_events_happen_or_never_do():
    """`happens` counts matches after the reference; `never_happens` fails at the first one."""
    trace = make()
    assert passed(happens(event("alarm.raised", nth=2), since=FAULT, within_s=0.3), trace)
    assert not passed(happens(event("alarm.raised", nth=2), since=FAULT, within_s=0.299), trace)
    assert not passed(happens(event("alarm.raised", nth=2), until=0.35), trace)
    assert passed(never_happens(event("alarm.raised"), until=0.1), trace)
    assert one(never_happens(event("alarm.raised")), trace).time_s == pytest.approx(0.108)


def test_the_order_of_events_is_that_of_the_log():
    """Events of one instant are in order too; a missing and an early one are distinguished."""
    trace = make()
    fault, error, stopped = (
        event("drive.state", to="FAULT"),
        event("job.error"),
        event("axis.state", to="ALARM_DISABLED"),
    )
    assert passed(event_order([fault, event("alarm.raised"), error, stopped], since=FAULT), trace)
    early = one(event_order([error, event("alarm.raised", nth=1), fault]), trace)
    assert early.verdict is Verdict.FAILED
    assert "came too early, at 0.104000 s" in early.observed
    missing = one(event_order([fault, event("alarm.cleared")]), trace)
    assert "did not happen after drive.state at 0.104000 s" in missing.observed
    with pytest.raises(ConfigurationError):
        event_order([])


def test_states_at_an_instant():
    """The last state event not later than the instant counts, of each state machine of a component."""
    trace = make()
    assert passed(state_at("axis1", 0.108, "ALARM_DRIVE_STOP"), trace)
    assert passed(state_at("axis1", 0.5, "ALARM_DISABLED"), trace)
    check = one(state_at("axis1", 0.2, "MOTION"), trace)
    assert check.observed == "ALARM_DRIVE_STOP since 0.108000 s"


# -- signals
# ----------------------------------------------------------------------------------------------------------


def test_always_and_never_name_the_first_sample():
    """A predicate is judged at every sample; the first that breaks it is named with its values."""
    trace = make({"v": (lambda t: 10 * t, "mm/s"), "on": (lambda t: float(t < 0.5), "")})
    assert passed(always("v below 11", lambda v: v < 11, "axis1.v"), trace)
    check = one(always("v below 6", lambda v: v < 6, "axis1.v"), trace)
    assert check.time_s == pytest.approx(0.6)
    assert "axis1.v = 6" in check.observed
    assert passed(
        always("v below 6", lambda v, on: v < 6, "axis1.v", "axis1.on", condition=lambda v, on: on > 0), trace
    )
    assert passed(always("v below 6", lambda v: v < 6, "axis1.v", until=0.59), trace)
    assert passed(never("v above 11", lambda v: v > 11, "axis1.v"), trace)
    assert one(never("v above 6", lambda v: v > 6.001, "axis1.v"), trace).time_s == pytest.approx(0.604)


def test_always_without_samples_is_no_success():
    """A rule that could be judged nowhere has not been shown to hold."""
    trace = make({"v": (lambda t: t, "")})
    assert not passed(always("anything", lambda v: v < 9, "axis1.v", since=5.0), trace)
    assert not passed(always("anything", lambda v: v < 9, "axis1.v", condition=lambda v: v > 99), trace)


def test_values_and_ranges_have_limits():
    """A value at an instant and a range over an interval give measurements with unit and limits."""
    trace = make({"v": (lambda t: 10 * t, "mm/s")})
    check = one(value_at("axis1.v", 0.5, 5.0, tolerance=0.1), trace)
    assert (check.verdict, check.value, check.low, check.high) == (
        Verdict.PASSED,
        pytest.approx(5.0),
        4.9,
        5.1,
    )
    assert not passed(value_at("axis1.v", 0.5, 5.2, tolerance=0.1), trace)
    assert passed(stays_within("axis1.v", low=0.0, high=10.0), trace)
    over = one(stays_within("axis1.v", high=8.0), trace)
    assert (over.verdict, over.value) == (Verdict.FAILED, pytest.approx(10.0))
    assert passed(stays_within("axis1.v", high=8.0, until=0.8), trace)


def test_values_that_are_no_numbers_fail():
    """Not-a-number lies within no limit."""
    trace = make({"v": (lambda t: float("nan"), "mm/s"), "p": (lambda t: float("nan"), "mm")})
    assert not passed(stays_within("axis1.v", low=-1e9, high=1e9), trace)
    assert not passed(value_at("axis1.v", 0.5, 0.0, tolerance=1e9), trace)
    assert not passed(standstill(by=0.5, velocity="axis1.v"), trace)
    assert not passed(no_motion_after(0.5, position="axis1.p"), trace)


def words(time_s):
    return 0x047F if time_s < 0.2 else 0x447B if time_s < 0.5 else 0x0478 if time_s < 0.504 else 0x047E


def test_control_word_sequences():
    """A sequence is exact, values of one cycle included, after masking the bits that are not the axis'
    own.
    """
    trace = make({"stw1": (words, "")})
    assert passed(stw1_sequence([0x047F, 0x047B, 0x0478, 0x047E]), trace)
    assert passed(stw1_sequence([0x047B, 0x0478, 0x047E], since=0.3), trace)
    missing = one(stw1_sequence([0x047F, 0x047B, 0x047E]), trace)
    assert missing.verdict is Verdict.FAILED
    assert missing.time_s == pytest.approx(0.5)
    assert "16#0478" in missing.observed
    assert passed(stw1_sequence([0x047F, 0x047E], exact=False), trace)
    assert not passed(stw1_sequence([0x047E, 0x047F], exact=False), trace)
    assert not passed(word_sequence("axis1.stw1", [0x047F, 0x047B, 0x0478, 0x047E]), trace), "bit 14 unmasked"


def test_bits_of_words():
    """A bit is judged at an instant, or must come within a time."""
    trace = make({"status_word": (lambda t: float((1 << 31) | (1 << 7 if t >= 0.5 else 0)), "")})
    assert passed(status_word_bit(7, True, at=0.5), trace)
    assert not passed(status_word_bit(7, True, at=0.4), trace)
    check = one(status_word_bit(7, True, at=0.4, within_s=0.1), trace)
    assert (check.verdict, check.value) == (Verdict.PASSED, pytest.approx(0.1))
    assert not passed(status_word_bit(7, True, at=0.4, within_s=0.09), trace)
    assert passed(status_word_bit(31, True, at=0.1), trace)
    with pytest.raises(ConfigurationError):
        status_word_bit(32, True, at=0.0)


def test_a_signal_that_is_missing_is_an_error_of_the_test():
    """A misspelt signal is an error of the harness, not a failure of the machine."""
    check = one(value_at("axis1.nonsense", 0.5, 0.0, tolerance=1.0), make())
    assert check.verdict is Verdict.ERROR
    assert "nonsense" in check.observed


def test_expectations_carry_requirements_and_names():
    """`covers` and `named` go into the check; `evaluate` keeps the order."""
    trace = make()
    checks = evaluate(trace, [alarm(421).covers("STP-559").named("trip"), no_alarm()])
    assert (checks[0].name, checks[0].requirements) == ("trip", ["STP-559"])
    assert [check.verdict for check in checks] == [Verdict.PASSED, Verdict.FAILED]
    assert describe(checks[0]) == "Trip: alarm 421 came at t = 0.108 s (at 0.108000 s)"


# -- stops
# ------------------------------------------------------------------------------------------------------------


def braking(velocity, deceleration, begin, jerk=None):
    """Return velocity and position over time of a stop that begins at `begin`."""
    whole = stop_ramp(velocity, deceleration, jerk)
    fine = np.linspace(0.0, whole.time_s, 20001)
    if jerk is None:
        speeds = velocity - deceleration * fine
    else:
        build = min(deceleration / jerk, whole.time_s / 2)
        slope = np.clip(np.minimum(fine, whole.time_s - fine) / build, 0, 1) * whole.peak_deceleration
        speeds = velocity - np.concatenate(([0.0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(fine))))
    places = np.concatenate(([0.0], np.cumsum((speeds[1:] + speeds[:-1]) / 2 * np.diff(fine))))

    def speed(t):
        return float(np.interp(t - begin, fine, speeds, left=velocity, right=0.0))

    def place(t):
        return velocity * min(t, begin) + float(np.interp(t - begin, fine, places))

    return speed, place


def stop_trace(velocity=300.0, deceleration=4000.0, begin=0.2, jerk=None, setpoint=None):
    speed, place = braking(velocity, deceleration, begin, jerk)
    return make(
        {
            "actual_velocity": (speed, "mm/s"),
            "actual_position": (place, "mm"),
            "velocity_setpoint": (setpoint or speed, "mm/s"),
            "position_setpoint": (place, "mm"),
            "speed_output": (setpoint or (lambda t: 6 * speed(t)), "rpm"),
        }
    )


@pytest.mark.requirement("STP-553")
@pytest.mark.parametrize("jerk", [None, 20_000.0])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_stop_is_measured(jerk, direction):
    """Begin, end, ramp time, travel, peak values and slope of a stop come out of the recording, in both
    directions.
    """
    speed, place = braking(300.0, 2000.0, 0.2, jerk)
    trace = make({"v": (lambda t: direction * speed(t), "mm/s"), "p": (lambda t: direction * place(t), "mm")})
    expected = stop_ramp(300.0, 2000.0, jerk)
    stop = measure_stop(trace, 0.2, velocity="axis1.v", position="axis1.p", threshold=1e-3)

    assert stop.duration_s == pytest.approx(expected.time_s, abs=CYCLE)
    assert stop.distance == pytest.approx(expected.distance, rel=0.005)
    assert stop.start_velocity == direction * 300.0
    assert stop.peak_deceleration == pytest.approx(2000.0, rel=0.02)
    if jerk is None:
        assert stop.mean_deceleration == pytest.approx(2000.0, rel=1e-3)
    else:
        assert stop.peak_jerk == pytest.approx(jerk, rel=0.1)
    without_position = measure_stop(trace, 0.2, velocity="axis1.v", threshold=1e-3)
    assert without_position.distance == pytest.approx(expected.distance, rel=0.005)


@pytest.mark.requirement("STP-553")
def test_who_made_the_ramp():
    """A setpoint that ramps is the controller's stop; one that is gone while the axis still brakes is the
    drive's.
    """
    by_controller = measure_stop(
        stop_trace(), 0.2, velocity="axis1.actual_velocity", setpoint="axis1.speed_output"
    )
    gone = stop_trace(setpoint=lambda t: 1800.0 if t < 0.2 else 0.0)
    by_drive = measure_stop(gone, 0.2, velocity="axis1.actual_velocity", setpoint="axis1.speed_output")
    assert (by_controller.made_by, by_drive.made_by) == ("controller", "drive")


@pytest.mark.requirement("STP-553")
def test_ramps_are_judged_by_time_travel_slope_and_maker():
    """A stop that keeps the numbers passes in all of them; each wrong number fails on its own."""
    trace = stop_trace()
    good = ramp(0.2, stop_ramp(300.0, 4000.0), made_by="controller").evaluate(trace)
    assert [check.name.partition(": ")[2] for check in good] == ["ramp time", "travel", "ramp made by"]
    assert all(check.verdict is Verdict.PASSED for check in good)
    assert good[0].unit == "s"
    assert (good[1].low, good[1].high) == (pytest.approx(8.85), pytest.approx(13.65))

    slower = ramp(0.2, stop_ramp(300.0, 3000.0), made_by="drive").evaluate(trace)
    assert {check.name.partition(": ")[2] for check in slower if check.verdict is Verdict.FAILED} == {
        "ramp time",
        "travel",
        "ramp made by",
    }
    assert not passed(ramp(0.2, slope=3000.0), trace)
    assert passed(ramp(0.2, slope=4000.0), trace)


@pytest.mark.requirement("STP-553")
def test_a_ramp_of_the_drive_is_measured_without_the_delay_of_the_bus():
    """The ramp of a drive begins later than the command; its time does not count the delay, which has a limit
    of its own.
    """
    trace = stop_trace(deceleration=1000.0, begin=0.212, setpoint=lambda t: 1800.0 if t < 0.2 else 0.0)
    checks = {
        c.name.partition(": ")[2]: c
        for c in ramp(0.2, drive_ramp(300.0, 500.0, 0.5), made_by="drive").evaluate(trace)
    }
    assert all(check.verdict is Verdict.PASSED for check in checks.values())
    assert checks["ramp time"].value == pytest.approx(0.3, abs=0.001)
    assert checks["delay"].value == pytest.approx(0.012, abs=0.001)
    late = ramp(0.2, drive_ramp(300.0, 500.0, 0.5), made_by="drive", delay_s=0.01).evaluate(trace)
    assert [c.name.partition(": ")[2] for c in late if c.verdict is Verdict.FAILED] == ["delay"]


def test_an_axis_that_does_not_stop_fails():
    """An axis that still moves at the end of the observation has not stopped."""
    trace = make({"actual_velocity": (lambda t: 50.0, "mm/s"), "actual_position": (lambda t: 50 * t, "mm")})
    check = one(ramp(0.2, stop_ramp(300.0, 4000.0)), trace)
    assert check.verdict is Verdict.FAILED
    assert "still 50 mm/s" in check.observed


def test_standstill_and_no_motion():
    """Rest is judged from the instant to the end, displacement from where the axis was at the instant."""
    trace = stop_trace()
    assert passed(standstill(by=0.276), trace)
    moving = one(standstill(by=0.25), trace)
    assert (moving.verdict, moving.time_s) == (Verdict.FAILED, pytest.approx(0.252, abs=CYCLE))
    assert passed(no_motion_after(0.28), trace)
    assert one(no_motion_after(0.2), trace).value == pytest.approx(11.25, abs=0.3)
    assert not passed(standstill(by=2.0), trace), "nothing was recorded then"


def test_a_motion_that_comes_back_is_motion():
    """An axis that stops and starts again has neither stopped nor stood still."""
    trace = make(
        {
            "v": (lambda t: 5.0 if 0.5 < t < 0.51 else 0.0, "mm/s"),
            "p": (lambda t: 0.3 if 0.5 < t < 0.6 else 0.0, "mm"),
        }
    )
    assert not passed(standstill(by=0.1, velocity="axis1.v"), trace)
    assert not passed(no_motion_after(0.1, position="axis1.p"), trace)
    assert passed(standstill(by=0.6, velocity="axis1.v"), trace)
    assert passed(standstill(by=0.1, until=0.4, velocity="axis1.v"), trace)
    assert passed(no_motion_after(0.1, until=0.4, position="axis1.p"), trace)
