"""Names that cannot be in a recording are refused: an expectation or trigger with a misspelt name never
passes silently.
"""

import pytest

from fieldbus.errors import ConfigurationError
from fieldbus.history import Event
from hil.bench import load_bench
from hil.errors import NotRecordedError
from hil.expect import (
    alarm,
    event,
    event_order,
    happens,
    never_happens,
    no_alarm,
    state_at,
    value_at,
)
from hil.faults import Injector, on_event, state
from hil.record import EVENT_DETAILS, EVENT_KINDS, Trace, TraceGroup, Vocabulary
from reports.model import Verdict


@pytest.fixture(scope="module")
def trace():
    """A short move of the reference bench with its vocabulary."""
    with load_bench("reference").build() as bench:
        axis = bench.axis()
        power = axis.power()
        bench.run_until(power.status, 2.0)
        axis.move_velocity(50.0)
        axis.halt()
        bench.run_for(0.1)
        return bench.trace()


SLIPS = [
    (never_happens(event("typo")), "'typo'", "kinds of parts of your own"),
    (never_happens(event("axis.stat")), "axis.stat", "axis.state"),
    (happens(event("axis.state"), since=event("fault.aplied")), "fault.aplied", "fault.applied"),
    (never_happens(event("axis.state", "axs1")), "'axs1'", "axis1"),
    (never_happens(event("axis.state", to="MOTOIN")), "'MOTOIN'", "MOTION"),
    (never_happens(event("axis.state", number=2)), "'number'", "the n-th event is nth=n"),
    (never_happens(event("alarm.raised", number=1)), "no number 1", "..."),
    (never_happens(event("alarm.raised", nmber=421)), "'nmber'", "number, reaction"),
    (never_happens(event("job.error", job="MC_Hlat#1")), "'MC_Hlat#1'", "axis1.MC_Halt"),
    (never_happens(event("job.error", instruction="MC_Hlat")), "'MC_Hlat'", "MC_Halt"),
    (never_happens(event("fault.applied", fault="drive.falt")), "'drive.falt'", "drive.fault"),
    (never_happens(event("drive.state", "drive1", to="Operational")), "'Operational'", "Operation enabled"),
    (never_happens(event("drive.state", to="MOTION")), "'MOTION'", "Operation enabled"),
    (never_happens(event("controller.state", to="HALT")), "'HALT'", "RUN"),
    (event_order([event("job.started"), event("jb.done")]), "jb.done", "job.done"),
    (no_alarm(axis="axis9"), "'axis9'", "axis1"),
    (no_alarm(besides=(1,)), "no number 1", "..."),
    (alarm(1), "no number 1", "..."),
    (state_at("axis1", 0.1, "STANDSTIL"), "'STANDSTIL'", "STANDSTILL"),
    (state_at("axs1", 0.1, "STANDSTILL"), "'axs1'", "axis1"),
    (state_at("drive1", 0.1, "OPERATIONAL", kind="drive.ntm"), "drive.ntm", "drive.nmt"),
    (value_at("axis1.actual_velocty", 0.1, 0.0, tolerance=1.0), "actual_velocty", "actual_velocity"),
]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("expectation", "slip", "proposal"), SLIPS, ids=lambda value: str(value)[:40])
def test_an_expectation_on_what_does_not_exist_is_an_error(trace, expectation, slip, proposal):
    """The check is an error of the harness, and its text names the slip and what there is."""
    (check,) = expectation.evaluate(trace)
    assert check.verdict is Verdict.ERROR
    assert slip in check.observed
    assert proposal in check.observed


def test_what_exists_and_did_not_come_is_no_slip(trace):
    """Kinds, states, jobs, alarms and faults that the bench has but this run did not see are answered."""
    for expectation in (
        never_happens(event("job.error", job="axis1.MC_Halt_1", instruction="MC_Halt")),
        never_happens(event("alarm.raised", "axis1", number=421)),
        never_happens(event("axis.state", to="ALARM_RAMP")),
        never_happens(event("fault.applied", "drive1", fault="drive.fault")),
        never_happens(event("controller.state", to="STOP")),
        never_happens(event("alarm.")),
        no_alarm(besides=(522,)),
    ):
        check = expectation.evaluate(trace)[0]
        assert check.verdict is Verdict.PASSED, check.observed


def test_the_words_are_kept_with_the_trace(trace, tmp_path):
    """A trace that was saved and loaded refuses the same slips."""
    trace.save(tmp_path / "trace")
    again = Trace.load(tmp_path / "trace")
    assert again.vocabulary == trace.vocabulary
    assert again.digest() == trace.digest()
    assert never_happens(event("axis.state", "axs1")).evaluate(again)[0].verdict is Verdict.ERROR


def test_the_details_are_those_of_the_events(trace):
    """Every event of a run has no other details than the table of its kind says."""
    assert set(EVENT_DETAILS) <= set(EVENT_KINDS)
    for entry in trace.events:
        known = EVENT_DETAILS.get(entry.kind)
        assert known is None or set(entry.data) <= set(known), entry


def test_a_number_is_a_detail_and_nth_the_place():
    """`number=421` selects alarm 421, `nth=2` the second match."""
    events = [
        Event(1, "axis1", "alarm.raised", {"number": 431}),
        Event(2, "axis1", "alarm.raised", {"number": 421}),
        Event(3, "axis1", "alarm.raised", {"number": 421}),
    ]
    assert event("alarm.raised", number=421).find(events).time_ns == 2
    assert event("alarm.raised", number=421, nth=2).find(events).time_ns == 3
    assert event("alarm.raised", nth=-1).find(events).time_ns == 3


def test_what_a_recording_cannot_hold_is_blocked_and_not_passed():
    """Where a kind or signal exists on the bench but not in this recording, the check is blocked, with the
    reason.
    """
    words = Vocabulary(
        ("axis1", "drive1"), kinds=("drive.",), absent=("axis1.torque",), origin="the log bus.log"
    )
    group = TraceGroup.from_bytes("drive1", (("position", "m"),), {}, b"")
    trace = Trace([group], vocabulary=words)
    for expectation in (no_alarm(), value_at("axis1.torque", 0.0, 0.0, tolerance=1.0)):
        (check,) = expectation.evaluate(trace)
        assert check.verdict is Verdict.BLOCKED
        assert "the log bus.log does not hold" in check.observed
    with pytest.raises(NotRecordedError):
        _ = trace["axis1.torque"]


@pytest.mark.parametrize(
    ("trigger", "slip"),
    [
        (on_event("axis.state", "axs1"), "axs1"),
        (on_event("axis.state", to="MOTOIN"), "MOTOIN"),
        (on_event("job.started", number=2), "nth=n"),
        (on_event("alarm.raised", number=1), "no number 1"),
        (state("axis1", "MOTOIN"), "MOTOIN"),
        (state("axs1", "MOTION"), "axs1"),
    ],
    ids=str,
)
def test_a_trigger_on_what_cannot_come_is_refused(trigger, slip):
    """A fault that waits for it would never act: arming it is refused, as its end is."""
    with load_bench("reference").build() as bench:
        injector = Injector(bench)
        with pytest.raises(ConfigurationError, match=slip):
            injector.inject("drive.sto", trigger=trigger)
        with pytest.raises(ConfigurationError, match=slip):
            injector.inject("drive.sto", until=trigger)
        assert not injector.armed
        injector.inject("drive.sto", trigger=on_event("job.started", job="a job that is made later"))
