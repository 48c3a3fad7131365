"""From a finished case to its result: story, alarms, faults, messages, signals.
Reads the trace, runs nothing.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Final

import numpy as np

from fieldbus.history import Event
from hil.faults import ArmedFault
from hil.record import Trace, protocol_of
from reports.model import AlarmRecord, Check, FaultRecord, Message, Scalar, Signal, Step, Verdict
from reports.text import check_sentence, code_text

if TYPE_CHECKING:
    from hil.record import BusFrame

MESSAGE_WINDOW: Final = 30
"""Frames kept before and after every fault and alarm."""
_MAX_STEPS: Final = 2000
_SYNCHRONOUS: Final = 3
"""Phase of an axis that is on its function."""

USUAL_SIGNALS: Final = frozenset(
    {
        "position_setpoint", "velocity_setpoint", "set_position", "set_velocity",
        "actual_position", "actual_velocity", "following_error",
        "actual_torque", "speed_output", "status_word", "alarm_number", "state", "stw1", "zsw1",
        "position", "velocity", "torque", "controlword", "statusword", "inputs", "error_code", "load",
        "leading_position", "function_position", "sync_phase",
    }
)  # fmt: skip
"""Columns kept in the report unless a case says otherwise."""


def _plain(value: object) -> Scalar:
    if isinstance(value, np.generic):
        value = value.item()
    return value if value is None or isinstance(value, (str, int, float, bool)) else str(value)


def _detail(entry: Event) -> dict[str, Scalar]:
    return {key: _plain(value) for key, value in entry.data.items()}


def _alarm_text(entry: Event) -> str:
    text = f": {entry.data['text']}" if entry.data.get("text") else ""
    return f"Alarm {entry.data.get('number')} of {entry.source}, reaction {entry.data.get('reaction')}{text}"


def _job_text(entry: Event) -> str:
    words = {
        "job.started": "Busy",
        "job.active": "Active",
        "job.done": "Done",
        "job.aborted": "CommandAborted",
        "job.error": "Error",
        "job.in_velocity": "InVelocity",
    }
    error = entry.data.get("error_id")
    code = f" 16#{error:04X}" if isinstance(error, int) and error else ""
    return f"{entry.data.get('job')}: {words.get(entry.kind, entry.kind)}{code}"


def _code(entry: Event) -> str:
    return f"0x{int(entry.data.get('error_id') or 0):04X}"


_VERBS: Final = {
    "fault.armed": "armed",
    "fault.applied": "applied",
    "fault.removed": "removed",
    "fault.waiting": "never fired",
}


def _fault_text(entry: Event) -> str:
    verb = _VERBS.get(entry.kind, "disarmed")
    details = ", ".join(
        f"{key} {code_text(key, value)}"
        for key, value in entry.data.items()
        if key not in {"fault", "injection", "trigger"}
    )
    return f"{entry.data.get('fault')} on {entry.source} {verb}" + (f" ({details})" if details else "")


def _state_text(entry: Event) -> str:
    return f"{entry.source}: {entry.data.get('from')} -> {entry.data.get('to')}"


_TELLERS: Final[dict[str, tuple[str, Callable[[Event], str]]]] = {
    "alarm.raised": ("observe", _alarm_text),
    "alarm.detail": (
        "observe",
        lambda entry: f"Alarm {entry.data.get('number')} of {entry.source}: {entry.data.get('text')}",
    ),
    "alarm.gone": (
        "observe",
        lambda entry: f"The cause of alarm {entry.data.get('number')} of {entry.source} is gone",
    ),
    "alarm.cleared": ("observe", lambda entry: f"Alarm {entry.data.get('number')} of {entry.source} cleared"),
    "axis.error": ("observe", lambda entry: f"Error of {entry.source}: {entry.data.get('text')}"),
    "axis.feed_missing": ("observe", lambda entry: f"{entry.source} is stopped: {entry.data.get('text')}"),
    "axis.reset": ("observe", lambda entry: f"Error {_code(entry)} of {entry.source} is reset"),
    "axis.state": ("observe", _state_text),
    "command.refused": (
        "observe",
        lambda entry: f"{entry.source} refuses a command: {entry.data.get('text')}",
    ),
    "drive.state": ("observe", _state_text),
    "drive.nmt": ("observe", _state_text),
    "nmt.state": ("observe", _state_text),
    "drive.fault": (
        "observe",
        lambda entry: f"Fault of {entry.source}: {entry.data.get('text') or entry.data.get('code')}",
    ),
    "emcy.received": (
        "observe",
        lambda entry: (
            f"EMCY of {entry.data.get('name')}: {entry.data.get('code') or 0:04X}h {entry.data.get('text')}"
        ),
    ),
    "encoder.alarm": ("observe", lambda entry: f"Alarms of {entry.source}: {entry.data.get('text')}"),
    "encoder.warning": ("observe", lambda entry: f"Warnings of {entry.source}: {entry.data.get('text')}"),
    "encoder.preset": ("observe", lambda entry: f"{entry.source}: preset {entry.data.get('value')}"),
    "log.silent": (
        "observe",
        lambda entry: f"{entry.source} is not known from here on: {entry.data.get('reason')}",
    ),
    "log.heard": ("observe", lambda entry: f"{entry.source} is heard again"),
    "power.status": ("observe", lambda entry: f"{entry.source}: MC_Power.Status {entry.data.get('value')}"),
    "fault.armed": ("inject", _fault_text),
    "fault.applied": ("inject", _fault_text),
    "fault.removed": ("inject", _fault_text),
    "fault.disarmed": ("inject", _fault_text),
    "fault.waiting": ("inject", _fault_text),
}


def build_story(trace: Trace, recorded: Iterable[Step], checks: Iterable[Check]) -> list[Step]:
    """Return the steps of the case, what the log shows, and the checks, by time."""
    steps = list(recorded)
    reported_by_drive = {(entry.time_ns, entry.source) for entry in trace.select(kind="drive.nmt")}
    for entry in trace.events:
        if entry.kind == "nmt.state" and (entry.time_ns, entry.source) in reported_by_drive:
            continue  # the drive reports the same under its own kind
        if entry.kind.startswith("job."):
            steps.append(Step(entry.time_ns * 1e-9, "observe", _job_text(entry), _detail(entry)))
            continue
        teller = _TELLERS.get(entry.kind)
        if teller is not None:
            steps.append(Step(entry.time_ns * 1e-9, teller[0], teller[1](entry), _detail(entry)))
    steps.extend(
        Step(
            trace.end_s if check.time_s is None else check.time_s,
            "expect",
            check_sentence(check),
            {"expected": check.expected, "observed": check.observed},
        )
        for check in checks
        if not (check.rule and check.verdict is Verdict.PASSED)
    )
    steps.sort(key=lambda step: step.time_s)
    if len(steps) > _MAX_STEPS:
        left_out = len(steps) - _MAX_STEPS
        steps = steps[:_MAX_STEPS]
        steps.append(Step(steps[-1].time_s, "observe", f"{left_out} more steps are left out", {}))
    return steps


def build_alarms(trace: Trace) -> list[AlarmRecord]:
    """Return all alarms with the times at which their cause went and at which they were cleared."""
    records: list[AlarmRecord] = []
    pending: dict[tuple[str, Scalar], AlarmRecord] = {}
    for entry in trace.select(kind="alarm."):
        key = (entry.source, entry.data.get("number"))
        if entry.kind == "alarm.raised":
            record = AlarmRecord(
                entry.time_ns * 1e-9,
                entry.source,
                int(entry.data.get("number") or 0),
                int(entry.data.get("reaction") or 0),
                str(entry.data.get("text") or ""),
            )
            records.append(record)
            pending[key] = record
        elif entry.kind == "alarm.detail" and key in pending:
            pending[key].text = str(entry.data.get("text") or "")
        elif entry.kind == "alarm.gone" and key in pending:
            pending[key].gone_s = entry.time_ns * 1e-9
        elif entry.kind == "alarm.cleared" and key in pending:
            pending.pop(key).cleared_s = entry.time_ns * 1e-9
    return records


def build_faults(trace: Trace, armed: Iterable[ArmedFault]) -> list[FaultRecord]:
    """Return all faults as they were injected, with the state of the axis at their application."""
    changes = list(trace.select(kind="axis.state"))
    times = [entry.time_ns for entry in changes]

    def state_at(time_ns: int | None) -> str:
        if time_ns is None:
            return ""
        # What a fault causes at its own instant comes after it: the state before counts.
        index = bisect_left(times, time_ns)
        if index:
            return str(changes[index - 1].data.get("to"))
        return str(changes[0].data.get("from")) if changes else ""

    def seconds(time_ns: int | None) -> float | None:
        return None if time_ns is None else time_ns * 1e-9

    return [
        FaultRecord(
            kind=fault.fault.kind,
            target=fault.target,
            armed_s=fault.armed_ns * 1e-9,
            applied_s=seconds(fault.applied_ns),
            removed_s=seconds(fault.removed_ns),
            parameters=dict(fault.fault.parameters),
            trigger="; ".join(filter(None, (str(fault.fault.trigger), fault.waiting_summary()))),
            axis_state=state_at(fault.applied_ns),
        )
        for fault in armed
    ]


def build_messages(
    trace: Trace,
    decode: Callable[[BusFrame], str],
    window: int = MESSAGE_WINDOW,
    *,
    times_s: Iterable[float] = (),
) -> list[Message]:
    """Return the frames around faults, alarms and further times, decoded."""
    marks = [
        entry.time_ns
        for entry in trace.events
        if entry.kind in {"fault.applied", "fault.removed", "alarm.raised", "drive.fault"}
    ]
    marks += [round(time_s * 1e9) for time_s in times_s]
    if not marks or window <= 0:
        return []
    found: list[tuple[int, Message]] = []
    for bus in trace.buses:
        log = trace.raw_frames(bus)
        protocol = protocol_of(log)
        wanted: set[int] = set()
        for mark in marks:
            middle = bisect_left(log, mark, key=itemgetter(0))
            wanted.update(range(max(middle - window, 0), min(middle + window, len(log))))
        for index in sorted(wanted):
            time_ns, sender, frame, error = log[index]
            data = f"R{frame.dlc}" if frame.remote else bytes(frame.data).hex(" ").upper()
            found.append(
                (
                    time_ns,
                    Message(
                        time_ns * 1e-9,
                        bus,
                        frame.can_id,
                        data,
                        sender,
                        _decoded(decode, frame),
                        error,
                        protocol,
                    ),
                )
            )
    found.sort(key=lambda item: item[0])
    return [message for _, message in found]


def _decoded(decode: Callable[[BusFrame], str], frame: BusFrame) -> str:
    try:
        return decode(frame)
    except Exception as error:  # noqa: BLE001 - a frame that nobody can decode is still evidence
        return f"(not decoded: {error})"


def build_signals(trace: Trace, wanted: Sequence[str] = (), *, judged: Iterable[str] = ()) -> list[Signal]:
    """Return the signals for the report: the usual ones, the named ones, or with `*`
    all; and those of failed checks.
    """
    if "*" in wanted:
        return list(trace)
    if wanted:
        chosen = list(wanted)
    else:
        chosen = [name for name in trace.names() if name.partition(".")[2] in USUAL_SIGNALS]
    chosen += [name for name in judged if name in trace]
    found: list[Signal] = [trace[name] for name in dict.fromkeys(chosen)]
    return found if wanted else [*found, *_function_errors(trace)]


def _function_errors(trace: Trace) -> Iterator[Signal]:
    """Return by how much the actual position of every synchronous axis is off its function: that of the
    setpoint which it can have reached by now.
    """
    for axis in trace.components_with("function_position", "sync_phase", "actual_position"):
        phase, function, actual = (
            trace[f"{axis}.{name}"] for name in ("sync_phase", "function_position", "actual_position")
        )
        synchronous = np.round(phase.values) == _SYNCHRONOUS
        if not synchronous.any():
            continue
        then = phase.time_s - trace.constants.get(f"{axis}.delay_s", 0.0)
        place = np.searchsorted(phase.time_s, then - 1e-9)
        # Both ends of the delay have to be synchronous.
        synchronous &= synchronous[place]
        error = np.where(
            synchronous, actual.values - np.interp(then, function.time_s, function.values), np.nan
        )
        yield Signal(f"{axis}.function_error", function.unit, phase.time_s, error, {})
