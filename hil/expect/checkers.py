"""Rules that hold in every run, whatever the case is about. They judge a finished trace.

A checker takes a trace and returns one check per rule and component that it could judge; where the trace
holds nothing to judge (no axis, no drive) it returns none. Each check names its requirement.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldbus.history import Event
from hil.expect._base import pending_alarms
from hil.expect._log_rules import check_log_signs_of_life, check_log_words
from hil.expect._motion_rules import STOPS, check_motion_while_disabled, check_setpoint_continuity
from hil.expect._nc_rules import check_nc_axes
from hil.expect._profidrive_rules import (
    check_profidrive_sign_of_life,
    check_profidrive_stops,
    check_profidrive_transitions,
    check_profidrive_words,
)
from hil.expect._search_rules import check_comes_up, check_feedback, check_rest_after_alarm
from hil.expect._setpoint_rules import (
    check_acceleration_setpoint,
    check_position_continuity,
    check_stop_travel,
)
from hil.expect._synchronous_rules import check_synchronous_operation
from hil.expect._wording import rule_sentence
from hil.expect._words import cia402_state, in_states, normal_state
from hil.expect.rules import judge
from hil.record import Trace
from reports.model import Check, Verdict

Checker = Callable[[Trace], list[Check]]

MOTION_JOBS: Final = frozenset(
    {
        "MC_MoveAbsolute",
        "MC_MoveRelative",
        "MC_MoveVelocity",
        "MC_MoveJog",
        "MC_MoveSuperimposed",
        "MC_Home",
        "MC_Halt",
        "MC_HaltSuperimposed",
        "MC_MotionInVelocity",
        "MC_MotionInPosition",
        "MC_MotionInSuperimposed",
        "MC_GearIn",
        "MC_GearInPos",
        "MC_GearInVelocity",
        "MC_GearOut",
        "MC_CamIn",
        "MC_CamOut",
    }
)
_ENDS: Final = {"job.done": "Done", "job.aborted": "CommandAborted", "job.error": "Error"}

LEGAL_TRANSITIONS: Final[dict[str, frozenset[str]]] = {
    "not_ready_to_switch_on": frozenset({"switch_on_disabled"}),
    "switch_on_disabled": frozenset({"ready_to_switch_on"}),
    "ready_to_switch_on": frozenset({"switched_on", "switch_on_disabled"}),
    "switched_on": frozenset({"operation_enabled", "ready_to_switch_on", "switch_on_disabled"}),
    "operation_enabled": frozenset(
        {"switched_on", "ready_to_switch_on", "switch_on_disabled", "quick_stop_active"}
    ),
    "quick_stop_active": frozenset({"switch_on_disabled", "operation_enabled"}),
    "fault_reaction_active": frozenset({"fault"}),
    "fault": frozenset({"switch_on_disabled"}),
}
"""Transitions 2 to 12, 14 to 16 of the power drive system; 0 and 13 are possible
from everywhere (C402-001..C402-017).
"""

_WITHOUT_TORQUE: Final = frozenset(
    {"not_ready_to_switch_on", "switch_on_disabled", "ready_to_switch_on", "switched_on"}
)


def _check(
    name: str, expected: str, problems: list[tuple[float, str]], requirements: Iterable[str], *, seen: str
) -> Check:
    """Return a check that passes when there are no problems (time and text each)."""
    observed = seen
    if problems:
        more = f"; {len(problems)} times in all" if len(problems) > 1 else ""
        observed = problems[0][1] + more
    return Check(
        name=name,
        verdict=Verdict.FAILED if problems else Verdict.PASSED,
        expected=expected,
        observed=observed,
        time_s=problems[0][0] if problems else None,
        requirements=list(requirements),
    )


_OF_A_JOB: Final = frozenset({"job.active", "job.in_velocity", "job.synchronous", "job.done", "job.aborted"})
"""Events that only a job has that was taken; one that is refused has an error at once."""


def check_job_outputs(trace: Trace) -> list[Check]:
    """No execution of an instruction ends in two of Done, CommandAborted and Error (MC-071); each begins
    before it is active, reaches a velocity, or ends.

    An instance that is started again while it is busy aborts its own job, and shows nothing of that (MC-069).
    """
    jobs: dict[str, list[Event]] = {}
    for entry in trace.select(kind="job."):
        jobs.setdefault(f"{entry.source}/{entry.data.get('job')}", []).append(entry)
    if not jobs:
        return []
    problems: list[tuple[float, str]] = []
    for name, entries in jobs.items():
        end: Event | None = None
        busy = superseded = False
        begun = 0
        for entry in entries:
            if entry.kind == "job.started":
                begun += 1
            elif entry.kind in _OF_A_JOB and begun <= 0:
                problems.append((entry.time_ns * 1e-9, f"{name}: {entry.kind}, and has not begun"))
            elif entry.kind in _ENDS:
                begun = max(begun - 1, 0)  # a job that is refused has an error, and never began
            if entry.kind == "job.started":
                end = None
                superseded, busy = busy, True
            elif entry.kind == "job.aborted" and superseded:
                superseded = False
            elif entry.kind in _ENDS:
                busy = False
                if end is not None and end.kind != entry.kind and end.time_ns == entry.time_ns:
                    problems.append(
                        (entry.time_ns * 1e-9, f"{name}: {_ENDS[end.kind]} and {_ENDS[entry.kind]} together")
                    )
                elif end is not None and entry.kind != "job.error":
                    problems.append(
                        (entry.time_ns * 1e-9, f"{name}: {_ENDS[entry.kind]} after {_ENDS[end.kind]}")
                    )
                end = entry
            elif entry.kind == "job.active" and end is not None:
                problems.append((entry.time_ns * 1e-9, f"{name}: Active after {_ENDS[end.kind]}"))
    problems.sort()
    return [
        _check(
            "job outputs",
            "one of Done, CommandAborted, Error per job",
            problems,
            ["MC-071"],
            seen=f"{len(jobs)} jobs",
        )
    ]


_CIA402_STATES = frozenset({"", "not_ready_to_switch_on", "fault_reaction_active", *LEGAL_TRANSITIONS})


def check_drive_transitions(trace: Trace) -> list[Check]:
    """Every state change of a CiA 402 drive is one of the profile's transitions; a drive that shows another
    state is of another profile.
    """
    checks = []
    # A bus log shows the states at SYNC only: one in between may be missing.
    sampled = trace.from_log
    drives: dict[str, list[Event]] = {}
    for entry in trace.select(kind="drive.state"):
        if normal_state(str(entry.data.get("to", ""))) in LEGAL_TRANSITIONS:
            drives.setdefault(entry.source, []).append(entry)
    others = {
        entry.source
        for entry in trace.select(kind="drive.state")
        if normal_state(str(entry.data.get("to", ""))) not in LEGAL_TRANSITIONS
    }
    for drive, entries in drives.items():
        if drive in others:
            continue
        problems = []
        steps = [
            tuple(normal_state(str(entry.data.get(side, ""))) for side in ("from", "to")) for entry in entries
        ]
        if not {state for step in steps for state in step} <= _CIA402_STATES:
            continue  # another profile, which may have a state of the same name
        for entry, (old, new) in zip(entries, steps, strict=True):
            if new in {"not_ready_to_switch_on", "fault_reaction_active"} or old not in LEGAL_TRANSITIONS:
                continue
            if new in LEGAL_TRANSITIONS[old] or (new == "fault" and (old in _WITHOUT_TORQUE or sampled)):
                continue
            if sampled and any(new in LEGAL_TRANSITIONS[via] for via in LEGAL_TRANSITIONS[old]):
                continue
            problems.append((entry.time_ns * 1e-9, f"{entry.data.get('from')} to {entry.data.get('to')}"))
        checks.append(
            _check(
                f"state transitions of {drive}",
                "only transitions of CiA 402",
                problems,
                ["C402-026"],
                seen=f"{len(entries)} transitions",
            )
        )
    return checks


def _words(trace: Trace, name: str) -> NDArray[np.int64]:
    return trace[name].values.astype(np.int64)


def check_status_words(trace: Trace) -> list[Check]:
    """The words of an axis agree with each other in every cycle (STP-507, STP-510 to STP-513, DIA-103)."""
    checks: list[Check] = []
    for axis in trace.components_with("status_word", "error_word", "alarm_number", "state", "stw1", "zsw1"):
        times = trace[f"{axis}.status_word"].time_s
        if len(times) == 0:
            continue
        word, error = _words(trace, f"{axis}.status_word"), _words(trace, f"{axis}.error_word")
        number, reaction = _words(trace, f"{axis}.alarm_number"), _words(trace, f"{axis}.alarm_reaction")
        stw1, zsw1 = _words(trace, f"{axis}.stw1"), _words(trace, f"{axis}.zsw1")

        rises = np.zeros(len(times), dtype=bool)
        rises[1:] = ((stw1[:-1] & 1) == 0) & ((stw1[1:] & 1) == 1) & ((zsw1[:-1] & zsw1[1:] & 0x40) != 0)
        ramping = in_states(trace[f"{axis}.state"], STOPS)
        braking = _until_zero(ramping, trace[f"{axis}.velocity_setpoint"].values)
        motion_bits = (word >> 12 & 1) + (word >> 13 & 1) + (word >> 14 & 1)
        has_error = (word & 2) != 0
        must, must_not = _error_spans(trace, axis, times)
        rules: list[tuple[str, str, NDArray[np.bool_], list[str]]] = [
            ("switching on", "STW1.0 does not rise while ZSW1.6 = 1 is received", rises, ["STP-510"]),
            (
                "control word in a ramp",
                "STW1 = 16#047F until setpoint zero, acknowledging aside",
                braking & ((stw1 & 0x047F) != 0x047F),
                ["STP-511"],
            ),
            ("motion bits", "at most one of X12, X13, X14", motion_bits > 1, ["STP-512", "DIA-105"]),
            (
                "error bits",
                "X1 implies an ErrorWord bit and an alarm number",
                has_error & ((error == 0) | (number == 0)),
                ["DIA-103"],
            ),
            (
                "error bit and alarms",
                "X1 exactly while an alarm with a reaction is pending",
                (must & ~has_error) | (must_not & has_error),
                ["STP-513"],
            ),
            (
                "reaction",
                "a reaction shown implies X1, in one snapshot",
                (reaction > 0) & ~has_error,
                ["DIA-110"],
            ),
        ]
        if f"{axis}.power_status" in trace and f"{axis}.power_busy" in trace:
            status, busy = _words(trace, f"{axis}.power_status"), _words(trace, f"{axis}.power_busy")
            rules.append(
                ("MC_Power outputs", "Status implies Busy", (status != 0) & (busy == 0), ["STP-507"])
            )
            if f"{axis}.power_enable" in trace:
                # In the cycle of an edge the outputs may still be those of the call before.
                enable = _words(trace, f"{axis}.power_enable") != 0
                held = enable.copy()
                held[1:] &= enable[:-1]
                free = (status == 0) & (busy == 0)
                rules.append(
                    ("MC_Power off", "neither Status nor Busy only without Enable", free & held, ["STP-508"])
                )
                rules.append(("MC_Power busy", "Enable implies Busy", held & (busy == 0), ["STP-509"]))
        for name, expected, broken, identifiers in rules:
            problems = [(float(times[index]), "not so") for index in np.flatnonzero(broken)]
            checks.append(
                _check(f"{name} of {axis}", expected, problems, identifiers, seen=f"{len(times)} cycles")
            )
    return checks


def _until_zero(ramping: NDArray[np.bool_], setpoint: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return, of every run of true flags, the part before the setpoint is zero: afterwards it may follow
    actual values.
    """
    index = np.arange(len(ramping))
    begun = np.maximum.accumulate(np.where(ramping, -1, index))
    zero = np.maximum.accumulate(np.where(np.abs(setpoint) <= 1e-9, index, -1))
    return ramping & (zero <= begun)


def _error_spans(
    trace: Trace, axis: str, times: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return where X1 must be TRUE (an alarm with a reaction is pending) and where
    it must be FALSE (none at all).
    """
    must, may = np.zeros(len(times), dtype=bool), np.zeros(len(times), dtype=bool)
    slack_s = 2 * float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    for raised_ns, cleared_ns, _, reaction in pending_alarms(trace, axis):
        start, end = raised_ns * 1e-9, cleared_ns * 1e-9
        may |= (times >= start - slack_s) & (times <= end + slack_s)
        if reaction:
            must |= (times > start + slack_s) & (times < end - slack_s)
    return must, ~may


def check_jobs_and_alarms(trace: Trace) -> list[Check]:
    """No motion job stays Busy while an alarm with reaction 1 to 4 is pending (STP-514)."""
    checks = []
    for axis in trace.components_with("status_word", "alarm_number", "state"):
        times = trace[f"{axis}.status_word"].time_s
        cycle_ns = round(float(np.median(np.diff(times))) * 1e9) if len(times) > 1 else 0
        spans = [span for span in pending_alarms(trace, axis) if 1 <= span[3] <= 4]
        problems = []
        for job, instruction, started_ns, ended_ns in _busy_spans(trace, axis):
            if instruction not in MOTION_JOBS:
                continue
            for raised_ns, cleared_ns, number, _ in spans:
                overlap = min(ended_ns, cleared_ns) - max(started_ns, raised_ns)
                if overlap > 2 * cycle_ns:
                    when = max(started_ns, raised_ns) * 1e-9
                    problems.append((when, f"{job} is busy while alarm {number} is pending"))
        checks.append(
            _check(
                f"jobs under alarms of {axis}",
                "no motion job busy while an alarm with reaction 1..4 is pending",
                sorted(problems),
                ["STP-514"],
                seen=f"{len(spans)} alarms",
            )
        )
    return checks


def _busy_spans(trace: Trace, axis: str) -> list[tuple[str, str, int, int]]:
    running: dict[str, Event] = {}
    spans = []
    for entry in trace.select(source=axis, kind="job."):
        job = str(entry.data.get("job"))
        if entry.kind == "job.started":
            running[job] = entry
        elif entry.kind in _ENDS and job in running:
            start = running.pop(job)
            spans.append((job, str(start.data.get("instruction")), start.time_ns, entry.time_ns))
    spans += [(job, str(e.data.get("instruction")), e.time_ns, trace.end_ns) for job, e in running.items()]
    return spans


def check_drive_status_words(trace: Trace) -> list[Check]:
    """A drive's statusword always shows one of the eight states (mask of CiA 402)."""
    checks = []
    for drive in trace.components_with("statusword"):
        signal = trace[f"{drive}.statusword"]
        problems = []
        for time_s, values in signal.parts():
            unknown = [word for word in np.unique(values) if not cia402_state(int(word))]
            if unknown:
                problems += [
                    (float(time_s[i]), f"16#{int(values[i]):04X}")
                    for i in np.flatnonzero(np.isin(values, unknown))
                ]
        checks.append(
            _check(
                f"statusword of {drive}",
                "a state of CiA 402",
                problems,
                ["C402-039"],
                seen=f"{len(signal)} samples",
            )
        )
    return checks


ALWAYS_ON: Final[tuple[Checker, ...]] = (
    check_job_outputs,
    check_drive_transitions,
    check_drive_status_words,
    check_status_words,
    check_jobs_and_alarms,
    check_motion_while_disabled,
    check_setpoint_continuity,
    check_position_continuity,
    check_acceleration_setpoint,
    check_stop_travel,
    check_profidrive_transitions,
    check_profidrive_words,
    check_profidrive_stops,
    check_profidrive_sign_of_life,
    check_log_words,
    check_log_signs_of_life,
    check_synchronous_operation,
    check_nc_axes,
    judge,
)
"""The checkers that judge every case."""

SEARCH_RULES: Final[tuple[Checker, ...]] = (check_rest_after_alarm, check_comes_up, check_feedback)
"""Further checkers for generated programs, whose axes are sound and enabled before anything else."""


def run_checkers(trace: Trace, checkers: Iterable[Checker] = ALWAYS_ON) -> list[Check]:
    """Return the checks of all checkers, in order, each marked as a rule and with its sentence."""
    checks = [check for checker in checkers for check in checker(trace)]
    for check in checks:
        if not check.rule:
            check.rule, check.sentence = True, rule_sentence(check)
    return checks
