"""Every word of the vocabulary at its edge: what just passes, what just fails, what was not seen, and what a
failure tells.
"""

import inspect
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hil.expect as vocabulary
from fieldbus.errors import ConfigurationError
from fieldbus.history import Event
from hil.expect import (
    Expectation,
    alarm,
    always,
    axis_error,
    command_refused,
    describe,
    disabled,
    event,
    event_order,
    follows,
    happens,
    job_output,
    never,
    never_happens,
    no_alarm,
    no_axis_error,
    no_motion_after,
    ramp,
    settles_within,
    standstill,
    state_at,
    status_word_bit,
    stays_within,
    stop,
    stop_ramp,
    stw1_sequence,
    telegram_bits,
    value_at,
    word_sequence,
)
from hil.record import Trace, TraceGroup, Vocabulary
from reports.model import Verdict

CYCLE_S = 0.004
BEGIN_S = 0.02
"""Of the rows of the axis; those of the drive begin at zero."""
HIT_S = 0.2
SPEED = 300.0
STOP = stop_ramp(SPEED, 2000.0, 20_000.0)


def at(time_s, source, kind, **data):
    return Event(round(time_s * 1e9), source, kind, data)


EVENTS = (
    at(HIT_S, "drive1", "fault.applied", fault="drive.fault"),
    at(0.208, "axis1", "alarm.raised", number=421, reaction=4, text="Drive fault"),
    at(0.208, "axis1", "job.error", job="move", instruction="MC_MoveVelocity", error_id=0x8001),
    at(0.208, "axis1", "axis.state", **{"from": "MOTION", "to": "ALARM_DISABLED"}),
    at(0.6, "axis1", "alarm.raised", number=421, reaction=3, text="Drive fault"),
    at(0.61, "nc1", "axis.error", error_id=0x4550, text="0x4550 (Position lag)"),
    at(0.62, "nc1", "command.refused", error_id=0x4550, text="0x4550 (Position lag)"),
)
HIT = event("fault.applied")


def speed_at(time_s, begin_s=HIT_S):
    """Return velocity, acceleration and travel of the stop with the maximum dynamic values."""
    after = np.clip(time_s - begin_s, 0.0, STOP.time_s)
    build = 2000.0 / 20_000.0
    slope = np.clip(np.minimum(after, STOP.time_s - after) / build, 0.0, 1.0) * 2000.0
    fine = np.linspace(0.0, STOP.time_s, 5001)
    slopes = np.clip(np.minimum(fine, STOP.time_s - fine) / build, 0.0, 1.0) * 2000.0
    speeds = SPEED - np.concatenate(([0.0], np.cumsum((slopes[1:] + slopes[:-1]) / 2 * np.diff(fine))))
    travel = np.concatenate(([0.0], np.cumsum((speeds[1:] + speeds[:-1]) / 2 * np.diff(fine))))
    speed = np.where(
        time_s < begin_s, SPEED, np.where(after >= STOP.time_s, 0.0, np.interp(after, fine, speeds))
    )
    return speed, -slope, SPEED * np.minimum(time_s, begin_s) + np.interp(after, fine, travel)


TRAVEL = float(speed_at(np.array(1.0))[2] - speed_at(np.array(HIT_S))[2])
"""Way of the axis after the fault."""


def rows(name, columns, begin_s=0.0, end_s=1.0, enums=None):
    times = np.arange(round(begin_s / CYCLE_S), round(end_s / CYCLE_S) + 1, dtype=np.int64) * round(
        CYCLE_S * 1e9
    )
    values = np.column_stack(
        [np.broadcast_to(column(times * 1e-9), times.shape) for column in columns.values()]
    )
    units = {"position": "mm", "velocity": "mm/s", "setpoint": "mm/s"}
    named = tuple((column, units.get(column.rpartition("_")[2], "")) for column in columns)
    return TraceGroup(name, named, enums or {}, times, values.astype(float))


AXIS = {
    "actual_velocity": lambda t: speed_at(t)[0],
    "actual_position": lambda t: speed_at(t)[2],
    "velocity_setpoint": lambda t: speed_at(t)[0],
    "acceleration_setpoint": lambda t: speed_at(t)[1],
    "position_setpoint": lambda t: speed_at(t)[2],
    "speed_output": lambda t: 6 * speed_at(t)[0],
    "stw1": lambda t: np.where(t < HIT_S, 0x047F, np.where(t < 0.3, 0x047B, 0x047E)),
    "status_word": lambda t: np.where(t >= 0.4, 1 << 7, 0),
    "power_status": lambda t: t < 0.4,
}
CONSTANTS = {"axis1.max_deceleration": 2000.0, "axis1.max_jerk": 20_000.0, "axis1.cycle_s": CYCLE_S}


def make(vocabulary=None, end_s=1.0, **changed):
    """Return the trace of a stop, with other columns of the axis where given."""
    axis = rows("axis1", {**AXIS, **changed}, BEGIN_S, end_s)
    drive = rows("drive1", {"statusword": lambda t: np.where(t < 0.4, 0x0237, 0x0250)}, end_s=end_s)
    return Trace(
        [axis, drive], events=EVENTS, constants=CONSTANTS, end_ns=round(end_s * 1e9), vocabulary=vocabulary
    )


@pytest.fixture(scope="module")
def trace():
    return make()


def verdict(expectation, trace):
    """Return the worst verdict."""
    found = {check.verdict for check in expectation.evaluate(trace)}
    order = (Verdict.ERROR, Verdict.FAILED, Verdict.BLOCKED, Verdict.PASSED)
    return next(one for one in order if one in found)


def moved(begin_s):
    """Return the columns of a stop whose setpoints begin at another time than the reference."""
    columns = ("velocity_setpoint", "acceleration_setpoint", "position_setpoint")
    return {column: lambda t, n=n: speed_at(t, begin_s)[n] for n, column in enumerate(columns)}


POSITION_AT_HALF = float(speed_at(np.array([0.5]))[2][0])
EDGES = {
    # word: what just passes, what just fails; the trace is that of `make`
    "alarm": (alarm(421, reaction=4, within_s=0.008, since=HIT), alarm(421, within_s=0.007999, since=HIT)),
    "no_alarm": (no_alarm(until=0.207999), no_alarm(until=0.208)),
    "axis_error": (
        axis_error(0x4550, axis="nc1", since=0.6, within_s=0.01),
        axis_error(0x4550, axis="nc1", since=0.6, within_s=0.009),
    ),
    "command_refused": (
        command_refused(0x4550, axis="nc1", since=0.6, within_s=0.02),
        command_refused(0x4550, axis="nc1", since=0.6, within_s=0.019),
    ),
    "no_axis_error": (no_axis_error(until=0.609999), no_axis_error(until=0.61)),
    "happens": (
        happens(event("alarm.raised", nth=2), since=HIT, within_s=0.4),
        happens(event("alarm.raised", nth=3)),
    ),
    "never_happens": (
        never_happens(event("alarm.raised", nth=3)),
        never_happens(event("alarm.raised", nth=2)),
    ),
    "event_order": (
        event_order([event("job.error"), event("axis.state"), event("alarm.raised", nth=2)]),
        event_order([event("axis.state"), event("job.error")]),
    ),
    "state_at": (state_at("axis1", 0.208, "ALARM_DISABLED"), state_at("axis1", 0.208, "MOTION")),
    "job_output": (
        job_output("move", "Error", within_s=0.008, since=HIT),
        job_output("move", "Error", within_s=0.0079, since=HIT),
    ),
    "value_at": (
        value_at("axis1.actual_velocity", 0.5, 0.5, tolerance=0.5),
        value_at("axis1.actual_velocity", 0.5, 0.5, tolerance=0.499999),
    ),
    "stays_within": (
        stays_within("axis1.actual_velocity", low=0.0, high=SPEED),
        stays_within("axis1.actual_velocity", low=0.0, high=299.999999),
    ),
    "always": (
        always("moving", lambda v: v > 0, "axis1.actual_velocity", until=0.448),
        always("moving", lambda v: v > 0, "axis1.actual_velocity", until=0.452),
    ),
    "never": (
        never("at rest", lambda v: v == 0, "axis1.actual_velocity", until=0.448),
        never("at rest", lambda v: v == 0, "axis1.actual_velocity", until=0.452),
    ),
    "status_word_bit": (status_word_bit(7, True, at=0.4), status_word_bit(7, True, at=0.396)),
    "word_sequence": (
        word_sequence("axis1.stw1", [0x047B, 0x047E], since=0.296),
        word_sequence("axis1.stw1", [0x047B, 0x047E], since=0.3),
    ),
    "stw1_sequence": (
        stw1_sequence([0x047F, 0x047B], until=0.299),
        stw1_sequence([0x047F, 0x047B], until=0.3),
    ),
    "ramp": (
        ramp(HIT, STOP, made_by="controller", time_tolerance_s=0.004),
        ramp(HIT, time_s=STOP.time_s - 0.012, made_by="controller", time_tolerance_s=0.008),
    ),
    "stop": (stop(HIT, "maximum"), stop(HIT, "maximum", time_tolerance_s=0.0, distance_tolerance=0.0)),
    "standstill": (standstill(by=0.452, tolerance=0.0), standstill(by=0.448, tolerance=0.0)),
    "no_motion_after": (no_motion_after(0.452, tolerance=1e-9), no_motion_after(0.444, tolerance=1e-9)),
    "disabled": (disabled(by=0.4), disabled(by=0.396)),
    "telegram_bits": (
        telegram_bits("axis1.stw1", ones=0x02, zeros=0x04, at=HIT, for_s=0.1),
        telegram_bits("axis1.stw1", ones=0x02, zeros=0x04, at=HIT, for_s=0.100001),
    ),
    "follows": (
        follows("axis1", "axis1", 1.1, since=HIT, tolerance=TRAVEL / 10 * (1 + 1e-9)),
        follows("axis1", "axis1", 1.1, since=HIT, tolerance=TRAVEL / 10 * (1 - 1e-9)),
    ),
    "settles_within": (
        settles_within("axis1.actual_velocity", 0.0, tolerance=0.0, within_s=0.252, since=HIT),
        settles_within("axis1.actual_velocity", 0.0, tolerance=0.0, within_s=0.251, since=HIT),
    ),
}


def test_every_word_has_its_edge():
    """No word of `hil.expect` is without a case that just passes and one that just fails."""
    words = {
        name
        for name in vocabulary.__all__
        if (inspect.isclass(one := getattr(vocabulary, name)) and issubclass(one, Expectation))
        or (inspect.isfunction(one) and inspect.signature(one).return_annotation in EDGES)
    } - {"Expectation"}
    assert words == set(EDGES)


@pytest.mark.parametrize("word", EDGES)
def test_a_word_at_its_edge(trace, word):
    """At the limit it still passes; the smallest amount beyond it fails."""
    good, bad = EDGES[word]
    assert verdict(good, trace) is Verdict.PASSED, [describe(check) for check in good.evaluate(trace)]
    assert verdict(bad, trace) is Verdict.FAILED, [describe(check) for check in bad.evaluate(trace)]


@pytest.mark.parametrize("word", EDGES)
def test_what_a_failure_tells(trace, word):
    """Expected, observed and a time in the recording; by how much where there is a limit; a signal that was
    judged can be plotted.
    """
    expectation = EDGES[word][1]
    check = next(one for one in expectation.evaluate(trace) if one.verdict is Verdict.FAILED)
    assert check.name
    assert check.expected.strip()
    assert check.observed.strip()
    assert check.time_s is not None
    assert 0.0 <= check.time_s <= trace.end_s
    if check.low is not None or check.high is not None:
        assert check.value is not None
        assert "the limit" in describe(check)
    if check.signal:
        assert check.signal in expectation.signals_on(trace)
    for name in expectation.signals_on(trace):
        assert name in trace or name == "drive1.state"
    of_events = {"alarm", "no_alarm", "happens", "never_happens", "event_order", "state_at", "job_output"}
    of_events |= {"axis_error", "command_refused", "no_axis_error"}
    assert bool(expectation.signals_on(trace)) is (word not in of_events)


THROUGHOUT = {
    "no_alarm": no_alarm(since=0.7, until=1.5),
    "no_axis_error": no_axis_error(since=0.7, until=1.5),
    "never_happens": never_happens(event("alarm.raised"), since=0.7, until=1.5),
    "stays_within": stays_within("axis1.actual_velocity", low=0.0, until=1.5),
    "always": always("not negative", lambda v: v >= 0, "axis1.actual_velocity", until=1.5),
    "never": never("negative", lambda v: v < 0, "axis1.actual_velocity", until=1.5),
    "word_sequence": word_sequence("axis1.stw1", [0x047E], since=0.7, until=1.5),
    "standstill": standstill(by=0.7, until=1.5),
    "no_motion_after": no_motion_after(0.7, until=1.5),
    "disabled": disabled(by=0.7, until=1.5),
    "settles_within": settles_within(
        "axis1.actual_velocity", 0.0, tolerance=1.0, within_s=0.1, since=0.7, until=1.5
    ),
    "telegram_bits": telegram_bits("axis1.stw1", ones=2, at=0.7, for_s=0.8),
    "ramp": ramp(HIT, until=1.5),
}


@pytest.mark.parametrize("word", THROUGHOUT)
def test_what_was_not_recorded_to_its_end_does_not_pass(trace, word):
    """An observation that goes on behind the end of the recording fails on the bench and is blocked in a
    log.
    """
    checks = THROUGHOUT[word].evaluate(trace)
    assert all(check.verdict is Verdict.FAILED for check in checks), checks
    assert all("recording" in check.observed for check in checks)
    log = Vocabulary(
        ("axis1", "drive1"), kinds=("drive.state", "alarm.", "axis.error", "fault."), origin="a log"
    )
    assert verdict(THROUGHOUT[word], make(log)) is Verdict.BLOCKED


EMPTY = [
    never("negative", lambda v: v < 0, "axis1.actual_velocity", condition=lambda v: v > 999),
    always("positive", lambda v: v > 0, "axis1.actual_velocity", condition=lambda v: v > 999),
    never("negative", lambda v: v < 0, "axis1.actual_velocity", since=0.5, until=0.4),
    never("negative", lambda v: v < 0, "axis1.actual_velocity", since=0.5001, until=0.5002),
    no_alarm(since=0.5, until=0.4),
    no_axis_error(since=0.5, until=0.4),
    never_happens(event("alarm.raised"), since=0.5, until=0.4),
    standstill(by=0.9, until=0.8),
    no_motion_after(0.9, until=0.8),
    disabled(by=0.9, until=0.8),
    stays_within("axis1.actual_velocity", low=0.0, since=0.5001, until=0.5002),
]


@pytest.mark.parametrize("expectation", EMPTY, ids=lambda one: one.title)
def test_an_empty_window_proves_nothing(trace, expectation):
    """Where there is no sample and no time to look at nothing has been shown to hold."""
    assert verdict(expectation, trace) is Verdict.FAILED


@pytest.mark.parametrize(
    "expectation",
    [
        value_at("axis1.actual_velocity", 0.016, SPEED, tolerance=1e9),
        status_word_bit(7, False, at=0.016),
        telegram_bits("axis1.stw1", ones=2, at=0.016),
        no_motion_after(0.0, tolerance=1e9),
        value_at("axis1.actual_velocity", -1.0, SPEED, tolerance=1e9),
        never_happens(event("axis.homed"), since=-1.0),
        never_happens(event("axis.homed"), since=math.nan),
    ],
    ids=lambda one: one.title,
)
def test_before_the_first_sample_nothing_is_known(trace, expectation):
    """The value before the first sample is not that of the first sample, and there is no time before the
    recording.
    """
    assert verdict(expectation, trace) is Verdict.FAILED


def gap(time_s, begin_s=0.6, end_s=0.62):
    return np.where((time_s > begin_s) & (time_s < end_s), np.nan, 0.0)


NANS = [
    always("at rest", lambda v: v < 1, "axis1.actual_velocity", since=0.5),
    never("moving", lambda v: v > 1, "axis1.actual_velocity", since=0.5),
    stays_within("axis1.actual_velocity", high=1.0, since=0.5),
    standstill(by=0.5),
    no_motion_after(0.5, position="axis1.actual_velocity"),
    settles_within("axis1.actual_velocity", 0.0, tolerance=1.0, within_s=0.05, since=0.5),
    value_at("axis1.actual_velocity", 0.608, 0.0, tolerance=1.0),
    ramp(0.5, velocity="axis1.actual_velocity", until=0.61),
    disabled(by=0.5, drive=""),
]


@pytest.mark.parametrize("expectation", NANS, ids=lambda one: one.title)
def test_what_is_no_number_fulfils_nothing(expectation):
    """A gap of values that are no numbers is neither rest nor within limits, whichever way it is asked."""
    assert verdict(expectation, make(actual_velocity=gap, power_status=gap)) is Verdict.FAILED


def test_a_drive_whose_word_is_unknown_is_not_disabled():
    """No number in the status word is not *no torque*."""
    drive = rows("drive1", {"statusword": lambda t: np.where(t < 0.5, 0x0250, np.nan)})
    trace = Trace([drive], end_ns=10**9)
    assert verdict(disabled(by=0.1, axis="", until=0.49), trace) is Verdict.PASSED
    assert verdict(disabled(by=0.1, axis=""), trace) is Verdict.FAILED


def test_a_stop_with_torque_is_not_disabled():
    """ZSW1 alone: the bits of S3 behind those of operation are a stop that still has torque (S5), before it
    they are not.
    """
    words = {0.0: 0x31, 0.1: 0x33, 0.2: 0x37, 0.4: 0x33, 0.6: 0x31}
    drive = rows(
        "drive1",
        {"drive_zsw1": lambda t: np.array([words[max(w for w in words if w <= x + 1e-9)] for x in t])},
    )
    trace = Trace([drive], end_ns=10**9)
    assert verdict(disabled(by=0.1, axis="", until=0.196), trace) is Verdict.PASSED
    assert verdict(disabled(by=0.4, axis=""), trace) is Verdict.FAILED
    assert verdict(disabled(by=0.6, axis=""), trace) is Verdict.PASSED


@pytest.mark.requirement("STP-241")
def test_a_setpoint_that_jumps_is_no_ramp():
    """A setpoint that is gone in the very cycle of the reference took no time and no way: that is not the
    ramp of any mode.
    """
    gone = {
        column: lambda t, n=n: np.where(t < HIT_S, speed_at(t)[n], (0.0, 0.0, SPEED * HIT_S)[n])
        for n, column in enumerate(moved(0))
    }
    failed = {
        check.name.rpartition(": ")[2]
        for check in stop(HIT, "maximum").evaluate(make(**gone))
        if check.verdict is Verdict.FAILED
    }
    assert failed == {"ramp time", "travel"}
    (rest,) = stop(0.7, "maximum").evaluate(make())
    assert rest.verdict is Verdict.FAILED
    assert "nothing to stop" in rest.observed


@pytest.mark.parametrize("late", range(6))
def test_a_stop_has_two_cycles(late):
    """The ramp ends up to two cycles after its time, the cycle of the sample that shows it among them."""
    trace = make(**moved(HIT_S + late * CYCLE_S))
    found = {check.name.rpartition(": ")[2]: check.verdict for check in stop(HIT, "maximum").evaluate(trace)}
    assert (found["ramp time"] is Verdict.PASSED) is (late <= 1)
    assert (found["travel"] is Verdict.PASSED) is (late <= 2)


@pytest.mark.exhaustive
@settings(max_examples=40, deadline=None)
@given(
    cycles=st.integers(0, 100),
    offset_ns=st.sampled_from([-1000, -2, 0, 2, 1000]),
    word=st.sampled_from(["alarm", "bits", "settles", "telegram"]),
)
def test_a_bound_counts_from_the_reference(cycles, offset_ns, word):
    """What comes n cycles after the reference is within every bound that is not shorter, whatever the cycle
    and the word.
    """
    hit_s = HIT_S
    came_s = hit_s + cycles * CYCLE_S
    within_s = cycles * CYCLE_S + offset_ns * 1e-9
    if within_s < 0:
        return
    step = rows("axis1", {"zsw1": lambda t: np.where(t >= came_s - 1e-9, 4.0, 0.0)})
    trace = Trace(
        [step],
        events=[at(hit_s, "x", "fault.applied"), at(came_s, "axis1", "alarm.raised", number=1, reaction=1)],
        end_ns=10**9,
    )
    expectation = {
        "alarm": alarm(1, since=HIT, within_s=within_s),
        "bits": status_word_bit(2, True, at=HIT, within_s=within_s, word="zsw1"),
        "telegram": telegram_bits("axis1.zsw1", ones=4, at=HIT, within_s=within_s),
        "settles": settles_within("axis1.zsw1", 4.0, tolerance=0.0, within_s=within_s, since=HIT),
    }[word]
    assert (verdict(expectation, trace) is Verdict.PASSED) is (offset_ns >= 0)


def test_an_alarm_that_comes_twice():
    """The first one behind the reference is judged: a second one does not excuse its reaction or its
    delay.
    """
    trace = make()
    assert verdict(alarm(421, reaction=3, since=HIT), trace) is Verdict.FAILED
    assert verdict(alarm(421, reaction=3, since=0.3), trace) is Verdict.PASSED
    assert verdict(alarm(421, since=0.3, within_s=0.2), trace) is Verdict.FAILED


def test_the_nth_of_an_order_is_the_nth():
    """In an order an event with nth is that one of those since the reference, and no other."""
    trace = make()
    twice, first = event("alarm.raised", nth=2), event("job.error")
    assert verdict(event_order([twice, first]), trace) is Verdict.FAILED
    assert verdict(event_order([first, event("alarm.raised", nth=-1)]), trace) is Verdict.PASSED
    assert verdict(event_order([twice], since=0.3), trace) is Verdict.FAILED


def test_mistakes_in_expectations_are_refused():
    """An instant where an event is meant, limits the wrong way round, no number as a limit."""
    for wrong in (
        lambda: happens(HIT.plus(0.1)),
        lambda: never_happens(HIT.plus(0.1)),
        lambda: event_order([HIT.plus(0.1)]),
        lambda: stays_within("axis1.actual_velocity", low=1.0, high=0.0),
        lambda: stays_within("axis1.actual_velocity", low=math.nan),
    ):
        with pytest.raises(ConfigurationError):
            wrong()


def test_a_log_that_ends_before_a_bound_cannot_tell():
    """What may still have come behind the end of a log is blocked, on the bench it has failed."""
    log = Vocabulary(("axis1", "drive1"), kinds=("alarm.", "fault.", "drive.state"), origin="a log")
    for expectation in (
        alarm(431, since=0.7, within_s=0.4),
        happens(event("alarm.raised", number=431), since=0.7, within_s=0.4),
        status_word_bit(9, True, at=0.7, within_s=0.4),
        telegram_bits("axis1.stw1", ones=0x8000, at=0.7, within_s=0.4),
    ):
        assert verdict(expectation, make()) is Verdict.FAILED
        assert verdict(expectation, make(log)) is Verdict.BLOCKED
        assert verdict(expectation, make(log, end_s=1.2)) is Verdict.FAILED


def test_an_expectation_of_ones_own_needs_no_more_than_before():
    """A word of one's own has to say how it judges, and nothing else."""

    class Mine(Expectation):
        title = "mine"
        wanted = "anything"

        def judge(self, trace):
            return [self.outcome(passed=True, observed="so")]

    assert verdict(Mine(), make()) is Verdict.PASSED
