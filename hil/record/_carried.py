"""A recording on its way to another process: columns as bytes, CAN frames packed, events as plain tuples."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

from fieldbus.can.frame import CanFrame
from fieldbus.history import Event
from hil.record._frames import PackedFrames
from hil.record._trace import Trace, TraceGroup

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from fieldbus.history import Scalar
    from hil.record._frames import BusFrame, FrameLog
    from hil.record._recorder import Recorder
    from hil.record._vocabulary import Vocabulary

_NEVER_ON_DISK: Final = 1 << 62
"""Bytes: a recording that travels is in memory."""


CarriedEvent: TypeAlias = "tuple[int, str, str, dict[str, Scalar]]"
"""Time in ns, source, kind and details."""


class CarriedGroup(NamedTuple):
    """The rows of one group."""

    name: str
    columns: tuple[tuple[str, str], ...]
    enums: Mapping[str, Mapping[int, str]]
    content: bytes
    """As of `Group.content`."""


class CarriedRecording(NamedTuple):
    """A recording that can be pickled quickly."""

    groups: tuple[CarriedGroup, ...]
    events: tuple[CarriedEvent, ...]
    frames: dict[str, PackedFrames | tuple[tuple[int, str, BusFrame, str], ...]]
    """By bus; those of Modbus are not packed."""
    constants: dict[str, float]
    end_ns: int
    vocabulary: Vocabulary | None

    def trace(self) -> Trace:
        """Return the trace: the one of `Recorder.trace`, with the same digest."""
        return Trace(
            [TraceGroup.from_bytes(*group) for group in self.groups],
            events=tuple(Event(*entry) for entry in self.events),
            frames=self.frames,
            constants=self.constants,
            end_ns=self.end_ns,
            vocabulary=self.vocabulary,
        )


class Carrier:
    """Makes a recording ready to travel; frames that have been packed once are not looked at again.

    Args:
        recorder: Has the recording.

    """

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._packed: dict[str, PackedFrames] = {}
        self._events: list[CarriedEvent] = []

    def pack(self) -> None:
        """Pack the CAN frames and events that have come since the last call: what is older is not read again,
        not from a file either.
        """
        for entry in self._recorder.history.events[len(self._events) :]:
            self._events.append((entry.time_ns, entry.source, entry.kind, entry.data))
        for bus in self._recorder.buses:
            log = self._recorder.frames(bus)
            if not log or not isinstance(log[0][2], CanFrame):
                continue
            packed = self._packed.get(bus)
            if packed is None:
                packed = self._packed[bus] = PackedFrames(in_memory=_NEVER_ON_DISK)
            packed.extend(_behind(log, len(packed)))

    def recording(self, end_ns: int, vocabulary: Vocabulary | None) -> CarriedRecording:
        """Return everything recorded so far.

        Args:
            end_ns: Present time of the bench, ns.
            vocabulary: Names and values that can be in it.

        """
        self.pack()
        recorder = self._recorder
        return CarriedRecording(
            tuple(
                CarriedGroup(group.name, group.columns, group.enums, group.content())
                for group in recorder.groups
            ),
            tuple(self._events),
            {bus: self._packed.get(bus) or tuple(recorder.frames(bus)) for bus in recorder.buses},
            recorder.constants,
            end_ns,
            vocabulary,
        )


def _behind(log: FrameLog, first: int) -> Iterator[tuple[int, str, BusFrame, str]]:
    """Return the entries of a log from a number on."""
    return iter(log[first:]) if first else islice(log, None)
