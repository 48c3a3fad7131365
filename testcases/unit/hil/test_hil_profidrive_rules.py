"""The rules for PROFIdrive axes: silent on a good run, loud on a doctored one. They see the trace only."""

from __future__ import annotations

import numpy as np
import pytest

from fieldbus.history import Event
from hil.bench import load_bench
from hil.expect import run_checkers
from hil.expect._profidrive_rules import (
    TRANSITIONS,
    check_profidrive_sign_of_life,
    check_profidrive_stops,
    check_profidrive_transitions,
    check_profidrive_words,
    state_of,
)
from hil.expect.checkers import check_motion_while_disabled
from hil.faults import Injector
from hil.record import Trace
from reports.model import Verdict
from testcases.unit.hil.test_hil_checkers import doctored, failed


@pytest.fixture(scope="module")
def good():
    """A run with moves, a fault, an acknowledgement, a quick stop and a coast."""
    with load_bench("profidrive").build(seed=1) as bench:
        axis = bench.axis()
        axis.power()
        bench.run_for(0.3)
        axis.move_velocity(100.0)
        bench.run_for(0.5)
        Injector(bench).inject("drive.fault", code=0x2310)
        bench.run_for(2.0)
        axis.reset()
        bench.run_for(0.5)
        axis.move_velocity(-100.0)
        bench.run_for(0.5)
        axis.power(False, stop_mode=1)
        bench.run_for(1.0)
        axis.power()
        bench.run_for(0.5)
        axis.move_velocity(100.0)
        bench.run_for(0.5)
        axis.power(False, stop_mode=3)
        bench.run_for(1.5)
        return bench.trace()


def event(trace, old, new):
    """Return the time of the first change of the drive between two states, s."""
    return next(
        entry.time_ns * 1e-9
        for entry in trace.select(source="drive1", kind="drive.state")
        if (state_of(entry.data["from"]), state_of(entry.data["to"])) == (old, new)
    )


def with_event(trace, time_s, old, new):
    """Return a trace in which the drive tells one more change of state."""
    extra = Event(round(time_s * 1e9), "drive1", "drive.state", {"from": old, "to": new})
    events = sorted([*trace.events, extra], key=lambda entry: entry.time_ns)
    return Trace(trace.groups, events=events, constants=trace.constants, end_ns=trace.end_ns)


@pytest.mark.exhaustive
def test_a_good_run_breaks_no_rule(good):
    """All rules pass, and each had something to judge: transitions, coasting, acknowledging, a counter."""
    checks = {check.name: check for check in run_checkers(good)}
    assert [name for name, check in checks.items() if check.verdict is not Verdict.PASSED] == []
    assert int(checks["general state machine of drive1"].observed.split()[0]) >= 12
    assert checks["acknowledging of drive1"].observed == "1 acknowledged"
    assert int(checks["OFF2 of drive1"].observed.split()[0]) > 10
    assert int(checks["sign of life of drive1"].observed.split()[0]) > 1000
    assert "no motion of drive1 without torque" in checks


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-113", "PD-097", "PD-104", "PD-114")
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("S5 quick stop", "S4 operation"),
        ("S1 switching on inhibited", "S3 switched on"),
        ("S1 switching on inhibited", "S4 operation"),
        ("S2 ready for switching on", "S4 operation"),
        ("S5 quick stop", "S2 ready for switching on"),
        ("S5 ramp stop", "S3 switched on"),
    ],
)
def test_a_change_that_the_state_machine_has_not_is_found(good, old, new):
    """A quick stop that is taken back, and every skipped state, is no transition of the profile."""
    assert failed(check_profidrive_transitions, with_event(good, 0.5, old, new)) == [
        "general state machine of drive1"
    ]


def test_the_table_of_transitions_has_one_row_per_rule():
    """PD-097 to PD-112 are the rows; nothing leads out of the quick stop but switching on inhibited."""
    assert sorted(rule.requirement for rule in TRANSITIONS.values()) == [
        f"PD-{number:03}" for number in range(97, 113)
    ]
    assert [new for old, new in TRANSITIONS if old == "S5b"] == ["S1"]


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-098", "PD-100", "PD-103", "PD-107")
@pytest.mark.parametrize(
    ("old", "new", "set_bits", "clear_bits"),
    [
        ("S1", "S2", 0x0001, 0), ("S1", "S2", 0, 0x0002), ("S2", "S3", 0, 0x0001), ("S3", "S4", 0, 0x0008),
    ],
)  # fmt: skip
def test_a_change_without_its_condition_in_the_control_word_is_found(good, old, new, set_bits, clear_bits):
    """S2 with ON still there, operation without enable, and so on, contradict the recorded STW1."""
    when = event(good, old, new)

    def change(values, times):
        near = np.abs(times - when) < 0.02
        values[near] = (values[near].astype(int) | set_bits) & ~clear_bits
        return values

    assert failed(check_profidrive_transitions, doctored(good, "drive1.drive_stw1", change)) == [
        "general state machine of drive1"
    ]


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-066", "PD-062")
@pytest.mark.parametrize("word", [0x0041, 0x0005, 0x0002, 0x0004, 0x0047, 0x0200])
def test_a_status_word_of_no_state_is_found(good, word):
    """Bits 0, 1, 2 and 6 show one of S1 to S5 together, or nothing is valid."""

    def change(values, times):
        values[np.searchsorted(times, 1.0)] = word
        return values

    assert "ZSW1 of drive1" in failed(check_profidrive_words, doctored(good, "drive1.drive_zsw1", change))


@pytest.mark.requirement("PD-078")
def test_a_fault_that_goes_by_itself_is_found(good):
    """ZSW1.3 that falls while STW1.7 stands still has not been acknowledged by an edge."""
    assert failed(check_profidrive_words, good) == []

    def still(values, times):
        values[:] = values.astype(int) | 0x80
        return values

    assert failed(check_profidrive_words, doctored(good, "drive1.drive_stw1", still)) == [
        "acknowledging of drive1"
    ]

    def never(values, times):
        values[:] = values.astype(int) & ~0x80
        return values

    assert failed(check_profidrive_words, doctored(good, "drive1.drive_stw1", never)) == [
        "acknowledging of drive1"
    ]


@pytest.mark.requirement("PD-104", "PD-107")
def test_pulses_and_torque_after_off2_are_found(good):
    """A drive that keeps its pulses with OFF2, and one that has torque without pulses."""
    when = event(good, "S4", "S1")

    def pulses(values, times):
        near = (times > when + 3.2) & (times < when + 20.0)
        values[near] = values[near].astype(int) | 0x0400
        return values

    assert "OFF2 of drive1" in failed(check_profidrive_stops, doctored(good, "drive1.drive_zsw2", pulses))

    def torque(values, times):
        values[np.searchsorted(times, when + 0.5)] = 0.01
        return values

    assert failed(check_profidrive_stops, doctored(good, "drive1.torque", torque)) == [
        "torque of drive1 without pulses"
    ]


@pytest.mark.requirement("PD-104")
def test_motion_without_pulses_is_found(good):
    """A machine that gets faster while its drive shows no pulses, and one that creeps away after it came to
    rest.
    """
    ended = good.end_s

    def faster(values, times):
        values[times > ended - 0.3] = 0.05
        return values

    assert failed(check_motion_while_disabled, doctored(good, "drive1.velocity", faster)) == [
        "no motion of drive1 without torque"
    ]

    def creeps(values, times):
        late = times > ended - 0.4
        values[late] += (times[late] - ended + 0.4) * 0.002
        return values

    assert failed(check_motion_while_disabled, doctored(good, "drive1.position", creeps)) == [
        "no motion of drive1 without torque"
    ]


@pytest.mark.requirement("PD-123", "PD-126")
@pytest.mark.parametrize("distance", [None, 2, 3, 7, 13])
def test_a_sign_of_life_that_jumps_is_found(good, distance):
    """One value so far from its own, or 0, in the middle of the counter is a jump there, or back."""
    at = 700

    def change(values, times):
        words = values.astype(int)
        sign = (words[at] >> 12) & 15
        other = 0 if distance is None else (sign - 1 + distance) % 15 + 1
        values[at] = words[at] & 0x0FFF | other << 12
        return values

    assert failed(check_profidrive_sign_of_life, doctored(good, "drive1.drive_zsw2", change)) == [
        "sign of life of drive1"
    ]


def test_a_clock_that_drifts_against_the_recorder_is_no_jump(good):
    """A value seen twice and the next one missed is how a live bench samples it."""

    def change(values, times):
        values[700] = values[699]
        return values

    assert failed(check_profidrive_sign_of_life, doctored(good, "drive1.drive_zsw2", change)) == []


def test_a_drive_that_is_made_to_lie_is_not_judged_by_its_lie():
    """A fault that freezes ZSW1 or lies in it takes that word out of the judgement, for as long as it
    acts.
    """
    with load_bench("profidrive").build(seed=1) as bench:
        bench.run_for(0.2)
        Injector(bench).inject("drive.statusword_bits", set=0x0047, duration_s=0.1)
        bench.run_for(0.5)
        assert failed(check_profidrive_words, bench.trace()) == []
