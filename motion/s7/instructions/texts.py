"""How an instance of an instruction stands, in words, for messages about jobs that end otherwise."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.s7.alarms import error_text
from motion.s7.axis.jobs import ERROR_ALARM

if TYPE_CHECKING:
    from collections.abc import Iterable

    from fieldbus.history import Event, History

_ENDS: Final = ("job.done", "job.aborted", "job.error")


def instance_text(name: str, axis: str) -> str:
    """Return an instance with its object: `MC_Home_1 of z`."""
    return f"{name.removeprefix(f'{axis}.')} of {axis}"


def error_id_text(error_id: int, alarms: Iterable[int]) -> str:
    """Return an ErrorID with its cause: `16#8001: alarm 521`, or with its text.

    Args:
        error_id: The ErrorID.
        alarms: Alarms that can be the cause of 16#8001.

    """
    numbers = list(alarms)
    if error_id == ERROR_ALARM and numbers:
        return f"16#{error_id:04X}: alarm {', '.join(map(str, numbers))}"
    return error_text(error_id)


def ended_text(history: History | None, name: str, axis: str, error_id: int) -> str:
    """Return how the job of an instance ended, with cause and time: `ended with
    16#8001: alarm 521 at 0.378 s`.

    Args:
        history: Event log, or None.
        name: Name of the instance.
        axis: Name of its object.
        error_id: ErrorID that it shows; 0 without an error.

    """
    end = _last(history, name, _ENDS)
    at = "" if end is None else f" at {end.time_ns * 1e-9:.3f} s"
    if error_id:
        alarms = [] if history is None or end is None else _alarms_until(history, axis, end.time_ns)
        return f"ended with {error_id_text(error_id, alarms)}{at}"
    if end is not None and end.kind == "job.aborted":
        return f"was aborted{at}{_by(history, axis, end)}"
    return f"was done{at}"


def begun_text(history: History | None, name: str) -> str:
    """Return since when the job of an instance is busy: `is busy since 0.200 s`."""
    begin = _last(history, name, ("job.started",))
    return "is busy" + ("" if begin is None else f" since {begin.time_ns * 1e-9:.3f} s")


def _last(history: History | None, name: str, kinds: tuple[str, ...]) -> Event | None:
    for entry in reversed(history.events if history is not None else ()):
        if entry.kind in kinds and entry.data.get("job") == name:
            return entry
    return None


def _by(history: History | None, axis: str, end: Event) -> str:
    """Return which other job of the axis began when this one was aborted."""
    for entry in history.events if history is not None else ():
        begins = entry.kind == "job.started" and entry.time_ns == end.time_ns and entry.source == axis
        if begins and entry.data.get("job") != end.data.get("job"):
            return f" by {str(entry.data.get('job')).removeprefix(f'{axis}.')}"
    return ""


def _alarms_until(history: History, axis: str, time_ns: int) -> list[int]:
    """Return the alarms with a reaction that an object had at a time."""
    pending: dict[int, None] = {}
    for entry in history.events:
        if entry.time_ns > time_ns:
            break
        if entry.source != axis or not entry.kind.startswith("alarm."):
            continue
        number = int(entry.data.get("number") or 0)
        if entry.kind == "alarm.raised" and entry.data.get("reaction"):
            pending[number] = None
        elif entry.kind == "alarm.cleared":
            pending.pop(number, None)
    return list(pending)
