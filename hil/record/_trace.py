"""The trace: everything a bench recorded, immutable, comparable, with a digest."""

from __future__ import annotations

import hashlib
import json
import zipfile
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from heapq import merge
from itertools import islice
from operator import itemgetter
from pathlib import Path
from struct import Struct
from typing import Any, Final, NamedTuple, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from fieldbus.can.frame import CanFrame
from fieldbus.growing_log import GrowingLog, LogPart
from fieldbus.history import Event, Scalar
from hil.errors import NotRecordedError, RecordingError
from hil.record._frames import BusFrame, Entry, FrameColumns, FrameLog, PackedFrames, canonical_frames
from hil.record._select import EventSelector, kind_matches
from hil.record._signal import Signal
from hil.record._spool import new_array
from hil.record._vocabulary import Vocabulary, similar_signals

_T = TypeVar("_T")
_Timed = TypeVar("_Timed", bound=tuple[Any, ...])
"""An entry that begins with its time in ns."""
_TIME: Final = Struct("<q").pack
_FRAME_HEAD: Final = Struct("<IBBB").pack
_OTHER_HEAD: Final = Struct("<qIH").pack
STATES: Final = "states"
"""What a silence in a log is about where values came, but no status word."""
_FORMAT: Final = 1
"""Of the files of a saved trace."""


class TraceFrame(NamedTuple):
    """One frame on a bus."""

    time_ns: int
    bus: str
    sender: str
    can_id: int
    data: bytes
    extended: bool
    remote: bool
    dlc: int
    error: str
    """Empty, or what went wrong with the frame."""
    protocol: str = "can"
    """`can`, `modbus_tcp` or `modbus_rtu`; over Modbus `can_id` is the unit."""
    note: str = ""
    """Over Modbus TCP: a connection that opens or closes; such an entry has no data."""
    fd: bool = False
    """Frame of CAN FD."""
    brs: bool = False
    """Its data phase has the data bit rate."""
    esi: bool = False
    """Its sender is error-passive."""

    def canonical(self) -> bytes:
        """Return the bytes that enter the digest."""
        if self.protocol != "can":
            head = _OTHER_HEAD(self.time_ns, self.can_id, len(self.data))
            return (
                head
                + self.data
                + f"{self.protocol}\0{self.bus}\0{self.sender}\0{self.error}\0{self.note}\0".encode()
            )
        return _TIME(self.time_ns) + _can_body(self, self.data, f"{self.bus}\0{self.sender}\0{self.error}\0")


def _can_body(frame: BusFrame | TraceFrame, data: bytes, tail: str) -> bytes:
    """Return what enters the digest of a CAN frame behind its time."""
    flags = _flags(frame)
    return _FRAME_HEAD(frame.can_id, flags, frame.dlc, len(data)) + data + tail.encode()


def _flags(frame: BusFrame | TraceFrame) -> int:
    """Return what else there is to say of a frame, in a number: 29 bits, remote, CAN FD with BRS and ESI."""
    flags = bool(frame.extended) | bool(frame.remote) << 1
    return (
        flags | 4 | frame.brs << 3 | frame.esi << 4
        if isinstance(frame, CanFrame | TraceFrame) and frame.fd
        else flags
    )


def _can_log(bus: str, log: FrameLog) -> Iterator[tuple[int, bytes]]:
    """Return time and canonical bytes of the frames of a CAN segment.

    The bytes after the time are made once for a frame that is sent many times,
    such as one without acknowledge.
    """
    if not isinstance(log, tuple):
        # On disk: frames are made when they are read, equal ones are not the same object.
        for time_ns, sender, packed, error in log:
            yield time_ns, _TIME(time_ns) + _can_body(packed, packed.data, f"{bus}\0{sender}\0{error}\0")
        return
    bodies: dict[tuple[int, str, str], bytes] = {}
    for time_ns, sender, frame, error in log:
        key = (id(frame), sender, error)
        body = bodies.get(key)
        if body is None:
            body = bodies[key] = _can_body(frame, bytes(frame.data), f"{bus}\0{sender}\0{error}\0")
        yield time_ns, _TIME(time_ns) + body


def protocol_of(log: FrameLog) -> str:
    """Return what the frames of a bus are: `can`, `modbus_tcp` or `modbus_rtu`."""
    if isinstance(log, PackedFrames):
        return "can"
    frame = log[0][2] if log else None
    return "can" if frame is None or isinstance(frame, CanFrame) else frame.protocol


class TraceGroup(NamedTuple):
    """The rows of one recorder group."""

    name: str
    columns: tuple[tuple[str, str], ...]
    enums: Mapping[str, Mapping[int, str]]
    time_ns: NDArray[np.int64]
    values: NDArray[np.float64]
    """Rows by columns."""

    @classmethod
    def from_bytes(
        cls,
        name: str,
        columns: tuple[tuple[str, str], ...],
        enums: Mapping[str, Mapping[int, str]],
        content: bytes,
    ) -> Self:
        """Unpack what `Group.content` packed."""
        width = 1 + len(columns)
        raw = np.frombuffer(content, dtype="<i8").reshape(-1, width)
        times = raw[:, 0].astype(np.int64)
        values = np.frombuffer(content, dtype="<f8").reshape(-1, width)[:, 1:].astype(np.float64)
        # One bit pattern for every not-a-number, so that the digest does not depend on how it came about.
        values[np.isnan(values)] = np.nan
        times.flags.writeable = False
        values.flags.writeable = False
        return cls(name, columns, {column: dict(texts) for column, texts in enums.items()}, times, values)


def _span(silent: Event, heard_ns: int) -> tuple[float, float, str]:
    return silent.time_ns * 1e-9, heard_ns * 1e-9, f"{silent.source}: {silent.data.get('reason', '')}"


def _plain(value: object) -> object:
    """Turn NumPy scalars in event data into Python numbers."""
    if isinstance(value, np.generic):
        number: object = value.item()
        return number
    raise TypeError(f"{value!r} is no scalar")


_EVENT_JSON: Final = json.JSONEncoder(sort_keys=True, separators=(",", ":"), default=_plain)


def event_json(entry: Event) -> str:
    """Return an event as canonical JSON: fixed key order, no blanks, shortest floats."""
    return _EVENT_JSON.encode([entry.time_ns, entry.source, entry.kind, entry.data])


class Trace:
    """An immutable view of a run: signals by name, events, frames.

    Args:
        groups: Recorded groups.
        events: Event log, in order.
        frames: Frame logs by bus: (time_ns, sender, CanFrame, error).
        constants: Facts of the bench for judges of the trace.
        end_ns: Time at which the trace was taken.
        vocabulary: Names and values that can be in it; None if they are not known.
        looked_at: Names of the signals that somebody has asked for, in this or another trace of the same run;
            this one adds to them.

    """

    def __init__(
        self,
        groups: Iterable[TraceGroup],
        *,
        events: Sequence[Event] = (),
        frames: Mapping[str, FrameLog] | None = None,
        constants: Mapping[str, float] | None = None,
        end_ns: int = 0,
        vocabulary: Vocabulary | None = None,
        looked_at: set[str] | None = None,
    ) -> None:
        self._groups = {group.name: group for group in groups}
        self.events: Sequence[Event] = _copied(events)
        self._raw_frames: dict[str, FrameLog] = {bus: _copied(log) for bus, log in (frames or {}).items()}
        self._frames: tuple[TraceFrame, ...] | None = None
        self._signals: dict[str, Signal] = {}
        self._times: dict[str, NDArray[np.float64]] = {}
        self._digest = ""
        self._by_kind: dict[str, list[tuple[int, Event]]] = {}
        """The events with their numbers; empty until somebody asks, and for a long log."""
        self._selected: dict[tuple[str | None, str | None], tuple[Event, ...]] = {}
        self._columns: dict[str, frozenset[str]] = {}
        self._once: dict[Hashable, object] = {}
        self.constants: dict[str, float] = dict(constants or {})
        self.end_ns = end_ns
        self.vocabulary = vocabulary
        self.looked_at: set[str] = set() if looked_at is None else looked_at

    def __getitem__(self, name: str) -> Signal:
        """Return the signal `component.column`.

        Raises:
            RecordingError: It was not recorded; the message lists what was.
            NotRecordedError: There is such a signal, but a recording like this one does not hold it.

        """
        signal = self._signals.get(name)
        if signal is not None:
            return signal
        component, _, column = name.partition(".")
        group = self._groups.get(component)
        if group is not None:
            for index, (own, unit) in enumerate(group.columns):
                if own == column:
                    enum = dict(group.enums.get(column, {}))
                    time_s = self._times_of(group)
                    values = group.values[:, index]
                    if self.from_log:
                        # What had not come yet, or was of long ago, is no sample.
                        known = ~np.isnan(values)
                        for silent_s, heard_s, _ in self.silences(component, states=False):
                            known &= (time_s <= silent_s) | (time_s >= heard_s)
                        time_s, values = _chosen(time_s, known), _chosen(values, known)
                    signal = Signal(name, unit, time_s, values, enum)
                    self._signals[name] = signal
                    self.looked_at.add(name)
                    return signal
        if self.vocabulary is not None and name in self.vocabulary.absent:
            raise NotRecordedError(f"{self.vocabulary.origin} does not hold the signal {name}")
        known_names = [n for n in self.names() if group is None or n.startswith(component + ".")]
        if group is None and known_names:
            components = ", ".join(dict.fromkeys(n.partition(".")[0] for n in known_names))
            similar = similar_signals(name, known_names)
            raise RecordingError(f"no signal {name!r} was recorded; there is: {components}{similar}")
        similar = similar_signals(name, known_names)
        every = ", ".join(known_names) or "none"
        raise RecordingError(f"no signal {name!r} was recorded{similar}; recorded are: {every}")

    def _times_of(self, group: TraceGroup) -> NDArray[np.float64]:
        """Return the times of a group in s, once for all its signals."""
        found = self._times.get(group.name)
        if found is None:
            rows = len(group.time_ns)
            found = self._times[group.name] = new_array(rows, 1)[:, 0]
            for first in range(0, rows, _PART):
                found[first : first + _PART] = group.time_ns[first : first + _PART] * 1e-9
        return found

    def __contains__(self, name: object) -> bool:
        if not isinstance(name, str):
            return False
        component, _, column = name.partition(".")
        group = self._groups.get(component)
        return group is not None and any(known == column for known, _ in group.columns)

    def __iter__(self) -> Iterator[Signal]:
        return (self[name] for name in self.names())

    @property
    def from_log(self) -> bool:
        """Whether it was read from the log of another tool, which holds bus
        frames only and may end anywhere.
        """
        return self.vocabulary is not None and bool(self.vocabulary.kinds)

    def silences(
        self, component: str, *, values: bool = True, states: bool = True
    ) -> list[tuple[float, float, str]]:
        """Return when a component (empty: any) was silent in a log: begin and end (s), component and reason;
        never on a bench.

        With `values` also when it sent no process data, but other frames; with `states` also when it sent
        values, but no status word.
        """
        if not self.from_log:
            return []
        found: list[tuple[float, float, str]] = []
        begun: dict[tuple[str, Scalar, Scalar], Event] = {}
        for entry in self.select(source=component or None, kind="log."):
            # What is about one kind of frame ends by itself, whatever else is heard of the node.
            key = (entry.source, entry.data["values"], entry.data.get("about", ""))
            if entry.data["values"] and not values:
                continue
            if entry.data.get("about") == STATES and not states:
                continue
            if entry.kind == "log.silent":
                begun.setdefault(key, entry)
            elif key in begun:
                found.append(_span(begun.pop(key), entry.time_ns))
        return sorted([*found, *(_span(entry, self.end_ns) for entry in begun.values())])

    @property
    def end_s(self) -> float:
        """Time at which the trace was taken, s."""
        return self.end_ns * 1e-9

    @property
    def groups(self) -> tuple[TraceGroup, ...]:
        """The recorded groups in the order in which they were added."""
        return tuple(self._groups.values())

    def names(self) -> list[str]:
        """Return the names of all signals."""
        return [f"{group.name}.{column}" for group in self._groups.values() for column, _ in group.columns]

    def components_with(self, *columns: str) -> list[str]:
        """Return the components that have all these columns, which distinguish axes from drives."""
        if not self._columns:
            self._columns = {
                name: frozenset(column for column, _ in group.columns) for name, group in self._groups.items()
            }
        return [name for name, known in self._columns.items() if known.issuperset(columns)]

    def once(self, key: Hashable, compute: Callable[[], _T]) -> _T:
        """Return what several judges of the trace need, computed for the first that asks.

        Args:
            key: Of what it is.
            compute: Makes it; nobody may change it afterwards.

        """
        if key not in self._once:
            self._once[key] = compute()
        return cast("_T", self._once[key])

    @property
    def frames(self) -> tuple[TraceFrame, ...]:
        """All frames of all buses, by time; of a long recording take `iter_frames`."""
        if self._frames is None:
            self._frames = tuple(self.iter_frames())
        return self._frames

    def _frames_of(self, bus: str) -> Iterator[TraceFrame]:
        log = self._raw_frames[bus]
        protocol = protocol_of(log)
        for time_ns, sender, frame, error in log:
            can = frame if isinstance(frame, CanFrame) else None
            yield TraceFrame(
                time_ns,
                bus,
                sender,
                frame.can_id,
                bytes(frame.data),
                bool(frame.extended),
                bool(frame.remote),
                frame.dlc,
                error,
                protocol,
                "" if isinstance(frame, CanFrame) else frame.note,
                fd=can is not None and can.fd,
                brs=can is not None and can.brs,
                esi=can is not None and can.esi,
            )

    def raw_frames(self, bus: str) -> FrameLog:
        """Return the frame log of a bus as the segment kept it."""
        return self._raw_frames.get(bus, ())

    def raw_by_time(self) -> Iterator[tuple[int, str, str, BusFrame, str]]:
        """Return the frames of all buses one by one, by time: time (ns), bus, sender, frame, error."""

        def named(bus: str) -> Iterator[tuple[int, str, str, BusFrame, str]]:
            return ((entry[0], bus, *entry[1:]) for entry in self._raw_frames[bus])

        return self._by_time([named(bus) for bus in self._raw_frames])

    def can_log(self, bus: str) -> Sequence[Entry]:
        """Return the frames of a CAN bus: time (ns), sender, frame, error; of another bus none."""
        log = self.raw_frames(bus)
        return cast("Sequence[Entry]", log) if protocol_of(log) == "can" else ()

    @property
    def can_buses(self) -> list[str]:
        """Names of the recorded CAN buses."""
        return [bus for bus, log in self._raw_frames.items() if protocol_of(log) == "can"]

    @property
    def buses(self) -> list[str]:
        """Names of the recorded buses."""
        return list(self._raw_frames)

    def select(self, *, source: str | None = None, kind: str | None = None) -> Iterator[Event]:
        """Return events of a source and of a kind (a trailing dot selects a family)."""
        if not isinstance(self.events, tuple):  # a long log stays on disk
            return (
                entry
                for entry in self.events
                if (source is None or entry.source == source)
                and (kind is None or kind_matches(kind, entry.kind))
            )
        found = self._selected.get((source, kind))
        if found is None:
            found = self._selected[source, kind] = self._select(source, kind)
        return iter(found)

    def _select(self, source: str | None, kind: str | None) -> tuple[Event, ...]:
        """Return some of the events in memory; twenty rules ask for twenty kinds each."""
        if kind is None:
            return tuple(entry for entry in self.events if source is None or entry.source == source)
        if not self._by_kind:
            for numbered in enumerate(self.events):
                self._by_kind.setdefault(numbered[1].kind, []).append(numbered)
        if not kind.endswith("."):
            some = self._by_kind.get(kind, ())
        else:
            families = (found for one, found in self._by_kind.items() if kind_matches(kind, one))
            some = sorted((one for found in families for one in found), key=itemgetter(0))
        return tuple(entry for _, entry in some if source is None or entry.source == source)

    def instant(self, reference: float | EventSelector) -> float | None:
        """Return a reference instant in seconds; None when its event did not happen."""
        if isinstance(reference, EventSelector):
            entry = reference.find(self.events)
            return None if entry is None else entry.time_ns * 1e-9 + reference.offset_s
        return float(reference)

    def window(self, start_s: float, end_s: float, *, events: Sequence[Event] | None = None) -> Trace:
        """Return what lies between two times, both included; times keep their origin.

        Args:
            start_s: Begin, s.
            end_s: End, s.
            events: The events of the result; None: those between the two times.

        """
        start, end = round(start_s * 1e9), round(min(end_s, 9e9) * 1e9)
        groups = []
        for group in self._groups.values():
            first = int(np.searchsorted(group.time_ns, start, side="left"))
            last = int(np.searchsorted(group.time_ns, end, side="right"))
            groups.append(group._replace(time_ns=group.time_ns[first:last], values=group.values[first:last]))
        return Trace(
            groups,
            events=(
                [entry for entry in self.events if start <= entry.time_ns <= end]
                if events is None
                else events
            ),
            frames={bus: _between(log, start, end) for bus, log in self._raw_frames.items()},
            constants=self.constants,
            end_ns=min(self.end_ns, end),
            vocabulary=self.vocabulary,
            looked_at=self.looked_at,
        )

    def without_frames(self) -> Trace:
        """Return signals and events alone."""
        return Trace(
            self.groups,
            events=self.events,
            constants=self.constants,
            end_ns=self.end_ns,
            vocabulary=self.vocabulary,
            looked_at=self.looked_at,
        )

    def digest(self) -> str:
        """Return the SHA-256 of the canonical content, hexadecimal: columns, samples, events, frames."""
        if not self._digest:
            sha = hashlib.sha256()
            for group in self._groups.values():
                sha.update(json.dumps([group.name, group.columns], separators=(",", ":")).encode())
                # In parts, so that a long log is not copied for it.
                for first in range(0, len(group.time_ns), _PART):
                    sha.update(group.time_ns[first : first + _PART].astype("<i8").tobytes())
                for first in range(0, len(group.time_ns), _PART):
                    part = group.values[first : first + _PART]
                    sha.update(np.ascontiguousarray(part, dtype="<f8").tobytes())
            for entry in self.events:
                sha.update(event_json(entry).encode())
                sha.update(b"\n")
            frames = self._canonical_frames()
            # In parts, so that a log of millions of frames is not unpacked for it.
            while some := b"".join(islice(frames, _PART)):
                sha.update(some)
            self._digest = sha.hexdigest()
        return self._digest

    def _canonical_frames(self) -> Iterator[bytes]:
        """Return the bytes of all frames of all buses, by time, as of `TraceFrame.canonical`."""
        packed = self._packed_columns()
        if packed is not None:
            return iter((canonical_frames(packed),))
        logs = [
            _can_log(bus, log)
            if protocol_of(log) == "can"
            else ((frame.time_ns, frame.canonical()) for frame in self._frames_of(bus))
            for bus, log in self._raw_frames.items()
        ]
        return (content for _time_ns, content in self._by_time(logs))

    def _packed_columns(self) -> list[tuple[str, FrameColumns]] | None:
        """Return the frames of all buses as columns; None: they are not packed, or too many for one piece."""
        found: list[tuple[str, FrameColumns]] = []
        for bus, log in self._raw_frames.items():
            columns = log.columns() if isinstance(log, PackedFrames) and len(log) <= _PART else None
            if columns is None:
                return None
            found.append((bus, columns))
        return found or None

    def iter_frames(self) -> Iterator[TraceFrame]:
        """Return all frames of all buses, by time, one after the other: those of a long recording do not have
        to be in memory at once.
        """
        return self._by_time([self._frames_of(bus) for bus in self._raw_frames])

    def _by_time(self, logs: Sequence[Iterator[_Timed]]) -> Iterator[_Timed]:
        """Return the entries of all buses by time; at the same time in the order of the buses."""
        if len(logs) == 1:
            return logs[0]
        if all(isinstance(log, tuple) for log in self._raw_frames.values()):
            return iter(sorted((entry for log in logs for entry in log), key=itemgetter(0)))
        return merge(*logs, key=itemgetter(0))

    def save(self, path: str | Path) -> tuple[Path, Path]:
        """Write `<path>.npz` (columns) and `<path>.json` (everything else), for `load`; returns both."""
        archive, document = _files(Path(path))
        arrays: dict[str, NDArray[np.int64] | NDArray[np.float64]] = {}
        groups: list[dict[str, object]] = []
        for index, group in enumerate(self._groups.values()):
            arrays[f"t{index}"] = group.time_ns
            arrays[f"v{index}"] = group.values
            enums = {
                column: {str(value): text for value, text in texts.items()}
                for column, texts in group.enums.items()
            }
            groups.append({"name": group.name, "columns": group.columns, "enums": enums})
        head = {
            "format": _FORMAT,
            "end_ns": self.end_ns,
            "digest": self.digest(),
            "constants": self.constants,
            "groups": groups,
        }
        archive.parent.mkdir(parents=True, exist_ok=True)
        with archive.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **arrays)
        with document.open("w", encoding="utf-8") as text:
            text.writelines(self._document(head))
        return archive, document

    def _document(self, head: dict[str, object]) -> Iterator[str]:
        """Return the JSON of a saved trace piece by piece."""
        encode = json.JSONEncoder(separators=(",", ":"), default=_plain).encode

        def listed(entries: Iterator[list[object]]) -> Iterator[str]:
            before = "["
            while part := list(islice(entries, _PART)):
                yield before + encode(part)[1:-1]
                before = ","
            yield "[]" if before == "[" else "]"

        yield encode(head)[:-1] + ',"events":'
        yield from listed(list(entry) for entry in self.events)
        yield ',"frames":{'
        for number, (bus, log) in enumerate(self._raw_frames.items()):
            yield f"{',' if number else ''}{encode(bus)}:"
            yield from listed(_row_of(*entry) for entry in log)
        vocabulary = None if self.vocabulary is None else self.vocabulary.as_dict()
        yield f'}},"vocabulary":{encode(vocabulary)}}}'

    @classmethod
    def load(cls, path: str | Path) -> Trace:
        """Read a saved trace.

        Raises:
            RecordingError: The files are missing, damaged, or do not belong together.

        """
        archive, document = _files(Path(path))
        try:
            content = json.loads(document.read_text(encoding="utf-8"))
            if content.get("format") != _FORMAT:
                raise RecordingError(f"{document}: format {content.get('format')!r} is not {_FORMAT}")
            with np.load(archive, allow_pickle=False) as arrays:
                groups = [
                    _group_of(entry, arrays[f"t{index}"], arrays[f"v{index}"])
                    for index, entry in enumerate(content["groups"])
                ]
            vocabulary = content.get("vocabulary")
            trace = cls(
                groups,
                events=[Event(*entry) for entry in content["events"]],
                frames={bus: [_entry_of(row) for row in log] for bus, log in content["frames"].items()},
                constants=content["constants"],
                end_ns=content["end_ns"],
                vocabulary=Vocabulary.from_dict(vocabulary) if vocabulary else None,
            )
        except (OSError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile) as error:
            raise RecordingError(f"no readable trace at {document} and {archive.name}: {error}") from error
        if trace.digest() != content["digest"]:
            raise RecordingError(f"{document} and {archive.name} do not belong together: the digest differs")
        return trace


_PART: Final = 65_536


def _between(log: FrameLog, start_ns: int, end_ns: int) -> FrameLog:
    """Return the frames between two times, both included; of a log on disk without reading them."""
    if isinstance(log, tuple):
        return [entry for entry in log if start_ns <= entry[0] <= end_ns]
    first = bisect_left(log, start_ns, key=itemgetter(0))
    return LogPart(log, first, bisect_right(log, end_ns, key=itemgetter(0)))


def _copied(log: Sequence[_T]) -> Sequence[_T]:
    """Return a log that does not change any more; what is on disk stays there."""
    if isinstance(log, GrowingLog):
        return log.copy()
    if isinstance(log, PackedFrames | LogPart):
        return cast("Sequence[_T]", log)
    return tuple(log)


def _chosen(values: NDArray[np.float64], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the values of which something is known: a part of the array where they are one, else a copy."""
    count = int(np.count_nonzero(known))
    if not count:
        return values[:0]
    first = int(np.argmax(known))
    if known[first : first + count].all():
        return values[first : first + count]
    result = new_array(count, 1)[:, 0]
    at = 0
    for begin in range(0, len(values), _PART):
        part = values[begin : begin + _PART][known[begin : begin + _PART]]
        result[at : at + len(part)] = part
        at += len(part)
    return result


def _files(path: Path) -> tuple[Path, Path]:
    """Return archive and document of a saved trace, by the name of either or without a suffix."""
    stem = path.with_suffix("") if path.suffix in {".npz", ".json"} else path
    return stem.with_name(stem.name + ".npz"), stem.with_name(stem.name + ".json")


def _group_of(entry: Mapping[str, Any], times: NDArray[np.int64], values: NDArray[np.float64]) -> TraceGroup:
    enums = {
        column: {int(value): text for value, text in texts.items()}
        for column, texts in entry["enums"].items()
    }
    columns = tuple((str(name), str(unit)) for name, unit in entry["columns"])
    return TraceGroup(entry["name"], columns, enums, times, values)


def _row_of(time_ns: int, sender: str, frame: BusFrame, error: str) -> list[object]:
    flags = _flags(frame)
    row: list[object] = [time_ns, sender, frame.can_id, bytes(frame.data).hex(), flags, frame.dlc, error]
    return row if isinstance(frame, CanFrame) else [*row, frame.protocol, frame.asked.hex(), frame.note]


def _entry_of(row: list[Any]) -> tuple[int, str, BusFrame, str]:
    time_ns, sender, can_id, data, flags, dlc, error, *modbus = row
    content = bytes.fromhex(data)
    if modbus:
        from fieldbus.modbus import ModbusFrame

        protocol, asked, note = modbus
        return time_ns, sender, ModbusFrame(protocol, content, bytes.fromhex(asked), note), error
    frame = CanFrame(
        can_id,
        content,
        extended=bool(flags & 1),
        remote=bool(flags & 2),
        dlc=dlc,
        fd=bool(flags & 4),
        brs=bool(flags & 8),
        esi=bool(flags & 16),
    )
    return time_ns, sender, frame, error
