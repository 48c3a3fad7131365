"""Sentences and numbers of a report."""

from __future__ import annotations

import math

import pytest

from reports import (
    CaseResult,
    Check,
    RunResult,
    Verdict,
    check_sentence,
    headline,
    margin,
    margin_text,
    replay_command,
    run_state,
)
from reports.text import limits, number, reaction_name


def check(
    name="alarm 521", expected="within 20 ms", observed="came after 48 ms", verdict=Verdict.FAILED, **more
) -> Check:
    return Check(name, verdict, expected, observed, **more)


@pytest.mark.parametrize(
    ("name", "expected", "observed", "sentence"),
    [
        (
            "alarm 521",
            "within 20 ms",
            "came after 48 ms",
            "Alarm 521 expected within 20 ms, came after 48 ms",
        ),
        ("alarm 521", "within 20 ms", "after 48 ms", "Alarm 521 expected within 20 ms, came after 48 ms"),
        ("Alarm 521", "alarm 521 within 20 ms", "never came", "Alarm 521 expected within 20 ms, never came"),
        (
            "stop distance",
            "at most 45 mm",
            "71.07 mm",
            "Stop distance expected at most 45 mm, observed 71.07 mm",
        ),
        ("state", "ALARM_DISABLED", "MOTION", "State: expected ALARM_DISABLED, observed MOTION"),
        ("alarm 5", "alarm 521 first", "alarm 431", "Alarm 5: expected alarm 521 first, observed alarm 431"),
        ("order", "a\n  before b", "", "Order: expected a before b"),
        ("order", "", "", "Order"),
        ("peak", "", "3 mm", "Peak: observed 3 mm"),
    ],
)
def test_check_becomes_one_sentence(name, expected, observed, sentence):
    """Expected against observed reads as one sentence whatever form the words of the check have."""
    assert check_sentence(check(name, expected, observed)) == sentence


def test_numbers_stand_in_where_words_are_missing():
    """A measurement without words speaks through its limits and value."""
    bare = check("ramp time", "", "", value=0.1 + 0.2, unit="s", low=0.1, high=0.2)
    assert check_sentence(bare) == "Ramp time: expected 100 … 200 ms, observed 300 ms"


def test_failed_case_speaks_through_its_first_failed_check():
    """The headline is not the case's message but what was measured."""
    case = CaseResult("c", "t", Verdict.FAILED, "assert 48 <= 20")
    case.checks = [check("first", verdict=Verdict.PASSED), check(), check("later")]
    assert headline(case) == "Alarm 521 expected within 20 ms, came after 48 ms"


@pytest.mark.parametrize(
    ("verdict", "message", "words"),
    [
        (Verdict.PASSED, "", ""),
        (Verdict.FAILED, "\n  axis moved \nmore", "axis moved"),
        (Verdict.FAILED, "", "Failed without saying why"),
        (Verdict.BLOCKED, "no encoder", "no encoder"),
        (Verdict.ERROR, "", "The harness failed without saying why"),
    ],
)
def test_case_without_failed_check_has_a_headline(verdict, message, words):
    """Every case that is not green says something; a green one nothing."""
    assert headline(CaseResult("c", "t", verdict, message)) == words


@pytest.mark.parametrize(
    ("value", "low", "high", "distance", "words"),
    [
        (48.0, None, 20.0, -28.0, "28 ms over the limit"),
        (12.0, None, 20.0, 8.0, "8 ms to spare"),
        (3.0, 5.0, None, -2.0, "2 ms under the limit"),
        (6.0, 5.0, 20.0, 1.0, "1 ms to spare"),
        (20.0, None, 20.0, 0.0, "0 ms to spare"),
        (6.0, None, None, None, ""),
        (None, 5.0, 20.0, None, ""),
        (math.nan, 5.0, 20.0, None, ""),
    ],
)
def test_margin_is_the_distance_to_the_nearest_limit(value, low, high, distance, words):
    """Inside is positive, outside negative, and the words name the side."""
    measured = check(value=value, unit="ms", low=low, high=high)
    assert margin(measured) == distance
    assert margin_text(measured) == words


def test_limits_in_symbols():
    """One-sided and two-sided limits read as such; without a unit nothing trails."""
    assert limits(check(low=1.0, high=2.5, unit="mm")) == "1 … 2.5 mm"
    assert limits(check(low=1.0)) == "≥ 1"
    assert limits(check(high=-3.0, unit="%")) == "≤ -3 %"
    assert limits(check()) == ""


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (48.0, "48"),
        (0.1 + 0.2, "0.3"),
        (1234567.0, "1234567"),
        (0.000123456789, "0.000123457"),
        (1e-7, "1e-07"),
        (2.5e12, "2.5e+12"),
        (100.0, "100"),
        (math.inf, "∞"),
        (-math.inf, "-∞"),
        (math.nan, "not a number"),
    ],
)
def test_numbers_read_well(value, text):
    """Six significant digits, no trailing zeros, no exponent in the usual range."""
    assert number(value) == text


def test_replay_command_is_safe_to_paste():
    """A token with characters of the shell is quoted."""
    assert replay_command("h1.ab-c_d+/=") == "hil replay h1.ab-c_d+/="
    assert replay_command("a'; rm b") == "hil replay 'a'\\''; rm b'"


@pytest.mark.parametrize(
    ("verdicts", "interrupted", "state"),
    [
        ("passed passed", False, "passed"),
        ("passed blocked", False, "passed"),
        ("passed failed", False, "failed"),
        ("passed error", True, "failed"),
        ("passed", True, "interrupted"),
        ("blocked", False, "empty"),
        ("", False, "empty"),
    ],
)
def test_only_a_complete_run_with_something_shown_is_green(verdicts, interrupted, state):
    """Nothing executed, everything blocked or a run cut short is not a pass."""
    run = RunResult("t", 1, "b", "", {}, "", interrupted=interrupted)
    run.cases = [CaseResult(str(index), "", Verdict(word)) for index, word in enumerate(verdicts.split())]
    assert run_state(run) == state


def test_unknown_reaction_has_a_name():
    """A code outside the catalogue is shown, not an error."""
    assert reaction_name(4) == "remove enable"
    assert reaction_name(99) == "reaction 99"
