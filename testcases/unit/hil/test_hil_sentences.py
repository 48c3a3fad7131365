"""The one sentence that a check ends in: what came, when, and what is allowed."""

from __future__ import annotations

import numpy as np
import pytest

from fieldbus.history import Event
from hil.expect import (
    Expectation,
    alarm,
    always,
    disabled,
    event,
    event_order,
    happens,
    job_output,
    never_happens,
    no_alarm,
    no_motion_after,
    ramp,
    run_checkers,
    settles_within,
    standstill,
    state_at,
    status_word_bit,
    stays_within,
    telegram_bits,
    value_at,
    word_sequence,
)
from hil.expect._wording import clause
from hil.record import Trace, TraceGroup
from reports.model import Check, Verdict

FAULT = event("fault.applied")


def happened(time_s: float, source: str, kind: str, **data: str | int) -> Event:
    return Event(round(time_s * 1e9), source, kind, data)


@pytest.fixture(scope="module")
def trace() -> Trace:
    """A fault at 0.1 s; the axis brakes from 100 mm/s to rest at 0.2 s, with alarm 421 at 0.104 s."""
    events = [
        happened(0.1, "drive1", "fault.applied", fault="drive.fault"),
        happened(0.1, "drive1", "drive.state", **{"from": "OPERATION_ENABLED", "to": "FAULT"}),
        happened(0.104, "axis1", "alarm.raised", number=421, reaction=4, text="Drive fault"),
        happened(0.104, "axis1", "job.error", job="axis1.MC_MoveVelocity_1", error_id=0x8001),
        happened(0.104, "axis1", "axis.state", **{"from": "MOTION", "to": "ALARM_RAMP"}),
    ]
    times = np.arange(0, 251) * 4_000_000
    seconds = times * 1e-9
    velocity = np.clip((0.2 - seconds) * 1000.0, 0.0, 100.0)
    position = np.concatenate(([0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2 * 0.004)))
    stw1 = np.where(seconds < 0.2, 0x47F, 0x47E)
    columns = {
        "actual_velocity": (velocity, "mm/s"), "actual_position": (position, "mm"), "stw1": (stw1, ""),
        "status_word": (np.where(seconds >= 0.104, 2, 0), ""), "power_status": (seconds < 0.104, ""),
    }  # fmt: skip
    values = np.array([column for column, _ in columns.values()], dtype=float).T
    group = TraceGroup("axis1", tuple((name, unit) for name, (_, unit) in columns.items()), {}, times, values)
    return Trace([group], events=events, end_ns=1_000_000_000)


def sentences(trace: Trace, expectation: Expectation) -> list[tuple[Verdict, str]]:
    return [(check.verdict, check.sentence) for check in expectation.evaluate(trace)]


GOOD = (
    (alarm(421, since=FAULT, within_s=0.012), "Alarm 421 came 4 ms after the fault (allowed: 12 ms)"),
    (alarm(421, axis="axis1"), "Alarm 421 of axis1 came at t = 0.104 s"),
    (no_alarm(besides=(421,)), "No alarm but 421 came in the whole case"),
    (job_output("axis1.MC_MoveVelocity_1", "Error", error_id=0x8001, since=FAULT),
     "MC_MoveVelocity_1 ended with error 16#8001 4 ms after the fault"),
    (happens(event("drive.state", "drive1", to="FAULT"), since=FAULT),
     "drive1 went to FAULT at the instant of the fault"),
    (never_happens(event("job.done", "axis1", job="axis1.MC_MoveVelocity_1"), since=FAULT),
     "MC_MoveVelocity_1 of axis1 was not done from the fault on"),
    (event_order([FAULT, event("alarm.raised", number=421)]), "In order came the fault, then alarm 421"),
    (state_at("axis1", FAULT.plus(0.01), "ALARM_RAMP"), "axis1 was in ALARM_RAMP at 10 ms after the fault"),
    (value_at("axis1.actual_velocity", 0.152, 48.0, tolerance=1.0),
     "axis1.actual_velocity was 48 mm/s at t = 0.152 s (allowed: 47 … 49 mm/s)"),
    (stays_within("axis1.actual_velocity", high=120.0),
     "axis1.actual_velocity reached 100 mm/s at t = 0 s (allowed: at most 120 mm/s)"),
    (always("not backwards", lambda v: v >= 0, "axis1.actual_velocity"),
     "Always not backwards: so at all 251 samples"),
    (word_sequence("axis1.stw1", [0x47F, 0x47E]), "axis1.stw1 went 16#047F -> 16#047E from t = 0 s on"),
    (status_word_bit(1, True, at=FAULT, within_s=0.012),
     "axis1.status_word.X1 was TRUE 4 ms after the fault (allowed: 12 ms)"),
    (telegram_bits("axis1.stw1", at=0.3, zeros=1), "axis1.stw1 had X0 = 0 at t = 0.3 s"),
    (settles_within("axis1.actual_velocity", 0.0, tolerance=1.0, within_s=0.2, since=FAULT),
     "axis1.actual_velocity settled at ± 1 mm/s 100 ms after the fault (allowed: 200 ms)"),
    (disabled(by=FAULT.plus(0.01), drive=""), "axis1 was disabled from 10 ms after the fault on"),
    (ramp(FAULT, time_s=0.1), "The ramp of axis1 after the fault took 100 ms (allowed: 92 … 108 ms)"),
    (standstill(by=0.25), ("axis1.actual_velocity was at rest from t = 0.25 s on: at most 0 mm/s "
     "(allowed: 1 mm/s)")),
    (no_motion_after(0.25), "axis1.actual_position moved by 0 mm after t = 0.25 s (allowed: 0.05 mm)"),
    (alarm(421, since=FAULT).named("the trip"), "The trip: alarm 421 came 4 ms after the fault"),
)  # fmt: skip

BAD = (
    (alarm(421, since=FAULT, within_s=0.002), "Alarm 421 came 4 ms after the fault (allowed: 2 ms)"),
    (alarm(421, since=FAULT, reaction=2), ("Alarm 421 came 4 ms after the fault, but with reaction 4 "
     "(remove enable) instead of 2 (stop, maximum dynamics)")),
    (alarm(431, since=FAULT, within_s=0.012),
     "Alarm 431 did not come after the fault, instead alarm 421 came (allowed: 12 ms)"),
    (no_alarm(), "Alarm 421 came at t = 0.104 s (allowed: none)"),
    (never_happens(event("alarm.raised", number=421)), "Alarm 421 came at t = 0.104 s (allowed: never)"),
    (job_output("axis1.MC_MoveVelocity_1", "Done", since=FAULT, within_s=0.1),
     ("MC_MoveVelocity_1 was not done after the fault (allowed: 100 ms); instead: job.error 16#8001 at "
     "0.104000 s")),
    (event_order([event("alarm.raised", number=421), FAULT]),
     "The fault came too early, at t = 0.1 s (allowed: only after alarm 421)"),
    (state_at("axis1", 0.5, "MOTION"), "axis1 was in ALARM_RAMP instead of MOTION at t = 0.5 s"),
    (value_at("axis1.actual_velocity", 0.152, 0.0, tolerance=0.0),
     "axis1.actual_velocity was 48 mm/s at t = 0.152 s (allowed: 0 mm/s)"),
    (always("slow", lambda v: v < 60, "axis1.actual_velocity"),
     "Always slow, but axis1.actual_velocity = 100 at t = 0 s (36 samples break it)"),
    (word_sequence("axis1.stw1", [0x47F, 0x47B]),
     "axis1.stw1 went 16#047F -> 16#047E instead of 16#047F -> 16#047B from t = 0 s on"),
    (status_word_bit(1, False, at=FAULT.plus(0.01)),
     "axis1.status_word.X1 was not FALSE at 10 ms after the fault"),
    (disabled(by=FAULT, drive=""), ("axis1 was not disabled after the fault: MC_Power.Status is TRUE, "
     "the last time 0.000000 s after")),
    (standstill(by=FAULT), "axis1.actual_velocity was 100 mm/s at t = 0.1 s (allowed: 1 mm/s)"),
    (no_motion_after(FAULT), "axis1.actual_position moved by 5 mm after the fault (allowed: 0.05 mm)"),
    (ramp(FAULT, distance=50.0), "The travel of axis1 after the fault was 5 mm (allowed: 47.6 … 52.4 mm)"),
)  # fmt: skip


def test_each_expectation_says_what_came_in_one_sentence(trace, subtests):
    """Passed and failed, the sentence has the subject, what it did and when, and the allowed value."""
    for verdict, cases in ((Verdict.PASSED, GOOD), (Verdict.FAILED, BAD)):
        for expectation, sentence in cases:
            with subtests.test(sentence):
                assert sentences(trace, expectation) == [(verdict, sentence)]


def test_what_was_not_judged_says_why(trace):
    """A misspelt name and a reference that never came are reported in the same place."""
    (slip,) = state_at("axis9", 0.5, "MOTION").evaluate(trace)
    assert slip.verdict is Verdict.ERROR
    assert slip.sentence.startswith("State of axis9 was not judged: ")
    assert "axis9" in slip.sentence.partition("judged")[2]
    (lost,) = alarm(421, since=event("fault.removed")).evaluate(trace)
    assert lost.sentence == "The fault did not go, from which on alarm 421 was expected"


def test_rules_of_the_bench_are_marked_and_say_what_they_are(trace):
    """Each check of an always-on rule is a rule with its own sentence; one that breaks it says when."""

    def broken(_trace: Trace) -> list[Check]:
        return [
            Check("motion bits of axis1", Verdict.FAILED, "at most one of X12, X13", "both", 0.25),
            Check("motion bits of axis2", Verdict.PASSED, "at most one of X12, X13", "9 cycles"),
        ]

    bad, good = run_checkers(trace, [broken])
    assert bad.rule
    assert bad.sentence == "Motion bits of axis1: both at 0.2500 s (allowed: at most one of X12, X13)"
    assert good.sentence == "Motion bits of axis2: at most one of X12, X13 (9 cycles)"
    assert all(check.rule and check.sentence for check in run_checkers(trace))


def test_events_become_clauses(subtests):
    """Subject, deed and its denial; a number of times where not the first is meant."""
    for selector, subject, past in (
        (event("alarm.raised", "axis1", number=531, nth=2), "alarm 531 of axis1", "came for the 2nd time"),
        (event("emcy.received", code=0x8130), "EMCY 8130h", "came"),
        (event("fault.applied", fault="can.drop"), "the fault can.drop", "came"),
        (event("drive.fault", "drive1", text="overcurrent"), "a fault of drive1 (overcurrent)", "came"),
        (event("node.booted", "drive1"), "drive1", "came into service"),
        (event("job.done", "axis1"), "a job of axis1", "was done"),
        (
            event("probe.latched", "drive1", edge="rising"),
            "probe.latched of drive1 with edge = rising",
            "came",
        ),
    ):
        with subtests.test(str(selector)):
            assert clause(selector)[:2] == (subject, past)
