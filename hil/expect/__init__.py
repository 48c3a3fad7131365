"""Expectations: what a trace must show. Values, evaluated on the recording,
never on the product's own opinion.

Reference instants are given as seconds or as an event: `since=event("fault.applied")`. `golden` holds the
numbers of the reference axis, `checkers` the rules that hold in every run.
"""

from __future__ import annotations

from hil.expect._base import Expectation, Reference, describe, evaluate
from hil.expect._errors import axis_error, command_refused, no_axis_error
from hil.expect._events import (
    JOB_OUTPUTS,
    alarm,
    event_order,
    happens,
    job_output,
    never_happens,
    no_alarm,
    state_at,
)
from hil.expect._following import follows
from hil.expect._measure import StopMeasurement, measure_stop
from hil.expect._search_rules import undecided_until
from hil.expect._settling import disabled, settles_within, telegram_bits
from hil.expect._signals import (
    STW1_MASK,
    always,
    never,
    status_word_bit,
    stays_within,
    stw1_sequence,
    value_at,
    word_sequence,
)
from hil.expect._stop_mode import stop
from hil.expect._stops import no_motion_after, ramp, standstill
from hil.expect.checkers import ALWAYS_ON, SEARCH_RULES, Checker, run_checkers
from hil.expect.golden import (
    REFERENCE_AXIS,
    ReferenceAxis,
    StopRamp,
    drive_ramp,
    stop_distance,
    stop_ramp,
    stop_time,
)
from hil.record import event

__all__ = [
    "ALWAYS_ON",
    "JOB_OUTPUTS",
    "REFERENCE_AXIS",
    "SEARCH_RULES",
    "STW1_MASK",
    "Checker",
    "Expectation",
    "Reference",
    "ReferenceAxis",
    "StopMeasurement",
    "StopRamp",
    "alarm",
    "always",
    "axis_error",
    "command_refused",
    "describe",
    "disabled",
    "drive_ramp",
    "evaluate",
    "event",
    "event_order",
    "follows",
    "happens",
    "job_output",
    "measure_stop",
    "never",
    "never_happens",
    "no_alarm",
    "no_axis_error",
    "no_motion_after",
    "ramp",
    "run_checkers",
    "settles_within",
    "standstill",
    "state_at",
    "status_word_bit",
    "stays_within",
    "stop",
    "stop_distance",
    "stop_ramp",
    "stop_time",
    "stw1_sequence",
    "telegram_bits",
    "undecided_until",
    "value_at",
    "word_sequence",
]
