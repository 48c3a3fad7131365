"""One case as the compact JSON that the page renders when the case is opened."""

from __future__ import annotations

import hashlib
import json
import math
from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePosixPath
from typing import Final
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from reports.coverage import NO_STOP, reactions_to, state_of, stop_modes, stop_reactions
from reports.html.curves import cam_payload
from reports.html.following import following_payloads
from reports.html.homing import drawing_payload
from reports.html.numbers import encode_all, thin
from reports.html.signals import Lane, Panel, arrange, bands, component, is_setpoint
from reports.json_types import Json, JsonObject
from reports.model import CaseResult, Check, Message, Scalar, Signal, Step, Verdict
from reports.text import (
    check_sentence,
    code_text,
    expected_text,
    headline,
    limits,
    margin_text,
    number,
    observed_text,
    own_title,
    reaction_name,
    replay_command,
)

MAX_MESSAGES: Final = 400
"""Messages shown of a case; of a passed one half of them, where no defect is looked for."""
MAX_LOG: Final = 20_000
"""Messages up to which a case that is not green carries its whole bus log, for who asks for it."""
_IN_LIST: Final = 3
"""Faults and alarms of a case that the list shows."""
_SEARCHED: Final = 2000
"""Characters of a message that a search looks through."""
_TIME_QUANTUM_S: Final = 1e-6
_TIME_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


def script_json(value: object) -> str:
    """Return JSON that may stand inside a `script` element: nothing in it can end
    the element or open a comment.
    """
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character, escape in (
        ("<", "\\u003c"),
        (">", "\\u003e"),
        ("&", "\\u0026"),
        ("\u2028", "\\u2028"),
        ("\u2029", "\\u2029"),
    ):
        text = text.replace(character, escape)
    return text


def file_link(path: str) -> str:
    """Return a link for an evidence file below the report; empty for a path that leads elsewhere."""
    plain = path.replace("\\", "/")
    if not plain or plain.startswith("/") or ".." in PurePosixPath(plain).parts or plain[1:2] == ":":
        return ""
    return "./" + quote(plain, safe="/", errors="replace")


def _error_of(case: CaseResult) -> list[str]:
    """Return error code and reaction of an axis that has no alarms."""
    reaction = case.reaction
    if reaction is None or not reaction.code:
        return []
    return [f"{reaction.code.partition(' (')[0]} {reaction.response}"]


def index_entry(case: CaseResult, change: str = "") -> JsonObject:
    """Return what the case list needs to show, search and filter; what is empty is left out.

    Args:
        case: The case.
        change: What happened to it since the last run, in short.

    """
    faults = [
        [fault.kind, reaction, state_of(fault)]
        for fault in case.faults
        for reaction in reactions_to(case, fault)
    ]
    named = list(
        dict.fromkeys(
            [*case.requirements, *(identifier for check in case.checks for identifier in check.requirements)]
        )
    )
    injected = list(dict.fromkeys(f"{fault.kind} → {fault.target}" for fault in case.faults))
    alarms = list(dict.fromkeys(f"{alarm.number} {reaction_name(alarm.reaction)}" for alarm in case.alarms))
    stops = [mode for mode in stop_modes(case) if mode != NO_STOP]
    words = [case.message[:_SEARCHED], case.token, *case.tags, *named]
    words += [f"{fault.kind} {fault.target}" for fault in case.faults]
    words += [f"{alarm.number} {alarm.text}" for alarm in case.alarms]
    entry = {
        "id": case.identifier,
        "v": case.verdict.value,
        "t": own_title(case),
        "h": headline(case),
        "g": case.group,
        "tags": case.tags,
        "f": faults,
        "fl": (injected or stops)[:_IN_LIST],
        "al": (alarms or _error_of(case) or stop_reactions(case))[:_IN_LIST],
        "m": stop_modes(case),
        "c": change,
        "s": _time(case.simulated_s),
        "w": _time(case.wall_s),
        "q": " ".join(dict.fromkeys(words)).lower(),
    }
    return {name: value for name, value in entry.items() if value not in ("", [])}


def case_payload(case: CaseResult, *, points: int) -> JsonObject:
    """Return everything of a case for the page.

    Args:
        case: The case.
        points: About how many samples of a signal may stay; extremes and the surroundings of faults,
            alarms and failed checks always do.

    """
    focus = focus_times(case)
    messages = list(case.messages)
    bad = case.verdict is not Verdict.PASSED
    limit = MAX_MESSAGES if bad else MAX_MESSAGES // 2
    whole = MAX_LOG if bad else 0
    return {
        **case_curves(case, points=points, hidden=True),
        "title": own_title(case),
        "v": case.verdict.value,
        "head": headline(case),
        "message": case.message,
        "traceback": case.traceback,
        "group": case.group,
        "tags": case.tags,
        "reqs": case.requirements,
        "seed": str(case.seed),
        "token": case.token,
        "replay": replay_command(case.token) if case.token else "",
        "sim": _time(case.simulated_s),
        "wall": _time(case.wall_s),
        "digest": case.trace_digest,
        "story": [
            [_time(step.time_s), step.kind, step.text, _pairs(step.detail)] for step in full_story(case)
        ],
        "checks": [_check(check) for check in case.checks],
        "alarms": [
            [
                _time(a.time_s),
                _time(a.cleared_s),
                a.axis,
                str(a.number),
                str(a.reaction),
                reaction_name(a.reaction),
                a.text,
                _time(a.gone_s),
            ]
            for a in case.alarms
        ],
        "faults": [
            [
                f.kind,
                f.target,
                _time(f.armed_s),
                _time(f.applied_s),
                _time(f.removed_s),
                f.trigger,
                f.axis_state,
                _pairs(f.parameters),
            ]
            for f in case.faults
        ],
        "messages": _messages(messages, select_messages(messages, focus, limit)),
        "log": _messages(messages, range(len(messages))) if limit < len(messages) <= whole else [],
        "focus": [_time(moment) for moment in focus],
        "messageTotal": len(messages),
        "cams": [*following_payloads(case.signals), *(cam_payload(cam) for cam in case.cams)],
        "homings": [drawing_payload(drawing) for drawing in case.homings],
        "files": [[name, path, file_link(path)] for name, path in case.files.items()],
    }


def case_curves(case: CaseResult, *, points: int, hidden: bool = False) -> JsonObject:
    """Return the part of a case that can be laid over another one: curves, states, where its time begins.

    Args:
        case: The case.
        points: See `case_payload`.
        hidden: Also what is not shown at first.

    """
    panels, lanes = arrange(_clean(case.signals), _interest(case), involved=_involved(case))
    columns = _Columns()
    focus = focus_times(case)
    shown = [_panel(panel, columns, points, focus) for panel in panels if hidden or panel.shown]
    columns.encode()
    applied = [fault.applied_s for fault in case.faults if fault.applied_s is not None]
    start = min((float(signal.time_s[0]) for signal in case.signals if len(signal.time_s)), default=0.0)
    return {
        "id": case.identifier,
        "start": _time(start),
        "end": _time(_end_of(case)),
        "zero": _time(min(applied, default=None)),
        "panels": shown,
        "lanes": [_lane(lane) for lane in lanes if hidden or lane.shown],
        "times": columns.times,
    }


def focus_times(case: CaseResult) -> list[float]:
    """Return the moments that a reader will zoom to: faults, alarms, failed checks, most important first."""
    moments = [fault.applied_s for fault in case.faults]
    moments += [alarm.time_s for alarm in case.alarms]
    moments += [check.time_s for check in case.checks if check.verdict is not Verdict.PASSED]
    moments += [fault.removed_s for fault in case.faults]
    moments += [alarm.cleared_s for alarm in case.alarms]
    return list(dict.fromkeys(moment for moment in moments if moment is not None and math.isfinite(moment)))


def _interest(case: CaseResult) -> set[str]:
    """Return the components that the case is about: of failed checks, else of alarms, else of faults."""
    failed = {
        component(check.signal) for check in case.checks if check.verdict is Verdict.FAILED and check.signal
    }
    return failed or {alarm.axis for alarm in case.alarms[:1]} or {fault.target for fault in case.faults[:1]}


def _involved(case: CaseResult) -> set[str]:
    """Return all components with a fault, an alarm, or a check that does not hold."""
    bad = {component(check.signal) for check in case.checks if check.verdict is not Verdict.PASSED}
    return bad | {alarm.axis for alarm in case.alarms} | {fault.target for fault in case.faults}


def full_story(case: CaseResult) -> list[Step]:
    """Return the story in order of time, with faults, alarms and checks where the steps do not tell them."""
    kinds = {step.kind for step in case.story}
    story = list(case.story)
    if "inject" not in kinds:
        for fault in case.faults:
            if fault.applied_s is not None:
                story.append(
                    Step(fault.applied_s, "inject", f"{fault.kind} on {fault.target}", dict(fault.parameters))
                )
            if fault.removed_s is not None:
                story.append(Step(fault.removed_s, "inject", f"{fault.kind} on {fault.target} removed"))
    if "observe" not in kinds:
        story += [
            Step(
                alarm.time_s,
                "observe",
                f"{alarm.axis}: alarm {alarm.number}, {reaction_name(alarm.reaction)}: {alarm.text}",
            )
            for alarm in case.alarms
        ]
    if "expect" not in kinds:
        story += [
            Step(
                check.time_s,
                "expect",
                f"{check.name}: {expected_text(check)}",
                {"observed": observed_text(check)},
            )
            for check in case.checks
            if check.time_s is not None
        ]
    return sorted(story, key=lambda step: step.time_s)


def select_messages(messages: Sequence[Message], focus: list[float], limit: int = MAX_MESSAGES) -> list[int]:
    """Choose the bus messages to show: frames with errors, then those nearest to the moments of interest.

    Without such moments these are the first ones.
    """
    if len(messages) <= limit:
        return list(range(len(messages)))
    ordered = sorted(focus)

    def distance(index: int) -> tuple[bool, float, int]:
        time = messages[index].time_s
        place = bisect_left(ordered, time)
        near = min((abs(time - moment) for moment in ordered[max(0, place - 1) : place + 1]), default=0.0)
        return not messages[index].error, near, index

    return sorted(sorted(range(len(messages)), key=distance)[:limit])


class _Columns:
    """The samples of a case, which are encoded all at once, and its time axes,
    each distinct one stored once.
    """

    def __init__(self) -> None:
        self.times: list[JsonObject] = []
        self._columns: list[tuple[NDArray[np.float64], float | None]] = []
        self._places: list[JsonObject] = []
        self._known: dict[bytes, int] = {}
        self._seen: dict[int, tuple[NDArray[np.float64], int]] = {}

    def add(self, values: NDArray[np.float64], quantum: float | None = None) -> JsonObject:
        """Return the object that holds the samples after `encode`."""
        place: JsonObject = {}
        self._columns.append((values, quantum))
        self._places.append(place)
        return place

    def add_time(self, time_s: NDArray[np.float64]) -> int:
        """Return the number of a time axis."""
        seen = self._seen.get(id(time_s))  # most signals share the very array, which stays alive in here
        if seen is not None:
            return seen[1]
        key = hashlib.sha256(time_s.tobytes()).digest()
        if key not in self._known:
            self._known[key] = len(self.times)
            self.times.append(self.add(time_s, _TIME_QUANTUM_S))
        self._seen[id(time_s)] = time_s, self._known[key]
        return self._known[key]

    def encode(self) -> None:
        """Fill the objects."""
        for place, plain in zip(self._places, encode_all(self._columns), strict=True):
            place.update(plain)


def _clean(signals: Iterable[Signal]) -> list[Signal]:
    """Return the signals as float64 with ascending times; a recording of a real machine may have neither."""
    found = []
    known: dict[int, tuple[NDArray[np.float64], bool]] = {}
    for signal in signals:
        time = np.asarray(signal.time_s, dtype=np.float64)
        values = np.asarray(signal.values, dtype=np.float64)
        if len(time) != len(values):
            size = min(len(time), len(values))
            time, values = time[:size], values[:size]
        if id(time) not in known:
            known[id(time)] = time, bool(np.isfinite(time).all() and (np.diff(time) >= 0).all())
        if not known[id(time)][1]:
            usable = np.isfinite(time)
            time, values = time[usable], values[usable]
            order = np.argsort(time, kind="stable")
            time, values = time[order], values[order]
        found.append(Signal(signal.name, signal.unit, time, values, signal.enum))
    return found


def _panel(panel: Panel, columns: _Columns, points: int, focus: list[float]) -> JsonObject:
    traces: list[JsonObject] = []
    for signal in panel.signals:
        time_s, values = signal.time_s, signal.values
        if len(values) > points:
            index = thin(time_s, values, points, focus)
            time_s, values = time_s[index], values[index]
        traces.append(
            {
                "name": signal.name,
                "set": is_setpoint(signal.name),
                "step": is_setpoint(signal.name) and len(values) == len(signal.values),
                "t": columns.add_time(time_s),
                "y": columns.add(values),
            }
        )
    return {
        "title": panel.title,
        "unit": panel.unit,
        "on": panel.shown,
        "idle": panel.idle,
        "traces": traces,
    }


def _lane(lane: Lane) -> JsonObject:
    starts, values = bands(lane)
    used = {int(value) for value in values if value is not None}
    return {
        "name": lane.signal.name,
        "kind": lane.kind,
        "on": lane.shown,
        "idle": lane.idle,
        "s": starts,
        "y": [None if value is None else int(value) if value.is_integer() else value for value in values],
        "end": _time(float(lane.signal.time_s[-1])),
        "texts": {str(value): text for value, text in lane.signal.enum.items() if value in used},
    }


def _check(check: Check) -> JsonObject:
    since = check.since_s
    scale = _TIME_UNITS.get(check.unit)
    limited = check.low is not None or check.high is not None
    if since is None and scale and limited and check.time_s is not None and check.value is not None:
        since = check.time_s - check.value * scale
    return {
        "name": check.name,
        "sentence": check_sentence(check),
        "rule": check.rule,
        "v": check.verdict.value,
        "expected": expected_text(check),
        "observed": observed_text(check),
        "t": _time(check.time_s),
        "since": _time(since),
        "value": _finite(check.value),
        "low": _finite(check.low),
        "high": _finite(check.high),
        "unit": check.unit,
        "limits": limits(check),
        "margin": margin_text(check),
        "scale": scale,
        "signal": check.signal,
        "reqs": check.requirements,
    }


def _messages(messages: Sequence[Message], chosen: Iterable[int]) -> list[list[Json]]:
    """Return rows of time, bus, identifier, data, sender, text, error, number
    of messages left out before it.
    """
    rows: list[list[Json]] = []
    before = -1
    for index in chosen:
        message = messages[index]
        rows.append(
            [
                _time(message.time_s),
                message.bus,
                _identifier(message),
                message.data,
                message.sender,
                message.text,
                message.error,
                index - before - 1,
            ]
        )
        before = index
    return rows


def _identifier(message: Message) -> str:
    """Return what names a frame on its bus: the CAN identifier, or the Modbus unit."""
    if message.protocol != "can":
        return f"unit {message.identifier}"
    return f"{message.identifier:0{3 if message.identifier < 0x800 else 8}X}h"


def _pairs(detail: Mapping[str, Scalar]) -> list[list[str]]:
    return [
        [name, number(value) if isinstance(value, float) else code_text(name, value)]
        for name, value in detail.items()
    ]


def _end_of(case: CaseResult) -> float:
    ends = [case.simulated_s, *(step.time_s for step in case.story), *(alarm.time_s for alarm in case.alarms)]
    ends += [float(signal.time_s[-1]) for signal in case.signals if len(signal.time_s)]
    return max((end for end in ends if math.isfinite(end)), default=0.0)


def _time(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), 7)


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
