"""What rules of a bus look at: the frames of one CAN bus by identifier, and what they say of its nodes."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from hil.expect.rules._definition import Excuses, Numbers
from hil.expect.rules._frames import Frames
from hil.expect.rules._views import TraceView

NODES: Final = range(1, 128)
START, STOP, PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 1, 2, 128, 129, 130
OPERATIONAL, STOPPED, PREPARED, STARTING = 5, 4, 127, 0
_LONGEST_BITS: Final = 160
"""Of a frame with eight bytes, 29 bits of identifier and stuff bits."""
_SLOWEST: Final = 125_000
"""Bit rate where the trace does not tell it, bit/s."""
_ACTS_S: Final = 1.5e-3
"""Time of an emulated node to act on a frame, and frames that wait in front of its own."""
_ACTS_REALLY_S: Final = 0.1
"""The same of any device: CiA 301 gives no time, and many handle NMT commands beside their control."""


class Sent(NamedTuple):
    """A frame: when it ended, and what it carried."""

    time_s: float
    data: bytes


class State(NamedTuple):
    """An NMT state that a node has been told to take."""

    begin_s: float
    state: int
    commanded: bool
    """By an NMT command; else it has told so itself by its boot-up."""


class Setting(NamedTuple):
    """A value that a node was given by SDO: from when to when it holds."""

    begin_s: float
    end_s: float
    value: int


class BusView:
    """A CAN bus.

    Args:
        whole: The trace.
        name: Of the bus.

    """

    def __init__(self, whole: TraceView, name: str) -> None:
        self.whole = whole
        self.name = name
        self._of: dict[int, list[Sent]] = {}
        self._states: dict[int, list[State]] = {}
        self._settings: dict[int, dict[bytes, list[Setting]]] = {}

    @cached_property
    def bitrate(self) -> float | None:
        """Bit rate, bit/s; None: the trace does not tell it."""
        return self.whole.numbers.get(f"{self.name}.bitrate")

    @cached_property
    def frame_s(self) -> float:
        """Duration of the longest frame, s."""
        return _LONGEST_BITS / (self.bitrate or _SLOWEST)

    @cached_property
    def settle_s(self) -> float:
        """Within so long a node has followed a command, s."""
        return (_ACTS_REALLY_S if self.real else _ACTS_S) + 6 * self.frame_s

    @cached_property
    def real(self) -> bool:
        """Whether somebody else's devices may be on it: in a log, and on a live bench."""
        return self.whole.trace.from_log or bool(self.whole.numbers.get("bench.live"))

    @cached_property
    def excuses(self) -> Excuses:
        """All faults of the trace."""
        return self.whole.excuses((*self.whole.axes, *self.whole.drives))

    def sent(self, can_id: int) -> list[Sent]:
        """Return the data frames of an identifier."""
        found = self._of.get(can_id)
        if found is None:
            made = tuple.__new__  # half of what `Sent` itself takes
            found = self._of[can_id] = [made(Sent, one) for one in self.frames(can_id).each()]
        return found

    def frames(self, can_id: int) -> Frames:
        """Return the data frames of an identifier as columns: those of process data are many."""
        return self.whole.frames.of(self.name, can_id)

    @cached_property
    def end_s(self) -> float:
        """End of the trace, s."""
        return self.whole.trace.end_ns * 1e-9

    @cached_property
    def _ends(self) -> Numbers:
        """When the data frames of the bus have ended, s."""
        frames = self.whole.frames
        parts = [frames.of(self.name, one).time_s for one in frames.identifiers(self.name)]
        return np.sort(np.concatenate(parts)) if parts else np.empty(0)

    def busy(self, begin_s: float, end_s: float) -> bool:
        """Return whether one frame has followed the other from one time to another: what was to be sent then
        may have waited for all of them.
        """
        ends = self._ends
        within = ends[np.searchsorted(ends, begin_s) : np.searchsorted(ends, end_s + 1e-9)]
        gaps = np.diff(within, prepend=begin_s)
        return len(within) > 0 and bool((gaps <= 1.2 * self.frame_s).all())

    def asked(self, can_id: int) -> list[float]:
        """Return when remote frames of an identifier have ended, s."""
        return self.whole.frames.remotes(self.name, can_id)

    @cached_property
    def nodes(self) -> list[int]:
        """Nodes of the bench file, those that have announced themselves by a boot-up, and in a log those that
        answer to SDOs.
        """
        known = self.whole.frames.identifiers(self.name)
        tail = f".node.{self.name}"
        found = {int(value) for key, value in self.whole.numbers.items() if key.endswith(tail)}
        if self.whole.trace.from_log:
            found.update(can_id - 0x580 for can_id in known)
        for can_id in known:
            if can_id > 0x700 and any(one.data == b"\0" for one in self.sent(can_id)):
                found.add(can_id - 0x700)
        return [node for node in NODES if node in found]

    def alone(self, node: int, can_id: int) -> bool:
        """Return whether an identifier is that of a node alone: nobody else has sent with it."""
        frames = self.whole.frames
        owners = frames.senders(self.name, 0x700 + node) or frames.senders(self.name, 0x580 + node)
        return len(owners) == 1 and frames.senders(self.name, can_id) <= owners

    def states(self, node: int) -> list[State]:
        """Return the states of a node as commands and boot-ups have it, by time."""
        found = self._states.get(node)
        if found is None:
            found = self._states[node] = self._find_states(node)
        return found

    def settings(self, node: int, index: int, sub: int) -> list[Setting]:
        """Return what expedited downloads have written to an object and the node has taken, each until the
        next one, or until the node restarts.
        """
        found = self._settings.get(node)
        if found is None:
            found = self._settings[node] = self._find_settings(node)
        return found.get(index.to_bytes(2, "little") + bytes((sub,)), [])

    def _find_settings(self, node: int) -> dict[bytes, list[Setting]]:
        """Return what was written to every object, by index and sub-index as they are on the bus."""
        answers = self.sent(0x580 + node)
        starts = [one.begin_s for one in self.states(node) if one.state == STARTING or not one.commanded]
        written: dict[bytes, list[Setting]] = {}
        for when, data in self.sent(0x600 + node):
            if len(data) != 8 or data[0] >> 5 != 1 or not data[0] & 2:
                continue
            mux = data[1:4]
            at = bisect_right(answers, when, key=lambda one: one.time_s)
            if at == len(answers) or answers[at].data[:1] != b"\x60" or answers[at].data[1:4] != mux:
                continue
            taken_s = answers[at].time_s
            over = bisect_left(starts, taken_s)
            end_s = starts[over] if over < len(starts) else self.end_s
            size = 4 - (data[0] >> 2 & 3) if data[0] & 1 else 4
            found = written.setdefault(mux, [])
            if found and found[-1].end_s > when:
                found[-1] = found[-1]._replace(end_s=when)
            found.append(Setting(taken_s, end_s, int.from_bytes(data[4 : 4 + size], "little")))
        return written

    def _find_states(self, node: int) -> list[State]:
        found = []
        for when, data in self.sent(0):
            if len(data) == 2 and data[1] in (0, node):
                state = {START: OPERATIONAL, STOP: STOPPED, PRE_OPERATIONAL: PREPARED}.get(data[0])
                if state is None and data[0] in (RESET_NODE, RESET_COMMUNICATION):
                    state = STARTING
                if state is not None:
                    found.append(State(when, state, commanded=True))
        orders = [(one.begin_s, one.state) for one in sorted(found)]
        answers = [one.time_s for one in self.sent(0x580 + node)]
        for when, data in self.sent(0x700 + node):
            if data != b"\0":
                continue
            at = bisect_right(orders, (when, STARTING)) - 1
            told_s, state = orders[at] if at >= 0 else (-1.0, PREPARED)
            # A boot-up that has waited for the bus is no restart of a node that has answered since.
            late = state != STARTING and (when - told_s < self.settle_s or self._just(answers, when))
            if not late:
                found.append(State(when, PREPARED, commanded=False))
        return sorted(found)

    def _just(self, times: list[float], when: float) -> bool:
        """Return whether one of some times is just before another."""
        at = bisect_right(times, when) - 1
        return at >= 0 and when - times[at] < self.settle_s

    def state_at(self, states: list[State], time_s: float) -> State | None:
        """Return the state that a node has at a time for sure; None: it has just been told another, or
        nothing is known.
        """
        at = bisect_right(states, time_s, key=lambda one: one.begin_s) - 1
        if at < 0 or time_s - states[at].begin_s < self.settle_s:
            return None
        return states[at]


def between(frames: list[Sent], begin_s: float, end_s: float) -> list[Sent]:
    """Return the frames behind one time and before another."""
    first = bisect_right(frames, begin_s, key=lambda one: one.time_s)
    return frames[first : bisect_left(frames, end_s, key=lambda one: one.time_s)]
