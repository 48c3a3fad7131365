"""Words of the sentences that checks end in: times, instants, events, and the sentences of rules."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final, NamedTuple

from hil.record import EventSelector
from reports.model import Check, Verdict
from reports.text import capital, quantity

_JOBS: Final = {
    "job.started": ("became busy", "did not become busy"),
    "job.active": ("took control", "did not take control"),
    "job.synchronous": ("reached its leading value", "did not reach its leading value"),
    "job.in_velocity": ("reached its velocity", "did not reach its velocity"),
    "job.done": ("was done", "was not done"),
    "job.aborted": ("was aborted", "was not aborted"),
    "job.error": ("ended with an error", "did not end with an error"),
}
_EVENTS: Final = {
    "alarm.cleared": ("was cleared", "was not cleared"),
    "alarm.acknowledged": ("was acknowledged", "was not acknowledged"),
    "alarm.detail": ("was explained", "was not explained"),
    "alarm.gone": ("lost its cause", "did not lose its cause"),
    "fault.applied": ("came", "did not come"),
    "fault.removed": ("went", "did not go"),
}
_CAME: Final = ("came", "did not come")
_OF_SOURCE: Final = {
    "drive.fault_acknowledged": ("acknowledged its faults", "did not acknowledge its faults"),
    "drive.fault_cleared": ("cleared its faults", "did not clear its faults"),
    "drive.warning": ("changed its warnings", "did not change its warnings"),
    "link.down": ("lost its cyclic data", "did not lose its cyclic data"),
    "link.up": ("had cyclic data", "had no cyclic data"),
    "node.booted": ("came into service", "did not come into service"),
    "node.failed": ("could not be taken into service", "was taken into service"),
    "node.lost": ("was lost", "was not lost"),
}
"""Kinds whose source is the one who does it."""
_PLAIN_TEXT: Final = re.compile(r"[A-Za-z]+(-[a-z]+)?$")


def span(seconds: float) -> str:
    """Return a time in the unit that suits its size: `4 ms`, `1.25 s`, `0.21 ms`."""
    return quantity(seconds, "s", 5) if abs(seconds) >= 1.0 else quantity(seconds * 1e3, "ms", 4)


def spans(low_s: float, high_s: float) -> str:
    """Return two times in one unit: `67 … 83 ms`."""
    if max(abs(low_s), abs(high_s)) >= 1.0:
        return f"{quantity(low_s, '', 5)} … {quantity(high_s, 's', 5)}"
    return f"{quantity(low_s * 1e3, '', 4)} … {quantity(high_s * 1e3, 'ms', 4)}"


def size(value: float, unit: str) -> str:
    """Return a magnitude; lengths and speeds in m in the unit that suits their size."""
    base, slash, rest = unit.partition("/")
    if base == "m" and value and abs(value) < 0.1:
        factor, name = (1e3, "mm") if abs(value) >= 1e-4 else (1e6, "µm")
        return quantity(value * factor, f"{name}{slash}{rest}", 4)
    return quantity(value, unit, 4)


def allowed(text: str) -> str:
    """Return the allowed value in brackets; empty for none."""
    return f" (allowed: {text})" if text else ""


def within(within_s: float | None) -> str:
    """Return the allowed time in brackets; empty for no limit."""
    return "" if within_s is None else allowed(span(within_s))


def starting(text: str) -> str:
    """Return a sentence with a capital letter, unless it begins with a name such as `axis1.state`."""
    return capital(text) if _is_plain(text.partition(" ")[0]) else text


@lru_cache(maxsize=1024)
def _is_plain(word: str) -> bool:
    return _PLAIN_TEXT.match(word.rstrip(":,")) is not None


class Clause(NamedTuple):
    """An event as a sentence: subject, what it did, and the same denied."""

    subject: str
    past: str
    denied: str


def clause(selector: EventSelector) -> Clause:
    """Return an event as a sentence: `alarm 421 of axis1`, `came`, `did not come`."""
    data = dict(selector.data)
    kind, of = selector.kind, f" of {selector.source}" if selector.source else ""
    past, denied = _EVENTS.get(kind, _CAME)
    if kind in _JOBS and "job" in data:
        past, denied = _JOBS[kind]
        subject = str(data.pop("job")).rpartition(".")[2] + of
        error = data.pop("error_id", None)
        if isinstance(error, int):
            past, denied = f"ended with error 16#{error:04X}", f"did not end with error 16#{error:04X}"
    elif "to" in data and (kind.endswith((".state", ".nmt")) or kind == "link.nmt_state"):
        state = data.pop("to")
        subject = selector.source or kind.partition(".")[0]
        past, denied = f"went to {state}", f"did not go to {state}"
    elif kind in _OF_SOURCE:
        past, denied = _OF_SOURCE[kind]
        subject = selector.source or ("the node" if kind.startswith("node.") else "the drive")
    elif kind in _JOBS:
        past, denied = _JOBS[kind]
        subject = f"a job{of}"
    elif kind.startswith("alarm."):
        subject = f"alarm {data.pop('number')}{of}" if "number" in data else f"an alarm{of}"
    elif kind in ("fault.applied", "fault.removed"):
        subject = f"the fault {data.pop('fault')}{of}" if "fault" in data else f"the fault{of}"
    elif kind == "drive.fault":
        text = f" ({data.pop('text')})" if "text" in data else ""
        subject = f"a fault{of}{text}"
    elif kind == "emcy.received" and isinstance(data.get("code"), int):
        subject = f"EMCY {int(data.pop('code') or 0):04X}h{of}"
    elif kind == "node.bootup":
        subject = f"the boot-up message{of}"
    elif kind == "can.bus_error":
        subject = f"a bus error{of}"
    else:
        subject = f"{kind}{of}"
    if data:
        subject += f" with {', '.join(f'{key} = {value}' for key, value in data.items())}"
    if selector.nth != 1:
        past += f" for the {_ordinal(selector.nth)} time"
        denied += f" for the {_ordinal(selector.nth)} time"
    return Clause(subject, past, denied)


def _ordinal(number: int) -> str:
    if number < 0:
        return "last" if number == -1 else f"{_ordinal(-number)} last"
    return f"{number}{ {1: 'st', 2: 'nd', 3: 'rd'}.get(number if number < 20 else number % 10, 'th') }"


def instant_words(reference: float | EventSelector) -> str:
    """Return an instant for `after ...` and `at ...`: `the fault`, `alarm 421`, `0.546 s`."""
    if not isinstance(reference, EventSelector):
        return f"t = {reference:.7g} s"
    words = clause(reference)
    text = words.subject if words.past in ("came", "went") else f"{words.subject} {words.past}"
    if reference.kind == "fault.removed":
        text = f"the end of {words.subject}"
    if reference.offset_s:
        side = "after" if reference.offset_s > 0 else "before"
        text = f"{span(abs(reference.offset_s))} {side} {text}"
    return text


def after(reference: float | EventSelector, delay_s: float | None = None) -> str:
    """Return `4 ms after the fault`; from the start of the case on `at t = 0.546 s`."""
    if not isinstance(reference, EventSelector) and reference == 0:
        return "" if delay_s is None else f"at {instant_words(delay_s)}"
    if delay_s is not None and abs(delay_s) < 1e-9:
        here = instant_words(reference)
        return f"at the instant of {here}" if isinstance(reference, EventSelector) else f"at {here}"
    return ("" if delay_s is None else f"{span(delay_s)} ") + f"after {instant_words(reference)}"


def moment(reference: float | EventSelector, delay_s: float | None) -> str:
    """Return what `after` gives, with the space that separates it from the verb before it."""
    text = after(reference, delay_s)
    return f" {text}" if text else ""


def period(since: float | EventSelector, until: float | EventSelector | None) -> str:
    """Return the time of an observation: `in the whole case`, `from the fault to 2.5 s`."""
    whole = not isinstance(since, EventSelector) and since == 0
    if until is None:
        return "in the whole case" if whole else f"from {instant_words(since)} on"
    return f"from {'the start' if whole else instant_words(since)} to {instant_words(until)}"


def default_sentence(check: Check) -> str:
    """Return the sentence of a check whose definition has none of its own: what was not judged, and why."""
    name = check.name
    if check.verdict is Verdict.PASSED:
        return starting(f"{name}: {check.observed}")
    if check.verdict is Verdict.FAILED:
        return starting(f"{name}: {check.observed}{allowed(check.expected)}")
    return starting(f"{name} was not judged: {check.observed}")


def rule_sentence(check: Check) -> str:
    """Return the sentence of a rule of the bench: the rule, and what it saw or what breaks it."""
    if check.verdict is Verdict.PASSED:
        return starting(f"{check.name}: {check.expected} ({check.observed})")
    when = "" if check.time_s is None else f" at {check.time_s:.4f} s"
    return starting(f"{check.name}: {check.observed}{when}{allowed(check.expected)}")
