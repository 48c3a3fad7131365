"""Rules for bus logs: acknowledging, switching off without ramp, sign of life, of drives of both profiles.

A log shows words when their frames pass, not what the drive does within: so there are some cycles of SYNC
between a command and what the drive shows. Times in which nothing is known of a drive are left out.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.record import Trace
from reports.model import Check, Verdict

PERIOD: Final = "sync_period_s"
"""Constant `<drive>.sync_period_s` of a log: usual distance of two SYNCs."""

_LATE: Final = 12
"""Cycles until the reaction to a command has to show; more than those after which missing process data are
known to be missing.
"""
_LIFE_LAST: Final = 15
_LIFE_SHIFT: Final = 12

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
            times, values = _word(trace, drive, word)
            sign = values >> _LIFE_SHIFT & 0xF
            if not period_s or not sign.any():
                continue
            at = np.flatnonzero(sign[1:] != sign[:-1]) + 1
            old, new = sign[at - 1].astype(np.int64), sign[at].astype(np.int64)
            since = np.diff(times[at], prepend=times[0])
            # Frames that the recorder has lost take a count along each.
            possible = np.maximum(1, np.floor(since / period_s + 0.75))
            ahead = (old > 0) & (new > 0) & ((new - old) % _LIFE_LAST > possible)
            ahead &= _known(trace, drive, times, period_s)[at]
            problems = [
                (float(times[place]), f"{int(sign[place - 1])} is followed by {int(sign[place])}")
                for place in at[ahead]
            ]
            checks.append(
                _check(
                    f"sign of life of {drive}{whose}",
                    "0, or 1 to 15 and again 1, one per bus cycle",
                    problems,
                    ("PD-123",),
                    f"{len(at)} changes",
                )
            )
    return checks


def _acknowledging(trace: Trace, drive: str, profile: _Profile, period_s: float) -> Check:
    times, status = _word(trace, drive, profile.status)
    command_times, command = _word(trace, drive, profile.command)
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
    times, command = _word(trace, drive, profile.command)
    if profile is _PROFIDRIVE:
        if f"{drive}.drive_zsw2" not in trace.names():
            return []
        status_times, status = _word(trace, drive, "drive_zsw2")
        powered = status & _PULSES != 0
    else:
        status_times, status = _word(trace, drive, profile.status)
        powered = np.zeros(len(status), dtype=bool)
        for mask, value in _POWERED:
            powered |= status & mask == value
    off = command & profile.off_mask == profile.off_value
    first = off.copy()
    first[1:] &= ~off[:-1]
    run = np.maximum.accumulate(np.where(first, np.arange(len(times)), 0)) if len(times) else times
    held = off & (times - times[run] >= _LATE * period_s) if len(times) else off
    place = np.searchsorted(times, status_times, side="right") - 1
    wrong = powered & (place >= 0) & held[np.maximum(place, 0)] if len(times) else powered & False
    wrong &= _known(trace, drive, status_times, period_s)
    starts = np.flatnonzero(wrong & ~np.concatenate(([False], wrong[:-1])))
    problems = [(float(status_times[at]), f"still powered {_LATE} cycles after the command") for at in starts]
    return [
        _check(
            f"{profile.off} of {drive}",
            "no torque at once",
            problems,
            profile.off_requirements,
            f"{int(first.sum())} commands",
        )
    ]


def _word(trace: Trace, drive: str, name: str) -> tuple[NDArray[np.float64], Words]:
    """Return a word from its first value on."""
    signal = trace[f"{drive}.{name}"]  # what had not come yet is no sample of it
    return signal.time_s, signal.values.astype(np.uint16)


def _known(trace: Trace, drive: str, times: NDArray[np.float64], period_s: float) -> Flags:
    """Return where something is known of a drive, and has been for some cycles."""
    known = np.ones(len(times), dtype=bool)
    for silent_s, heard_s, _ in trace.silences(drive):
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
