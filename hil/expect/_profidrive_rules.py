"""Always-on rules for PROFIdrive axes, from their recorded words: states, stops, pulses, acknowledging, sign
of life.

They judge the words of the drive itself (`<drive>.drive_stw1`, ...), which a disturbed telegram does not
touch. While a fault lets the drive lie about its own ZSW1 that word is not judged.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldbus.history import Event
from hil.expect._words import normal_state
from hil.record import Trace
from reports.model import Check, Verdict

Words = NDArray[np.int64]
Flags = NDArray[np.bool_]

COLUMNS: Final = ("drive_stw1", "drive_zsw1", "drive_zsw2", "torque", "position", "velocity")
"""What the recording of a drive has to hold to be judged."""

PULSES: Final = 0x0400
"""ZSW2.10: pulses enabled (PD-083)."""
STATE_MASK: Final = 0x0047
STATE_BITS: Final = (0x0040, 0x0001, 0x0003, 0x0007)
"""ZSW1 & 0047h of S1, S2, S3 and S5, S4; 0 before the first cyclic data."""

_ON, _NO_OFF2, _NO_OFF3, _OPERATE = 0x0001, 0x0002, 0x0004, 0x0008
_ACKNOWLEDGE: Final = 0x0080
_CONTROL: Final = 0x0400
_JOG: Final = 0x0300
_FAULT: Final = 0x0008
_SIGN_SHIFT: Final = 12
_SIGN_LAST: Final = 15
_EDGE_SAMPLES: Final = 3
"""Samples in which the edge that acknowledges has to lie."""
_LIES: Final = ("drive.statusword_stuck", "drive.statusword_bits")
_SETTLE_S: Final = 0.02


class Rule(NamedTuple):
    """What a transition needs in STW1; `unless` are bits that serve as well."""

    requirement: str
    ones: int = 0
    zeros: int = 0
    unless: int = 0
    by_drive: bool = False
    """Faults, safety functions and standstill make it too."""


IDLE, S1, S2, S3, S4, S5A, S5B = STATES = "idle", "S1", "S2", "S3", "S4", "S5a", "S5b"
TRANSITIONS: Final[dict[tuple[str, str], Rule]] = {
    (IDLE, S1): Rule("PD-097", ones=_CONTROL),
    (S1, S2): Rule("PD-098", ones=_NO_OFF2 | _NO_OFF3, zeros=_ON),
    (S2, S1): Rule("PD-099", by_drive=True),
    (S2, S3): Rule("PD-100", ones=_ON, unless=_JOG),
    (S3, S1): Rule("PD-101", by_drive=True),
    (S3, S2): Rule("PD-102", by_drive=True),
    (S3, S4): Rule("PD-103", ones=_OPERATE),
    (S4, S1): Rule("PD-104", by_drive=True),
    (S4, S5B): Rule("PD-105", by_drive=True),
    (S4, S5A): Rule("PD-106", by_drive=True),
    (S4, S3): Rule("PD-107", zeros=_OPERATE),
    (S5A, S1): Rule("PD-108", by_drive=True),
    (S5A, S5B): Rule("PD-109", by_drive=True),
    (S5A, S2): Rule("PD-110", by_drive=True),
    (S5A, S4): Rule("PD-111", ones=_ON | _OPERATE, unless=_JOG),
    (S5B, S1): Rule("PD-112", by_drive=True),
}
"""The general state machine: every other change is illegal, S5b to S4 above all (PD-113)."""

_TEXTS: Final = {
    "waiting_for_control_by_plc": IDLE,
    "s1_switching_on_inhibited": S1,
    "s2_ready_for_switching_on": S2,
    "s3_switched_on": S3,
    "s4_operation": S4,
    "s5_ramp_stop": S5A,
    "s5_quick_stop": S5B,
}


def state_of(text: object) -> str:
    """Return the state that a drive's event names, as in `TRANSITIONS`; empty
    when it is none of this profile.
    """
    return _TEXTS.get(normal_state(str(text)), "")


def profidrive_axes(trace: Trace) -> tuple[str, ...]:
    """Return the drives of a trace that these rules can judge."""
    return tuple(trace.components_with(*COLUMNS))


def column(trace: Trace, drive: str, name: str) -> Words:
    """Return a recorded word."""
    return trace[f"{drive}.{name}"].values.astype(np.int64)


def _check(
    name: str, expected: str, problems: list[tuple[float, str]], requirements: list[str], seen: str
) -> Check:
    problems = sorted(problems)
    more = f"; {len(problems)} times in all" if len(problems) > 1 else ""
    return Check(
        name=name,
        verdict=Verdict.FAILED if problems else Verdict.PASSED,
        expected=expected,
        observed=problems[0][1] + more if problems else seen,
        time_s=problems[0][0] if problems else None,
        requirements=requirements,
    )


def check_profidrive_transitions(trace: Trace) -> list[Check]:
    """Every change of state is one of the general state machine, and STW1 shows
    its condition (PD-097 to PD-113).

    A bus log shows the states at SYNC only: there one in between may be missing.
    """
    checks = []
    sampled = trace.from_log
    drives = trace.components_with("drive_stw1", "drive_zsw1") if sampled else profidrive_axes(trace)
    for drive in drives:
        changes = list(trace.select(source=drive, kind="drive.state"))
        problems = []
        for entry in changes:
            old, new = state_of(entry.data.get("from")), state_of(entry.data.get("to"))
            if not old or not new or new == IDLE:
                continue  # of another profile; a restart is possible from everywhere
            rule = TRANSITIONS.get((old, new))
            when = entry.time_ns * 1e-9
            if (
                rule is None
                and sampled
                and any((old, via) in TRANSITIONS and (via, new) in TRANSITIONS for via in STATES)
            ):
                continue
            if rule is None:
                problems.append((when, f"{old} to {new}"))
            elif not _condition_holds(trace, drive, when, rule):
                problems.append((when, f"{old} to {new} without its condition in STW1"))
        checks.append(
            _check(
                f"general state machine of {drive}",
                "only transitions of PROFIdrive, each with its condition",
                problems,
                [rule.requirement for rule in TRANSITIONS.values()] + ["PD-113"],
                f"{len(changes)} transitions",
            )
        )
    return checks


def _condition_holds(trace: Trace, drive: str, when: float, rule: Rule) -> bool:
    """Say whether the sample before the change or one of the two after it shows what the change needs."""
    if rule.by_drive:
        return True
    signal = trace[f"{drive}.drive_stw1"]
    index = int(np.searchsorted(signal.time_s, when - 1e-10))
    for word in signal.values[max(index - 1, 0) : index + 2].astype(np.int64):
        if word & rule.unless or (word & rule.ones == rule.ones and not word & rule.zeros):
            return True
    return False


def check_profidrive_words(trace: Trace) -> list[Check]:
    """ZSW1 shows one of the states, and a fault goes with an edge of STW1.7
    under control by PLC only (PD-078).
    """
    checks = []
    for drive in profidrive_axes(trace):
        times = trace[f"{drive}.drive_zsw1"].time_s
        zsw1, stw1 = column(trace, drive, "drive_zsw1"), column(trace, drive, "drive_stw1")
        honest = ~_lying(trace, drive, times)
        strange = honest & (zsw1 != 0) & ~np.isin(zsw1 & STATE_MASK, STATE_BITS)
        problems = [(float(times[at]), f"ZSW1 = {int(zsw1[at]):04X}h") for at in np.flatnonzero(strange)]
        checks.append(
            _check(
                f"ZSW1 of {drive}",
                "bits 0, 1, 2 and 6 of one state",
                problems,
                ["PD-060", "PD-061", "PD-062", "PD-066"],
                f"{len(times)} samples",
            )
        )
        gone = np.zeros(len(times), dtype=bool)
        gone[1:] = (zsw1[:-1] & _FAULT != 0) & (zsw1[1:] & _FAULT == 0) & (zsw1[1:] != 0)
        gone[1:] &= honest[1:] & honest[:-1]
        edge = np.zeros(len(times), dtype=bool)
        edge[1:] = (stw1[:-1] & _ACKNOWLEDGE == 0) & (
            stw1[1:] & (_ACKNOWLEDGE | _CONTROL) == _ACKNOWLEDGE | _CONTROL
        )
        restarted = [entry.time_ns * 1e-9 for entry in _restarts(trace, drive)]
        problems = [
            (float(times[at]), "ZSW1.3 fell without an edge of STW1.7")
            for at in np.flatnonzero(gone)
            if not edge[max(int(at) - _EDGE_SAMPLES + 1, 0) : int(at) + 2].any()
            and not any(times[max(int(at) - 2, 0)] <= when <= times[at] for when in restarted)
        ]
        checks.append(
            _check(
                f"acknowledging of {drive}",
                "a fault goes by an edge of STW1.7 alone",
                problems,
                ["PD-078", "PD-137"],
                f"{int(gone.sum())} acknowledged",
            )
        )
    return checks


def check_profidrive_stops(trace: Trace) -> list[Check]:
    """While STW1.1 = 0 (OFF2) the pulses are off at once; without pulses there is no
    torque (PD-104, PD-108, PD-112).
    """
    checks = []
    for drive in profidrive_axes(trace):
        times = trace[f"{drive}.drive_stw1"].time_s
        stw1 = column(trace, drive, "drive_stw1")
        pulses = pulses_enabled(trace, drive)
        torque = trace[f"{drive}.torque"].values
        coasting = (stw1 & (_NO_OFF2 | _CONTROL)) == _CONTROL
        held = coasting.copy()
        held[1:] &= coasting[:-1]  # from the second sample on, so that the command has been carried out
        problems = [
            (float(times[at]), f"pulses are on with STW1 = {int(stw1[at]):04X}h")
            for at in np.flatnonzero(held & pulses)
        ]
        checks.append(
            _check(
                f"OFF2 of {drive}",
                "pulses off at once",
                problems,
                ["PD-104", "PD-108", "PD-112"],
                f"{int(held.sum())} samples with OFF2",
            )
        )
        problems = [
            (float(times[at]), f"{float(torque[at]):.4g} Nm")
            for at in np.flatnonzero(~pulses & (torque != 0.0))
        ]
        checks.append(
            _check(
                f"torque of {drive} without pulses",
                "0 Nm",
                problems,
                ["PD-083", "PD-104"],
                f"{int((~pulses).sum())} samples without pulses",
            )
        )
    return checks


def check_profidrive_sign_of_life(trace: Trace) -> list[Check]:
    """The drive's counter stands, begins with 1, counts 1 to 15 and again 1, or goes back to 0; it never
    jumps (PD-123).
    """
    checks = []
    for drive in profidrive_axes(trace):
        times = trace[f"{drive}.drive_zsw2"].time_s
        sign = column(trace, drive, "drive_zsw2") >> _SIGN_SHIFT & 0xF
        if not sign.any():
            continue  # without isochronous operation nobody counts (PD-130)
        old, new = sign[:-1], sign[1:]
        step = np.where((old > 0) & (new > 0), (new - old) % _SIGN_LAST, 0)
        begin = (old == 0) & (new > 1)
        # Where a clock drifts against the recorder, a value may be seen twice and the next one not at all.
        stands = np.zeros(len(step) + 2, dtype=bool)
        stands[1:-1] = (step == 0) & (old > 0)
        excused = (step == 2) & (stands[:-2] | stands[2:])
        wrong = begin | ((step > 1) & ~excused)
        problems = [
            (float(times[at + 1]), f"{int(old[at])} is followed by {int(new[at])}")
            for at in np.flatnonzero(wrong)
        ]
        checks.append(
            _check(
                f"sign of life of {drive}",
                "0, or 1 to 15 and again 1",
                problems,
                ["PD-123", "PD-126"],
                f"{int((sign > 0).sum())} samples",
            )
        )
    return checks


def pulses_enabled(trace: Trace, drive: str) -> Flags:
    """Return where a PROFIdrive axis shows that its pulses are enabled."""
    result: Flags = (column(trace, drive, "drive_zsw2") & PULSES) != 0
    return result


def _lying(trace: Trace, drive: str, times: NDArray[np.float64]) -> Flags:
    """Return where the drive shows a ZSW1 that a fault has made."""
    result = np.zeros(len(times), dtype=bool)
    for begin, end in _fault_spans(trace, drive):
        result |= (times >= begin - _SETTLE_S) & (times <= end + _SETTLE_S)
    return result


def _fault_spans(trace: Trace, drive: str) -> Iterator[tuple[float, float]]:
    begun: dict[object, float] = {}
    for entry in trace.select(source=drive, kind="fault."):
        if entry.data.get("fault") not in _LIES:
            continue
        number = entry.data.get("injection")
        if entry.kind == "fault.applied":
            begun[number] = entry.time_ns * 1e-9
        elif entry.kind == "fault.removed" and number in begun:
            yield begun.pop(number), entry.time_ns * 1e-9
    for begin in begun.values():
        yield begin, float("inf")


def _restarts(trace: Trace, drive: str) -> Iterator[Event]:
    """Return the changes to the state after power-on."""
    for entry in trace.select(source=drive, kind="drive.state"):
        if state_of(entry.data.get("to")) == IDLE:
            yield entry
