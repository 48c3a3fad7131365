"""Rules for bus logs: acknowledging, switching off without ramp, sign of life, of drives of both profiles.

A log shows words when their frames pass, not what the drive does within: so there are some cycles of SYNC
between a command and what the drive shows. Times in which nothing is known of a drive are left out.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.record import Signal, Trace
from reports.model import Check, Verdict

PERIOD: Final = "sync_period_s"
"""Constant `<drive>.sync_period_s` of a log: usual distance of two SYNCs."""

_LATE: Final = 12
"""Cycles until the reaction to a command has to show; more than those after which missing process data are
known to be missing.
"""
_LIFE_LAST: Final = 15
_LIFE_SHIFT: Final = 12

Numbers = NDArray[np.float64]
Silences = list[tuple[float, float, str]]
Words = NDArray[np.uint16]
Flags = NDArray[np.bool_]


class _Profile(NamedTuple):
    """What the words of a profile say."""

    command: str
    status: str
    off: str
    off_mask: int
    off_value: int
    """Bits of the command that mean: switch off at once."""
    acknowledge_mask: int
    acknowledge_value: int
    """Bits of the command of which an edge acknowledges."""
    fault: int
    """Bit of the status word that shows a fault."""
    off_requirements: tuple[str, ...]
    acknowledge_requirements: tuple[str, ...]


_PROFIDRIVE: Final = _Profile(
    "drive_stw1", "drive_zsw1", "OFF2", 0x0402, 0x0400, 0x0480, 0x0480, 0x0008,
    ("PD-104", "PD-108", "PD-112"), ("PD-078", "PD-137"),
)  # fmt: skip
_CIA402: Final = _Profile(
    "controlword", "statusword", "disable voltage", 0x0002, 0x0000, 0x0080, 0x0080, 0x0008,
    ("C402-010", "C402-013"), ("C402-016",),
)  # fmt: skip
_PULSES: Final = 0x0400
_POWERED: Final = ((0x6F, 0x27), (0x6F, 0x07))
"""Operation enabled, Quick stop active."""


def check_log_words(trace: Trace) -> list[Check]:
    """Of every drive whose words a log shows: a fault goes by an edge of the bit that acknowledges; the
    command to switch off without ramp switches off.
    """
    if not trace.from_log:
        return []
    checks = []
    for profile in (_PROFIDRIVE, _CIA402):
        for drive in trace.components_with(profile.command, profile.status):
            period_s = trace.constants.get(f"{drive}.{PERIOD}", 0.0)
            if period_s:
                checks.append(_acknowledging(trace, drive, profile, period_s))
                checks += _off(trace, drive, profile, period_s)
    return checks


def check_log_signs_of_life(trace: Trace) -> list[Check]:
    """The counters of drive and controller never run ahead of the bus cycle (PD-123)."""
    if not trace.from_log:
        return []
    checks = []
    for word, whose in (("drive_zsw2", ""), ("drive_stw2", " in the telegram to it")):
        for drive in trace.components_with(word):
            period_s = trace.constants.get(f"{drive}.{PERIOD}", 0.0)
            signal = trace[f"{drive}.{word}"]
            if not period_s or not any(_signs(values).any() for _, values in signal.parts()):
                continue
            problems, changes = _jumps(signal, period_s, trace.silences(drive, states=False))
            checks.append(
                _check(
                    f"sign of life of {drive}{whose}",
                    "0, or 1 to 15 and again 1, one per bus cycle",
                    problems,
                    ("PD-123",),
                    f"{changes} changes",
                )
            )
    return checks


def _signs(words: Numbers) -> NDArray[np.int64]:
    return words.astype(np.int64) >> _LIFE_SHIFT & 0xF


def _jumps(signal: Signal, period_s: float, silences: Silences) -> tuple[list[tuple[float, str]], int]:
    """Return where a counter has run ahead of the cycle, and how often it has changed."""
    problems: list[tuple[float, str]] = []
    changes = 0
    last, changed_s = np.empty(0, dtype=np.int64), float(signal.time_s[0])
    for time_s, words in signal.parts():
        sign = np.concatenate((last, _signs(words)))
        times = np.concatenate((np.full(len(last), changed_s), time_s))
        at = np.flatnonzero(sign[1:] != sign[:-1]) + 1
        old, new = sign[at - 1], sign[at]
        since = np.diff(times[at], prepend=changed_s)
        # Frames that the recorder has lost take a count along each.
        possible = np.maximum(1, np.floor(since / period_s + 0.75))
        ahead = (old > 0) & (new > 0) & ((new - old) % _LIFE_LAST > possible)
        ahead &= _known(silences, times[at], period_s)
        problems += [
            (float(times[place]), f"{int(sign[place - 1])} is followed by {int(sign[place])}")
            for place in at[ahead]
        ]
        changes += len(at)
        last = sign[-1:]
        changed_s = float(times[at[-1]]) if len(at) else changed_s
    return problems, changes


def _acknowledging(trace: Trace, drive: str, profile: _Profile, period_s: float) -> Check:
    times, status = _changes(trace, drive, profile.status)
    command_times, command = _changes(trace, drive, profile.command)
    set_ = command & profile.acknowledge_mask == profile.acknowledge_value
    bit = command & 0x0080 != 0
    edges = command_times[1:][set_[1:] & ~bit[:-1]]
    fault = status & profile.fault != 0
    begins = np.flatnonzero(fault[1:] & ~fault[:-1]) + 1
    ends = np.flatnonzero(fault[:-1] & ~fault[1:]) + 1
    boots = [
        entry.time_ns * 1e-9 for entry in trace.select(kind="node.bootup") if entry.data.get("name") == drive
    ]
    silences = trace.silences(drive)
    problems = []
    for end in ends:
        before = begins[begins < end]
        begin_s, end_s = float(times[before[-1]]) if len(before) else -np.inf, float(times[end])
        if not len(before) and end_s - times[0] < _LATE * period_s:
            continue  # the edge may have been before the log
        excused = any(begin_s <= when <= end_s for when in boots) or any(
            silent_s <= end_s + period_s and heard_s >= begin_s for silent_s, heard_s, _ in silences
        )
        if not excused and not ((edges >= begin_s) & (edges <= end_s)).any():
            problems.append((end_s, f"the fault bit fell without an edge of bit 7 of {profile.command}"))
    return _check(
        f"acknowledging of {drive}",
        "a fault goes by an edge of bit 7 alone",
        problems,
        profile.acknowledge_requirements,
        f"{len(ends)} acknowledged",
    )


def _off(trace: Trace, drive: str, profile: _Profile, period_s: float) -> list[Check]:
    times, command = _changes(trace, drive, profile.command)
    shows = "drive_zsw2" if profile is _PROFIDRIVE else profile.status
    if f"{drive}.{shows}" not in trace:
        return []
    masks = ((_PULSES, _PULSES),) if profile is _PROFIDRIVE else _POWERED
    off = command & profile.off_mask == profile.off_value
    first = off.copy()
    first[1:] &= ~off[:-1]
    since = times[np.maximum.accumulate(np.where(first, np.arange(len(times)), 0))] if len(times) else times
    silences = trace.silences(drive)
    problems = []
    before = False
    for status_times, values in trace[f"{drive}.{shows}"].parts():
        status = values.astype(np.uint16)
        wrong = np.zeros(len(status), dtype=bool)
        for mask, value in masks:
            wrong |= status & mask == value
        place = np.searchsorted(times, status_times, side="right") - 1
        if len(times):
            at = np.maximum(place, 0)
            # The command comes once a cycle: one cycle more until it has been repeated for so long.
            wrong &= (place >= 0) & off[at] & (status_times - since[at] >= (_LATE + 1) * period_s)
        else:
            wrong[:] = False
        wrong &= _known(silences, status_times, period_s)
        starts = np.flatnonzero(wrong & ~np.concatenate(([before], wrong[:-1])))
        problems += [
            (float(status_times[at]), f"still powered {_LATE} cycles after the command") for at in starts
        ]
        before = bool(wrong[-1])
    return [
        _check(
            f"{profile.off} of {drive}",
            "no torque at once",
            problems,
            profile.off_requirements,
            f"{int(first.sum())} commands",
        )
    ]


def _changes(trace: Trace, drive: str, name: str) -> tuple[Numbers, Words]:
    """Return a word from its first value on, where it changes."""
    found = trace[f"{drive}.{name}"].changes()  # what had not come yet is no sample of it
    return np.array([time_s for time_s, _ in found]), np.array(
        [int(word) for _, word in found], dtype=np.uint16
    )


def _known(silences: Silences, times: Numbers, period_s: float) -> Flags:
    """Return where something is known of a drive, and has been for some cycles."""
    known = np.ones(len(times), dtype=bool)
    for silent_s, heard_s, _ in silences:
        known &= (times < silent_s) | (times > heard_s + _LATE * period_s)
    return known


def _check(
    name: str, expected: str, problems: list[tuple[float, str]], requirements: tuple[str, ...], seen: str
) -> Check:
    more = f"; {len(problems)} times in all" if len(problems) > 1 else ""
    return Check(
        name=name,
        verdict=Verdict.FAILED if problems else Verdict.PASSED,
        expected=expected,
        observed=problems[0][1] + more if problems else seen,
        time_s=problems[0][0] if problems else None,
        requirements=list(requirements),
    )
