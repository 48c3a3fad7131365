"""The axis that an expectation is about, where it names none."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from hil.errors import RecordingError, name_the
from hil.record import EventSelector, Trace

_COLUMNS: Final = frozenset(
    {"actual_position", "actual_velocity", "velocity_setpoint", "status_word", "power_status", "stw1", "zsw1"}
)
"""Columns that only an axis has."""
_WORDS_OF_DRIVES: Final = frozenset({"statusword", "drive_zsw1", "drive_zsw2"})


def axis_names(trace: Trace) -> tuple[str, ...]:
    """Return the axes of a trace: as its bench has them, or what has the columns of one."""
    words = trace.vocabulary
    if words is not None and words.drives:
        return tuple(words.drives)
    return tuple(group.name for group in trace.groups if _COLUMNS & {column for column, _ in group.columns})


def drive_of(trace: Trace, axis: str) -> str:
    """Return the drive of an axis; of a trace that knows no bench the first thing that is one.

    Raises:
        RecordingError: There is none.

    """
    words = trace.vocabulary
    if words is not None and axis in words.drives:
        return words.drives[axis]
    for group in trace.groups:
        if _WORDS_OF_DRIVES & {column for column, _ in group.columns}:
            return group.name
    raise RecordingError(f"the trace does not tell which drive moves {axis}: name the drive")


def axis_about(trace: Trace, axis: str, *about: float | EventSelector | str | None) -> str:
    """Return the axis that is meant.

    Args:
        trace: The trace.
        axis: As given: an axis, the drive of one, or empty.
        *about: What the expectation is about, for a bench with several axes: events that it counts from,
            components and signals that it names. The first that belongs to an axis tells it.

    Raises:
        RecordingError: None is given, there are several, and nothing tells which.

    """
    names = axis_names(trace)
    words = trace.vocabulary
    of_drives = {} if words is None else {drive: name for name, drive in words.drives.items()}
    if axis:
        return axis if axis in names else of_drives.get(axis, axis)
    if len(names) == 1:
        return names[0]
    for component in _components(trace, about):
        if component in names:
            return component
        if component in of_drives:
            return of_drives[component]
    if not names:
        raise RecordingError("the trace holds no axis")
    raise RecordingError(name_the("axis", names))


def signal_about(trace: Trace, signal: str, *about: float | EventSelector | str | None) -> str:
    """Return the name of a signal with its component; without one it is that of the axis that is meant.

    Raises:
        RecordingError: See `axis_about`.

    """
    return signal if "." in signal else f"{axis_about(trace, '', *about)}.{signal}"


def _components(trace: Trace, about: Iterable[float | EventSelector | str | None]) -> Iterable[str]:
    for one in about:
        if isinstance(one, str):
            yield one.partition(".")[0]
        elif isinstance(one, EventSelector):
            if one.source is not None:
                yield one.source
            elif (found := one.find(trace.events)) is not None:
                yield found.source
