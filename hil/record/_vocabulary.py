"""Names and values that can be in a recording, so that a misspelt name is an error and not a passed check."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from fieldbus.errors import ConfigurationError, similar_names
from fieldbus.history import Event, Scalar
from hil.errors import NotRecordedError, RecordingError
from hil.record._kinds import EVENT_KINDS, check_event_kind
from hil.record._select import EventSelector, kind_matches
from reports.json_types import JsonObject


class RecordedGroup(Protocol):
    """Columns of a component, recorded or still being recorded."""

    @property
    def name(self) -> str:
        """The component."""

    @property
    def columns(self) -> Sequence[tuple[str, str]]:
        """Names and units."""

    @property
    def enums(self) -> Mapping[str, Mapping[int, str]]:
        """Texts of the values of state columns, by column."""


class Recording(Protocol):
    """A trace, or the recording of a bench that still runs."""

    @property
    def events(self) -> Sequence[Event]:
        """The log so far."""

    @property
    def groups(self) -> Sequence[RecordedGroup]:
        """Recorded groups."""

    @property
    def vocabulary(self) -> Vocabulary | None:
        """Names and values that can be in it; None if they are not known."""


_JOB: Final = ("job", "instruction", "error_id")
EVENT_DETAILS: Final[Mapping[str, tuple[str, ...]]] = {
    "alarm.acknowledged": ("pending", "cleared"),
    "alarm.cleared": ("number",),
    "alarm.detail": ("number", "text"),
    "alarm.gone": ("number",),
    "alarm.raised": ("number", "reaction", "alarm_class", "info", "text"),
    "axis.error": ("error_id", "text"),
    "axis.feed_missing": ("error_id", "text"),
    "axis.homed": ("mode", "offset", "position"),
    "axis.follows": (
        "job",
        "leader",
        "coupling",
        "numerator",
        "denominator",
        "updated",
        "master",
        "slave",
        "cam",
        "mode",
        "master_scaling",
        "slave_scaling",
    ),
    "axis.position_set": ("offset",),
    "axis.reset": ("error_id",),
    "axis.state": ("from", "to"),
    "axis.torque_limit": ("active", "limit"),
    "axis.torque_range": ("active", "upper", "lower"),
    "cam.interpolated": ("start", "end", "function"),
    "command.refused": ("error_id", "text"),
    "controller.state": ("from", "to", "reason"),
    "drive.fault": ("code", "number", "persistent", "text"),
    "drive.inputs": ("inputs",),
    "drive.nmt": ("from", "to"),
    "drive.outputs": ("outputs",),
    "drive.state": ("from", "to", "transition"),
    "drive.warning": ("warnings", "text"),
    "emcy.cleared": ("code", "register"),
    "emcy.raised": ("code", "register", "data"),
    "emcy.received": ("node", "name", "code", "register", "text"),
    "homing.phase": ("phase", "direction"),
    "job.aborted": _JOB,
    "job.active": _JOB,
    "job.done": _JOB,
    "job.error": _JOB,
    "job.synchronous": _JOB,
    "job.in_velocity": _JOB,
    "job.leaves_velocity": _JOB,
    "job.started": (
        *_JOB,
        "mode",
        "velocity",
        "acceleration",
        "deceleration",
        "jerk",
        "position",
        "direction",
        "distance",
    ),
    "log.heard": ("values", "about"),
    "log.silent": ("reason", "values", "about"),
    "nmt.state": ("from", "to"),
    "power.disable": ("stop_mode",),
    "power.status": ("value",),
    "program.write": ("variable", "value", "in_runtime_unit", "start"),
}
"""Details of the kinds that always have the same ones; a source leaves out those that it does not know."""

_NMT: Final = frozenset({"drive.nmt", "nmt.state"})
_STATES: Final = frozenset({"from", "to"})


@dataclass(frozen=True)
class Vocabulary:
    """Names and values that a recording can hold; made by the bench, and kept with the trace."""

    components: tuple[str, ...]
    """Everything that can be the source of an event."""
    values: Mapping[str, tuple[Scalar, ...]] = field(default_factory=dict)
    """Values of a detail, by `kind:detail`, the kind also as a family: `job.:job`, `controller.state:to`."""
    declared: tuple[str, ...] = ()
    """Kinds of events of user-defined parts."""
    kinds: tuple[str, ...] = ()
    """Kinds, or families with a trailing dot, that this recording can hold; none: every one."""
    absent: tuple[str, ...] = ()
    """Signals of the bench that this recording cannot hold."""
    relative: tuple[str, ...] = ()
    """Signals whose zero is not known: only their displacement counts."""
    origin: str = "a bench"
    """What was recorded, for messages."""
    drives: Mapping[str, str] = field(default_factory=dict)
    """Axes and the drives that move them."""

    def as_dict(self) -> JsonObject:
        """Return plain values; `from_dict` reads them back."""
        return {
            "components": list(self.components),
            "values": {key: list(values) for key, values in self.values.items()},
            "declared": list(self.declared),
            "kinds": list(self.kinds),
            "absent": list(self.absent),
            "relative": list(self.relative),
            "origin": self.origin,
            "drives": dict(self.drives),
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Vocabulary:
        """Build it from what `as_dict` gave."""
        return cls(
            tuple(content["components"]),
            {key: tuple(values) for key, values in content["values"].items()},
            tuple(content["declared"]),
            tuple(content["kinds"]),
            tuple(content["absent"]),
            tuple(content.get("relative", ())),
            content["origin"],
            dict(content.get("drives", {})),
        )


def check_selector(trace: Recording, selector: EventSelector) -> None:
    """Refuse to look for an event that cannot be in this trace.

    Kinds and details are known for every trace; components, jobs and other values
    for those that a bench has made.

    Raises:
        RecordingError: There is no such kind, component, detail, state, job or other value; the message lists
            those that exist.
        NotRecordedError: It exists, but this sort of recording does not hold it.

    """
    kind = selector.kind
    alike = [entry for entry in trace.events if kind_matches(kind, entry.kind)]
    _check_kind(trace, kind, alike)
    if selector.source is not None:
        check_component(trace, selector.source, f"event {kind}")
    _check_details(kind, selector.data, alike)
    for key, value in selector.data.items():
        known = _known_values(trace, kind, key, selector.source, alike)
        if known and value not in known:
            raise RecordingError(f"event {kind}: no {key} {value!r}; there is: {_near(value, known)}")


def check_component(trace: Recording, name: str, where: str) -> None:
    """Refuse the name of a component that the bench of this trace does not have.

    Raises:
        RecordingError: There is none; the message lists the known ones.

    """
    if trace.vocabulary is None or name in trace.vocabulary.components:
        return
    if any(entry.source == name for entry in trace.events) or any(g.name == name for g in trace.groups):
        return
    raise RecordingError(
        f"{where}: no component {name!r}; there is: {', '.join(trace.vocabulary.components)}"
    )


def check_state(trace: Recording, component: str, text: str, kind: str = "") -> None:
    """Refuse a component, or a state that none of its state machines has.

    Raises:
        RecordingError: There is none; the message lists the known ones.

    """
    check_component(trace, component, f"state of {component}")
    alike = [
        entry
        for entry in trace.events
        if entry.source == component and (entry.kind == kind if kind else _tells_state(entry.kind))
    ]
    if kind:
        _check_kind(trace, kind, alike)
    known = _state_texts(trace, kind, component, alike)
    if known and text not in known:
        raise RecordingError(f"{component} has no state {text!r}; it has: {_near(text, known)}")


def _check_kind(trace: Recording, kind: str, alike: list[Event]) -> None:
    if alike:
        return
    vocabulary = trace.vocabulary
    declared = () if vocabulary is None else vocabulary.declared
    seen = {entry.kind for entry in trace.events}
    try:
        check_event_kind("event kind", kind, others=seen.union(declared))
    except ConfigurationError as error:
        raise RecordingError(str(error)) from None
    if vocabulary is None or not vocabulary.kinds or kind in declared:
        return
    if not any(kind_matches(one, kind) or kind_matches(kind, one) for one in vocabulary.kinds):
        raise NotRecordedError(
            f"{vocabulary.origin} does not hold {kind}; it holds: {', '.join(vocabulary.kinds)}"
        )


def _check_details(kind: str, details: Mapping[str, Scalar], alike: list[Event]) -> None:
    kinds = [one for one in EVENT_KINDS if kind_matches(kind, one)]
    if not kinds or any(one not in EVENT_DETAILS for one in kinds):
        return
    known = {key for one in kinds for key in EVENT_DETAILS[one]}.union(*(entry.data for entry in alike))
    for key in details:
        if key not in known:
            raise RecordingError(
                f"event {kind}: no detail {key!r}; it has: {', '.join(sorted(known))} (the n-th event is "
                f"nth=n)"
            )


def _known_values(
    trace: Recording, kind: str, detail: str, source: str | None, alike: Iterable[Event]
) -> tuple[Scalar, ...]:
    """Return the known values of a detail; none if every value is possible."""
    vocabulary = trace.vocabulary
    if vocabulary is None:
        return ()
    if detail in _STATES and (_tells_state(kind) or kind == "drive.nmt"):
        return _state_texts(trace, kind, source, alike)
    known: dict[Scalar, None] = {}
    for key, values in vocabulary.values.items():
        family, _, name = key.partition(":")
        if name == detail and kind_matches(family, kind):
            known.update(dict.fromkeys(values))
    if known:
        known.update(dict.fromkeys(entry.data[detail] for entry in alike if detail in entry.data))
    return tuple(known)


def _tells_state(kind: str) -> bool:
    return kind.endswith(".state")


def _state_texts(
    trace: Recording, kind: str, component: str | None, alike: Iterable[Event]
) -> tuple[Scalar, ...]:
    """Return the texts of state machines: from the columns of their components, or from the bench."""
    vocabulary = trace.vocabulary
    if vocabulary is None:
        return ()
    if kind in _NMT:
        columns: tuple[str, ...] = ("nmt_state",)
    else:
        columns = ("state",) if kind else ("state", "nmt_state")
    known: dict[Scalar, None] = {}
    for key, values in vocabulary.values.items():
        owner, _, name = key.partition(":")
        if name == "to" and (owner == kind or (component == owner.split(".")[0] and not kind)):
            known.update(dict.fromkeys(values))
    groups = () if known else trace.groups
    for group in groups:
        is_axis = any(column == "alarm_number" for column, _ in group.columns)
        if component == group.name or (component is None and is_axis == kind.startswith("axis.")):
            for column in columns:
                known.update(dict.fromkeys(group.enums.get(column, {}).values()))
    if not known:
        return ()
    for entry in alike:
        known.update(dict.fromkeys(entry.data[key] for key in ("from", "to") if key in entry.data))
    return tuple(known)


def similar_signals(name: str, known: Iterable[str]) -> str:
    """Return what to add to a message about a signal that does not exist: `; similar: drive1.torque`."""
    near = similar_names(name, known)
    return f"; {near}" if near else ""


def _near(value: Scalar, known: Iterable[Scalar]) -> str:
    """Return the known values, only the nearest ones if there are many."""
    texts = [str(one) for one in known]
    if len(texts) > 24:
        texts = difflib.get_close_matches(str(value), texts, n=8, cutoff=0.4) or texts[:8]
        return f"{', '.join(texts)}, ..."
    return ", ".join(texts)
