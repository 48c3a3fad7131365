"""A recording on its way to another process: columns as bytes, CAN frames packed, events in pieces.

What a bench is called and has, names, units and numbers, travels only if it has changed: both processes come
from the one in which the carrier was made.
"""

from __future__ import annotations

import pickle
from functools import lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Final, NamedTuple

from fieldbus.can.frame import CanFrame
from fieldbus.history import Event
from hil.record._frames import PackedFrames
from hil.record._trace import Trace, TraceGroup

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from hil.record._frames import BusFrame, FrameLog
    from hil.record._recorder import Recorder
    from hil.record._vocabulary import Vocabulary

_NEVER_ON_DISK: Final = 1 << 62
"""Bytes: a recording that travels is in memory."""


class CarriedGroup(NamedTuple):
    """What a group is called and has."""

    name: str
    columns: tuple[tuple[str, str], ...]
    enums: Mapping[str, Mapping[int, str]]


class CarriedFacts(NamedTuple):
    """What does not change from cycle to cycle."""

    groups: tuple[CarriedGroup, ...]
    constants: dict[str, float]


class CarriedRecording(NamedTuple):
    """A recording that can be pickled quickly."""

    rows: tuple[bytes, ...]
    """Of every group, as of `Group.content`."""
    events: tuple[bytes, ...]
    """Pickled pieces of the log: of each event time in ns, source, kind and details."""
    frames: dict[str, PackedFrames | tuple[tuple[int, str, BusFrame, str], ...]]
    """By bus; those of Modbus are not packed."""
    end_ns: int
    facts: CarriedFacts | None
    """None: those of the carrier."""


class Carrier:
    """Makes a recording ready to travel; frames and events that are packed once are not looked at again.

    Args:
        recorder: Has the recording.
        vocabulary: Names and values that can be in it.

    """

    def __init__(self, recorder: Recorder, vocabulary: Vocabulary | None) -> None:
        self._recorder = recorder
        self._vocabulary = vocabulary
        self._facts = self._present_facts()
        self._packed: dict[str, PackedFrames] = {}
        self._events: list[bytes] = []
        self._event_count = 0

    def _present_facts(self) -> CarriedFacts:
        recorder = self._recorder
        groups = (CarriedGroup(group.name, group.columns, group.enums) for group in recorder.groups)
        return CarriedFacts(tuple(groups), dict(recorder.constants))

    def pack(self) -> None:
        """Pack the CAN frames and events that have come since the last call: what is older is not read again,
        not from a file either.
        """
        events = self._recorder.history.events[self._event_count :]
        if events:
            self._event_count += len(events)
            plain = [(entry.time_ns, entry.source, entry.kind, entry.data) for entry in events]
            self._events.append(pickle.dumps(plain, protocol=pickle.HIGHEST_PROTOCOL))
        for bus in self._recorder.buses:
            log = self._recorder.frames(bus)
            if not log or not isinstance(log[0][2], CanFrame):
                continue
            packed = self._packed.get(bus)
            if packed is None:
                packed = self._packed[bus] = PackedFrames(in_memory=_NEVER_ON_DISK)
            packed.extend(_behind(log, len(packed)))

    def recording(self, end_ns: int) -> CarriedRecording:
        """Return everything recorded so far.

        Args:
            end_ns: Present time of the bench, ns.

        """
        self.pack()
        recorder, facts = self._recorder, self._facts
        same = len(facts.groups) == len(recorder.groups) and facts.constants == recorder.constants
        return CarriedRecording(
            tuple(group.content() for group in recorder.groups),
            tuple(self._events),
            {bus: self._packed.get(bus) or tuple(recorder.frames(bus)) for bus in recorder.buses},
            end_ns,
            None if same else self._present_facts(),
        )

    def trace(self, recording: CarriedRecording) -> Trace:
        """Return the trace of a recording that has come from another process: the one of `Recorder.trace`,
        with the same digest.
        """
        facts = recording.facts or self._facts
        return Trace(
            [
                TraceGroup.from_bytes(*group, content)
                for group, content in zip(facts.groups, recording.rows, strict=True)
            ],
            events=[entry for piece in recording.events for entry in _unpacked(piece)],
            frames=recording.frames,
            constants=facts.constants,
            end_ns=recording.end_ns,
            vocabulary=self._vocabulary,
        )


@lru_cache(maxsize=256)
def _unpacked(piece: bytes) -> tuple[Event, ...]:
    """Return the events of a piece: recordings with a common past have the pieces of it in common."""
    return tuple(Event(*entry) for entry in pickle.loads(piece))  # noqa: S301 - of a process of our own


def _behind(log: FrameLog, first: int) -> Iterator[tuple[int, str, BusFrame, str]]:
    """Return the entries of a log from a number on."""
    return iter(log[first:]) if first else islice(log, None)
